"""A V-cycle of smoothed aggregation on all cores, in single precision: the preconditioner of multigrid.

The smoother is Chebyshev's polynomial of the fourth kind on the blocks of the diagonal (Lottes 2023, algorithm 2.3),
the same before and after the coarse correction, so that the cycle is symmetric and positive definite. It consists of
products with the matrix only: each row is summed by one thread in one order, and the result is the same to round-off
for any number of threads. Single precision halves the memory and its traffic. Its round-off leaves 1e-7 of noise on a
correction, which is rough and thus weighs 1e-14 times the condition number in energy; the iteration around the cycle is
in double precision. Matrix and residual are scaled first, so that units do not matter. The coarsest level is solved in
double precision.

A level of several processes has the rows of its own nodes, and beside its own entries of a vector those of neighbouring
nodes, which its `Halo` fills in (`halo`).

Rows that add a term N^T N to the matrix (`row_term`) keep its hierarchy: the term is restricted to the coarser levels
by products of the rows with the prolongations, and everything that belongs to the matrix is shared.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from lacmesh.communicator import SERIAL, Communicator
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacsolver.linear.multigrid.row_term import RowTerm, bounded, scaled_rows
from lacsolver.linear.vectors import Vectors

#: degree of the polynomial: 2 takes least time on HEXA8 and TETRA10
_DEGREE = 2
#: steps of Lanczos for the largest eigenvalue of D^-1 K, and the factor on their result, which is a lower bound
_LANCZOS, _MARGIN = 10, 1.05
#: energy of a direction, relative to the largest that its size allows, that is round-off
_NO_ENERGY = 1e-13
#: least number of rows of blocks for a thread
_WORTH = 2000
#: entries of a part of a long vector, which fits into a cache; least number of such parts for a thread
_PART, _WORTH_PARTS = 4096, 16


class Blocks(NamedTuple):
    """A matrix of blocks: `indptr`, `indices`, `data` (blocks, b, c)."""

    indptr: Ints
    indices: Ints
    data: NDArray[np.floating]

    @staticmethod
    def of(A: bsr_array, dtype: type = np.float64, scale: float = 1.0) -> Blocks:
        """Return the blocks of a matrix in the given precision, times `scale`."""
        if scale == 1 and A.data.dtype == dtype:
            return Blocks(A.indptr, A.indices, A.data)
        data = np.empty(A.data.shape, dtype)
        return Blocks(A.indptr, A.indices, np.multiply(A.data, scale, out=data, casting="same_kind"))


class Team(Vectors):
    """Threads that share the rows of a matrix; results do not depend on their number.

    `comm`: the processes that share a vector; each has its own entries, of which products and norms are sums over all.
    """

    def __init__(self, threads: int, comm: Communicator = SERIAL) -> None:
        self.comm, self._threads = comm, threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def run(self, work: Any, n_rows: int, *arguments: Any, worth: int | None = None) -> None:
        """Call work(*arguments, first, last) on all rows, shared among threads with at least `worth` rows each."""
        parts = min(self._threads, n_rows // (worth or _WORTH))
        if self._pool is None or parts < 2:
            work(*arguments, 0, n_rows)
            return
        ends = [n_rows * k // parts for k in range(parts + 1)]
        for one in [self._pool.submit(work, *arguments, *ends[k : k + 2]) for k in range(parts)]:
            one.result()

    def product(self, A: Blocks, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return A x."""
        out = np.empty((len(A.indptr) - 1) * A.data.shape[1], A.data.dtype)
        self.run(_product, len(A.indptr) - 1, *A, x, out)
        return out

    def dots(self, A: Floats, x: Floats) -> NDArray[np.floating]:
        """Return A x for a few long rows A (k, n), summed in parts that do not depend on the threads, in order."""
        n_parts = -(-len(x) // _PART)
        out = np.zeros((n_parts, len(A)))
        self.run(_dots, n_parts, np.ascontiguousarray(A), np.ascontiguousarray(x), out, worth=_WORTH_PARTS)
        return self.comm.total(np.asarray(out.sum(axis=0)))

    def dot(self, x: Floats, y: Floats) -> float:
        """Return the product of two vectors, the same for any number of threads."""
        return float(self.dots(x[None], y)[0])

    def norm(self, x: Floats) -> float:
        """Return the Euclidean norm of a vector, the same for any number of threads."""
        return float(np.sqrt(self.dot(x, x)))

    def largest(self, x: Floats) -> float:
        """Return the largest magnitude of an entry, 0 for an empty vector."""
        return self.comm.largest(super().largest(x))

    def subtract(self, c: Floats, A: Floats, x: Floats) -> None:
        """Subtract c A from x in place, for a few long rows A (k, n)."""
        self.run(_subtract, -(-len(x) // _PART), c, A, x, worth=_WORTH_PARTS)


class Halo:
    """Vectors of a level: own entries, then those of neighbours; here those that one process has whole, without any.

    It fills in entries of neighbours, and adds up what several processes have; rows that it sends set up a hierarchy.
    """

    def fill(self, x: NDArray[np.floating]) -> None:
        """Fill the entries of neighbours in place."""

    def add(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the own entries with what all processes have for them added."""
        return x

    def add_columns(self, A: bsr_array) -> bsr_array:
        """Return the own columns of a matrix with what all processes have for them added."""
        return A

    def of_columns(self, A: bsr_array) -> Halo:
        """Return the halo of vectors of the columns of A, all of which are own entries."""
        return self

    def with_ghosts(self, A: bsr_array, columns: Any) -> tuple[bsr_array, Halo]:
        """Return own rows of A with those of neighbours below them, and the halo of the columns that they have."""
        return A, columns

    def add_rows(self, A: bsr_array, columns: Any) -> tuple[bsr_array, Halo]:
        """Return the own rows of A with what all processes have for them added, and the halo of their columns."""
        return A, columns


#: vectors that one process has whole
NO_HALO = Halo()


def extended(halo: Halo, x: NDArray[np.floating], size: int) -> NDArray[np.floating]:
    """Return own entries with those of neighbours, (size,)."""
    if len(x) < size:
        x = np.concatenate([x, np.zeros(size - len(x), x.dtype)])
    halo.fill(x)  # also where there are none: others may want what is here
    return x


class Level(NamedTuple):
    """Level of the hierarchy: K, inverses of its diagonal blocks over the largest eigenvalue of D^-1 K, R and P.

    R restricts a residual to the next coarser level, P prolongs a correction from it. `width`: columns of K. `halo`:
    that of K's columns; `coarse`: that of P's. `team` computes. `added`: a term added to K.
    """

    K: Blocks
    inverse: NDArray[np.floating]
    R: Blocks
    P: Blocks
    width: int
    team: Team
    halo: Halo = NO_HALO
    coarse: Halo = NO_HALO
    added: RowTerm | None = None

    @staticmethod
    def of(
        K: bsr_array, P: bsr_array, inverse: Floats, unit: float, team: Team,
        halos: tuple[Halo, Halo] = (NO_HALO, NO_HALO),
    ) -> Level:  # fmt: skip
        """Make a level of `unit` K in single precision; `halos`: those of the columns of K and of P."""
        single = Blocks.of(transposed(P), np.float32), Blocks.of(P, np.float32)
        scaled = Blocks.of(K, np.float32, unit), (inverse / unit).astype(np.float32)
        return Level(*scaled, *single, K.shape[1], team, *halos)

    @property
    def n_coarse(self) -> int:
        """Number of columns of P."""
        return (len(self.R.indptr) - 1) * self.R.data.shape[1]

    def with_rows(self, N: bsr_array, finest: bool) -> Level:
        """Return the level of K + N^T N, for rows of blocks (1, b)."""
        if finest:
            return self._replace(added=RowTerm.smoothed(N, self.inverse, self.team.comm))
        return self._replace(added=RowTerm.of(N), inverse=bounded(self.inverse, N, self.team.comm))

    def rows_below(self, N: bsr_array) -> bsr_array:
        """Return N P, the rows N on the next coarser level."""
        P = bsr_array((self.P.data, self.P.indices, self.P.indptr), shape=(N.shape[1], self.n_coarse))
        return self.coarse.add_columns(bsr_array(N @ P))

    def residual(self, r: NDArray[np.floating], x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return r - K x, with the added term in K; x (width,)."""
        self.halo.fill(x)
        out = r - self.team.product(self.K, x)
        if self.added is not None:
            self.added.subtract(out, x, self.team.comm)
        return np.asarray(out)

    def restrict(self, r: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return R r, a residual on the next coarser level."""
        return self.coarse.add(self.team.product(self.R, r))

    def prolong(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return P x, a correction from the next coarser level."""
        return self.team.product(self.P, extended(self.coarse, x, self.n_coarse))

    def smooth(self, r: NDArray[np.floating], x: NDArray[np.floating], last: bool = False) -> NDArray[np.floating]:
        """Add the smoothing polynomial of the residual r to x; return the new residual, or any if it is the `last`."""
        rows, run = len(self.K.indptr) - 1, self.team.run
        z, new = np.zeros_like(x), np.empty_like(x)
        for k in range(1, _DEGREE + 1):
            old, fresh = np.float32((2 * k - 3) / (2 * k + 1)), np.float32((8 * k - 4) / (2 * k + 1))
            if k == 1:
                run(_start, rows, self.inverse, r, z, x, fresh)
            else:
                self.halo.fill(z)
                if self.added is not None:
                    self.added.subtract(r, z, self.team.comm)
                run(_advance, rows, *self.K, self.inverse, z, r, new, x, old, fresh)
                z, new = new, z
            if self.added is not None:
                self.added.correct(float(fresh), r, self.team.comm, z, x)
        return r if last else self.residual(r, z)


#: rows B on all levels, finest first, in single precision, over their largest entry, which comes first
RowsOnLevels: TypeAlias = tuple[float, list[bsr_array]]


class Cycle:
    """One V-cycle as a function of a residual (n,). Levels and the coarsest matrix are those of `unit` K."""

    def __init__(self, levels: list[Level], coarsest: Floats, unit: float, team: Team) -> None:
        self._levels, self._unit, self._team, self._K = levels, unit, team, coarsest
        self._coarsest = np.linalg.pinv(coarsest, hermitian=True) if coarsest.size else coarsest

    def on_levels(self, B: bsr_array) -> RowsOnLevels:
        """Return rows B (m, n) of blocks (1, b) on all levels, for `with_rows`."""
        size = self._team.largest(B.data.ravel()) or 1.0
        rows = [bsr_array(((B.data / size).astype(np.float32), B.indices, B.indptr), shape=B.shape)]
        for level in self._levels:
            rows.append(level.rows_below(rows[-1]))
        return size, rows

    def with_rows(self, B: RowsOnLevels, weights: Floats) -> Cycle:
        """Return the V-cycle of K + B^T W B, for rows B of `on_levels`, with W = diag `weights` (m,).

        Rows without weight have no part in it.
        """
        size, rows = B
        active = np.flatnonzero(weights)
        factor = np.sqrt(weights[active] * self._unit) * size
        *N, coarsest = (scaled_rows(on_level, active, factor) for on_level in rows)
        levels = [level.with_rows(own, k == 0) for k, (level, own) in enumerate(zip(self._levels, N, strict=True))]
        dense = coarsest.toarray().astype(float)
        return Cycle(levels, self._K + dense.T @ dense, self._unit, self._team)

    def below(self) -> tuple[bsr_array, Cycle, Level] | None:
        """Return the matrix of the first coarser level, its V-cycle, and the level above it; None if that is dense."""
        if len(self._levels) < 2:
            return None
        above, level = self._levels[:2]
        data = level.K.data.astype(float) / self._unit
        K = bsr_array((data, level.K.indices, level.K.indptr), shape=(above.n_coarse,) * 2)
        return K, Cycle(self._levels[1:], self._K, self._unit, self._team), above

    def __call__(self, r: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 r."""
        size = self._team.largest(r)
        if not (size > 0 and np.isfinite(size)):
            return np.asarray(r * self._unit)
        return self._down(0, (r / size).astype(np.float32)).astype(float) * (size * self._unit)

    def _down(self, k: int, r: NDArray[np.floating]) -> NDArray[np.floating]:
        if k == len(self._levels):
            return (self._coarsest @ r.astype(float)).astype(np.float32)
        level = self._levels[k]
        x = np.zeros(level.width, r.dtype)
        left = level.smooth(r.copy(), x)
        x[: len(r)] += level.prolong(self._down(k + 1, level.restrict(left)))
        level.smooth(level.residual(r, x), x, last=True)
        return x[: len(r)]


def transposed(A: bsr_array) -> bsr_array:
    """Return the transpose of A as blocks."""
    return bsr_array(A.T.tobsr(A.blocksize[::-1]))


def jacobi(K: bsr_array, team: Team, halo: Halo = NO_HALO) -> tuple[NDArray[np.floating], float]:
    """Return D^-1 (rows, b, b), and an estimate slightly above the largest eigenvalue of D^-1 K."""
    inverse = np.linalg.pinv(_diagonal_blocks(K), hermitian=True)
    return inverse, _MARGIN * _largest(K, inverse, team, halo)


def _largest(K: bsr_array, inverse: Floats, team: Team, halo: Halo) -> float:
    """Return a lower bound of the largest eigenvalue of D^-1 K, by Lanczos from the conjugate gradient coefficients.

    A direction without energy, as in a small body that nothing constrains, is the last one, with the quotient 0.
    """
    r = np.random.default_rng(0).normal(size=len(inverse) * inverse.shape[1])
    p = z = _apply(inverse, r)
    rz, blocks = team.dot(r, z), Blocks.of(K)
    size, top = rz, 0.0  # p^T D p, and the largest quotient p^T K p / p^T D p
    quotients, betas = [], [0.0]
    for _ in range(_LANCZOS):
        if not rz > 0:
            break
        Kp = team.product(blocks, extended(halo, p, K.shape[1]))
        energy = team.dot(p, Kp)
        top = max(top, energy / size)
        if not energy > _NO_ENERGY * top * size:
            quotients.append(0.0)
            break
        quotients.append(energy / rz)
        r = r - Kp / quotients[-1]
        z = _apply(inverse, r)
        rz, before = team.dot(r, z), rz
        betas.append(rz / before)
        p = z + betas[-1] * p
        size = rz + betas[-1] ** 2 * size
    if not any(quotients):
        return 1.0
    main, b = np.array(quotients), np.array(betas[: len(quotients)])
    side = np.sqrt(np.maximum(b[1:], 0)) * main[:-1]
    main[1:] += b[1:] * main[:-1]
    return float(np.linalg.eigvalsh(np.diag(main) + np.diag(side, 1) + np.diag(side, -1))[-1])


def _diagonal_blocks(K: bsr_array) -> NDArray[np.floating]:
    """Return the diagonal blocks (rows, b, b), zero where none is stored."""
    b = K.blocksize[0]
    out = np.zeros((K.shape[0] // b, b, b))
    row = np.repeat(np.arange(len(out)), np.diff(K.indptr))
    on = np.flatnonzero(row == K.indices)
    out[row[on]] = K.data[on]
    return out


def _apply(inverse: Floats, r: Floats) -> NDArray[np.floating]:
    """Return the product of diagonal blocks (n, b, b) with r."""
    return np.asarray(np.einsum("nij,nj->ni", inverse, r.reshape(inverse.shape[:2])).ravel())


@kernel
def _row(indptr: Any, indices: Any, data: Any, x: Any, i: int, out: Any) -> None:
    """Fill out (b,) with block row i of A x."""
    b, c = data.shape[1], data.shape[2]
    if b == 3 and c == 3:
        s0 = s1 = s2 = out.dtype.type(0)
        for k in range(indptr[i], indptr[i + 1]):
            j = 3 * indices[k]
            x0, x1, x2 = x[j], x[j + 1], x[j + 2]
            s0 += data[k, 0, 0] * x0 + data[k, 0, 1] * x1 + data[k, 0, 2] * x2
            s1 += data[k, 1, 0] * x0 + data[k, 1, 1] * x1 + data[k, 1, 2] * x2
            s2 += data[k, 2, 0] * x0 + data[k, 2, 1] * x1 + data[k, 2, 2] * x2
        out[0], out[1], out[2] = s0, s1, s2
        return
    out[:] = 0
    for k in range(indptr[i], indptr[i + 1]):
        j = c * indices[k]
        for s in range(b):
            a = out.dtype.type(0)
            for t in range(c):
                a += data[k, s, t] * x[j + t]
            out[s] += a


@kernel
def _product(indptr: Any, indices: Any, data: Any, x: Any, out: Any, first: int, last: int) -> None:
    """Fill block rows first to last of out = A x."""
    b = data.shape[1]
    for i in range(first, last):
        _row(indptr, indices, data, x, i, out[b * i : b * i + b])


@kernel
def _start(inverse: Any, r: Any, z: Any, x: Any, fresh: float, first: int, last: int) -> None:
    """Fill z = `fresh` D^-1 r, and add it to x."""
    b = inverse.shape[1]
    for i in range(first, last):
        for s in range(b):
            a = r.dtype.type(0)
            for t in range(b):
                a += inverse[i, s, t] * r[b * i + t]
            z[b * i + s] = fresh * a
            x[b * i + s] += fresh * a


@kernel
def _advance(
    indptr: Any, indices: Any, data: Any, inverse: Any, z: Any, r: Any, new: Any, x: Any, old: float, fresh: float,
    first: int, last: int,
) -> None:  # fmt: skip
    """Subtract K z from r, fill new = `old` z + `fresh` D^-1 r, and add it to x."""
    b = inverse.shape[1]
    Kz = np.empty(b, r.dtype)
    for i in range(first, last):
        _row(indptr, indices, data, z, i, Kz)
        for s in range(b):
            r[b * i + s] -= Kz[s]
        for s in range(b):
            a = r.dtype.type(0)
            for t in range(b):
                a += inverse[i, s, t] * r[b * i + t]
            new[b * i + s] = old * z[b * i + s] + fresh * a
            x[b * i + s] += new[b * i + s]


@kernel
def _dots(A: Any, x: Any, out: Any, first: int, last: int) -> None:
    """Fill rows first to last of `out`, each with one part of the sums A x."""
    for part in range(first, last):
        low, high = part * _PART, min((part + 1) * _PART, len(x))
        for k in range(len(A)):
            out[part, k] = np.dot(A[k, low:high], x[low:high])


@kernel
def _subtract(c: Any, A: Any, x: Any, first: int, last: int) -> None:
    """Subtract c A from x, in parts first to last."""
    for part in range(first, last):
        low, high = part * _PART, min((part + 1) * _PART, len(x))
        for k in range(len(A)):
            for i in range(low, high):
                x[i] -= c[k] * A[k, i]
