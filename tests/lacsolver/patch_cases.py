"""The patch test: blocks on one another under a uniform pressure, and how far the answer is from the exact one.

Stress is uniform and displacement linear: under pressure P the height shrinks by P / E a length (P (1 - nu^2) / E in
plane strain) and the blocks grow freely sideways. In a tilted frame the symmetry planes hold the normal displacement.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from lacsolver.bodies.small import stress
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.patch_meshes import own_places, placed, side_by_side, stack
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS, TWO_WAYS, tilt

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
        """Larger one of each of two figures; NaN counts as largest."""
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
    """Solve a patch test and return its errors."""
    problem, state = solved(press)
    return measured(press, problem, state)


def measured(press, problem, state):
    """The figures of a state."""
    p, exact = press.pressure, exact_displacement(press, problem.space.mesh)
    sigma = np.concatenate([s.reshape(-1, s.shape[-1]) for s in stress(problem.space, problem.materials, state.u)])
    pressure = p
    if "measure" in press.options and '"current"' in press.options:
        pressure = p / stretch(press)
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
    """Resultants of forces (n, d) at x (n, 3) and of their moments, each relative to the sum of the magnitudes."""
    f = np.zeros((len(force), 3))
    f[:, : force.shape[1]] = force
    size = np.abs(f).sum()
    if axisymmetric:  # radial forces are in balance all round, and so are moments
        return abs(f[:, 1].sum()) / size, 0.0
    x = x - x[np.abs(f).sum(axis=1) > 0].mean(axis=0)
    moments = np.cross(x, f)
    moment_arm = (np.linalg.norm(x, axis=1) * np.linalg.norm(f, axis=1)).sum()
    return np.abs(f.sum(axis=0)).max() / size, np.abs(moments.sum(axis=0)).max() / moment_arm


def strains(press):
    """(3,): along x, (y,) the height, then nothing."""
    e = press.pressure / press.young
    if press.model == "3d":
        return np.array([POISSON * e, POISSON * e, -e])
    if press.model == "plane_strain":
        return np.array([POISSON * (1 + POISSON) * e, -(1 - POISSON**2) * e, 0.0])
    return np.array([POISSON * e, -e, 0.0])


def stretch(press):
    """Deformed area of the interface over the undeformed one; that of a body of revolution grows in two directions."""
    return (1 + strains(press)[0]) ** (2 if press.model in ("3d", "axisymmetric") else 1)


def exact_displacement(press, mesh):
    """(n_nodes, dim): in each of several stacks, which stand two of their sizes apart, from its own symmetry plane."""
    dim = 3 if press.model == "3d" else 2
    turn = np.eye(3) if press.turn is None else press.turn
    x = mesh.points @ turn
    if len(press.zones) > 1:
        x = own_places(x, dim)
    x[:, dim - 1] -= x[:, dim - 1].min()
    return (x * strains(press)) @ turn.T[:, :dim]


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


class Named(NamedTuple):
    """A patch test of a family; `make` builds it when it is asked for."""

    family: str
    label: str
    make: Callable[[], Press]


def ways(kind):
    """The ways in which the slave faces of a kind may be cut."""
    return ("pyramid", "hexa") if kind in TWO_WAYS else ("pyramid",)


def every_master(slave, dim, *, way="pyramid"):
    """One slave kind under or on every master kind at once, in a tilted frame."""
    masters = PLANE_KINDS if dim == 2 else SOLID_KINDS
    zones = tuple((f"slave{k}", f"master{k}") for k in range(len(masters)))
    return _pressed(side_by_side(slave, masters, dim), dim, None, way, True, "", zones)


def pair(slave, master, *, dim=3, model=None, way="pyramid", tilted=False, options="", **moves):
    """One slave block and one master block."""
    return _pressed(stack(slave, master, dim, **moves), dim, model, way, tilted, options, (("slave", "master"),))


def ring(slave, master, options=""):
    """A body of revolution between radii 1 and 2, free inside and outside."""
    return pair(slave, master, dim=2, model="axisymmetric", options=options, shift=(1, 0, 0))._replace(sides=())


def sized(press, size, young, pressure):
    """Copy of a patch test in other units, scaled about its interface."""
    low = np.eye(3)[2 if press.model == "3d" else 1]
    return press._replace(mesh=placed(press.mesh, size=size, shift=-size * low), young=young, pressure=pressure)


def _pressed(mesh, dim, model, way, tilted, options, zones):
    turn = tilt(dim) if tilted else None
    model = model or ("3d" if dim == 3 else "plane_strain")
    if way != "pyramid":
        options = f'hexa = "{way}"\n{options}'
    return Press(mesh if turn is None else placed(mesh, turn), model, zones, options, turn)


#: pairs that stand for all, where something else than the cells varies
_FEW = {
    2: (("TRIA3", "QUAD8"), ("QUAD4", "TRIA7"), ("QUAD9", "mixed 1"), ("mixed 2", "QUAD4")),
    3: (("HEXA8", "TETRA4"), ("TETRA10", "HEXA20"), ("PENTA15 quadrangle", "HEXA27"), ("mixed 2", "mixed 1")),
}
#: what lines of [[contact]] must not change on plane faces that are triangles or parallelograms
_OPTIONS = {
    "smoothed": 'normals = "smoothed"',
    "bilateral": 'type = "bilateral"',
    "initially open": 'initial = "none"',
    "initially closed": 'initial = "all"',
    "current": 'geometry = "current"',
    "current, current measure": 'geometry = "current"\nmeasure = "current"',
    "current, smoothed": 'geometry = "current"\nnormals = "smoothed"',
}
#: distorted faces: slave, way of its cut, master, how they are moved
_DISTORTED = (
    ("HEXA8", "pyramid", "HEXA20", {"skew": 0.2}),
    ("HEXA8", "hexa", "HEXA8", {"bulge": 0.2}),
    ("HEXA20", "hexa", "HEXA8", {"skew": 0.05}),
    ("HEXA20", "pyramid", "HEXA20", {"bulge": 0.2}),
    ("HEXA27", "pyramid", "HEXA8", {"bulge": 0.05}),
    ("PENTA15 quadrangle", "pyramid", "HEXA20", {"bulge": 0.2}),
    ("PYRAM14 quadrangle", "pyramid", "HEXA8", {"skew": 0.2}),
)


def cases():
    """Patch tests on generated blocks: what the family `patch` of the verification leaves out, and a few of each."""
    for slave in ("TRIA7", "QUAD8", "mixed 2"):
        yield Named("2D, tilted", slave, partial(every_master, slave, 2))
    for slave, way in (("TETRA10", "pyramid"), ("HEXA8", "hexa"), ("PYRAM13 triangle", "pyramid")):
        yield Named("3D, tilted", f"{slave} {way}", partial(every_master, slave, 3, way=way))
    for slave, master in (("TRIA6", "TRIA3"), ("QUAD8", "QUAD9"), ("mixed 2", "QUAD4")):
        label = f"{slave} against {master}"
        for model in ("plane_stress", "axisymmetric"):
            yield Named(model, label, partial(pair, slave, master, dim=2, model=model))
        yield Named("axisymmetric", f"ring, {label}", partial(ring, slave, master))
    for slave, way, master, move in _DISTORTED:
        make = partial(pair, slave, master, way=way, tilted=master == "HEXA20", counts=(5, 4), even=True, **move)
        yield Named("distorted quadrangles", f"{slave} {way} against {master}, {move}", make)
    for slave, way in (("HEXA8", "pyramid"), ("HEXA8", "hexa"), ("HEXA20", "hexa")):
        move = {"counts": (3, 2), "skew": 0.2, "options": 'geometry = "current"'}
        make = partial(pair, slave, "HEXA8", way=way, **move)
        yield Named("distorted quadrangles, current", f"{slave} {way}", make)
    yield from _with_options()


def _with_options():
    """Every option on a pair in the plane, a ring and a pair in space; all pairs take turns."""
    for k, (family, options) in enumerate(_OPTIONS.items()):
        for dim, pairs in _FEW.items():
            slave, master = pairs[k % len(pairs)]
            make = partial(pair, slave, master, dim=dim, options=options, tilted=k % 2 == 0)
            yield Named(family, f"{slave} against {master}", make)
        yield Named(family, "ring", partial(ring, "QUAD8", "TRIA3", options))
