"""Laws that a program adds to those that lacsolver comes with, by the names that a case file calls them by.

    MATERIAL_LAWS["mooney_rivlin"] = MooneyRivlin          law = "mooney_rivlin", constants = { c10 = 0.5, c01 = 0.1 }
    CONTACT_LAWS["bond"] = Bond                            type = "bond", constants = { strength = 2.0 }

Each is called with the record's `constants`, and with the density of a material that has one, as keyword arguments.
What a law has to provide: `lacsolver.bodies.material.PointLaw`, `lacsolver.contact.laws.ContactLaw`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

#: laws of materials
MATERIAL_LAWS: dict[str, Callable[..., Any]] = {}
#: laws of contacts
CONTACT_LAWS: dict[str, Callable[..., Any]] = {}
