"""The law of a [[material]] of the case."""

from __future__ import annotations

from lacsolver.bodies.finite.laws import LOCKING, NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.material import Elastic, Law, Orthotropic
from lacsolver.case import Material

_ISOTROPIC = {"elastic": Elastic, "saint_venant_kirchhoff": SaintVenantKirchhoff}


def law_of(material: Material) -> Law:
    """The law that a record describes. Raises DataError for constants that store no energy.

    A neo-Hookean law that is nearly incompressible takes mean dilatation, where cells allow.
    """
    given = {name: getattr(material, name) for name in ("young", "poisson", "density", "expansion")}
    given["reference_temperature"] = material.reference_temperature
    if material.law == "neo_hookean":
        return NeoHookean(**given, mean_dilatation=given["poisson"] > LOCKING)
    if material.law in _ISOTROPIC:
        return _ISOTROPIC[material.law](**given)
    assert material.shear is not None  # the record says so
    return Orthotropic(**given, shear=material.shear, axes=material.axes)
