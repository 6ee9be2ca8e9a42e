"""Patches: the parts of faces, with straight sides, that are clipped in their place.

A face with straight sides is one patch. Curved faces are subdivided for the intersection only, all faces of a surface
alike, so that the patches of neighbours share whole edges; quadrature points lie on the true geometry. A quadrangle
that is not convex in its mean plane is split into two triangles.

Candidate master patches for each slave patch (the broad phase) are found in a tree of boxes (`topology.boxes`). The
search region of a slave patch is a prism: its bounding rectangle in its own plane, swept along its normal from `behind`
to `ahead`.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.surface.maps import coefficients, kinds, monomials
from lacmesh.surface.record import Surface
from lacmesh.topology.boxes import Boxes, Pairs, boxes_in
from lacmesh.topology.orientation import corner_normals
from lacmesh.topology.skin import MAX_CORNERS

Bools = NDArray[np.bool_]

#: curved faces go in 2 parts a side where the most curved (maps.kinds) is less so than the first; then 4, 8
_STEPS = np.array([0.2, 0.8])
#: corners nearer than this, against the patch, are one: the direction of so short an edge would be rounding
_SAME = 1e-8
#: corners of a patch in reverse, by their number; the rows end with the first one, as those of patches do
_REVERSED = np.array([[0, 1, 2, 3], [0, 1, 2, 3], [1, 0, 1, 1], [0, 2, 1, 0], [0, 3, 2, 1]])
#: name under which a surface keeps its patches
_KEPT = "patches"


class Patches(NamedTuple):
    """Patches of a surface, one per row: `face`, `n` corners (2 to 4), `xi` (p, 4, 2): corners in the face.

    `x` (p, 4, 3): corners; frame: `centre` (p, 3), `e` (p, 3, 3): two tangents and the unit normal of the mean plane;
    `y` (p, 4, 3): corners in that frame. `area` (p,) in the mean plane: length of segments. `G` (f, 9, 3), `kind` (f,),
    `warp` (f,): the maps of the whole faces (maps.kinds). Patches without area, or with NaN, are left out.
    """

    face: Ints
    n: Ints
    xi: Floats
    x: Floats
    centre: Floats
    e: Floats
    y: Floats
    area: Floats
    G: Floats
    kind: Ints
    warp: Floats

    def take(self, rows: Ints) -> Patches:
        """Some of the patches."""
        one = {name: getattr(self, name)[rows] for name in Patches._fields[:8]}
        return self._replace(**one)

    def turned_over(self, which: Bools) -> Patches:
        """Return the patches with some of them, a mask (p,), seen from behind: corners in reverse, opposite normals."""
        order = _REVERSED[self.n[which]]
        xi, x, y, e = (part.copy() for part in (self.xi, self.x, self.y, self.e))
        for part in (xi, x, y):
            part[which] = np.take_along_axis(part[which], order[..., None], axis=1)
        e[which] *= np.array([[1.0], [-1.0], [-1.0]])
        y[which] *= np.array([1.0, -1.0, -1.0])
        return self._replace(xi=xi, x=x, y=y, e=e)


def patches(surface: Surface) -> Patches:
    """Divide a surface into patches, sorted by face. They are kept with it, as its pairing and its edges need them."""
    if _KEPT not in surface.__dict__:
        surface.__dict__[_KEPT] = _divided(surface)
    kept: Patches = surface.__dict__[_KEPT]
    return kept


def _divided(surface: Surface) -> Patches:
    with np.errstate(over="ignore", invalid="ignore"):  # wild coordinates: such faces have no patch
        G = coefficients(surface)
        kind, warp, curved = kinds(G, surface.n_corners)
        most = curved[np.isfinite(curved)].max(initial=0.0)
        level = np.where(curved > 0, 1 + np.searchsorted(_STEPS, most), 0)
        face, n, xi = _grids(surface, level)
        out = _with_frames(face, n, xi, G, kind, warp)
        return out if surface.dim == 1 else _split_concave(out)


def _grids(surface: Surface, level: Ints) -> tuple[Ints, Ints, Floats]:
    """Return face rows, numbers of corners and reference coordinates of the patches, sorted by face."""
    faces, ns, xis = [], [], []
    for family, corners in (("SEG", 2), ("TRIA", 3), ("QUAD", 4)):
        for k in range(len(_STEPS) + 2):
            rows = np.flatnonzero((surface.n_corners == corners) & (level == k))
            if not len(rows):
                continue
            cells = reference_grid(family, 2**k)
            faces.append(np.repeat(rows, len(cells)))
            ns.append(np.full(len(rows) * len(cells), corners))
            xis.append(np.tile(cells, (len(rows), 1, 1)))
    face = np.concatenate(faces)
    order = np.argsort(face, kind="stable")
    return face[order], np.concatenate(ns)[order], np.concatenate(xis)[order]


@cache
def reference_grid(family: str, n: int) -> Floats:
    """(cells, 4, 2): the reference element of a family divided into n parts per side; the cells have its winding.

    >>> reference_grid("TRIA", 2).shape, reference_grid("QUAD", 2).shape, reference_grid("SEG", 2)[:, :2, 0].tolist()
    ((4, 4, 2), (4, 4, 2), [[-1.0, 0.0], [0.0, 1.0]])
    """
    corners = np.zeros((3 if family == "TRIA" else 2 ** (1 + (family == "QUAD")), 2))
    reference = np.array(CELLS[f"{family}{len(corners)}"].reference)
    corners[:, : reference.shape[1]] = reference
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    if family == "SEG":
        at = np.array([[[k, 0], [k + 1, 0]] for k in range(n)], float)
    elif family == "QUAD":
        at = np.stack([i, j, i + 1, j, i + 1, j + 1, i, j + 1], axis=1).reshape(-1, 4, 2).astype(float)
    else:
        up = i + j < n
        down = i + j < n - 1
        ups = np.stack([i, j, i + 1, j, i, j + 1], axis=1)[up]
        downs = np.stack([i + 1, j, i + 1, j + 1, i, j + 1], axis=1)[down]
        at = np.concatenate([ups, downs]).reshape(-1, 3, 2).astype(float)
    last = corners[-1] if len(corners) != 2 else corners[0]
    xi = corners[0] + at[..., :1] / n * (corners[1] - corners[0]) + at[..., 1:] / n * (last - corners[0])
    return np.concatenate([xi, np.repeat(xi[:, :1], MAX_CORNERS - xi.shape[1], axis=1)], axis=1)


def _with_frames(face: Ints, n: Ints, xi: Floats, G: Floats, kind: Ints, warp: Floats) -> Patches:
    line = len(n) > 0 and n[0] == 2
    x = _joined(np.matmul(monomials(xi), G[face]) if len(face) else np.zeros((0, 4, 3)))
    normal = corner_normals(x, n)
    area, a, b = (np.linalg.norm(v, axis=1) for v in (normal, x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]))
    area, longest = area if line else area / 2, np.maximum(a, b)
    fine = np.isfinite(area) & (area > 1e-14 * (longest if line else longest**2)) & (area > 0)
    face, n, xi, x, normal, area = (v[fine] for v in (face, n, xi, x, normal, area))
    normal = _unit(normal)
    corners = np.arange(MAX_CORNERS) < n[:, None]
    centre = (x * corners[..., None]).sum(axis=1) / n[:, None]
    # a tangent along the first edge, or the diagonal where that has hardly a length
    a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    longer = np.linalg.norm(b, axis=1) > 4 * np.linalg.norm(a, axis=1)
    along = np.where(longer[:, None], b, a)
    along = _unit(along - (along * normal).sum(axis=1, keepdims=True) * normal)
    e = np.stack([along, np.cross(normal, along), normal], axis=1)
    y = _joined(np.matmul(x - centre[:, None], np.swapaxes(e, 1, 2)))
    return Patches(face, n, xi, x, centre, e, y, area, G, kind, warp)


def _unit(v: Floats) -> Floats:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _joined(x: Floats) -> Floats:
    """Merge nearly coincident corners of each patch x (p, 4, 3), so that the edge between them has length 0."""
    size = np.abs(x[:, 1:] - x[:, :1]).max(axis=(1, 2), initial=0.0)[:, None]
    near = np.abs(x - np.roll(x, 1, axis=1)).max(axis=2) <= _SAME * size
    near[:, 0] = False  # the last corner and the first: below
    for k in range(1, MAX_CORNERS):
        x[near[:, k], k] = x[near[:, k], k - 1]
    last = np.abs(x[:, 3] - x[:, 0]).max(axis=1) <= _SAME * size[:, 0]
    x[last, 3] = x[last, 0]
    return x


def turns(y: Floats) -> Floats:
    """(p, 4): twice the area of the triangle at each corner of plane quadrangles y (p, 4, 2 or more); > 0 if convex."""
    before, after = y - np.roll(y, 1, axis=1), np.roll(y, -1, axis=1) - y
    return before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]


def _split_concave(p: Patches) -> Patches:
    """Split quadrangles that are not convex in their mean plane into two triangles, at the re-entrant corner."""
    corner = turns(p.y)
    concave = (p.n == 4) & (corner.min(axis=1) < -1e-12 * p.area)
    if not concave.any():
        return p
    rows = np.flatnonzero(concave)
    start = corner[rows].argmin(axis=1)
    triangles = []
    for places in ((0, 1, 2), (0, 2, 3)):
        which = (start[:, None] + np.array(places)) % 4
        xi = np.take_along_axis(p.xi[rows], which[..., None], axis=1)
        triangles.append(np.concatenate([xi, xi[:, :1]], axis=1))
    face = np.concatenate([p.face[~concave], p.face[rows], p.face[rows]])
    n = np.concatenate([p.n[~concave], np.full(2 * len(rows), 3)])
    xi = np.concatenate([p.xi[~concave], *triangles])
    order = np.argsort(face, kind="stable")
    return _with_frames(face[order], n[order], xi[order], p.G, p.kind, p.warp)


class Reach(NamedTuple):
    """Search distances of slave patches along their normals: `ahead` (slave patches,), and a distance behind.

    The latter is `behind` (slave patches,) plus the master patch's `deep` (master patches,), but at most `limit`.
    """

    ahead: Floats
    behind: Floats
    deep: Floats
    limit: float


def candidates(slave: Patches, master: Patches, reach: Reach) -> Pairs:
    """Find the master patches whose boxes intersect the prisms of slave patches."""
    low, high = _extent(slave.y, slave.n)
    low[:, 2] -= np.minimum(reach.behind + reach.deep.max(initial=0.0), reach.limit)
    high[:, 2] += reach.ahead
    middle, half = (low + high) / 2, (high - low) / 2
    half += 1e-12 * (half[:, :1] + half[:, 1:2] + half[:, 2:])
    origin = slave.centre + (slave.e * middle[:, :, None]).sum(axis=1)
    return boxes_in(Boxes(origin, half), slave.e, *_extent(master.x, master.n))


def _extent(x: Floats, n: Ints) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates of patches with n corners at x (p, 4, 3)."""
    low, high = np.minimum(x[:, 0], x[:, 1]), np.maximum(x[:, 0], x[:, 1])
    for k in (2, 3):
        corner = np.where((n > k)[:, None], x[:, k], x[:, 0])
        np.minimum(low, corner, out=low)
        np.maximum(high, corner, out=high)
    return low, high
