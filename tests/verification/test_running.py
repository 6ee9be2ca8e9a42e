"""The runner and its command: however a case ends the others go on, finished cases are kept; lists and refusals."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from lacmesh.errors import RequestError
from tests.verification import fakes
from tests.verification.fakes import FAILURE, planned
from verification import families, mpiexec, plan, running
from verification.cli import commands as command_run
from verification.cli import main
from verification.comparison import read_rows
from verification.records import SUITES, Case, Family
from verification.running import locked, read_run, run_suite


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Let runs know the family `fake`; returns the file that its cases write to."""
    monkeypatch.setitem(families.MODULES, "fake", "fake")
    monkeypatch.setitem(sys.modules, "verification.families.fake", fakes)
    monkeypatch.setattr(running, "ARGUMENTS", [*running.ARGUMENTS, "-p", "tests.verification.fakes"])
    monkeypatch.setenv("FAKES", str(tmp_path / "ran"))
    return tmp_path / "ran"


def run(cases, folder, jobs=2):
    with locked(folder, resume=True):
        return run_suite(cases, "quick", folder, jobs)


def ran(file):
    """name -> (process, time, threads), of the cases that were solved since the last call, in their order."""
    lines = [line.split() for line in file.read_text().splitlines()] if file.exists() else []
    assert len({line[0] for line in lines}) == len(lines), "a case was solved twice"
    file.unlink(missing_ok=True)
    return {name: (int(pid), float(when), int(threads)) for name, pid, when, threads in lines}


def gone(pid):
    """Wait until a process has ended (a zombie counts as ended); False after a minute."""
    deadline = time.monotonic() + 60
    with suppress(FileNotFoundError):
        while "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text():
            if time.monotonic() > deadline:
                return False
            time.sleep(0.05)
    return True


ENDS = {
    "killed": "killed by SIGKILL, perhaps for want of memory",
    "exits": "the process ended with status 7 and no results",
    "leaves": "SystemExit: here",
    "slow": "not done in 4 s",
    "failed": FAILURE,
}


def test_failed_case_does_not_stop_the_others(fake, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(running, "PATIENCE", 4.0)
    made = run(planned(["a", *ENDS, "missed", "halting"]), tmp_path / "run")
    assert {done.case: done.outcome.failure for done in made.done if done.outcome.failure} == ENDS
    assert {done.case for done in made.done if all(r.passed for r in done.results())} == {"a", "halting"}
    assert "said before" in next(done.log for done in made.done if done.case == "failed")
    content = json.loads((tmp_path / "run" / "results.json").read_text())
    errors = [row for row in content["results"] if row["quantity"] == "outcome"]
    assert {row["case"]: row["reason"] for row in errors} == ENDS
    assert all(row["passed"] is False and row["value"] is None for row in errors)
    assert gone(int(fake.with_suffix(".child").read_text()))
    assert read_run(tmp_path / "run") == made
    assert "fake/missed: MISSED 1 of 2 results" in capsys.readouterr().out
    promised = ("family", "case", "quantity", "value", "expected", "tolerance", "passed", "source", "reason", "seconds")
    assert all(set(row) >= {*promised, "levels", "bound"} for row in content["results"])
    assert {"lacmesh", "commit", "processor", "cores", "scipy", "rslab"} <= set(content["environment"])


def test_finished_cases_are_kept_and_others_solved_again(fake, tmp_path, monkeypatch):
    folder = tmp_path / "run"
    run(planned(["a", "missed", "failed"]), folder)
    assert set(ran(fake)) == {"a", "missed", "failed"}
    run(planned(["a", "missed", "failed"]), folder)
    assert set(ran(fake)) == {"failed"}  # it has no outcome
    again = run([*planned("a", levels=3), *planned("b")], folder)
    assert set(ran(fake)) == {"a", "b"}  # on more meshes; new
    assert {done.case: done.levels for done in again.done} == {"a": 3, "b": 2, "failed": 2, "missed": 2}
    lines = (folder / "cases.jsonl").read_bytes().splitlines(keepends=True)
    (folder / "cases.jsonl").write_bytes(b"".join(line for line in lines if b'"b"' not in line) + b'{"family": "fa')
    assert len(run(planned("ab", levels=3), folder).done) == 4
    assert set(ran(fake)) == {"b"}  # its line is damaged
    monkeypatch.setattr(running, "sources", lambda: "of other code")
    assert [done.case for done in run(planned("a", levels=3), folder).done] == ["a"]
    assert set(ran(fake)) == {"a"}


def test_case_that_measures_time_is_alone(fake, tmp_path):
    run(planned(["timed", "a", "halting"]), tmp_path / "run")
    began = ran(fake)
    assert began["timed"][1] > began["halting"][1] + 0.5 and began["timed"][2] == len(os.sched_getaffinity(0))


def test_processes_that_end_at_their_start_are_an_error(tmp_path):
    words = [sys.executable, "-m", "tests.verification.fakes", "a,b", "run", "-j", "2", "-o", str(tmp_path / "run")]
    ended = subprocess.run(words, cwd=plan.ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert ended.returncode == 1 and re.search(r"no active workers|ended before fake/a", ended.stderr)
    assert read_run(tmp_path / "run").done == ()


def test_case_that_a_process_does_not_know_is_an_error(fake, tmp_path):
    unknown = Case("fake", "unknown", "", partial(print), {"quick": 1})
    with pytest.raises(RuntimeError, match="unknown"):
        run([(unknown, 1)], tmp_path / "run")


def test_folder_belongs_to_one_run(tmp_path):
    folder = tmp_path / "deep" / "run"
    with locked(folder, resume=False), pytest.raises(RequestError, match="another process"):
        locked(folder, resume=True).__enter__()
    with pytest.raises(RequestError, match="holds a run already"):
        locked(folder, resume=False).__enter__()


def test_digest_follows_the_code_and_not_the_reports(tmp_path, monkeypatch):
    digest, found = plan.sources.__wrapped__, []
    monkeypatch.setattr(plan, "ROOT", tmp_path)
    for name in ("lacmesh/a.py", "lacsolver/b.py", "verification/families/cut.py", "verification/report/__init__.py",
                 "verification/running.py"):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        for text in ("x = 1\n", "x = 2\n"):
            (tmp_path / name).write_text(text)
            found.append(digest())
    (tmp_path / "lacmesh/a.py").rename(tmp_path / "lacmesh/c.py")
    assert len(set(found)) == 6 and len(set(found[5:])) == 1 and digest() not in found


def test_cases_are_tests_of_pytest():
    words = ["-m", "pytest", "-o", "addopts=--strict-markers", "verification/cases.py", "-q", "--co", "-m", "quick"]
    child = subprocess.run([sys.executable, *words], cwd=plan.ROOT, capture_output=True, text=True)
    found = re.findall(r"test_case\[quick-(.*)\]", child.stdout)
    assert found == [case.id for case in families.cases("quick")], child.stdout[-2000:] + child.stderr


# ---- the command


def test_every_case_is_listed_as_data(capsys):
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [f"{row['family']}/{row['case']}" for row in listed] == [case.id for case in families.cases()]
    assert all(row["given"] and row["about"] and row["levels"] and row["seconds"] > 0 for row in listed)
    assert main(["list", "--suite", "quick", "--family", "inf-sup"]) == 0
    wanted = [case.id for case in families.cases("quick", ("inf-sup",))]
    assert re.findall(r"inf-sup/\S+", capsys.readouterr().out) == wanted


def test_one_case_runs_to_its_report(tmp_path, capsys):
    folder, page, kept = tmp_path / "run", tmp_path / "page.html", tmp_path / "figures.json"
    words = ["run", "--case", "cut/counts", "-j", "1", "-o", str(folder)]
    assert main(words) == 0
    assert re.search(r"cut/counts: met (\d+) of \1 results", capsys.readouterr().out)
    assert "counts" in (folder / "report.html").read_text()
    before = json.loads((folder / "results.json").read_text())["results"]
    assert main(words) == 2 and "holds a run already" in capsys.readouterr().err
    assert main([*words, "--resume"]) == 0
    assert "0 cases to run, 1 are done already" in capsys.readouterr().out
    assert json.loads((folder / "results.json").read_text())["results"] == before
    for path in (page, kept):
        assert main(["report", str(folder), "-o", str(path)]) == 0
        assert capsys.readouterr().out == f"{path}\n" and "counts" in path.read_text()
    assert main(["compare", str(folder), str(kept)]) == 0
    assert capsys.readouterr().out.startswith(f"{len(before)} results in both: 0 missed now, 0 met now, ")


def test_missed_result_is_the_exit_status(fake, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plan, "plan", lambda *which: planned(["a", "missed", "failed"]))
    assert main(["run", "-o", "run"]) == 1
    printed = capsys.readouterr()
    escaped = r"failed: FAILED: ValueError: the\x1b[31m mesh\n is <wrong>"
    assert all(f"fake/{line}" in printed.out for line in ("missed: MISSED 1 of 2", "a: met 2 of 2", escaped))
    assert "2 of the results miss their bound (fake/failed: outcome; fake/missed: error)" in printed.err
    assert "&lt;wrong&gt;" in Path("run/report.html").read_text()
    monkeypatch.setattr(plan, "plan", lambda *which: planned("a"))
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


def test_suite_without_a_family_is_refused_and_a_named_case_is_not(monkeypatch, capsys):
    case = Case("cut", "long", "a long one", partial(print), {"full": 4, "all": 5})
    monkeypatch.setattr(families, "family", lambda name: Family(name, "", "", (case,)))
    assert main(["list", "--family", "cut", "--suite", "quick"]) == 2
    assert "try --suite full" in capsys.readouterr().err
    assert main(["list", "--family", "cut", "--suite", "quick", "--case", "long"]) == 0
    assert "long" in capsys.readouterr().out


CONTENTS = (None, "", "{", "[]", "3", "{}", '{"results": [3]}', '{"results": []}')


@pytest.mark.parametrize(
    ("words", "content"),
    [("compare {0} {0}", None), ("report {}/none", None), *(("report {}", c) for c in CONTENTS),
     *(("compare {0} {0}", c) for c in CONTENTS[:-1])],
)  # fmt: skip
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
    file, folder = tmp_path / "ran", tmp_path / "run"

    def begin(names, *more):
        words = [sys.executable, "-m", "tests.verification.fakes", names, "run", "-j", "2", "-o", str(folder), *more]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        return subprocess.Popen(words, cwd=plan.ROOT, env={**os.environ, "FAKES": str(file)}, text=True, **pipes)

    with begin("a,slow,b") as child:
        printed = "".join(child.stdout.readline() for _ in range(3))
        assert all(line in printed for line in ("cases to run", "fake/a: met 2", "fake/b: met 2"))
        while not file.with_suffix(".child").exists():
            time.sleep(0.02)
        child.send_signal(sent)
        _, err = child.communicate(timeout=300)
    assert child.returncode == status and "Traceback" not in err
    assert f"finished cases are kept in {folder}; --resume goes on" in err
    assert all(gone(pid) for pid, *_ in ran(file).values()) and gone(file.with_suffix(".child").read_text())
    assert sorted(path.name for path in folder.iterdir()) == ["cases.jsonl", "results.json"]
    assert {case for case, _ in read_rows(folder)} == {"fake/a", "fake/b"}

    with begin("a,b,halting", "--resume") as child:
        out, _ = child.communicate(timeout=300)
    assert child.returncode == 0 and "1 cases to run, 2 are done already" in out
    assert set(ran(file)) == {"halting"} and len(read_rows(folder)) == 6


def test_without_petsc_the_family_is_refused_or_left_out(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(mpiexec, "python_with_petsc", lambda: "")
    monkeypatch.setattr(mpiexec, "_complaint", lambda python: "MPI is not installed")
    assert main(["run", "--suite", "all", "-o", str(tmp_path / "run"), "--case", "distributed/tie-2d"]) == 2
    assert "distributed cannot be run: MPI is not installed" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    cases = [Case(name, "a", "", partial(print), {"all": 1}) for name in ("distributed", "patch")]
    left = command_run._possible([(case, 1) for case in cases])
    assert [case.family for case, _ in left] == ["patch"]
    assert "distributed is left out (1 of the cases)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "name", "suite"),
    [(None, "distributed", "all"), (None, "patch", "quick"), (None, None, "quick"), ("full", "distributed", "full")],
)
def test_a_family_that_no_smaller_suite_has_is_run_without_asking(asked, name, suite):
    assert plan.suite_of(asked, name, "quick") == suite


@pytest.mark.parametrize("others", [True, False], ids=["with the meshes of others", "without"])
def test_kept_figures_are_of_the_present_cases(monkeypatch, others):
    if not others:
        monkeypatch.setattr("verification.families.friction_published.there", lambda name: False)
    kept = plan.ROOT / "docs" / "verification" / "figures.json"
    suite = json.loads(kept.read_text())["suite"]
    ours, theirs = {case.id for case in families.cases(suite)}, {case for case, _ in read_rows(kept)}
    assert suite in SUITES and ours <= theirs and kept.stat().st_size < 900_000
    assert all(f"{name}-twin" in ours for name in theirs - ours)  # its mesh is not at hand
