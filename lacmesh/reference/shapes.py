"""Shape functions of every cell, and their gradients, on the reference elements of `cells.py`.

Each cell's functions are the Lagrange basis of a space spanned by a few terms x^i y^j z^k (1 - z)^-m; only pyramids
have m > 0. The spaces: complete polynomials (SEG, TRIA, TETRA, tensor cells), serendipity (QUAD8, HEXA20, PENTA15),
P2 with a bubble (TRIA7), and on pyramids Bedrosian's rational functions (PYRAM5, PYRAM13; Int. J. Numer. Meth. Engng
35, 1992) and Bergot, Cohen and Durufle's (PYRAM14; J. Sci. Comput. 42, 2010). At a pyramid's apex the functions take
their limit; the gradient has no limit there and must not be evaluated.

Notation: N (p, n) values at p points of n functions, dN (p, n, dim) their gradients, X (p, dim) reference points.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS

#: one basis function: its terms, each (i, j, k, m), summed
Basis = tuple[tuple[tuple[int, int, int, int], ...], ...]

_TINY = 1e-300


def _monomials(dim: int, degree: int, total: int = 6, linear: int = 0) -> Basis:
    """Every monomial of degree at most `degree` in each variable, and at most `total` in all, as P and Q spaces have.

    Powers up to `linear` do not count for the total: with 1 they are those of the serendipity spaces, whose superlinear
    degree is bounded (Arnold and Awanou, Found. Comput. Math. 11, 2011).
    """
    powers = (e for e in product(range(degree + 1), repeat=dim) if sum(i for i in e if i > linear) <= total)
    padded = ((*e, 0, 0, 0)[:3] for e in powers)
    return tuple(((i, j, k, 0),) for i, j, k in padded)


def _prism(triangle: Basis, powers: range) -> Basis:
    return tuple(((i, j, k, 0),) for ((i, j, _, _),) in triangle for k in powers)


_RATIONAL_13: Basis = (((1, 1, 0, 1),), ((2, 1, 0, 1),), ((1, 2, 0, 1),))
_BASES: dict[str, Basis] = {
    "POI1": _monomials(0, 0, 0),
    "SEG2": _monomials(1, 1, 1),
    "SEG3": _monomials(1, 2, 2),
    "TRIA3": _monomials(2, 1, 1),
    "TRIA6": _monomials(2, 2, 2),
    "TRIA7": (*_monomials(2, 2, 2), ((2, 1, 0, 0), (1, 2, 0, 0))),
    "QUAD4": _monomials(2, 1),
    "QUAD8": _monomials(2, 2, 2, linear=1),
    "QUAD9": _monomials(2, 2),
    "TETRA4": _monomials(3, 1, 1),
    "TETRA10": _monomials(3, 2, 2),
    "HEXA8": _monomials(3, 1),
    "HEXA20": _monomials(3, 2, 2, linear=1),
    "HEXA27": _monomials(3, 2),
    "PENTA6": _prism(_monomials(2, 1, 1), range(2)),
    "PENTA15": (*_prism(_monomials(2, 2, 2), range(2)), *_prism(_monomials(2, 1, 1), range(2, 3))),
    "PENTA18": _prism(_monomials(2, 2, 2), range(3)),
    "PYRAM5": (*_monomials(3, 1, 1), ((1, 1, 0, 1),)),
    "PYRAM13": (*_monomials(3, 2, 2), *_RATIONAL_13),
    "PYRAM14": (*_monomials(3, 2, 2), *_RATIONAL_13, ((2, 2, 0, 2),)),
}


def _padded(X: Any, dim: int) -> NDArray[np.floating]:
    X = np.atleast_2d(np.asarray(X, dtype=float))
    if dim and X.shape[1] != dim:
        raise ValueError(f"reference points must be (p, {dim}), not {X.shape}")
    out = np.zeros((len(X), 3))
    out[:, :dim] = X[:, :dim]
    return out


def _terms(basis: Basis, X: NDArray, derivative: int | None = None) -> NDArray:
    """(p, n): each basis function, or its derivative along one axis, at the points X (p, 3)."""
    w = np.maximum(1.0 - X[:, 2], _TINY)
    out = np.zeros((len(X), len(basis)))
    for column, terms in enumerate(basis):
        for i, j, k, m in terms:
            for factor, powers in _derivatives((i, j, k, m), derivative):
                value = np.full(len(X), float(factor))
                for x, power in zip(X.T, powers, strict=False):
                    if power:
                        value *= x**power
                if powers[3]:
                    value = np.divide(value, w ** powers[3], out=np.zeros_like(value), where=value != 0)
                out[:, column] += value
    return out


def _derivatives(e: tuple[int, int, int, int], axis: int | None) -> list[tuple[int, tuple[int, ...]]]:
    """x^i y^j z^k (1 - z)^-m, or its derivative, as (factor, exponents) terms."""
    if axis is None:
        return [(1, e)]
    lower = list(e)
    lower[axis] -= 1
    parts = [(e[axis], tuple(lower))] if e[axis] else []
    if axis == 2 and e[3]:
        parts.append((e[3], (*e[:3], e[3] + 1)))
    return parts


@cache
def _coefficients(name: str) -> NDArray:
    """(n, n): coefficients of the Lagrange basis in the terms of `_BASES`, rounded to the exact multiples of 1/8."""
    cell = CELLS[name]
    nodes = _padded(np.array(cell.reference).reshape(cell.n_nodes, cell.dim), cell.dim)
    return np.round(np.linalg.inv(_terms(_BASES[name], nodes)) * 8) / 8


def shape(name: str, X: Any) -> NDArray[np.floating]:
    """N (p, n_nodes): shape functions of cell type `name` at reference points X (p, dim).

    >>> shape("SEG3", [[0.5]])
    array([[-0.125,  0.375,  0.75 ]])
    """
    return _terms(_BASES[name], _padded(X, CELLS[name].dim)) @ _coefficients(name)


def gradient(name: str, X: Any) -> NDArray[np.floating]:
    """dN (p, n_nodes, dim): gradients of the shape functions at reference points X (p, dim).

    >>> gradient("SEG2", [[0.0]])[0, :, 0]
    array([-0.5,  0.5])
    """
    dim = CELLS[name].dim
    X = _padded(X, dim)
    along = [_terms(_BASES[name], X, axis) @ _coefficients(name) for axis in range(dim)]
    return np.stack(along, axis=-1) if along else np.zeros((len(X), 1, 0))


def jacobian(name: str, x: Any, X: Any) -> NDArray[np.floating]:
    """J (cells, p, 3, dim): derivative of the map of cells with nodes at x (cells, n_nodes, 3), at X (p, dim)."""
    return np.einsum("cns,pnd->cpsd", np.asarray(x, dtype=float), gradient(name, X), optimize=True)
