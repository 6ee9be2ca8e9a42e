"""Incidence of faces and cells: the cells that own a face, the cells that duplicate it.

A face is identified by its corners, in any order. Only cells that touch the requested faces are examined, so that the
cost is one pass over the mesh's nodes and then grows with the faces (no table of all facets is ever built).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Ints, concatenated, places_of

#: width of a padded list of a face's nodes (QUAD9) and corners
MAX_NODES, MAX_CORNERS = 9, 4
_PIECE = 1 << 15
#: 2^64 over the golden ratio, odd
_GOLDEN = 0x9E3779B97F4A7C15
#: face types, in the order of the codes that `Faces.type` uses
FACE_TYPES = ("POI1", "SEG2", "SEG3", "TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9")
TYPE_CODE = {name: code for code, name in enumerate(FACE_TYPES)}
N_CORNERS = np.array([CELLS[name].n_corners for name in FACE_TYPES])
N_NODES = np.array([CELLS[name].n_nodes for name in FACE_TYPES])


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
        corners = self.nodes[:, :MAX_CORNERS].copy()
        corners[np.arange(MAX_CORNERS) >= N_CORNERS[self.type][:, None]] = -1
        return corners

    @classmethod
    def stack(cls, parts: Sequence[Faces]) -> Faces:
        """Lists of faces, one after the other."""
        return cls(np.concatenate([p.type for p in parts]), np.vstack([p.nodes for p in parts]))

    @classmethod
    def join(cls, parts: Iterable[tuple[str, Ints]]) -> Faces:
        """Join parts (type, nodes (k, n)) into one list of faces, in their order."""
        parts = list(parts)
        codes = np.repeat([TYPE_CODE[t] for t, _ in parts] or [0], [len(n) for _, n in parts] or [0])
        nodes = np.full((len(codes), MAX_NODES), -1, np.int64)
        start = 0
        for _, rows in parts:
            nodes[start : start + len(rows), : rows.shape[1]] = rows
            start += len(rows)
        return cls(codes, nodes)


@dataclass(frozen=True)
class FaceIncidence:
    """Incident pairs, one per row: `face`, `cell` (the caller's id), and `facet`, the number of the face in the cell.

    Rows are sorted by face, then by cell. `same`: the facet has all nodes of the face, mid-nodes included.
    """

    face: Ints
    cell: Ints
    facet: Ints
    same: NDArray[np.bool_]

    def by_cell(self) -> FaceIncidence:
        """All pairs, sorted by cell."""
        order = np.argsort(self.cell, kind="stable")
        return FaceIncidence(self.face[order], self.cell[order], self.facet[order], self.same[order])


def label_rows(rows: Ints) -> tuple[Ints, int]:
    """Label rows so that equal rows get the same label; return (labels (k,), number of labels).

    Exact, and faster than sorting whole rows.
    """
    seed = 0
    while True:
        seed += 1
        # multiplicative hash: powers of an odd constant (Knuth, The Art of Computer Programming 3, 6.4)
        weights = np.array([pow(_GOLDEN, seed + k, 2**64) for k in range(rows.shape[1])], np.uint64)
        key = (rows.astype(np.uint64) * weights).sum(axis=1, dtype=np.uint64)
        order = np.argsort(key, kind="stable")
        new = np.diff(key[order], prepend=key[order[:1]] + np.uint64(1)) != 0
        repeats = np.flatnonzero(~new)
        if (rows[order[repeats]] == rows[order[repeats - 1]]).all():  # else two different rows met: draw again
            break
    labels = np.empty(len(rows), np.int64)
    labels[order] = np.cumsum(new) - 1
    return labels, int(new.sum())


def first_of_each(labels: Ints, count: int) -> tuple[Ints, Ints]:
    """Return the first row of each label, ascending, and for each row its position among these."""
    first = np.full(count, len(labels))
    np.minimum.at(first, labels, np.arange(len(labels)))
    order = np.argsort(first)
    rank = places_of(order, count)
    return first[order], rank[labels]


def label_faces(faces: Faces) -> tuple[Ints, int]:
    """Label faces so that those with the same corners get the same label; return (labels (f,), number of labels)."""
    return label_rows(np.sort(faces.corners, axis=1))


def find_owners(faces: Faces, cells: Iterable[tuple[str, Ints, Ints]], n_nodes: int) -> FaceIncidence:
    """Find the cells that have one of `faces` as a facet. `cells`: parts (type, nodes (k, n), ids (k,)).

    >>> square = [("QUAD4", np.array([[0, 1, 2, 3]]), np.array([7]))]
    >>> found = find_owners(Faces.join([("SEG2", np.array([[2, 1]]))]), square, 4)
    >>> found.cell, found.facet
    (array([7]), array([1]))
    """
    touched = _touched(faces, n_nodes)
    parts = []
    for kind, nodes, ids in cells:
        cell = CELLS.get(kind)
        if cell is None or not cell.facets or not len(nodes):
            continue
        near = _near(touched, nodes, cell.n_corners, cell.dim)
        close = nodes[near]
        for j, facet in enumerate(cell.facets):
            corners = facet.nodes[: CELLS[facet.type].n_corners]
            hit = np.flatnonzero(touched[close[:, corners]].all(axis=1))
            parts.append((facet.type, close[hit][:, facet.nodes], ids[near[hit]], j))
    return _match(faces, parts)


def find_repeats(faces: Faces, cells: Iterable[tuple[str, Ints, Ints]], n_nodes: int) -> FaceIncidence:
    """Find the cells that lie on one of `faces`: same corners, any order (`facet` is 0). `cells`: as `find_owners`."""
    touched = _touched(faces, n_nodes)
    parts = []
    for kind, nodes, ids in cells:
        if kind in TYPE_CODE and len(nodes):
            hit = np.flatnonzero(touched[nodes[:, : CELLS[kind].n_corners]].all(axis=1))
            parts.append((kind, nodes[hit], ids[hit], 0))
    return _match(faces, parts)


def _touched(faces: Faces, n_nodes: int) -> NDArray[np.bool_]:
    touched = np.zeros(n_nodes + 1, bool)  # one more, for the padding's -1
    touched[faces.corners] = True
    touched[-1] = False
    return touched


def _near(touched: NDArray[np.bool_], nodes: Ints, n_corners: int, least: int) -> Ints:
    """Rows of `nodes` with at least `least` touched corners, found in chunks that stay in the cache."""
    rows = [np.empty(0, np.int64)]
    for start in range(0, len(nodes), _PIECE):
        piece = nodes[start : start + _PIECE]
        count = np.zeros(len(piece), np.uint8)
        for corner in range(n_corners):
            count += touched[piece[:, corner]]
        rows.append(start + np.flatnonzero(count >= least))
    return np.concatenate(rows)


def _match(faces: Faces, parts: list[tuple[str, Ints, Ints, int]]) -> FaceIncidence:
    """Pair faces with candidates (type, nodes, ids, facet number) that have the same corners."""
    candidates = Faces.join((kind, nodes) for kind, nodes, _, _ in parts)
    ids = concatenated(i for _, _, i, _ in parts)
    facet = np.repeat([j for *_, j in parts] or [0], [len(i) for _, _, i, _ in parts] or [0])
    labels, count = label_faces(Faces.stack([faces, candidates]))
    face_of = places_of(labels[: len(faces)], count)
    face = face_of[labels[len(faces) :]]
    hits = np.flatnonzero(face >= 0)
    hits = hits[np.lexsort((ids[hits], face[hits]))]
    same = candidates.type[hits] == faces.type[face[hits]]
    same &= (np.sort(candidates.nodes[hits], axis=1) == np.sort(faces.nodes[face[hits]], axis=1)).all(axis=1)
    return FaceIncidence(face[hits], ids[hits], facet[hits], same)
