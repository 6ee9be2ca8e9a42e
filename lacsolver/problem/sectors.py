"""Slaves of a sector that leave it: the part of a skin that faces the master of a neighbouring sector alone.

Contact looks for the masters of its own sector. Where bodies are cut at other angles, or slide about the axis, a part
of a slave lies in front of the master of the next sector, and has no contact there.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lacmesh.errors import LacmeshWarning
from lacmesh.mesh import Floats
from lacsolver.case import Case, Cyclic
from lacsolver.constraints.cyclic import turn_of
from lacsolver.contact.interface import Interface, Turn
from lacsolver.problem.pair import ContactPair
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: part of a slave's area that may face the next sector without a warning, and without a refusal: normals of flat faces
#: on a curved skin point across the side of the sector
_LITTLE, _MUCH = 1e-2, 3e-2


def check_in_sector(case: Case, pair: ContactPair, face: Interface, space: Space) -> None:
    """Raise CaseError where undeformed slave faces of a sector face the master of a neighbouring sector alone.

    Warn where they are a small part.
    """
    part, words = beyond_sector(case, pair, face, space, np.zeros(space.n_dof))
    advice = "cut the sector of one body where the other one's is cut, so that their sides line up"
    message = f"{words}; {advice}, or model the whole ring"
    if part > _MUCH:
        raise wrong(pair.record, message)
    if part > _LITTLE:
        warnings.warn(LacmeshWarning(f"contact {pair.name!r}: {message}"), stacklevel=4)


def leaves_sector(case: Case, pair: ContactPair, face: Interface, space: Space, u: Floats) -> str:
    """Return a warning where slave faces at u (n_dof,) face the master of a neighbouring sector alone, or ""."""
    part, words = beyond_sector(case, pair, face, space, u)
    return f"{words}; model the whole ring" if part > _LITTLE else ""


def beyond_sector(case: Case, pair: ContactPair, face: Interface, space: Space, u: Floats) -> tuple[float, str]:
    """Return the part of a slave that faces the master of a neighbouring sector alone at u (n_dof,), and in words."""
    neighbours = [] if isinstance(pair.record, Cyclic) else _neighbours(case, space)
    part = max((_part_beyond(pair, face, space, u, turns) for turns in neighbours), default=0.0)
    slave, master = pair.record.slave, pair.record.master
    return part, (
        f"{100 * part:.2g} % of the area of slave {slave!r} has master {master!r} of a neighbouring sector in front of "
        "it, and none of its own: nothing joins or presses them there"
    )


def _neighbours(case: Case, space: Space) -> Iterator[list[Turn]]:
    """Yield the rotations that take each sector of a case onto its neighbours."""
    for record in case.cyclic:
        angles = [record.angle] if record.sectors == 2 else [record.angle, -record.angle]
        turns = [turn_of(record.altered(angle=angle), space.dim) for angle in angles]
        yield [turn._replace(centre=turn.centre - space.origin) for turn in turns]


def _part_beyond(pair: ContactPair, face: Interface, space: Space, u: Floats, turns: list[Turn]) -> float:
    """Return the part of a slave's area that is not covered in its sector, and would be in the neighbouring ones."""
    other = np.zeros_like(face.w)
    for turn in turns:
        turned = replace(pair, pairing=replace(pair.pairing, turn=turn, friction=False))
        other += turned.integrate(space, u, face.t).w
    return float(np.minimum(np.maximum(face.area - face.w, 0.0), other).sum() / face.area.sum())
