"""The heights of the smooth surface over the flat faces of a surface, and surfaces with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, Mesh, mask_of
from lacmesh.origin import origin_of
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.smooth.find import FoundShape, PatchFit, find_shapes, numbers_of, shapes_of_few
from lacmesh.smooth.local import centre_heights, cubic_heights, edge_heights
from lacmesh.smooth.parents import Bools, Parents, SmoothPatches, are_straight, by_corners, inverse, parents_of
from lacmesh.smooth.shape import Shape
from lacmesh.surface.maps import N_HEIGHTS, QUADRATIC, Height, functions_of_heights
from lacmesh.surface.normals import CREASE_ANGLE, normals_of, unit
from lacmesh.surface.record import Surface, mean_normals
from lacmesh.topology.skin import FACE_TYPES, TYPE_CODE

_LINEAR = np.array([TYPE_CODE[name] for name in QUADRATIC if CELLS[name].order == 1])
#: most heights over a face as the user meshed it: at the middles of its edges; a quadrangle's centre, or cubics
_OVER = 8
#: degrees: faces that turn by the crease angle itself, nine to a circle, are smooth whatever their last bit
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Smooth:
    """Shapes and fits of a surface: its `parents`, the `rows` (k,) of the linear ones, and their shapes, `fit`.

    The coordinates of `fit` are relative to `origin` (3,). `taken` (k,): the number of the shape of few faces
    (`lacmesh.smooth.find`) that a linear parent is on; else -1.
    """

    parents: Parents
    rows: Ints
    origin: Floats
    fit: PatchFit
    taken: Ints

    @property
    def heights(self) -> tuple[Floats, Bools]:
        """(k, 8): heights over the linear parents; (k,): True for parents without a fit at some edge."""
        return self._computed[:2]

    @property
    def doubt(self) -> Floats:
        """(k,): how far the heights of linear parents of free form may be off, over the lengths of their edges.

        That is how much they hang on the order of the fits, or what is left between two shapes that touch inside.
        """
        return self._computed[2]

    @cached_property
    def _computed(self) -> tuple[Floats, Bools, Floats]:
        return _heights(self.fit, self.parents.faces.n_corners[self.rows])


def smooth_of(mesh: Mesh, surface: Surface, crease_angle: float | None) -> Smooth:
    """Find the exact shapes and the local fits of a surface; arguments as in `height_of`."""
    parents = parents_of(mesh, surface)
    there = (mean_normals(parents.faces)[0] != 0).any(axis=1)  # else it has no extent, or places that are no numbers
    there[parents.of[~are_straight(surface)]] = False
    parents = parents._replace(faces=by_corners(parents.faces))
    rows = np.flatnonzero(np.isin(parents.faces.faces.type, _LINEAR) & there)
    faces = parents.faces.take(rows)
    origin = origin_of(faces.x[faces.faces.distinct_nodes])
    x = faces.x - origin
    angle = CREASE_ANGLE + ROUNDING if crease_angle is None else crease_angle
    few = shapes_of_few(faces, x, angle) if crease_angle is None else ()
    taken = numbers_of(few, len(faces))
    return Smooth(parents, rows, origin, find_shapes(SmoothPatches.of(faces, angle, x, taken), angle, few), taken)


def height_of(mesh: Mesh, surface: Surface, crease_angle: float | None = None) -> Height | None:
    """Compute the heights of the smooth surface over the faces of a surface; None if all are exactly 0.

    `mesh`: that of the surface's cells, with the records of its cut if it has one; the coordinates are the surface's.
    `crease_angle` (degrees): an edge with a larger angle between the normals is an edge of the smooth surface as well.
    None: 40, but for faces whose nodes lie on one circle, cylinder, sphere or cone across such edges
    (`lacmesh.smooth.find`).
    The fits use only the faces of the surface: include all faces that continue it smoothly.
    """
    smooth = smooth_of(mesh, surface, crease_angle)
    over = np.zeros((len(smooth.parents.faces), _OVER))
    over[smooth.rows] = smooth.heights[0]
    if not over.any():
        return None
    taken = np.full(len(over), -1)
    taken[smooth.rows] = smooth.taken
    height = Height(surface.faces.type, _of_faces(smooth.parents, surface, over, smooth.rows))
    value, lean = _of_surface(smooth, surface, height)
    doubt = np.zeros(len(over))
    doubt[smooth.rows] = smooth.doubt
    of = smooth.parents.of
    return replace(height, value=value, lean=lean, taken=taken[of] if (taken >= 0).any() else None, doubt=doubt[of])


def _of_surface(smooth: Smooth, surface: Surface, height: Height) -> tuple[Floats, Floats]:
    """(f, 10): heights, and (f, 9, 2): slopes of the smooth surface's normals at the nodes of the quadratic types.

    The normals are those of exact shapes and of fits, where faces have one, else those of `height`. Faces that a cut
    has made have the distances of an exact shape from their own nodes, along its normals: the quadratic over their
    parent misses these by h^4.
    """
    value, lean = height.value.copy(), height.slopes_at_nodes
    of, shapes = smooth.parents.of, smooth.fit.shapes
    cut, source = np.bincount(of)[of] > 1, _sources(smooth)[of]
    for number, code in np.unique(np.stack([source, surface.faces.type], axis=1)[source >= 0], axis=0):
        rows, name = np.flatnonzero((source == number) & (surface.faces.type == code)), FACE_TYPES[code]
        X = np.array(CELLS[QUADRATIC[name]].reference, dtype=float)
        x = surface.x[surface.faces.nodes[rows, : CELLS[name].n_nodes]] - smooth.origin
        J = jacobian(name, x, X)
        if number == len(shapes):
            n = _fitted_normals(smooth, rows, name, X)
        else:
            at = np.einsum("kn,pns->pks", shape(name, X), x)
            f, n = (k.reshape(len(rows), len(X), -1) for k in shapes[number].shape.distance(at.reshape(-1, 3)))
            out = -f[..., 0] * np.sign((n * normals_of(J)).sum(axis=2))
            value[rows[cut[rows]], : len(X)] = out[cut[rows]]
        share = (n * unit(normals_of(J))).sum(axis=2)
        lean[rows, : len(X), : X.shape[1]] = -np.einsum("pks,pksd->pkd", n, J) / share[..., None]
    return value, lean


def _sources(smooth: Smooth) -> Ints:
    """(p,): the number of the curved shape that each parent is on; their number for one with fits; -1 for others."""
    out = np.full(len(smooth.parents.faces), -1)
    out[smooth.rows[smooth.fit.fitted]] = len(smooth.fit.shapes)
    for number, one in enumerate(smooth.fit.shapes):
        if one.shape.kind != "plane":
            out[smooth.rows[one.faces]] = number
    return out


def _fitted_normals(smooth: Smooth, rows: Ints, name: str, X: Floats) -> NDArray[np.floating]:
    """(p, k, 3): normals at points X (k, dim) of faces (p,) of a type, interpolated from fits at parents' corners."""
    parents, whole = smooth.parents, smooth.fit.whole
    mother = parents.of[rows]
    corner = whole.node[np.searchsorted(smooth.rows, mother)]
    out = np.zeros((len(rows), len(X), 3))
    kind = parents.faces.faces.type[mother]
    for code in np.unique(kind):
        some, parent = np.flatnonzero(kind == code), CELLS[FACE_TYPES[code]]
        place = np.einsum(
            "kn,pnd->pkd", shape(CELLS[name].linear, X), parents.corner[rows[some], : CELLS[name].n_corners]
        )
        N = shape(parent.name, place.reshape(-1, 2)[:, : parent.dim]).reshape(len(some), len(X), -1)
        out[some] = np.einsum("pkn,pns->pks", N, smooth.fit.fits.normal[corner[some, : parent.n_corners]])
    return out


def _of_faces(parents: Parents, surface: Surface, over: Floats, linear: Ints) -> Floats:
    """(f, 10): heights over the faces, as in `Height`, from those `over` (p, 8) their parents.

    Children have heights at nodes alone. Those of a warped quadrangle do not lie on it, nor do mid-nodes exactly: their
    distance from it is added, and their points are projected into it by inverting its map. `linear`: rows of the
    parents that have heights.
    """
    value = np.zeros((len(surface), N_HEIGHTS))
    kind, mother = surface.faces.type, parents.faces.faces.type[parents.of]
    normal = mean_normals(surface)[0]
    mine = mask_of(len(over), linear)[parents.of]
    apart = (np.bincount(parents.of)[parents.of] > 1) | ~np.isin(kind, _LINEAR)
    for code in np.unique(kind[mine]):
        name = FACE_TYPES[code]
        nodes = np.array(CELLS[QUADRATIC[name]].reference)
        n = CELLS[name].n_nodes
        whole = np.flatnonzero(mine & (kind == code) & ~apart)
        value[whole, n:] = over[parents.of[whole], : N_HEIGHTS - n]
        for other in np.unique(mother[mine & apart & (kind == code)]):
            rows, parent = np.flatnonzero(mine & apart & (kind == code) & (mother == other)), FACE_TYPES[other]
            N, dim = shape(name, nodes), CELLS[parent].dim
            x = np.einsum("kn,pns->pks", N, surface.x[surface.faces.nodes[rows, :n]]).reshape(-1, 3)
            ring = surface.x[parents.faces.faces.nodes[parents.of[rows], : CELLS[parent].n_corners]]
            ring = np.repeat(ring, len(nodes), axis=0)
            place, _ = inverse(parent, ring, x)
            off = np.einsum("pn,pns->ps", shape(parent, place[:, :dim]), ring) - x
            M = functions_of_heights(parent, place)[:, CELLS[parent].n_corners :]
            own = np.repeat(over[parents.of[rows]], len(nodes), axis=0)[:, : M.shape[1]]
            b = (M * own).sum(axis=1) + (off * np.repeat(normal[rows], len(nodes), axis=0)).sum(axis=1)
            value[rows, : len(nodes)] = b.reshape(len(rows), -1)
    return value


def _heights(fit: PatchFit, corners: Ints) -> tuple[Floats, Bools, Floats]:
    """(f, 8): heights over the faces; (f,): True for free form without a fit at some edge; (f,): as `Smooth.doubt`.

    `corners` (f,): their number.
    """
    four = corners == 4
    patches, sides = fit.whole, NodeShapes.of(fit)
    n = len(patches.patch)
    value, lacking, doubt = np.zeros((n, _OVER)), np.zeros(n, bool), np.zeros(n)
    face, k, i, j = patches.edges()
    free = np.flatnonzero(fit.free[face])
    value[face[free], k[free]], known = edge_heights(fit.fits, patches.x, i[free], j[free])
    centre = np.flatnonzero(four & fit.free)
    value[centre, 4] = centre_heights(fit.fits, patches.x, patches.node[centre])
    differ = np.zeros(len(face))
    differ[free] = np.abs(value[face[free], k[free]] - edge_heights(fit.rough, patches.x, i[free], j[free])[0])
    differ[free[~known]] = 0.0
    wanted = np.flatnonzero((fit.free | sides.loose)[face])
    over, between, left = heights_between(
        fit, sides, i[wanted], j[wanted], patches.edge_normal[face[wanted], k[wanted]]
    )
    split = wanted[between]
    value[face[split], k[split]], differ[split] = over[between], left[between]
    _split_centres(fit, sides, value, np.flatnonzero(four & (fit.free | sides.loose)))
    length = np.linalg.norm(patches.x[j] - patches.x[i], axis=1)
    np.maximum.at(doubt, face, np.divide(differ, length, out=np.zeros_like(length), where=length > 0))
    lacking[face[np.setdiff1d(free[~known], split)]] = True
    _set_cubics(fit, corners, value, face[split])
    middle, way = (patches.x[i] + patches.x[j]) / 2, patches.edge_normal[face, k]
    curved = [one for one in fit.shapes if one.shape.kind != "plane"]
    of_shape = numbers_of(curved, n)
    order = np.argsort(of_shape[face], kind="stable")
    start = np.searchsorted(of_shape[face][order], np.arange(len(curved) + 1))
    for number, one in enumerate(curved):
        e = order[start[number] : start[number + 1]]
        value[face[e], k[e]] = _met(one, middle[e], way[e])
        quads = one.faces[four[one.faces]]
        value[quads, 4] = _met(one, patches.x[patches.node[quads]].mean(axis=1), patches.normal[quads])
    return value, lacking, doubt


def _set_cubics(fit: PatchFit, corners: Ints, value: Floats, split: Ints) -> None:
    """Set the cubics of the heights (f, 8) over segments and triangles with fits, but for faces that are `split`."""
    fitted = fit.fitted
    fitted[split] = False
    for n, first in ((2, 1), (3, 3)):
        rows = np.flatnonzero(fitted & (corners == n))
        cubic = cubic_heights(fit.fits, fit.whole.x, fit.whole.node[rows, :n])
        value[rows[:, None], first + np.arange(cubic.shape[1])] = cubic


def _split_centres(fit: PatchFit, sides: NodeShapes, value: Floats, centre: Ints) -> None:
    """Set the heights (f, 8) at the centres of quadrangles whose diagonals go from one shape to another it touches."""
    node, normal = fit.whole.node[centre], fit.whole.normal[centre]
    (one, good, _), (two, fine, _) = (heights_between(fit, sides, node[:, a], node[:, a + 2], normal) for a in (0, 1))
    both = good & fine
    value[centre[both], 4] = (one + two)[both] / 2


def _met(one: FoundShape, x: Floats, way: Floats) -> Floats:
    """(n,): distance of the shape from points x (n, 3) along directions (n, 3); 0 where they miss it."""
    return np.nan_to_num(one.shape.meets(x, way))


# ---- faces between two shapes that touch inside them: a plane that goes over into a fillet between two rows of nodes


#: how far the sum of the roots may be from that of shapes that touch, against it
_TOUCHING = 0.15


class NodeShapes(NamedTuple):
    """The shapes of nodes: `first` and `second` (n,) of `shapes` that each lies on, or -1; nodes of more have two.

    `loose` (f,): faces of planes without a node of their own, as one row of quadrangles between a plane and a fillet
    is: the nodes do not tell that these are planes, and have only the shapes beside them.
    """

    shapes: tuple[FoundShape, ...]
    first: Ints
    second: Ints
    loose: Bools

    @classmethod
    def of(cls, fit: PatchFit) -> NodeShapes:
        """Return the shapes of the nodes of all patches, before shapes were grown inside them."""
        node, n = fit.whole.node, len(fit.whole.x)
        nodes = [np.unique(node[one.faces][node[one.faces] >= 0]) for one in fit.shapes]
        shared = np.zeros(n, np.int64)
        for mine in nodes:
            shared[mine] += 1
        first, second, loose = np.full(n, -1), np.full(n, -1), np.zeros(len(node), bool)
        for number, (one, mine) in enumerate(zip(fit.shapes, nodes, strict=True)):
            if one.shape.kind == "plane" and shared[mine].min() > 1:
                loose[one.faces] = True
                continue
            second[mine] = np.where(first[mine] >= 0, number, -1)
            first[mine] = np.where(first[mine] >= 0, first[mine], number)
        return cls(fit.shapes, first, second, loose)


def heights_between(
    fit: PatchFit, sides: NodeShapes, i: Ints, j: Ints, normal: Floats
) -> tuple[NDArray[np.floating], Bools, NDArray[np.floating]]:
    """(e,): heights over the middles of chords from nodes i to j (e,) along unit normals (e, 3); (e,): True if known.

    Known are those between two nodes of one shape, and of two shapes that touch in between. (e,): largest distance of
    the skin from the parabola of such a height.
    """
    out, known, left = np.zeros(len(i)), np.zeros(len(i), bool), np.zeros(len(i))
    a, b = sides.first[i], sides.first[j]
    for one, other in ((sides.second[i], b), (a, sides.second[j]), (sides.second[i], sides.second[j])):
        same = (one == other) & (one >= 0)  # a node on two shapes: that which it shares with the other end
        a, b = np.where(same, one, a), np.where(same, other, b)
    x = fit.whole.x
    both = np.flatnonzero((a >= 0) & (b >= 0))
    pair = a[both] * len(sides.shapes) + b[both]
    for code in np.unique(pair):
        e = both[pair == code]
        A, B = (sides.shapes[k].shape for k in divmod(int(code), len(sides.shapes)))
        at, to = x[i[e]], x[j[e]]
        bend_a, f_b = _bend(A, at, to - at, normal[e]), _signed(B, at, normal[e])
        bend_b, f_a = _bend(B, to, to - at, normal[e]), _signed(A, to, normal[e])
        if A is B:
            out[e], known[e] = bend_a / 8, True
            continue
        root_a, root_b = np.sqrt(np.abs(f_a)), np.sqrt(np.abs(f_b))
        whole = np.sqrt(np.abs(bend_b - bend_a) / 2)
        known[e] = (f_a * f_b < 0) & (np.abs(root_a + root_b - whole) <= _TOUCHING * whole)
        t = np.divide(root_a, root_a + root_b, out=np.zeros_like(root_a), where=root_a + root_b > 0)
        out[e] = (bend_a + (bend_b - bend_a) * t * t * (3 - 2 * t)) / 8
        left[e] = np.abs(bend_b - bend_a) * t * (1 - t) / 16
    return out, known, left


def _signed(shape: Shape, x: Floats, normal: Floats) -> NDArray[np.floating]:
    """(n,): signed distances of points x (n, 3) from a shape, outward along normals (n, 3) of the faces."""
    f, gradient = shape.distance(x)
    return f * np.copysign(1.0, (gradient * normal).sum(axis=1))


def _bend(shape: Shape, x: Floats, e: Floats, normal: Floats) -> NDArray[np.floating]:
    """(n,): curvature of a shape at points x (n, 3) along chords e (n, 3), convex > 0, times the chord squared."""
    ahead, here, behind = (_signed(shape, x + part * e, normal) for part in (0.5, 0.0, -0.5))
    return 4 * (ahead - 2 * here + behind)


#: what a surface may be taken for
SURFACES = ("smooth", "faces")


def surface_of(mesh: Mesh, cells: Ints, surface: str = "smooth", crease_angle: float | None = None) -> Surface:
    """Build the surface of some skin cells (indices) of a mesh, with the heights of the smooth skin over its faces.

    `surface`: `smooth`, or `faces` for a surface without heights; `crease_angle` in degrees as in `height_of`. Raises
    RequestError; DataError as in `Surface.of`.
    """
    if surface not in SURFACES:
        raise RequestError(f"surface is one of {', '.join(SURFACES)}, not {surface!r}")
    skin = Surface.of(mesh, cells)
    return skin if surface == "faces" else replace(skin, height=height_of(mesh, skin, crease_angle))
