"""The corpus of broken meshes: how one is entered, the tools that break a healthy one, and the meshes themselves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lacmesh import Mesh, cut_skin, join, split
from lacmesh.cells import CELLS
from lacmesh.cutting.records import without_records
from lacmesh.generate import box, line, rectangle
from lacmesh.generate.parts import SEAM, sew
from lacmesh.topology.orientation import reverse
from tests.checks.blocks import cut_blocks, skin, two_blocks
from tests.coarse_rings import rings

#: name -> how a broken mesh is made and what is found; filled by `defect`
CORPUS: dict[str, Case] = {}


class Case(NamedTuple):
    """A broken mesh, and what is found: `count` cells of a rule or, if it has none, nodes, and `also` other rules."""

    build: Any
    rule: str
    count: int
    also: tuple[str, ...]
    #: type of the two blocks, cut, that are broken, if there are any
    on: str | None
    #: arguments of `check`
    asked: dict[str, Any]

    def make(self):
        return self.build(cut_blocks(self.on)) if self.on else self.build()


def defect(rule, count, *also, on=None, name=None, **asked):
    """Enter a mesh into the corpus, by the name of the function that makes it."""

    def enter(build):
        assert (name or build.__name__) not in CORPUS
        groups = {"slave": "slave", "master": "master", **asked}
        CORPUS[name or build.__name__] = Case(build, rule, count, also, on, groups)

    return enter


# ---- tools


def changed(mesh, kind=None, rows=(), nodes=None, points=None, drop=(), add=None):
    """A mesh with some cells' nodes replaced, other points, cells left out, and a cell added: (type, nodes, group).

    Data of the cells follow; those of the added cell are -1.
    """
    points = mesh.points if points is None else np.asarray(points)
    parts, source = {}, {}
    for start, b in zip(mesh.offsets, mesh.blocks, strict=False):
        source[b.type] = np.setdiff1d(start + np.arange(len(b.nodes)), drop)
        parts[b.type] = (put(b.nodes, rows, nodes) if b.type == kind else b.nodes)[source[b.type] - start]
    groups = dict(mesh.cell_groups)
    if add:
        kind, row, group = add
        parts[kind] = np.vstack([parts[kind], row] if kind in parts else [row])
        source[kind] = np.append(source.get(kind, []), -1).astype(int)
        groups[group] = np.append(groups.get(group, []), -1)
    order = np.concatenate([*source.values()])
    groups = {name: np.flatnonzero(np.isin(order, ids)) for name, ids in groups.items()}
    data = {name: np.where(order < 0, -1, v[order]).astype(v.dtype) for name, v in mesh.cell_data.items()}
    more = len(points) - mesh.n_nodes
    node_data = {name: np.append(v, np.full(more, -1, v.dtype)) for name, v in mesh.node_data.items()}
    made = Mesh.create(
        points, parts.items(), cell_groups=groups, cell_data=data, node_data=node_data, space_dim=mesh.space_dim
    )
    return replace(made, zones=mesh.zones)


def at(mesh, *x):
    """The node nearest to a place."""
    return int(np.linalg.norm(mesh.points - np.resize(np.append(x, 0), 3), axis=1).argmin())


def put(values, where, new):
    """A copy of values with some replaced."""
    values = values.copy()
    values[where] = new
    return values


def moved(mesh, node, by):
    """A mesh with one node moved."""
    return changed(mesh, points=put(mesh.points, node, mesh.points[node] + by))


def of_type(mesh, kind, group):
    """(rows in the block, nodes) of the cells of one type in a group."""
    k = [b.type for b in mesh.blocks].index(kind)
    cells = mesh.cell_groups[group]
    cells = cells[(cells >= mesh.offsets[k]) & (cells < mesh.offsets[k + 1])]
    return cells - mesh.offsets[k], mesh.block(kind)[cells - mesh.offsets[k]]


def reversed_group(mesh, group):
    """A mesh with the faces of a group turned over."""
    return reverse(mesh, mesh.cells_of(group))


def cut(mesh, slave="slave"):
    return cut_skin(mesh, slave).mesh


# ---- cells


@defect("invalid-cell", 4, on="TETRA10")
def a_mid_node_beyond_the_quarter_of_its_edge(mesh):
    mid = of_type(mesh, "TETRA10", "body1")[1][-1]
    return moved(mesh, mid[4], 0.4 * (mesh.points[mid[1]] - mesh.points[mid[0]]))


@defect("invalid-cell", 1, on="TETRA4")
def a_flat_tetrahedron(mesh):
    corner, n = at(mesh, 1, 1, 2.01), mesh.n_nodes
    more = mesh.points[corner] + 0.3 * np.array([[1, 0, 0], [0, 1, 0], [1, 1, 0]])
    return changed(mesh, points=np.vstack([mesh.points, more]), add=("TETRA4", [corner, n, n + 1, n + 2], "body1"))


# ---- cells with their neighbours


#: rule of a pyramid on the facet of a hexahedron, outside or inside it
for rule, count, row, side in (("crowded-facet", 3, 0, 1), ("overlapping-cells", 2, -1, -1)):

    @defect(rule, count, on="HEXA8", name=f"{rule} by a pyramid")
    def pyramid(mesh, row=row, side=side):
        _, nodes = of_type(mesh, "HEXA8", "body1")
        base = nodes[row][list(CELLS["HEXA8"].facets[5].nodes)][::side]
        points = np.vstack([mesh.points, mesh.points[base].mean(axis=0) + np.array([0, 0, 0.1 * side])])
        return changed(mesh, points=points, add=("PYRAM5", [*base, mesh.n_nodes], "body1"))


#: type of a cell whose mid-node is its own, its group, its place there, the mid-node, how many cells differ
for kind, cell, group, row, mid, count in (
    ("HEXA20", "HEXA20", "body1", 13, 8, 3),
    ("TETRA10", "TRIA6", "slave", 0, 3, 1),
):

    @defect("mid-nodes-differ", count, on=kind, name=f"a {cell} with a mid-node of its own")
    def own(mesh, cell=cell, group=group, row=row, mid=mid):
        rows, nodes = of_type(mesh, cell, group)
        points = np.vstack([mesh.points, mesh.points[nodes[row, mid]]])
        nodes[row, mid] = mesh.n_nodes
        return changed(mesh, cell, rows[row], nodes[row], points=points)


@defect("torn-body", 6)
def a_node_inside_an_edge_away_from_the_skins():
    high = box(2, (1, 1, 0.99), corner=(0, 0, 1.01)).renamed(bottom="master", top=SEAM)
    mesh = join(box(2).renamed(top="slave"), high, box((4, 2, 2), corner=(0, 0, 2)).renamed(bottom=SEAM))
    return cut(sew(mesh, SEAM).only("body", "slave", "master"))


@defect("coincident-nodes", 16, on="HEXA8")
def a_body_torn_along_a_plane(mesh):
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    upper = mesh.points[nodes].mean(axis=1)[:, 2] > 1.4
    torn = np.unique(nodes[upper])
    torn = torn[(np.abs(mesh.points[torn, 2] - (1.01 + 1 / 3)) < 1e-9) & (mesh.points[torn, 0] < 0.5)]
    new = put(np.arange(mesh.n_nodes), torn, mesh.n_nodes + np.arange(len(torn)))
    return changed(mesh, "HEXA8", rows[upper], new[nodes[upper]], points=np.vstack([mesh.points, mesh.points[torn]]))


@defect("unsupported-face", 1, on="HEXA8", master=None)
def a_cell_of_order_3_behind(mesh):
    face = of_type(mesh, "TRIA3", "slave")[1][0]
    rows, nodes = of_type(mesh, "PYRAM5", "body0")
    (behind,) = np.flatnonzero(np.isin(nodes, face).sum(axis=1) == 3)
    more = mesh.points[nodes[behind]].mean(axis=0) + 0.01 * np.random.default_rng(1).random((25, 3))
    cell = ("PYRAM30", [*nodes[behind], *(mesh.n_nodes + np.arange(25))], "body0")
    number = [b.type for b in mesh.blocks].index("PYRAM5")
    return changed(mesh, points=np.vstack([mesh.points, more]), drop=[mesh.offsets[number] + rows[behind]], add=cell)


# ---- skins and what is behind them


@defect("no-parent", 4, on="HEXA8")
def cells_behind_missing(mesh):
    parent = mesh.cell_data["lac_parent"]
    return changed(mesh, drop=np.flatnonzero(parent == parent[mesh.cell_groups["body0"][-1]]))


def without_upper_body(mesh, turned):
    """A bare master, so many of whose faces are turned."""
    bare = changed(mesh, drop=mesh.cell_groups["body1"])
    return reverse(bare, bare.cells_of("master")[:turned])


@defect("non-manifold", 3, "interface", "partial-coverage", on="HEXA27")
def a_fin_on_the_slave(mesh):
    within = lambda x: (np.abs(x[..., 0] - 0.5) < 1e-9) & (x[..., 2] > 0.45) & (x[..., 2] < 1.005)  # noqa: E731
    inner = skin(mesh.points, {"HEXA27": mesh.block("HEXA27")}, within)["QUAD9"]
    return changed(mesh, add=("QUAD9", next(f for f in inner if at(mesh, 0.5, 0.5, 1.0) in f), "slave"))


# ---- bodies that do not fit together


def under(*bodies, gap=0.01):
    """Bodies whose tops are slaves, sewn together at their seams, under one that is wider, cut."""
    above = box((4, 2, 2), (2.3, 1.3, 0.9), corner=(-0.1, -0.1, 1 + gap)).renamed(bottom="master")
    mesh = join(*(one.renamed(top="slave") for one in bodies), above)
    return cut(sew(mesh, SEAM).only("body", "slave", "master"))


def two_divisions():
    return under(box().renamed(right=SEAM), box((2, 4, 2), corner=(1, 0, 0)).renamed(left=SEAM))


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


# ---- curved skins


@defect("faceted", 45)
def a_curved_skin_of_three_faces_to_a_quarter_turn():
    """The skin is bent to a shape that is not one of those recognised."""

    def bent(x):
        angle, radius = np.pi / 2 * (x[0] - 0.5), (0.5 + x[2]) * (1 + 0.1 * x[1] ** 2 + 0.1 * x[0] ** 3)
        return [radius * np.sin(angle), x[1], radius * np.cos(angle)]

    return cut(two_blocks(n=3, matching=True, gap=0.05).moved(bent))


@defect("few-faces", 80, master="bore")
def a_pin_of_eight_faces():
    """Its nodes lie on a cylinder, and its edges turn by 45 degrees."""
    pin = {"kind": "HEXA8", "n": 8, "radii": (0.5, 1), "heights": (0, 0.5, 1), "names": ("pin", "bore", "slave")}
    return cut(rings(pin, dim=3))


# ---- macro-elements


def macro_elements_of_one_face(n):
    """Records of a cut in which each slave face, of n in a row, is a macro-element."""
    mesh = two_blocks("HEXA8", n=n)
    faces = mesh.cell_groups["slave"]
    macro, zone, child = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    macro[faces], zone[faces], child[faces] = np.arange(len(faces)), 0, 1
    return replace(mesh, cell_data={"lac_macro": macro, "lac_zone": zone, "lac_child": child}, zones=("slave",))


# ---- records of a cut


def recorded(mesh, **changes):
    """A cut with other records: name -> (cells or nodes, values)."""
    data = {**mesh.cell_data, **mesh.node_data}
    data |= {name: put(data[name], *change) for name, change in changes.items()}
    cells = {name: data[name] for name in mesh.cell_data}
    return replace(mesh, cell_data=cells, node_data={name: data[name] for name in mesh.node_data})


def numbered(mesh, k):
    """(n_cells,): True for the faces of a macro-element."""
    return mesh.cell_data["lac_macro"] == k


BOTH = {"slave": ["slave", "master"], "master": None}


@defect("broken-records", 1, on="HEXA8")
def an_internal_dof_recorded_at_a_vertex(mesh):
    node = np.flatnonzero(mesh.node_data["lac_internal"] == 0)
    return recorded(mesh, lac_internal=([*node, at(mesh, 0.5, 0.5, 1)], [-1] * len(node) + [0]))


@defect("broken-records", 1, on="TETRA4")
def an_internal_dof_recorded_at_a_vertex_of_the_rim(mesh):
    number = mesh.cell_data["lac_macro"].max()
    nodes = mesh.nodes_on(np.flatnonzero(numbered(mesh, number)))
    corner = nodes[np.abs(mesh.points[nodes, :2] - 0.5).min(axis=1).argmax()]
    centre = np.flatnonzero(mesh.node_data["lac_internal"] == number)
    return recorded(mesh, lac_internal=([*centre, corner], [-1] * len(centre) + [number]))


@defect("broken-records", 18, **BOTH)
def macro_elements_of_two_bodies_with_one_number():
    mesh = cut(two_blocks("TETRA4"), ["slave", "master"])
    return recorded(mesh, lac_macro=(numbered(mesh, mesh.cell_data["lac_macro"].max()), 0))


@defect("broken-records", 3, **BOTH)
def a_macro_element_in_two_zones():
    mesh = cut(two_blocks("QUAD4"), ["slave", "master"])
    return recorded(mesh, lac_zone=(np.flatnonzero(numbered(mesh, 0))[:1], 1))


# ---- in a line each


def again(mesh, kind, group, row, order=slice(None), into=None):
    """A mesh with a cell of a group once more, its nodes in another order."""
    return changed(mesh, add=(kind, of_type(mesh, kind, group)[1][row][order], into or group))


def listed(mesh, kind, row, order):
    """A mesh of which a cell has other ones of its nodes."""
    rows, nodes = of_type(mesh, kind, "body1")
    return changed(mesh, kind, rows[row], nodes[row][order])


def tilted(mesh):
    return replace(mesh, points=mesh.points[:, [0, 1, 0]], space_dim=3)


def order_3(mesh):
    """A mesh with a slave face of order 3 somewhere else."""
    points = np.vstack([mesh.points, np.random.default_rng(0).random((10, 3)) + 5])
    return changed(mesh, points=points, add=("TRIA10", mesh.n_nodes + np.arange(10), "slave"))


def grouped(mesh, **groups):
    """A mesh with groups of some cells."""
    return replace(mesh, cell_groups={**mesh.cell_groups, **{name: np.sort(ids) for name, ids in groups.items()}})


NONE = {"slave": "none", "master": None}
ZONES, SIDES, MORE = ({"slave": zones} for zones in (["slave", "fixed"], ["left", "right"], ["slave", "more"]))
LINE, EDGE = ("SEG2", [0, 1], "line"), {"master": "line"}
HALVES = {"left": lambda x: (x[2] == 1) & (x[0] <= 0.5), "right": lambda x: (x[2] == 1) & (x[0] >= 0.5)}
#: name -> rule, cells or nodes, type of the blocks, how the mesh is made, and what is asked
ROWS = {
    "only lines": ("no-cells", 0, None, lambda: replace(line(1, (0, 0), (1, 0)), cell_groups={"none": [0]}), NONE),
    "nothing at all": ("no-cells", 0, None, lambda: Mesh.create(np.zeros((0, 3)), [], cell_groups={"none": []}), NONE),
    "a coordinate nan": ("not-finite", 1, "HEXA8", lambda m: moved(m, at(m, 0.33, 0.33, 1.67), np.nan)),
    "a coordinate inf": ("not-finite", 1, "TETRA10", lambda m: moved(m, at(m, 0.33, 0.33, 1.67), np.inf)),
    "a number twice": ("repeated-number", 1, "HEXA8", lambda m: replace(m, cell_number=put(m.cell_number, 3, 8))),
    "a number below 0": ("repeated-number", 1, "HEXA8", lambda m: replace(m, node_number=put(m.node_number, -1, -4))),
    "a node of no cell": ("unreferenced-node", 1, "HEXA8", lambda m: changed(m, points=[*m.points, [5, 5, 5]])),
    "a node twice": ("repeated-node", 1, "HEXA8", lambda m: listed(m, "HEXA8", -1, [0, 1, 2, 3, 4, 5, 7, 7])),
    "a cell inside out": ("inverted-cell", 1, "HEXA8", lambda m: listed(m, "HEXA8", -1, [4, 5, 6, 7, 0, 1, 2, 3])),
    "one reversed": ("inverted-cell", 1, "TETRA10", lambda m: listed(m, "TETRA10", 90, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8])),
    "a plane cell clockwise": ("clockwise-cell", 1, "QUAD4", lambda m: listed(m, "QUAD4", -1, [0, 3, 2, 1])),
    "a node astray": ("invalid-cell", 6, "HEXA8", lambda m: moved(m, at(m, 1 / 3, 1 / 3, 5 / 3), [0.5, 0.5, 0.0])),
    # at 1/3 the corner is flat
    "a cell almost flat": ("poor-cell", 1, "HEXA8", lambda m: moved(m, at(m, 1, 1, 2.01), np.full(3, -0.32 / 3))),
    "a cell twice": ("repeated-cell", 1, "HEXA8", lambda m: again(m, "HEXA8", "body1", -1)),
    "an inner cell twice": ("repeated-cell", 1, "TETRA4", lambda m: again(m, "TETRA4", "body1", 80, [1, 2, 0, 3])),
    "a slave face twice": ("repeated-face", 1, "HEXA8", lambda m: again(m, "TRIA3", "slave", 2)),
    "a master face twice": ("repeated-face", 1, "HEXA8", lambda m: again(m, "QUAD4", "master", 2, [1, 2, 3, 0])),
    "a coated slave face": ("duplicate", 1, "HEXA8", lambda m: again(m, "TRIA3", "slave", 2, into="coating")),
    "an empty group": ("empty-skin", 0, "HEXA8", lambda m: grouped(m, more=np.empty(0, int)), MORE),
    "a master of lines": ("empty-skin", 1, "HEXA8", lambda m: changed(m, add=LINE), EDGE),
    "a volume in the slave": (
        "wrong-dimension", 1, "HEXA8", lambda m: grouped(m, slave=[m.cells_of("body0")[0], *m.cells_of("slave")]),
    ),
    "lines in the slave": ("lower-dimension", 1, "HEXA8", lambda m: changed(m, add=("SEG2", [0, 1], "slave"))),
    "a slave face of order 3": ("unsupported-face", 1, "HEXA8", order_3),
    "a face twice": ("face-in-two-zones", 4, "HEXA8", lambda m: grouped(m, more=m.cells_of("slave")[:4]), MORE),
    "a rigid master": ("bare-master", 9, "HEXA8", lambda m: changed(m, drop=m.cells_of("body1"))),
    "a slave inside": (
        "interface", 16, None, lambda: cut(box().with_groups("inner", slave=lambda x: x[2] == 0.5)), {"master": None},
    ),
    "a slave turned inward": ("orientation", 16, None, lambda: cut(reversed_group(two_blocks(), "slave"))),
    "a master turned inward": ("orientation", 3, "QUAD8", lambda m: reversed_group(m, "master")),
    "one face turned": ("orientation partial-coverage", 1, "HEXA8", lambda m: without_upper_body(m, 1)),
    "a bare master, all turned": ("no-coverage wrong-side", 16, "HEXA8", lambda m: without_upper_body(m, None)),
    "a bare master, three turned": (
        "wrong-side orientation partial-coverage", 3, None,
        lambda: without_upper_body(cut_blocks("HEXA27", n=3, matching=True), 3),
    ),
    "two orders": ("mixed-order", 4, None, lambda: under(box(2, kind="HEXA27"), box(2, corner=(1.01, 0, 0)))),
    "orders side by side": (
        "mid-nodes-differ", 4, "HEXA20",
        lambda m: changed(m, drop=m.cells_of("body1")[-1:], add=("HEXA8", m.block("HEXA20")[-1][:8], "body1")),
    ),
    "nodes hang": ("hanging-node torn-body", 2, None, two_divisions),
    "two zones": ("zones-share-nodes", 3, None, lambda: cut(two_blocks().with_groups(**HALVES), [*HALVES]), SIDES),
    "a crack": (
        "crack-front", 1, None,
        lambda: split(rectangle().with_groups("inner", G=lambda x: (x[1] == 0.5) & (x[0] < 0.6)), "G"),
        {"slave": "G_a", "master": "G_b"},
    ),
    "a slave through another": (
        "self-intersection", 12, None,
        lambda: under(box(), box(corner=(0.7, 0.1, 0)).moved(lambda x: [*x[:2], x[2] + 0.05 * (x[0] - 0.85)]), gap=0.1),
    ),
    "plane slaves that cross": (
        "self-intersection", 3, None,
        lambda: cut(join(rectangle().renamed(top="slave"), rectangle(corner=(0.45, 0.5)).renamed(left="slave"))),
        {"master": None},
    ),
    "a slave on another": ("self-intersection", 32, None, lambda: under(box(2), box(2, corner=(0.21, 0.13, 0)))),
    "a mesh that is not cut": ("not-cut", 8, None, lambda: two_blocks("TETRA4")),
    "one face that is not cut": ("not-cut", 1, None, lambda: two_blocks("QUAD4", n=1), {"master": None}),
    "dofs on the rim only": ("rim-dof", 4, None, lambda: macro_elements_of_one_face(2)),
    "a macro-element of one face": ("no-internal-dof rim-dof", 5, None, lambda: macro_elements_of_one_face(3)),
    "held": ("fixed-internal-dof", 6, "TETRA10", lambda m: grouped(m, x=m.cells_of("slave")[:6]), {"dirichlet": "x"}),
    "no records": ("recognised", 20, None, lambda: without_records(cut_blocks("HEXA20", "hexa")), {"recognise": True}),
    "a cut of another group": (
        "half-cut no-internal-dof no-coverage wrong-side", 9, "HEXA8", lambda m: m, {"slave": ["slave", "loaded"]},
    ),
    "records of no cut": ("broken-records", 0, "HEXA8", lambda m: recorded(m, lac_zone=(m.cells_of("slave")[0], 7))),
    "dofs that are not recorded": ("broken-records", 2, "QUAD8", lambda m: replace(m, node_data={})),
    "all are the first": ("broken-records", 16, "HEXA8", lambda m: recorded(m, lac_child=(m.cells_of("slave"), 1))),
    "a huge number": ("broken-records", 3, "TETRA10", lambda m: recorded(m, lac_macro=(numbered(m, 3), 10**9))),
    "a master deep in the slave": ("wrong-side", 36, None, lambda: cut_blocks(gap=-0.4, n=3, m=2, reach=0.1)),
    "a master too deep": ("wrong-side no-coverage", 36, None, lambda: cut_blocks(gap=-0.6, n=3, m=2, reach=0.1)),
    "a small master": ("partial-coverage", 16, None, lambda: cut_blocks(reach=-0.1)),
    "a much finer master": ("size-ratio", 0, None, lambda: cut_blocks("QUAD4", n=2, m=14)),
    "a much coarser master": ("size-ratio", 0, None, lambda: cut_blocks("QUAD4", n=14, m=2)),
    "a finer master": ("better-slave", 0, None, lambda: cut_blocks(n=2, m=5)),
    "the wrong master": ("no-coverage", 16, "HEXA8", lambda m: m, {"master": "loaded"}),
    "a zone astray": ("no-coverage", 6, None, lambda: cut(two_blocks("QUAD4", reach=0.2), ZONES["slave"]), ZONES),
    "segments in a tilted plane": ("facing-left-out", 0, "QUAD9", tilted),
}  # fmt: skip
for name, (rules, count, on, build, *asked) in ROWS.items():
    rule, *also = rules.split()
    defect(rule, count, *also, on=on, name=name, **dict(*asked))(build)
