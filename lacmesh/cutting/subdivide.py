"""Subdivision of slave faces and their parents: the new nodes and their positions, and the children of each cell.

A cell with several slave faces is cut once per face, in the order of its own facets. Each pattern leaves the other
facets whole, so the next face has exactly one owner among the children of the earlier cuts; it is found in the same way
as the first owners (`skin.find_owners`). All cells are cut together: there are as many rounds as the largest number of
slave faces of a cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import CONE, RING, WHOLE, Template, face_pattern, parent_pattern, turns
from lacmesh.mesh import Floats, Ints, Mesh, codes
from lacmesh.reference.shapes import shape
from lacmesh.topology.skin import FACE_TYPES, FaceIncidence, Faces, find_owners, turn

#: kinds of cut, as codes of arrays
KINDS = (WHOLE, CONE, RING)
WHOLE_CODE, CONE_CODE, RING_CODE = range(3)
#: a cell has at most this many children in one cut; keys of children are numbers in this base
_BASE = 8


@dataclass(frozen=True)
class Birth:
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
class Leaves:
    """Cells of one type that replace others: `nodes` (k, n); `root` (k,), the replaced cell; `key` (k,), the order."""

    type: str
    nodes: Ints
    root: Ints
    key: Ints

    def take(self, rows: Ints) -> Leaves:
        """Some of the cells."""
        return Leaves(self.type, self.nodes[rows], self.root[rows], self.key[rows])


@dataclass(frozen=True)
class Subdivision:
    """Result of a cut: new nodes, points of each face (f, p), padded with -1, and the cells that replace others."""

    n_nodes: int
    births: list[Birth]
    face_points: Ints
    leaves: list[Leaves]


class Cutter:
    """State of a cut: the nodes made so far, while faces and cells are cut one kind after the other."""

    def __init__(self, mesh: Mesh, faces: Faces, kinds: Ints, ring: float, depth: float) -> None:
        self.mesh, self.faces, self.kinds = mesh, faces, kinds
        self.ring, self.depth = ring, depth
        self.n_nodes = mesh.n_nodes
        self.births: list[Birth] = []
        self.face_points = self._cut_faces()

    def _born(self, kind: str, sources: Ints, at: Floats, on: Ints) -> Ints:
        ids = self.n_nodes + np.arange(len(sources) * len(at)).reshape(len(sources), len(at))
        if ids.size:
            self.n_nodes += ids.size
            self.births.append(Birth(kind, sources, at, ids, on))
        return ids

    def _cut_faces(self) -> Ints:
        """Make the new nodes on every face, once for all the cells that share it."""
        found = [
            (face_type, face_pattern(face_type, kind, self.ring), rows)
            for face_type, kind, rows in self._face_kinds(np.arange(len(self.faces)))
        ]
        width = max((len(pattern.on_face) for _, pattern, _ in found), default=0)
        points = np.full((len(self.faces), width), -1, np.int64)
        for face_type, pattern, rows in found:
            sources = self.faces.nodes[rows][:, : CELLS[face_type].n_nodes]
            on = sources[:, : CELLS[face_type].n_corners]
            points[rows, : len(pattern.on_face)] = self._born(face_type, sources, pattern.on_face, on)
        return points

    def _face_kinds(self, faces: Ints) -> Iterator[tuple[str, str, Ints]]:
        """Iterate over the combinations present: (face type, kind, rows of `faces`)."""
        code = self.faces.type[faces] * len(KINDS) + self.kinds[faces]
        for value in codes(code):
            yield FACE_TYPES[value // len(KINDS)], KINDS[value % len(KINDS)], np.flatnonzero(code == value)

    def _frame(self, nodes: Ints, listed: Ints, faces: Ints, face_type: str, kind: str) -> Ints:
        """(k, ...): nodes of cells, then the points of their faces in the cells' listing (`listed`: facet nodes)."""
        of = self.faces.take(faces)
        rows = turn(of, Faces.join([(face_type, listed)]))
        places = turns(face_type, kind, self.ring)[rows]
        return np.hstack([nodes, np.take_along_axis(self.face_points[faces], places, axis=1)])

    def _corners(self, cells: Ints) -> Ints:
        """(k, 8): the corners of cells of the mesh, padded with the last one."""
        corners = np.empty((len(cells), 8), np.int64)
        order = np.argsort(cells, kind="stable")
        done = 0
        for kind, some, nodes in self.mesh.select(cells[order]):
            n = CELLS[kind].n_corners
            corners[order[done : done + len(some)]] = nodes[:, np.minimum(np.arange(8), n - 1)]
            done += len(some)
        return corners

    def cut_skin_cells(self, kind_of_cell: str, nodes: Ints, cells: Ints, faces: Ints) -> Iterator[Leaves]:
        """Cut skin cells (all of one type) that lie on `faces`; yield their children, in each cell's own order."""
        for face_type, kind, rows in self._face_kinds(faces):
            if kind != WHOLE:
                frame = self._frame(nodes[rows], nodes[rows], faces[rows], face_type, kind)
                yield from _children(face_pattern(kind_of_cell, kind, self.ring), frame, cells[rows], 0)

    def cut_cells(self, owners: Leaves, facet: Ints, faces: Ints) -> Iterator[Leaves]:
        """Cut cells (all of one type) whose facet number `facet` is the slave face `faces`; yield their children."""
        cell = CELLS[owners.type]
        for j in codes(facet):
            at = np.flatnonzero(facet == j)
            for face_type, kind, some in self._face_kinds(faces[at]):
                rows = at[some]
                mine = owners.take(rows)
                pattern = parent_pattern(owners.type, int(j), kind, self.ring, self.depth)
                listed = mine.nodes[:, cell.facets[j].nodes]
                frame = self._frame(mine.nodes, listed, faces[rows], face_type, kind)
                if len(pattern.inside):
                    inside = self._born(owners.type, mine.nodes, pattern.inside, self._corners(mine.root))
                    frame = np.hstack([frame, inside])
                yield from _children(pattern, frame, mine.root, mine.key)


def _children(pattern: Template, frame: Ints, root: Ints, key: Ints | int) -> Iterator[Leaves]:
    for block in pattern.children:
        nodes = frame[:, block.nodes].reshape(-1, block.nodes.shape[1])
        n = len(block.rank)
        ranked = (np.broadcast_to(key, root.shape) * _BASE)[:, None] + block.rank
        yield Leaves(block.type, nodes, np.repeat(root, n), ranked.ravel())


def subdivide(
    mesh: Mesh,
    faces: Faces,
    kinds: Ints,
    skin: FaceIncidence,
    parents: FaceIncidence,
    ring: float = 1 / 3,
    depth: float = 1 / 2,
) -> Subdivision:
    """Cut `faces` (kinds (f,), codes of KINDS), the skin cells on them and the parents behind (cells of `mesh`)."""
    cutter = Cutter(mesh, faces, kinds, ring, depth)
    leaves: list[Leaves] = []
    for kind, cells, nodes in mesh.select(skin.cell):
        on = skin.face[np.searchsorted(skin.cell, cells)]
        leaves.extend(cutter.cut_skin_cells(kind, nodes, cells, on))
    leaves.extend(_cut_parents(cutter, parents))
    return Subdivision(cutter.n_nodes, cutter.births, cutter.face_points, leaves)


def _cut_parents(cutter: Cutter, parents: FaceIncidence) -> list[Leaves]:
    order = np.lexsort((parents.facet, parents.cell))
    order = order[cutter.kinds[parents.face[order]] != WHOLE_CODE]
    face, cell, facet = parents.face[order], parents.cell[order], parents.facet[order]
    first = np.flatnonzero(np.diff(cell, prepend=-1))
    turn_of = np.arange(len(cell)) - np.repeat(first, np.diff(first, append=len(cell)))
    leaves: list[Leaves] = []
    for kind, cells, nodes in cutter.mesh.select(cell[first]):
        rows = first[np.searchsorted(cell[first], cells)]
        owners = Leaves(kind, nodes, cells, np.zeros(len(cells), np.int64))
        leaves.extend(cutter.cut_cells(owners, facet[rows], face[rows]))
    for r in range(1, int(turn_of.max(initial=0)) + 1):
        now = np.flatnonzero(turn_of == r)
        leaves = _cut_again(cutter, leaves, face[now], cell[now])
    return leaves


def _cut_again(cutter: Cutter, leaves: list[Leaves], face: Ints, root: Ints) -> list[Leaves]:
    """Cut once more: for each pair of a cell `root` and a face `face`, the child of that cell that owns that face."""
    wanted, which = np.unique(face, return_inverse=True)
    starts = np.cumsum([0, *(len(block.root) for block in leaves)])
    parts = [(b.type, b.nodes, starts[k] + np.arange(len(b.root))) for k, b in enumerate(leaves)]
    found = find_owners(cutter.faces.take(wanted), parts, cutter.n_nodes)
    roots = np.concatenate([b.root for b in leaves])[found.cell]
    size = cutter.mesh.n_cells
    mine = np.isin(found.face * size + roots, which * size + root)
    out: list[Leaves] = []
    for k, block in enumerate(leaves):
        rows = np.flatnonzero(mine & (found.cell >= starts[k]) & (found.cell < starts[k + 1]))
        local = found.cell[rows] - starts[k]
        kept = np.setdiff1d(np.arange(len(block.root)), local, assume_unique=True)
        left = block.take(kept)
        out.append(Leaves(left.type, left.nodes, left.root, left.key * _BASE))
        out.extend(cutter.cut_cells(block.take(local), found.facet[rows], wanted[found.face[rows]]))
    return out
