"""Items with one history: the sets that a deck names, and what is left, split by history."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacsolver.decks.cards import Refused
from lacsolver.decks.content import Assigned, Content
from lacsolver.decks.histories import Orders, Points, history


class HistoryPart(NamedTuple):
    """Items with one history: name of their set ("" if the deck has none), and the history of each component.

    `line`: the line of the deck that names them first.
    """

    name: str
    items: Ints
    histories: dict[int, Points]
    line: Assigned


def parts_of(content: Content, orders: Orders, *, once: bool) -> Iterator[HistoryPart]:
    """Yield parts that cover every order: whole sets where all items have one history, then what is left.

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
            yield HistoryPart(line.name, line.items, _histories(content, orders, int(at[0]), some, line), line)
    yield from _others(content, orders, left)


def _first_of_sets(lines: Sequence[Assigned]) -> list[Assigned]:
    """Return the first line of each set, by its name; numbers have none."""
    return list({line.name: line for line in reversed(lines) if line.name}.values())[::-1]


def _uniform(orders: Orders, at: Ints) -> NDArray[np.bool_]:
    """Return a mask (components,), True where all items at `at` have the same orders in all steps."""
    value, amplitude = orders.value[:, :, at], orders.amplitude[:, :, at]
    same = (value == value[:, :, :1]) | (np.isnan(value) & np.isnan(value[:, :, :1]))
    return np.asarray((same & (amplitude == amplitude[:, :, :1])).all(axis=(0, 2)))


def _others(content: Content, orders: Orders, left: NDArray[np.bool_]) -> Iterator[HistoryPart]:
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
        yield HistoryPart("", orders.items[at], _histories(content, orders, int(at[0]), left[:, at[0]], line), line)


def _histories(
    content: Content, orders: Orders, at: int, components: NDArray[np.bool_], line: Assigned, start: float = 0.0
) -> dict[int, Points]:
    """Return the histories of some components of one item. Raises Refused, at the line that they begin with."""
    tables: list = [content.amplitudes[name] for name in orders.amplitudes]
    found = {}
    for c in np.flatnonzero(components).tolist():
        value: Floats = orders.value[:, c, at]
        factors = [tables[k] if k >= 0 else None for k in orders.amplitude[:, c, at].tolist()]
        try:
            found[c] = history(content.steps, value, factors, start)
        except Refused as refused:
            raise Refused(refused.message, refused.row or line.row) from None
    return found


def history_of(content: Content, orders: Orders, item: int, component: int, start: float = 0.0) -> Points | None:
    """Return the history of one component of an item, None if the steps say nothing of it. Raises Refused."""
    at = int(np.searchsorted(orders.items, item))
    if at == len(orders.items) or orders.items[at] != item or np.isnan(orders.value[:, component, at]).all():
        return None
    chosen = np.zeros(orders.value.shape[1], bool)
    chosen[component] = True
    return _histories(content, orders, at, chosen, orders.line_of(at), start)[component]
