"""An exact solution from its displacement alone: stress, body force, tractions and pressure, derived symbolically.

Saint Venant-Kirchhoff: F = 1 + du/dX, E = (F^T F - 1) / 2, S = lambda tr(E) 1 + 2 mu E, P = F S, nominal stress.
Body force b = -Div P. On the slave, whose outward normal N is minus the last axis, the deformed normal is along
m = cof(F) N; the traction P N has the part -p m / |m| that contact gives, of nominal pressure p, and the rest, which is
applied as a load. In a plane, plane strain.

All that comes out is text in the grammar of the case file, which `compiled` also turns into functions; the exact
values are computed from these and never by lacsolver.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import sympy as sp
except ModuleNotFoundError:  # the cases are listed without it; `missing` is asked before one is solved
    sp = None

Texts = tuple[str, ...]
SymbolicFunction = Callable[[NDArray[np.floating]], NDArray[np.floating]]
_X = sp.symbols("x y z") if sp else ()


def missing() -> str:
    """A sentence about what is not installed, and how to get it; '' if sympy is."""
    return "" if sp else "sympy is not installed; pip install 'lacmesh[verification]' brings it"


@dataclass(frozen=True)
class Law:
    """Saint Venant-Kirchhoff: Young's modulus (stress) and Poisson's ratio."""

    young: float = 1.0
    poisson: float = 0.0


@dataclass(frozen=True)
class Sources:
    """Texts of x, y(, z): `stress` P by rows, `body_force` per undeformed volume; of the first coordinates,
    where the last is 0: `tangential`, the slave's load per undeformed area, and `pressure`, nominal, > 0 in
    compression.
    """

    stress: tuple[Texts, ...]
    body_force: Texts
    tangential: Texts
    pressure: str

    def traction(self, axis: int, side: int) -> Texts:
        """P N on the side of the block whose outward normal N is `side` (-1 or 1) times an axis."""
        return tuple(row[axis] if side > 0 else f"-({row[axis]})" for row in self.stress)


@cache
def derive(displacement: Texts, law: Law = Law()) -> Sources:
    """Loads and stress for which a displacement (texts of x, y(, z), one per component) is the solution.

    >>> derive(("0", "-y / 2")).pressure
    '3/16'
    """
    d = len(displacement)
    X = _X[:d]
    u = [_read(text) for text in displacement]
    F = sp.eye(d) + sp.Matrix(d, d, lambda i, j: sp.diff(u[i], X[j]))
    P = F * _second_stress(F, law)
    b = [-sum(sp.diff(P[i, j], X[j]) for j in range(d)) for i in range(d)]
    tangential, pressure = _on_slave(F, P, X[-1])
    stress = tuple(tuple(_text(P[i, j]) for j in range(d)) for i in range(d))
    return Sources(stress, tuple(map(_text, b)), tuple(map(str, tangential)), str(pressure))


def compiled(texts: Sequence[str]) -> SymbolicFunction:
    """Function of points (n, dim) that returns the values (n, k) of k texts of x, y(, z)."""
    columns = [sp.lambdify(_X, _read(text), "numpy", cse=True) for text in texts]

    def values(points: NDArray[np.floating]) -> NDArray[np.floating]:
        x = [*np.asarray(points, dtype=float).T, 0.0][:3]
        place = [*x, *[0.0] * (3 - len(x))]
        return np.stack([np.broadcast_to(column(*place), len(points)) for column in columns], axis=-1).astype(float)

    return values


def _read(text: str) -> Any:
    """A text as an expression whose numbers are fractions, so that nothing is rounded."""
    return sp.nsimplify(sp.sympify(text, locals=dict(zip("xyz", _X, strict=True))), rational=True)


def _second_stress(F: Any, law: Law) -> Any:
    young, nu = (sp.nsimplify(c, rational=True) for c in (law.young, law.poisson))
    one = sp.eye(F.shape[0])
    strain = (F.T * F - one) / 2
    return young / (1 + nu) * (nu / (1 - 2 * nu) * strain.trace() * one + strain)


def _on_slave(F: Any, P: Any, last: Any) -> tuple[list[Any], Any]:
    """The tangential traction and the nominal pressure where the coordinate `last` is 0."""
    N = sp.Matrix([*[0] * (F.shape[0] - 1), -1])
    m = (F.adjugate().T * N).subs(last, 0)
    traction = (P * N).subs(last, 0)
    along = traction.dot(m)
    return [sp.factor(c) for c in traction - m * along / m.dot(m)], sp.factor(-along) / sp.sqrt(sp.factor(m.dot(m)))


def _text(polynomial: Any) -> str:
    """A polynomial with as few products as nesting gives."""
    return str(sp.horner(sp.expand(polynomial)))
