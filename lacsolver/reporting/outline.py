"""The report of a run as blocks: what came out, the model, each zone, curves, convergence, loads, the case."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshError, RequestError
from lacmesh.formats.output import readable, replace_file
from lacmesh.mesh import Mesh
from lacsolver.output.names import HISTORY
from lacsolver.output.states import StoredFields
from lacsolver.output.summary import read_summary
from lacsolver.output.tables import read_table
from lacsolver.pictures.drawing import ContactPicture, missing_packages, pictures_of
from lacsolver.pictures.frames import even_times
from lacsolver.pictures.quantities import QUANTITIES, ColourScale
from lacsolver.reporting import blocks
from lacsolver.reporting.blocks import ReportBlock, TableRow, table, title
from lacsolver.reporting.charts import COLOURS, Chart, Line, Plot, with_legend
from lacsolver.reporting.images import address_of
from lacsolver.reporting.model import model_frame
from lacsolver.reporting.pages import html_page
from lacsolver.results.results import Fields
from lacsolver.results.units import Units

#: times that the model of a report shows at most
TIMES = 12
#: figures of a zone in results.json that a report names: key -> words, kind of unit
ZONE_WORDS: Mapping[str, tuple[str, str]] = {
    "slave": ("slave", ""),
    "master": ("master", ""),
    "active": ("macro-elements in contact", ""),
    "open": ("open", ""),
    "unpaired": ("without a master opposite", ""),
    "sticking": ("sticking", ""),
    "sliding": ("sliding", ""),
    "pressure_max": ("largest pressure", "stress"),
    "pressure_min": ("least pressure", "stress"),
    "gap_max": ("largest gap", "length"),
    "gap_min": ("least gap", "length"),
    "contact_area": ("area in contact", ""),
    "resultant": ("force on the slave", "force"),
    "friction": ("of it friction", "force"),
    "slip_max": ("largest slip of the last step", "length"),
    "overlap_at_start": ("overlap of the undeformed bodies", "length"),
}


def write_run_report(folder: str | Path, path: str | Path, *, case: str | Path | None = None) -> None:
    """Write the report of a run from its folder as one page of HTML, which opens without a network.

    `case`: the file of its case, to be shown; by default the one beside the folder with its name, if it is there.
    Pictures need matplotlib, and pyvista in space; without them the page has none. Raises ReadError, RequestError,
    WriteError.

    >>> from tempfile import TemporaryDirectory
    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> with TemporaryDirectory() as folder:
    ...     done = ls.run(example("two_blocks.toml"), f"{folder}/results")
    ...     write_run_report(f"{folder}/results", f"{folder}/report.html")
    ...     "contact pressure" in Path(folder, "report.html").read_text()
    True
    """
    check_report(Path(path))
    run = FinishedRun(Path(folder), None if case is None else Path(case))
    content = list(outline(run))
    footer = f"lacsolver {run.summary['version']}"
    replace_file(Path(path), html_page(content, run.name, footer, scripted=True).encode("utf-8", "replace"))


def check_report(path: Path) -> None:
    """Raise RequestError for another file than .html."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise RequestError(f"{path}: a report is written as .html")


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """A run as its folder has it. `case`: the file of its case, None for the one of the folder's name."""

    folder: Path
    case: Path | None = None

    @property
    def name(self) -> str:
        """Name of the folder."""
        return readable(self.folder.resolve().name)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Content of results.json. Raises ReadError."""
        return read_summary(self.folder)

    @cached_property
    def history(self) -> dict[str, NDArray[np.floating]]:
        """Columns of history.csv. Raises ReadError."""
        return read_table(self.folder / HISTORY)

    @cached_property
    def units(self) -> Units:
        """Names of the units of the case."""
        return Units.of(self.summary.get("units"))

    @cached_property
    def states(self) -> list[tuple[Mesh, Fields]]:
        """Mesh and fields at some of the times that were written, evenly spaced, the last among them."""
        stored = StoredFields(self.folder)
        return [(stored.mesh, stored.read(k)) for k in even_times(stored.times, TIMES)]

    @cached_property
    def pictures(self) -> list[ContactPicture]:
        """Pictures of the pressure at those times, to one scale and with one magnification."""
        zones = [zone for _, fields in self.states for zone in fields.zones.values()]
        scale = ColourScale.of(QUANTITIES["pressure"], zones, self.units)
        return pictures_of(self.states, "pressure", scale, self.units)

    @property
    def case_text(self) -> str:
        """Text of the case's file; "" if it is not known."""
        path = self.case or self.folder.with_suffix(".toml")
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, ValueError):
            return ""


def outline(run: FinishedRun) -> Iterator[ReportBlock]:
    """Yield the blocks of the report of a run."""
    yield title(run.name, 1)
    yield _facts(run)
    yield from _warnings(run)
    zones = run.summary.get("contact", {})
    if zones and run.states:
        yield title("The model")
        try:
            yield blocks.drawing(model_frame(run.pictures[-1], f"{run.name}: contact pressure"))
        except LacmeshError as error:
            yield blocks.sentence(f"No model: {error}.", "missed")
        yield title("Contact")
        yield from _pictures(run)
        yield _zones(run)
    yield from _loads(run)
    yield from _curves(run)
    yield from _convergence(run)
    yield from _stresses(run)
    yield from _case(run)
    yield title("Size and time")
    sizes = [(name.replace("_", " "), f"{value:,}") for name, value in run.summary.get("sizes", {}).items()]
    timings = [(name, f"{value:.2f} s") for name, value in run.summary.get("timings", {}).items()]
    memory = [("memory at its peak", f"{run.summary.get('memory', 0) / 1e6:,.0f} MB")]
    yield blocks.named_values([*sizes, *timings, *memory])


def _facts(run: FinishedRun) -> ReportBlock:
    """Return the numbers to be seen first."""
    summary, fact = run.summary, blocks.fact
    steps, zones = summary["steps"], summary.get("contact", {}).values()
    last = steps[-1]["time"] if steps else math.nan
    iterations = sum(step["iterations"] for step in steps)
    halved = sum(step["halvings"] for step in steps)
    closed = sum(zone["active"] for zone in zones)
    every = closed + sum(zone["open"] + zone["unpaired"] for zone in zones)
    top = max((zone["pressure_max"] or 0.0 for zone in zones), default=0.0)
    balance = summary.get("balance", {}).get("force")
    done = summary["status"] == "done"
    return blocks.facts(
        (
            fact("status", summary["status"], f"to t = {last:.6g}", "met" if done else "missed"),
            fact("steps", f"{len(steps):,}", f"{iterations:,} iterations, {halved:,} cutbacks"),
            fact("in contact", f"{closed:,}", f"of {every:,} macro-elements"),
            fact("largest pressure", _number(top), run.units.stress),
            fact("balance of contact forces", _number(balance), "relative, largest of all steps"),
        )
    )


def _warnings(run: FinishedRun) -> Iterator[ReportBlock]:
    lines = str(run.summary.get("message", "")).splitlines()
    if lines:
        yield title("Warnings")
        yield from (blocks.sentence(line, "missed" if run.summary["status"] != "done" else "") for line in lines)


def _pictures(run: FinishedRun) -> Iterator[ReportBlock]:
    """Yield pictures of the last time: the pressure and the status of each zone."""
    mesh, fields = run.states[-1]
    missing = missing_packages(mesh.dim)
    if missing:
        yield blocks.sentence(f"Pictures need {' and '.join(missing)}; pip install 'lacmesh[view]' brings them.")
        return
    for field in ("pressure", "status"):
        drawn = run.pictures[-1] if field == "pressure" else ContactPicture.of(mesh, fields, field, (), run.units)
        try:
            source = address_of(drawn.png())
        except LacmeshError as error:
            yield blocks.sentence(f"No picture: {error}.", "missed")
            return
        yield blocks.drawing(
            f'<figure><img style="max-width:100%" src="{source}" alt="{escape(drawn.heading, quote=True)}"></figure>'
        )


def _zones(run: FinishedRun) -> ReportBlock:
    """Return the figures of all zones at the last step, a column each."""
    zones = run.summary["contact"]
    rows = [
        TableRow((run.units.label(words, unit), *(_number(zone.get(key, "")) for zone in zones.values())))
        for key, (words, unit) in ZONE_WORDS.items()
        if any(key in zone for zone in zones.values())
    ]
    return table(("at the last step", *zones), rows, numbers=tuple(zones))


def _loads(run: FinishedRun) -> Iterator[ReportBlock]:
    """Yield the resultants of loads, and the reactions of supports, at the last step."""
    steps = run.summary["steps"]
    rows = [(load["section"], load["where"], load["force"]) for load in run.summary.get("loads", ())]
    rows += [("support", name, force) for name, force in (steps[-1]["reactions"] if steps else {}).items()]
    if not rows:
        return
    axes = "xyz"[: max(len(force) for _, _, force in rows)]
    names = [run.units.label(f"F{axis}", "force") for axis in axes]
    yield title("Loads and supports")
    yield blocks.prose("Resultants at the last step, of the whole thickness or circle; those of supports on the body.")
    cells = (TableRow((kind, where, *(_number(part) for part in force))) for kind, where, force in rows)
    yield table(("kind", "where", *names), list(cells), numbers=names)


def _curves(run: FinishedRun) -> Iterator[ReportBlock]:
    """Yield charts over time: forces, pressures, gaps, energies."""
    kinds = {
        ("forces of contact", "force"): [
            name for name in run.history if name.startswith("contact.") and name[-3:] in (".fx", ".fy", ".fz")
        ],
        ("reactions", "force"): [n for n in run.history if n.startswith("reaction.")],
        ("largest pressure", "stress"): [n for n in run.history if n.endswith(".pressure_max")],
        ("energies", "energy"): [n for n in run.history if n.startswith(("energy.", "work."))],
    }
    charts = []
    for (words, unit), names in kinds.items():
        x = run.history["time"]
        lines = [Line(name.partition(".")[2], tuple(x), tuple(run.history[name])) for name in names]
        lines = [line for line in lines if np.nanmax(np.abs(line.y), initial=0.0) > 0]
        charts += [(words, unit, lines[k : k + COLOURS]) for k in range(0, len(lines), COLOURS)]
    times = tuple(fields.time for _, fields in run.states) if run.summary.get("contact") else ()
    gaps = [
        Line(name, times, tuple(_largest(fields.zones[name].gap) for _, fields in run.states))
        for name in run.summary.get("contact", {})
        if all(name in fields.zones for _, fields in run.states)
    ]
    charts += [("largest gap", "length", gaps[k : k + COLOURS]) for k in range(0, len(gaps), COLOURS)]
    if not charts:
        return
    yield title("Over time")
    time = run.units.label("time", "time")
    yield blocks.figures(
        blocks.figure(words, with_legend(Chart(Plot("", words, time, run.units.label(words, unit), tuple(lines)))))
        for words, unit, lines in charts
    )


def _numbered(label: str, values: Sequence[float | None]) -> Line:
    """Return a line of values over their numbers, from 1."""
    y = tuple(math.nan if value is None else value for value in values)
    return Line(label, tuple(float(k) for k in range(1, len(y) + 1)), y)


def _largest(values: Any) -> float:
    known = np.asarray(values)[np.isfinite(values)]
    return float(known.max()) if len(known) else math.nan


def _convergence(run: FinishedRun) -> Iterator[ReportBlock]:
    """Yield the iterations of each step, and the residuals of the steps with most of them."""
    steps = run.summary["steps"]
    if not steps:
        return
    yield title("Convergence")
    x = tuple(step["time"] for step in steps)
    counts = Line("iterations", x, tuple(float(step["iterations"]) for step in steps))
    halved = Line("cutbacks", x, tuple(float(step["halvings"]) for step in steps))
    longest = sorted(steps, key=lambda step: -len(step["residuals"]))[:4]
    residuals = [
        _numbered(f"step to {step['time']:.6g}", step["residuals"])
        for step in sorted(longest, key=lambda step: step["time"])
    ]
    plots = (
        Plot("convergence", "iterations of each step", run.units.label("time", "time"), "number", (counts, halved)),
        Plot("convergence", "residuals", "iteration", "relative residual", tuple(residuals), log_y=True),
    )
    yield blocks.figures(blocks.figure(plot.title, with_legend(Chart(plot))) for plot in plots)
    balance = run.summary.get("balance", {})
    yield blocks.named_values((f"balance of {name}s", _number(value)) for name, value in balance.items())


def _stresses(run: FinishedRun) -> Iterator[ReportBlock]:
    """Yield the range of stresses of each group of cells."""
    stress = run.summary.get("stress", {})
    if not stress:
        return
    names = tuple(dict.fromkeys(name for ranges in stress.values() for name in ranges))
    rows = [
        TableRow((group or "all", *(_range(ranges.get(name)) for name in names))) for group, ranges in stress.items()
    ]
    yield title("Stresses")
    yield blocks.prose("Least and largest value at integration points of each group, at the last step.")
    yield table(("group", *(run.units.label(name.replace("_", " "), "stress") for name in names)), rows)


def _case(run: FinishedRun) -> Iterator[ReportBlock]:
    if run.case_text:
        yield title("The case")
        yield ReportBlock(f'<div class="scroll"><pre><code>{escape(run.case_text)}</code></pre></div>', "")


def _range(ends: Sequence[float] | None) -> str:
    return "" if ends is None else f"{_number(ends[0])} .. {_number(ends[1])}"


def _number(value: Any) -> str:
    """Return a figure as words: a number, a vector, a name; "" for none."""
    if value is None or value == "":
        return ""
    if isinstance(value, (list, tuple)):
        return ", ".join(f"{part:.5g}" for part in value if part is not None)
    if isinstance(value, float):
        return f"{value:.5g}"
    return f"{value:,}" if isinstance(value, int) else str(value)
