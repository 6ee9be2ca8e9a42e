"""Impacts with known solutions: elastic bars by characteristics, Hertz' impact of a sphere, and its oblique impact.

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


def rebound(
    slip: float, friction: float, poisson: float, *, springs: int = 400, steps: int = 8000
) -> tuple[float, float]:
    """Normal and tangential velocity change of an elastic sphere that hits a rigid plane at a normal speed of 1.

    `slip`: velocity along the plane of the sphere's point that touches first. The second is the impulse of friction
    over the sphere's mass, against the slip. By the reduction to one dimension (Popov and Hess 2015), which has the
    same forces as Hertz', Cattaneo's and Mindlin's contact: springs side by side, E* dx and 4 G / (2 - nu) dx, under a
    profile x^2 / R, each of which sticks or slides for itself. R, E and the density are 1, the speed is small.

    >>> [round(float(v), 3) for v in rebound(5.0, 0.1, 0.3)]  # it slides all the time: mu (1 + e)
    [2.0, 0.2]
    """
    speed = speed_for(1e-4, 1.0, 1.0, poisson, 1.0)
    at = hertz(1.0, 1.0, poisson, 1.0, speed)
    dt, mass, reach = at.duration / steps, 4 / 3 * pi, 1.1 * sqrt(at.approach)
    x = (np.arange(springs) + 0.5) * reach / springs  # of one side; the other is the same
    normal = 2 * reach / springs / (1 - poisson**2)
    tangential = 2 * reach / springs * 2 / ((1 + poisson) * (2 - poisson))  # 4 G / (2 - nu) with E = 1
    depth, down, along, u = 0.0, speed, slip * speed, np.zeros(springs)
    impulse = 0.0
    while depth >= 0:
        depth += down * dt
        pressed = normal * np.maximum(depth - x**2, 0.0)
        bound = friction * pressed / tangential
        u = np.clip(u + along * dt, -bound, bound)
        down -= pressed.sum() / mass * dt
        impulse += (pull := tangential * u.sum() / mass * dt)
        along -= 3.5 * pull  # 1 / m + R^2 / I, I = 2/5 m R^2
    return (speed - down) / speed, impulse / speed
