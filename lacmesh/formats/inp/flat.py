"""A deck of parts and instances as one without: what is written once its mesh has changed, and what lacsolver reads.

Nodes and elements have the numbers of the mesh, in cards of their own for each instance. A set or surface `Set` of an
instance `Part-1-1` is `Part-1-1_Set`, for both programs, as neither takes a point in a name of a deck without parts;
where the mesh has no name of the instance before it (one instance alone), it is `Set`. Names and numbers in cards of
the assembly, of the model and of the steps are rewritten. Sections and other cards of a part are written once for each
instance, behind the cards of the model, where CalculiX knows the materials that they name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from io import BytesIO

from lacmesh.deck import DataLine, Deck, DeckCard, DeckInstance, Lines, key_of
from lacmesh.formats.inp.carry import NUMBER, OF_NODES, with_option, without_option
from lacmesh.formats.inp.contradictions import Contradiction
from lacmesh.formats.inp.lines import write_set
from lacmesh.formats.inp.plan import NAME
from lacmesh.formats.labels import labels
from lacmesh.mesh import Ints

#: Cards that say where parts begin and end.
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
    names = FlatNames(deck)
    rewriter = _Rewriter(deck, names)
    before: list[DeckCard] = []
    model: list[DeckCard] = []
    of_parts: list[DeckCard] = []
    steps: list[DeckCard] = []
    for k, (card, part, instance) in enumerate(_inside(deck)):
        if card.key in (*_FRAMES, "NSET", "ELSET", "SURFACE"):
            _keep_comments(card, steps or model or before)
        elif card.key in ("NODE", "ELEMENT"):
            rewriter.check_elements(k, card, part)
        elif part is not None or instance is not None:
            of_parts += rewriter.of_instances(card, part, instance)
        elif steps or card.key == "STEP":
            steps.append(rewriter.rewritten(card))
        elif not model and card.key in ("HEADING", "PREPRINT"):
            before.append(card)
        else:
            model.append(rewriter.rewritten(card))
    flat = replace(
        deck,
        cards=(*before, *_of_mesh(deck, names), *model, *of_parts, *steps),
        node_sets={key_of(names.of(group)): group for group in deck.node_sets.values()},
        element_sets={key_of(names.of(group)): group for group in deck.element_sets.values()},
        surfaces={(kind, key_of(names.of(group))): group for (kind, _), group in deck.surfaces.items()},
        apart="",
        instances=(),
    )
    return flat, tuple(rewriter.refused)


def _inside(deck: Deck) -> Iterator[tuple[DeckCard, str | None, DeckInstance | None]]:
    """Yield each card of a deck with the part (its name for comparison) and the instance that it stands in, if any."""
    instances = {key_of(one.name): one for one in deck.instances}
    part: str | None = None
    instance: DeckInstance | None = None
    for card in deck.cards:
        name = key_of(card.options.get("NAME", ""))
        if card.key in ("PART", "ENDPART"):
            part = name if card.key == "PART" else None
        elif card.key in ("INSTANCE", "ENDINSTANCE"):
            instance = instances.get(name) if card.key == "INSTANCE" else None
        yield card, part, instance


def _keep_comments(card: DeckCard, cards: list[DeckCard]) -> None:
    """Add the comments of a card that is not written to the last of the cards before it, if there is one."""
    text = "".join(_comments(part.text) for part in card.body)
    if cards and text:
        cards[-1] = replace(cards[-1], body=(*cards[-1].body, Lines(text, card.file, card.line)))


def _of_mesh(deck: Deck, names: FlatNames) -> Iterator[DeckCard]:
    """Yield the cards of nodes and elements in the order of the mesh, then those of sets and surfaces."""
    read = deck.mesh
    for k, numbers in deck.placed:
        card = deck.cards[k]
        body = tuple(part._replace(text=_comments(part.text)) for part in card.body)
        options = {name: value for name, value in card.options.items() if name not in (*_SETS, "SYSTEM", "INPUT")}
        plain = without_option(card, "ELSET", "NSET", "SYSTEM", "INPUT")
        yield replace(plain, body=body, numbers=numbers, options=options)
    elements = [n for k, n in deck.placed if deck.cards[k].key == "ELEMENT" and len(n)]
    largest = max((int(n.max()) for n in elements), default=0)  # skin of surfaces has the numbers that follow
    for group in dict.fromkeys(deck.node_sets.values()):
        if len(nodes := read.node_groups[group]):
            yield _listed(deck, "NSET", {"NSET": names.of(group)}, read.node_number[nodes])
    for group in dict.fromkeys(deck.element_sets.values()):
        numbers = read.cell_number[read.cell_groups[group]]
        if len(numbers := numbers[numbers <= largest]):
            yield _listed(deck, "ELSET", {"ELSET": names.of(group)}, numbers)
    for (kind, _), group in deck.surfaces.items():
        of_nodes = read.node_number[read.node_groups[group]] if kind == "NODE" else None
        yield _listed(deck, "SURFACE", {"NAME": names.of(group), "TYPE": kind}, of_nodes)


class _Rewriter:
    """Rewrites cards of a deck of parts with the names and numbers of one without; `refused`: what cannot be."""

    def __init__(self, deck: Deck, names: FlatNames) -> None:
        self.deck, self.names = deck, names
        self.refused: list[Contradiction] = []
        self._written = {k for k, _ in deck.placed}
        self._used = {key_of(one.part) for one in deck.instances}

    def _refuse(self, card: DeckCard, why: str, line: DataLine | None = None) -> None:
        at = (card.file, card.line) if line is None else (line.file, line.line)
        self.refused.append(Contradiction(card, *at, why))

    def check_elements(self, k: int, card: DeckCard, part: str | None) -> None:
        """Refuse elements, of the card of index k, that are not written from the mesh."""
        if card.key == "ELEMENT" and k not in self._written and part in (None, *self._used):
            why = "these elements say more than their nodes, or are no cells, and cannot be numbered anew"
            self._refuse(card, f"{why}; put them into a deck without parts")

    def of_instances(self, card: DeckCard, part: str | None, instance: DeckInstance | None) -> Iterator[DeckCard]:
        """Yield a card of a part, or of an instance alone, once for each instance of it; a part may have none."""
        if instance is None and part not in self._used:
            return
        if card.key not in _OF_PARTS | _WITH_DIRECTIONS:
            why = "it stands in a part, and lacmesh does not know which of its names and numbers are the part's"
            self._refuse(card, f"{why}; move it to the assembly")
            return
        for one in self.deck.instances:
            if one is instance or (instance is None and key_of(one.part) == part):
                if one.turned and card.key in _WITH_DIRECTIONS:
                    why = f"it has directions, which the rotation of instance {one.name} turns"
                    self._refuse(card, f"{why}; place this instance without a rotation")
                else:
                    yield self._of_instance(card, one)

    def _of_instance(self, card: DeckCard, one: DeckInstance) -> DeckCard:
        """Return a card of a part as that of one of its instances."""
        options = {option: self.names.of_part(card.options[option], one) for option in _SETS if option in card.options}
        for option in ("NAME", "ORIENTATION"):
            if one.prefix and card.options.get(option):
                options[option] = one.prefix.replace(".", "_") + card.options[option].strip('"')
        return _with(card, options)

    def rewritten(self, card: DeckCard) -> DeckCard:
        """Return a card of the assembly, of the model or of a step with other names and numbers."""
        elements = card.key in _OF_ELEMENTS or (
            card.key == "INITIALCONDITIONS" and "".join(card.options.get("TYPE", "").upper().split()) not in OF_NODES
        )
        options = {}
        for option, value in card.options.items():
            names = "".join(option.split()) in _NAMING or "." in value
            if names and (new := self.names.written(value, False)) != value:
                options[option] = new
        body = tuple(part._replace(text="".join(self._lines(part, card, elements))) for part in card.body)
        return replace(_with(card, options), body=body)

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


def _with(card: DeckCard, options: dict[str, str]) -> DeckCard:
    """Return a card with other values of some of its parameters."""
    for option, value in options.items():
        card = with_option(card, option, value)
    return replace(card, options={**card.options, **options})


def _kept_blanks(old: str, new: str) -> str:
    """Return a field of a line with the blanks that it had around it."""
    return old if new == old.strip() else old.replace(old.strip(), new)


def _comments(text: str) -> str:
    return "".join(line for line in text.splitlines(keepends=True) if line.lstrip().startswith("**"))


def _listed(deck: Deck, keyword: str, options: dict[str, str], numbers: Ints | None) -> DeckCard:
    """Return a card with numbers below it; None: without lines, for a surface that is written from the mesh.

    It has the place of the deck's first card of its kind.
    """
    place = next((card for card in deck.cards if card.key == keyword), deck.cards[0])
    head = f"*{keyword}, " + ", ".join(f"{name}={value}" for name, value in options.items())
    lines = BytesIO()
    if numbers is not None and keyword == "SURFACE":
        lines.writelines(f"{number}\n".encode() for number in numbers.tolist())
    elif numbers is not None:
        write_set(lines, "", numbers)
    text = lines.getvalue().decode().lstrip("\n")
    body = (Lines(text, place.file, place.line),) if text else ()
    return DeckCard(keyword, options, place.file, place.line, head + "\n", body)


# ---- names and numbers of a deck of parts and instances in one without


_PLAIN = re.compile(rf"[A-Za-z_][A-Za-z0-9_-]{{0,{NAME - 1}}}")


class FlatNames:
    """Names and numbers of a deck with instances in one without."""

    def __init__(self, deck: Deck) -> None:
        self.instances = {key_of(one.name): one for one in deck.instances}
        ends = [(one.nodes, one.elements) for one in deck.instances[1:]]
        end = deck.own if any(deck.own) else (_largest(deck, "NODE"), _largest(deck, "ELEMENT"))
        self._ends = dict(zip(self.instances, [*ends, end], strict=True))
        known = {**deck.node_sets, **deck.element_sets, **{key: group for (_, key), group in deck.surfaces.items()}}
        self._label = _labels(dict.fromkeys(known.values()))
        self._by_key = {key: self._label[group] for key, group in known.items()}
        self._renamed = {key: label for key, label in self._by_key.items() if label != known[key]}

    def of(self, group: str) -> str:
        """Return the name of a group of the mesh."""
        return self._label[group]

    def written(self, text: str, elements: bool) -> str:
        """Return what stands for a name in the assembly, or for a number after the name of an instance.

        A number that is beyond those of its instance stays, and is then the name of nothing.
        """
        if label := self._renamed.get(key_of(text)):
            return label
        before, point, rest = text.strip().replace('"', "").rpartition(".")
        one = self.instances.get(key_of(before)) if point else None
        if one is None:
            return text
        if NUMBER.fullmatch(rest.strip()):
            number = int(rest) + (one.elements if elements else one.nodes)
            return str(number) if number <= self._ends[key_of(before)][elements] else text
        return self._by_key.get(key_of(one.prefix + rest), text)

    def of_part(self, text: str, one: DeckInstance) -> str:
        """Return what stands for a name in a part, for one of its instances."""
        return self._by_key.get(key_of(one.prefix + text.strip('"')), text)


def _largest(deck: Deck, key: str) -> int:
    """Return the largest number that cards of a kind make."""
    return max((int(n.max()) for k, n in deck.placed if deck.cards[k].key == key and len(n)), default=0)


def _labels(groups: Mapping[str, None]) -> dict[str, str]:
    """Return distinct names that both programs take without quotes."""
    plain = {group: group.replace(".", "_") for group in groups}
    fitting = {text for text in plain.values() if _PLAIN.fullmatch(text)}
    others = labels((text for text in plain.values() if text not in fitting), "A-Za-z0-9_-", NAME)
    label_of: dict[str, str] = {}
    taken: set[str] = set()
    for group, text in sorted(plain.items(), key=lambda item: "." in item[0]):  # sets of the assembly keep their names
        label, k = others.get(text, text), 1
        while label.upper() in taken:
            k += 1
            label = f"{others.get(text, text)[: NAME - len(str(k)) - 1]}_{k}"
        taken.add(label.upper())
        label_of[group] = label
    return label_of
