"""The family of impacts: small ones pass, a plain mass fails, and the exact solutions are what they should be."""

from unittest.mock import patch

import numpy as np
import pytest

from lacmesh import check
from lacsolver.bodies.mass import assemble_mass
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.space.space import Space
from verification.exact.impact import SDNL111, SDNL111_TIMES, hertz, modulus, speed_for
from verification.families.impact import FAMILY, solve_case
from verification.families.impact_free import spin
from verification.families.impact_runs import Impact, on_wall
from verification.meshes.balls import half_sphere_on_wall, quarter_sphere_on_wall, sphere_on_wall
from verification.meshes.thrown import two_rings


def case(name):
    return next(one for one in FAMILY.cases if one.name == name)


def test_a_plain_mass_fails_as_it_must():
    results = case("plain-mass").solve(levels=1).results
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


def test_hertz_is_consistent():
    speed = speed_for(1e-3, 2.0, 5.0, 0.3, 1.5)
    found = hertz(2.0, 5.0, 0.3, 1.5, speed)
    assert found.approach == pytest.approx(1e-3)
    mass = 4 / 3 * np.pi * 8 * 1.5
    assert 0.4 * found.force * found.approach == pytest.approx(0.5 * mass * speed**2)  # the work of the force


@pytest.mark.parametrize(
    ("make", "model", "part"),
    [(sphere_on_wall, "axisymmetric", 1.0), (quarter_sphere_on_wall, "3d", 0.25), (half_sphere_on_wall, "3d", 0.5)],
)
def test_the_spheres_are_round(make, model, part):
    """Faces outward and on the sphere, a volume within 0.05 %, no cell inverted."""
    mesh = make(0.1, 0.02)
    space = Space.of(mesh, model)
    x = mesh.points[:, : space.dim] - np.eye(space.dim)[-1] * 1.02
    for name, side in (("slave", -1), ("rest", 1)):
        nodes = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups[name])]))
        np.testing.assert_allclose(np.linalg.norm(x[nodes], axis=1), 1.0)
        assert (side * (x[nodes, -1] + np.sqrt(0.5)) > -1e-9).all()
    M = assemble_mass(space, Materials.of(space, Elastic(young=1.0, poisson=0.0, density=1.0)))
    assert M.sum() / space.dim == pytest.approx(part * 4 / 3 * np.pi, rel=5e-4)
    assert {error.rule for error in check(mesh, "slave", "wall").errors} == set()


@pytest.mark.slow
def test_free_spin_and_frequencies_have_their_orders():
    """The families' own criteria on few steps, and frequencies at the rates of the case."""
    given = Impact("spin", "QUAD4", n=1, young=1e3, dynamics=(("scheme", "newmark"),))
    momentum, *rates, account = list(spin(given, 2))
    assert momentum.passed and account.passed
    assert all(1.8 < result.value < 2.6 for result in rates)
    assert all(result.passed for result in case("frequencies-QUAD8").solve(levels=3).results)


@pytest.mark.slow
def test_a_coarse_disc_is_thrown():
    """The three cases of large deformation are made alike: energy is kept, and the static twin is solved."""
    with patch("verification.families.impact_finite._STEP", 0.02):
        given = Impact("disc", n=3, dynamics=(("scheme", "newmark"),), young=100.0, speed=0.5)
        results = solve_case(given, levels=1).results
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
