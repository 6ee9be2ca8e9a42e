"""The report of a run: one page of HTML, missed results first; or its figures alone, a line each."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TypeVar

from markdown_it import MarkdownIt

from lacmesh.formats.output import replace_file
from verification.charts import Line, Plot, address, drawn, sloping
from verification.families import MODULES, family
from verification.records import Result
from verification.running import CaseResult, Run, rows

#: pictures that a family shows at most; lines of a chart, and charts of a picture
EXAMPLES, LINES, CHARTS = 6, 8, 12
#: what a kept figure has of a result
COLUMNS = ("case", "quantity", "value", "bound", "expected", "tolerance", "passed")
_MEANING = (
    "The ratio of a result is the share of its bound that it uses: 1 at the bound, above 1 where it is missed. The "
    "source says where the expected value comes from, never from the solver under test. The reason says why the bound "
    "is as wide as it is, or why it is missed. In charts h is the size of the mesh, and the black line has the "
    "expected slope. Published values of other codes are for comparison only. results.json has all results."
)
K = TypeVar("K")
T = TypeVar("T")


def write(run: Run, path: Path, *, informative: bool = False) -> None:
    """Write the page of a run; where the file's name ends with .json, its figures. Raises WriteError."""
    text = figures(run) if path.suffix == ".json" else page(run, informative=informative)
    replace_file(path, text.encode())


def figures(run: Run) -> str:
    """The figures of a run as JSON, a line for each result, without sources and reasons."""
    head = {"version": run.version, "suite": run.suite, "environment": dict(run.environment), "columns": COLUMNS}
    lines = []
    for row in rows(run, informative=False):
        value = row["value"] if row["value"] is None else float(f"{row['value']:.10g}")
        kept = {**row, "case": f"{row['family']}/{row['case']}", "value": value}
        lines.append(json.dumps([kept[name] for name in COLUMNS], ensure_ascii=False))
    return json.dumps(head)[:-1] + ', "results": [\n' + ",\n".join(lines) + "\n]}\n"


def ratio(result: Result) -> float:
    """The share of its bound that a result uses: 1 at the bound, above where it is missed; infinite for no number.

    >>> from verification.records import at_least, at_most, equal
    >>> ratio(at_most("a", 1.0, 4.0, source="")), ratio(equal("b", 3.5, 3.0, 1.0, source="", reason=""))
    (0.25, 0.5)
    >>> ratio(at_least("rate", 3.0, 1.5, source=""))
    0.5
    """
    if result.expected is None or result.bound == "informative":
        return math.nan if result.passed else math.inf
    part, whole = {
        "equal": (abs(result.value - result.expected), result.tolerance or 0.0),
        "at most": (result.value, result.expected),
        "at least": (result.expected, result.value),
    }[result.bound]
    if math.isnan(part) or math.isnan(whole):
        return math.inf
    return part / whole if whole else 0.0 if part == 0 else math.inf


def page(run: Run, *, informative: bool = False) -> str:
    """The page of a run."""
    title = f"Verification of lacmesh and lacsolver {run.version}, suite {run.suite}"
    styles = ((files(__name__) / name).read_text(encoding="utf-8") for name in ("style.css", "problems/style.css"))
    head = f'<meta charset="utf-8">\n<title>{escape(title)}</title>\n<style>\n{"".join(styles)}</style>'
    body = "\n".join(_body(run, title, informative=informative))
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


def _body(run: Run, title: str, *, informative: bool) -> Iterator[str]:
    families = _grouped((done.family, done) for done in run.done)
    names = ("family", "what", "cases", "met", "missed", "seconds", "worst ratio")
    yield f"<h1>{escape(title)}</h1><p>{escape('; '.join(map(' '.join, run.environment.items())))}</p>"
    yield f"<p>{_MEANING}</p><h2>Missed</h2>"
    missed = [_missed(done, r) for done in run.done for r in done.results() if not r.passed]
    yield _table(("case", "quantity", "value", "must be", "reason"), missed) or "<p>Every result is met.</p>"
    yield "<h2>Families</h2>"
    yield _table(names, [_counts("all", run.done), *(_counts(name, cases) for name, cases in families.items())])
    for name, cases in families.items():
        yield from _family(name, cases, informative=informative)


def _missed(done: CaseResult, r: Result) -> tuple[object, ...]:
    steps = [level.rate for level in r.levels if level.rate is not None]
    slow = f"the slowest step from mesh to mesh has {min(steps):.3f}; " if steps else ""
    return done.id, r.quantity, _number(r.value), _must_be(r), f"{slow}{r.reason}\n{done.log[-5000:]}"


def _counts(name: str, cases: Sequence[CaseResult]) -> tuple[object, ...]:
    results = [r for done in cases for r in done.results()]
    met = sum(r.passed for r in results)
    worst = max(map(ratio, results), default=math.nan)
    title = family(name).title if name in MODULES else ""
    return name, title, len(cases), met, len(results) - met, round(sum(d.seconds for d in cases)), _number(worst, 3)


def _family(name: str, cases: Sequence[CaseResult], *, informative: bool) -> Iterator[str]:
    """The part of the page on a family: its problem, its results, charts and pictures."""
    known = family(name) if name in MODULES else None
    yield f"<h2>{escape(known.title if known else name)}</h2>"
    drawing = files(__name__) / "problems" / f"{name}.svg"
    if drawing.is_file():
        yield drawing.read_text(encoding="utf-8").replace(' xmlns="http://www.w3.org/2000/svg"', "")
    yield MarkdownIt().render(known.text if known else "")
    names = ("quantity", "results", "met", "worst ratio", "worst", "must be", "case", "source", "reason")
    pairs = [(done, r) for done in cases for r in done.results()]
    groups = _grouped(((r.quantity, r.bound, r.bound != "equal" and r.expected), (done, r)) for done, r in pairs)
    body = sorted(map(_worst, groups.values()), key=lambda row: (row[1] == row[2], -float(str(row[3]))))
    yield _table(names, body, missed=sum(row[1] != row[2] for row in body))
    others = [((r.quantity, p.who, p.source), (r.value, p.value)) for done, r in _every(cases) for p in r.published]
    beside = [(q, len(own), *map(_span, zip(*own, strict=True)), *more) for (q, *more), own in _grouped(others).items()]
    yield _table(("quantity", "results", "here", "published", "by", "where"), beside)
    if informative:
        free = _grouped((r.quantity, r) for _, r in _every(cases) if r.bound == "informative")
        spans = [(name, len(own), _span(r.value for r in own), own[0].reason) for name, own in free.items()]
        yield _table(("quantity without a bound", "results", "values", "reason"), spans)
    yield from _pictures(cases)


def _every(cases: Sequence[CaseResult]) -> list[tuple[CaseResult, Result]]:
    return [(done, r) for done in cases for r in done.outcome.results]


def _worst(own: Sequence[tuple[CaseResult, Result]]) -> tuple[object, ...]:
    """The row of a quantity: the result that uses most of its bound."""
    done, r = max(own, key=lambda pair: (not pair[1].passed, ratio(pair[1])))
    met = sum(one.passed for _, one in own)
    return r.quantity, len(own), met, _number(ratio(r), 3), _number(r.value), _must_be(r), done.case, r.source, r.reason


def _pictures(cases: Sequence[CaseResult]) -> Iterator[str]:
    """Errors over the size of the mesh, and examples of the pictures."""
    rated = [(done, r) for done, r in _every(cases) if len(r.levels) > 1]
    groups = _grouped(((r.quantity, r.expected), _errors(done, r)) for done, r in rated)
    charts = []
    for (quantity, slope), lines in groups.items():
        for k in range(0, len(lines), LINES):
            own = [*lines[k : k + LINES], *([sloping(lines[k : k + LINES], slope)] if slope else [])]
            charts.append(Plot(quantity, "h", "", tuple(own), log_x=True, log_y=True))
    for k in range(0, len(charts), CHARTS):
        yield f'<img src="{drawn(charts[k : k + CHARTS])}" alt="errors over the size of the mesh">'
    for one in _examples([picture for done in cases for picture in done.outcome.pictures]):
        yield f'<h4>{escape(one.title)}</h4><img src="{address("png", one.png)}" alt="{escape(one.alt)}">'


def _errors(done: CaseResult, r: Result) -> Line:
    return Line(done.case, tuple(level.h for level in r.levels), tuple(level.error for level in r.levels))


def _examples(every: Sequence[T]) -> list[T]:
    """A few of many, from the first to the last."""
    return [every[k] for k in sorted({round(k * (len(every) - 1) / (EXAMPLES - 1)) for k in range(EXAMPLES)}) if every]


def _grouped(pairs: Iterable[tuple[K, T]]) -> dict[K, list[T]]:
    """The values of each key, in the order of their first."""
    groups: dict[K, list[T]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def _number(value: float, digits: int = 6) -> str:
    return f"{value:.{digits}g}"


def _span(values: Iterable[float]) -> str:
    every = sorted(v for v in values if not math.isnan(v))
    return " to ".join(dict.fromkeys(f"{v:.4g}" for v in every[:: len(every) - 1 or 1])) if every else "none"


def _must_be(r: Result) -> str:
    if r.expected is None or r.bound == "informative":
        return "a number"
    signs = {"equal": "", "at most": "≤ ", "at least": "≥ "}
    return f"{signs[r.bound]}{_number(r.expected)}" + (f" ± {r.tolerance:.3g}" if r.tolerance else "")


def _table(names: Sequence[str], body: Sequence[Sequence[object]], missed: int = 0) -> str:
    """A table of HTML, its first rows marked as missed; empty where there is no row."""
    if not body:
        return ""
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    rows = ("".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in body)
    marked = "\n".join(f"<tr{' class=missed' if k < missed else ''}>{row}</tr>" for k, row in enumerate(rows))
    return f"<table><thead><tr>{head}</tr></thead><tbody>\n{marked}\n</tbody></table>"
