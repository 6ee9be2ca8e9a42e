"""Slave skins in space laid flat, so that all of a skin is seen at once, and nothing hides it.

A skin that faces one way is seen along its mean normal, one that lies on a cylinder is unrolled, and any other is seen
from two sides. The eye is outside of the slave's body, where the master is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.drawing import screen_axes
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.topology.skin import FACE_TYPES, N_NODES

#: least cosines between the normals of faces and their mean: of a skin seen undistorted, of one seen as a whole
_EVEN, _SEEN = 0.9, 0.35
#: a skin whose mean normal is less than this faces every way
_ONE_WAY = 0.3
#: how far a skin may be from a cylinder: the part of its normals along the axis; how far its nodes lie outside, and
#: inside, as those of the cut do in the middles of flat faces, which do not count for its radius
_ALONG, _OUTSIDE, _INSIDE = 0.02, 0.03, 0.2
#: nodes around a face, at most
_AROUND = 8
#: cosine of the angle up to which a skin is seen along a coordinate axis
_ALIGNED = 0.9986
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class SkinView:
    """A part of a skin laid flat: the rows (k,) of its faces, and their outlines on paper (k, 8, 2), in lengths.

    `basis` (k, 2, 3): directions in space of both axes, at each face. `words`: how it is seen; `axes`: names of both
    axes. `flipped`: axes whose values fall from left to right, or upwards.
    """

    rows: Ints
    paper: Floats
    basis: Floats
    words: str
    axes: tuple[str, str]
    flipped: tuple[bool, bool] = (False, False)


def views_of(surface: Surface, x: Floats, macro: Ints) -> list[SkinView]:
    """Return the views that show all of a skin of faces in space, at coordinates x (n_nodes, 3).

    `macro` (f,): the macro-element of each face, -1 for none.
    """
    if not len(surface):
        return []
    X = x[rings_of(surface)]
    area = _areas(X)
    size = np.linalg.norm(area, axis=1)
    n = area / np.maximum(size, _TINY)[:, None]
    mean = area.sum(axis=0)
    one_way = np.linalg.norm(mean) > _ONE_WAY * size.sum()
    towards = n @ (mean / (np.linalg.norm(mean) or 1.0))
    every = np.arange(len(X))
    if one_way and towards.min() > _EVEN:
        return [_flat(every, X, mean)]
    unrolled = _unrolled(every, X, n, size, macro)
    if unrolled is not None:
        return [unrolled]
    if one_way and towards.min() > _SEEN:
        return [_flat(every, X, mean)]
    eye = mean if one_way else np.linalg.eigh((area * size[:, None]).T @ n)[1][:, -1]
    near = n @ eye >= 0
    sides = ((np.flatnonzero(near), eye), (np.flatnonzero(~near), -eye))
    return [_flat(rows, X[rows], towards) for rows, towards in sides if len(rows)]


def rings_of(surface: Surface) -> Ints:
    """Return the nodes around each face (f, 8), in order; the last one is repeated."""
    out = np.empty((len(surface), _AROUND), np.int64)
    for code in np.unique(surface.faces.type):
        rows = np.flatnonzero(surface.faces.type == code)
        places = ring(FACE_TYPES[code])
        places = np.append(places, np.full(_AROUND - len(places), places[-1]))
        out[rows] = surface.faces.nodes[rows, : N_NODES[code]][:, places]
    return out


def ring(kind: str) -> Ints:
    """Return the places of the nodes around a face of a type, in order.

    >>> ring("TRIA6").tolist()
    [0, 3, 1, 4, 2, 5]
    """
    facets = [np.asarray(facet.nodes) for facet in CELLS[kind].facets]
    return np.concatenate([[nodes[0], *nodes[2:]] for nodes in facets])


def outlines(view: SkinView, ring: Ints, macro: Ints) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the edges on paper (e, 2, 2) between macro-elements or at the end of the skin, and those of its end alone.

    `ring` (f, 8), `macro` (f,): the nodes around each face of the skin, and its macro-element.
    """
    own, of = ring[view.rows], np.repeat(macro[view.rows], _AROUND)
    ends = np.stack([own, np.roll(own, -1, axis=1)], axis=-1).reshape(-1, 2)
    drawn = np.stack([view.paper, np.roll(view.paper, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    real = ends[:, 0] != ends[:, 1]
    ends, of, drawn = np.sort(ends[real], axis=1), of[real], drawn[real]
    label = np.unique(ends, axis=0, return_inverse=True)[1].ravel()
    low, high = np.full(len(of), np.iinfo(np.int64).max), np.full(len(of), -2)
    np.minimum.at(low, label, of)
    np.maximum.at(high, label, of)
    times = np.bincount(label, minlength=len(of))
    return drawn[(low != high)[label] | (times[label] != 2)], drawn[times[label] != 2]


def _areas(X: Floats) -> NDArray[np.floating]:
    """Return the area vectors (f, 3) of polygons (f, k, 3)."""
    r = X - X.mean(axis=1, keepdims=True)
    return np.cross(r, np.roll(r, -1, axis=1)).sum(axis=1) / 2


def _flat(rows: Ints, X: Floats, eye: Floats) -> SkinView:
    """Return the view of faces (k, 8, 3) from the direction of the eye; along a coordinate axis it has its values."""
    eye = eye / np.linalg.norm(eye)
    nearest = np.zeros(3)
    nearest[np.abs(eye).argmax()] = np.sign(eye[np.abs(eye).argmax()])
    eye = nearest if eye @ nearest > _ALIGNED else eye
    axes = screen_axes(eye)[:, :2].T
    names, flipped, scale = zip(*(_axis(axis) for axis in axes), strict=True)
    start = np.where([len(name) == 1 for name in names], 0.0, (X @ axes.T).reshape(-1, 2).min(axis=0))
    paper = (X @ axes.T - start) * np.array(scale)
    basis = np.broadcast_to(axes * np.array(scale)[:, None], (len(rows), 2, 3))
    return SkinView(rows, paper, basis, f"seen along {_direction(-eye)}", names, flipped)


def _axis(axis: Floats) -> tuple[str, bool, float]:
    """Return the name of a direction on paper, whether its values fall, and the sign by which they are drawn."""
    k = int(np.abs(axis).argmax())
    if abs(axis[k]) > _ALIGNED:
        return "xyz"[k], bool(axis[k] < 0), float(np.sign(axis[k]))
    return f"length along {_direction(axis)}", False, 1.0


def _direction(axis: Floats) -> str:
    """Return a direction in words: +x, or its components."""
    k = int(np.abs(axis).argmax())
    if abs(axis[k]) > 1 - 1e-9:
        return ("\N{MINUS SIGN}" if axis[k] < 0 else "+") + "xyz"[k]
    return f"({', '.join(f'{round(part, 2) + 0.0:.2f}' for part in axis.tolist())})".replace("-", "\N{MINUS SIGN}")


def _unrolled(rows: Ints, X: Floats, n: Floats, size: Floats, macro: Ints) -> SkinView | None:
    """Return the faces of a cylinder unrolled, (radius times angle, length along the axis); None for another shape.

    It is cut open between macro-elements.
    """
    part, directions = np.linalg.eigh((n * size[:, None]).T @ n / size.sum())
    if part[0] > _ALONG or part[1] < _ALONG:
        return None
    axis = directions[:, 0] * np.sign(directions[np.abs(directions[:, 0]).argmax(), 0])
    right = screen_axes(axis)[:, 0]
    basis = np.stack([right, np.cross(axis, right)])
    flat = X @ basis.T
    points = np.unique(X.reshape(-1, 3), axis=0) @ basis.T
    centre, radius = _circle(points)
    centre, radius = _circle(points[np.linalg.norm(points - centre, axis=1) > (1 - _OUTSIDE) * radius])
    away = np.linalg.norm(points - centre, axis=1) / radius
    if away.max() > 1 + _OUTSIDE or away.min() < 1 - _INSIDE:
        return None
    whole = np.unique(np.where(macro >= 0, macro, -1 - rows), return_inverse=True)[1].ravel()
    middles = np.zeros((whole.max() + 1, 2))
    np.add.at(middles, whole, flat.mean(axis=1) - centre)
    middle = middles[whole]
    angle = np.arctan2(middle[:, 1], middle[:, 0])
    angle = (angle - _seam(angle)) % (2 * np.pi)
    turned = np.stack([middle, np.stack([-middle[:, 1], middle[:, 0]], axis=1)], axis=1)
    turned /= np.maximum(np.linalg.norm(middle, axis=1), _TINY)[:, None, None]
    local = np.einsum("kij,kpj->kpi", turned, flat - centre)
    outward = np.sign(np.einsum("ki,ki->", n @ basis.T, middle)) or 1.0
    s = outward * radius * (angle[:, None] + np.arctan2(local[..., 1], local[..., 0]))
    across = outward * turned[:, 1] @ basis
    directions = np.stack([across, np.broadcast_to(axis, across.shape)], axis=1)
    name = _axis(axis)[0]
    words = f"unrolled, {'outside' if outward > 0 else 'inside'} of radius {radius:.4g}"
    return SkinView(rows, np.stack([s - s.min(), X @ axis], axis=2), directions, words, ("length around", name))


def _seam(angle: Floats) -> float:
    """Return the angle in the middle of the widest gap between some angles, where a cylinder is cut open."""
    ordered = np.sort(angle)
    gaps = np.diff(np.append(ordered, ordered[0] + 2 * np.pi))
    k = int(gaps.argmax())
    return float(ordered[k] + gaps[k] / 2)


def _circle(x: Floats) -> tuple[Floats, float]:
    """Return the centre and the radius of the least-squares circle of points (n, 2)."""
    A = np.concatenate([2 * x, np.ones((len(x), 1))], axis=1)
    c = np.linalg.lstsq(A, (x * x).sum(axis=1), rcond=None)[0]
    return c[:2], float(np.sqrt(max(c[2] + c[:2] @ c[:2], _TINY)))


def macro_places(view: SkinView, macro: Ints) -> Iterator[tuple[int, Floats, Floats]]:
    """Yield for each macro-element in sight its row, its place on paper (2,), and the directions of the axes (2, 3)."""
    own = macro[view.rows]
    side = np.linalg.norm(np.roll(view.paper, -1, axis=1) - view.paper, axis=2)  # 0 beside a node that is repeated
    weight = side + np.roll(side, 1, axis=1)
    centre = np.einsum("kp,kpi->ki", weight / np.maximum(weight.sum(axis=1), _TINY)[:, None], view.paper)
    for row in np.unique(own[own >= 0]).tolist():
        faces = np.flatnonzero(own == row)
        yield row, centre[faces].mean(axis=0), view.basis[faces].mean(axis=0)
