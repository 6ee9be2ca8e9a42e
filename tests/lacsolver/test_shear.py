"""Tangential rows: their balance, against closed forms, and the tangents that they are taken along."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lacsolver.contact import Pairing, integrate
from lacsolver.contact.shear import first_directions
from tests.lacsolver.patch_meshes import placed, stack
from tests.lacsolver.test_interface import PAIRS, rigid_motions, wavy, zone_of
from tests.lacsolver.test_tangent import MEASURES, NORMALS, raised
from tests.samples import each_option
from verification.meshes.stacks import tilt

#: every family of faces that a slave or a master can have
EVERY = [
    *PAIRS, ("TRIA3", "QUAD9", 2), ("QUAD8", "TRIA6", 2), ("PENTA6 triangle", "HEXA20", 3), ("HEXA20", "TETRA10", 3)
]  # fmt: skip
OPTIONS = list(itertools.product(EVERY, MEASURES, NORMALS, (False, True)))
ROUNDING = 1e-12


def moved(slave, master, dim, measure="reference", normals="facet", *, smooth=False, gap=0.1, **options):
    """A zone with friction whose wavy skins are deformed at random, and its coordinates and interface there."""
    mesh, zone = wavy(slave, master, dim, gap=gap, counts=(2, 3), margin=0.15)
    if smooth:
        zone = replace(zone, slave=raised(zone.slave), master=raised(zone.master))
    x = mesh.points.copy()
    x[:, :dim] += 4e-3 * np.random.default_rng(1).uniform(-1, 1, (len(x), dim))
    pairing = Pairing(search_distance=0.6, normals=normals, measure=measure, friction=True, **options)
    return zone, x, integrate(zone, dim, pairing, x=x)


@pytest.mark.parametrize("pair, measure, normals, smooth", each_option(OPTIONS), ids=str)
def test_forces_and_moments_balance(pair, measure, normals, smooth):
    """A rigid motion of both skins is no slip, across gaps, of curved and smooth skins and with any normals."""
    zone, x, face = moved(*pair, measure, normals, smooth=smooth)
    dim = pair[2]
    assert face.B_T.shape == (zone.n_macros * (dim - 1), dim * len(x)) and np.abs(face.points.ray).min() > 0.05
    for motion in rigid_motions(x, dim):
        work = np.abs(face.B_T) @ np.abs(motion.ravel())
        assert (work > 0).all()
        np.testing.assert_array_less(np.abs(face.B_T @ motion.ravel()), ROUNDING * work)


@pytest.mark.parametrize("pair", EVERY, ids=str)
@pytest.mark.parametrize("normals", NORMALS)
def test_a_traction_has_its_size_at_every_point(pair, normals):
    _, _, face = moved(*pair, normals=normals)
    points, dim = face.points, pair[2]
    e = face.tangents.e
    axes = np.concatenate([e, points.normal[:, None, :dim]], axis=1)
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), np.tile(np.eye(dim), (len(e), 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(axes), 1 if dim == 3 else -1, atol=1e-13)


@pytest.mark.parametrize("pair", EVERY, ids=str)
def test_a_master_that_slides_along(pair):
    """A uniform motion of the master is slip by minus its parts along the tangents, over what is covered."""
    dim = pair[2]
    mesh, zone = zone_of(placed(stack(*pair, gap=0.05, skew=0.1), tilt(dim)))
    face = integrate(zone, dim, Pairing(search_distance=0.5, friction=True))
    size = np.einsum("mas,mbs->mab", face.frame, face.frame)
    np.testing.assert_allclose(size, np.tile(np.eye(dim - 1), (zone.n_macros, 1, 1)), atol=1e-12)
    move = np.array([0.5, -1.0, 2.0])[:dim]
    v = np.zeros((mesh.n_nodes, dim))
    v[np.unique(zone.master.faces.nodes[zone.master.faces.nodes >= 0])] = move
    slip = (face.B_T @ v.ravel()).reshape(-1, dim - 1)
    np.testing.assert_allclose(slip, -face.w[:, None] * (face.frame @ move), atol=1e-12)


@pytest.mark.parametrize("pair", [("TRIA6", "QUAD8", 2), ("HEXA8", "TETRA4", 3), ("TETRA10", "HEXA20", 3)], ids=str)
@pytest.mark.parametrize("normals", NORMALS)
def test_the_frame_is_the_mean_direction_of_the_force(pair, normals):
    """The force of tractions t on the slave is -sum w t_alpha times the frame, whatever the curvature."""
    zone, _, face = moved(*pair, normals=normals)
    dim = pair[2]
    t = np.random.default_rng(2).uniform(-1, 1, (zone.n_macros, dim - 1))
    forces = (face.B_T.T @ t.ravel()).reshape(-1, dim)
    of_slave = np.unique(zone.slave.faces.nodes[zone.slave.faces.nodes >= 0])
    want = np.einsum("m,ma,mas->s", face.w, t, face.frame)
    np.testing.assert_allclose(forces[of_slave].sum(axis=0), want, atol=1e-13)
    assert np.linalg.norm(np.einsum("ma,mas->ms", t, face.frame), axis=1).max() <= np.linalg.norm(t, axis=1).max()


@pytest.mark.parametrize("pair", [("QUAD8", "TRIA6", 2), ("HEXA8", "TETRA4", 3), ("TETRA10", "HEXA20", 3)], ids=str)
@pytest.mark.parametrize("normals", NORMALS)
def test_tangents_turn_with_the_skin(pair, normals):
    """A rotation by 1.4 of skins that are deformed turns the tangents by it, and the rows."""
    dim = pair[2]
    zone, x, face = moved(*pair, normals=normals)
    axis, angle = (np.array([0, 0, 1.0]) if dim == 2 else np.array([1.0, 2.0, -2.0]) / 3), 1.4
    W = np.cross(np.eye(3), axis)
    R = np.eye(3) - np.sin(angle) * W + (1 - np.cos(angle)) * W @ W
    pairing = Pairing(search_distance=0.6, normals=normals, friction=True)
    turned = integrate(zone, dim, pairing, x=x @ R.T)
    np.testing.assert_allclose(turned.frame, face.frame @ R[:dim, :dim].T, atol=1e-12)
    v = np.random.default_rng(3).uniform(-1, 1, (len(x), dim))
    np.testing.assert_allclose(turned.B_T @ (v @ R[:dim, :dim].T).ravel(), face.B_T @ v.ravel(), atol=1e-11)


def test_first_directions():
    """Along the first axis that is most tangential to the whole zone; a macro-element across it takes the next."""
    _, zone = zone_of(stack("HEXA8", "TETRA4", 3))
    np.testing.assert_allclose(first_directions(zone), np.broadcast_to([1.0, 0, 0], (zone.n_macros, 3)), atol=1e-14)
    x = zone.slave.x[:, [2, 0, 1]]
    turned = replace(zone, slave=zone.slave.at(x))
    np.testing.assert_allclose(first_directions(turned), np.broadcast_to([0, 1.0, 0], (zone.n_macros, 3)), atol=1e-14)


def test_about_an_axis_rows_are_those_of_the_ring():
    """A master that slides along the axis; the weights are those of the full circle."""
    zone, x, face = moved("QUAD4", "TRIA3", 2, axisymmetric=True)
    v = np.zeros((len(x), 2))
    v[:, 1] = 1.0
    np.testing.assert_allclose(face.B_T @ v.ravel(), 0, atol=1e-13)
    v[np.unique(zone.slave.faces.nodes[:, :2]), 1] = 0.0
    np.testing.assert_allclose(face.B_T @ v.ravel(), -face.w * face.frame[:, 0, 1], rtol=1e-11)


def test_nothing_of_it_without_friction():
    _, zone = wavy("QUAD4", "TRIA3", 2)
    face = integrate(zone, 2, Pairing(search_distance=0.5))
    assert face.B_T is None and face.frame is None
