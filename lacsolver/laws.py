"""The law of a [[material]] of the case, and which kinematics are solved."""

from __future__ import annotations

from lacmesh.errors import RequestError
from lacsolver.case import Case, CaseError, Material, Problem
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


def check_kinematics(case: Case) -> None:
    """Raises CaseError for kinematics that are not solved."""
    if case.kinematics != "small":
        message = f'kinematics = "{case.kinematics}" is not solved yet'
        raise CaseError([Problem(f'{message}; where displacements are small, take "small" and the law "elastic"')])
