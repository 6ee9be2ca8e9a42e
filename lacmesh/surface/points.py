"""Contact points: quadrature points on the slave, each with the point where its normal meets the master; coverage.

The coverage of a macro-element is its area, the part of it that faces the master, and the gap there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints
from lacmesh.origin import origin_of
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import shape
from lacmesh.surface.clip import FACING, clip
from lacmesh.surface.lines import Intervals, clip_lines, gauss_points, place_lines
from lacmesh.surface.maps import FLAT, QUADRANGLES, NormalMaps
from lacmesh.surface.normals import normal_maps, weighted
from lacmesh.surface.patches import Bools, Patches, Reach, candidates, patches
from lacmesh.surface.place import FUNCTION_DEGREE, N_FUNCTIONS, Placed, Sides, pair_rule, place
from lacmesh.surface.record import Surface, mean_normals
from lacmesh.topology.boxes import Pairs
from lacmesh.topology.skin import MAX_CORNERS, TYPE_CODE

NORMALS = ("facet", "smoothed", "master")
#: how far nodes of an axisymmetric surface may lie beyond the axis, against the extent of what is there
_BEYOND = 1e-9
#: a master is nearly a plane if the sum of its normals, by area, is longer than this part of its area
_PLANE = 0.9


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contact points (n,), one per row, sorted by (slave type, master type, rule); `groups` gives the ranges.

    `macro`: macro-element; `slave`, `master`: rows of the two surfaces; `xi_slave`, `xi_master` (n, 2; the second
    column is 0 on lines): reference coordinates in those faces; `weight`: true measure of the slave surface (including
    2 pi r if `axisymmetric`); `normal` (n, 3): unit, outward from the slave; `ray` = (x_bar - x).normal, with x the
    point of the slave's face and x_bar that of the master's, on the line through x along `normal`; `gap`, > 0 where
    open: `ray` minus the heights of both surfaces there (`Surface.height`), so that it is measured between the smooth
    surfaces where faces approximate such.
    `groups` (g, 5): slave type code, master type code (skin.FACE_TYPES), rule code, first row, row after the last.
    """

    macro: Ints
    slave: Ints
    master: Ints
    xi_slave: Floats
    xi_master: Floats
    weight: Floats
    normal: Floats
    ray: Floats
    gap: Floats
    groups: Ints
    axisymmetric: bool = False

    def __len__(self) -> int:
        return len(self.weight)


def contact_points(
    slave: Surface, master: Surface, *, macro: Ints | None = None, normals: str = "facet",
    crease_angle: float | None = None, search_distance: float | None = None, max_penetration: float | None = None,
    axisymmetric: bool = False, degree: int = 0, keeps: Bools | None = None,
) -> ContactPoints:  # fmt: skip
    """Compute the contact points of a slave surface against a master.

    `macro` (faces of slave,): the macro-element of each slave face; its own row if None; points of faces with a
    negative one are left out. `normals`: `facet`, the slave's true normal, which is that of the smooth surface where
    faces have heights; `smoothed`, nodal normals averaged over edges with an angle below `crease_angle` degrees
    (None: 40, and over any edge between faces that the slave's height takes as one shape); or `master`, the same of the
    master, turned round, where the ray ends.
    `axisymmetric`: about the y axis, x >= 0 the radius; weights include 2 pi x.
    `degree` (4 at most): degree of polynomials on plane faces that are integrated exactly besides the shape functions.
    `keeps` (faces of slave,): faces that keep to a plane master also where they have turned away from it, as those of
    an edge that folds under; not farther from it than their macro-element is large. Only with the master's normals.

    A slave face is paired with master faces that face it (opposite normals), up to `search_distance` ahead along its
    normal, by default `default_distance`; and behind it, where bodies overlap, up to `max_penetration`, by default the
    mean depth of the cells behind the slave face and behind the master face (the size of a face without a cell behind),
    and no farther than ahead: so two plates one cell thick may overlap by half of both before their far sides could be
    paired. All of these are distances of the smooth surfaces where faces have heights. Of several layers of the master
    the nearest counts. Raises RequestError, ValueError.

    >>> from lacmesh import Mesh
    >>> mesh = Mesh.create([[0, 0], [1, 0], [1, 0.1], [0, 0.1]], [("SEG2", [[1, 0], [3, 2]])])
    >>> points = contact_points(Surface.of(mesh, [0]), Surface.of(mesh, [1]))
    >>> points.gap.round(12).tolist(), float(points.weight.sum())
    ([0.1], 1.0)
    """
    _check(slave, master, normals, axisymmetric, search_distance, max_penetration)
    macro = np.arange(len(slave)) if macro is None else np.asarray(macro)
    if macro.shape != (len(slave),):
        raise ValueError(f"macro must be ({len(slave)},), not {macro.shape}")
    corners = [side.faces.nodes[:, :MAX_CORNERS] for side in (slave, master)]
    origin = origin_of(np.concatenate([side.x[k[k >= 0]] for side, k in zip((slave, master), corners, strict=True)]))
    if origin.any():
        slave, master = slave.at(slave.x - origin), master.at(master.x - origin)
    s, m = patches(slave), patches(master)
    with np.errstate(over="ignore", invalid="ignore"):
        H = normal_maps(slave, master, normals, crease_angle)
    s = s.take(np.flatnonzero(macro[s.face] >= 0))
    if search_distance is None:
        search_distance = default_distance(slave, master, macro)
    degree = max(degree, *(0 if side.height is None else side.height.degree for side in (slave, master)))
    reach = reaches(slave, master, s, m, search_distance, max_penetration)
    if keeps is not None and normals == "master":
        s, reach = _with_folds(slave, s, m, reach, macro, keeps)
    pairs = candidates(s, m, reach)
    radius = float(origin[0]) if axisymmetric else None
    fs, fm, placed, groups = _placed(slave, master, s, m, pairs, reach, H, radius, degree)
    gap = placed.gap
    if slave.height is not None or master.height is not None:
        gap = gap - (slave.heights(fs, placed.xi_slave) + master.heights(fm, placed.xi_master))
    return ContactPoints(
        macro[fs], fs, fm, placed.xi_slave, placed.xi_master, placed.weight, placed.normal, placed.gap, gap, groups,
        axisymmetric,
    )  # fmt: skip


def _with_folds(
    slave: Surface, s: Patches, m: Patches, reach: Reach, macro: Ints, keeps: Bools
) -> tuple[Patches, Reach]:
    """Return the slave's patches, those turned over that have turned away and keep to the master, and their reach."""
    normal = (m.area[:, None] * m.e[:, 2]).sum(axis=0)
    size = float(np.linalg.norm(normal))
    away = keeps[s.face] & (s.e[:, 2] @ normal > FACING * size)
    if not (away.any() and size > _PLANE * m.area.sum()):
        return s, reach
    near = np.bincount(np.maximum(macro, 0), np.where(macro >= 0, slave.size, 0.0))[macro[s.face]]
    ahead = np.where(away, near, reach.ahead)
    behind = np.where(away, near - reach.deep.max(initial=0.0), reach.behind)
    return s.turned_over(away), reach._replace(ahead=ahead, behind=behind)


def _check(
    slave: Surface, master: Surface, normals: str, axisymmetric: bool, distance: float | None, penetration: float | None
) -> None:
    """Raise RequestError for arguments of `contact_points` that make no sense; DataError for nodes beyond an axis."""
    if normals not in NORMALS:
        raise RequestError(f"normals is one of {', '.join(NORMALS)}, not {normals!r}")
    for name, length in (("search_distance", distance), ("max_penetration", penetration)):
        if length is not None and not length >= 0:
            raise RequestError(f"{name} is a length, 0 or more, not {length}")
    if slave.dim != master.dim:
        raise RequestError(f"the slave's faces have dimension {slave.dim}, the master's {master.dim}: they do not meet")
    if axisymmetric and slave.dim != 1:
        raise RequestError("an axisymmetric model is plane: its surfaces are placed of segments")
    for surface, what in ((slave, "slave"), (master, "master")) if axisymmetric else ():
        x = surface.x[surface.faces.distinct_nodes, :2]
        fine = x[np.isfinite(x).all(axis=1)]
        size = np.ptp(fine, axis=0).max() if len(fine) else 0.0
        beyond = int((x[:, 0] < -_BEYOND * size).sum())
        if beyond:
            raise DataError(
                f"{beyond} of {len(x)} nodes of the {what} have x < 0, and an axisymmetric model has its radius along "
                "x: move the model to x >= 0, or measure it as a plane one"
            )


def default_distance(slave: Surface, master: Surface, macro: Ints) -> float:
    """Default search distance ahead of a slave surface, which a cut of the slave does not change.

    A quarter of the diagonal of the smaller surface's box, or twice the diagonal of the largest macro-element's box if
    that is more. `macro` (faces of slave,), as in `contact_points`.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # wild coordinates
        smaller = min(_diagonals(k, np.zeros(len(k), np.int64)).max(initial=0.0) for k in (slave, master))
        return float(max(0.25 * smaller, 2 * _diagonals(slave, macro).max(initial=0.0)))


def _diagonals(surface: Surface, group: Ints) -> Floats:
    """(groups,): diagonal of the bounding box of each group of faces; faces with a negative `group` are left out."""
    rows = np.flatnonzero(group >= 0)
    nodes = surface.faces.nodes[rows, :MAX_CORNERS]
    there = np.arange(MAX_CORNERS) < surface.n_corners[rows, None]
    ends = np.full((2, int(group.max(initial=-1)) + 1, 3), -np.inf)
    x = surface.x[nodes]
    for out, corners in zip(ends, (x, -x), strict=True):
        np.maximum.at(out, group[rows], np.where(there[..., None], corners, -np.inf).max(axis=1))
    length = np.linalg.norm(ends[0] + ends[1], axis=1)
    return length[np.isfinite(length)]


def reaches(
    slave: Surface,
    master: Surface,
    s: Patches,
    m: Patches,
    distance: float | None = None,
    penetration: float | None = None,
) -> Reach:
    """Search distances of each slave patch, ahead and behind, by the rules in `contact_points`.

    These are distances of the smooth surfaces: faces are looked for as much farther as these are off them.
    """
    if distance is None:
        distance = default_distance(slave, master, np.arange(len(slave)))
    heights = (np.zeros((len(k), 1)) if k.height is None else np.abs(k.height.value) for k in (slave, master))
    off_s, off_m = (height.max(axis=1)[p.face] for height, p in zip(heights, (s, m), strict=True))
    most = float(off_m.max(initial=0.0))
    ahead = distance + off_s + most
    if penetration is not None:
        return Reach(ahead, penetration + off_s, off_m, np.inf)
    depth_s, depth_m = (np.where(k.depth > 0, k.depth, k.size)[p.face] for k, p in ((slave, s), (master, m)))
    return Reach(
        ahead, depth_s / 2 + off_s, depth_m / 2 + off_m, float(distance) + float(off_s.max(initial=0.0)) + most
    )


def _placed(
    slave: Surface, master: Surface, s: Patches, m: Patches, pairs: Pairs, reach: Reach, H: NormalMaps,
    radius: float | None, degree: int,
) -> tuple[Ints, Ints, Placed, Ints]:  # fmt: skip
    """Place points on the common parts of the candidate pairs: (slave face, master face, points, groups).

    `radius`: that of the origin in an axisymmetric model, else None. Points whose ray misses the master are left out:
    their part of the slave is not covered.
    """
    if slave.dim == 1:
        parts = clip_lines(pairs, s, m, reach)
        fs, fm = s.face[parts.slave], m.face[parts.master]
        of_faces = np.maximum(FUNCTION_DEGREE[slave.faces.type[fs]], FUNCTION_DEGREE[master.faces.type[fm]])
        least, smooth = np.maximum(of_faces, degree), _turned(slave, master, H, fs, fm) > FLAT
        code = gauss_points(s, m, parts, least, radius is not None, smooth)
        order, groups = _groups(slave, master, fs, fm, code)
        placed = place_lines(Intervals._make(column[order] for column in parts), code[order], s, m, H, radius)
        piece = order[placed.piece]
    else:
        pieces = clip(pairs, s, m, reach)
        fs, fm = s.face[pieces.slave], m.face[pieces.master]
        sides = _side(slave, s, pieces.slave), _side(master, m, pieces.master)
        turned = _turned(slave, master, H, fs, fm)
        code = pair_rule(*sides, np.diff(pieces.start), pieces.largest_share(), turned, degree)
        order, groups = _groups(slave, master, fs, fm, code)
        functions = np.stack([side.functions for side in sides], axis=1)
        placed = place(pieces, order, code, s, m, functions, np.maximum(s.warp[fs], turned), H)
        piece = placed.piece
    groups[:, 3:] = placed.first[groups[:, 3:]]
    placed = placed._replace(piece=piece)
    if not placed.met.all():
        groups[:, 3:] = np.concatenate([[0], np.cumsum(placed.met)])[groups[:, 3:]]
        groups = groups[groups[:, 4] > groups[:, 3]]
        placed = Placed._make([placed.first, *(column[placed.met] for column in placed[1:])])
    return fs[placed.piece], fm[placed.piece], placed, groups


def _turned(slave: Surface, master: Surface, H: NormalMaps, fs: Ints, fm: Ints) -> NDArray[np.floating]:
    """(n,): how normals of maps H turn over a slave's face: their deviation from its own mean normal, 0 without any.

    Of the master's normals it is their variation over its face. `fs`, `fm` (n,): the faces of slave and master.
    """
    if not len(H.G):
        return np.zeros(len(fs))
    if not H.are_normals:
        return np.asarray(np.abs(H.G).max(axis=(1, 2)) / np.maximum(slave.size, 1e-300))[fs]
    turned = np.abs(H.G[:, 1:]).max(axis=(1, 2))
    if H.of_master:
        return np.asarray(turned)[fm]
    return np.asarray(np.maximum(turned, np.abs(H.G[:, 0] - mean_normals(slave)[0]).max(axis=1)))[fs]


def _side(surface: Surface, p: Patches, rows: Ints) -> Sides:
    """Collect the properties of some patches that determine the rules of their pieces."""
    f = p.face[rows]
    functions = N_FUNCTIONS[surface.faces.type]
    if surface.height is not None:  # a polynomial in the plane of other faces, which rules integrate without a fit
        high = np.isin(surface.faces.type, QUADRANGLES) & surface.height.value.any(axis=1)
        functions = np.where(high, N_FUNCTIONS[TYPE_CODE["QUAD9"]], functions)
    return Sides(surface.faces.type[f], p.kind[f], p.warp[f], p.n[rows] == surface.n_corners[f], functions[f])


def _groups(slave: Surface, master: Surface, fs: Ints, fm: Ints, code: Ints) -> tuple[Ints, Ints]:
    """Order of the pieces by (slave type, master type, rule, slave face), and the groups: (types, rule, start, end)."""
    key = (slave.faces.type[fs] * 16 + master.faces.type[fm]) * 64 + code
    order = np.argsort(key, kind="stable")
    values, first = np.unique(key[order], return_index=True)
    last = np.append(first, len(order))[1:]
    return order, np.stack([values // 1024, values // 64 % 16, values % 64, first, last], axis=1).astype(np.int64)


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
    area, covered, integral = (
        np.bincount(rows, values, minlength=n).astype(float)
        for rows, values in (
            (macro[ours], face_measure(slave, points.axisymmetric)[ours]),
            (points.macro, points.weight),
            (points.macro, points.weight * points.gap),
        )
    )
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        ratio = np.where(area > 0, np.minimum(covered / area, 1.0), 0.0)
        mean = np.where(covered > 0, integral / covered, np.nan)
    least, most = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(least, points.macro, points.gap)
    np.maximum.at(most, points.macro, points.gap)
    least[np.isinf(least)], most[np.isinf(most)] = np.nan, np.nan
    return Coverage(area, covered, ratio, integral, mean, least, most)


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
