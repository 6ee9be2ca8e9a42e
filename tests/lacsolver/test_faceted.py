"""A run warns where its pressures are those of flat faces, and only there."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import pytest

import lacmesh
import lacsolver
from lacsolver.output import create_output
from lacsolver.results.faceted import faceted
from lacsolver.running import run
from verification.families.press_fit import PressFit, case_of, mesh_of
from verification.meshes.rings import pair, ring
from verification.solving import solve

DATA = Path(__file__).parents[2] / "data"
PRESS_FIT = (DATA / "press_fit.toml").read_text()
FACES = PRESS_FIT.replace('master = "master"', 'master = "master"\nsurface = "faces"')


def told(text, mesh):
    solved = solve(text, mesh)
    return list(faceted(solved.problem, solved.state))


def test_a_press_fit_of_flat_faces_is_told(tmp_path):
    """The estimated error of flat faces is as large as the pressure, far from 63.46, and the warning names a remedy."""
    mesh = lacmesh.read(DATA / "press_fit.msh")
    (message,) = told(FACES, mesh)
    assert "pressures of contact 'fit' differ by" in message and 'take surface = "smooth"' in message
    with pytest.warns(lacmesh.LacmeshWarning, match="E h / 8R"):
        results = run(lacsolver.parse_case(FACES), create_output(tmp_path / "out"), mesh=mesh)
    assert message in results.message


def test_cylinders_are_not_faces():
    assert told(PRESS_FIT, lacmesh.read(DATA / "press_fit.msh")) == []


def test_flat_skins_are_what_they_are():
    text = (DATA / "two_blocks.toml").read_text()
    assert told(text, lacmesh.read(DATA / "two_blocks.msh")) == []


@pytest.mark.parametrize("count, said", [(3, True), (24, False)])
def test_a_skin_of_free_form_that_is_too_coarse(count, said):
    """Two ellipses, hardly pressed: twelve faces to a turn are too few for a fit, and a hundred are not."""
    given = PressFit("TRIA3", "plane_strain", "facet", pressure=2.0)
    bodies = (ring("TRIA3", (2, n), radii) for n, radii in ((count, (20, 30)), (count + 1, (30, 40))))
    mesh = pair(*bodies)
    mesh = replace(mesh, points=mesh.points * [1.3, 1.0, 1.0])
    with warnings.catch_warnings(record=True) as before:
        warnings.simplefilter("always")
        assert bool(told(case_of(given), mesh)) == said
    assert any("its curvature changes within few faces" in str(one.message) for one in before) == said


def test_quadratic_cells_have_their_curve():
    given = PressFit("TRIA6", "plane_strain", "facet")
    assert told(case_of(given), mesh_of(given, 0)) == []


def test_a_contact_without_pressure_says_nothing():
    assert told(FACES.replace("clearance = -0.02", "clearance = 0.2"), lacmesh.read(DATA / "press_fit.msh")) == []
