"""Small strains: stiffness, strain and stress at integration points, internal forces.

K = int L^T A L, summed directly into block-CSR                (stiffness)
strain and stress at the same points, and f_int from stress    (fields)
"""

from lacsolver.bodies.small.fields import (
    displacement,
    internal_force,
    points,
    strain,
    stress,
    weights,
)
from lacsolver.bodies.small.stiffness import assemble_stiffness, stiffness_values

__all__ = [
    "assemble_stiffness",
    "displacement",
    "internal_force",
    "points",
    "stiffness_values",
    "strain",
    "stress",
    "weights",
]
