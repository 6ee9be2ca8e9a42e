"""Hertz's half-spaces: the closed form is in equilibrium, meets Hooke's law at its edge, and closes the gap."""

from __future__ import annotations

import numpy as np
import pytest

from verification.exact.half_space import about_axis, contact_modulus, peak_pressure, plane, strains

A, P0, E, NU = 1.3, 2.0, 3.0, 0.3
STEP = 1e-5
POTENTIALS = {"plane": plane, "axis": about_axis}


@pytest.fixture
def inside():
    rng = np.random.default_rng(0)
    return rng.uniform(0.05, 3, 60), rng.uniform(0.05, 3, 60)


def at(name, r, z):
    return strains(POTENTIALS[name](r, z, A, P0), z, E, NU)


def slope(f, r, z, axis):
    dr, dz = (STEP, 0) if axis == 0 else (0, STEP)
    return (f(r + dr, z + dz) - f(r - dr, z - dz)) / (2 * STEP)


@pytest.mark.parametrize("name", POTENTIALS)
def test_strains_are_those_of_the_displacement(name, inside):
    r, z = inside
    found = at(name, r, z)
    u_r, u_z = (lambda r, z: at(name, r, z).u_r), (lambda r, z: at(name, r, z).u_z)
    np.testing.assert_allclose(slope(u_r, r, z, 0), found.rr, atol=1e-8)
    np.testing.assert_allclose(slope(u_z, r, z, 1), found.zz, atol=1e-8)
    np.testing.assert_allclose((slope(u_r, r, z, 1) + slope(u_z, r, z, 0)) / 2, found.rz, atol=1e-8)
    np.testing.assert_allclose(found.tt, found.u_r / r if name == "axis" else 0.0, atol=1e-14)


def stresses(name, r, z):
    """rr, tt, zz, rz."""
    lam, mu = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    e = at(name, r, z)
    trace = e.rr + e.tt + e.zz
    return (*(lam * trace + 2 * mu * c for c in (e.rr, e.tt, e.zz)), 2 * mu * e.rz)


@pytest.mark.parametrize("name", POTENTIALS)
def test_stresses_are_in_equilibrium(name, inside):
    r, z = inside
    parts = [lambda r, z, k=k: stresses(name, r, z)[k] for k in range(4)]
    rr, tt, _, rz = stresses(name, r, z)
    round_ = name == "axis"
    along_r = slope(parts[0], r, z, 0) + slope(parts[3], r, z, 1) + round_ * (rr - tt) / r
    along_z = slope(parts[3], r, z, 0) + slope(parts[2], r, z, 1) + round_ * rz / r
    np.testing.assert_allclose(along_r, 0, atol=1e-7)
    np.testing.assert_allclose(along_z, 0, atol=1e-7)


@pytest.mark.parametrize("name", POTENTIALS)
def test_the_surface_is_pressed_as_hertz_says_and_free_beside(name):
    r = np.linspace(0, 2, 41)
    _, _, zz, rz = stresses(name, r, np.zeros_like(r))
    np.testing.assert_allclose(zz, -P0 * np.sqrt(np.maximum(1 - (r / A) ** 2, 0)), atol=1e-12)
    np.testing.assert_allclose(rz, 0, atol=1e-12)


@pytest.mark.parametrize("name", POTENTIALS)
def test_the_surface_fits_the_clearance(name):
    """u_z(0) - u_z(r) = r^2 / 2R where the bodies touch, less beyond; p0 from R as Johnson has it."""
    radius = 7.0
    p0 = peak_pressure(A, radius, contact_modulus([(E, NU)]), plane=name == "plane")
    r = np.linspace(0, 2, 41)
    found = strains(POTENTIALS[name](r, np.zeros_like(r), A, p0), np.zeros_like(r), E, NU)
    gap = r**2 / (2 * radius) - (found.u_z[0] - found.u_z)
    np.testing.assert_allclose(gap[r <= A], 0, atol=1e-12)
    assert (gap[r > A + 0.02] > 0).all()


def test_near_the_axis_the_limit_goes_on():
    z = np.linspace(0, 2, 9)
    near, off = (about_axis(np.full(9, r), z, A, P0).hoop for r in (0.99e-4 * A, 1.01e-4 * A))
    np.testing.assert_allclose(near, off, rtol=1e-6)


def test_two_bodies_are_softer_than_one():
    assert contact_modulus([(E, NU), (E, NU)]) == pytest.approx(contact_modulus([(E, NU)]) / 2)
