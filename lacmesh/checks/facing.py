"""What is asked of slave and master together: gap, coverage, sides, sizes. All of it is read from `surface`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lacmesh.checks.dofs import macros_of
from lacmesh.checks.findings import Finding
from lacmesh.checks.subject import Side, Subject
from lacmesh.errors import DataError
from lacmesh.mesh import Floats, Ints
from lacmesh.skin import FACE_TYPES, REVERSED, Faces
from lacmesh.surface import ContactPoints, Coverage, Surface, contact_points, coverage

#: coverage from which a macro-element is covered, up to which it is not
WHOLE, NONE = 1 - 1e-6, 1e-6
#: how much slave and master may differ in size where they meet, and from where a hint is given
RATIO, HINT = 5.0, 1.5


def check_facing(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """The gap, what the master covers, on which side it is, and how the sizes compare."""
    slave, master = subject.slave, subject.master
    if master is None or not len(slave) or not len(master):
        return [], {}
    if not (subject.finite[slave.nodes].all() and subject.finite[master.nodes].all()):
        return [_left_out(subject, "some coordinates are no numbers")], {}
    try:
        a, b = (Surface.of(subject.mesh, side.cells) for side in (slave, master))
    except DataError as error:
        return [_left_out(subject, str(error))], {}
    macro = macros_of(subject).of_face
    points = contact_points(a, b, macro=macro, **subject.options)
    covered = coverage(points, a, macro)
    found = _coverage(subject, macro, covered)
    found += _sides(subject, a, b, macro, points, covered)
    if not len(points):
        return found, {"covered": 0.0}
    gap, figures = _gap(subject, points, covered)
    return [*found, gap, *_sizes(subject, a, b, macro, points)], figures


def _left_out(subject: Subject, why: str) -> Finding:
    return subject.found("facing-left-out", f"gap and coverage were left out: {why}", group=subject.slave.group)


def _coverage(subject: Subject, macro: Ints, covered: Coverage) -> list[Finding]:
    side = subject.slave
    part = covered.ratio
    if (part <= NONE).all():
        message = "no slave face finds a master face along its normal; check the groups, their places and their sides"
        return [subject.found("no-coverage", message, side.cells, group=side.group)]
    bare, partly = part <= NONE, (part > NONE) & (part < WHOLE)
    if not (bare | partly).any():
        return []
    cells = side.cells[(bare | partly)[macro]]
    message = (
        f"{int(bare.sum())} of {len(part)} macro-elements do not face the master at all, {int(partly.sum())} only in "
    )
    message += (
        f"part (slave faces {subject.numbers(cells)}); nothing to do if the slave is meant to reach beyond the master"
    )
    return [subject.found("partial-coverage", message, cells, group=side.group)]


def _sides(
    subject: Subject, slave: Surface, master: Surface, macro: Ints, points: ContactPoints, covered: Coverage
) -> list[Finding]:
    """Whether the master turns its back on the slave, or lies behind it."""
    found = []
    lacking = covered.ratio < WHOLE
    bare = np.isnan(master.depth)
    if lacking.any() and bare.any():
        over = contact_points(slave, _turned_over(master, bare), macro=macro, **subject.options)
        gained = coverage(over, slave, macro).ratio > covered.ratio + 0.5
        if gained.any():
            cells = subject.slave.cells[gained[macro]]
            message = f"the master turns its back on {int(gained.sum())} macro-elements (slave faces "
            message += f"{subject.numbers(cells)}); turn it over (lacmesh orient, or list its faces the other way)"
            found.append(subject.found("wrong-side", message, cells, group=subject.slave.group))
    size = _size(covered.area, slave.dim)
    deep = (covered.ratio > NONE) & (covered.mean_gap < -size)
    if deep.any():
        cells = subject.slave.cells[deep[macro]]
        message = f"the master lies behind {int(deep.sum())} macro-elements, deeper than their size (slave faces "
        message += f"{subject.numbers(cells)}); check that these are the surfaces that meet"
        found.append(subject.found("wrong-side", message, cells, group=subject.slave.group))
    return found


def _turned_over(surface: Surface, rows: np.ndarray) -> Surface:
    nodes = surface.faces.nodes.copy()
    for code in np.unique(surface.faces.type[rows]):
        mine = np.flatnonzero(rows & (surface.faces.type == code))
        order = np.array(REVERSED[FACE_TYPES[code]])
        nodes[mine[:, None], np.arange(len(order))] = surface.faces.nodes[mine[:, None], order]
    return replace(surface, faces=Faces(surface.faces.type, nodes))


def _gap(subject: Subject, points: ContactPoints, covered: Coverage) -> tuple[Finding, dict[str, Any]]:
    total = float(covered.covered.sum())
    mean = float(covered.gap_integral.sum()) / total if total > 0 else 0.0
    low, high = float(points.gap.min()), float(points.gap.max())
    share = min(total / float(covered.area.sum()), 1.0) if covered.area.sum() > 0 else 0.0
    message = f"gap from {low:.6g} to {high:.6g}, mean {mean:.6g} (open > 0); "
    message += f"{100 * share:.4g} % of the slave faces the master"
    figures = {
        "gap": {"min": low, "mean": mean, "max": high},
        "covered": share,
        "covered_macro_elements": int((covered.ratio >= WHOLE).sum()),
        "partly_covered_macro_elements": int(((covered.ratio > NONE) & (covered.ratio < WHOLE)).sum()),
        "uncovered_macro_elements": int((covered.ratio <= NONE).sum()),
    }
    return subject.found("gap", message, group=subject.slave.group), figures


def _sizes(subject: Subject, slave: Surface, master: Surface, macro: Ints, points: ContactPoints) -> list[Finding]:
    """Sizes of macro-elements and master faces where they meet."""
    own = _size(np.bincount(macro, _measures(slave)).astype(float), slave.dim)[points.macro]
    other = _size(_measures(master), master.dim)[points.master]
    good = (own > 0) & (other > 0)
    if not good.any():
        return []
    weight = points.weight[good]
    ratio = float(np.exp((weight * np.log(own[good] / other[good])).sum() / weight.sum()))
    found = []
    text = f"where they meet, slave macro-elements are {ratio:.3g} times as large as master faces"
    if not 1 / RATIO <= ratio <= RATIO:
        coarse = "slave" if ratio > 1 else "master"
        found.append(subject.found("size-ratio", f"{text}; refine the {coarse}", group=subject.slave.group))
    if ratio > HINT and not _bare(subject, subject.master):
        message = f"a hint: {text}, and the rule of thumb takes the coarser and stiffer side as master; "
        message += "think of exchanging them"
        found.append(subject.found("better-slave", message, group=subject.slave.group))
    return found


def _bare(subject: Subject, side: Side | None) -> bool:
    """A rigid side is the stiffer one, whatever its mesh."""
    return side is not None and bool((subject.behind(side) == 0).all())


def _measures(surface: Surface) -> Floats:
    from lacmesh.quadrature import measure

    out = np.zeros(len(surface))
    for kind, rows, nodes in surface.by_type():
        out[rows] = measure(kind, surface.x[nodes])
    return out


def _size(area: Floats, dim: int) -> Floats:
    return np.asarray(area, float) ** (1 / dim)
