"""A deck of parts and instances as one without: what is written once its mesh has changed, and what lacsolver reads.

Nodes and elements have the numbers of the mesh, in cards of their own for each instance. A set or surface `Set` of an
instance `Part-1-1` is `Part-1-1_Set`, for both programs, as neither takes a point in a name of a deck without parts;
where the mesh has no name of the instance before it (one instance alone), it is `Set`. Names and numbers in cards of
the assembly, of the model and of the steps are rewritten. Sections and other cards of a part are written once for each
instance, behind the cards of the model, where CalculiX knows the materials that they name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from lacmesh.deck import DataLine, Deck, DeckCard, DeckInstance, Lines, key_of
from lacmesh.formats.inp.carry import NUMBER, is_on_nodes, with_option, without_option
from lacmesh.formats.inp.elements import FRAMES
from lacmesh.formats.labels import labels

#: Characters of a name in both programs.
NAME = 80
#: Cards of a part that name its sets in ELSET and NSET, its orientations in NAME and ORIENTATION, and nothing else.
_OF_PARTS = frozenset(
    ("SOLIDSECTION", "SHELLSECTION", "MEMBRANESECTION", "SURFACESECTION", "COHESIVESECTION", "MASS", "ROTARYINERTIA",
     "HOURGLASSSTIFFNESS", "TRANSVERSESHEARSTIFFNESS")
)  # fmt: skip
#: The same, where a line is of directions in space, which a rotated instance would turn.
_WITH_DIRECTIONS = frozenset(("ORIENTATION", "BEAMSECTION", "BEAMGENERALSECTION", "SPRING", "DASHPOT"))
_OF_ELEMENTS = ("DLOAD", "DFLUX", "FILM", "RADIATE", "MODELCHANGE", "ELPRINT", "NORMAL")
#: Cards whose lines begin with a node or an element, which without an instance is one of the assembly's.
_FIRST = ("BOUNDARY", "CLOAD", "CFLUX", "TEMPERATURE", "INITIALCONDITIONS", *_OF_ELEMENTS)
#: A card that a deck without parts cannot have, the line at fault, if it is in one, and why.
Refusal = tuple[DeckCard, DataLine | None, str]
#: Parameters that name sets, surfaces and nodes.
_NAMING = frozenset(
    ("ELSET", "NSET", "REFNODE", "ROTNODE", "TIENSET", "PINNSET", "SLAVE", "MASTER", "SURFACE", "SURFACENAME", "REGION")
)


def flattened(deck: Deck) -> tuple[Deck, tuple[Refusal, ...]]:
    """Return a deck with instances of parts as one without, and what it lacks of that; one without them as it is."""
    if not deck.instances:
        return deck, ()
    flat, written = _Flat(deck), {k for k, _, _ in deck.instance_numbers}
    before: list[DeckCard] = []
    model: list[DeckCard] = []
    of_parts: list[DeckCard] = []
    steps: list[DeckCard] = []
    part: str | None = None  # key of the part that is open
    instance: DeckInstance | None = None
    for k, card in enumerate(deck.cards):
        name = key_of(card.options.get("NAME", ""))
        part = name if card.key == "PART" else None if card.key == "ENDPART" else part
        if card.key in ("INSTANCE", "ENDINSTANCE"):
            instance = flat.instances.get(name) if card.key == "INSTANCE" else None
        if card.key in (*FRAMES, "NSET", "ELSET", "SURFACE"):  # sets are written from the mesh
            if last := steps or model or before:
                last[-1] = replace(last[-1], body=(*last[-1].body, *card.comments))
        elif card.key in ("NODE", "ELEMENT"):
            if card.key == "ELEMENT" and k not in written and part in (None, *flat.parts):
                why = "these elements say more than their nodes, or are no cells, and cannot be numbered anew"
                flat.refused.append((card, None, f"{why}; put them into a deck without parts"))
        elif part is not None or instance is not None:
            of_parts += flat.of_instances(card, part, instance)
        elif steps or card.key == "STEP":
            steps.append(flat.rewritten(card))
        elif not model and card.key in ("HEADING", "PREPRINT"):
            before.append(card)
        else:
            model.append(flat.rewritten(card))
    return replace(
        deck,
        cards=(*before, *flat.of_mesh(), *model, *of_parts, *steps),
        node_sets={key_of(flat.labels[group]): group for group in deck.node_sets.values()},
        element_sets={key_of(flat.labels[group]): group for group in deck.element_sets.values()},
        surfaces={(kind, key_of(flat.labels[group])): group for (kind, _), group in deck.surfaces.items()},
        labels=flat.labels,
        numbers_differ="",
        instances=(),
        instance_numbers=(),
    ), tuple(flat.refused)


class _Flat:
    """Cards, names and numbers of a deck with instances in one without; `refused`: what that cannot have."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self.refused: list[Refusal] = []
        self.instances = {key_of(one.name): one for one in deck.instances}
        largest = [0, 0]
        for k, numbers, _ in deck.instance_numbers:
            of = deck.cards[k].key == "ELEMENT"
            largest[of] = max(largest[of], int(numbers.max(initial=0)))
        end = deck.assembly_offset if any(deck.assembly_offset) else tuple(largest)
        ends = [*((one.nodes, one.elements) for one in deck.instances[1:]), end]
        self._ends = dict(zip(self.instances, ends, strict=True))  # the largest numbers of each instance
        known = {**deck.node_sets, **deck.element_sets, **{key: group for (_, key), group in deck.surfaces.items()}}
        self.labels = labels(dict.fromkeys(known.values()), "A-Za-z0-9_-", NAME, first="A-Za-z_")
        self._by_key = {key: self.labels[group] for key, group in known.items()}
        self._renamed = {key: label for key, label in self._by_key.items() if label != known[key]}
        self.parts = {key_of(one.part) for one in deck.instances}

    def of_mesh(self) -> Iterator[DeckCard]:
        """Yield the cards of nodes and elements in the order of the mesh, then those of sets and surfaces, empty."""
        for k, numbers, index in self.deck.instance_numbers:
            card = without_option(self.deck.cards[k], "ELSET", "NSET", "SYSTEM", "INPUT")
            yield replace(card, body=card.comments, numbers=numbers, index=index)
        sets = [("NSET", {"NSET": group}) for group in dict.fromkeys(self.deck.node_sets.values())]
        sets += [("ELSET", {"ELSET": group}) for group in dict.fromkeys(self.deck.element_sets.values())]
        sets += [("SURFACE", {"NAME": group, "TYPE": kind}) for (kind, _), group in self.deck.surfaces.items()]
        for keyword, names in sets:
            place = next((card for card in self.deck.cards if card.key == keyword), self.deck.cards[0])
            options = {option: self.labels.get(name, name) for option, name in names.items()}
            head = ", ".join([f"*{keyword}", *(f"{option}={value}" for option, value in options.items())])
            yield DeckCard(keyword, options, place.file, place.line, f"{head}\n")

    def of_instances(self, card: DeckCard, part: str | None, instance: DeckInstance | None) -> Iterator[DeckCard]:
        """Yield a card of a part, or of an instance alone, once for each instance of it; a part may have none."""
        if instance is None and part not in self.parts:
            return
        if card.key not in _OF_PARTS | _WITH_DIRECTIONS:
            why = "it stands in a part, and lacmesh does not know which of its names and numbers are the part's"
            self.refused.append((card, None, f"{why}; move it to the assembly"))
            return
        for one in self.deck.instances:
            if one is not instance and (instance is not None or key_of(one.part) != part):
                continue
            if one.rotated and card.key in _WITH_DIRECTIONS:
                why = f"it has directions, which the rotation of instance {one.name} turns"
                self.refused.append((card, None, f"{why}; place this instance without a rotation"))
                continue
            new = card
            for option in ("ELSET", "NSET", "NAME", "ORIENTATION"):
                value = card.options.get(option, "").strip('"')
                if option in ("ELSET", "NSET") and option in card.options:
                    new = with_option(new, option, self._by_key.get(key_of(one.prefix + value), value))
                elif one.prefix and value:
                    new = with_option(new, option, one.prefix.replace(".", "_") + value)
            yield new

    def rewritten(self, card: DeckCard) -> DeckCard:
        """Return a card of the assembly, of the model or of a step with other names and numbers."""
        elements = card.key in _OF_ELEMENTS or (card.key == "INITIALCONDITIONS" and not is_on_nodes(card))
        for option, value in card.options.items():
            if option in _NAMING or "." in value:
                new = self._in_mesh(value, False)
                card = card if new == value else with_option(card, option, new)
        body = tuple(part._replace(text="".join(self._lines(card, part, elements))) for part in card.body)
        return replace(card, body=body)

    def _lines(self, card: DeckCard, part: Lines, elements: bool) -> Iterable[str]:
        """Yield the lines of a part of a card's body with other names and numbers."""
        for line in part.each():
            if not line.is_data:
                yield line.text
                continue
            fields = line.text.rstrip("\r\n").split(",")
            if card.key in _FIRST and NUMBER.fullmatch(fields[0].strip()):
                offset = self.deck.assembly_offset[elements]
                if self.deck.numbers_differ and not offset:
                    why = "so that a number may mean several; name a set, or write instance.number"
                    self.refused.append((card, line, f"{self.deck.numbers_differ}, {why}"))
                fields[0] = str(int(fields[0]) + offset)
            for k, text in enumerate(fields):
                new = self._in_mesh(text.strip(), elements)
                fields[k] = text if new == text.strip() else text.replace(text.strip(), new)
            yield ",".join(fields) + "\n"

    def _in_mesh(self, text: str, elements: bool) -> str:
        """Return what stands for a name in the assembly, or for a number after the name of an instance.

        A number that is beyond those of its instance stays, and is then the name of nothing.
        """
        if label := self._renamed.get(key_of(text)):
            return label
        before, point, rest = text.replace('"', "").rpartition(".")
        one = self.instances.get(key_of(before)) if point else None
        if one is None:
            return text
        if NUMBER.fullmatch(rest.strip()):
            number = int(rest) + (one.elements if elements else one.nodes)
            return str(number) if number <= self._ends[key_of(before)][elements] else text
        return self._by_key.get(key_of(one.prefix + rest), text)
