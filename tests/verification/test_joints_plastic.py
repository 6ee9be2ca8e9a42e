"""Metals that yield: the exact solutions against equilibrium, and cases of the family on their coarsest levels."""

import numpy as np
import pytest

from verification.exact.plastic import Sphere, Tube
from verification.families import joints


def test_the_sphere_is_continuous_and_follows_hooke_outside_its_front():
    """Twice the hoop strain plus the radial one is the volume's, (1 - 2 nu) / E times the mean stress times 3."""
    sphere = Sphere(1.0, 2.0, 1.5, 500.0, 0.3, 1.0)
    at = np.array([1.5 - 1e-9, 1.5 + 1e-9])
    assert np.diff(sphere.displacement(at)) == pytest.approx(0.0, abs=1e-10)
    for r in (1.2, 1.7):
        h = 1e-5
        slope = (sphere.displacement(np.array([r + h])) - sphere.displacement(np.array([r - h])))[0] / (2 * h)
        radial = -sphere.pressure + 2 * np.log(r) if r < 1.5 else -2 / 3 * (1.5**3 / 8) * (8 / r**3 - 1)
        hoop = radial + 1.0 if r < 1.5 else 2 / 3 * (1.5**3 / 8) * (4 / r**3 + 1)
        volume = slope + 2 * sphere.displacement(np.array([r]))[0] / r
        assert volume == pytest.approx((1 - 0.6) / 500 * (radial + 2 * hoop), rel=1e-6)


def test_the_tube_balances_forces():
    """For small motions the pressure is that of elasticity; in perfect plasticity it is 2 / sqrt(3) Y ln(b / a)."""
    tube = Tube(1.0, 2.0, 100.0, 1.0, 0.0, 0.0)
    assert tube.pressure(1e-6) == pytest.approx(2 * 100 * 1e-6 * (1 - 1 / 4), rel=1e-5)
    moved = 0.5
    b = np.sqrt(4 + 1.5**2 - 1)
    assert tube.pressure(moved) == pytest.approx(2 / np.sqrt(3) * np.log(b / 1.5), rel=1e-9)


@pytest.mark.parametrize("name", ["yielding_sphere_quad4", "cyclic_plate", "first_yield_axisymmetric"])
def test_cases_pass_on_coarse_levels(name):
    (case,) = [case for case in joints.FAMILY.cases if case.name == name]
    assert all(result.passed for result in case.solve(levels=min(3, max(case.levels.values()))).results)
