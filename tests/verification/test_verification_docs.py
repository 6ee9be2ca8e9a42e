"""docs/verification.md is what its results say, and these are of the cases that there are."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture
def made():
    spec = importlib.util.spec_from_file_location("make_verification", DOCS / "make_verification.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_current(made):
    assert made.out_of_date() == []


def test_the_page_is_current_without_the_meshes_of_others(made, monkeypatch):
    monkeypatch.setattr("verification.families.friction_published.there", lambda name: False)
    assert made.out_of_date() == []


def test_another_figure_makes_it_out_of_date(made, tmp_path, monkeypatch):
    told = json.loads((made.KEPT / "report.json").read_text(encoding="utf-8"))
    row = next(row for row in told["results"] if row["bound"] == "at most")
    row["passed"], row["value"] = False, 2.0 + abs(row["expected"])
    (tmp_path / "report.json").write_text(json.dumps(told), encoding="utf-8")
    monkeypatch.setattr(made, "KEPT", tmp_path)
    assert any("make it again" in line for line in made.out_of_date())


def test_a_case_that_was_not_run_makes_it_out_of_date(made, tmp_path, monkeypatch):
    told = json.loads((made.KEPT / "report.json").read_text(encoding="utf-8"))
    name = told["results"][0]["family"], told["results"][0]["case"]
    told["results"] = [row for row in told["results"] if (row["family"], row["case"]) != name]
    (tmp_path / "report.json").write_text(json.dumps(told), encoding="utf-8")
    monkeypatch.setattr(made, "KEPT", tmp_path)
    assert f"{name[0]}/{name[1]} is new, and was not run: run the suite {told['suite']} again" in made.out_of_date()


def test_the_report_is_kept_beside():
    assert {path.name for path in (DOCS / "verification").iterdir()} == {"report.html", "report.md", "report.json"}
