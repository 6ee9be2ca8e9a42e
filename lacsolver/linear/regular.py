"""Check that a stiffness is regular: the motion of least energy, found by inverse iteration, must cost some energy.

Round-off hides a zero pivot: the factorisation of a body without support may give six pivots of 1e-16, of either sign,
and a solution of noise. So the factor is tested. In the scaling D = diag K, which is independent of units, one step of
inverse iteration from a random vector approaches the least eigenvalue of K v = E D v; if E is small, two more steps
settle it. K is singular to round-off if E = v.Kv is below the round-off of its own terms, eps |v|.|K||v|. A slender
beam, a stiff inclusion or a weak spring stays far above that (1e-12 for a beam of 1,000 cells in a row), a free body
far below (1e-17). The check costs one solve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lacmesh.errors import DataError
from lacmesh.mesh import Floats
from lacsolver.linear.accuracy import Matrix
from lacsolver.linear.errors import SingularError

#: energies (relative to D) above this need no further check
CLEAR = 1e-10
_STEPS = 3


def positive_diagonal(K: Matrix) -> Floats:
    """Return the diagonal (n,). Raises SingularError for one that is not positive, DataError for entries not finite."""
    d = K.diagonal()
    if not np.isfinite(K.data).all():
        row = int(np.flatnonzero(~np.isfinite(abs(K) @ np.ones(len(d))))[0])
        raise DataError(f"the stiffness has an entry that is no number, in row {row}; look at the material there")
    if (d <= 0).any():
        row = int(d.argmin())
        raise singular(dof=row) if d[row] == 0 else indefinite(row)
    return d


def least_motion(K: Matrix, d: Floats, solve: Callable[[Floats], Floats], clear: float = CLEAR) -> Floats:
    """Return the motion v (n,) of least energy v.Kv with v.Dv = 1, or the first iterate with an energy above `clear`.

    d: the diagonal of K.
    """
    s = 1 / np.sqrt(d)
    y = np.random.default_rng(1).normal(size=len(d))
    for _ in range(_STEPS):
        v = solve(y / s)
        v /= np.abs(v / s).max()  # first, so that the norm does not overflow
        v /= np.linalg.norm(v / s)
        if v @ (K @ v) > clear:
            break
        y = v / s
    return v


def check_regular(K: Matrix, d: Floats, solve: Callable[[Floats], Floats]) -> None:
    """Raise SingularError if some motion costs no energy, to round-off, or a negative one."""
    if not len(d):
        return
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        v = least_motion(K, d, solve)
    if not np.isfinite(v).all():
        raise singular(dof=int(np.flatnonzero(~np.isfinite(v))[0]))
    if v @ (K @ v) < CLEAR and is_free(K, v):
        raise singular(mode=v)


def is_free(K: Matrix, v: Floats) -> bool:
    """True if a motion costs no energy, to the round-off of the terms whose sum is its energy."""
    size = np.abs(v)
    terms = size @ (abs(K) @ size)
    return bool(v @ (K @ v) < np.finfo(float).eps * terms)


def singular(mode: Floats | None = None, dof: int | None = None) -> SingularError:
    """Return the error for a free motion, scaled to a largest entry of 1, or for a row."""
    if mode is not None:
        dof = int(np.abs(mode).argmax())
        mode = mode / mode[dof]
    where = "" if dof is None else f", most of all unknown {dof}"
    message = f"the stiffness is singular: something can move{where}, without any force"
    return SingularError(f"{message}; hold it by a displacement, a spring or contact", dof, mode)


def indefinite(dof: int | None = None) -> SingularError:
    """Return the error for a negative stiffness."""
    where = "" if dof is None else f", seen at unknown {dof}"
    message = f"the stiffness is not positive definite{where}"
    return SingularError(f"{message}; look for a negative modulus, a wrong material or an inverted cell", dof)
