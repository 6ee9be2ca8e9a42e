"""Writer of a run: figures after every converged step; fields, contact tables and states at the steps of [output].

Fields and state of the last converged step of a run are written in any case, to look at them and for a restart; for a
finished run with times in [output], the state alone.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple, Protocol

from lacmesh.errors import WriteError
from lacmesh.formats.output import signals_wait
from lacsolver.case import Case, Output
from lacsolver.output.folder import OutputFolder
from lacsolver.output.names import UNCONVERGED, contact_stems
from lacsolver.output.states import write_state
from lacsolver.output.summary import Summary
from lacsolver.output.tables import History, add_contact, cut_off, same_time
from lacsolver.output.vtu import VtuSeries
from lacsolver.results.results import Fields, Restart, Results
from lacsolver.space.space import Space


class Series(Protocol):
    """Interface of files with fields in some format, to which times are added."""

    def write(self, fields: Fields, number: int) -> None:
        """Add the fields after `number` steps. Raises WriteError."""


class _Unwritten(NamedTuple):
    """The last converged step, if its fields are not written yet: the function that makes them, and its state."""

    fields: Callable[[], Fields]
    state: Restart


class Writer:
    """Writes a run into its folder, in which the results of an earlier run are removed here, or continued.

    `prints`: fingerprint of the case and its mesh, stored with states; `whole`: function that makes states of the whole
    model from those of a process's share. Of several processes all call the same methods, and the first one writes what
    is not a part of each. The folder is locked against other runs until
    `finish`. Raises WriteError, RequestError if another run writes there, and ReadError if files to be continued are
    damaged. Signals are delayed until a file is complete.
    """

    def __init__(
        self, folder: OutputFolder, case: Case, space: Space, prints: Mapping[str, str],
        whole: Callable[[Restart], Restart] = lambda state: state,
    ) -> None:  # fmt: skip
        self._path, self._output, self._space, self._prints = folder.path, case.output, space, prints
        self._whole, self._share, self._zones = (
            whole,
            space.share,
            tuple(zone.name for zone in (*case.contact, *case.tie)),
        )
        end = folder.restart.time if folder.restart else None
        with signals_wait():
            self._share.on_first(lambda: self._take(folder, end))
            self._series = self._fields_to(folder.path, end)
        self._unwritten: _Unwritten | None = None

    def _take(self, folder: OutputFolder, end: float | None) -> None:
        """Lock the folder, clear it of results after the time `end`, and open its tables."""
        self._let_go = weakref.finalize(self, folder.hold())  # by `finish`, or with this writer
        self._history, self._summary = History(folder.path, end), Summary(folder.path, end)
        folder.take()
        if end is not None:
            for table in folder.path.glob("contact_*.csv"):
                cut_off(table, end)

    def step(self, results: Results, fields: Callable[[], Fields], state: Restart) -> bool:
        """Write a converged step, the last of `results.steps`; return True if its fields and state were written.

        `fields` is called if they are due, or later, by `finish`, if this is the last step.
        """
        with signals_wait():
            self._share.on_first(lambda: self._tell(results))
            self._unwritten = _Unwritten(fields, state)  # before a signal that came up meanwhile does
        if not is_due(self._output, state.number, state.time):
            return False
        made = fields()  # it may take its time: a signal that comes up here leaves the rest to `finish`
        with signals_wait():
            self._unwritten = None
            self._write(made, state)
        return True

    def finish(self, results: Results, tried: Callable[[], Fields] | None = None) -> None:
        """Write the status at the end, and fields and state of the last converged step if they are not written yet.

        For a finished run with times in [output], only the state is added. `tried`: fields of the last state tried by a
        run that failed, which are written to the subfolder `unconverged`.
        """
        last, self._unwritten = self._unwritten, None
        made = last.fields() if last and not (results.status == "done" and self._output.times) else None
        failed = tried() if tried else None
        with signals_wait(), ExitStack() as ending:
            ending.callback(self._release)
            self._share.on_first(lambda: self._summary.write(results))
            if last and made:
                self._write(made, last.state)
            elif last:
                self._state(last.state)
            if failed:
                self._share.on_first(lambda: _made(self._path / UNCONVERGED))
                self._fields_to(self._path / UNCONVERGED).write(failed, 1)

    def _release(self) -> None:
        if self._share.rank == 0:
            self._let_go()

    def _tell(self, results: Results) -> None:
        """Add the last step to the table of the history, and write the summary."""
        self._history.add(results.steps[-1])
        self._summary.write(results)

    def _fields_to(self, folder: Path, end: float | None = None) -> Series:
        """Return the files of fields in a folder; `end`: existing ones are continued after this time."""
        if self._output.format == "med":
            from lacsolver.output.med import MedSeries  # with h5py, which few runs need

            return MedSeries(folder, self._space, self._zones, end)
        return VtuSeries(folder, self._space)

    def _write(self, fields: Fields, state: Restart) -> None:
        self._series.write(fields, state.number)

        def tables() -> None:
            for zone, stem in contact_stems(fields.zones).items():
                add_contact(self._path / f"{stem}.csv", fields.time, fields.zones[zone])

        self._share.on_first(tables)
        self._state(state)

    def _state(self, state: Restart) -> None:
        whole = self._whole(state)
        self._share.on_first(lambda: write_state(self._path, whole, self._prints))


def is_due(output: Output, number: int, time: float) -> bool:
    """True if the fields and state after `number` steps, at a time, are to be written.

    >>> [is_due(Output(every=2), k, 0.25 * k) for k in (1, 2, 3)]
    [False, True, False]
    >>> [is_due(Output(times=(0.3,)), k, 0.1 * k) for k in (1, 2, 3)]
    [False, False, True]
    """
    if output.times is not None:
        return any(same_time(time, t) for t in output.times)
    return number % (output.every or 1) == 0


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise WriteError(folder, f"cannot be made ({error.strerror or error})") from error
    return folder
