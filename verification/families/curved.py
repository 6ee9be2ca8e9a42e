"""Curved skins of linear cells: the gap between the surfaces that their nodes lie on, against that between faces.

Flat faces of two curved skins that fit each other miss each other by up to h^2 / 8R here and overlap as much there, and
a macro-element answers with E h / 8R, which may be large beside the pressure that is sought. Each problem is solved
three times on each mesh, with one gap or another:

- `faces`: the gap is that between the faces, along their normals;
- `smooth`: that between the curved skins that the nodes lie on, as lacmesh finds them, along the normals of these;
- `true`: at every point what it is between the exact surfaces, along the same normals as `smooth`.

What is left with the true gap is what the faceted bodies and constants on macro-elements cost. No smooth surface can do
much better; `smooth` may not be much worse, and nowhere worse than `faces`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lacsolver.problem.problem import Problem
from verification.families import curved_lug, curved_problems
from verification.families.curved_problems import Curved, Fitted, Lifted, Pin
from verification.measures.norms import nodal_pressure_error, pressure_errors
from verification.measures.rates import fitted
from verification.records import Family, Level, Result, at_most, informative, levels_of, problem, rate, row
from verification.solving import LevelSolution, balanced, finished, with_true_gap

#: what the gap is measured between
GAPS = ("faces", "smooth", "true")
#: how near the errors with smooth surfaces are to be to those with the true gap, and how fast they are to fall
RATIO, FALLING = 1.3, 0.9
#: and how fast what fits add to them, where no shape is found, and how near the errors are then on the finest mesh
BEYOND, RATIO_OF_FITS = 1.8, 2.0
#: by how much errors may exceed both those between faces and those with the true gap, which fits meet only so well
NO_WORSE = {"p_m": 1e-3, "recovered": 1e-2}
_TRUE = "the same mesh with the true gap: what faceted bodies and constants cost"
_SAME = "the same mesh with the gap between faces"
_NOWHERE = (
    "nowhere worse than faces; but where the true gap itself has a larger error, as the gap between faces makes good "
    "for some of the bodies' stiffness, nothing better can come of the right surface"
)
_ORDER = "p_m is constant on a macro-element: h, or better where p is uniform"
_UNEVEN = (
    "the 0.9 that is asked for, or what the true gap has on these meshes: they are irregular, and few, so that its "
    "rates are between 0.7 and 1.1; regular meshes are in the family press-fit, whose rates are 1.4 and more. A level "
    "on which smooth surfaces do better than the true gap is not counted against them"
)
_HEIGHTS = "heights miss by h^4, over quadrangles by h^3, and macro-elements answer with an order less"
_FREE = "no shape is found: heights are fits of a few nodes"
_CUBIC = "heights are cubics over triangles and segments, but over quadrangles they leave h^3 of third derivatives"
_FEW = "there are few faces, so that fits miss the curvature"

#: the solutions with a gap: a list for each level, of one for each set of meshes
Levels = list[list[LevelSolution]]


@problem
def solve_case(given: Fitted | Pin | Lifted, *, levels: int) -> Iterator[Result]:
    """A problem on so many meshes, with each of the three gaps."""
    own = given.problem
    smooth, faces, true = (
        [[solution(own, n, gap, k) for k in range(own.sets(n, levels))] for n in range(levels)]
        for gap in ("smooth", "faces", "true")
    )
    yield _falls(own, smooth, true)
    yield from _near_the_true_gap(own, smooth, true)
    for called, error in (("p_m", "p_m"), ("recovered pressure", "recovered")):
        name = f"{called} in L2 over that between faces or with the true gap, worst mesh"
        ratio = _worst(smooth, error, faces, true)
        yield at_most(name, ratio, 1 + NO_WORSE[error], source=_SAME, reason=_NOWHERE)
    if own.second is not None and levels > 1:
        yield at_most("p_m in L2, second mesh", _means(smooth)[1], own.second, source="what engineers can use")
    if own.uniform:
        first = 1 if own.skins == "ellipse" and levels > 1 else 0
        where = "all meshes" if first == 0 else "all but the coarsest meshes"
        count = sum(int((one.solved.zone.pressure <= 0).sum()) for level in smooth[first:] for one in level)
        reason = _FEW if first else ""
        yield at_most(f"macro-elements that open, {where}", count, 0, source="p is uniform", reason=reason)
    for called, other in (("with the true gap", true), ("between faces", faces)):
        table = _table(other, _means(other))
        reason = "beside the smooth surfaces'"
        yield informative(f"p_m in L2 {called}, finest mesh", table[-1].error, reason=reason, levels=table)
    for quantity in list(smooth[-1][0].errors)[2:]:
        mine, *theirs = (abs(each[-1][0].errors[quantity]) for each in (smooth, faces, true))
        most = max(theirs) + NO_WORSE["p_m"]
        yield at_most(f"error of the {quantity}, finest mesh", mine, most, source=_SAME, reason=_NOWHERE)
    yield from balanced([one.solved for each in (smooth, faces, true) for level in each for one in level])


def solution(given: Curved, level: int, gap: str, number: int = 0) -> LevelSolution:
    """Solve on one level, on the meshes of a number.

    Errors of p_m (`p_m`) and of the recovered pressure relative to the exact pressure, in L2; the problem's own.
    """
    own = Problem.of(given.case("faces" if gap == "faces" else "smooth"), given.mesh(level, number))
    if gap == "true":
        own = with_true_gap(own, lambda x, n: given.gap(x[:, : own.space.dim]))
    solved = finished(own)
    mesh, zone, axial = solved.mesh, solved.zone, given.axisymmetric
    errors = {
        "p_m": pressure_errors(mesh, zone.pressure, given.pressure, axisymmetric=axial).exact,
        "recovered": nodal_pressure_error(mesh, solved.recovered, given.pressure, axisymmetric=axial),
    }
    return LevelSolution(solved, given.h(level), errors | given.more(solved))


def _falls(given: Curved, smooth: Levels, true: Levels) -> Result:
    """Convergence rate of the larger of two errors of p_m, with the smooth and with the true gap.

    It is to be 0.9, or the rate with the true gap alone where that is lower.
    """
    h = [given.h(level) for level in range(len(true))]
    larger = [max(pair) for pair in zip(_means(smooth), _means(true), strict=True)]
    wanted, reason = FALLING, _UNEVEN
    if len(h) > 1:
        wanted = min(FALLING, fitted(h, _means(true)))
        reason += f"; that of p_m in L2 itself is {fitted(h, _means(smooth)):.3g}"
    quantity = "p_m in L2, or with the true gap where that is larger, rate"
    return rate(quantity, _table(smooth, larger), wanted, source=_ORDER, reason=reason)


def _near_the_true_gap(given: Curved, smooth: Levels, true: Levels) -> Iterator[Result]:
    """Errors with smooth surfaces over those with the true gap: everywhere if shapes are found, else at the end."""
    name = "p_m in L2 over that with the true gap"
    if given.skins == "found":
        yield at_most(f"{name}, worst mesh", _worst(smooth, "p_m", true), RATIO, source=_TRUE)
    elif given.skins == "parabola":
        yield at_most(f"{name}, finest mesh", _worst(smooth[-1:], "p_m", true[-1:]), RATIO, source=_TRUE, reason=_FREE)
    else:
        mine, theirs, reason = _means(smooth), _means(true), f"{_FREE}; {_CUBIC}"
        table = _table(smooth, [np.sqrt(max(a * a - b * b, 0.0)) for a, b in zip(mine, theirs, strict=True)])
        beyond = "p_m in L2 beyond that with the true gap, rate"
        yield rate(beyond, table, BEYOND, source=_HEIGHTS, reason=reason)
        yield at_most(f"{name}, finest mesh", mine[-1] / theirs[-1], RATIO_OF_FITS, source=_TRUE, reason=reason)


def _means(own: Levels) -> list[float]:
    """Root mean square of the error of p_m over the sets of meshes, one per level."""
    return [float(np.sqrt(np.mean([one.errors["p_m"] ** 2 for one in level]))) for level in own]


def _table(own: Levels, errors: Sequence[float]) -> tuple[Level, ...]:
    """Levels of a convergence table: mesh size, unknowns and error."""
    return levels_of([level[0].h for level in own], [level[0].solved.unknowns for level in own], errors)


def _worst(own: Levels, error: str, *others: Levels) -> float:
    """Largest ratio of an error to the largest error of the others on the same mesh."""
    flat = [[one.errors[error] for level in levels for one in level] for levels in (own, *others)]
    return max(a / max(more) for a, *more in zip(*flat, strict=True))


FAMILY = Family(
    "curved",
    "Curved skins on linear cells",
    "\n\n".join([__doc__.partition("\n\n")[2], curved_problems.__doc__ or "", curved_lug.__doc__ or ""]),
    (
        *(
            row("curved", name, what, solve_case, given, **levels)
            for name, what, given, levels in curved_problems.problems()
        ),
        row("curved", "lug", "a pin in the eye of a lug from CAD, TETRA4", curved_lug.solve_case, full=2, seconds=90.0),
    ),
)
