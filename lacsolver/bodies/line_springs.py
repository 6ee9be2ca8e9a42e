"""Springs along the lines between pairs of nodes, which turn with their nodes in finite kinematics.

A spring of undeformed length L and length l has the energy k (l - L)^2 / 2. With the unit vector n from its first node
to its second one, the force on the second node is k (l - L) n as an internal force, on the first the opposite, and

    K = k n n^T + k (l - L) / l (I - n n^T)

is the derivative of the former by the displacement of the second node. In axisymmetry k is that of the full circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse_blocks

#: length of a spring, relative to the undeformed one, below which its line has no direction
_SHORTEST = 1e-9


@dataclass(frozen=True, eq=False)
class LineSprings:
    """Springs between the nodes `ends` (m, 2), of which no two are at one place; `k` (m,): force per length."""

    space: Space
    ends: Ints
    k: Floats

    def internal_force(self, u: Floats) -> NDArray[np.floating]:
        """Return the forces (n_dof,) at a displacement u (n_dof,). Raises InadmissibleError where two ends meet."""
        n, _, longer = self._lines(u)
        f, end = np.zeros((self.space.mesh.n_nodes, self.space.dim)), (self.k * longer)[:, None] * n
        np.add.at(f, self.ends[:, 0], -end)
        np.add.at(f, self.ends[:, 1], end)
        return f.ravel()

    def tangent(self, u: Floats) -> csr_array:
        """Return the symmetric df/du (n_dof, n_dof). Raises InadmissibleError where two ends meet."""
        n, length, longer = self._lines(u)
        along = np.einsum("ms,mt->mst", n, n)
        k = self.k[:, None, None]
        blocks = k * along + k * (longer / length)[:, None, None] * (np.eye(self.space.dim) - along)
        return between_nodes(self.space, self.ends, blocks)

    def energy(self, u: Floats) -> float:
        """Return the stored energy. Raises InadmissibleError where two ends meet."""
        _, _, longer = self._lines(u)
        return 0.5 * float(self.k @ longer**2)

    def _lines(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Return unit vectors (m, dim) from first to second nodes, lengths (m,), and how much longer they are (m,)."""
        dim = self.space.dim
        d = np.subtract(*self.space.local.points[self.ends[:, ::-1], :dim].swapaxes(0, 1))
        du = np.subtract(*u.reshape(-1, dim)[self.ends[:, ::-1]].swapaxes(0, 1))
        first, length = np.linalg.norm(d, axis=1), np.linalg.norm(d + du, axis=1)
        if (meet := ~(length > _SHORTEST * first)).any():
            nodes = some(self.space.mesh.node_number[self.ends[meet].ravel()])
            raise InadmissibleError(f"the ends of a spring, nodes {nodes}, meet, where its line has no direction")
        # l^2 - L^2 = (2 d + du) . du, without the cancellation of l - L
        longer = np.einsum("ms,ms->m", 2 * d + du, du) / (length + first)
        return (d + du) / length[:, None], length, longer


def between_nodes(space: Space, ends: Ints, blocks: Floats) -> csr_array:
    """Return the stiffness (n_dof, n_dof) of springs between nodes `ends` (m, 2).

    `blocks` (m, dim, dim): force on the second node for a unit displacement of it.
    """
    dofs = space.dofs(ends.ravel()).reshape(len(ends), -1)
    K = np.block([[[blocks, -blocks], [-blocks, blocks]]]).reshape(len(ends), 2 * space.dim, 2 * space.dim)
    matrix = sparse_blocks(space.n_dof, [(dofs, K)])
    matrix.eliminate_zeros()
    return matrix
