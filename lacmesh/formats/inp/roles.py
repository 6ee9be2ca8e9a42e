"""Roles of cells in an .inp file: elements, and skin, which says a face of the cell behind it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.formats.inp.types import FACETS
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.orientation import relative_listing
from lacmesh.topology.skin import TYPE_CODE, Faces, find_owners, first_of_each, label_faces


@dataclass(frozen=True)
class Roles:
    """Role of each cell in the file: an element; for skin, the face `facet` of the cell `parent` (-1 for none)."""

    element: NDArray[np.bool_]
    parent: Ints
    facet: Ints

    @property
    def skin(self) -> NDArray[np.bool_]:
        """(n_cells,): True for skin cells, which lie on a face of another cell."""
        return self.parent >= 0


def roles_of(mesh: Mesh, all_cells: bool) -> Roles:
    """Find the skin cells and the cell behind each; of two, the one whose facet has the same orientation."""
    parent, facet = np.full(mesh.n_cells, -1), np.full(mesh.n_cells, -1)
    below = np.flatnonzero(mesh.cell_dim == mesh.dim - 1) if mesh.dim > 1 else np.empty(0, np.int64)
    solid = [
        (b.type, b.nodes, np.arange(lo, hi))
        for b, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True)
        if b.type in CELLS and CELLS[b.type].dim == mesh.dim and CELLS[b.type].family in FACETS
    ]
    for cell_type, chosen, nodes in mesh.select(below):
        if cell_type in TYPE_CODE:
            faces = Faces.join([(cell_type, nodes)])
            face, cell, side = _behind(faces, solid, mesh.n_nodes)
            turned = relative_listing(faces.take(face), _facets(mesh, cell, side)) % 2
            best = np.lexsort((turned, face))
            best = best[np.append(True, np.diff(face[best]) != 0)[: len(best)]]
            parent[chosen[face[best]]] = cell[best]
            facet[chosen[face[best]]] = side[best]
    element = (mesh.cell_dim == mesh.dim) | ((mesh.cell_dim == mesh.dim - 1) & (parent < 0))
    return Roles(element | all_cells, parent, facet)


def _behind(faces: Faces, solid: list[tuple[str, Ints, Ints]], n_nodes: int) -> tuple[Ints, Ints, Ints]:
    """Pairs of a face and a cell behind it: face, cell, facet of the cell; faces may lie on each other."""
    first, which = first_of_each(*label_faces(faces))
    owners = find_owners(faces.take(first), solid, n_nodes)
    count = np.bincount(owners.face, minlength=len(first))
    begin = (np.cumsum(count) - count)[which]
    of = count[which]
    rows = np.repeat(begin - (np.cumsum(of) - of), of) + np.arange(of.sum())
    return np.repeat(np.arange(len(faces)), of), owners.cell[rows], owners.facet[rows]


def _facets(mesh: Mesh, cells: Ints, facets: Ints) -> Faces:
    """Facets of cells, as faces, in the order of `cells`."""
    parts, order = [], [np.empty(0, np.int64)]
    block = np.searchsorted(mesh.offsets, cells, side="right") - 1
    for b in np.unique(block).tolist():
        for j, facet in enumerate(CELLS[mesh.blocks[b].type].facets):
            rows = np.flatnonzero((block == b) & (facets == j))
            parts.append((facet.type, mesh.blocks[b].nodes[cells[rows] - mesh.offsets[b]][:, facet.nodes]))
            order.append(rows)
    return Faces.join(parts).take(np.argsort(np.concatenate(order)))
