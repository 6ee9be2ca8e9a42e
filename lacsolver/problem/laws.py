"""Laws of materials and contacts from the [[material]], [[contact]] and [[tie]] records of a case."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lacmesh.errors import DataError
from lacsolver.bodies.finite.laws import LOCKING, NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.material import Elastic, Law, Orthotropic
from lacsolver.case import Contact, Material, Tie
from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.contact.laws import Bilateral, ContactLaw, Tied, Unilateral

_ISOTROPIC = {"elastic": Elastic, "saint_venant_kirchhoff": SaintVenantKirchhoff}


def law_of(material: Material) -> Law:
    """Return the law that a record describes. Raises DataError for constants without positive energy.

    A nearly incompressible neo-Hookean law gets mean dilatation, which applies to the cells that allow it.
    """
    if material.law in MATERIAL_LAWS:
        density = {"density": material.density} if material.density else {}
        made: Law = _added(MATERIAL_LAWS[material.law], material.law, {**(material.constants or {}), **density})
        return made
    given = {name: getattr(material, name) for name in ("young", "poisson", "density", "expansion")}
    given["reference_temperature"] = material.reference_temperature
    if material.law == "neo_hookean":
        return NeoHookean(**given, mean_dilatation=given["poisson"] > LOCKING)
    if material.law in _ISOTROPIC:
        return _ISOTROPIC[material.law](**given)
    assert material.shear is not None  # the record says so
    return Orthotropic(**given, shear=material.shear, axes=material.axes)


def contact_law_of(record: Contact | Tie) -> ContactLaw:
    """Return the law that a contact or a tie obeys."""
    if isinstance(record, Tie):
        return Tied()
    if record.type in CONTACT_LAWS:
        made: ContactLaw = _added(CONTACT_LAWS[record.type], record.type, record.constants or {})
        missing = [name for name in vars(ContactLaw) if not name.startswith("_") and not hasattr(made, name)]
        if missing:
            raise DataError(f"the contact law {record.type!r} lacks {', '.join(missing)}; see lacsolver.contact.laws")
        return made
    compliance = 0.0 if record.stiffness is None else 1 / record.stiffness
    return (Bilateral if record.type == "bilateral" else Unilateral)(compliance)


def _added(law: Callable[..., Any], name: str, constants: Mapping[str, float]) -> Any:
    """Return a law that a program has added. Raises DataError for constants that it does not take or that it misses."""
    try:
        return law(**constants)
    except TypeError as error:
        raise DataError(f"constants {sorted(constants)} are not those of the law {name!r}: {error}") from None
