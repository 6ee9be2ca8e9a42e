"""Broken meshes: groups, skins, what is behind them and what they share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh import Mesh, cut_skin, raise_order, recognise, split
from lacmesh.cells import CELLS
from tests.checks.blocks import block, cut_blocks, join, skin, two_blocks
from tests.checks.corpus import at, changed, defect, merged, of_type, reversed_group, without_records
from tests.coarse_rings import rings


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
    _, nodes = of_type(mesh, "TRIA3", "slave")
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
    _, nodes = of_type(mesh, "TRIA3", "slave")
    shift = mesh.n_nodes + np.arange(len(mesh.points))
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "copy": mesh.cell_groups["body0"]})
    part = {
        b.type: b.nodes[of_type(mesh, b.type, "body0")[0]] + mesh.n_nodes for b in mesh.blocks if CELLS[b.type].dim == 3
    }
    add = [(kind, row, ["body2"]) for kind, rows_ in part.items() for row in rows_]
    add += [("TRIA3", shift[n], ["slave"]) for n in nodes]
    doubled = changed(mesh, points=np.vstack([mesh.points, mesh.points + np.array([0.21, 0.13, 0.0])]), add=add)
    return cut_again(doubled)


def cut_again(mesh):
    """The records of a cut found again where cells were added."""
    cut = recognise(without_records(mesh), "slave", certain=False)
    assert cut is not None
    return cut.mesh


@defect("self-intersection", slave="slave", master=None)
def plane_slaves_that_cross():
    one, two = block((2, 2), (0, 0), (1, 1), "QUAD4"), block((2, 2), (0.45, 0.5), (1.45, 1.5), "QUAD4")
    on = lambda axis, v: lambda x: np.abs(x[..., axis] - v) < 1e-9  # noqa: E731
    mesh = join([(*one, {"slave": skin(*one, on(1, 1.0))}), (*two, {"slave": skin(*two, on(0, 0.45))})])
    return cut_skin(mesh, "slave").mesh


@defect("crack-front", slave="G_a", master="G_b", also=["not-cut"])
def a_crack_that_ends_inside():
    points = [[x, y] for y in (0, 1, 2) for x in (0, 1, 2)]
    quads = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    return split(Mesh.create(points, [("QUAD4", quads), ("SEG2", [[3, 4]])], cell_groups={"G": [4]}), "G")


@defect("shared-nodes")
def a_node_on_both_sides():
    mesh = cut_blocks(gap=0.0, matching=True)
    a, b = (
        int(np.intersect1d(np.flatnonzero(np.abs(mesh.points - [1, 1, 1]).max(axis=1) < 1e-9), _nodes(mesh, g))[0])
        for g in ("slave", "master")
    )
    blocks = tuple(block_._replace(nodes=np.where(block_.nodes == b, a, block_.nodes)) for block_ in mesh.blocks)
    return replace(mesh, blocks=blocks)


@defect("shared-nodes", also=("interface",))
def bodies_that_share_their_faces():
    """Two rows of cells that were meshed as one body, with a group of its middle edges for each side."""
    points = [[x, y] for y in (0, 1, 2) for x in (0, 1, 2)]
    quads = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    edges = [[3, 4], [4, 5], [4, 3], [5, 4]]
    groups = {"slave": [4, 5], "master": [6, 7]}
    return Mesh.create(points, [("QUAD4", quads), ("SEG2", edges)], cell_groups=groups)


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


@defect("faceted")
def a_curved_skin_of_three_faces_to_a_quarter_turn():
    """The skin is bent to a shape that is not one of those recognised."""
    mesh = two_blocks(n=3, matching=True, gap=0.05)
    x, y, z = mesh.points.T
    angle, radius = np.pi / 2 * (x - 0.5), (0.5 + z) * (1 + 0.1 * y**2 + 0.1 * x**3)
    points = np.stack([radius * np.sin(angle), y, radius * np.cos(angle)], axis=1)
    return cut_skin(replace(mesh, points=points), "slave").mesh


@defect("few-faces", master="bore")
def a_pin_of_eight_faces():
    """Its nodes lie on a cylinder, and its edges turn by 45 degrees."""
    pin = {"kind": "HEXA8", "n": 8, "radii": (0.5, 1), "heights": (0, 0.5, 1), "names": ("pin", "bore", "slave")}
    return cut_skin(rings(pin, dim=3), "slave").mesh
