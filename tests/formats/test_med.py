"""MED: what we write and read again is the same; medcoupling and gmsh see the same; what is left out is said."""

import json
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import LacmeshWarning, RequestError, WriteError
from lacmesh.formats import med
from lacmesh.mesh import Mesh, Step
from tests.bad_input.format_cases import STEP, put
from tests.bad_input.raw import write_old
from tests.formats.med_peer import ask
from tests.formats.msh_meshes import plain
from tests.meshes import lenient
from tests.samples import samples

HERE = Path(__file__).parents[1]
#: our type -> (MED's name, place in our order of the node MED lists k-th), from ../reference, not from the module
ORDERS = {
    ours: (key.removeprefix("med:"), places)
    for ours, row in json.loads((HERE / "reference" / "node_orders.json").read_text()).items()
    if ours != "about"
    for key, places in row.items()
    if key.startswith("med:")
}
ORDERS |= {
    kind: (name, list(range(n))) for kind, name, n in (("POI1", "PO1", 1), ("SEG2", "SE2", 2), ("SEG3", "SE3", 3))
}
ORDERS |= {"SEG4": ("SE4", [0, 1, 2, 3])}


def home_of(file, mesh="mesh"):
    return file[f"ENS_MAA/{mesh}/{STEP}"]


@pytest.fixture
def cube():
    """A hexahedron, its lower face in two groups, an orphan node."""
    points = [*CELLS["HEXA8"].reference, (5, 5, 5)]
    return Mesh.create(
        points,
        [("HEXA8", [range(8)]), ("QUAD4", [[0, 3, 2, 1], [4, 5, 6, 7]])],
        cell_groups={"body": [0], "slave": [1], "both": [1, 2], "none": []},
        node_groups={"corner": [0, 8], "no node": []},
        cell_number=[7, 70, 71],
        node_number=range(10, 100, 10),
        cell_data={"colour": [1.0, np.nan, 2.0], "lac_macro": np.array([-1, 0, -1], np.int32)},
        node_data={"heat": np.arange(9.0)},
        name="mesh",
    )


# There and back


def arrays(rng, n):
    """Data of every kind that MED holds, with rows that are missing, one array all missing."""
    reals, vectors = rng.normal(size=n), rng.normal(size=(n, 3))
    reals[rng.random(n) < 0.4] = np.nan
    vectors[rng.random(n) < 0.4] = np.nan
    vectors[rng.random((n, 3)) < 0.1] = np.nan
    return {
        "reals": reals,
        "vectors": vectors,
        "missing": np.full(n, np.nan),
        "lac_macro": np.where(rng.random(n) < 0.7, -1, rng.integers(0, 5, n)).astype(np.int32),
        "entity": rng.integers(-1, 3, (n, 2)).astype(np.int32),
        "large": rng.integers(-(2**60), 2**60, n),
        "colour of é": rng.integers(0, 9, n).astype(float),
    }


def random_mesh(rng, types, n_nodes, names, space_dim=3, data=True):
    """A mesh of random connectivity: all that matters to a file, whatever the geometry."""

    def groups(names, n):
        return {name: np.flatnonzero(rng.random(n) < rng.choice([0, 0.3, 1])) for name in names}

    widths = {kind: ALL_CELLS[kind].n_nodes for kind in types}
    blocks = [
        (kind, np.stack([rng.permutation(n_nodes)[:width] for _ in range(rng.integers(1, 5))]))
        for kind, width in widths.items()
    ]
    n_cells = sum(len(rows) for _, rows in blocks)
    steps, cell_data, node_data = {}, {}, {}
    if data and n_cells:
        cell_data, node_data = arrays(rng, n_cells), arrays(rng, n_nodes)
        for k, (number, order, time) in enumerate([(0, -1, 0.0), (1, -1, 0.5), (1, 2, 0.75)]):
            steps[f"moved@{k}"] = Step("moved", number, order, time)
            cell_data[f"moved@{k}"], node_data[f"moved@{k}"] = rng.normal(size=n_cells), rng.normal(size=n_nodes)
        steps["late"], cell_data["late"] = Step("late", 3, -1, 2.5), rng.normal(size=n_cells)
    return Mesh.create(
        rng.normal(size=(n_nodes, 3)) * [1, 1, space_dim == 3], blocks, space_dim=space_dim, name="maillage é 1",
        node_number=rng.permutation(3 * n_nodes)[:n_nodes] + 1, cell_number=rng.permutation(3 * n_cells)[:n_cells] + 1,
        cell_groups=groups(names, n_cells), node_groups=groups(names[::2], n_nodes),
        cell_data=cell_data, node_data=node_data, steps=steps,
    )  # fmt: skip


NAMES = st.lists(
    st.text(st.characters(exclude_categories=("Cs", "Cc")), min_size=1, max_size=20).map(lambda s: s + "é·"),
    max_size=5,
    unique=True,
)


@pytest.mark.fuzz
@settings(max_examples=samples(10, 40), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 10**9),
    types=st.lists(st.sampled_from(sorted(ORDERS)), max_size=6, unique=True),
    names=NAMES,
    n_nodes=st.integers(27, 40),
    data=st.booleans(),
)
def test_round_trip(tmp_path, seed, types, names, n_nodes, data):
    rng = np.random.default_rng(seed)
    flat = all(ALL_CELLS[t].dim < 3 for t in types) and rng.random() < 0.5
    mesh = random_mesh(rng, types, n_nodes, names, 2 if flat else 3, data)
    med.write(tmp_path / "a.med", mesh)
    again = med.read(tmp_path / "a.med")
    assert plain(mesh) == plain(again)
    assert again.cell_number.tolist() == mesh.cell_number.tolist() and again.file_order is None
    med.write(tmp_path / "b.med", again)
    assert plain(again) == plain(med.read(tmp_path / "b.med"))


def test_zones_are_derived_where_our_notes_are_gone(tmp_path):
    rows = [[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5], [0, 4, 5]]
    mesh = Mesh.create(
        np.random.default_rng(0).random((6, 3)),
        [("TRIA3", rows)],
        cell_groups={"slave": [0, 1, 3], "all": range(5), "zone": [0, 1], "big": [0, 1, 2, 3]},
        cell_data={name: np.array([0, 0, 1, -1, 2], np.int32) for name in ("lac_macro", "lac_zone")},
        zones=("a", "b", "c"),
    )
    path = tmp_path / "a.med"
    med.write(path, mesh)
    assert med.read(path).zones == ("a", "b", "c")
    with h5py.File(path, "r+") as file:
        del file["LACMESH"]
    assert med.read(path).zones == ("zone", "zone2", "zone3")


def test_data_that_med_holds_otherwise(tmp_path, cube):
    """Slashes, two shapes under one name, tensors, text: changed as little as possible, and said."""
    cell_data = {
        "a/b": np.arange(3.0),
        "two": np.arange(3.0),
        "tensor": np.arange(27.0).reshape(3, 3, 3),
        "text": np.array(["x"] * 3),
    }
    mesh = replace(cube, cell_data=cell_data, node_data={"two": np.ones((9, 2)), "flag": np.arange(9) > 3})
    with pytest.warns(LacmeshWarning, match=r"tensor.*text.*'a/b' is written as 'a_b'.*'two' is written as 'two_2'"):
        med.write(tmp_path / "a.med", mesh)
    again = med.read(tmp_path / "a.med")
    assert (set(again.cell_data), set(again.node_data)) == ({"a_b", "two", "tensor"}, {"two_2", "flag"})
    np.testing.assert_array_equal(again.cell_data["tensor"], cell_data["tensor"].reshape(3, 9))
    np.testing.assert_array_equal(again.node_data["flag"], np.arange(9) > 3)


# Other programs read what we write
def ours(mesh):
    """Expected result of `med_peer.say`, built from the mesh and the reference's node orders."""
    types, place = {}, {}
    for block, lo in zip(mesh.blocks, mesh.offsets, strict=False):
        name, order = ORDERS[block.type]
        number = mesh.cell_number[lo : lo + len(block.nodes)].tolist()
        types[name] = {"nodes": block.nodes[:, order].tolist(), "number": number}
        place |= {int(lo) + k: [name, k] for k in range(len(block.nodes))}
    return {
        "name": mesh.name,
        "space_dim": mesh.space_dim,
        "points": mesh.points[:, : mesh.space_dim].tolist(),
        "types": types,
        "groups": {name: sorted(place[c] for c in ids.tolist()) for name, ids in mesh.cell_groups.items() if len(ids)},
        "node_groups": {name: ids.tolist() for name, ids in mesh.node_groups.items() if len(ids)},
        "node_number": mesh.node_number.tolist(),
        "all_groups": sorted({*mesh.cell_groups, *mesh.node_groups}),
    }


def assert_says(said, mesh):
    expected = ours(mesh)
    if all(number is None for part in said["types"].values() for number in part["number"]):
        expected["types"] = {
            name: {**part, "number": [None] * len(part["number"])} for name, part in expected["types"].items()
        }
    expected["node_number"] = expected["node_number"] if said["node_number"] else None
    assert {name: said[name] for name in expected} == expected


def dense(field, mesh):
    """medcoupling's pieces of a step as our arrays: (cells, nodes), NaN where there is nothing."""
    start = {ORDERS[b.type][0]: (int(lo), len(b.nodes)) for b, lo in zip(mesh.blocks, mesh.offsets, strict=False)}
    start["NOE"] = (0, mesh.n_nodes)
    width = len(next(iter(field.values()))[1][0])
    found = {"cells": np.full((mesh.n_cells, width), np.nan), "nodes": np.full((mesh.n_nodes, width), np.nan)}
    for support, (places, rows) in field.items():
        lo, n = start[support]
        found["nodes" if support == "NOE" else "cells"][
            lo + np.arange(n)[slice(None) if places is None else places]
        ] = rows
    return found["cells"], found["nodes"]


def assert_fields(said, mesh):
    keys = {}
    for key in (*mesh.cell_data, *mesh.node_data):
        step = mesh.steps.get(key, Step(key))
        keys[step.field, step.number, step.order] = key, step.time
    assert {(name, n, o) for name, steps in said.items() for n, o, _, _ in steps} == set(keys)
    for name, steps in said.items():
        for number, order, time, parts in steps:
            key, expected = keys[name, number, order]
            assert time == expected
            for found, data in zip(dense(parts, mesh), (mesh.cell_data, mesh.node_data), strict=True):
                if key not in data:
                    assert np.isnan(found).all()
                    continue
                values = data[key].reshape(len(data[key]), -1).astype(float)
                if data[key].dtype.kind == "i":
                    values[(data[key].reshape(len(values), -1) == -1).all(axis=1)] = np.nan
                    found = np.where((found == -1).all(axis=1)[:, None], np.nan, found)
                np.testing.assert_array_equal(found, values, err_msg=key)


@pytest.mark.medcoupling
def test_medcoupling_reads_what_we_write(tmp_path):
    pytest.importorskip("medcoupling")
    meshes = {}
    kinds = sorted(ORDERS)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        types = kinds if seed == 0 else [kinds[k] for k in rng.permutation(len(kinds))[: seed + 1]]
        names = ["slave", "peau é à 2", "x" * 80, "ß" * 40, "last"][: seed + 1]
        mesh = random_mesh(rng, types, 30, names)
        mesh = replace(mesh, zones=("zone é",), group_tags={"slave": ((2, 1),)})
        path = tmp_path / f"{seed}.med"
        med.write(path, mesh)
        meshes[str(path)] = mesh
    for path, said in ask("say", *meshes).items():
        assert_says(said, meshes[path])
        assert_fields(said["fields"], meshes[path])


def old_mesh(seed, space_dim):
    rng = np.random.default_rng(seed)
    types = ["TRIA3", "SEG2", "QUAD8"] if space_dim == 2 else ["HEXA20", "TRIA6", "TETRA4", "POI1"]
    mesh = random_mesh(rng, types, 30, ["SLAVE", "peau", "X" * 80], space_dim, data=False)
    heat = np.where(rng.random(30) < 0.5, rng.normal(size=30), np.nan)
    used = {name: ids for name, ids in mesh.cell_groups.items() if len(ids)}
    data = {"u": rng.normal(size=(mesh.n_cells, 2))}
    return replace(
        mesh, name="old", cell_groups=used, node_groups={"N": np.arange(3)}, cell_data=data, node_data={"heat": heat}
    )


@pytest.mark.medcoupling
def test_med_2_3_as_libmed_reads_it(tmp_path):
    """Our reader and libmed agree on files of the layout of MED 2.3, whose cells have no order of types."""
    pytest.importorskip("medcoupling")
    meshes = {}
    for seed, (space_dim, faces, esp) in enumerate(
        ((3, (), True), (2, (), True), (3, ("TRIA6",), True), (3, (), False))
    ):
        path = tmp_path / f"{seed}.med"
        mesh = old_mesh(seed, space_dim)
        write_old(path, mesh, ORDERS, faces, esp)
        read = med.read(path)
        assert plain(mesh) == plain(read)
        meshes[str(path)] = read
    for path, said in ask("say", *meshes).items():
        assert_says(said, meshes[path])
        if "2.med" not in path:  # libmed looks for the field of a face among cells
            assert_fields(said["fields"], meshes[path])
    with h5py.File(tmp_path / "3.med", "r+") as file:  # families may stand at the root
        file.create_group("FAS")
        file.move("ENS_MAA/old/FAS", "FAS/old")
    assert plain(read) == plain(med.read(tmp_path / "3.med"))


# What a file may say, and what we say to it
def edited(tmp_path, mesh, change):
    """The mesh as a file, changed by `change(file, group of the step)`."""
    path = tmp_path / "edited.med"
    with lenient():
        med.write(path, mesh)
    with h5py.File(path, "r+") as file:
        change(file, home_of(file))
    return path


def test_several_meshes(tmp_path, cube):
    path = edited(tmp_path, cube, lambda file, _: file.copy("ENS_MAA/mesh", "ENS_MAA/other"))
    with pytest.raises(RequestError, match="2 meshes, say which: mesh, other"):
        med.read(path)
    with pytest.raises(RequestError, match="did you mean other"):
        med.read(path, "othr")
    assert plain(cube) == plain(med.read(path, "mesh"))
    with pytest.warns(LacmeshWarning, match="cells in 3 undefined families"):
        other = med.read(path, "other")  # without families, fields and notes of its own
    assert (other.name, dict(other.cell_groups), dict(other.cell_data)) == ("other", {}, {})


def _without_numbers(_, step):
    del step["NOE/NUM"], step["MAI/QU4/NUM"], step["MAI/HE8/NUM"]


def _unordered(file, step):
    parts = file.create_group("parts")
    for name in step["MAI"]:
        step.copy(f"MAI/{name}", parts, name)
    del step["MAI"]
    file.move("parts", f"{step.name}/MAI")


def _latin_1(file, _):
    for family in file["FAS/mesh/ELEME"].values():
        names = family["GRO/NOM"]
        rows = [
            b"c\xf4t\xe9".ljust(80) if bytes(row.view("u1")).startswith(b"slave") else bytes(row) for row in names[()]
        ]
        names[...] = np.array([np.frombuffer(row, "i1") for row in rows])


def _gauss(file, _):
    leaf = file[f"CHA/colour/{STEP}/MAI.HE8/MED_NO_PROFILE_INTERNAL"]
    put(leaf, "CO", np.arange(8.0))
    leaf.attrs["NGA"] = 8


def _more(file, step):
    put(step, "NOE/NOM", np.zeros(9 * 16, "i1"))
    file["ENS_MAA/mesh"].create_group("EQS/twins")
    file.copy(step, f"ENS_MAA/mesh/{0:020d}{-1:020d}")
    put(step, "MAI/HE8/FAM", np.array([-99], "i4"))


#: what a file may say: an edit of it, words of the only warning, and what holds of the mesh all the same
EDITS = {
    "numbers that are missing are counted in libmed's order": (  # HEXA8 first in the file, QUAD4 first in libmed
        _without_numbers, [],
        lambda m: (m.node_number.tolist(), m.cell_number.tolist()) == ([*range(1, 10)], [3, 1, 2]),
    ),
    "numbers given twice are counted": (
        lambda _, step: put(step, "MAI/QU4/NUM", np.array([7, 8], "i4")), ["cells are numbered from 1"],
        lambda m: m.cell_number.tolist() == [3, 1, 2],
    ),
    "types without order of links come in libmed's order": (
        _unordered, [],
        lambda m: ([b.type for b in m.blocks], m.cell_number.tolist(), m.cell_groups["both"].tolist())
        == (["QUAD4", "HEXA8"], [70, 71, 7], [0, 1]),
    ),
    "Latin-1 and blanks in names": (_latin_1, [], lambda m: m.cell_groups["côté"].tolist() == [1]),
    "Gauss points are left out whole": (_gauss, ["of colour$"], lambda m: set(m.cell_data) == {"lac_macro"}),
    "what is left out": (
        _more, ["one of the 2 steps", "names of single nodes", "1 undefined families", "equivalences"],
        lambda m: "body" in m.cell_groups,
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", EDITS)
@pytest.mark.filterwarnings("always")
def test_what_a_file_may_say(tmp_path, cube, what, recwarn):
    edit, words, holds = EDITS[what]
    path = edited(tmp_path, cube, edit)
    recwarn.clear()
    assert holds(med.read(path))
    assert len(recwarn) == bool(words)
    assert all(re.search(word, str(one.message)) for one in recwarn for word in words)


@pytest.mark.parametrize("name", ["x" * 81, "é" * 41, "blank ", "", "nul\0l"])
def test_names_that_med_lacks(tmp_path, cube, name):
    for groups in ({"cell_groups": {name: np.array([0])}}, {"node_groups": {name: np.array([0])}}):
        with pytest.raises(WriteError, match="name"):
            med.write(tmp_path / "a.med", replace(cube, **groups))
    for change in ({"name": "m" * 65}, {"cell_data": {"d" * 65: np.zeros(3)}}):
        with pytest.raises(WriteError, match="64 bytes at most"):
            med.write(tmp_path / "a.med", replace(cube, **change))


def test_groups_track_the_order_of_links_and_not_of_attributes(tmp_path, cube):
    med.write(tmp_path / "a.med", cube)
    with h5py.File(tmp_path / "a.med") as file:
        groups = [file["/"]]
        file.visititems(lambda _, o: groups.append(o) if isinstance(o, h5py.Group) else None)
        assert len(groups) > 20
        for group in groups:
            made = group.id.get_create_plist()
            assert (made.get_link_creation_order(), made.get_attr_creation_order()) == (3, 0)
