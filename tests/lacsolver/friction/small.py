"""Friction on matrices: a random body, its rows, and the solution by the active-set loop."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from lacsolver.contact.friction import Bounds
from lacsolver.contact.laws import Unilateral
from lacsolver.equilibrium.active_set import active_set_iterates
from lacsolver.equilibrium.search import search
from lacsolver.results.state import Iterate
from lacsolver.saddle.contact_system import ContactSystem, skin_stiffness
from lacsolver.saddle.row_group import RowGroup, Rows
from lacsolver.saddle.row_set import ShearRows
from lacsolver.saddle.stiffness import FactorCache
from lacsolver.saddle.tolerances import ConvergenceTolerance

#: no rigid-body motion
TOLERANCE = ConvergenceTolerance(1e-10, 60, 0.0)


def half_space(m, tangents, seed=0, coupling=0.3):
    """Return K (n, n), B (m (1 + k), n): points with a normal and k tangents each, coupled as on a body's skin.

    Row m + k i + a is the tangent a of point i. Farther points are coupled less; K is symmetric and definite.
    """
    rng = np.random.default_rng(seed)
    d = 1 + tangents
    place = rng.uniform(size=(m, tangents)) * m
    away = np.linalg.norm(place[:, None] - place[None], axis=2)
    blocks = rng.normal(size=(d, d))
    shape = np.eye(d) + coupling * (blocks + blocks.T) / 4
    C = np.kron(np.exp(-away / 2), shape) + 0.1 * np.eye(d * m)
    K = np.linalg.inv(C)
    B = np.zeros((d * m, d * m))
    for i in range(m):
        B[i, d * i] = 1.0
        for a in range(tangents):
            B[m + tangents * i + a, d * i + 1 + a] = 1.0
    return (K + K.T) / 2, B


def solve(K, B, f, G, bounds, tangents, *, slip=None, start=None, tolerance=TOLERANCE, law=None):
    """Return the outcome of the loop; `slip` (m k,): what slips are counted from."""
    m, n = len(G), len(f)
    stiffness = FactorCache(np.zeros((n, 0)), "superlu").factorise(csr_array(K))
    rows = Rows(csr_array(B), np.ones(len(B)))
    slip = np.zeros(m * tangents) if slip is None else slip
    normal = slice(0, m)
    shear = ShearRows(normal, slice(m, len(B)), bounds)
    group = RowGroup(law or Unilateral(), normal, np.empty((m, 0)), shear=shear)
    every = np.ones(len(B), bool)
    system = ContactSystem(rows, np.concatenate([G, slip]), (group,), every, every, skin_stiffness(stiffness, rows))
    start = start or Iterate(np.zeros(n), np.zeros(len(B)), np.zeros(len(B), bool))

    def contact_at(q):
        return system.with_gaps(system.G - B @ q)

    return search(active_set_iterates(stiffness, f, contact_at, start, tolerance), tolerance)


def coulomb(mu, m):
    """Return the bounds of m macro-elements with a coefficient."""
    return Bounds(np.full(m, float(mu)), np.zeros(m), np.full(m, np.inf))
