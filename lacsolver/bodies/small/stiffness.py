"""The stiffness K_ab,st = int A_sitj L_ia L_jb dV, summed directly into its block-CSR pattern.

A cell's L and L W are stacked over its points; one product M = (L W)^T L gives all int L_ia L_jb, and since A is
constant in a cell, K is the sum of the few terms A_sitj M_ij that are not zero (`Materials.terms`): 21 of 81 for an
isotropic solid. This takes less than half the time of the general sum of `assembly`, into whose rows it goes.

In a cell with mean dilatation (`bodies.locking`) the strain is P B u + m g.u / 3, with P the deviator, m = (1, 1, 1, 0,
...), and g (d, n) the mean over the cell of the divergence of the shape functions. Then A is that of P C P, and

    K_ab,st += V (r_sa g_tb + g_sa r_tb + bulk g_sa g_tb),    V r = int B^T P C m / 3 dV,    bulk = m^T C m / 9

with r = 0 for an isotropic law.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from lacmesh.kernels import kernel
from lacsolver.bodies.assembly import OwnedRows, add_mean, add_row, assemble, block_values, matrix, sort_places
from lacsolver.bodies.locking import may_take_the_mean
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import Span, at_points, kind, table
from lacsolver.space.space import Space


def assemble_stiffness(space: Space, materials: Materials, threads: int = 1) -> bsr_array:
    """Return K (n_dof, n_dof), symmetric, in dim x dim blocks, with the pattern `space.pattern` (shared, not copied).

    The result is the same to round-off for any number of threads. `K.tocsr()` and `K.tocsc()` convert it for a
    solver. Raises RequestError for a law of finite strains.

    >>> from lacmesh import Mesh
    >>> from lacsolver.bodies.material import Elastic
    >>> bar = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> space = Space.of(bar, "plane_stress")
    >>> K = assemble_stiffness(space, Materials.of(space, Elastic(young=1.0, poisson=0.0)))
    >>> K.shape, K.blocksize, float(round(K.diagonal()[0], 12))
    ((8, 8), (2, 2), 0.5)
    """
    return matrix(space, stiffness_values(space, materials, threads))


def stiffness_values(
    space: Space, materials: Materials, threads: int = 1, *, out: NDArray[np.floating] | None = None
) -> NDArray[np.floating]:
    """Return the blocks of K in the order of `space.pattern`, (n_blocks, dim, dim), in `out` if it is given."""
    materials.check_small()
    K = block_values(space, out)

    def add(span: Span, rows: OwnedRows) -> None:
        block, law, cells = span
        name, nodes, _ = space.blocks[block]
        terms = materials.mean_terms if may_take_the_mean(space, block) else materials.terms
        N = table(name, space.model.axisymmetric)
        add_cells_of_one_law(cells, nodes, space.local.points, N, kind(space), terms, law, rows)

    assemble(space, materials.law, add, np.empty((0, 0)), K, threads)
    return K


@kernel(costly=10)  # compiles as long as a million numbers take, and is called once
def add_cells_of_one_law(
    cells: Any, nodes: Any, x: Any, table: Any, kind: Any, terms: Any, law: int, rows: Any
) -> None:
    """Add the stiffness of some cells of a block of nodes (k, n) at x to the rows; `terms` of all laws."""
    n, n_points, dim = nodes.shape[1], len(table.w), kind.dim
    m = kind.rows * n
    L, W = np.empty((n_points, kind.rows, n)), np.empty(n_points)
    WH, M, K = np.empty((n_points, m)), np.empty((m, m)), np.empty((dim * (dim + 1) // 2, n * n))
    g, r, order = np.empty((dim, n)), np.empty((dim, n)), np.empty(n, np.int64)
    owner, mine, pattern, _, out = rows
    for e in cells:
        at_points(nodes, e, x, table, kind, L, W)
        product(L.reshape(n_points, m), W, WH, M)
        if dim == 3 and terms.lame[law, 1] > 0:
            _isotropic(M, n, terms.lame[law, 0], terms.lame[law, 1], K)
        else:
            _combine(M, n, kind.rows, terms, law, K)
        if terms.bulk[law] > 0:
            V = _mean(L, W, terms.coupling[law], g, r)
            add_mean(r, g, terms.bulk[law] * V, K)
        sort_places(nodes, e, order)
        for a in range(n):
            if owner[nodes[e, a]] == mine:
                add_row(nodes, e, order, a, K, pattern, out, dim)


@kernel
def product(H: Any, W: Any, WH: Any, M: Any) -> None:
    """Fill M = H^T W H. A single point is summed without BLAS, whose call would cost more."""
    m = H.shape[1]
    for q in range(len(W)):
        for r in range(m):
            WH[q, r] = W[q] * H[q, r]
    if len(W) > 1:
        np.dot(WH.T, H, M)
        return
    for r in range(m):
        for c in range(m):
            M[r, c] = WH[0, r] * H[0, c]


@kernel
def _combine(M: Any, n: int, n_rows: int, terms: Any, law: int, K: Any) -> None:
    """Fill K (pairs, n^2) with the sums of A_sitj M_ij, for s <= t."""
    K[:] = 0.0
    for k in range(terms.start[law], terms.start[law + 1]):
        pair, i, j = terms.at[k, 0], terms.at[k, 1] // n_rows * n, terms.at[k, 1] % n_rows * n
        v = terms.value[k]
        for a in range(n):
            for b in range(n):
                K[pair, a * n + b] += v * M[i + a, j + b]


@kernel
def _isotropic(M: Any, n: int, lam: float, mu: float, K: Any) -> None:
    """Fill K (6, n^2) of an isotropic solid, A_sitj = lam d_si d_tj + mu (d_st d_ij + d_sj d_it), in one pass."""
    y, z = n, 2 * n
    for a in range(n):
        for b in range(n):
            ab = a * n + b
            trace = mu * (M[a, b] + M[y + a, y + b] + M[z + a, z + b])
            K[0, ab] = (lam + mu) * M[a, b] + trace
            K[1, ab] = lam * M[a, y + b] + mu * M[y + a, b]
            K[2, ab] = lam * M[a, z + b] + mu * M[z + a, b]
            K[3, ab] = (lam + mu) * M[y + a, y + b] + trace
            K[4, ab] = lam * M[y + a, z + b] + mu * M[z + a, y + b]
            K[5, ab] = (lam + mu) * M[z + a, z + b] + trace


@kernel
def _mean(L: Any, W: Any, coupling: Any, g: Any, r: Any) -> float:
    """Fill g (dim, n), and r (dim, n) with V r of the module's page; return the volume V."""
    n_rows, dim, n = L.shape[1], g.shape[0], g.shape[1]
    g[:] = 0.0
    r[:] = 0.0
    V = 0.0
    for q in range(len(W)):
        V += W[q]
        for a in range(n):
            for s in range(dim):
                g[s, a] += W[q] * L[q, s, a]
                for i in range(n_rows):
                    r[s, a] += W[q] * coupling[i, s] * L[q, i, a]
            if n_rows > dim:
                g[0, a] += W[q] * L[q, 2, a]
    for s in range(dim):
        for a in range(n):
            g[s, a] /= V
    return V
