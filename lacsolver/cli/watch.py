"""Display of a running solution: the last iterations on a terminal, and a line of output for each step."""

from __future__ import annotations

import sys
import time
from collections import deque
from types import TracebackType
from typing import TYPE_CHECKING, Any

from lacmesh.cli.terminal import on_stderr, tell
from lacsolver.results.step_table import step_columns, step_lines

if TYPE_CHECKING:
    from lacsolver.case import Case
    from lacsolver.equilibrium.attempt import Progress
    from lacsolver.results.results import StepFigures

#: iterations of the current step that are shown at a time
SHOWN = 8
#: least time between two updates of the iterations, in seconds
_PAUSE = 0.1


class Watch:
    """Shows a run, from the calls `told` for each iteration and `stepped` for each step.

    Iterations are shown on the terminal of stderr and removed afterwards; steps are lines of stdout. `time`: time of
    the last converged step, or None.
    """

    def __init__(self, case: Case, *, quiet: bool) -> None:
        self.time: float | None = None
        self._quiet, self._end = quiet, case.steps.last
        self._columns, self._steps = step_columns(case), 0
        self._iterations: deque[Progress] = deque(maxlen=SHOWN)
        self._begun, self._shown = time.perf_counter(), 0.0
        self._live: Any = None
        if sys.stderr.isatty() and not quiet:
            from rich.console import Console
            from rich.live import Live

            self._live = Live(
                get_renderable=self._now,
                console=Console(stderr=True, highlight=False),
                refresh_per_second=8,
                transient=True,
                redirect_stdout=sys.stdout.isatty(),
            )

    def __enter__(self) -> Watch:
        if self._live:
            self._live.start()
            tell(self._live.console.print)
        elif not self._quiet:
            tell(on_stderr)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._live:
            self._live.stop()

    def iterated(self, progress: Progress) -> None:
        """Record an iteration, and update the display."""
        if progress.number == 1:
            self._iterations.clear()
        self._iterations.append(progress)
        now = time.perf_counter()
        if self._live and now - self._shown > _PAUSE:
            self._shown = now
            self._live.refresh()

    def stepped(self, step: StepFigures) -> None:
        """Record a converged step, and print its line."""
        self.time = step.time
        self._steps += 1
        self._iterations.clear()
        if not self._quiet:
            for line in step_lines(self._columns, self._steps, step):
                print(line, flush=True)  # a log is read while it grows

    def _now(self) -> Any:
        """Return the display of the current step and its iterations."""
        from rich.console import Group
        from rich.text import Text

        spent = time.perf_counter() - self._begun
        if not self._iterations:
            done = "preparing" if self.time is None else f"t = {self.time:.6g} of {self._end:g} is done"
            return Text(f"{done}, {spent:.0f} s", style="dim")
        last = self._iterations[-1]
        halved = f", halved {last.halvings} times" if last.halvings else ""
        head = Text(f"towards t = {last.time:.6g} of {self._end:g}{halved}, {spent:.0f} s", style="bold")
        rows = [
            f"  iteration {one.number:3}  closed {one.closed:8,}  balance {one.balance:8.1e}  gaps {one.gap:8.1e}"
            for one in self._iterations
        ]
        return Group(head, *(Text(row, style="dim", no_wrap=True, overflow="ellipsis") for row in rows))
