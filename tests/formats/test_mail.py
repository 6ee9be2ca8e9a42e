""".mail: what is written is read back, code_aster's grammar is understood, damaged files are errors with a line."""

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
from lacmesh.formats.med.types import MED_TYPES
from lacmesh.mesh import Mesh, Step
from lacmesh.reference.quadrature import measure
from tests.formats.mail_texts import WHOLE
from tests.formats.msh_meshes import lenient, meshes
from tests.meshes import cell_with_faces, random_mesh

some = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))


def read_text(tmp_path, text):
    path = tmp_path / "a.mail"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return mail.read(path)


def again(folder, mesh):
    path = folder / "again.mail"
    mail.write(path, mesh)
    return mail.read(path)


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("mail")


def in_file_order(mesh):
    """Cells type by type in the file's order: (type, number, node numbers)."""
    order = np.arange(mesh.n_cells) if mesh.file_order is None else mesh.file_order
    block = np.searchsorted(mesh.offsets, order, side="right") - 1
    rows = [(int(b), int(c)) for b, c in zip(block, order, strict=True)]
    rows.sort(key=lambda row: row[0])
    return [
        (
            mesh.blocks[b].type,
            int(mesh.cell_number[c]),
            mesh.node_number[mesh.blocks[b].nodes[c - mesh.offsets[b]]].tolist(),
        )
        for b, c in rows
    ]


def kept(mesh):
    """Contents of a mesh that a .mail file keeps, by number and with the file's group names."""
    groups = {}
    for what, found, number in (
        ("nodes", mesh.node_groups, mesh.node_number),
        ("cells", mesh.cell_groups, mesh.cell_number),
    ):
        made = labels(found, "A-Za-z0-9_", 24, ["FIN", "FINSF"])
        groups[what] = {made[name]: sorted(number[members].tolist()) for name, members in found.items()}
    plane = mesh.space_dim == 2 and mesh.dim < 3 and not mesh.points[:, 2].any()
    points = dict(zip(mesh.node_number.tolist(), map(tuple, mesh.points.tolist()), strict=True))
    return {"points": points, "cells": in_file_order(mesh), "space": 2 if plane else 3, "name": mesh.name, **groups}


@some
@given(mesh=meshes(kinds=tuple(NODES)))
def test_round_trip(folder, mesh):
    small = int(max(mesh.node_number.max(), mesh.cell_number.max(initial=0))) <= 9_999_999
    with lenient():
        read = again(folder, mesh)
        if small:
            assert kept(read) == kept(mesh)
        same = again(folder, read)
        first = (folder / "again.mail").read_bytes()
        assert kept(same) == kept(read)
        again(folder, same)
        assert (folder / "again.mail").read_bytes() == first


#: U3.01.00: the edges on which mid-nodes stand, by corners from 1, then centres of faces, in the order of the file.
ORDER = {
    "SEG3": "12",
    "TRIA6": "12 23 31",
    "TRIA7": "12 23 31 123",
    "QUAD8": "12 23 34 41",
    "QUAD9": "12 23 34 41 1234",
    "TETRA10": "12 23 31 14 24 34",
    "PYRAM13": "12 23 34 41 15 25 35 45",
    "PENTA15": "12 23 31 14 25 36 45 56 64",
    "PENTA18": "12 23 31 14 25 36 45 56 64 1254 2365 3146",
    "HEXA20": "12 23 34 41 15 26 37 48 56 67 78 85",
    "HEXA27": "12 23 34 41 15 26 37 48 56 67 78 85 1234 1265 2376 3487 4158 5678 12345678",
}


@pytest.mark.parametrize("kind", [k for k in NODES if k in CELLS])
def test_order_of_nodes(tmp_path, kind):
    """Listed as the documentation says, a cell has a positive volume and its mid-nodes in the middle."""
    mesh = cell_with_faces(kind, facets=())
    mail.write(tmp_path / "a.mail", mesh)
    text = (tmp_path / "a.mail").read_text()
    coordinates = re.search(r"COOR_.D\n(.*?)FINSF", text, re.DOTALL)[1].splitlines()
    point = {row.split()[0]: np.array([*map(float, row.split()[1:]), 0.0])[:3] for row in coordinates}
    listed = re.search(rf"{kind}\nM1 (.*?)FINSF", text, re.DOTALL)[1].split()
    at = np.array([point[name] for name in listed])
    expected = list(range(CELLS[kind].n_corners))
    for k, corners in enumerate(ORDER.get(kind, "").split()):
        assert np.allclose(at[CELLS[kind].n_corners + k], at[[int(c) - 1 for c in corners]].mean(axis=0), atol=1e-12)
        expected.append(k)
    assert len(listed) == len(expected) == CELLS[kind].n_nodes
    if CELLS[kind].dim == 3:
        assert measure(CELLS[kind].linear, at[None, : CELLS[kind].n_corners])[0] > 0


@pytest.mark.parametrize("med", MED_TYPES, ids=lambda med: med.type)
def test_order_is_meds_turned_round(med):
    """code_aster turns MED's 3D cells round: its corners 1 2 3 4 are MED's 1 4 3 2 (routine lrmtyp)."""
    if med.type not in CELLS or CELLS[med.type].dim < 3:
        assert NODES[med.type] == med.nodes
        return
    cell = CELLS[med.type]
    base = 4 if cell.family in ("HEXA", "PYRAM") else 3
    back = [0, *range(base - 1, 0, -1)]
    corners = [*back, *[base + k for k in back]][: cell.n_corners]
    assert [med.nodes[k] for k in corners] == list(NODES[med.type][: cell.n_corners])
    assert sorted(NODES[med.type]) == list(range(cell.n_nodes))


def test_grammar(tmp_path):
    mesh = read_text(tmp_path, WHOLE)
    assert mesh.name == "a plate of two squares"
    assert mesh.space_dim == 2
    assert mesh.node_number.tolist() == [1, 2, 3, 4, 5, 6, 77]
    assert mesh.points[:, :2].tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [3.5, -1.5]]
    assert in_file_order(mesh) == [
        ("QUAD4", 1, [1, 2, 5, 4]),
        ("QUAD4", 12, [2, 3, 6, 5]),
        ("QUAD4", 4, [4, 5, 2, 1]),
        ("SEG2", 3, [1, 2]),
    ]
    assert mesh.cell_number[mesh.file_order].tolist() == [1, 12, 3, 4]
    assert {n: mesh.cell_number[m].tolist() for n, m in mesh.cell_groups.items()} == {"BAS": [3], "TOUT": [1, 12, 4, 3]}
    assert {n: mesh.node_number[m].tolist() for n, m in mesh.node_groups.items()} == {"COIN": [1, 77], "RIEN": []}


@pytest.mark.parametrize(
    "change", [lambda t: t.replace("\n", "\r\n"), lambda t: t.replace(" ", "\t"), lambda t: t + "\0"]
)
def test_other_blanks(tmp_path, change):
    assert kept(read_text(tmp_path, change(WHOLE))) == kept(read_text(tmp_path, WHOLE)) | {
        "name": read_text(tmp_path, change(WHOLE)).name
    }


def test_latin_1_names(tmp_path):
    text = "COOR_2D\nN1 0. 0.\nFINSF\nGROUP_NO NOM=été\nN1\nFINSF\nFIN\n"
    for encoding in ("utf-8", "latin-1"):
        assert list(read_text(tmp_path, text.encode(encoding)).node_groups) == ["été"]


def test_one_dimension(tmp_path):
    mesh = read_text(tmp_path, "COOR_1D\nN1 0.5\nN2 1.5\nFINSF\nSEG2\nM1 N1 N2\nFINSF\nFIN\n")
    assert mesh.points.tolist() == [[0.5, 0, 0], [1.5, 0, 0]]


def test_names_without_numbers_become_a_count(tmp_path):
    text = "COOR_2D\nNW 0. 0.\nNE 1. 0.\nN-1 1. 1.\nFINSF\nSEG2\nS1 NW NE\nFINSF\nPOI1\nP1 N-1\nFINSF\n"
    text += "GROUP_MA NOM=G\nP1\nFINSF\nGROUP_NO NOM=G\nN-1\nFINSF\nFIN\n"
    with pytest.warns(LacmeshWarning) as said:
        mesh = read_text(tmp_path, text)
    assert len(said) == 2
    assert "names of nodes (as N-1)" in str(said[0].message)
    assert "names of cells (as P1)" in str(said[1].message)
    assert in_file_order(mesh) == [("SEG2", 1, [1, 2]), ("POI1", 2, [3])]
    assert mesh.cell_groups["G"].tolist() == [1]
    assert mesh.node_groups["G"].tolist() == [2]


def test_prefixes_may_differ(tmp_path):
    text = "COOR_2D\nA1 0. 0.\nB2 1. 0.\nFINSF\nSEG2\nS10 A1 B2\nFINSF\nPOI1\nP11 B2\nFINSF\n"
    text += "GROUP_MA NOM=G\nP11 S10\nFINSF\nFIN\n"
    mesh = read_text(tmp_path, text)
    assert in_file_order(mesh) == [("SEG2", 10, [1, 2]), ("POI1", 11, [2])]
    assert mesh.cell_groups["G"].tolist() == [0, 1]


def test_leading_zeros_are_other_names(tmp_path):
    text = "COOR_2D\nN1 0. 0.\nN01 1. 0.\nFINSF\nSEG2\nS1 N1 N01\nFINSF\nFIN\n"
    with pytest.warns(LacmeshWarning, match="names of nodes"):
        mesh = read_text(tmp_path, text)
    assert mesh.block("SEG2").tolist() == [[0, 1]]


def test_what_is_no_mesh_is_named(tmp_path):
    with pytest.warns(LacmeshWarning, match=r"a\.mail: left out, as they are no part of a mesh: SYS_UNIT, MATERIAU"):
        read_text(tmp_path, "COOR_2D\nN1 0. 0.\nFINSF\nSYS_UNIT\nm kg\nFINSF\nMATERIAU\nsteel\nFINSF\nFIN\n")


def test_a_node_twice_in_a_cell_is_told(tmp_path):
    text = "COOR_2D\nN1 0. 0.\nN2 1. 0.\nN3 1. 1.\nFINSF\nQUAD4\nM1 N1 N2 N3 N3\nFINSF\nFIN\n"
    with pytest.warns(LacmeshWarning, match="1 cells QUAD4 have a node twice, the first M1"):
        assert read_text(tmp_path, text).block("QUAD4").tolist() == [[0, 1, 2, 2]]


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


def test_lines_and_numbers_are_what_code_aster_reads(tmp_path):
    """80 characters a line; a real number has a point before its exponent."""
    values = [1e-5, -1.2345678901234567e-5, 1e22, -1.2345678901234567e-105, 5e-324, 0.1, 123456789.0, -0.0, 1e16]
    points = np.array([values, values[::-1], values[3:] + values[:3]]).T
    number = np.arange(9) + 9_999_991
    mesh = Mesh.create(points, [("HEXA8", [[0, 1, 2, 3, 4, 5, 6, 7]])], node_number=number, node_groups={"a": range(9)})
    read = again(tmp_path, mesh)
    lines = (tmp_path / "again.mail").read_text().splitlines()
    assert max(map(len, lines)) <= 80
    for word in re.findall(r"(?<=\s)-?[0-9][^\s]*", "\n".join(lines)):
        assert re.fullmatch(r"-?\d+\.\d+(e[+-]\d+)?", word)
    assert np.array_equal(read.points, points)


def test_names_that_code_aster_cannot_hold(tmp_path):
    names = ["a" * 30, "a" * 31, "rive gauche", "rive_gauche", "été", "2nd", "FIN", ""]
    mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], cell_groups={n: [0] for n in names})
    with pytest.warns(LacmeshWarning, match="names of GROUP_MA have 24 letters, digits and _ at most") as said:
        read = again(tmp_path, mesh)
    assert list(read.cell_groups) == [
        "a" * 24,
        "a" * 22 + "_2",
        "rive_gauche_2",
        "rive_gauche",
        "ete",
        "G_2nd",
        "FIN_2",
        "G_",
    ]
    assert "'été' is ete" in str(said[0].message)


def test_what_it_cannot_hold_is_said_once(tmp_path):
    mesh = Mesh.create(
        [[0, 0], [1, 0]],
        [("SEG2", [[0, 1]])],
        cell_data={"lac_macro": [-1], "T": [1.0]},
        node_data={"u": [0.0, 1.0]},
        group_tags={"g": ((1, 2),)},
        cell_groups={"g": [0]},
        zones=("slave",),
        steps={"T": Step("T")},
    )
    with pytest.warns(LacmeshWarning) as said:
        mail.write(tmp_path / "a.mail", mesh)
    assert [str(w.message) for w in said] == [
        ".mail: fields are left out: cell data lac_macro, cell data T, node data u; the zones of the cut are left out: "
        "slave; what only gmsh knows is left out: tags of groups"
    ]


def test_numbers_that_do_not_fit(tmp_path):
    mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], node_number=[7, 10_000_000], cell_number=[5])
    with pytest.warns(LacmeshWarning, match="the numbers of nodes are not distinct or above 9999999"):
        read = again(tmp_path, mesh)
    assert (read.node_number.tolist(), read.cell_number.tolist()) == ([1, 2], [5])


def test_every_keyword_is_known_one_way():
    assert not set(NODES) & mail_read.NOT_READ
    assert set(NODES) <= {*CELLS, "SEG4"}
