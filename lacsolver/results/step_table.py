"""The table of the steps of a run as text: a heading, and a line for each step, on a terminal as in a log."""

from __future__ import annotations

from collections.abc import Iterator

from lacsolver.case import Case
from lacsolver.results.results import StepFigures

#: columns: heading, width
_STEP = (("step", 5), ("time", 11), ("iterations", 12), ("cutbacks", 10), ("balance", 9))
_CONTACT, _FRICTION, _PRESSURE = (("in contact", 16),), (("sticking", 10), ("sliding", 9)), (("max pressure", 14),)


def step_columns(case: Case) -> tuple[tuple[str, int], ...]:
    """Return the heading and the width of each column for a case: those of contact if it has any, and of friction.

    >>> from lacsolver import read_case
    >>> [heading for heading, _ in step_columns(read_case("data/two_blocks.toml"))]
    ['step', 'time', 'iterations', 'cutbacks', 'balance', 'in contact', 'max pressure']
    """
    if not (case.contact or case.ties):
        return _STEP
    friction = _FRICTION if any(contact.has_friction for contact in case.contact) else ()
    return (*_STEP, *_CONTACT, *friction, *_PRESSURE)


def step_lines(columns: tuple[tuple[str, int], ...], number: int, step: StepFigures) -> Iterator[str]:
    """Yield the line of the step with a number, counted from 1; before the first one the heading."""
    if number == 1:
        yield "".join(f"{name:>{width}}" for name, width in columns)
    cells = dict(_cells(number, step))
    yield "".join(f"{cells[name]:>{width}}" for name, width in columns)


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
