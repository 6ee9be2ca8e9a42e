"""The problems of the balance: two that are solved, and that a problem without contact is found out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from verification.families import balance
from verification.families.balance import FAMILY, Touch, mesh_of
from verification.measures.balance import Balance, unbalanced

CASES = {case.name: case for case in FAMILY.cases}


def results(given):
    outcome = balance.run(given, levels=1)
    return {result.quantity.split(",")[0]: result for result in outcome.results}


@pytest.mark.filterwarnings("ignore:contact .* its curvature changes within few faces")
@pytest.mark.parametrize("name", ["waves-smoothed-2d", "overhang-3d", "rigid-small-2d", "tie-gap-3d"])
def test_forces_and_moments_are_in_balance(name):
    given = CASES[name].solve.args[0]
    found = results(replace(given, pairs=given.pairs[:1]))
    assert len(found) == 3 and all(result.passed for result in found.values())


def test_bodies_that_do_not_meet_are_no_proof(monkeypatch):
    monkeypatch.setattr(balance, "_DOWN", 0.1)
    found = results(Touch((("QUAD4", "TRIA3"),), "plane_strain", "waves"))
    assert found["balance of forces"].value == 0 and not found["macro-elements in contact"].passed


def test_forces_that_are_not_opposite_are_seen(monkeypatch):
    solve = balance.solve

    def off(text, mesh):
        solved = solve(text, mesh)
        force = solved.state.zones[0].force
        force[np.abs(force).max(axis=1).argmax()] *= 1 + 1e-9
        return solved

    monkeypatch.setattr(balance, "solve", off)
    found = results(Touch((("QUAD4", "TRIA3"),), "plane_strain", "waves"))
    assert not found["balance of forces"].passed and not found["balance of moments"].passed


def test_shapes_are_what_they_are_called():
    def ends(shape, group):
        mesh = mesh_of(Touch((), "3d", shape), "HEXA8", "TETRA4")
        nodes = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups[group])]))
        return mesh.points[nodes]

    assert np.ptp(ends("overhang", "slave")[:, 0]) > 1.5 * np.ptp(ends("overhang", "master")[:, 0])
    assert np.ptp(ends("tucked", "slave")[:, 0]) < 0.75 * np.ptp(ends("tucked", "master")[:, 0])
    assert np.ptp(ends("waves", "slave")[:, 2]) > 0.1
    mesh = mesh_of(Touch((), "3d", "saddle"), "HEXA8", "HEXA8")
    a, b, c, d = np.moveaxis(mesh.points[mesh.block("QUAD4")[mesh.cell_groups["slave"] - mesh.offsets[1]]], 1, 0)
    assert (np.abs(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)) > 1e-5).all()


def test_radial_forces_about_an_axis_balance_each_other():
    x = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    assert unbalanced(x, np.array([[1.0, 0.0], [2.0, 0.0]]), axisymmetric=True) == Balance(0.0, 0.0)
