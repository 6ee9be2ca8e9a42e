"""Recovered friction: exact where it is even, within its bound, and near Cattaneo's and Mindlin's ellipses."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.contact.friction import Bounds
from lacsolver.contact.laws import CONTACT, SLIDES
from lacsolver.results.recovered_shear import recover_shear
from lacsolver.results.recovery import recover_pressure
from tests.lacsolver.friction.small import coulomb
from tests.lacsolver.friction.test_output import WAYS, joint
from tests.samples import each_option
from verification.families import friction_cattaneo as cattaneo
from verification.measures.norms import nodal_pressure_error


@pytest.mark.parametrize(
    ("cell", "turns"),
    each_option(
        [("TRIA3", (0.6,)), ("QUAD4", (0.6, -0.6)), ("QUAD4", (0.6,)), ("QUAD8", (0.6,))], of=lambda row: [row[1]]
    ),
)
def test_cylinders_that_are_sheared(cell, turns):
    """The recovered traction has less than half of the error of the means, and less than that of the best constants."""
    given = cattaneo.PressedCylinders(cell, turns)
    loads, own = given.loads(given.times[-1]), []
    for k in (8, 16):
        one = cattaneo.solved(given, k)
        means, t = cattaneo.shear_errors(one, loads), one.fields.zones["slave"].shear_recovered
        off = nodal_pressure_error(one.mesh, t[:, 0], lambda x: cattaneo.cattaneo.shear(x[:, 0], loads)[:, None])
        own.append(off)
        assert off < 0.5 * means.exact and off < 0.65 * means.best
        assert np.nanmax(np.abs(t[:, 1])) < 1e-12
    assert own[1] < 0.68 * own[0]


@pytest.mark.parametrize(("model", "geometry"), each_option(WAYS))
def test_it_is_within_its_bound_where_the_pressure_is(model, geometry):
    zone = joint(model, geometry)
    t, on = np.linalg.norm(zone.shear_recovered, axis=1), np.isfinite(zone.pressure_recovered)
    assert np.isfinite(t[on]).all() and np.isnan(t[~on]).all()
    assert (t[on] <= 0.4 * zone.pressure_recovered[on] * (1 + 1e-12) + 1e-12).all() and t[on].max() > 0


def skin():
    """Return the slave of a flat zone in space, its macro-elements, and their centres."""
    zone = joint("3d", "small")
    return zone.surface, zone.macro, zone.centre


@pytest.mark.parametrize("bounds", [coulomb(0.5, 1), Bounds(*(np.full(1, v) for v in (np.inf, 0.0, np.inf)))])
def test_what_is_even_is_exact(bounds):
    """Uniform tractions, that stick below the bound, slide on it, or are rough, and a linear one that is rough."""
    surface, macro, centre = skin()
    n = len(centre)
    bounds = Bounds(*(np.repeat(values, n) for values in bounds))
    p, way = np.full(n, 2.0), np.array([0.6, -0.8, 0.0])
    for size, status in ((0.7, CONTACT), (1.0, SLIDES)):
        states = np.full(n, status)
        nodal, _ = recover_pressure(surface, macro, p, states)
        t = recover_shear(surface, macro, np.tile(size * way, (n, 1)), (p, nodal), states, bounds)
        np.testing.assert_allclose(
            t[np.isfinite(nodal)], np.tile(size * way, (np.isfinite(nodal).sum(), 1)), atol=1e-12
        )
    if np.isinf(bounds.friction).all():
        linear = np.outer(centre[:, 0] - 0.4, way)  # through 0
        t = recover_shear(surface, macro, linear, (p, nodal), np.full(n, CONTACT), bounds)
        on = np.isfinite(nodal)
        np.testing.assert_allclose(t[on], np.outer(surface.x[on, 0] - 0.4, way), atol=1e-10)
