"""Histories over the steps: what a load, support or temperature is at every time, and the items that have one history.

Without an amplitude a value grows linearly over its step from what it was (or at once, with AMPLITUDE=STEP), and keeps
its value in later steps. With an amplitude it is the factor of the amplitude times the value.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints, concatenated, mask_of
from lacsolver.case.value import interpolate
from lacsolver.decks.cards import Card, DeckLine, Refused

Points = list[tuple[float, float]]
#: part of a step in which a value jumps
JUMP = 1e-9


@dataclass(frozen=True)
class Amplitude:
    """Factor ((time, value), ...) of loads, over the time of the step or of the whole analysis (`total`)."""

    rows: tuple[tuple[float, float], ...]
    total: bool


@dataclass
class DeckStep:
    """A step: when it begins and how long it takes, its increments, and how loads without amplitude grow.

    `procedure`: the card that says what is computed. `increment`: the first one; `largest`: the largest one allowed.
    `alpha`: numerical damping of a step with inertia, None for a static one. `modes`: how many natural modes it asks
    for; such a step takes no time, and goes at its end, as one that is `left_out` of a partial import. `changes`: the
    last card in it of each that begins a change of a surface interaction.
    """

    card: Card
    begin: float
    procedure: Card | None = None
    period: float = 1.0
    increment: float = 1.0
    largest: float = 0.0
    direct: bool = False
    large: bool = False
    sudden: bool = False
    alpha: float | None = None
    modes: int = 0
    left_out: bool = False
    changes: dict[str, Card] = field(default_factory=dict)

    @property
    def origin(self) -> Card:
        """The card of the procedure, or that of the step if it has none."""
        return self.procedure or self.card

    @property
    def end(self) -> float:
        """Time at which the step ends."""
        return self.begin + self.period


@dataclass(frozen=True)
class Assigned:
    """One line of a load, a support or a temperature: `value` on components of some items in a step.

    `items`: nodes, facets or cells (indices); `step`: -1 for the model's; `data`: numbers beside the value, such as the
    axis of a centrifugal load.
    """

    kind: str
    step: int
    name: str
    items: Ints
    components: tuple[int, ...]
    value: float
    amplitude: Amplitude | None
    card: Card
    row: DeckLine
    data: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Orders:
    """Orders of the steps for some items: nodes, facets or cells.

    `items` (k,) sorted; `value` (steps, components, k), NaN where a step says nothing; `amplitude` (steps, components,
    k): index into `amplitudes`, -1 for none; `lines`: the lines of the deck that they come from; `first` (k,): the
    index of the first line that names an item.
    """

    steps: Sequence[DeckStep]
    items: Ints
    value: Floats
    amplitude: Ints
    amplitudes: tuple[Amplitude, ...]
    lines: tuple[Assigned, ...]
    first: Ints

    @classmethod
    def of(cls, lines: Sequence[Assigned], steps: Sequence[DeckStep], n_components: int, adds: bool) -> Orders:
        """Return the orders of lines of one kind, in their order.

        `adds`: lines of one step for the same item add, as loads do; else the last one counts. Raises Refused if those
        that add have several amplitudes.
        """
        items = np.unique(concatenated(line.items for line in lines))
        shape = (max(len(steps), 1), n_components, len(items))
        value, amplitude = np.full(shape, np.nan), np.full(shape, -1)
        amplitudes = tuple(dict.fromkeys(line.amplitude for line in lines if line.amplitude))
        first = np.full(len(items), len(lines))
        for number, line in enumerate(lines):
            at = np.searchsorted(items, line.items)
            first[at] = np.minimum(first[at], number)
            index = amplitudes.index(line.amplitude) if line.amplitude else -1
            for component in line.components:
                own, which = value[max(line.step, 0), component], amplitude[max(line.step, 0), component]
                again = ~np.isnan(own[at]) & adds
                if (which[at][again] != index).any():
                    raise Refused("it adds to a load with another amplitude; give both the same amplitude", line.row)
                own[at] = np.where(again, own[at], 0.0) + line.value
                which[at] = index
        return cls(steps, items, value, amplitude, amplitudes, tuple(lines), first)

    @property
    def given(self) -> NDArray[np.bool_]:
        """Mask (components, k), True where a step says something."""
        return np.asarray(~np.isnan(self.value).all(axis=0))

    def line_of(self, at: int, component: int | None = None) -> Assigned:
        """Return the first line that names the item with index `at` in `items`, and a component of it."""
        if component is None:
            return self.lines[int(self.first[at])]
        item = self.items[at]
        return next(one for one in self.lines if component in one.components and item in one.items)

    def history(self, item: int, component: int, start: float = 0.0) -> Points | None:
        """Return the history of one component of an item, None if the steps say nothing of it. Raises Refused."""
        at = int(np.searchsorted(self.items, item))
        if at == len(self.items) or self.items[at] != item or not self.given[component, at]:
            return None
        chosen = mask_of(self.value.shape[1], component)
        return self._histories(at, chosen, self.line_of(at), start)[component]

    def parts(self, *, once: bool) -> Iterator[tuple[Assigned, dict[int, Points]]]:
        """Yield items with the history of each component, which cover every order: whole sets first, then the rest.

        They are the items of the line that names them first, or of one like it without a name.

        `once`: each component of an item is in one part only, as loads must be; supports may be in several.
        Raises Refused for a history that a case cannot have.
        """
        given, left = self.given, self.given
        for line in reversed({line.name: line for line in reversed(self.lines) if line.name}.values()):
            at = np.searchsorted(self.items, line.items)
            some = given[:, at].all(axis=1) & self._uniform(at)
            some &= left[:, at].all(axis=1) if once else left[:, at].any(axis=1)
            if some.any():
                left[np.ix_(some, at)] = False
                yield line, self._histories(int(at[0]), some, line)
        yield from self._others(left)

    def _uniform(self, at: Ints) -> NDArray[np.bool_]:
        """Return a mask (components,), True where all items at `at` have the same orders in all steps."""
        value, amplitude = self.value[:, :, at], self.amplitude[:, :, at]
        same = (value == value[:, :, :1]) | (np.isnan(value) & np.isnan(value[:, :, :1]))
        return np.asarray((same & (amplitude == amplitude[:, :, :1])).all(axis=(0, 2)))

    def _others(self, left: NDArray[np.bool_]) -> Iterator[tuple[Assigned, dict[int, Points]]]:
        """Yield the items that no set has covered, split by their histories."""
        rest = np.flatnonzero(left.any(axis=0))
        if not len(rest):
            return
        value = np.where(left[None], self.value, np.nan)[:, :, rest]
        which, first = same_columns(value, self.amplitude[:, :, rest])
        for k in np.argsort(first).tolist():
            at = rest[which == k]
            line = self.line_of(at[0])
            yield replace(line, name="", items=self.items[at]), self._histories(int(at[0]), left[:, at[0]], line)

    def _histories(
        self, at: int, components: NDArray[np.bool_], line: Assigned, start: float = 0.0
    ) -> dict[int, Points]:
        """Return the histories of some components of one item. Raises Refused, at the line that they begin with."""
        histories = {}
        for c in np.flatnonzero(components).tolist():
            factors = [self.amplitudes[k] if k >= 0 else None for k in self.amplitude[:, c, at].tolist()]
            try:
                histories[c] = _history(self.steps, self.value[:, c, at], factors, start)
            except Refused as refused:
                raise Refused(refused.message, refused.row or line.row) from None
        return histories


def same_columns(value: Floats, amplitude: Ints) -> tuple[Ints, Ints]:
    """Return a number (k,) for each item, the same for equal orders (..., k), and the first item of each number."""
    table = np.concatenate([np.nan_to_num(value, nan=np.inf), amplitude.astype(float)])
    columns = table.reshape(-1, value.shape[-1]).T
    _, first, which = np.unique(columns, axis=0, return_index=True, return_inverse=True)
    return which.ravel(), first


def _history(steps: Sequence[DeckStep], value: Floats, amplitude: Sequence[Amplitude | None], start: float) -> Points:
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
    return [(t, value * interpolate(amplitude.rows, t - origin)) for t in (step.begin, *inside, step.end)]


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


def scaled(value: Any, factor: float) -> Any:
    """Return a value of a case, a number or a table of times, times a factor."""
    return [[t, v * factor] for t, v in value] if isinstance(value, list) else value * factor


def from_step_on(values: dict[int, float], steps: Sequence[DeckStep]) -> list[list[float]]:
    """Return a table of times for values, each from a step on, and -1 for the model's, which jump as a step begins."""
    now = [values[max(k for k in values if k <= number)] for number in range(len(steps))]
    points = [(0.0, now[0] if now else values[-1])]
    for step, value in zip(steps, now, strict=True):
        if value != points[-1][1]:
            points.append((step.begin + JUMP * step.period, value))
        points.append((step.end, value))
    return [list(point) for point in points]
