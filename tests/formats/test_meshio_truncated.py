"""Files of meshio's formats that end too early: refused at once, whatever meshio's reader would do with them."""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest

from lacmesh.errors import LacmeshError, ReadError
from lacmesh.formats import read
from lacmesh.formats.table import OF_NAME
from lacmesh.formats.truncation import AT_RISK
from tests.bad_input.case import SECONDS, alarm
from tests.formats.feature_cases import OF_MESHIO
from tests.samples import samples

meshio = pytest.importorskip("meshio")
pytestmark = pytest.mark.meshio

HERE = Path(__file__).parent
POINTS = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
MESHES = {
    "surface": [("triangle", [[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6]])],
    "solid": [("tetra", [[0, 1, 3, 5], [0, 3, 2, 6], [0, 5, 3, 6], [4, 6, 5, 0]])],
    "both": [("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]]), ("quad", [[0, 1, 3, 2], [4, 5, 7, 6]])],
}


@pytest.mark.parametrize("path", sorted((HERE / "truncated").iterdir()), ids=lambda path: path.name)
def test_a_truncated_file_is_refused_at_once(path):
    with alarm(SECONDS), pytest.raises(ReadError, match=rf"{path.name}: "):
        read(path)


def written(folder, suffix, name):
    """Small files of a format, in text where it has one; what meshio cannot write so is left out."""
    for cells in MESHES.values():
        for options in ({}, {"binary": False}):
            path = folder / f"whole{suffix}"
            try:
                meshio.write(path, meshio.Mesh(POINTS, cells), file_format=name, **options)
                yield path.read_bytes(), read(path)
            except (Exception, SystemExit):
                continue


def same(one, other):
    cells = zip(one.blocks, other.blocks, strict=False)
    alike = all(np.array_equal(a.nodes, b.nodes) for a, b in cells)
    return np.array_equal(one.points, other.points) and one.n_cells == other.n_cells and alike


#: beginnings of each file that are tried
N = samples(30, 300)


@pytest.mark.fuzz
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
                    found = read(path)
            except LacmeshError:
                continue
            ends = content[:n].endswith(b"\n")
            assert same(found, whole) or (name in AT_RISK and ends), (n, len(content), content[max(n - 40, 0) : n])
    assert tried >= N or suffix == ".hmf"


def test_a_whole_last_line_may_be_without_its_end_where_words_end_the_format(tmp_path):
    (tmp_path / "a.stl").write_text(
        "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid"
    )
    assert read(tmp_path / "a.stl").n_cells == 1


def test_the_page_names_the_formats_that_do_not_tell():
    page = (HERE.parents[1] / "docs" / "formats.md").read_text(encoding="utf-8")
    told = re.search(r"at the user's risk: ([^.]*)\.", " ".join(page.split()))[1]
    assert set(re.findall(r"\w+", told)) - {"and"} == set(AT_RISK)
    assert set(AT_RISK) <= set(OF_NAME) and all(OF_NAME[name].meshio for name in AT_RISK)
