"""Contents of a report, page by page: a summary, then a page for each family with its cases."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from lacmesh.report.blocks import (
    Chart,
    Column,
    Command,
    Drawing,
    Fact,
    Facts,
    Figure,
    Figures,
    Image,
    Line,
    NamedValues,
    Page,
    Plot,
    Section,
    Simple,
    Table,
    TableCell,
    TableRow,
    Text,
    Title,
    columns,
)
from lacmesh.report.charts import COLOURS
from verification.families import MODULES, family
from verification.report import convergence, tables, words
from verification.report.drawings import drawing
from verification.report.judging import Count, counted
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
    groups: dict[str, list[CaseResult]] = {}
    for done in cases:
        groups.setdefault(done.family, []).append(done)
    return groups


def title_of(name: str) -> str:
    """The title of a family; its name where the family is not known here."""
    found = _family(name)
    return found.title if found else name.capitalize()


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


def facts(n: Count, seconds: float) -> Facts:
    """The numbers to be seen first."""
    share = f"{n.met / n.judged:.1%} of {n.judged:,} judged" if n.judged else "none judged"
    found = [
        Fact("results met", f"{n.met:,}", share, "met" if n.met else ""),
        Fact("missed", f"{n.missed:,}", "each with its reason" if n.missed else "", "missed" if n.missed else ""),
        Fact("no outcome", f"{n.failed:,}", f"of {words.count(n.cases, 'case')}", "none" if n.failed else ""),
        Fact("for information", f"{n.informative:,}", "without a bound"),
        Fact("time", words.seconds(seconds)),
    ]
    return Facts(tuple(found))


def summary_page(run: Run) -> Page:
    """Summary page: results met and missed, reference solutions, and software versions."""
    n = counted(run.done)
    return Page(
        "summary", f"Verification of lacmesh and lacsolver {run.version}", "", n.verdict, tuple(_summary(run, n))
    )


def _summary(run: Run, n: Count) -> Iterator[Simple]:
    yield Text(verdict_sentence(run))
    yield facts(n, run.seconds)
    yield Title("Families")
    yield families_table(run)
    yield Title("What fell short")
    short = tables.missed(run.done)
    yield short if short.rows else Text("Nothing: every case has an outcome, and every result with a bound is met.")
    yield Title("Reference solutions")
    yield Text("What the results are compared with. No expected value was computed by the solver under test.")
    yield tables.sources(run.done)
    others = tables.peers(run.done)
    if others.rows:
        yield Title("Published results")
        yield Text("Results of other codes for the same problem. Only those with a bound are compared for better.")
        yield others
    yield Title("Software")
    yield NamedValues(tuple((name, str(value)) for name, value in run.environment.items()))
    yield Command(command(run))
    yield Title("How to read it")
    yield Text(_MEANING)


def families_table(run: Run) -> Table:
    """A line for each family."""
    names = ("family", "what", "cases", "met", "missed", "for information", "no outcome", "time", "verdict")
    heads = columns(names, numbers=("cases", "met", "missed", "for information", "no outcome", "time"), wide=("what",))
    return Table(heads, tuple(_family_row(name, cases) for name, cases in by_family(run.done).items()))


def _family_row(name: str, cases: Sequence[CaseResult]) -> TableRow:
    n, time = counted(cases), sum(done.seconds for done in cases)
    counts = (TableCell(f"{k:,}", k) for k in (n.cases, n.met, n.missed, n.informative, n.failed))
    ends = TableCell(words.seconds(time), time), tables.judged(n.verdict)
    return TableRow.of((TableCell(name, link=name), title_of(name), *counts, *ends), n.verdict)


def family_page(run: Run, name: str, cases: Sequence[CaseResult]) -> Page:
    """Page of a family."""
    n = counted(cases)
    short = n.missed + n.failed
    note = f"{short} short" if short else f"{n.met} met" if n.met else f"{n.informative} for information"
    parts = (*_family_page(run, name, cases, n), *(case_section(run, done) for done in cases))
    return Page(name, title_of(name), note, n.verdict, parts)


def _family_page(run: Run, name: str, cases: Sequence[CaseResult], n: Count) -> Iterator[Simple]:
    found = _family(name)
    yield Drawing(drawing(name))
    if found:
        yield Text(found.text)
    yield facts(n, sum(done.seconds for done in cases))
    yield Command(command(run, name))
    short = tables.missed(cases)
    if short.rows:
        yield Title("What fell short")
        yield short
    yield Title("The worst of each quantity")
    yield tables.worst(cases)
    yield from _graphs(run, name, cases)
    others = tables.published(cases)
    if others.rows:
        yield Title("Published results")
        yield others
    yield Title("Cases")
    yield tables.index(cases)


def _graphs(run: Run, name: str, cases: Sequence[CaseResult]) -> Iterator[Simple]:
    """Convergence of all cases, pictures, and some plots of each kind."""
    charts = list(convergence.charts_of(cases))
    if charts:
        yield Title("Against the size of the mesh")
        yield Figures(tuple(_common(run, name, f"errors-{k}", chart) for k, chart in enumerate(charts)))
    pictures = tuple(_picture(run, done, k) for done in cases for k in range(len(done.pictures)))
    if pictures:
        yield Title("Pictures")
        yield Figures(pictures)
    kinds: dict[str, list[tuple[CaseResult, int]]] = {}
    for done in cases:
        for k, plot in enumerate(done.plots):
            kinds.setdefault(plot.kind, []).append((done, k))
    for kind, group in kinds.items():
        yield Title(kind[:1].upper() + kind[1:])
        yield from _kind(run, name, kind, group)


def _kind(run: Run, name: str, kind: str, group: Sequence[tuple[CaseResult, int]]) -> Iterator[Simple]:
    """Plots of a kind: those of few points joined, of others some."""
    if len(group) > 1 and all(_is_short(done.plots[k]) for done, k in group):
        joined = _joined(kind, group)
        yield Figures(tuple(_common(run, name, f"{kind}-{k}", chart) for k, chart in enumerate(joined)))
        return
    if len(group) > EXAMPLES:
        yield Text(f"{EXAMPLES} of {len(group)}; all of them stand with their cases.")
    spread = [group[round(k * (len(group) - 1) / (EXAMPLES - 1))] for k in range(EXAMPLES)]
    chosen = group if len(group) <= EXAMPLES else list(dict(((d.id, k), (d, k)) for d, k in spread).values())
    yield Figures(tuple(_drawn(run, done, k, "-example") for done, k in chosen))


def _is_short(plot: Plot) -> bool:
    return len(plot.lines) <= 2 and plot.log_x and all(len(line.x) <= _FEW for line in plot.lines)


def _joined(kind: str, group: Sequence[tuple[CaseResult, int]]) -> Iterator[Chart]:
    """Plots with the same axes, in one."""
    axes: dict[tuple[str, str, bool, bool], list[tuple[str, Line]]] = {}
    for done, k in group:
        plot = done.plots[k]
        for line in plot.lines:
            label = f"{done.case}: {line.label}" if len(plot.lines) > 1 else done.case
            own = Line(label, line.x, line.y, line.style)
            axes.setdefault((plot.x_label, plot.y_label, plot.log_x, plot.log_y), []).append((done.id, own))
    for (x, y, log_x, log_y), lines in axes.items():
        for start in range(0, len(lines), COLOURS):
            part = lines[start : start + COLOURS]
            plot = Plot(kind, f"{y} against {x}", x, y, tuple(line for _, line in part), log_x, log_y)
            yield Chart(plot, links=tuple(link for link, _ in part))


def _common(run: Run, name: str, which: str, chart: Chart) -> Figure:
    """A chart of several cases."""
    place = f"{name}:{'-'.join(which.split())}"
    return Figure(chart.plot.title, chart, place, name, name, command(run, name))


def _drawn(run: Run, done: CaseResult, k: int, more: str = "") -> Figure:
    """A plot of a case."""
    plot = done.plots[k]
    return _figure(run, done, f"plot-{k}{more}", plot.title, Chart(plot))


def _picture(run: Run, done: CaseResult, k: int) -> Figure:
    own = done.pictures[k]
    image = Image(run.path / "cases" / done.family / own.file, own.alt)
    return _figure(run, done, f"picture-{k}", own.title, image)


def _figure(run: Run, done: CaseResult, name: str, title: str, content: Chart | Image) -> Figure:
    """A figure of a case."""
    return Figure(title, content, f"{done.id}:{name}", done.id, done.id, _again(run, done))


def _again(run: Run, done: CaseResult) -> str:
    return command(run, done.family, done.case)


def case_section(run: Run, done: CaseResult) -> Section:
    """Section of a case."""
    n = counted([done])
    parts = [
        f"{n.met} met" if n.met else "",
        f"{n.missed} missed" if n.missed else "",
        f"{n.informative} for information" if n.informative else "",
    ]
    note = ", ".join(p for p in (*parts, "no outcome" if n.failed else "", words.seconds(done.seconds)) if p)
    return Section(done.id, done.case, note, n.verdict, tuple(_case(run, done)))


def _case(run: Run, done: CaseResult) -> Iterator[Simple]:
    yield Text(done.description, literal=True)
    if done.failure:
        yield Text(f"No outcome: {done.failure}", "none", literal=True)
    levels, memory = words.count(done.levels, "level"), words.memory(done.memory)
    yield Text(f"{levels}, {words.seconds(done.seconds)}, {memory} at most.")
    yield Command(_again(run, done))
    if done.parameters:
        yield NamedValues(tuple((name, _told(value)) for name, value in done.parameters.items()))
    if done.results:
        yield tables.results_of(done.results)
    chart = convergence.chart_of(done)
    drawn = [_figure(run, done, "errors", "Errors", chart)] if chart else []
    yield from convergence.tables(done.results)
    drawn += [_drawn(run, done, k) for k in range(len(done.plots))]
    if drawn:
        yield Figures(tuple(drawn))
    if done.pictures:
        yield Table((Column("picture"),), tuple(_to_picture(done, k) for k in range(len(done.pictures))))
    others = tables.published([done], with_case=False)
    if others.rows:
        yield others


def _to_picture(done: CaseResult, k: int) -> TableRow:
    return TableRow.of((TableCell(done.pictures[k].title, link=f"{done.id}:picture-{k}"),))


def _told(value: Any) -> str:
    """Format a value of a problem's definition for reading."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_told(own)}" for name, own in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(_told(own) for own in value)
    return words.number(value) if isinstance(value, float) else str(value)
