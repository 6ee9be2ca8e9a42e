"""Fits whose bodies are moved by motions that change nothing, and straight quadratic cells, against exact solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import raise_order
from lacmesh.cells import CELLS
from verification.families.curved_fits import _PLANE
from verification.families.moved_fits import INTERFERENCE, MovedFit
from verification.families.press_fit import case_of, mesh_of
from verification.meshes.blocks import nodes_of
from verification.solving import solve

COARSE = ((2, 5, 2), (2, 4, 2))
FITS = [
    MovedFit("TRIA3"),
    MovedFit("TETRA4", counts=COARSE),
    MovedFit("TETRA4", counts=COARSE, normals="smoothed"),
    MovedFit("TETRA4", counts=COARSE, slave="around"),
    MovedFit("HEXA8", counts=COARSE, slope=0.3),
    MovedFit("TETRA4", counts=((2, 9, 3), (2, 8, 2)), oval=0.7),
]


@pytest.mark.parametrize("given", FITS, ids=str)
def test_a_motion_that_changes_nothing_changes_no_pressure(given):
    """A cylinder slides on itself; a cone that is pressed by s has the pressures of an interference s sin(a)."""
    mesh = given.mesh()
    still = solve(given.case(-INTERFERENCE), mesh)
    p, force = still.zone.pressure, still.zone.force[nodes_of(still.mesh, "slave")].sum(axis=0)
    for clearance, motion in given.motions().values():
        moved = solve(given.case(clearance, motion), mesh)
        np.testing.assert_allclose(moved.zone.pressure, p, atol=given.allowed * p.mean())
        there = moved.zone.force[nodes_of(moved.mesh, "slave")].sum(axis=0)
        np.testing.assert_allclose(there, force, atol=0.2 * given.allowed * np.abs(force).max())
        assert max(moved.balance.force, moved.balance.moment) < 1e-12


@pytest.mark.parametrize("cell", ["TRIA3", "QUAD4"])
@pytest.mark.parametrize("slave", ["within", "around"])
def test_quadratic_cells_whose_mid_nodes_are_on_chords(cell, slave):
    """Their faces are flat, and the gap is that between the circles that their corners lie on."""
    given = replace(_PLANE, cell=cell, slave=slave)
    pressure = solve(case_of(given), with_mid_nodes_on_chords(mesh_of(given, 1))).zone.pressure
    np.testing.assert_allclose(pressure, given.exact.between, rtol=0.03)


def with_mid_nodes_on_chords(mesh):
    """Return the mesh with quadratic cells, whose mid-nodes are at the middle of straight edges."""
    raised = raise_order(mesh)
    points = raised.points.copy()
    for block in raised.blocks:
        cell = CELLS[block.type]
        for k, (a, b) in enumerate(cell.edges or [(0, 1)]):
            ends = mesh.points[block.nodes[:, [a, b]]]
            points[block.nodes[:, cell.n_corners + k]] = ends.mean(axis=1)
    return replace(raised, points=points)
