"""Energy that soft contact stores: it comes back, and counts neither as taken nor as made."""

import itertools

import numpy as np
import pytest

from lacsolver.contact.curves import Exponential, Linear, Table
from lacsolver.contact.laws import Bilateral, RowState
from lacsolver.results.motion import CONTACT, ENERGIES, STORED, doubtful_energy
from tests.lacsolver.moving import PLANE, held_sideways, moved, steps, thrown, unbalanced
from tests.samples import each_option
from verification.meshes.bars import bar_on_wall

LAWS = {
    "linear": "stiffness = 4.0\n",
    "exponential": 'law = "exponential"\npressure_at_contact = 0.4\nclearance_at_zero = 0.1\n',
    "table": 'law = "table"\npressures = [[0.0, -0.02], [0.1, 0.0], [0.9, 0.1]]\n',
}
SOFT = ENERGIES.index("soft_contact")


def on_foundation(law, kinematics, more):
    """A bar that is as good as rigid, on a soft foundation."""
    own = 'law = "saint_venant_kirchhoff"\n' if kinematics == "finite" else ""
    text = f'{PLANE}kinematics = "{kinematics}"\n[[material]]\n{own}young = 1e5\npoisson = 0.0\ndensity = 1.0\n'
    return text + f'[[contact]]\nslave = "slave"\nmaster = "wall"\n{LAWS[law]}[[rigid]]\ngroup = "wall"\n' + more


@pytest.mark.parametrize("law", [
    Linear(stiffness=4.0), Exponential(at_contact=1.0, clearance=0.1),
    Table(rows=((0.0, -0.05), (1.0, 0.0), (9.0, 0.1), (30.0, 0.2))),
])  # fmt: skip
def test_the_energy_of_a_curve_is_the_area_under_it(law):
    gap = np.linspace(law.reach + 0.05, -0.3, 20001)
    p = law.pressure(gap)
    area = np.append(0.0, np.cumsum(0.5 * (p[1:] + p[:-1]) * -np.diff(gap)))
    np.testing.assert_allclose(law.energy(gap), area, atol=1e-6 * area[-1])


def test_springs_store_what_their_pressures_say():
    """A bilateral spring is the same in tension as in compression, and rigid contact stores nothing."""
    p, none = np.array([3.0, -3.0]), np.zeros(2)
    rows = RowState(none, p, none > 1, none + 1, np.empty((2, 0)))
    assert Bilateral(compliance=0.5).stored(rows).tolist() == [2.25, 2.25]
    assert not Bilateral().stored(rows).any()


@pytest.mark.parametrize(("law", "kinematics"), each_option(itertools.product(LAWS, ("small", "finite"))))
def test_a_bar_bounces(law, kinematics):
    """Contact takes nothing of what it stores; no step is halved for it, and nothing is warned of."""
    more = held_sideways() + thrown("bar", vy=-0.1) + "[dynamics]\n" + steps(3.0, 40)
    _, states, motions = moved(on_foundation(law, kinematics, more), bar_on_wall("QUAD4", 2, 0.05))
    table = np.array([m.energies for m in motions])
    start = table[0, STORED].sum()
    assert unbalanced(motions) < 1e-8
    assert table[:, SOFT].max() > 0.9 * start
    assert not table[-1, SOFT]
    assert np.abs(table[:, CONTACT]).max() < 0.01 * start
    assert len(states) == 40
    assert doubtful_energy([s.time for s in states], table, True) is None


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_foundation_that_was_pressed_throws_the_bar(kinematics):
    """The energy that static steps have stored is there at the start, and becomes motion, with nothing added."""
    load = '[[pressure]]\ngroup = "top"\nvalue = "0.4 if t < 1.001 else 0"\n'
    times = [1.0, *np.linspace(1.002, 3, 41).tolist()]
    more = held_sideways() + load + f"[dynamics]\nstart = 1.0\n[steps]\ntimes = {times}\n"
    _, states, motions = moved(on_foundation("linear", kinematics, more), bar_on_wall("QUAD4", 2))
    table, start = np.array([m.energies for m in motions]), 0.25 * 0.5 * 0.4**2 / 4.0
    assert table[0, SOFT] == pytest.approx(start, rel=1e-4)
    assert table[-1, 0] == pytest.approx(start, rel=0.02)
    assert not table[-1, SOFT]
    assert doubtful_energy([s.time for s in states], table, True) is None
