"""Charts as SVG, drawn line by line: no library, so that a report of hundreds of them stays light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from verification.pages.markup import identifier

Array: TypeAlias = NDArray[np.float64]
WIDTH, HEIGHT = 440, 290
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 430, 10, 246
#: number of lines in one chart that can be told apart
COLOURS = 8
#: outlines of marks, drawn from their centre
_MARKS = ("m-3.4 0a3.4 3.4 0 1 0 6.8 0a3.4 3.4 0 1 0-6.8 0z", "m-3 -3h6v6h-6z", "m-3.6 2.6h7.2l-3.6-6.2z",
          "m-4 0l4-4l4 4l-4 4z")  # fmt: skip
#: span of values that are one, relative to the largest: of values, and of logarithms
_LEVEL, _LEVEL_LOG = 1e-6, 1e-12
#: of a line with more points, marks are dots
_MANY = 40
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Line:
    """A line of a plot. `style`: `line` (an exact solution), `points`, `both`, `steps` (constant between its x)."""

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    style: Literal["line", "points", "both", "steps"] = "both"


@dataclass(frozen=True)
class Plot:
    """Lines to draw. `kind`: what a report groups plots by, such as `pressure`, `Newton`, `inf-sup`."""

    kind: str
    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    log_x: bool = False
    log_y: bool = False


@dataclass(frozen=True)
class Chart:
    """A plot to draw. `slopes`: of triangles drawn beside the lines; `links`: the ids that the lines lead to."""

    plot: Plot
    slopes: tuple[float, ...] = ()
    links: tuple[str, ...] = ()


@dataclass(frozen=True)
class Axis:
    """From values to places: `low` and `high` (of the logarithm where `log`) lie at `start` and `end`."""

    low: float
    high: float
    start: float
    end: float
    log: bool

    def at(self, values: Sequence[float] | Array) -> Array:
        """Positions of values on the axis; NaN where there is none."""
        scaled = scale(np.asarray(values, dtype=float), self.log)
        return self.start + (scaled - self.low) / (self.high - self.low) * (self.end - self.start)

    def ticks(self) -> list[tuple[float, str]]:
        """Values to name, and their names."""
        if not self.log:
            return _named(steps(self.low, self.high))
        decades = range(math.ceil(self.low - 1e-9), math.floor(self.high + 1e-9) + 1)
        if len(decades) > 2:
            every = math.ceil(len(decades) / 6)
            return [(10.0**k, _power(k)) for k in decades if k % every == 0]
        fine = [m * 10.0**k for k in range(math.floor(self.low), math.ceil(self.high) + 1) for m in (1, 2, 5)]
        inside = [v for v in fine if self.low - 1e-9 <= math.log10(v) <= self.high + 1e-9]
        if len(inside) < 2:
            inside = [v for v in steps(10**self.low, 10**self.high) if v > 0]
        return _named(inside)


def scale(values: Array, log: bool) -> Array:
    """Transform values to an axis' scale: NaN where a logarithm does not exist."""
    finite = np.where(np.isfinite(values), values, np.nan)
    return np.log10(np.where(finite > 0, finite, np.nan)) if log else finite


def steps(low: float, high: float) -> list[float]:
    """Round values within a range, about five.

    >>> steps(0, 1)
    [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    """
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(m for m in (1, 2, 2.5, 5, 10) if m * power >= rough * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [float(f"{k * step:.12g}") for k in range(first, math.floor(high / step + 1e-9) + 1)]


def with_legend(chart: Chart) -> str:
    """A chart as an <svg> element, and below it the names of its lines."""
    lines = chart.plot.lines
    links = chart.links or ("",) * len(lines)
    named = zip(lines, ranks(lines), links, strict=True)
    legend = "".join(f"<li>{_named_line(line, rank, link)}</li>" for line, rank, link in named if line.label)
    return f'{svg(chart)}<ul class="legend">{legend}</ul>'


def _named_line(line: Line, rank: int, link: str) -> str:
    label = escape(line.label, quote=False)
    return swatch(line, rank) + (f'<a href="#{identifier(link)}">{label}</a>' if link else label)


def svg(chart: Chart) -> str:
    """A chart as an <svg> element."""
    plot = chart.plot
    xs, ys = _scaled(plot)
    label = escape(f"{plot.title}: {plot.y_label} against {plot.x_label}", quote=True)
    start = f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label}">'
    if not len(xs):
        return f'{start}<text class="tick" x="{WIDTH / 2}" y="{HEIGHT / 2}" text-anchor="middle">no value</text></svg>'
    corners = [c for k, slope in enumerate(chart.slopes) if (c := _triangle(plot, slope, k)) is not None]
    x = _axis(xs, plot.log_x, _LEFT, _RIGHT)
    y = _axis(np.concatenate([ys, *(c[:, 1] for c in corners)]), plot.log_y, _BOTTOM, _TOP)
    parts = [_frame(x, y, plot)]
    parts += [_slope(x, y, c, slope) for c, slope in zip(corners, chart.slopes, strict=False)]
    parts += [_line(x, y, line, k) for k, line in zip(ranks(plot.lines), plot.lines, strict=True)]
    return f"{start}{''.join(parts)}</svg>"


def ranks(lines: Sequence[Line]) -> list[int]:
    """The colour of each line: -1 of the first exact solution, which is drawn in ink."""
    styles = [line.style for line in lines]
    exact = styles.index("line") if "line" in styles else len(lines)
    return [-1 if k == exact else k - (k > exact) for k in range(len(lines))]


def swatch(line: Line, rank: int) -> str:
    """Sample of a line for the legend."""
    drawn = "" if line.style == "points" else '<path class="stroke" d="M1 6H25"/>'
    marked = f'<path class="{_mark_class(rank)}" d="M13 6{_mark(rank)}"/>' if line.style in ("points", "both") else ""
    return f'<svg class="swatch {_class(rank)}" viewBox="0 0 26 12" aria-hidden="true">{drawn}{marked}</svg>'


def _scaled(plot: Plot) -> tuple[Array, Array]:
    """All points that can be drawn, as the axes have them."""
    xs, ys = [np.empty(0)], [np.empty(0)]
    for line in plot.lines:
        n = min(len(line.x), len(line.y))
        x, y = scale(np.array(line.x[:n]), plot.log_x), scale(np.array(line.y[:n]), plot.log_y)
        seen = ~(np.isnan(x) | np.isnan(y))
        xs.append(x[seen])
        ys.append(y[seen])
        if line.style == "steps" and len(line.x) > n:
            xs.append(scale(np.array(line.x[n:]), plot.log_x))
    return np.concatenate(xs), np.concatenate(ys)


def _axis(values: Array, log: bool, start: float, end: float) -> Axis:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if high - low <= (_LEVEL_LOG if log else _LEVEL) * max(abs(low), abs(high), 1e-300):
        room = 0.5 if log else abs(low) * 0.1 or 1.0
        return Axis(low - room, high + room, start, end, log)
    room = (high - low) * 0.05
    return Axis(low - room, high + room, start, end, log)


def _named(values: list[float]) -> list[tuple[float, str]]:
    """Values and their names, with as many digits as tell them apart."""
    digits = next(d for d in range(4, 18) if d == 17 or len({_name(v, d) for v in values}) == len(values))
    return [(v, _name(v, digits)) for v in values]


def _name(value: float, digits: int = 4) -> str:
    return "0" if value == 0 else f"{value:.{digits}g}"


def _power(k: int) -> str:
    return _name(10.0**k) if -3 < k < 4 else f"10{str(k).translate(_SUPERSCRIPTS)}"


def _frame(x: Axis, y: Axis, plot: Plot) -> str:
    """The grid, names of its lines, and of the axes."""
    across, down, names = [], [], []
    for value, name in y.ticks():
        place = float(y.at([value])[0])
        across.append(f"M{_LEFT} {place:.1f}H{_RIGHT}")
        names.append(f'<text class="tick" x="{_LEFT - 6}" y="{place + 3.8:.1f}" text-anchor="end">{name}</text>')
    for value, name in x.ticks():
        place = float(x.at([value])[0])
        down.append(f"M{place:.1f} {_TOP}V{_BOTTOM}")
        names.append(f'<text class="tick" x="{place:.1f}" y="{_BOTTOM + 15}" text-anchor="middle">{name}</text>')
    middle = (_LEFT + _RIGHT) / 2, (_TOP + _BOTTOM) / 2
    return (
        f'<path class="grid" d="{"".join(across + down)}"/><path class="frame" d="M{_LEFT} {_TOP}V{_BOTTOM}H{_RIGHT}"/>'
        f'{"".join(names)}<text class="label" x="{middle[0]}" y="{HEIGHT - 8}" text-anchor="middle">'
        f'{escape(plot.x_label)}</text><text class="label" transform="translate(14 {middle[1]}) rotate(-90)" '
        f'text-anchor="middle">{escape(plot.y_label)}</text>'
    )


def _line(x: Axis, y: Axis, line: Line, rank: int) -> str:
    px, py = _places(x, y, line)
    drawn = "" if line.style == "points" else f'<path class="stroke" d="{_path(px, py)}"/>'
    marked = ""
    if line.style in ("points", "both"):
        seen = ~(np.isnan(px) | np.isnan(py))
        mark = "h0" if seen.sum() > _MANY else _mark(rank)
        d = "".join(f"M{a:.1f} {b:.1f}{mark}" for a, b in zip(px[seen], py[seen], strict=True))
        marked = f'<path class="{"dots" if mark == "h0" else _mark_class(rank)}" d="{d}"/>'
    return f'<g class="{_class(rank)}">{drawn}{marked}<title>{escape(line.label)}</title></g>'


def _places(x: Axis, y: Axis, line: Line) -> tuple[Array, Array]:
    """Positions of a line's points in the chart; a line of steps holds each value until the next position."""
    n = min(len(line.x), len(line.y))
    if line.style != "steps":
        return _thinned(x.at(line.x[:n]), y.at(line.y[:n]))
    ends = line.x if len(line.x) > n else (*line.x[:n], line.x[n - 1])
    return np.repeat(x.at(ends[: n + 1]), 2)[1:-1], np.repeat(y.at(line.y[:n]), 2)


def _thinned(px: Array, py: Array) -> tuple[Array, Array]:
    """Drop points that cannot be seen: nearer than half a unit to the one before."""
    if len(px) < 200:
        return px, py
    step = np.floor(np.nan_to_num(np.cumsum(np.hypot(np.diff(px, prepend=px[0]), np.diff(py, prepend=py[0])))) / 0.5)
    kept = np.r_[True, np.diff(step) > 0] | np.isnan(px) | np.isnan(py)
    kept[-1] = True
    return px[kept], py[kept]


def _path(px: Array, py: Array) -> str:
    """A path through the places, broken where there is none."""
    out, pen = [], "M"
    for a, b in zip(px.tolist(), py.tolist(), strict=True):
        if math.isnan(a) or math.isnan(b):
            pen = "M"
            continue
        out.append(f"{pen}{a:.1f} {b:.1f}")
        pen = "L"
    return "".join(out)


def _triangle(plot: Plot, slope: float, rank: int) -> Array | None:
    """(3, 2), in logarithms: the ends of a slope and its corner, below all lines, the first at the right end.

    None where there is no room.
    """
    if not (plot.log_x and plot.log_y):
        return None
    xs, ys = _scaled(plot)
    width = float(np.ptp(xs))
    if width == 0 or slope <= 0:
        return None
    right = xs.max() - (0.06 + 0.36 * rank) * width
    left = right - 0.26 * width
    at = np.linspace(left, right, 9)
    lines = [_logs(plot, line) for line in plot.lines]
    below = [np.interp(at, *line, left=np.nan, right=np.nan) for line in lines if len(line[0]) > 1]
    room = 0.06 * max(float(np.ptp(ys)), 0.5)
    floor = float(np.nanmin([b - slope * at for b in below], initial=float(ys.max()))) - room
    low, high = slope * left + floor, slope * right + floor
    return np.array([[left, low], [right, high], [right, low]])


def _logs(plot: Plot, line: Line) -> tuple[Array, Array]:
    """The points of a line, from the left."""
    n = min(len(line.x), len(line.y))
    x, y = scale(np.array(line.x[:n]), True), scale(np.array(line.y[:n]), True)
    seen = ~(np.isnan(x) | np.isnan(y))
    order = np.argsort(x[seen])
    return x[seen][order], y[seen][order]


def _slope(x: Axis, y: Axis, corners: Array, slope: float) -> str:
    px, py = x.at(10.0 ** corners[:, 0]), y.at(10.0 ** corners[:, 1])
    (a, b, c), (d, e, f) = px, py
    return (
        f'<path class="slope" d="M{a:.1f} {d:.1f}L{b:.1f} {e:.1f}L{c:.1f} {f:.1f}Z"/>'
        f'<text class="tick" x="{b + 5:.1f}" y="{(e + f) / 2 + 4:.1f}">{slope:.3g}</text>'
        f'<text class="tick" x="{(a + c) / 2:.1f}" y="{min(f + 12, _BOTTOM - 2):.1f}" text-anchor="middle">1</text>'
    )


def _class(rank: int) -> str:
    return "exact" if rank < 0 else f"c{rank % COLOURS}"


def _mark(rank: int) -> str:
    return _MARKS[rank % len(_MARKS)]


def _mark_class(rank: int) -> str:
    """Marks of a second round of colours are hollow."""
    return "hollow" if rank >= COLOURS else "mark"
