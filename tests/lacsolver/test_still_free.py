"""Motions that nothing but contact and ties constrains, and those left free, of each body and of several together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from lacsolver.case import Displacement, Rigid
from lacsolver.problem.rigid_modes import describe, free_motions, still_free
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANE_MODELS, cube
from tests.lacsolver.held import held, joined, moved, nodes_in, two, with_sides

ALL = {"ux": 0, "uy": 0, "uz": 0}


def contact(mesh, model="3d"):
    """B of two flat faces that meet node to node: the normal displacement of each slave node against its master."""
    space = Space.of(mesh, model)
    low, high = mesh.node_groups["low"], mesh.node_groups["high"]
    rows = np.zeros((len(low), space.n_dof))
    s = space.dim - 1
    for k, (i, j) in enumerate(zip(low, high, strict=True)):
        rows[k, [space.dim * i + s, space.dim * j + s]] = 0.1, -0.1
    return csr_array(rows)


@pytest.mark.parametrize("gap", [0.0, 0.5])
def test_a_block_on_another_may_slide(gap):
    mesh = two(gap=gap)
    space, constraints = held(mesh, displacement=[Displacement(group="z0", **ALL)])
    motions = free_motions(space, constraints)
    left = still_free(contact(mesh), motions)
    assert [describe(m) for m in left] == [
        "'b' moves along x",
        "'b' moves along y",
        f"'b' turns about an axis along z through (0.5, 0.5, {1.5 + gap:g})",
    ]
    for motion in left:
        np.testing.assert_allclose(contact(mesh) @ motion.field, 0, atol=1e-14)
    assert len(still_free(1e-12 * contact(mesh), motions)) == 3  # areas may be small


@pytest.mark.parametrize("model", PLANE_MODELS)
def test_a_block_on_another_in_a_plane(model):
    mesh = two(model)
    clamp = Displacement(group="y0", ux=0, uy=0)
    space, constraints = held(mesh, model, displacement=[clamp])
    left = still_free(contact(mesh, model), free_motions(space, constraints))
    assert [describe(m) for m in left] == ([] if model == "axisymmetric" else ["'b' moves along x"])


def test_two_floating_bodies_in_contact():
    """Together they have the six motions of one body, and slide on one another: nine."""
    mesh = two(gap=0.0)
    space, constraints = held(mesh)
    motions = free_motions(space, constraints)
    assert len(motions) == 12
    left = still_free(contact(mesh), motions)
    names = [describe(m) for m in left]
    assert len(names) == 9
    B = contact(mesh).toarray()
    R = np.array([m.field for m in left]).T
    assert np.linalg.matrix_rank(R) == 9
    np.testing.assert_allclose(B @ R, 0, atol=1e-13)
    assert names == [
        "'a' moves along x",
        "'a' moves along y",
        "'a' turns about an axis along z through (0.5, 0.5, 0.5)",
        "'b' moves along x",
        "'b' moves along y",
        "'b' turns about an axis along z through (0.5, 0.5, 1.5)",
        "'a' and 'b' move along z",
        "'a' and 'b' turn about an axis along x through (0.5, 0.5, 0.5)",
        "'a' and 'b' turn about an axis along y through (0.5, 0.5, 0.5)",
    ]


def test_a_tie_leaves_the_motions_of_the_whole():
    mesh = two(gap=0.0)
    space, constraints = held(mesh)
    low, high = mesh.node_groups["low"], mesh.node_groups["high"]
    rows = np.zeros((3 * len(low), space.n_dof))
    k = np.arange(3 * len(low))
    rows[k, space.dofs(low).ravel()] = 1.0
    rows[k, space.dofs(high).ravel()] = -1.0
    left = still_free(csr_array(rows), free_motions(space, constraints))
    assert [describe(m) for m in left][:3] == [f"'a' and 'b' move along {axis}" for axis in "xyz"]
    assert [describe(m).split(" through")[0] for m in left][3:] == [
        f"'a' and 'b' turn about an axis along {axis}" for axis in "xyz"
    ]


def test_bodies_that_contact_does_not_couple_are_named_apart():
    far = moved(cube("HEXA8", 1), shift=(9, 0, 0))
    mesh = with_sides(joined(cube("HEXA8", 1), far))
    space, constraints = held(mesh, displacement=[Displacement(group="z0", **{"uy": 0, "uz": 0})])
    motions = free_motions(space, constraints)
    assert [describe(m) for m in motions] == ["'a' moves along x", "'b' moves along x"]
    rows = np.zeros((2, space.n_dof))
    rows[0, 0] = 1.0
    left = still_free(csr_array(rows), motions)
    assert [describe(m) for m in left] == ["'b' moves along x"]
    assert still_free(csr_array(np.zeros((0, space.n_dof))), motions)[0].field.tolist() == motions[0].field.tolist()
    assert still_free(csr_array(rows), ()) == ()


def test_contact_with_a_rigid_die():
    """A block that floats between a held rigid side and nothing: the die's rows hold it along z only."""
    mesh = two(gap=0.0)
    space, constraints = held(mesh, rigid=[Rigid(group="a")])
    left = still_free(contact(mesh), free_motions(space, constraints))
    assert [describe(m).split(" through")[0] for m in left] == [
        "'b' moves along x",
        "'b' moves along y",
        "'b' turns about an axis along z",
    ]
    assert set(left[0].nodes) == set(nodes_in(mesh, "b"))


def test_bodies_that_move_against_each_other():
    """A row that couples them with one sign: one goes forth as the other goes back, twice as far."""
    mesh = with_sides(joined(cube("HEXA8", 1), moved(cube("HEXA8", 1), shift=(9, 0, 0))))
    space, constraints = held(mesh, displacement=[Displacement(group="z0", uy=0, uz=0)])
    rows = np.zeros((1, space.n_dof))
    rows[0, [0, 24]] = 2.0, 1.0
    (motion,) = still_free(csr_array(rows), free_motions(space, constraints))
    assert describe(motion) == "'a' moves along x while 'b' moves along -x"
    np.testing.assert_allclose(rows @ motion.field, 0, atol=1e-14)
    assert np.abs(motion.field).max() == 1.0
