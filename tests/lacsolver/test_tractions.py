"""The derivative of the forces of tractions, against central differences as `test_tangent` does for pressures."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lacsolver.contact import Pairing, integrate
from lacsolver.contact.tangent import motion_of, tangent
from tests.lacsolver.test_interface import rigid_motions, wavy
from tests.lacsolver.test_tangent import ANY, MEASURES, NORMALS, STRAIGHT, Deformed, options_of
from tests.samples import each_option

#: where integrals are exact: in front of one master face, and where slave faces are straight with their own normals
EXACT = 1e-9


def every(pairs, normals=NORMALS):
    """Mark a test to try each pair with each measure and normal, in a plane about an axis too."""
    options = [
        (pair, {"measure": m, "normals": of, "axisymmetric": a, "friction": True})
        for pair, m, of, a in itertools.product(pairs, MEASURES, normals, (False, True))
        if not (a and pair[2] == 3)
    ]
    return pytest.mark.parametrize("pair, options", each_option(options, of=options_of), ids=str)


def error(made, step=1e-5):
    """Return the error of the forces' derivative in a random direction against differences of fourth order."""
    v = made.direction()
    far, near = ((made.forces(made.at(h * v)) - made.forces(made.at(-h * v))) / (2 * h) for h in (2 * step, step))
    want = (4 * near - far) / 3
    return np.abs(made.K @ v[:, : made.dim].ravel() - want).max() / np.abs(want).max()


@every([*STRAIGHT[:2], *ANY])
@pytest.mark.parametrize("smooth", [False, True])
def test_in_front_of_one_face(pair, options, smooth):
    """Tangents, their spin, arms across the ray, weights and heights: all terms but those of moving edges."""
    assert error(Deformed(*pair, options, counts=(2, 1), smooth=smooth)) <= EXACT


@every(STRAIGHT, normals=("facet",))
def test_moving_edges(pair, options):
    """Faces in front of several, whose mortar segments move; the integrals over straight faces are exact."""
    assert error(Deformed(*pair, options, surface="faces")) <= EXACT


@every(ANY)
def test_any_faces_in_front_of_several(pair, options):
    """Rules with a few points leave the derivative off by what they are off themselves."""
    made = Deformed(*pair, options, counts=(6, 7) if pair[2] == 2 else (2, 3))
    assert error(made) <= (1e-2 if pair[:2] == ("QUAD8", "TRIA6") else 1e-4)


@every([ANY[0], STRAIGHT[1], STRAIGHT[2], STRAIGHT[3]])
def test_a_master_that_ends_under_its_slave(pair, options):
    assert error(Deformed(*pair, options, margin=-0.05)) <= (EXACT if pair[2] == 2 else 1e-5)


@every(ANY)
def test_a_rotation_of_both_skins_turns_the_forces(pair, options):
    made = Deformed(*pair, options, counts=(2, 3))
    dim = pair[2]
    forces = made.forces(made.face).reshape(-1, dim)
    size = np.abs(made.K).sum(axis=1).max()
    spin = [np.zeros(3)] * dim + ([np.array([0, 0, 1.0])] if dim == 2 else list(np.eye(3)))
    for k, (motion, theta) in enumerate(zip(rigid_motions(made.x, dim), spin, strict=True)):
        if options["axisymmetric"] and k != 1:
            continue  # about an axis, only a translation along it is a rigid motion
        turned = np.cross(theta, np.pad(forces, ((0, 0), (0, 3 - dim))))[:, :dim]
        np.testing.assert_allclose((made.K @ motion.ravel()).reshape(-1, dim), turned, atol=1e-12 * size)


@pytest.mark.parametrize("pair, normals", each_option(itertools.product(ANY, NORMALS)), ids=str)
def test_without_tractions_it_is_that_of_the_pressures(pair, normals):
    """Macro-elements without pressure and traction are left out; those with one of the two are not."""
    mesh, zone = wavy(*pair, counts=(2, 3), margin=0.15)
    pairing = Pairing(search_distance=0.6, normals=normals, friction=True)
    face = integrate(zone, pair[2], pairing, x=mesh.points)
    motion = motion_of(face, face.slave, face.master, pairing, pair[2])
    p, t = np.arange(zone.n_macros) % 3.0, np.arange(zone.n_macros * (pair[2] - 1)) % 2.0
    of_p, both, of_t = tangent(motion, p), tangent(motion, p, t), tangent(motion, 0 * p, t)
    atol = 1e-13 * np.abs(both).max()
    np.testing.assert_allclose(tangent(motion, p, 0 * t).toarray(), of_p.toarray(), atol=atol)
    np.testing.assert_allclose((of_p + of_t).toarray(), both.toarray(), atol=atol)
    assert np.abs(of_t).max() > 0.1 * np.abs(of_p).max()
