"""Broken meshes: groups, skins, what is behind them and what they share; macro-elements; skins that do not meet."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

import lacmesh
from lacmesh import Mesh, cut_skin, split
from lacmesh.generate import box, rectangle
from tests.checks.blocks import cut_blocks, skin, two_blocks
from tests.checks.corpus import at, changed, defect, merged, of_type, reversed_group, without_records
from tests.coarse_rings import rings

# ---- groups


@defect("empty-skin", 0, on="HEXA8", slave=["slave", "nobody"])
def an_empty_group(mesh):
    return changed(mesh, groups={"nobody": set()})


@defect("empty-skin", 1, on="HEXA8", master="edges")
def a_master_of_lines(mesh):
    return changed(mesh, add=[("SEG2", [0, 1], ["edges"])])


@defect("wrong-dimension", 1, on="HEXA8")
def a_volume_in_the_slave_group(mesh):
    inside = set(mesh.cell_groups["slave"].tolist()) | {int(mesh.cell_groups["body0"][0])}
    return changed(mesh, groups={"slave": inside})


@defect("lower-dimension", 1, on="HEXA8")
def lines_in_the_slave_group(mesh):
    return changed(mesh, add=[("SEG2", [0, 1], ["slave"])])


@defect("unsupported-face", 1, on="HEXA8")
def a_slave_face_of_order_3(mesh):
    points = np.vstack([mesh.points, np.random.default_rng(0).random((10, 3)) + 5])
    return changed(mesh, points=points, add=[("TRIA10", mesh.n_nodes + np.arange(10), ["slave"])])


@defect("unsupported-face", 1, on="HEXA8", master=None)
def a_cell_of_order_3_behind(mesh):
    face = of_type(mesh, "TRIA3", "slave")[1][0]
    rows, nodes = of_type(mesh, "PYRAM5", "body0")
    (behind,) = np.flatnonzero(np.isin(nodes, face).sum(axis=1) == 3)
    more = mesh.points[nodes[behind]].mean(axis=0) + 0.01 * np.random.default_rng(1).random((25, 3))
    cell = ("PYRAM30", [*nodes[behind], *(mesh.n_nodes + np.arange(25))], ["body0"])
    number = [b.type for b in mesh.blocks].index("PYRAM5")
    return changed(mesh, points=np.vstack([mesh.points, more]), drop=[mesh.offsets[number] + rows[behind]], add=[cell])


@defect("repeated-face", 1, on="HEXA8")
def a_slave_face_twice(mesh):
    return changed(mesh, add=[("TRIA3", of_type(mesh, "TRIA3", "slave")[1][2], ["slave"])])


@defect("repeated-face", 1, on="HEXA8")
def a_master_face_twice(mesh):
    return changed(mesh, add=[("QUAD4", of_type(mesh, "QUAD4", "master")[1][2][[1, 2, 3, 0]], ["master"])])


@defect("face-in-two-zones", 4, on="HEXA8", slave=["slave", "again"])
def a_face_in_two_zones(mesh):
    return changed(mesh, groups={"again": set(mesh.cell_groups["slave"][:4].tolist())})


@defect("duplicate", 1, on="HEXA8")
def another_cell_on_a_slave_face(mesh):
    return changed(mesh, add=[("TRIA3", of_type(mesh, "TRIA3", "slave")[1][2], ["coating"])])


# ---- parents and orientation


@defect("no-parent", 4, on="HEXA8")
def cells_behind_missing(mesh):
    parent = mesh.cell_data["lac_parent"]
    return changed(mesh, drop=np.flatnonzero(parent == parent[mesh.cell_groups["body0"][-1]]))


@defect("bare-master", 9, on="HEXA8")
def a_rigid_master(mesh):
    return changed(mesh, drop=mesh.cell_groups["body1"])


@defect("interface", 16, master=None)
def a_slave_inside_the_body():
    return cut_skin(box(2).with_groups("inner", slave=lambda x: x[2] == 0.5), "slave").mesh


@defect("orientation", 16)
def a_slave_turned_inward():
    return cut_skin(reversed_group(two_blocks(), "slave"), "slave").mesh


@defect("orientation", 3, on="QUAD8")
def a_master_turned_inward(mesh):
    return reversed_group(mesh, "master")


def without_upper_body(mesh, turned):
    """A bare master, so many of whose faces are turned."""
    bare = changed(mesh, drop=mesh.cell_groups["body1"])
    some = replace(bare, cell_groups={"some": bare.cell_groups["master"][:turned]})
    return replace(reversed_group(some, "some"), cell_groups=bare.cell_groups)


@defect("orientation", 1, "partial-coverage", on="HEXA8")
def a_bare_master_that_turns_both_ways(mesh):
    return without_upper_body(mesh, 1)


@defect("no-coverage", 16, "wrong-side", on="HEXA8")
def a_bare_master_that_turns_its_back(mesh):
    return without_upper_body(mesh, None)


@defect("wrong-side", 3, "orientation", "partial-coverage")
def a_bare_master_of_which_a_part_turns_its_back():
    return without_upper_body(cut_blocks("HEXA27", n=3, matching=True), 3)


@defect("non-manifold", 3, "interface", "partial-coverage", on="HEXA27")
def a_fin_on_the_slave(mesh):
    within = lambda x: (np.abs(x[..., 0] - 0.5) < 1e-9) & (x[..., 2] > 0.45) & (x[..., 2] < 1.005)  # noqa: E731
    inner = skin(mesh.points, {"HEXA27": mesh.block("HEXA27")}, within)["QUAD9"]
    return changed(mesh, add=[("QUAD9", next(f for f in inner if at(mesh, 0.5, 0.5, 1.0) in f), ["slave"])])


# ---- bodies that do not fit together


def under(*bodies, gap=0.01, sew=False):
    """Bodies whose tops are slaves, under one that is wider, cut."""
    above = box((4, 2, 2), (2.3, 1.3, 0.9), corner=(-0.1, -0.1, 1 + gap)).renamed(bottom="master")
    mesh = lacmesh.join(*(one.renamed(top="slave") for one in bodies), above).only("body", "slave", "master")
    return cut_skin(merged(mesh) if sew else mesh, "slave").mesh


@defect("mixed-order", 4)
def linear_and_quadratic_slaves():
    return under(box(2, kind="HEXA27"), box(2, corner=(1.01, 0, 0)))


@defect("hanging-node", 2, "torn-body")
def a_slave_that_does_not_conform():
    return under(box(2), box((2, 4, 2), corner=(1, 0, 0)), sew=True)


@defect("self-intersection", 12)
def two_slave_bodies_through_each_other():
    tilted = box(2, corner=(0.7, 0.1, 0)).moved(lambda x: [x[0], x[1], x[2] + 0.05 * (x[0] - 0.85)])
    return under(box(2), tilted, gap=0.1)


@defect("self-intersection", 32)
def two_slave_faces_on_each_other():
    return under(box(2), box(2, corner=(0.21, 0.13, 0)))


@defect("self-intersection", 3, master=None)
def plane_slaves_that_cross():
    parts = rectangle(2).renamed(top="slave"), rectangle(2, corner=(0.45, 0.5)).renamed(left="slave")
    return cut_skin(lacmesh.join(*parts), "slave").mesh


# ---- nodes on both sides


@defect("crack-front", 1, slave="G_a", master="G_b")
def a_crack_that_ends_inside():
    return split(rectangle(2).with_groups("inner", G=lambda x: (x[1] == 0.5) & (x[0] < 0.6)), "G")


@defect("shared-nodes", 1)
def a_node_on_both_sides():
    mesh = cut_blocks(gap=0.0, matching=True)
    corner = np.flatnonzero(np.abs(mesh.points - 1).max(axis=1) < 1e-9)
    a, b = (np.intersect1d(corner, mesh.nodes_on(mesh.cell_groups[name])) for name in ("slave", "master"))
    return replace(
        mesh, blocks=tuple(one._replace(nodes=np.where(one.nodes == b, a, one.nodes)) for one in mesh.blocks)
    )


@defect("shared-nodes", 3, "interface")
def bodies_that_share_their_faces():
    """Two rows of cells that were meshed as one body, with a group of its middle edges for each side."""
    points = [[x, y] for y in (0, 1, 2) for x in (0, 1, 2)]
    quads = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    edges = [[3, 4], [4, 5], [4, 3], [5, 4]]
    groups = {"slave": [4, 5], "master": [6, 7]}
    return Mesh.create(points, [("QUAD4", quads), ("SEG2", edges)], cell_groups=groups)


@defect("zones-share-nodes", 3, slave=["left", "right"])
def two_zones_side_by_side():
    halves = {"left": lambda x: (x[2] == 1) & (x[0] <= 0.5), "right": lambda x: (x[2] == 1) & (x[0] >= 0.5)}
    return cut_skin(two_blocks().with_groups(**halves), ["left", "right"]).mesh


# ---- curved skins


@defect("faceted", 45)
def a_curved_skin_of_three_faces_to_a_quarter_turn():
    """The skin is bent to a shape that is not one of those recognised."""

    def bent(x):
        angle, radius = np.pi / 2 * (x[0] - 0.5), (0.5 + x[2]) * (1 + 0.1 * x[1] ** 2 + 0.1 * x[0] ** 3)
        return [radius * np.sin(angle), x[1], radius * np.cos(angle)]

    return cut_skin(two_blocks(n=3, matching=True, gap=0.05).moved(bent), "slave").mesh


@defect("few-faces", 80, master="bore")
def a_pin_of_eight_faces():
    """Its nodes lie on a cylinder, and its edges turn by 45 degrees."""
    pin = {"kind": "HEXA8", "n": 8, "radii": (0.5, 1), "heights": (0, 0.5, 1), "names": ("pin", "bore", "slave")}
    return cut_skin(rings(pin, dim=3), "slave").mesh


# ---- macro-elements


defect("not-cut", 8, name="a mesh that is not cut")(partial(two_blocks, "TETRA4"))
defect("not-cut", 1, name="a single face that is not cut", master=None)(partial(two_blocks, "QUAD4", n=1))


def macro_elements_of_one_face(n):
    """Records of a cut in which each slave face, of n in a row, is a macro-element."""
    mesh = two_blocks("HEXA8", n=n)
    faces = mesh.cell_groups["slave"]
    macro, zone, child = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    macro[faces], zone[faces], child[faces] = np.arange(len(faces)), 0, 1
    return replace(mesh, cell_data={"lac_macro": macro, "lac_zone": zone, "lac_child": child}, zones=("slave",))


defect("rim-dof", 4, name="macro-elements with dofs on the rim only")(partial(macro_elements_of_one_face, 2))
defect("no-internal-dof", 5, "rim-dof", name="a macro-element of one face inside the skin")(
    partial(macro_elements_of_one_face, 3)
)


@defect("fixed-internal-dof", 6, on="TETRA10", dirichlet=["held"])
def internal_dofs_that_are_held(mesh):
    return changed(mesh, groups={"held": set(mesh.cell_groups["slave"][:6].tolist())})


defect("recognised", 20, name="a cut without records", recognise=True)(
    lambda: without_records(cut_blocks("HEXA20", "hexa"))
)
defect(
    "half-cut",
    9,
    "no-internal-dof",
    "no-coverage",
    "wrong-side",
    on="HEXA8",
    name="a cut of another group only",
    slave=["slave", "loaded"],
)(lambda mesh: mesh)

# ---- records of a cut


def recorded(mesh, **changes):
    """A cut with other records: name -> (cells or nodes, values)."""
    data = {**mesh.cell_data, **mesh.node_data}
    for name, (where, values) in changes.items():
        data[name] = data[name].copy()
        data[name][where] = values
    cells = {name: data[name] for name in mesh.cell_data}
    return replace(mesh, cell_data=cells, node_data={name: data[name] for name in mesh.node_data})


def two_zones(kind):
    return cut_skin(two_blocks(kind), ["slave", "master"]).mesh


BOTH = {"slave": ["slave", "master"], "master": None}


@defect("broken-records", 0, on="HEXA8")
def records_of_no_cut(mesh):
    return recorded(mesh, lac_zone=(mesh.cell_groups["slave"][0], 7))


@defect("broken-records", 1, on="HEXA8")
def an_internal_dof_recorded_at_a_vertex(mesh):
    node = np.flatnonzero(mesh.node_data["lac_internal"] == 0)
    return recorded(mesh, lac_internal=([*node, at(mesh, 0.5, 0.5, 1)], [-1] * len(node) + [0]))


@defect("broken-records", 1, on="TETRA4")
def an_internal_dof_recorded_at_a_vertex_of_the_rim(mesh):
    number = mesh.cell_data["lac_macro"].max()
    nodes = mesh.nodes_on(np.flatnonzero(mesh.cell_data["lac_macro"] == number))
    corner = nodes[np.abs(mesh.points[nodes, :2] - 0.5).min(axis=1).argmax()]
    centre = np.flatnonzero(mesh.node_data["lac_internal"] == number)
    return recorded(mesh, lac_internal=([*centre, corner], [-1] * len(centre) + [number]))


@defect("broken-records", 2, on="QUAD8")
def internal_dofs_that_are_not_recorded(mesh):
    return replace(mesh, node_data={})


@defect("broken-records", 16, on="HEXA8")
def faces_of_macro_elements_that_are_all_the_first(mesh):
    return recorded(mesh, lac_child=(mesh.cell_groups["slave"], 1))


@defect("broken-records", 18, **BOTH)
def macro_elements_of_two_bodies_with_one_number():
    mesh = two_zones("TETRA4")
    macro = mesh.cell_data["lac_macro"]
    return recorded(mesh, lac_macro=(macro == macro.max(), 0))


@defect("broken-records", 3, **BOTH)
def a_macro_element_in_two_zones():
    mesh = two_zones("QUAD4")
    return recorded(mesh, lac_zone=(np.flatnonzero(mesh.cell_data["lac_macro"] == 0)[:1], 1))


@defect("broken-records", 3, on="TETRA10")
def a_huge_number_of_a_macro_element(mesh):
    return recorded(mesh, lac_macro=(mesh.cell_data["lac_macro"] == 3, 10**9))


# ---- slave against master


for rule, count, also, name, blocks in (
    ("wrong-side", 36, (), "a master deep inside the slave", {"gap": -0.4, "n": 3, "m": 2, "reach": 0.1}),
    ("wrong-side", 36, ("no-coverage",), "a master too deep to be seen", {"gap": -0.6, "n": 3, "m": 2, "reach": 0.1}),
    ("partial-coverage", 16, (), "a master smaller than the slave", {"reach": -0.1}),
    ("size-ratio", 0, (), "a master much finer than the slave", {"name": "QUAD4", "n": 2, "m": 14}),
    ("size-ratio", 0, (), "a master much coarser than the slave", {"name": "QUAD4", "n": 14, "m": 2}),
    ("better-slave", 0, (), "a master finer than the slave", {"n": 2, "m": 5}),
):
    defect(rule, count, *also, name=name)(partial(cut_blocks, **blocks))

defect("no-coverage", 16, on="HEXA8", name="the wrong master", master="loaded")(lambda mesh: mesh)


@defect("no-coverage", 6, slave=["slave", "fixed"])
def one_zone_of_two_that_faces_nothing():
    return cut_skin(two_blocks("QUAD4", reach=0.2), ["slave", "fixed"]).mesh


@defect("facing-left-out", 0, on="QUAD9")
def segments_in_a_tilted_plane(mesh):
    points = mesh.points.copy()
    points[:, 2] = points[:, 0]
    return replace(mesh, points=points, space_dim=3)
