"""Impacts with known solutions: elastic bars by characteristics, and Hertz' impact of a sphere.

Bars have length 1 and density 1, so that a speed of waves c is all there is to their material (lateral motion held).
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


def modulus(young: float, poisson: float) -> float:
    """Modulus of a bar that cannot move sideways.

    >>> modulus(1.0, 0.0)
    1.0
    """
    return young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))


#: displacements of the face of contact of the free bar of code_aster's sdnl111, by characteristics, at these times: two
#: equal bars of length 1 (E = 2e11, nu = 0.3, rho = 7800, lateral motion held), 1e-5 apart; the free one flies at a
#: speed of 1 against the other, which is clamped at its far end
SDNL111_TIMES = (2e-4, 4e-4, 6e-4, 8e-4, 10e-4)
SDNL111 = (-1.05e-4, -1.5542e-4, -5.542e-5, 9.916e-5, 2.9916e-4)
#: errors of code_aster's own tests at these times, per cent: sdnl111e, by continuous contact
SDNL111_CODE_ASTER = (0.0, -0.01, -0.02, -5.80, -1.93)


class HertzImpact(NamedTuple):
    """Impact of an elastic sphere of radius R on a rigid plane: largest force, its approach and its duration."""

    force: float
    approach: float
    duration: float


def hertz(radius: float, young: float, poisson: float, density: float, speed: float) -> HertzImpact:
    """Hertz' impact (1882): 15 m v^2 / 16 = E* sqrt(R) delta^2.5, F = 4/3 E* sqrt(R) delta^1.5, T = 2.943 delta / v.

    >>> hertz(1.0, 1.0, 0.0, 1.0, 0.01).approach > 0
    True
    """
    mass, stiff = 4 / 3 * pi * radius**3 * density, young / (1 - poisson**2)
    approach = (15 * mass * speed**2 / (16 * stiff * sqrt(radius))) ** 0.4
    return HertzImpact(4 / 3 * stiff * sqrt(radius) * approach**1.5, approach, 2.9432751 * approach / speed)


def speed_for(approach: float, radius: float, young: float, poisson: float, density: float) -> float:
    """Speed of a sphere whose largest approach is given."""
    mass, stiff = 4 / 3 * pi * radius**3 * density, young / (1 - poisson**2)
    return sqrt(16 * stiff * sqrt(radius) * approach**2.5 / (15 * mass))
