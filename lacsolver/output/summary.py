"""results.json: the figures of a run, replaced as a whole after every step, so that it is valid at any time.

Values that are not finite are null. Each step is converted once, and its line is kept.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import ReadError
from lacmesh.formats.output import replace_file
from lacsolver.output.names import RESULTS
from lacsolver.output.tables import until
from lacsolver.results.results import Results, StepFigures, ZoneFigures

#: figures of a step in results.json
STEP_KEYS = ("time", "iterations", "halvings", "residuals", "reactions", "probes")
#: further figures of a step of a case with [dynamics]
MOTION_KEYS = ("energies", "momentum", "impulse", "velocities", "accelerations")
_BALANCE = ("force", "moment")


class Summary:
    """The file results.json of a folder. `end`: keep the steps of an existing file up to this time, and add to them."""

    def __init__(self, folder: Path, end: float | None = None) -> None:
        self._path = folder / RESULTS
        before = {} if end is None else _read(self._path)
        self._before = [_line(step) for step in before.get("steps", []) if until(step["time"], end or 0.0)]
        self._worst = before.get("balance", {}) if self._before else {}
        self._told: list[str] = []

    def write(self, results: Results) -> None:
        """Write the results so far. Raises WriteError."""
        self._told += [_line(_step(step)) for step in results.steps[len(self._told) :]]
        parts = {name: _line(value) for name, value in _whole(results, self._worst).items()}
        parts["steps"] = "[" + ",".join(f"\n  {line}" for line in (*self._before, *self._told)) + "\n ]"
        text = "{" + ",".join(f"\n {_line(name)}: {part}" for name, part in parts.items()) + "\n}\n"
        replace_file(self._path, text.encode())


def _whole(results: Results, worst: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of the file, in its order, with `steps` empty; `message` only if there is one."""
    last = results.steps[-1] if results.steps else None
    return {
        "version": results.version,
        "status": results.status,
        **({"message": results.message} if results.message else {}),
        "steps": [],
        "contact": {name: _zone(zone, results, name) for name, zone in (last.contact if last else {}).items()},
        "balance": _balance(results, worst),
        "loads": [load._asdict() for load in results.loads],
        "stress": results.stress,
        "energy": None if last is None else last.energy,
        "sizes": results.sizes,
        "timings": results.timings,
        "memory": results.memory,
    }


def _step(step: StepFigures) -> dict[str, Any]:
    told = {name: getattr(step, name) for name in STEP_KEYS}
    return told if step.motion is None else told | {name: getattr(step.motion, name) for name in MOTION_KEYS}


def _zone(zone: ZoneFigures, results: Results, name: str) -> dict[str, Any]:
    """Return the slave and the master of a zone, why the slave was chosen if it was, and the figures."""
    slave, master, why = results.roles.get(name, ("", "", ""))
    roles = {"slave": slave, "master": master} | ({"why": why} if why else {}) if slave else {}
    told = {f.name: getattr(zone, f.name) for f in fields(ZoneFigures)}
    return {**roles, **told, "overlap_at_start": results.overlap.get(name, float("nan"))}


def _balance(results: Results, worst: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the largest imbalance of all steps; NaN counts as the largest."""
    told = {}
    for k, name in enumerate(_BALANCE):
        before = [float("nan") if worst[name] is None else worst[name]] if name in worst else []
        values = np.array([*before, *(step.balance[k] for step in results.steps)], float)
        told[name] = float(values.max()) if len(values) else None
    return told


def _line(value: Any) -> str:
    return json.dumps(_plain(value), ensure_ascii=False, allow_nan=False).encode("utf-8", "replace").decode()


def _plain(value: Any) -> Any:
    """Return a value in types that JSON has: None for NaN and infinity, lists for arrays."""
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _read(path: Path) -> dict[str, Any]:
    """Read the results of an earlier run; return an empty dict if there are none. Raises ReadError."""
    if not path.exists():
        return {}
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(told, dict) and all(isinstance(step["time"], (int, float)) for step in told["steps"]):
            return told
        reason = "it holds something else"
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    raise ReadError(path, f"cannot be gone on with ({reason}); write into another folder")
