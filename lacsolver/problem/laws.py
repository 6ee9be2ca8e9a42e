"""Laws of materials and contacts from the [[material]], [[contact]] and [[tie]] records of a case."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from lacmesh.errors import DataError
from lacsolver.bodies.hyperelastic import NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.locking import nearly_incompressible
from lacsolver.bodies.material import Elastic, Law, Orthotropic
from lacsolver.bodies.plastic import FinitePlastic, Plastic
from lacsolver.case import Contact, Material, Tie
from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.contact.curves import Exponential, Linear, Table
from lacsolver.contact.damping import Damped
from lacsolver.contact.laws import Bilateral, ContactLaw, Tied, Unilateral
from lacsolver.space.places import wrong

_ISOTROPIC = {"elastic": Elastic, "neo_hookean": NeoHookean, "saint_venant_kirchhoff": SaintVenantKirchhoff}


def law_of(material: Material, kinematics: str = "small") -> Law:
    """Return the law that a record describes. Raises DataError for constants without positive energy.

    A nearly incompressible law, and one that yields, get mean dilatation, which applies to the cells that allow it;
    that of Saint Venant-Kirchhoff has none.
    """
    if material.law in MATERIAL_LAWS:
        density = {"density": material.density} if material.density else {}
        added: Law = _added(MATERIAL_LAWS[material.law], material.law, {**(material.constants or {}), **density})
        return added
    given = {name: getattr(material, name) for name in ("young", "poisson", "density", "expansion")}
    given["reference_temperature"] = material.reference_temperature
    if material.law == "plastic":
        assert material.hardening is not None  # the record says so
        make = FinitePlastic if kinematics == "finite" else Plastic
        return make(**given, hardening=material.hardening, kinematic=material.kinematic)
    if material.law in _ISOTROPIC:
        law: Elastic | Orthotropic = _ISOTROPIC[material.law](**given)
    else:
        assert material.shear is not None  # the record says so
        law = Orthotropic(**given, shear=material.shear, axes=material.axes)
    return replace(law, mean_dilatation=law.takes_mean and nearly_incompressible(law))


def contact_law_of(record: Contact | Tie, t: float) -> ContactLaw:
    """Return the law that a contact or a tie obeys at time t. Raises CaseError for a stiffness that is not > 0."""
    if isinstance(record, Tie):
        return Tied()
    if record.type in CONTACT_LAWS:
        added: ContactLaw = _added(CONTACT_LAWS[record.type], record.type, record.constants or {})
        missing = [name for name in vars(ContactLaw) if not name.startswith("_") and not hasattr(added, name)]
        if missing:
            raise DataError(f"the contact law {record.type!r} lacks {', '.join(missing)}; see lacsolver.contact.laws")
        return added
    stiffness = _stiffness(record, t)
    law = _soft_law(record, stiffness)
    if record.damping:
        return Damped(base=Linear(stiffness=stiffness) if stiffness else law, damping=record.damping)
    return law


def _stiffness(record: Contact, t: float) -> float | None:
    """Return the stiffness of a soft contact at time t; None for a rigid one or another law."""
    stiffness = None if record.stiffness is None else record.stiffness.at(t)
    if stiffness is not None and not stiffness > 0:
        raise wrong(record, f"stiffness is {stiffness:g} at t = {t:g}; it must be > 0")
    return stiffness


def _soft_law(record: Contact, stiffness: float | None) -> Any:
    """Return the law of a contact without its damping."""
    if record.law == "exponential":
        assert record.pressure_at_contact is not None and record.clearance_at_zero is not None  # the rules say so
        return Exponential(at_contact=record.pressure_at_contact, clearance=record.clearance_at_zero)
    if record.law == "table":
        assert record.pressures is not None
        return Table(rows=record.pressures)
    compliance = 0.0 if stiffness is None else 1 / stiffness
    return (Bilateral if record.type == "bilateral" else Unilateral)(compliance)


def _added(law: Callable[..., Any], name: str, constants: Mapping[str, float]) -> Any:
    """Return a law that a program has added. Raises DataError for constants that it does not take or that it misses."""
    try:
        return law(**constants)
    except TypeError as error:
        raise DataError(f"constants {sorted(constants)} are not those of the law {name!r}: {error}") from None
