"""Histories over the steps: what a load, support or temperature is at every time, and the items that have one history.

Without an amplitude a value grows linearly over its step from what it was (or at once, with AMPLITUDE=STEP), and keeps
its value in later steps. With an amplitude it is the factor of the amplitude times the value.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints, concatenated, mask_of
from lacsolver.case.value import interpolate
from lacsolver.decks.cards import Refused
from lacsolver.decks.content import Amplitude, Assigned, DeckContent, DeckStep

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

    def line_of(self, at: int, component: int | None = None) -> Assigned:
        """Return the first line that names the item with index `at` in `items`, and a component of it."""
        if component is None:
            return self.lines[int(self.first[at])]
        item = self.items[at]
        return next(one for one in self.lines if component in one.components and item in one.items)


def orders_of(lines: Sequence[Assigned], n_steps: int, n_components: int, adds: bool) -> Orders:
    """Return the orders of lines of one kind, in their order.

    `adds`: lines of one step for the same item add, as loads do; else the last one counts. Raises Refused if those that
    add have several amplitudes.
    """
    items = np.unique(concatenated(line.items for line in lines))
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
            grown = [(step.begin, new), (step.end, new)] if step.sudden else [(step.end, new)]
            part = _sampled(step, new, factor) if factor else grown
        elif last is not None and last[1].total:
            part = _sampled(step, *last)
        elif last is not None and len({factor for _, factor in last[1].rows}) > 1:
            raise Refused("loads whose amplitude counts the time of a step should be repeated in the later steps")
        else:
            part = [(step.end, points[-1][1])]
        if part[0][0] <= step.begin and part[0][1] != points[-1][1]:  # a jump at the beginning of the step
            points = points[:-1] if step.begin == 0 else points
            part[0] = (step.begin + (JUMP * step.period if step.begin else 0.0), part[0][1])
        points += [row for row in part if not points or row[0] > points[-1][0]]
    return points


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


def parts_of(deck: DeckContent, orders: Orders, *, once: bool) -> Iterator[tuple[Assigned, dict[int, Points]]]:
    """Yield items with the history of each component, which cover every order: whole sets with one, then what is left.

    They are the items of the line that names them first, or of one like it without a name.

    `once`: each component of an item is in one part only, as loads must be; supports may be in several.
    Raises Refused for a history that a case cannot have.
    """
    given: NDArray[np.bool_] = np.asarray(~np.isnan(orders.value).all(axis=0))
    left = given.copy()
    for line in _first_of_sets(orders.lines):
        at = np.searchsorted(orders.items, line.items)
        some = given[:, at].all(axis=1) & _uniform(orders, at)
        some &= left[:, at].all(axis=1) if once else left[:, at].any(axis=1)
        if some.any():
            left[np.ix_(some, at)] = False
            yield line, _histories(deck, orders, int(at[0]), some, line)
    yield from _others(deck, orders, left)


def _first_of_sets(lines: Sequence[Assigned]) -> list[Assigned]:
    """Return the first line of each set, by its name; numbers have none."""
    return list({line.name: line for line in reversed(lines) if line.name}.values())[::-1]


def _uniform(orders: Orders, at: Ints) -> NDArray[np.bool_]:
    """Return a mask (components,), True where all items at `at` have the same orders in all steps."""
    value, amplitude = orders.value[:, :, at], orders.amplitude[:, :, at]
    same = (value == value[:, :, :1]) | (np.isnan(value) & np.isnan(value[:, :, :1]))
    return np.asarray((same & (amplitude == amplitude[:, :, :1])).all(axis=(0, 2)))


def _others(deck: DeckContent, orders: Orders, left: NDArray[np.bool_]) -> Iterator[tuple[Assigned, dict[int, Points]]]:
    """Yield the items that no set has covered, split by their histories."""
    rest = np.flatnonzero(left.any(axis=0))
    if not len(rest):
        return
    value = np.where(left[None], orders.value, np.nan)[:, :, rest]
    table = np.concatenate([np.nan_to_num(value, nan=np.inf), orders.amplitude[:, :, rest].astype(float)])
    _, first, which = np.unique(table.reshape(-1, len(rest)).T, axis=0, return_index=True, return_inverse=True)
    for k in np.argsort(first).tolist():
        at = rest[which.ravel() == k]
        line = orders.line_of(at[0])
        histories = _histories(deck, orders, int(at[0]), left[:, at[0]], line)
        yield replace(line, name="", items=orders.items[at]), histories


def _histories(
    deck: DeckContent, orders: Orders, at: int, components: NDArray[np.bool_], line: Assigned, start: float = 0.0
) -> dict[int, Points]:
    """Return the histories of some components of one item. Raises Refused, at the line that they begin with."""
    tables: list = [deck.amplitudes[name] for name in orders.amplitudes]
    histories = {}
    for c in np.flatnonzero(components).tolist():
        value: Floats = orders.value[:, c, at]
        factors = [tables[k] if k >= 0 else None for k in orders.amplitude[:, c, at].tolist()]
        try:
            histories[c] = history(deck.steps, value, factors, start)
        except Refused as refused:
            raise Refused(refused.message, refused.row or line.row) from None
    return histories


def history_of(deck: DeckContent, orders: Orders, item: int, component: int, start: float = 0.0) -> Points | None:
    """Return the history of one component of an item, None if the steps say nothing of it. Raises Refused."""
    at = int(np.searchsorted(orders.items, item))
    if at == len(orders.items) or orders.items[at] != item or np.isnan(orders.value[:, component, at]).all():
        return None
    chosen = mask_of(orders.value.shape[1], component)
    return _histories(deck, orders, at, chosen, orders.line_of(at), start)[component]
