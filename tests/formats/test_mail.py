""".mail: what is written is read back, code_aster's grammar is understood, damaged files are in `test_damaged.py`."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning
from lacmesh.formats import mail
from lacmesh.formats.labels import labels
from lacmesh.formats.mail import names as mail_names
from lacmesh.formats.mail import reader as mail_read
from lacmesh.formats.mail.types import NODES
from lacmesh.mesh import Mesh
from tests.formats.msh_meshes import lenient, meshes
from tests.formats.texts import MAIL
from tests.meshes import random_mesh

TWO = "COOR_2D\nN1 0. 0.\nN2 1. 0.\nN3 1. 1.\nFINSF\n"


def read_text(folder, text):
    (folder / "a.mail").write_bytes(text if isinstance(text, bytes) else text.encode())
    return mail.read(folder / "a.mail")


def again(folder, mesh):
    mail.write(folder / "again.mail", mesh)
    return mail.read(folder / "again.mail")


def in_file_order(mesh):
    """Cells type by type in the file's order: (type, number, node numbers)."""
    order = np.arange(mesh.n_cells) if mesh.file_order is None else mesh.file_order
    cells = [(b.type, mesh.node_number[row].tolist()) for b in mesh.blocks for row in b.nodes]
    blocks = np.searchsorted(mesh.offsets, order, side="right")
    return [(cells[c][0], int(mesh.cell_number[c]), cells[c][1]) for c in order[np.argsort(blocks, kind="stable")]]


def members(mesh):
    """Groups by the numbers of their nodes and cells."""
    pairs = (mesh.node_groups, mesh.node_number), (mesh.cell_groups, mesh.cell_number)
    return [{name: number[ids].tolist() for name, ids in found.items()} for found, number in pairs]


def kept(mesh):
    """Contents of a mesh that a .mail file keeps, by number and with the file's group names."""
    groups = []
    for found in members(mesh):
        made = labels(found, "A-Za-z0-9_", 24, ["FIN", "FINSF"])
        groups.append({made[name]: sorted(numbers) for name, numbers in found.items()})
    plane = mesh.space_dim == 2 and mesh.dim < 3 and not mesh.points[:, 2].any()
    points = dict(zip(mesh.node_number.tolist(), map(tuple, mesh.points.tolist()), strict=True))
    return points, in_file_order(mesh), 2 if plane else 3, groups


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(mesh=meshes(kinds=tuple(NODES)))
def test_round_trip(tmp_path_factory, mesh):
    folder = tmp_path_factory.mktemp("mail")
    with lenient():
        read = again(folder, mesh)
        if max(mesh.node_number.max(), mesh.cell_number.max(initial=0)) <= 9_999_999:
            assert (kept(read), read.name) == (kept(mesh), mesh.name)
        same = again(folder, read)
        first = (folder / "again.mail").read_bytes()
        assert kept(same) == kept(read)
        again(folder, same)
        assert (folder / "again.mail").read_bytes() == first


def test_grammar(tmp_path):
    mesh = read_text(tmp_path, MAIL)
    assert (mesh.name, mesh.space_dim) == ("a plate of two squares", 2)
    assert mesh.node_number.tolist() == [1, 2, 3, 4, 5, 6, 77]
    assert mesh.points[:, :2].tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [3.5, -1.5]]
    quads = [("QUAD4", 1, [1, 2, 5, 4]), ("QUAD4", 12, [2, 3, 6, 5]), ("QUAD4", 4, [4, 5, 2, 1])]
    assert in_file_order(mesh) == [*quads, ("SEG2", 3, [1, 2])]
    assert mesh.cell_number[mesh.file_order].tolist() == [1, 12, 3, 4]
    assert members(mesh) == [{"COIN": [1, 77], "RIEN": []}, {"BAS": [3], "TOUT": [1, 12, 4, 3]}]
    for old, new in (("\n", "\r\n"), (" ", "\t"), ("whatever", "\0")):
        assert kept(read_text(tmp_path, MAIL.replace(old, new))) == kept(mesh)
    for encoding in ("utf-8", "latin-1"):
        assert "été" in read_text(tmp_path, MAIL.replace("BAS", "été").encode(encoding)).cell_groups
    line = read_text(tmp_path, "COOR_1D\nN1 0.5\nN2 1.5\nFINSF\nSEG2\nM1 N1 N2\nFINSF\nFIN\n")
    assert line.points.tolist() == [[0.5, 0, 0], [1.5, 0, 0]]


#: a change of a small file, words of the warnings, and its cells all the same
NAMES = {
    "names without numbers": (
        TWO.replace("N3", "N-3") + "SEG2\nS1 N1 N2\nFINSF\nPOI1\nP1 N-3\nFINSF\n",
        ["names of nodes .as N-3", "names of cells .as P1"], [("SEG2", 1, [1, 2]), ("POI1", 2, [3])],
    ),
    "prefixes that differ": (
        TWO.replace("N2", "B2") + "SEG2\nS10 N1 B2\nFINSF\nPOI1\nP11 B2\nFINSF\n",
        [], [("SEG2", 10, [1, 2]), ("POI1", 11, [2])],
    ),
    "leading zeros are other names": (
        TWO.replace("N3", "N01") + "SEG2\nS1 N1 N01\nFINSF\n", ["names of nodes"], [("SEG2", 1, [1, 3])]
    ),
    "what is no mesh": (
        TWO + "SYS_UNIT\nm kg\nFINSF\nMATERIAU\nsteel\nFINSF\n", ["no part of a mesh: SYS_UNIT, MATERIAU"], []
    ),
    "a node twice in a cell": (
        TWO + "QUAD4\nM1 N1 N2 N3 N3\nFINSF\n", ["a node twice, the first M1"], [("QUAD4", 1, [1, 2, 3, 3])]
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", NAMES)
@pytest.mark.filterwarnings("always")
def test_names_become_numbers_and_what_is_odd_is_said(tmp_path, what, recwarn):
    text, words, cells = NAMES[what]
    last = text.split()[-2] if cells else "N1"  # a member of both groups
    mesh = read_text(tmp_path, f"{text}GROUP_NO NOM=G\n{last if cells else 'N1'}\nFINSF\nFIN\n")
    assert in_file_order(mesh) == cells
    assert [mesh.node_number[mesh.node_groups["G"]].tolist()] == [[cells[-1][2][-1]] if cells else [1]]
    assert len(recwarn) == len(words)
    assert all(re.search(word, str(one.message)) for word, one in zip(words, recwarn, strict=True))


def test_compiled_words_are_the_plain_ones():
    rng = np.random.default_rng(3)
    alphabet = [b"N1", b"M22", b"abc_7", b"N0", b"\n", b" ", b"\t", b",", b"\r\n", b"%"[:0], b"N999999999"]
    for _ in range(300):
        text = b" ".join(alphabet[k] for k in rng.integers(0, len(alphabet), rng.integers(0, 12))) + b"\n"
        one, other = mail_names.scanned(text), mail_names.scanned_by_arrays(text)
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
        assert one[2].tolist() == mail_names.words(text).first.tolist()
    for text in (b"N1 7\n", b"N\n", b"N01\n", b"N1a\n", b"N-1\n", b"abcdefgh1\n", b"N1234567890\n", b"\xe9\n"):
        assert mail_names.scanned(text) is None
        assert mail_names.scanned_by_arrays(text) is None


def test_pieces_of_a_large_file(tmp_path, monkeypatch):
    """Read in pieces of a few lines, a file gives the same mesh."""
    mesh = random_mesh(np.random.default_rng(1), order=2, orphans=False)
    while "PYRAM13" not in mesh.cells_by_type:
        mesh = random_mesh(np.random.default_rng(len(mesh.points)), order=2)
    with lenient():
        whole = again(tmp_path, mesh)
    monkeypatch.setattr("lacmesh.formats.text._CHUNK", 100)
    monkeypatch.setattr("lacmesh.formats.text._COMPILED", 50)
    assert kept(mail.read(tmp_path / "again.mail")) == kept(whole) == kept(mesh)


def test_lines_numbers_and_names_are_what_code_aster_reads(tmp_path):
    """80 characters a line; a real number has a point before its exponent; names have 24 letters, digits and _."""
    values = [1e-5, -1.2345678901234567e-5, 1e22, -1.2345678901234567e-105, 5e-324, 0.1, 123456789.0, -0.0, 1e16]
    points = np.array([values, values[::-1], values[3:] + values[:3]]).T
    number = np.arange(9) + 9_999_991
    names = {
        "a" * 30: "a" * 24, "a" * 31: "a" * 22 + "_2", "rive gauche": "rive_gauche_2", "rive_gauche": "rive_gauche",
        "été": "ete", "2nd": "G_2nd", "FIN": "FIN_2", "": "G_",
    }  # fmt: skip
    hexa = [("HEXA8", [range(8)])]
    groups = {name: [0] for name in names}
    mesh = Mesh.create(points, hexa, node_number=number, node_groups={"a": range(9)}, cell_groups=groups)
    with pytest.warns(LacmeshWarning, match="'été' is ete"):
        read = again(tmp_path, mesh)
    assert list(read.cell_groups) == list(names.values())
    lines = (tmp_path / "again.mail").read_text().splitlines()
    assert max(map(len, lines)) <= 80
    for word in re.findall(r"(?<=\s)-?[0-9][^\s]*", "\n".join(lines)):
        assert re.fullmatch(r"-?\d+\.\d+(e[+-]\d+)?", word)
    assert np.array_equal(read.points, points)
    with pytest.warns(LacmeshWarning, match="above 9999999"):
        read = again(tmp_path, Mesh.create(points, hexa, node_number=number + 1, cell_number=[5]))
    assert (read.node_number.tolist(), read.cell_number.tolist()) == ([*range(1, 10)], [5])


def test_every_keyword_is_known_one_way():
    assert not set(NODES) & mail_read.NOT_READ
    assert set(NODES) <= {*CELLS, "SEG4"}
