"""docs/output.md names every key, column, array and field that a run writes, and no others of its tables."""

from __future__ import annotations

import json
import re
from dataclasses import fields as record_fields
from pathlib import Path

import pytest

from lacmesh import read
from lacsolver.output.summary import STEP_KEYS
from lacsolver.output.tables import CONTACT_COLUMNS, FRICTION_COLUMNS, TANGENT_COLUMNS
from lacsolver.results.results import STATUSES, FrictionFigures, ZoneFigures
from tests.lacsolver.written import ZONES, made_up

#: fields with friction: tests/lacsolver/friction/test_output.py writes them
OF_FRICTION, OF_FRICTION_AT_NODES = ("shear", "slip", "path", "use", "dissipation"), "shear_recovered"
#: fields where a material yields: tests/lacsolver/test_plastic.py writes them
OF_YIELDING = {"vtu": ("plastic_strain",), "med": ("VARI_NOEU", "V1")}
PAGE = (Path(__file__).resolve().parents[2] / "docs" / "output.md").read_text(encoding="utf-8")


def part(title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE)[1]


def first_cells(text):
    """The names in the first column of a part's tables."""
    rows = re.findall(r"^\| (`[^|]*) \|", text, re.MULTILINE)
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    made = made_up(tmp_path_factory.mktemp("docs"))
    made.steps(made.writer(), 1)
    return made


def test_keys_of_results(run):
    told = json.loads((run.folder / "results.json").read_text())
    figures = [f.name for f in record_fields(ZoneFigures) if f.name != "friction"] + list(FrictionFigures._fields)
    zone = ["slave", "master", "why", *figures, "adjusted", "gap_bridged", "overlap_at_start"]
    listed = first_cells(part(r"results\.json"))
    assert [key for key in listed if key not in ("message", "units", "pretension", "cyclic")] == [*told, *zone]
    assert all(f"`{word}`" in part(r"results\.json") for word in (*STEP_KEYS, *STATUSES))


def test_columns_of_the_contact_table():
    tangent = [name.format(1) for name in TANGENT_COLUMNS]
    assert first_cells(part(r"contact_NAME\.csv")) == [*CONTACT_COLUMNS, *tangent, *FRICTION_COLUMNS]


def test_examples_read_the_tables_of_a_run(tmp_path, monkeypatch):
    """The page's examples run unchanged beside the tables of two steps."""
    made = made_up(tmp_path)
    made.steps(made.writer(), 2)
    monkeypatch.chdir(made.folder)
    names = {}
    for code in re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE):
        exec(compile(code, "output.md", "exec"), names)
    times = [0.25, 0.5]
    assert names["force"] == [3 * t for t in times] and names["times"].tolist() == times
    n = len(names["macros"])
    assert n > 1 and names["pressure"].tolist() == [[t * k for k in range(n)] for t in times]


def test_arrays_of_vtu(run):
    text = part("Fields for ParaView")
    listed = set(re.findall(r"`([^`]+)`", "".join(re.findall(r"^\|[^|]*\| (`[^|]*)\|", text, re.MULTILINE))))
    there = set()
    for stem in ("solid", f"contact_{ZONES[0]}"):
        mesh = read(run.folder / "fields" / f"{stem}_0001.vtu")
        there |= {*mesh.cell_data, *mesh.node_data}
    rubbed = (*OF_FRICTION, OF_FRICTION_AT_NODES)
    assert listed == there | {"cell_number", "node_number", "group:NAME", *rubbed, *OF_YIELDING["vtu"]}


def test_fields_of_med(tmp_path):
    run = made_up(tmp_path, output='[output]\nformat = "med"')
    run.steps(run.writer(), 1)
    mesh = read(run.folder / "results.med")
    ours = {n for n in (*mesh.cell_data, *mesh.node_data) if not n.startswith(("lac_", ZONES[1].replace("/", "_")))}
    named = {n.replace("NAME", ZONES[0]) for n in first_cells(part("Fields for Salome"))}
    rubbed = {f"{ZONES[0]}.{name}" for name in (*OF_FRICTION, f"{OF_FRICTION_AT_NODES}.nodes")}
    assert named == ours | rubbed | set(OF_YIELDING["med"][::2])


def test_files_of_a_folder(run):
    table = PAGE.split("\n## ", 1)[0]
    listed = {name.rstrip("/") for name in first_cells(table)}
    there = {re.sub(r"(?<=contact_).*(?=\.)", "NAME", p.name) for p in run.folder.iterdir()}
    there = {re.sub(r"(?<=state_)\d+", "NUMBER", name) for name in there}
    assert listed == there | {"results.med", "unconverged", "ring.pvd"}
