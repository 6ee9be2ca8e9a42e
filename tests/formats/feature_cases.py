"""Features of a mesh, one case each: a mesh that has it, a test that it is kept, and its name in a warning.

Cells of two meshes are matched by type and node coordinates, so that numbers and order may change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cutting.cut import Cut, cut_skin
from lacmesh.formats.registry import FORMATS, OF_NAME, SUFFIXES
from lacmesh.mesh import Mesh, Model, Periodic, Step

#: suffix -> name of a format of meshio
OF_MESHIO = {suffix: name for suffix, name in SUFFIXES.items() if OF_NAME[name].meshio}


def solid(**rest):
    """Four tetrahedra in a row, three of their faces as skin."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1.5, 1, 0], [2, 0, 0.75]])
    tetrahedra = [[0, 1, 2, 3], [1, 4, 2, 3], [1, 5, 2, 4], [1, 6, 5, 4]]
    return Mesh.create(points, [("TETRA4", tetrahedra), ("TRIA3", [[0, 2, 1], [0, 1, 3], [1, 2, 5]])], **rest)


def bare(**rest):
    """The tetrahedra alone."""
    mesh = solid()
    return Mesh.create(mesh.points, [("TETRA4", mesh.block("TETRA4"))], **rest)


def skin(**rest):
    """Four triangles in space, on the same nodes."""
    return Mesh.create(solid().points, [("TRIA3", [[0, 2, 1], [0, 1, 3], [1, 2, 5], [4, 5, 6]])], **rest)


def plane(space_dim, **rest):
    """Triangles in the plane."""
    points = np.array([[0, 0], [1, 0], [0, 1], [1, 1.25], [2, 0.5]])
    return Mesh.create(points, [("TRIA3", [[0, 1, 2], [1, 3, 2], [1, 4, 3]])], space_dim=space_dim, **rest)


class Matched(NamedTuple):
    """For each cell and node of the first mesh its index in the second, -1 where it is not there."""

    cell: np.ndarray
    node: np.ndarray


def matched(before, after):
    def keys(mesh):
        near = np.round(mesh.points, 5) + 0.0
        names = [tuple(p) for p in near.tolist()]
        cells = [(b.type, *(names[n] for n in row)) for b in mesh.blocks for row in b.nodes.tolist()]
        return cells, names

    (cells, points), (other_cells, other_points) = keys(before), keys(after)
    at_cell, at_point = ({k: i for i, k in enumerate(ks)} for ks in (other_cells, other_points))
    cell = np.array([at_cell.get(k, -1) for k in cells], int)
    node = np.array([at_point.get(k, -1) for k in points], int)
    return Matched(cell, node)


def same_groups(groups, others, to):
    return all(name in others and set(to[g].tolist()) == set(others[name].tolist()) for name, g in groups.items())


def same_data(data, others, to):
    def same(a, b):
        return a.shape[1:] == b.shape[1:] and np.allclose(a, b[to], rtol=1e-7, atol=0, equal_nan=True)

    return all(name in others and same(np.asarray(a), np.asarray(others[name])) for name, a in data.items())


@dataclass(frozen=True)
class Feature:
    """A feature: a mesh that has it, made of `one` (`bare`, or `skin` for formats of surfaces); whether it is still
    there; a warning's word for it. `also`: other features that the mesh has, whose loss may be told as well.
    """

    mesh: Any
    kept: Any
    word: str
    also: tuple[str, ...] = ()


def same_cells(before, after, to):
    return before.n_cells == after.n_cells and bool((to.cell >= 0).all())


def groups_on(on):
    name = f"{on}_groups"
    return lambda before, after, to: same_groups(getattr(before, name), getattr(after, name), getattr(to, on))


def data(before, after, to):
    pairs = (before.cell_data, after.cell_data, to.cell), (before.node_data, after.node_data, to.node)
    return all(same_data(*pair) for pair in pairs)


def integers(before, after, to):
    pairs = [(before.cell_data, after.cell_data), (before.node_data, after.node_data)]
    kinds = all(name in b and np.asarray(b[name]).dtype.kind in "iu" for a, b in pairs for name in a)
    return kinds and data(before, after, to)


def steps(before, after, to):
    def told(mesh):
        data = [*mesh.node_data.items(), *mesh.cell_data.items()]
        return {(s.field, s.number, s.time): v for k, v in data for s in [mesh.steps.get(k)] if s is not None}

    mine, theirs = told(before), told(after)
    return mine.keys() == theirs.keys() and all(np.allclose(v, theirs[k][to.node]) for k, v in mine.items())


def turned(one):
    """Every other cell inside out, or turned against its neighbours."""
    mesh = one()
    nodes = mesh.blocks[0].nodes.copy()
    nodes[1::2, :2] = nodes[1::2, 1::-1]
    return Mesh.create(mesh.points, [(mesh.blocks[0].type, nodes)])


def with_entities(one):
    mesh = one()
    dim = mesh.dim
    return replace(mesh, cell_data={"entity": np.array([[dim, 7], [dim, 7], [dim, 3], [dim, 3]], np.int32)})


def two_zones():
    """Two zones that have the same cells in a group that would else give its name."""
    mesh = solid(cell_groups={"slave": [4], "other": [5], "above": [4], "beside": [5]})
    return replace(cut_skin(mesh, ["slave", "other"]).mesh, zones=("left side", "right side"))


def records(before, after, to):
    try:
        was, now = Cut(before), Cut(after)
    except Exception:
        return False
    if was.n_macros != now.n_macros or told(was) != told(now):
        return False
    return np.array_equal(was.macro_of_node, now.macro_of_node[to.node])


def told(cut):
    """Records of the cells, each cell given by its type and node coordinates, in whatever order it is listed.

    The parent, whose number may change, is given by its first child, which has its number.
    """
    mesh = cut.mesh
    places = [tuple(p) for p in (np.round(mesh.points, 5) + 0.0).tolist()]
    keys = [(b.type, frozenset(places[n] for n in row)) for b in mesh.blocks for row in b.nodes.tolist()]
    first = dict(zip(mesh.cell_number.tolist(), keys, strict=True))
    columns = (cut.macro_of_face, cut.zone_of_face, cut.child_kind, cut.parent_of_cell)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    said = {key: (*row, first.get(parent)) for key, (*row, parent) in zip(keys, rows, strict=True)}
    return {key: row for key, row in said.items() if row != (-1, -1, -1, None)}


def periodic():
    mesh = solid(cell_data={"entity": np.array([[3, 1]] * 4 + [[2, 1], [2, 2], [2, 3]], np.int32)})
    link = Periodic((2, 1), (2, 2), (1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1), np.array([[0, 1], [2, 3]]))
    return replace(mesh, model=Model({}, (link,)))


def links(before, after, to):
    def told(mesh, there):
        found = () if mesh.model is None else mesh.model.periodic
        return [(p.slave, p.master, sorted(map(tuple, there(np.asarray(p.nodes)).tolist()))) for p in found]

    return told(before, lambda n: to.node[n]) == told(after, lambda n: n)


def order(mesh):
    kinds = np.repeat([b.type for b in mesh.blocks], np.diff(mesh.offsets))
    return (kinds if mesh.file_order is None else kinds[mesh.file_order]).tolist()


def number(on):
    name = f"{on}_number"
    return lambda before, after, to: np.array_equal(getattr(before, name), getattr(after, name)[getattr(to, on)])


LONG = "a name of 60 characters that goes on and on, as some like it"

#: what meshes with a cut have as well
BESIDE_A_CUT = ("group", "cell_number", "order", "loose_skin", "digits")

#: every column of the table, by its key
FEATURES = {
    "group": Feature(lambda one: one(cell_groups={"all": [0, 1, 2, 3]}), groups_on("cell"), "group"),
    "overlap": Feature(
        lambda one: one(cell_groups={"a": [0, 1, 2], "b": [1, 2, 3], "c": [2]}), groups_on("cell"), "group"
    ),
    "lower": Feature(lambda one: solid(cell_groups={"slave": [4, 5], "rest": [6]}), groups_on("cell"), "group"),
    "dims": Feature(lambda one: solid(cell_groups={"all": [0, 1, 2, 3, 4, 5, 6]}), groups_on("cell"), "group|all"),
    "empty": Feature(lambda one: one(cell_groups={"all": [0, 1, 2, 3], "none": []}), groups_on("cell"), "none|group"),
    "loose": Feature(lambda one: one(cell_groups={"a": [0]}), same_cells, "cells", also=("group", "node_number")),
    "loose_skin": Feature(lambda one: solid(), same_cells, "cells", also=("cell_number",)),
    "nodes": Feature(lambda one: one(node_groups={"corner": [0, 2], "all": range(7)}), groups_on("node"), "node"),
    "names": Feature(
        lambda one: one(cell_groups={"Körper links": [0, 1], "été": [2]}), groups_on("cell"), "nam|Körper"
    ),
    "long": Feature(lambda one: one(cell_groups={LONG: [0, 1]}), groups_on("cell"), "nam|characters"),
    "orphan": Feature(
        lambda one: Mesh.create([*one().points, (3, 3, 3), (4, 3, 3)], one().blocks),
        lambda b, a, to: b.n_nodes == a.n_nodes and (to.node >= 0).all(),
        "nodes",
    ),
    "node_number": Feature(lambda one: one(node_number=range(10, 80, 10)), number("node"), "number"),
    "cell_number": Feature(lambda one: one(cell_number=[1003, 1001, 1009, 1004]), number("cell"), "number"),
    "order": Feature(
        lambda one: solid(file_order=[4, 0, 5, 1, 2, 6, 3]), lambda b, a, to: order(b) == order(a), "order"
    ),
    "turn": Feature(turned, same_cells, "turn", also=("node_number",)),
    "field": Feature(
        lambda one: one(cell_data={"stress": np.array([1.5, np.pi, -2e-7, 3e9])}, node_data={"heat": np.arange(7) / 3}),
        data,
        "stress|field|data",
    ),
    "vector": Feature(
        lambda one: one(
            node_data={"move": np.arange(21).reshape(7, 3) / 7}, cell_data={"s": np.arange(36).reshape(4, 9) / 9}
        ),
        data,
        "move|field|data",
    ),
    "gap": Feature(lambda one: one(cell_data={"stress": np.array([1.5, np.nan, 2, 3])}), data, "stress|field|data"),
    "integer": Feature(
        lambda one: one(cell_data={"rank": np.array([1, -1, 7, 2**30])}, node_data={"level": np.arange(7)}),
        integers,
        "rank|field|data",
    ),
    "steps": Feature(
        lambda one: one(
            node_data={"heat@0": np.arange(7) / 3, "heat@1": np.arange(7) / 5},
            steps={"heat@0": Step("heat", 0, -1, 0.0), "heat@1": Step("heat", 1, -1, 0.5)},
        ),
        steps,
        "heat|field|data|step",
    ),
    "cut": Feature(
        lambda one: cut_skin(solid(cell_groups={"slave": [4, 5]}), "slave").mesh,
        records,
        "lac_|field|data",
        also=BESIDE_A_CUT,
    ),
    "zones": Feature(lambda one: two_zones(), lambda b, a, to: b.zones == a.zones, "zone", also=BESIDE_A_CUT),
    "plane": Feature(lambda one: plane(2), lambda b, a, to: a.space_dim == 2, "dimension"),
    "flat": Feature(lambda one: plane(3), lambda b, a, to: a.space_dim == 3, "dimension"),
    "periodic": Feature(lambda one: periodic(), links, "periodic|model"),
    "partition": Feature(
        lambda one: one(cell_data={"partition": np.array([1, 1, 2, 2], np.int32)}), integers, "partition|field|data"
    ),
    "entity": Feature(with_entities, integers, "entit|field|data"),
    "tags": Feature(
        lambda one: one(cell_groups={"all": [0, 1, 2, 3]}, group_tags={"all": ((3, 7),)}),
        lambda b, a, to: b.group_tags == a.group_tags,
        "tag",
    ),
    "name": Feature(lambda one: one(name="beam"), lambda b, a, to: a.name == "beam", "name"),
    "digits": Feature(
        lambda one: replace(one(), points=one().points * np.pi / 3),
        lambda b, a, to: np.array_equal(b.points[b.blocks[0].nodes], a.points[a.blocks[0].nodes]),
        "digits",
        also=("node_number",),
    ),
}

#: every type of cell, alone, as a column of the other table
TYPES = tuple(CELLS)


def one_cell(kind):
    """One cell of a type, bent so that no two of its nodes could change places unseen."""
    cell = ALL_CELLS[kind]
    x = np.array(cell.reference, float).reshape(cell.n_nodes, -1)
    x = np.pad(x, ((0, 0), (0, 3 - x.shape[1])))
    bent = x @ np.array([[1, 0.1, 0.2], [0.05, 1.1, 0.1], [0.15, 0.2, 0.9]]) + 0.02 * np.sin(3 * x + [1, 2, 3])
    return Mesh.create(bent + np.array([1, 2, 3]), [(kind, [range(cell.n_nodes)])])


# ---- what each format keeps, with some options: all but what stands here


KEPT, LOST, REFUSED = "yes", "lost", "error"
#: cells stand together by type in the file, without a word; kept where only lacmesh reads it again, which is warned of
BY_TYPE, OURS = "by type", "for lacmesh"


class Fidelity(NamedTuple):
    """Types of cells that a format `takes`, and features that are `lost`, `refused`, `ours`, or kept `by_type`."""

    form: str
    takes: frozenset[str]
    lost: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    ours: frozenset[str] = frozenset()
    by_type: bool = False
    options: tuple[tuple[str, str], ...] = ()

    def keeps(self, feature):
        """The fate of a feature."""
        if feature == "order" and self.by_type:
            return BY_TYPE
        return next(
            (f for f, some in ((OURS, self.ours), (LOST, self.lost), (REFUSED, self.refused)) if feature in some), KEPT
        )

    def keeps_cells(self, kind):
        """The fate of cells of a type."""
        return OURS if kind in self.ours else KEPT if kind in self.takes else REFUSED


def words(text):
    return frozenset(text.split())


def but(text):
    return frozenset(CELLS) - words(text)


FIELDS = words("field vector gap integer steps partition entity periodic tags")
ALL_BUT_CELLS = FIELDS | words("group overlap empty nodes names long node_number cell_number name")
#: what only meshes of several types of cells have
MIXED = words("lower loose_skin dims order cut zones periodic")
LINEAR = "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5"


def one_type(form, takes, keeps="", loses="flat", refuses=""):
    """A format of meshio that takes cells of one type in a mesh."""
    return Fidelity(form, words(takes), (ALL_BUT_CELLS - MIXED | words(loses)) - words(keeps), words(refuses) | MIXED)


def mixed(form, takes, loses="flat"):
    """A format of meshio that takes cells of several types in one mesh, and nothing else."""
    return Fidelity(form, words(takes), ALL_BUT_CELLS | MIXED - {"loose_skin"} | words(loses))


TABLE = (
    Fidelity("msh", but(""), ours=words("TRIA7 partition"), by_type=True),
    Fidelity("msh", but(""), ours=words("TRIA7"), options=(("msh", "2.2"),)),
    Fidelity("med", but("PYRAM14"), by_type=True),
    Fidelity("mail", but("PYRAM14"), FIELDS | words("names long"), by_type=True),
    Fidelity(
        "inp",
        but("TRIA7 QUAD9 HEXA27 PENTA18 PYRAM5 PYRAM13 PYRAM14"),
        FIELDS | words("loose_skin empty names long"),
        by_type=True,
    ),
    Fidelity(
        "inp",
        but("TRIA7 PYRAM13 PYRAM14"),
        FIELDS | words("loose_skin empty names"),
        by_type=True,
        options=(("target", "abaqus"),),
    ),
    Fidelity("vtu", but("PYRAM14")),
    Fidelity("xdmf", but("TRIA7 PYRAM14")),
    one_type("flac3d", "TETRA4 HEXA8 PYRAM5", loses="", refuses="plane flat turn"),
    mixed("mdpa", "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6"),
    one_type("ply", "POI1 SEG2 TRIA3 QUAD4"),
    one_type("stl", "TRIA3", loses="flat orphan"),
    Fidelity("vtk", but("TRIA7 PENTA15 PYRAM13 PYRAM14"), words("order steps flat name periodic tags zones")),
    mixed("h5m", "SEG2 TRIA3 TETRA4"),
    one_type(
        "avsucd",
        "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5",
        keeps="group overlap empty nodes node_number cell_number field vector gap entity",
    ),
    one_type("dolfin-xml", "TRIA3 TETRA4"),
    mixed("exodus", LINEAR),
    Fidelity("hmf", words(LINEAR), words("names long steps flat tags name"), MIXED),
    mixed("medit", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5"),
    mixed("nastran", "TRIA3 TETRA4 PENTA6", loses="flat digits"),
    mixed("netgen", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5"),
    one_type("obj", "TRIA3 QUAD4"),
    one_type("off", "TRIA3"),
    mixed("permas", LINEAR),
    one_type("su2", "TETRA4 HEXA8 PENTA6 PYRAM5", loses="", refuses="plane flat"),
    one_type(
        "tecplot", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8", keeps="group overlap empty nodes node_number cell_number field gap"
    ),
)
assert [row.form for row in TABLE if not row.options] == [form.name for form in FORMATS]
