"""The patch test: blocks on one another under a uniform pressure, and how far the answer is from the exact one.

Stress is uniform and displacement linear: under pressure P the height shrinks by P / E a length (P (1 - nu^2) / E in
plane strain) and the blocks grow freely sideways. In a tilted frame the symmetry planes hold the normal displacement.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lacmesh.cells import CELLS
from lacsolver.assemble import stress
from lacsolver.case import parse_case
from lacsolver.march import march
from lacsolver.problem import Problem
from tests.lacsolver.patch_meshes import (
    PLANE_KINDS,
    SOLID_KINDS,
    TWO_WAYS,
    own_places,
    placed,
    rotation,
    side_by_side,
    stack,
)

POISSON = 0.3
#: components of a stress, as pairs of axes
_AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


class Figures(NamedTuple):
    """Worst relative errors of a state; forces and moments: what is left of their sums, of the sum of their sizes."""

    stress: float
    pressure: float
    displacement: float
    gap: float
    coverage: float
    force: float
    moment: float

    def worst(self, other):
        """The larger of each, NaN above all."""
        return Figures(*(float(np.maximum(a, b)) for a, b in zip(self, other, strict=True)))


class Press(NamedTuple):
    """A patch test: blocks and how they are pressed. `options`: lines of every [[contact]]; `turn`: the frame's."""

    mesh: object
    model: str
    zones: tuple[tuple[str, str], ...] = (("slave", "master"),)
    options: str = ""
    turn: np.ndarray | None = None
    young: float = 1e3
    pressure: float = 1.0
    solver: str = ""
    sides: tuple[str, ...] | None = None


def text(press):
    """The case as a file has it."""
    dim = 3 if press.model == "3d" else 2
    lines = ['mesh = "blocks.msh"', f'model = "{press.model}"', "[[material]]"]
    lines += [f"young = {press.young!r}", f"poisson = {POISSON}"]
    for slave, master in press.zones:
        lines += ["[[contact]]", f'slave = "{slave}"', f'master = "{master}"', press.options]
    sides = ("x0", "y0")[: dim - 1] if press.sides is None else press.sides
    for group, axis in [*((side, side[0]) for side in sides), ("bottom", "xyz"[dim - 1])]:
        lines += ["[[displacement]]", f'group = "{group}"', f"{'un' if press.turn is not None else f'u{axis}'} = 0.0"]
    lines += ["[[pressure]]", 'group = "top"', f"value = {press.pressure!r}", "[solver]", "threads = 1", press.solver]
    return "\n".join(lines)


def solved(press):
    """The problem and its last state."""
    problem = Problem.of(parse_case(text(press)), press.mesh)
    (state,) = march(problem)
    return problem, state


def figures(press):
    """What a patch test yields."""
    problem, state = solved(press)
    return measured(press, problem, state)


def measured(press, problem, state):
    """The figures of a state."""
    p, exact = press.pressure, exact_displacement(press, problem.space.mesh)
    sigma = np.concatenate([s.reshape(-1, s.shape[-1]) for s in stress(problem.space, problem.materials, state.u)])
    pressure = p
    if "measure" in press.options and '"current"' in press.options:
        pressure = p / np.prod(1 + strains(press)[: problem.space.dim - 1])
    attached = problem.space.attached
    u = state.u.reshape(-1, problem.space.dim)
    x = problem.space.mesh.points.copy()
    if problem.joints[0].moving:
        x[:, : problem.space.dim] += u
    out = Figures(
        stress=np.abs(sigma - exact_stress(press)[: sigma.shape[1]]).max() / p,
        pressure=max(np.abs(zone.pressure / pressure - 1).max() for zone in state.zones),
        displacement=np.abs(u - exact)[attached].max() / np.abs(exact).max(),
        gap=max(np.abs(z.gap / z.area ** (1 / (problem.space.dim - 1))).max() for z in state.zones),
        coverage=max(np.abs(zone.coverage - 1).max() for zone in state.zones),
        force=0.0,
        moment=0.0,
    )
    for zone in state.zones:
        force, moment = unbalanced(x, zone.force, problem.space.model.axisymmetric)
        out = out.worst(out._replace(force=force, moment=moment))
    return out


def unbalanced(x, force, axisymmetric=False):
    """What is left of the sum of forces (n, d) at x (n, 3), and of their moments, relative to the sum of their sizes."""
    f = np.zeros((len(force), 3))
    f[:, : force.shape[1]] = force
    size = np.abs(f).sum()
    if axisymmetric:  # radial forces are in balance all round, and so are moments
        return abs(f[:, 1].sum()) / size, 0.0
    x = x - x[np.abs(f).sum(axis=1) > 0].mean(axis=0)
    moments = np.cross(x, f)
    lever = (np.linalg.norm(x, axis=1) * np.linalg.norm(f, axis=1)).sum()
    return np.abs(f.sum(axis=0)).max() / size, np.abs(moments.sum(axis=0)).max() / lever


def strains(press):
    """(3,): along x, (y,) the height, then nothing."""
    e = press.pressure / press.young
    if press.model == "3d":
        return np.array([POISSON * e, POISSON * e, -e])
    if press.model == "plane_strain":
        return np.array([POISSON * (1 + POISSON) * e, -(1 - POISSON**2) * e, 0.0])
    return np.array([POISSON * e, -e, 0.0])


def exact_displacement(press, mesh):
    """(n_nodes, dim): in each of several stacks, which stand two of their sizes apart, from its own symmetry plane."""
    turn = np.eye(3) if press.turn is None else press.turn
    x = mesh.points @ turn
    if len(press.zones) > 1:
        x = own_places(x)
    return (x * strains(press)) @ turn.T[:, : 3 if press.model == "3d" else 2]


def exact_stress(press):
    """(6,)."""
    up = 2 if press.model == "3d" else 1
    sigma = np.zeros((3, 3))
    sigma[up, up] = -press.pressure
    if press.model == "plane_strain":
        sigma[2, 2] = -POISSON * press.pressure
    turn = np.eye(3) if press.turn is None else press.turn
    sigma = turn @ sigma @ turn.T
    return np.array([sigma[a, b] for a, b in _AXES])


def hexa(kind):
    """The ways in which the slave faces of a kind may be cut."""
    return ("pyramid", "hexa") if kind in TWO_WAYS else ("pyramid",)


def every_master(slave, dim, *, model=None, way="pyramid", tilted=False, options="", **moves):
    """One slave kind under or on every master kind at once."""
    masters = PLANE_KINDS if dim == 2 else SOLID_KINDS
    mesh = side_by_side(slave, masters, dim, **moves)
    zones = tuple((f"slave{k}", f"master{k}") for k in range(len(masters)))
    return _pressed(mesh, dim, model, way, tilted, options, zones)


def pair(slave, master, dim, *, model=None, way="pyramid", tilted=False, options="", **moves):
    """One slave block and one master block."""
    return _pressed(stack(slave, master, dim, **moves), dim, model, way, tilted, options, (("slave", "master"),))


def _pressed(mesh, dim, model, way, tilted, options, zones):
    turn = rotation(dim) if tilted else None
    model = model or ("3d" if dim == 3 else "plane_strain")
    if dim == 3 and way != "pyramid":
        options = f'hexa = "{way}"\n{options}'
    return Press(mesh if turn is None else placed(mesh, turn), model, zones, options, turn)


assert {kind.partition(" ")[0] for kind in (*PLANE_KINDS, *SOLID_KINDS)} - {"mixed"} == {
    name for name, cell in CELLS.items() if cell.dim >= 2
} | set(), "every type of cell"
