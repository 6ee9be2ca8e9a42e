"""The stiffness K_ab,st = int A_sitj L_ia L_jb dV, summed directly into its block-CSR pattern.

A cell's L and L W are stacked over its points; one product M = (L W)^T L gives all int L_ia L_jb, and since A is
constant in a cell, K is the sum of the few terms A_sitj M_ij that are not zero (`Materials.terms`): 21 of 81 for an
isotropic solid. Each thread owns some rows (nodes) of K, goes through the cells that touch them in their order, and
adds to its own rows only. So every entry is summed in one order whatever the number of threads, and the result is the
same to the last bit; the price is that cells between two threads' nodes are computed by both. K is symmetric to the
last bit.

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
from lacmesh.kernels.threads import side_by_side, worthwhile
from lacmesh.mesh import Ints
from lacsolver.bodies.locking import may_take_the_mean
from lacsolver.bodies.material import Materials
from lacsolver.bodies.small.gradients import at_points, kind, table
from lacsolver.space.space import Space


def assemble_stiffness(space: Space, materials: Materials, threads: int = 1) -> bsr_array:
    """Return K (n_dof, n_dof), symmetric, in dim x dim blocks, with the pattern `space.pattern` (shared, not copied).

    The result is the same to the last bit for any number of threads. `K.tocsr()` and `K.tocsc()` convert it for a
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


def matrix(space: Space, values: NDArray[np.floating]) -> bsr_array:
    """Return the matrix with block values (n_blocks, dim, dim) in the pattern of a space."""
    indptr, indices = space.pattern
    return bsr_array((values, indices, indptr), shape=(space.n_dof, space.n_dof), blocksize=(space.dim, space.dim))


def stiffness_values(
    space: Space, materials: Materials, threads: int = 1, *, out: NDArray[np.floating] | None = None
) -> NDArray[np.floating]:
    """Return the blocks of K in the order of `space.pattern`, (n_blocks, dim, dim), in `out` if it is given."""
    materials.check_small("lacsolver.bodies.finite.tangent")
    if threads < 1:
        raise ValueError(f"threads is 1 or more, not {threads}")
    shape = (len(space.pattern.indices), space.dim, space.dim)
    if out is None:
        out = np.zeros(shape)
    elif out.shape != shape:
        raise ValueError(f"out must be {shape}, not {out.shape}")
    else:
        out[:] = 0.0
    threads = worthwhile(threads, space.mesh.n_cells)
    owner = owners(space, threads)

    def run(mine: int) -> None:
        for number, (name, nodes, _) in enumerate(space.blocks):
            made = table(name, space.model.axisymmetric)
            rows = touching(owner, nodes, mine, threads)
            law, x = materials.law[number], space.local.points
            terms = materials.mean_terms if may_take_the_mean(space, number) else materials.terms
            _add(rows, nodes, x, made, kind(space), law, terms, owner, mine, space.pattern, out)

    side_by_side(run, threads)
    return out


def owners(space: Space, threads: int) -> Ints:
    """Return the thread that owns each node's row, (n_nodes,): boxes of about equal numbers of nodes.

    The boxes come from repeated division along the longest side.
    """
    owner = np.zeros(space.mesh.n_nodes, np.int16)
    parts = [(np.flatnonzero(space.attached), 0, threads)]
    while parts:
        nodes, first, count = parts.pop()
        owner[nodes] = first
        if count > 1:
            x = space.local.points[nodes]
            axis = int(np.argmax(np.ptp(x, axis=0))) if len(nodes) else 0
            low = count // 2
            order = np.argsort(x[:, axis], kind="stable")
            middle = len(nodes) * low // count
            parts += [(nodes[order[:middle]], first, low), (nodes[order[middle:]], first + low, count - low)]
    return owner


def touching(owner: Ints, nodes: Ints, mine: int, threads: int) -> Ints:
    """Return the rows of `nodes` with a node that thread `mine` owns, ascending."""
    if threads == 1:
        return np.arange(len(nodes))
    touched = np.zeros(len(nodes), bool)
    for column in nodes.T:
        touched |= owner[column] == mine
    return np.flatnonzero(touched)


@kernel
def _add(
    rows: Any, nodes: Any, x: Any, table: Any, kind: Any, law: Any, terms: Any, owner: Any, mine: int, pattern: Any,
    out: Any,
) -> None:  # fmt: skip
    """Add cells `rows` of nodes (k, n) to the blocks `out` of the nodes that `mine` owns."""
    n, n_points, dim = nodes.shape[1], len(table.w), kind.dim
    m = kind.rows * n
    L, W = np.empty((n_points, kind.rows, n)), np.empty(n_points)
    H, WH = L.reshape(n_points, m), np.empty((n_points, m))
    M, K = np.empty((m, m)), np.empty((dim * dim, n * n))
    order = np.empty(n, np.int64)
    g, r = np.empty((dim, n)), np.empty((dim, n))
    for e in rows:
        at_points(nodes, e, x, table, kind, L, W)
        product(H, W, WH, M)
        if dim == 3 and terms.lame[law[e], 1] > 0:
            _isotropic(M, n, terms.lame[law[e], 0], terms.lame[law[e], 1], K)
        else:
            _combine(M, n, kind.rows, terms, law[e], K)
        if terms.bulk[law[e]] > 0:
            _add_mean(L, W, terms.bulk[law[e]], terms.coupling[law[e]], g, r, K)
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
    """Fill K (dim^2, n^2) with the sums of A_sitj M_ij, for s <= t."""
    K[:] = 0.0
    for k in range(terms.start[law], terms.start[law + 1]):
        st, i, j = terms.at[k, 0], terms.at[k, 1] // n_rows * n, terms.at[k, 1] % n_rows * n
        v = terms.value[k]
        for a in range(n):
            for b in range(n):
                K[st, a * n + b] += v * M[i + a, j + b]


@kernel
def _isotropic(M: Any, n: int, lam: float, mu: float, K: Any) -> None:
    """Fill K (9, n^2) of an isotropic solid, A_sitj = lam d_si d_tj + mu (d_st d_ij + d_sj d_it), in one pass."""
    y, z = n, 2 * n
    for a in range(n):
        for b in range(n):
            ab = a * n + b
            trace = mu * (M[a, b] + M[y + a, y + b] + M[z + a, z + b])
            K[0, ab] = (lam + mu) * M[a, b] + trace
            K[1, ab] = lam * M[a, y + b] + mu * M[y + a, b]
            K[2, ab] = lam * M[a, z + b] + mu * M[z + a, b]
            K[4, ab] = (lam + mu) * M[y + a, y + b] + trace
            K[5, ab] = lam * M[y + a, z + b] + mu * M[z + a, y + b]
            K[8, ab] = (lam + mu) * M[z + a, z + b] + trace


@kernel
def _add_mean(L: Any, W: Any, bulk: float, coupling: Any, g: Any, r: Any, K: Any) -> None:
    """Add V (r g^T + g r^T + bulk g g^T) to K (dim^2, n^2), for s <= t; g, r (dim, n) are filled with V g and V r."""
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
        for t in range(s, dim):
            for a in range(n):
                x, y = (r[s, a] + bulk * g[s, a]) / V, g[s, a] / V
                for b in range(n):
                    K[s * dim + t, a * n + b] += x * g[t, b] + y * r[t, b]


@kernel
def sort_places(nodes: Any, e: int, order: Any) -> None:
    """Fill `order` with the positions of a cell's nodes, sorted by node number."""
    for a in range(len(order)):
        b = a
        while b > 0 and nodes[e, order[b - 1]] > nodes[e, a]:
            order[b] = order[b - 1]
            b -= 1
        order[b] = a


@kernel
def add_row(nodes: Any, e: int, order: Any, a: int, K: Any, pattern: Any, out: Any, dim: int) -> None:
    """Add row a of a cell's K to its row of blocks; `order` sorts the cell's nodes as the columns are sorted."""
    at = pattern.indptr[nodes[e, a]]
    for b in order:
        while pattern.indices[at] != nodes[e, b]:
            at += 1
        ab, ba = a * len(order) + b, b * len(order) + a
        up = ab if a <= b else ba  # K_ss is symmetric but for rounding: one triangle serves both
        if dim == 3:
            out[at, 0, 0] += K[0, up]
            out[at, 0, 1] += K[1, ab]
            out[at, 0, 2] += K[2, ab]
            out[at, 1, 0] += K[1, ba]
            out[at, 1, 1] += K[4, up]
            out[at, 1, 2] += K[5, ab]
            out[at, 2, 0] += K[2, ba]
            out[at, 2, 1] += K[5, ba]
            out[at, 2, 2] += K[8, up]
        else:
            out[at, 0, 0] += K[0, up]
            out[at, 0, 1] += K[1, ab]
            out[at, 1, 0] += K[1, ba]
            out[at, 1, 1] += K[3, up]
