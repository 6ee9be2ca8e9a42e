"""The runner and its command: however a case ends the others go on, what is done is kept; what is listed, refused."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from lacmesh.errors import RequestError, WriteError
from tests.verification.fakes import Given, command, planned, ran
from verification import families, mpiexec
from verification.cli import commands as command_run
from verification.cli import main
from verification.records import Case, Family, Outcome, Picture, informative, levels_of, rate
from verification.running import plan, pool, worker
from verification.running.folder import CaseResult, FolderError, forget, read_case_result, read_run, rows
from verification.running.suite import locked_run, run_suite


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
    return run_suite(cases, "quick", folder, jobs, lambda progress: None, lambda done, progress: None)


def gone(pid):
    """Wait until a process has ended (a zombie counts as ended); False after a minute."""
    deadline = time.monotonic() + 60
    with suppress(FileNotFoundError):
        while "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text():
            if time.monotonic() > deadline:
                return False
            time.sleep(0.05)
    return True


def wait_for(path):
    deadline = time.monotonic() + 300
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)


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
    made = run(planned(prepared, ["good", *ENDS, "missed", "last"]), folder, jobs)
    assert {done.case: done.failure for done in made.done if done.failure} == ENDS
    assert {done.case for done in made.done if done.passed} == {"good", "last"}
    results = json.loads((folder / "results.json").read_text())["results"]
    errors = [row for row in results if row["quantity"] == "outcome"]
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


def test_what_is_done_is_not_done_again(prepared, folder):
    cases = planned(prepared, ["a", "missed", "failed", "exits"])
    first = run(cases, folder)
    assert set(ran(prepared)) == {"a", "missed", "failed", "exits"}
    assert run(cases, folder).seconds > first.seconds
    assert set(ran(prepared)) == {"failed", "exits"}  # what has no outcome
    results = json.loads((folder / "results.json").read_text())["results"]
    names = [(row["case"], row["quantity"]) for row in results]
    assert len(names) == len(set(names)) == 6


@pytest.mark.rows("given")
@pytest.mark.parametrize(
    "changed",
    [{"levels": 3}, {"digest": "of other sources"}, {"given": Given((0.5, 0.125))}],
    ids=lambda changed: next(iter(changed)),
)
def test_what_is_not_the_same_case_is_run_again(prepared, folder, changed):
    run(planned(prepared, "ab"), folder)
    ran(prepared)
    cases = [*planned(prepared, "a", **changed), *planned(prepared, "b")]
    assert len(run(cases, folder).done) == 2 and [*ran(prepared)] == ["a"]
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
    with locked_run(folder, resume=False), pytest.raises(RequestError, match="another process"):
        locked_run(folder, resume=True).__enter__()
    with pytest.raises(RequestError, match="holds a run already"):
        locked_run(folder, resume=False).__enter__()
    (folder / "cases" / "cut").mkdir()
    (folder / "cases" / "cut" / ".a-0123.png").write_text("half")
    (folder / ".results-0123.json").write_text("half")
    (folder / ".mine").write_text("kept")
    with locked_run(folder, resume=True):
        assert [path.name for path in folder.rglob(".*")] == [".mine"]


def test_a_part_that_is_run_again_keeps_the_others_and_what_measures_time_is_alone(prepared, folder):
    """All but those that other code than today's had made."""
    old = planned(prepared, ["old"], digest="older")
    run([*planned(prepared, ["timed", "a", "halting"], alone=("timed",)), *old], folder)
    began = ran(prepared)
    assert began["timed"][1] > began["halting"][1] + 0.3 and began["timed"][2] == len(os.sched_getaffinity(0))
    made = run(planned(prepared, "a", levels=3), folder)
    assert {done.case: done.levels for done in made.done} == {"timed": 2, "a": 3, "halting": 2}
    assert read_run(folder) == made and (folder / "cases" / "cut" / "old.json").exists()


def test_a_worker_that_cannot_be_started_is_an_error(prepared, folder, monkeypatch):
    monkeypatch.setattr(pool, "COMMAND", ("/nowhere/python",))
    with pytest.raises(WriteError, match="cut/a cannot be started"):
        run(planned(prepared, "a"), folder)


@pytest.fixture
def solved(monkeypatch, tmp_path):
    """Let the worker solve a case by a function: what it leaves."""

    def solve(function):
        def solved(given, *, levels):
            return function(levels)

        case = Case("cut", "one", "a case", partial(solved, Given()), {"quick": 2})
        monkeypatch.setattr(families, "family", lambda name: Family(name, "", "", (case,)))
        worker.main("cut", "one", 2, tmp_path)
        return read_case_result(tmp_path, "cut", "one")

    return solve


def test_a_worker_keeps_what_a_case_yields_or_why_there_is_nothing(solved, tmp_path, capsys):
    picture = Picture("a title", "what is seen", b"bytes")
    done = solved(lambda levels: Outcome((informative("levels", levels, reason=""),), (), (picture, picture)))
    assert done.results[0].value == 2 and done.parameters == {"sizes": [0.5, 0.25]} and not done.failure
    assert (done.sources, done.levels) == (plan.sources("cut"), 2) and done.seconds >= 0 and done.memory > 1e6
    assert [(tmp_path / "cases" / "cut" / kept.file).read_bytes() for kept in done.pictures] == [b"bytes"] * 2
    forget(tmp_path, "cut", "one")
    assert not list((tmp_path / "cases" / "cut").iterdir())

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


# ---- the command


@pytest.fixture
def fakes(prepared, monkeypatch):
    """Let the command run cases that solve nothing."""

    def use(*names):
        cases = planned(prepared, names)
        monkeypatch.setattr(plan, "plan", lambda *which: cases)

    return use


def test_every_case_is_listed_as_data(capsys):
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [f"{row['family']}/{row['case']}" for row in listed] == [case.id for case in families.cases()]
    assert all(row["given"] and row["about"] and row["levels"] and row["seconds"] > 0 for row in listed)
    assert main(["list", "--suite", "quick", "--family", "inf-sup"]) == 0
    wanted = [case.id for case in families.cases("quick", ("inf-sup",))]
    assert re.findall(r"inf-sup/\S+", capsys.readouterr().out) == wanted


def test_one_case_runs_to_its_report(tmp_path, capsys):
    folder, page = tmp_path / "run", tmp_path / "page.html"
    words = ["run", "--case", "cut/counts", "-j", "1", "-o", str(folder)]
    assert main(words) == 0
    assert re.search(r"cut/counts: met (\d+) of \1 results", capsys.readouterr().out)
    assert "counts" in (folder / "report.html").read_text() and (folder / "report.md").exists()
    assert ET.parse(folder / "junit.xml").getroot().find("testsuite/testcase").get("name") == "counts"
    before = json.loads((folder / "results.json").read_text())["results"]

    assert main(words) == 2 and "holds a run already" in capsys.readouterr().err
    assert main([*words, "--resume"]) == 0
    assert "0 cases to run, 1 are done already" in capsys.readouterr().out
    again = (folder / "results.json").read_text()
    assert json.loads(again)["results"] == before

    assert main(["report", str(folder), "-o", str(page)]) == 0
    assert capsys.readouterr().out == f"{page}\n" and "counts" in page.read_text()
    assert page.with_suffix(".json").read_text() == again, "away from the run the page has the results beside it"
    assert main(["compare", str(folder), str(folder)]) == 0
    assert capsys.readouterr().out.strip()


def test_a_figure_that_falls_short_is_the_exit_status(fakes, tmp_path, capsys):
    fakes("good", "missed", "failed")
    assert main(["run", "-o", str(tmp_path / "run")]) == 1
    told = capsys.readouterr()
    for said in (
        "missed: MISSED 1 of 2",
        "good: met 2 of 2",
        r"failed: FAILED: ValueError: the\x1b[31m mesh is <wrong>",
    ):
        assert f"cut/{said}" in told.out
    assert "2 of the results fall short (cut/failed has no outcome; cut/missed: error)" in told.err
    assert (tmp_path / "run" / "report.html").exists()


def test_a_quiet_run_says_nothing_and_goes_to_build_by_default(fakes, tmp_path, monkeypatch, capsys):
    fakes("good")
    monkeypatch.chdir(tmp_path)
    assert main(["run", "-q", "-j", "2", "--suite", "full"]) == 0
    assert main(["report", "-q", "build/verification-full"]) == 0
    assert capsys.readouterr() == ("", "")
    (tmp_path / "file").write_text("")
    assert main(["run", "-o", "file"]) == 3 and "file: cannot be used" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("list --family hertzz", "did you mean hertz?"),
        ("run --family patsh", "did you mean patch?"),
        ("run --case cut/mixd-2d", "did you mean mixed-2d"),
        ("run --family cut --case TRIAA", "did you mean TRIA"),
        ("run --case cutt/TRIA", "did you mean cut?"),
        ("run --family patch --case cut/TRIA", "leave --family out"),
        ("run --family cut --case", "requires an argument"),
        ("run -j 0", "no number of processes"),
        ("run -j many", "no number of processes"),
        ("rum", "there is no command 'rum'; did you mean run?"),
    ],
)
def test_a_wrong_command_is_one_sentence(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    status = main(words.split())
    told = capsys.readouterr().err
    assert status == 2 and said in told and told.count("\n") == 1 and not list(tmp_path.iterdir())


def test_a_family_that_a_suite_has_not_is_said(monkeypatch, capsys):
    case = Case("cut", "long", "a long one", partial(print), {"full": 4, "all": 5})
    monkeypatch.setattr(families, "family", lambda name: Family(name, "", "", (case,)))
    assert main(["list", "--family", "cut", "--suite", "quick"]) == 2
    assert "try --suite full" in capsys.readouterr().err
    assert main(["list", "--family", "cut", "--suite", "quick", "--case", "long"]) == 0  # it is named
    assert "long" in capsys.readouterr().out


CONTENTS = (None, "", "{", "[]", "3", "{}", '{"results": [3]}', '{"results": []}')


@pytest.mark.parametrize(
    ("words", "content"), [("compare {0} {0}", None), ("report {}/none", None), *(("report {}", c) for c in CONTENTS)]
)
def test_a_folder_that_is_no_run_has_its_status(tmp_path, capsys, words, content):
    if content is not None:
        (tmp_path / "results.json").write_text(content)
    assert main(words.format(tmp_path).split()) == 3
    told = capsys.readouterr().err
    assert "is not the folder of a run" in told and told.count("\n") == 1
    assert len(list(tmp_path.iterdir())) == (content is not None)


@pytest.mark.rows("15-143")
@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_a_run_that_can_be_resumed(tmp_path, sent, status):
    prepared, folder = tmp_path / "prepared", tmp_path / "run"
    prepared.mkdir()

    def begin(names, *more):
        words = [sys.executable, "-m", "tests.verification.fakes", str(prepared), names, "run", "-j", "2"]
        return subprocess.Popen(
            [*words, "-o", str(folder), *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    with begin("good,slow,other") as child:
        for ended in ("cases to run", "cut/good: met 2", "cut/other: met 2"):
            assert ended in child.stdout.readline()
        wait_for(prepared / "child")
        child.send_signal(sent)
        _, err = child.communicate(timeout=300)
    assert child.returncode == status and "Traceback" not in err
    assert f"finished cases are kept in {folder}; --resume goes on" in err
    pids = [line.split()[1] for line in (prepared / "ran").read_text().splitlines()]
    assert len(pids) == 3 and all(map(gone, [*pids, (prepared / "child").read_text()]))
    left = sorted(path.name for path in folder.rglob("*") if path.is_file())
    assert left == ["good.json", "junit.xml", "other.json", "results.json"]
    assert main(["report", "-q", str(folder)]) == 0

    (prepared / "ran").unlink()
    with begin("good,halting,other", "--resume") as child:  # the third is another by now
        told, _ = child.communicate(timeout=300)
    assert child.returncode == 0 and "1 cases to run, 2 are done already" in told
    assert [line.split()[0] for line in (prepared / "ran").read_text().splitlines()] == ["halting"]
    found = json.loads((folder / "results.json").read_text())["results"]
    assert sorted({row["case"] for row in found}) == ["good", "halting", "other"] and len(found) == 6


def test_without_petsc_the_family_is_refused_or_left_out(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(mpiexec, "python_with_petsc", lambda: "")
    monkeypatch.setattr(mpiexec, "_complaint", lambda python: "MPI is not installed")
    assert main(["run", "--suite", "all", "-o", str(tmp_path / "run"), "--case", "distributed/tie-2d"]) == 2
    assert "distributed cannot be run: MPI is not installed" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    cases = [Case(name, "a", "", partial(print), {"all": 1}) for name in ("distributed", "patch")]
    left = command_run._possible([plan.Planned(case, 1, "") for case in cases])
    assert [planned.case.family for planned in left] == ["patch"]
    assert "distributed is left out (1 of the cases)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "name", "suite"),
    [(None, "distributed", "all"), (None, "patch", "quick"), (None, None, "quick"), ("full", "distributed", "full")],
)
def test_a_family_that_no_smaller_suite_has_is_run_without_asking(asked, name, suite):
    assert plan.suite_of(asked, name, "quick") == suite


def test_the_kept_run_is_that_of_the_cases_that_there_are(monkeypatch):
    docs = Path(__file__).resolve().parents[2] / "docs"
    spec = importlib.util.spec_from_file_location("make_verification", docs / "make_verification.py")
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    assert page.out_of_date() == []
    monkeypatch.setattr("verification.families.friction_published.there", lambda name: False)
    assert page.out_of_date() == []  # without the meshes of others
