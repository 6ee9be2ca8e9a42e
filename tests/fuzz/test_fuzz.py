"""Spoilt files of every format, a thin slice (10,000 each: `make fuzz`), and what the trial itself must see."""

from __future__ import annotations

import time
import warnings

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.errors import ReadError
from tests.bad_input import case
from tests.fuzz import trial
from tests.fuzz.trial import FAILED, FORMATS, READ, REFUSED, seeds, tried
from tests.samples import samples


@pytest.mark.parametrize("name", FORMATS)
def test_whole_files_are_read(name, tmp_path):
    """The files are readable before they are corrupted: otherwise the fuzz test would only see errors."""
    for seed in seeds(name):
        for file, content in seed.files.items():
            (tmp_path / file).write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert isinstance(trial._mesh(tmp_path / seed.main), Mesh)


#: files of each format: parts of as many
PARTS, FILES = samples(1, 20), samples(16, 500)


@pytest.mark.fuzz
@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize("name", FORMATS)
def test_spoilt_files_are_read_or_refused(name, part, tmp_path):
    """Within limits of time and memory; `trial.tried(name, number, folder)` tries one again."""
    with case.room(case.BYTES):
        found = {number: tried(name, number, tmp_path) for number in range(part * FILES, (part + 1) * FILES)}
    failed = {number: outcome.text for number, outcome in found.items() if outcome.what == FAILED}
    assert not failed, f"{name} {next(iter(failed.items()))}"
    assert sum(outcome.what == READ for outcome in found.values()) > FILES / 30
    assert sum(outcome.what == REFUSED for outcome in found.values()) > FILES / 4


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
