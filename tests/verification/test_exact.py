"""Exact solutions without friction, against a second derivation: Hooke's law, equilibrium, surfaces, differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacsolver.case import Value
from verification.exact.half_space import about_axis, contact_modulus, peak_pressure, plane, strains
from verification.exact.impact import SDNL111, SDNL111_TIMES, hertz, modulus, speed_for
from verification.exact.lame import Fit, Shell
from verification.exact.opened_cracks import EdgeCrack, PennyCrack
from verification.exact.pin import PinInHole
from verification.exact.plastic import Sphere, Tube
from verification.exact.sources import Law, derive
from verification.families.manufactured import LAW, PLANE, SOLID
from verification.families.press_fit import PressFit


def gradient(displacement, x, step=1e-5):
    """(n, dim, dim): du_i / dx_j by differences."""
    steps = step * np.eye(x.shape[1])
    return np.stack([(displacement(x + h) - displacement(x - h)) / (2 * step) for h in steps], axis=-1)


def hooke(slope, young, poisson):
    """Stress (n, dim, dim) of a displacement gradient, plane strain or space."""
    strain = (slope + slope.swapaxes(1, 2)) / 2
    two_mu, dim = young / (1 + poisson), slope.shape[-1]
    lam = two_mu * poisson / (1 - 2 * poisson)
    return two_mu * strain + lam * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(dim)


def stress_of(displacement, body, step):
    """The stress at points of a displacement field in a body that has a Young's modulus and a Poisson's ratio."""
    return lambda x: hooke(gradient(displacement, x, step), body.young, body.poisson)


def divergence(stress, x, step):
    """(n, dim): the force on a unit volume that stresses leave over."""
    return np.trace(gradient(stress, x, step), axis1=2, axis2=3)


# ---- Hertz's half-spaces

A, P0, E, NU = 1.3, 2.0, 3.0, 0.3
POTENTIALS = {"plane": plane, "axis": about_axis}
SPACES = pytest.mark.parametrize("name", POTENTIALS)


def at(name, x, p0=P0):
    return strains(POTENTIALS[name](*x.T, A, p0), x[:, 1], E, NU)


def strain_of(name, x):
    """(n, 3, 3): along r, along z, around."""
    e, strain = at(name, x), np.zeros((len(x), 3, 3))
    strain[:, 0, 0], strain[:, 1, 1], strain[:, 2, 2] = e.rr, e.zz, e.tt
    strain[:, 0, 1] = strain[:, 1, 0] = e.rz
    return strain


def pressed(name, x):
    return hooke(strain_of(name, x), E, NU)


@SPACES
def test_half_spaces_are_in_equilibrium_and_pressed_as_hertz_says(name):
    x = np.random.default_rng(0).uniform(0.05, 3, (60, 2))
    slope = gradient(lambda x: np.stack([at(name, x).u_r, at(name, x).u_z], axis=1), x)
    strain, s = strain_of(name, x), pressed(name, x)
    np.testing.assert_allclose((slope + slope.swapaxes(1, 2)) / 2, strain[:, :2, :2], atol=1e-8)
    np.testing.assert_allclose(strain[:, 2, 2], at(name, x).u_r / x[:, 0] if name == "axis" else 0.0, atol=1e-14)
    force = divergence(lambda x: pressed(name, x)[:, :2, :2], x, 1e-5)
    if name == "axis":
        force += np.stack([s[:, 0, 0] - s[:, 2, 2], s[:, 0, 1]], axis=1) / x[:, :1]
    np.testing.assert_allclose(force, 0, atol=1e-7)
    r = np.linspace(0, 2, 41)
    s = pressed(name, np.stack([r, 0 * r], axis=1))
    np.testing.assert_allclose(s[:, 1, 1], -P0 * np.sqrt(np.maximum(1 - (r / A) ** 2, 0)), atol=1e-12)
    np.testing.assert_allclose(s[:, 0, 1], 0, atol=1e-12)


@SPACES
def test_the_surface_fits_the_clearance(name):
    """u_z(0) - u_z(r) = r^2 / 2R where the bodies touch, less beyond; p0 from R as Johnson has it."""
    radius = 7.0
    p0 = peak_pressure(A, radius, contact_modulus([(E, NU)]), plane=name == "plane")
    r = np.linspace(0, 2, 41)
    u_z = at(name, np.stack([r, 0 * r], axis=1), p0).u_z
    gap = r**2 / (2 * radius) - (u_z[0] - u_z)
    np.testing.assert_allclose(gap[r <= A], 0, atol=1e-12)
    assert (gap[r > A + 0.02] > 0).all()


def test_near_the_axis_the_limit_goes_on_and_two_bodies_are_softer_than_one():
    z = np.linspace(0, 2, 9)
    near, off = (about_axis(np.full(9, r), z, A, P0).hoop for r in (0.99e-4 * A, 1.01e-4 * A))
    np.testing.assert_allclose(near, off, rtol=1e-6)
    assert contact_modulus([(E, NU), (E, NU)]) == pytest.approx(contact_modulus([(E, NU)]) / 2)


# ---- a pin in a hole (Persson)

PIN = PinInHole(radius=12.0, clearance=0.2, young=210e3, poisson=0.3, angle=60.0)


def around(r, angle):
    return r * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def stress_in(body):
    return stress_of(lambda x: PIN.displacement(x, body), PIN, 1e-3)


@pytest.mark.parametrize("angle", [20.0, 60.0, 85.0])
def test_the_pressure_of_a_pin_carries_the_force(angle):
    pin = PinInHole(12.0, 0.2, 210e3, 0.3, angle)
    t = (np.arange(200_000) + 0.5) / 200_000 * np.pi
    assert 2 * np.pi * np.mean(pin.pressure(t) * np.cos(t)) * pin.radius == pytest.approx(pin.force, rel=1e-5)
    assert not pin.pressure(t[t > np.radians(angle)]).any()


@pytest.mark.slow
def test_the_gap_of_a_pin_is_closed_where_there_is_pressure_and_open_beyond():
    t = np.radians(np.arange(0.0, 180.0, 5.0))
    n = around(1.0, t)
    apart = PIN.displacement(12 * n, "plate") - PIN.displacement(12 * n, "pin")
    gap = PIN.clearance + (apart * n).sum(axis=1)
    assert np.abs(gap[t < np.radians(52)]).max() < 1e-6
    assert gap[t > np.radians(62)].min() > 1e-3


@pytest.mark.parametrize(("body", "radius"), [("pin", 6.0), ("plate", 24.0)])
def test_pin_and_plate_are_in_equilibrium(body, radius):
    """No force in the body, and across a circle all of the force."""
    stress, x = stress_in(body), around(radius, np.linspace(0, 2 * np.pi, 7)[:-1] + 0.1)
    assert np.abs(divergence(stress, x, 1e-2)).max() < 1e-4 * np.abs(stress(x)).max() / radius * 10
    t = (np.arange(720) + 0.5) / 720 * 2 * np.pi
    n = around(1.0, t)
    pull = np.einsum("pij,pj->pi", stress(radius * n), n).mean(axis=0) * 2 * np.pi * radius
    np.testing.assert_allclose(pull, [-PIN.force, 0.0], rtol=1e-4, atol=1.0)


def test_the_edge_of_the_pin_bears_the_pressure_and_no_shear():
    t = np.radians([5.0, 30.0, 45.0, 90.0, 150.0])
    n = around(1.0, t)
    pull = np.einsum("pij,pj->pi", stress_in("pin")((12 - 2e-3) * n), n)
    tolerance = 0.02 * PIN.pressure(np.zeros(1))[0]
    np.testing.assert_allclose((pull * n).sum(axis=1), -PIN.pressure(t), atol=tolerance)
    np.testing.assert_allclose(pull[:, 0] * -n[:, 1] + pull[:, 1] * n[:, 0], 0, atol=tolerance)


# ---- cracks that a pressure opens


@pytest.mark.parametrize("n", [1, 3])
def test_the_edge_crack(n):
    exact = EdgeCrack(n)
    x = np.random.default_rng(0).uniform(-1, 1, (40, 2))
    s = stress_of(exact.displacement, exact, 1e-5)(x)
    np.testing.assert_allclose(np.stack([s[:, 0, 0], s[:, 1, 1], s[:, 0, 1]], axis=1), exact.stress(x), atol=1e-7)
    force = divergence(lambda x: exact.stress(x)[:, [[0, 2], [2, 1]]], x, 1e-4)
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

    stress = stress_of(u, exact, 1e-3)
    x = np.random.default_rng(0).uniform(0.3, 2, (30, 3))
    np.testing.assert_allclose(divergence(stress, x, 1e-3), 0, atol=1e-3)
    s = stress(np.array([[0.3, 0.2, 2e-3]]))[0]
    np.testing.assert_allclose(s[:, 2], [0, 0, -exact.pressure], atol=1e-4)
    r = np.array([0.2, 0.9, 1.1, 1.7])
    np.testing.assert_allclose(2 * exact.displacement(r, 0 * r)[:, 1], exact.opening(r), atol=1e-10)
    assert np.abs(exact.displacement(np.array([60.0]), np.array([80.0]))).max() < 1e-3 * exact.opening(np.zeros(1))[0]


# ---- press fits (Lame)

SHAPES = pytest.mark.parametrize("shape", ["sphere", "plane_strain", "plane_stress"])
RADII = np.linspace(20.5, 29.5, 7)


def shell(shape, **changes):
    return replace(Shell(shape, 20.0, 30.0, 2000.0, 0.3), **changes)


def along(f):
    """The slope of a function at the radii."""
    return (f(RADII + 1e-4) - f(RADII - 1e-4)) / 2e-4


@SHAPES
def test_shells_are_in_equilibrium_and_have_the_strains_of_their_stress(shape):
    """Hooke's law in three dimensions, with no strain, or no stress, across the plane of a cylinder."""
    body, sides = shell(shape), 2 if shape == "sphere" else 1
    radial, hoop = body.stress(RADII, 25.0, 7.0)
    slope = along(lambda r: body.stress(r, 25.0, 7.0)[0])
    np.testing.assert_allclose(slope, -sides * (radial - hoop) / RADII, rtol=1e-8)
    np.testing.assert_allclose(body.stress(np.array([20.0, 30.0]), 25.0, 7.0)[0], [-25.0, -7.0], rtol=1e-13)
    u = body.displacement(RADII, 25.0, 7.0)
    strain = np.stack([along(lambda r: body.displacement(r, 25.0, 7.0)), u / RADII, u / RADII])
    lame, mu = 2000 * 0.3 / (1.3 * 0.4), 2000 / 2.6
    if shape != "sphere":
        strain[2] = 0 if shape == "plane_strain" else -lame / (lame + 2 * mu) * strain[:2].sum(axis=0)
    stress = lame * strain.sum(axis=0) + 2 * mu * strain
    np.testing.assert_allclose(stress[:2], [radial, hoop], rtol=1e-8)


@SHAPES
def test_bodies_stay_apart_by_the_interference_and_touch(shape):
    fit = Fit(shell(shape), shell(shape, inner=30.0, outer=40.0, young=5000.0), pressure=25.0, interference=0.1)
    x = 30 * np.array([[1.0, 0.0], [0.6, 0.8]])
    apart = fit.displacement(x, "around") - fit.displacement(x, "within")
    np.testing.assert_allclose(apart, 0.1 * x / 30, rtol=1e-12)
    assert fit.between > replace(fit, interference=0.0).between > 0


def test_the_pressure_is_that_of_the_test_of_code_aster():
    """A sphere of one material knows nothing of the cut in it: Lame's stress of the whole at r = 30."""
    whole = shell("sphere", outer=40.0)
    right = PressFit("TRIA6").exact.between
    assert right == pytest.approx(-whole.stress(np.array([30.0]), 25.0, 0.0)[0][0], rel=1e-13)
    assert right == pytest.approx(4.894178, rel=1e-6)


# ---- metals that yield


def test_the_sphere_is_continuous_and_follows_hooke_outside_its_front():
    """Twice the hoop strain plus the radial one is the volume's, (1 - 2 nu) / E times the mean stress times 3."""
    sphere = Sphere(1.0, 2.0, 1.5, 500.0, 0.3, 1.0)
    around_front = np.array([1.5 - 1e-9, 1.5 + 1e-9])
    assert np.diff(sphere.displacement(around_front)) == pytest.approx(0.0, abs=1e-10)
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
    b = np.sqrt(4 + 1.5**2 - 1)
    assert tube.pressure(0.5) == pytest.approx(2 / np.sqrt(3) * np.log(b / 1.5), rel=1e-9)


# ---- impacts


def test_bars_by_characteristics():
    """sdnl111: the free bar's face moves at -1 until the touch, then for 2 L / c at -1/2, as long at 1/2, then at 1."""
    touch, wave = 1e-5, 2 / np.sqrt(modulus(2e11, 0.3) / 7800)
    ends = [0.0, touch, touch + wave, touch + 2 * wave, 1.0]
    places = np.concatenate([[0.0], np.cumsum(np.diff(ends) * [-1.0, -0.5, 0.5, 1.0])])
    np.testing.assert_allclose(np.interp(SDNL111_TIMES, ends, places), SDNL111, rtol=1e-3)


def test_the_work_of_hertzs_force_is_the_energy_of_the_impact():
    speed = speed_for(1e-3, 2.0, 5.0, 0.3, 1.5)
    found = hertz(2.0, 5.0, 0.3, 1.5, speed)
    assert found.approach == pytest.approx(1e-3)
    mass = 4 / 3 * np.pi * 8 * 1.5
    assert 0.4 * found.force * found.approach == pytest.approx(0.5 * mass * speed**2)


# ---- manufactured solutions: sympy's derivatives against those of the displacement, and laws of mechanics

PROBLEMS = {"plane": PLANE, "solid": SOLID}
LAWS = pytest.mark.parametrize("law", [LAW, pytest.param(Law(7.0, 0.3), marks=pytest.mark.slow)])


@pytest.fixture(params=PROBLEMS)
def given(request):
    return PROBLEMS[request.param]


def places(given, n=40):
    return np.random.default_rng(1).uniform(given.low, given.high, (n, given.dim))


def displacement(given, points):
    names = dict(zip("xyz", points.T, strict=False))
    return np.stack([eval(text, {}, names) for text in given.displacement], axis=-1)


def gradient_of_motion(given, points):
    """F (n, dim, dim) by complex steps, which have no rounding."""
    F = np.tile(np.eye(given.dim), (len(points), 1, 1))
    for j in range(given.dim):
        F[:, :, j] += displacement(given, points + 1e-40j * np.eye(given.dim)[j]).imag / 1e-40
    return F


def nominal_stress(given, points, law=LAW):
    F = gradient_of_motion(given, points)
    return F @ hooke(0.5 * (np.swapaxes(F, 1, 2) @ F - np.eye(given.dim)), law.young, law.poisson)


def values_of(texts, points):
    """Values at points that the solver gives to texts of the case."""
    return np.stack([Value.of(text)(points, 1.0) for text in texts], axis=-1)


@pytest.mark.rows("plane-law0")
@LAWS
def test_stress_and_body_force_are_those_of_the_law(given, law):
    """The body force is minus the divergence of stress, by differences of a polynomial of degree 10."""
    points, made = places(given), derive(given.displacement, law)
    right = nominal_stress(given, points, law)
    stress = np.stack([values_of(row, points) for row in made.stress], axis=1)
    np.testing.assert_allclose(stress, right, rtol=0, atol=1e-13 * np.abs(right).max())
    force = -divergence(lambda x: nominal_stress(given, x, law), points, 1e-4)
    np.testing.assert_allclose(values_of(made.body_force, points), force, rtol=0, atol=1e-7 * np.abs(force).max())


def on_slave(given):
    points = places(given)
    points[:, -1] = 0.0
    return points


def normal_of_slave(given, points):
    """Outward, on the deformed face: across the tangents, which are the first columns of F."""
    F = gradient_of_motion(given, points)
    m = np.stack([F[:, 1, 0], -F[:, 0, 0]], axis=1) if given.dim == 2 else -np.cross(F[:, :, 0], F[:, :, 1])
    return m / np.linalg.norm(m, axis=1, keepdims=True)


@LAWS
def test_the_slave_carries_its_load_and_the_pressure(given, law):
    points, sources = on_slave(given), derive(given.displacement, law)
    n = normal_of_slave(given, points)
    tangential, p = values_of(sources.tangential, points), values_of([sources.pressure], points)
    right = -nominal_stress(given, points, law)[:, :, -1]
    np.testing.assert_allclose(tangential - p * n, right, rtol=0, atol=1e-14)
    np.testing.assert_allclose((tangential * n).sum(axis=1), 0, atol=1e-15)
    assert p.min() > 0


def test_the_deformed_slave_lies_on_the_master(given):
    points = on_slave(given)
    where = points + displacement(given, points)
    height = eval(given.master_height, {}, dict(zip("xyz", where.T, strict=False)))
    np.testing.assert_allclose(where[:, -1], height, atol=1e-15)
