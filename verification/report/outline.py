"""Contents of a report, page by page: a summary, then a page for each family with its cases."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from importlib.resources import files
from typing import Any

from verification.families import MODULES, family
from verification.pages import blocks
from verification.pages.blocks import ReportBlock, TableCell, TableRow, figures, prose, sentence, table, title
from verification.pages.charts import COLOURS, Chart, Line, Plot, with_legend
from verification.pages.markup import plain
from verification.pages.pages import Page
from verification.report import convergence, tables, words
from verification.report.judging import Count, counted
from verification.report.tables import grouped
from verification.running.folder import CaseResult, Run

#: plots of a kind that a family's page shows; all are with their cases
EXAMPLES = 6
#: a plot of so few points is joined with those of other cases
_FEW = 12
_MEANING = """\
- **met**, **missed**: the result is within, or beyond, what stands under `must be`, or has no value. \
What the bound is taken from is its source, why it is as wide as it is, or what was missed and why, is its reason.
- **for information**: a result without a bound; its reason says why.
- **no outcome**: the case ended in an error, or was stopped. It counts as one that fell short.
- **h** is the size of the mesh, **rate** the slope of the error from one level to the next, **fitted** the slope of \
all levels, or of the last ones where the reason says so. A triangle in a chart has the slope that is wanted.
- **published**: results of other codes, with where they stand. For comparison; no verdict uses them."""


def outline(run: Run) -> Iterator[Page]:
    """The pages of a report."""
    yield summary_page(run)
    for name, cases in by_family(run.done).items():
        yield family_page(run, name, cases)


def by_family(cases: Iterable[CaseResult]) -> dict[str, list[CaseResult]]:
    """The cases of each family, in the order of the run."""
    return grouped((done.family, done) for done in cases)


def titled(text: str, content: ReportBlock | None, *before: ReportBlock, level: int = 2) -> Iterator[ReportBlock]:
    """A title, what is said before a block, and the block; nothing where there is no block."""
    if content is not None:
        yield from (title(text, level), *before, content)


def title_of(name: str) -> str:
    """The title of a family; its name where the family is not known here."""
    known = _family(name)
    return known.title if known else name.capitalize()


def _family(name: str) -> Any:
    if name not in MODULES:
        return None
    try:
        return family(name)
    except Exception:  # a family that does not load here must not cost the report of its results
        return None


def command(run: Run, family: str = "", case: str = "") -> str:
    """Command line that runs a suite, a family or a case again."""
    which = f" --family {family}" if family else ""
    which += f" --case {case}" if case else ""
    return f"python -m verification run{which} --suite {run.suite}"


def verdict_sentence(run: Run) -> str:
    """Result of a run in three sentences: its size and time, results met, missed, and given for information."""
    n = counted(run.done)
    families = words.count(len(by_family(run.done)), "family")
    start = f"Suite `{run.suite}`: {words.count(n.cases, 'case')} of {families}, {words.seconds(run.seconds)}."
    judged = f"Of {words.count(n.judged, 'judged result')}, {n.met:,} are met and {n.missed:,} missed"
    failed = f"; {words.count(n.failed, 'case')} came to no outcome" if n.failed else ""
    more = f"{words.count(n.informative, 'result')} more {'is' if n.informative == 1 else 'are'} for information"
    return f"{start} {judged}{failed}. {more}."


def facts(n: Count, seconds: float) -> ReportBlock:
    """The numbers to be seen first."""
    share = f"{n.met / n.judged:.1%} of {n.judged:,} judged" if n.judged else "none judged"
    fact = blocks.fact
    return blocks.facts(
        (
            fact("results met", f"{n.met:,}", share, "met" if n.met else ""),
            fact("missed", f"{n.missed:,}", "each with its reason" if n.missed else "", "missed" if n.missed else ""),
            fact("no outcome", f"{n.failed:,}", f"of {words.count(n.cases, 'case')}", "none" if n.failed else ""),
            fact("for information", f"{n.informative:,}", "without a bound"),
            fact("time", words.seconds(seconds)),
        )
    )


def summary_page(run: Run) -> Page:
    """Summary page: results met and missed, reference solutions, and software versions."""
    n = counted(run.done)
    return Page(
        "summary", f"Verification of lacmesh and lacsolver {run.version}", "", n.verdict, tuple(_summary(run, n))
    )


def _summary(run: Run, n: Count) -> Iterator[ReportBlock]:
    nothing = prose("Nothing: every case has an outcome, and every result with a bound is met.")
    compared = prose("What the results are compared with. No expected value was computed by the solver under test.")
    others = prose("Results of other codes for the same problem. Only those with a bound are compared for better.")
    yield prose(verdict_sentence(run))
    yield facts(n, run.seconds)
    yield from titled("Families", families_table(run))
    yield from titled("What fell short", tables.missed(run.done) or nothing)
    yield from titled("Reference solutions", tables.sources(run.done), compared)
    yield from titled("Published results", tables.peers(run.done), others)
    yield from titled("Software", blocks.named_values((name, str(value)) for name, value in run.environment.items()))
    yield blocks.command(command(run))
    yield from titled("How to read it", prose(_MEANING))


def families_table(run: Run, *, verdicts: bool = True) -> ReportBlock:
    """A line for each family; `verdicts`: with what the counts say, in a word."""
    names = ["family", "what", "cases", "met", "missed", "for information", "no outcome", "time", "verdict"]
    rows = [_family_row(name, cases) for name, cases in by_family(run.done).items()]
    if not verdicts:
        names, rows = names[:-1], [row._replace(cells=row.cells[:-1]) for row in rows]
    return table(names, rows, numbers=names[2:8], wide=("what",))


def _family_row(name: str, cases: Sequence[CaseResult]) -> TableRow:
    n = counted(cases)
    counts = map(tables.whole, (n.cases, n.met, n.missed, n.informative, n.failed))
    time = tables.seconds(sum(done.seconds for done in cases))
    return TableRow((TableCell(name, link=name), title_of(name), *counts, time, tables.judged(n.verdict)), n.verdict)


def family_page(run: Run, name: str, cases: Sequence[CaseResult]) -> Page:
    """Page of a family."""
    n = counted(cases)
    short = n.missed + n.failed
    note = f"{short} short" if short else f"{n.met} met" if n.met else f"{n.informative} for information"
    parts = (*_family_page(run, name, cases, n), *(case_section(run, done) for done in cases))
    return Page(name, title_of(name), note, n.verdict, parts)


def _family_page(run: Run, name: str, cases: Sequence[CaseResult], n: Count) -> Iterator[ReportBlock]:
    known = _family(name)
    yield blocks.drawing(drawing(name))
    if known:
        yield prose(known.text)
    yield facts(n, sum(done.seconds for done in cases))
    yield blocks.command(command(run, name))
    yield from titled("What fell short", tables.missed(cases))
    yield from titled("The worst of each quantity", tables.worst(cases))
    yield from _graphs(run, name, cases)
    yield from titled("Published results", tables.published(cases))
    yield from titled("Cases", tables.index(cases))


def drawing(name: str) -> str:
    """The drawing of a family's problem as an <svg> element, without its namespace, which a page has not to name.

    Its classes are those of `problems/style.css`. Empty for a family without a drawing.
    """
    file = files("verification.report") / "problems" / f"{name}.svg"
    if not file.is_file():
        return ""
    lines = file.read_text(encoding="utf-8").replace(' xmlns="http://www.w3.org/2000/svg"', "").splitlines()
    return "".join(line.strip() for line in lines)


def _graphs(run: Run, name: str, cases: Sequence[CaseResult]) -> Iterator[ReportBlock]:
    """Convergence of all cases, pictures, and some plots of each kind."""
    charts = [_common(run, name, f"errors-{k}", chart) for k, chart in enumerate(convergence.charts_of(cases))]
    pictures = [_picture(run, done, k) for done in cases for k in range(len(done.pictures))]
    yield from titled("Against the size of the mesh", figures(charts) if charts else None)
    yield from titled("Pictures", figures(pictures) if pictures else None)
    kinds = grouped((plot.kind, (done, k)) for done in cases for k, plot in enumerate(done.plots))
    for kind, group in kinds.items():
        yield title(kind[:1].upper() + kind[1:])
        yield from _kind(run, name, kind, group)


def _kind(run: Run, name: str, kind: str, group: Sequence[tuple[CaseResult, int]]) -> Iterator[ReportBlock]:
    """Plots of a kind: those of few points joined, of others some."""
    if len(group) > 1 and all(_is_short(done.plots[k]) for done, k in group):
        joined = _joined(kind, group)
        yield figures(_common(run, name, f"{kind}-{k}", chart) for k, chart in enumerate(joined))
        return
    if len(group) > EXAMPLES:
        yield prose(f"{EXAMPLES} of {len(group)}; all of them stand with their cases.")
    spread = [group[round(k * (len(group) - 1) / (EXAMPLES - 1))] for k in range(EXAMPLES)]
    chosen = group if len(group) <= EXAMPLES else list(dict(((d.id, k), (d, k)) for d, k in spread).values())
    yield figures(_drawn(run, done, k, "-example") for done, k in chosen)


def _is_short(plot: Plot) -> bool:
    return len(plot.lines) <= 2 and plot.log_x and all(len(line.x) <= _FEW for line in plot.lines)


def _joined(kind: str, group: Sequence[tuple[CaseResult, int]]) -> Iterator[Chart]:
    """Plots with the same axes, in one."""
    plots = [(done, done.plots[k]) for done, k in group]
    axes = grouped(
        ((plot.x_label, plot.y_label, plot.log_x, plot.log_y), (done.id, _of_case(done, plot, line)))
        for done, plot in plots
        for line in plot.lines
    )
    for (x, y, log_x, log_y), lines in axes.items():
        for start in range(0, len(lines), COLOURS):
            links, part = zip(*lines[start : start + COLOURS], strict=True)
            yield Chart(Plot(kind, f"{y} against {x}", x, y, part, log_x, log_y), links=links)


def _of_case(done: CaseResult, plot: Plot, line: Line) -> Line:
    """A line of a plot, named after the case."""
    return replace(line, label=f"{done.case}: {line.label}" if len(plot.lines) > 1 else done.case)


def _common(run: Run, name: str, which: str, chart: Chart) -> ReportBlock:
    """A chart of several cases."""
    place, again = f"{name}:{'-'.join(which.split())}", command(run, name)
    return blocks.figure(chart.plot.title, with_legend(chart), name=place, source=name, link=name, command=again)


def _drawn(run: Run, done: CaseResult, k: int, more: str = "") -> ReportBlock:
    """A plot of a case."""
    plot = done.plots[k]
    return _figure(run, done, f"plot-{k}{more}", plot.title, with_legend(Chart(plot)))


def _picture(run: Run, done: CaseResult, k: int) -> ReportBlock:
    """A picture of a case; in Markdown its file in the folder of the run."""
    own = done.pictures[k]
    path = run.path / "cases" / done.family / own.file
    line = f"- {plain(done.id)}, {plain(own.title)}: `cases/{done.family}/{own.file}`"
    return _figure(run, done, f"picture-{k}", own.title, blocks.picture(path, own.alt), line)


def _figure(run: Run, done: CaseResult, name: str, heading: str, html: str, markdown: str = "") -> ReportBlock:
    """A figure of a case."""
    return blocks.figure(
        heading, html, markdown,
        name=f"{done.id}:{name}", source=done.id, link=done.id, command=_again(run, done),
    )  # fmt: skip


def _again(run: Run, done: CaseResult) -> str:
    return command(run, done.family, done.case)


def case_section(run: Run, done: CaseResult) -> ReportBlock:
    """Section of a case."""
    n = counted([done])
    counts = ((n.met, "met"), (n.missed, "missed"), (n.informative, "for information"))
    parts = [*(f"{k} {word}" for k, word in counts if k), *(["no outcome"] if n.failed else [])]
    note = ", ".join([*parts, words.seconds(done.seconds)])
    return blocks.section(done.id, done.case, note, n.verdict, _case(run, done))


def _case(run: Run, done: CaseResult) -> Iterator[ReportBlock]:
    yield sentence(done.description)
    if done.failure:
        yield sentence(f"No outcome: {done.failure}", "none")
    levels, memory = words.count(done.levels, "level"), words.memory(done.memory)
    yield prose(f"{levels}, {words.seconds(done.seconds)}, {memory} at most.")
    yield blocks.command(_again(run, done))
    if done.parameters:
        yield blocks.named_values((name, _in_words(value)) for name, value in done.parameters.items())
    if done.results:
        yield tables.results_of(done.results)
    chart = convergence.chart_of(done)
    drawn = [_figure(run, done, "errors", "Errors", with_legend(chart))] if chart else []
    yield from convergence.tables(done.results)
    drawn += [_drawn(run, done, k) for k in range(len(done.plots))]
    if drawn:
        yield figures(drawn)
    if done.pictures:
        links = enumerate(done.pictures)
        yield table(
            ("picture",), [TableRow((TableCell(own.title, link=f"{done.id}:picture-{k}"),)) for k, own in links]
        )
    others = tables.published([done], with_case=False)
    if others:
        yield others


def _in_words(value: Any) -> str:
    """Format a value of a problem's definition for reading."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_in_words(own)}" for name, own in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(_in_words(own) for own in value)
    return words.number(value) if isinstance(value, float) else str(value)
