"""A deck of parts and instances as one without: what is written once its mesh has changed, and what lacsolver reads.

Nodes and elements have the numbers of the mesh, in cards of their own for each instance. A set or surface `Set` of an
instance `Part-1-1` is `Part-1-1_Set`, for both programs, as neither takes a point in a name of a deck without parts;
where the mesh has no name of the instance before it (one instance alone), it is `Set`. Names and numbers in cards of
the assembly, of the model and of the steps are rewritten. Sections and other cards of a part are written once for each
instance, behind the cards of the model, where CalculiX knows the materials that they name.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from io import BytesIO

from lacmesh.deck import DataLine, Deck, DeckCard, DeckInstance, Lines, key_of
from lacmesh.formats.inp.carry import NUMBER, OF_NODES, with_option, without_option
from lacmesh.formats.inp.contradictions import Contradiction
from lacmesh.formats.inp.flat_names import FlatNames
from lacmesh.formats.inp.lines import write_set
from lacmesh.mesh import Ints

#: Cards that make the mesh, and that say where parts begin and end.
_MESH = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")
_FRAMES = ("PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "INSTANCE", "ENDINSTANCE")
#: Cards of a part that name its sets in ELSET and NSET, its orientations in NAME and ORIENTATION, and nothing else.
_OF_PARTS = frozenset(
    ("SOLIDSECTION", "SHELLSECTION", "MEMBRANESECTION", "SURFACESECTION", "COHESIVESECTION", "MASS", "ROTARYINERTIA",
     "HOURGLASSSTIFFNESS", "TRANSVERSESHEARSTIFFNESS")
)  # fmt: skip
#: The same, where a line is of directions in space, which a rotated instance would turn.
_WITH_DIRECTIONS = frozenset(("ORIENTATION", "BEAMSECTION", "BEAMGENERALSECTION", "SPRING", "DASHPOT"))
_OF_ELEMENTS = ("DLOAD", "DFLUX", "FILM", "RADIATE", "MODELCHANGE", "ELPRINT", "NORMAL")
#: Cards whose lines begin with a node or an element, which without an instance is one of the assembly's own.
_FIRST = ("BOUNDARY", "CLOAD", "CFLUX", "TEMPERATURE", "INITIALCONDITIONS", *_OF_ELEMENTS)
_SETS = ("ELSET", "NSET")
#: Parameters that name sets, surfaces and nodes.
_NAMING = frozenset(
    ("ELSET", "NSET", "REFNODE", "ROTNODE", "TIENSET", "PINNSET", "SLAVE", "MASTER", "SURFACE", "SURFACENAME", "REGION")
)


def flattened(deck: Deck) -> tuple[Deck, tuple[Contradiction, ...]]:
    """Return a deck with instances of parts as one without, and what it lacks of that; one without them as it is."""
    if not deck.instances:
        return deck, ()
    made = _Flattening(deck)
    for k, card in enumerate(deck.cards):
        made.take(k, card)
    cards = (*made.before, *made.mesh(), *made.model, *made.of_parts, *made.steps)
    names = made.names
    flat = replace(
        deck,
        cards=cards,
        node_sets={key_of(names.of(group)): group for group in deck.node_sets.values()},
        element_sets={key_of(names.of(group)): group for group in deck.element_sets.values()},
        surfaces={(kind, key_of(names.of(group))): group for (kind, _), group in deck.surfaces.items()},
        apart="",
        instances=(),
    )
    return flat, tuple(made.refused)


@dataclass
class _Flattening:
    """Cards of a deck, taken one by one: those before the mesh, of the model, of parts, of the steps."""

    deck: Deck
    before: list[DeckCard] = field(default_factory=list)
    model: list[DeckCard] = field(default_factory=list)
    of_parts: list[DeckCard] = field(default_factory=list)
    steps: list[DeckCard] = field(default_factory=list)
    refused: list[Contradiction] = field(default_factory=list)
    part: str | None = None
    instance: DeckInstance | None = None

    def __post_init__(self) -> None:
        self.names = FlatNames(self.deck)
        self._written = {k for k, _ in self.deck.placed}
        self._used = {key_of(one.part) for one in self.deck.instances}

    def take(self, k: int, card: DeckCard) -> None:
        """Take the next card of the deck, of index k."""
        if card.key in (*_FRAMES, "NSET", "ELSET", "SURFACE"):
            self._keep_comments(card)
        if card.key in _FRAMES:
            self._frame(card)
        elif card.key in _MESH:
            if card.key == "ELEMENT" and k not in self._written and self.part in (None, *self._used):
                why = "these elements say more than their nodes, or are no cells, and cannot be numbered anew"
                self._refuse(card, f"{why}; put them into a deck without parts")
        elif self.part is not None or self.instance is not None:
            self._of_part(card)
        elif self.steps or card.key == "STEP":
            self.steps.append(self._rewritten(card))
        elif not self.model and card.key in ("HEADING", "PREPRINT"):
            self.before.append(card)
        else:
            self.model.append(self._rewritten(card))

    def _keep_comments(self, card: DeckCard) -> None:
        """Add the comments of a card that is not written to the card before it, if there is one."""
        there = self.steps or self.model or self.before
        text = "".join(_comments(part.text) for part in card.body)
        if there and text:
            there[-1] = replace(there[-1], body=(*there[-1].body, Lines(text, card.file, card.line)))

    def _frame(self, card: DeckCard) -> None:
        name = key_of(card.options.get("NAME", ""))
        if card.key in ("PART", "ENDPART"):
            self.part = name if card.key == "PART" else None
        elif card.key in ("INSTANCE", "ENDINSTANCE"):
            self.instance = self.names.instances.get(name) if card.key == "INSTANCE" else None

    def _refuse(self, card: DeckCard, why: str, line: DataLine | None = None) -> None:
        at = (card.file, card.line) if line is None else (line.file, line.line)
        self.refused.append(Contradiction(card, *at, why))

    def _of_part(self, card: DeckCard) -> None:
        """Take a card of a part, or of an instance alone, once for each instance of it; a part may have none."""
        if self.instance is None and self.part not in self._used:
            return
        if card.key not in _OF_PARTS | _WITH_DIRECTIONS:
            why = "it stands in a part, and lacmesh does not know which of its names and numbers are the part's"
            self._refuse(card, f"{why}; move it to the assembly")
            return
        for one in self.deck.instances:
            if one is self.instance or (self.instance is None and key_of(one.part) == self.part):
                if one.turned and card.key in _WITH_DIRECTIONS:
                    why = f"it has directions, which the rotation of instance {one.name} turns"
                    self._refuse(card, f"{why}; place this instance without a rotation")
                    continue
                self.of_parts.append(self._of_instance(card, one))

    def _of_instance(self, card: DeckCard, one: DeckInstance) -> DeckCard:
        """Return a card of a part as that of one of its instances."""
        made = card
        for option in _SETS:
            if option in card.options:
                made = _with(made, option, self.names.of_part(card.options[option], one))
        for option in ("NAME", "ORIENTATION"):
            if one.prefix and card.options.get(option):
                made = _with(made, option, one.prefix.replace(".", "_") + card.options[option].strip('"'))
        return made

    def _rewritten(self, card: DeckCard) -> DeckCard:
        """Return a card of the assembly, of the model or of a step with other names and numbers."""
        made = card
        elements = card.key in _OF_ELEMENTS or (
            card.key == "INITIALCONDITIONS" and "".join(card.options.get("TYPE", "").upper().split()) not in OF_NODES
        )
        for option, value in card.options.items():
            names = "".join(option.split()) in _NAMING or "." in value
            if names and (new := self.names.written(value, False)) != value:
                made = _with(made, option, new)
        body = tuple(part._replace(text="".join(self._lines(part, card, elements))) for part in card.body)
        return replace(made, body=body)

    def _lines(self, part: Lines, card: DeckCard, elements: bool) -> Iterator[str]:
        """Yield the lines of a part of a card's body with other names and numbers."""
        own = self.deck.own[elements]
        for k, line in enumerate(part.text.splitlines(keepends=True)):
            if line.lstrip().startswith("**") or not line.strip():
                yield line
                continue
            fields = line.rstrip("\r\n").split(",")
            if card.key in _FIRST and NUMBER.fullmatch(fields[0].strip()):
                if self.deck.apart and not own:
                    why = f"{self.deck.apart}, so that a number may mean several; name a set, or write instance.number"
                    self._refuse(card, why, DataLine(line, part.file, part.line + k))
                fields[0] = str(int(fields[0]) + own)
            yield ",".join(_kept_blanks(f, self.names.written(f.strip(), elements)) for f in fields) + "\n"

    def mesh(self) -> Iterator[DeckCard]:
        """Yield the cards of nodes and elements in the order of the mesh, then those of sets and surfaces."""
        deck, read = self.deck, self.deck.mesh
        for k, numbers in deck.placed:
            card = deck.cards[k]
            body = tuple(part._replace(text=_comments(part.text)) for part in card.body)
            made = without_option(card, "ELSET", "NSET", "SYSTEM", "INPUT")
            options = {name: value for name, value in card.options.items() if name not in (*_SETS, "SYSTEM", "INPUT")}
            yield replace(made, body=body, numbers=numbers, options=options)
        of = {"NSET": (deck.node_sets, read.node_groups, read.node_number),
              "ELSET": (deck.element_sets, read.cell_groups, read.cell_number)}  # fmt: skip
        for keyword, (sets, groups, number) in of.items():
            for group in dict.fromkeys(sets.values()):
                members = groups[group] if keyword == "NSET" else self._elements_of(group)
                if len(members):
                    yield _listed(keyword, {keyword: self.names.of(group)}, number[members], self._place_of(keyword))
        for (kind, _), group in deck.surfaces.items():
            options = {"NAME": self.names.of(group), "TYPE": kind}
            nodes = read.node_number[read.node_groups[group]] if kind == "NODE" else None
            yield _listed("SURFACE", options, nodes, self._place_of("SURFACE"))

    def _elements_of(self, group: str) -> Ints:
        """Return those cells of a group that are elements of the deck: the others are skin of a surface."""
        cells = self.deck.mesh.cell_groups[group]
        return cells[self.deck.mesh.cell_number[cells] <= self._largest]

    @property
    def _largest(self) -> int:
        """Largest number of an element; new skin follows it."""
        cards = self.deck.cards
        return max((int(n.max()) for k, n in self.deck.placed if cards[k].key == "ELEMENT" and len(n)), default=0)

    def _place_of(self, key: str) -> DeckCard:
        """Return the card whose place a written set is said to have: the first of its kind."""
        return next((card for card in self.deck.cards if card.key == key), self.deck.cards[0])


def _with(card: DeckCard, option: str, value: str) -> DeckCard:
    return replace(with_option(card, option, value), options={**card.options, option: value})


def _kept_blanks(old: str, new: str) -> str:
    """Return a field of a line with the blanks that it had around it."""
    return old if new == old.strip() else old.replace(old.strip(), new)


def _comments(text: str) -> str:
    return "".join(line for line in text.splitlines(keepends=True) if line.lstrip().startswith("**"))


def _listed(keyword: str, options: dict[str, str], numbers: Ints | None, place: DeckCard) -> DeckCard:
    """Return a card with numbers below it; None: without lines, for a surface that is written from the mesh."""
    head = f"*{keyword}, " + ", ".join(f"{name}={value}" for name, value in options.items())
    lines = BytesIO()
    if numbers is not None and keyword == "SURFACE":
        lines.writelines(f"{number}\n".encode() for number in numbers.tolist())
    elif numbers is not None:
        write_set(lines, "", numbers)
    text = lines.getvalue().decode().lstrip("\n")
    body = (Lines(text, place.file, place.line),) if text else ()
    return DeckCard(keyword, options, place.file, place.line, head + "\n", body)
