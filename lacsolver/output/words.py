"""Figures of contacts in words: rows that `lacsolver run` prints at its end, and that a report has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite, nan
from typing import Any

import numpy as np

from lacsolver.results.units import NO_UNITS, Units

#: numbers of macro-elements, and ranges with their kinds of unit
_STATES = (("active", "in contact"), ("open", "open"), ("unpaired", "without a master"))
_RANGES = (("pressure", "stress", "pressure"), ("mean gaps", "length", "gap"), ("coverage", "", "coverage"))


def zone_rows(
    zone: Mapping[str, Any], units: Units = NO_UNITS, *, axisymmetric: bool = False
) -> Iterator[tuple[str, str]]:
    """Yield what the figures of a contact or a tie in results.json are, and the figures in words.

    `axisymmetric`: forces are those on a ring, which has no moment.
    """
    if zone.get("why"):
        yield "slave chosen", f"{zone['slave']}, with master {zone['master']}: {zone['why']}"
    if "adjusted" in zone:
        yield "slave nodes adjusted", adjusted_in_words(**zone["adjusted"])
    yield "macro-elements", ", ".join(f"{zone[key]:,} {words}" for key, words in _STATES)
    for words, unit, name in _RANGES:
        low, high, mean = (_number(zone.get(f"{name}_{end}")) for end in ("min", "max", "mean"))
        yield units.label(words, unit), f"{low:.6g} to {high:.6g}" + (f", mean {mean:.6g}" if isfinite(mean) else "")
    yield "contact area", f"{zone['contact_area']:.6g}"
    yield units.label("force on the slave", "force"), force_in_words(zone["resultant"], axisymmetric)
    if not axisymmetric:
        yield units.label("moment on the slave", "moment"), vector_in_words(zone["moment"])
    if "friction" in zone:
        states = f"{zone['sticking']:,} macro-elements stick, {zone['sliding']:,} slide"
        yield "friction", f"{states}; largest slip of the step {_number(zone['slip_max']):.6g}"
        yield units.label("friction on the slave", "force"), force_in_words(zone["friction"], axisymmetric)
    for key, words in (
        ("overlap_at_start", "deepest overlap at the start"),
        ("gap_bridged", "widest gap that the tie bridges"),
    ):
        if (size := _number(zone.get(key))) > 0:
            yield units.label(words, "length"), f"{size:.6g}"


def adjusted_in_words(count: int, largest: float, mean: float) -> str:
    """Describe how far slave nodes were moved onto the master."""
    if not count:
        return "none: all within the distance are on the master"
    return f"{count:,}, by {largest:.4g} at most, {mean:.4g} in the mean"


def force_in_words(force: Any, axisymmetric: bool) -> str:
    """Format a force; that on a ring is along the axis, and its radial part has no resultant, but an integral."""
    if not axisymmetric:
        return vector_in_words(force)
    radial, axial = vector_in_words(force).split(", ")
    return f"axial {axial}; radial integral {radial}"


def vector_in_words(values: Any) -> str:
    """Format a vector or a number; components that are round-off relative to the largest one are shown as 0."""
    values = np.atleast_1d(np.asarray(values, float))
    rounding = 1e-12 * float(np.abs(values).max(initial=0.0))
    return ", ".join(f"{v if abs(v) > rounding else 0.0:.6g}" for v in values)


def _number(value: float | None) -> float:
    """Return a number of results.json, NaN for null."""
    return nan if value is None else value
