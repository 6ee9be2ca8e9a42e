"""Laws of finite strains: hyperelastic, isotropic, with the constants of `Elastic`.

For small strains they agree with `Elastic`.

| law | energy per reference volume |
|---|---|
| Saint Venant-Kirchhoff | lambda/2 (tr E)^2 + mu E:E |
| neo-Hookean, compressible | mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2 |

F = I + du/dX, C = F^T F, E = (C - I)/2, J = det F. The neo-Hookean law is that of Bonet and Wood, Nonlinear continuum
mechanics for finite element analysis, 1997, section 5.4.3: of the several laws of that name, one whose stress is
unbounded in compression, J -> 0, and that needs no constants beyond young and poisson. Saint Venant-Kirchhoff softens
in compression (the force in a bar is largest at a length of 1/sqrt 3 = 58 % and 0 at a length of 0): it is meant for
large rotations with small strains.

Nearly incompressible bodies lock in linear cells (`bodies.locking`). With `mean_dilatation` a linear cell of several
points of neo-Hookean law has one constraint, on the mean of J over the cell (`dilatation`).

Thermal expansion splits F = F_e theta, theta = 1 + expansion (T - T0). The energy above is a function of F_e, per
volume of the warm, stress-free body: W = theta^3 W_e(F / theta).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.material import Elastic, Materials

#: codes of the laws in kernels; cells of laws that are evaluated at points are left out there
POINTWISE, KIRCHHOFF, NEO_HOOKEAN = -1, 0, 1


@dataclass(frozen=True)
class SaintVenantKirchhoff(Elastic):
    """Linear in the Green-Lagrange strain: S = lambda tr E I + 2 mu E. Raises DataError as `Elastic` does.

    It has no mean dilatation.
    """

    finite = True
    takes_mean = False


@dataclass(frozen=True)
class NeoHookean(Elastic):
    """Compressible rubber: S = mu (I - C^-1) + lambda ln J C^-1. Raises DataError as `Elastic` does."""

    finite = True


class Constants(NamedTuple):
    """Constants of the laws for kernels, one row per law.

    `kind` (laws,): code of the law; `lame` (laws, 2): lambda and mu; `mean` (laws,): True for mean dilatation.
    """

    kind: Ints
    lame: Floats
    mean: NDArray[np.bool_]


def constants(materials: Materials) -> Constants:
    """Return the constants of the materials' laws. Raises RequestError for a law of small strains."""
    codes, lame = [], []
    for law in materials.laws:
        pointwise = hasattr(law, "respond")
        if not (isinstance(law, (SaintVenantKirchhoff, NeoHookean)) or (pointwise and getattr(law, "finite", False))):
            message = f"the law {type(law).__name__} is for small strains"
            raise RequestError(f"{message}; finite kinematics take saint_venant_kirchhoff or neo_hookean")
        codes.append(POINTWISE if pointwise else NEO_HOOKEAN if isinstance(law, NeoHookean) else KIRCHHOFF)
        lame.append(law.lame if isinstance(law, Elastic) else (0.0, 0.0))
    return Constants(np.array(codes), np.array(lame), materials.mean)
