"""Writer of a run: figures after every converged step; fields, contact tables and states at the steps of [output].

Fields and state of the last converged step of a run are written in any case, to look at them and for a restart; for a
finished run with times in [output], the state alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

from lacmesh.errors import RequestError
from lacmesh.formats.output import signals_wait
from lacsolver.case import Case, Output
from lacsolver.output.folder import OutputFolder, make_folder
from lacsolver.output.names import UNCONVERGED, contact_stems
from lacsolver.output.ring import asked
from lacsolver.output.states import TimeWriter
from lacsolver.output.summary import Summary
from lacsolver.output.tables import History, add_contact, cut_off, same_time
from lacsolver.output.vtu import VtuSeries
from lacsolver.results.results import Fields, Restart, Results
from lacsolver.results.whole import Order
from lacsolver.space.space import Space


class Writer:
    """Writes a run into its folder, in which the results of an earlier run are removed here, or continued.

    `prints`: fingerprint of the case and its mesh, stored with states; `orders`: those of
    `lacsolver.results.whole.orders_of`. Of several processes all call the same methods, and the first one writes what
    is not a part of each. Raises WriteError, RequestError if results have come into the folder that would be lost, and
    ReadError if files to be continued are damaged. Signals are delayed until a file is complete.
    """

    def __init__(
        self, folder: OutputFolder, case: Case, space: Space, prints: Mapping[str, str],
        orders: Mapping[str, Order] | None = None,
    ) -> None:  # fmt: skip
        self._path, self._output, self._space = folder.path, case.output, space
        self._share, self._sector = space.share, asked(case)
        if case.output.format == "med":
            from lacsolver.output.med import check_names

            check_names(folder.path, [zone.name for zone in (*case.contact, *case.ties)])
        with signals_wait():
            self._share.on_first(lambda: self._take(folder))
            self._times = TimeWriter(folder.path, space, prints, orders or {})
            self._series = None if case.output.format == "med" else VtuSeries(folder.path, space, self._sector)
        #: the last converged step, if its fields are not written yet: the function that makes them, and its state
        self._unwritten: tuple[Callable[[], Fields], Restart] | None = None

    def _take(self, folder: OutputFolder) -> None:
        """Open the tables, and clear the folder of results after the time of a restart that goes on there."""
        end = folder.restart.time if folder.restart else None
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
            self._share.on_first(lambda: self._add_figures(results))
            self._unwritten = fields, state  # before a signal that came up meanwhile does
        if not is_due(self._output, state.number, state.time):
            return False
        values = fields()  # it may take its time: a signal that comes up here leaves the rest to `finish`
        with signals_wait():
            self._unwritten = None
            self._write(values, state)
        return True

    def finish(self, results: Results, tried: Callable[[], Fields] | None = None) -> None:
        """Write the status at the end, and fields and state of the last converged step if they are not written yet.

        For a finished run with times in [output], only the state is added. `tried`: fields of the last state tried by a
        run that failed, which are written to the subfolder `unconverged`.
        """
        unwritten, self._unwritten = self._unwritten, None
        state_alone = results.status == "done" and self._output.times
        last = unwritten[0]() if unwritten and not state_alone else None
        failed = tried() if tried else None
        with signals_wait():
            self._share.on_first(lambda: self._summary.write(results))
            if unwritten and last:
                self._write(last, unwritten[1])
            elif unwritten:
                self._times.write(unwritten[1], None)
            if self._series is None and results.steps:
                self._share.on_first(self._export)
            if failed:
                self._share.on_first(lambda: make_folder(self._path / UNCONVERGED))
                VtuSeries(self._path / UNCONVERGED, self._space, self._sector).write(failed, 1)

    def _export(self) -> None:
        from lacsolver.output.med import write_med  # with h5py, which few runs need

        with suppress(RequestError):  # no fields were due
            write_med(self._path)

    def _add_figures(self, results: Results) -> None:
        """Add the last step to the table of the history, and write the summary."""
        self._history.add(results.steps[-1])
        self._summary.write(results)

    def _write(self, fields: Fields, state: Restart) -> None:
        """Write the fields for ParaView, the tables of contacts, and last what a restart needs."""
        if self._series is not None:
            self._series.write(fields, state.number)

        def tables() -> None:
            for zone, stem in contact_stems(fields.zones).items():
                add_contact(self._path / f"{stem}.csv", fields.time, fields.zones[zone])

        self._share.on_first(tables)
        self._times.write(state, fields)


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
