"""Every type, facet, rotation, orientation and variant of the cut, on one cell; and code_aster's own cuts."""

import json
from pathlib import Path

import numpy as np
import pytest

from lacmesh import Mesh, aster_multipliers, cut_skin
from lacmesh.cells import CELLS
from tests.meshes import cell_with_faces
from tests.properties import follow
from verification.families import cut as family

CUTS = Path(__file__).parent / "reference" / "code_aster_cuts"
BODIES = [name for name, cell in CELLS.items() if cell.dim > 1]
#: nodes and cells that the first slave face of a cell adds, and each further one
SEVERAL = {("HEXA8", "pyramid"): ((1, 7), (1, 6)), ("HEXA20", "pyramid"): ((9, 7), (6, 6))}


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
