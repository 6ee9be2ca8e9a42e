"""Curved skins on linear cells: cases on coarse meshes, and what they are judged by."""

from __future__ import annotations

import numpy as np
import pytest

import lacmesh
from verification.families import curved
from verification.families.curved import FAMILY, solution
from verification.families.curved_lug import _reached
from verification.meshes.rings import octant

CASES = {case.name: case for case in FAMILY.cases}


@pytest.mark.parametrize("name", ["cylinders-TRIA3-within", "spheres-QUAD4-around", "octants-HEXA8-around"])
def test_smooth_surfaces_are_as_good_as_the_true_gap_and_faces_are_not(name):
    faces, smooth, true = (solution(CASES[name].solve.args[0], 1, gap) for gap in curved.GAPS)
    assert smooth.errors["p_m"] < 1.05 * true.errors["p_m"]
    assert faces.errors["p_m"] > 20 * smooth.errors["p_m"]
    assert (smooth.solved.zone.pressure > 0).all()


def test_a_problem_is_judged_and_flat_faces_fall_short(monkeypatch):
    """Without heights the figures that are asked for are missed."""
    case = CASES["cylinders-QUAD4-within"]
    assert all(r.passed for r in case.solve(levels=2).results)
    monkeypatch.setattr("lacmesh.smooth.surfaces.height_of", lambda *_: None)
    missed = [r.quantity for r in case.solve(levels=2).results if not r.passed]
    assert "p_m in L2 over that with the true gap, worst mesh" in missed
    assert "p_m in L2, second mesh" in missed


def test_the_pin_has_its_force_and_its_angle():
    smooth = solution(CASES["pin-QUAD4-within"].solve.args[0], 1, "smooth")
    assert abs(smooth.errors["force"]) < 0.006 and abs(smooth.errors["angle of contact"]) < 0.02
    assert smooth.errors["p_m"] < 0.035


@pytest.mark.parametrize("name", ["hertz-2d-QUAD4", "socket-3d-TETRA4"])
def test_hertz_on_curved_skins_is_hertz_on_flat_ones_with_a_clearance(name):
    smooth, true = (solution(CASES[name].solve.args[0], 0, gap) for gap in ("smooth", "true"))
    assert smooth.errors["p_m"] == pytest.approx(true.errors["p_m"], rel=1e-3)


def test_octants_with_jitter_stay_octants():
    mesh = octant("HEXA8", (2, 3), (1.0, 2.0), jitter=0.15, seed=1)
    even = octant("HEXA8", (2, 3), (1.0, 2.0))
    np.testing.assert_allclose(np.linalg.norm(mesh.points, axis=1), np.linalg.norm(even.points, axis=1), rtol=1e-14)
    assert np.linalg.norm(mesh.points - even.points, axis=1).max() > 0.02
    assert not mesh.points[even.points == 0].any()
    assert not lacmesh.check(lacmesh.cut_skin(mesh, "high")).errors


def test_how_far_a_cylinder_is():
    x, n = np.array([[0.0, 3.0, -11.0]]), np.array([[0.0, 0.0, -1.0]])
    np.testing.assert_allclose([_reached(x, n, 12.0)[0], _reached(x, -n, 12.0)[0]], [1.0, -1.0])
