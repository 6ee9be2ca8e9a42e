"""Search for exact shapes: first for one of a whole patch, then for shapes grown from seeds inside it.

The nodes of a mesh from CAD lie on their plane, cylinder, sphere, cone or torus up to rounding. A patch with all nodes
on one of these within 1e-8 of its size has that shape; the simplest one that fits is chosen. If a patch consists of
several shapes with smooth transitions, a shape is fitted to the two rings of a node and grown over all faces on it.

Shapes of few faces are skins whose nodes lie on one shape across edges that turn by more than the crease angle. With
five to eight faces to a circle neighbouring faces turn by 45 to 72 degrees, as the faces of a nut do. Such edges are
smooth where nothing speaks against it and four things speak for it: the nodes of all faces that join across them lie
on one circle, cylinder, sphere or cone, as exactly as elsewhere; no edge turns as those of a square do; five nodes at
least follow one another round the axis, so that three edges or more turn; and the faces on both sides of most of these
edges are about as wide. So a square stays one (90 degrees), and one with its corners cut off (two widths), and a bent
sheet (two edges). A hexagonal nut with one face to a side has all of this: it is taken as round, and reported.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints, mask_of, places_of
from lacmesh.smooth.local import ENOUGH, Fits, Rings, local_fits, rings_of
from lacmesh.smooth.parents import Bools, Joints, SmoothPatches, joints_of
from lacmesh.smooth.shape import EXACT, ROUNDED, Shape, least_nodes, nearest, simplest, tolerance_of
from lacmesh.surface.normals import unit
from lacmesh.surface.record import Surface
from lacmesh.topology.bodies import label_components

_EPS = float(np.finfo(float).eps)
#: a seed's nodes may be so many times as far off as those of all that is grown from it
_SLACK = 10.0
#: nodes of the least shape that is grown, in the plane and in space
_LEAST = {1: 5, 2: 6}
#: so many nodes that are left between shapes lie on a plane or a line anyway, or on a regular mesh
_ALWAYS_FLAT = {1: 2, 2: 4}
#: rounds of growing at most
_GROWING = 8
#: seeds without a shape after which a patch, and all patches together, are of free form
_FAILING, _ALL_FAILING = 12, 120


@dataclass(frozen=True, eq=False)
class FoundShape:
    """A shape that was found, the `faces` (rows) on it, its number of `nodes`, and their largest `distance` from it.

    `turn`: largest angle (degrees) between its faces, where it is one across creases (`lacmesh.smooth.find`).
    """

    shape: Shape
    faces: Ints
    nodes: int
    distance: float
    turn: float | None = None


@dataclass(frozen=True, eq=False)
class Sought:
    """Result of the search: `patches`, each of one shape or of free form; `found` shapes; `free` (f,): faces of none.

    `whole`: the patches before shapes were grown inside them. `fits`: local fits at its nodes on free faces; they also
    use the nodes beyond the border of a shape, because a few faces left between shapes would not determine a fit.
    `rough`: fits of second order there, whose heights differ from those of `fits` where curvature jumps.
    """

    patches: SmoothPatches
    whole: SmoothPatches
    found: tuple[FoundShape, ...]
    fits: Fits
    rough: Fits
    free: Bools


def find_shapes(patches: SmoothPatches, crease_angle: float, given: tuple[FoundShape, ...] = ()) -> Sought:
    """Find the exact shapes in the patches besides those `given`, and fit the faces that are left locally."""
    budget = [_ALL_FAILING]
    patches, shapes, free = _with(patches, [], list(given))
    patches, shapes, free = _with(patches, shapes, _planes(patches, free))
    patches, shapes, free = _with(patches, shapes, _whole_patches(patches, free, crease_angle, budget))
    whole, beyond = patches, free
    fits, rings = _fits(patches, free, free, 2)
    grown = list(_grown(patches, free, fits, rings, crease_angle, budget))
    if grown:
        patches, shapes, free = _with(patches, shapes, grown)
        more = [one for one in _planes(patches, free) if one.nodes > _ALWAYS_FLAT[patches.dim]]
        patches, shapes, free = _with(patches, shapes, more)
        patches, shapes, free = _with(patches, shapes, _whole_patches(patches, free, crease_angle, budget))
    return Sought(patches, whole, tuple(shapes), _fits(whole, free, beyond, 4)[0], fits, free)


def shapes_at(patches: SmoothPatches, seeds: Bools, crease_angle: float) -> list[FoundShape]:
    """Find the shapes of whole patches, and those grown from the nodes `seeds` (n,), of which each is tried."""
    left, budget = np.ones(len(patches.patch), bool), [_ALL_FAILING]
    shapes = _whole_patches(patches, left, crease_angle, budget)
    for one in shapes:
        left[one.faces] = False
    fits, rings = _fits(patches, left, left, 2)
    rank = _unsteady(patches, fits, rings[0])
    open_ = seeds & np.isfinite(rank)
    for seed in np.flatnonzero(open_)[np.argsort(rank[open_], kind="stable")].tolist():
        if not open_[seed] or budget[0] <= 0:
            continue
        one_more = _from_seed(patches, left, seed, fits, rings, crease_angle)
        if one_more is None:
            budget[0] -= 1
            continue
        shapes.append(one_more)
        left[one_more.faces] = False
        open_[_nodes(patches, one_more.faces)] = False
    return shapes


def _count(patches: SmoothPatches) -> int:
    return int(patches.patch.max(initial=-1)) + 1


def _with(
    patches: SmoothPatches, shapes: list[FoundShape], more: list[FoundShape]
) -> tuple[SmoothPatches, list[FoundShape], Bools]:
    """Add `more` shapes; return the patches, split to have one shape or none, all shapes, and the free faces (f,)."""
    shapes = shapes + more
    shape_of = np.full(len(patches.patch), -1, np.int64)
    for k, one in enumerate(shapes):
        shape_of[one.faces] = k
    return patches.split(shape_of), shapes, shape_of < 0


def _fits(patches: SmoothPatches, asked: Bools, beside: Bools, degree: int) -> tuple[Fits, tuple[Rings, Rings]]:
    """Fit at the nodes of the faces `asked` (f,), from neighbours on the faces `beside` (f,); return fits and rings.

    The rings are those of the nearest neighbours, and those used for the fits.
    """
    nodes = mask_of(len(patches.x), patches.node[asked][patches.node[asked] >= 0])
    rings = rings_of(patches.node[beside], len(patches.x), nodes, ENOUGH[patches.dim][degree])
    return local_fits(patches.x, patches.node_normal, rings[1], patches.dim, degree), rings


# ---- whole patches


def _planes(patches: SmoothPatches, free: Bools) -> list[FoundShape]:
    """Find the flat patches of free faces (f,), all at once, because a faceted skin has as many patches as faces."""
    n = _count(patches)
    count = np.maximum(np.bincount(patches.owner, minlength=n), 1)[:, None]
    centre = np.zeros((n, 3))
    normal: Floats = np.zeros((n, 3))
    np.add.at(centre, patches.owner, patches.x)
    np.add.at(normal, patches.patch, patches.normal * patches.area[:, None])
    centre /= count
    normal = unit(normal)
    d = patches.x - centre[patches.owner]
    off, reach, far = np.zeros(n), np.zeros(n), np.zeros(n)
    np.maximum.at(off, patches.owner, np.abs((d * normal[patches.owner]).sum(axis=1)))
    np.maximum.at(reach, patches.owner, np.linalg.norm(d, axis=1))
    np.maximum.at(far, patches.owner, np.abs(patches.x).max(axis=1))
    flat = (off <= 2 * EXACT * reach + ROUNDED * far) & normal.any(axis=1)
    np.logical_and.at(flat, patches.patch, free)
    none, distance = np.zeros(0), np.maximum(off, _EPS * reach)
    return [
        FoundShape(Shape("plane", centre[k], normal[k], none), faces, int(count[k, 0]), float(distance[k]))
        for k, faces in _by_patch(patches, np.flatnonzero(flat))
    ]


def _by_patch(patches: SmoothPatches, which: Ints) -> Iterator[tuple[int, Ints]]:
    """Iterate over some patches and their faces, the largest first."""
    order = np.argsort(patches.patch, kind="stable")
    start = np.searchsorted(patches.patch[order], np.arange(_count(patches) + 1))
    size = np.diff(start)
    for k in which[np.argsort(-size[which], kind="stable")].tolist():
        yield k, order[start[k] : start[k + 1]]


def _whole_patches(patches: SmoothPatches, free: Bools, crease_angle: float, budget: list[int]) -> list[FoundShape]:
    """Find the patches of free faces (f,) that are one shape as a whole, the largest patches first."""
    shapes = []
    enough = np.bincount(patches.owner, minlength=_count(patches)) >= least_nodes("sphere", patches.dim)
    which = np.unique(patches.patch[free])
    for _, faces in _by_patch(patches, which[enough[which]]):
        if budget[0] <= 0:
            break
        nodes = _nodes(patches, faces)
        shape = simplest(patches.x[nodes], patches.node_normal[nodes], patches.dim)
        one = None if shape is None else _kept(patches, faces, shape, crease_angle)
        if one is not None:
            shapes.append(one)
        else:
            budget[0] -= 1
    return shapes


def _nodes(patches: SmoothPatches, faces: Ints) -> Ints:
    node = patches.node[faces]
    return np.unique(node[node >= 0])


def _kept(patches: SmoothPatches, faces: Ints, shape: Shape, crease_angle: float) -> FoundShape | None:
    """Return the shape with its faces if these are tangential to it, not transverse; else None."""
    nodes = _nodes(patches, faces)
    if not _along(patches, faces, shape, crease_angle).all():
        return None
    distance = float(np.abs(shape.distance(patches.x[nodes])[0]).max())
    least = _EPS * float(np.ptp(patches.x[nodes], axis=0).max())  # what is less is rounding of the shape itself
    return FoundShape(shape, faces, len(nodes), max(distance, least))


def _along(patches: SmoothPatches, faces: Ints, shape: Shape, crease_angle: float) -> Bools:
    """(f,): True for faces whose normal is that of the shape at their centre, within the crease angle."""
    node = patches.node[faces]
    there = node >= 0
    middle = np.where(there[..., None], patches.x[node], 0.0).sum(axis=1) / there.sum(axis=1)[:, None]
    normal = shape.distance(middle)[1]
    out: Bools = np.abs((normal * patches.normal[faces]).sum(axis=1)) > np.cos(np.radians(min(crease_angle, 90.0)))
    return out


# ---- grown from seeds


def _grown(
    patches: SmoothPatches, free: Bools, fits: Fits, rings: tuple[Rings, Rings], crease_angle: float, budget: list[int]
) -> Iterator[FoundShape]:
    """Find shapes inside the patches of free faces (f,), each grown from a seed; the largest patches first."""
    rank = _unsteady(patches, fits, rings[0])
    order = np.lexsort((rank, patches.owner))
    start = np.searchsorted(patches.owner[order], np.arange(_count(patches) + 1))
    for k, faces in _by_patch(patches, np.unique(patches.patch[free])):
        seeds = order[start[k] : start[k + 1]]
        seeds = seeds[np.isfinite(rank[seeds])]
        if budget[0] <= 0:
            return
        if len(seeds) >= _LEAST[patches.dim]:
            yield from _grown_in(patches, faces, seeds, fits, rings, crease_angle, budget)


def _unsteady(patches: SmoothPatches, fits: Fits, one: Rings) -> Floats:
    """(n,): largest change of the steadier principal curvature to a neighbour, times its distance; inf without a fit.

    Every exact shape has one principal curvature that does not change.
    """
    out = np.full(len(patches.x), np.inf)
    rows = np.flatnonzero(fits.known & (np.diff(one.start) > 0))
    if not len(rows):
        return out
    kappa = np.zeros((len(patches.x), 3))
    kappa[rows] = np.linalg.eigvalsh(fits.H[rows])  # one of the three is 0, along the normal
    count = np.diff(one.start)
    i = np.repeat(np.arange(len(count)), count)
    d = np.linalg.norm(patches.x[one.neighbour] - patches.x[i], axis=1)
    lowest, highest = kappa.min(axis=1), kappa.max(axis=1)
    change = np.zeros((len(i), 2))
    for k, value in enumerate((lowest, highest)):
        change[:, k] = np.abs(value[one.neighbour] - value[i]) * d
    begin = one.start[:-1][rows]
    out[rows] = np.maximum.reduceat(change, begin, axis=0)[: len(rows)].min(axis=1)
    return out


def _grown_in(
    patches: SmoothPatches, faces: Ints, seeds: Ints, fits: Fits, rings: tuple[Rings, Rings], crease_angle: float,
    budget: list[int],
) -> Iterator[FoundShape]:  # fmt: skip
    """Find shapes inside one patch with the given faces; `seeds`: its nodes, the most promising first."""
    left = mask_of(len(patches.patch), faces)
    open_ = mask_of(len(patches.x), seeds)
    failing = 0
    for seed in seeds:
        if failing >= _FAILING or budget[0] <= 0:
            return
        if not open_[seed]:
            continue
        one = _from_seed(patches, left, int(seed), fits, rings, crease_angle)
        if one is None:
            failing += 1
            budget[0] -= 1
            open_[seed] = False
            open_[rings[0].of(seed)] = False
            continue
        left[one.faces] = False
        open_[_nodes(patches, one.faces)] = False
        yield one


def _from_seed(
    patches: SmoothPatches, left: Bools, seed: int, fits: Fits, rings: tuple[Rings, Rings], crease_angle: float
) -> FoundShape | None:
    """Fit a shape to the two rings of a seed, or else to one, and grow it over the faces `left` (f,); None if none."""
    for ring in (rings[1], rings[0]):
        nodes = np.append(ring.of(seed), seed)
        shape = (
            simplest(patches.x[nodes], fits.normal[nodes], patches.dim, _SLACK)
            if len(nodes) >= _LEAST[patches.dim]
            else None
        )
        if shape is not None:
            return _grow(patches, left, seed, shape, crease_angle)
    return None


def _grow(patches: SmoothPatches, left: Bools, seed: int, shape: Shape, crease_angle: float) -> FoundShape | None:
    """Grow a shape from a seed over all connected faces that lie on it, and fit it to all of them; None if too few."""
    mine = np.flatnonzero(left & (patches.patch == patches.owner[seed]))
    tolerance, before = tolerance_of(patches.x[_nodes(patches, mine)]), 0
    for _ in range(_GROWING):
        faces = _on(patches, mine, seed, shape, tolerance, crease_angle)
        better = nearest(shape, patches.x[_nodes(patches, faces)]) if len(faces) else None
        if better is None:
            return None
        shape = better
        if len(faces) == before:
            break
        before = len(faces)
    faces = _on(patches, mine, seed, shape, tolerance_of(patches.x[_nodes(patches, faces)]), crease_angle)
    if len(_nodes(patches, faces)) < max(least_nodes(shape.kind, patches.dim), _LEAST[patches.dim]):
        return None
    return _kept(patches, faces, shape, crease_angle)


def _on(patches: SmoothPatches, faces: Ints, seed: int, shape: Shape, tolerance: float, crease_angle: float) -> Ints:
    """Return the faces that lie on a shape and are connected to the node `seed` by such faces."""
    node = patches.node[faces]
    f = shape.distance(patches.x[node.ravel()])[0].reshape(node.shape)
    on: Bools = np.all((np.abs(f) <= tolerance) | (node < 0), axis=1)
    on[on] = _along(patches, faces[on], shape, crease_angle)
    kept = mask_of(len(patches.patch), faces[on])
    i, j = patches.joints.i, patches.joints.j
    both = kept[i] & kept[j]
    rows = np.flatnonzero(kept)
    place = places_of(rows, len(kept))
    label = label_components(place[i[both]], place[j[both]], len(rows)) if len(rows) else rows
    at_seed = np.unique(label[(patches.node[rows] == seed).any(axis=1)])
    return rows[np.isin(label, at_seed)]


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
