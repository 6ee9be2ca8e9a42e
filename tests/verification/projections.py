"""Contact with Coulomb friction on condensed matrices by projections: a third way beside those of `exact.coulomb`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verification.exact.coulomb import Condensed

Floats = NDArray[np.floating]


def gauss_seidel(given: Condensed, *, tolerance: float = 1e-12, most: int = 100000) -> tuple[Floats, Floats]:
    """p (m,) and t (m, d - 1) by projections of one macro-element after the other (Jean and Moreau).

    Raises ArithmeticError.
    """
    m, across = given.S.shape
    A, right = given.A, given.right
    z = np.zeros(len(right))
    own = [np.concatenate([[k], m + across * k + np.arange(across)]) for k in range(m)]
    blocks = [A[np.ix_(rows, rows)] for rows in own]
    steps = [(1 / B[0, 0], 1 / np.linalg.eigvalsh(B[1:, 1:])[-1]) for B in blocks]
    for sweep in range(most):
        for k, rows in enumerate(own):
            value = A[rows] @ z + right[rows]
            z[rows] = _local(blocks[k], value - blocks[k] @ z[rows], z[rows], given.friction[k], steps[k])
        if sweep % 10 == 9 and given.residual(z[:m], z[m:].reshape(m, across)) <= tolerance:
            return z[:m], z[m:].reshape(m, across)
    raise ArithmeticError("projections do not settle")


def _local(B: Floats, b: Floats, z: Floats, friction: float, steps: tuple[float, float]) -> Floats:
    """Tractions (d,) of one macro-element with the others held: some projections."""
    z = z.copy()
    for _ in range(20):
        before = z.copy()
        z[0] = max(0.0, -(b[0] + B[0, 1:] @ z[1:]) * steps[0])
        trial = z[1:] - steps[1] * (b[1:] + B[1:] @ z)
        length = np.linalg.norm(trial)
        z[1:] = trial * min(1.0, friction * z[0] / max(length, 1e-300))
        if np.abs(z - before).max() <= 1e-15 * max(np.abs(z).max(), 1e-300):
            break
    return z
