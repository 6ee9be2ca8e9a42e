"""Consistent linearisation of an interface: derivatives of the contact force and of the gaps by the displacement.

At a contact point with fixed slave coordinates, whose ray x + g n meets the master at xi_bar,

    tau_b dxi_bar^b - n dg = dx + g dn - dx_bar          (dx_bar: the master's displacement at fixed xi_bar)

gives the motion of the point on the master and the change of the gap g between the faces. The gap of the smooth
surfaces, whose heights b move with their faces, changes by dg - (db_m/dxi^b) dxi_bar^b. dn is the change of the faces'
own normal, or of the interpolated nodal normals. With w the weight and dw its change (in the current measure),

    d(B^T p).v = sum p w [ dn.(v - v_bar) - (n.dv_bar/dxi^b) dxi_bar^b ] + p dw n.(v - v_bar)
    dG = sum w dg + dw g

The edges of mortar segments move too, by V (`edges`), which adds the line integral of the integrand times V:

    d(B^T p).v += sum_edges p w V n.(v - v_bar),     dG += sum_edges w V g

All these derivatives are sparse matrices of the displacement, with rows for points times components; the tangents are
products of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, shape
from lacmesh.surface import Surface
from lacmesh.surface.normals import crease_pairs, normals_of
from lacsolver.contact.edges import edges_of
from lacsolver.contact.interface import Interface, Pairing, by_type, stretch, tangents


class Motion(NamedTuple):
    """Derivatives at contact points, as matrices of u (n_dof,) with rows for points, or points times components.

    `jump`: v(x) - v(x_bar); `d_normal`: dn; `d_master_xi`: dxi_bar; `d_gap`: dg; `d_master_normal`: n . dv_bar/dxi^b,
    with the rows of `d_master_xi`; `d_weight`: dw / w, None for the reference measure, whose weights are constant;
    `boundary`: the terms of moving segment edges.
    """

    jump: csr_array
    d_normal: csr_array
    d_master_xi: csr_array
    d_gap: csr_array
    d_master_normal: csr_array
    d_weight: csr_array | None
    boundary: MovingBoundaryTerms


class MovingBoundaryTerms(NamedTuple):
    """Boundary terms of moving mortar segments (Reynolds transport), one row per quadrature point of an edge.

    `macro`; `weight`; `distance`: gap with the mean clearance of the macro-element; `across`: n.(v - v_bar), and
    `moving`: V, as matrices of u.
    """

    macro: Ints
    weight: Floats
    distance: Floats
    across: csr_array
    moving: csr_array


def tangent(face: Interface, motion: Motion, p: Floats) -> csr_array:
    """Return d(B^T p)/du (n_dof, n_dof) at pressures p (m,); it is not symmetric."""
    d = face.normal.shape[1]
    load = p[face.points.macro] * face.weight
    each, slide = np.repeat(load, d), np.repeat(load, d - 1)
    K = motion.jump.T @ diags_array(each) @ motion.d_normal
    K = K - motion.d_master_normal.T @ diags_array(slide) @ motion.d_master_xi
    if motion.d_weight is not None:
        n = face.points.normal[:, :d]
        K = K + (_along(n) @ motion.jump).T @ diags_array(load) @ motion.d_weight
    gained = motion.boundary
    return csr_array(K + gained.across.T @ diags_array(p[gained.macro] * gained.weight) @ gained.moving)


def gap_derivative(face: Interface, motion: Motion) -> csr_array:
    """Return -dG/du (m, n_dof), with all terms."""
    points, m = face.points, len(face.G)
    total = csr_array((face.weight, (points.macro, np.arange(len(points)))), shape=(m, len(points)))
    out = total @ motion.d_gap
    if motion.d_weight is not None:
        moment_arm = csr_array(
            (face.weight * face.distance, (points.macro, np.arange(len(points)))), shape=(m, len(points))
        )
        out = out + moment_arm @ motion.d_weight
    gained = motion.boundary
    at, moment_arm = np.arange(len(gained.macro)), gained.weight * gained.distance
    return csr_array(-out - csr_array((moment_arm, (gained.macro, at)), shape=(m, len(at))) @ gained.moving)


def motion_of(face: Interface, slave: Surface, master: Surface, pairing: Pairing, dim: int) -> Motion:
    """Return the derivatives at the contact points of an interface; `slave`, `master`: its deformed skins."""
    points = face.points
    n = points.normal[:, :dim]
    here = _interpolation(slave, points.slave, points.xi_slave, dim)
    there = _interpolation(master, points.master, points.xi_master, dim)
    if pairing.normals == "smoothed":
        nodal, turned = _nodal_normals(slave, pairing.crease_angle, dim)
        turning = _smooth_normal_change(slave, face, nodal, turned, dim)
    else:
        nodal, turning = None, _facet_normal_change(slave, face, dim)
    tau = tangents(master, points.master, points.xi_master)[:, :dim]
    moved = csr_array(here + diags_array(np.repeat(points.ray, dim)) @ turning - there)
    solved = _blocks(np.linalg.inv(np.concatenate([tau, -n[:, :, None]], axis=2))) @ moved
    at = np.arange(len(points))
    slides = (dim * at[:, None] + np.arange(dim - 1)).ravel()
    sliding, closing = csr_array(solved[slides]), csr_array(solved[dim * at + dim - 1])
    if master.height is not None:
        slope = master.height.slope(points.master, points.xi_master)[:, : dim - 1]
        closing = csr_array(closing - _along(slope) @ sliding)
    along = _along_master(master, face, dim)
    stretching = _stretching(slave, face, pairing, dim) if pairing.measure == "current" else None
    return Motion(
        csr_array(here - there),
        turning,
        sliding,
        closing,
        along,
        stretching,
        _moving_boundary_terms(face, slave, master, pairing, dim, nodal),
    )


def _moving_boundary_terms(
    face: Interface, slave: Surface, master: Surface, pairing: Pairing, dim: int, nodal: Floats | None
) -> MovingBoundaryTerms:
    """Return the boundary terms of moving mortar segments."""
    edges = edges_of(face.points.slave, face.points.master, slave, master, dim, nodal, pairing.axisymmetric)
    at = edges.points
    between = _interpolation(slave, at.slave, at.xi_slave, dim) - _interpolation(master, at.master, at.xi_master, dim)
    weight = at.weight * pairing.thickness
    if pairing.measure == "reference":
        weight = weight * stretch(face.zone, slave, at, pairing.axisymmetric)
    n, macro = np.ascontiguousarray(at.normal[:, :dim]), face.zone.macro[at.macro]
    extra = np.bincount(face.points.macro, face.weight * (face.distance - face.points.gap), len(face.w))
    clearance = np.divide(extra, face.w, out=np.zeros_like(face.w), where=face.w > 0)
    return MovingBoundaryTerms(macro, weight, at.gap + clearance[macro], csr_array(_along(n) @ between), edges.moving)


def _interpolation(surface: Surface, face: Ints, xi: Floats, dim: int) -> csr_array:
    """Return the displacement at points of faces, as a matrix (points dim, n_dof) of u."""
    parts = []
    for rows, name, nodes in by_type(surface, face):
        N = shape(name, xi[rows, : surface.dim])
        column = dim * nodes[:, None, :] + np.arange(dim)[:, None]
        parts.append((rows, column, np.broadcast_to(N[:, None, :], column.shape)))
    return _rows(parts, len(face), dim, dim * len(surface.x))


def _along_master(master: Surface, face: Interface, dim: int) -> csr_array:
    """Return n . dv/dxi^b on the master, (points (dim - 1), n_dof)."""
    points = face.points
    parts = []
    for rows, name, nodes in by_type(master, points.master):
        dN = gradient(name, points.xi_master[rows, : master.dim])
        parts.append((rows, nodes, np.einsum("pab,ps->pbas", dN, points.normal[rows, :dim])))
    return _gathered(parts, len(points), dim - 1, dim, len(master.x))


def _facet_normal_change(slave: Surface, face: Interface, dim: int) -> csr_array:
    """Return the change of the faces' own normals, dn = -sum_a a^a (n . dv/dxi^a), (points dim, n_dof)."""
    points, parts = face.points, []
    for rows, name, nodes in by_type(slave, points.slave):
        dN = gradient(name, points.xi_slave[rows, : slave.dim])
        dual = _dual(np.einsum("pad,pas->psd", dN, slave.x[nodes]))[:, :dim]
        parts.append((rows, nodes, -np.einsum("pkd,pad,ps->pkas", dual, dN, points.normal[rows, :dim])))
    return _gathered(parts, len(points), dim, dim, len(slave.x))


def _stretching(slave: Surface, face: Interface, pairing: Pairing, dim: int) -> csr_array:
    """Return dw / w = sum_a a^a . dv/dxi^a, plus v_r / r in axisymmetry, (points, n_dof)."""
    points, parts = face.points, []
    for rows, name, nodes in by_type(slave, points.slave):
        xi = points.xi_slave[rows, : slave.dim]
        dN = gradient(name, xi)
        dual = _dual(np.einsum("pad,pas->psd", dN, slave.x[nodes]))[:, :dim]
        entry = np.einsum("pkd,pad->pak", dual, dN)[:, None]
        if pairing.axisymmetric:
            N = shape(name, xi)
            r = (N * slave.x[nodes, 0]).sum(axis=1)
            entry[:, 0, :, 0] += N / r[:, None]
        parts.append((rows, nodes, entry))
    return _gathered(parts, len(points), 1, dim, len(slave.x))


def _smooth_normal_change(slave: Surface, face: Interface, nodal: Floats, turned: csr_array, dim: int) -> csr_array:
    """Return the change dn of interpolated nodal normals n = H / |H|, H = sum_a N_a n_a, (points dim, n_dof)."""
    points, parts = face.points, []
    for rows, name, nodes in by_type(slave, points.slave):
        k = nodes.shape[1]
        N = shape(name, points.xi_slave[rows, : slave.dim])
        H = np.einsum("pa,pas->ps", N, nodal[points.slave[rows], :k])
        n = points.normal[rows, :dim]
        P = (np.eye(dim) - n[:, :, None] * n[:, None, :]) / np.linalg.norm(H, axis=1)[:, None, None]
        places = 9 * points.slave[rows][:, None] + np.arange(k)
        parts.append((rows, places, np.einsum("pks,pa->pkas", P, N)))
    return csr_array(_gathered(parts, len(points), dim, dim, 9 * len(slave)) @ turned)


def _nodal_normals(slave: Surface, crease_angle: float | None, dim: int) -> tuple[NDArray[np.floating], csr_array]:
    """Return unit normals (f, 9, dim) at the nodes of each face, and their derivative (f 9 dim, n_dof).

    As in `lacmesh.surface.normals.smoothed`, a node's normal is the area-weighted mean of the normals of its faces,
    without those across a crease.
    """
    f = len(slave)
    own, area = np.zeros((f, 9, dim)), np.zeros(f)
    turn, grow = [], []
    for name, rows, nodes in slave.by_type():
        k, x = nodes.shape[1], slave.x[nodes]
        dN = gradient(name, np.array(CELLS[name].reference, dtype=float)[:, : slave.dim])
        J = np.einsum("ead,fas->fesd", dN, x)
        n = _unit_normals(J)[..., :dim]
        own[rows, :k] = n
        dual = _dual(J.reshape(-1, *J.shape[2:])).reshape(J.shape)[:, :, :dim]
        entry = -np.einsum("feld,ead,fes->felas", dual, dN, n)
        place = 9 * rows[:, None] + np.arange(k)
        turn.append((place.ravel(), np.repeat(nodes, k, axis=0), entry.reshape(-1, dim, k, dim)))
        X, w = rule(CELLS[name].family, 4)
        made, change = _mean_area(name, x, X, w, slave.dim, dim)
        area[rows] = made
        grow.append((rows, nodes, change[:, None]))
    d_own = _gathered(turn, 9 * f, dim, dim, len(slave.x))
    d_area = _gathered(grow, f, 1, dim, len(slave.x))
    row, other = crease_pairs(slave, own, crease_angle)
    share, unit = area[other // 9], own.reshape(-1, dim)[other]
    total = np.zeros((9 * f, dim))
    np.add.at(total, row, share[:, None] * unit)
    d_total = (
        _scattered(row, other, np.broadcast_to(share[:, None, None] * np.eye(dim), (len(row), dim, dim)), f, dim)
        @ d_own
    )
    at = (dim * row[:, None] + np.arange(dim)).ravel()
    d_total = d_total + csr_array((unit.ravel(), (at, np.repeat(other // 9, dim))), shape=(9 * f * dim, f)) @ d_area
    size = np.linalg.norm(total, axis=1)
    n = np.divide(total, size[:, None], out=np.zeros_like(total), where=size[:, None] > 0)
    P = (np.eye(dim) - n[:, :, None] * n[:, None, :]) / np.where(size > 0, size, 1.0)[:, None, None]
    return n.reshape(f, 9, dim), csr_array(_blocks(P) @ d_total)


def _mean_area(name: str, x: Floats, X: Floats, w: Floats, of: int, dim: int) -> tuple[Floats, Floats]:
    """Return the size (f,) of the vector area of each face, and its derivative (f, nodes, dim)."""
    dN = gradient(name, X[:, :of])
    J = np.einsum("qad,fas->fqsd", dN, x)
    vector = np.einsum("q,fqs->fs", w, normals_of(J))
    size = np.linalg.norm(vector, axis=1)
    unit = vector / size[:, None]
    if of == 1:
        change = np.einsum("q,qa,fs->fas", w, dN[..., 0], np.stack([-unit[:, 1], unit[:, 0]], axis=1))
        return size, change[..., :dim]
    ab = np.cross(J[..., 1], unit[:, None])
    ba = np.cross(unit[:, None], J[..., 0])
    change = np.einsum("q,qa,fqs->fas", w, dN[..., 0], ab) + np.einsum("q,qa,fqs->fas", w, dN[..., 1], ba)
    return size, change


def _unit_normals(J: Floats) -> NDArray[np.floating]:
    n = normals_of(J)
    size = np.linalg.norm(n, axis=-1, keepdims=True)
    return np.divide(n, size, out=np.zeros_like(n), where=size > 0)


def _dual(J: Floats) -> NDArray[np.floating]:
    """Return the dual vectors (p, 3, d) of tangents (p, 3, d), in their plane."""
    return np.einsum("psd,pde->pse", J, np.linalg.inv(np.einsum("psd,pse->pde", J, J)))


def _along(n: Floats) -> csr_array:
    """Return the matrix (points, points dim) that takes the components of vectors along n (points, dim)."""
    count, dim = n.shape
    return csr_array((n.ravel(), np.arange(n.size), dim * np.arange(count + 1)), shape=(count, n.size))


def _blocks(A: Floats) -> csr_array:
    """Return the block diagonal matrix of A (points, d, d)."""
    count, d, _ = A.shape
    column = (d * np.arange(count)[:, None, None] + np.broadcast_to(np.arange(d), (d, d))).ravel()
    return csr_array((A.ravel(), column, d * np.arange(count * d + 1)), shape=(count * d, count * d))


def _gathered(parts: list, count: int, rows: int, dim: int, n_nodes: int) -> csr_array:
    """Return a matrix (count rows, dim n_nodes) from entries (points, nodes (p, k), values (p, rows, k, dim))."""
    flat = []
    for points, nodes, value in parts:
        column = (dim * nodes[:, :, None] + np.arange(dim)).reshape(len(nodes), 1, -1)
        flat.append((points, np.broadcast_to(column, (len(nodes), rows, column.shape[2])), value))
    return _rows(flat, count, rows, dim * n_nodes)


def _rows(parts: list, count: int, rows: int, n: int) -> csr_array:
    """Return a matrix (count rows, n) from entries (points, columns (p, rows, k), values (p, rows, ..)).

    Each point is in one entry only.
    """
    width = np.zeros(count, np.int64)
    for points, column, _ in parts:
        width[points] = column.shape[2]
    indptr = np.concatenate([[0], np.cumsum(np.repeat(width, rows))])
    indices, data = np.empty(indptr[-1], np.int32), np.empty(indptr[-1])
    for points, column, value in parts:
        first = indptr[rows * points[:, None] + np.arange(rows)]
        at = first[:, :, None] + np.arange(column.shape[2])
        indices[at], data[at] = column, value.reshape(column.shape)
    return csr_array((data, indices, indptr), shape=(count * rows, n))


def _scattered(row: Ints, column: Ints, value: Floats, f: int, dim: int) -> csr_array:
    """Return a matrix (9 f dim, 9 f dim) with the sum of blocks (k, dim, dim) at block rows and columns."""
    i = np.broadcast_to(dim * row[:, None, None] + np.arange(dim)[:, None], value.shape)
    j = np.broadcast_to(dim * column[:, None, None] + np.arange(dim), value.shape)
    return coo_array((value.ravel(), (i.ravel(), j.ravel())), shape=(9 * f * dim, 9 * f * dim)).tocsr()
