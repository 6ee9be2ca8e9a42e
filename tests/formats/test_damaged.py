"""Damaged files of every format: an error in one sentence, or a sound mesh.

What is wrong in one place of a file, and what is said of it, is in `tests/bad_input`; files come from `tests/fuzz`.
"""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.errors import LacmeshError, ReadError
from lacmesh.formats.truncation import AT_RISK
from tests.bad_input.case import SECONDS, alarm
from tests.formats import test_vtu, test_xdmf, texts
from tests.formats.feature_cases import OF_MESHIO
from tests.fuzz import trial
from tests.fuzz.trial import FAILED, FORMATS, READ, REFUSED, seeds
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
    assert not failed, f"{name} {next(iter(failed.items()))}"
    assert min(sum(o.what == what for o in outcomes) for what in (READ, REFUSED)) > n / 30


def damaged_texts():
    """(suffix, what is wrong, text, what is said, where) of small files that are damaged in one place."""
    for suffix, table in (("inp", texts.WRONG_INP), ("mail", texts.WRONG_MAIL)):
        for what, (text, line, words) in table.items():
            yield suffix, what, text, re.escape(words), f"line {line}$"
    for old, new, words in texts.WRONG_MSH:
        assert texts.ASCII4.count(old) == 1
        yield "msh", f"{old!r} -> {new!r}", texts.ASCII4.replace(old, new), re.escape(words), "line |byte "
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


HERE = Path(__file__).parent
POINTS = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
MESHES = {
    "surface": [("triangle", [[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6]])],
    "solid": [("tetra", [[0, 1, 3, 5], [0, 3, 2, 6], [0, 5, 3, 6], [4, 6, 5, 0]])],
    "both": [("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]]), ("quad", [[0, 1, 3, 2], [4, 5, 7, 6]])],
}
# ---- formats of meshio: refused at once, whatever meshio's reader would do with them


@pytest.mark.meshio
@pytest.mark.parametrize("path", sorted((HERE / "truncated").iterdir()), ids=lambda path: path.name)
def test_a_truncated_file_is_refused_at_once(path):
    with alarm(SECONDS), pytest.raises(ReadError, match=rf"{path.name}: "):
        lacmesh.read(path)


def written(folder, suffix, name):
    """Small files of a format, in text where it has one; what meshio cannot write so is left out."""
    meshio = pytest.importorskip("meshio")
    for cells in MESHES.values():
        for options in ({}, {"binary": False}):
            path = folder / f"whole{suffix}"
            try:
                meshio.write(path, meshio.Mesh(POINTS, cells), file_format=name, **options)
                yield path.read_bytes(), lacmesh.read(path)
            except (Exception, SystemExit):
                continue


def same(one, other):
    cells = zip(one.blocks, other.blocks, strict=False)
    alike = all(np.array_equal(a.nodes, b.nodes) for a, b in cells)
    return np.array_equal(one.points, other.points) and one.n_cells == other.n_cells and alike


#: beginnings of each file that are tried
N = samples(30, 300)


@pytest.mark.fuzz
@pytest.mark.meshio
@pytest.mark.parametrize("suffix", OF_MESHIO)
@pytest.mark.filterwarnings("ignore")
def test_no_beginning_of_a_file_is_taken_for_another_mesh(suffix, tmp_path):
    name, tried = OF_MESHIO[suffix], 0
    for content, whole in written(tmp_path, suffix, name):
        for n in random.Random(suffix).sample(range(1, len(content)), min(len(content) - 1, N)):
            path = tmp_path / f"cut{suffix}"
            path.write_bytes(content[:n])
            tried += 1
            try:
                with alarm(SECONDS):
                    found = lacmesh.read(path)
            except LacmeshError:
                continue
            ends = content[:n].endswith(b"\n")
            assert same(found, whole) or (name in AT_RISK and ends), (n, len(content), content[max(n - 40, 0) : n])
    assert tried >= N or suffix == ".hmf"


@pytest.mark.meshio
def test_a_whole_last_line_may_be_without_its_end_where_words_end_the_format(tmp_path):
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet"
    (tmp_path / "a.stl").write_text(f"solid\n{facet}\nendsolid")
    assert lacmesh.read(tmp_path / "a.stl").n_cells == 1
