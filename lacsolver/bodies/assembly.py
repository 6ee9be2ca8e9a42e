"""Sums of forces and stiffnesses of cells, directly into a vector of forces and a block-CSR pattern.

    f_as = int P_si L_ia dV,      K_ab,st = int A_sitj L_ia L_jb dV

for a stress P_si and a tangent A_sitj at integration points, (3, 3) and (3, 3, 3, 3) in every model: in axisymmetry the
row L_2 = N / r of s = x works on the hoop, P_22 and A_22.. . With the points of a cell stacked, and G_(qj),(st a) =
W A_sitj L_ia, its K is one product of matrices, G^T L; only s <= t are formed, since A is symmetric.

A law whose strain has the mean of its dilatation over the cell adds r g^T + g r^T + b g g^T, of r_sa = int R_si L_ia dV
and g_sa = int G_si L_ia dV (`MeanTerms`).

Each thread owns some rows (nodes), goes through the cells that touch them in their order, and adds to its own rows
only. So every entry is summed in one order whatever the number of threads, and the result is the same to round-off;
the price is that cells between two threads' nodes are computed by both. K is symmetric to round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.threads import side_by_side, worthwhile
from lacsolver.bodies.points import Span, spans
from lacsolver.space.pattern import Pattern
from lacsolver.space.space import Space


class OwnedRows(NamedTuple):
    """Sums that one thread adds to: the rows of nodes whose `owner` (n_nodes,) is `mine`.

    `f` (n_nodes, dim): forces; `K` (n_blocks, dim, dim): values in the pattern, empty where K is not asked for.
    """

    owner: Ints
    mine: int
    pattern: Pattern
    f: NDArray[np.floating]
    K: NDArray[np.floating]


class MeanTerms(NamedTuple):
    """Terms of a cell with mean dilatation: R, G (c, q, 3, 3) and b (c,); all empty without it."""

    R: Floats
    G: Floats
    b: Floats


#: of cells without mean dilatation
NO_MEAN = MeanTerms(np.empty((0, 0, 3, 3)), np.empty((0, 0, 3, 3)), np.empty(0))


def assemble(
    space: Space,
    laws: Sequence[Ints],
    add: Callable[[Span, OwnedRows], None],
    f: NDArray[np.floating],
    K: NDArray[np.floating],
    threads: int = 1,
) -> None:
    """Call `add` for spans of all cells, law by law, once for each thread that owns rows of theirs."""
    if threads < 1:
        raise ValueError(f"threads is 1 or more, not {threads}")
    threads = worthwhile(threads, space.mesh.n_cells)
    owner = owners(space, threads)

    def run(mine: int) -> None:
        rows = OwnedRows(owner, mine, space.pattern, f, K)
        for span in spans(space, laws, select=lambda nodes: touching(owner, nodes, mine, threads)):
            add(span, rows)

    side_by_side(run, threads)


def matrix(space: Space, values: NDArray[np.floating]) -> bsr_array:
    """Return the matrix with block values (n_blocks, dim, dim) in the pattern of a space."""
    indptr, indices = space.pattern
    return bsr_array((values, indices, indptr), shape=(space.n_dof, space.n_dof), blocksize=(space.dim, space.dim))


def block_values(space: Space, out: NDArray[np.floating] | None = None) -> NDArray[np.floating]:
    """Return zeros for the blocks (n_blocks, dim, dim) of the pattern of a space, in `out` if it is given."""
    shape = (len(space.pattern.indices), space.dim, space.dim)
    if out is None:
        return np.zeros(shape)
    if out.shape != shape:
        raise ValueError(f"out must be {shape}, not {out.shape}")
    out[:] = 0.0
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
def add_cells(nodes: Any, L: Any, W: Any, P: Any, A: Any, mean: Any, kind: Any, rows: Any) -> None:
    """Add cells of nodes (c, n) to the rows: P (c, q, 3, 3) to f, and, unless its K is empty, A (c, q, 3, 3, 3, 3)."""
    n, n_points, n_rows, dim = nodes.shape[1], L.shape[1], L.shape[2], kind.dim
    f, order = np.empty((n, dim)), np.empty(n, np.int64)
    owner, mine, pattern, out_f, out_K = rows
    wanted, n_pairs = len(out_K) > 0, dim * (dim + 1) // 2
    K, G = np.empty((n_pairs, n * n)), np.empty((n_points * n_rows, n_pairs * n))
    r, g = np.empty((n, dim)), np.empty((n, dim))
    for e in range(len(nodes)):
        f[:] = 0.0
        for q in range(n_points):
            add_force(W[e, q], P[e, q], L[e, q], kind, f)
        if wanted:
            for q in range(n_points):
                _put(W[e, q], A[e, q], L[e, q], kind, G[q * n_rows : (q + 1) * n_rows])
            multiply(G, L[e].reshape(n_points * n_rows, n), K.reshape(n_pairs * n, n))
            if len(mean.b):
                r[:] = 0.0
                g[:] = 0.0
                for q in range(n_points):
                    add_force(W[e, q], mean.R[e, q], L[e, q], kind, r)
                    add_force(W[e, q], mean.G[e, q], L[e, q], kind, g)
                add_mean(r, g, mean.b[e], K)
            sort_places(nodes, e, order)
        for a in range(n):
            if owner[nodes[e, a]] == mine:
                for s in range(dim):
                    out_f[nodes[e, a], s] += f[a, s]
                if wanted:
                    add_row(nodes, e, order, a, K, pattern, out_K, dim)


@kernel
def add_force(W: float, P: Any, L: Any, kind: Any, f: Any) -> None:
    """Add W P_si L_ia to f (n, dim)."""
    p00, p01, p02, p10, p11, p12 = P[0, 0], P[0, 1], P[0, 2], P[1, 0], P[1, 1], P[1, 2]
    p20, p21, p22 = P[2, 0], P[2, 1], P[2, 2]
    for a in range(len(f)):
        g0, g1, g2 = W * L[0, a], W * L[1, a], 0.0
        if kind.dim == 3:
            g2 = W * L[2, a]
            f[a, 2] += p20 * g0 + p21 * g1 + p22 * g2
        f[a, 0] += p00 * g0 + p01 * g1 + p02 * g2
        f[a, 1] += p10 * g0 + p11 * g1 + p12 * g2
        if kind.axisymmetric:
            f[a, 0] += p22 * W * L[2, a]


@kernel
def _put(W: float, A: Any, L: Any, kind: Any, G: Any) -> None:
    """Fill G (rows, pairs n) with W A_sitj L_ia at a point: row j, columns st a."""
    n, start = L.shape[1], 0
    for s in range(kind.dim):
        for t in range(s, kind.dim):
            for j in range(len(L)):
                k, m = t, j  # A_..kl
                if j == 2 and kind.axisymmetric:
                    k, m = 2, 2
                a0, a1, a2 = W * A[s, 0, k, m], W * A[s, 1, k, m], 0.0
                if kind.dim == 3:
                    a2 = W * A[s, 2, k, m]
                elif s == 0:
                    a2 = W * A[2, 2, k, m]
                if j == 2 and kind.axisymmetric and t > 0:  # the hoop works on u_x alone
                    a0 = a1 = a2 = 0.0
                if len(L) == 3:
                    for a in range(n):
                        G[j, start + a] = a0 * L[0, a] + a1 * L[1, a] + a2 * L[2, a]
                else:
                    for a in range(n):
                        G[j, start + a] = a0 * L[0, a] + a1 * L[1, a]
            start += n


@kernel
def multiply(G: Any, L: Any, K: Any) -> None:
    """Fill K = G^T L. The rows of a single point are summed without BLAS, whose call would cost more."""
    if len(L) > 3:
        np.dot(G.T, L, K)
        return
    for r in range(K.shape[0]):
        for b in range(K.shape[1]):
            K[r, b] = G[0, r] * L[0, b]
    for j in range(1, len(L)):
        for r in range(K.shape[0]):
            for b in range(K.shape[1]):
                K[r, b] += G[j, r] * L[j, b]


@kernel
def add_mean(r: Any, g: Any, b: float, K: Any) -> None:
    """Add r g^T + g r^T + b g g^T of r, g (n, dim) to K (pairs, n^2)."""
    n, dim = g.shape
    pair = 0
    for s in range(dim):
        for t in range(s, dim):
            for a in range(n):
                x, y = r[a, s] + b * g[a, s], g[a, s]
                for c in range(n):
                    K[pair, a * n + c] += x * g[c, t] + y * r[c, t]
            pair += 1


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
            out[at, 1, 1] += K[3, up]
            out[at, 1, 2] += K[4, ab]
            out[at, 2, 0] += K[2, ba]
            out[at, 2, 1] += K[4, ba]
            out[at, 2, 2] += K[5, up]
        else:
            out[at, 0, 0] += K[0, up]
            out[at, 0, 1] += K[1, ab]
            out[at, 1, 0] += K[1, ba]
            out[at, 1, 1] += K[2, up]


@kernel
def scatter(out: Any, nodes: Any, f: Any) -> None:
    """Add nodal forces f (c, n, dim) of cells to out (n_nodes, dim), in their order."""
    for e in range(nodes.shape[0]):
        for a in range(nodes.shape[1]):
            for s in range(f.shape[2]):
                out[nodes[e, a], s] += f[e, a, s]
