"""The records of a cut beside a file, which come back with their mesh and no other; notes in files; the journal."""

from __future__ import annotations

import json
import shutil
import warnings
from dataclasses import replace

import h5py
import numpy as np
import pytest

from lacmesh import Cut, Mesh, cut_skin, raise_order, read, write
from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import RING_PARENTS
from lacmesh.cutting.records import CELL_RECORDS, is_cut
from lacmesh.errors import LacmeshWarning, RequestError, WriteError
from lacmesh.formats import notes, sidecar
from lacmesh.formats.hdf5 import image
from lacmesh.formats.note_types import DAMAGE, from_plain, to_plain
from lacmesh.formats.notes import ARRAY_NOTES, CUT_NOTES, MSH_NOTES
from lacmesh.formats.table import BESIDE, FORMATS, REFUSED
from lacmesh.mesh import Model, Periodic
from lacmesh.topology.skin import FACE_TYPES
from tests.formats import feature_cases
from tests.formats.feature_cases import told
from tests.meshes import cell_with_faces, random_mesh

SOLIDS = [(name, "pyramid") for name, cell in CELLS.items() if cell.dim > 1]
SOLIDS += [(name, "hexa") for name in RING_PARENTS if CELLS[name].dim == 3]
WAYS = [(form, row, dict(row.options)) for form in FORMATS for row in form.fidelity if row.keeps("cut") == BESIDE]
WAYS += [(form, row, {**options, "all_cells": True}) for form, row, options in WAYS if form.name == "inp"]
#: families whose cut a format cannot take, for want of a type of cell
LACKS = {".inp for CalculiX": "PENTA", "mdpa": "PENTA", "nastran": "TRIA QUAD HEXA PENTA", "h5m": "QUAD HEXA PENTA"}


def one_cell(name, variant):
    """Every face of one cell that can be slave alone, cut: each type of cell, and of child."""
    mesh = cell_with_faces(name, facets=[0, len(CELLS[name].facets) - 1])
    return cut_skin(mesh, "slave", hexa=variant).mesh


def quiet(path, mesh, **options):
    """Write and read a mesh; return it and the warnings."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        write(path, mesh, **options)
        found = read(path)
    return found, [str(w.message) for w in said]


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


@pytest.mark.parametrize(("form", "row", "options"), WAYS, ids=[f"{row.title}-{len(o)}" for _, row, o in WAYS])
def test_every_family_by_every_format_of_cells_and_skin(form, row, options, tmp_path):
    if form.meshio:
        pytest.importorskip("meshio")
    suffix, tried = form.suffixes[0], set()
    for k, (name, variant) in enumerate(SOLIDS):
        mesh = one_cell(name, variant)
        lacks = any(row.keeps_cells(kind) == REFUSED for kind in mesh.cells_by_type)
        if lacks or (name == "QUAD9" and suffix == ".inp"):  # which Abaqus has, but not in the plane
            continue
        if form.name == "nastran":  # meshio fails on coordinates of many digits
            mesh = replace(mesh, points=np.round(mesh.points, 6))
        path = tmp_path / f"{k}{suffix}"
        found, said = quiet(path, mesh, **options)
        assert not any("records" in s or "lac_" in s or "zone" in s for s in said)
        assert sidecar.place_of(path).exists()
        same(mesh, found)
        tried.add(CELLS[name].family)
    assert tried == {"TRIA", "QUAD", "TETRA", "HEXA", "PENTA", "PYRAM"} - set(LACKS.get(row.title, "").split())


@pytest.mark.parametrize("form", [form for form in FORMATS if form.sidecar], ids=lambda form: form.name)
def test_skin_alone_by_every_format(form, tmp_path):
    """Formats of one type of cells take the cut of a skin; those that keep arrays need no second file."""
    if form.meshio:
        pytest.importorskip("meshio")
    kinds = [kind for kind in FACE_TYPES if CELLS[kind].dim == 2 and form.fidelity[0].keeps_cells(kind) != REFUSED]
    for kind in kinds:
        one = feature_cases.one_cell(kind)
        mesh = cut_skin(replace(one, cell_groups={"slave": np.array([0])}), "slave", skin_only=True).mesh
        path = tmp_path / f"{kind}{form.suffixes[0]}"
        same(mesh, quiet(path, mesh)[0])
        assert sidecar.place_of(path).exists() == (form.name not in ("vtk", "hmf"))
    assert kinds or form.name in ("su2", "flac3d")  # formats of volumes


@pytest.mark.filterwarnings("ignore:slave faces stand twice")
@pytest.mark.parametrize("suffix", [".mail", ".inp"])
@pytest.mark.parametrize("seed", range(6))
def test_random_numbers_groups_and_twins(suffix, seed, tmp_path):
    rng = np.random.default_rng(seed)
    mesh = random_mesh(
        rng, dim=3 - seed % 2, order=1 + (seed > 2 and suffix == ".mail"), twins=suffix == ".mail", interior=seed > 3
    )
    mesh = replace(cut_skin(mesh, "slave", hexa="hexa").mesh, zones=('été, "links"',))
    found, _ = quiet(tmp_path / f"a{suffix}", mesh, **({"target": "abaqus"} if suffix == ".inp" else {}))
    if suffix == ".mail":  # cells and nodes keep their numbers: so every record is under the same one
        order, back = np.argsort(mesh.cell_number), np.argsort(found.cell_number)
        for name in CELL_RECORDS:
            assert np.array_equal(mesh.cell_data[name][order], found.cell_data[name][back])
        order, back = np.argsort(mesh.node_number), np.argsort(found.node_number)
        assert np.array_equal(mesh.node_data["lac_internal"][order], found.node_data["lac_internal"][back])
        assert found.zones == mesh.zones
    else:
        same(mesh, found)


@pytest.mark.parametrize("suffix", [".mail", ".inp"])
def test_a_file_that_numbers_anew_has_its_parents_under_the_new_numbers(suffix, tmp_path):
    mesh = cut_skin(raise_order(cell_with_faces("HEXA8", facets=[0, 3]), "2"), "slave", hexa="hexa").mesh
    big = np.int64(3_000_000_000)
    parent = mesh.cell_data["lac_parent"].astype(np.int64)
    moved = replace(
        mesh,
        cell_number=mesh.cell_number + big,
        node_number=mesh.node_number[::-1] + big,
        cell_data={**mesh.cell_data, "lac_parent": np.where(parent >= 0, parent + big, -1)},
    )
    found, said = quiet(tmp_path / f"a{suffix}", moved)
    assert "they are 1, 2 ... in the file" in said[0] and found.cell_number.max() < 100
    same(moved, found)
    assert set(found.cell_data["lac_parent"].tolist()) <= {-1, *found.cell_number.tolist()}
    again, _ = quiet(tmp_path / f"b{suffix}", found)
    for name in CELL_RECORDS:
        assert np.array_equal(again.cell_data[name], found.cell_data[name])


def pair(tmp_path):
    """A .mail file of a cut mesh and its records."""
    path = tmp_path / "part.mail"
    write(path, one_cell("HEXA8", "hexa"))
    return path, sidecar.place_of(path)


def refused(path):
    """Read a file whose records are left out, and return its only warning; the mesh then has no records."""
    with pytest.warns(LacmeshWarning) as said:
        found = read(path)
    assert len(said) == 1 and not is_cut(found) and not found.zones and "lac_internal" not in found.node_data
    text = str(said[0].message)
    assert text.startswith(f"{sidecar.place_of(path)}: the records of a cut are left out: ")
    assert text.endswith("; write the mesh again, or take this file away")
    return text


def test_records_go_with_their_own_mesh_alone(tmp_path):
    path, side = pair(tmp_path)
    text = path.read_text()
    x = next(line for line in text.splitlines() if line.startswith("N1 "))
    path.write_text(text.replace(x, "N1 0.125 0.25 0.5"))
    assert Cut(read(path)).n_macros == 2  # a moved mesh is the same one
    path.write_text(text.replace("M1\n", "M1000\n").replace("M1 N", "M1000 N").replace("M1 ", "M1000 "))
    assert "name cells or nodes that the file has not" in refused(path)
    a, b = text.index("QUAD4"), text.index("GROUP_")
    begin = text.index("HEXA8")
    path.write_text(text[:begin] + text[a:b] + text[begin:a] + text[b:])
    assert Cut(read(path)).n_macros == 2  # nor does the order of its parts matter
    cells = text.index("QUAD4")
    first, second = (line.split()[0] for line in text[cells:].splitlines()[1:3])
    swapped = text[cells:].replace(first + " ", "M\0 ").replace(second + " ", first + " ").replace("M\0 ", second + " ")
    path.write_text(text[:cells] + swapped)
    assert "of other cells than those of part.mail, or were changed" in refused(path)
    write(tmp_path / "b.mail", one_cell("TETRA4", "hexa"))
    shutil.copy(tmp_path / "b.mail", path)
    assert "part.mail has 6 and 11" in refused(path)
    shutil.copy(sidecar.place_of(tmp_path / "b.mail"), side)
    assert Cut(read(path)).n_macros == 2


def test_no_damage_is_an_error_or_a_wrong_record(tmp_path):
    path, side = pair(tmp_path)
    whole = side.read_bytes()
    right = read(path)
    rng = np.random.default_rng(1)
    for cut in rng.integers(0, len(whole) - 2, 30).tolist():
        side.write_bytes(whole[:cut])
        refused(path)
    n = 0
    for at in rng.integers(0, len(whole), 150).tolist():
        damaged = bytearray(whole)
        damaged[at] = int(rng.integers(256))
        side.write_bytes(damaged)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            found = read(path)
        assert len(said) <= 1 and is_cut(found) != bool(said)
        n += bool(said)
        for name in CELL_RECORDS if is_cut(found) else ():  # a blank, or the same byte
            assert np.array_equal(found.cell_data[name], right.cell_data[name])
    assert n > 100


HEAD = '{"lacmesh": "records of a cut", "version": 1, '
NO_RECORD = {
    "": "lacmesh did not write it",
    '{"a": 1}': "lacmesh did not write it",
    "[1, 2]": "lacmesh did not write it",
    HEAD: "damaged",
    HEAD + '"nodes": ' + "[" * 100_000: "damaged",
    HEAD + '"nodes": ' + "9" * 10_000 + "}": "damaged",
    HEAD + '"nodes": "many", "cells": 3}': "damaged",
    '{"lacmesh": "records of a cut", "version": 2}': "newer lacmesh",
    '{"lacmesh": "records of a cut", "version": "x"}': "damaged",
    HEAD + " " * 2_000_000: "larger than the records",
    HEAD + '"nodes": "\udcff"}': "damaged",
}


def test_what_is_no_record(tmp_path, monkeypatch):
    path, side = pair(tmp_path)
    held = json.loads(side.read_text())
    held["cells"] |= {"HEXA8": held["cells"]["HEXA8"] - 1, "PENTA6": 1}
    for text, why in (NO_RECORD | {json.dumps(held): "of other types"}).items():
        side.write_bytes(text.encode(errors="surrogateescape"))
        assert why in refused(path)
    with monkeypatch.context() as patch:
        patch.setattr(sidecar, "_loaded", lambda *_: (_ for _ in ()).throw(PermissionError(13, "Permission denied")))
        assert "(Permission denied)" in refused(path)
    side.unlink()
    side.mkdir()
    assert "no regular file" in refused(path)


#: the last value of a column of the records; None for the whole value: there is none
WRONG = {
    ("children", "macro"): (10**15, 3, [1], None),
    ("children", "zone"): (1, -1, ()),
    ("children", "child"): (6, 0),
    ("children", "parent"): (-2, "1", 1.5, 2**70),
    ("children", "cell"): (10**12,),
    ("internal", "node"): (10**12, ()),
    ("internal", "macro"): (2, -1),
}


@pytest.mark.parametrize(
    ("part", "column", "value"), [(*where, value) for where, some in WRONG.items() for value in some]
)
def test_absurd_values_under_a_right_digest(part, column, value, tmp_path, monkeypatch):
    """`()`: the last value is missing, so that the columns do not fit each other."""
    path, side = pair(tmp_path)
    held = json.loads(side.read_text())
    held[part][column][-1:] = [] if value == () else [value]
    side.write_text(json.dumps(held))
    refused(path)
    monkeypatch.setattr(sidecar, "_digest", lambda *_: held["digest"])
    why = refused(path)
    assert "is damaged" in why or "has not, or twice" in why


def test_a_mesh_without_a_cut_takes_old_records_away_and_no_other_file(tmp_path):
    path, side = pair(tmp_path)
    bare = cell_with_faces("HEXA8")
    with pytest.raises(RequestError, match="exists already"):
        write(path, bare, force=False)
    path.unlink()
    with pytest.raises(RequestError, match=r"part\.mail\.lac\.json exists"):
        write(path, bare, force=False)
    assert side.exists() and not path.exists()
    write(path, bare)
    assert not side.exists() and not is_cut(read(path))
    side.write_text('{"mine": 1}')
    write(path, bare)
    assert side.read_text() == '{"mine": 1}'
    side.unlink()
    with pytest.warns(LacmeshWarning, match="cell data lac_macro"):  # data that are no cut are fields like others
        write(path, replace(bare, cell_data={"lac_macro": np.array([0.5, 1.5])}))
    assert [p.name for p in tmp_path.iterdir()] == ["part.mail"]


def test_a_failure_leaves_both_files_as_they_were(tmp_path, monkeypatch):
    """A damaged file of ours is replaced, and another's is not."""
    path, side = pair(tmp_path)
    side.write_bytes(side.read_bytes()[:100])
    write(path, one_cell("HEXA8", "hexa"))
    assert is_cut(read(path))
    before = path.read_bytes(), side.read_bytes()

    def fails(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(sidecar, "to_json", fails)
        with pytest.raises(WriteError, match=r"part\.mail: .*No space left"):
            write(path, one_cell("TETRA4", "hexa"))
    assert (path.read_bytes(), side.read_bytes()) == before and len(list(tmp_path.iterdir())) == 2
    side.write_text("precious")
    with pytest.raises(WriteError, match="lacmesh did not write it"):
        write(path, one_cell("TETRA4", "hexa"))
    assert side.read_text() == "precious" and path.read_bytes() == before[0]


def test_records_go_whole_or_not_at_all(tmp_path):
    """Slave faces that the file does not hold: nothing is written of the cut, and that is said."""
    mesh = replace(one_cell("HEXA8", "hexa"), cell_groups={})
    found, said = quiet(tmp_path / "a.inp", mesh)
    assert said[1:] == ["the records of the cut are left out: 10 of its slave faces are not in the file"]
    assert not is_cut(found) and [p.name for p in tmp_path.iterdir()] == ["a.inp"]
    wrong = one_cell("HEXA8", "hexa")
    odd = replace(wrong, cell_data={**wrong.cell_data, "lac_child": wrong.cell_data["lac_child"] + 7})
    with pytest.warns(LacmeshWarning, match="left out: there are records that no cut leaves"):
        write(tmp_path / "b.mail", odd)
    assert not sidecar.place_of(tmp_path / "b.mail").exists()


def test_skin_on_skin_becomes_one_face_with_the_slaves_record(tmp_path):
    """An .inp file keeps two skin cells on one face as a single face, which is the slave's."""
    one = cell_with_faces("HEXA8")
    skin = np.vstack([one.block("QUAD4"), one.block("QUAD4")[:, ::-1]])
    for slave in (1, 2):
        blocks = [("HEXA8", one.block("HEXA8")), ("QUAD4", skin)]
        twins = Mesh.create(one.points, blocks, cell_groups={"slave": [slave], "twin": [3 - slave]})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = cut_skin(twins, "slave", hexa="hexa").mesh
        found, said = quiet(tmp_path / f"{slave}.inp", mesh)
        assert "5 skin cells lie on others" in said[0] and len(said) == 1
        cut = Cut(found)
        assert np.bincount(cut.macro_of_face[cut.macro_of_face >= 0]).tolist() == [5]
        assert sorted(cut.child_kind[cut.macro_of_face >= 0]) == [1, 2, 3, 4, 5]
        assert np.array_equal(cut.macro_of_node, Cut(mesh).macro_of_node)
        same_faces = found.cell_groups["slave"]
        assert np.array_equal(same_faces, np.flatnonzero(cut.macro_of_face >= 0))


#: a note of lacmesh -> JSON data that are none; what comes back is in the tests of each format
NO_NOTE = {
    "name": [7, None, ["a"]], "space_dim": [0, 4, 2.0, "2", True], "zones": ["a", [7], {"a": 1}],
    "group_tags": [{"g": [[2]]}, {"g": [[2, 5, 1]]}, [["g"]], {"g": [[2, 5.0]]}],
    "steps": [{"T@0": ["T", 0, -1]}, {"T@0": ["T", "0", -1, 0.5]}, {"T": 1}],
    "model": [
        {}, {"boundary": [], "periodic": [{}]}, {"boundary": [[3]], "periodic": []}, {"boundary": 1, "periodic": []},
    ],
    "names": [{"cell": ["a"]}, {"cell": {"a": 1}}, "a"], "shapes": [{"node": {"s": 3}}, {"node": {"s": [1.5]}}],
    "own": [[1], "tags"], "groups": [[None], {}], "file_order": [[1.5], [[1]], ["1"], [2**70]],
}  # fmt: skip
NO_NOTE_OF_MSH = {
    "nodes": ["12", 1.5, 2**63, None], "cells": [[6]],
    "groups": [{"g": []}, [{"name": "g"}], [{"name": 1, "tags": []}], [7]],
    "node_groups": [[{"name": "g", "nodes": ["4"]}], [{"nodes": [4]}]],
    "cell_groups": [[{"name": "g", "nodes": [1]}], 7],
    "extra_cells": [
        [{"type": "TRIA7"}], [{"type": "?", "number": [], "nodes": [], "entity": [], "at": []}],
        [{"type": "TRIA7", "number": [9], "nodes": [1, 2], "entity": [2, 5], "at": [3]}],
    ],
    "node_entity": [[1, 2], [[1, 2, 3]], "1"], "boundary": [[[3, 1]], [[3, 1, 5]], [3]],
    "fields": [[{"on": "node"}], {"on": "node"}],
}  # fmt: skip
NO_NOTE_OF_A_CUT = {
    "nodes": ["12"], "cells": [2, {"HEXA8": "2"}], "digest": [7], "zones": ["slave"],
    "children": [{"cell": [1]}, [1]],
    "internal": [{"node": [7], "macro": []}, {"node": [7], "macro": [-2]}, {"node": [7], "macro": [0.5]}],
}  # fmt: skip


def test_other_data_are_refused():
    for table, wrong in ((ARRAY_NOTES, NO_NOTE), (MSH_NOTES, NO_NOTE_OF_MSH), (CUT_NOTES, NO_NOTE_OF_A_CUT)):
        assert set(table) <= set(wrong) | set(NO_NOTE)
        for key, value in ((key, value) for key, values in wrong.items() for value in values):
            with pytest.raises(DAMAGE):
                from_plain({key: value}, table)
    empty = {"zones": (), "group_tags": {}, "steps": {}, "model": None, "names": {}, "name": "", "space_dim": 3}
    assert to_plain(empty, ARRAY_NOTES) == {"name": "", "space_dim": 3}
    link = Periodic((2, 1), (2, 7), (1.0, 0.5), np.array([[0, 4], [1, 5]]))
    assert notes.mesh_fields({"model": Model({}, (link,)), "mesh": "m"}, 6).keys() == {"model"}
    with pytest.raises(ValueError, match="periodic node outside"):
        notes.mesh_fields({"model": Model({}, (link,))}, 5)


def test_an_error_inside_leaves_the_file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(1000.0)
    before = path.read_bytes()
    with pytest.raises(ZeroDivisionError), image(path, path) as root:
        del root["x"]
        raise ZeroDivisionError
    assert path.read_bytes() == before
    with image(path, path) as root:
        root["z"] = np.arange(3000.0)
    with h5py.File(path) as file:
        assert file["x"][-1] == 999 and file["z"][-1] == 2999
    path.write_bytes(b"no HDF5" * 100)
    with pytest.raises(WriteError, match=r"a\.h5: cannot be written \(HDF5"), image(path, path):
        pass
