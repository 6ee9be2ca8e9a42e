"""Quadrature over faces, edges and cells of a mesh, undeformed or displaced: points, weights and shape functions.

Integrals are those of the whole thickness or circle: the weight of a point includes thickness or 2 pi r, here and in
`bodies.points`. They are exact for a constant where the integrand is a polynomial: that of a pressure is, as its normal
is not normalised; that of a traction on a curved face is not, and converges with the degree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, jacobian, shape
from lacmesh.surface.normals import normals_of
from lacsolver.space.determinant import determinant
from lacsolver.space.space import Cells, Space

#: by dimension and order of the cell: degree of the rule, in each coordinate, of TRIA and TETRA the total degree.
#: N times the measure of the cell, with r in axisymmetry, needs at most 3 in cells of order 1; of order 2 it needs 10
#: in TRIA7 (N 3, det J 4, r 3), 7 in QUAD9 and HEXA27. The rest is for values that vary with the place.
_DEGREE = {(1, 1): 5, (2, 1): 5, (3, 1): 5, (1, 2): 10, (2, 2): 10, (3, 2): 7}
#: numbers of one array of a piece of cells, which are evaluated together
_PIECE = 1 << 18


@dataclass(frozen=True, eq=False)
class Points:
    """Quadrature points of some cells of one type, with nodes at `places` (n_nodes, 3), relative to the origin.

    `X` (q, k), `weights` (q,): the rule on the reference element, whose points have the shape functions `N` (q, n).
    """

    space: Space
    cells: Cells
    places: Floats
    X: Floats
    weights: Floats
    N: Floats

    @property
    def nodes(self) -> Ints:
        """Nodes (c, n) of the cells."""
        return self.cells.nodes

    @cached_property
    def x(self) -> NDArray[np.floating]:
        """Coordinates (c, q, 3) of the undeformed points in the mesh."""
        return np.einsum("qn,cns->cqs", self.N, self.space.mesh.points[self.nodes], optimize=True)

    @cached_property
    def now(self) -> NDArray[np.floating]:
        """Coordinates (c, q, 3) of the points where they are, relative to the origin."""
        return np.einsum("qn,cns->cqs", self.N, self.places[self.nodes], optimize=True)

    @cached_property
    def w(self) -> NDArray[np.floating]:
        """Weights (c, q) on the reference element, times thickness or 2 pi r."""
        return self.weights * self.space.depth(self.now, self.cells.cell)

    @cached_property
    def gradient(self) -> NDArray[np.floating]:
        """Derivatives (q, n, k) of the shape functions by the reference coordinates."""
        return gradient(self.cells.type, self.X)

    @cached_property
    def J(self) -> NDArray[np.floating]:
        """Tangents (c, q, 3, k) of the cells."""
        return jacobian(self.cells.type, self.places[self.nodes], self.X[:, : CELLS[self.cells.type].dim])

    @cached_property
    def normal(self) -> NDArray[np.floating]:
        """Normals (c, q, 3) of faces, times their size."""
        return normals_of(self.J)

    @cached_property
    def size(self) -> NDArray[np.floating]:
        """Length, area or volume (c, q) of the cells, relative to that of the reference element."""
        dim = CELLS[self.cells.type].dim
        if dim == 3:
            return np.abs(determinant(self.nodes, self.places, self.gradient))
        return np.linalg.norm(self.normal if dim == 2 else self.J[..., 0], axis=-1)


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Quadrature over cells of one dimension, type by type, of a space."""

    space: Space
    blocks: tuple[Cells, ...]

    @classmethod
    def on_cells(cls, space: Space, cells: Ints) -> Quadrature:
        """Return that over cells (indices); of faces and edges with the same nodes the first one counts."""
        blocks = []
        for name, chosen, nodes in space.mesh.select(cells):
            if CELLS[name].dim < space.dim:
                first = np.sort(np.unique(np.sort(nodes, axis=1), axis=0, return_index=True)[1])
                chosen, nodes = chosen[first], nodes[first]
            blocks.append(Cells(name, nodes, chosen))
        return cls(space, tuple(blocks))

    def points(self, u: Floats | None = None) -> Iterator[Points]:
        """Yield the points, piece by piece, at the displacement u (n_dof,) of the nodes; None: undeformed."""
        places = self.space.local.points if u is None else self.space.places(u)
        for name, nodes, cell in self.blocks:
            X, weights = rule(CELLS[name].family, _DEGREE[CELLS[name].dim, CELLS[name].order])
            N = shape(name, X)
            size = max(1, _PIECE // N.size)
            for first in range(0, len(cell), size):
                piece = slice(first, first + size)
                yield Points(self.space, Cells(name, nodes[piece], cell[piece]), places, X, weights, N)

    def forces(self, density: Callable[[Points], Floats], u: Floats | None = None) -> NDArray[np.floating]:
        """Return the nodal forces (n_dof,) of `density`, (c, q, dim) per measure of the reference element."""
        out = np.zeros((self.space.mesh.n_nodes, self.space.dim))
        for at in self.points(u):
            np.add.at(out, at.nodes, np.einsum("qn,cq,cqs->cns", at.N, at.w, density(at), optimize=True))
        return out.ravel()

    def measures(self) -> NDArray[np.floating]:
        """Return int N_a (n_nodes,), the part of each node in the measure of the cells."""
        out = np.zeros(self.space.mesh.n_nodes)
        for at in self.points():
            np.add.at(out, at.nodes, (at.w * at.size) @ at.N)
        return out


def nodal_measures(space: Space, cells: Ints) -> NDArray[np.floating]:
    """Return int N_a (n_nodes,) over cells (indices), those of the highest dimension among them, each cell once.

    With thickness or 2 pi r. Points count 1 each. A uniform load has these parts at the nodes.
    """
    dims = space.mesh.cell_dim[cells]
    dim = int(space.share.largest(float(dims.max(initial=0))))
    if dim:
        return Quadrature.on_cells(space, cells[dims == dim]).measures()
    out = np.zeros(space.mesh.n_nodes)
    out[space.mesh.nodes_on(cells)] = 1.0
    return out
