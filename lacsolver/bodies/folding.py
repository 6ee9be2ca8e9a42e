"""Cells that are folded: J = det F falls to zero inside, though it is positive at all integration points.

Forces see F at integration points alone. So Newton's method may find an equilibrium in which a corner has changed
places with its mid-side node, or in which the body is wound once around a point of a cell.

The volume element of a cell is a polynomial. Its coefficients in Bernstein's basis bound it from below, and those at
corners are its values there (Johnen, Remacle and Geuzaine, J. Comput. Phys. 233, 2013). A cell that the bound leaves in
doubt is bisected, and bisected again. A cell is a product of simplices: QUAD of two intervals, PENTA of a triangle and
an interval. Pyramids, whose volume elements are rational, are not looked at.
"""

from __future__ import annotations

from functools import cache, reduce
from itertools import product
from math import factorial, prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.shapes import gradient
from lacsolver.bodies.kinematics import Kinematics
from lacsolver.bodies.points import parts_of
from lacsolver.space.determinant import determinant
from lacsolver.space.rules import cell_rule
from lacsolver.space.space import Space

#: least volume element of a cell, relative to its largest coefficient, below which it is folded
_FLAT = 1e-3
#: how often a cell is halved in each direction before one that is still in doubt is taken as folded
_DEPTH = 5
#: dimensions of the simplices of which cells of a family are products
_FACTORS = {"TRIA": (2,), "QUAD": (1, 1), "TETRA": (3,), "HEXA": (1, 1, 1), "PENTA": (2, 1)}


class _Bernstein(NamedTuple):
    """Volume element of a type of cell in Bernstein's basis of m functions.

    `dN` (m + 1, n, dim): gradients at m points of a lattice, and at an integration point; `coefficients` (m, m): those
    of values at the lattice; `corners` (k,): functions that are 1 at a corner; `halves`: for each bisection, from
    coefficients on a cell those on its two halves (m, m). All bisections together halve it in each direction.
    """

    dN: NDArray[np.floating]
    coefficients: NDArray[np.floating]
    corners: Ints
    halves: tuple[tuple[NDArray[np.floating], NDArray[np.floating]], ...]


def folded(bodies: Kinematics, u: Floats, t: float) -> str:
    """Return a sentence about cells of finite strains that u (n_dof,) folds; "" if there are none.

    It is the same on all processes.
    """
    if not bodies.finite:
        return ""
    space = bodies.space
    every = space.share.gather(folds(space, u))
    if not len(every):
        return ""
    number, *place = every[every[:, 0].argmin()].tolist()
    who = f"cell {number:.0f}" if len(every) == 1 else f"{len(every)} cells, the first {number:.0f},"
    return (
        f"{who} near ({', '.join(space.told(np.array(place)))}) folded at time {t:.6g}: the volume falls to zero "
        "between integration points, where forces do not see it, and this may be a wrong equilibrium; take smaller "
        "steps, or smaller or linear cells there"
    )


def folds(space: Space, u: Floats) -> NDArray[np.floating]:
    """Return number and undeformed centre (k, 4) of the cells of this process that u (n_dof,) folds.

    Cells that are folded or collapsed undeformed are left out.
    """
    x, out = space.places(u), [np.empty((0, 4))]
    for number, block in enumerate(space.blocks):
        if CELLS[block.type].family not in _FACTORS or block.type in ("TRIA3", "TETRA4"):
            continue
        for cells in parts_of(space, number, np.flatnonzero(space.own_cells(block))):
            nodes = block.nodes[cells]
            bad = np.flatnonzero(_fold(block.type, nodes, x))
            bad = bad[~_fold(block.type, nodes[bad], space.local.points)]
            centre = space.mesh.points[nodes[bad]].mean(axis=1)
            out.append(np.column_stack([space.mesh.cell_number[block.cell[cells[bad]]], centre]))
    return np.concatenate(out)


def _fold(name: str, nodes: Ints, x: Floats) -> NDArray[np.bool_]:
    """Return a mask of cells of nodes (c, n) at x (n_nodes, 3) that are folded."""
    basis = _basis(name)
    values = determinant(nodes, x, basis.dN)
    b = values[:, :-1] @ basis.coefficients.T * np.sign(values[:, -1:])
    b -= _FLAT * np.abs(b).max(axis=1, initial=0.0, keepdims=True)
    out, cell = np.zeros(len(nodes), bool), np.arange(len(nodes))
    for _ in range(_DEPTH):
        for halves in basis.halves:
            out[cell[(b[:, basis.corners] <= 0).any(axis=1)]] = True
            doubt = (b <= 0).any(axis=1) & ~out[cell]
            if not doubt.any():
                return out
            b, cell = np.concatenate([b[doubt] @ half.T for half in halves]), np.tile(cell[doubt], 2)
    out[cell[(b <= 0).any(axis=1)]] = True
    return out


@cache
def _basis(name: str) -> _Bernstein:
    """Return the basis of a type of cell, in which a factor of dimension n has degree n (p - 1) + (dim - n) p."""
    cell = CELLS[name]
    p = 3 if name == "TRIA7" else cell.order
    factors = [(n, n * (p - 1) + (cell.dim - n) * p) for n in _FACTORS[cell.family]]
    lattices = [_lattice(n, degree) for n, degree in factors]
    inverse = [np.linalg.inv(_bernstein(n, degree, B)) for (n, degree), B in zip(factors, lattices, strict=True)]
    corners = [(B == 1).any(axis=1) for B in lattices]
    whole = [np.eye(len(B)) for B in lattices]
    halves = []
    for k, (n, degree) in enumerate(factors):
        parts = [inverse[k] @ _bernstein(n, degree, lattices[k] @ half) for half in _halves(n)]
        first, second = (reduce(np.kron, [*whole[:k], part, *whole[k + 1 :]]) for part in parts)
        halves += n * [(first, second)]  # as many bisections halve all edges of a simplex
    axes = (B[:, 1:] if B.shape[1] > 2 else 2 * B[:, 1:] - 1 for B in lattices)
    X = np.array([np.concatenate(rows) for rows in product(*axes)])
    dN = gradient(name, np.concatenate([X, cell_rule(name)[0][:1]]))
    return _Bernstein(dN, reduce(np.kron, inverse), np.flatnonzero(reduce(np.kron, corners)), tuple(halves))


def _exponents(n: int, degree: int) -> NDArray[np.integer]:
    """Return the exponents (m, n + 1) of a simplex, each row with the sum `degree`."""
    return np.array([e for e in product(range(degree + 1), repeat=n + 1) if sum(e) == degree])


def _lattice(n: int, degree: int) -> NDArray[np.floating]:
    """Return barycentric coordinates (m, n + 1) of as many points of a simplex as it has functions."""
    return _exponents(n, degree) / degree


def _bernstein(n: int, degree: int, B: Floats) -> NDArray[np.floating]:
    """Return Bernstein's functions (p, m) of a simplex at barycentric coordinates B (p, n + 1)."""
    exponents = _exponents(n, degree)
    counts = np.array([factorial(degree) / prod(map(factorial, e)) for e in exponents.tolist()])
    return np.asarray(counts * (np.asarray(B)[:, None, :] ** exponents).prod(axis=2))


def _halves(n: int) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return barycentric corners (n + 1, n + 1) of the halves of a simplex, bisected at its edge from first to last.

    In the order of the halves' corners the next bisection is of another edge, so that all become short.
    """
    corner = np.eye(n + 1)
    rest = [(corner[0] + corner[n]) / 2, *corner[1:n]]
    return np.array([corner[0], *rest]), np.array([corner[n], *rest])
