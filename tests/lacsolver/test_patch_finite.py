"""The patch test under finite kinematics: blocks on one another at a uniform finite strain, whatever the cells.

The stack is pressed down to 0.85 of its height by its top, sides free (or, for some, held): a diagonal stretch whose
lateral parts make the stress on free sides vanish, found here from the law by itself. With `current` areas the pressure
is Cauchy's, with `reference` ones the nominal one.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import brentq

from lacsolver.equilibrium.stepping import march
from tests.lacsolver.contact_cases import held
from tests.lacsolver.finite_cases import YOUNG, problem_of
from tests.lacsolver.patch_meshes import placed, stack, ways
from tests.samples import each_option
from verification.measures.balance import unbalanced
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS, tilt

EXACT, BALANCED = 1e-10, 1e-12
POISSON, DOWN = 0.3, 0.85
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
#: which stretches are 1 by themselves, and that of the height
SOLVER = "tolerance = 1e-12\nmax_iterations = 100\n"
HELD_OUT = {"plane_strain": [2], "plane_stress": [], "axisymmetric": [], "3d": []}


class Press(NamedTuple):
    """A stack, and how it is pressed: `pressed` down to DOWN by `top`, or by a `load`, the force that this takes."""

    mesh: object
    model: str
    law: str = "neo_hookean"
    zones: tuple = (("slave", "master"),)
    options: str = ""
    turn: np.ndarray | None = None
    walls: bool = False
    load: str = ""
    solver: str = SOLVER


def nominal(law, stretch):
    """(3,): first Piola-Kirchhoff stress P = dW/d(stretch)."""
    lame, mu = LAME
    if law == "neo_hookean":
        return mu * (stretch - 1 / stretch) + lame * np.log(stretch.prod()) / stretch
    E = (stretch**2 - 1) / 2
    return stretch * (lame * E.sum() + 2 * mu * E)


def stretches(press):
    """(3,): along x, y, z before the frame is turned."""
    up = 2 if press.model == "3d" else 1
    fixed = HELD_OUT[press.model] + ([0, 1][:up] if press.walls else [])
    free = [k for k in range(3) if k != up and k not in fixed]

    def made(wide):
        out = np.ones(3)
        out[up], out[free] = DOWN, wide
        return out

    if not free:
        return made(1.0)
    wide = brentq(lambda w: nominal(press.law, made(w))[free[0]], 0.8, 1.3, xtol=1e-15, rtol=1e-15)
    return made(wide)


def text(press):
    """The sections of the case."""
    dim = 3 if press.model == "3d" else 2
    up, lines = "xyz"[dim - 1], ""
    for slave, master in press.zones:
        lines += f'[[contact]]\nslave = "{slave}"\nmaster = "{master}"\n{press.options}'
    if press.model != "axisymmetric":
        sides = [f"{a}{e}" for a in "xyz"[: dim - 1] for e in ("01" if press.walls else "0")]
        lines += "".join(held(side, **{"un" if press.turn is not None else f"u{side[0]}": 0.0}) for side in sides)
    name = "un" if press.turn is not None else f"u{up}"
    lines += held("bottom", **{name: 0.0})
    stretch = stretches(press)
    P = -nominal(press.law, stretch)[dim - 1]
    area = stretch.prod() / stretch[dim - 1]
    if press.load:
        value, follower = (P / area, "true") if press.load == "follower" else (P, "false")
        return lines + f'[[pressure]]\ngroup = "top"\nvalue = {float(value)!r}\nfollower = {follower}\n'
    return lines + held("top", **{name: 2.0 * (DOWN - 1)})


def solved(press):
    """The problem and its state; by load, two steps to it."""
    steps = "[steps]\ncount = 2\n" if press.load else ""
    problem = problem_of(press.mesh, text(press) + steps, model=press.model, law=press.law, solver=press.solver)
    *_, state = march(problem)
    return problem, state


def check(press):
    """Stress, pressure, displacement, gap, coverage, forces and moments of a press."""
    problem, state = solved(press)
    dim, stretch = problem.space.dim, stretches(press)
    turn = np.eye(3) if press.turn is None else press.turn
    P = nominal(press.law, stretch)
    up, area = dim - 1, stretch.prod() / stretch[dim - 1]
    size = abs(P[up])
    sigma = turn @ np.diag(stretch * P / stretch.prod()) @ turn.T
    found = np.concatenate([s.reshape(-1, s.shape[-1]) for s in problem.kinematics.stress(state.u, state.time)])
    wanted = sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]][: found.shape[1]]
    if press.model == "plane_stress":
        found, wanted = found[:, [0, 1, 3]], wanted[[0, 1, 3]]
    assert np.abs(found - wanted).max() <= EXACT * size, "stress"
    x = problem.space.mesh.points @ turn
    x[:, up] -= x[:, up].min()
    exact = (x * (stretch - 1) * [1, 1, dim == 3]) @ turn.T[:, :dim]
    off = np.abs(state.u.reshape(-1, dim) - exact)[problem.space.attached].max()
    assert off <= EXACT * np.abs(exact).max(), "displacement"
    if press.model == "plane_stress":
        area = stretch[0]  # a skin's thickness stays as it was
    pressure = size / area if '"current"' in press.options else size
    for joint, zone in zip(problem.joints, state.zones, strict=True):
        assert np.abs(zone.pressure / pressure - 1).max() <= EXACT, "pressure"
        assert np.abs(zone.coverage - 1).max() <= EXACT, "coverage"
        assert np.abs(zone.gap / zone.area ** (1 / up)).max() <= EXACT, "gap"
        force, moment = unbalanced(
            joint.places(problem.space, state.u), zone.force, axisymmetric=press.model == "axisymmetric"
        )
        assert max(force, moment) <= BALANCED, (force, moment)


OPTIONS = [f'measure = "{m}"\nnormals = "{n}"\n' for m in ("reference", "current") for n in ("facet", "smoothed")]
LAWS = ("neo_hookean", "saint_venant_kirchhoff")


def pair(slave, master, k, *, dim=3, model=None, way="pyramid", tilted=False, options=None, **moves):
    """A stack of one slave and one master block; measures, normals and laws take turns with k."""
    mesh, turn = stack(slave, master, dim, counts=moves.pop("counts", (2, 1) if dim == 3 else (3, 2)), **moves), None
    if tilted:
        turn = tilt(dim)
        mesh = placed(mesh, turn)
    own = (OPTIONS[k % 4] if options is None else options) + (f'hexa = "{way}"\n' if way != "pyramid" else "")
    model = model or ("3d" if dim == 3 else "plane_strain")
    return Press(mesh, model, LAWS[k // 4 % 2], options=own, turn=turn)


_PLANE = [(slave, PLANE_KINDS[(k + 4) % len(PLANE_KINDS)], k) for k, slave in enumerate(PLANE_KINDS)]
_SOLID = [
    (slave, SOLID_KINDS[(9 * k + 3) % len(SOLID_KINDS)], k, way)
    for k, slave in enumerate(SOLID_KINDS)
    for way in ways(slave)
]


def test_every_kind_is_a_slave_and_a_master():
    for pairs, kinds in ((_PLANE, PLANE_KINDS), (_SOLID, SOLID_KINDS)):
        assert {row[0] for row in pairs} == {row[1] for row in pairs} == set(kinds)


_QUADRANGLES = [("HEXA8", "TETRA4"), ("PENTA6 quadrangle", "TETRA10")]


@pytest.mark.parametrize("kinds, k", each_option(itertools.product(_QUADRANGLES, (3, 5))))
def test_smoothed_normals_of_distorted_quadrangles(kinds, k):
    check(pair(*kinds, k, counts=(3, 2), skew=0.05, tilted=k > 3))


def options_of(row):
    """Kinds of the slave and the master, model or way of the cut; and measure, normals and law, by turns."""
    return [option for option in row if isinstance(option, str)] + [row[2] % 8]


@pytest.mark.parametrize(
    "slave, master, k, model",
    each_option(
        [(*row, model) for model in ("plane_strain", "plane_stress", "axisymmetric") for row in _PLANE], of=options_of
    ),
)
def test_plane_kinds(slave, master, k, model):
    check(pair(slave, master, k, dim=2, model=model, tilted=k % 2 == 0 and model != "axisymmetric"))


@pytest.mark.parametrize("slave, master, k, way", each_option(_SOLID, of=options_of))
def test_solid_kinds(slave, master, k, way):
    check(pair(slave, master, k - k % 2 if way == "hexa" else k, way=way, tilted=k % 2 == 0))


_DISTORTED = [
    ("HEXA8", "TETRA4", 0.05, "pyramid", 0),
    ("PENTA6 quadrangle", "TETRA10", 0.05, "pyramid", 2),
    ("HEXA8", "HEXA8", 0.2, "pyramid", 0),
    ("HEXA8", "TETRA4", 0.2, "hexa", 2),
    ("HEXA20", "TETRA4", 0.2, "pyramid", 0),
    ("HEXA20", "PENTA6 triangle", 0.05, "hexa", 2),
]


@pytest.mark.parametrize("slave, master, skew, way, k", each_option(_DISTORTED, of=lambda row: [row[0], *row[2:]]))
def test_distorted_quadrangles(slave, master, skew, way, k):
    """Both measures by turns; the current one in a tilted frame."""
    check(pair(slave, master, k, counts=(3, 2), skew=skew, tilted=k > 1, way=way))


@pytest.mark.parametrize(
    "slave, master, dim, k", [("QUAD8", "TRIA3", 2, 0), ("HEXA8", "TETRA10", 3, 1), ("TETRA4", "HEXA20", 3, 6)]
)
def test_sides_that_are_held(slave, master, dim, k):
    """Walls on all sides: the pressure is that of a body that cannot give way."""
    press = pair(slave, master, k, dim=dim)._replace(walls=True)
    assert stretches(press).tolist() == ([1, 1, DOWN] if dim == 3 else [1, DOWN, 1])
    check(press)


_LOADED = [("QUAD4", "TRIA6", "axisymmetric"), ("QUAD9", "QUAD4", "plane_strain"), ("TETRA10", "HEXA8", "3d")]


@pytest.mark.parametrize("case, load", each_option(itertools.product(_LOADED, ["dead", "follower"])))
def test_pressed_by_a_load(case, load):
    """The force that it takes, per undeformed area or, with a follower, per deformed."""
    slave, master, model = case
    check(pair(slave, master, 3, dim=3 if model == "3d" else 2, model=model)._replace(load=load))


_OF_LAWS = [("HEXA8", "TETRA4", 0), ("TETRA10", "PENTA6 triangle", 5), ("mixed 1", "HEXA8", 2)]


@pytest.mark.parametrize("slave, master, k", each_option(_OF_LAWS, of=lambda row: [LAWS[row[2] // 4]]))
def test_with_multigrid(slave, master, k):
    check(pair(slave, master, k)._replace(solver='backend = "multigrid"\n' + SOLVER))


def test_the_stretches_are_those_of_the_law():
    """Against the derivative of the energy, and with the stress on the free sides gone."""
    stretch, h = np.array([1.1, 0.8, 1.05]), 1e-6
    lame, mu = LAME

    def energy(law, s):
        if law == "neo_hookean":
            J = s.prod()
            return mu / 2 * ((s**2).sum() - 3) - mu * np.log(J) + lame / 2 * np.log(J) ** 2
        E = (s**2 - 1) / 2
        return lame / 2 * E.sum() ** 2 + mu * (E**2).sum()

    for law in LAWS:
        slope = [(energy(law, stretch + h * e) - energy(law, stretch - h * e)) / (2 * h) for e in np.eye(3)]
        np.testing.assert_allclose(nominal(law, stretch), slope, rtol=1e-8, atol=1e-6)
        for model, free in (("3d", [0, 1]), ("plane_strain", [0]), ("plane_stress", [0, 2]), ("axisymmetric", [0, 2])):
            found = nominal(law, stretches(Press(None, model, law)))
            assert np.abs(found[free]).max() <= 1e-12 * np.abs(found).max()
