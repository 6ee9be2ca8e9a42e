"""Picture of the quality of a mesh, by matplotlib: histograms of the leading measures for every cell type."""

from __future__ import annotations

import io
import os
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import RequestError, check_installed
from lacmesh.formats.output import check_place, replace_file
from lacmesh.quality.measures import ACCEPTED, SCALES, primary_metric
from lacmesh.quality.statistics import Histogram, Statistics
from lacmesh.quality.summary import Quality, TypeQuality
from lacmesh.report.histograms import outer, window

_INK, _SOFT, _LINE, _GOOD, _POOR, _BAD = "#1d2733", "#5c6b7a", "#dde3ea", "#2563b8", "#e0982c", "#b3261e"
#: the measures drawn for a type: the one that ranks it, then the first of each of these that it has
_BESIDE = (
    ("validity",),
    ("edge_ratio",),
    ("min_dihedral", "min_angle", "min_corner_angle"),
)
_TICKS = {"ratio": (1, 2, 5, 10, 20, 50, 100), "angle": tuple(range(0, 181, 30)), "unit": (0, 0.25, 0.5, 0.75, 1)}
_NAMES = {"angle": "degrees"}


def plot_quality(quality: Quality, path: str | os.PathLike[str], *, title: str = "", force: bool = True) -> None:
    """Draw the quality of a mesh into a .png, a row for each cell type: invalid cells red, poor ones orange.

    Raises RequestError where matplotlib is missing or nothing was measured, WriteError.
    """
    path = Path(path)
    check_plot(path, force=force)
    types = [t for t in quality.types if primary_metric(t.type) not in (None, "validity")]
    if not types:
        raise RequestError("there is no surface or solid cell to draw the quality of")
    figure = import_module("matplotlib.figure").Figure(figsize=(13, 1.0 + 2.5 * len(types)), dpi=110)
    axes = figure.subplots(len(types), 1 + len(_BESIDE), squeeze=False)
    for row, kind in zip(axes, types, strict=True):
        for axis, measure in zip(row, _drawn(kind), strict=True):
            _draw(axis, kind, measure)
        row[0].set_ylabel("cells", color=_SOFT)
        _name(row[0], kind)
    figure.suptitle(title or "Quality", x=0.012, ha="left", fontsize=14, fontweight="bold", color=_INK)
    _legend(figure)
    figure.tight_layout(rect=(0, 0, 1, 1 - 0.35 / figure.get_figheight()), h_pad=3.2, w_pad=1.6)
    image = io.BytesIO()
    figure.savefig(image, format="png")
    replace_file(path, image.getvalue())


def check_plot(path: Path, *, force: bool = True) -> None:
    """Check early that the plot can be drawn and written. Raises RequestError, WriteError."""
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a plot is written as .png")
    check_place(path, force=force)
    check_installed("matplotlib", "view", "a plot")


def _drawn(kind: TypeQuality) -> list[str | None]:
    beside = [next((m for m in names if m in kind.measures), None) for names in _BESIDE]
    return [primary_metric(kind.type), *beside]


def _draw(axis: Any, kind: TypeQuality, measure: str | None) -> None:
    """Draw one histogram; the bins of a measure are equally wide on the page, whatever their range."""
    if measure is None:
        axis.set_visible(False)
        return
    values = kind.measures[measure]
    h = values.histogram
    at = np.arange(-1, len(h.counts) + 1) + 0.5
    accepted = ACCEPTED.get(kind.type, {}).get(measure)
    axis.bar(at, outer(h), width=0.92, color=_colours(measure, h.edges, accepted), zorder=2)
    ticks = _TICKS[SCALES[measure].kind]
    axis.set_xticks(np.interp(ticks, h.edges, np.arange(len(h.edges))), [f"{t:g}" for t in ticks])
    axis.set_xlim(*_limits(measure, h))
    _dress(axis, measure, values)


def _limits(measure: str, h: Histogram) -> tuple[float, float]:
    """Limits of the bins that are shown, with room beside them."""
    low, high = window(SCALES[measure].kind, [h])
    return low - 1 - (0.2 if h.below else 0.3), high + (0.2 if h.above else 0.3)


def _colours(measure: str, edges: tuple[float, ...], accepted: tuple[float, float] | None) -> list[str]:
    """Colour of every bin: red for invalid cells, orange on the wrong side of the range that Verdict accepts."""
    middle = [-np.inf, *(0.5 * (a + b) for a, b in pairwise(edges)), np.inf]
    better = SCALES[measure].better
    first = _BAD if SCALES[measure].kind == "unit" and better > 0 else _GOOD
    out = [first, *(_GOOD for _ in middle[1:])]
    if accepted is not None:
        poor = [v < accepted[0] if better > 0 else v > accepted[1] for v in middle]
        out = [_POOR if c == _GOOD and p else c for c, p in zip(out, poor, strict=True)]
    return out


def _dress(axis: Any, measure: str, values: Statistics) -> None:
    unit = _NAMES.get(SCALES[measure].kind, "")
    axis.set_title(f"{measure}{f' ({unit})' if unit else ''}", fontsize=10.5, loc="left", color=_INK)
    summary = f"min {values.least:.3g}   median {values.median:.3g}   max {values.largest:.3g}"
    if values.undefined:
        summary += f"   undefined {values.undefined:,}"
    axis.set_xlabel(summary, fontsize=8.5, color=_SOFT)
    axis.tick_params(labelsize=8.5, colors=_SOFT, length=3)
    axis.grid(axis="y", color=_LINE, zorder=0)
    axis.xaxis.set_minor_locator(import_module("matplotlib.ticker").NullLocator())
    axis.yaxis.set_major_locator(import_module("matplotlib.ticker").MaxNLocator(4, integer=True))
    for side in ("top", "right", "left"):
        axis.spines[side].set_visible(False)
    axis.spines["bottom"].set_color(_SOFT)


def _name(axis: Any, kind: TypeQuality) -> None:
    title = f"{kind.type}   {kind.count:,} cells, {kind.invalid:,} invalid"
    title += "" if kind.poor is None else f", {kind.poor:,} poor"
    words = axis.annotate(
        title, (0, 1), (0, 22), xycoords="axes fraction", textcoords="offset points", fontweight="bold", color=_INK
    )
    words.set_in_layout(False)  # it may run over the next chart's column


def _legend(figure: Any) -> None:
    patch = import_module("matplotlib.patches").Patch
    words = {_GOOD: "valid", _POOR: "outside Verdict's range", _BAD: "invalid"}
    handles = [patch(color=colour, label=word) for colour, word in words.items()]
    figure.legend(handles=handles, loc="upper right", ncols=3, frameon=False, fontsize=9, labelcolor=_INK)
