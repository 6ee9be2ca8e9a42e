"""A deck that is being read: its content so far, its mesh's names, and what was found in it."""

from __future__ import annotations

from dataclasses import dataclass, field

from lacsolver.decks.cards import Card, DeckLine, Finding, found_at
from lacsolver.decks.content import Content
from lacsolver.decks.names import Names


@dataclass
class Reading:
    """Content, names and findings of a deck; `variants`: names of elements that a note has told of.

    `lenient`: what lacsolver lacks is left out, with a warning.
    """

    names: Names
    lenient: bool = False
    content: Content = field(default_factory=Content)
    findings: list[Finding] = field(default_factory=list)
    variants: set[str] = field(default_factory=set)

    def note(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Tell what does not change the answer."""
        self.findings.append(found_at(card, message, row, "note"))

    def warn(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Tell what may change the answer."""
        self.findings.append(found_at(card, message, row, "warning"))

    def lack(self, card: Card, message: str, instead: str) -> None:
        """Tell what would change the answer and is not taken, or, if this is lenient, what is taken instead."""
        if self.lenient:
            self.warn(card, f"left out: {message}; {instead}")
        else:
            self.error(card, message)

    def error(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Tell what would change the answer, and is not taken."""
        self.findings.append(found_at(card, message, row, "error"))
