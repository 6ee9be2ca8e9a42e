"""The note of a file: fields of a mesh, and the records of a cut, which come back with their own mesh and no other."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lacmesh import Cut, Mesh, cut_skin
from lacmesh.cells import CELLS
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, is_cut, without_records
from lacmesh.formats import notes
from lacmesh.formats.builder import MeshBuilder
from lacmesh.mesh import Model, Periodic, Step
from tests.formats.feature_cases import told
from tests.meshes import cell_with_faces


def one_cell(name, variant):
    """Every face of one cell that can be slave alone, cut: each type of cell, and of child."""
    mesh = cell_with_faces(name, facets=[0, len(CELLS[name].facets) - 1])
    return cut_skin(mesh, "slave", hexa=variant).mesh


def same(before, after):
    """Assert that the records of two meshes agree at the same places."""
    was, now = Cut(before), Cut(after)
    assert told(was) == told(now)
    assert was.zones == now.zones and was.n_macros == now.n_macros

    def places(cut):
        near = np.round(cut.mesh.points, 5) + 0.0
        return [sorted(map(tuple, near[nodes].tolist())) for nodes in cut.internal_nodes]

    assert places(was) == places(now)
    assert all(now.mesh.cell_data[n].dtype.kind == "i" for n in CELL_RECORDS)


def noted(mesh, note, number=None):
    """The mesh without a cut, built anew with a note; `number`: of its cells. And the warnings of it."""
    bare = without_records(mesh)
    out = MeshBuilder(Path("part.mail"))
    out.nodes(bare.node_number, bare.points)
    number = bare.cell_number if number is None else number
    for block, a, b in zip(bare.blocks, bare.offsets, bare.offsets[1:], strict=False):
        out.cells(block.type, number[a:b], bare.node_number[block.nodes])
    for name, cells in bare.cell_groups.items():
        out.group("cell", name, number[cells])
    out.read_note(note)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = out.mesh()
    return found, "; ".join(str(w.message) for w in caught)


def note_of(mesh, **rest):
    return notes.dump(mesh, "zones", "records", **rest)


def test_records_go_with_their_own_mesh_alone():
    mesh = one_cell("HEXA8", "hexa")
    found, words = noted(mesh, note_of(mesh))
    same(mesh, found)
    assert not words
    moved = replace(mesh, points=mesh.points + 0.125)
    assert Cut(noted(moved, note_of(mesh))[0]).n_macros == 2  # a moved mesh is the same one
    other = one_cell("TETRA4", "hexa")
    swapped = mesh.cell_number[::-1].copy()
    for wrong, number, why in (
        (other, None, f"of {mesh.n_nodes} nodes"),
        (mesh, mesh.cell_number + 1000, "other cells"),
        (mesh, swapped, "other cells"),
    ):
        found, words = noted(wrong, note_of(mesh), number)
        assert "part.mail: the records of the cut are left out: they are" in words and why in words
        assert not is_cut(found) and not found.zones and NODE_RECORD not in found.node_data


def test_faces_get_back_the_numbers_that_a_file_has_no_place_for():
    mesh = one_cell("HEXA8", "hexa")
    faces = np.flatnonzero(mesh.cell_dim == 2)
    number = mesh.cell_number.copy()
    number[faces] = number.max() + 1 + np.arange(len(faces))[::-1]
    found, words = noted(mesh, note_of(mesh, faces=faces), number)
    assert not words and np.array_equal(found.cell_number, mesh.cell_number)
    same(mesh, found)
    number[np.flatnonzero(mesh.cell_dim == 3)[0]] = mesh.cell_number[faces[0]]
    assert "gives their numbers to other cells" in noted(mesh, note_of(mesh, faces=faces), number)[1]


#: the last value of a column of the records, `()` for none: the columns do not fit each other then
WRONG = {
    ("cells", "lac_macro"): (10**15, 3, [1], None),
    ("cells", "lac_zone"): (1, -1, ()),
    ("cells", "lac_child"): (6, 0),
    ("cells", "lac_parent"): ("1", 1.5, 2**70),
    ("cells", "number"): (10**12,),
    ("internal", "number"): (10**12, ()),
}


@pytest.mark.parametrize(
    ("part", "column", "value"), [(*where, value) for where, some in WRONG.items() for value in some]
)
def test_absurd_records(part, column, value, monkeypatch):
    mesh = one_cell("HEXA8", "hexa")
    note = json.loads(note_of(mesh))
    values = note["records"][part][column]
    at = next(
        k for k in range(len(values) - 1, -1, -1) if column == "number" or note["records"][part]["lac_macro"][k] >= 0
    )
    values[at : at + 1] = [] if value == () else [value]
    found, words = noted(mesh, json.dumps(note))
    assert "left out" in words and not is_cut(found)
    monkeypatch.setattr(notes, "_digest", lambda *_: note["records"]["digest"])
    found, words = noted(mesh, json.dumps(note))
    assert "left out" in words and not is_cut(found)


#: a field in a note -> JSON data that are none
NO_NOTE = {
    "name": [7, ["a"]], "space_dim": [0, 4, 2.0, "2"], "zones": [[7], 7],
    "group_tags": [{"g": [[2]]}, {"g": [[2, 5, 1]]}, [["g"]], {"g": [[2, 5.0]]}],
    "steps": [{"T@0": ["T", 0, -1]}, {"T@0": ["T", "0", -1, 0.5]}, {"T": 1}],
    "model": [{}, {"boundary": [], "periodic": [{}]}, {"boundary": [[3]], "periodic": []}],
}  # fmt: skip


def test_fields_of_a_note_and_other_data():
    """All fields come back, on several lines too; what is none of them leaves the mesh as it is, with a warning."""
    names = ("name", "space_dim", "zones", "group_tags", "steps", "model")
    link = Periodic((2, 1), (2, 7), (1.0, 0.5), np.array([[0, 1]]))
    mesh = Mesh.create(
        np.eye(3)[:, :2], [("TRIA3", [[0, 1, 2]])], node_number=[7, 3, 5], space_dim=3, name="$ é", zones=("a,\n",),
        cell_groups={"g": [0]}, group_tags={"g": ((2, 5),)}, node_data={"T@0": np.ones(3)},
        steps={"T@0": Step("T", 0, -1, 0.5)}, model=Model({(2, 1): (1, -2)}, (link,)),
    )  # fmt: skip
    text = notes.dump(mesh, *names)
    assert text.isascii() and "$" not in text and "".join(notes.in_lines(text, 30)) == text.replace("\n", "")
    bare = replace(mesh, name="mesh", space_dim=2, zones=(), group_tags={}, steps={}, model=None)
    found = notes.load(bare, notes.parse(text), [])
    assert all(getattr(found, name) == getattr(mesh, name) for name in names[:-1])
    assert found.model.boundary == mesh.model.boundary
    (back,) = found.model.periodic
    assert (back.slave, back.master, back.affine, back.nodes.tolist()) == ((2, 1), (2, 7), (1.0, 0.5), [[0, 1]])
    assert notes.dump(bare, *names) == ""
    for key, value in ((key, value) for key, values in NO_NOTE.items() for value in values):
        messages = []
        assert notes.load(bare, {key: value}, messages) is bare
        assert messages == ["lacmesh's own note is damaged and left out"], (key, value)
    assert notes.parse('{"version": 3, "name": "a"}') == {}
    for text in ("[1]", "{", "[" * 100_000, "7"):
        with pytest.raises(ValueError):
            notes.parse(text)
