"""Exact solutions with friction, each against a second derivation: equilibrium, integrals, known limits."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from tests.verification.projections import gauss_seidel
from tests.verification.test_exact import divergence, gradient, hooke, stress_of
from verification.exact import impact
from verification.exact.cattaneo import Cylinders, pressure, shear
from verification.exact.coulomb import Condensed, complementary, lemke, tresca
from verification.exact.crack import Crack
from verification.exact.fits import SlidingFit
from verification.exact.half_plane import Ellipse
from verification.exact.lame import Fit, Shell
from verification.exact.spence import stick_edge, tractions, uncoupled_edge
from verification.exact.spheres import LikeSpheres

CYLINDERS, SPHERES, CRACK = Cylinders(), LikeSpheres(), Crack()
#: Q / (mu P) after the turns of a load that goes to 0.6, back and forth
TURNS = ((0.6,), (0.6, -0.6), (0.6, -0.6, 0.6), (0.6, 0.0), (0.6, -0.2), (-1.0,))


INSIDE = np.random.default_rng(0).uniform([-2, 0.1], [2, 2], (30, 2))


# ---- half-planes


@pytest.mark.parametrize("side", [1, -1])
def test_stress_of_half_planes_is_that_of_their_displacement_and_on_the_surface_the_tractions(side):
    body, loads, x = CYLINDERS.body(side), CYLINDERS.rolling(0.5), INSIDE * [1, side]
    sigma = stress_of(lambda x: body.displacement(x, loads), body, 1e-5)(x)
    found = body.stress(x, loads)
    np.testing.assert_allclose(np.stack([sigma[:, 0, 0], sigma[:, 1, 1], sigma[:, 0, 1]], axis=1), found, atol=1e-9)
    x = np.linspace(-1.6, 1.6, 33)
    stress = body.stress(np.stack([x, 0 * x], axis=1), loads)
    np.testing.assert_allclose(stress[:, 1], -pressure(x, loads), atol=1e-14)
    np.testing.assert_allclose(stress[:, 2], shear(x, loads), atol=1e-14)
    s, w = np.polynomial.legendre.leggauss(80)  # an ellipse of tractions as many forces
    w, x = w * np.pi / 2 * np.cos(np.pi / 2 * s) ** 2, INSIDE[INSIDE[:, 1] > 0.8] * [1, side]
    force = np.stack([-side * 0.3 * w, side * 0.7 * w], axis=1)
    apart = body.under_forces(x, np.sin(np.pi / 2 * s), force) - body.displacement(x, [Ellipse(1.0, 0.7, 0.3)])
    assert np.ptp(apart, axis=0).max() < 1e-14


# ---- cylinders


@pytest.mark.parametrize("turns", TURNS)
def test_shear_of_cylinders_carries_the_load_within_friction(turns):
    loads, bound = CYLINDERS.sheared(*turns), CYLINDERS.friction
    places = [0.0, *(load.half_width for load in loads)]
    total = 2 * quad(lambda x: float(shear(np.array(x), loads)), 0, 1, points=sorted(set(places)), limit=200)[0]
    assert total == pytest.approx(turns[-1] * bound * CYLINDERS.force, abs=1e-8)
    x = np.linspace(-1, 1, 2001)
    assert (np.abs(shear(x, loads)) <= bound * pressure(x, loads) + 1e-15).all()


def test_cylinders_close_their_gap_and_stick_in_the_middle():
    x, loads = np.linspace(-1, 1, 41)[1:-1], CYLINDERS.sheared(0.6)
    gap = x**2 / (2 * CYLINDERS.radius) + CYLINDERS.apart(x, loads)[:, 1]
    assert np.ptp(gap) < 1e-15
    slip, sticks = CYLINDERS.slip(x, loads), np.abs(x) < CYLINDERS.stick(0.6)
    assert np.abs(slip[sticks]).max() < 1e-15 and slip[~sticks].min() > 0  # as the shear stress is
    assert CYLINDERS.stick(0.6) == pytest.approx(np.sqrt(0.4))


def test_a_full_loop_is_the_load_that_grew_from_zero():
    x = np.linspace(-1, 1, 41)
    once, loop = (shear(x, CYLINDERS.sheared(*turns)) for turns in ((0.6,), (0.6, -0.6, 0.6)))
    np.testing.assert_allclose(loop, once, atol=1e-15)
    np.testing.assert_allclose(shear(x, CYLINDERS.sheared(0.6, -0.6)), -once, atol=1e-15)
    x = np.linspace(0.7, 1, 9)  # all that slipped slips back, twice as far: Masing's rule
    once, back = (CYLINDERS.slip(x, CYLINDERS.sheared(*turns)) for turns in ((0.6,), (0.6, -0.6)))
    np.testing.assert_allclose(once - back, 2 * once, atol=1e-15)


@pytest.mark.slow
def test_dissipation_of_cylinders_is_the_work_on_the_way():
    """Sum over small steps of the load: mean shear stress times what slips more in the step."""
    s, w = np.polynomial.legendre.leggauss(200)
    x, w = np.sin(np.pi / 2 * s), w * np.pi / 2 * np.cos(np.pi / 2 * s)
    states = [(shear(x, at), CYLINDERS.slip(x, at)) for at in map(CYLINDERS.sheared, np.linspace(0.0, 0.6, 400)[1:])]
    work = sum(w @ ((t + t2) / 2 * (s2 - s)) for (t, s), (t2, s2) in pairwise(states))
    assert CYLINDERS.dissipation(0.6) == pytest.approx(work, rel=2e-3)


def test_rolling_cylinders_stick_at_the_leading_edge():
    loads, creep = CYLINDERS.rolling(0.5), CYLINDERS.creep(0.5)
    x = np.linspace(-0.999, 0.999, 4001)
    rate = creep - np.gradient(CYLINDERS.apart(x, loads)[:, 0], x)  # of slip, over the rate of rolling
    sticks = x > 1 - 2 * CYLINDERS.stick(0.5)
    near = np.abs(x - (1 - 2 * CYLINDERS.stick(0.5))) < 0.01
    assert np.abs(rate[sticks & ~near]).max() < 1e-6
    assert rate[~sticks & ~near].min() > 0
    assert quad(lambda x: float(shear(np.array(x), loads)), -1, 1, points=[1 - 2 * CYLINDERS.stick(0.5)])[0] == (
        pytest.approx(0.5 * CYLINDERS.friction * CYLINDERS.force, abs=1e-8)
    )


# ---- spheres


def stress_of_sphere(x, side=1, h=1e-5):
    return hooke(gradient(lambda x: SPHERES.far(x, side, 0.6), x, h), SPHERES.young, 0.0)


def test_half_spaces_under_tractions_are_in_equilibrium():
    x, h = np.random.default_rng(1).uniform([-2, -2, 1], 2, (8, 3)), 1e-3
    stress = partial(stress_of_sphere, h=h)
    assert np.abs(divergence(stress, x, h)).max() < 1e-5 * np.abs(stress(x)).max()
    outside = np.array([[1.6, 0, h], [0.9, 1.3, h], [0, -2.0, h]])
    assert np.abs(stress(outside)[:, 2]).max() < 2e-2 * np.abs(stress(outside)).max()  # free, to the step


@pytest.mark.slow
def test_half_spaces_carry_the_forces_of_their_tractions():
    """Stress on a half-sphere around the disc, on either side."""
    s, w = np.polynomial.legendre.leggauss(8)
    height, around = (1 + s) / 2, 2 * np.pi * np.arange(16) / 16
    level = np.sqrt(1 - height**2)
    n = np.stack([np.outer(level, np.cos(around)), np.outer(level, np.sin(around)), np.outer(height, around**0)], -1)
    n, w = n.reshape(-1, 3), np.repeat(w / 2, 16) * 2 * np.pi / 16
    for side in (1, -1):
        sigma = stress_of_sphere(2.5 * n * [1, 1, side], side)
        force = 2.5**2 * np.einsum("p,pij,pj->i", w, sigma, n * [1, 1, side])
        pulled = side * 0.6 * SPHERES.friction * SPHERES.force  # the lower body along +x: its far side pulls back
        np.testing.assert_allclose(force, [pulled, 0, -side * SPHERES.force], atol=2e-4 * SPHERES.force)


def test_spheres_stick_and_carry_their_load_as_johnson_says():
    """Johnson, 7.42 with (2 - nu) / G = 8 / E: the displacement."""
    P, mu, q = SPHERES.force, SPHERES.friction, 0.6
    assert SPHERES.stick(q) == pytest.approx((1 - q) ** (1 / 3))
    assert -SPHERES.shift(q) == pytest.approx(3 * mu * P / 16 * 8 * (1 - (1 - q) ** (2 / 3)))
    total = quad(lambda r: 2 * np.pi * r * float(SPHERES.shear(np.array(r), q)), 0, 1, points=[SPHERES.stick(q)])[0]
    assert total == pytest.approx(q * mu * P, rel=1e-7)


# ---- crack


def test_stress_at_a_crack_is_in_equilibrium_and_carried_by_its_faces():
    x = np.random.default_rng(2).uniform(0.2, 2, (20, 2)) * [1, -1]
    h = 1e-3

    stress = stress_of(CRACK.displacement, CRACK, h)
    assert np.abs(divergence(stress, x, h)).max() < 2e-3 * CRACK.load
    faces = stress(np.array([[0.0, 2 * h], [0.5, 2 * h], [0.5, -2 * h]]))
    np.testing.assert_allclose(faces[:, 1, 1], -CRACK.pressure, rtol=1e-2)
    np.testing.assert_allclose(faces[:, 0, 1], CRACK.shear, rtol=3e-2)
    far = stress(np.array([[40.0, 30.0]]))[0]
    np.testing.assert_allclose([far[1, 1], far[0, 1]], [-CRACK.pressure, CRACK.shear + CRACK.left], rtol=1e-2)


def test_slip_of_a_crack_is_the_jump_of_its_displacement():
    x = np.linspace(-0.9, 0.9, 7)
    apart = CRACK.displacement(np.stack([x, 0 * x], 1)) - CRACK.displacement(np.stack([x, 0 * x - 1e-13], 1))
    np.testing.assert_allclose(apart[:, 0], CRACK.slip(x), atol=1e-12)
    np.testing.assert_allclose(apart[:, 1], 0, atol=1e-12)
    assert CRACK.slip(np.zeros(1))[0] == pytest.approx(3.8078e-3, abs=1e-7)
    assert (CRACK.pressure, CRACK.shear, CRACK.left) == pytest.approx((11.698, 6.754, 25.386), abs=1e-3)


# ---- punch


@pytest.mark.parametrize(
    ("poisson", "friction", "edge"), [(0.3, 0.2, 0.361), (0.3, 0.4, 0.865), (0.0, 0.4, 0.358), (0.45, 0.1, 0.772)]
)
def test_punch_sticks_as_another_discretisation_has_it_and_without_the_coupling_as_in_closed_form(
    poisson, friction, edge
):
    assert stick_edge(poisson, friction) == pytest.approx(edge, abs=0.003)
    uncoupled = stick_edge(poisson, friction, coupled=False)
    assert uncoupled == pytest.approx(uncoupled_edge(poisson, friction), abs=2e-4)


def test_pressure_of_a_punch_without_friction_is_that_of_sadowsky():
    x, p, q = tractions(0.0, 0.3, 100, True, 100)
    inner = x < 0.95
    np.testing.assert_allclose(p[inner], 1 / (np.pi * np.sqrt(1 - x[inner] ** 2)), rtol=5e-3)
    assert np.abs(q).max() < 1e-12  # nothing moves aside: all sticks


# ---- fits and belts


FIT = SlidingFit(
    Fit(Shell("plane_strain", 0.5, 1.0, 3.0, 0.2), Shell("plane_strain", 1.0, 2.0, 1.0, 0.3), interference=0.01), 0.3
)


@pytest.mark.parametrize("way", ["pulled", "turned"])
def test_shear_of_a_fit_carries_its_load_at_every_radius(way):
    move = getattr(FIT, way)
    power = {"pulled": 1, "turned": 2}[way]
    for r in (0.6, 0.9, 1.1, 1.9):
        at = np.array([r - 1e-4, r, r + 1e-4])
        u = move(at, 0.7 * FIT.bound, slip=0.02)
        strain = (u[2] - u[0]) / 2e-4 - (u[1] / r if way == "turned" else 0.0)
        shell = FIT.fit.within if r < 1 else FIT.fit.around
        stress = strain * shell.young / (2 * (1 + shell.poisson))
        assert -stress == pytest.approx(0.7 * FIT.bound / r**power, rel=1e-6)
    apart = move(np.array([1.0 - 1e-12]), 0.0, slip=0.02) - move(np.array([1.0]), 0.0, slip=0.02)
    assert apart[0] == pytest.approx(0.02)
    assert move(np.array([2.0]), FIT.bound)[0] == pytest.approx(0)


def test_force_and_moment_of_a_fit_are_friction_times_its_pressure():
    assert FIT.pull_out == pytest.approx(2 * np.pi * 0.3 * FIT.fit.between)
    assert replace(FIT, friction=0.0).torque == 0.0
    assert FIT.torque == pytest.approx(FIT.pull_out)  # radius 1


# ---- an oblique impact


def test_an_oblique_impact_is_linear_while_it_sticks_and_coulombs_while_it_slides():
    """Without any slip the impulse is in proportion; where all slides, it is mu times the normal one."""
    (up, one), (_, two) = (impact.rebound(slip, 100.0, 0.3) for slip in (0.1, 0.2))
    assert up == pytest.approx(2.0, abs=1e-3) and two == pytest.approx(2 * one, rel=1e-3)
    assert 0 < one / 0.1 < 2 / 3.5  # less than what turns the velocity round
    assert impact.rebound(3.0, 0.2, 0.3) == pytest.approx((2.0, 0.4), rel=1e-3)


# ---- Coulomb's problem: Lemke's method, Tresca's fixed point and projections, three independent ways

FRICTION = (0.1, 0.3, 0.6, 1.0, 1.5)


def random_problem(m, across, friction, seed):
    """A chain of macro-elements, pressed, opened and sheared at random; pressure and shear are coupled."""
    rng = np.random.default_rng(seed)
    x = np.arange(m) / m
    near = np.exp(-3 * np.abs(x[:, None] - x))
    A = 0.3 * np.eye(m * (1 + across))
    A[:m, :m] += near
    for axis in range(across):
        A[m + axis :: across, m + axis :: across] += near
    A[:m, m::across] += 0.25 * np.sign(x[:, None] - x) * near
    A[m::across, :m] = A[:m, m::across].T
    return Condensed(A, rng.normal(-0.5, 0.7, m), rng.standard_normal((m, across)), np.full(m, friction))


@pytest.mark.parametrize("seed", range(20))
def test_three_ways_find_the_same_tractions(seed):
    given = random_problem(12, 1, FRICTION[seed % 5], seed)
    solutions = [way(given) for way in (lemke, tresca, gauss_seidel)]
    for p, t in solutions:
        assert given.residual(p, t) < 1e-11
        np.testing.assert_allclose(p, solutions[0][0], atol=1e-9)
        np.testing.assert_allclose(t, solutions[0][1], atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_projections_solve_problems_in_space(seed):
    given = random_problem(9, 2, 0.6, seed)
    p, t = gauss_seidel(given)
    G, S = given.gaps(p, t)
    assert p.min() >= 0 and G.min() > -1e-10 and np.abs(p * G).max() < 1e-9
    length, slides = np.linalg.norm(t, axis=1), np.linalg.norm(S, axis=1) > 1e-8
    slides &= p > 0
    assert (length <= 0.6 * p + 1e-12).all() and slides.any() and not slides.all()
    np.testing.assert_allclose(
        t[slides], 0.6 * p[slides, None] * S[slides] / np.linalg.norm(S[slides], axis=1)[:, None], atol=1e-8
    )


def test_residual_sees_what_is_wrong():
    given = random_problem(8, 1, 0.3, 0)
    p, t = lemke(given)
    closed = int(p.argmax())
    for off_p, off_t in ((1e-3, 0.0), (0.0, 1e-3)):
        q, s = p.copy(), t.copy()
        q[closed], s[closed] = q[closed] + off_p, s[closed] + off_t
        assert given.residual(q, s) > 1e-5


def test_one_block_on_a_plane_slides_where_more_than_friction_is_asked():
    """A spring of stiffness 1 either way, pressed in by 2 and moved aside by s: t = min(s, mu 2)."""
    for s, t in ((0.1, 0.1), (0.59, 0.59), (0.61, 0.6), (-5.0, -0.6)):
        given = Condensed(np.eye(2), np.array([-2.0]), np.array([[s]]), np.array([0.3]))
        for way in (lemke, tresca, gauss_seidel):
            found = way(given)
            assert (found[0][0], found[1][0, 0]) == pytest.approx((2.0, t))


def test_a_complementarity_problem_without_a_solution_is_an_error():
    with pytest.raises(ArithmeticError):
        complementary(np.array([[0.0, 1.0], [0.0, -1.0]]), np.array([-1.0, -1.0]))
