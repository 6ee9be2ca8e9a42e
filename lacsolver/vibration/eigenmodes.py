"""Lowest modes of a symmetric eigenvalue problem with constraints, some of whose modes are known beforehand.

    K q + C^T p = lambda M q,    C q = 0,    K R = 0,    C R = 0,    R^T M R = 1

M is positive definite, and so is K but for R. The other modes are found by Lanczos' iteration (ARPACK, through
`scipy.sparse.linalg.eigsh`) with the inverse of K among the motions that C and R leave,

    f -> P (x - A^-1 C^T S^-1 C x),    x = A^-1 P^T f,    A = K + C^T C,    S = C A^-1 C^T,    P = 1 - R R^T M

A is factorised; along R it is regularised by springs, which carry no force (`FactorCache`). Since there is no shift,
the lowest modes are found to full accuracy. The iteration starts from one vector, and may miss modes with equal lambda:
it is repeated among the motions that the modes found so far leave, until it finds no lower one. Problems of few
unknowns are solved with dense matrices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats
from lacsolver.linear import LinearError
from lacsolver.saddle.stiffness import Stiffness

#: up to this number of unknowns matrices are dense; and up to this one, if more than half of the modes are asked for
_DENSE, _DENSE_FOR_MANY = 300, 3000
#: columns solved together
_TOGETHER = 64
#: restarts of one iteration, and repeated iterations without a new mode
_RESTARTS, _IDLE = 60, 3
#: relative difference below which two eigenvalues are the same
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class EigenProblem:
    """K, M (n, n), constraints C (m, n) of independent rows, and known modes R (n, r)."""

    K: csr_array
    M: csr_array
    C: csr_array
    R: NDArray[np.floating]

    @property
    def regular(self) -> csr_array:
        """Matrix A = K + C^T C, whose null space is R."""
        return csr_array(self.K + self.C.T @ self.C) if self.C.shape[0] else self.K

    @property
    def count(self) -> int:
        """Number of modes beside R."""
        return self.K.shape[0] - self.C.shape[0] - self.R.shape[1]

    def lowest(self, count: int, A: Stiffness) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the lowest lambda (k,) of modes beside R, and the modes Q (n, k), Q^T M Q = 1, with k <= `count`.

        `A`: the factor of `regular`. Raises LinearError if the iteration does not converge, RequestError if more than
        half of very many modes are asked for.
        """
        n, count = self.K.shape[0], min(count, self.count)
        if n <= _DENSE or (2 * count > self.count and n <= _DENSE_FOR_MANY):
            return self._ritz(self._dense(count), count)
        if 2 * count > self.count:
            raise RequestError(f"{count} modes are more than half of the {self.count} that there are; ask for fewer")
        return self._sparse(count, A)

    def _ritz(self, X: Floats, count: int) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the lowest lambda (count,) and modes in the span of columns X (n, j)."""
        K, M = X.T @ (self.K @ X), X.T @ (self.M @ X)
        eigenvalues, Y = scipy.linalg.eigh((K + K.T) / 2, (M + M.T) / 2)
        return eigenvalues[:count], X @ Y[:, :count]

    def _dense(self, count: int) -> NDArray[np.floating]:
        """Return columns that span the lowest modes, by dense matrices on the motions that C and R leave."""
        rows = np.concatenate([self.C.toarray(), (self.M @ self.R).T])
        size = np.linalg.norm(rows, axis=1, keepdims=True)
        Z = scipy.linalg.null_space(rows / np.where(size > 0, size, 1.0)) if len(rows) else np.eye(self.K.shape[0])
        last = min(count, Z.shape[1]) - 1
        _, Y = scipy.linalg.eigh(Z.T @ (self.K @ Z), Z.T @ (self.M @ Z), subset_by_index=[0, last])
        return np.asarray(Z @ Y)

    def _sparse(self, count: int, A: Stiffness) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the lowest modes by repeated iterations, each among the motions that the modes before leave."""
        eigenvalues: Floats = np.empty(0)
        X, idle, relaxed = np.zeros((self.K.shape[0], 0)), 0, self._relaxed(A)
        while idle <= _IDLE:
            left = self._inverse(A, relaxed, np.concatenate([self.R, X], axis=1))
            new = self._iterate(max(count - len(eigenvalues), 1), left, seed=len(eigenvalues) + idle)
            if not new.shape[1]:
                idle += 1
                continue
            lowest = np.sum(new * (self.K @ new), axis=0).min()
            if len(eigenvalues) >= count and lowest >= eigenvalues[count - 1] * (1 - _SAME):
                return eigenvalues[:count], X[:, :count]
            joined, idle = np.concatenate([X, new], axis=1), 0
            eigenvalues, X = self._ritz(joined, joined.shape[1])
        raise LinearError(f"of {count} modes only {len(eigenvalues)} converged; ask for fewer, or for more")

    def _iterate(self, count: int, inverse: Callable[[Floats], Floats], seed: int) -> NDArray[np.floating]:
        """Return modes (n, j), j <= count, that one iteration finds."""
        n = self.K.shape[0]
        operator = LinearOperator((n, n), matvec=inverse, dtype=float)
        start = inverse(np.random.default_rng(seed).normal(size=n))
        try:
            return np.asarray(eigsh(self.K, count, M=self.M, sigma=0.0, OPinv=operator, v0=start, maxiter=_RESTARTS)[1])
        except ArpackNoConvergence as error:
            return np.asarray(error.eigenvectors).reshape(n, -1)

    def _relaxed(self, A: Stiffness) -> Callable[[Floats], NDArray[np.floating]]:
        """Return g -> S^-1 g with S = C A^-1 C^T (m, m)."""
        C_T, m = csr_array(self.C.T), self.C.shape[0]
        S = np.empty((m, m))
        for k in range(0, m, _TOGETHER):
            S[:, k : k + _TOGETHER] = self.C @ A.solve(C_T[:, k : k + _TOGETHER].toarray())
        return _solver(S)

    def _inverse(
        self, A: Stiffness, relaxed: Callable[[Floats], Floats], X: Floats
    ) -> Callable[[Floats], NDArray[np.floating]]:
        """Return the inverse of K among the motions that C and modes X (n, j), X^T M X = 1, leave; R is among them."""
        MX, C, C_T = self.M @ X, self.C, csr_array(self.C.T)

        def inverse(f: Floats) -> NDArray[np.floating]:
            x = A.solve(f - MX @ (X.T @ f))
            if C.shape[0]:
                x = x - A.solve(C_T @ relaxed(C @ x))
            return x - X @ (MX.T @ x)

        return inverse


def orthonormal(X: Floats, M: csr_array) -> NDArray[np.floating]:
    """Return columns with the span of X (n, j) such that X^T M X = 1."""
    for _ in range(2 if X.shape[1] else 0):  # the second time for round-off
        X = np.linalg.solve(np.linalg.cholesky(X.T @ (M @ X)), X.T).T
    return X


def _solver(S: Floats) -> Callable[[Floats], NDArray[np.floating]]:
    """Return g -> S^-1 g for a symmetric S (m, m), by its pseudo-inverse if rows depend on each other."""
    S = (S + S.T) / 2
    try:
        factor = scipy.linalg.cho_factor(S) if len(S) else None
    except np.linalg.LinAlgError:
        inverse = scipy.linalg.pinvh(S, rtol=1e-10)
        return lambda g: np.asarray(inverse @ g)
    return lambda g: g if factor is None else np.asarray(scipy.linalg.cho_solve(factor, g))
