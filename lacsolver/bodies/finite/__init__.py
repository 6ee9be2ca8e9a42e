"""Bodies at finite strains, in the undeformed configuration (total Lagrangian).

laws = hyperelastic energies                                        (laws)
stress and terms of the tangent of a law at a point                 (point)
f_int(u) and K(u), summed directly into a vector and block-CSR      (equations)
stress, energy and thermal stretch at integration points            (fields)
"""

from lacsolver.bodies.finite.equations import internal_force, tangent
from lacsolver.bodies.finite.errors import InadmissibleError
from lacsolver.bodies.finite.fields import cauchy_stress, energy, thermal_stretches
from lacsolver.bodies.finite.laws import NeoHookean, SaintVenantKirchhoff

__all__ = [
    "InadmissibleError",
    "NeoHookean",
    "SaintVenantKirchhoff",
    "cauchy_stress",
    "energy",
    "internal_force",
    "tangent",
    "thermal_stretches",
]
