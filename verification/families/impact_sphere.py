"""*Spheres*: Hertz' impact (1882) of an elastic sphere on a rigid plane, axisymmetric, and a quarter of it in space.

Hertz' sphere gives way as a half-space does. A sphere of finite size is stiffer, by a part of order a / R, which the
linear solution of the sphere under Hertz' pressure gives without any contact.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sqrt

import numpy as np

from verification.exact import impact as exact
from verification.families.impact_runs import CLOSED, Impact, energies, run
from verification.measures.norms import points_of
from verification.meshes.balls import quarter_sphere_on_wall, sphere_on_wall
from verification.records import Result, equal
from verification.solving import case_text, entry, solve

#: steps of a contact
_STEPS = 200
#: error of the largest force that meshes of ten cells a radius of the contact leave
_MESH = 2e-4


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
    yield equal("largest force over Hertz'", force.max() / right.force, finite(given), given.approach + _MESH,
                source="Hertz 1882, and the linear solution of a finite sphere, to first order in a / R",
                reason=f"errors of second order, (a / R)^2, and {_MESH:g} of the meshes")  # fmt: skip
    yield equal("duration over Hertz'", (on[-1] - on[0] + 1) * dt / right.duration, 1.0, max(given.allowed, 0.007),
                source="Hertz 1882",
                reason=f"Hertz' solution is of a half-space: errors go as a / R; a step of 1/{_STEPS}")  # fmt: skip
    yield equal("openings", float((np.diff(on) > 1).sum() + 1), 1, 0, source="one impact", reason="exact")
    narrow = given.approach < 1e-3
    why = "cells a thousand times smaller than the sphere: round-off of K u is 1e-9 of the forces"
    yield from energies(impact, 0.99, 1e-9 if narrow else CLOSED, why if narrow else "")


def finite(given: Impact) -> float:
    """The largest force of a finite sphere over that of Hertz' solution, to first order in a / R.

    Under Hertz' pressure p0 of radius a and the body force that balances it the sphere's contact approaches its centre
    of mass by less than a half-space's by c F / (E R), in the mean weighted by p0. As p0 is stationary, the energy at
    an approach grows by c F^2 / (2 E R); at a given energy the force grows by a part of c (a / R) / (1 - nu^2).
    """
    contact, young, nu = sqrt(given.approach), 1e4, given.poisson  # so stiff that displacements are small
    force = 2 / 3 * pi * contact**2
    mesh = sphere_on_wall(contact, 1e-9, 16)
    top = float(mesh.points[:, 1].max())
    solved = solve(
        case_text(
            "axisymmetric",
            entry("material", young=young, poisson=nu),
            entry("traction", group="slave", ty=f"sqrt(max(0, 1 - (x / {contact!r})**2))"),
            entry("body_force", groups=["ball"], fy=-force / (4 / 3 * pi)),
            entry("displacement", at=[0.0, top], uy=0.0), entry("rigid", group="wall"),
        ), mesh,
    )  # fmt: skip
    mesh, u = solved.mesh, solved.u[:, 1]
    points = {name: tuple(points_of(mesh, mesh.cell_groups[name], axisymmetric=True)) for name in ("ball", "slave")}
    ball, skin = ([(p, np.einsum("pn,kn->kp", p.N, u[p.nodes])) for p in points[name]] for name in points)
    centre = sum((p.w * v).sum() for p, v in ball) / sum(p.w.sum() for p, _ in ball)
    loss, weight = 0.0, 0.0
    for p, v in skin:
        inside = np.maximum(0.0, 1 - (p.x[..., 0] / contact) ** 2)
        half_space = pi * contact * (1 + inside) * (1 - nu**2) / (4 * young)
        w = p.w * np.sqrt(inside)
        loss, weight = loss + (w * (half_space - v + centre)).sum(), weight + w.sum()
    return 1 + loss / weight * young / force * contact / (1 - nu**2)


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
