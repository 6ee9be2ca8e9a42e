"""Shapes of few faces: skins whose nodes lie on one shape across edges that turn by more than the crease angle.

With five to eight faces to a circle neighbouring faces turn by 45 to 72 degrees, as the faces of a nut do. Such edges
are smooth where nothing speaks against it and four things speak for it: the nodes of all faces that join across them
lie on one circle, cylinder, sphere or cone, as exactly as elsewhere; no edge turns as those of a square do; five
nodes at least follow one another round the axis, so that three edges or more turn; and the faces on both sides of most
of these edges are about as wide. So a square stays one (90 degrees), and one with its corners cut off (two widths),
and a bent sheet (two edges). A hexagonal nut with one face to a side has all of this: it is taken as round, and said.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.smooth.find import FoundShape, shapes_at
from lacmesh.smooth.patches import Bools, Joints, SmoothPatches, joints_of
from lacmesh.surface.normals import unit
from lacmesh.surface.record import Surface

#: edges that turn by more (degrees) are sharp: between five faces to a circle (72) and four (90)
WIDEST = 80.0
#: shapes that are taken across such edges; in the plane a sphere is a circle
_KINDS = ("cylinder", "sphere", "cone")
#: two faces are about as wide if one has this part of the other's width; so many of the edges need to have two such
_EVEN, _MOST = 0.5, 0.5
#: least number of places round an axis, and how far apart (radians) two of them are
_PLACES, _APART = 5, 1e-6


def shapes_of_few(faces: Surface, x: Floats, crease_angle: float) -> tuple[FoundShape, ...]:
    """Find the shapes of linear faces that go on across edges that turn by more than `crease_angle` (degrees).

    `x` (n_nodes of the mesh, 3): coordinates of the nodes.
    """
    every = SmoothPatches.of(faces, WIDEST, x)
    sharp = every.patch[every.joints.i[_turning(every, every.joints) > crease_angle]]
    rows = np.flatnonzero(np.isin(every.patch, sharp))
    if not len(rows):
        return ()
    patches = SmoothPatches.of(faces.take(rows), WIDEST, x)
    crease = _turning(patches, patches.joints) > crease_angle
    seeds = np.zeros(len(patches.x), bool)
    corner = patches.node[np.concatenate([patches.joints.i[crease], patches.joints.j[crease]])]
    seeds[corner[corner >= 0]] = True
    shapes = [one for one in shapes_at(patches, seeds, WIDEST) if one.shape.kind in _KINDS]
    within = _within(joints_of(faces.take(rows), patches.normal, 180.0), numbers_of(shapes, len(rows)), len(shapes))
    turns = [_turning(patches, joints) for joints in within]
    return tuple(
        FoundShape(one.shape, rows[one.faces], one.nodes, one.distance, float(turn.max()))
        for one, joints, turn in zip(shapes, within, turns, strict=True)
        if (turn > crease_angle).any()
        and turn.max() <= WIDEST
        and _even(patches, joints, turn > crease_angle)
        and (one.shape.kind == "sphere" or _places(patches, one) >= _PLACES)
    )


def numbers_of(shapes: Sequence[FoundShape], n_faces: int) -> Ints:
    """(n_faces,): the number of the shape that each face is on, or -1."""
    out = np.full(n_faces, -1)
    for number, one in enumerate(shapes):
        out[one.faces] = number
    return out


def _turning(patches: SmoothPatches, joints: Joints) -> Floats:
    """(k,): angles (degrees) between the normals of joined faces."""
    cosine = (patches.normal[joints.i] * patches.normal[joints.j]).sum(axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _within(joints: Joints, number: Ints, count: int) -> list[Joints]:
    """For each shape, the joints between two of its faces; `number` (f,): the shape of each face, or -1."""
    own = np.flatnonzero((number[joints.i] == number[joints.j]) & (number[joints.i] >= 0))
    own = own[np.argsort(number[joints.i[own]], kind="stable")]
    ends = np.searchsorted(number[joints.i[own]], np.arange(1, count))
    return [Joints(*(column[rows] for column in joints)) for rows in np.split(own, ends)][:count]


def _even(patches: SmoothPatches, joints: Joints, crease: Bools) -> bool:
    """True if at most of the joints that are a `crease` (k,) two faces about as wide meet."""
    i, j, a, b = (column[crease] for column in joints)
    p, q = _width(patches, i, a), _width(patches, j, b)
    return bool((np.minimum(p, q) >= _EVEN * np.maximum(p, q)).mean() >= _MOST)


def _width(patches: SmoothPatches, face: Ints, edge: Ints) -> NDArray[np.floating]:
    """(k,): the largest distance of a face's corners from one of its edges, or from one end of a segment."""
    node = patches.node[face]
    n = (node >= 0).sum(axis=1)
    x = np.where((node >= 0)[..., None], patches.x[node], patches.x[node[:, :1]])
    rows = np.arange(len(face))
    start = x[rows, edge]
    way = unit(np.where((n > 2)[:, None], x[rows, (edge + 1) % n] - start, 0.0))
    d = x - start[:, None]
    across = d - np.einsum("kns,ks->kn", d, way)[..., None] * way[:, None]
    return np.asarray(np.linalg.norm(across, axis=2).max(axis=1))


def _places(patches: SmoothPatches, one: FoundShape) -> int:
    """Number of different angles about a shape's axis at which it has nodes."""
    axis = one.shape.axis
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    node = patches.node[one.faces]
    d = patches.x[np.unique(node[node >= 0])] - one.shape.centre
    p, q = d @ first, d @ np.cross(axis, first)
    away = np.hypot(p, q)
    angle = np.sort(np.arctan2(q, p)[away > _APART * away.max()])
    step = np.diff(angle, append=angle[:1] + 2 * np.pi)
    return int((step > _APART).sum())
