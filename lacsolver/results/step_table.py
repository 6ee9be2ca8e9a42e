"""The table of the steps of a run as text: a heading, and a line for each step, on a terminal as in a log."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lacsolver.case import Case
from lacsolver.results.results import StepFigures

#: columns: heading, width
_STEP = (("step", 5), ("time", 11), ("iterations", 12), ("cutbacks", 10), ("balance", 9))
_CONTACT, _FRICTION, _PRESSURE = (("in contact", 16),), (("sticking", 10), ("sliding", 9)), (("max pressure", 14),)


class StepTable(NamedTuple):
    """Lines on the steps of a run. `columns`: heading and width of each.

    >>> from lacsolver import read_case
    >>> StepTable.of(read_case("data/two_blocks.toml")).heading
    ' step       time  iterations  cutbacks  balance      in contact  max pressure'
    """

    columns: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, case: Case) -> StepTable:
        """Return the table for a case: columns of contact if it has any, and of friction."""
        if not (case.contact or case.ties):
            return cls(_STEP)
        friction = _FRICTION if any(contact.has_friction for contact in case.contact) else ()
        return cls((*_STEP, *_CONTACT, *friction, *_PRESSURE))

    @property
    def heading(self) -> str:
        """The names of the columns."""
        return "".join(f"{name:>{width}}" for name, width in self.columns)

    def lines(self, number: int, step: StepFigures) -> Iterator[str]:
        """Yield the line of the step with a number, counted from 1; before the first one the heading."""
        if number == 1:
            yield self.heading
        cells = dict(_cells(number, step))
        yield "".join(f"{cells[name]:>{width}}" for name, width in self.columns)


def _cells(number: int, step: StepFigures) -> Iterator[tuple[str, str]]:
    """Yield the text of each column of a step."""
    yield "step", f"{number:,}"
    yield "time", f"{step.time:.6g}"
    yield "iterations", f"{step.iterations:,}"
    yield "cutbacks", f"{step.halvings:,}"
    yield "balance", f"{max(step.balance):.1e}"
    zones = step.contact.values()
    closed, every = sum(z.active for z in zones), sum(z.active + z.open + z.unpaired for z in zones)
    yield "in contact", f"{closed:,} of {every:,}"
    friction = [zone.friction for zone in zones if zone.friction is not None]
    yield "sticking", f"{sum(one.sticking for one in friction):,}"
    yield "sliding", f"{sum(one.sliding for one in friction):,}"
    yield "max pressure", f"{max((z.pressure_max for z in zones), default=0.0):.6g}"
