"""Checks of the surfaces of the skins: shapes of curved ones, and slave and master together: gap, coverage, sizes.

All are computed by `lacmesh.smooth` and `lacmesh.surface`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from lacmesh.checks.dofs import macros_of, records_of
from lacmesh.checks.findings import Place, rule
from lacmesh.checks.request import Bools, CheckedSkin, Request
from lacmesh.errors import DataError, counted
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import measure
from lacmesh.smooth import surface_of
from lacmesh.smooth.fitted import DOUBTFUL, doubt_text, faceted, few_faces_text, fitted_shapes
from lacmesh.smooth.heights import smooth_of
from lacmesh.surface import ContactPoints, Coverage, Surface, contact_points, coverage, default_distance

T = TypeVar("T")
#: coverage from which a macro-element is covered, up to which it is not. Faces are matched in their mean planes, and
#: where these are curved some hundredths are lost along the boundary of a skin that the master covers
WHOLE, NONE = 0.95, 1e-6
#: how much slave and master may differ in size where they meet, and from where a hint is given
RATIO, HINT = 5.0, 1.5


# ---- shapes of curved skins


def _smooth_zones(request: Request, side: CheckedSkin) -> list[tuple[str, Any, Surface]]:
    """The name, the smooth surface and the surface of each group of a skin whose faces have normals."""
    zones, mesh = [], request.once(records_of).mesh
    for zone, name in enumerate(side.names):
        cells = side.cells[side.zone == zone]
        if len(cells):
            with suppress(DataError):  # faces without a normal: `facing-left-out` reports them
                surface = Surface.of(mesh, cells)
                zones.append((name, smooth_of(mesh, surface, request.options["crease_angle"]), surface))
    return zones


@rule("faceted", "warning", "refine the mesh (16 faces to a full turn or more), or use quadratic cells", "skin")
def faceted_skins(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A curved surface of linear cells is too coarse for a smooth fit: neighbouring faces of a free-form surface meet
    at more than 22.5 degrees (fewer than 16 to a full turn), have too few neighbours, or change their curvature within
    few faces, as at a fillet, so that heights may be off by 0.005 of a face's size.
    """
    for name, smooth, surface in request.once(_smooth_zones, side) if request.options["surface"] == "smooth" else ():
        coarse = faceted(smooth, surface)
        if len(coarse.cells):
            what = [f"meet at angles up to {coarse.turn:.0f} degrees"]
            if coarse.no_height:
                what.append(f"{coarse.no_height:,} of them have too few neighbours for a fit")
            if coarse.doubt > DOUBTFUL:
                what.append(f"their {doubt_text(coarse.doubt)}")
            message = f"{side.counted(len(coarse.cells), 'is|are')} too coarse for a curved surface: they "
            yield Place(f"{message}{', and '.join(what)}", coarse.cells, group=name)


@rule("few-faces", "warning", "give --crease-angle 40 if the edges are sharp, as those of a nut")
def few_faces(request: Request) -> Iterator[Place | dict[str, Any]]:
    """A circle, cylinder, sphere or cone of few faces, five to eight to a full turn: they turn by more than 40 degrees,
    and are taken as that shape since all nodes lie on it.
    """
    shapes: dict[str, Any] = {}
    for name, smooth, surface in (zone for side in request.sides for zone in request.once(_smooth_zones, side)):
        message = few_faces_text(smooth) if request.options["surface"] == "smooth" else ""
        if message:
            yield Place(message, surface.cell, group=name)
        fitted = fitted_shapes(smooth, surface)
        if not all(one.flat for one in fitted):
            at = [one if one.centre is None else replace(one, centre=one.centre + request.origin) for one in fitted]
            shapes[name] = [one.as_dict() for one in at]
    yield {"shapes": shapes}


# ---- slave against master


@dataclass(frozen=True, eq=False)
class _Facing:
    """Slave and master surface, the macro-element of each slave face, the contact points and the coverage."""

    slave: Surface
    master: Surface
    macro: Ints
    options: dict[str, Any]
    points: ContactPoints
    covered: Coverage

    def coverage(self, master: Surface, **options: Any) -> Coverage:
        """Return the coverage by another master, or with other options."""
        points = contact_points(self.slave, master, macro=self.macro, **self.options | options)
        return coverage(points, self.slave, self.macro)

    @property
    def lacking(self) -> tuple[Bools, Bools]:
        """(m,) each: True for macro-elements that the master does not cover at all, and for those covered in part."""
        ratio = self.covered.ratio
        return ratio <= NONE, (ratio > NONE) & (ratio < WHOLE)


def _facing(request: Request) -> _Facing | str | None:
    """Pair the surfaces of slave and master; None without both, or the reason why it is impossible."""
    slave, master = request.slave, request.master
    if master is None or not len(slave) or not len(master):
        return None
    if not (request.finite[slave.nodes].all() and request.finite[master.nodes].all()):
        return "some coordinates are not finite"
    options = dict(request.options)
    smooth, mesh = {name: options.pop(name) for name in ("surface", "crease_angle")}, request.once(records_of).mesh
    try:
        a, b = (surface_of(mesh, side.cells, **smooth) for side in request.sides)
        macro = request.once(macros_of).of_face
        if options.get("search_distance") is None:
            options["search_distance"] = default_distance(a, b, macro)
        points = contact_points(a, b, macro=macro, **options)
        return _Facing(a, b, macro, options, points, coverage(points, a, macro))
    except DataError as error:
        return str(error)


def _paired(function: Callable[[Request, _Facing], T]) -> Callable[[Request], T | tuple[()]]:
    """Return a function of (request) that calls one of (request, facing), where slave and master are paired."""

    @wraps(function)
    def of_request(request: Request) -> T | tuple[()]:
        facing = request.once(_facing)
        return function(request, facing) if isinstance(facing, _Facing) else ()

    return of_request


def _bare_zones(request: Request, facing: _Facing) -> dict[str, Bools]:
    """The macro-elements (m,) of each zone that sees no master at all."""
    bare = facing.lacking[0]
    zone = np.empty(len(bare), np.int64)
    zone[facing.macro] = request.slave.zone
    of_zone = {name: zone == k for k, name in enumerate(request.slave.names)}
    return {name: macros for name, macros in of_zone.items() if macros.any() and bare[macros].all()}


@rule("no-coverage", "error", "check the groups, their positions and normals, or increase --search-distance", "pair")
@_paired
def no_coverage(request: Request, facing: _Facing) -> Iterator[Place]:
    """No slave face of a contact has a master face along its normal, within the search distance."""
    for name, macros in _bare_zones(request, facing).items():  # an error, whatever the other zones see
        message = f"no slave face of {name} has a master face along its normal, within "
        message += f"{facing.options['search_distance']:.4g}"
        yield Place(message, request.slave.cells[macros[facing.macro]], group=name)


@rule("partial-coverage", "warning", "nothing to do if the slave is meant to extend beyond the master", "pair")
@_paired
def partial_coverage(request: Request, facing: _Facing) -> Iterator[Place]:
    """The master covers less than 95 % of a macro-element, or none of it."""
    bare, partly = facing.lacking
    for macros in _bare_zones(request, facing).values():
        bare = bare & ~macros
    if (bare | partly).any():
        cells = request.slave.cells[(bare | partly)[facing.macro]]
        all_ = f" of {counted(len(bare), 'macro-element')}"
        none = f"does not cover {bare.sum():,}{all_}" if bare.any() else ""
        some = f"covers {partly.sum():,}{'' if none else all_} only in part" if partly.any() else ""
        message = f"the master {none}{', and ' if none and some else ''}{some} (slave faces {request.numbers(cells)})"
        yield Place(message, cells)


@rule("wrong-side", "warning", "orient the surfaces outward, and check which surfaces face each other", "pair")
@_paired
def wrong_side(request: Request, facing: _Facing) -> Iterator[Place]:
    """Slave and master normals are not opposite where they face each other, or the master lies behind the slave."""
    parentless, covered = np.isnan(facing.master.depth), facing.covered
    if parentless.any() and np.any(facing.lacking):  # turned over, such faces may cover more
        over = facing.coverage(facing.master.turned_over(np.flatnonzero(parentless)))
        gained = over.ratio > covered.ratio + 0.5
        if gained.any():
            cells = request.slave.cells[gained[facing.macro]]
            message = f"the master's normal points away from {counted(int(gained.sum()), 'macro-element')} (slave "
            advice = "flip it: lacmesh orient, or reverse the node order of its faces"
            yield Place(f"{message}faces {request.numbers(cells)})", cells, advice=advice)
    if np.any(facing.lacking[0]):  # a master that lies deeper than overlapping bodies would may be out of range
        covered = facing.coverage(facing.master, max_penetration=facing.options["search_distance"])
    unseen = covered.ratio > facing.covered.ratio + 0.5
    deep = unseen | ((covered.ratio > NONE) & (covered.mean_gap < -_macro_sizes(facing)))
    if deep.any():
        cells = request.slave.cells[deep[facing.macro]]
        message = f"the master lies behind {counted(int(deep.sum()), 'macro-element')}, too deep for an overlap of two "
        message += f"bodies (slave faces {request.numbers(cells)})"
        advice = "check that these are the surfaces in contact"
        yield Place(message, cells, advice=advice)


def _gap(facing: _Facing) -> tuple[dict[str, float], float] | None:
    """The least, mean and largest gap, and the part of the slave's area that faces the master; None if not finite."""
    points, covered = facing.points, facing.covered
    total, area = float(covered.covered.sum()), float(covered.area.sum())
    mean = float(covered.gap_integral.sum()) / total if total > 0 else 0.0
    gap = {"min": float(points.gap.min()), "mean": mean, "max": float(points.gap.max())}
    share = min(total / area, 1.0) if area > 0 else 0.0
    return (gap, share) if np.isfinite([*gap.values(), share]).all() else None


@rule("gap", "info", "nothing", "pair")
@_paired
def gaps(request: Request, facing: _Facing) -> Iterator[Place | dict[str, Any]]:
    """The signed gap between slave and master: open > 0, penetration < 0."""
    if not len(facing.points):
        yield {"covered": 0.0}
    elif known := _gap(facing):
        (gap, share), (bare, partly) = known, facing.lacking
        yield {
            "gap": gap,
            "covered": share,
            "covered_macro_elements": int((~bare & ~partly).sum()),
            "partly_covered_macro_elements": int(partly.sum()),
            "uncovered_macro_elements": int(bare.sum()),
        }
        message = f"gap from {gap['min']:.6g} to {gap['max']:.6g}, mean {gap['mean']:.6g} (open > 0); "
        yield Place(f"{message}the master covers {100 * share:.4g} % of the slave")


@rule("size-ratio", "warning", "refine the coarser side, which limits the resolution of the pressure", "pair")
@_paired
def size_ratios(request: Request, facing: _Facing) -> Iterator[Place]:
    """The faces of slave and master differ much in size."""
    ratio = _size_ratio(facing)
    if not 1 / RATIO <= ratio <= RATIO:
        advice = f"refine the {'slave' if ratio > 1 else 'master'}"
        yield Place(_MEET.format(ratio), advice=advice)


@rule("better-slave", "info", "exchange slave and master, if the slave is not the softer body", "pair")
@_paired
def better_slaves(request: Request, facing: _Facing) -> Iterator[Place]:
    """A hint from the sizes alone: by a rule of thumb the coarser and stiffer side is the master."""
    ratio, is_rigid = _size_ratio(facing), np.isnan(facing.master.depth).all()  # a rigid side is the stiffer one
    if ratio > HINT and not is_rigid:
        message = f"a hint: {_MEET.format(ratio)}; by a rule of thumb the coarser and stiffer side is the master: "
        yield Place(f"{message}consider exchanging slave and master")


_MEET = "where slave and master face each other, macro-elements are {:.3g} times as large as master faces"


def _size_ratio(facing: _Facing) -> float:
    """The ratio of the sizes of macro-elements and master faces, where they face each other; 1 if it is not known."""
    points = facing.points
    if not len(points) or not _gap(facing):
        return 1.0
    slave = _macro_sizes(facing)[points.macro]
    master = _size(_measures(facing.master), facing.master.dim)[points.master]
    good = (slave > 0) & (master > 0)
    if not good.any():
        return 1.0
    weight = points.weight[good]
    return float(np.exp((weight * np.log(slave[good] / master[good])).sum() / weight.sum()))


@rule("facing-left-out", "warning", "correct the mesh; all other checks were done", "pair")
def facing_left_out(request: Request) -> Iterator[Place]:
    """Gap and coverage cannot be computed: segments that are not in one plane, or coordinates not finite."""
    facing = request.once(_facing)
    why = facing if isinstance(facing, str) else ""
    if isinstance(facing, _Facing) and len(facing.points) and not _gap(facing):
        why = "lengths are too large or too small to be multiplied"
    if why:
        yield Place(f"gap and coverage were not computed: {why}", advice="")


def _macro_sizes(facing: _Facing) -> Floats:
    """(m,): the size of each macro-element as a length: its length, or the square root of its area."""
    return _size(np.bincount(facing.macro, _measures(facing.slave)).astype(float), facing.slave.dim)


def _measures(surface: Surface) -> Floats:
    out = np.zeros(len(surface))
    for kind, rows, nodes in surface.by_type():
        out[rows] = measure(kind, surface.x[nodes])
    return out


def _size(area: Floats, dim: int) -> Floats:
    return np.asarray(area, float) ** (1 / dim)
