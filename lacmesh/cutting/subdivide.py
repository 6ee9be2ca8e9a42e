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

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import CONE, RING, WHOLE, Template, face_pattern, listings, parent_pattern
from lacmesh.mesh import Floats, Ints, Mesh, codes
from lacmesh.reference.shapes import shape
from lacmesh.topology.skin import FACE_TYPES, FaceIncidence, Faces, find_owners
from lacmesh.topology.winding import relative_listing

#: patterns, as codes of arrays
PATTERNS = (WHOLE, CONE, RING)
WHOLE_CODE, CONE_CODE, RING_CODE = range(3)
#: indices between two children, for the children of the first of them: a cell has fewer in one cut
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
class Subdivision:
    """Result of a cut: new nodes, points of each face (f, p), padded with -1, and the cells that replace others."""

    n_nodes: int
    new_nodes: list[NewNodes]
    face_points: Ints
    children: list[ChildCells]


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

    def frame(self, nodes: Ints, listed: Ints, faces: Ints, face_type: str, pattern: str) -> Ints:
        """(k, ...): nodes of cells, then the points of their faces in the cells' listing (`listed`: facet nodes)."""
        rows = relative_listing(self.faces.take(faces), Faces.join([(face_type, listed)]))
        places = listings(face_type, pattern, self.ring)[rows]
        return np.hstack([nodes, np.take_along_axis(self.points[faces], places, axis=1)])


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
    points, on_faces = cut_faces(faces, patterns, mesh.n_nodes, ring)
    cut = CutFaces(faces, patterns, points, ring, depth)
    of_skin = cut_skin_cells(mesh, cut, skin)
    of_parents, inside = cut_parents(mesh, cut, parents, _after(on_faces, mesh.n_nodes))
    new_nodes = [*on_faces, *inside]
    return Subdivision(_after(new_nodes, mesh.n_nodes), new_nodes, points, [*of_skin, *of_parents])


def cut_faces(faces: Faces, patterns: Ints, first: int, ring: float) -> tuple[Ints, list[NewNodes]]:
    """Make the new nodes on every face, from id `first` on: (points (f, p), padded with -1; the new nodes)."""
    groups = [(kind, face_pattern(kind, name, ring), rows) for kind, name, rows in _by_pattern(faces, patterns)]
    points = np.full((len(faces), max((len(p.on_face) for _, p, _ in groups), default=0)), -1, np.int64)
    new_nodes: list[NewNodes] = []
    for kind, pattern, rows in groups:
        if len(pattern.on_face):
            nodes = faces.nodes[rows][:, : CELLS[kind].n_nodes]
            corners = nodes[:, : CELLS[kind].n_corners]
            new_nodes.append(_made(kind, nodes, pattern.on_face, corners, _after(new_nodes, first)))
            points[rows, : len(pattern.on_face)] = new_nodes[-1].ids
    return points, new_nodes


def cut_skin_cells(mesh: Mesh, cut: CutFaces, skin: FaceIncidence) -> list[ChildCells]:
    """Cut the skin cells on the faces; their children are in each cell's own order. `skin`: sorted by cell."""
    children: list[ChildCells] = []
    for kind, cells, nodes in mesh.select(skin.cell):
        faces = skin.face[np.searchsorted(skin.cell, cells)]
        for face_type, name, rows in _by_pattern(cut.faces.take(faces), cut.patterns[faces]):
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
    children: list[ChildCells] = []
    new_nodes: list[NewNodes] = []
    for kind, cells, nodes in mesh.select(cell[starts]):
        rows = starts[np.searchsorted(cell[starts], cells)]
        whole = ChildCells(kind, nodes, cells, np.zeros(len(cells), np.int64))
        more, inside = _cut_cells(mesh, cut, whole, facet[rows], face[rows], _after(new_nodes, first))
        children, new_nodes = [*children, *more], [*new_nodes, *inside]
    for r in range(1, int(nth.max(initial=0)) + 1):
        now = np.flatnonzero(nth == r)
        children, inside = _cut_again(mesh, cut, children, face[now], cell[now], _after(new_nodes, first))
        new_nodes = [*new_nodes, *inside]
    return children, new_nodes


def _cut_again(
    mesh: Mesh, cut: CutFaces, children: list[ChildCells], face: Ints, parent: Ints, first: int
) -> tuple[list[ChildCells], list[NewNodes]]:
    """Cut once more: for each pair of a cell `parent` and a face `face`, the child of that cell that owns that face."""
    wanted, which = np.unique(face, return_inverse=True)
    starts = np.cumsum([0, *(len(block.parent) for block in children)])
    parts = [(b.type, b.nodes, starts[k] + np.arange(len(b.parent))) for k, b in enumerate(children)]
    owners = find_owners(cut.faces.take(wanted), parts, first)
    parents = np.concatenate([b.parent for b in children])[owners.cell]
    mine = np.isin(owners.face * mesh.n_cells + parents, which * mesh.n_cells + parent)
    out: list[ChildCells] = []
    new_nodes: list[NewNodes] = []
    for k, block in enumerate(children):
        rows = np.flatnonzero(mine & (owners.cell >= starts[k]) & (owners.cell < starts[k + 1]))
        local = owners.cell[rows] - starts[k]
        left = block.take(np.setdiff1d(np.arange(len(block.parent)), local, assume_unique=True))
        more, inside = _cut_cells(
            mesh, cut, block.take(local), owners.facet[rows], wanted[owners.face[rows]], _after(new_nodes, first)
        )
        out += [replace(left, child_index=left.child_index * _ROOM), *more]
        new_nodes += inside
    return _renumbered(out), new_nodes


def _cut_cells(
    mesh: Mesh, cut: CutFaces, owners: ChildCells, facet: Ints, faces: Ints, first: int
) -> tuple[list[ChildCells], list[NewNodes]]:
    """Cut cells (all of one type) whose facet number `facet` is the slave face `faces`, into children with room."""
    children: list[ChildCells] = []
    new_nodes: list[NewNodes] = []
    for j in codes(facet):
        at = np.flatnonzero(facet == j)
        for face_type, name, some in _by_pattern(cut.faces.take(faces[at]), cut.patterns[faces[at]]):
            rows = at[some]
            mine = owners.take(rows)
            pattern = parent_pattern(owners.type, int(j), name, cut.ring, cut.depth)
            listed = mine.nodes[:, CELLS[owners.type].facets[j].nodes]
            frame = cut.frame(mine.nodes, listed, faces[rows], face_type, name)
            if len(pattern.inside):
                corners = _corners(mesh, mine.parent)
                new_nodes.append(_made(owners.type, mine.nodes, pattern.inside, corners, _after(new_nodes, first)))
                frame = np.hstack([frame, new_nodes[-1].ids])
            children += _children(pattern, frame, mine.parent, mine.child_index)
    return children, new_nodes


def _children(pattern: Template, frame: Ints, parent: Ints, index: Ints | int = 0) -> list[ChildCells]:
    """Children of cells with nodes in a frame; between two indices there is room for the children of a child."""
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


def _made(kind: str, sources: Ints, at: Floats, on: Ints, first: int) -> NewNodes:
    """New nodes at points `at` of some cells, numbered cell by cell from id `first` on."""
    return NewNodes(kind, sources, at, first + np.arange(len(sources) * len(at)).reshape(len(sources), len(at)), on)


def _after(new_nodes: list[NewNodes], first: int) -> int:
    """Return the id after those of the new nodes; `first`: that of the first."""
    return first + sum(nodes.ids.size for nodes in new_nodes)


def _by_pattern(faces: Faces, patterns: Ints) -> Iterator[tuple[str, str, Ints]]:
    """Iterate over the combinations present: (face type, pattern, rows of `faces`)."""
    code = faces.type * len(PATTERNS) + patterns
    for value in codes(code):
        yield FACE_TYPES[value // len(PATTERNS)], PATTERNS[value % len(PATTERNS)], np.flatnonzero(code == value)


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
