"""Subdivision of slave faces and their parents: the new nodes and their positions, and the children of each cell.

    points = the new nodes on every face, once for all cells that share it      (cut_faces)
    children of the skin cells on the faces                                     (cut_skin_cells)
    children of the parents, and the new nodes inside them                      (cut_parents)

A cell with several slave faces is cut once per face, in the order of its own facets. Each pattern leaves the other
facets whole, so the next face has exactly one owner among the children of the earlier cuts; it is found in the same way
as the first owners (`skin.find_owners`). All cells are cut together: there are as many rounds as the largest number of
slave faces of a cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import CONE, RING, WHOLE, Template, face_pattern, listings, parent_pattern
from lacmesh.mesh import Floats, Ints, Mesh, codes
from lacmesh.reference.shapes import shape
from lacmesh.topology.orientation import relative_listing
from lacmesh.topology.skin import FACE_TYPES, FaceIncidence, Faces, find_owners

#: patterns, as codes of arrays
PATTERNS = (WHOLE, CONE, RING)
WHOLE_CODE, CONE_CODE, RING_CODE = range(3)
#: a child that is cut again leaves its index to fewer children than so many; they are counted anew after each round
_ROOM = 8


@dataclass(frozen=True)
class NewNodes:
    """New nodes `ids` (k, m) in k cells of one type with nodes `sources` (k, n), at reference points `at` (m, dim).

    `on` (k, c): the corners of the face, edge or cell on which they lie.
    """

    type: str
    sources: Ints
    at: Floats
    ids: Ints
    on: Ints

    def values(self, old: Floats) -> Floats:
        """(k, m, ...): node values `old` (n_nodes, ...) interpolated at the new nodes by the cells' shape functions."""
        return np.einsum("mn,kn...->km...", shape(self.type, self.at), old[self.sources], optimize=True)


def n_added(new_nodes: list[NewNodes]) -> int:
    """Number of new nodes."""
    return sum(nodes.ids.size for nodes in new_nodes)


def node_values(old: NDArray, new_nodes: list[NewNodes]) -> NDArray:
    """(n + added, ...): values at old and new nodes, interpolated in the cells in which the new nodes are created."""
    values = np.concatenate([old, np.zeros((n_added(new_nodes), *old.shape[1:]), old.dtype)])
    for nodes in new_nodes:
        values[nodes.ids] = nodes.values(values)
    return values


@dataclass(frozen=True)
class ChildCells:
    """Cells of one type that replace others: `nodes` (k, n), `parent` (k,), and `child_index` (k,) in that, from 0."""

    type: str
    nodes: Ints
    parent: Ints
    child_index: Ints

    def take(self, rows: Ints) -> ChildCells:
        """Some of the cells."""
        return ChildCells(self.type, self.nodes[rows], self.parent[rows], self.child_index[rows])


@dataclass(frozen=True)
class CutFaces:
    """Faces with their `patterns` (f,), codes of PATTERNS, and the new nodes on them, `points` (f, p), padded with -1.

    `ring`, `depth`: the shape of the ring, as parts of a cell.
    """

    faces: Faces
    patterns: Ints
    points: Ints
    ring: float
    depth: float

    def by_pattern(self, rows: Ints | None = None) -> Iterator[tuple[str, str, Ints]]:
        """Iterate over what all faces, or those of some `rows`, have: (face type, pattern, which of them)."""
        faces = slice(None) if rows is None else rows
        code = self.faces.type[faces] * len(PATTERNS) + self.patterns[faces]
        for value in codes(code):
            yield FACE_TYPES[value // len(PATTERNS)], PATTERNS[value % len(PATTERNS)], np.flatnonzero(code == value)

    def frame(self, nodes: Ints, listed: Ints, faces: Ints, face_type: str, pattern: str) -> Ints:
        """(k, ...): nodes of cells, then the points of their faces in the cells' listing (`listed`: facet nodes)."""
        rows = relative_listing(self.faces.take(faces), Faces.join([(face_type, listed)]))
        places = listings(face_type, pattern, self.ring)[rows]
        return np.hstack([nodes, np.take_along_axis(self.points[faces], places, axis=1)])


@dataclass(frozen=True)
class Subdivision:
    """Result of a cut: the faces with what was put on them, all new nodes, and the cells that replace others."""

    cut: CutFaces
    new_nodes: list[NewNodes]
    children: list[ChildCells]


def subdivide(
    mesh: Mesh,
    faces: Faces,
    patterns: Ints,
    skin: FaceIncidence,
    parents: FaceIncidence,
    ring: float = 1 / 3,
    depth: float = 1 / 2,
) -> Subdivision:
    """Cut `faces` by their `patterns` (f,), codes of PATTERNS, the skin cells on them, and the parents behind them."""
    cut, on_faces = cut_faces(CutFaces(faces, patterns, np.empty((len(faces), 0), np.int64), ring, depth), mesh.n_nodes)
    of_skin = cut_skin_cells(mesh, cut, skin)
    of_parents, inside = cut_parents(mesh, cut, parents, _after(on_faces, mesh.n_nodes))
    return Subdivision(cut, [*on_faces, *inside], [*of_skin, *of_parents])


def cut_faces(cut: CutFaces, first: int) -> tuple[CutFaces, list[NewNodes]]:
    """Make the new nodes on every face, from id `first` on: the faces with their points, and the new nodes."""
    groups = [(kind, face_pattern(kind, name, cut.ring), rows) for kind, name, rows in cut.by_pattern()]
    points = np.full((len(cut.faces), max((len(p.on_face) for _, p, _ in groups), default=0)), -1, np.int64)
    new_nodes: list[NewNodes] = []
    for kind, pattern, rows in groups:
        if len(pattern.on_face):
            nodes = cut.faces.nodes[rows][:, : CELLS[kind].n_nodes]
            corners = nodes[:, : CELLS[kind].n_corners]
            new_nodes.append(_nodes_at(kind, nodes, pattern.on_face, corners, _after(new_nodes, first)))
            points[rows, : len(pattern.on_face)] = new_nodes[-1].ids
    return replace(cut, points=points), new_nodes


def cut_skin_cells(mesh: Mesh, cut: CutFaces, skin: FaceIncidence) -> list[ChildCells]:
    """Cut the skin cells on the faces; their children are in each cell's own order. `skin`: sorted by cell."""
    children: list[ChildCells] = []
    for kind, cells, nodes in mesh.select(skin.cell):
        faces = skin.face[np.searchsorted(skin.cell, cells)]
        for face_type, name, rows in cut.by_pattern(faces):
            if name != WHOLE:
                frame = cut.frame(nodes[rows], nodes[rows], faces[rows], face_type, name)
                children += _children(face_pattern(kind, name, cut.ring), frame, cells[rows])
    return children


def cut_parents(
    mesh: Mesh, cut: CutFaces, parents: FaceIncidence, first: int
) -> tuple[list[ChildCells], list[NewNodes]]:
    """Cut the parents; return their children, and the new nodes inside them, from id `first` on."""
    order = np.lexsort((parents.facet, parents.cell))
    order = order[cut.patterns[parents.face[order]] != WHOLE_CODE]
    face, cell, facet = parents.face[order], parents.cell[order], parents.facet[order]
    starts = np.flatnonzero(np.diff(cell, prepend=-1))
    nth = np.arange(len(cell)) - np.repeat(starts, np.diff(starts, append=len(cell)))
    children = [ChildCells(kind, nodes, cells, 0 * cells) for kind, cells, nodes in mesh.select(cell[starts])]
    owners = FaceIncidence(face[starts], np.arange(len(starts)), facet[starts], starts >= 0)
    children, new_nodes = _cut_once(mesh, cut, children, owners, first)
    for r in range(1, int(nth.max(initial=0)) + 1):
        n_nodes = _after(new_nodes, first)
        owners = _owners(cut, children, face[nth == r], cell[nth == r], n_nodes)
        children, inside = _cut_once(mesh, cut, children, owners, n_nodes)
        children, new_nodes = _renumbered(children), [*new_nodes, *inside]
    return children, new_nodes


def _owners(cut: CutFaces, children: list[ChildCells], face: Ints, parent: Ints, n_nodes: int) -> FaceIncidence:
    """Find for each pair of a cell `parent` and a face `face` the row of the child of that cell that owns the face."""
    wanted, which = np.unique(face, return_inverse=True)
    of = np.concatenate([block.parent for block in children])
    ends = np.cumsum([len(block.parent) for block in children])[:-1]
    rows = np.split(np.arange(len(of)), ends)
    cells = [(block.type, block.nodes, own) for block, own in zip(children, rows, strict=True)]
    owners = find_owners(cut.faces.take(wanted), cells, n_nodes)
    size = int(parent.max()) + 1
    mine = (of[owners.cell] < size) & np.isin(owners.face * size + of[owners.cell], which * size + parent)
    return FaceIncidence(wanted[owners.face[mine]], owners.cell[mine], owners.facet[mine], owners.same[mine])


def _cut_once(
    mesh: Mesh, cut: CutFaces, cells: list[ChildCells], owners: FaceIncidence, first: int
) -> tuple[list[ChildCells], list[NewNodes]]:
    """Replace the cells that own a face by their children. `owners`: the faces, and the rows of their cells in all."""
    out: list[ChildCells] = []
    new_nodes: list[NewNodes] = []
    start = 0
    for block in cells:
        stop = start + len(block.parent)
        at = np.flatnonzero((owners.cell >= start) & (owners.cell < stop))
        rows = owners.cell[at] - start
        left = block.take(np.setdiff1d(np.arange(len(block.parent)), rows, assume_unique=True))
        if len(left.parent):
            out.append(replace(left, child_index=left.child_index * _ROOM))
        more, inside = _cut_cells(
            mesh, cut, block.take(rows), owners.facet[at], owners.face[at], _after(new_nodes, first)
        )
        out, new_nodes = [*out, *more], [*new_nodes, *inside]
        start = stop
    return out, new_nodes


def _cut_cells(
    mesh: Mesh, cut: CutFaces, owners: ChildCells, facet: Ints, faces: Ints, first: int
) -> tuple[list[ChildCells], list[NewNodes]]:
    """Cut cells (all of one type) whose facet number `facet` is the slave face `faces`."""
    children: list[ChildCells] = []
    new_nodes: list[NewNodes] = []
    for j in codes(facet):
        at = np.flatnonzero(facet == j)
        for face_type, name, some in cut.by_pattern(faces[at]):
            rows = at[some]
            mine = owners.take(rows)
            pattern = parent_pattern(owners.type, int(j), name, cut.ring, cut.depth)
            listed = mine.nodes[:, CELLS[owners.type].facets[j].nodes]
            frame = cut.frame(mine.nodes, listed, faces[rows], face_type, name)
            if len(pattern.inside):
                corners = _corners(mesh, mine.parent)
                new_nodes.append(_nodes_at(owners.type, mine.nodes, pattern.inside, corners, _after(new_nodes, first)))
                frame = np.hstack([frame, new_nodes[-1].ids])
            children += _children(pattern, frame, mine.parent, mine.child_index)
    return children, new_nodes


def _children(pattern: Template, frame: Ints, parent: Ints, index: Ints | int = 0) -> list[ChildCells]:
    """Children of cells with nodes in a frame, in the places of those cells among the children of their parents."""
    return [
        ChildCells(
            block.type,
            frame[:, block.nodes].reshape(-1, block.nodes.shape[1]),
            np.repeat(parent, len(block.rank)),
            ((np.broadcast_to(index, parent.shape) * _ROOM)[:, None] + block.rank).ravel(),
        )
        for block in pattern.children
    ]


def _renumbered(children: list[ChildCells]) -> list[ChildCells]:
    """Children whose indices in their parents count from 0 without gaps, in the same order."""
    parent, index = (np.concatenate([getattr(b, f) for b in children]) for f in ("parent", "child_index"))
    order = np.lexsort((index, parent))
    start = np.flatnonzero(np.diff(parent[order], prepend=-1))
    counted = np.empty(len(order), np.int64)
    counted[order] = np.arange(len(order)) - np.repeat(start, np.diff(start, append=len(order)))
    ends = np.cumsum([len(b.parent) for b in children])[:-1]
    return [replace(b, child_index=own) for b, own in zip(children, np.split(counted, ends), strict=True)]


def _nodes_at(kind: str, sources: Ints, at: Floats, on: Ints, first: int) -> NewNodes:
    """New nodes at points `at` of some cells, numbered cell by cell from id `first` on."""
    return NewNodes(kind, sources, at, first + np.arange(len(sources) * len(at)).reshape(len(sources), len(at)), on)


def _after(new_nodes: list[NewNodes], first: int) -> int:
    """Return the id after those of the new nodes; `first`: that of the first."""
    return first + n_added(new_nodes)


def _corners(mesh: Mesh, cells: Ints) -> Ints:
    """(k, 8): the corners of cells of the mesh, padded with the last one."""
    corners = np.empty((len(cells), 8), np.int64)
    order = np.argsort(cells, kind="stable")
    done = 0
    for kind, some, nodes in mesh.select(cells[order]):
        n = CELLS[kind].n_corners
        corners[order[done : done + len(some)]] = nodes[:, np.minimum(np.arange(8), n - 1)]
        done += len(some)
    return corners
