"""Damaged files of every format that lacmesh reads by itself: an error in one sentence, or a sound mesh.

What is wrong in one place of a file, and what is said of it, is in `tests/bad_input`; files come from `tests/fuzz`.
"""

from __future__ import annotations

import random
import re

import pytest

import lacmesh
from lacmesh.errors import ReadError
from tests.formats import inp_texts, mail_texts, msh_texts, test_vtu, test_xdmf
from tests.fuzz import trial
from tests.fuzz.seeds import FORMATS, seeds
from tests.fuzz.trial import FAILED, READ, REFUSED
from tests.samples import samples

#: number of the first spoilt file; those before it are tried by the commands (`tests/fuzz`)
_FIRST = 24


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
    outcomes = [trial.read_and_checked(trial.spoilt(name, _FIRST + k), tmp_path) for k in range(n)]
    failed = {_FIRST + k: outcome.text for k, outcome in enumerate(outcomes) if outcome.what == FAILED}
    assert not failed, f"python -m tests.fuzz {name!r} --only {next(iter(failed))}"
    assert min(sum(o.what == what for o in outcomes) for what in (READ, REFUSED)) > n / 30


def damaged_texts():
    """(suffix, what is wrong, text, what is said, where) of small files that are damaged in one place."""
    for suffix, table in (("inp", inp_texts.DAMAGED), ("mail", mail_texts.DAMAGED)):
        for what, (text, line, words) in table.items():
            yield suffix, what, text, re.escape(words), f"line {line}$"
    for old, new, words in msh_texts.DAMAGES:
        assert msh_texts.ASCII4.count(old) == 1
        yield "msh", f"{old!r} -> {new!r}", msh_texts.ASCII4.replace(old, new), re.escape(words), "line |byte "
    for what, (text, words) in test_vtu.WRONG.items():
        yield "vtu", what, text, words, ""
    for what, (body, words) in test_xdmf.WRONG.items():
        yield "xdmf", what, test_xdmf.document(body), words, ""


@pytest.mark.parametrize(
    ("suffix", "text", "says", "where"),
    [pytest.param(suffix, *rest, id=f"{suffix}: {what}") for suffix, what, *rest in damaged_texts()],
)
def test_damage_is_one_sentence_with_its_place(suffix, text, says, where, tmp_path):
    """Small files; many more are in `tests/bad_input`."""
    path = tmp_path / f"bad.{suffix}"
    path.write_text(text)
    with pytest.raises(ReadError, match=says) as caught:
        lacmesh.read(path)
    assert re.match(where, caught.value.place or "")
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def replace_file(seed, file, content):
    return seed._replace(files={**seed.files, file: content})
