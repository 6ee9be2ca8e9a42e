"""Every bad input gets one sentence and its status, leaves nothing behind, and stands in docs/bad_input.md."""

from __future__ import annotations

import contextlib
import re
import resource
import subprocess
import sys
import tempfile
import warnings
from functools import cache
from pathlib import Path

import pytest

from lacmesh import read
from lacmesh.errors import LacmeshWarning, ReadError
from tests.bad_input import case, command_cases, mesh_cases, page, stop_cases
from tests.bad_input.case import Case, listing
from tests.bad_input.command_cases import GOOD
from tests.bad_input.page import all_cases
from tests.samples import each_option


@cache
def the_page() -> dict[tuple[str, str, str], str]:
    return page.parsed(page.PAGE.read_text(encoding="utf-8"))


def holds(one, outcome):
    """The status that is expected, the sentence in the page, and the words that the page leaves out."""
    assert outcome.status == one.status, outcome.sentence
    assert re.search(one.says, outcome.sentence), outcome.sentence
    key, said = page.entry(one, outcome)
    assert the_page().get(key) == said, "run: python -m tests.bad_input.page"


def parameters(rows):
    """Parameters of pytest with a case each, named by it, and marked by the package that it needs."""
    return [
        pytest.param(one, id=one.key, marks=[*marks, *([getattr(pytest.mark, one.needs)] if one.needs else [])])
        for (one,), marks, _ in rows
    ]


@pytest.fixture
def folder():
    """An empty folder that every user may reach, unlike those of pytest."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def reader_and_error(row):
    """Option of a case: what it tries of a reader. One of any format tries the command, and has its own."""
    (one,) = row
    return [(one.format, one.kind, one.command[0], one.status, one.what if one.format == "any" else "")]


@pytest.mark.parametrize("one", parameters(each_option(((one,) for one in all_cases()), of=reader_and_error)))
def test_one_sentence_and_nothing_left(one, folder):
    outcome = case.run(one, folder)
    holds(one, outcome)
    if outcome.status == 3:  # it names the file: the input, one that belongs to it, the output, or where it is made
        names = [Path(path).name for path in (*folder.iterdir(), one.input, one.out, *one.command)]
        assert any(name in outcome.sentence for name in (*names, tempfile.gettempdir()))


def damaged_files():
    """Cases of files that a reader refuses: all of them, as this takes no command."""
    return [c for c in all_cases() if c.status == 3 and c.format not in ("any", "STEP", "IGES", "BREP", "STL", "geo")]


@pytest.mark.parametrize(
    "one", parameters(pytest.param(c) for c in damaged_files() if c.command in (case.CUT, case.INFO))
)
def test_the_reader_says_what_the_command_says(one, folder):
    with contextlib.chdir(folder), case.alarm(case.SECONDS), case.room(case.BYTES), warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        case.made(one, folder)
        with pytest.raises(ReadError) as caught:
            read(one.input)
    holds(one, case.Outcome(3, [f"lacmesh: error: {caught.value}"], 0))


def every_command():
    """Each defect, in a file of each format, with a third of the commands by turns."""
    rows = [(name, defect, turn) for name, defect in command_cases.readable() for turn in range(3)]
    for row in each_option(rows, of=lambda row: [row[1].what, row[2]]):
        name, defect, turn = row.values
        yield pytest.param(*row.values, marks=row.marks, id=f"{name}: {defect.what}, {turn}")


@pytest.mark.parametrize(("name", "defect", "turn"), [*every_command()])
def test_every_command_takes_what_can_be_read(name, defect, turn, tmp_path):
    """No exception, one sentence where there is an error, nothing left: whatever is wrong with the mesh."""
    content = mesh_cases.spoilt(name, defect)
    for what, words in [*command_cases.EVERY.items()][turn::3]:
        folder = tmp_path / what
        folder.mkdir()
        outcome = case.run(Case("", name, defect.what, content, command=words), folder)
        assert outcome.status in (0, 1, 2) and "not-checked" not in outcome.sentence, (what, outcome)


STOPS = {stop.key: stop for stop in stop_cases.cases()}


@pytest.mark.parametrize(
    "key", each_option([(key,) for key in STOPS], of=lambda row: (STOPS[row[0]].stage.what, STOPS[row[0]].number))
)
def test_stopped(key, tmp_path):
    stop = STOPS[key]
    outcome = stop_cases.run(stop, tmp_path)
    assert len(outcome.lines) == 1
    holds(stop, outcome)


def test_the_page_holds_these_cases_and_no_other():
    every = (*all_cases(), *stop_cases.cases())
    keys = [(page.KINDS[c.kind], page._safe(page.row(c, case.Outcome(0, [], 0)).what), c.format) for c in every]
    assert len(set(keys)) == len(keys), "two cases have the same name"
    assert set(keys) == set(the_page())
    assert len(keys) >= 250


def in_process(args, folder, file_size):
    """`lacmesh` as it is installed, with a limit of the files that it writes."""
    limit = None if file_size is None else lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))
    args = [sys.executable, "-m", "lacmesh", *args]
    return subprocess.run(args, cwd=folder, capture_output=True, text=True, preexec_fn=limit)


def selected() -> list[Case]:
    """One case of each suffix, whose libraries are shut down with the process, and one of each status."""
    cases = [c for c in all_cases() if not c.nobody]
    found = {Path(c.input).suffix: c for c in cases if c.status} | {c.status: c for c in cases}
    return list(dict.fromkeys(found.values()))


@pytest.mark.parametrize("one", parameters(map(pytest.param, selected())))
def test_in_a_process_of_its_own(one, tmp_path):
    """The installed command behaves alike, up to the end of its process."""
    args = case.made(one, tmp_path)
    before = listing(tmp_path)
    done = in_process(args, tmp_path, one.file_size)
    assert done.returncode == one.status
    errors = [line for line in done.stderr.splitlines() if not line.startswith("lacmesh: warning: ")]
    assert [line.startswith("lacmesh: error: ") for line in errors] == [True] * bool(one.status)
    if one.status:
        assert listing(tmp_path) == before


@pytest.mark.parametrize(
    ("suffix", "size"), [(".msh", 50), (".med", 50), (".xdmf", 50), (".med", 3000), (".xdmf", 3000)]
)
def test_a_full_disk_and_the_end_of_the_process(suffix, size, tmp_path):
    """HDF5 that could not write used to end in a segmentation fault; all formats are tried without a process."""
    (tmp_path / "in.msh").write_bytes(GOOD)
    done = in_process(["cut", "in.msh", "--slave", "SLAVE", "--hexa", "hexa", "-o", f"out{suffix}"], tmp_path, size)
    if done.returncode == 0:
        assert size == 3000 and (tmp_path / f"out{suffix}").stat().st_size <= size
        return
    assert done.returncode == 3
    assert done.stderr == f"lacmesh: error: out{suffix}: cannot be written (File too large)\n"
    assert [path.name for path in tmp_path.iterdir()] == ["in.msh"]


def test_the_run_of_a_case_sees_what_is_wrong(tmp_path):
    """Two sentences, a file that is left, a changed output, too much memory, too much time: none of them passes."""

    def stray(folder: Path) -> None:
        (folder / "bad.msh").write_bytes(GOOD)

    one = Case("output", "any", "", stray, command=("nothing",))

    def tried(monkeypatched):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(case, "main", monkeypatched)
            folder = tmp_path / monkeypatched.__name__
            folder.mkdir()
            case.run(one, folder)

    def says_it_twice(args):
        print("lacmesh: error: a\nlacmesh: error: b", file=sys.stderr)
        return 3

    def leaves_a_file(args):
        print("lacmesh: error: a", file=sys.stderr)
        Path("half").touch()
        return 3

    def takes_memory(args):
        bytes(2 << 30)

    for main in (says_it_twice, leaves_a_file):
        with pytest.raises(AssertionError):
            tried(main)
    with pytest.raises(MemoryError):
        tried(takes_memory)
    with pytest.raises(case.TooSlow), case.alarm(0.05):
        while True:
            pass
