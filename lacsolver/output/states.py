"""States for a restart: a file state_NUMBER.npz for every time that is written.

A file holds the arrays of a `Restart`, and, as JSON in the bytes of `about`, its numbers, the names of its zones and
rigid bodies, and the fingerprint of the case (`lacsolver.case.fingerprint`).
"""

from __future__ import annotations

import json
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError, ReadError, RequestError, reading
from lacmesh.mesh import Mesh
from lacsolver.case import Case, changed, fingerprint, fingerprint_as
from lacsolver.contact.anchors import Anchors
from lacsolver.distributed.share import ALONE, Share
from lacsolver.output.arrays import StoredRows, rows_in, rows_of, write_arrays
from lacsolver.output.names import state_file, states_in
from lacsolver.output.tables import same_time
from lacsolver.problem.roles import with_roles
from lacsolver.problem.skin import mesh_of
from lacsolver.results.results import Restart
from lacsolver.results.state import Histories, Iterate, StepState, Work
from lacsolver.results.whole import Order, grows, whole_arrays, with_arrays

#: raised when the meaning of a state's data changes; 3: the mesh in memory, rotations of rigid bodies as lengths
VERSION = 3
_ABOUT, _WORK = "about", "work"
_NONE: Mapping[str, Order] = MappingProxyType({})
#: errors that numpy raises for a damaged file
_DAMAGE = (
    *(OSError, ValueError, KeyError, TypeError, EOFError, IndexError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)


def write_state(
    folder: Path, state: Restart, prints: Mapping[str, str], share: Share = ALONE, orders: Mapping[str, Order] = _NONE
) -> None:
    """Write a state; `prints`: the fingerprint of its case. An existing file is replaced at the end.

    All processes of a `share` call this, and the first one writes; the arrays with an order come to it piece after
    piece. Raises WriteError, on all of them.
    """
    large = whole_arrays(state)
    small = {name: values for name, values in _arrays(state, prints).items() if name not in large}
    rows = {name: StoredRows.of(values, orders.get(name)) for name, values in large.items()}
    failed: Exception | None = None
    if share.rank == 0:
        try:
            write_arrays(folder / state_file(state.number), small, rows)
        except Exception as error:
            failed = error
    for array in rows.values():  # what other processes give, and what is left after a failure
        for _ in array.pieces:
            pass
    share.agree(failed)


def _arrays(state: Restart, prints: Mapping[str, str]) -> dict[str, NDArray]:
    """Return all arrays of a file, by their names."""
    step, histories = state.step, state.step.histories
    assert step.iterate is not None
    about = {
        **{"version": VERSION, "time": float(state.time), "step_size": float(state.step_size)},
        **{"number": state.number, "case": dict(prints)},
        **{"zones": list(state.multipliers), "rigid": list(state.rigid)},
        **{"earlier": None if step.earlier is None else float(step.earlier[0])},
        **{"scheme": list(step.histories.scheme)},
    }
    arrays = {_ABOUT: np.frombuffer(json.dumps(about).encode(), np.uint8), "u": state.u}
    for k, zone in enumerate(state.multipliers):
        arrays |= {f"multipliers_{k}": state.multipliers[zone], f"status_{k}": state.status[zone]}
    arrays |= {f"rigid_{k}": dofs for k, dofs in enumerate(state.rigid.values())}
    arrays |= {f"now_{name}": values for name, values in step.iterate._asdict().items()}
    if step.earlier is not None:
        arrays |= {f"earlier_{name}": values for name, values in step.earlier[1]._asdict().items()}
    arrays |= {f"materials_{k}": values for k, values in enumerate(histories.materials)}
    arrays |= {f"contact_{k}": values for k, values in enumerate(histories.contact)}
    for k, anchors in enumerate(histories.anchors):
        arrays |= {f"anchors_{k}_{name}": values for name, values in anchors._asdict().items()}
    arrays |= {} if step.work is None else {_WORK: np.array(step.work)}
    return arrays | {f"scheme_{k}": values for k, values in enumerate(histories.scheme.values())}


def read_state(
    folder: str | os.PathLike[str], case: Case, from_time: float | None = None, *, mesh: Mesh | None = None,
    large: bool = True,
) -> Restart:  # fmt: skip
    """Read a state that an earlier run of the same case wrote: the last one, or the one at time `from_time`.

    `mesh`: the mesh of the run, as for `run`; the case's file is read if None. `large`: False leaves the arrays that
    grow with the model empty, for several processes, which `run` gives their shares of the file, and leaves it to `run`
    to compare case and mesh. Raises RequestError if there is no state (or none at that time; the message lists the
    others), DataError if the case or the mesh differs (the message names the differences), ReadError for a folder or
    file that cannot be read.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import read_case, run
    >>> from lacsolver.output import create_output
    >>> case = read_case("data/two_blocks.toml")
    >>> with TemporaryDirectory() as folder:
    ...     done = run(case, create_output(folder))
    ...     read_state(folder, case).time
    1.0
    """
    folder = Path(folder)
    with reading(folder):
        paths = states_in(folder)
    if not paths:
        raise RequestError(f"{folder} holds no state to go on from (state_*.npz); name the folder of an earlier run")
    path = paths[-1] if from_time is None else _at(folder, paths, from_time)
    with _damage_in(path, _others(folder, paths, path)), _opened(path) as file:
        about = _about(path, file)
        state = _restart(file if large else _Light(file), about, folder)
    if large:
        check_same(state, case, mesh_of(case, mesh))
    return state


def scatter_state(state: Restart, share: Share, orders: Mapping[str, Order]) -> Restart:
    """Return the share of this process in a state, of which the first process has the whole arrays, or their file.

    All processes call this. Raises RequestError for a state with histories of an added time scheme, ReadError.
    """
    if state.step.histories.scheme and state.step.motion is None:
        raise RequestError("a state with histories of an added time scheme goes on in one process only")
    own, failed = {}, None
    for name, values in whole_arrays(state).items():
        source = _Source(state, name, values) if share.rank == 0 else None
        own[name] = orders[name].deal(source.read if source else lambda n: np.empty(0))
        failed = failed or (source.failed if source else None)
    share.agree(failed)
    return with_arrays(state, own)


class _Source:
    """The rows of an array of a state, from memory, or from its file if they were left there; `failed`: an error."""

    def __init__(self, state: Restart, name: str, values: NDArray) -> None:
        self.failed: Exception | None = None
        self._path = state.folder / state_file(state.number) if state.folder and not len(values) else None
        self._shape = values.shape[1:]
        self._rows = rows_of(values) if self._path is None else rows_in(self._path, name)
        next(self._rows)

    def read(self, n: int) -> NDArray:
        """Return the next n rows; zeros after an error, which is kept until all processes have been served."""
        try:
            if self._path is None:
                return self._rows.send(n)
            with _damage_in(self._path, "start anew"):
                return self._rows.send(n)
        except ReadError as error:
            self.failed = error
            return np.zeros((n, *self._shape))


class _Light(Mapping[str, NDArray]):
    """The arrays of a file, without the rows of those that grow with the model."""

    def __init__(self, file: Mapping[str, NDArray]) -> None:
        self._file = file

    def __getitem__(self, name: str) -> NDArray:
        return self._file[name] if not grows(name) else np.empty((0, 1, 1) if name.startswith("materials") else 0)

    def __iter__(self) -> Iterator[str]:
        return iter(self._file)

    def __len__(self) -> int:
        return len(self._file)


def check_same(state: Restart, case: Case, mesh: Mesh, prints: Mapping[str, str] | None = None) -> None:
    """Raise DataError if a state belongs to another case or mesh; `prints`: the fingerprint of these, if known."""
    if state.case is None:
        return
    prints = fingerprint(with_roles(case, mesh), mesh) if prints is None else prints
    same = fingerprint_as(state.case, prints, case, mesh)
    differs = changed(state.case, same)
    if differs:
        whose = "the state to go on from is" if state.folder is None else f"the states in {state.folder} are"
        older = "mesh" in differs and same is not prints
        advice = ", start as many processes as that run of an older lacsolver had" if older else ""
        raise DataError(f"{whose} of another case: {', '.join(differs)} changed; restore it{advice}, or start anew")


def _restart(file: Mapping[str, NDArray], about: Mapping[str, Any], folder: Path) -> Restart:
    zones = list(enumerate(about["zones"]))
    earlier = None if about["earlier"] is None else (about["earlier"], _iterate(file, "earlier"))
    scheme = {name: file[f"scheme_{k}"] for k, name in enumerate(about.get("scheme", ()))}
    histories = Histories(_numbered(file, "materials"), _numbered(file, "contact"), scheme, _anchors(file))
    work = Work(*file[_WORK].tolist()) if _WORK in file else None
    return Restart(
        step=StepState(about["time"], _iterate(file, "now"), earlier, about["step_size"], histories, work),
        number=about["number"],
        u=file["u"],
        multipliers={name: file[f"multipliers_{k}"] for k, name in zones},
        status={name: file[f"status_{k}"] for k, name in zones},
        rigid={name: file[f"rigid_{k}"] for k, name in enumerate(about["rigid"])},
        folder=folder,
        case=about["case"],
    )


def _iterate(file: Mapping[str, NDArray], when: str) -> Iterate:
    return Iterate(*(file[f"{when}_{name}"] for name in Iterate._fields))


def _anchors(file: Mapping[str, NDArray]) -> tuple[Anchors, ...]:
    """Return the anchors of the friction of each pair; none in files of cases without it."""
    count = sum(name.startswith("anchors_") for name in file) // len(Anchors._fields)
    return tuple(Anchors(*(file[f"anchors_{k}_{name}"] for name in Anchors._fields)) for k in range(count))


def _numbered(file: Mapping[str, NDArray], what: str) -> tuple[NDArray, ...]:
    """Return the arrays what_0, what_1 ... of a file; none in files of versions that had no histories."""
    return tuple(file[f"{what}_{k}"] for k in range(sum(name.startswith(f"{what}_") for name in file)))


def _about(path: Path, file: Mapping[str, NDArray]) -> dict[str, Any]:
    about = json.loads(file[_ABOUT].tobytes())
    if about["version"] > VERSION:
        raise ReadError(path, "is of a newer lacsolver; go on with that one")
    if about["version"] < VERSION:
        message = "is of an older lacsolver, whose states keep other things and do not tell which mesh they are of"
        raise ReadError(path, f"{message}; run the case again from its start")
    return {**about, "time": float(about["time"]), "number": int(about["number"]), "case": dict(about["case"])}


def _at(folder: Path, paths: list[Path], time: float) -> Path:
    """Return the file of the state at a time. Raises RequestError."""
    times = {path: _time(path) for path in paths}
    matching = [path for path, there in times.items() if there is not None and same_time(there, time)]
    if not matching:
        known = ", ".join(f"{there:.9g}" for there in times.values() if there is not None) or "none that can be read"
        raise RequestError(f"{folder} holds no state at t = {time:.9g}; there are: {known}")
    return matching[-1]


def _time(path: Path) -> float | None:
    """Return the time of a state, None if its file is damaged."""
    try:
        with _opened(path) as file:
            return float(json.loads(file[_ABOUT].tobytes())["time"])
    except _DAMAGE:
        return None


def _others(folder: Path, paths: list[Path], path: Path) -> str:
    """Return advice for a damaged state: an earlier time to restart from, if there is one."""
    times = [f"{there:.9g}" for other in paths if other != path and (there := _time(other)) is not None]
    return f"go on from an earlier time, --from {times[-1]}" if times else f"no other state is in {folder}: start anew"


@contextmanager
def _opened(path: Path) -> Iterator[Mapping[str, NDArray]]:
    """Open the arrays of a file; it is opened here because numpy does not close a file that it cannot read."""
    with path.open("rb") as raw, np.load(raw) as file:
        yield file


@contextmanager
def _damage_in(path: Path, advice: str) -> Iterator[None]:
    try:
        yield
    except _DAMAGE as error:
        raise ReadError(path, f"is damaged or no state ({error}); {advice}") from error
