"""The answer does not depend on how the model is written down: in which units, where, how turned, in what order."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lacmesh.errors import LacmeshWarning
from tests.lacsolver.invariant_cases import CASES as PLAIN
from tests.lacsolver.invariant_cases import brought_back, compared, figures
from tests.lacsolver.joined_cases import JOINED, OF_TWO_SIZES, solved_stacks, two_sizes
from tests.samples import each_option
from verification.meshes.stacks import tilt

#: of figures, relative; of coordinates that are rounded, against the shift over the size of a cell
EXACT, ROUNDING = 1e-9, 1e-15
#: cells are at least so large, and models so large
CELL, SIZE = 0.2, 2.0
#: factors of lengths and of stresses; forces change by both
UNITS = ((1e-6, 1e-12), (1e6, 1e12))
#: units of length alone, and of forces alone
ONE_UNIT = ((1e-3, 1.0), (1e3, 1.0), (1e-6, 1.0), (1.0, 1e9))
FAR = (1e7, 1e3)
#: directions of a shift; an axisymmetric model moves along its axis
AWAY = {"axisymmetric": np.array([0.0, 1.0, 0.0]), "3d": np.array([1.0, -0.7, 0.4])}
CASES = PLAIN | JOINED
MODELS = pytest.mark.parametrize("name", PLAIN)


@cache
def base(name):
    """The figures of a case as it stands."""
    case = CASES[name]
    return figures(case, case.world)


def check(name, world, allowed=EXACT, one=None, iterations=True):
    """Assert that a case in a world has the same results, after the same number of `iterations`."""
    same, active, far = compared(base(name) if one is None else one, figures(CASES[name], world))
    assert active
    worst = max(far, key=far.get)
    assert far[worst] <= allowed, (worst, far[worst])
    assert same or not iterations


@pytest.mark.parametrize(("name", "length", "stress"), each_option((name, *units) for name in PLAIN for units in UNITS))
def test_in_other_units(name, length, stress):
    check(name, replace(CASES[name].world, length=length, stress=stress))


@pytest.mark.parametrize(
    ("name", "length", "stress"), each_option((name, *units) for name in JOINED for units in (*ONE_UNIT, *UNITS))
)
def test_joined_in_other_units(name, length, stress):
    check(name, replace(CASES[name].world, length=length, stress=stress))


@pytest.mark.parametrize("name", [name for name in JOINED if name != "rubbing in space"])
def test_joined_and_turned(name):
    """Tangents of friction in space depend on the axes of the mesh, which tells where faces of a macro-element bend."""
    check(name, replace(CASES[name].world, turn=turned(CASES[name])), iterations=False)


#: the round-off of its coordinates limits the small one of some
RATIOS = [
    (name, ratio)
    for ratio in (1e4, 1e5, 1e6)
    for name in OF_TWO_SIZES
    if (name, ratio) != ("hung in space, finite", 1e6)
]


@pytest.mark.parametrize(("name", "ratio"), each_option(RATIOS))
def test_contacts_of_two_sizes_in_one_model(name, ratio):
    """Each is as in a model of its own, to the round-off of the coordinates of the small one."""
    together, *alone = two_sizes(name, ratio)
    for zone, own in zip(together.zones, alone, strict=True):
        assert (zone.status == own.zones[0].status).all()
        far = np.abs(zone.pressure - own.zones[0].pressure).max()
        assert far <= max(1e-8, 3e-14 * ratio) * own.zones[0].pressure.max()


def test_multigrid_warns_of_bodies_that_are_much_smaller_than_others():
    with pytest.warns(LacmeshWarning, match="of the largest one, and multigrid solves all with one accuracy"):
        solved_stacks("pushed", (1.0, 1e-4), (0, 1), 'backend = "multigrid"\n')


def options_of(row):
    """Model, kinematics and normals of a case, and whether formulas of the place are in it."""
    case = CASES[row[0]]
    text = case.sections(case.world)
    return case.model, case.finite, (case.model, "smoothed" in text), "* (x - " in text


@pytest.mark.parametrize(("name", "far"), each_option(itertools.product(PLAIN, FAR), of=options_of))
def test_somewhere_else(name, far):
    """Compared with the model whose coordinates are rounded as they are there, where it stands."""
    case = CASES[name]
    shift = far * SIZE * AWAY.get(case.model, np.array([1.0, -0.7, 0.0]))
    there = replace(case.world, shift=shift)
    one = figures(case, case.world, brought_back(case, there))
    check(name, there, np.abs(shift).max() * ROUNDING / CELL, one)


def turned(case):
    """A rotation in space or in the plane; about an axis there is none."""
    return np.eye(3) if case.model == "axisymmetric" else tilt(case.dim, 2.5)


def mirrored(case):
    """A reflection in x; about an axis along it."""
    axis = 1 if case.model == "axisymmetric" else 0
    return np.diag(np.where(np.arange(3) == axis, -1.0, 1.0))


@MODELS
def test_turned_and_mirrored_and_in_another_order(name):
    """Nodes, cells, blocks, groups and sections are in another order."""
    case = CASES[name]
    check(name, replace(case.world, turn=turned(case) @ mirrored(case), seed=1), iterations=False)


@pytest.mark.slow
@MODELS
@pytest.mark.parametrize("alone", ["turned", "mirrored", "in another order"])
def test_one_of_these_alone(name, alone):
    case = CASES[name]
    changes = {"turned": {"turn": turned(case)}, "mirrored": {"turn": mirrored(case)}, "in another order": {"seed": 1}}
    check(name, replace(case.world, **changes[alone]), iterations=False)
