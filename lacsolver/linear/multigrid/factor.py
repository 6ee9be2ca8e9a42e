"""Multigrid on nodal blocks as a preconditioner, with the hierarchy of `aggregation`.

The hierarchy is built once for a matrix. It serves all right-hand sides, and similar matrices too, until it is stale:
until they take 1.5 times as many iterations as at its first use. Rows of the identity for prescribed displacements keep
the blocks complete; they cost no iterations (measured).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from scipy.sparse import bsr_array, csr_array
from scipy.sparse.csgraph import connected_components

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats
from lacsolver.linear.accuracy import TOLERANCE, Matrix, backward_error, right_hand_sides
from lacsolver.linear.errors import LinearError
from lacsolver.linear.krylov import minimise
from lacsolver.linear.multigrid.aggregation import aggregated
from lacsolver.linear.multigrid.cycle import Blocks, Cycle, Level, Team
from lacsolver.linear.regular import CLEAR, is_free, positive_diagonal, singular
from lacsolver.linear.vectors import Vectors

#: most iterations in all and in a round of GCR, whose directions are stored; most rounds
_MOST, _ROUND, _LOOKS = 300, 80, 12
#: reduction of the residual in a round, after which it is computed anew
_RECURRED = 1e-9
#: backward error below which a residual is round-off
_ROUNDING = 1e-15
#: lower bound of the tolerance
_LEAST = 1e-16
_TINY = 1e-300
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

    def cycle_with_rows(self, B: bsr_array, weights: Floats) -> Callable[[Floats], Floats]:
        """Return b -> an approximation of (K + B^T W B)^-1 b, one V-cycle, with the hierarchy of K."""
        cycle = self.hierarchy.cycle
        return cycle.with_rows(cycle.on_levels(B), weights)

    def coarse(self) -> tuple[MultigridFactor, Level] | None:
        """Return the factor of the matrix on the first coarser level, and the level above it; None if there is none."""
        below = self.hierarchy.cycle.below()
        if below is None:
            return None
        K, cycle, above = below
        d = K.diagonal()
        return MultigridFactor(K, np.where(d > 0, d, 1.0), Hierarchy(cycle), self.team), above

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
        solutions = [self._one(*column, tolerance) for column in columns]
        return np.stack(solutions, axis=1) if solutions else b

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
            dx, left, count = minimise(self, r, lambda r: norm(r) / goal, limit, least=_RECURRED * before)
            if not count:
                break
            self.n_iterations += count
            x = x + dx
            r = b - self.image(x)
            decades = float(np.log10(before / max(norm(left), _TINY)))
            self.hierarchy.record_convergence("alone", count, decades)
        if norm(r) <= goal or backward_error(self._scale, x, r, b) <= _ROUNDING:
            return x
        message = f"multigrid stopped at a residual of {norm(r) / norm(b):.1e} of the forces, "
        message += f"after {self.n_iterations} iterations"
        raise LinearError(f"{message}; try a direct backend, and look for a part that is hardly held, or thin cells")


class MultigridAnalysis:
    """The rigid-body modes and the size of nodal blocks, from which hierarchies are built.

    `modes` (n, r): motions that cost no energy in a free body, translations if None; `block`: number of unknowns of a
    node, numbered consecutively. `near`: as of `aggregated`.
    """

    backend, note = "multigrid", ""

    def __init__(
        self, K: Matrix, modes: Floats | None, block: int | None, threads: int = 1, near: csr_array | None = None
    ) -> None:
        n = K.shape[0]
        self._block = block or (K.blocksize[0] if isinstance(K, bsr_array) else 1)
        if n % self._block:
            message = f"{n} unknowns are not a whole number of blocks of {self._block}"
            raise RequestError(f"{message}; keep rows of the identity for the unknowns that are prescribed")
        modes = np.tile(np.eye(self._block), (n // self._block, 1)) if modes is None else np.asarray(modes, float)
        if modes.ndim != 2 or len(modes) != n or not np.isfinite(modes).all():
            raise RequestError(f"modes are ({n}, r) finite numbers, not {modes.shape}")
        self._modes, self._team, self._near = modes, Team(threads), near

    def factor(self, K: Matrix, reuse: MultigridFactor | None = None) -> MultigridFactor:
        """Return a factor of K, whose size is that analysed, with the hierarchy of the factor `reuse` or a new one.

        The hierarchy of `reuse`, the factor of a similar matrix, is used until it is stale. Raises SingularError if a
        body is free to move.
        """
        if K.shape != (len(self._modes),) * 2:
            raise RequestError(f"the matrix is {K.shape}, and {len(self._modes)} unknowns were analysed")
        d = positive_diagonal(K)
        blocks = K.tobsr((self._block, self._block))
        if reuse is not None and reuse.shape == K.shape and not reuse.hierarchy.is_stale:
            return MultigridFactor(blocks, d, reuse.hierarchy, self._team)
        _check_held(blocks, d, self._modes)
        cycle = aggregated(blocks, self._modes, self._team, near=self._near)
        return MultigridFactor(blocks, d, Hierarchy(cycle), self._team)


def _check_held(K: bsr_array, d: Floats, modes: Floats) -> None:
    """Raise SingularError if a combination of the modes costs a body no energy; bodies are connected parts of K."""
    size = np.maximum(K.data.max(axis=(1, 2)), -K.data.min(axis=(1, 2)))  # without a copy of all entries
    nodes = csr_array((size, K.indices.copy(), K.indptr.copy()), shape=(len(K.indptr) - 1,) * 2)
    nodes.eliminate_zeros()  # in place
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
