"""Checks of slave and master together: gap, coverage, orientation, sizes. All are computed by `lacmesh.surface`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.subject import Subject
from lacmesh.errors import DataError
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import measure
from lacmesh.smooth import surface_of
from lacmesh.surface import ContactPoints, Coverage, Surface, contact_points, coverage, default_distance

#: coverage from which a macro-element is covered, up to which it is not. Faces are matched in their mean planes, and
#: where these are curved some hundredths are lost along the boundary of a skin that the master covers
WHOLE, NONE = 0.95, 1e-6
#: how much slave and master may differ in size where they meet, and from where a hint is given
RATIO, HINT = 5.0, 1.5


@dataclass(frozen=True, eq=False)
class _Facing:
    """Slave and master surface, the macro-element of each slave face, the contact points and the coverage."""

    slave: Surface
    master: Surface
    macro: Ints
    options: dict[str, Any]
    points: ContactPoints
    covered: Coverage

    @classmethod
    def of(cls, subject: Subject) -> _Facing:
        """Pair the slave and master surfaces. Raises DataError if that is impossible with these faces."""
        assert subject.master is not None
        options = dict(subject.options)
        smooth = {name: options.pop(name) for name in ("surface", "crease_angle")}
        a, b = (surface_of(subject.cut_mesh, side.cells, **smooth) for side in subject.sides)
        macro = subject.macros.of_face
        if options.get("search_distance") is None:
            options["search_distance"] = default_distance(a, b, macro)
        points = contact_points(a, b, macro=macro, **options)
        return cls(a, b, macro, options, points, coverage(points, a, macro))

    @property
    def lacking(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(m,) each: True for macro-elements that the master does not cover at all, and for those covered in part."""
        ratio = self.covered.ratio
        return ratio <= NONE, (ratio > NONE) & (ratio < WHOLE)


def check_facing(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check the gap, the coverage by the master, the side on which the master lies, and the ratio of sizes."""
    slave, master = subject.slave, subject.master
    if master is None or not len(slave) or not len(master):
        return [], {}
    if not (subject.finite[slave.nodes].all() and subject.finite[master.nodes].all()):
        return [_left_out(subject, "some coordinates are not finite")], {}
    try:
        facing = _Facing.of(subject)
    except DataError as error:
        return [_left_out(subject, str(error))], {}
    findings = [*_coverage(subject, facing), *_facing_away(subject, facing), *_behind(subject, facing)]
    if not len(facing.points):
        return findings, {"covered": 0.0}
    gap, figures = _gap(subject, facing)
    if not np.isfinite([*figures["gap"].values(), figures["covered"]]).all():
        return [*findings, _left_out(subject, "lengths are too large or too small to be multiplied")], {}
    return [*findings, gap, *_sizes(subject, facing)], figures


def _left_out(subject: Subject, why: str) -> Finding:
    return subject.found("facing-left-out", f"gap and coverage were not computed: {why}", group=subject.slave.group)


def _coverage(subject: Subject, facing: _Facing) -> Iterator[Finding]:
    side = subject.slave
    unseen, partly = facing.lacking
    zone = np.empty(len(unseen), np.int64)
    zone[facing.macro] = side.zone
    for k, name in enumerate(side.names):  # a zone that sees no master is an error, whatever the others see
        mine = zone == k
        if mine.any() and unseen[mine].all():
            message = f"no slave face of {name} finds a master face along its normal, up to "
            message += f"{facing.options['search_distance']:.4g} away; check the groups, their positions and their "
            message += "orientation, or increase --search-distance"
            yield subject.found("no-coverage", message, side.cells[mine[facing.macro]], group=name)
            unseen = unseen & ~mine
    if (unseen | partly).any():
        cells = side.cells[(unseen | partly)[facing.macro]]
        message = f"of {counted(len(unseen), 'macro-element')}, {unseen.sum():,} do not face the master at all and "
        message += (
            f"{partly.sum():,} only in part (slave faces {subject.numbers(cells)}); nothing to do if the slave is "
        )
        yield subject.found("partial-coverage", f"{message}meant to extend beyond the master", cells, group=side.group)


def _facing_away(subject: Subject, facing: _Facing) -> Iterator[Finding]:
    """Report master faces without parent cell whose normal points away from the slave: flipped, they cover more."""
    parentless = np.isnan(facing.master.depth)
    if not parentless.any() or not np.any(facing.lacking):
        return
    over = contact_points(
        facing.slave, facing.master.turned_over(np.flatnonzero(parentless)), macro=facing.macro, **facing.options
    )
    gained = coverage(over, facing.slave, facing.macro).ratio > facing.covered.ratio + 0.5
    if gained.any():
        cells = subject.slave.cells[gained[facing.macro]]
        message = f"the master's normal points away from {counted(int(gained.sum()), 'macro-element')} (slave faces "
        message += f"{subject.numbers(cells)}); flip it: lacmesh orient, or reverse the node order of its faces"
        yield subject.found("wrong-side", message, cells, group=subject.slave.group)


def _behind(subject: Subject, facing: _Facing) -> Iterator[Finding]:
    """Report a master that lies deeper behind the slave than overlapping bodies would, and may be out of range."""
    covered = facing.covered
    if np.any(facing.lacking[0]):
        depth = facing.options["search_distance"]
        options = facing.options | {"max_penetration": depth}
        points = contact_points(facing.slave, facing.master, macro=facing.macro, **options)
        covered = coverage(points, facing.slave, facing.macro)
    unseen = covered.ratio > facing.covered.ratio + 0.5
    deep = unseen | ((covered.ratio > NONE) & (covered.mean_gap < -_macro_sizes(facing)))
    if deep.any():
        cells = subject.slave.cells[deep[facing.macro]]
        message = f"the master lies behind {counted(int(deep.sum()), 'macro-element')}, too deep for an overlap of two "
        message += f"bodies (slave faces {subject.numbers(cells)}); check that these are the surfaces in contact"
        yield subject.found("wrong-side", message, cells, group=subject.slave.group)


def _gap(subject: Subject, facing: _Facing) -> tuple[Finding, dict[str, Any]]:
    points, covered = facing.points, facing.covered
    total, area = float(covered.covered.sum()), float(covered.area.sum())
    mean = float(covered.gap_integral.sum()) / total if total > 0 else 0.0
    low, high = float(points.gap.min()), float(points.gap.max())
    share = min(total / area, 1.0) if area > 0 else 0.0
    message = f"gap from {low:.6g} to {high:.6g}, mean {mean:.6g} (open > 0); "
    message += f"{100 * share:.4g} % of the slave faces the master"
    unseen, partly = facing.lacking
    figures = {
        "gap": {"min": low, "mean": mean, "max": high},
        "covered": share,
        "covered_macro_elements": int((~unseen & ~partly).sum()),
        "partly_covered_macro_elements": int(partly.sum()),
        "uncovered_macro_elements": int(unseen.sum()),
    }
    return subject.found("gap", message, group=subject.slave.group), figures


def _sizes(subject: Subject, facing: _Facing) -> Iterator[Finding]:
    """Report the ratio of the sizes of macro-elements and master faces, where they face each other."""
    points, group = facing.points, subject.slave.group
    own = _macro_sizes(facing)[points.macro]
    other = _size(_measures(facing.master), facing.master.dim)[points.master]
    good = (own > 0) & (other > 0)
    if not good.any():
        return
    weight = points.weight[good]
    ratio = float(np.exp((weight * np.log(own[good] / other[good])).sum() / weight.sum()))
    text = f"where they meet, slave macro-elements are {ratio:.3g} times as large as master faces"
    if not 1 / RATIO <= ratio <= RATIO:
        yield subject.found("size-ratio", f"{text}; refine the {'slave' if ratio > 1 else 'master'}", group=group)
    rigid = np.isnan(facing.master.depth).all()  # the stiffer side, whatever its mesh
    if ratio > HINT and not rigid:
        message = f"a hint: {text}, and by a rule of thumb the master is the coarser and stiffer side; "
        yield subject.found("better-slave", f"{message}consider exchanging them", group=group)


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
