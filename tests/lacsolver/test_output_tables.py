"""results.json, history.csv and contact_NAME.csv: what stands in them after every step, and at the end."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from lacmesh.errors import ReadError, WriteError
from lacsolver.output import files, summary
from lacsolver.output.names import contact_stems
from lacsolver.output.tables import CONTACT_COLUMNS, History
from lacsolver.results.results import Results
from tests.lacsolver.test_output_med import room
from tests.lacsolver.written import MODELS, ZONES, figures, made_up, zone_fields

NUMBER, COUNT = {"type": ["number", "null"]}, {"type": "integer", "minimum": 0}


def exactly(**properties):
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def each(value):
    return {"type": "object", "additionalProperties": value}


def schema(dim, message=False):
    """Schema of results.json as design/case.md describes it."""
    vector = {"type": "array", "items": NUMBER, "minItems": dim, "maxItems": dim}
    zone = exactly(
        **{f"{what}_{end}": NUMBER for what in ("pressure", "gap") for end in ("min", "max")},
        pressure_mean=NUMBER,
        contact_area=NUMBER,
        resultant=vector,
        moment=vector if dim == 3 else NUMBER,
        coverage_min=NUMBER,
        coverage_max=NUMBER,
        overlap_at_start=NUMBER,
        **{name: COUNT for name in ("active", "open", "unpaired")},
    )
    step = exactly(
        time={"type": "number"},
        iterations=COUNT,
        halvings=COUNT,
        residuals={"type": "array", "items": NUMBER},
        reactions=each(vector),
        probes=each(vector),
    )
    extremes = {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2}
    return exactly(
        version={"type": "string"},
        status={"enum": ["running", "done", "interrupted", "failed"]},
        **({"message": {"type": "string", "minLength": 1}} if message else {}),
        steps={"type": "array", "items": step},
        contact=each(zone),
        balance=exactly(force=NUMBER, moment=NUMBER),
        loads={"type": "array", "items": exactly(section={"type": "string"}, where={"type": "string"}, force=vector)},
        stress=each(each(extremes)),
        energy=NUMBER,
        sizes=each(COUNT),
        timings=each(NUMBER),
        memory=COUNT,
    )


def told(run, **rest):
    def no_constant(name):
        raise ValueError(f"{name} is no JSON")

    found = json.loads((run.folder / "results.json").read_text(encoding="utf-8"), parse_constant=no_constant)
    jsonschema.validate(found, schema(run.space.dim, **rest))
    return found


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("model", MODELS)
def test_results_are_whole_after_every_step_and_at_the_end(tmp_path, model):
    run = made_up(tmp_path, model)
    writer = run.writer()
    for number in (1, 2):
        run.step(writer, number, 0.25 * number)
        assert (told(run)["status"], len(told(run)["steps"])) == ("running", number)
    run.results = replace(run.results, stress={"body": {"xx": (-1.0, 2.0), "zz": (math.nan, math.inf)}})
    run.finish(writer)
    found = told(run)
    d = run.space.dim
    assert found["status"] == "done"
    assert found["steps"][1] == {
        "time": 0.5,
        "iterations": 5,
        "halvings": 1,
        "residuals": [1.0, 1e-12],
        "reactions": {"base": [0.5 * k for k in range(1, d + 1)]},
        "probes": {"PA, top": [-0.5] * d},
    }
    assert found["contact"]["joint"]["pressure_max"] == 5.0
    assert found["contact"]["joint"]["gap_min"] is None
    assert found["contact"]["joint"]["moment"] == ([1.0] * 3 if d == 3 else 2.5)
    assert found["balance"] == {"force": 4e-15, "moment": 1e-15}  # of the first step, of the second
    assert found["stress"] == {"body": {"xx": [-1.0, 2.0], "zz": [None, None]}}
    assert (found["energy"], found["memory"], found["sizes"]) == (1.5, 10**6, {"nodes": 5})


def test_the_schema_refuses_another_key(tmp_path):
    run = made_up(tmp_path)
    writer = run.writer()
    run.step(writer, 1, 0.25)
    found = told(run)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**found, "more": 1}, schema(3))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(found, schema(2))


def test_a_run_that_fails_before_its_first_step_says_so(tmp_path):
    run = made_up(tmp_path)
    run.finish(run.writer(), "failed", message='no material\non "lower"')
    found = told(run, message=True)
    assert (found["status"], found["message"]) == ("failed", 'no material\non "lower"')
    assert (found["steps"], found["contact"], found["energy"]) == ([], {}, None)
    assert found["balance"] == {"force": None, "moment": None}


def test_a_balance_that_is_no_number_is_not_lost_among_others(tmp_path):
    run = made_up(tmp_path)
    growing = summary.Summary(tmp_path)
    steps = [replace(figures(run.space, t), balance=(b, 1e-16)) for t, b in ((0.1, 1e-14), (0.2, math.nan), (0.3, 0.0))]
    growing.write(Results("1", steps=tuple(steps)))
    balance = json.loads((tmp_path / "results.json").read_text())["balance"]
    assert balance == {"force": None, "moment": 1e-16}


def test_a_step_adds_its_line_and_the_file_is_as_if_written_at_once(tmp_path):
    space = made_up(tmp_path).space
    growing, results = summary.Summary(tmp_path), Results("1", message="two\nlines")
    for k in range(1, 5):
        results = replace(results, steps=(*results.steps, figures(space, 0.25 * k)), memory=10 ** (9 - k))
        growing.write(results)
        one = tmp_path / f"{k}"
        one.mkdir()
        summary.Summary(one).write(results)
        assert (tmp_path / "results.json").read_bytes() == (one / "results.json").read_bytes()
    growing.write(replace(results, status="done"))
    assert json.loads((tmp_path / "results.json").read_text())["status"] == "done"


def test_a_summary_that_cannot_grow_stays_as_it_was(tmp_path):
    space, growing = made_up(tmp_path).space, summary.Summary(tmp_path)
    results = Results("1", steps=(figures(space, 0.25),), message="x" * 3000)
    growing.write(results)
    before = (tmp_path / "results.json").read_bytes()
    with room(len(before) + 5), pytest.raises(WriteError, match=r"results.json: cannot be written"):
        growing.write(replace(results, steps=(*results.steps, figures(space, 0.5))))
    assert (tmp_path / "results.json").read_bytes() == before


def test_a_word_that_is_no_status_is_refused():
    with pytest.raises(ValueError, match="'finished'"):
        Results("1", status="finished")


@pytest.mark.parametrize("model", MODELS)
def test_history_has_a_row_a_step(tmp_path, model):
    run = made_up(tmp_path, model)
    writer = run.writer()
    for number in (1, 2, 3):
        run.step(writer, number, 0.1 * number)
        assert len(table(run.folder / "history.csv")) == number
    axes = "xyz"[: run.space.dim]
    rows = table(run.folder / "history.csv")
    assert list(rows[0]) == [
        *("time", "iterations"),
        *(f"reaction.base.{a}" for a in axes),
        *(f"probe.PA, top.u{a}" for a in axes),
        *(f"contact.joint.f{a}" for a in axes),
        *("contact.joint.area", "contact.joint.pressure_max"),
    ]
    assert [float(r["time"]) for r in rows] == [0.1 * k for k in (1, 2, 3)]  # to the last digit
    assert [float(r["reaction.base.y"]) for r in rows] == [2 * 0.1 * k for k in (1, 2, 3)]
    assert {r["iterations"] for r in rows} == {"5"}


def test_a_figure_that_is_no_number_is_an_empty_field(tmp_path):
    step = figures(made_up(tmp_path).space, 0.5)
    zone = replace(step.contact["joint"], pressure_max=math.nan)
    History(tmp_path).add(replace(step, contact={"joint": zone}))
    assert table(tmp_path / "history.csv")[0]["contact.joint.pressure_max"] == ""


def test_a_step_with_other_names_than_the_first_is_refused(tmp_path):
    step = figures(made_up(tmp_path).space, 0.5)
    history = History(tmp_path)
    history.add(step)
    with pytest.raises(ValueError, match=r"probe\.new"):
        history.add(replace(step, probes={"new": np.zeros(3)}))


@pytest.mark.parametrize("model", MODELS)
def test_contact_tables_have_a_row_each_macro_element_and_time(tmp_path, model):
    run = made_up(tmp_path, model)
    run.steps(run.writer(), 2)
    stems = contact_stems(ZONES)
    assert sorted(p.name for p in run.folder.glob("contact_*.csv")) == sorted(f"{s}.csv" for s in stems.values())
    for k, name in enumerate(ZONES):
        rows = table(run.folder / f"{stems[name]}.csv")
        assert tuple(rows[0]) == CONTACT_COLUMNS
        zone = zone_fields(run.space, 0.5, k)
        n = len(zone.number)
        assert [float(r["time"]) for r in rows] == [0.25] * n + [0.5] * n
        last = rows[n:]
        assert [int(r["macro"]) for r in last] == [100 * k + m for m in range(n)]
        assert [float(r["pressure"]) for r in last] == zone.pressure.tolist()
        assert [float(r["pressure_recovered"]) for r in last] == zone.recovered.tolist()
        assert [float(r["coverage"]) for r in last] == zone.coverage.tolist()
        assert [float(r["area"]) for r in last] == zone.area.tolist()
        assert [r["gap"] for r in last[:2]] == ["", "0.1"]
        assert [int(r["status"]) for r in last] == zone.status.tolist()
        d = run.space.dim
        assert [[float(r[a]) for a in "xyz"[:d]] for r in last] == zone.centre.tolist()
        assert [[float(r[f"n{a}"]) for a in "xyz"[:d]] for r in last] == zone.normal.tolist()
        if d == 2:
            assert {(r["z"], r["nz"]) for r in last} == {("0.0", "0.0")}


def test_a_table_that_cannot_grow_stays_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "t.csv"
    path.write_bytes(b"one\n")

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(WriteError, match=r"t\.csv: cannot be written \(No space left on device\)"):
        files.append(path, b"two\n")
    assert path.read_bytes() == b"one\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a,b\n1,2\n", "no table of lacsolver"),
        (b"time,iterations\n0.25,5\n0.5", "line 3: has a row that is not whole"),
    ],
)
def test_a_history_that_cannot_be_gone_on_with_is_told(tmp_path, content, message):
    (tmp_path / "history.csv").write_bytes(content)
    with pytest.raises(ReadError, match=message):
        History(tmp_path, end=1.0)


def test_names_of_files_are_safe_and_differ():
    names = ["..", "a/b", "a\\b", "x" * 300, "tab\t\0", "Ä", "ä"]
    stems = list(contact_stems(names).values())
    assert len({s.lower() for s in stems}) == len(names)
    assert all(len(s) < 100 and not set(s) & set('/\\\0\t:*?"<>|') for s in stems)
