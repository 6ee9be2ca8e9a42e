"""results.json: the figures of a run, valid after every step.

Values that are not finite are null. The lines of the steps are kept, so that only that of a new step is made; the file
is replaced as a whole, so that it is valid at any time.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import ReadError
from lacmesh.formats.output import replace_file
from lacmesh.mesh import Floats
from lacsolver.output.names import MESH, RESULTS
from lacsolver.output.tables import until
from lacsolver.results.results import Results, StepFigures, ZoneFigures

#: figures of a step in results.json
STEP_KEYS = ("time", "iterations", "halvings", "residuals", "reactions", "probes")
#: further figures of a step, if the case has what they are of
JOINT_KEYS = ("equations", "couplings", "pretension")
#: further figures of a step of a case with [dynamics]
MOTION_KEYS = ("energies", "momentum", "impulse", "velocities", "accelerations")
_BALANCE = ("force", "moment")


class Summary:
    """The file results.json of a folder. `end`: keep the steps of an existing file up to this time, and add to them."""

    def __init__(self, folder: Path, end: float | None = None) -> None:
        self._path = folder / RESULTS
        before = {} if end is None else _read(self._path)
        self._steps = [_line(step) for step in before.get("steps", []) if until(step["time"], end or 0.0)]
        self._balance = np.full(len(_BALANCE), -np.inf)
        if self._steps:
            worst = [before.get("balance", {}).get(name, -np.inf) for name in _BALANCE]
            self._balance = np.array([np.nan if value is None else value for value in worst])
        self._count = 0

    def write(self, results: Results) -> None:
        """Write the results so far. Raises WriteError."""
        new, self._count = results.steps[self._count :], len(results.steps)
        self._steps += [_line(_step(step)) for step in new]
        for step in new:
            self._balance = np.maximum(self._balance, step.balance)  # NaN counts as the largest
        head, tail = _parts(results, self._balance)
        steps = ",".join(f"\n  {line}" for line in self._steps)
        replace_file(self._path, f"{head}{steps}{tail}".encode())


def _parts(results: Results, balance: Floats) -> tuple[str, str]:
    """Return what precedes the steps in the file, and what follows them; `message` only if there is one."""
    last = results.steps[-1] if results.steps else None
    message = {"message": results.message} if results.message else {}
    units = {"units": results.units} if results.units else {}
    head = {"version": results.version, "status": results.status, **message, **units}
    tail = {
        "contact": {name: zone_content(zone, results, name) for name, zone in (last.contact if last else {}).items()},
        **({"pretension": _named(last.pretension)} if last and last.pretension else {}),
        **({"cyclic": results.sectors} if results.sectors else {}),
        "balance": dict(zip(_BALANCE, balance.tolist(), strict=True)),
        "loads": [load._asdict() for load in results.loads],
        "stress": results.stress,
        "energy": None if last is None else last.energy,
        "sizes": results.sizes,
        "timings": results.timings,
        "memory": results.memory,
    }
    first, rest = (
        ",".join(f"\n {_line(name)}: {_line(value)}" for name, value in part.items()) for part in (head, tail)
    )
    return f'{{{first},\n "steps": [', f"\n ],{rest}\n}}\n"


def _step(step: StepFigures) -> dict[str, Any]:
    figures = {name: getattr(step, name) for name in STEP_KEYS}
    figures |= {} if step.work is None else {"work": step.work._asdict()}
    figures |= {} if step.plastic is None else {"plastic": step.plastic._asdict()}
    figures |= {name: _named(getattr(step, name)) for name in JOINT_KEYS if getattr(step, name)}
    return figures if step.motion is None else figures | {name: getattr(step.motion, name) for name in MOTION_KEYS}


def _named(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return figures by name, with the names of what they consist of; those that are None are left out."""
    return {
        name: {k: v for k, v in one._asdict().items() if v is not None} if hasattr(one, "_asdict") else one
        for name, one in figures.items()
    }


def zone_content(zone: ZoneFigures, results: Results, name: str) -> dict[str, Any]:
    """Return the slave and the master of a zone, why the slave was chosen if it was, and the figures."""
    slave, master, why = results.roles.get(name, ("", "", ""))
    roles = {"slave": slave, "master": master} | ({"why": why} if why else {}) if slave else {}
    figures = {f.name: getattr(zone, f.name) for f in fields(ZoneFigures) if f.name != "friction"}
    figures |= {} if zone.friction is None else zone.friction._asdict()
    figures |= {"adjusted": results.adjusted[name]._asdict()} if name in results.adjusted else {}
    figures |= {"gap_bridged": results.bridged[name]} if name in results.bridged else {}
    return {**roles, **figures, "overlap_at_start": results.overlap.get(name, float("nan"))}


def read_summary(folder: Path) -> dict[str, Any]:
    """Return the content of results.json of a folder. Raises ReadError for none, or an older one."""
    path = folder / RESULTS
    if not path.is_file():
        raise ReadError(folder, f"holds no results of a run (no {RESULTS})")
    summary: dict[str, Any] = read_json(path, lambda s: isinstance(s, dict) and {"status", "steps"} <= set(s))
    if summary["steps"] and not (folder / MESH).is_file():
        raise ReadError(folder, "is of an older lacsolver, whose files hold other things; run the case again")
    return summary


def read_json(path: Path, is_ours: Callable[[Any], bool], failed: str = "cannot be read", advice: str = "") -> Any:
    """Return the content of a JSON file. Raises ReadError, in the words `failed` and with `advice`, for another one.

    `is_ours` may raise KeyError and TypeError for other content.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if is_ours(content):
            return content
        reason = "it holds something else"
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    raise ReadError(path, f"{failed} ({reason}){advice}")


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

    def is_ours(content: Any) -> bool:
        return isinstance(content, dict) and all(isinstance(step["time"], (int, float)) for step in content["steps"])

    content: dict[str, Any] = read_json(path, is_ours, "cannot be gone on with", "; write into another folder")
    return content
