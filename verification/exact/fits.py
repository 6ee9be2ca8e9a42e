"""A shaft in a hub (Lame's fit, plane strain) that is pulled or turned: friction carries it up to mu p.

Shear that goes through from the inner radius a of the shaft to the outer radius b of the hub leaves p as it is. Pulled
along the axis, sigma_rz = tau c / r and u_z = tau c / G ln r + constant; turned, sigma_rt = tau c^2 / r^2 and
u_t = -tau c^2 / (2 G r) + angle r, with c where the two meet and tau = force / (2 pi c), or moment / (2 pi c^2), by
unit length, at most mu p. The hub's outer face stays; what the shaft's inner face moves more is slip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verification.exact.lame import Fit, Shell

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class SlidingFit:
    """A fit of a shaft `fit.within` and a hub `fit.around`, and its friction."""

    fit: Fit
    friction: float

    @property
    def bound(self) -> float:
        """The largest shear stress, mu p."""
        return self.friction * self.fit.between

    @property
    def pull_out(self) -> float:
        """Force by unit length along the axis at which the shaft slides."""
        return 2 * np.pi * self.fit.within.outer * self.bound

    @property
    def torque(self) -> float:
        """Moment by unit length at which the shaft turns."""
        return self.pull_out * self.fit.within.outer

    def pulled(self, r: Floats, shear: float, slip: float = 0.0) -> Floats:
        """u_z (n,) at radii (n,) under this stress at c; the shaft slips by `slip`, positive as the stress is.

        The stress is that on the shaft's inner face, along z: that of the hub on the shaft is its negative.
        """
        c = self.fit.within.outer
        hub = shear * c / _rigidity(self.fit.around) * np.log(self.fit.around.outer / np.maximum(r, c))
        shaft = shear * c / _rigidity(self.fit.within) * np.log(c / np.minimum(r, c)) + slip
        return np.asarray(hub + np.where(r < c, shaft, 0.0))

    def turned(self, r: Floats, shear: float, slip: float = 0.0) -> Floats:
        """u_t (n,) at radii (n,); the shaft turns by slip / c more than sticks."""
        c, b = self.fit.within.outer, self.fit.around.outer
        outer, inner = np.maximum(r, c), np.minimum(r, c)
        hub = shear * c**2 / (2 * _rigidity(self.fit.around)) * (1 / outer**2 - 1 / b**2)
        shaft = shear * c**2 / (2 * _rigidity(self.fit.within)) * (1 / inner**2 - 1 / c**2)
        return np.asarray(r * (hub + np.where(r < c, shaft + slip / c, 0.0)))


def _rigidity(shell: Shell) -> float:
    """Shear modulus."""
    return float(shell.young / (2 * (1 + shell.poisson)))


def capstan(friction: float, angle: float) -> float:
    """T2 / T1 of a thin belt around a cylinder (radians); Euler and Eytelwein."""
    return float(np.exp(friction * angle))
