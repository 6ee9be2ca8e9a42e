"""What is shown while a case is solved: iterations on a terminal or in a notebook, and a line for each step."""

from __future__ import annotations

import sys
import time
from collections import deque
from typing import TYPE_CHECKING, Any, Literal

from lacsolver.results.step_table import step_columns, step_lines

if TYPE_CHECKING:
    from lacsolver.case import Case
    from lacsolver.equilibrium.attempt import Progress
    from lacsolver.results.results import StepFigures

#: iterations of the current step that are shown at a time
SHOWN = 8
#: least time between two updates of the iterations, in seconds
_PAUSE = 0.1


def shows_more() -> bool:
    """Return True if stderr is a terminal, or the output that of a notebook, which show iterations too."""
    if sys.stderr.isatty():
        return True
    if "IPython" not in sys.modules:
        return False
    from rich.console import Console

    return Console(stderr=True).is_jupyter


class Watch:
    """Shows the solution of a case, from the calls of `iterated` for each iteration and of `stepped` for each step.

    Iterations are shown on the terminal of stderr, or in a notebook, and removed afterwards; steps are lines of
    the `stream`. `time`: time of the last converged step, or None. Nothing is shown if `quiet`.
    """

    def __init__(self, case: Case, stream: Literal["stdout", "stderr"], *, quiet: bool = False) -> None:
        self.time: float | None = None
        self._stream, self._quiet, self._end = stream, quiet, case.steps.last
        self._columns, self._steps = step_columns(case), 0
        self._iterations: deque[Progress] = deque(maxlen=SHOWN)
        self._begun, self._shown = time.perf_counter(), 0.0
        self._live: Any = None
        if not quiet and shows_more():
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
        return self

    def log(self, message: str) -> None:
        """Print a message above what is shown, on stderr."""
        if self._live:
            self._live.console.print(message)
        else:
            print(message, file=sys.stderr, flush=True)

    def __exit__(self, *error: object) -> None:
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
        for line in () if self._quiet else step_lines(self._columns, self._steps, step):
            # the stream of now, which is above what is shown; a log is read while it grows
            print(line, file=getattr(sys, self._stream), flush=True)

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
