"""Every bad input of `bad_cases`: what the command says, its status, and that the folder is as it was."""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
import warnings
from pathlib import Path

import pytest

from lacsolver.cli import main
from tests.bad_input.case import alarm, listing, nobody, small_files
from tests.lacsolver.bad_cases import CASES, blocks, put

#: of the processor's time: kernels may have to be compiled first
SECONDS = 300


def said(words, folder, bad):
    """The command's status and what it said of errors, line by line."""
    out = io.StringIO()
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stderr(out),
        contextlib.redirect_stdout(io.StringIO()),
        nobody() if bad.nobody else contextlib.nullcontext(),
        small_files(bad.file_size),
        alarm(SECONDS),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("default")
        try:
            status = main(words)
        except SystemExit as error:
            status = error.code
    lines = out.getvalue().splitlines()
    assert all(line.startswith(("lacsolver: error: ", "lacsolver: warning: ")) for line in lines), lines
    return status, [line.removeprefix("lacsolver: error: ") for line in lines if "error: " in line]


def words_of(command):
    """A command as its arguments; one word is a command on the case."""
    words = command.replace("CASE", "case.toml").split()
    return [*words, "case.toml"] if command in ("validate", "run") else words


@pytest.fixture
def folder():
    """A folder that a user who owns nothing may work in, too."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o777)
        yield Path(name)


@pytest.mark.parametrize("bad", CASES, ids=lambda bad: bad.what)
def test_bad_input(bad, folder):
    put(blocks(), folder)
    (folder / "case.toml").write_bytes(bad.text if isinstance(bad.text, bytes) else bad.text.encode())
    if bad.make:
        bad.make(folder)
    for command in bad.commands:
        before = listing(folder)
        status, lines = said(words_of(command), folder, bad)
        told = "\n".join(lines)
        assert status == bad.status, told
        assert len(lines) == len(bad.patterns), told
        for pattern, line in zip(bad.patterns, lines, strict=True):
            assert re.search(pattern, line), f"{command}: {line}"
        assert "internal error" not in told and "Traceback" not in told
        if bad.then:
            bad.then(folder)
        else:
            assert listing(folder) == before, "something was left, or changed"


def test_the_good_case_is_good(folder):
    put(blocks(), folder)
    (folder / "case.toml").write_text(CASES[2].text.replace("[[contact\n", ""))
    for command in ("validate", "run", "matrices CASE -o m.npz --mtx"):
        assert said(words_of(command), folder, CASES[0]) == (0, [])
    assert (folder / "case" / "results.json").exists() and (folder / "m.mtx").exists()
