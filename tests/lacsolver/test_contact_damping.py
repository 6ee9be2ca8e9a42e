"""Damping of soft contact in motion, `[[contact]] damping`, against the damped oscillator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lacsolver.case import CaseError, parse_case
from lacsolver.contact.curves import Exponential, Linear, Table
from lacsolver.contact.damping import Damped
from lacsolver.contact.laws import RowState
from lacsolver.results.motion import ENERGIES
from tests.lacsolver.moving import PLANE, SPACE, held_sideways, moved, steps, thrown, unbalanced
from verification.meshes.bars import bar_on_wall, bars

#: mass, stiffness and damping of the contact, per area
M, K, C = 1.0, 4.0, 0.6
#: a bar that is as good as rigid
STIFF = "[[material]]\nyoung = 1e5\npoisson = 0.0\ndensity = 1.0\n"
WALL = f'[[contact]]\nslave = "slave"\nmaster = "wall"\nstiffness = {K}\ndamping = {C}\n[[rigid]]\ngroup = "wall"\n'


LOAD = '[[pressure]]\ngroup = "top"\nvalue = "0.4 * t if t <= 1 else 0.3 + 0.1 * cos(3 * (t - 1))"\n'


def oscillator(t):
    """Overlaps and their rates, (2, n), of M y'' + C y' + K y = 0.3 + 0.1 cos 3 t from rest at the first load on."""
    by = solve_ivp(lambda t, y: [y[1], (0.3 + 0.1 * np.cos(3 * t) - K * y[0] - C * y[1]) / M], (0, 10), [0.1, 0.0],
                   rtol=1e-11, atol=1e-13, dense_output=True)  # fmt: skip
    return by.sol(t)


def swung(times, dynamics="", kinematics="small"):
    """A bar on its soft foundation, pressed and then shaken: times, overlaps, motions."""
    law = 'kinematics = "finite"\n' + STIFF.replace("young", 'law = "saint_venant_kirchhoff"\nyoung')
    text = PLANE + (STIFF if kinematics == "small" else law) + WALL + held_sideways() + LOAD
    text += f"[dynamics]\nstart = 1.0\n{dynamics}[steps]\ntimes = {[1.0, *(1 + np.asarray(times)).tolist()]}\n"
    _, states, motions = moved(text, bar_on_wall("QUAD4", 2))
    return np.array([s.time - 1 for s in states]), -np.array([s.zones[0].gap.mean() for s in states]), motions


def even(count, end=4.0):
    """Times of equal steps."""
    return end * np.arange(1, count + 1) / count


@pytest.mark.parametrize("dynamics", ["", pytest.param('scheme = "newmark"\n', marks=pytest.mark.slow)])
def test_the_damped_oscillator(dynamics):
    """Overlaps are those of the exact damped oscillation, with errors that fall with the square of the step."""
    errors = []
    for count in (40, 80):
        t, overlap, motions = swung(even(count), dynamics)
        errors.append(np.abs(overlap - oscillator(t)[0]).max() / 0.05)
        assert unbalanced(motions) < 1e-9
    assert errors[1] < 0.006
    assert errors[1] < errors[0] / 3.3


def test_the_energy_that_is_taken():
    """`damped` is the work of the damper, and what is left of kinetic and stored energy falls."""
    t, overlap, motions = swung(even(160, 6.0), 'scheme = "newmark"\n')
    width, fine = 0.25, np.linspace(0, t[-1], 20001)
    rate = oscillator(fine)[1]
    taken = width * C * np.trapezoid(rate**2, fine)
    energies = np.array([m.energies for m in motions])
    damped = energies[:, ENERGIES.index("damped")]
    np.testing.assert_allclose(damped[-1], taken, rtol=6e-3)
    stored = energies[:, 0] + energies[:, 1] + 0.5 * width * K * overlap**2
    given = width * np.concatenate(
        [[0.0], np.cumsum(np.diff(overlap) * (0.3 + 0.1 * np.cos(3 * (t[1:] + t[:-1]) / 2)))]
    )
    np.testing.assert_allclose(stored - stored[0] - (given - given[0]) + damped - damped[0], 0.0, atol=2e-3 * taken)
    assert (np.diff(damped) >= -1e-4 * taken).all()


def test_finite_kinematics_swing_alike():
    """Steps are halved there, as the foundation stores energy: both are near the exact oscillation."""
    for kinematics in ("small", "finite"):
        t, overlap, _ = swung([0.02], kinematics=kinematics)
        np.testing.assert_allclose(overlap - 0.1, oscillator(t)[0] - 0.1, atol=2e-6)


@pytest.mark.parametrize("damping", [0.6, 3.0])
def test_an_impact_loses_what_the_damper_takes(damping):
    """A bar strikes: restitution as of the oscillator until p = 0; it never pulls, and energy never grows."""
    v = 0.1
    c = damping / M
    fly = solve_ivp(lambda t, y: [y[1], -(K * y[0] + damping * y[1]) / M], (0, 6), [0, v], rtol=1e-10, atol=1e-12,
                    dense_output=True)  # fmt: skip
    leaves = brentq(lambda t: K * fly.sol(t)[0] + damping * fly.sol(t)[1], 0.2 / (1 + c), 3.0)
    back = -fly.sol(leaves)[1]
    text = PLANE + STIFF + WALL.replace(f"damping = {C}", f"damping = {damping}") + held_sideways()
    text += thrown("bar", vy=-v) + "[dynamics]\n" + steps(3.5, 200)
    _, states, motions = moved(text, bar_on_wall("QUAD4", 2, 0.2 * v))
    energies = np.array([m.energies for m in motions])
    o = np.maximum(-np.array([s.zones[0].gap.mean() for s in states]), 0.0)
    whole = energies[:, 0] + 0.25 * 0.5 * K * o**2
    assert (np.diff(whole) <= 2e-3 * whole[0]).all()
    assert all((s.zones[0].pressure >= 0).all() for s in states)
    assert not states[-1].zones[0].pressure.any()
    np.testing.assert_allclose(energies[-1, 0] / energies[0, 0], (back / v) ** 2, atol=0.01)
    assert unbalanced(motions) < 1e-9


@pytest.mark.parametrize("base", [
    Linear(stiffness=4.0), Exponential(at_contact=1.0, clearance=0.1),
    Table(rows=((0.0, -0.05), (1.0, 0.0), (9.0, 0.1))),
])  # fmt: skip
def test_the_law_is_continuous_and_its_equation_its_tangent(base):
    """The pressure falls with the gap, from 0 at the reach on; the equation has its value and slope."""
    law = Damped(base=base, damping=2.0, dt=0.05)
    for history in ([1.0, 0.03, 0.4, 0.05, 0], [1.0, 0.001, -1.0, 0.05, 0], [1.0, 0.0, 0.0, 0.0, 0], [0.0] * 5):
        gap = base.reach - np.linspace(-0.02, 0.2, 4001)
        one = np.ones(len(gap))
        rows = RowState(gap, 0 * one, one > 0, 1e-3 * one, np.tile(history, (len(gap), 1)))
        p = law.total(rows)
        steepest = (base.slope(gap).max() + 2.0 * 1.5 / 0.05) * 0.22 / 4000
        assert (np.diff(p) >= 0).all()
        assert np.diff(p).max() <= 1.01 * steepest
        assert not p[gap >= base.reach].any()
        offset, compliance = law.linearise(rows._replace(pressure=p))
        on = p > 1e-9
        np.testing.assert_allclose((gap + compliance * p - offset)[on], 0.0, atol=1e-9)
        slope = np.diff(p) / -np.diff(gap)
        smooth = on[1:] & on[:-1] & (np.abs(slope * compliance[1:] - 1) < 0.02)
        assert smooth[on[1:]].mean() > 0.98


def test_steps_of_unlike_sizes_keep_the_order():
    """Every third step is shorter: the rate of the overlap knows the steps' sizes."""
    t, overlap, _ = swung(np.cumsum([0.08 if k % 3 else 0.03 for k in range(60)]), 'scheme = "newmark"\n')
    assert np.abs(overlap - oscillator(t)[0]).max() / 0.05 < 0.02


def test_bodies_on_a_gasket_in_space():
    """Friction, a table, and two bodies that do not match: the account of energy closes, and damping takes."""
    text = SPACE + "[[material]]\nyoung = 1.0\npoisson = 0.3\ndensity = 1.0\n"
    text += '[[contact]]\nslave = "slave"\nmaster = "master"\nlaw = "table"\nfriction = 0.2\ndamping = 0.3\n'
    text += "pressures = [[0.0, 0.0], [0.1, 0.02], [1.0, 0.05]]\n"
    text += '[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\nuz = 0.0\n'
    text += thrown("upper", vz=-0.1, vx=0.02) + "[dynamics]\n" + steps(1.0, 20)
    _, states, motions = moved(text, bars(("HEXA8", "TETRA4"), (3, 2), (2, 1), 0.01))
    taken = np.array([m.energies[ENERGIES.index("damped")] for m in motions])
    assert taken[-1] > 1e-6
    assert unbalanced(motions) < 1e-8
    assert max(s.zones[0].pressure.max() for s in states) > 0.01


@pytest.mark.parametrize(("more", "words"), [
    ("stiffness = 4.0\ndamping = 1.0\n", "goes with velocities, and there are none without"),
    ("damping = 1.0\n[dynamics]\n", "acts on an overlap, which rigid contact does not have"),
    ("stiffness = 4.0\ndamping = -1.0\n[dynamics]\n", "damping"),
    ('type = "bilateral"\nstiffness = 4.0\ndamping = 1.0\n[dynamics]\n', "damping"),
])  # fmt: skip
def test_what_is_refused(more, words):
    with pytest.raises(CaseError, match=words):
        parse_case(PLANE + STIFF + '[[contact]]\nslave = "slave"\nmaster = "wall"\n' + more)
