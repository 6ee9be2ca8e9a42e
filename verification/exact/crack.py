"""A closed crack in a plane under compression, in plane strain, whose faces slide: Phan et al. 2003.

Phan, Napier, Gray, Kaplan, Int. J. Numer. Meth. Eng. 57, 2003, 835. The crack |x| < a on y = 0, the stress `load`
pressed along a direction at `angle` to it. Normal and shear stress on its line are those of the uncracked plane,

    sigma_n = load sin^2(angle),   tau = load sin(angle) cos(angle)

and friction carries mu sigma_n of it; the rest, tau_e, opens nothing and slides the faces as a crack of mode II
(Westergaard; Tada, Paris, Irwin, The stress analysis of cracks handbook), with Z = tau_e (z / root - 1),
root = sqrt(z^2 - a^2), and its integral Y = tau_e (root - z):

    2 G u_x = 2 (1 - nu) Im Y + y Re Z,   2 G u_y = -(1 - 2 nu) Re Y - y Im Z
    slip = 4 (1 - nu^2) / E tau_e sqrt(a^2 - x^2)

The upper face moves to +x if tau > 0: pressed along the direction (cos(angle), -sin(angle)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Crack:
    """The crack, its friction and the load. `angle`: degrees; `young`, `load`: stress."""

    young: float = 25e3
    poisson: float = 0.25
    load: float = 100.0
    angle: float = 20.0
    friction: float = 0.5774
    half_length: float = 1.0

    @property
    def pressure(self) -> float:
        """sigma_n between the faces."""
        return float(self.load * np.sin(np.radians(self.angle)) ** 2)

    @property
    def shear(self) -> float:
        """Shear stress that friction carries."""
        return self.friction * self.pressure

    @property
    def left(self) -> float:
        """tau_e, what friction does not carry."""
        return float(self.load * np.sin(np.radians(2 * self.angle)) / 2 - self.shear)

    def slip(self, x: Floats) -> Floats:
        """Slip (n,) of the upper face along x at places (n,)."""
        most = 4 * (1 - self.poisson**2) / self.young * self.left
        return np.asarray(most * np.sqrt(np.maximum(self.half_length**2 - x**2, 0.0)))

    def displacement(self, x: Floats) -> Floats:
        """Displacement (n, 2) at points (n, 2), y = 0 from above; the middle of the crack stays on its line."""
        z = x[:, 0] + 1j * np.where(x[:, 1] == 0, 1e-300, x[:, 1])
        root = np.sqrt(z - self.half_length) * np.sqrt(z + self.half_length)
        Y, Z = self.left * (root - z), self.left * (z / np.where(root == 0, 1e-300, root) - 1)
        nu, y = self.poisson, x[:, 1]
        opened = np.stack([2 * (1 - nu) * Y.imag + y * Z.real, -(1 - 2 * nu) * Y.real - y * Z.imag], axis=1)
        return np.asarray(opened * (1 + nu) / self.young + x @ self.strain.T)

    @property
    def strain(self) -> Floats:
        """Strain (2, 2) of the plane without crack."""
        way = np.array([np.cos(np.radians(self.angle)), -np.sin(np.radians(self.angle))])
        stress = -self.load * np.outer(way, way)
        nu = self.poisson
        return np.asarray((1 + nu) / self.young * (stress - nu * np.trace(stress) * np.eye(2)))
