"""Cases in processes of their own: however one ends the others go on, and what is done is kept and not done again."""

from __future__ import annotations

import json
import math
import os
import re
import time
import xml.etree.ElementTree as ET
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lacmesh.errors import RequestError, WriteError
from tests.verification.fakes import Given, command, outcome_of, planned, ran
from verification import families
from verification.records import Case, Family, Outcome, Picture, informative, levels_of, rate
from verification.running import plan, pool, worker
from verification.running.folder import (
    CaseResult,
    FolderError,
    Run,
    forget,
    read_case_result,
    read_run,
    rows,
)
from verification.running.suite import junit, locked_run, run_suite


@pytest.fixture
def prepared(tmp_path, monkeypatch):
    """Folder in which workers find prepared outcomes."""
    monkeypatch.setattr(pool, "COMMAND", command(tmp_path / "prepared"))
    (tmp_path / "prepared").mkdir()
    return tmp_path / "prepared"


@pytest.fixture
def folder(tmp_path):
    """Folder of a run."""
    (tmp_path / "run" / "cases").mkdir(parents=True)
    return tmp_path / "run"


def run(cases, folder, jobs=2):
    """Run cases: the run, and what was said meanwhile."""
    said = []
    made = run_suite(
        cases, "quick", folder, jobs,
        lambda progress: said.append(replace(progress)),
        lambda done, progress: said.append((done.case, replace(progress))),
    )  # fmt: skip
    return made, said


def listed(folder):
    return json.loads((folder / "results.json").read_text())["results"]


def gone(pid):
    """Wait until a process has ended (a zombie counts as ended); False after a minute."""
    deadline = time.monotonic() + 60
    with suppress(FileNotFoundError):
        while "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text():
            if time.monotonic() > deadline:
                return False
            time.sleep(0.05)
    return True


#: how each ends, and what is said of it
ENDS = {
    "killed": "killed by SIGKILL, perhaps for want of memory; see cases/cut/killed.log",
    "exits": "the process ended with status 7 and no results; see cases/cut/exits.log",
    "silent": "the process ended with status 0 and no results; see cases/cut/silent.log",
    "slow": "not done in 8 s; see cases/cut/slow.log",
    "failed": "ValueError: the\x1b[31m mesh\n is <wrong>",
}


@pytest.mark.parametrize("jobs", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_no_case_stops_the_others(prepared, folder, monkeypatch, jobs):
    monkeypatch.setattr(pool, "PATIENCE", 8)  # a worker is there within a tenth of a second, idle
    made, _ = run(planned(prepared, ["good", *ENDS, "missed", "last"]), folder, jobs)
    assert {done.case: done.failure for done in made.done if done.failure} == ENDS
    assert {done.case for done in made.done if done.passed} == {"good", "last"}
    errors = [row for row in listed(folder) if row["quantity"] == "outcome"]
    assert {row["case"]: row["reason"] for row in errors} == ENDS
    assert all(row["passed"] is False and row["value"] is None for row in errors)
    suite = ET.parse(folder / "junit.xml").getroot()[0]
    assert suite.attrib.items() >= {"name": "cut", "tests": "8", "failures": "1", "errors": "5"}.items()
    assert {case.get("name") for case in suite if case.find("error") is not None} == set(ENDS)
    assert [case.get("name") for case in suite if case.find("failure") is not None] == ["missed"]
    logs = {path.stem for path in folder.glob("cases/cut/*.log")}
    assert logs == set(ENDS) and not list(folder.rglob(".*"))
    assert gone(int((prepared / "child").read_text()))
    began = ran(prepared)
    assert len({pid for pid, *_ in began.values()} | {os.getpid()}) == len(began) + 1
    assert read_run(folder) == made


def test_what_takes_longest_is_begun_first_and_the_time_that_is_left_is_told(prepared, folder):
    cases = [replace(p, case=replace(p.case, seconds=k)) for k, p in enumerate(planned(prepared, "abc"), start=4)]
    _, (begun, *said) = run(cases, folder, 1)
    assert list(ran(prepared)) == ["c", "b", "a"]
    assert (begun.count, begun.kept, begun.ended) == (3, 0, 0) and begun.left == pytest.approx(15)
    assert [(p.ended, p.count) for _, p in said] == [(1, 3), (2, 3), (3, 3)]
    left = [p.left for _, p in said]
    assert 15 > left[0] > 0 and left[-1] == pytest.approx(0)  # they are much faster than was thought


def wait_for(path):
    deadline = time.monotonic() + 300
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_what_is_done_is_not_done_again(prepared, folder):
    cases = planned(prepared, ["a", "missed", "failed", "exits"])
    first, _ = run(cases, folder)
    assert set(ran(prepared)) == {"a", "missed", "failed", "exits"}
    second, (begun, *said) = run(cases, folder)
    assert set(ran(prepared)) == {"failed", "exits"} == {name for name, _ in said}  # what has no outcome
    assert (begun.count, begun.kept) == (2, 2) and second.seconds > first.seconds
    names = [(row["case"], row["quantity"]) for row in listed(folder)]
    assert len(names) == len(set(names)) == 6


@pytest.mark.parametrize(
    "changed",
    [{"levels": 3}, {"digest": "of other sources"}, {"given": Given((0.5, 0.125))}],
    ids=lambda changed: next(iter(changed)),
)
def test_what_is_not_the_same_case_is_run_again(prepared, folder, changed):
    run(planned(prepared, "ab"), folder)
    ran(prepared)
    cases = [*planned(prepared, "a", **changed), *planned(prepared, "b")]
    made, _ = run(cases, folder)
    assert [*ran(prepared)] == ["a"] and len(made.done) == 2
    run(cases, folder)
    assert not (prepared / "ran").exists()


def test_a_damaged_case_is_run_again(prepared, folder):
    cases = planned(prepared, "ab")
    run(cases, folder)
    for content in ("", "{", "[]", '{"format": 1}', '{"format": 0}', '{"format": 1, "results": [3]}'):
        (folder / "cases" / "cut" / "a.json").write_text(content)
        with pytest.raises(FolderError, match=r"cut/a is missing or damaged"):
            read_run(folder)
        ran(prepared)
        run(cases, folder)
        assert [*ran(prepared)] == ["a"] and len(read_run(folder).done) == 2, content
        (prepared / "ran").touch()


def test_a_folder_is_held_by_one_run(tmp_path):
    folder = tmp_path / "deep" / "run"
    with (
        locked_run(folder, resume=False),
        pytest.raises(RequestError, match="another process"),
        locked_run(folder, resume=True),
    ):
        pass
    with pytest.raises(RequestError, match="holds a run already; --resume"), locked_run(folder, resume=False):
        pass
    (folder / "cases" / "cut").mkdir()
    (folder / "cases" / "cut" / ".a-0123.png").write_text("half")
    (folder / ".results-0123.json").write_text("half")
    (folder / ".mine").write_text("kept")
    with locked_run(folder, resume=True):
        assert [path.name for path in folder.rglob(".*")] == [".mine"]


def test_a_part_that_is_run_again_keeps_the_others_and_what_measures_time_is_alone(prepared, folder):
    """All but those that other code than today's had made."""
    kept = [
        *planned(prepared, ["timed", "a", "halting"], alone=("timed",)),
        *planned(prepared, ["old"], digest="older"),
    ]
    run(kept, folder)
    began = ran(prepared)
    assert began["timed"][1] > began["halting"][1] + 0.3 and began["timed"][2] == len(os.sched_getaffinity(0))
    made, _ = run(planned(prepared, "a", levels=3), folder)
    assert {done.case: done.levels for done in made.done} == {"timed": 2, "a": 3, "halting": 2}
    assert read_run(folder) == made and (folder / "cases" / "cut" / "old.json").exists()


def test_what_cannot_be_made_or_started_is_said(prepared, folder, monkeypatch):
    (folder / "file").write_text("")
    with pytest.raises(WriteError, match="file: cannot be used"), locked_run(folder / "file", resume=False):
        pass
    monkeypatch.setattr(pool, "COMMAND", ("/nowhere/python",))
    with pytest.raises(WriteError, match="cut/a cannot be started"):
        run(planned(prepared, "a"), folder)


CASE = Case("cut", "one", "a case", partial(outcome_of, Given()), {"quick": 2})


@pytest.fixture
def solved(monkeypatch, tmp_path):
    """Let the worker solve a case by a function: what it leaves."""

    def solve(function):
        def solved(given, *, levels):
            return function(levels)

        case = replace(CASE, solve=partial(solved, *CASE.solve.args))
        monkeypatch.setattr(families, "family", lambda name: Family(name, "", "", (case,)))
        worker.main("cut", "one", 2, tmp_path)
        return read_case_result(tmp_path, "cut", "one")

    return solve


def test_a_worker_keeps_what_a_case_yields(solved, tmp_path):
    picture = Picture("a title", "what is seen", b"bytes")
    done = solved(lambda levels: Outcome((informative("levels", levels, reason=""),), (), (picture, picture)))
    assert done.results[0].value == 2 and done.parameters == {"sizes": [0.5, 0.25]} and not done.failure
    assert (done.sources, done.levels) == (plan.sources("cut"), 2) and done.seconds >= 0 and done.memory > 1e6
    assert [(tmp_path / "cases" / "cut" / kept.file).read_bytes() for kept in done.pictures] == [b"bytes"] * 2
    forget(tmp_path, "cut", "one")
    assert not list((tmp_path / "cases" / "cut").iterdir())


def test_a_worker_keeps_why_there_is_nothing(solved, capsys):
    def fails(levels):
        raise ArithmeticError("no equilibrium")

    assert solved(fails).failure == "ArithmeticError: no equilibrium"
    assert "Traceback" in capsys.readouterr().err
    assert solved(lambda levels: Outcome(())).failure == "there is no result"


def test_results_have_the_keys_that_are_promised(prepared, folder):
    run(planned(prepared, ["a", "exits"]), folder)
    told = json.loads((folder / "results.json").read_text())
    assert set(told) >= {"version", "environment", "results"} and "numpy" in told["environment"]
    promised = ("family", "case", "quantity", "value", "expected", "tolerance", "passed", "source", "reason", "seconds")
    assert all(set(row) >= {*promised, "levels"} for row in told["results"]) and len(told["results"]) == 3
    assert {"lacmesh", "commit", "processor", "cores", "scipy", "rslab"} <= set(told["environment"])
    result = rate("u", levels_of((1.0, 0.5), (9, 25), (1.0, 0.25)), 2.0, source="theory")
    (row,) = rows(CaseResult("cut", "a", "", {}, 2, 1.5, 0, (result,)))
    (first, second) = (list(level.values()) for level in row["levels"])
    assert first == [1.0, 9, 1.0, None] and second == pytest.approx([0.5, 25, 0.25, 2.0])
    assert row["seconds"] == 1.5


@settings(max_examples=30, deadline=None, database=None)
@given(st.text(), st.text(), st.text())
def test_junit_is_well_formed_whatever_is_said(failure, quantity, reason):
    short = replace(informative(quantity, math.nan, reason=reason), passed=False)
    done = (
        CaseResult("cut", "a", "", {}, 1, 0.5, 0, (short,)),
        CaseResult("cut", "b", "", {}, 1, 0.5, 0, failure=failure or "?"),
        CaseResult("patch", "c", "", {}, 1, 0.5, 0, (informative("q", 1.0, reason=""),)),
    )
    suites = ET.fromstring(junit(Run(None, "1", "quick", {}, 2.0, done)))
    assert [(s.get("name"), s.get("failures"), s.get("errors")) for s in suites] == [
        ("cut", "1", "1"),
        ("patch", "0", "0"),
    ]
    assert [len(case) for case in suites.iter("testcase")] == [1, 1, 0]


@pytest.mark.parametrize("content", [None, "", "{", "[]", "3", "{}", '{"results": [3]}', '{"results": []}'])
def test_a_folder_that_is_no_run_is_said(tmp_path, content):
    if content is not None:
        (tmp_path / "results.json").write_text(content)
    with pytest.raises(FolderError, match="is not the folder of a run"):
        read_run(tmp_path)


def test_the_digest_follows_the_code(tmp_path, monkeypatch):
    """The modules that a family imports; a file that grows, and one that is moved."""
    names = plan._imported("verification.families.manufactured", set())
    wanted = {"records", "solving", "exact.sources", "measures.norms", "meshes.blocks"}
    assert {f"verification.{name}" for name in wanted} <= names
    assert not [name for name in names if re.match(r"verification\.(report|running|cli)", name)]
    assert plan.sources("cut") != plan.sources("patch")
    for name in ("lacmesh/a.py", "lacsolver/b.py", "verification/__init__.py", "verification/families/cut.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x = 1\n")
    monkeypatch.setattr(plan, "ROOT", tmp_path)
    digest = plan.sources.__wrapped__
    found = [digest("cut"), digest("cut")]
    (tmp_path / "lacmesh/a.py").write_text("x = 2\n")
    found.append(digest("cut"))
    (tmp_path / "lacmesh/a.py").rename(tmp_path / "lacmesh/c.py")
    found.append(digest("cut"))
    assert found[0] == found[1] and len(set(found)) == 3
