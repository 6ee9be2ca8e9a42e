"""The cards of a deck as they are read here, and what is found in them: file, line, card, and what to try."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from lacmesh.deck import DataLine, DeckCard, key_of
from lacmesh.errors import did_you_mean


class Refused(Exception):  # noqa: N818 (never leaves this package: it becomes a Finding)
    """A card, or the line `row` of it, cannot be taken; the message says why, and what to try.

    `card`: the card, if it is not the one that is being read.
    """

    def __init__(self, message: str, row: DeckLine | None = None, card: Card | None = None) -> None:
        super().__init__(message)
        self.message, self.row, self.card = message, row, card


class Lacking(Refused):
    """A card that lacsolver has no place for, and that may be left out as a whole if the user says so."""


class DeckLine(NamedTuple):
    """A data line, or the value of an option: its fields, and its place in a file."""

    fields: tuple[str, ...]
    file: str
    line: int

    @classmethod
    def of(cls, line: DataLine) -> DeckLine:
        """Return the fields of a data line, without blank ones at its end."""
        fields = list(line.fields)
        while len(fields) > 1 and not fields[-1]:
            fields.pop()
        return cls(tuple(fields), line.file, line.line)

    def text(self, k: int) -> str:
        """Return field k, "" where the line ends before it."""
        return self.fields[k] if k < len(self.fields) else ""

    def number(self, k: int, what: str, default: float | None = None) -> float:
        """Return field k as a real number; `default` where it is blank. Raises Refused."""
        text = self.text(k)
        if not text and default is not None:
            return default
        try:
            value = float(re.sub("[dD]", "e", text))
        except ValueError:
            raise Refused(f"{what} should be a number, not {text[:40]!r}", self) from None
        if not abs(value) < float("inf"):
            raise Refused(f"{what} should be a finite number, not {text[:40]!r}", self)
        return value

    def numbers(self, first: int, count: int, what: str, default: float | None = None) -> list[float]:
        """Return `count` fields from `first` on as real numbers. Raises Refused."""
        return [self.number(k, what, default) for k in range(first, first + count)]

    def positive(self, k: int, what: str) -> float:
        """Return field k as a number above 0. Raises Refused."""
        value = self.number(k, what)
        if not value > 0:
            raise Refused(f"{what} should be positive, not {value:g}", self)
        return value

    def whole(self, k: int, what: str, default: int | None = None) -> int:
        """Return field k as a whole number; `default` where it is blank. Raises Refused."""
        text = self.text(k)
        if not text and default is not None:
            return default
        if not re.fullmatch(r"[+-]?\d{1,9}", text):
            raise Refused(f"{what} should be a whole number, not {text[:40]!r}", self)
        return int(text)

    def two_skins(self) -> tuple[str, ...]:
        """Return the names of a slave and a master. Raises Refused for a line of more or fewer."""
        if len(self.fields) != 2:
            raise Refused("a line should be a slave surface and a master surface", self)
        return self.fields


@dataclass(frozen=True)
class Card:
    """A card of a deck, with its options and its data lines `rows`, as numbers and names."""

    of: DeckCard
    rows: tuple[DeckLine, ...]

    @classmethod
    def from_deck(cls, card: DeckCard) -> Card:
        """Return a card with all its data lines."""
        return cls(card, tuple(map(DeckLine.of, card.data)))

    @property
    def lines(self) -> list[Card]:
        """The card once for each of its data lines; itself if it has none."""
        return [replace(self, rows=(row,)) for row in self.rows] or [self]

    @property
    def key(self) -> str:
        """The keyword in capitals, without blanks."""
        return self.of.key

    @cached_property
    def options(self) -> Mapping[str, str]:
        """Values of the options as written, by name in capitals without blanks."""
        return {name.replace(" ", ""): value for name, value in self.of.options.items()}

    def word(self, name: str, default: str = "") -> str:
        """Return the value of an option in capitals without blanks; the default if the card does not have it."""
        return "".join(self.options.get(name, "").strip('" ').split()).upper() or default

    def needed(self, name: str) -> str:
        """Return the value of an option as written. Raises Refused if the card does not have it."""
        if not self.options.get(name, "").strip('" '):
            raise Refused(f"the option {name}=name is missing")
        return self.options[name]

    def number(self, name: str, default: float | None = None) -> float:
        """Return the value of an option as a real number. Raises Refused."""
        return DeckLine((self.options.get(name, ""),), self.of.file, self.of.line).number(0, name, default)

    def first(self, what: str) -> DeckLine:
        """Return the first data line. Raises Refused if there is none."""
        if not self.rows:
            raise Refused(f"it should be followed by a line with {what}")
        return self.rows[0]

    def single(self, what: str) -> DeckLine:
        """Return the only data line, or the first of equal ones. Raises Refused for values of several temperatures."""
        row = self.first(what)
        if len({one.fields[:-1] for one in self.rows}) > 1:
            raise Refused(f"{what} that depend on temperature are not supported; give one line", self.rows[1])
        return row

    def table(self, *what: str, blank: float | None = None) -> list[list[float]]:
        """Return rows of two numbers at one temperature; `blank`: the second where it is blank. Raises Refused."""
        self.first(f"{what[0]} and {what[1]}")
        if len({row.number(2, "the temperature", 0.0) for row in self.rows}) > 1:
            raise Refused("values that depend on temperature are not supported; give those of one", self.rows[-1])
        return [[row.number(0, what[0]), row.number(1, what[1], blank)] for row in self.rows]


class Finding(NamedTuple):
    """A sentence about a line of a deck.

    `level`: `error` for what would change the answer, `warning` for what may, `note` for what does not.
    """

    file: str
    line: int
    card: str
    message: str
    level: str

    @property
    def text(self) -> str:
        """File, line, card and message."""
        return f"{self.file}, line {self.line}: *{self.card}: {self.message}"


def look_up(known: Mapping[str, object], name: str, what: str, row: DeckLine | None = None) -> str:
    """Return the key (`key_of`) of a name of the deck. Raises Refused, with near matches, values if they are names."""
    key = key_of(name)
    if key not in known:
        shown = [value if isinstance(value, str) else name for name, value in known.items()]
        raise Refused(f"there is no {what} named {name!r}{did_you_mean(name, shown)}", row)
    return key
