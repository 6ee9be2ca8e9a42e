"""Values that cards give to nodes by number, carried to the new nodes of a cut: *BOUNDARY, *TEMPERATURE and others."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh.deck import DataLine, DeckCard
from lacmesh.formats.ids import Index
from lacmesh.formats.inp.follow import Followed
from lacmesh.formats.text import reals
from lacmesh.mesh import Floats, Ints

_NUMBER = re.compile(r"[0-9]{1,9}")
#: Characters of a real number in both programs.
_REAL = 20
#: Cards whose values are of one degree of freedom, which stands before them.
_OF_DOF = ("VELOCITY", "DISPLACEMENT")


@dataclass
class _Condition:
    """Values of one kind, as of one degree of freedom: nodes that have one, and those that a set gives it to."""

    has: NDArray[np.bool_]
    values: Floats
    by_set: NDArray[np.bool_]
    width: int = 0

    def add(self, nodes: Ints, values: list[float]) -> None:
        """Give nodes (by index) their values; a number more than before widens all."""
        more = len(values) - self.values.shape[1]
        if more > 0:
            self.values = np.pad(self.values, ((0, 0), (0, more)))
        self.has[nodes] = True
        self.values[nodes, : len(values)] = values
        self.width = max(self.width, len(values))


def added_lines(card: DeckCard, followed: Followed) -> list[str]:
    """Lines for new nodes on faces, edges and cells all of whose corners the card has a condition for.

    New nodes that a set of the card holds need none. Raises ValueError for a line that is not as it should be.
    """
    if not any(_NUMBER.fullmatch(line.fields[0]) for line in card.data):
        return []
    number = Index(followed.deck.mesh.node_number)
    conditions: dict[str, _Condition] = {}
    for line in card.data:
        nodes, in_set = _nodes(line, followed, number)
        for kind, values in _kinds(card, line):
            of_kind = conditions.setdefault(kind, _none(followed.mesh.n_nodes))
            of_kind.add(nodes, values)
            of_kind.by_set[in_set] = True
    return [text for kind, condition in conditions.items() for text in _lines(kind, condition, followed)]


def _none(n: int) -> _Condition:
    return _Condition(np.zeros(n, bool), np.zeros((n, 0)), np.zeros(n, bool))


def _nodes(line: DataLine, followed: Followed, number: Index) -> tuple[Ints, Ints]:
    """Indices of the deck's nodes that a line names, and those that its set has in the mesh."""
    none = np.empty(0, np.int64)
    name = line.fields[0]
    if _NUMBER.fullmatch(name):
        places = number.places(np.array([int(name)]))
        return places[places >= 0], none
    group = followed.deck.node_group(name)
    if group is None:
        return none, none
    return followed.deck.mesh.node_groups[group], followed.mesh.node_groups.get(group, none)


def _kinds(card: DeckCard, line: DataLine) -> list[tuple[str, list[float]]]:
    """Kinds of condition that a line gives, as the text that stands between node and values, and the values."""
    fields = line.fields
    if card.key == "BOUNDARY":
        if len(fields) < 2 or not _NUMBER.fullmatch(fields[1]):
            return [(", ".join(fields[1:]), [])]
        last = fields[2] if len(fields) > 2 and fields[2] else fields[1]
        if not _NUMBER.fullmatch(last) or not int(fields[1]) <= int(last) <= 100:
            raise ValueError(f"line {line.line} should give the first and the last degree of freedom")
        return [(f"{dof}, {dof}", _values(line, fields[3:4])) for dof in range(int(fields[1]), int(last) + 1)]
    if card.options.get("TYPE", "").upper() in _OF_DOF:
        return [(", ".join(fields[1:2]), _values(line, fields[2:3]))]
    return [("", _values(line, fields[1:]))]


def _values(line: DataLine, texts: tuple[str, ...]) -> list[float]:
    try:
        return [float(text.lower().replace("d", "e")) if text else 0.0 for text in texts]
    except ValueError:
        raise ValueError(f"line {line.line} should have numbers after the node") from None


def _lines(kind: str, condition: _Condition, followed: Followed) -> list[str]:
    has, values = followed.interpolated(condition.has, condition.values)
    new = np.flatnonzero(has & ~condition.by_set & ~condition.has)
    columns = [reals(values[new, k], _REAL) for k in range(condition.width)]
    heads = [f"{number}, {kind}" if kind else str(number) for number in followed.mesh.node_number[new].tolist()]
    return [", ".join(row) + "\n" for row in zip(heads, *columns, strict=True)]
