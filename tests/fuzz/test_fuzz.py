"""A thin slice of the fuzz test (all of it: `make fuzz`), and what the harness itself must see."""

from __future__ import annotations

import faulthandler
import os
import random
import re
import time
import warnings

import numpy as np
import pytest

import lacmesh
from lacmesh.errors import ReadError
from tests.bad_input import case
from tests.fuzz import pool, trial
from tests.fuzz.seeds import FORMATS, seeds
from tests.fuzz.trial import FAILED, READ, REFUSED, Outcome, tried
from tests.samples import samples

FILES = 24


@pytest.mark.parametrize("name", FORMATS)
def test_whole_files_are_read(name, tmp_path):
    """The files are readable before they are corrupted: otherwise the fuzz test would only see errors."""
    for seed in seeds(name):
        for file, content in seed.files.items():
            (tmp_path / file).write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert trial._read(tmp_path / seed.main).what == READ


@pytest.mark.parametrize("name", FORMATS)
def test_spoilt_files_are_read_or_refused(name, tmp_path):
    found = [tried(name, number, tmp_path) for number in range(FILES)]
    failed = {number: outcome.text for number, outcome in enumerate(found) if outcome.what == FAILED}
    assert not failed, f"python -m tests.fuzz {name!r} --only {next(iter(failed))}"
    assert sum(outcome.what == READ for outcome in found) > FILES / 30
    assert sum(outcome.what == REFUSED for outcome in found) > FILES / 4


def may_end(name, content):
    """True if a file of the format may be whole: `inp` after any line, msh after a section, .mail after FIN."""
    ends = {"inp": rb"", "msh": rb"\$End\w+\s*\Z|\A\s*\Z", "mail": rb"(?m)^\s*FIN\b"}
    end = ends.get(name.split()[0])
    return end is not None and re.search(end, content) is not None


@pytest.mark.fuzz
@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_ends_too_early_is_refused(name, tmp_path):
    rng, n_read = random.Random(name), 0  # a VTU file has all its arrays before its last tags
    for seed in seeds(name):
        for file, content in seed.files.items():
            if file.endswith(".lac.json"):  # without it the mesh is read, with a warning
                continue
            tail = re.search(rb"\s*(</AppendedData>\s*)?(</VTKFile>)?\s*\Z", content)
            for n in rng.sample(range(tail.start() - 1), samples(12, 200)):
                outcome = trial.read_and_checked(replace_file(seed, file, content[:n]), tmp_path)
                assert outcome.what == REFUSED or (outcome.what == READ and may_end(name, content[:n])), (n, outcome)
                n_read += outcome.what == READ
    assert n_read or not name.startswith("inp")


@pytest.mark.fuzz
@pytest.mark.parametrize("name", FORMATS)
def test_spoilt_files_are_sound_meshes_or_refused(name, tmp_path):
    """More files than are tried by commands; here they are read alone."""
    n = samples(60, 1000)
    outcomes = [trial.read_and_checked(trial.spoilt(name, FILES + k), tmp_path) for k in range(n)]
    failed = {FILES + k: outcome.text for k, outcome in enumerate(outcomes) if outcome.what == FAILED}
    assert not failed, f"python -m tests.fuzz {name!r} --only {next(iter(failed))}"
    assert min(sum(o.what == what for o in outcomes) for what in (READ, REFUSED)) > n / 30


def replace_file(seed, file, content):
    return seed._replace(files={**seed.files, file: content})


def test_a_spoilt_file_is_always_the_same():
    for name in ("msh 4.1 ASCII", "inp", "vtu"):
        assert trial.spoilt(name, 7) == trial.spoilt(name, 7) != trial.spoilt(name, 8)


def _chain():
    try:
        bytes(1 << 60)
    except MemoryError as error:
        raise ReadError("a.msh", "cannot be read") from error


def _raise(error):
    raise error


@pytest.mark.parametrize(
    ("reads", "says"),
    [
        (lambda: _raise(KeyError("x")), "KeyError"),
        (lambda: _raise(ReadError("a.msh", "x" * 3000)), "xxx"),
        (lambda: _raise(AssertionError), "takes for granted"),
        (_chain, "memory"),
        (lambda: time.sleep(9), "more than 0.05 s"),
        (lambda: lacmesh.Mesh.create([[0.0, 0]], [], cell_data={"a": np.empty(0, object)}), "data 'a'"),
        (lambda: lacmesh.Mesh.create([[0.0, 0]], [], node_number=[3], group_tags={"g": ((1, 1),)}), "group_tags"),
    ],
)
def test_what_is_a_failure(reads, says, tmp_path, monkeypatch):
    monkeypatch.setattr(trial, "SECONDS", 0.05)
    monkeypatch.setattr(lacmesh, "read", lambda path: reads())
    outcome = tried("mail", 1, tmp_path)
    assert outcome.what == FAILED and says in outcome.text


def test_what_kills_a_worker_or_hangs_is_a_failure(monkeypatch):
    def strange(name, number, folder):
        if number == 3:
            faulthandler.disable()  # a word of pytest's in the middle of its own
            os.abort()
        if number == 11:
            time.sleep(60)
        if number == 12:
            return Outcome(FAILED, "by itself")
        return Outcome(READ if number % 2 else REFUSED)

    monkeypatch.setattr(pool, "tried", strange)
    monkeypatch.setattr(pool, "SECONDS", 1)
    monkeypatch.setattr(pool, "WAITS", 4)
    tally = pool.fuzz("mail", range(20))
    assert set(tally.failed) == {3, 11, 12}
    assert "kills the process" in tally.failed[3] and "does not end" in tally.failed[11]
    assert (tally.read, tally.refused) == (8, 9)
    assert 1e6 < tally.peak < case.BYTES
