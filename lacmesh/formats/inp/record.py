"""The record of a deck: its cards as text with their places, made of what the reader went through."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from lacmesh.deck import Deck, DeckCard, Lines
from lacmesh.formats.inp.cards import Card, Span
from lacmesh.formats.inp.deck import InputDeck
from lacmesh.formats.inp.scope import ElementCard
from lacmesh.formats.source import SourceFile
from lacmesh.formats.text import values_in_lines
from lacmesh.mesh import Ints, Mesh


def deck_of(path: Path, model: InputDeck, mesh: Mesh) -> Deck:
    """Make the record of a deck that was read as `mesh`."""
    places = _Places()
    scope = model.scope
    numbers: dict[int, Ints] = {}
    if not model.apart:
        numbers = {id(nodes.card): nodes.number for nodes in scope.nodes}
        numbers |= {id(elements.card): elements.number for elements in scope.elements}
    in_mesh = set(numbers) - {id(card) for card in model.whole}
    cards = tuple(_card(card, places, numbers.get(id(card)), id(card) in in_mesh) for card in model.cards)
    return Deck(
        str(path),
        cards,
        mesh,
        places.lines(model.start),
        {key: one.shown for key, one in scope.node_sets.items()},
        {key: one.shown for key, one in scope.element_sets.items()},
        {key: one.shown for key, one in scope.surfaces.items()},
        model.apart,
        tuple(model.instances),
        _placed(model) if model.instances else (),
        model.own,
    )


def _placed(model: InputDeck) -> tuple[tuple[int, Ints], ...]:
    """Indices of the cards of nodes and elements that are cells alone, with their numbers in the mesh."""
    index = {id(card): k for k, card in enumerate(model.cards)}
    nodes = [(index[id(one.card)], one.number) for one in model.scope.nodes]
    elements = [(index[id(one.card)], one.number) for one in model.scope.elements if not _says_more(one, model)]
    return (*nodes, *elements)


def _says_more(one: ElementCard, model: InputDeck) -> bool:
    """True if the lines of elements have more numbers than those of the elements and of their nodes."""
    listed = any(one.card is card for card in model.whole)
    return listed and int(values_in_lines(one.card.text()).sum()) > one.nodes.size + len(one.number)


def _card(card: Card, places: _Places, numbers: Ints | None, in_mesh: bool) -> DeckCard:
    (head,) = places.lines([card.head])
    body = places.comments(card) if in_mesh else places.lines(card.body)
    return DeckCard(card.shown, card.parameters, head.file, head.line, head.text, body, numbers)


class _Places:
    """Line numbers of spans, which come in the order of their files: each file is counted through once."""

    def __init__(self) -> None:
        self._reached: dict[int, tuple[SourceFile, int, int]] = {}

    def lines(self, spans: list[Span]) -> tuple[Lines, ...]:
        """Spans as text, each with the file and the number of its first line; every line ends with a line end."""
        lines = []
        for span in spans:
            text = bytes(span.source.data[span.begin : span.end]).decode(errors="surrogateescape")
            ended = text if text.endswith("\n") else text + "\n"
            lines.append(Lines(ended, str(span.source.path), self._line(span.source, span.begin)))
        return tuple(lines)

    def comments(self, card: Card) -> tuple[Lines, ...]:
        """The comments of a card alone: what its body has beside its data."""
        spans: list[Span] = []
        for part in card.body:
            data = [s for s in card.spans if s.source is part.source and part.begin <= s.begin < part.end]
            edges = [part.begin, *(edge for s in data for edge in (s.begin, s.end)), part.end]
            spans += [Span(part.source, a, b) for a, b in list(pairwise(edges))[::2] if b > a]
        return self.lines(spans)

    def _line(self, source: SourceFile, at: int) -> int:
        _, begin, line = self._reached.get(id(source), (source, 0, 1))
        if at < begin:
            begin, line = 0, 1
        line += _count(source, begin, at)
        self._reached[id(source)] = (source, at, line)
        return line


def _count(source: SourceFile, begin: int, end: int) -> int:
    """Count the line ends in a part of a file, in pieces of a megabyte."""
    edges = [*range(begin, end, 1 << 20), end]
    return sum(source.data[a:b].count(b"\n") for a, b in pairwise(edges))
