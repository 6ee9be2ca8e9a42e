"""Coverage of macro-elements, from contact points: the area, the part that faces the master, and the gap there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import shape
from lacmesh.surface.normals import weighted
from lacmesh.surface.points import ContactPoints
from lacmesh.surface.record import Surface

#: of the rule that measures a face: exact on plane ones, and to 1e-9 where a quadratic one turns by half a radian
_DEGREE = {1: 6, 2: 12}


@dataclass(frozen=True)
class Coverage:
    """One row per macro-element (n_macros,). Areas are lengths in plane problems and include 2 pi r in axisymmetry.

    `area` A; `covered` w, the measure of the part that faces the master; `ratio` kappa = w / A in [0, 1] (0 where A is
    0); `gap_integral` G, the gap integrated over that part; `mean_gap` G / w, `min_gap`, `max_gap` over the quadrature
    points: NaN where nothing is covered.
    """

    area: Floats
    covered: Floats
    ratio: Floats
    gap_integral: Floats
    mean_gap: Floats
    min_gap: Floats
    max_gap: Floats


def coverage(points: ContactPoints, slave: Surface, macro: Ints | None = None) -> Coverage:
    """Compute area, covered part and gap of each macro-element of a slave surface.

    `macro` (faces of slave,): the macro-element of each slave face, as it was given to `contact_points`; if None, each
    face is a macro-element. Faces with a negative entry belong to none.

    >>> from lacmesh import Mesh, contact_points
    >>> mesh = Mesh.create([[0, 0], [1, 0], [0.5, 0.1], [0, 0.1]], [("SEG2", [[1, 0], [3, 2]])])
    >>> slave = Surface.of(mesh, [0])
    >>> covered = coverage(contact_points(slave, Surface.of(mesh, [1])), slave)
    >>> covered.ratio.round(12).tolist(), covered.mean_gap.round(12).tolist()
    ([0.5], [0.1])
    """
    macro = np.arange(len(slave)) if macro is None else np.asarray(macro)
    if macro.shape != (len(slave),):
        raise ValueError(f"macro must be ({len(slave)},), not {macro.shape}")
    n = int(macro.max(initial=-1)) + 1
    ours = macro >= 0
    area = _sums(macro[ours], face_measure(slave, points.axisymmetric)[ours], n)
    covered = _sums(points.macro, points.weight, n)
    integral = _sums(points.macro, points.weight * points.gap, n)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        ratio = np.where(area > 0, np.minimum(covered / area, 1.0), 0.0)
        mean = np.where(covered > 0, integral / covered, np.nan)
    least, most = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(least, points.macro, points.gap)
    np.maximum.at(most, points.macro, points.gap)
    least[np.isinf(least)], most[np.isinf(most)] = np.nan, np.nan
    return Coverage(area, covered, ratio, integral, mean, least, most)


def _sums(rows: Ints, values: Floats, n: int) -> Floats:
    return np.bincount(rows, values, minlength=n).astype(float)


def face_measure(surface: Surface, axisymmetric: bool = False) -> Floats:
    """(f,): true area or length of each face; times 2 pi r where `axisymmetric`."""
    out = np.zeros(len(surface))
    for name, rows, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, _DEGREE[CELLS[name].order])
        x = surface.x[nodes]
        with np.errstate(over="ignore", invalid="ignore"):  # wild coordinates: infinite, and covered by nothing
            size = np.linalg.norm(weighted(name, x, X), axis=2)
        if axisymmetric:
            size = size * 2 * np.pi * (x[..., 0] @ shape(name, X).T)
        out[rows] = size @ w
    return out
