"""Names and numbers of a deck of parts and instances in one without."""

from __future__ import annotations

import re
from collections.abc import Mapping

from lacmesh.deck import Deck, DeckInstance, key_of
from lacmesh.formats.inp.carry import NUMBER
from lacmesh.formats.inp.plan import NAME
from lacmesh.formats.labels import labels

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
        before, point, rest = text.strip().strip('"').rpartition(".")
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
