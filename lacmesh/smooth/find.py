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
from lacmesh.smooth.local import ENOUGH, LocalFits, Rings, local_fits, rings_of
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
class PatchFit:
    """Fit of a surface: its `patches`, each of one shape or of free form; `shapes`; `free` (f,): faces of none.

    `whole`: the patches before shapes were grown inside them. `fits`: local fits at its nodes on free faces; they also
    use the nodes beyond the border of a shape, because a few faces left between shapes would not determine a fit.
    `rough`: fits of second order there, whose heights differ from those of `fits` where curvature jumps.
    """

    patches: SmoothPatches
    whole: SmoothPatches
    shapes: tuple[FoundShape, ...]
    fits: LocalFits
    rough: LocalFits
    free: Bools

    @property
    def fitted(self) -> Bools:
        """(f,): free faces with a fit at each corner."""
        node = self.whole.node
        return np.asarray(self.free & (self.fits.known[node] | (node < 0)).all(axis=1))


def find_shapes(patches: SmoothPatches, crease_angle: float, given: tuple[FoundShape, ...] = ()) -> PatchFit:
    """Find the exact shapes in the patches besides those `given`, and fit the faces that are left locally."""
    search = _Search(patches, crease_angle)
    search.add(list(given))
    search.add(search.planes())
    search.add(search.whole_patches())
    whole, beyond = search.patches, search.free
    fits, rings = _fits(whole, beyond, beyond, 2)
    grown = list(search.grown(fits, rings))
    if grown:
        search.add(grown)
        search.add([one for one in search.planes() if one.nodes > _ALWAYS_FLAT[patches.dim]])
        search.add(search.whole_patches())
    close = _fits(whole, search.free, beyond, 4)[0]
    return PatchFit(search.patches, whole, tuple(search.shapes), close, fits, search.free)


def shapes_at(patches: SmoothPatches, seeds: Bools, crease_angle: float) -> list[FoundShape]:
    """Find the shapes of whole patches, and those grown from the nodes `seeds` (n,), of which each is tried."""
    search = _Search(patches, crease_angle)
    shapes = search.whole_patches()
    left = numbers_of(shapes, len(patches.patch)) < 0
    fits, rings = _fits(patches, left, left, 2)
    rank = _unsteady(patches, fits, rings[0])
    nodes = np.flatnonzero(seeds & np.isfinite(rank))
    nodes = nodes[np.argsort(rank[nodes], kind="stable")]
    return shapes + list(search.from_seeds(left, nodes, fits, rings, each=True))


def _fits(patches: SmoothPatches, wanted: Bools, beside: Bools, degree: int) -> tuple[LocalFits, tuple[Rings, Rings]]:
    """Fit at the nodes of the faces `wanted` (f,), from neighbours on the faces `beside` (f,); return fits and rings.

    The rings are those of the nearest neighbours, and those used for the fits.
    """
    nodes = mask_of(len(patches.x), patches.node[wanted][patches.node[wanted] >= 0])
    rings = rings_of(patches.node[beside], len(patches.x), nodes, ENOUGH[patches.dim][degree])
    return local_fits(patches.x, patches.node_normal, rings[1], patches.dim, degree), rings


def _unsteady(patches: SmoothPatches, fits: LocalFits, one: Rings) -> Floats:
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


class _Search:
    """A search in `patches`, which are split to have one of the `shapes` or none; `free` (f,): faces of none.

    `remaining`: seeds and patches without a shape after which all is of free form.
    """

    def __init__(self, patches: SmoothPatches, crease_angle: float) -> None:
        self.patches, self.crease_angle, self.remaining = patches, crease_angle, _ALL_FAILING
        self.shapes: list[FoundShape] = []
        self.free: Bools = np.ones(len(patches.patch), bool)

    def add(self, more: list[FoundShape]) -> None:
        """Add shapes."""
        self.shapes += more
        number = numbers_of(self.shapes, len(self.free))
        self.patches, self.free = self.patches.split(number), number < 0

    @property
    def _count(self) -> int:
        return int(self.patches.patch.max(initial=-1)) + 1

    def planes(self) -> list[FoundShape]:
        """Find the flat patches of free faces, all at once, because a faceted skin has as many patches as faces."""
        n = self._count
        count = np.maximum(np.bincount(self.patches.owner, minlength=n), 1)[:, None]
        centre = np.zeros((n, 3))
        normal: Floats = np.zeros((n, 3))
        np.add.at(centre, self.patches.owner, self.patches.x)
        np.add.at(normal, self.patches.patch, self.patches.normal * self.patches.area[:, None])
        centre /= count
        normal = unit(normal)
        d = self.patches.x - centre[self.patches.owner]
        off, reach, far = np.zeros(n), np.zeros(n), np.zeros(n)
        np.maximum.at(off, self.patches.owner, np.abs((d * normal[self.patches.owner]).sum(axis=1)))
        np.maximum.at(reach, self.patches.owner, np.linalg.norm(d, axis=1))
        np.maximum.at(far, self.patches.owner, np.abs(self.patches.x).max(axis=1))
        flat = (off <= 2 * EXACT * reach + ROUNDED * far) & normal.any(axis=1)
        np.logical_and.at(flat, self.patches.patch, self.free)
        none, distance = np.zeros(0), np.maximum(off, _EPS * reach)
        return [
            FoundShape(Shape("plane", centre[k], normal[k], none), faces, int(count[k, 0]), float(distance[k]))
            for k, faces in self._by_patch(np.flatnonzero(flat))
        ]

    def whole_patches(self) -> list[FoundShape]:
        """Find the patches of free faces that are one shape as a whole, the largest patches first."""
        shapes = []
        enough = np.bincount(self.patches.owner, minlength=self._count) >= least_nodes("sphere", self.patches.dim)
        which = np.unique(self.patches.patch[self.free])
        for _, faces in self._by_patch(which[enough[which]]):
            if self.remaining <= 0:
                break
            nodes = self._nodes(faces)
            shape = simplest(self.patches.x[nodes], self.patches.node_normal[nodes], self.patches.dim)
            one = None if shape is None else self._kept(faces, shape)
            if one is not None:
                shapes.append(one)
            else:
                self.remaining -= 1
        return shapes

    def _by_patch(self, which: Ints) -> Iterator[tuple[int, Ints]]:
        """Iterate over some patches and their faces, the largest first."""
        order = np.argsort(self.patches.patch, kind="stable")
        start = np.searchsorted(self.patches.patch[order], np.arange(self._count + 1))
        size = np.diff(start)
        for k in which[np.argsort(-size[which], kind="stable")].tolist():
            yield k, order[start[k] : start[k + 1]]

    def _nodes(self, faces: Ints) -> Ints:
        node = self.patches.node[faces]
        return np.unique(node[node >= 0])

    def _kept(self, faces: Ints, shape: Shape) -> FoundShape | None:
        """Return the shape with its faces if these are tangential to it, not transverse; else None."""
        nodes = self._nodes(faces)
        if not self._along(faces, shape).all():
            return None
        distance = float(np.abs(shape.distance(self.patches.x[nodes])[0]).max())
        rounding = _EPS * float(np.ptp(self.patches.x[nodes], axis=0).max())
        return FoundShape(shape, faces, len(nodes), max(distance, rounding))

    def _along(self, faces: Ints, shape: Shape) -> Bools:
        """(f,): True for faces whose normal is that of the shape at their centre, within the crease angle."""
        node = self.patches.node[faces]
        there = node >= 0
        middle = np.where(there[..., None], self.patches.x[node], 0.0).sum(axis=1) / there.sum(axis=1)[:, None]
        normal = shape.distance(middle)[1]
        cosine = np.abs((normal * self.patches.normal[faces]).sum(axis=1))
        return np.asarray(cosine > np.cos(np.radians(min(self.crease_angle, 90.0))))

    def grown(self, fits: LocalFits, rings: tuple[Rings, Rings]) -> Iterator[FoundShape]:
        """Find shapes inside the patches of free faces, each grown from a seed; the largest patches first."""
        rank = _unsteady(self.patches, fits, rings[0])
        order = np.lexsort((rank, self.patches.owner))
        start = np.searchsorted(self.patches.owner[order], np.arange(self._count + 1))
        for k, faces in self._by_patch(np.unique(self.patches.patch[self.free])):
            seeds = order[start[k] : start[k + 1]]
            seeds = seeds[np.isfinite(rank[seeds])]
            if self.remaining <= 0:
                return
            if len(seeds) >= _LEAST[self.patches.dim]:
                yield from self.from_seeds(mask_of(len(self.patches.patch), faces), seeds, fits, rings)

    def from_seeds(
        self, left: Bools, seeds: Ints, fits: LocalFits, rings: tuple[Rings, Rings], *, each: bool = False
    ) -> Iterator[FoundShape]:
        """Find shapes on the faces `left` (f,), each grown from one of the nodes `seeds`, the most promising first.

        `each`: every seed is tried; else none beside one without a shape, and the search ends after a few of these.
        """
        untried = mask_of(len(self.patches.x), seeds)
        failing = 0
        for seed in seeds.tolist():
            if self.remaining <= 0 or (failing >= _FAILING and not each):
                return
            if not untried[seed]:
                continue
            one = self._from_seed(left, seed, fits, rings)
            if one is None:
                failing += 1
                self.remaining -= 1
                untried[rings[0].of(seed)] &= each
                continue
            left[one.faces] = False
            untried[self._nodes(one.faces)] = False
            yield one

    def _from_seed(self, left: Bools, seed: int, fits: LocalFits, rings: tuple[Rings, Rings]) -> FoundShape | None:
        """Fit a shape to the two rings of a seed, or else to one, and grow it over the faces `left` (f,), or None."""
        for ring in (rings[1], rings[0]):
            nodes = np.append(ring.of(seed), seed)
            if len(nodes) >= _LEAST[self.patches.dim]:
                shape = simplest(self.patches.x[nodes], fits.normal[nodes], self.patches.dim, _SLACK)
                if shape is not None:
                    return self._grow(left, seed, shape)
        return None

    def _grow(self, left: Bools, seed: int, shape: Shape) -> FoundShape | None:
        """Grow a shape from a seed over all connected faces on it, and fit it to all of them; None if too few."""
        mine = np.flatnonzero(left & (self.patches.patch == self.patches.owner[seed]))
        tolerance, before = tolerance_of(self.patches.x[self._nodes(mine)]), 0
        for _ in range(_GROWING):
            faces = self._on(mine, seed, shape, tolerance)
            better = nearest(shape, self.patches.x[self._nodes(faces)]) if len(faces) else None
            if better is None:
                return None
            shape = better
            if len(faces) == before:
                break
            before = len(faces)
        faces = self._on(mine, seed, shape, tolerance_of(self.patches.x[self._nodes(faces)]))
        if len(self._nodes(faces)) < max(least_nodes(shape.kind, self.patches.dim), _LEAST[self.patches.dim]):
            return None
        return self._kept(faces, shape)

    def _on(self, faces: Ints, seed: int, shape: Shape, tolerance: float) -> Ints:
        """Return the faces that lie on a shape and are connected to the node `seed` by such faces."""
        node = self.patches.node[faces]
        f = shape.distance(self.patches.x[node.ravel()])[0].reshape(node.shape)
        on: Bools = np.all((np.abs(f) <= tolerance) | (node < 0), axis=1)
        on[on] = self._along(faces[on], shape)
        kept = mask_of(len(self.patches.patch), faces[on])
        i, j = self.patches.joints.i, self.patches.joints.j
        both = kept[i] & kept[j]
        rows = np.flatnonzero(kept)
        place = places_of(rows, len(kept))
        label = label_components(place[i[both]], place[j[both]], len(rows)) if len(rows) else rows
        at_seed = np.unique(label[(self.patches.node[rows] == seed).any(axis=1)])
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
