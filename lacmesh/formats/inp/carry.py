"""The cards of a deck that are no part of the mesh, as they stand in a new file: word for word, or rewritten.

A line is rewritten where it names an element that a cut replaced, or a node set that a cut made larger. `REWRITTEN` has
what does it for each card; every other card is carried as it stands.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.deck import DataLine, DeckCard
from lacmesh.errors import DataError
from lacmesh.formats.ids import Index
from lacmesh.formats.inp.follow import Followed
from lacmesh.formats.text import reals
from lacmesh.mesh import Floats, Ints

#: Entries of a data line.
_PER_LINE = 16
NUMBER = re.compile(r"[0-9]{1,9}")
#: A load or a condition on a face of an element, as P3, F1NU, EDNOR2.
_ON_FACE = re.compile(r"(P|HP|TRVEC|TRSHR|F|R|S|VP|SP|EDLD|EDNOR|EDSHR|EDTRA|EDMOM)([1-6])((?:NU|FC|CR)?.*)", re.I)
#: Initial conditions of nodes; all others are of elements and their integration points.
OF_NODES = ("TEMPERATURE", "VELOCITY", "DISPLACEMENT", "PRESSURE", "MASSFLOW", "TOTALPRESSURE", "FIELD", "POREPRESSURE")

Replacement = list[str] | None


class RefusedError(DataError):
    """A line that cannot be carried; the text says why, and what to try."""


class Complaints:
    """Lines that cannot be carried: the first is an error, or with `lenient` all are left out and named."""

    def __init__(self, lenient: bool) -> None:
        self.lenient = lenient
        self.said: list[str] = []

    def add(self, card: DeckCard, file: str, line: int, why: str, left: str) -> None:
        """Raise DataError with the card and its line, or note it, and what is `left`."""
        text = f"{file}, line {line}: *{card.name}: {why}"
        if not self.lenient:
            raise DataError(f"{text}; --lenient (lenient=True) goes on with a warning")
        self.said.append(f"{text}; {left}")


def carried(card: DeckCard, followed: Followed, complaints: Complaints) -> Iterator[str]:
    """Yield the text of a card in a new file, keyword line first. Raises DataError for a line that is refused."""
    yield card.head
    if followed.same or card.key not in REWRITTEN:
        yield from (part.text for part in card.body)
        return
    for part in card.body:
        for k, text in enumerate(part.text.splitlines(keepends=True)):
            yield from _line(card, DataLine(text, part.file, part.line + k), followed, complaints)
    if card.key in _OF_NODES or (card.key == "INITIALCONDITIONS" and _is_of_nodes(card)):
        try:
            yield from added_lines(card, followed)
        except ValueError as error:
            complaints.add(card, card.file, card.line, str(error), "its new nodes get none")


def _line(card: DeckCard, line: DataLine, followed: Followed, complaints: Complaints) -> Iterator[str]:
    """Yield what a line of a card becomes: itself, others, or nothing if it is refused and that is allowed."""
    stripped = line.text.strip()
    if not stripped or stripped.startswith("**"):
        yield line.text
        return
    try:
        texts = REWRITTEN[card.key](card, line._replace(text=stripped), followed)
    except RefusedError as error:
        complaints.add(card, line.file, line.line, str(error), "the line is left out")
        texts = []
    yield from [line.text] if texts is None else (text + "\n" for text in texts)


def _load(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    """A load, film or flux of an element or an element set: the same on the children of those that were cut."""
    fields = line.fields
    label = fields[1] if len(fields) > 1 else ""
    on_face = _ON_FACE.fullmatch(label)
    if NUMBER.fullmatch(fields[0]):
        numbers = [int(fields[0])]
    elif on_face is None:  # the whole elements: their set has the children
        return None
    else:
        members = followed.members(fields[0])
        numbers = [] if members is None else members.tolist()
    if not any(map(followed.is_changed, numbers)):
        return None
    lines = []
    for number in numbers:
        sides = _sides(number, on_face, label, followed)
        lines += [", ".join([str(element), new, *fields[2:]]) for element, new in sides]
    return lines


def _sides(number: int, on_face: re.Match[str] | None, label: str, followed: Followed) -> list[tuple[int, str]]:
    """Elements and labels that take the place of one element and a label. Raises RefusedError."""
    if not followed.is_changed(number):
        return [(number, label)]
    if on_face is None:
        return [(child, label) for child in followed.children(number)]
    faces = followed.faces(number, int(on_face[2]))
    if not faces:
        raise RefusedError(f"element {number} was cut, and its children have no face that lies on its {label}")
    return [(child, f"{on_face[1]}{side}{on_face[3]}") for child, side in faces]


def _concentrated(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    """A force on each node of a set: on the nodes that it had, so that the sum stays."""
    group = followed.deck.node_group(line.fields[0])
    if NUMBER.fullmatch(line.fields[0]) or group is None or not _grown(group, followed):
        return None
    read = followed.deck.mesh
    numbers = read.node_number[read.node_groups[group]].tolist()
    return [", ".join([str(number), *line.fields[1:]]) for number in numbers]


def _grown(group: str, followed: Followed) -> bool:
    now = followed.mesh.node_groups.get(group)
    return now is not None and len(now) != len(followed.deck.mesh.node_groups[group])


def _equation(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    """An equation between nodes stays; one between node sets has no sense for the new nodes of one of them."""
    for name in line.fields:
        group = followed.deck.node_group(name)
        if group is not None and not NUMBER.fullmatch(name) and _grown(group, followed):
            raise RefusedError(f"it lists the node set {name}, which the cut made larger; list its nodes by number")
    return None


def _elements(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    """A list of elements: those that were cut are replaced by their children."""
    if card.options.get("TYPE", "ELEMENT").upper() != "ELEMENT":
        return None
    numbers = [int(f) for f in line.fields if NUMBER.fullmatch(f)]
    if not any(map(followed.is_changed, numbers)):
        return None
    members = []
    for f in line.fields:
        known = NUMBER.fullmatch(f) and followed.is_changed(int(f))
        members += [str(child) for child in followed.children(int(f))] if known else [f]
    return [", ".join(members[k : k + _PER_LINE]) for k in range(0, len(members), _PER_LINE)]


def _of_each(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    """Values of an element: the same for each of its children."""
    first = line.fields[0]
    if not NUMBER.fullmatch(first) or not followed.is_changed(int(first)):
        return None
    return [", ".join([str(child), *line.fields[1:]]) for child in followed.children(int(first))]


def _at_points(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    """Values at integration points or at nodes of an element: refused if it was cut."""
    first = line.fields[0]
    if NUMBER.fullmatch(first) and followed.is_changed(int(first)):
        raise RefusedError(f"element {first} was cut, and its children have other integration points and nodes")
    return None


def _initial(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    """Initial conditions: those of nodes are carried to the new nodes, those of points are `_at_points`."""
    return None if _is_of_nodes(card) else _at_points(card, line, followed)


def _is_of_nodes(card: DeckCard) -> bool:
    return "".join(card.options.get("TYPE", "").upper().split()) in OF_NODES


def _as_it_is(card: DeckCard, line: DataLine, followed: Followed) -> Replacement:
    return None


#: Card -> what rewrites one of its data lines: the new lines, or None for the line as it stands. Raises RefusedError.
REWRITTEN: Mapping[str, Callable[[DeckCard, DataLine, Followed], Replacement]] = {
    "DLOAD": _load,
    "FILM": _load,
    "RADIATE": _load,
    "DFLUX": _load,
    "CLOAD": _concentrated,
    "CFLUX": _concentrated,
    "EQUATION": _equation,
    "MODELCHANGE": _elements,
    "DISTRIBUTION": _of_each,
    "NORMAL": _at_points,
    "INITIALCONDITIONS": _initial,
    "BOUNDARY": _as_it_is,
    "TEMPERATURE": _as_it_is,
    "NODALTHICKNESS": _as_it_is,
}
#: Cards of values at nodes, which get lines for the new nodes.
_OF_NODES = ("BOUNDARY", "TEMPERATURE", "NODALTHICKNESS")


def without_option(card: DeckCard, *names: str) -> DeckCard:
    """The card without some of its parameters."""
    head = card.head
    for name in names:
        if name in card.options:
            head = re.sub(_parameter(name), r"\2", head, count=1, flags=re.I)
    return replace(card, head=head)


def with_option(card: DeckCard, name: str, value: str) -> DeckCard:
    """The card with another value of a parameter that it has."""
    head = re.sub(_parameter(name), rf",\1{name}={value}\2", card.head, count=1, flags=re.I)
    return replace(card, head=head)


def _parameter(name: str) -> str:
    """Pattern of a parameter with the comma before it: the blanks before its name, and what follows its value."""
    return r",(\s*)" + r"\s*".join(name) + r'\s*(?:=\s*(?:"[^"]*"|[^,"\r\n]*))?(?=(\s*?)(?:,|\r|\n|$))'


# ---- values that cards give to nodes by number, carried to the new nodes of a cut: *BOUNDARY, *TEMPERATURE and others


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
