"""Stiffness matrices that linear solvers are tested on, held and free, and their rigid modes."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_diag, csr_array

from lacmesh import Mesh
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube, mixture, plane_mixture, square

LAW = Elastic(young=200.0, poisson=0.3)
#: name -> mesh, model: plane and solid, linear and quadratic, mixed, axisymmetric
BODIES = {
    "plane": (lambda: square("QUAD8", 5), "plane_strain"),
    "plane mixture": (lambda: plane_mixture("2"), "plane_stress"),
    "axisymmetric": (lambda: square("TRIA6", 5), "axisymmetric"),
    "hexahedra": (lambda: cube("HEXA8", 5), "3d"),
    "tetrahedra": (lambda: cube("TETRA10", 3), "3d"),
    "mixture": (lambda: mixture("2"), "3d"),
}


def stiffness(mesh, model, young=200.0):
    """The space and K of a mesh that nothing holds."""
    space = Space.of(mesh, model)
    return space, assemble_stiffness(space, Materials.of(space, Elastic(young, 0.3)))


def free(name):
    """The space and K of a body that floats (in axisymmetry: along its axis)."""
    mesh, model = BODIES[name]
    return stiffness(mesh(), model)


def held(name, young=200.0):
    """K of a body whose lowest nodes are held, these rows taken out, and the rigid modes on the others."""
    mesh, model = BODIES[name]
    space, K = stiffness(mesh(), model, young)
    kept = above(space)
    return csr_array(K.tocsr()[kept][:, kept]), rigid_modes(space)[kept]


def above(space):
    """(n_dof,): unknowns of nodes that do not lie lowest."""
    height = space.mesh.points[:, space.dim - 1]
    return np.repeat(height > height.min() + 1e-9, space.dim)


def rigid_modes(space):
    """(n_dof, 6) in 3D, (n_dof, 3) in a plane: translations, and rotations about the centre."""
    x = space.mesh.points - space.mesh.points.mean(axis=0)
    turns = [np.cross(axis, x) for axis in np.eye(3)[2 if space.dim == 2 else 0 :]]
    shifts = [np.broadcast_to(axis, x.shape) for axis in np.eye(3)[: space.dim]]
    return np.stack([m[:, : space.dim].ravel() for m in (*shifts, *turns)], axis=1)


def beam(length):
    """A row of cubes."""
    mesh = cube("HEXA8", 1)
    cell, x = mesh.blocks[0].nodes[0], mesh.points
    ends = [x + np.array([k, 0, 0]) for k in range(length)]
    points, where = np.unique(np.concatenate([e[cell] for e in ends]).round(9), axis=0, return_inverse=True)
    return Mesh.create(points, [("HEXA8", where.reshape(length, 8))])


def beside(*matrices):
    """One matrix of several bodies that do not touch."""
    return csr_array(block_diag(matrices, format="csr"))
