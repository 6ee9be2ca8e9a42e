"""gmsh's current model as a mesh.

    content = nodes, cells, groups, boundaries, links and views, by gmsh's functions   (`_content`)
    mesh = what a msh file with that content makes                                      (`formats.msh.assembly`)

gmsh's getElements shows one type of a shape in an entity. Where it shows fewer cells than the model counts, cells are
taken from a temporary file that gmsh writes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import DataError, RequestError
from lacmesh.formats import read
from lacmesh.formats.msh.assembly import to_mesh
from lacmesh.formats.msh.content import Content, Piece
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.formats.msh.types import TYPE_NAMES, UNKNOWN_TYPE
from lacmesh.gmsh import attribute, session, views
from lacmesh.mesh import Ints, Mesh, Tag, concatenated

#: What gmsh counts in the current model: its option -> our family.
_COUNTS = {
    "NbTriangles": "TRIA",
    "NbQuadrangles": "QUAD",
    "NbTetrahedra": "TETRA",
    "NbHexahedra": "HEXA",
    "NbPrisms": "PENTA",
    "NbPyramids": "PYRAM",
}
#: It counts no lines and points: it is asked about the numbers that no cell found has, so many at a time.
_ASKED = 1 << 20
#: Entities that are parts of others.
_PARTS = ("Partition", "Ghost")
_FULL_FILE = {"SaveAll": 1, "Binary": 1, "MshFileVersion": 4.1, "SaveParametric": 0, "ScalingFactor": 1}


@dataclass(frozen=True)
class Read:
    """The model `name` and its mesh. `parent`: entities that are parts (of a partition) -> the entity they belong to.

    `raw`: the mesh with the entities that hold its cells and nodes, parts among them. `held`: the views it came with.
    """

    name: str
    raw: Mesh
    parent: Mapping[Tag, Tag] = field(default_factory=dict)
    held: tuple[views.Held, ...] = ()

    @cached_property
    def mesh(self) -> Mesh:
        """Mesh in which parts of entities are replaced by the entities they belong to, as msh files are read."""
        if not self.parent:
            return self.raw
        own = {tag: of for tag, of in self.parent.items() if tag[0] == of[0]}
        data = [
            renamed(d["entity"], known) for d, known in ((self.raw.cell_data, own), (self.raw.node_data, self.parent))
        ]
        return replace(
            self.raw,
            cell_data={**self.raw.cell_data, "entity": data[0]},
            node_data={**self.raw.node_data, "entity": data[1]},
        )


def read_model(keep: Collection[Tag] | None = None) -> Read:
    """Read the current model. `keep`: cells of these entities only. Raises RequestError, DataError."""
    gmsh = session.running()
    name = gmsh.model.getCurrent()
    source = MshBytes(Path(f"gmsh's model {name!r}"), b"-")
    source.size = 1 << 40  # no file, whose size would bound what its fields may take
    content = Content(source)
    _add_nodes(gmsh, content)
    if not len(content.node_number):
        raise RequestError(f"gmsh's current model {name!r} has no mesh; gmsh.model.mesh.generate() makes one")
    parent = _add_cells(gmsh, content, keep)
    if keep is None and not _complete(gmsh, content):
        if parent:
            raise DataError("a partitioned model with cells of several orders in an entity: unpartition it first")
        content.pieces = list(_pieces_through_file(gmsh))
    _add_groups(gmsh, content)
    content.boundary = _boundary(gmsh, content)
    content.links = list(_links(gmsh))
    content.notes = attribute.read_notes(gmsh, name)
    kept_views = views.read_views(gmsh, name, content)
    content.rows = [h.rows for h in kept_views if not h.stale]
    named = content.notes.name is None and name
    mesh = to_mesh(content)
    return Read(name, replace(mesh, name=name) if named else mesh, parent, tuple(kept_views))


def renamed(entity: Ints, known: Mapping[Tag, Tag]) -> Ints:
    """Entities (n, 2), with those in `known` replaced by what it maps them to."""
    rows, which = np.unique(entity, axis=0, return_inverse=True)
    return np.array([known.get((int(d), int(t)), (d, t)) for d, t in rows], np.int32)[which.ravel()]


def _add_nodes(gmsh: Any, content: Content) -> None:
    number, points, entity = [np.empty(0, np.int64)], [np.empty(0)], []
    for dim, tag in gmsh.model.getEntities():
        tags, xyz, _ = gmsh.model.mesh.getNodes(dim, tag, returnParametricCoord=False)
        number.append(tags.astype(np.int64))
        points.append(xyz)
        entity.append(np.broadcast_to(np.array([dim, tag], np.int32), (len(tags), 2)))
    content.node_number = np.concatenate(number)
    content.points = np.concatenate(points).reshape(-1, 3)
    content.node_entity = np.concatenate(entity) if entity else None


def _add_cells(gmsh: Any, content: Content, keep: Collection[Tag] | None) -> dict[Tag, Tag]:
    """Add the cells, entity by entity, as gmsh writes them; return the parents of entities that are parts of others."""
    parent: dict[Tag, Tag] = {}
    at = 0
    for dim, tag in gmsh.model.getEntities():
        if gmsh.model.getType(dim, tag).startswith("Ghost"):  # cells that other entities hold
            continue
        partition = -1
        if (of := tuple(gmsh.model.getParent(dim, tag)))[0] >= 0:
            parent[dim, tag] = of
            partition = int(next(iter(gmsh.model.getPartitions(dim, tag)), -1))
        if keep is not None and (dim, tag) not in keep:
            continue
        groups = tuple((dim, abs(int(g))) for g in gmsh.model.getPhysicalGroupsForEntity(dim, tag))
        for gmsh_type, number, nodes in zip(*gmsh.model.mesh.getElements(dim, tag), strict=True):
            name = TYPE_NAMES.get(int(gmsh_type))
            if name is None:
                raise DataError(UNKNOWN_TYPE.format(gmsh_type))
            rows = nodes.astype(np.int64).reshape(len(number), -1)
            content.pieces.append(Piece(name, number.astype(np.int64), rows, at, (dim, tag), partition, groups))
            at += len(number)
    return parent


def _complete(gmsh: Any, content: Content) -> bool:
    """True if the cells found are all cells of the model."""
    counts = dict.fromkeys(_COUNTS.values(), 0)
    for piece in content.pieces:
        family = ALL_CELLS[piece.type].family
        if family in counts:
            counts[family] += len(piece.number)
    if any(int(gmsh.option.getNumber(f"Mesh.{option}")) != counts[family] for option, family in _COUNTS.items()):
        return False
    number = np.sort(concatenated(p.number for p in content.pieces))
    last = int(gmsh.model.mesh.getMaxElementTag())
    for a in range(1, last + 1, _ASKED) if last > len(number) else ():
        b = min(a + _ASKED, last + 1)
        free = np.ones(b - a, bool)
        free[number[slice(*np.searchsorted(number, (a, b)))] - a] = False
        if free.any() and _any_cell(gmsh, a + np.flatnonzero(free)):
            return False
    return True


def _any_cell(gmsh: Any, numbers: Ints) -> bool:
    """True if any of the numbers is a cell's: a number without a cell stays invisible when it is made visible."""
    hidden = numbers[gmsh.model.mesh.getVisibility(numbers) == 0]
    if len(hidden) < len(numbers):
        return True
    gmsh.model.mesh.setVisibility(hidden, 1)
    shown = hidden[gmsh.model.mesh.getVisibility(hidden) != 0]
    gmsh.model.mesh.setVisibility(shown, 0)
    return len(shown) > 0


def _pieces_through_file(gmsh: Any) -> Iterator[Piece]:
    """The cells of the current model from a file that gmsh writes."""
    with tempfile.TemporaryDirectory(prefix="lacmesh-") as folder, _options(gmsh, _FULL_FILE):
        path = Path(folder) / "model.msh"
        gmsh.write(str(path))
        mesh = read(path)
    place = mesh.places_in_file(np.arange(mesh.n_cells))
    entity = mesh.cell_data["entity"]
    for block, (a, b) in zip(mesh.blocks, pairwise(mesh.offsets.tolist()), strict=True):
        for own in np.unique(entity[a:b], axis=0).tolist():
            rows = np.flatnonzero((entity[a:b] == own).all(axis=1))
            groups = tuple((own[0], abs(int(g))) for g in gmsh.model.getPhysicalGroupsForEntity(*own))
            nodes = mesh.node_number[block.nodes[rows]]
            yield Piece(block.type, mesh.cell_number[a + rows], nodes, place[a + rows], tuple(own), -1, groups)


@contextmanager
def _options(gmsh: Any, wanted: Mapping[str, float]) -> Iterator[None]:
    """Set options of gmsh's mesh inside the block, and restore them after it."""
    before = {name: gmsh.option.getNumber(f"Mesh.{name}") for name in wanted}
    try:
        for name, value in wanted.items():
            gmsh.option.setNumber(f"Mesh.{name}", value)
        yield
    finally:
        for name, value in before.items():
            gmsh.option.setNumber(f"Mesh.{name}", value)


def _add_groups(gmsh: Any, content: Content) -> None:
    for dim, tag in gmsh.model.getPhysicalGroups():
        if name := gmsh.model.getPhysicalName(dim, tag):
            content.names.append((dim, abs(tag), name))


def _boundary(gmsh: Any, content: Content) -> dict[Tag, tuple[int, ...]]:
    """Signed tags of the entities that bound each entity, except parts; tags of embedded ones are beyond the largest.

    As in files, empty if no entity has a boundary and each holds nodes or cells.
    """
    last = [max((tag for _, tag in gmsh.model.getEntities(dim)), default=0) for dim in range(4)]
    boundary = {}
    for dim, tag in gmsh.model.getEntities():
        if gmsh.model.getType(dim, tag).startswith(_PARTS):
            continue
        bounds = [int(t) for _, t in gmsh.model.getBoundary([(dim, tag)], combined=False, oriented=True)] if dim else []
        if dim == 1:  # the sign of a curve's end is told in files only
            bounds = [sign * abs(t) for sign, t in zip((1, -1), bounds, strict=False)]
        inside = [t for d, t in gmsh.model.mesh.getEmbedded(dim, tag) if d == dim - 1] if dim > 1 else []
        boundary[dim, tag] = (*bounds, *(last[dim - 1] + int(t) for t in inside))
    used = {tuple(p.entity) for p in content.pieces}
    if content.node_entity is not None:
        used |= {(int(d), int(t)) for d, t in _heads(content.node_entity)}
    return boundary if any(boundary.values()) or not used.issuperset(boundary) else {}


def _heads(rows: Ints) -> Ints:
    """The first of every run of equal rows."""
    return rows[np.append(True, (rows[1:] != rows[:-1]).any(axis=1))] if len(rows) else rows


def _links(gmsh: Any) -> Iterator[tuple[Tag, Tag, tuple[float, ...], Ints]]:
    for dim in range(3):
        tags = [tag for _, tag in gmsh.model.getEntities(dim)]
        for tag, master in zip(tags, gmsh.model.mesh.getPeriodic(dim, tags) if tags else (), strict=True):
            if master != tag:
                _, slaves, masters, affine = gmsh.model.mesh.getPeriodicNodes(dim, tag, includeHighOrderNodes=True)
                pairs = np.stack([slaves, masters], axis=1).astype(np.int64)
                yield (dim, tag), (dim, int(master)), tuple(affine.tolist()), pairs
