"""Balance of the contact forces on slave and master."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


class Balance(NamedTuple):
    """Largest components of the resultant force and moment, each relative to the sum of the magnitudes."""

    force: float
    moment: float


def unbalanced(x: Floats, force: Floats, *, axisymmetric: bool = False) -> Balance:
    """Balance of forces (n, d) that act at x (n, 3), with moments about the mean of the loaded nodes.

    In axisymmetry radial forces and moments are in balance by themselves: only the axial forces are summed.

    >>> unbalanced(np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.0, 1], [0, -1]]))
    Balance(force=0.0, moment=1.0)
    """
    f = np.zeros((len(force), 3))
    f[:, : force.shape[1]] = force
    pushed = np.abs(f).sum(axis=1) > 0
    if not pushed.any():
        return Balance(0.0, 0.0)
    if axisymmetric:
        axial = np.abs(f[:, 1]).sum()
        return Balance(float(abs(f[:, 1].sum()) / axial) if axial else 0.0, 0.0)
    arm = x - x[pushed].mean(axis=0)
    moment_arm = (np.linalg.norm(arm, axis=1) * np.linalg.norm(f, axis=1)).sum()
    moments = np.cross(arm, f).sum(axis=0)
    return Balance(float(np.abs(f.sum(axis=0)).max() / np.abs(f).sum()), float(np.abs(moments).max() / moment_arm))
