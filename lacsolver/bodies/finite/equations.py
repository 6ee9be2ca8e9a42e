"""Internal forces and their tangent at a displacement, summed directly into a vector and a block-CSR pattern.

    f_as = int P_si L_ia dV,      K_ab,st = int A_sitj L_ia L_jb dV

over the undeformed body (total Lagrangian). With the form of A in `point`, and y_sa = Y_si L_ia,

    K_ab,st = int lam y_sa y_tb + m y_ta y_sb + delta_st L_ia X_ij L_jb + Z_st L_ia L_ib dV

so that each of the first three terms of a cell's K is one product of matrices, with its points stacked. Only the law of
Saint Venant-Kirchhoff has the last term. In axisymmetry the hoop adds Y_22 u_x / r to the lam term of s = x, and one
more product.

Cells with mean dilatation have z_sa v_tb + v_sa z_tb and terms of the whole cell in place of the lam term
(`dilatation`).

As in `bodies.small.stiffness`, each thread owns some rows and goes through their cells in order: the result is the same
to the last bit for any number of threads, and K is symmetric to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from lacmesh.kernels import kernel
from lacmesh.kernels.threads import side_by_side, worthwhile
from lacmesh.mesh import Floats
from lacsolver.bodies.finite.dilatation import dilate, mean_of, put_mean, stress_and_tangent_mean
from lacsolver.bodies.finite.errors import InadmissibleError
from lacsolver.bodies.finite.laws import KIRCHHOFF, POINTWISE, constants
from lacsolver.bodies.finite.point import apply_thermal_stretch, gradient, stress_and_tangent, work
from lacsolver.bodies.locking import may_take_the_mean
from lacsolver.bodies.material import Materials
from lacsolver.bodies.small.fields import checked
from lacsolver.bodies.small.gradients import at_points, kind, table
from lacsolver.bodies.small.stiffness import add_row, matrix, owners, product, sort_places, touching
from lacsolver.space.space import Space

#: thermal stretches, (cells, points) for each block; None for 1 everywhere
Stretches = Sequence[Floats] | None


def internal_force(
    space: Space, materials: Materials, u: Floats, *, stretches: Stretches = None, threads: int = 1
) -> NDArray[np.floating]:
    """Return the internal forces f_int (n_dof,) at u (n_dof,), identical to the last bit for any number of threads.

    `stretches`: those of `thermal_stretches`. Raises InadmissibleError where u inverts a cell at one of its integration
    points, RequestError for a law of small strains.
    """
    return _assembled(space, materials, u, stretches, threads, np.empty((0, space.dim, space.dim)))


def tangent(
    space: Space,
    materials: Materials,
    u: Floats,
    *,
    stretches: Stretches = None,
    threads: int = 1,
    out: NDArray[np.floating] | None = None,
) -> bsr_array:
    """Return the symmetric K = df_int/du (n_dof, n_dof) at u (n_dof,) in dim x dim blocks; see `internal_force`.

    `out` (n_blocks, dim, dim): array that the values of K are written to; None allocates a new one.

    >>> from lacmesh import Mesh
    >>> from lacsolver.bodies.finite.laws import NeoHookean
    >>> bar = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> space = Space.of(bar, "plane_stress")
    >>> materials = Materials.of(space, NeoHookean(young=1.0, poisson=0.3))
    >>> turned = np.array([0, 0, -1, 1, -2, 0, -1, -1.0])  # by 90 degrees
    >>> float(abs(internal_force(space, materials, turned)).max()), tangent(space, materials, turned).shape
    (0.0, (8, 8))
    """
    shape = (len(space.pattern.indices), space.dim, space.dim)
    if out is None:
        out = np.zeros(shape)
    elif out.shape != shape:
        raise ValueError(f"out must be {shape}, not {out.shape}")
    out[:] = 0.0
    _assembled(space, materials, u, stretches, threads, out)
    return matrix(space, out)


def _assembled(
    space: Space, materials: Materials, u: Floats, stretches: Stretches, threads: int, out: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Return f_int, and add the blocks of K to `out` unless that array is empty."""
    if threads < 1:
        raise ValueError(f"threads is 1 or more, not {threads}")
    threads = worthwhile(threads, space.mesh.n_cells)
    laws, moved = constants(materials), checked(space, u).reshape(-1, space.dim)
    f, owner = np.zeros((space.mesh.n_nodes, space.dim)), owners(space, threads)
    folded = [np.zeros(len(block.nodes), bool) for block in space.blocks]

    def run(mine: int) -> None:
        for number, (name, nodes, _) in enumerate(space.blocks):
            theta = np.empty((0, 0)) if stretches is None else stretches[number]
            _add(
                touching(owner, nodes, mine, threads), nodes, space.local.points, moved,
                table(name, space.model.axisymmetric), kind(space), space.model.plane_stress, materials.law[number],
                laws, may_take_the_mean(space, number), theta, owner, mine, space.pattern, f, out, folded[number],
            )  # fmt: skip

    side_by_side(run, threads)
    check_admissible(space, folded)
    return f.ravel()


def check_admissible(space: Space, folded: Sequence[NDArray[np.bool_]]) -> None:
    """Raise InadmissibleError if any cell is inverted, as `folded` (cells,) of each block tells."""
    cells = np.concatenate([block.cell[bad] for block, bad in zip(space.blocks, folded, strict=True)])
    if len(cells):
        message = f"cells {space.mesh.cell_names(cells)} are inverted by this displacement"
        raise InadmissibleError(f"{message}; take smaller steps", space.mesh.cell_number[cells])


class TangentWorkspace(NamedTuple):
    """Terms of a cell's K at its points q, multiplied by the points' weights, and arrays for their products.

    `v`, `y` (q, dim, n): factors of the lam and of the m term, one shared array except in axisymmetry; `lam`, `m` (q,).
    `XL` (q, rows, n): X_ij L_jb; `Z` (q, dim^2); `hoop` (q,): factor of L_2a L_2b, for s = t = x. `z` (q, dim, n), `r`,
    `gm` (dim, n): terms of mean dilatation. `weighted`, `M`, `N`, `D`: products.
    """

    v: Floats
    y: Floats
    lam: Floats
    m: Floats
    XL: Floats
    Z: Floats
    hoop: Floats
    z: Floats
    r: Floats
    gm: Floats
    weighted: Floats
    M: Floats
    N: Floats
    D: Floats


@kernel
def _add(
    rows: Any, nodes: Any, x: Any, u: Any, table: Any, kind: Any, plane_stress: bool, law: Any, laws: Any, may: bool,
    theta: Any, owner: Any, mine: int, pattern: Any, f: Any, out: Any, folded: Any,
) -> None:  # fmt: skip
    """Add cells `rows` of nodes (k, n) to the rows of f and of `out` (unless empty) that `mine` owns."""
    n, n_points, dim, n_rows = nodes.shape[1], len(table.w), kind.dim, kind.rows
    wanted, axisymmetric = len(out) > 0, kind.axisymmetric
    L, W, hot = np.empty((n_points, n_rows, n)), np.empty(n_points), np.empty(0)
    own, K, order = np.empty((n, dim)), np.empty((dim * dim, n * n)), np.empty(n, np.int64)
    place, mean, stack = work(), mean_of(n_points), _tangent_workspace(n_points, n_rows, dim, n, axisymmetric)
    for e in rows:
        k = law[e]
        if laws.kind[k] == POINTWISE:
            continue
        lam, mu, whole = laws.lame[k, 0], laws.lame[k, 1], may and laws.mean[k]
        at_points(nodes, e, x, table, kind, L, W)
        if len(theta):
            hot = theta[e]
            apply_thermal_stretch(hot, L, W)
        own[:] = 0.0
        if whole:
            b, v, good = _cell_at_once(nodes, e, u, L, W, hot, kind, lam, mu, wanted, mean, place, stack, own)
        else:
            b, v = 0.0, 1.0
            good = _by_points(
                nodes, e, u, L, W, hot, kind, plane_stress, laws.kind[k], lam, mu, wanted, place, stack, own
            )
        if not good:
            folded[e] = True
            continue
        if wanted:
            _first_term(stack, whole, b, v, n_points, dim * n)
            _combine(L, stack, dim, axisymmetric, laws.kind[k] == KIRCHHOFF, K)
            sort_places(nodes, e, order)
        for a in range(n):
            if owner[nodes[e, a]] == mine:
                for s in range(dim):
                    f[nodes[e, a], s] += own[a, s]
                if wanted:
                    add_row(nodes, e, order, a, K, pattern, out, dim)


@kernel
def _by_points(
    nodes: Any, e: int, u: Any, L: Any, W: Any, theta: Any, kind: Any, plane_stress: bool, law: int, lam: float,
    mu: float, wanted: bool, place: Any, stack: Any, f: Any,
) -> Any:  # fmt: skip
    """Add to f (n, dim) and fill the stack of cell e point by point; return True if J > 0 at every point."""
    for q in range(len(W)):
        hot = theta[q] if len(theta) else 1.0
        gradient(nodes, e, u, L[q], kind.dim, kind.axisymmetric, hot, place.F)
        lam_q, m, _, good = stress_and_tangent(law, lam, mu, plane_stress, place)
        if not good:
            return False
        _force(W[q], place.P, L[q], kind.dim, kind.axisymmetric, f)
        if wanted:
            _put(q, W[q], lam_q, m, place, L, kind.dim, kind.axisymmetric, stack)
    return True


@kernel
def _cell_at_once(
    nodes: Any, e: int, u: Any, L: Any, W: Any, theta: Any, kind: Any, lam: float, mu: float, wanted: bool, mean: Any,
    place: Any, stack: Any, f: Any,
) -> Any:  # fmt: skip
    """Do as `_by_points` with the mean dilatation of the cell; return (b, v, True if J > 0 at every point)."""
    p, b, _, v, good = dilate(nodes, e, u, L, W, theta, kind, lam, mu, mean)
    if not good:
        return b, v, False
    stack.r[:] = 0.0
    stack.gm[:] = 0.0
    for q in range(len(W)):
        m, factor = stress_and_tangent_mean(q, p, mu, mean, place)
        _force(W[q], place.P, L[q], kind.dim, kind.axisymmetric, f)
        if wanted:
            _put(q, W[q], 0.0, m, place, L, kind.dim, kind.axisymmetric, stack)
            put_mean(
                q, W[q], p, mu, factor, mean, place, L[q], kind.dim, kind.axisymmetric, stack.z[q], stack.r, stack.gm
            )
    return b, v, True


@kernel
def _tangent_workspace(n_points: int, n_rows: int, dim: int, n: int, axisymmetric: bool) -> Any:
    """Allocate the arrays for a cell."""
    m = dim * n
    y, z = np.empty((n_points, dim, n)), np.empty((n_points, dim, n))
    v = np.empty((n_points, dim, n)) if axisymmetric else y
    XL, Z = np.zeros((n_points, n_rows, n)), np.empty((n_points, dim * dim))
    lam, m_q, hoop = np.empty(n_points), np.empty(n_points), np.empty(n_points)
    r, gm, weighted = np.empty((dim, n)), np.empty((dim, n)), np.empty((n_points, m))
    M, N, D = np.empty((m, m)), np.empty((m, m)), np.empty((n, n))
    return TangentWorkspace(v, y, lam, m_q, XL, Z, hoop, z, r, gm, weighted, M, N, D)


@kernel
def _first_term(stack: Any, mean: bool, b: float, v: float, n_points: int, m: int) -> None:
    """Fill M (m, m) with the lam term, v^T lam v, or with the terms that replace it under mean dilatation."""
    M, N = stack.M, stack.N
    if not mean:
        product(stack.v.reshape(n_points, m), stack.lam, stack.weighted, M)
        return
    np.dot(stack.z.reshape(n_points, m).T, stack.v.reshape(n_points, m), N)
    r, gm = stack.r.reshape(m), stack.gm.reshape(m)
    for i in range(m):
        gm[i] /= v
    for i in range(m):
        for j in range(m):
            M[i, j] = N[i, j] + N[j, i] + r[i] * gm[j] + gm[i] * r[j] + b * gm[i] * gm[j]


@kernel
def _force(W: float, P: Any, L: Any, dim: int, axisymmetric: bool, f: Any) -> None:
    """Add W P_si L_ia to f (n, dim)."""
    p00, p01, p02, p10, p11, p12 = P[0, 0], P[0, 1], P[0, 2], P[1, 0], P[1, 1], P[1, 2]
    p20, p21, p22 = P[2, 0], P[2, 1], P[2, 2]
    for a in range(len(f)):
        g0, g1, g2 = W * L[0, a], W * L[1, a], 0.0
        if dim == 3:
            g2 = W * L[2, a]
            f[a, 2] += p20 * g0 + p21 * g1 + p22 * g2
        f[a, 0] += p00 * g0 + p01 * g1 + p02 * g2
        f[a, 1] += p10 * g0 + p11 * g1 + p12 * g2
        if axisymmetric:
            f[a, 0] += p22 * W * L[2, a]


@kernel
def _put(q: int, W: float, lam: float, m: float, place: Any, L: Any, dim: int, axisymmetric: bool, stack: Any) -> None:
    """Fill the stack at point q; L (q, rows, n)."""
    Y, X, Z, y = place.Y, place.X, place.Z, stack.y
    stack.lam[q], stack.m[q] = W * lam, W * m
    for s in range(dim):
        for t in range(dim):
            stack.Z[q, s * dim + t] = W * Z[s, t]
    if dim == 3:
        _times(q, Y, X, W, L, y, stack.XL)
        return
    for s in range(dim):
        y0, y1, x0, x1 = Y[s, 0], Y[s, 1], W * X[s, 0], W * X[s, 1]
        for a in range(L.shape[2]):
            y[q, s, a] = y0 * L[q, 0, a] + y1 * L[q, 1, a]
            stack.XL[q, s, a] = x0 * L[q, 0, a] + x1 * L[q, 1, a]
    if axisymmetric:
        stack.hoop[q] = W * (m * Y[2, 2] ** 2 + X[2, 2] + Z[2, 2])
        for a in range(L.shape[2]):
            stack.v[q, 0, a] = y[q, 0, a] + Y[2, 2] * L[q, 2, a]
            stack.v[q, 1, a] = y[q, 1, a]


@kernel
def _times(q: int, Y: Any, X: Any, W: float, L: Any, y: Any, XL: Any) -> None:
    """Fill y with Y_si L_ia and XL with W X_si L_ia at point q, in three dimensions."""
    y00, y01, y02, y10, y11, y12 = Y[0, 0], Y[0, 1], Y[0, 2], Y[1, 0], Y[1, 1], Y[1, 2]
    y20, y21, y22 = Y[2, 0], Y[2, 1], Y[2, 2]
    x00, x01, x02, x11, x12, x22 = W * X[0, 0], W * X[0, 1], W * X[0, 2], W * X[1, 1], W * X[1, 2], W * X[2, 2]
    for a in range(L.shape[2]):
        g0, g1, g2 = L[q, 0, a], L[q, 1, a], L[q, 2, a]
        y[q, 0, a] = y00 * g0 + y01 * g1 + y02 * g2
        y[q, 1, a] = y10 * g0 + y11 * g1 + y12 * g2
        y[q, 2, a] = y20 * g0 + y21 * g1 + y22 * g2
        XL[q, 0, a] = x00 * g0 + x01 * g1 + x02 * g2
        XL[q, 1, a] = x01 * g0 + x11 * g1 + x12 * g2
        XL[q, 2, a] = x02 * g0 + x12 * g1 + x22 * g2


@kernel
def _combine(L: Any, stack: Any, dim: int, axisymmetric: bool, kirchhoff: bool, K: Any) -> None:
    """Fill K (dim^2, n^2), for s <= t, from the stack of a cell, whose first term is in M."""
    n_points, n_rows, n = L.shape
    XL, weighted, M, N, D = stack.XL, stack.weighted, stack.M, stack.N, stack.D
    product(stack.y.reshape(n_points, dim * n), stack.m, weighted, N)
    if n_points > 1:
        np.dot(XL.reshape(n_points * n_rows, n).T, L.reshape(n_points * n_rows, n), D)
    else:  # a single point, for which a call of BLAS would cost more
        for a in range(n):
            for b in range(n):
                D[a, b] = XL[0, 0, a] * L[0, 0, b] + XL[0, 1, a] * L[0, 1, b]
                if n_rows == 3:
                    D[a, b] += XL[0, 2, a] * L[0, 2, b]
    if dim == 3:
        _sum_solid(M, N, D, n, K)
        if kirchhoff:
            _add_Z(L, stack.Z, K)
    else:
        _sum_plane(M, N, D, n, K)
        if kirchhoff:
            _add_Z_plane(L, stack.Z, K)
    if axisymmetric:
        for q in range(n_points):
            for a in range(n):
                v = stack.hoop[q] * L[q, 2, a]
                for b in range(n):
                    K[0, a * n + b] += v * L[q, 2, b]


@kernel
def _sum_solid(M: Any, N: Any, D: Any, n: int, K: Any) -> None:
    """Fill K_st = M_st + N_ts + delta_st D in three dimensions, in one pass over the cell's K."""
    y, z = n, 2 * n
    for a in range(n):
        for b in range(n):
            ab = a * n + b
            K[0, ab] = M[a, b] + N[a, b] + D[a, b]
            K[1, ab] = M[a, y + b] + N[y + a, b]
            K[2, ab] = M[a, z + b] + N[z + a, b]
            K[4, ab] = M[y + a, y + b] + N[y + a, y + b] + D[a, b]
            K[5, ab] = M[y + a, z + b] + N[z + a, y + b]
            K[8, ab] = M[z + a, z + b] + N[z + a, z + b] + D[a, b]


@kernel
def _sum_plane(M: Any, N: Any, D: Any, n: int, K: Any) -> None:
    """Fill K_st = M_st + N_ts + delta_st D in two dimensions."""
    for a in range(n):
        for b in range(n):
            ab = a * n + b
            K[0, ab] = M[a, b] + N[a, b] + D[a, b]
            K[1, ab] = M[a, n + b] + N[n + a, b]
            K[3, ab] = M[n + a, n + b] + N[n + a, n + b] + D[a, b]


@kernel
def _add_Z(L: Any, Z: Any, K: Any) -> None:
    """Add Z_st L_ia L_ib, i over the axes, at every point to K (9, n^2), s <= t."""
    n = L.shape[2]
    for q in range(len(L)):
        z0, z1, z2, z4, z5, z8 = Z[q, 0], Z[q, 1], Z[q, 2], Z[q, 4], Z[q, 5], Z[q, 8]
        for a in range(n):
            g0, g1, g2 = L[q, 0, a], L[q, 1, a], L[q, 2, a]
            for b in range(n):
                v = g0 * L[q, 0, b] + g1 * L[q, 1, b] + g2 * L[q, 2, b]
                ab = a * n + b
                K[0, ab] += z0 * v
                K[1, ab] += z1 * v
                K[2, ab] += z2 * v
                K[4, ab] += z4 * v
                K[5, ab] += z5 * v
                K[8, ab] += z8 * v


@kernel
def _add_Z_plane(L: Any, Z: Any, K: Any) -> None:
    """Add Z_st L_ia L_ib, i over the two axes, at every point to K (4, n^2), s <= t."""
    n = L.shape[2]
    for q in range(len(L)):
        z0, z1, z3 = Z[q, 0], Z[q, 1], Z[q, 3]
        for a in range(n):
            g0, g1 = L[q, 0, a], L[q, 1, a]
            for b in range(n):
                v = g0 * L[q, 0, b] + g1 * L[q, 1, b]
                ab = a * n + b
                K[0, ab] += z0 * v
                K[1, ab] += z1 * v
                K[3, ab] += z3 * v
