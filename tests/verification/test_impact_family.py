"""The family of impacts: small ones pass, a plain mass fails, and the exact solutions are what they should be."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from verification.exact.impact import SDNL111, SDNL111_TIMES, hertz, modulus, rod_pressure, speed_for
from verification.families.impact import FAMILY, solve_case
from verification.families.impact_runs import Impact, on_wall
from verification.meshes.balls import sphere_on_wall
from verification.meshes.thrown import two_rings


def case(name):
    return next(one for one in FAMILY.cases if one.name == name)


def test_a_plain_mass_fails_as_it_must():
    results = solve_case(case("plain-mass"), 1).results
    assert all(result.passed for result in results) and len(results) == 3


def test_the_error_of_a_plain_mass_would_be_seen():
    """Mutation: the criteria of the wall are not met with mass on the skin."""
    made, error = on_wall(Impact("wall", cfl=0.25, dynamics=(("scheme", "newmark"), ("massless", "none"))), 8)
    assert error > 0.02 and made.whole.max() > 1.001
    _, right = on_wall(Impact("wall", cfl=0.25, dynamics=(("scheme", "newmark"),)), 8)
    assert right < error / 5


def test_bars_by_characteristics():
    """sdnl111: the free bar's face moves at -1 until the touch, then for 2 L / c at -1/2, as long at 1/2, then at 1."""
    touch, wave = 1e-5, 2 / np.sqrt(modulus(2e11, 0.3) / 7800)
    ends = [0.0, touch, touch + wave, touch + 2 * wave, 1.0]
    places = np.concatenate([[0.0], np.cumsum(np.diff(ends) * [-1.0, -0.5, 0.5, 1.0])])
    np.testing.assert_allclose(np.interp(SDNL111_TIMES, ends, places), SDNL111, rtol=1e-3)


def test_the_rod_has_period_3_and_hertz_is_consistent():
    t = np.linspace(0.05, 8.95, 90)
    np.testing.assert_array_equal(rod_pressure(t), rod_pressure(t + 3))
    speed = speed_for(1e-3, 2.0, 5.0, 0.3, 1.5)
    found = hertz(2.0, 5.0, 0.3, 1.5, speed)
    assert found.approach == pytest.approx(1e-3)
    mass = 4 / 3 * np.pi * 8 * 1.5
    assert 0.4 * found.force * found.approach == pytest.approx(0.5 * mass * speed**2)  # the work of the force


def test_the_sphere_is_one():
    mesh = sphere_on_wall(0.1, 0.02)
    x = mesh.points[np.unique(mesh.block("QUAD4"))]
    assert np.hypot(x[:, 0], x[:, 1] - 1.02).max() == pytest.approx(1.0)
    assert x[:, 1].min() == pytest.approx(0.02) and x[:, 1].max() == pytest.approx(2.02)


def test_a_coarse_disc_is_thrown():
    """The three cases of large deformation are made alike: energy is kept, and the static twin is solved."""
    with patch("verification.families.impact_finite._STEP", 0.02):
        given = Impact("disc", n=3, dynamics=(("scheme", "newmark"),), young=100.0, speed=0.5)
        results = solve_case(replace(case("thrown-disc"), parameters=given), 1).results
    found = {result.quantity: result for result in results}
    assert all(result.passed for result in found.values()) and len(found) == 7
    assert 0.97 < found["smallest energy"].value < 1 and found["openings"].value == 1
    assert found["Newton iterations of 10 static steps"].value > 1


def test_two_rings_do_not_match():
    mesh = two_rings((12, 8), 2, 0.1)
    skins = (mesh.select(mesh.cells_of(name)) for name in ("slave", "master"))
    slave, master = (np.unique(np.concatenate([nodes for *_, nodes in skin])) for skin in skins)
    assert (len(slave), len(master)) == (12, 8)
    x = mesh.points[:, 0]
    assert x[slave].max() == pytest.approx(-0.05) and x[master].min() == pytest.approx(0.05)
