"""Impacts with large deformations: a ring, a disc and a ball thrown on a wall, two rings that hit each other.

No exact solution is known. Energy is compared with that at the start, and the work of Newton's method with that of the
static twin: the same bodies, held at the far side, and pressed as deep as the impact presses them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lacmesh import Mesh
from verification.families.impact_runs import ACCOUNT, CLOSED, Impact, ImpactRun, run
from verification.meshes.balls import sphere_on_wall
from verification.meshes.thrown import INNER, OUTER, disc, on_wall, ring, two_rings
from verification.records import Result, at_least, at_most, informative
from verification.solving import case_text, entry, solve

#: way of a body to its first touch, size of a step, and steps of the static twin
_GAP, _STEP, _PRESSED = 0.02, 0.01, 10
#: end of each kind of impact
_END = {"ring": 1.6, "disc": 0.7, "ball": 1.0, "rings": 1.8}
#: radius of the contact of a ball, about
_WIDE = 0.4
_NEWMARK = (("scheme", "newmark"),)
#: name, description and parameters of the cases
THROWN = tuple(
    (f"thrown-{kind}", f"{what}, large deformations", Impact(kind, n=n, dynamics=_NEWMARK, young=100.0, speed=0.5))
    for kind, n, what in (
        ("ring", 48, "A neo-Hookean ring thrown on a wall"),
        ("disc", 6, "A neo-Hookean disc thrown on a wall"),
        ("ball", 5, "A neo-Hookean ball thrown on a wall, axisymmetric"),
        ("rings", 48, "Two neo-Hookean rings that hit each other"),
    )
)


class _Bodies(NamedTuple):
    """Bodies of an impact: `meshes`, apart and touching; tables of contact, start, and static twin.

    In the static twin a formula DEPTH * t is the way that the bodies are pressed.
    """

    meshes: tuple[Mesh, Mesh]
    contact: str
    start: tuple[str, ...]
    pressed: tuple[str, ...]


def thrown(given: Impact, levels: int) -> Iterator[Result]:
    """Throw neo-Hookean bodies at one another, and press them as deep."""
    bodies = _two_rings(given) if given.kind == "rings" else _on_wall(given)
    tables = [bodies.contact, *bodies.start, entry("dynamics", **dict(given.dynamics))]
    end = _END[given.kind]
    impact = run(_text(given, end, round(end / _STEP), *tables), bodies.meshes[0])
    yield at_most("largest energy", impact.whole.max(), 1.001, source="no energy is created")
    yield at_least("smallest energy", impact.whole.min(), 0.97, source="energy is conserved as dt -> 0",
                   reason="Newmark's method is of the second order in finite kinematics")  # fmt: skip
    yield at_most("account of energy", impact.unbalanced, CLOSED, source=ACCOUNT)
    touching = impact.pressure.any(axis=1)
    yield informative("openings", float((np.diff(touching.astype(int)) < 0).sum()), reason="bodies vibrate")
    iterations = np.array([state.iterations for state in impact.solved.states])[touching].mean()
    tables = [table.replace("DEPTH", repr(_depth(given, impact))) for table in (bodies.contact, *bodies.pressed)]
    yield at_most("Newton iterations of a step in contact", iterations, 3.5, source="as the first static steps take",
                  reason="a wave crosses a cell in a step and changes strains by per cents")  # fmt: skip
    for steps, reason in ((_PRESSED, "coarse steps"), (int(touching.sum()) // 2, "as small steps, on a smooth path")):
        value = _static(given, tables, bodies.meshes[1], steps)
        yield informative(f"Newton iterations of {steps} static steps", value, reason=reason)


def _static(given: Impact, tables: list[str], mesh: Mesh, count: int) -> float:
    """Mean number of Newton iterations of the static twin's steps in contact."""
    states = solve(_text(given, 1.0, count, *tables), mesh).states
    return float(np.mean([state.iterations for state in states if state.zones[0].pressure.any()]))


def _depth(given: Impact, impact: ImpactRun) -> float:
    """Largest way of the bodies' centres from the first touch on."""
    space, inertia = impact.solved.problem.space, impact.solved.problem.inertia
    assert inertia is not None
    mass = np.asarray(inertia.M.sum(axis=1)).ravel()[: space.n_dof].reshape(-1, space.dim)
    toward = np.array([1.0, 0.0] if given.kind == "rings" else [0.0, -1.0])
    if given.kind == "rings":
        mass = mass * (space.mesh.points[:, :1] < 0)
    ways = [(mass * state.u.reshape(-1, space.dim)).sum(axis=0) @ toward for state in impact.solved.states]
    free = _GAP / 2 if given.kind == "rings" else _GAP
    return float(max(ways) / (mass.sum() / space.dim) - free)


def _on_wall(given: Impact) -> _Bodies:
    body = "ball" if given.kind == "ball" else "body"
    below = entry("displacement", at=[0.0, OUTER + INNER if given.kind == "ring" else OUTER], ux=0.0)
    top = entry("displacement", at=[0.0, 2 * OUTER], ux=0.0, uy=0.0)
    return _Bodies(
        (_over_wall(given, _GAP), _over_wall(given, 0.0)), entry("contact", slave="slave", master="wall"),
        (entry("rigid", group="wall"), entry("initial", groups=[body], vy=-given.speed)),
        (entry("rigid", group="wall", uy="DEPTH * t"), top, below),
    )  # fmt: skip


def _over_wall(given: Impact, gap: float) -> Mesh:
    """A body over a wall; `n`: cells along half of the contact of a ball, around a ring, along an eighth of a disc."""
    if given.kind == "ball":
        return sphere_on_wall(_WIDE, gap, given.n)
    centre = 0.0, OUTER + gap
    return on_wall(ring(given.n, 2, centre, "slave") if given.kind == "ring" else disc(given.n, centre, "slave"))


def _two_rings(given: Impact) -> _Bodies:
    meshes = two_rings((given.n, given.n - 4), 2, _GAP), two_rings((given.n, given.n - 4), 2, 0.0)
    start = [entry("initial", groups=[name], vx=v) for name, v in (("left", given.speed), ("right", -given.speed))]
    far, inner = 2 * OUTER, OUTER + INNER
    paths = [entry("displacement", at=[-far, 0.0], ux="DEPTH * t", uy=0.0),
            entry("displacement", at=[far, 0.0], ux="-DEPTH * t", uy=0.0),
            *(entry("displacement", at=[side * inner, 0.0], uy=0.0) for side in (-1, 1))]  # fmt: skip
    return _Bodies(meshes, entry("contact", slave="slave", master="master"), tuple(start), tuple(paths))


def _text(given: Impact, end: float, count: int, *tables: str) -> str:
    """The case of neo-Hookean bodies, as TOML."""
    model = "axisymmetric" if given.kind == "ball" else "plane_strain"
    return case_text(
        model,
        entry("material", law="neo_hookean", young=given.young, poisson=given.poisson, density=1.0),
        *tables,
        entry("steps", end=end, count=count),
        kinematics="finite",
    )
