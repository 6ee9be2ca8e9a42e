"""Resultants of loads: of each record of the case, the sum of its forces, of the whole thickness or circle."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.bodies.material import Materials
from lacsolver.case import Case
from lacsolver.case.entry import Entry
from lacsolver.problem import acting
from lacsolver.space.places import where_of
from lacsolver.space.space import Space

#: sections whose records are loads, each evaluated by itself
LOADS = ("pressure", "traction", "force", "body_force", "temperature")
#: component of a resultant, relative to the sum of the sizes of its forces, that is round-off
_ROUNDING = 1e-12


class Resultant(NamedTuple):
    """Sum of the forces of one load: its `section` of the case, `where` it acts, and its `force` (dim,).

    Where axisymmetric, the force along x is the sum of the radial forces of the full circle.
    """

    section: str
    where: str
    force: tuple[float, ...]


def each_load(case: Case) -> Iterator[tuple[Entry, Case]]:
    """Yield each load of a case, and the case with this load alone."""
    none: dict[str, Any] = {**dict.fromkeys(LOADS, ()), "gravity": None}
    bare = replace(case, **none)
    for name in LOADS:
        for record in getattr(case, name):
            only: dict[str, Any] = {name: (record,)}
            yield record, replace(bare, **only)
    if case.gravity is not None:
        yield case.gravity, replace(bare, gravity=case.gravity)


def resultants(
    space: Space, materials: Materials, case: Case, t: float, *, u: Floats | None = None,
    weight: Callable[[Floats], Floats] | None = None,
) -> tuple[Resultant, ...]:  # fmt: skip
    """Return the resultants of all loads at time t but temperatures, whose forces are in balance.

    `u`, `weight`: as for `acting.load`. Springs, supports and forces on rigid bodies are no loads here.
    """
    out = []
    for record, alone in each_load(replace(case, temperature=())):
        f = space.own(acting.load(space, materials, alone, t, u=u, weight=weight))
        sums = space.share.total(np.stack([f.sum(axis=0), np.abs(f).sum(axis=0)]))
        force = np.where(np.abs(sums[0]) > _ROUNDING * sums[1].max(), sums[0], 0.0)
        out.append(Resultant(record.SECTION.name, where_of(record), tuple(force.tolist())))
    return tuple(out)
