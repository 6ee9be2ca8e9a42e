"""The inf-sup constant: of pairs whose constant is known, and of the family's own blocks, cut and not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver
from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.families import family, levels_in
from verification.families.inf_sup import (
    SIDES,
    WHOLE,
    ZERO,
    Pressed,
    Skin,
    block_of,
    case_of,
    constants,
    exact_pressure,
    over_best,
    pressed,
    uncut,
)
from verification.measures.inf_sup import constant, norm
from verification.meshes import stacks
from verification.meshes.blocks import with_master

FAMILY = family("inf-sup")


def named(name):
    return next(case for case in FAMILY.cases if case.name == name)


def test_the_norm_is_that_of_h1():
    mesh = stacks.block("HEXA20", (2, 2, 2), skew=0.1)
    A = norm(mesh)
    assert np.ones(mesh.n_nodes) @ A @ np.ones(mesh.n_nodes) == pytest.approx(1, rel=1e-12)
    x = mesh.points[:, 0]
    assert x @ A @ x == pytest.approx(1 + 1 / 3, rel=1e-12)


def test_the_constant_of_a_bubble_over_a_segment():
    """One TRIA6 on the side (0, 1), the node in the middle of it alone free: v = 4 x (1 - x - y), int v = 2 / 3."""
    triangle = lacmesh.raise_order(Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]])]), "2")
    nodes = triangle.blocks[0].nodes
    slave = [("TRIA6", nodes), ("SEG3", nodes[:, [0, 1, 3]])]
    mesh = Mesh.create(triangle.points, slave, space_dim=2, cell_groups={"slave": [1]})
    made = lacsolver.contact_matrices(with_master(mesh, "SEG2", np.array([[2.0, 0.0], [-1.0, 0.0]])), "slave", "master")
    x, y = (lacmesh.reference.quadrature.rule("TRIA", 6)[0].T[k] for k in (0, 1))
    w = lacmesh.reference.quadrature.rule("TRIA", 6)[1]
    square = w @ ((4 * x * (1 - x - y)) ** 2 + 16 * ((1 - 2 * x - y) ** 2 + x**2))
    moving = np.abs(made.mesh.points - [0.5, 0, 0]).max(axis=1) < 1e-9
    assert constant(made, moving) == pytest.approx(2 / 3 / np.sqrt(square), rel=1e-12)


@pytest.mark.parametrize("kind", ZERO)
def test_a_checkerboard_on_an_uncut_skin_moves_nothing(kind):
    dim = CELLS[kind.split()[0]].dim
    found = constants(Skin(kind, dim), SIDES[dim][0])
    assert found.uncut < 1e-6
    assert found.cut > 0.1
    assert found.internal * (1 - 1e-9) < found.cut <= found.cut_free


def test_every_type_has_a_case_and_all_are_of_one_kind():
    kinds = {case.parameters["kind"] for case in FAMILY.cases}
    assert set(stacks.PLANE_KINDS) | set(stacks.SOLID_KINDS) == kinds
    assert not set(WHOLE) & set(ZERO)
    assert len({case.name for case in FAMILY.cases}) == len(FAMILY.cases)


@pytest.mark.parametrize("name", ["QUAD4", "HEXA8", "QUAD9", "TRIA3-on-QUAD4"])
def test_a_case_comes_out(name):
    outcome = named(name).solve(levels=3)
    assert all(result.passed for result in outcome.results)
    (plot,) = outcome.plots
    assert plot.kind == "inf-sup"
    assert {line.label.split(",")[0] for line in plot.lines} == ({"cut"} if name in WHOLE else {"cut", "uncut"})


def test_two_levels_judge_no_exponent():
    results = named("HEXA8").solve(levels=2).results
    assert [r.bound for r in results if "exponent" in r.quantity] == ["informative"]
    assert all(r.passed for r in results)


@pytest.mark.parametrize("name", ["TRIA3", "HEXA8", "TETRA4"])
def test_a_skin_that_is_not_cut_falls_short(name, monkeypatch):
    """Uncut faces in the place of the cut skin: no internal dof, and beta is zero."""
    monkeypatch.setattr("lacsolver.contact_matrices", _without_cut(lacsolver.contact_matrices))
    results = named(name).solve(levels=3).results
    assert not all(r.passed for r in results if r.quantity.startswith("least beta, cut"))


def _without_cut(made):
    return lambda mesh, slave, master, hexa="": made(mesh if mesh.zones else uncut(mesh, slave), slave, master)


def test_pressures_oscillate_on_the_uncut_skin_only():
    outcome = named("pressed-TRIA3").solve(levels=2)
    assert all(result.passed for result in outcome.results)
    (plot,) = outcome.plots
    exact, without, cut = plot.lines
    assert exact.label == "exact"
    assert np.abs(np.diff(without.y)).sum() > 2 * np.abs(np.diff(cut.y)).sum()
    assert np.all(np.diff(cut.x) >= 0)
    assert (cut.x[0], cut.x[-1]) == pytest.approx((0, 1))


def test_the_exact_pressure_is_what_pressures_converge_to():
    """Nodes where they are: the mean of p_m is exact, and its error falls with h^2 against the means."""
    errors = []
    for n in (8, 16):
        got = pressed(Pressed("QUAD4", 2, jitter=0.0), n)
        made = lacsolver.contact_matrices(got.mesh, "y0", "master")
        errors.append(np.abs(got.state.zones[0].pressure - exact_pressure(made.centre)[:, 0]).max())
        assert over_best(got) < 1.1
    assert errors[1] < 0.3 * errors[0] < 0.002


def test_all_sides_of_a_jittered_block_stay_flat():
    given = Pressed("TETRA4", 3)
    mesh = block_of(given, 3)
    still = block_of(replace(given, jitter=0.0), 3)
    moved = np.abs(mesh.points - still.points)
    assert moved.max() > 0.01
    assert moved[np.abs(still.points - 0.5) > 0.5 - 1e-9].max() == 0
    assert 'group = "rim"\nuz' in case_of(given)


def test_quick_has_some_cases_and_full_all():
    assert 5 <= sum(levels_in(case, "quick") > 0 for case in FAMILY.cases) <= 8
    assert all(levels_in(case, "full") >= 3 for case in FAMILY.cases)
