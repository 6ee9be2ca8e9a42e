"""Histograms of the quality of a mesh: drawn by matplotlib, and a bar of them in characters."""

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
from lacmesh.quality.summary import Quality, TypeQuality

_INK, _GOOD, _POOR, _BAD = "#1d2733", "#2563b8", "#e0982c", "#b3261e"
#: measures drawn for a type: the one that ranks it, then the first of each of these that it has
_BESIDE = (("validity",), ("edge_ratio",), ("min_dihedral", "min_angle", "min_corner_angle"))
_TICKS = {"ratio": (1, 2, 5, 10, 20, 50, 100), "angle": tuple(range(0, 181, 30)), "unit": (0, 0.25, 0.5, 0.75, 1)}


def plot_quality(quality: Quality, path: str | os.PathLike[str], *, title: str = "", force: bool = True) -> None:
    """Draw the quality of a mesh into a .png, a row for each cell type: invalid cells red, poor ones orange.

    Raises RequestError where matplotlib is missing or nothing was measured, WriteError.
    """
    path = Path(path)
    check_plot(path, force=force)
    types = [t for t in quality.types if primary_metric(t.type) not in (None, "validity")]
    if not types:
        raise RequestError("there is no surface or solid cell to draw the quality of")
    figure = import_module("matplotlib.figure").Figure((13, 1.0 + 2.5 * len(types)), dpi=110, layout="constrained")
    axes = figure.subplots(len(types), 1 + len(_BESIDE), squeeze=False)
    for row, kind in zip(axes, types, strict=True):
        beside = [next((m for m in names if m in kind.measures), None) for names in _BESIDE]
        for axis, measure in zip(row, [primary_metric(kind.type), *beside], strict=True):
            _draw(axis, kind, measure)
        poor = "" if kind.poor is None else f", {kind.poor:,} poor"
        row[0].set_ylabel(f"{kind.type}: {kind.count:,} cells,\n{kind.invalid:,} invalid{poor}", color=_INK)
    figure.suptitle(title or "Quality", fontsize=14, fontweight="bold", color=_INK)
    patch = import_module("matplotlib.patches").Patch
    words = {_GOOD: "valid", _POOR: "outside Verdict's range", _BAD: "invalid"}
    handles = [patch(color=colour, label=word) for colour, word in words.items()]
    figure.legend(handles=handles, loc="outside lower right", ncols=3, frameon=False, fontsize=9)
    image = io.BytesIO()
    figure.savefig(image, format="png")
    replace_file(path, image.getvalue())


def check_plot(path: Path, *, force: bool = True) -> None:
    """Check early that the plot can be drawn and written. Raises RequestError, WriteError."""
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a plot is written as .png")
    check_place(path, force=force)
    check_installed("matplotlib", "view", "a plot")


def _draw(axis: Any, kind: TypeQuality, measure: str | None) -> None:
    """Draw one histogram; the bins of a measure are equally wide on the page, whatever their range."""
    if measure is None:
        axis.set_visible(False)
        return
    values, (scale, better) = kind.measures[measure], SCALES[measure]
    h, accepted = values.histogram, ACCEPTED.get(kind.type, {}).get(measure)
    counts = np.array([h.below, *h.counts, h.above])
    middle = [-np.inf, *(0.5 * (a + b) for a, b in pairwise(h.edges)), np.inf]
    colours = [_GOOD] * len(counts)
    if accepted is not None:
        poor = [v < accepted[0] if better > 0 else v > accepted[1] for v in middle]
        colours = [_POOR if bad else _GOOD for bad in poor]
    if scale == "unit" and better > 0:
        colours[0] = _BAD
    axis.bar(np.arange(-1, len(h.counts) + 1) + 0.5, counts, width=0.92, color=colours)
    axis.set_xticks(np.interp(_TICKS[scale], h.edges, np.arange(len(h.edges))), [f"{t:g}" for t in _TICKS[scale]])
    axis.set_xlim(-1.3 if h.below else -0.3, len(h.counts) + (1.3 if h.above else 0.3))
    axis.set_title(f"{measure}{' (degrees)' if scale == 'angle' else ''}", fontsize=10.5, loc="left", color=_INK)
    undefined = f"   undefined {values.undefined:,}" if values.undefined else ""
    summary = f"min {values.least:.3g}   median {values.median:.3g}   max {values.largest:.3g}{undefined}"
    axis.set_xlabel(summary, fontsize=8.5)
    axis.tick_params(labelsize=8.5, length=3)
    axis.spines[["top", "right", "left"]].set_visible(False)
