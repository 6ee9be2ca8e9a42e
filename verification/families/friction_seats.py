"""**Seats.** A cylinder settles under its weight in a groove of 90 degrees, and a ball in a cone: it slides down the
flank, which carries it with N and mu N. So the force across is (1 - mu) / (1 + mu) times the weight. Sets of rows of
such a seat return under pivoting; all must be solved without a cutback.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from verification.meshes.friction import seated
from verification.records import Case, Outcome, equal
from verification.solving import balanced, case_text, entry, solve

RADIUS, HOLE = 10.0, 3.0
#: weight of half a cylinder of this radius, and of a ball, of 1 per volume; the volume of half of what is modelled
_WEIGHT = {"groove": np.pi / 2 * RADIUS**2, "cone": 4 / 3 * np.pi * RADIUS**3}
_PART = {"groove": 1 - (HOLE / RADIUS) ** 2, "cone": 1 - (HOLE / RADIUS) ** 3}
_MODEL = {"groove": "plane_strain", "cone": "axisymmetric"}
#: friction, slave, geometry
_SEATS = [*zip((0.2, 0.5), ("round", "flank"), ("reference", "current"), strict=True)]
_SEATS += [one for one in product((0.1, 0.2, 0.3, 0.4, 0.5), ("round", "flank"), ("reference", "current"))
           if one not in _SEATS]  # fmt: skip


def solve_seats(kind: str, *, levels: int) -> Outcome:
    """So many seats, each with skins whose faces, in the middle, are parallel where they touch."""
    results, solutions = [], []
    for friction, slave, geometry in _SEATS[:levels]:
        text = case_text(
            _MODEL[kind],
            entry("material", young=210e3, poisson=0.3),
            entry("contact", slave=slave, master={"round": "flank", "flank": "round"}[slave], friction=friction,
                  geometry=geometry),
            entry("displacement", group="base", ux=0.0, uy=0.0),
            entry("displacement", group="axis", ux=0.0),
            entry("body_force", groups=["ball"], fy=float(-1 / _PART[kind])),
            entry("steps", count=4, max_halvings=0),
        )  # fmt: skip
        one = solve(text, seated("QUAD4", 26, RADIUS, HOLE))
        zone = one.zone
        across, along = np.abs(zone.area @ (zone.pressure[:, None] * zone.normal + one.shear))
        name, ratio = f"mu {friction}, {slave} the slave, {geometry}", (1 - friction) / (1 + friction)
        results += [
            equal(f"force across over that along, {name}", float(across / along), ratio, 1e-3 * ratio,
                  source="balance on flanks of 45 degrees", reason="flanks that give way turn a little"),
            equal(f"force across, {name}", float(across), _WEIGHT[kind] * ratio, 0.005 * _WEIGHT[kind] * ratio,
                  source="balance on flanks of 45 degrees", reason="13 chords to a right angle"),
        ]  # fmt: skip
        solutions.append(one)
    return Outcome((*results, *balanced(solutions)))


def cases(family: str) -> Iterator[Case]:
    """A groove and a cone, with every slave and geometry."""
    for kind, what in (("groove", "a cylinder in a groove"), ("cone", "a ball in a cone")):
        sizes = {"quick": 2, "full": len(_SEATS)}
        yield Case(family, f"seat-{kind}", what, partial(solve_seats, kind), sizes, 10.0)
