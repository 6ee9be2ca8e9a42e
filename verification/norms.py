"""L2 errors of what a solver gives against exact fields, by quadrature on the reference cells of the undeformed mesh.

The rules are of a degree (`DEGREE`) at which the integral's own error is far below the one that it measures.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh import CELLS, Mesh
from lacmesh.quadrature import rule
from lacmesh.shapes import jacobian, shape
from verification.exact import Function

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]
#: of the rules, in each reference coordinate or in all together
DEGREE = 8
#: cells whose points are held at once
_PIECE = 1 << 14


class Points(NamedTuple):
    """Quadrature points of cells of one type: rows in the list asked for (k,), nodes (k, n), N (p, n), x (k, p, 3),
    weights (k, p) with the measure of the cell in them.
    """

    row: Ints
    nodes: Ints
    N: Floats
    x: Floats
    w: Floats


def points_of(mesh: Mesh, cells: Ints, degree: int = DEGREE) -> Iterator[Points]:
    """The quadrature points of some cells (sorted indices), type by type and piece by piece."""
    for kind, chosen, nodes in mesh.select(cells):
        X, w = rule(CELLS[kind].family, degree)
        N, row = shape(kind, X), np.searchsorted(cells, chosen)
        for k in range(0, len(nodes), _PIECE):
            x = mesh.points[nodes[k : k + _PIECE]]
            J = jacobian(kind, x, X)
            measure = np.sqrt(np.linalg.det(np.swapaxes(J, -1, -2) @ J))
            yield Points(row[k : k + _PIECE], nodes[k : k + _PIECE], N, np.einsum("pn,kns->kps", N, x), measure * w)


def displacement_error(mesh: Mesh, u: Floats, exact: Function) -> float:
    """|u - u_exact| / |u_exact| in L2 over the body; u (n_nodes, dim)."""
    body = np.flatnonzero(mesh.cell_dim == mesh.space_dim)
    off = whole = 0.0
    for at in points_of(mesh, body):
        right = _values(exact, at.x, mesh.space_dim)
        off += _squared(np.einsum("pn,kns->kps", at.N, u[at.nodes]) - right, at.w)
        whole += _squared(right, at.w)
    return float(np.sqrt(off / whole))


class PressureErrors(NamedTuple):
    """Relative to the exact pressure in L2: of p_m against it, and against its mean over each macro-element."""

    exact: float
    mean: float


def pressure_errors(mesh: Mesh, p: Floats, exact: Function) -> PressureErrors:
    """Errors over the slave of a cut mesh; p (n_macros,) by the number of the macro-element, `exact` (n, 1)."""
    macro = mesh.cell_data["lac_macro"]
    faces = np.flatnonzero(macro >= 0)
    off = whole = 0.0
    area, force = np.zeros(len(p)), np.zeros(len(p))
    for at in points_of(mesh, faces):
        own = macro[faces[at.row]]
        right = _values(exact, at.x, mesh.space_dim)
        off += _squared(p[own][:, None, None] - right, at.w)
        whole += _squared(right, at.w)
        np.add.at(area, own, at.w.sum(axis=1))
        np.add.at(force, own, (at.w * right[..., 0]).sum(axis=1))
    return PressureErrors(float(np.sqrt(off / whole)), float(np.sqrt(area @ (p - force / area) ** 2 / whole)))


def _values(exact: Function, x: Floats, dim: int) -> Floats:
    """(k, p, components) of an exact field at points (k, p, 3)."""
    return exact(x.reshape(-1, 3)[:, :dim]).reshape(*x.shape[:2], -1)


def _squared(v: Floats, w: Floats) -> float:
    return float(np.einsum("kps,kps,kp->", v, v, w))
