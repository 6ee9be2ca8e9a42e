"""Division of a mesh along interior faces: the sides of the faces, and the sides that meet at each of their nodes.

Around a node, cells that share a facet are on one side, unless the mesh is divided along this facet. A node in the
middle of the faces has two sides; one where several sheets of faces meet has more; one on the front, where the faces
end inside the body, has one and stays closed. Cells that met at a node without a common facet still meet there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CARRIED
from lacmesh.errors import DataError
from lacmesh.mesh import Ints, Mesh, mask_of, positions
from lacmesh.topology.bodies import label_components
from lacmesh.topology.facets import ALONE, FACETS, Solid, pair_facets
from lacmesh.topology.orientation import (
    ONE_SIDED,
    OPEN,
    consistent_windings,
    face_normals,
    is_inverted,
    relative_listing,
)
from lacmesh.topology.skin import FaceIncidence, Faces, facets_of

Bools = NDArray[np.bool_]
#: means of normals, relative to the faces' area, below which a component counts as zero
_FLAT = 1e-9


class FaceSides(NamedTuple):
    """The two cells of each of some faces, (f,) each, and the number of the face among the facets of each."""

    cell: tuple[Ints, Ints]
    facet: tuple[Ints, Ints]

    @classmethod
    def of(cls, owners: FaceIncidence) -> FaceSides:
        """Return the sides of faces that have two owners each, sorted by face."""
        return cls((owners.cell[::2], owners.cell[1::2]), (owners.facet[::2], owners.facet[1::2]))

    def take(self, rows: Ints) -> FaceSides:
        """FaceSides of some of the faces."""
        one, other = ((cell[rows], facet[rows]) for cell, facet in zip(*self, strict=True))
        return FaceSides((one[0], other[0]), (one[1], other[1]))

    def exchanged(self, where: Bools) -> FaceSides:
        """Exchange the sides of some faces (f,)."""
        pairs = ((np.where(where, other, one), np.where(where, one, other)) for one, other in (self.cell, self.facet))
        return FaceSides(*pairs)


def second_is_a(mesh: Mesh, faces: Faces, sides: FaceSides) -> Bools:
    """(f,): True for faces whose side a is their second cell: the normals of the faces point from side a to side b.

    Where faces of one sheet do not agree, most of them decide; a closed sheet has its side a inside. If as many faces
    point one way as the other, side b is where x grows along the mean normal, or else y, or z.
    Raises DataError for a sheet with one side only, and for faces that their two cells list alike.
    """
    flip, kind, sheet = consistent_windings(mesh, faces)
    if (kind == ONE_SIDED).any():
        raise DataError("has one side only, as a Moebius strip: its two sides cannot be told apart")
    flip ^= _undecided(mesh, faces, flip, kind, sheet)
    agrees = []
    for cell, facet in zip(*sides, strict=True):
        listed = facets_of(mesh, FaceIncidence(np.arange(len(faces)), cell, facet, np.ones(len(faces), bool)))
        agrees.append((relative_listing(faces, listed) % 2 == 0) ^ is_inverted(mesh, cell, mesh.space_dim == 2) ^ flip)
    alike = np.flatnonzero(agrees[0] == agrees[1])
    if len(alike):
        cells = np.concatenate([cell[alike] for cell in sides.cell])
        message = f"has faces on whose two sides the cells list their nodes alike (cells {mesh.cell_names(cells)}), so "
        raise DataError(f"{message}that they overlap or have no common orientation: see lacmesh check", cells)
    return agrees[1]


def _undecided(mesh: Mesh, faces: Faces, flip: Bools, kind: Ints, sheet: Ints) -> Bools:
    """(f,): True for the faces of open sheets half of which are flipped, and whose mean normal points to the back."""
    n = np.bincount(sheet)
    half = (2 * np.bincount(sheet, flip) == n) & (np.bincount(sheet, kind == OPEN) == n)
    normal = face_normals(mesh, faces) * np.where(flip, -1.0, 1.0)[:, None]
    size = np.bincount(sheet, np.linalg.norm(normal, axis=1))
    mean = np.stack([np.bincount(sheet, normal[:, k]) for k in range(3)], axis=1)
    mean[np.abs(mean) <= _FLAT * size[:, None]] = 0
    leading = np.take_along_axis(mean, (mean != 0).argmax(axis=1)[:, None], axis=1)[:, 0]
    return (half & (leading < 0))[sheet]


@dataclass(frozen=True)
class CellNodes:
    """Nodes of faces as nodes of the cells around them, one row each: `cell`, `column` in that, `node` (m,).

    `key` (m,), ascending, is made of cell and node. `new_node` (m,): index of the node in the divided mesh, where the
    copies come after the `n_nodes` old nodes; `copied` (k,): the node that each copy repeats, ascending.
    """

    cell: Ints
    column: Ints
    node: Ints
    key: Ints
    n_nodes: int
    new_node: Ints
    copied: Ints

    def rows(self, cell: Ints, node: Ints) -> Ints:
        """Row of each node of a cell, -1 where there is none; both of one shape."""
        return np.where(node >= 0, positions(self.key, cell.astype(np.int64) * self.n_nodes + node), -1)

    def in_divided_mesh(self, cell: Ints, node: Ints) -> Ints:
        """Index in the divided mesh of nodes of cells; both of one shape."""
        row = self.rows(cell, node)
        return np.where(row >= 0, self.new_node[row], node)


@dataclass(frozen=True)
class _Links:
    """Links between neighbours around nodes, `one` and `other` (n,) rows of `CellNodes`, over the facet `pair` (n,).

    `number` (p,): the lower of the two numbers of each pair of facets, ascending (`facets.py`).
    """

    one: Ints
    other: Ints
    pair: Ints
    number: Ints


def divide(mesh: Mesh, faces: Faces, sides: FaceSides) -> tuple[CellNodes, Bools]:
    """Divide a mesh along faces; return the nodes of the cells around them, and True for faces that open (f,).

    The first cells of `sides` keep the nodes, the others take copies. A face that would have the same corners on both
    sides, all of them on the front, is not opened, which moves the front. Raises DataError for cells of order 3 and
    higher at the faces.
    """
    touched = mask_of(mesh.n_nodes, faces.nodes[faces.nodes >= 0])
    solid = _near(mesh, touched)
    around = _around(mesh, solid.cells, touched)
    links = _links(mesh, solid, around, touched)
    pair = _pair_of_faces(solid, links, sides)
    whole = label_components(links.one, links.other, len(around.cell))
    first, second = (around.rows(np.broadcast_to(c[:, None], faces.nodes.shape), faces.nodes) for c in sides.cell)
    corner = faces.corners >= 0
    opened = np.ones(len(faces), bool)
    while True:
        linked = ~np.isin(links.pair, pair[opened])
        part = label_components(links.one[linked], links.other[linked], len(around.cell))
        keeps = np.unique(first[opened][first[opened] >= 0])
        around = _with_copies(around, whole, part, keeps)
        ids = (around.new_node[rows[:, : corner.shape[1]]] for rows in (first, second))
        closed = opened & ~(np.not_equal(*ids) & corner).any(axis=1)
        if not closed.any():
            return around, opened
        opened &= ~closed


def _near(mesh: Mesh, touched: Bools) -> Solid:
    """Return the cells of the mesh's dimension that have one of the nodes `touched` for a corner."""
    solid = Solid.of(mesh)
    near = solid.take(np.flatnonzero((touched[solid.corners] & (solid.corners >= 0)).any(axis=1)))
    for kind, cells, _ in mesh.select(np.sort(near.cells)):
        if kind in CARRIED:
            message = (
                f"has cells of type {kind} at it ({mesh.cell_names(cells)}): those of order 3 and higher are not split"
            )
            raise DataError(message, mesh.cell_number[cells])
    return near


def _around(mesh: Mesh, cells: Ints, touched: Bools) -> CellNodes:
    """Return the nodes `touched` of some cells; none is copied yet."""
    parts = []
    for _, chosen, nodes in mesh.select(np.sort(cells)):
        row, column = np.nonzero(touched[nodes])
        parts.append((chosen[row], column, nodes[row, column]))
    cell, column, node = (np.concatenate(p).astype(np.int64) for p in zip(*parts, strict=True))
    key = cell * mesh.n_nodes + node
    order = np.argsort(key)
    cell, column, node, key = (values[order] for values in (cell, column, node, key))
    return CellNodes(cell, column, node, key, mesh.n_nodes, node, np.empty(0, np.int64))


def _links(mesh: Mesh, solid: Solid, around: CellNodes, touched: Bools) -> _Links:
    """Link the cells around each node that share a facet with this node."""
    opposite, _ = pair_facets(solid)
    number = np.flatnonzero(opposite > np.maximum(np.arange(len(opposite)), ALONE))
    pairs = np.stack([number, opposite[number]])
    cell = solid.cells[pairs // FACETS].astype(np.int64)
    listed = FaceIncidence(np.arange(len(number)), cell[0], pairs[0] % FACETS, np.ones(len(number), bool))
    nodes = facets_of(mesh, listed).nodes
    pair, column = np.nonzero(touched[nodes] & (nodes >= 0))
    one, other = (around.rows(c[pair], nodes[pair, column]) for c in cell)
    shared = (one >= 0) & (other >= 0)  # mid-nodes that differ link nothing
    return _Links(one[shared], other[shared], pair[shared], number)


def _pair_of_faces(solid: Solid, links: _Links, sides: FaceSides) -> Ints:
    """(f,): the pair of facets that each face is."""
    order = np.argsort(solid.cells)
    numbers = [
        order[np.searchsorted(solid.cells[order], cell)] * FACETS + facet for cell, facet in zip(*sides, strict=True)
    ]
    return np.searchsorted(links.number, np.minimum(*numbers))


def _with_copies(around: CellNodes, whole: Ints, part: Ints, keeps: Ints) -> CellNodes:
    """Number the copies: the parts (m,) of what was one around a node, `whole` (m,), have a node each.

    The part with one of the rows `keeps` has the old node, or else the first.
    """
    first, label = np.unique(part, return_index=True, return_inverse=True)[1:]
    behind = np.ones(len(first), bool)
    behind[label[keeps]] = False
    order = np.lexsort((first, behind, whole[first]))
    copy = order[1:][whole[first[order[1:]]] == whole[first[order[:-1]]]]
    copy = copy[np.argsort(around.node[first[copy]], kind="stable")]
    node = around.node[first]
    node[copy] = around.n_nodes + np.arange(len(copy))
    return replace(around, new_node=node[label], copied=around.node[first[copy]])
