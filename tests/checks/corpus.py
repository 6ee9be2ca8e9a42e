"""Meshes with one defect each, made from healthy ones, and the rule that must name it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lacmesh import Mesh, cut_skin, raise_order
from lacmesh.cells import CELLS
from lacmesh.cut import CELL_RECORDS, NODE_RECORD
from lacmesh.skin import REVERSED
from tests.checks.blocks import block, cut_blocks, join, skin, two_blocks

#: name -> function that makes the mesh; filled by `defect`
CORPUS: dict[str, Case] = {}


@dataclass(frozen=True)
class Case:
    """A broken mesh: how it is made, the rule that names its defect, and how `check` is asked."""

    make: Any
    rule: str
    #: other errors that the same defect is bound to cause
    also: tuple[str, ...] = ()
    asked: dict[str, Any] = field(default_factory=dict)


def defect(rule, name=None, also=(), **asked):
    """Enter a mesh into the corpus."""

    def enter(make):
        key = name or make.__name__
        assert key not in CORPUS
        CORPUS[key] = Case(make, rule, also, {"slave": "slave", "master": "master", **asked})
        return make

    return enter


# ---- tools


def changed(mesh, kind=None, rows=(), nodes=None, points=None, drop=(), add=(), groups=None, **rest):
    """A mesh with some cells' nodes replaced, other points, cells left out, and cells added: (type, nodes, groups).

    Data of the cells follow; those of an added cell are -1.
    """
    points = mesh.points if points is None else np.asarray(points)
    keep = np.setdiff1d(np.arange(mesh.n_cells), drop)
    blocks = {b.type: b.nodes.copy() for b in mesh.blocks}
    if nodes is not None:
        blocks[kind][rows] = nodes
    members = {name: set(np.asarray(g).tolist()) for name, g in mesh.cell_groups.items()} | (groups or {})
    parts, source = [], []
    for k, b in enumerate(mesh.blocks):
        mine = keep[(keep >= mesh.offsets[k]) & (keep < mesh.offsets[k + 1])]
        new = [np.atleast_2d(n) for t, n, _ in add if t == b.type]
        parts.append((b.type, np.concatenate([blocks[b.type][mine - mesh.offsets[k]], *new])))
        source += mine.tolist() + [-1 - i for i, (t, _, _) in enumerate(add) if t == b.type]
    for t in dict.fromkeys(t for t, _, _ in add if t not in blocks):
        parts.append((t, np.concatenate([np.atleast_2d(n) for u, n, _ in add if u == t])))
        source += [-1 - i for i, (u, _, _) in enumerate(add) if u == t]
    names = [*members, *(g for _, _, of in add for g in of if g not in members)]
    inside = lambda name, s: s in members.get(name, ()) if s >= 0 else name in add[-1 - s][2]  # noqa: E731
    cell_groups = {name: [i for i, s in enumerate(source) if inside(name, s)] for name in names}
    data = {name: np.array([v[s] if s >= 0 else -1 for s in source], v.dtype) for name, v in mesh.cell_data.items()}
    node_data = {n: np.concatenate([v, np.full(len(points) - len(v), -1, v.dtype)]) for n, v in mesh.node_data.items()}
    made = Mesh.create(
        points, parts, cell_groups=cell_groups, cell_data=data, node_data=node_data, space_dim=mesh.space_dim, **rest
    )
    return replace(made, zones=mesh.zones)


def at(mesh, *x):
    """The node nearest to a place."""
    return int(np.linalg.norm(mesh.points - np.resize(np.append(x, 0), 3), axis=1).argmin())


def moved(mesh, node, by):
    """A mesh with one node moved."""
    points = mesh.points.copy()
    points[node] += by
    return changed(mesh, points=points)


def of_type(mesh, kind, group):
    """(rows in the block, nodes) of the cells of one type in a group."""
    k = [b.type for b in mesh.blocks].index(kind)
    cells = mesh.cell_groups[group]
    cells = cells[(cells >= mesh.offsets[k]) & (cells < mesh.offsets[k + 1])]
    return cells - mesh.offsets[k], mesh.block(kind)[cells - mesh.offsets[k]]


def reversed_group(mesh, group):
    """A mesh with the faces of a group turned over."""
    blocks = []
    for k, b in enumerate(mesh.blocks):
        nodes = b.nodes.copy()
        cells = mesh.cell_groups[group]
        rows = cells[(cells >= mesh.offsets[k]) & (cells < mesh.offsets[k + 1])] - mesh.offsets[k]
        if len(rows):
            nodes[rows] = nodes[rows][:, REVERSED[b.type]]
        blocks.append(b._replace(nodes=nodes))
    return replace(mesh, blocks=tuple(blocks))


def without_records(mesh):
    """A cut mesh as another program would write it."""
    data = {k: v for k, v in mesh.cell_data.items() if k not in CELL_RECORDS}
    return replace(
        mesh, cell_data=data, node_data={k: v for k, v in mesh.node_data.items() if k != NODE_RECORD}, zones=()
    )


# ---- the mesh as a whole


@defect("no-cells", slave="line", master=None)
def only_lines():
    return Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], cell_groups={"line": [0]})


@defect("no-cells", slave="none", master=None)
def nothing_at_all():
    return Mesh.create(np.zeros((0, 3)), [], cell_groups={"none": []})


@defect("not-finite")
def a_coordinate_that_is_no_number():
    mesh = cut_blocks()
    return moved(mesh, at(mesh, 0.33, 0.33, 1.67), np.nan)


@defect("not-finite")
def an_infinite_coordinate():
    mesh = cut_blocks("TETRA10")
    return moved(mesh, at(mesh, 0.33, 0.33, 1.67), np.inf)


@defect("repeated-number")
def two_cells_of_one_number():
    mesh = cut_blocks()
    number = mesh.cell_number.copy()
    number[3] = number[7]
    return replace(mesh, cell_number=number)


@defect("repeated-number")
def a_negative_node_number():
    mesh = cut_blocks()
    number = mesh.node_number.copy()
    number[-1] = -4
    return replace(mesh, node_number=number)


@defect("repeated-node")
def a_hexahedron_that_lists_a_node_twice():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    last = nodes[-1].copy()
    last[6] = last[7]
    return changed(mesh, "HEXA8", rows[-1], last)


@defect("repeated-cell")
def the_same_hexahedron_twice():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "HEXA8", "body1")
    return changed(mesh, add=[("HEXA8", nodes[-1], ["body1"])])


@defect("repeated-cell")
def a_cell_inside_the_body_listed_again_from_another_corner():
    mesh = cut_blocks("TETRA4")
    _, nodes = of_type(mesh, "TETRA4", "body1")
    return changed(mesh, add=[("TETRA4", nodes[80][[1, 2, 0, 3]], ["body1"])])


@defect("invalid-cell")
def a_node_pushed_through_its_cells():
    mesh = cut_blocks()
    return moved(mesh, at(mesh, 1 / 3, 1 / 3, 1 + 2 / 3), [0.5, 0.5, 0.0])


@defect("invalid-cell")
def a_mid_node_beyond_the_quarter_of_its_edge():
    mesh = cut_blocks("TETRA10")
    mid = mesh.block("TETRA10")[of_type(mesh, "TETRA10", "body1")[0][-1]]
    a, b = mesh.points[mid[0]], mesh.points[mid[1]]
    return moved(mesh, mid[4], 0.4 * (b - a))


@defect("invalid-cell")
def a_flat_tetrahedron():
    mesh = cut_blocks("TETRA4")
    corner = at(mesh, 1, 1, 2.01)
    points = np.vstack([mesh.points, mesh.points[corner] + [0.3, 0.0, 0.0], mesh.points[corner] + [0.0, 0.3, 0.0]])
    points = np.vstack([points, mesh.points[corner] + [0.3, 0.3, 0.0]])
    n = mesh.n_nodes
    return changed(mesh, points=points, add=[("TETRA4", [corner, n, n + 1, n + 2], ["body1"])])


@defect("inverted-cell")
def a_hexahedron_inside_out():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    return changed(mesh, "HEXA8", rows[-1], nodes[-1][[4, 5, 6, 7, 0, 1, 2, 3]])


@defect("inverted-cell")
def a_quadratic_tetrahedron_inside_out():
    mesh = cut_blocks("TETRA10")
    rows, nodes = of_type(mesh, "TETRA10", "body1")
    return changed(mesh, "TETRA10", rows[90], nodes[90][[0, 2, 1, 3, 6, 5, 4, 7, 9, 8]])


@defect("clockwise-cell")
def a_plane_cell_listed_clockwise():
    mesh = cut_blocks("QUAD4")
    rows, nodes = of_type(mesh, "QUAD4", "body1")
    return changed(mesh, "QUAD4", rows[-1], nodes[-1][[0, 3, 2, 1]])


@defect("poor-cell")
def a_cell_almost_flat():
    mesh = cut_blocks()
    return moved(mesh, at(mesh, 1, 1, 2.01), np.full(3, -0.32 / 3))  # at 1/3 the corner is flat


@defect("crowded-facet")
def a_third_cell_on_a_facet():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "HEXA8", "body1")
    inner = nodes[0][list(CELLS["HEXA8"].facets[5].nodes)]
    points = np.vstack([mesh.points, mesh.points[inner].mean(axis=0) + [0, 0, 0.1]])
    return changed(mesh, points=points, add=[("PYRAM5", [*inner, mesh.n_nodes], ["body1"])])


@defect("overlapping-cells")
def two_cells_on_one_side_of_a_facet():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "HEXA8", "body1")
    top = nodes[-1][list(CELLS["HEXA8"].facets[5].nodes)][::-1]
    points = np.vstack([mesh.points, mesh.points[top].mean(axis=0) - [0, 0, 0.1]])
    return changed(mesh, points=points, add=[("PYRAM5", [*top, mesh.n_nodes], ["body1"])])


@defect("mid-nodes-differ")
def a_mid_node_of_its_own():
    mesh = cut_blocks("HEXA20")
    rows, nodes = of_type(mesh, "HEXA20", "body1")
    mine = nodes[13].copy()
    points = np.vstack([mesh.points, mesh.points[mine[8]]])
    mine[8] = mesh.n_nodes
    return changed(mesh, "HEXA20", rows[13], mine, points=points)


@defect("mid-nodes-differ")
def a_slave_face_with_a_mid_node_of_its_own():
    mesh = cut_blocks("TETRA10")
    rows, nodes = of_type(mesh, "TRIA6", "slave")
    mine = nodes[0].copy()
    points = np.vstack([mesh.points, mesh.points[mine[3]]])
    mine[3] = mesh.n_nodes
    return changed(mesh, "TRIA6", rows[0], mine, points=points)


@defect("mid-nodes-differ")
def linear_beside_quadratic():
    mesh = cut_blocks("HEXA20")
    rows, nodes = of_type(mesh, "HEXA20", "body1")
    return changed(mesh, drop=[mesh.cell_groups["body1"][-1]], add=[("HEXA8", nodes[-1][:8], ["body1"])])


@defect("torn-body")
def a_node_inside_an_edge_away_from_the_skins():
    low = block((2, 2, 2), (0, 0, 0), (1, 1, 1))
    high = block((2, 2, 2), (0, 0, 1.01), (1, 1, 2))
    on = lambda z: lambda x: np.abs(x[..., 2] - z) < 1e-9  # noqa: E731
    fine = block((4, 2, 2), (0, 0, 2), (1, 1, 3))
    mesh = join([(*low, {"slave": skin(*low, on(1))}), (*high, {"master": skin(*high, on(1.01))}), (*fine, {})])
    return cut_skin(merged(mesh), "slave").mesh


def merged(mesh):
    """A mesh whose nodes at one place are one."""
    _, first, inverse = np.unique(mesh.points.round(9), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[order] = np.arange(len(first))
    new = rank[inverse.ravel()]
    blocks = [(b.type, new[b.nodes]) for b in mesh.blocks]
    return Mesh.create(mesh.points[first[order]], blocks, cell_groups=mesh.cell_groups)


@defect("coincident-nodes")
def a_body_torn_along_a_plane():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    upper = mesh.points[nodes].mean(axis=1)[:, 2] > 1.4
    torn = np.unique(nodes[upper])
    torn = torn[(np.abs(mesh.points[torn, 2] - (1.01 + 1 / 3)) < 1e-9) & (mesh.points[torn, 0] < 0.5)]
    new = np.arange(mesh.n_nodes)
    new[torn] = mesh.n_nodes + np.arange(len(torn))
    return changed(mesh, "HEXA8", rows[upper], new[nodes[upper]], points=np.vstack([mesh.points, mesh.points[torn]]))


@defect("unreferenced-node")
def a_node_of_no_cell():
    mesh = cut_blocks()
    return changed(mesh, points=np.vstack([mesh.points, [5.0, 5.0, 5.0]]))


# ---- the skins


@defect("empty-skin", slave=["slave", "nobody"])
def an_empty_group():
    return changed(cut_blocks(), groups={"nobody": set()})


@defect("empty-skin", master="edges")
def a_master_of_lines():
    mesh = cut_blocks()
    return changed(mesh, add=[("SEG2", [0, 1], ["edges"])])


@defect("wrong-dimension")
def a_volume_in_the_slave_group():
    mesh = cut_blocks()
    inside = set(mesh.cell_groups["slave"].tolist()) | {int(mesh.cell_groups["body0"][0])}
    return changed(mesh, groups={"slave": inside})


@defect("lower-dimension")
def lines_in_the_slave_group():
    return changed(cut_blocks(), add=[("SEG2", [0, 1], ["slave"])])


@defect("unsupported-face")
def a_slave_face_of_order_3():
    mesh = cut_blocks()
    points = np.vstack([mesh.points, np.random.default_rng(0).random((10, 3)) + 5])
    return changed(mesh, points=points, add=[("TRIA10", mesh.n_nodes + np.arange(10), ["slave"])])


@defect("unsupported-face", slave="slave", master=None)
def a_cell_of_order_3_behind():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "TRIA3", "slave")
    corners = nodes[:1, :3]
    behind = [c for c in mesh.block("PYRAM5") if set(corners[0]) <= set(c)]
    assert len(behind) == 1
    number = [b.type for b in mesh.blocks].index("PYRAM5")
    row = int(np.flatnonzero((mesh.block("PYRAM5") == behind[0]).all(axis=1))[0])
    more = mesh.points[behind[0]].mean(axis=0) + 0.01 * np.random.default_rng(1).random((25, 3))
    nodes = [*behind[0], *(mesh.n_nodes + np.arange(25))]
    return changed(
        mesh,
        points=np.vstack([mesh.points, more]),
        drop=[mesh.offsets[number] + row],
        add=[("PYRAM30", nodes, ["body0"])],
    )


@defect("repeated-face")
def a_slave_face_twice():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "TRIA3", "slave")
    return changed(mesh, add=[("TRIA3", nodes[2], ["slave"])])


@defect("repeated-face")
def a_master_face_twice():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "QUAD4", "master")
    return changed(mesh, add=[("QUAD4", nodes[2][[1, 2, 3, 0]], ["master"])])


@defect("face-in-two-zones", slave=["slave", "again"])
def a_face_in_two_zones():
    mesh = cut_blocks()
    return changed(mesh, groups={"again": set(mesh.cell_groups["slave"][:4].tolist())})


@defect("duplicate")
def another_cell_on_a_slave_face():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "TRIA3", "slave")
    return changed(mesh, add=[("TRIA3", nodes[2], ["coating"])])


@defect("no-parent")
def cells_behind_missing():
    mesh = cut_blocks()
    first = np.flatnonzero(mesh.cell_data["lac_parent"] == mesh.cell_data["lac_parent"][mesh.cell_groups["body0"][-1]])
    return changed(mesh, drop=first)


@defect("bare-master")
def a_rigid_master():
    mesh = cut_blocks()
    return changed(mesh, drop=mesh.cell_groups["body1"])


@defect("interface", slave="inside", master=None)
def a_slave_inside_the_body():
    points, cells = block((2, 2, 2), (0, 0, 0), (1, 1, 1))
    low = {"HEXA8": cells["HEXA8"][points[cells["HEXA8"]].mean(axis=1)[:, 2] < 0.5]}
    inside = skin(points, low, lambda x: np.abs(x[..., 2] - 0.5) < 1e-9)
    return cut_skin(join([(points, cells, {"inside": inside})]), "inside").mesh


@defect("orientation")
def a_slave_turned_inward():
    return cut_skin(reversed_group(two_blocks(), "slave"), "slave").mesh


@defect("orientation")
def a_master_turned_inward():
    return reversed_group(cut_blocks("QUAD8"), "master")


@defect("orientation")
def a_bare_master_that_turns_both_ways():
    mesh = cut_blocks()
    mesh = changed(mesh, drop=mesh.cell_groups["body1"])
    return replace(
        reversed_group(replace(mesh, cell_groups={"x": mesh.cell_groups["master"][:1]}), "x"),
        cell_groups=mesh.cell_groups,
    )


@defect("non-manifold")
def a_fin_on_the_slave():
    mesh = cut_blocks("HEXA27")
    inner = skin(
        mesh.points,
        {"HEXA27": mesh.block("HEXA27")},
        lambda x: (np.abs(x[..., 0] - 0.5) < 1e-9) & (x[..., 2] > 0.45) & (x[..., 2] < 1.005),
    )
    fin = next(f for f in inner["QUAD9"] if at(mesh, 0.5, 0.5, 1.0) in f)
    return changed(mesh, add=[("QUAD9", fin, ["slave"])])


@defect("mixed-order")
def linear_and_quadratic_slaves():
    on = lambda x: np.abs(x[..., 2] - 1) < 1e-9  # noqa: E731
    left, right = block((2, 2, 2), (0, 0, 0), (1, 1, 1)), block((2, 2, 2), (1.01, 0, 0), (2.01, 1, 1))
    top = block((4, 2, 2), (-0.1, -0.1, 1.01), (2.2, 1.1, 2))
    above = skin(*top, lambda x: np.abs(x[..., 2] - 1.01) < 1e-9)
    full = raise_order(join([(*left, {"slave": skin(*left, on)})]), "2-full")
    part = (full.points, {"HEXA27": full.block("HEXA27")}, {"slave": {"QUAD9": full.block("QUAD9")}})
    return cut_skin(join([part, (*right, {"slave": skin(*right, on)}), (*top, {"master": above})]), "slave").mesh


@defect("hanging-node")
def a_slave_that_does_not_conform():
    on = lambda x: np.abs(x[..., 2] - 1) < 1e-9  # noqa: E731
    left, right = block((2, 2, 2), (0, 0, 0), (1, 1, 1)), block((2, 4, 2), (1, 0, 0), (2, 1, 1))
    top = block((4, 2, 2), (-0.1, -0.1, 1.01), (2.2, 1.1, 2))
    above = skin(*top, lambda x: np.abs(x[..., 2] - 1.01) < 1e-9)
    mesh = join([(*left, {"slave": skin(*left, on)}), (*right, {"slave": skin(*right, on)}), (*top, {"master": above})])
    return cut_skin(merged(mesh), "slave").mesh


@defect("self-intersection")
def two_slave_bodies_through_each_other():
    on = lambda x: np.abs(x[..., 2] - 1) < 1e-9  # noqa: E731
    left, right = block((2, 2, 2), (0, 0, 0), (1, 1, 1)), block((2, 2, 2), (0.7, 0.1, 0), (1.7, 1.1, 1))
    right = (right[0] + np.outer(right[0][:, 0] - 0.85, [0, 0, 0.05]), right[1])
    tilted = skin(*right, lambda x: np.abs(x[..., 2] - 1 - 0.05 * (x[..., 0] - 0.85)) < 1e-9)
    top = block((4, 2, 2), (-0.1, -0.1, 1.1), (2.2, 1.2, 2))
    above = skin(*top, lambda x: np.abs(x[..., 2] - 1.1) < 1e-9)
    return cut_skin(
        join([(*left, {"slave": skin(*left, on)}), (*right, {"slave": tilted}), (*top, {"master": above})]), "slave"
    ).mesh


@defect("self-intersection")
def two_slave_faces_on_each_other():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "TRIA3", "slave")
    shift = mesh.n_nodes + np.arange(len(mesh.points))
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "copy": mesh.cell_groups["body0"]})
    part = {
        b.type: b.nodes[of_type(mesh, b.type, "body0")[0]] + mesh.n_nodes for b in mesh.blocks if CELLS[b.type].dim == 3
    }
    add = [(kind, row, ["body2"]) for kind, rows_ in part.items() for row in rows_]
    add += [("TRIA3", shift[n], ["slave"]) for n in nodes]
    doubled = changed(mesh, points=np.vstack([mesh.points, mesh.points + [0.21, 0.13, 0.0]]), add=add)
    return cut_again(doubled)


def cut_again(mesh):
    """The records of a cut found again where cells were added."""
    from lacmesh.recognition import find_macros, with_records

    bare = without_records(mesh)
    return with_records(bare, find_macros(bare, ["slave"]))


@defect("self-intersection", slave="slave", master=None)
def plane_slaves_that_cross():
    one, two = block((2, 2), (0, 0), (1, 1), "QUAD4"), block((2, 2), (0.45, 0.5), (1.45, 1.5), "QUAD4")
    on = lambda axis, v: lambda x: np.abs(x[..., axis] - v) < 1e-9  # noqa: E731
    mesh = join([(*one, {"slave": skin(*one, on(1, 1.0))}), (*two, {"slave": skin(*two, on(0, 0.45))})])
    return cut_skin(mesh, "slave").mesh


@defect("shared-nodes")
def a_node_on_both_sides():
    mesh = cut_blocks(gap=0.0, matching=True)
    a, b = (
        int(np.intersect1d(np.flatnonzero(np.abs(mesh.points - [1, 1, 1]).max(axis=1) < 1e-9), _nodes(mesh, g))[0])
        for g in ("slave", "master")
    )
    blocks = tuple(block_._replace(nodes=np.where(block_.nodes == b, a, block_.nodes)) for block_ in mesh.blocks)
    return replace(mesh, blocks=blocks)


def _nodes(mesh, group):
    return np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups[group])]))


@defect("zones-share-nodes", slave=["left", "right"])
def two_zones_side_by_side():
    mesh = two_blocks()
    x = {
        int(c): mesh.points[n].mean(axis=0)[0]
        for _, cells, nodes in mesh.select(mesh.cell_groups["slave"])
        for c, n in zip(cells, nodes, strict=True)
    }
    groups = {**mesh.cell_groups, "left": [c for c in x if x[c] < 0.5], "right": [c for c in x if x[c] > 0.5]}
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_groups=groups)
    return cut_skin(mesh, ["left", "right"]).mesh


# ---- the internal dof


@defect("no-internal-dof")
def a_mesh_that_is_not_cut():
    return two_blocks("TETRA4")


@defect("no-internal-dof", slave="slave", master=None)
def a_single_face_that_is_not_cut():
    return two_blocks("QUAD4", n=1)


@defect("rim-dof")
def macro_elements_with_dofs_on_the_rim_only():
    mesh = two_blocks("HEXA8", n=2)
    faces = mesh.cell_groups["slave"]
    macro, zone, child = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    macro[faces], zone[faces], child[faces] = np.arange(len(faces)), 0, 1
    records = {"lac_macro": macro, "lac_zone": zone, "lac_child": child}
    return replace(mesh, cell_data=records, zones=("slave",))


@defect("fixed-internal-dof", dirichlet=["held"])
def internal_dofs_that_are_held():
    mesh = cut_blocks("TETRA10")
    return changed(mesh, groups={"held": set(mesh.cell_groups["slave"][:6].tolist())})


@defect("recognised")
def a_cut_without_records():
    return without_records(cut_blocks("HEXA20", "hexa"))


@defect("half-cut", also=("no-internal-dof",), slave=["slave", "loaded"], master="master")
def a_cut_of_another_group_only():
    return cut_blocks()


@defect("broken-records")
def records_of_no_cut():
    mesh = cut_blocks()
    zone = mesh.cell_data["lac_zone"].copy()
    zone[mesh.cell_groups["slave"][0]] = 7
    return replace(mesh, cell_data={**mesh.cell_data, "lac_zone": zone})


# ---- slave against master


@defect("no-coverage", master="loaded")
def the_wrong_master():
    return cut_blocks()


@defect("no-coverage")
def a_bare_master_that_turns_its_back():
    mesh = reversed_group(cut_blocks(), "master")
    return changed(mesh, drop=mesh.cell_groups["body1"])


@defect("wrong-side")
def a_bare_master_of_which_a_part_turns_its_back():
    mesh = cut_blocks("HEXA27", n=3, matching=True)
    half = {int(c) for c in mesh.cell_groups["master"][:3]}
    bare = changed(mesh, drop=mesh.cell_groups["body1"])
    assert len(half) == 3
    turned = replace(bare, cell_groups={**bare.cell_groups, "some": bare.cell_groups["master"][:3]})
    return reversed_group(turned, "some")


@defect("wrong-side")
def a_master_deep_inside_the_slave():
    return cut_blocks(gap=-0.6, n=3, m=2, reach=0.1)


@defect("partial-coverage")
def a_master_smaller_than_the_slave():
    return cut_blocks(reach=-0.1)


@defect("size-ratio")
def a_master_much_finer_than_the_slave():
    return cut_blocks("QUAD4", n=2, m=14)


@defect("size-ratio")
def a_master_much_coarser_than_the_slave():
    return cut_blocks("QUAD4", n=14, m=2)


@defect("better-slave")
def a_master_finer_than_the_slave():
    return cut_blocks(n=2, m=5)


@defect("facing-left-out")
def segments_in_a_tilted_plane():
    mesh = cut_blocks("QUAD9")
    points = mesh.points.copy()
    points[:, 2] = points[:, 0]
    return replace(mesh, points=points, space_dim=3)
