"""Slaves of a sector that leave it: the part of a skin that faces the master of a neighbouring sector alone.

Contact looks for the masters of its own sector. Where bodies are cut at other angles, or slide about the axis, a part
of a slave lies in front of the master of the next sector, and has no contact there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.case import Cyclic
from lacsolver.constraints.cyclic import turn_of
from lacsolver.contact.interface import Turn
from lacsolver.doubts.run import Doubt, Run
from lacsolver.problem.pair import ContactPair

#: part of a slave's area that may face the next sector without a warning, and without a refusal: normals of flat faces
#: on a curved skin point across the side of the sector
_LITTLE, _MUCH = 1e-2, 3e-2


def beyond_sector(run: Run) -> Iterator[Doubt]:
    """Refuse undeformed slave faces that face the master of a neighbouring sector alone, or doubt a small part."""
    for pair in run.pairs:
        face = run.face(pair)
        part, words = _beyond(run, pair, face.area, face.w, np.zeros(run.space.n_dof), run.start)
        advice = "cut the sector of one body where the other one's is cut, so that their sides line up"
        message = f"{words}; {advice}, or model the whole ring"
        if part > _LITTLE:
            fatal = part > _MUCH
            yield Doubt(message if fatal else f"contact {pair.name!r}: {message}", pair.record, fatal)


def leaves_sector(run: Run) -> Iterator[Doubt]:
    """Refuse deformed slave faces that face the master of a neighbouring sector alone, or doubt a small part."""
    state = run.state
    for pair, zone in run.zones:
        if not pair.moving:
            continue
        part, words = _beyond(run, pair, zone.area, zone.area * zone.coverage, state.u, state.time)
        message = f"at time {state.time:.6g} {words}; model the whole ring"
        if part > _LITTLE:
            fatal = part > _MUCH
            text = f"{message}, or let the bodies slide less" if fatal else f"contact {pair.name!r} {message}"
            yield Doubt(text, pair.record, fatal)


def _beyond(run: Run, pair: ContactPair, area: Floats, covered: Floats, u: Floats, t: float) -> tuple[float, str]:
    """Return the part of a slave that faces the master of a neighbouring sector alone at u (n_dof,), and in words.

    `area`, `covered` (m,): of each macro-element, and what is covered of it by the master of its own sector.
    """
    neighbours = [] if isinstance(pair.record, Cyclic) else _neighbours(run)
    part, bare = 0.0, np.maximum(area - covered, 0.0)
    for turns in neighbours:
        turned = (replace(pair, pairing=replace(pair.pairing, turn=turn, friction=False)) for turn in turns)
        other = sum(one.integrate(run.space, u, t).w for one in turned)
        part = max(part, float(np.minimum(bare, other).sum() / area.sum()))
    slave, master = pair.record.slave, pair.record.master
    return part, (
        f"{100 * part:.2g} % of the area of slave {slave!r} has master {master!r} of a neighbouring sector in front of "
        "it, and none of its own: nothing joins or presses them there"
    )


def _neighbours(run: Run) -> Iterator[list[Turn]]:
    """Yield the rotations that take each sector of a case onto its neighbours."""
    for record in run.parts.case.cyclic:
        angles = [record.angle] if record.sectors == 2 else [record.angle, -record.angle]
        turns = [turn_of(record.altered(angle=angle), run.space.dim) for angle in angles]
        yield [turn._replace(centre=turn.centre - run.space.origin) for turn in turns]
