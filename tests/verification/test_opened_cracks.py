"""Exact solutions of cracks that a pressure opens: in equilibrium, with the pressure on their faces, closed beyond."""

from __future__ import annotations

import numpy as np
import pytest

from verification.exact.opened_cracks import EdgeCrack, PennyCrack


def stress_of(u, x, exact, h):
    """Stress (n, d, d) of a displacement field at points (n, d), by central differences."""
    d = x.shape[1]
    gradient = np.stack([(u(x + h * e) - u(x - h * e)) / (2 * h) for e in np.eye(d)], axis=-1)
    lame = exact.young * exact.poisson / (1 + exact.poisson) / (1 - 2 * exact.poisson)
    shear = exact.young / 2 / (1 + exact.poisson)
    trace = np.trace(gradient, axis1=1, axis2=2)[:, None, None]
    return lame * trace * np.eye(d) + shear * (gradient + gradient.swapaxes(1, 2))


@pytest.mark.parametrize("n", [1, 3])
def test_the_edge_crack(n):
    exact = EdgeCrack(n)
    x = np.random.default_rng(0).uniform(-1, 1, (40, 2))
    s, wanted = stress_of(exact.displacement, x, exact, 1e-5), exact.stress(x)
    np.testing.assert_allclose(np.stack([s[:, 0, 0], s[:, 1, 1], s[:, 0, 1]], axis=1), wanted, atol=1e-7)
    h = 1e-4
    rows = [[0, 2], [2, 1]]
    force = sum(
        (exact.stress(x + h * e) - exact.stress(x - h * e))[:, rows[k]] / (2 * h) for k, e in enumerate(np.eye(2))
    )
    np.testing.assert_allclose(force, 0, atol=1e-4)
    above, below = np.array([[-0.3, 0.0]]), np.array([[-0.3, -1e-300]])
    np.testing.assert_allclose(exact.stress(above)[0, 1:], [-exact.pressure, 0], atol=1e-9)
    jump = exact.displacement(above) - exact.displacement(below)
    np.testing.assert_allclose(jump[0], [0, exact.opening(np.array([0.3]))[0]], atol=1e-12)


def test_the_penny_shaped_crack():
    exact = PennyCrack()

    def u(x):
        r = np.hypot(x[:, 0], x[:, 1])
        v = exact.displacement(r, x[:, 2])
        return np.stack([v[:, 0] * x[:, 0] / r, v[:, 0] * x[:, 1] / r, v[:, 1]], axis=1)

    x = np.random.default_rng(0).uniform(0.3, 2, (30, 3))
    h = 1e-3
    force = sum(
        (stress_of(u, x + h * e, exact, h) - stress_of(u, x - h * e, exact, h))[:, :, k] / (2 * h)
        for k, e in enumerate(np.eye(3))
    )
    np.testing.assert_allclose(force, 0, atol=1e-3)
    s = stress_of(u, np.array([[0.3, 0.2, 2e-3]]), exact, h)[0]
    np.testing.assert_allclose(s[:, 2], [0, 0, -exact.pressure], atol=1e-4)
    r = np.array([0.2, 0.9, 1.1, 1.7])
    np.testing.assert_allclose(2 * exact.displacement(r, 0 * r)[:, 1], exact.opening(r), atol=1e-10)
    assert np.abs(exact.displacement(np.array([60.0]), np.array([80.0]))).max() < 1e-3 * exact.opening(np.zeros(1))[0]
