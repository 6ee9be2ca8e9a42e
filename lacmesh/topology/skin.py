"""Faces of skins: the cells on them, the cells that own them, their edges, and the matching of rows of nodes.

A face is identified by its corners, in any order. Only cells that touch the requested faces are examined, so that the
cost is one pass over the mesh's nodes and then grows with the faces (no table of all facets is ever built).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS, Cell, Facet
from lacmesh.mesh import Ints, Mesh, codes, concatenated, places_of

Bools = NDArray[np.bool_]
#: width of a padded list of a face's nodes (QUAD9) and corners
MAX_NODES, MAX_CORNERS = 9, 4
#: cells, or facets, that are treated at once
PIECE = 1 << 16
#: 2^64 over the golden ratio, odd
_GOLDEN = 0x9E3779B97F4A7C15
#: face types, in the order of the codes that `Faces.type` uses
FACE_TYPES = ("POI1", "SEG2", "SEG3", "TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9")
TYPE_CODE = {name: code for code, name in enumerate(FACE_TYPES)}
N_CORNERS = np.array([CELLS[name].n_corners for name in FACE_TYPES])
N_NODES = np.array([CELLS[name].n_nodes for name in FACE_TYPES])
_WHOLE = {
    kind: (Facet(kind, *(tuple(range(n)) for n in (CELLS[kind].n_nodes, CELLS[kind].n_corners))),)
    for kind in FACE_TYPES
}


@dataclass(frozen=True)
class Faces:
    """Faces of any types, one per row: `type` (f,), codes of FACE_TYPES; `nodes` (f, 9), padded with -1."""

    type: Ints
    nodes: Ints

    def __len__(self) -> int:
        return len(self.type)

    def take(self, rows: Ints) -> Faces:
        """Some of the faces."""
        return Faces(self.type[rows], self.nodes[rows])

    @property
    def distinct_nodes(self) -> Ints:
        """(n,): the nodes of all faces, each once, sorted."""
        return np.unique(self.nodes[self.nodes >= 0])

    @property
    def corners(self) -> Ints:
        """(f, 4): the corners, padded with -1."""
        return np.where(np.arange(MAX_CORNERS) < N_CORNERS[self.type][:, None], self.nodes[:, :MAX_CORNERS], -1)

    @classmethod
    def stack(cls, parts: Sequence[Faces]) -> Faces:
        """Lists of faces, one after the other."""
        return cls(np.concatenate([p.type for p in parts]), np.vstack([p.nodes for p in parts]))

    @classmethod
    def join(cls, parts: Iterable[tuple[str, Ints]]) -> Faces:
        """Join parts (type, nodes (k, n)) into one list of faces, in their order."""
        parts = list(parts)
        code = concatenated(np.full(len(rows), TYPE_CODE[kind]) for kind, rows in parts)
        nodes = np.full((len(code), MAX_NODES), -1, np.int64)
        start = 0
        for _, rows in parts:
            nodes[start : start + len(rows), : rows.shape[1]] = rows
            start += len(rows)
        return cls(code, nodes)


@dataclass(frozen=True)
class FaceIncidence:
    """Incident pairs, one per row: `face`, `cell` (the caller's id), and `facet`, the number of the face in the cell.

    Rows are sorted by face, then by cell. `same`: the facet has all nodes of the face, mid-nodes included.
    """

    face: Ints
    cell: Ints
    facet: Ints
    same: Bools

    def take(self, rows: Ints) -> FaceIncidence:
        """Some of the pairs."""
        return FaceIncidence(self.face[rows], self.cell[rows], self.facet[rows], self.same[rows])


# ---- rows of nodes that are equal


def mixed_bits(numbers: Ints, seed: int = 1) -> NDArray[np.uint64]:
    """Hash numbers from 0 to 64 bits each, so that the sum over a set of numbers identifies the set.

    The finalizer of splitmix64 (Steele, Lea, Flood, OOPSLA 2014).
    """
    x = (numbers.astype(np.uint64) + np.uint64(seed)) * np.uint64(_GOLDEN)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


def sort_hashes(key: NDArray[np.uint64]) -> tuple[Ints, Bools]:
    """Sort hashes (m,), which are overwritten: the place of each among them, and True where it differs from the last.

    Hash and place share 64 bits: whole numbers are sorted several times faster than places. What is equal is alike in
    the end; what is alike may differ, a few of millions.
    """
    bits = np.uint64(len(key).bit_length())
    place = (np.uint64(1) << bits) - np.uint64(1)
    for k in range(0, len(key), PIECE):
        piece = key[k : k + PIECE]
        piece[:] = piece & ~place | np.arange(k, k + len(piece), dtype=np.uint64)
    key.sort()
    new = np.ones(len(key), bool)
    for k in range(1, len(key), PIECE):
        new[k : k + PIECE] = (key[k : k + PIECE] ^ key[k - 1 : k - 1 + PIECE][: len(key) - k]) >> bits
    key &= place
    return key.view(np.int64), new


def label_rows(rows: Ints) -> tuple[Ints, int]:
    """Label rows so that equal rows get the same label; return (labels (k,), number of labels).

    Exact, and faster than sorting whole rows.

    >>> labels, count = label_rows(np.array([[2, 3], [7, 0], [2, 3]]))
    >>> bool(labels[0] == labels[2] != labels[1]), count
    (True, 2)
    """
    key = np.zeros(len(rows), np.uint64)
    # multiplicative hash: powers of an odd constant (Knuth, The Art of Computer Programming 3, 6.4)
    for column, weight in zip(rows.T, np.cumprod(np.full(rows.shape[1], _GOLDEN, np.uint64)), strict=True):
        key += column.astype(np.uint64) * weight
    order, new = sort_hashes(key)
    differs = _differ_from_last(rows[order])
    clash = differs & ~new
    if clash.any():  # different rows with one hash: these runs are sorted row by row
        run = np.cumsum(new)
        at = np.flatnonzero(np.isin(run, run[clash]))
        order[at] = order[at[np.lexsort((*rows[order[at]].T, run[at]))]]
        differs = _differ_from_last(rows[order])
    labels = np.empty(len(rows), np.int64)
    labels[order] = np.cumsum(differs) - 1
    return labels, int(np.count_nonzero(differs))


def _differ_from_last(rows: Ints) -> Bools:
    differs = np.ones(len(rows), bool)
    differs[1:] = False
    for column in rows.T:
        differs[1:] |= column[1:] != column[:-1]
    return differs


def first_of_each(labels: Ints, count: int) -> tuple[Ints, Ints]:
    """Return the first row of each label, ascending, and for each row its position among these."""
    first = np.full(count, len(labels))
    np.minimum.at(first, labels, np.arange(len(labels)))
    order = np.argsort(first)
    return first[order], places_of(order, count)[labels]


def label_faces(faces: Faces) -> tuple[Ints, int]:
    """Label faces so that those with the same corners get the same label; return (labels (f,), number of labels)."""
    return label_rows(np.sort(faces.corners, axis=1))


# ---- cells that own faces, and cells on them


def find_owners(faces: Faces, cells: Iterable[tuple[str, Ints, Ints]], n_nodes: int) -> FaceIncidence:
    """Find the cells that have one of `faces` as a facet. `cells`: parts (type, nodes (k, n), ids (k,)).

    >>> square = [("QUAD4", np.array([[0, 1, 2, 3]]), np.array([7]))]
    >>> owners = find_owners(Faces.join([("SEG2", np.array([[2, 1]]))]), square, 4)
    >>> owners.cell, owners.facet
    (array([7]), array([1]))
    """
    return _match(faces, cells, n_nodes, lambda cell: cell.facets)


def find_repeats(faces: Faces, cells: Iterable[tuple[str, Ints, Ints]], n_nodes: int) -> FaceIncidence:
    """Find the cells that lie on one of `faces`: same corners, any order (`facet` is 0). `cells`: as `find_owners`."""
    return _match(faces, cells, n_nodes, lambda cell: _WHOLE.get(cell.name, ()))


def _match(
    faces: Faces, cells: Iterable[tuple[str, Ints, Ints]], n_nodes: int, sides: Callable[[Cell], tuple[Facet, ...]]
) -> FaceIncidence:
    """Pair faces with the `sides` of cells that have the same corners, of the cells near the faces."""
    touched = np.zeros(n_nodes + 1, bool)  # one more, for the padding's -1
    touched[faces.corners] = True
    touched[-1] = False
    parts = []  # type, nodes, ids, number of the side
    for kind, nodes, ids in cells:
        if kind not in CELLS or not (of_cell := sides(CELLS[kind])):
            continue
        least = min(len(side.corners) for side in of_cell)
        near = concatenated(  # in pieces that stay in the cache
            start + np.flatnonzero(sum(touched[column].view(np.int8) for column in corners.T) >= least)
            for start in range(0, len(nodes), PIECE)
            for corners in [nodes[start : start + PIECE, : CELLS[kind].n_corners]]
        )
        close = nodes[near]
        for j, side in enumerate(of_cell):
            hit = np.flatnonzero(touched[close[:, side.corners]].all(axis=1))
            parts.append((side.type, close[hit][:, side.nodes], ids[near[hit]], j))
    candidates = Faces.join((kind, nodes) for kind, nodes, _, _ in parts)
    ids = concatenated(i for _, _, i, _ in parts)
    facet = concatenated(np.full(len(i), j) for _, _, i, j in parts)
    labels, count = label_rows(np.sort(np.vstack([faces.corners, candidates.corners]), axis=1))
    face = places_of(labels[: len(faces)], count)[labels[len(faces) :]]
    hits = np.flatnonzero(face >= 0)
    hits = hits[np.lexsort((ids[hits], face[hits]))]
    same = candidates.type[hits] == faces.type[face[hits]]
    same &= (np.sort(candidates.nodes[hits], axis=1) == np.sort(faces.nodes[face[hits]], axis=1)).all(axis=1)
    return FaceIncidence(face[hits], ids[hits], facet[hits], same)


# ---- cells of a mesh as faces


def cells_of_dim(mesh: Mesh, dim: int) -> Iterator[tuple[str, Ints, Ints]]:
    """Iterate over the cells of dimension `dim`, block by block: (type, their nodes, their indices)."""
    for k, block in enumerate(mesh.blocks):
        if ALL_CELLS[block.type].dim == dim:
            yield block.type, block.nodes, np.arange(mesh.offsets[k], mesh.offsets[k + 1])


def lacking(mesh: Mesh, dim: int, called: str = "the mesh") -> str:
    """Say that a mesh, `called` so, has no cells of dimension `dim`, what it has, and what gmsh leaves out of a file.

    >>> lacking(Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])]), 2)[:44]
    'the mesh has no surfaces, only cells of type'
    """
    name = ("points", "lines", "surfaces", "volumes")[dim]
    if not mesh.n_cells:
        return f"{called} has no {name}, nor any other cells"
    message = f"{called} has no {name}, only cells of type {', '.join(mesh.cells_by_type)}; where there are physical "
    message += f"groups, gmsh saves their cells alone: add one of the {name}, or save as msh 4.1 with "
    return f"{message}Mesh.SaveAll = 1 (msh 2.2 loses all groups then)"


def faces_of(mesh: Mesh, cells: Ints) -> Faces:
    """Return some skin cells (of types in FACE_TYPES) as faces, in the order of `cells`."""
    parts = list(mesh.select(cells))
    order = concatenated(chosen for _, chosen, _ in parts)
    return Faces.join((kind, nodes) for kind, _, nodes in parts).take(places_of(order, mesh.n_cells, np.int32)[cells])


def distinct_faces(mesh: Mesh, cells: Ints) -> tuple[Faces, Ints]:
    """Return the faces under some cells, each once, and the index in `cells` of the cell that gives its node order."""
    faces = faces_of(mesh, cells)
    first, _ = first_of_each(*label_faces(faces))
    return faces.take(first), first


def facets_of(mesh: Mesh, owners: FaceIncidence) -> Faces:
    """Return the facets of a match's cells, with the cells' (outward) listing of their nodes, in the match's order."""
    parts, rows = [], []
    order = np.argsort(owners.cell, kind="stable")
    done = 0
    for kind, cells, nodes in mesh.select(owners.cell[order]):
        facet = owners.facet[order[done : done + len(cells)]]
        for j in codes(facet):
            at = np.flatnonzero(facet == j)
            parts.append((CELLS[kind].facets[j].type, nodes[at][:, CELLS[kind].facets[j].nodes]))
            rows.append(order[done + at])
        done += len(cells)
    return Faces.join(parts).take(places_of(concatenated(rows), len(order)))


# ---- edges of faces


class EdgeUses(NamedTuple):
    """One row for each edge of each face, or each end of each segment: `face` (m,), `place` (m,), `edge` (m,) labels.

    `place` k: the edge from corner k to the next, or the end k. `start`, `stop` (m,): its nodes, as the face lists
    them; -1 for the `stop` of a segment's end. `forward` (m,): direction in which the face runs along the edge; two
    faces have consistent windings if they run along their common edge in opposite directions.
    """

    face: Ints
    place: Ints
    edge: Ints
    start: Ints
    stop: Ints
    forward: Bools

    @property
    def pairs(self) -> tuple[Ints, Ints]:
        """(p,), (p,): the rows of the two faces at each edge that has exactly two."""
        order = np.argsort(self.edge, kind="stable")
        first, second = order[np.bincount(self.edge)[self.edge[order]] == 2].reshape(-1, 2).T
        return first, second


def edge_uses(faces: Faces) -> EdgeUses:
    """Label the edges of faces, and return the faces at each of them."""
    n = N_CORNERS[faces.type]
    place, face = np.nonzero(np.arange(MAX_CORNERS)[:, None] < n)
    start = faces.nodes[face, place]
    segment = n[face] == 2
    stop = np.where(segment, -1, faces.nodes[face, (place + 1) % n[face]])
    forward = np.where(segment, place == 0, start < stop)
    ends = np.column_stack([np.minimum(start, stop) + 1, np.maximum(start, stop) + 1])
    return EdgeUses(face, place, label_rows(ends)[0], start, stop, forward)


def boundary_edges(faces: Faces) -> Ints:
    """(e, 3): the nodes of the edges that one face has alone: start, stop, mid-node; -1 for what there is not."""
    uses = edge_uses(faces)
    alone = np.flatnonzero(np.bincount(uses.edge)[uses.edge] == 1)
    middle = mid_nodes(faces, uses.face[alone], uses.place[alone])
    return np.column_stack([uses.start[alone], uses.stop[alone], middle])


def mid_nodes(faces: Faces, face: Ints, place: Ints) -> Ints:
    """(k,): the nodes in the middle of edges, each a place on a face; -1 on linear faces, and in the plane."""
    n = N_CORNERS[faces.type[face]]
    linear = (n == 2) | (N_NODES[faces.type[face]] == n)
    return np.where(linear, -1, faces.nodes[face, np.where(linear, 0, n + place)])


def neighbours(faces: Faces) -> Ints:
    """(f, 4): the neighbour across the edge from corner k to the next (at corner k, for segments), or -1.

    At an edge of more than two faces it is one of the others.

    >>> neighbours(Faces.join([("TRIA3", np.array([[0, 1, 2], [2, 1, 3]]))])).tolist()
    [[-1, 1, -1, -1], [0, -1, -1, -1]]
    """
    uses = edge_uses(faces)
    order = np.lexsort((uses.place, uses.face, uses.edge))
    alike = uses.edge[order[:-1]] == uses.edge[order[1:]]
    one, following = order[:-1][alike], order[1:][alike]
    out = np.full((len(faces), MAX_CORNERS), -1)
    out[uses.face[following], uses.place[following]] = uses.face[one]
    out[uses.face[one], uses.place[one]] = uses.face[following]
    return out


def distinct_edges(corners: Ints) -> tuple[Ints, Ints]:
    """Return the edges (e, 2) of faces with corners (f, n), padded with -1, each once, and how many faces have each.

    A segment, of two corners, is an edge itself.
    """
    n = (corners >= 0).sum(axis=1)
    place, face = np.nonzero(np.arange(corners.shape[1])[:, None] < np.where(n > 2, n, n > 0))
    ends = np.stack([corners[face, place], corners[face, (place + 1) % n[face]]])
    size = np.int64(corners.max(initial=0)) + 1
    key, count = np.unique(ends.min(axis=0) * size + ends.max(axis=0), return_counts=True)
    return np.column_stack(np.divmod(key, size)), count
