"""The law of a [[material]] of the case."""

from __future__ import annotations

from lacmesh.errors import RequestError
from lacsolver.case import Material
from lacsolver.material import Elastic, Law, Orthotropic


def law_of(material: Material) -> Law:
    """The law that a record describes. Raises DataError for constants that store no energy."""
    given = {name: getattr(material, name) for name in ("young", "poisson", "density", "expansion")}
    given["reference_temperature"] = material.reference_temperature
    if material.law == "elastic":
        return Elastic(**given)
    if material.law == "orthotropic" and material.shear is not None:
        return Orthotropic(**given, shear=material.shear, axes=material.axes)
    raise RequestError(f'the law {material.law} belongs to kinematics = "finite"')
