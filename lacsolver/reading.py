"""Results of a finished run, read from its folder: the history as arrays, and the solution at each time written.

results.json, history.csv -> status, warnings, columns of the history      (docs/output.md)
mesh.npz, state_NUMBER.npz -> mesh, fields                                 at the times of [output]
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError
from lacmesh.facts import Described, listed
from lacsolver.output.finished import FinishedRun
from lacsolver.output.tables import same_time
from lacsolver.solution import Solution


class RunResults(FinishedRun, Described):
    """Results of a run in its folder. `summary`: content of results.json.

    `history`: columns of history.csv by name, an array (steps,) each, NaN where there is no value. `status`: done,
    running, interrupted or failed; `message`: its warnings, or why it is not done.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     done = ls.run(example("two_blocks.toml"), f"{folder}/results")
    ...     results = ls.read_results(f"{folder}/results")
    ...     pressure = results.solution(-1).contact["joint"].pressure
    >>> results.status, results.times.tolist(), len(results.history["time"]), pressure.shape
    ('done', [0.5, 1.0], 2, (36,))
    """

    @property
    def status(self) -> str:
        """Status of the run: done, running, interrupted or failed."""
        return str(self.summary["status"])

    @property
    def message(self) -> str:
        """Warnings of the run, or why it is not done; empty if there is nothing to say."""
        return str(self.summary.get("message", ""))

    @cached_property
    def times(self) -> NDArray[np.floating]:
        """Times (k,) at which fields were written."""
        return np.array(self.stored.times)

    def solution(self, i: int = -1) -> Solution:
        """Return the solution at the i-th of `times`, the last by default. Raises IndexError, ReadError."""
        i = range(len(self.times))[i]
        time, history = float(self.times[i]), self.history
        row = next((k for k, t in enumerate(history["time"]) if same_time(t, time)), None)
        iterations = 0 if row is None else int(history["iterations"][row])
        fields = self.stored.read(i)
        step: Mapping[str, Any] = next((one for one in self.summary["steps"] if same_time(one["time"], time)), {})
        of_step = {
            what: {name: np.array(values, dtype=float) for name, values in step.get(what, {}).items()}
            for what in ("reactions", "probes")
        }
        return Solution(self.stored.mesh, time, iterations, lambda: fields, units=self.units, _of_step=of_step)

    def report(self, path: str | Path) -> None:
        """Write the page of `lacsolver report` on the run. Raises RequestError, ReadError, WriteError."""
        from lacsolver.reporting import write_run_report

        write_run_report(self.folder, path)

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
    results = RunResults(Path(folder))
    results.summary, results.history  # noqa: B018 (raises where they are missing)
    return results
