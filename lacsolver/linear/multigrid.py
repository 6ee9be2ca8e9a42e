"""Multigrid by smoothed aggregation (PyAMG) on nodal blocks, with the rigid-body modes, as a preconditioner.

Vanek, Mandel, Brezina (1996); the rigid-body modes are the near-null space. The hierarchy is built once for a matrix.
It serves all right-hand sides, and similar matrices too, until it is stale: until they take 1.5 times as many
iterations as at its first use. Rows of the identity for prescribed displacements keep the blocks complete; they cost no
iterations (measured).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from scipy.sparse import bsr_array, csr_array
from scipy.sparse.csgraph import connected_components

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints
from lacsolver.linear.cycle import Blocks, Cycle, Level, Team, jacobi
from lacsolver.linear.errors import LinearError
from lacsolver.linear.krylov import minimise
from lacsolver.linear.protocol import TOLERANCE, Factor, Matrix
from lacsolver.linear.refine import backward_error
from lacsolver.linear.regular import CLEAR, is_free, positive_diagonal, singular
from lacsolver.linear.sides import right_hand_sides
from lacsolver.linear.vectors import Vectors

#: couplings weaker than this, relative to the diagonals, do not join nodes; 0.03 took least time on HEXA8 and TETRA10
_STRENGTH = 0.03
#: most nodes (of six unknowns) of the coarsest level, which is solved by a dense inverse
_COARSEST = 60
_LEVELS = 12
#: damping of the smoothing of prolongations, times the largest eigenvalue of D^-1 K
_SMOOTHING = 4 / 3
#: most iterations in all and in a round of GCR, whose directions are stored; most rounds
_MOST, _ROUND, _LOOKS = 300, 80, 12
#: reduction of the residual in a round, after which it is computed anew
_RECURRED = 1e-9
#: backward error below which a residual is round-off
_ROUNDING = 1e-15
#: lower bound of the tolerance
_LEAST = 1e-16
_TINY = 1e-300
#: number of blocks, and of rows of blocks, that are multiplied at once
_PIECE, _ROWS = 1 << 17, 1 << 16
#: energy of a direction, relative to the diagonal's, that is round-off
_FREE = 1e-15
#: a hierarchy is stale when it takes this many times the iterations per decade of the residual of its first use
_STALE_RATIO = 1.5
#: only solves that reduce the residual by at least this many decades count for that
_MIN_DECADES = 3.0


C = TypeVar("C", bound=Callable[[Floats], Floats])


class Hierarchy(Generic[C]):
    """A V-cycle, with its first and last rates of convergence."""

    def __init__(self, cycle: C) -> None:
        self.cycle = cycle
        self._rates: dict[str, tuple[float, float]] = {}

    def record_convergence(self, use: str, cycles: int, decades: float) -> None:
        """Record that a kind of use took `cycles` to reduce a residual by so many decades."""
        if decades >= _MIN_DECADES:
            rate = cycles / decades
            self._rates[use] = self._rates.get(use, (rate, rate))[0], rate

    @property
    def is_stale(self) -> bool:
        """True if building a new hierarchy pays."""
        return any(last > _STALE_RATIO * first for first, last in self._rates.values())


class MultigridFactor:
    """A matrix, and a hierarchy of it or of a similar one. `n_iterations`: those of the last right-hand side."""

    iterative = True

    def __init__(self, K: bsr_array, d: Floats, hierarchy: Hierarchy[Cycle], team: Team) -> None:
        self.n_solves = 0
        self.n_iterations = 0
        self.shape = K.shape
        self.hierarchy = hierarchy
        self.vectors: Vectors = team
        self.matrix, self.team = K, team
        self._scale, self._blocks = 1 / np.sqrt(d), Blocks.of(K)

    def apply(self, x: Floats) -> Floats:
        """Return K x, computed on all threads."""
        return self.team.product(self._blocks, x)

    def cycle(self, b: Floats) -> Floats:
        """Return an approximation of K^-1 b (n,), by one V-cycle."""
        return self.hierarchy.cycle(b)

    def cycle_with_rows(self, B: csr_array, weights: Floats) -> Callable[[Floats], Floats]:
        """Return b -> an approximation of (K + B^T W B)^-1 b, one V-cycle, with the hierarchy of K."""
        return self.hierarchy.cycle.with_rows(bsr_array(B.tobsr((1, self._blocks.data.shape[1]))), weights)

    def coarse(self) -> tuple[MultigridFactor, Level] | None:
        """Return the factor of the matrix on the first coarser level, and the level above it; None if there is none."""
        found = self.hierarchy.cycle.below()
        if found is None:
            return None
        K, cycle, above = found
        d = K.diagonal()
        return MultigridFactor(K, np.where(d > 0, d, 1.0), Hierarchy(cycle), self.team), above

    def record_convergence(self, use: str, cycles: int, decades: float) -> None:
        """Record that `cycles` reduced a residual by so many decades, in a kind of use."""
        self.hierarchy.record_convergence(use, cycles, decades)

    def solve(self, b: Floats, *, tolerance: float = TOLERANCE, x0: Floats | None = None) -> Floats:
        """Return x with |b - K x| <= tolerance |b|, each column from its own x0.

        Raises LinearError if neither that nor a residual at round-off is reached, and SingularError if a direction
        without energy is met.
        """
        b = right_hand_sides(b, len(self._scale))
        x = np.zeros_like(b) if x0 is None else right_hand_sides(x0, len(b))
        if x.shape != b.shape:
            raise RequestError(f"x0 has the shape of b, {b.shape}, not {x.shape}")
        if b.ndim == 1:
            return self._one(b, x, tolerance)
        columns = zip(np.ascontiguousarray(b.T), np.ascontiguousarray(x.T), strict=True)
        made = [self._one(*column, tolerance) for column in columns]
        return np.stack(made, axis=1) if made else b

    precondition = cycle

    def image(self, z: Floats) -> Floats:
        """Return K z. Raises SingularError for a direction without energy."""
        Kz = self.apply(z)
        if z.any() and not z @ Kz > _FREE * np.square(z / self._scale).sum():
            raise singular(dof=int(np.abs(z).argmax()))
        return Kz

    def _one(self, b: Floats, x: Floats, tolerance: float) -> Floats:
        """Return the solution for one right-hand side, by rounds of GCR with the true residual after each."""
        self.n_solves, self.n_iterations, b = self.n_solves + 1, 0, np.ascontiguousarray(b)
        if not b.any():
            return np.zeros_like(b)
        norm = self.vectors.norm
        goal, r = max(tolerance, _LEAST) * norm(b), b - self.apply(x)
        for _ in range(_LOOKS):
            before = norm(r)
            if before <= goal or backward_error(self._scale, x, r, b) <= _ROUNDING:
                return x
            limit = min(_ROUND, _MOST - self.n_iterations)
            step = minimise(self, r, lambda left: norm(left) / goal, limit, least=_RECURRED * before)
            if not step.directions:
                break
            self.n_iterations += step.directions
            x = x + step.x
            r = b - self.image(x)
            self.record_convergence("alone", step.directions, float(np.log10(before / max(norm(step.residual), _TINY))))
        if norm(r) <= goal or backward_error(self._scale, x, r, b) <= _ROUNDING:
            return x
        message = f"multigrid stopped at a residual of {norm(r) / norm(b):.1e} of the forces, "
        message += f"after {self.n_iterations} iterations"
        raise LinearError(f"{message}; try a direct backend, and look for a part that is hardly held, or thin cells")


class MultigridAnalysis:
    """The rigid-body modes and the size of nodal blocks, from which hierarchies are built.

    `modes` (n, r): motions that cost no energy in a free body, translations if None; `block`: number of unknowns of a
    node, numbered consecutively.
    """

    backend = "multigrid"

    def __init__(self, K: Matrix, modes: Floats | None, block: int | None, threads: int = 1) -> None:
        n = K.shape[0]
        self._block = block or (K.blocksize[0] if isinstance(K, bsr_array) else 1)
        if n % self._block:
            message = f"{n} unknowns are not a whole number of blocks of {self._block}"
            raise RequestError(f"{message}; keep rows of the identity for the unknowns that are prescribed")
        modes = np.tile(np.eye(self._block), (n // self._block, 1)) if modes is None else np.asarray(modes, float)
        if modes.ndim != 2 or len(modes) != n or not np.isfinite(modes).all():
            raise RequestError(f"modes are ({n}, r) finite numbers, not {modes.shape}")
        self._modes, self._team = modes, Team(threads)

    def factor(self, K: Matrix, reuse: Factor | None = None) -> MultigridFactor:
        """Return a factor of K, whose size is that analysed, with the hierarchy of the factor `reuse` or a new one.

        The hierarchy of `reuse`, the factor of a similar matrix, is used until it is stale. Raises SingularError if a
        body is free to move.
        """
        if K.shape != (len(self._modes),) * 2:
            raise RequestError(f"the matrix is {K.shape}, and {len(self._modes)} unknowns were analysed")
        d = positive_diagonal(K)
        blocks = K.tobsr((self._block, self._block))
        if isinstance(reuse, MultigridFactor) and reuse.shape == K.shape and not reuse.hierarchy.is_stale:
            return MultigridFactor(blocks, d, reuse.hierarchy, self._team)
        _check_held(blocks, d, self._modes)
        return MultigridFactor(blocks, d, _hierarchy(blocks, self._modes, self._team), self._team)


def _check_held(K: bsr_array, d: Floats, modes: Floats) -> None:
    """Raise SingularError if a combination of the modes costs a body no energy; bodies are connected parts of K."""
    size = np.maximum(K.data.max(axis=(1, 2)), -K.data.min(axis=(1, 2)))  # without a copy of all entries
    nodes = csr_array((size, K.indices, K.indptr), shape=(len(K.indptr) - 1,) * 2)
    nodes.eliminate_zeros()
    n_bodies, body = connected_components(nodes, directed=False)
    body = np.repeat(body, K.blocksize[0])
    forces = K @ modes
    moving = np.isin(body, np.unique(body[modes.any(axis=1)]))  # without fully constrained nodes
    order = np.flatnonzero(moving)[np.argsort(body[moving], kind="stable")]
    for rows in np.split(order, np.flatnonzero(np.diff(body[order])) + 1) if n_bodies else ():
        M = modes[rows]
        size, turn = np.linalg.eigh(M.T @ (d[rows, None] * M))
        kept = size > 1e-12 * size[-1]
        if not kept.any():
            continue
        turn = turn[:, kept] / np.sqrt(size[kept])
        energy, way = np.linalg.eigh(turn.T @ (M.T @ forces[rows]) @ turn)
        v = np.zeros(len(d))
        v[rows] = M @ turn @ way[:, 0]
        if energy[0] < CLEAR and is_free(K, v):
            raise singular(v)


def _hierarchy(K: bsr_array, modes: Floats, team: Team) -> Hierarchy[Cycle]:
    """Build the hierarchy of K: aggregates of nodes with orthonormal modes, smoothed by one step of block Jacobi."""
    levels: list[Level] = []
    unit = 1 / float(K.diagonal().mean()) if K.shape[0] else 1.0
    while len(levels) < _LEVELS and K.shape[0] // K.blocksize[0] > _COARSEST:
        inverse, largest = jacobi(K, team)
        tentative, coarse_modes = _tentative(K, modes)
        if tentative.shape[1] >= K.shape[0]:
            break
        P = _smoothed(K, tentative, inverse, _SMOOTHING / largest)
        del tentative  # memory is at its largest in this loop
        coarse = _galerkin(K, P)
        levels.append(Level.of(K, _transposed(P), P, inverse / largest, unit))
        K, modes = coarse, coarse_modes
    return Hierarchy(Cycle(levels, K.toarray() * unit, unit, team))


def _tentative(K: bsr_array, modes: Floats) -> tuple[bsr_array, Floats]:
    """Aggregate coupled nodes by PyAMG; return (P, coarse modes) with P (coarse modes) = modes."""
    from pyamg.aggregation import fit_candidates, standard_aggregation
    from pyamg.strength import symmetric_strength_of_connection

    norms = np.sqrt(np.einsum("kij,kij->k", K.data, K.data))  # PyAMG would copy all entries for them
    nodes = csr_array((norms, K.indices, K.indptr), shape=(len(K.indptr) - 1,) * 2)
    aggregates, _ = standard_aggregation(symmetric_strength_of_connection(nodes, theta=_STRENGTH))
    P, coarse = fit_candidates(aggregates, modes)
    return bsr_array(P), coarse


def _smoothed(K: bsr_array, P: bsr_array, inverse: Floats, factor: float) -> bsr_array:
    """Return the smoothed prolongation P - factor D^-1 K P in single precision, in which the cycle has it."""
    made = K @ P
    row = np.repeat(np.arange(len(inverse), dtype=made.indices.dtype), np.diff(made.indptr))
    for first in range(0, len(row), _PIECE):
        piece = slice(first, first + _PIECE)
        made.data[piece] = -factor * (inverse[row[piece]] @ made.data[piece])
    _add(made, row, P)
    return bsr_array((made.data.astype(np.float32), made.indices, made.indptr), shape=made.shape)


def _add(A: bsr_array, row: Ints, P: bsr_array) -> None:
    """Add P, with a block in each block row or none, to A in place, which has these blocks; `row`: those of A's."""
    own = np.full(len(A.indptr) - 1, -1, P.indices.dtype)
    own[np.diff(P.indptr) > 0] = P.indices
    at = np.flatnonzero(A.indices == own[row])
    A.data[at] += P.data[P.indptr[row[at]]]


def _galerkin(K: bsr_array, P: bsr_array) -> bsr_array:
    """Return P^T K P, summed over parts of the rows of K: K P has several times the blocks of P."""
    n = len(K.indptr) - 1
    parts = (_transposed(_rows(P, k, k + _ROWS)) @ (_rows(K, k, k + _ROWS) @ P) for k in range(0, n, _ROWS))
    return bsr_array(sum(parts, next(parts)))


def _rows(A: bsr_array, first: int, last: int) -> bsr_array:
    """Return block rows first to last of A, without a copy of their blocks."""
    indptr, b = A.indptr[first : last + 1], A.blocksize[0]
    own = slice(indptr[0], indptr[-1])
    return bsr_array((A.data[own], A.indices[own], indptr - indptr[0]), shape=(b * (len(indptr) - 1), A.shape[1]))


def _transposed(A: bsr_array) -> bsr_array:
    """Return the transpose of A as blocks."""
    return bsr_array(A.T.tobsr(A.blocksize[::-1]))
