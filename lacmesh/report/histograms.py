"""Histograms of cells before and after a cut: as SVG, drawn line by line without a library, and in characters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from lacmesh.quality.statistics import Histogram
from lacmesh.report.blocks import ReportBlock, figure, figures

#: legend of histograms on a page
_KEY = '<p class="key"><i class="before"></i>before<i class="after"></i>after; share of the cells</p>'
WIDTH, HEIGHT = 340, 168
_LEFT, _RIGHT, _TOP, _BOTTOM = 40, 10, 8, 34
_EIGHTHS = " ▏▎▍▌▋▊▉"
_BAR = 24
_TICKS: dict[str, Sequence[float]] = {
    "unit": (0, 0.2, 0.4, 0.6, 0.8, 1),
    "ratio": (1, 2, 5, 10, 20, 50, 100),
    "angle": range(0, 181, 30),
}


class Bars(NamedTuple):
    """A measure of cells and its histograms: before a cut, where there was one, and after it.

    `scale`: what its values are: `unit` (0 to 1), `ratio` or `angle`.
    """

    measure: str
    scale: str
    histograms: tuple[Histogram, ...]


def block(charts: Iterable[Bars]) -> ReportBlock:
    """Several histograms side by side, with a legend above them; in Markdown in characters."""
    charts = tuple(charts)
    html = figures(figure(chart.measure, svg(chart)) for chart in charts).html
    return ReportBlock(f"{_KEY}\n{html}", "\n".join(["```text", *map(text, charts), "```"]))


def svg(chart: Bars) -> str:
    """A chart: the share of the cells in each bin, before and after side by side, as an <svg> element."""
    first = chart.histograms[0]
    words = [word for word, _ in lines(first)]
    low, high = window(chart.scale, chart.histograms)
    shares = [_shares(h, low, high) for h in chart.histograms]
    top = _round_up(max(float(s.max(initial=0)) for s in shares))
    bins = len(shares[0])
    width = (WIDTH - _LEFT - _RIGHT) / bins
    height = HEIGHT - _TOP - _BOTTOM
    parts = [_frame(top, height)]
    for which, share in enumerate(shares):
        name = "before" if len(shares) == 2 and which == 0 else "after"
        slot = width * 0.86 / len(shares)
        for k in np.flatnonzero(share > 0).tolist():
            tall = max(float(share[k]) / top * height, 0.8)
            x = _LEFT + k * width + 0.07 * width + which * slot
            y = _TOP + height - tall
            title = f"{name}: {share[k]:.1%}, {words[k + low]}"
            parts.append(
                f'<rect class="{name}" x="{x:.1f}" y="{y:.1f}" width="{slot:.1f}" height="{tall:.1f}">'
                f"<title>{escape(title)}</title></rect>"
            )
    parts.append(_axis(chart, first, low, bins, width, _TOP + height))
    start = f'<svg class="histogram" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(chart.measure)}">'
    return f"{start}{''.join(parts)}</svg>"


def outer(h: Histogram) -> np.ndarray:
    """Counts of all bins, with what lies below the first and above the last."""
    return np.array([h.below, *h.counts, h.above])


def window(scale: str, histograms: Sequence[Histogram]) -> tuple[int, int]:
    """First and last bin to show, of those that `outer` counts; of ratios and angles only those in use."""
    used = np.flatnonzero(np.sum([outer(h) for h in histograms], axis=0))
    last = len(histograms[0].counts) + 1
    low = 0 if len(used) and used[0] == 0 else 1
    high = last if len(used) and used[-1] == last else last - 1
    if scale == "ratio":
        high = max(int(used.max(initial=1)), 10)
    elif scale == "angle" and used.max(initial=1) <= (last - 1) // 2:
        high = (last - 1) // 2
    return low, high


def _shares(h: Histogram, low: int, high: int) -> np.ndarray:
    counts = outer(h)
    return counts[low : high + 1] / max(int(counts.sum()), 1)


def _round_up(share: float) -> float:
    """Upper end of the axis for a largest share."""
    return next(step for step in (0.06, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.01) if share <= step)


def _frame(top: float, height: float) -> str:
    """Lines across at half and full height."""
    out = []
    for part in (0, 0.5, 1):
        y = _TOP + height * (1 - part)
        out.append(f'<line class="grid" x1="{_LEFT}" x2="{WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        out.append(
            f'<text class="tick" x="{_LEFT - 5}" y="{y + 3.5:.1f}" text-anchor="end">{100 * top * part:.3g} %</text>'
        )
    return "".join(out)


def _axis(chart: Bars, h: Histogram, low: int, bins: int, width: float, y: float) -> str:
    """Ticks of the bins, and words under what lies outside them."""
    out = []
    edges = np.array(h.edges)
    for value in _TICKS.get(chart.scale, edges[[0, -1]].tolist()):
        place = float(np.interp(value, edges, np.arange(len(edges)))) + 1 - low
        if 0 <= place <= bins:
            x = _LEFT + place * width
            out.append(f'<line class="notch" x1="{x:.1f}" x2="{x:.1f}" y1="{y:.1f}" y2="{y + 4:.1f}"/>')
            out.append(f'<text class="tick" x="{x:.1f}" y="{y + 15:.1f}" text-anchor="middle">{value:.3g}</text>')
    if low == 0:
        out.append(f'<text class="tick" x="{_LEFT + width / 2:.1f}" y="{y + 28:.1f}" text-anchor="middle">below</text>')
    if low + bins > len(h.counts) + 1:
        x = _LEFT + (bins - 0.5) * width
        out.append(f'<text class="tick" x="{x:.1f}" y="{y + 28:.1f}" text-anchor="middle">above</text>')
    return "".join(out)


def text(chart: Bars) -> str:
    """A chart in characters: a line for each bin, before and after side by side."""
    return "\n".join(_text_lines(chart))


def _text_lines(chart: Bars) -> Iterator[str]:
    yield chart.measure
    rows = [lines(h) for h in chart.histograms]
    used = [k for k in range(len(rows[0])) if any(r[k][1] for r in rows)]
    if not used:
        yield "  (no cell has it)"
        return
    if len(rows) == 2:
        yield f"  {'':16} {'before':{_BAR + 9}} after"
    for k in range(used[0], used[-1] + 1):
        cells = " ".join(f"{bar(r[k][1], sum(c for _, c in r)):{_BAR}} {r[k][1]:8,}" for r in rows)
        yield f"  {rows[0][k][0]:16} {cells}".rstrip()
    yield ""


def lines(h: Histogram) -> list[tuple[str, int]]:
    """Range and count of every bin, with those below and above the bins first and last.

    >>> lines(Histogram((0.0, 0.5, 1.0), (1, 2), 0, 3))
    [('below 0', 0), ('0 to 0.5', 1), ('0.5 to 1', 2), ('above 1', 3)]
    """
    words = [f"{low:.3g} to {high:.3g}" for low, high in zip(h.edges, h.edges[1:], strict=False)]
    names = [f"below {h.edges[0]:.3g}", *words, f"above {h.edges[-1]:.3g}"]
    return list(zip(names, (h.below, *h.counts, h.above), strict=True))


def bar(count: int, total: int, width: int = _BAR) -> str:
    """Bar as long as the share of `count` in `total`; any count above 0 is visible.

    >>> bar(1, 4, 8), bar(1, 10**6), bar(0, 4)
    ('██', '▏', '')
    """
    eighths = round(8 * width * count / max(total, 1))
    if count and not eighths:
        eighths = 1
    return "█" * (eighths // 8) + _EIGHTHS[eighths % 8].strip()
