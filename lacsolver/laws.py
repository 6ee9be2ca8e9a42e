"""The law of a [[material]] of the case, and which kinematics are solved."""

from __future__ import annotations

from lacsolver.case import Case, CaseError, Material, Problem
from lacsolver.finite.laws import LOCKING, NeoHookean, SaintVenantKirchhoff
from lacsolver.material import Elastic, Law, Orthotropic

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


def check_kinematics(case: Case) -> None:
    """Raises CaseError for kinematics that are not solved."""
    if case.kinematics != "small":
        message = f'kinematics = "{case.kinematics}" is not solved yet'
        raise CaseError([Problem(f'{message}; where displacements are small, take "small" and the law "elastic"')])
