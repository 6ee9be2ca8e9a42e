"""The cut: properties that hold for every mesh and every cell, special meshes, refusals, and code_aster's own cuts."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lacmesh import Cut, LacmeshWarning, Mesh, aster_multipliers, cut_skin, generate, raise_order
from lacmesh.cells import CELLS
from lacmesh.errors import CutError, DataError, GroupNotFoundError, RequestError
from lacmesh.mesh import Model, Periodic
from lacmesh.quality import validity_of
from lacmesh.reference.quadrature import measure
from lacmesh.reference.shapes import shape
from tests.meshes import affine, cell_with_faces, lenient, random_mesh, renumbered, worst
from tests.properties import CONFORMING, DOFS, IN_ORDER, KEPT, UNTOUCHED, follow, hold
from tests.samples import samples
from verification.families import cut as family
from verification.families.cut import listed
from verification.measures.cutting import same_up_to_numbers, sizes

VARIANTS = ("pyramid", "hexa", "auto")
CUTS = Path(__file__).parent / "reference" / "code_aster_cuts"
BODIES = [name for name, cell in CELLS.items() if cell.dim > 1]
#: nodes and cells that the first slave face of a cell adds, and each further one
SEVERAL = {("HEXA8", "pyramid"): ((1, 7), (1, 6)), ("HEXA20", "pyramid"): ((9, 7), (6, 6))}


# ---- meshes


def hexa(**changes):
    """A HEXA8 and its slave face."""
    return replace(cell_with_faces("HEXA8"), **changes)


def entities(*pairs):
    return {"entity": np.array(pairs, np.int32)}


def corner(*blocks, points=(), **about):
    """A tetrahedron on the origin and the unit points; other points are numbered from 4 on."""
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], *points]
    return Mesh.create(points, [("TETRA4", [[0, 1, 2, 3]]), *blocks], **about)


def row(n, prism=True, inward=False):
    """A row of n HEXA8, then a PENTA6. Groups of faces: `between` cells, `chain` between hexahedra, `end`."""
    at = lambda x, y, z: x + (n + 1) * (y + 2 * z)  # noqa: E731
    ring = ((0, 0), (1, 0), (1, 1), (0, 1))
    points = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in range(n + 1)]
    blocks = [("HEXA8", [[at(x + i, y, z) for z in (0, 1) for i, y in ring] for x in range(n)])]
    if prism:
        low = len(points)
        points += [[n + 0.7, 0.5, 0], [n + 0.7, 0.5, 1]]
        blocks.append(("PENTA6", [[at(n, 0, 0), low, at(n, 1, 0), at(n, 0, 1), low + 1, at(n, 1, 1)]]))
    faces = [listed(np.array([at(x, y, z) for y, z in ring]), "QUAD4", 1, inward) for x in range(n + prism)]
    first = n + prism
    groups = {"end": [first], "between": range(first + 1, first + len(faces)), "chain": range(first + 1, first + n)}
    return Mesh.create(affine(np.array(points, float)), [*blocks, ("QUAD4", faces)], cell_groups=groups)


BESIDE = Mesh.create(
    [[0, 0], [1, 0], [1, 1], [0, 1], [1.8, 0.4]],
    [("QUAD4", [[0, 1, 2, 3]]), ("TRIA3", [[1, 4, 2]]), ("SEG2", [[1, 2]])],
    cell_groups={"slave": [2]},
)
CUBE = generate.box(1).only("body", "top").renamed(top="slave")
ZONES = generate.box().only("body", "top")
ZONES = replace(ZONES, cell_groups={"a": np.array([8, 9, 10]), "b": np.array([10, 11]), "unused": np.array([0])})
GROUPS = {"slave": [1, 2], "volume": [0], "edge": [2], "mixed": [0, 1]}
EDGE_TOO = corner(("TRIA3", [[0, 2, 1]]), ("SEG2", [[0, 1]]), cell_groups=GROUPS)
OTHER_RECORDS = hexa(cell_data={"lac_macro": np.array([0, -1])})


# ---- what holds for every mesh


@pytest.mark.fuzz
@settings(max_examples=samples(25, 60), deadline=None)
@given(
    *(st.integers(0, 10**9), st.sampled_from([2, 3]), st.sampled_from([1, 2, 3]), st.sampled_from(VARIANTS)),
    *(st.booleans(), st.booleans(), st.integers(1, 8)),
)
def test_random_meshes(seed, dim, order, hexa, interior, twins, slaves):
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves, interior, twins)
    with lenient():
        cut = cut_skin(mesh, "slave", hexa=hexa)
    hold(mesh, cut)
    np.testing.assert_allclose(cut.mesh.node_data["heat"], cut.mesh.points @ [1.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(cut.mesh.node_data["where"], cut.mesh.points, atol=1e-12)
    assert len(cut.mesh.node_groups["every"]) == cut.mesh.n_nodes
    numbers = cut.mesh.cell_number[cut.mesh.file_order]
    new = numbers[numbers > mesh.cell_number.max()]  # they grow along the file
    assert (np.diff(new) == 1).all()


@pytest.mark.fuzz
@settings(max_examples=samples(10, 25), deadline=None)
@given(seed=st.integers(0, 10**9), order=st.sampled_from([1, 2]), hexa=st.sampled_from(VARIANTS))
def test_order_does_not_matter(seed, order, hexa):
    """Permuted nodes, blocks, cells and groups give the same mesh but for its numbers."""
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, 3, order, slaves=6, interior=True)
    other, _ = renumbered(mesh, rng)
    assert same_up_to_numbers(*(cut_skin(m, "slave", hexa=hexa).mesh for m in (other, mesh)))


#: mesh, its slaves, and how many cells of some types its cut has, also with `hexa` alone
SPECIAL = {
    "face between two cells": (row(2, prism=False), "between"),
    "face between two cells, turned": (row(2, prism=False, inward=True), "between"),
    "prism that forces a cone": (row(1), ["between", "end"], {"HEXA8": 0, "QUAD4": 0}),
    "prism whose face is no slave forces none": (row(1), "end", {}, {"HEXA8": 6}),
    "prism that forces cones along a row": (row(4), "between", {"HEXA8": 0}),
    "row": (row(4), "chain", {}, {"PYRAM5": 0}),
    "quadrangle (3) beside triangle (2)": (BESIDE, "slave", {"TRIA3": 5, "QUAD4": 0, "SEG2": 2}),
    "two zones that share a face": (ZONES, ["b", "a"]),
    "two faces": (cell_with_faces("HEXA8", (0, 5)), "slave"),
    "full prism": (cell_with_faces("PENTA18"), "slave", {"TRIA6": 3, "PYRAM14": 3, "TETRA10": 1, "PENTA18": 0}),
}


@pytest.mark.parametrize("hexa", VARIANTS)
@pytest.mark.parametrize("name", SPECIAL)
def test_special_meshes(name, hexa):
    mesh, slave, *counts = SPECIAL[name]
    cut = cut_skin(mesh, slave, hexa=hexa)
    hold(mesh, cut)
    for expected in counts[: 1 + (hexa == "hexa")]:
        assert {kind: cut.mesh.cells_by_type.get(kind, 0) for kind in expected} == expected


def test_children_of_curved_tetrahedra_have_their_parents_own_map():
    mesh = generate.ring((2, 5, 2), (1, 1.75), "TETRA10").only("body", "inner")
    cut = cut_skin(mesh, "inner")
    solid = np.flatnonzero((cut.parent_of_cell >= 0) & (cut.mesh.cell_dim == 3))
    parents = np.searchsorted(mesh.cell_number, cut.parent_of_cell[solid])
    size, whole = (sizes(m) for m in (cut.mesh, mesh))
    np.testing.assert_allclose(np.bincount(parents, size[solid])[parents], whole[parents], rtol=1e-12)
    assert validity_of(cut.mesh).min() > 0
    on_faces = shape("TRIA6", np.array([(2, 2), (1, 1), (4, 1), (1, 4)]) / 6) @ mesh.points[mesh.block("TRIA6")]
    new = cut.mesh.points[mesh.n_nodes :]
    assert np.linalg.norm(on_faces.reshape(-1, 1, 3) - new, axis=2).min(axis=1).max() < 1e-14


@pytest.mark.parametrize("hexa", VARIANTS)
@pytest.mark.parametrize("kind", ["mixed", "mixed 2", "mixed 2-full"])
def test_skin_only_cuts_a_shell(hexa, kind):
    mesh = shell(kind)
    cut = cut_skin(mesh, "slave", hexa=hexa, skin_only=True)
    hold(mesh, cut, IN_ORDER, DOFS, KEPT)
    assert cut.n_macros == mesh.n_cells


def shell(kind="mixed"):
    """Faces of a plane mesh, bent, all of them slaves."""
    plane = generate.rectangle((3, 2), kind=kind).only("body")
    bent = plane.moved(lambda x: [x[0], x[1], np.sin(x[0])])
    return replace(bent, space_dim=3, cell_groups={"slave": np.arange(plane.n_cells)})


# ---- slave groups


@pytest.mark.parametrize("both", [True, False])
def test_a_face_that_is_there_twice_is_cut_twice(both):
    top = CUBE.block("QUAD4")[0]
    blocks = [("QUAD4", [top, listed(top, "QUAD4", 2, True)]), ("HEXA8", CUBE.block("HEXA8"))]
    mesh = Mesh.create(CUBE.points, blocks, cell_groups={"slave": [0, 1] if both else [1], "other": [0]})
    if both:
        with pytest.warns(LacmeshWarning, match="occur twice"):
            cut = cut_skin(mesh, "slave")
        for again in ("slave", "other"):
            assert cut_skin(cut.mesh, again).mesh is cut.mesh
    else:
        cut = cut_skin(mesh, "slave")
        assert not {*cut.mesh.cell_groups["other"]} & {*cut.faces_of_macro[0]}
    hold(mesh, cut, CONFORMING, UNTOUCHED)
    assert cut.n_macros == 1 and cut.mesh.cells_by_type == {"TRIA3": 8, "PYRAM5": 5}
    one, two = (
        {frozenset(n.tolist()) for _, _, rows in cut.mesh.select(cells) for n in rows}
        for cells in (cut.mesh.cell_groups["other"], cut.faces_of_macro[0])
    )
    assert one == two and len(one) == 4


def test_a_cut_mesh_is_not_cut_again():
    mesh = cell_with_faces("HEXA8", (0, 5))
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "one": np.array([1])})
    cut = cut_skin(mesh, "slave")
    assert cut_skin(cut.mesh, "slave").mesh is cut.mesh
    assert cut_skin(cut.mesh, "one").mesh is cut.mesh
    with pytest.raises(CutError, match="cut already"):
        cut_skin(cut_skin(mesh, "one").mesh, "slave")


def test_tags_name_groups():
    mesh = hexa(group_tags={"slave": ((2, 5),)}, cell_data=entities([3, 1], [2, 7]))
    assert cut_skin(mesh, 5).zones == ("slave",)
    assert cut_skin(mesh, "entity:2:07").zones == ("entity:2:7",)
    with pytest.raises(RequestError, match="twice"):
        cut_skin(mesh, ["entity:2:7", "entity:2:07"])
    with pytest.warns(LacmeshWarning, match="in an earlier slave group"):
        assert cut_skin(mesh, ["slave", "entity:2:7"]).n_macros == 1


# ---- refusals and warnings


def case(name, mesh, slave, error, words=None, cells=None, **options):
    return pytest.param(mesh, slave, error, words, cells, options, id=name)


def refused():
    yield case("between", row(2, False), "between", CutError, "between two cells", interface="refuse")
    faces = ("TRIA3", [[0, 2, 1], [4, 5, 6]])
    orphan = corner(faces, points=5 + np.eye(3), cell_number=[10, 20, 77], cell_groups={"slave": [1, 2]})
    yield case("face without a cell", orphan, "slave", CutError, "no parent cell", (77,))
    for name in ("volume", "edge", "mixed"):
        yield case(f"dimension of {name}", EDGE_TOO, name, CutError, "dimension")
    ten = cell_with_faces("TETRA10", (0,))
    face, points = ten.block("TRIA6")[0], np.vstack([ten.points, ten.points[ten.block("TRIA6")[0, 3]]])
    for kind, nodes in (("TRIA3", face[:3]), ("TRIA6", [*face[:3], 10, *face[4:]])):
        mesh = Mesh.create(points, [("TETRA10", ten.block("TETRA10")), (kind, [nodes])], cell_groups={"slave": [1]})
        yield case(f"{kind} on a TETRA10", mesh, "slave", CutError, "mid-nodes")
    yield case("no volumes", shell(), "slave", CutError, "QUAD4, TRIA3; .*--skin-only")
    yield case("cells behind", cell_with_faces("TETRA4"), "slave", CutError, "cells behind them", skin_only=True)
    yield case("no such group", hexa(), "Slav", GroupNotFoundError, "did you mean slave")
    yield case("a group twice", hexa(), ["slave", "slave"], RequestError, "twice")
    yield case("no group", hexa(), [], RequestError)
    yield case("empty group", hexa(cell_groups={"slave": np.empty(0, int)}), "slave", CutError, "empty")
    for option in ({"hexa": "tetra"}, {"ring": 1.0}, {"depth": 0}, {"interface": "x"}, {"orient": "x"}):
        yield case(f"option {option}", hexa(), "slave", RequestError, **option)
    for kind, n, *faces in (("TRIA10", 10, "SEG2"), ("TETRA20", 20, "TRIA3"), ("SEG4", 4, "SEG2", "TRIA3")):
        blocks = [(kind, [range(n)]), *((face, [range(int(face[-1]))]) for face in faces)]
        about = {"cell_number": [70, 5, 6][: len(blocks)], "cell_groups": {"slave": [1]}}
        mesh = Mesh.create(np.random.default_rng(0).random((n, 3)), blocks, **about)
        for only in (True, False):  # such cells are never cut, so what lies on them would be torn off
            yield case(f"{kind}, {only}", mesh, "slave", CutError, f"{kind} 70", (70,), skin_only=only)
    line = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]]), ("POI1", [[0]])], cell_groups={"slave": [1]})
    yield case("a mesh of lines", line, "slave", CutError, "no surface")
    yield case("other records", OTHER_RECORDS, "slave", CutError, "not those of a cut")
    labels = hexa(node_data={"label": np.array(list("abcdefgh"))})
    yield case("data that are no numbers", labels, "slave", DataError, "only numbers")
    for numbers in ([3, 3], [-1, 2]):
        yield case(f"cells {numbers}", hexa(cell_number=np.array(numbers)), "slave", CutError, "not distinct")


@pytest.mark.parametrize("mesh, slave, error, words, cells, options", [*refused()])
def test_refusals(mesh, slave, error, words, cells, options):
    with pytest.raises(error, match=words) as caught:
        cut_skin(mesh, slave, **options)
    assert cells is None or caught.value.cells == cells


def test_a_view_of_a_cut_needs_a_cut():
    for mesh, words in ((hexa(), "no cut"), (OTHER_RECORDS, "not those of a cut")):
        with pytest.raises(CutError, match=words):
            Cut(mesh)
    with pytest.raises(ValueError, match="integers"):
        Mesh.create(hexa().points, hexa().blocks, cell_number=[1.0, 2.0])


def test_cells_of_lower_dimension_in_a_slave_group_are_left_and_those_of_higher_order_elsewhere_are_kept():
    with pytest.warns(LacmeshWarning, match="lower dimension"):
        assert cut_skin(EDGE_TOO, "slave").mesh.cells_by_type == {"TETRA4": 3, "TRIA3": 3, "SEG2": 1}
    far, about = 9 + np.random.default_rng(0).random((20, 3)), {"cell_groups": {"slave": [1], "far": [2]}}
    mesh = corner(("TRIA3", [[0, 2, 1]]), ("TETRA20", [range(4, 24)]), points=far, **about)
    assert cut_skin(mesh, "slave").mesh.cells_by_type == {"TETRA4": 3, "TRIA3": 3, "TETRA20": 1}


def test_periodic_faces_are_warned_of():
    link = Periodic((2, 7), (2, 8), (), np.empty((0, 2), int))
    mesh = hexa(cell_data=entities([3, 1], [2, 7]), model=Model(periodic=(link,)))
    with pytest.warns(LacmeshWarning, match="periodic entities .2:7."):
        cut_skin(mesh, "slave")
    with pytest.warns(LacmeshWarning, match="periodic links"):
        raise_order(mesh)


# ---- options


@pytest.mark.parametrize("name, centre", [("HEXA8", -1), ("HEXA20", -1), ("QUAD4", 1)])
@pytest.mark.parametrize("ring", [0.2, 1 / 3, 0.6])
def test_ring_and_depth(name, centre, ring):
    mesh = cell_with_faces(name)
    for depth in (0.25, 0.5, 0.75):
        cut = cut_skin(mesh, "slave", hexa="hexa", ring=ring, depth=depth)
        hold(mesh, cut)
        ((kind, _, nodes),) = cut.mesh.select(cut.faces_of_macro[0])
        area = measure(kind, cut.mesh.points[nodes])
        np.testing.assert_allclose(area[centre] / area.sum(), ring ** (CELLS[name].dim - 1), rtol=1e-12)


@pytest.mark.parametrize("height", [0.05, 1.0, 20.0])
def test_auto_takes_the_variant_whose_worst_child_is_better(height):
    mesh = replace(CUBE, points=CUBE.points * [1, 1, height])
    cuts = {hexa: cut_skin(mesh, "slave", hexa=hexa).mesh for hexa in VARIANTS}
    least = {hexa: worst(cut) for hexa, cut in cuts.items()}
    assert least["auto"] == max(least["pyramid"], least["hexa"]) and least["pyramid"] != least["hexa"]


# ---- groups and data of nodes, numbers


def test_integer_node_data_are_not_interpolated():
    on_face = np.zeros(8, int)
    on_face[cell_with_faces("HEXA8").block("QUAD4")[0]] = 5
    mesh = hexa(node_data={"same": np.ones(8, int), "mixed": np.arange(8), "on_face": on_face})
    data = cut_skin(mesh, "slave", hexa="hexa").mesh.node_data
    assert data["same"][8:].tolist() == [1] * 8 and data["mixed"][8:].tolist() == [-1] * 8
    assert sorted(data["on_face"][8:].tolist()) == [-1] * 4 + [5] * 4


KINDS = "u1 i2", "u4 i8", "u8 i8", "? i1", "i2 i2", "c16 c16", "f4 f4"


@pytest.mark.parametrize("dtype, becomes", [kind.split() for kind in KINDS])
def test_kinds_of_numbers(dtype, becomes):
    values = np.arange(8).astype(dtype)
    data = cut_skin(hexa(node_data={"v": values}), "slave").mesh.node_data["v"]
    assert data.dtype == np.dtype(becomes)
    np.testing.assert_array_equal(data[:8], values.astype(becomes))
    if dtype != "?":
        face = values[cell_with_faces("HEXA8").block("QUAD4")[0]]
        assert data[8] == pytest.approx(face.mean() if np.dtype(dtype).kind in "fc" else -1)


@pytest.mark.parametrize("second", range(1, 6))
def test_a_child_that_is_cut_again_is_replaced_where_it_is(second):
    """As in code_aster's sequence of cuts: of five pyramids, the one on the second face becomes four tetrahedra."""
    cuts = [cut_skin(cell_with_faces("HEXA8", facets), "slave") for facets in ((0,), (0, second))]
    once, twice = ([row[1:] for row in in_file(c.mesh) if c.parent_of_cell[row[0]] == 1] for c in cuts)
    base = {*CELLS["HEXA8"].facets[second].nodes}
    (place,) = (k for k, (_, nodes) in enumerate(once) if {*nodes[:4]} == base)
    assert [kind for kind, _ in twice] == ["PYRAM5"] * place + ["TETRA4"] * 4 + ["PYRAM5"] * (4 - place)


# ---- every type, facet, rotation, orientation and variant on one cell; and code_aster's own cuts


def cuts(name):
    """Trials of the verification, cut: cells of a type by every facet, turn and variant, and by every set of facets."""
    for trial in family.trials(CELLS[name].dim, (name,), (), 2):
        yield trial, cut_skin(trial.mesh, trial.slave, hexa=trial.hexa)


@pytest.mark.parametrize("name", BODIES)
def test_cells_by_every_facet_turn_variant_and_set_of_facets(name):
    """Nothing is broken, with one macro-element for each slave face."""
    for trial, cut in cuts(name):
        assert not {what: count for what, count in family.broken(trial, cut).items() if count}, trial.label
        follow(trial.mesh, cut)
        assert cut.n_macros == len(trial.mesh.cell_groups["slave"])
        if trial.added is None and (name, trial.hexa) in SEVERAL:
            first, more = np.array(SEVERAL[name, trial.hexa])
            added = cut.mesh.n_nodes - trial.mesh.n_nodes, cut.mesh.n_cells - trial.mesh.n_cells
            assert added == tuple(trial.count * first + (cut.n_macros - trial.count) * more)


# code_aster's own node order (its files say so): mid-nodes by edge, for a cell of so many nodes
ASTER_EDGES = {
    "TRIA": [(0, 1), (1, 2), (2, 0)],
    "QUAD": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "SEG": [(0, 1)],
    "TETRA": [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)],
    "HEXA": [(0, 1), (1, 2), (2, 3), (0, 3), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (4, 7)],
    "PENTA": [(0, 1), (1, 2), (0, 2), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (3, 5)],
    "PYRAM": [(0, 1), (1, 2), (2, 3), (0, 3), (0, 4), (1, 4), (2, 4), (3, 4)],
}


def from_aster(name, nodes):
    """A cell's nodes, from code_aster's order (counted from 1) to gmsh's."""
    cell = CELLS[name]
    nodes = [n - 1 for n in nodes]
    out = nodes[: cell.n_corners]
    if cell.order == 2:
        edges = [frozenset(e) for e in ASTER_EDGES[cell.family]]
        out += [nodes[cell.n_corners + edges.index(frozenset(e))] for e in cell.edges]
        rest = nodes[len(out) :]
        if cell.family == "HEXA" and rest:  # its faces: bottom, front, right, back, left, top
            rest = [rest[k] for k in (0, 1, 4, 2, 3, 5)] + rest[6:]
        out += rest
    return out


def after_aster(data):
    """The mesh that code_aster has made of the cell of a file."""
    after, rows = data["after"], {}
    for number, nodes in enumerate(after["cells"], start=1):
        dim = CELLS[data["cell"]].dim - (number not in after["groups"]["VOL"])
        kind = next(c.name for c in CELLS.values() if c.n_nodes == len(nodes) and c.dim == dim)
        rows.setdefault(kind, []).append((number, from_aster(kind, nodes)))
    numbers = [number for of in rows.values() for number, _ in of]
    slave = np.flatnonzero(np.isin(numbers, after["groups"]["ESCL"]))
    blocks = [(kind, [nodes for _, nodes in of]) for kind, of in rows.items()]
    about = {"cell_number": numbers, "file_order": np.argsort(numbers), "cell_groups": {"ESCL": slave}}
    return Mesh.create(np.array(after["coordinates"], float), blocks, **about)


def in_file(mesh):
    """(index, type, nodes) of each cell in the order of the file."""
    for cell in range(mesh.n_cells) if mesh.file_order is None else mesh.file_order.tolist():
        ((kind, _, (nodes,)),) = mesh.select(np.array([cell]))
        yield cell, kind, nodes.tolist()


@pytest.mark.parametrize("path", sorted(CUTS.glob("*.json")), ids=lambda p: p.stem)
def test_code_aster_cut(path):
    """Positions, children and their order, multipliers: as code_aster's file has them."""
    data = json.loads(path.read_text())
    name, face = data["cell"], data["face_type"]
    before = data["before"]
    blocks = [(kind, [from_aster(kind, nodes)]) for kind, nodes in zip((name, face), before["cells"], strict=True)]
    mesh = Mesh.create(np.array(before["coordinates"], float), blocks, cell_groups={"VOL": [0], "ESCL": [1]})
    cut = cut_skin(mesh, "ESCL", hexa=data["variant"] or "pyramid")
    if "status" in data:  # QUAD9: code_aster stops, we do not
        assert name == "QUAD9" and cut.mesh.n_cells == 2 and cut.n_macros == 1
        return
    ours, theirs, after = cut.mesh, after_aster(data), data["after"]
    distance = np.linalg.norm(ours.points[:, None] - theirs.points[None], axis=2)
    node = distance.argmin(axis=1)  # ours -> theirs
    assert distance.min(axis=1).max() < 1e-11 and sorted(node) == list(range(theirs.n_nodes))
    for (_, kind, nodes), (cell, same, those) in zip(in_file(ours), in_file(theirs), strict=True):
        mine, slave = node[nodes].tolist(), cell in theirs.cell_groups["ESCL"]
        assert kind == same and ((mine == those) if slave else ({*mine} == {*those})), "another child, or its order"
    view = aster_multipliers(cut)
    assert [int(view.patch_of_cell[cell]) for cell, *_ in in_file(ours)] == after["patch_of_cell"]
    of_node = np.zeros(theirs.n_nodes, int)
    of_node[node] = view.patch_of_node
    assert of_node.tolist() == after["patch_of_node"]
    code, *carriers = after["patch_code"]
    assert [view.patch_code[0]] == [code]
    assert sorted(node[view.patch_nodes[0]] + 1) == sorted(carriers)


HALVES = {
    ("HEXA8", "hexa"): ([0.5, 0.5, 0.5, 0.5, 0.25], [2, 2, 2, 2, 4]),
    ("HEXA20", "hexa"): ([0.5, 0.5, 0.5, 0.5, 0.25], [2, 2, 2, 2, 4]),
    ("HEXA8", "pyramid"): ([1, 1, 1, 1], [1, 1, 1, 1]),
    ("TETRA4", "pyramid"): ([1, 1, 1], [1, 1, 1]),
    ("QUAD4", "pyramid"): ([1, 0.5, 1], [1, 2, 1]),
    ("TRIA3", "pyramid"): ([1, 1], [1, 1]),
    ("HEXA27", "pyramid"): ([1], [1]),
    ("TRIA6", "pyramid"): ([1], [1]),
}


@pytest.mark.parametrize(("key", "expected"), HALVES.items(), ids=lambda k: str(k))
def test_halves_and_quarters(key, expected):
    """Figures 3 to 16: the share of each child is one over the multipliers that it carries."""
    name, variant = key
    view = aster_multipliers(cut_skin(cell_with_faces(name), "slave", hexa=variant))
    assert view.share.tolist() == expected[0]
    assert (view.nodes >= 0).sum(axis=1).tolist() == expected[1]
