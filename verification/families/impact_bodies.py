"""Impacts of spheres, of bodies with large deformations, and motions without impact, of the family `impact`."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacsolver import natural_modes, parse_case
from lacsolver.problem.problem import Problem
from verification.exact import impact as exact
from verification.families.impact_runs import ACCOUNT, CLOSED, Bar, account, energies, run
from verification.measures.norms import points_of
from verification.meshes.balls import quarter_sphere_on_wall, sphere_on_wall
from verification.meshes.bars import WIDTH, bar, bar_on_wall
from verification.meshes.thrown import OUTER, disc, on_wall, ring, two_rings
from verification.records import Result, at_least, at_most, equal, levels_of, problem, rate
from verification.solving import Solved, case_text, contact, entry, fixed, material, model_of, solve

Floats = NDArray[np.floating]

# ---- spheres

#: Poisson's ratio of spheres, whose radius, density and Young's modulus are 1; steps of a contact; error of the largest
#: force that meshes of ten cells a radius of the contact leave
_NU, _STEPS, _MESH = 0.3, 200, 2e-4


@problem
def solve_sphere(cell: str, approach: float, allowed: float) -> Iterator[Result]:
    """Hertz' impact (1882) on a rigid plane, axisymmetric or of a quarter, whose force counts four times.

    `approach`: of the sphere's centre, over its radius; `allowed`: of the error of the duration.
    """
    dim, count = CELLS[cell].dim, round(1.15 * _STEPS)
    speed = exact.speed_for(approach, 1.0, 1.0, _NU, 1.0)
    right = exact.hertz(1.0, 1.0, _NU, 1.0, speed)
    dt = right.duration / _STEPS
    text = case_text(
        "3d" if dim == 3 else "axisymmetric", material(1.0, _NU, density=1.0), contact(master="wall"),
        entry("rigid", group="wall"), *(fixed(f"{a}0", a) for a in ("xy" if dim == 3 else "")),
        entry("initial", groups=["ball"], **{f"v{'xyz'[dim - 1]}": -speed}), entry("dynamics"),
        entry("steps", end=count * dt, count=count),
    )  # fmt: skip
    mesh = (quarter_sphere_on_wall if dim == 3 else sphere_on_wall)(sqrt(approach), 2.5 * dt * speed)
    impact = run(text, mesh)
    force = np.array([motion.pushes[0, 0, -1] for motion in impact.motions]) * (4 if dim == 3 else 1)
    on = np.flatnonzero(force > 0)
    yield equal("largest force over Hertz'", force.max() / right.force, finite(approach), approach + _MESH,
                source="Hertz 1882, and the linear solution of a finite sphere, to first order in a / R",
                reason=f"errors of second order, (a / R)^2, and {_MESH:g} of the meshes")  # fmt: skip
    yield equal("duration over Hertz'", (on[-1] - on[0] + 1) * dt / right.duration, 1.0, max(allowed, 0.007),
                source="Hertz 1882",
                reason=f"Hertz' solution is of a half-space: errors go as a / R; a step of 1/{_STEPS}")  # fmt: skip
    yield equal("openings", float((np.diff(on) > 1).sum() + 1), 1, 0, source="one impact", reason="exact")
    why = "cells a thousand times smaller than the sphere: round-off of K u is 1e-9 of the forces"
    narrow = approach < 1e-3
    yield from energies(impact, 0.99, 1e-9 if narrow else CLOSED, why if narrow else "")


def finite(approach: float) -> float:
    """The largest force of a finite sphere over that of Hertz' solution, to first order in a / R.

    Under Hertz' pressure p0 of radius a and the body force that balances it the sphere's contact approaches its centre
    of mass by less than a half-space's by c F / (E R), in the mean weighted by p0. As p0 is stationary, the energy at
    an approach grows by c F^2 / (2 E R); at a given energy the force grows by a part of c (a / R) / (1 - nu^2).
    """
    radius, young = sqrt(approach), 1e4  # so stiff that displacements are small
    force = 2 / 3 * pi * radius**2
    mesh = sphere_on_wall(radius, 1e-9, 16)
    text = case_text(
        "axisymmetric", material(young, _NU),
        entry("traction", group="slave", ty=f"sqrt(max(0, 1 - (x / {radius!r})**2))"),
        entry("body_force", groups=["ball"], fy=-force / (4 / 3 * pi)),
        entry("displacement", at=[0.0, float(mesh.points[:, 1].max())], uy=0.0), entry("rigid", group="wall"),
    )  # fmt: skip
    solved = solve(text, mesh)
    mesh, u = solved.mesh, solved.u[:, 1]
    points = {name: tuple(points_of(mesh, mesh.cell_groups[name], axisymmetric=True)) for name in ("ball", "slave")}
    ball, skin = ([(p, np.einsum("pn,kn->kp", p.N, u[p.nodes])) for p in points[name]] for name in points)
    centre = sum((p.w * v).sum() for p, v in ball) / sum(p.w.sum() for p, _ in ball)
    loss, weight = 0.0, 0.0
    for p, v in skin:
        inside = np.maximum(0.0, 1 - (p.x[..., 0] / radius) ** 2)
        half_space = pi * radius * (1 + inside) * (1 - _NU**2) / (4 * young)
        w = p.w * np.sqrt(inside)
        loss, weight = loss + (w * (half_space - v + centre)).sum(), weight + w.sum()
    return 1 + loss / weight * young / force * radius / (1 - _NU**2)


# ---- large deformations

#: kinds of bodies: cells (along half of the contact of a ball, around a ring, along an eighth of a disc), and the end
_THROWN = {"ring": (48, 1.6), "disc": (6, 0.7), "ball": (5, 1.0), "rings": (48, 1.8)}
#: way of a body to its first touch, size of a step, speed, and radius of the contact of a ball, about
_GAP, _STEP, _SPEED, _WIDE = 0.02, 0.01, 0.5, 0.4


@problem
def solve_thrown(kind: str) -> Iterator[Result]:
    """Throw a neo-Hookean body at a wall, or two rings at one another."""
    n, end = _THROWN[kind]
    starts = {"body": {"vy": -_SPEED}}
    if kind == "rings":
        mesh, starts = two_rings((n, n - 4), 2, _GAP), {"left": {"vx": _SPEED}, "right": {"vx": -_SPEED}}
    elif kind == "ball":
        mesh, starts = sphere_on_wall(_WIDE, _GAP, n), {"ball": {"vy": -_SPEED}}
    else:
        centre = 0.0, OUTER + _GAP
        mesh = on_wall(ring(n, 2, centre) if kind == "ring" else disc(n, centre))
    text = case_text(
        "axisymmetric" if kind == "ball" else "plane_strain", material(100.0, 0.3, law="neo_hookean", density=1.0),
        contact(master="master" if kind == "rings" else "wall"),
        *([] if kind == "rings" else [entry("rigid", group="wall")]),
        *(entry("initial", groups=[group], **velocity) for group, velocity in starts.items()),
        entry("dynamics", scheme="newmark"), entry("steps", end=end, count=round(end / _STEP)), kinematics="finite",
    )  # fmt: skip
    impact = run(text, mesh)
    touching = impact.pressure.any(axis=1)
    iterations = np.array([state.iterations for state in impact.solved.states])[touching].mean()
    yield at_most("largest energy", impact.whole.max(), 1.001, source="no energy is created")
    yield at_least("smallest energy", impact.whole.min(), 0.97, source="energy is conserved as dt -> 0",
                   reason="Newmark's method is of the second order in finite kinematics")  # fmt: skip
    yield account(impact)
    yield at_most("Newton iterations of a step in contact", iterations, 3.5, source="as the first static steps take",
                  reason="a wave crosses a cell in a step and changes strains by per cents")  # fmt: skip


# ---- free motions

#: velocity and angular velocity of a body in one turn, in a plane and in space; steps of it on the coarsest level
_FLIGHT, _TURN, _COARSE = (0.3, 0.1, -0.2), {2: 1.0, 3: [0.6, 0.0, 0.8]}, 40


@problem
def solve_spin(cell: str, scheme: str, *, levels: int) -> Iterator[Result]:
    """One turn of a neo-Hookean bar that flies and starts unstretched, each level in twice as many steps."""
    dim, counts = CELLS[cell].dim, [_COARSE << level for level in range(levels)]
    velocity = np.array(_FLIGHT[:dim])
    off: list[tuple[float, ...]] = []
    for count in counts:
        text = case_text(
            model_of(dim), material(1e3, 0.3, law="neo_hookean", density=1.0),
            entry("initial", rotation=_TURN[dim], **dict(zip(("vx", "vy", "vz"), _FLIGHT[:dim], strict=False))),
            entry("dynamics", scheme=scheme), entry("steps", end=2 * np.pi, count=count), kinematics="finite",
        )  # fmt: skip
        turned = run(text, bar(cell, 4))
        linear = np.array([motion.linear for motion in turned.motions]) / WIDTH ** (dim - 1) - velocity
        angular = np.array([np.atleast_1d(motion.angular) for motion in turned.motions])
        off.append((
            float(np.linalg.norm(linear, axis=1).max() / np.linalg.norm(velocity)),
            float(np.linalg.norm(angular - angular[0], axis=1).max() / np.linalg.norm(angular[0])),
            float(np.abs(turned.whole - 1).max()),
            turned.unbalanced,
        ))  # fmt: skip
    momentum, spin, energy, accounts = zip(*off, strict=True)
    yield at_most("linear momentum", max(momentum), 1e-12, source="no force acts", reason="in every step")
    h, unknowns = [2 * np.pi / count for count in counts], [turned.solved.unknowns] * levels
    for what, errors in (("angular momentum", spin), ("energy", energy)):
        table = levels_of(h, unknowns, errors)
        yield rate(f"{what}, its largest error", table, 1.95, source="second order in dt", reason="relative, in a turn")
    yield at_most("account of energy", max(accounts), 10 * CLOSED, source=ACCOUNT,
                  reason="Newton's method ends at the round-off of K u, 1e-14 of it, in every step")  # fmt: skip


@problem
def solve_vibration(given: Bar, *, levels: int) -> Iterator[Result]:
    """The two lowest natural frequencies of a bar that one end holds and that cannot move sideways."""
    right, up = np.array([1, 3]) * given.c / 4, "xyz"[given.dim - 1]
    counts, errors, unknowns = [given.n << level for level in range(levels)], [], []
    for n in counts:
        text = given.text(1.0, 1, fixed(f"{up}0", up))
        modes = natural_modes(Problem.of(parse_case(text), bar(given.cell, n)), count=2)
        errors.append(float((modes.frequencies / right - 1).max()))
        unknowns.append(modes.unknowns)
    yield at_least("least error of a frequency", min(errors), 0.0, source="a consistent mass: all come from above")
    yield rate("largest error of 2 frequencies", levels_of([1 / n for n in counts], unknowns, errors),
               2.0 * CELLS[given.cell].order - 0.05, source="h^2 and h^4: frequencies (2 k - 1) c / 4 L")  # fmt: skip


#: order in time: the end, steps to it on the coarsest level, and how much finer the reference is
_END, _COUNT, _FINER = 3.0, 60, 16


@problem
def solve_order(given: Bar, *, levels: int) -> Iterator[Result]:
    """A bar that stays in contact with a wall, under preload until t = 1 and a smooth further load: errors at the end.

    They are those of displacements, of velocities of nodes with mass, and of the force of contact.
    """
    counts = [_COUNT << level for level in range(levels)]
    *coarser, right = (_loaded(given, count) for count in (*counts, _COUNT * _FINER))
    reference, unknowns = _at_the_end(right), [right.unknowns] * levels
    for k, what in enumerate(("displacement", "velocity", "force of contact")):
        own = reference[k]
        errors = [float(np.abs(_at_the_end(one)[k] - own).max() / np.abs(own).max()) for one in coarser]
        table = levels_of([_END / count for count in counts], unknowns, errors)
        reason = f"against steps of 1/{_COUNT * _FINER} of the time"
        yield rate(f"{what}, largest error at the end", table, 1.95, source="second order in dt", reason=reason)


def _loaded(given: Bar, count: int) -> Solved:
    load = entry("force", group="top", fy="-0.01 - 0.02 * max(t - 1.0, 0) ** 4")
    skins = contact(master="wall"), entry("rigid", group="wall")
    return solve(given.text(_END, count, *skins, load), bar_on_wall(given.cell, given.n))


def _at_the_end(solved: Solved) -> tuple[Floats, Floats, Floats]:
    """Displacements, velocities of nodes with mass, force on the slave."""
    inertia, motion = solved.problem.inertia, solved.state.step.motion
    assert inertia is not None and motion is not None
    return solved.state.u, np.delete(motion.velocity, inertia.massless_dofs), motion.pushes[0, 0]
