"""Tables: history.csv with a row per step, contact_NAME.csv with a row per macro-element and step that is written.

Reals have the fewest digits from which the same value is read; missing values are empty fields.
"""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, writing
from lacmesh.formats.output import replace_file
from lacmesh.mesh import Floats
from lacsolver.equilibrium.state import ZoneFriction
from lacsolver.output.names import HISTORY
from lacsolver.results.results import StepFigures, ZoneFields

#: two times are the same if they differ by less than this, relative to the larger
SAME_TIME = 1e-9
#: columns of contact_NAME.csv
CONTACT_COLUMNS = (
    *("time", "macro", "x", "y", "z", "nx", "ny", "nz", "area"),
    *("pressure", "pressure_recovered", "gap", "status", "coverage"),
)
#: its further columns with friction, and those of each tangent
FRICTION_COLUMNS = ("path", "use", "dissipation")
TANGENT_COLUMNS = ("tangent_{}_x", "tangent_{}_y", "tangent_{}_z", "shear_{}", "slip_{}")
_AXES = "xyz"


def same_time(one: float, other: float) -> bool:
    """True if two times are the same up to round-off."""
    return abs(one - other) <= SAME_TIME * max(abs(one), abs(other))


def until(time: float, end: float) -> bool:
    """True if a time is not after `end`, up to round-off."""
    return time <= end or same_time(time, end)


class History:
    """The file history.csv of a folder. `end`: keep the rows of an existing file up to this time, and add to them.

    If the conditions or probes differ from those of earlier rows, columns are added, which are empty where no value is
    known.
    """

    def __init__(self, folder: Path, end: float | None = None) -> None:
        self._path = folder / HISTORY
        self._columns: list[str] = []
        self._before: tuple[list[str], list[list[str]]] = ([], []) if end is None else _read_until(self._path, end)

    def add(self, step: StepFigures) -> None:
        """Append the row of a step and flush it to the disk. Raises WriteError, ValueError for new columns."""
        row = history_row(step)
        if not self._columns:
            self._begin(row)
        if set(row) - set(self._columns):
            raise ValueError(f"the step at t = {step.time} has columns {sorted(set(row) - set(self._columns))} more")
        append(self._path, _lines([[_plain(row.get(name)) for name in self._columns]]))

    def _begin(self, row: Mapping[str, Any]) -> None:
        columns, rows = self._before
        self._columns = list(row) + [name for name in columns if rows and name not in row]
        earlier = [dict(zip(columns, old, strict=True)) for old in rows]
        replace_file(self._path, _lines([self._columns, *([old.get(n, "") for n in self._columns] for old in earlier)]))


def history_row(step: StepFigures) -> dict[str, float]:
    """Return the row of a step, by column."""
    row = {"time": step.time, "iterations": step.iterations}
    for start, value in _figures(step):
        values = np.asarray(value).tolist()
        row |= (
            dict(zip((f"{start}{axis}" for axis in _AXES), values, strict=False))
            if np.ndim(value)
            else {start.rstrip("."): values}
        )
    return row


def _figures(step: StepFigures) -> Iterator[tuple[str, Any]]:
    """Yield numbers by the name of their column, and vectors by what precedes the axis in the names of theirs."""
    moving = step.motion
    for name, force in step.reactions.items():
        yield f"reaction.{name}.", force
    for name, one in step.equations.items():
        yield f"equation.{name}.force", one
    for name, point in step.couplings.items():
        yield from ((f"coupling.{name}.u", point.displacement), (f"coupling.{name}.f", point.force))
        for key, turns in (("rotation", point.rotation), ("moment", point.moment)):
            if len(turns):
                yield f"coupling.{name}.{key}.", turns if len(turns) > 1 else turns[0]
    for name, move in step.probes.items():
        yield f"probe.{name}.u", move
        if moving is not None:
            yield from ((f"probe.{name}.v", moving.velocities[name]), (f"probe.{name}.a", moving.accelerations[name]))
    for name, zone in step.contact.items():
        start = f"contact.{name}."
        yield f"{start}f", zone.resultant
        yield from (
            (f"{start}{key}", value)
            for key, value in (("area", zone.contact_area), ("pressure_max", zone.pressure_max))
        )
        if zone.friction is not None:
            yield f"{start}friction.", zone.friction.friction
            yield from ((f"{start}{key}", getattr(zone.friction, key)) for key in ("sticking", "sliding", "slip_max"))
            yield f"{start}dissipation", zone.friction.dissipation[1]
        if moving is not None:
            yield f"{start}impulse.", moving.impulse[name]
    for name, bolt in step.pretension.items():
        yield from ((f"pretension.{name}.{key}", getattr(bolt, key)) for key in ("force", "shortening"))
        if bolt.moment is not None:
            yield f"pretension.{name}.moment.", bolt.moment
    if step.work is not None:
        yield from ((f"work.{name}", value) for name, value in step.work._asdict().items())
    if step.plastic is not None:
        yield from ((f"plastic.{key}", getattr(step.plastic, key)) for key in ("strain_max", "von_mises_max"))
        yield "plastic.dissipation", step.plastic.dissipation[1]
    if moving is not None:
        yield from ((f"energy.{name}", value) for name, value in moving.energies.items())
        yield from (("momentum.", moving.momentum["linear"]), ("momentum.angular.", moving.momentum["angular"]))


def add_contact(path: Path, time: float, zone: ZoneFields) -> None:
    """Append the rows of a zone's macro-elements to its table. Raises WriteError."""
    if not path.exists():
        replace_file(path, _lines([contact_columns(zone)]))
    append(path, _lines(_contact_rows(time, zone)))


def contact_columns(zone: ZoneFields) -> tuple[str, ...]:
    """Return the columns of a zone's table."""
    if zone.friction is None:
        return CONTACT_COLUMNS
    tangents = [name.format(k + 1) for k in range(zone.friction.shear.shape[1]) for name in TANGENT_COLUMNS]
    return (*CONTACT_COLUMNS, *tangents, *FRICTION_COLUMNS)


def read_table(path: Path) -> dict[str, NDArray[np.floating]]:
    """Return the columns of a table, NaN for empty fields. Raises ReadError.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "t.csv").write_text("time,force\\n0.5,1.0\\n1.0,\\n")
    ...     read_table(Path(folder, "t.csv"))
    {'time': array([0.5, 1. ]), 'force': array([ 1., nan])}
    """
    try:
        with path.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
            heads, *rows = list(csv.reader(file))
        values = np.array([[float(cell) if cell else np.nan for cell in row] for row in rows], float)
        return dict(zip(heads, values.reshape(-1, len(heads)).T, strict=True))
    except OSError as error:
        raise ReadError(path, f"cannot be read ({error.strerror or error})") from error
    except (ValueError, csv.Error) as error:
        raise ReadError(path, f"is damaged ({error}); run the case again") from error


def cut_off(path: Path, end: float) -> None:
    """Remove the rows of a table after the time `end`. Raises ReadError, WriteError."""
    columns, rows = _read_until(path, end)
    replace_file(path, _lines([columns, *rows]))


def append(path: Path, content: bytes) -> None:
    """Append content to a file and flush it to the disk; if that fails, the file keeps its former content.

    Raises WriteError.
    """
    with writing(path), path.open("ab", buffering=0) as file:
        size = file.seek(0, os.SEEK_END)
        try:
            rest = memoryview(content)
            while len(rest):
                rest = rest[file.write(rest) :]
            os.fsync(file.fileno())
        except OSError:
            file.truncate(size)
            raise


def _contact_rows(time: float, zone: ZoneFields) -> Iterator[Sequence[Any]]:
    plane = zone.surface.x[zone.surface.faces.nodes[0, 0], 2] if len(zone.surface) else 0.0
    places = [*_columns(zone.centre, plane), *_columns(zone.normal, 0.0)]
    reals = [_blank(values) for values in (*places, zone.area, zone.pressure, zone.recovered, zone.gap)]
    friction = [] if zone.friction is None else [_blank(values) for values in _of_friction(zone.friction)]
    last = zone.status.tolist(), _blank(zone.coverage), *friction
    return zip(repeat(time), zone.number.tolist(), *reals, *last, strict=False)


def _of_friction(friction: ZoneFriction) -> Iterator[NDArray]:
    """Yield the columns of friction."""
    for k in range(friction.shear.shape[1]):
        yield from (*_columns(friction.tangents[:, k], 0.0), friction.shear[:, k], friction.slip[:, k])
    yield from (friction.path, friction.use, friction.dissipation)


def _columns(vectors: Floats, z: float) -> list[NDArray]:
    """Return x, y and z of vectors (n, d); in a plane the third is `z`."""
    return [*vectors.T] if vectors.shape[1] == 3 else [*vectors.T, np.full(len(vectors), z)]


def _blank(values: NDArray) -> list[Any]:
    """Return values for csv, None where they are not finite."""
    plain: list[Any] = values.tolist()
    for k in np.flatnonzero(~np.isfinite(values)):
        plain[k] = None
    return plain


def _plain(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _lines(rows: Iterable[Sequence[Any]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode("utf-8", "surrogateescape")


def _read_until(path: Path, end: float) -> tuple[list[str], list[list[str]]]:
    """Return the columns of a table, and its rows up to the time `end`; none if there is no table. Raises ReadError."""
    if not path.exists():
        return [], []
    kept: list[list[str]] = []
    try:
        with path.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
            rows = csv.reader(file)
            columns = next(rows, [])
            if columns[:1] != ["time"]:
                raise ReadError(path, "is no table of lacsolver; move it away, or write into another folder")
            for row in rows:
                if len(row) != len(columns):
                    raise ReadError(path, "has a row that is not whole; remove it", f"line {rows.line_num}")
                if until(float(row[0]), end):
                    kept.append(row)
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise ReadError(path, f"cannot be read ({reason})") from error
    return columns, kept
