"""Systems of equations and of inequalities that are small and made at random, and their plain solutions."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from lacsolver.solve.equilibrium import ContactSystem
from lacsolver.solve.schur import Rows
from lacsolver.solve.stiffness import Stiffness, hold


class System(NamedTuple):
    """K q + B^T p + C (q - q0) = f, D q = G; `R` (n, r): motions that K does not resist."""

    K: np.ndarray
    B: np.ndarray
    D: np.ndarray
    C: np.ndarray
    w: np.ndarray
    R: np.ndarray
    f: np.ndarray
    G: np.ndarray

    @property
    def held(self) -> Stiffness:
        """K as the solver has it."""
        return hold(csr_array(self.K), self.R, backend="superlu")

    @property
    def rows(self) -> Rows:
        """B and D as the solver has them."""
        return Rows(csr_array(self.B), csr_array(self.D), self.w)


def system(seed, n=30, m=12, free=0, turning=0.0, same=True):
    """A random one: K like a chain of springs on a grid of two scales, rows of B on a few unknowns each."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n)) * rng.uniform(0.1, 10, n)
    K = root @ root.T / n + 5 * np.eye(n)
    R = np.linalg.qr(rng.normal(size=(n, free)))[0]
    P = np.eye(n) - R @ R.T
    K = P @ K @ P
    K = (K + K.T) / 2
    B = np.where(rng.uniform(size=(m, n)) < 0.3, rng.normal(size=(m, n)), 0.0)
    B[np.arange(m), rng.permutation(n)[:m]] += 2.0
    D = B if same else B * rng.uniform(0.8, 1.2, B.shape)
    C = np.zeros((n, n))
    some = rng.permutation(n)[: n // 4]
    C[np.ix_(some, some)] = turning * rng.normal(size=(len(some), len(some)))
    return System(K, B, D, C, rng.uniform(0.5, 2, m), R, rng.normal(size=n), 0.1 * rng.normal(size=m))


def saddle(s, active, q0):
    """(q, p (m,)) of the whole system, rows `active` held, by dense elimination."""
    n, a = len(s.K), np.asarray(active)
    big = np.block([[s.K + s.C, s.B[a].T], [s.D[a], np.zeros((len(a), len(a)))]])
    found = np.linalg.solve(big, np.concatenate([s.f + s.C @ q0, s.G[a]]))
    p = np.zeros(len(s.B))
    p[a] = found[n:]
    return found[:n], p


def enumerated(s, paired, held):
    """(q, p) of K q = f - B^T p, 0 <= p, G - B q >= 0, p (G - B q) = 0, looked for among all sets of rows."""
    must, may = np.flatnonzero(paired & held), np.flatnonzero(paired & ~held)
    for k in range(len(may) + 1):
        for chosen in itertools.combinations(may, k):
            active = np.sort(np.concatenate([must, chosen]).astype(int))
            if np.linalg.matrix_rank(s.B[active] @ s.R) < s.R.shape[1]:
                continue  # a body is free to move
            q, p = saddle(s, active, np.zeros(len(s.K)))
            gap = s.G - s.B @ q
            if (p[may] >= -1e-12).all() and (gap[may] >= -1e-12).all():
                return q, p
    return None


def contact(s, paired=None, held=None):
    """Contact of a system as a function of q, for `find_equilibrium`: the rows, and their gaps at q."""
    m = len(s.B)
    paired = np.ones(m, bool) if paired is None else paired
    held = np.zeros(m, bool) if held is None else held
    rows = s.rows
    return lambda q: ContactSystem(rows, s.G - s.D @ q, paired, held, np.ones(m))


def complementarity(M, r):
    """The system whose gaps are M p + r: unit rows on K = M^-1."""
    m = len(M)
    K = np.linalg.inv(M)
    eye = np.eye(m)
    return System((K + K.T) / 2, eye, eye, np.zeros((m, m)), np.ones(m), np.zeros((m, 0)), np.zeros(m), r)
