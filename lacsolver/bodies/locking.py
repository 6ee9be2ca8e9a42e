"""Locking of bodies that hardly change their volume: laws by which linear cells lock, and cells with mean dilatation.

A linear cell has a constraint of volume at each of its integration points, and too few degrees of freedom for that.
With mean dilatation a linear cell of several points (QUAD4, HEXA8, PENTA6, PYRAM5) has one, on the mean of the change
of volume over the cell: `bodies.small` for the linear laws, `bodies.dilatation` for the neo-Hookean law and for metals
that yield, which keep their volume as they flow, whatever their Poisson's ratio. TRIA3 and TETRA4 have one point, so
that nothing is gained; PENTA6 and PYRAM5 gain, but there may still be too many of them for their nodes: a prism in
plane strain across its axis is a TRIA3.
"""

from __future__ import annotations

from lacmesh.cells import CELLS
from lacsolver.bodies.material import Elastic, Law, Orthotropic
from lacsolver.bodies.plastic import Plastic
from lacsolver.space.space import Space

#: Poisson's ratio above which linear cells are too stiff to be trusted
LOCKING = 0.45
#: tolerance of a Poisson's ratio that is computed from other constants
ROUNDING = 1e-9


def poisson_of(law: Law) -> float | None:
    """Return the Poisson's ratio by which a law is judged, that of its averages if it is orthotropic; None if unknown.

    >>> wood = Orthotropic((11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06))
    >>> poisson_of(Elastic(1.0, 0.49)), round(poisson_of(wood), 3)
    (0.49, 0.287)
    """
    if isinstance(law, Orthotropic):
        return law.equivalent_poisson
    return law.poisson if isinstance(law, Elastic) else None


def nearly_incompressible(law: Law) -> bool:
    """True for a law by which linear cells lock: Poisson's ratio above `LOCKING`, or flow that keeps the volume."""
    if isinstance(law, Plastic):
        return True
    poisson = poisson_of(law)
    return poisson is not None and poisson > LOCKING + ROUNDING * isinstance(law, Orthotropic)


def may_take_the_mean(space: Space, block: int) -> bool:
    """True if mean dilatation applies to a block: linear cells of several points, and not plane stress.

    Plane stress does not lock, since the strain across the plane is free.
    """
    cell = CELLS[space.blocks[block].type]
    return cell.order == 1 and cell.family not in ("TRIA", "TETRA") and not space.model.plane_stress
