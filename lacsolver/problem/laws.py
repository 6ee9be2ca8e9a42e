"""Laws from the [[material]] records of a case."""

from __future__ import annotations

from lacsolver.bodies.finite.laws import LOCKING, NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.material import Elastic, Law, Orthotropic
from lacsolver.case import Material

_ISOTROPIC = {"elastic": Elastic, "saint_venant_kirchhoff": SaintVenantKirchhoff}


def law_of(material: Material) -> Law:
    """Return the law that a record describes. Raises DataError for constants without positive energy.

    A nearly incompressible neo-Hookean law gets mean dilatation, which applies to the cells that allow it.
    """
    given = {name: getattr(material, name) for name in ("young", "poisson", "density", "expansion")}
    given["reference_temperature"] = material.reference_temperature
    if material.law == "neo_hookean":
        return NeoHookean(**given, mean_dilatation=given["poisson"] > LOCKING)
    if material.law in _ISOTROPIC:
        return _ISOTROPIC[material.law](**given)
    assert material.shear is not None  # the record says so
    return Orthotropic(**given, shear=material.shear, axes=material.axes)
