"""Histories over the steps: what a load, support or temperature is at every time, and the items that have one history.

Without an amplitude a value grows linearly over its step from what it was (or at once, with AMPLITUDE=STEP), and keeps
its value in later steps. With an amplitude it is the factor of the amplitude times the value.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lacmesh.mesh import Ints, concatenated
from lacsolver.case.value import interpolate
from lacsolver.decks.cards import Card, DeckLine, Refused

Points = list[tuple[float, float]]
#: value and amplitude in each step, None where a step says nothing
Order = tuple[tuple[float, "Amplitude | None"] | None, ...]
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

    `items` (k,) sorted; `label` (components, k): index into `orders` of what an item has, -1 for nothing. An order has
    a value and an amplitude for each step, None where that says nothing. `lines`: those of the deck that they come
    from; `first` (k,): the index of the first line that names an item. `removed`: steps that remove orders.
    """

    steps: Sequence[DeckStep]
    items: Ints
    label: Ints
    orders: tuple[Order, ...]
    lines: tuple[Assigned, ...]
    first: Ints
    removed: tuple[int, ...]

    @classmethod
    def of(
        cls, lines: Sequence[Assigned], steps: Sequence[DeckStep], n_components: int, adds: bool,
        removing: Iterable[int] = (),
    ) -> Orders:  # fmt: skip
        """Return the orders of lines of one kind, in their order.

        `adds`: lines of one step for the same item add, as loads do; else the last one counts. `removing`: steps that
        remove orders of earlier ones: loads go to 0 then. Raises Refused if lines that add have several amplitudes.
        """
        items = np.unique(concatenated(line.items for line in lines))
        label, first = np.full((n_components, len(items)), -1), np.full(len(items), len(lines))
        nothing: Order = (None,) * (max(len(steps), 1) + 1)  # the model's, then one for each step
        known: dict[Order, int] = {nothing: -1}
        orders: list[Order] = []
        for number, line in enumerate(lines):
            at = np.searchsorted(items, line.items)
            first[at] = np.minimum(first[at], number)
            for c in line.components:
                before = label[c, at]
                for k in np.unique(before).tolist():
                    order = _with_line(orders[k] if k >= 0 else nothing, line, adds)
                    if order not in known:
                        known[order] = len(orders)
                        orders.append(order)
                    label[c, at[before == k]] = known[order]
        final: dict[Order, int] = {}
        renamed, removed = [-1], set()
        for order in orders:
            for step in removing:
                if any(order[: step + 1]) and order[step + 1] is None:
                    removed.add(step)
                    order = (*order[: step + 1], (0.0, None) if adds else None, *order[step + 2 :])
            renamed.append(final.setdefault((order[1] or order[0], *order[2:]), len(final)))
        label = np.array(renamed)[label + 1]
        return cls(steps, items, label, tuple(final), tuple(lines), first, tuple(sorted(removed)))

    def order_of(self, component: int, at: int) -> Order:
        """Return the order of a component of the item with index `at` in `items`, of nothing if it has none."""
        k = int(self.label[component, at])
        return self.orders[k] if k >= 0 else (None,) * len(self.steps)

    def line_of(self, at: int, component: int | None = None) -> Assigned:
        """Return the first line that names the item with index `at` in `items`, and a component of it."""
        if component is None:
            return self.lines[int(self.first[at])]
        item = self.items[at]
        return next(one for one in self.lines if component in one.components and item in one.items)

    def history(self, item: int, component: int, start: float = 0.0) -> Points | None:
        """Return the history of one component of an item, None if the steps say nothing of it. Raises Refused."""
        at = int(np.searchsorted(self.items, item))
        if at == len(self.items) or self.items[at] != item or self.label[component, at] < 0:
            return None
        return self._histories(at, [component], self.line_of(at), start)[component]

    def parts(self, *, once: bool) -> Iterator[tuple[Assigned, dict[int, Points]]]:
        """Yield items with the history of each component, which cover every order: whole sets first, then the rest.

        They are the items of the line that names them first, or of one like it without a name.

        `once`: each component of an item is in one part only, as loads must be; supports may be in several.
        Raises Refused for a history that a case cannot have.
        """
        left = self.label >= 0
        for line in reversed({line.name: line for line in reversed(self.lines) if line.name}.values()):
            at = np.searchsorted(self.items, line.items)
            own = self.label[:, at]
            some = (own == own[:, :1]).all(axis=1) & (own[:, 0] >= 0)
            some &= left[:, at].all(axis=1) if once else left[:, at].any(axis=1)
            if some.any():
                left[np.ix_(some, at)] = False
                yield line, self._histories(int(at[0]), np.flatnonzero(some).tolist(), line)
        rest = np.flatnonzero(left.any(axis=0))
        columns = np.where(left, self.label, -1)[:, rest].T
        _, first, which = np.unique(columns, axis=0, return_index=True, return_inverse=True)
        for k in np.argsort(first).tolist():  # what no set has covered, split by the histories
            at = rest[which.ravel() == k]
            line, components = self.line_of(at[0]), np.flatnonzero(left[:, at[0]]).tolist()
            yield replace(line, name="", items=self.items[at]), self._histories(int(at[0]), components, line)

    def _histories(self, at: int, components: Iterable[int], line: Assigned, start: float = 0.0) -> dict[int, Points]:
        """Return the histories of some components of one item. Raises Refused, at the line that they begin with."""
        try:
            return {c: _history(self.steps, self.order_of(c, at), start) for c in components}
        except Refused as refused:
            raise Refused(refused.message, refused.row or line.row) from None


def _with_line(order: Order, line: Assigned, adds: bool) -> Order:
    """Return an order with that of one more line. Raises Refused for an amplitude that differs from the one before."""
    k, value = line.step + 1, line.value
    before = order[k]
    if before and adds:
        if before[1] != line.amplitude:
            raise Refused("it adds to a load with another amplitude; give both the same amplitude", line.row)
        value += before[0]
    return (*order[:k], (value, line.amplitude), *order[k + 1 :])


def _history(steps: Sequence[DeckStep], order: Order, start: float) -> Points:
    """Return the history ((t, v), ...) of an order; `start`: the value at time 0.

    Raises Refused for a load whose amplitude counts the time of a step, in a later step that does not repeat it.
    """
    points: Points = [(0.0, start)]
    last: tuple[float, Amplitude] | None = None
    for step, given in zip(steps, order, strict=True):
        if given is not None:
            new, factor = given
            last = (new, factor) if factor else None
            grown = [(step.begin, new), (step.end, new)] if step.sudden else [(step.end, new)]
            part = _sampled(step, new, factor) if factor else grown
        elif last is not None and last[1].total:
            part = _sampled(step, *last)
        elif last is not None and len({factor for _, factor in last[1].rows}) > 1:
            raise Refused("loads whose amplitude counts the time of a step must be repeated in the later steps")
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
