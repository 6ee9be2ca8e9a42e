"""Every bad input gets one sentence and its status, and leaves nothing behind."""

import contextlib
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import warnings
from functools import cache
from pathlib import Path

import pytest

from lacmesh import read
from lacmesh.errors import LacmeshWarning, ReadError
from tests.bad_input import case, command_cases, format_cases, mesh_cases
from tests.bad_input.case import Case, listing
from tests.bad_input.command_cases import GOOD, HALF, STAGES
from tests.samples import each_option

# ---- the cases


@cache
def all_cases():
    """Every case but those that are stopped."""
    return tuple(one for some in (mesh_cases, format_cases, command_cases) for one in some.cases())


def check(one, outcome):
    """Assert the status that is expected, and words on the place."""
    assert outcome.status == one.status, outcome.sentence
    assert re.search(one.says, outcome.sentence), outcome.sentence
    assert len(outcome.sentence) < 1500 and outcome.sentence.isprintable(), outcome.sentence


def test_no_two_cases_have_one_name():
    keys = [one.key for one in all_cases()]
    assert len(set(keys)) == len(keys)


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
    check(one, outcome)
    if outcome.status == 3:  # it names the file: the input, one that belongs to it, the output, or where it is made
        names = [Path(path).name for path in (*folder.iterdir(), one.input, one.out, *one.command)]
        assert any(name in outcome.sentence for name in (*names, tempfile.gettempdir()))


#: cases of files that a reader refuses: all of them, as this takes no command
REFUSED = [
    one for one in all_cases() if one.status == 3 and one.command in (case.CUT, case.INFO) and one.format != "any"
]


@pytest.mark.parametrize("one", parameters(pytest.param(one) for one in REFUSED))
def test_the_reader_says_what_the_command_says(one, folder):
    with contextlib.chdir(folder), case.alarm(case.SECONDS), case.room(case.BYTES), warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        case.made(one, folder)
        with pytest.raises(ReadError) as caught:
            read(one.input)
    check(one, case.Outcome(3, [f"lacmesh: error: {caught.value}"]))


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
        (tmp_path / what).mkdir()
        outcome = case.run(Case("", name, defect.what, content, command=words), tmp_path / what)
        assert outcome.status in (0, 1, 2) and "not-checked" not in outcome.sentence, (what, outcome)


@pytest.mark.parametrize(
    ("stage", "number"),
    [(stage, signal.SIGINT) for stage in STAGES] + [(stage, signal.SIGTERM) for stage in STAGES if stage.first == HALF],
    ids=lambda value: getattr(value, "what", None),
)
def test_stopped(stage, number, tmp_path):
    """A signal ends the command where it is, in a sentence, and leaves the folder as it was."""
    output = stage.command[stage.command.index("-o") + 1] if "-o" in stage.command else ""
    folder, other = tmp_path / "in", tmp_path / "temporary"
    for place in (folder, other):
        place.mkdir()
    (folder / "in.msh").write_bytes(GOOD)
    for name in {output, "r.html", "q.png"} - {""}:
        (folder / name).write_bytes(case.PRECIOUS)
    before = listing(folder)
    args, pipes = (
        [sys.executable, "-c", stage.code(), *stage.command],
        dict.fromkeys(("stdout", "stderr"), subprocess.PIPE),
    )
    with subprocess.Popen(args, env=os.environ | {"TMPDIR": str(other)}, text=True, cwd=folder, **pipes) as child:
        assert child.stdout.readline() == "now\n", child.communicate()
        child.send_signal(number)
        _, said = child.communicate(timeout=100)
    word = "interrupted" if number == signal.SIGINT else "terminated"
    left = f"{output} was written" if stage.written else "nothing was written"
    assert child.returncode == 128 + number and said.count("\n") == 1
    assert said.startswith(f"lacmesh: error: {word}; {left}")
    after = listing(folder)
    assert not listing(other) and (stage.written or after == before)
    if stage.written:
        assert after[output] != case.PRECIOUS and not any(name.startswith(".") for name in after)
        assert (folder / output).with_suffix(".h5").exists() == output.endswith(".xdmf")


def in_process(args, folder, file_size):
    """`lacmesh` as it is installed, with a limit of the files that it writes; then Python keeps no compiled modules."""
    limit = None if file_size is None else lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))
    args = [sys.executable, *(["-B"] if limit else []), "-m", "lacmesh", *args]
    return subprocess.run(args, cwd=folder, capture_output=True, text=True, preexec_fn=limit)


def selected():
    """One case of each library that is shut down with the process, of each status, and of HDF5 on a full disk."""
    cases = [c for c in all_cases() if not c.nobody]
    libraries = {
        Path(c.input).suffix: c for c in cases if c.status and Path(c.input).suffix in (".med", ".xdmf", ".step")
    }
    full = [c for c in cases if c.kind == "full disk" and c.out.endswith((".med", ".xdmf")) and c.file_size]
    return dict.fromkeys([*libraries.values(), *{c.status: c for c in cases}.values(), *full])


@pytest.mark.parametrize("one", parameters(map(pytest.param, selected())))
def test_in_a_process_of_its_own(one, tmp_path):
    """The installed command behaves alike, up to the end of its process, which HDF5 must not end by a signal."""
    args = case.made(one, tmp_path)
    before = listing(tmp_path)
    done = in_process(args, tmp_path, one.file_size)
    assert done.returncode == one.status
    errors = [line for line in done.stderr.splitlines() if not line.startswith("lacmesh: warning: ")]
    assert [line.startswith("lacmesh: error: ") for line in errors] == [True] * bool(one.status)
    assert not one.status or listing(tmp_path) == before
