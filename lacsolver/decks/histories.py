"""Histories over the steps: what a load, support or temperature is at every time, as a value of a case.

Without an amplitude a value grows linearly over its step from what it was (or at once, with AMPLITUDE=STEP), and keeps
its value in later steps. With an amplitude it is the factor of the amplitude times the value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lacmesh.mesh import Floats, Ints
from lacsolver.case.value import interpolate
from lacsolver.decks.cards import Refused
from lacsolver.decks.content import Amplitude, Assigned, DeckStep

Points = list[tuple[float, float]]
#: part of a step in which a value jumps
JUMP = 1e-9


@dataclass(frozen=True, eq=False)
class Orders:
    """Orders of the steps for some items: nodes, facets or cells.

    `items` (k,) sorted; `value` (steps, components, k), NaN where a step says nothing; `amplitude` (steps, components,
    k): index into `amplitudes`, -1 for none; `lines`: the lines of the deck that they come from; `first` (k,): the
    index of the first line that names an item.
    """

    items: Ints
    value: Floats
    amplitude: Ints
    amplitudes: tuple[str, ...]
    lines: tuple[Assigned, ...]
    first: Ints

    def line_of(self, at: int) -> Assigned:
        """Return the first line that names the item with index `at` in `items`."""
        return self.lines[int(self.first[at])]


def orders_of(lines: Sequence[Assigned], n_steps: int, n_components: int, adds: bool) -> Orders:
    """Return the orders of lines of one kind, in their order.

    `adds`: lines of one step for the same item add, as loads do; else the last one counts. Raises Refused if those that
    add have several amplitudes.
    """
    none = np.empty(0, np.int64)
    items = np.unique(np.concatenate([none, *(line.items for line in lines)]))
    shape = (max(n_steps, 1), n_components, len(items))
    value, amplitude = np.full(shape, np.nan), np.full(shape, -1)
    names = tuple(dict.fromkeys(line.amplitude for line in lines if line.amplitude))
    first = np.full(len(items), len(lines))
    for number, line in enumerate(lines):
        at = np.searchsorted(items, line.items)
        first[at] = np.minimum(first[at], number)
        index = names.index(line.amplitude) if line.amplitude else -1
        for component in line.components:
            own, which = value[max(line.step, 0), component], amplitude[max(line.step, 0), component]
            again = ~np.isnan(own[at]) & adds
            if (which[at][again] != index).any():
                raise Refused("it adds to a load with another amplitude; give both the same amplitude", line.row)
            own[at] = np.where(again, own[at], 0.0) + line.value
            which[at] = index
    return Orders(items, value, amplitude, names, tuple(lines), first)


def history(
    steps: Sequence[DeckStep], value: Floats, amplitude: Sequence[Amplitude | None], start: float = 0.0
) -> Points:
    """Return the history ((t, v), ...) of one component: `value` (steps,), NaN where a step says nothing.

    `amplitude`: that of each step; `start`: the value at time 0. Raises Refused for a load whose amplitude counts the
    time of a step, in a later step that does not repeat it.
    """
    points: Points = [(0.0, start)]
    last: tuple[float, Amplitude] | None = None
    for step, new, factor in zip(steps, value.tolist(), amplitude, strict=True):
        if not np.isnan(new):
            last = (new, factor) if factor else None
            part = _sampled(step, new, factor) if factor else _grown(step, new)
        elif last is not None and last[1].total:
            part = _sampled(step, *last)
        elif last is not None and _ends_varied(last[1]):
            raise Refused("loads whose amplitude counts the time of a step should be repeated in the later steps")
        else:
            part = [(step.end, points[-1][1])]
        if part[0][0] <= step.begin and part[0][1] != points[-1][1]:  # a jump at the beginning of the step
            points = points[:-1] if step.begin == 0 else points
            part[0] = (step.begin + (JUMP * step.period if step.begin else 0.0), part[0][1])
        points += [row for row in part if not points or row[0] > points[-1][0]]
    return points


def _grown(step: DeckStep, value: float) -> Points:
    return [(step.begin, value), (step.end, value)] if step.sudden else [(step.end, value)]


def _ends_varied(amplitude: Amplitude) -> bool:
    return len({factor for _, factor in amplitude.rows}) > 1


def _sampled(step: DeckStep, value: float, amplitude: Amplitude) -> Points:
    """Return the factors of an amplitude over a step, times a value."""
    origin = 0.0 if amplitude.total else step.begin
    inside = [t + origin for t, _ in amplitude.rows if step.begin < t + origin < step.end]
    times = [step.begin, *inside, step.end]
    return [(t, value * interpolate(amplitude.rows, t - origin)) for t in times]


def written(points: Points, end: float, start: float = 0.0) -> Any:
    """Return a history as the value of a case: a number where that is ramped so, else a table of times.

    `start`: what a number is ramped from.

    >>> written([(0.0, 0.0), (1.0, 2.0), (2.0, 4.0)], 2.0), written([(0.0, 0.0), (1.0, 4.0), (2.0, 4.0)], 2.0)
    (4.0, [[0.0, 0.0], [1.0, 4.0]])
    """
    kept: Points = []
    for k, (t, v) in enumerate(points):
        after = points[k + 1] if k + 1 < len(points) else None
        if kept and after and abs(interpolate((kept[-1], after), t) - v) <= 1e-14 * max(abs(v), abs(after[1])):
            continue
        kept.append((t, v))
    while len(kept) > 1 and kept[-1][1] == kept[-2][1]:
        kept.pop()
    if kept == [(0.0, start)] or (len(kept) == 2 and kept[0] == (0.0, start) and kept[1][0] == end):
        return kept[-1][1]
    return [list(row) for row in kept]
