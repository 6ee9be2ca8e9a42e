"""`python -m verification`: what it lists, runs, refuses, and how it ends."""

from __future__ import annotations

import importlib.util
import json
import re
import signal
import subprocess
import sys
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path

import pytest

from tests.verification.fakes import command, planned
from tests.verification.test_running import gone, wait_for
from verification import families, mpiexec
from verification.cli import main
from verification.cli import run as command_run
from verification.running import plan, pool


@pytest.fixture
def fakes(tmp_path, monkeypatch):
    """Let the command run cases that solve nothing."""

    def use(*names):
        monkeypatch.setattr(pool, "COMMAND", command(tmp_path / "prepared"))
        (tmp_path / "prepared").mkdir(exist_ok=True)
        cases = planned(tmp_path / "prepared", names)
        monkeypatch.setattr(plan, "plan", lambda *which: cases)

    return use


def test_every_case_is_listed_as_data(capsys):
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [f"{row['family']}/{row['case']}" for row in listed] == [case.id for case in families.cases()]
    assert all(row["given"] and row["about"] and row["levels"] and row["seconds"] > 0 for row in listed)
    assert main(["list", "--suite", "quick", "--family", "inf-sup"]) == 0
    told = capsys.readouterr().out
    wanted = [case.id for case in families.cases("quick", ("inf-sup",))]
    assert re.findall(r"inf-sup/\S+", told) == wanted and f"{len(wanted)} cases, about" in told


def test_one_case_runs_to_its_report(tmp_path, capsys):
    folder = tmp_path / "run"
    words = ["run", "--case", "cut/counts", "-j", "1", "-o", str(folder)]
    assert main(words) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "1 cases to run; about 1 s left"
    assert re.fullmatch(r"\[1/1\] cut/counts: met (\d+) of \1 results, [\d.]+ s; about 0 s left", told[1])
    assert told[2].startswith("1 cases, ") and told[2].endswith("report.html") and len(told) == 3
    assert "counts" in (folder / "report.html").read_text() and (folder / "report.md").exists()
    assert ET.parse(folder / "junit.xml").getroot().find("testsuite/testcase").get("name") == "counts"
    before = (folder / "results.json").read_text()
    assert sorted(path.name for path in folder.glob("*.json")) == ["results.json"]

    assert main(words) == 2
    assert "holds a run already; --resume goes on with it" in capsys.readouterr().err
    assert main([*words, "--resume"]) == 0
    assert "0 cases to run, 1 are done already" in capsys.readouterr().out
    again = (folder / "results.json").read_text()
    assert json.loads(again)["results"] == json.loads(before)["results"]

    assert main(["report", str(folder), "-o", str(tmp_path / "page.html")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'page.html'}\n" and "counts" in (tmp_path / "page.html").read_text()
    assert (tmp_path / "page.json").read_text() == again, "away from the run the page has the results beside it"
    assert main(["compare", str(folder), str(folder)]) == 0
    assert capsys.readouterr().out.strip()


def test_a_figure_that_falls_short_is_the_exit_status(fakes, tmp_path, capsys):
    fakes("good", "missed", "failed")
    assert main(["run", "-o", str(tmp_path / "run")]) == 1
    told = capsys.readouterr()
    assert "cut/missed: MISSED 1 of 2 results, 0.2 s" in told.out and "cut/good: met 2 of 2 results" in told.out
    assert r"cut/failed: FAILED: ValueError: the\x1b[31m mesh is <wrong>" in told.out
    assert "2 of the results fall short (cut/failed has no outcome; cut/missed: error); see the report" in told.err
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
        ("list --family hertzz", "no family named 'hertzz'; did you mean hertz?"),
        ("run --family patsh", "no family named 'patsh'; did you mean patch?"),
        ("run --case cut/mixd-2d", "no case named 'mixd-2d'; did you mean mixed-2d"),
        ("run --family cut --case TRIAA", "no case named 'TRIAA'; did you mean TRIA"),
        ("run --case cutt/TRIA", "no family named 'cutt'; did you mean cut?"),
        ("run --family patch --case cut/TRIA", "case cut/TRIA is not of family patch; leave --family out"),
        ("run --family cut --case", "expected one argument"),
        ("run --suite ful", "invalid choice: 'ful' (choose from"),
        ("run -j 0", "0 is no number of processes"),
        ("run -j many", "many is no number of processes"),
        ("run --jobs -1", "-1 is no number of processes"),
        ("rum", "invalid choice: 'rum'"),
    ],
)
def test_a_wrong_command_is_one_sentence(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    try:
        status = main(words.split())
    except SystemExit as ended:  # by the parser
        status = ended.code
    told = capsys.readouterr().err
    assert status == 2 and said in told and told.count("\n") == 1 and not list(tmp_path.iterdir())


def test_a_family_that_a_suite_has_not_is_said(monkeypatch, capsys):
    case = families.Case("cut", "long", "a long one", partial(print), {"full": 4, "all": 5})
    monkeypatch.setattr(families, "family", lambda name: families.Family(name, "", "", (case,)))
    assert main(["list", "--family", "cut", "--suite", "quick"]) == 2
    assert "suite quick has no case of family cut; try --suite full" in capsys.readouterr().err
    assert main(["list", "--family", "cut", "--suite", "quick", "--case", "long"]) == 0  # it is named
    assert "long" in capsys.readouterr().out


@pytest.mark.parametrize("words", ["report {}", "compare {0} {0}", "report {}/none"])
def test_a_folder_that_is_no_run_has_its_status(tmp_path, capsys, words):
    assert main(words.format(tmp_path).split()) == 3
    told = capsys.readouterr().err
    assert "is not the folder of a run" in told and told.count("\n") == 1 and not list(tmp_path.iterdir())


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


# ---- without PETSc


def test_without_petsc_the_family_is_refused_or_left_out(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(mpiexec, "python_with_petsc", lambda: "")
    monkeypatch.setattr(mpiexec, "_complaint", lambda python: "MPI is not installed")
    words = ["run", "--suite", "all", "-o", str(tmp_path / "run"), "--case"]
    assert main([*words, "distributed/tie-2d"]) == 2
    said = capsys.readouterr().err
    assert (
        "family distributed cannot be run: MPI is not installed; in a checkout, make petsc installs all of it" in said
    )
    assert not (tmp_path / "run").exists()
    cases = [families.Case(name, "a", "", partial(print), {"all": 1}) for name in ("distributed", "patch")]
    left = command_run._possible([plan.Planned(case, 1, "") for case in cases])
    assert [planned.case.family for planned in left] == ["patch"]
    assert "family distributed is left out (1 of the cases): MPI" in capsys.readouterr().out


def test_the_family_is_run_without_a_suite():
    assert plan.suite_of(None, "distributed", "quick") == "all"
    assert plan.suite_of(None, "patch", "quick") == plan.suite_of(None, None, "quick") == "quick"
    assert plan.suite_of("full", "distributed", "quick") == "full"


# ---- docs/verification.md

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_is_that_of_the_cases_that_there_are_and_of_their_figures(monkeypatch):
    spec = importlib.util.spec_from_file_location("make_verification", DOCS / "make_verification.py")
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    assert page.out_of_date() == []
    monkeypatch.setattr("verification.families.friction_published.there", lambda name: False)
    assert page.out_of_date() == []  # without the meshes of others
