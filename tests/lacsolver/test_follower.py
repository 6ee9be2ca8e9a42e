"""The load stiffness of a follower pressure, against differences, and its symmetry on a closed skin."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacsolver.problem import loads
from tests.lacsolver.bodies import PAIRS, PLANE_MODELS
from tests.lacsolver.test_finite import by_differences
from tests.lacsolver.test_loads import curved
from tests.samples import each_option


def deformed(space, u):
    x = space.mesh.points.copy()
    x[:, : space.dim] += u.reshape(-1, space.dim)
    return x


def varying(x, t):
    """A pressure by place and time."""
    return t + x[:, 0] * x[:, 1]


def options_of(row):
    """The kinds of faces that are pressed, each in its model, and the pressure."""
    name, model, value = row
    return [*((facet.type, model) for facet in CELLS[name].facets), value]


@pytest.mark.parametrize(
    ("name", "model", "value"),
    each_option(((*pair, value) for pair in PAIRS for value in (varying, 3.0)), of=options_of),
)
def test_the_load_stiffness_is_the_derivative_of_the_load(name, model, value):
    space, skin = curved(name, model)
    skin = skin[: len(skin) // 2]
    u = np.random.default_rng(0).uniform(-0.1, 0.1, space.n_dof)
    K = loads.pressure_tangent(space, skin, value, 0.7, x=deformed(space, u)).toarray()

    def load(v):
        return loads.pressure(space, skin, value, 0.7, x=deformed(space, v))

    expected = by_differences(load, u, 1e-3)  # the load is a cubic of u at most: exact but for rounding
    np.testing.assert_allclose(K, expected, rtol=0, atol=1e-11 * np.abs(K).max())
    assert np.abs(K - K.T).max() > 1e-2 * np.abs(K).max()


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_a_uniform_pressure_on_a_closed_skin_has_a_potential(name, model):
    """It is -p V, so that the load stiffness is symmetric."""
    space, skin = curved(name, model)
    u = np.random.default_rng(0).uniform(-0.1, 0.1, space.n_dof)
    K = loads.pressure_tangent(space, skin, 3.0, x=deformed(space, u)).toarray()
    np.testing.assert_allclose(K, K.T, rtol=0, atol=1e-13 * np.abs(K).max())


@pytest.mark.parametrize("model", ["3d", *PLANE_MODELS])
def test_without_places_it_is_that_of_the_mesh(model):
    space, skin = curved("HEXA20" if model == "3d" else "TRIA6", model)
    K = loads.pressure_tangent(space, skin, 2.0)
    assert abs(K - loads.pressure_tangent(space, skin, 2.0, x=space.mesh.points)).max() == 0
    zero = K @ np.tile(np.eye(space.dim)[1], space.mesh.n_nodes)
    assert np.abs(zero).max() < 1e-13 * abs(K).max()
