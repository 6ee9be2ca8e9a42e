"""The arm of a tie across a gap, which turns with the faces of the slave under finite rotations.

With r n the vector from a point x of the undeformed slave to its master, and n(u) the normal of the deformed face,

    J(u) = int_{T_m} (u(x) + r (n(u) - n) - u(x_bar)) . e_k dGamma,    k = 1 ... d

is 0 for every rigid motion, which takes n to R n. Its derivative are the rows of `shear.jump_rows` on the deformed
faces, and the second derivative of n is the geometric stiffness. With dual vectors a^a of the deformed tangents,

    P . d2n(v, w) = sum_ab (n.v_a)(P.a^b)(a^a.w_b) + (P.a^a)(a^b.v_a)(n.w_b) - a^a.a^b (P.n)(n.v_a)(n.w_b),

where v_a = dv/dxi^a.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats
from lacmesh.reference.shapes import gradient
from lacmesh.surface import Surface
from lacmesh.surface.normals import dual_vectors, normals_of, unit
from lacsolver.contact.faces import by_type, places, tangents
from lacsolver.contact.interface import Interface
from lacsolver.contact.shear import integrals, jump_rows
from lacsolver.distributed.share import Share
from lacsolver.space.sparse import sparse

#: arm of a tie, relative to the size of the faces, below which it is round-off
_ROUNDING = 1e-13


def has_arm(face: Interface, share: Share) -> bool:
    """True if the skins of a tie are apart."""
    longest = share.largest(float(np.abs(face.points.ray).max(initial=0.0)))
    return longest > _ROUNDING * float(face.slave.size.max())


def turned(face: Interface, x: Floats, share: Share) -> Interface:
    """Return the interface of a tie, from the one of the undeformed skins, with its nodes at x (n_nodes, 3).

    Its rows B are the derivative of J(u), and G is -J(u), (d m,).
    """
    points, dim, m = face.points, face.normal.shape[1], len(face.w)
    slave, master, n = face.slave.at(x), face.master.at(x), _normals(face, face.slave.at(x))
    axes = np.broadcast_to(np.eye(dim), (len(points), dim, dim))
    J = tangents(slave, points.slave, points.xi_slave)
    B = jump_rows(slave, master, replace(points, normal=n), face.weight, axes, m, J)
    jump = points.ray[:, None] * (n - _normals(face, face.slave))
    jump += places(slave, points.slave, points.xi_slave) - places(face.slave, points.slave, points.xi_slave)
    jump -= places(master, points.master, points.xi_master) - places(face.master, points.master, points.xi_master)
    G = -share.total(integrals(jump[:, :dim], points.macro, face.weight, m)).ravel()
    return replace(face, B=share.add_matrices(B, (False, True)), G=G)


def bent(face: Interface, x: Floats, p: Floats) -> csr_array:
    """Return d(B^T p)/du (n_dof, n_dof) at multipliers p (d m,), of own macro-elements; `face`, x: see `turned`."""
    points, dim, slave = face.points, face.normal.shape[1], face.slave.at(x)
    if not len(points):
        return csr_array((dim * x.shape[0],) * 2)
    J = tangents(slave, points.slave, points.xi_slave)
    dual, n = dual_vectors(J)[:, :dim], _normals(face, slave)[:, :dim]
    P = (face.weight * points.ray)[:, None] * p.reshape(-1, dim)[points.macro]
    along, k = np.einsum("ps,psa->pa", P, dual), dual.shape[2]
    M = np.einsum("ps,pb,pta->pasbt", n, along, dual)
    M = M + M.transpose(0, 3, 4, 1, 2)
    M -= np.einsum("p,psa,psb,pi,pj->paibj", (P * n).sum(axis=1), dual, dual, n, n)
    blocks = (M.reshape(len(points), k * dim, k * dim), np.arange(len(points)), np.arange(len(points) + 1))
    slopes = _slopes(face, x.shape[0])
    return csr_array(slopes.T @ (bsr_array(blocks, shape=(slopes.shape[0],) * 2) @ slopes))


def _normals(face: Interface, slave: Surface) -> NDArray[np.floating]:
    """Return the unit normals (points, 3) of deformed faces, on the side on which the undeformed ones are."""
    points = face.points
    n = unit(normals_of(tangents(slave, points.slave, points.xi_slave)))
    before = unit(normals_of(tangents(face.slave, points.slave, points.xi_slave)))
    return np.asarray(n * np.sign((before * points.normal).sum(axis=1, keepdims=True)))


def _slopes(face: Interface, n_nodes: int) -> csr_array:
    """Return the matrix of dv_s/dxi^a (points, a, s) at the points, on the unknowns of all nodes of the slave."""
    points, dim, k = face.points, face.normal.shape[1], face.slave.dim
    axis, entries = np.arange(dim), []
    for rows, name, nodes in by_type(face.slave, points.slave):
        at = np.arange(len(points))[rows]
        dN = gradient(name, points.xi_slave[rows, :k])
        row = dim * (k * at[:, None, None, None] + np.arange(k)[:, None]) + axis
        column = dim * nodes[:, :, None, None] + axis
        entries.append((row, column, dN[..., None]))
    return sparse((len(points) * k * dim, n_nodes * dim), *entries)
