"""Statistics of the values of one measure: extremes, percentiles, mean, and a histogram on fixed bins.

The bins depend on the measure only, so that histograms of two meshes, or of one before and after its cut, can be
compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacmesh.quality.measures import SCALES

#: Verdict's infinity, also where a measure divides by zero
LARGEST = 1e30
#: percentiles that statistics hold
PERCENTS = (1, 5, 50, 95, 99)
_EDGES: Mapping[str, NDArray] = {
    "unit": np.linspace(0, 1, 21),
    "ratio": 10 ** (np.arange(21) / 10),
    "angle": np.linspace(0, 180, 37),
}
_BINS = 20


@dataclass(frozen=True)
class Histogram:
    """Histogram: `counts` (b,) between `edges` (b + 1,), the last bin closed; `below`, `above`: counts outside."""

    edges: tuple[float, ...]
    counts: tuple[int, ...]
    below: int
    above: int


@dataclass(frozen=True)
class Statistics:
    """Statistics of `count` values: extremes, percentiles (1, 5, 50, 95, 99), mean, histogram.

    The `undefined` values are left out of these: NaN, and the value that Verdict writes as 1e30, for a cell so flat
    that the measure divides by zero. `outside` counts the values beyond the range that Verdict accepts, undefined ones
    included; None if Verdict names no range.
    """

    count: int
    undefined: int
    outside: int | None
    least: float
    percentiles: tuple[float, ...]
    mean: float
    largest: float
    histogram: Histogram

    @property
    def median(self) -> float:
        """The value that half of the cells do not exceed."""
        return self.percentiles[PERCENTS.index(50)]

    def as_json(self) -> dict[str, Any]:
        """Return the statistics as plain data; None for a value that does not exist."""
        out: dict[str, Any] = {"count": self.count, "undefined": self.undefined, "outside_range": self.outside}
        out |= {"min": _plain(self.least)}
        out |= {f"p{p}": _plain(v) for p, v in zip(PERCENTS, self.percentiles, strict=True)}
        out |= {"mean": _plain(self.mean), "max": _plain(self.largest)}
        return out | {"histogram": asdict(self.histogram)}


def _plain(value: float) -> float | None:
    return None if np.isnan(value) else value


def statistics(measure: str, values: Floats, accepted: tuple[float, float] | None = None) -> Statistics:
    """Compute the statistics of the values (k,) of a measure; `accepted`: the range that Verdict accepts.

    >>> s = statistics("skew", np.array([0.0, 0.1, 0.2, 0.9]), (0, 0.5))
    >>> s.count, s.outside, round(s.median, 3), s.histogram.counts[2]
    (4, 1, 0.15, 1)
    """
    good = values[np.abs(values) < LARGEST]  # NaN is not
    outside = None
    if accepted is not None:
        slack = 1e-9 * max(abs(a) for a in accepted if np.isfinite(a)) + 1e-12  # an ideal cell is not outside
        outside = int(np.count_nonzero(~((values >= accepted[0] - slack) & (values <= accepted[1] + slack))))
    if not len(good):
        nothing = float("nan")
        empty = (nothing,) * len(PERCENTS)
        return Statistics(0, len(values), outside, nothing, empty, nothing, nothing, histogram(measure, good))
    return Statistics(
        count=len(good),
        undefined=len(values) - len(good),
        outside=outside,
        least=float(good.min()),
        percentiles=tuple(np.percentile(good, PERCENTS).tolist()),
        mean=float(good.mean()),
        largest=float(good.max()),
        histogram=histogram(measure, good),
    )


def histogram(measure: str, values: Floats) -> Histogram:
    """Make the histogram of the values (k,) of a measure, on the bins of its kind."""
    edges = _EDGES.get(SCALES[measure].kind)
    if edges is None:
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        edges = np.linspace(low, high if high > low else low + 1, _BINS + 1)
    slack = 1e-9 * np.diff(edges)  # round-off does not put an ideal cell outside
    starts = [edges[0] - slack[0], *(edges[1:-1] - slack[1:])]
    below = [int(np.count_nonzero(values < edge)) for edge in starts]
    below.append(int(np.count_nonzero(values <= edges[-1] + slack[-1])))
    return Histogram(tuple(edges.tolist()), tuple(np.diff(below).tolist()), below[0], len(values) - below[-1])
