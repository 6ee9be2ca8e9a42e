"""Report as Markdown: tables, and histograms drawn in characters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lacmesh.quality.statistics import Histogram
from lacmesh.report.outline import Bars, Charts, Facts, ReportBlock, Table, Text, Title

_EIGHTHS = " ▏▎▍▌▋▊▉"
_WIDTH = 24


def markdown(blocks: Iterable[ReportBlock], footer: str) -> str:
    """The blocks of `outline` as Markdown."""
    return "\n\n".join([*("\n".join(_block(block)) for block in blocks), footer]) + "\n"


def _block(block: ReportBlock) -> Iterator[str]:
    match block:
        case Title():
            yield f"{'#' * block.level} {_plain(block.text)}"
        case Text():
            yield f"**{_plain(block.lead)}**: {_plain(block.text)}" if block.lead else _plain(block.text)
        case Facts():
            yield from _table(Table(("", "", ""), tuple((f.label, f.value, f.note) for f in block.facts), (False,) * 3))
        case Table():
            if block.folded:
                yield f"**{_plain(block.folded)}**"
                yield ""
            yield from _table(block)
        case Charts():
            yield "```text"
            for chart in block.charts:
                yield from _chart(chart)
            yield "```"


def _plain(text: str) -> str:
    for sign in "\\`*_<>[]|":
        text = text.replace(sign, "\\" + sign)
    return text.replace("\n", " ")


def _table(table: Table) -> Iterator[str]:
    yield f"| {' | '.join(_plain(name) for name in table.columns)} |"
    yield f"|{'|'.join('---:' if right else '---' for right in table.right)}|"
    yield from (f"| {' | '.join(_plain(value) for value in row)} |" for row in table.rows)


def _chart(chart: Bars) -> Iterator[str]:
    yield chart.measure
    histograms = [h for h in (chart.before, chart.after) if h is not None]
    rows = [lines(h) for h in histograms]
    seen = [k for k in range(len(rows[0])) if any(r[k][1] for r in rows)]
    if not seen:
        yield "  (no cell has it)"
        return
    if len(rows) == 2:
        yield f"  {'':16} {'before':{_WIDTH + 9}} after"
    for k in range(seen[0], seen[-1] + 1):
        cells = " ".join(f"{bar(r[k][1], sum(c for _, c in r)):{_WIDTH}} {r[k][1]:8,}" for r in rows)
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


def bar(count: int, total: int, width: int = _WIDTH) -> str:
    """Bar as long as the share of `count` in `total`; any count above 0 is visible.

    >>> bar(1, 4, 8), bar(1, 10**6), bar(0, 4)
    ('██', '▏', '')
    """
    eighths = round(8 * width * count / max(total, 1))
    if count and not eighths:
        eighths = 1
    return "█" * (eighths // 8) + _EIGHTHS[eighths % 8].strip()
