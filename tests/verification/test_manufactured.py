"""The manufactured rows: what they say, that they converge, that a case of theirs is one that a user could run."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver
from verification.families import levels_in, manufactured
from verification.families.manufactured import FAMILY, LAW, ROWS, WANTED, case_of, mesh_of, solution

CASES = {case.name: case for case in FAMILY.cases}


@pytest.mark.shared
def test_rows_are_those_of_the_reference(shared):
    listed = json.loads((shared / "reference" / "cases.json").read_text())["cases"]
    asked = {case["id"]: case for case in listed if case["kind"] == "manufactured_rates"}
    rows = {row.test: row for row in ROWS.values() if row.test}
    assert set(asked) == set(rows)
    for name, case in asked.items():
        row, theirs = rows[name], case["code_aster"]
        assert (row.cell, row.levels, row.solution.model) == (case["cell"], case["levels"], case["model"])
        assert (row.displacement_rate, row.pressure_rate) == tuple(
            theirs[f"rate_L2_{what}"] for what in ("displacement", "pressure")
        )
        assert case["hexa"] == row.hexa
        assert case["material"] == {"young": LAW.young, "poisson": LAW.poisson}
        points = dict(zip("xyz", np.random.default_rng(0).random((3, 9)), strict=True))
        for own, given in zip(row.solution.displacement, case["displacement"], strict=True):
            np.testing.assert_allclose(eval(own, {}, points), eval(given, {}, points), rtol=1e-14)


def test_a_row_has_the_rates_asked_for():
    outcome = CASES["QUAD4"].solve(levels=3)
    assert all(result.passed for result in outcome.results)
    held = [result for result in outcome.results if result.bound == "at least"]
    assert tuple(result.expected for result in held) == WANTED[1]
    assert [len(result.levels) for result in held] == [3] * 3
    assert held[0].published[0].value == ROWS["QUAD4"].displacement_rate
    assert {plot.kind for plot in outcome.plots} >= {"Newton"}


def test_a_rate_that_falls_short_does_not_pass(monkeypatch):
    """Errors of u that fall by a half and a little."""
    slow = iter([0.1, 0.04, 0.02])

    def solved(row, level):
        one = solution(row, 0)
        return replace(one, h=0.5**level, errors={**one.errors, "displacement": next(slow)})

    monkeypatch.setattr(manufactured, "solution", solved)
    results = CASES["QUAD4"].solve(levels=3).results
    assert not results[0].passed
    assert results[0].value == pytest.approx(np.log2(5) / 2)


def test_the_plots_of_a_plane_row_show_the_pressure_and_the_residuals():
    outcome = CASES["QUAD8"].solve(levels=1)
    pressure, newton = outcome.plots
    exact, means, recovered = pressure.lines
    assert (pressure.kind, newton.kind, newton.log_y) == ("pressure", "Newton", True)
    assert (means.x[0], means.x[-1]) == (0, 1)
    for told in (means, recovered):
        off = np.interp(told.x, exact.x, exact.y) - told.y
        assert np.linalg.norm(off) < 0.25 * np.linalg.norm(told.y)
    (history,) = newton.lines
    assert history.y[-1] < 1e-10 < history.y[0]
    assert len(outcome.pictures) == 1


def test_the_rim_is_left_out_of_what_is_away_from_it():
    """One macro-element in four at each end of QUAD8, whose faces are whole."""
    mesh = lacmesh.cut_skin(mesh_of(ROWS["QUAD8"], 0), ["y0"]).mesh
    faces = manufactured._away(ROWS["QUAD8"], mesh)
    (found,) = mesh.select(faces)
    assert sorted(mesh.points[found[2]].mean(axis=1)[:, 0]) == [0.375, 0.625]


def test_the_error_is_that_of_the_state_at_the_end(tmp_path):
    """A row run as a file by `lacsolver run`'s own functions has the same unknowns and is in balance at t = 1."""
    row = ROWS["TRIA3"]
    lacmesh.write(tmp_path / "mesh.msh", mesh_of(row, 0))
    (tmp_path / "case.toml").write_text(case_of(row), encoding="utf-8")
    results = lacsolver.run(tmp_path / "case.toml", tmp_path / "out")
    assert results.sizes["unknowns"] == solution(row, 0).solved.unknowns
    assert results.steps[-1].time == 1.0
    assert max(results.steps[-1].balance) < 1e-12


def test_the_case_says_what_it_is():
    case = lacsolver.parse_case(case_of(ROWS["HEXA8-hexa"]))
    assert (case.kinematics, case.model) == ("finite", "3d")
    (contact,) = case.contact
    assert (contact.measure, contact.geometry, contact.hexa) == ("reference", "current", "hexa")
    assert {load.group for load in case.traction} == {"z0", "x0", "x1", "y0", "y1"}


def test_suites_have_the_levels_asked_for():
    full = {name: levels_in(case, "full") for name, case in CASES.items()}
    plane = {name for name, row in ROWS.items() if row.solution.dim == 2}
    assert all(found == (5 if name in plane else 4) for name, found in full.items())
    assert all(levels_in(case, "all") >= (6 if name in plane else 4) for name, case in CASES.items())
