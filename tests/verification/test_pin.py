"""A pin in a hole: Persson's pressure against its load, the displacements against Hooke's law and the gap."""

from __future__ import annotations

import numpy as np
import pytest

from verification.exact.pin import PinInHole

PIN = PinInHole(radius=12.0, clearance=0.2, young=210e3, poisson=0.3, angle=60.0)
STEP = 1e-3


def around(r, angle):
    return r * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("angle", [20.0, 60.0, 85.0])
def test_the_pressure_carries_the_force(angle):
    pin = PinInHole(12.0, 0.2, 210e3, 0.3, angle)
    t = (np.arange(200_000) + 0.5) / 200_000 * np.pi
    assert 2 * np.pi * np.mean(pin.pressure(t) * np.cos(t)) * pin.radius == pytest.approx(pin.force, rel=1e-5)
    assert not pin.pressure(t[t > np.radians(angle)]).any()


def test_the_gap_is_closed_where_there_is_pressure_and_open_beyond():
    t = np.radians(np.arange(0.0, 180.0, 5.0))
    n = around(1.0, t)
    apart = PIN.displacement(12 * n, "plate") - PIN.displacement(12 * n, "pin")
    gap = PIN.clearance + (apart * n).sum(axis=1)
    inside = t < np.radians(52)
    assert np.abs(gap[inside]).max() < 1e-6
    assert gap[t > np.radians(62)].min() > 1e-3


def strain(x, body):
    """(n, 2, 2): of the displacement, by differences."""
    step = STEP * np.eye(2)
    slope = [(PIN.displacement(x + d, body) - PIN.displacement(x - d, body)) / (2 * STEP) for d in step]
    grad = np.stack(slope, axis=2)
    return (grad + grad.swapaxes(1, 2)) / 2


def stress(x, body):
    lame, mu = PIN.young * PIN.poisson / (1 + PIN.poisson) / (1 - 2 * PIN.poisson), PIN.young / 2 / (1 + PIN.poisson)
    e = strain(x, body)
    return lame * np.trace(e, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 2 * mu * e


@pytest.mark.parametrize(("body", "radius"), [("pin", 6.0), ("plate", 24.0)])
def test_bodies_are_in_equilibrium(body, radius):
    """No force in the body, and across a circle all of the force."""
    x = around(radius, np.linspace(0, 2 * np.pi, 7)[:-1] + 0.1)
    h = 1e-2
    div = sum((stress(x + d, body) - stress(x - d, body))[:, :, k] / (2 * h) for k, d in enumerate(h * np.eye(2)))
    assert np.abs(div).max() < 1e-4 * np.abs(stress(x, body)).max() / radius * 10
    t = (np.arange(720) + 0.5) / 720 * 2 * np.pi
    n = around(1.0, t)
    pull = np.einsum("pij,pj->pi", stress(radius * n, body), n).mean(axis=0) * 2 * np.pi * radius
    np.testing.assert_allclose(pull, [-PIN.force, 0.0], rtol=1e-4, atol=1.0)


def test_the_edge_of_the_pin_bears_the_pressure_and_no_shear():
    t = np.radians([5.0, 30.0, 45.0, 90.0, 150.0])
    n = around(1.0, t)
    sigma = stress((12 - 2 * STEP) * n, "pin")
    pull = np.einsum("pij,pj->pi", sigma, n)
    tolerance = 0.02 * PIN.pressure(np.zeros(1))[0]
    np.testing.assert_allclose((pull * n).sum(axis=1), -PIN.pressure(t), atol=tolerance)
    np.testing.assert_allclose(
        pull @ np.array([0.0, 0.0]) + pull[:, 0] * -n[:, 1] + pull[:, 1] * n[:, 0], 0, atol=tolerance
    )
