"""Cases in processes of their own: however one ends the others go on, and what is done is kept and not done again."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
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
from verification.records import Case, Family, Outcome, Picture, informative
from verification.running import plan, pool, worker
from verification.running.environment import environment
from verification.running.folder import (
    CaseResult,
    FolderError,
    Run,
    forget,
    read_case_result,
    read_run,
    rows,
    sweep,
    write_results,
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


def test_cores_are_shared_and_cases_that_measure_time_are_alone(prepared, folder):
    cases = planned(prepared, ["timed", "a", "halting", "b"], alone=("timed",))
    done = [done.case for done in pool.solve_all(cases, folder, 2)]
    began = ran(prepared)
    cores = len(os.sched_getaffinity(0))
    assert list(began)[-1] == done[-1] == "timed"
    assert began["timed"][1] > began["halting"][1] + 0.3
    assert began["timed"][2] == cores and all(began[name][2] <= max(1, (cores + 1) // 2) for name in ("a", "b"))


def test_what_takes_longest_is_begun_first(prepared, folder):
    cases = [
        replace(p, case=replace(p.case, seconds=k)) for k, p in enumerate(planned(prepared, ["a", "b", "c"]), start=1)
    ]
    list(pool.solve_all(cases, folder, 1))
    assert list(ran(prepared)) == ["c", "b", "a"]


def test_the_time_that_is_left_is_told(prepared, folder):
    _, (begun, *said) = run(planned(prepared, ["a", "b", "c"]), folder, 1)
    assert (begun.count, begun.kept, begun.ended) == (3, 0, 0) and begun.left == pytest.approx(15)
    assert [(p.ended, p.count) for _, p in said] == [(1, 3), (2, 3), (3, 3)]
    left = [p.left for _, p in said]
    assert 15 > left[0] > 0 and left[-1] == pytest.approx(0)  # they are much faster than was thought


def test_a_run_that_is_stopped_leaves_no_process_and_no_half(prepared, folder):
    cases = [
        replace(p, case=replace(p.case, seconds=k))
        for p, k in zip(planned(prepared, ["slow", "good", "missed"]), (3, 2, 1), strict=True)
    ]

    def stop(done, progress):
        if progress.ended == 2:
            wait_for(prepared / "child")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_suite(cases, "quick", folder, 2, lambda progress: None, stop)
    assert gone(int((prepared / "child").read_text())) and gone(ran(prepared)["slow"][0])
    assert sorted(path.name for path in folder.rglob("*") if path.is_file()) == [
        "good.json", "junit.xml", "missed.json", "results.json",
    ]  # fmt: skip
    assert [done.case for done in read_run(folder).done] == ["good", "missed"]


def test_a_signal_that_meets_a_start_leaves_no_process(prepared, folder, monkeypatch):
    """Between the process and its being known."""
    start, began = pool._start, []

    def met(*words):
        began.append(start(*words))
        signal.raise_signal(signal.SIGINT)
        return began[-1]

    monkeypatch.setattr(pool, "_start", met)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            run(planned(prepared, ["slow"]), folder)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert began[0].process.returncode == -signal.SIGKILL and not list((folder / "cases" / "cut").iterdir())


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
    run(planned(prepared, ["a", "b"]), folder)
    ran(prepared)
    cases = [*planned(prepared, ["a"], **changed), *planned(prepared, ["b"])]
    made, _ = run(cases, folder)
    assert [*ran(prepared)] == ["a"] and len(made.done) == 2
    run(cases, folder)
    assert not (prepared / "ran").exists()


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": 1}', '{"format": 0}', '{"format": 1, "results": [3]}'])
def test_a_damaged_case_is_run_again(prepared, folder, content):
    cases = planned(prepared, ["a", "b"])
    run(cases, folder)
    ran(prepared)
    (folder / "cases" / "cut" / "a.json").write_text(content)
    with pytest.raises(FolderError, match=r"cut/a is missing or damaged"):
        read_run(folder)
    run(cases, folder)
    assert [*ran(prepared)] == ["a"] and len(read_run(folder).done) == 2


def test_a_part_that_is_run_again_keeps_the_others(prepared, folder):
    """Except for those that other code than today's had made."""
    run([*planned(prepared, ["a", "b", "c"]), *planned(prepared, ["old"], digest="older")], folder)
    ran(prepared)
    made, _ = run(planned(prepared, ["b"], levels=3), folder)
    assert [*ran(prepared)] == ["b"]
    assert {done.case: done.levels for done in made.done} == {"a": 2, "b": 3, "c": 2} and read_run(folder) == made
    assert (folder / "cases" / "cut" / "old.json").exists()


def test_an_outcome_of_before_is_not_taken_for_one_of_now(prepared, folder):
    run(planned(prepared, ["a"]), folder)
    cases = planned(prepared, ["a"], levels=3)
    (prepared / "cases" / "cut" / "a.json").unlink()  # the worker fails
    made, _ = run(cases, folder)
    assert (
        "status 1 and no results" in made.done[0].failure and "FileNotFound" in (folder / "cases/cut/a.log").read_text()
    )


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


def test_a_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="file: cannot be used"), locked_run(tmp_path / "file", resume=False):
        pass


def test_a_worker_that_cannot_be_started_is_said(prepared, folder, monkeypatch):
    monkeypatch.setattr(pool, "COMMAND", ("/nowhere/python",))
    with pytest.raises(WriteError, match="cut/a cannot be started"):
        run(planned(prepared, ["a"]), folder)


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


def test_a_worker_ends_with_its_run():
    code = "import time\nfrom verification.running import worker\nworker._PAUSE = 0.05\n"
    child = f"{code}import os\nworker.end_with(os.getppid())\nprint(os.getpid(), flush=True)\ntime.sleep(60)"
    parent = f"import subprocess, sys\nsubprocess.Popen([sys.executable, '-c', {child!r}]).wait()"
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True) as process:
        pid = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
        assert gone(pid)


def test_results_have_the_keys_that_are_promised(prepared, folder):
    run(planned(prepared, ["a", "exits"]), folder)
    told = json.loads((folder / "results.json").read_text())
    assert set(told) >= {"version", "environment", "results"} and "numpy" in told["environment"]
    promised = ("family", "case", "quantity", "value", "expected", "tolerance", "passed", "source", "reason", "seconds")
    assert all(set(row) >= {*promised, "levels"} for row in told["results"]) and len(told["results"]) == 3


def test_rows_of_a_convergence():
    from verification.records import levels_of, rate

    result = rate("u", levels_of((1.0, 0.5), (9, 25), (1.0, 0.25)), 2.0, source="theory")
    (row,) = rows(CaseResult("cut", "a", "", {}, 2, 1.5, 0, (result,)))
    assert row["levels"] == [
        {"h": 1.0, "unknowns": 9, "error": 1.0, "rate": None}, {"h": 0.5, "unknowns": 25, "error": 0.25, "rate": 2.0},
    ]  # fmt: skip
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


def test_a_run_without_cases_is_read(tmp_path):
    made = Run(tmp_path, "1", "quick", {"Python": "3"}, 0.0, ())
    write_results(tmp_path, made)
    assert read_run(tmp_path) == made


def test_sweeping_an_empty_folder_is_nothing(tmp_path):
    sweep(tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_code_of_a_family_is_known():
    found = plan._imported("verification.families.manufactured", set())
    wanted = {"records", "solving", "exact.sources", "measures.norms", "meshes.blocks"}
    assert {f"verification.{name}" for name in wanted} <= found
    assert not [name for name in found if re.match(r"verification\.(report|running|cli)", name)]
    assert plan.sources("cut") != plan.sources("patch")


def test_every_import_of_the_harness_is_seen():
    import ast

    said = "from verification import records\nfrom verification.measures import norms\nfrom verifications import x"
    assert set(plan._names(ast.parse(said))) == {
        "verification", "verification.records", "verification.measures", "verification.measures.norms",
    }  # fmt: skip


def test_the_digest_follows_the_code(tmp_path, monkeypatch):
    """A file that grows, and one that is moved."""
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


def test_the_environment_is_told_in_words():
    found = environment()
    assert {"lacmesh", "commit", "Python", "processor", "cores", "numpy", "scipy", "rslab"} <= set(found)
    assert all(isinstance(value, str) and value for value in found.values())
