"""Report of a finished run: Markdown with pictures, as a page of HTML or with the pictures beside; and its 3D page.

folder of a run -> results.json, history.csv, fields at some times      (lacsolver.output)
sections in Markdown: figures, zones, loads, curves, stresses, the case
pictures = contact at the last time, curves                              (lacsolver.pictures)
"""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import LacmeshError, ReadError, RequestError
from lacmesh.formats.output import readable, replace_file
from lacmesh.report.markdown import html_page, plain, table
from lacmesh.view import check_renderer, page_of
from lacsolver.output.finished import FinishedRun
from lacsolver.output.words import zone_rows
from lacsolver.pictures.drawing import ContactPicture, missing_packages
from lacsolver.pictures.frames import even_times
from lacsolver.pictures.history import Panel, draw_panels

#: times of which a report has the largest gap at most; curves in a panel at most
TIMES, _CURVES = 12, 10
#: columns of history.csv that are drawn, by what they are and its kind of unit
_CURVES_OF = {
    ("forces of contact", "force"): r"contact\..*\.f[xyz]",
    ("reactions", "force"): r"reaction\..*",
    ("largest pressure", "stress"): r".*\.pressure_max",
    ("energies", "energy"): r"(energy|work)\..*",
}


def write_run_report(folder: str | Path, path: str | Path, *, case: str | Path | None = None) -> None:
    """Write the report of a run from its folder: a page of HTML, or Markdown (.md) with its pictures beside it.

    `case`: the file of its case, to be shown; by default the one beside the folder with its name, if it is there.
    Pictures need matplotlib, and pyvista in space; without them the report has none. The model that turns is a page of
    its own (`model_page`), where trame-pyvista is installed. Raises ReadError, RequestError, WriteError.

    >>> from tempfile import TemporaryDirectory
    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> with TemporaryDirectory() as folder:
    ...     done = ls.run(example("two_blocks.toml"), f"{folder}/results")
    ...     write_run_report(f"{folder}/results", f"{folder}/report.html")
    ...     "contact pressure" in Path(folder, "report.html").read_text()
    True
    """
    path = Path(path)
    check_report(path)
    run = _Report(Path(folder), None if case is None else Path(case), path)
    text = "\n\n".join([*_sections(run), f"lacsolver {run.summary['version']}"]) + "\n"
    beside = path.suffix.lower() == ".md"
    for name, png in run.pictures.items():
        if beside:
            replace_file(path.with_name(name), png)
        else:
            text = text.replace(f"]({name})", f"](data:image/png;base64,{base64.b64encode(png).decode()})")
    replace_file(path, (text if beside else html_page(text, run.name)).encode("utf-8", "replace"))


def check_report(path: Path) -> None:
    """Raise RequestError for another file than .html or .md."""
    if path.suffix.lower() not in (".html", ".htm", ".md"):
        raise RequestError(f"{path}: a report is written as .html or .md")


def model_page(path: Path) -> Path:
    """Return the path of the model that turns, beside a report."""
    return path.with_name(f"{path.stem}_model.html")


@dataclass(frozen=True, eq=False)
class _Report(FinishedRun):
    """A run to be reported in a file `path`. `case`: the file of its case, None for that of the folder's name.

    `pictures`: PNG files of the report by name, which its sections add.
    """

    case: Path | None
    path: Path
    pictures: dict[str, bytes] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the folder."""
        return readable(self.folder.resolve().name)

    @cached_property
    def case_text(self) -> str:
        """Text of the case file; "" where there is none. Raises ReadError for one that was named."""
        path = self.case or self.folder.with_suffix(".toml")
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            if self.case is None:
                return ""
            raise ReadError(path, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None

    def picture(self, name: str, alt: str, png: bytes) -> str:
        """Add a picture, and return the Markdown that shows it."""
        file = f"{self.path.stem}_{name}.png"
        self.pictures[file] = png
        return f"![{plain(alt)}]({file})"


def _sections(run: _Report) -> Iterator[str]:
    """Yield paragraphs, tables, titles and pictures of a report."""
    yield f"# {plain(run.name)}"
    yield _facts(run)
    lines = str(run.summary.get("message", "")).splitlines()
    if lines:
        yield "## Warnings"
        yield "\n".join(f"- {plain(line)}" for line in lines)
    missing = missing_packages(run.stored.mesh.dim)
    if missing:
        yield f"Pictures need {' and '.join(missing)}; `pip install 'lacmesh[view]'` brings them."
    if run.summary.get("contact") and run.stored.times:
        yield "## Contact"
        if not missing:
            yield from _contact(run)
        yield _zones(run)
    yield from _loads(run)
    if "matplotlib" not in missing:
        yield from _curves(run)
        yield from _convergence(run)
    yield from _stresses(run)
    if run.case_text:
        yield "## The case"
        yield f"````toml\n{run.case_text.rstrip()}\n````"
    yield "## Size and time"
    sizes = [(name.replace("_", " "), f"{value:,}") for name, value in run.summary.get("sizes", {}).items()]
    timings = [(name, f"{value:.2f} s") for name, value in run.summary.get("timings", {}).items()]
    memory = ("memory at its peak", f"{run.summary.get('memory', 0) / 1e6:,.0f} MB")
    yield table(("", ""), [*sizes, *timings, memory])


def _facts(run: _Report) -> str:
    """Return the numbers to be seen first."""
    summary = run.summary
    steps, zones = summary["steps"], summary.get("contact", {}).values()
    last = steps[-1]["time"] if steps else math.nan
    iterations, halved = (sum(step[name] for step in steps) for name in ("iterations", "halvings"))
    closed = sum(zone["active"] for zone in zones)
    every = closed + sum(zone["open"] + zone["unpaired"] for zone in zones)
    rows = [
        ("status", f"**{summary['status']}**, to t = {last:.6g}"),
        ("steps", f"{len(steps):,}, {iterations:,} iterations, {halved:,} cutbacks"),
        ("in contact", f"{closed:,} of {every:,} macro-elements"),
        (
            run.units.label("largest pressure", "stress"),
            _number(max((zone["pressure_max"] or 0.0 for zone in zones), default=0.0)),
        ),
    ]
    balance = summary.get("balance", {})
    rows += [(f"imbalance of {name}s, relative", _number(value)) for name, value in balance.items()]
    return table(("", ""), rows)


def _contact(run: _Report) -> Iterator[str]:
    """Yield the way to the model, which is written, and pictures of the last time: pressure and status of each zone."""
    mesh, fields = run.stored.mesh, run.stored.read(len(run.stored.times) - 1)
    try:
        drawn = [ContactPicture.of(mesh, fields, name, (), run.units) for name in ("pressure", "status")]
        for name, one in zip(("pressure", "status"), drawn, strict=True):
            yield run.picture(name, one.heading, one.png())
        yield _model(run, drawn[0])
    except LacmeshError as error:
        yield f"No picture: {plain(str(error))}."


def _model(run: _Report, picture: ContactPicture) -> str:
    """Write the model that turns, and return the way to it, or what it needs. Raises WriteError."""
    if find_spec("pyvista") is None or find_spec("trame_pyvista") is None:
        return "A model that turns needs trame-pyvista; `pip install 'lacmesh[view]'` brings it."
    check_renderer()
    path = model_page(run.path)
    drawing = picture.drawing(picture.mesh.points + picture.times * picture.u, (1200, 800))
    text = re.sub("<title>.*?</title>", lambda _: "<title>contact pressure</title>", page_of(drawing.plot), count=1)
    replace_file(path, text.encode("utf-8", "replace"))
    return f"[The model, which turns]({path.name}), has the pressure on its surfaces; {plain(picture.heading)}."


def _zones(run: _Report) -> str:
    """Return the figures of all zones at the last step, a column each."""
    columns = {
        name: {"slave": zone.get("slave", ""), "master": zone.get("master", ""), **dict(zone_rows(zone, run.units))}
        for name, zone in run.summary["contact"].items()
    }
    rows = dict.fromkeys(words for column in columns.values() for words in column)
    cells = [(words, *(plain(column.get(words, "")) for column in columns.values())) for words in rows]
    return table(("at the last step", *map(plain, columns)), cells)


def _loads(run: _Report) -> Iterator[str]:
    """Yield the resultants of loads, and the reactions of supports, at the last step."""
    steps = run.summary["steps"]
    rows = [(load["section"], load["where"], load["force"]) for load in run.summary.get("loads", ())]
    rows += [("support", name, force) for name, force in (steps[-1]["reactions"] if steps else {}).items()]
    if rows:
        names = [run.units.label(f"F{axis}", "force") for axis in "xyz"[: max(len(force) for _, _, force in rows)]]
        yield "## Loads and supports"
        yield "Resultants at the last step, of the whole thickness or circle; those of supports on the body."
        cells = [(plain(kind), plain(where), *map(_number, force)) for kind, where, force in rows]
        yield table(("kind", "where", *names), cells)


def _curves(run: _Report) -> Iterator[str]:
    """Yield curves over time: forces, pressures, energies, gaps."""
    time = run.history["time"]
    known = {name: values for name, values in run.history.items() if np.nanmax(np.abs(values), initial=0.0) > 0}
    curves: dict[tuple[str, str], dict[str, tuple[Any, Any]]] = {
        of: {name.partition(".")[2]: (time, known[name]) for name in known if re.fullmatch(pattern, name)}
        for of, pattern in _CURVES_OF.items()
    }
    zones = run.summary.get("contact", {})
    fields = [run.stored.read(k) for k in even_times(run.stored.times, TIMES)] if zones else []
    gaps = {n: ([f.time for f in fields], [_largest(f.zones[n].gap) for f in fields]) for n in zones if fields}
    across = run.units.label("time", "time")
    panels = [
        Panel(run.units.label(*of), dict(list(named.items())[k : k + _CURVES]), across)
        for of, named in {**curves, ("largest gap", "length"): gaps}.items()
        for k in range(0, len(named), _CURVES)
    ]
    if panels:
        yield "## Over time"
        yield run.picture("curves", "forces, pressures, energies and gaps over time", draw_panels(panels, columns=2))


def _convergence(run: _Report) -> Iterator[str]:
    """Yield the iterations of each step, and the residuals of the steps with most of them."""
    steps = run.summary["steps"]
    if not steps:
        return
    time = [step["time"] for step in steps]
    counts = {n: (time, [float(step[key]) for step in steps]) for n, key in
              (("iterations", "iterations"), ("cutbacks", "halvings"))}  # fmt: skip
    longest = sorted(sorted(steps, key=lambda step: -len(step["residuals"]))[:4], key=lambda step: step["time"])
    residuals = {
        f"step to {step['time']:.6g}": (range(1, len(step["residuals"]) + 1), step["residuals"]) for step in longest
    }
    panels = [Panel("number in a step", counts, run.units.label("time", "time"))]
    panels += (
        [Panel("relative residual", residuals, "iteration", log=True)]
        if any(step["residuals"] for step in longest)
        else []
    )
    yield "## Convergence"
    yield run.picture("convergence", "iterations of each step, and residuals", draw_panels(panels, columns=2))


def _stresses(run: _Report) -> Iterator[str]:
    """Yield the range of stresses of each group of cells."""
    stress = run.summary.get("stress", {})
    if stress:
        names = tuple(dict.fromkeys(name for ranges in stress.values() for name in ranges))
        rows = [
            (plain(group) or "all", *(_range(ranges.get(name)) for name in names)) for group, ranges in stress.items()
        ]
        yield "## Stresses"
        yield "Least and largest value at integration points of each group, at the last step."
        yield table(("group", *(run.units.label(name.replace("_", " "), "stress") for name in names)), rows)


def _largest(values: Any) -> float:
    known = np.asarray(values)[np.isfinite(values)]
    return float(known.max()) if len(known) else math.nan


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
