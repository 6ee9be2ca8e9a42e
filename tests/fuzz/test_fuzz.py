"""A thin slice of the fuzz test (all of it: `make fuzz`), and what the harness itself must see."""

from __future__ import annotations

import faulthandler
import os
import time
import warnings

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.errors import ReadError
from tests.bad_input import case
from tests.fuzz import pool, trial
from tests.fuzz.seeds import FORMATS, seeds
from tests.fuzz.trial import FAILED, READ, REFUSED, Outcome, tried

FILES = 16


@pytest.mark.parametrize("name", FORMATS)
def test_whole_files_are_read(name, tmp_path):
    """The files are readable before they are corrupted: otherwise the fuzz test would only see errors."""
    for seed in seeds(name):
        for file, content in seed.files.items():
            (tmp_path / file).write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert isinstance(trial._mesh(tmp_path / seed.main), Mesh)


@pytest.mark.parametrize("name", FORMATS)
def test_spoilt_files_are_read_or_refused(name, tmp_path):
    found = [tried(name, number, tmp_path) for number in range(FILES)]
    failed = {number: outcome.text for number, outcome in enumerate(found) if outcome.what == FAILED}
    assert not failed, f"python -m tests.fuzz {name!r} --only {next(iter(failed))}"
    assert sum(outcome.what == READ for outcome in found) > FILES / 30
    assert sum(outcome.what == REFUSED for outcome in found) > FILES / 4


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
