"""Large sliding over masters of many faces: the last iterations are quadratic, and a flat master has no drag."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from lacsolver.results.state import CONTACT
from tests.lacsolver.contact_cases import JOINT, held, resultant
from tests.lacsolver.finite_cases import solve
from tests.samples import one_in
from verification.meshes.sliding import slider

MODEL = {2: "plane_strain", 3: "3d"}
#: of residuals: where Newton's method has come near, and what rounding leaves of sliding bodies
NEAR, ROUND = 1e-2, 3e-12


def dragged(dim, kind, wave, normals, way=1.5, count=6, walls=False):
    """(problem, states): pressed down in the first step, then dragged; `walls`: its sides keep straight."""
    up, aside = "xyz"[dim - 1], {"uy": 0.0} if dim == 3 else {}
    path = {"ux": [[1.0, 0.0], [float(1 + count), way]], f"u{up}": [[0.0, 0.0], [1.0, -0.05]]}
    sections = (
        JOINT.replace('"master"', '"plate"')
        + f'normals = "{normals}"\nmeasure = "current"\n'
        + held("top", **path, **aside)
    )
    if walls:
        sections += "".join(held(side, ux=path["ux"]) for side in ("x0", "x1"))
        sections += "".join(held(side, uy=0.0) for side in ("y0", "y1")[: 2 * (dim - 2)])
    sections += f'[[rigid]]\ngroup = "plate"\n[steps]\nend = {float(1 + count)}\ncount = {1 + count}\n'
    return solve(slider(kind, 3, 17, wave), sections, model=MODEL[dim])


def ends(residuals):
    """The last two (residual, next residual) among those that are near and above rounding."""
    return [(e, then) for e, then in pairwise(residuals) if ROUND < e < NEAR][-2:]


CASES = [(2, "QUAD4"), (2, "QUAD8"), (3, "HEXA8")]


@pytest.mark.parametrize("dim, kind", CASES)
@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_on_a_flat_master_nothing_drags(dim, kind, normals):
    """A slider that keeps straight: from face to face the push stays what it was, and there is no force along."""
    problem, states = dragged(dim, kind, 0.0, normals, walls=True)
    forces = np.array([resultant(state.zones[0], problem) for state in states])
    push = forces[0, dim - 1]
    assert push > 10 and all((state.zones[0].status == CONTACT).all() for state in states)
    assert len({tuple(state.u[:2]) for state in states}) == len(states) == 7
    np.testing.assert_allclose(forces[:, dim - 1], push, rtol=1e-10)
    assert np.abs(forces[:, : dim - 1]).max() <= 1e-12 * push


@pytest.mark.parametrize("dim, kind", CASES)
@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_a_slider_that_bulges_keeps_its_forces(dim, kind, normals):
    """Its underside bulges between the nodes, and pressures along its own normals add up to 3e-4 of the push; that goes
    with it over the faces and does not change."""
    problem, states = dragged(dim, kind, 0.0, normals)
    forces = np.array([resultant(state.zones[0], problem) for state in states])
    push = forces[0, dim - 1]
    assert push > 10
    np.testing.assert_allclose(forces, np.tile(forces[0], (len(forces), 1)), atol=1e-9 * push)
    assert np.abs(forces[:, : dim - 1]).max() <= 3e-4 * push


@pytest.mark.fuzz
@pytest.mark.parametrize(
    "dim, kind, normals", one_in(2, [(*case, normals) for case in CASES for normals in ("facet", "smoothed")][1:])
)
def test_the_last_iterations_are_quadratic(dim, kind, normals):
    """Over a wave, 0.25 of a block each step: each of the last residuals is at most the one before to the power of 1.8,
    from 1e-2 on down to what rounding leaves."""
    _, states = dragged(dim, kind, 0.02, normals)
    pairs = [pair for state in states for pair in ends(state.residuals)]
    told = [" ".join(f"{e:.1e}" for e in state.residuals) for state in states]
    assert len(pairs) >= len(states) and not any(state.halvings for state in states), told
    assert all(then <= max(e**1.8, ROUND) for e, then in pairs), told
    assert any(not (state.zones[0].status == CONTACT).all() for state in states), "nothing opens"
