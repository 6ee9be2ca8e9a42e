"""Every type, facet, rotation, orientation and variant of the cut, on one cell; and code_aster's own cuts."""

from __future__ import annotations

import json
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest

from lacmesh import Mesh, aster_multipliers, cut_skin
from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import RING_PARENTS, WHOLE_FACES
from tests.meshes import cell_with_faces
from tests.properties import hold
from tests.samples import each_option, samples
from verification.measures.cutting import same_up_to_numbers

CUTS = Path(__file__).parent / "reference" / "code_aster_cuts"
CASES = [
    (name, j, variant)
    for name, cell in CELLS.items()
    if cell.dim > 1
    for j in range(len(cell.facets))
    for variant in (("pyramid", "hexa") if name in RING_PARENTS and cell.dim == 3 else ("pyramid",))
]
#: (facet type, parent): nodes and cells added, skin and volume together; HEXA20 per variant
COUNTS = {
    ("TRIA3", None): (1, 2), ("QUAD4", None): (4, 5), ("TETRA4", 3): (1, 4), ("TETRA10", 3): (5, 4),
    ("HEXA8", "hexa"): (8, 9), ("HEXA8", "pyramid"): (1, 7), ("HEXA20", "hexa"): (28, 9),
    ("HEXA20", "pyramid"): (9, 7), ("PENTA6", 3): (1, 5), ("PENTA6", 4): (1, 6), ("PENTA15", 3): (7, 5),
    ("PENTA15", 4): (7, 6), ("PYRAM5", 4): (1, 6), ("PYRAM5", 3): (1, 5), ("PYRAM13", 4): (6, 6),
    ("PYRAM13", 3): (6, 5), ("PENTA18", 3): (7, 5), ("PYRAM14", 3): (6, 5),
}  # fmt: skip


def expected_counts(name, j, variant):
    facet = CELLS[name].facets[j].type
    keys = (name, variant), (name, CELLS[facet].n_corners), (name, None)
    return (0, 0) if facet in WHOLE_FACES else next(COUNTS[key] for key in keys if key in COUNTS)


def added(mesh, cut):
    return cut.mesh.n_nodes - mesh.n_nodes, cut.mesh.n_cells - mesh.n_cells


def ways(name, j):
    """Rotations of a facet of a cell, each with both orientations, or with one by turns."""
    n = CELLS[CELLS[name].facets[j].type].n_corners
    every = [*product(range(n if n > 2 else 1), (False, True))]
    return samples(every[1::4] + every[2::4] if n > 2 else every, every)


@pytest.mark.rows(
    "TRIA3-2-pyramid, TRIA6-2-pyramid, TRIA7-0-pyramid, QUAD4-1-pyramid, QUAD8-2-pyramid, QUAD9-0-pyramid, "
    "TETRA4-3-pyramid, TETRA10-1-pyramid, HEXA8-1-hexa, HEXA20-1-pyramid, HEXA27-4-pyramid, PENTA6-1-pyramid, "
    "PENTA15-0-pyramid, PENTA18-0-pyramid, PYRAM5-3-pyramid, PYRAM13-1-pyramid, PYRAM14-1-pyramid"
)
@pytest.mark.fuzz
@pytest.mark.parametrize(("name", "j", "variant"), CASES)
def test_one_cell(name, j, variant):
    for rotation, inward in ways(name, j):
        mesh = cell_with_faces(name, (j,), rotation, inward, seed=rotation)
        cut = cut_skin(mesh, "slave", hexa=variant)
        hold(mesh, cut)
        assert added(mesh, cut) == expected_counts(name, j, variant)
        assert len(cut.mesh.node_groups["all"]) == cut.mesh.n_nodes


@pytest.mark.rows(
    "TRIA3-pyramid, QUAD4-pyramid, TETRA4-pyramid, PYRAM5-pyramid, PENTA6-pyramid, TRIA6-pyramid, QUAD8-pyramid, "
    "TETRA10-pyramid, PYRAM13-pyramid, PENTA15-pyramid"
)
@pytest.mark.fuzz
@pytest.mark.parametrize(
    ("name", "variant"),
    each_option(
        sorted({(n, v) for n, _, v in CASES}, key=lambda row: (CELLS[row[0]].n_nodes, row)),
        of=lambda row: [(CELLS[row[0]].linear, CELLS[row[0]].order), (CELLS[row[0]].linear, row[1])],
    ),
)
def test_every_set_of_slave_faces(name, variant):
    """Several slave faces of one cell, in any order, in one pass: one macro-element each.

    Quadratic cells are cut as their corners are.
    """
    n = len(CELLS[name].facets)
    every = [facets for size in range(2, n + 1) for facets in combinations(range(n), size)]
    for facets in samples([*every[: n * (n - 1) // 2 : 2], *every[n * (n - 1) // 2 :: 4], every[-1]], every):
        size = len(facets)
        way = {"rotation": size, "inward": bool(size % 2)}
        mesh = cell_with_faces(name, facets, **way)
        cut = cut_skin(mesh, "slave", hexa=variant)
        assert cut.n_macros == size
        if (CELLS[name].family, variant) == ("HEXA", "pyramid") and name != "HEXA27":
            first, more = ((1, 7), (1, 6)) if name == "HEXA8" else ((9, 7), (6, 6))
            assert added(mesh, cut) == tuple(np.add(first, np.multiply(size - 1, more)).tolist())
        hold(mesh, cut)
        other = cut_skin(cell_with_faces(name, facets[::-1], **way), "slave", hexa=variant)
        assert same_up_to_numbers(other.mesh, cut.mesh)


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
