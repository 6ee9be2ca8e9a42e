"""The manufactured rows: what they say, that they converge, that their cases can be written and run again."""

from __future__ import annotations

import json

import numpy as np
import pytest

import lacmesh
import lacsolver
from verification.manufactured import Rates, case_text, main, mesh_of, rates, solve, write_case
from verification.manufactured_rows import LAW, ROWS

#: two further levels than these are asked for
COARSEST = {"ssnp150c": 1, "ssnv219e": 1}


@pytest.mark.shared
def test_rows_are_those_of_the_reference(shared):
    listed = json.loads((shared / "reference" / "cases.json").read_text())["cases"]
    asked = {case["id"]: case for case in listed if case["kind"] == "manufactured_rates"}
    assert set(asked) <= set(ROWS)
    for name, case in asked.items():
        row, theirs = ROWS[name], case["code_aster"]
        assert (row.cell, row.levels, row.solution.model) == (case["cell"], case["levels"], case["model"])
        assert (row.displacement_rate, row.pressure_rate) == tuple(
            theirs[f"rate_L2_{what}"] for what in ("displacement", "pressure")
        )
        assert case["hexa"] in (None, row.hexa)
        assert case["material"] == {"young": LAW.young, "poisson": LAW.poisson}
        points = dict(zip("xyz", np.random.default_rng(0).random((3, 9)), strict=True))
        for own, given in zip(row.solution.displacement, case["displacement"], strict=True):
            np.testing.assert_allclose(eval(own, {}, points), eval(given, {}, points), rtol=1e-14)


@pytest.mark.parametrize("name", ["ssnp150c", pytest.param("ssnv219e", marks=pytest.mark.slow)])
def test_a_row_converges(name):
    row = ROWS[name]
    made = rates(row, range(COARSEST[name], COARSEST[name] + 3))
    assert made.displacement >= row.wanted
    assert made.pressure >= 0.95
    assert all(made.pairwise("error_u") > row.wanted / 2)
    assert all(level.halvings == 0 for level in made.levels)


def test_the_error_is_that_of_the_state_at_the_end(tmp_path):
    """The same row as a file, through `lacsolver run`'s own functions: same unknowns, same pressure resultant."""
    row = ROWS["ssnp150c"]
    case = lacsolver.read_case(write_case(row, 0, tmp_path))
    results = lacsolver.run(case, lacsolver.create(tmp_path / "out"))
    assert results.sizes["unknowns"] == solve(row, 0).unknowns
    assert results.steps[-1].time == 1.0
    assert max(results.steps[-1].balance) < 1e-12


def test_the_case_says_what_it_is():
    case = lacsolver.parse_case(case_text(ROWS["ssnv219j"]))
    assert (case.kinematics, case.model) == ("finite", "3d")
    (contact,) = case.contact
    assert (contact.measure, contact.geometry, contact.hexa) == ("reference", "current", "pyramid")
    assert {load.group for load in case.traction} == {"z0", "x0", "x1", "y0", "y1"}


def test_the_command_prints_a_table_and_says_if_a_rate_falls_short(capsys, monkeypatch):
    assert main(["ssnp150e", "--levels", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "ssnp150e: QUAD4"
    assert lines[1].split()[:3] == ["level", "h", "unknowns"]
    assert lines[-1].split() == ["code_aster", "2.002", "1.013"]
    monkeypatch.setattr(Rates, "displacement", 1.9)
    assert main(["ssnp150e", "--levels", "2"]) == 1


def test_the_command_writes_a_case_and_its_mesh(tmp_path, capsys):
    assert main(["ssnv219g", "--levels", "2", "--write", str(tmp_path)]) == 0
    written = capsys.readouterr().out.strip()
    case = lacsolver.read_case(written)
    assert case.contact[0].hexa == "hexa"
    assert lacmesh.read(case.mesh).cells_by_type == mesh_of(ROWS["ssnv219g"], 1).cells_by_type
