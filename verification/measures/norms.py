"""Errors against exact fields, in L2 and in the energy norm, by quadrature on the undeformed cells.

The rules are of a degree (`DEGREE`) at which the integral's own error is far below the one that it measures. In
axisymmetry (r = x, the axis is y) weights have 2 pi r in them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, jacobian, shape

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]
#: (n, k) at points (n, dim)
ExactField = Callable[[Floats], Floats]
#: of the rules, in each reference coordinate or in all together
DEGREE = 8
#: cells whose points are in memory at once
_PIECE = 1 << 14


class Points(NamedTuple):
    """Quadrature points of cells of one type: rows in the list of cells (k,), nodes (k, n), N (p, n), x (k, p, 3),
    weights (k, p) with the measure of the cell in them; `dN` (p, n, dim) and `J` (k, p, 3, dim) for gradients.
    """

    row: Ints
    nodes: Ints
    N: Floats
    x: Floats
    w: Floats
    dN: Floats
    J: Floats

    def gradient(self, u: Floats) -> Floats:
        """Gradient (k, p, d, dim), du_i / dx_j, of a nodal field u (n_nodes, d), for cells of the space's dimension."""
        dim = self.J.shape[-1]
        dN = self.dN @ np.linalg.inv(self.J[..., :dim, :])
        return np.einsum("kni,kpnj->kpij", u[self.nodes], dN)


def points_of(mesh: Mesh, cells: Ints, *, axisymmetric: bool = False, degree: int = DEGREE) -> Iterator[Points]:
    """The quadrature points of some cells (sorted indices), type by type and piece by piece."""
    for kind, chosen, nodes in mesh.select(cells):
        X, w = rule(CELLS[kind].family, degree)
        N, dN, row = shape(kind, X), gradient(kind, X), np.searchsorted(cells, chosen)
        for k in range(0, len(nodes), _PIECE):
            own = nodes[k : k + _PIECE]
            J = jacobian(kind, mesh.points[own], X)
            x = np.einsum("pn,kns->kps", N, mesh.points[own])
            measure = np.sqrt(np.linalg.det(np.swapaxes(J, -1, -2) @ J)) * w
            round_ = 2 * np.pi * x[..., 0] if axisymmetric else 1.0
            yield Points(row[k : k + _PIECE], own, N, x, measure * round_, dN, J)


def displacement_error(
    mesh: Mesh, u: Floats, exact: ExactField, *, cells: Ints | None = None, axisymmetric: bool = False
) -> float:
    """Error |u - u_exact| / |u_exact| in L2 over the body or some cells (sorted indices); u (n_nodes, dim)."""
    body = np.flatnonzero(mesh.cell_dim == mesh.space_dim) if cells is None else cells
    off = whole = 0.0
    for at in points_of(mesh, body, axisymmetric=axisymmetric):
        right = _values(exact, at.x, mesh.space_dim)
        off += squared(np.einsum("pn,kns->kps", at.N, u[at.nodes]) - right, at.w)
        whole += squared(right, at.w)
    return float(np.sqrt(off / whole))


class PressureErrors(NamedTuple):
    """Errors of p_m relative to the exact pressure in L2: against it, and against its mean over each macro-element."""

    exact: float
    mean: float

    @property
    def best(self) -> float:
        """Relative L2 error of the exact means, the best of all constants on macro-elements (Pythagoras)."""
        return float(np.sqrt(max(self.exact**2 - self.mean**2, 0.0)))


def pressure_errors(mesh: Mesh, p: Floats, exact: ExactField, *, axisymmetric: bool = False) -> PressureErrors:
    """Errors over the slave of a cut mesh; p (n_macros,) by the number of the macro-element, `exact` (n, 1)."""
    macro = mesh.cell_data["lac_macro"]
    faces = np.flatnonzero(macro >= 0)
    off = whole = 0.0
    area, force = np.zeros(len(p)), np.zeros(len(p))
    for at in points_of(mesh, faces, axisymmetric=axisymmetric):
        own = macro[faces[at.row]]
        right = _values(exact, at.x, mesh.space_dim)
        off += squared(p[own][:, None, None] - right, at.w)
        whole += squared(right, at.w)
        np.add.at(area, own, at.w.sum(axis=1))
        np.add.at(force, own, (at.w * right[..., 0]).sum(axis=1))
    return PressureErrors(float(np.sqrt(off / whole)), float(np.sqrt(area @ (p - force / area) ** 2 / whole)))


def nodal_pressure_error(
    mesh: Mesh, p: Floats, exact: ExactField, *, faces: Ints | None = None, axisymmetric: bool = False
) -> float:
    """Error |p - p_exact| / |p_exact| in L2 of a pressure p (n_nodes,) at the nodes of the slave of a cut mesh.

    The integral runs over all slave faces, or over some (sorted indices of cells).
    """
    faces = np.flatnonzero(mesh.cell_data["lac_macro"] >= 0) if faces is None else faces
    off = whole = 0.0
    for at in points_of(mesh, faces, axisymmetric=axisymmetric):
        right = _values(exact, at.x, mesh.space_dim)
        off += squared((p[at.nodes] @ at.N.T)[..., None] - right, at.w)
        whole += squared(right, at.w)
    return float(np.sqrt(off / whole))


def strains(u: Floats, at: Points, *, axisymmetric: bool = False) -> Floats:
    """Strain (k, p, 6): xx, yy, zz, xy, yz, xz (tensor components) of a nodal displacement u (n_nodes, dim)."""
    G = at.gradient(u)
    out = np.zeros((*G.shape[:2], 6))
    dim = G.shape[-1]
    for s in range(dim):
        out[..., s] = G[..., s, s]
    if axisymmetric:
        out[..., 2] = np.einsum("pn,kn->kp", at.N, u[at.nodes, 0]) / at.x[..., 0]
    for k, (i, j) in enumerate(((0, 1), (1, 2), (0, 2))):
        if max(i, j) < dim:
            out[..., 3 + k] = (G[..., i, j] + G[..., j, i]) / 2
    return out


def energy(strain: Floats, w: Floats, young: float, poisson: float) -> float:
    """Integral of sigma : epsilon of strains (k, p, 6) in an isotropic body."""
    mu, lam = young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    trace = strain[..., :3].sum(axis=-1)
    square = (strain[..., :3] ** 2).sum(axis=-1) + 2 * (strain[..., 3:] ** 2).sum(axis=-1)
    return float(((lam * trace**2 + 2 * mu * square) * w).sum())


def _values(exact: ExactField, x: Floats, dim: int) -> Floats:
    """Values (k, p, components) of an exact field at points (k, p, 3)."""
    return exact(x.reshape(-1, 3)[:, :dim]).reshape(*x.shape[:2], -1)


def squared(v: Floats, w: Floats) -> float:
    """Integral of |v|^2 of a field (k, p, components)."""
    return float(np.einsum("kps,kps,kp->", v, v, w))
