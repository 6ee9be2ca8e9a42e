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

Nearly incompressible bodies lock in linear cells: the volume is constrained at each integration point of a cell, and
the nodes have too few degrees of freedom for that. With `mean_dilatation` a linear cell of several points (QUAD4,
HEXA8, PENTA6, PYRAM5) has one constraint, on the mean of J over the cell (`dilatation`). TRIA3 and TETRA4 have one
point, so that nothing is gained; quadratic cells do not need it.

Thermal expansion splits F = F_e theta, theta = 1 + expansion (T - T0). The energy above is a function of F_e, per
volume of the warm, stress-free body: W = theta^3 W_e(F / theta).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.space.space import Space

#: codes of the laws in kernels; cells of laws that are evaluated at points are left out there
POINTWISE, KIRCHHOFF, NEO_HOOKEAN = -1, 0, 1
#: Poisson's ratio above which linear cells are too stiff to be trusted
LOCKING = 0.45


@dataclass(frozen=True)
class SaintVenantKirchhoff(Elastic):
    """Linear in the Green-Lagrange strain: S = lambda tr E I + 2 mu E. Raises DataError as `Elastic` does."""

    finite = True


@dataclass(frozen=True)
class NeoHookean(Elastic):
    """Compressible rubber: S = mu (I - C^-1) + lambda ln J C^-1. Raises DataError as `Elastic` does.

    `mean_dilatation`: True if linear cells of several points use the mean of J over the cell; see the module.
    """

    mean_dilatation: bool = False

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
    codes, lame, mean = [], [], []
    for law in materials.laws:
        pointwise = hasattr(law, "respond")
        if not (isinstance(law, (SaintVenantKirchhoff, NeoHookean)) or (pointwise and getattr(law, "finite", False))):
            message = f"the law {type(law).__name__} is for small strains"
            raise RequestError(f"{message}; finite kinematics take saint_venant_kirchhoff or neo_hookean")
        codes.append(POINTWISE if pointwise else NEO_HOOKEAN if isinstance(law, NeoHookean) else KIRCHHOFF)
        lame.append(law.lame if isinstance(law, Elastic) else (0.0, 0.0))
        mean.append(isinstance(law, NeoHookean) and law.mean_dilatation)
    return Constants(np.array(codes), np.array(lame), np.array(mean))


def may_take_the_mean(space: Space, block: int) -> bool:
    """True if mean dilatation applies to a block: linear cells of several points, and not plane stress.

    Plane stress does not lock, since the strain across the plane is free.
    """
    cell = CELLS[space.blocks[block].type]
    return cell.order == 1 and cell.family not in ("TRIA", "TETRA") and not space.model.plane_stress


def locking(space: Space, materials: Materials) -> tuple[str, ...]:
    """Return a warning for each nearly incompressible law that makes linear cells too stiff to be trusted."""
    told = []
    for k, law in enumerate(materials.laws):
        if not isinstance(law, Elastic) or law.poisson <= LOCKING or space.model.plane_stress:
            continue
        mean = isinstance(law, NeoHookean) and law.mean_dilatation
        stiff = [
            block.type
            for number, (block, which) in enumerate(zip(space.blocks, materials.law, strict=True))
            if CELLS[block.type].order == 1 and (which == k).any() and not (mean and may_take_the_mean(space, number))
        ]
        if stiff:
            message = f"poisson = {law.poisson:g} makes linear cells ({', '.join(stiff)}) far too stiff: they lock"
            told.append(f"{message}; mesh that body with quadratic cells, or take poisson = {LOCKING} or less")
    return tuple(told)
