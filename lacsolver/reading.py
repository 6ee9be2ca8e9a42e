"""Results of a finished run, read from its folder: the history as arrays, and the solution at each time written.

results.json, history.csv -> status, warnings, columns of the history      (docs/output.md)
solid, contact_NAME (VTU) or results.med, contact_NAME.csv -> fields       at the times of [output]
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, RequestError
from lacmesh.facts import Described, listed
from lacmesh.formats import read
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.surface import Surface
from lacsolver.output.names import HISTORY, MED, RESULTS, SOLID, contact_stems
from lacsolver.output.tables import CONTACT_COLUMNS, FRICTION_COLUMNS, same_time
from lacsolver.output.vtu import read_pvd
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.results.state import ZoneFriction
from lacsolver.solution import Solution


@dataclass(frozen=True, eq=False, repr=False)
class RunResults(Described):
    """Results of a run in its folder. `summary`: content of results.json.

    `history`: columns of history.csv by name, an array (steps,) each, NaN where there is no value. `status`: done,
    running, interrupted or failed; `message`: its warnings, or why it is not done.

    >>> import lacsolver as ls
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     done = ls.run("data/two_blocks.toml", f"{folder}/results")
    ...     results = ls.read_results(f"{folder}/results")
    ...     pressure = results.solution(-1).contact["joint"].pressure
    >>> results.status, results.times.tolist(), len(results.history["time"]), pressure.shape
    ('done', [0.5, 1.0], 2, (36,))
    """

    folder: Path
    summary: Mapping[str, Any]
    history: Mapping[str, NDArray[np.floating]]

    @property
    def status(self) -> str:
        """Status of the run: done, running, interrupted or failed."""
        return str(self.summary["status"])

    @property
    def message(self) -> str:
        """Warnings of the run, or why it is not done; empty if there is nothing to say."""
        return str(self.summary.get("message", ""))

    @cached_property
    def _series(self) -> _VtuSeries | _MedSeries:
        pvd = self.folder / f"{SOLID}.pvd"
        return _VtuSeries(self.folder) if pvd.exists() else _MedSeries(self.folder)

    @cached_property
    def times(self) -> NDArray[np.floating]:
        """Times (k,) at which fields were written."""
        return np.array(self._series.times)

    def solution(self, i: int = -1) -> Solution:
        """Return the solution at the i-th of `times`, the last by default. Raises IndexError, ReadError."""
        i = range(len(self.times))[i]
        time, history = float(self.times[i]), self.history
        row = next((k for k, t in enumerate(history["time"]) if same_time(t, time)), None)
        iterations = 0 if row is None else int(history["iterations"][row])
        mesh, fields = self._series.read(i, tuple(self.summary.get("contact", {})))
        return Solution(mesh, time, iterations, lambda: fields)

    def to_pandas(self) -> Any:
        """Return the history as a `pandas.DataFrame` with the time as its index. Raises RequestError without pandas."""
        if find_spec("pandas") is None:
            raise RequestError("this needs pandas; pip install pandas brings it")
        import pandas

        return pandas.DataFrame(dict(self.history)).set_index("time")

    def _facts(self) -> dict[str, str]:
        return {
            "folder": str(self.folder),
            "status": self.status + (f": {self.message.splitlines()[0]}" if self.message else ""),
            "steps": f"{len(self.history['time'])}",
            "times": f"{len(self.times)}, solution(i)",
            "contact": listed(self.summary.get("contact", {})) or "none",
            "history": listed(self.history),
        }


def read_results(folder: str | Path) -> RunResults:
    """Read the results of a run from its folder. Raises ReadError if there are none.

    >>> read_results("data")
    Traceback (most recent call last):
    lacmesh.errors.ReadError: data: holds no results of a run (no results.json)
    """
    folder = Path(folder)
    path = folder / RESULTS
    if not path.is_file():
        raise ReadError(folder, f"holds no results of a run (no {RESULTS})")
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(summary, dict) or not {"status", "steps"} <= set(summary):
            raise ValueError("it holds something else")
    except (OSError, ValueError, RecursionError) as error:
        raise ReadError(path, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None
    return RunResults(folder, summary, _table(folder / HISTORY))


def _table(path: Path) -> dict[str, NDArray[np.floating]]:
    """Return the columns of a table, NaN for empty fields. Raises ReadError."""
    try:
        with path.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
            rows = list(csv.reader(file))
        values = np.array([[float(cell) if cell else np.nan for cell in row] for row in rows[1:]])
        return dict(zip(rows[0], values.reshape(-1, len(rows[0])).T, strict=True))
    except (OSError, ValueError, IndexError, csv.Error) as error:
        raise ReadError(path, f"is no table of lacsolver ({getattr(error, 'strerror', None) or error})") from None


class _VtuSeries:
    """Fields in VTU files."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._entries = folder, read_pvd(folder / f"{SOLID}.pvd")

    @property
    def times(self) -> Sequence[float]:
        """Times of the PVD."""
        return [entry.time for entry in self._entries]

    def read(self, i: int, zones: tuple[str, ...]) -> tuple[Mesh, Fields]:
        """Return the bodies and the fields at the i-th time. Raises ReadError."""
        time, file = self._entries[i]
        if file.endswith(".pvtu"):
            raise ReadError(self._folder / file, "is in pieces of several processes, which only ParaView joins")
        solid = read(self._folder / file)
        nodal = _vectors(solid, solid.node_data)
        contact = {}
        for zone, stem in contact_stems(zones).items():
            skin = next((e.file for e in read_pvd(self._folder / f"{stem}.pvd") if same_time(e.time, time)), None)
            if skin is not None:
                contact[zone] = _of_skin(solid, read(self._folder / skin), _rows_at(self._folder / f"{stem}.csv", time))
        stress = solid.node_data["stress"]
        stress = stress[:, :4] if solid.dim == 2 else stress
        moving = (nodal.get("velocity"), nodal.get("acceleration"))
        strain = solid.node_data.get("plastic_strain")
        return solid, Fields(time, nodal["displacement"], stress, nodal["reaction"], contact, *moving, strain)


class _MedSeries:
    """Fields in results.med."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._mesh = folder, read(folder / MED)
        steps = self._mesh.steps.values()
        self._times = sorted({step.time for step in steps if step.field == "DEPL"})

    @property
    def times(self) -> Sequence[float]:
        """Times of the displacement."""
        return self._times

    def read(self, i: int, zones: tuple[str, ...]) -> tuple[Mesh, Fields]:
        """Return the bodies and the fields at the i-th time. Raises ReadError."""
        time, mesh = self._times[i], self._mesh
        now = {step.field: name for name, step in mesh.steps.items() if same_time(step.time, time)}
        names = {field: mesh.node_data[name] for field, name in now.items() if name in mesh.node_data}
        nodal, contact = _vectors(mesh, names), {}
        for zone, stem in contact_stems(zones).items():
            pressure = mesh.cell_data[now[f"{zone}.pressure"]].reshape(-1)
            surface = Surface.of(mesh, np.flatnonzero(np.isfinite(pressure)))
            rows = _rows_at(self._folder / f"{stem}.csv", time)
            macro = _places(mesh.cell_data["lac_macro"][surface.cell], rows["macro"])
            recovered = names[f"{zone}.pressure_recovered.nodes"].reshape(-1)
            contact[zone] = _zone(surface, macro, rows, nodal[f"{zone}.contact_force"], recovered)
        moving = (nodal.get("VITE"), nodal.get("ACCE"))
        strain = names["VARI_NOEU"].reshape(-1) if "VARI_NOEU" in names else None
        return mesh, Fields(time, nodal["DEPL"], names["SIEF_NOEU"], nodal["REAC_NODA"], contact, *moving, strain)


def _vectors(mesh: Mesh, values: Mapping[str, NDArray]) -> dict[str, NDArray[np.floating]]:
    """Return the values (n, components) that have at least as many components as the space, as vectors (n, d)."""
    d = mesh.dim
    return {k: np.asarray(v, float)[:, :d] for k, v in values.items() if v.ndim == 2 and v.shape[1] >= d}


def _rows_at(path: Path, time: float) -> dict[str, NDArray[np.floating]]:
    """Return the rows (m,) of a contact's table at a time, by column. Raises ReadError."""
    table = _table(path)
    if not set(CONTACT_COLUMNS) <= set(table):
        raise ReadError(path, "is no table of a contact")
    at = np.array([same_time(t, time) for t in table["time"]], bool)
    return {name: values[at] for name, values in table.items()}


def _of_skin(solid: Mesh, skin: Mesh, rows: Mapping[str, NDArray]) -> ZoneFields:
    """Return the fields of a zone from its skin's file, on the nodes of the bodies."""
    surface = Surface.of(skin, np.arange(skin.n_cells))
    node = _places(skin.node_number, solid.node_number)
    on_solid = np.where(surface.faces.nodes >= 0, node[surface.faces.nodes], -1)
    cells = _places(skin.cell_number[surface.cell], solid.cell_number)
    force, nodal = np.zeros((solid.n_nodes, solid.dim)), np.full(solid.n_nodes, np.nan)
    force[node] = skin.node_data["contact_force"][:, : solid.dim]
    nodal[node] = skin.node_data["pressure_recovered"].reshape(-1)
    macro = _places(skin.cell_data["macro"][surface.cell], rows["macro"])
    faces = replace(surface.faces, nodes=on_solid)
    return _zone(replace(surface, x=solid.points, faces=faces, cell=cells), macro, rows, force, nodal)


def _zone(surface: Surface, macro: Ints, rows: Mapping[str, NDArray], force: Floats, nodal: Floats) -> ZoneFields:
    axes = "xyz"[: surface.dim + 1]
    centre, normal = (np.stack([rows[f"{start}{axis}"] for axis in axes], axis=1) for start in ("", "n"))
    columns = ("pressure", "pressure_recovered", "gap", "status", "coverage", "area")
    pressure, recovered, gap, status, coverage, area = (rows[name] for name in columns)
    return ZoneFields(
        surface, macro, rows["macro"].astype(int), pressure, recovered, gap, status.astype(np.int8), coverage, area,
        centre, normal, force, nodal, _friction(rows, axes, area * coverage),
    )  # fmt: skip


def _friction(rows: Mapping[str, NDArray], axes: str, w: Floats) -> ZoneFriction | None:
    """Return the friction of a zone from the rows of its table, with the covered areas w (m,); None without it.

    Energies of the step are not known.
    """
    if "shear_1" not in rows:
        return None
    count = range(1, len(axes))
    tangents = np.stack([np.stack([rows[f"tangent_{k}_{a}"] for a in axes], axis=1) for k in count], axis=1)
    shear, slip = (np.stack([rows[f"{name}_{k}"] for k in count], axis=1) for name in ("shear", "slip"))
    taken = float((rows["dissipation"] * w).sum())
    resultant = -np.einsum("n,nk,nkd->d", w, shear, tangents)
    path, use, dissipation = (rows[name] for name in FRICTION_COLUMNS)
    return ZoneFriction(tangents, shear, slip, path, use, dissipation, (np.nan, taken), resultant)


def _places(wanted: NDArray, among: NDArray) -> Ints:
    """Return the index of each wanted number among others, -1 for those that are not there."""
    order = np.argsort(among, kind="stable")
    at = np.clip(np.searchsorted(among, wanted, sorter=order), 0, max(len(among) - 1, 0))
    nearest = order[at] if len(among) else np.zeros(len(wanted), int)
    return np.where(among[nearest] == wanted, nearest, -1)
