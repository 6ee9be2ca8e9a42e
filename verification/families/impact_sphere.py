"""*Spheres*: Hertz' impact (1882) of an elastic sphere on a rigid plane, axisymmetric, and a quarter of it in space."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt

import numpy as np

from verification.exact import impact as exact
from verification.families.impact_runs import CLOSED, Impact, energies, run
from verification.meshes.balls import quarter_sphere_on_wall, sphere_on_wall
from verification.records import Result, equal
from verification.solving import case_text, entry

#: steps of a contact
_STEPS = 200


def sphere(given: Impact, levels: int) -> Iterator[Result]:
    """A sphere of radius and density 1, whose approach is given. The force of a quarter counts four times."""
    speed = exact.speed_for(given.approach, 1.0, given.young, given.poisson, 1.0)
    right = exact.hertz(1.0, given.young, given.poisson, 1.0, speed)
    dt = right.duration / _STEPS
    made_of = quarter_sphere_on_wall if given.dim == 3 else sphere_on_wall
    impact = run(_text(given, speed, dt), made_of(sqrt(given.approach), 2.5 * dt * speed))
    force = np.array([m.pushes[0, 0, -1] for s in impact.solved.states if (m := s.step.motion) is not None])
    force *= 4 if given.dim == 3 else 1
    on = np.flatnonzero(force > 0)
    yield equal("largest force over Hertz'", force.max() / right.force, 1.0, given.allowed, source="Hertz 1882",
                reason="Hertz' solution is of a half-space: errors go as a / R")  # fmt: skip
    yield equal("duration over Hertz'", (on[-1] - on[0] + 1) * dt / right.duration, 1.0, max(given.allowed, 0.007),
                source="Hertz 1882", reason=f"as of the force, and a step of 1/{_STEPS}")  # fmt: skip
    yield equal("openings", float((np.diff(on) > 1).sum() + 1), 1, 0, source="one impact", reason="exact")
    narrow = given.approach < 1e-3
    why = "cells a thousand times smaller than the sphere: round-off of K u is 1e-9 of the forces"
    yield from energies(impact, 0.99, 1e-9 if narrow else CLOSED, why if narrow else "")


def _text(given: Impact, speed: float, dt: float) -> str:
    """The case of a sphere that reaches the wall in two and a half steps."""
    up = "xyz"[given.dim - 1]
    planes = [entry("displacement", group=f"{a}0", **{f"u{a}": 0.0}) for a in ("xy" if given.dim == 3 else "")]
    count = round(1.15 * _STEPS)
    return case_text(
        "3d" if given.dim == 3 else "axisymmetric",
        entry("material", young=given.young, poisson=given.poisson, density=1.0),
        entry("contact", slave="slave", master="wall"), entry("rigid", group="wall"), *planes,
        entry("initial", groups=["ball"], **{f"v{up}": -speed}), entry("dynamics", **dict(given.dynamics)),
        entry("steps", end=count * dt, count=count),
    )  # fmt: skip
