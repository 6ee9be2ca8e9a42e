"""Names that a text format can hold, for names that it cannot: distinct, and as like the old ones as may be."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable


def labels(names: Iterable[str], allowed: str, limit: int, reserved: Iterable[str] = ()) -> dict[str, str]:
    """A label for each name, no two alike when letters' case is set aside; a name that fits is its own label.

    `allowed`: the characters that may stand after the first, a letter, as in a regular expression's brackets.

    >>> labels(["rive gauche", "Rive_gauche", "été", "2nd"], "A-Za-z0-9_", 24)
    {'rive gauche': 'rive_gauche_2', 'Rive_gauche': 'Rive_gauche', 'été': 'ete', '2nd': 'G_2nd'}
    """
    names = list(names)
    taken = {word.upper() for word in reserved}
    made = {}
    plain = {name: _plain(name, allowed, limit) for name in names}
    for name in sorted(names, key=lambda name: plain[name] != name):  # names that fit come first
        label, k = plain[name], 1
        while label.upper() in taken:
            k += 1
            end = f"_{k}"
            label = plain[name][: limit - len(end)] + end
        taken.add(label.upper())
        made[name] = label
    return {name: made[name] for name in names}


def changes(made: dict[str, str]) -> str:
    """The labels that differ from their names, for a warning; empty where none does.

    >>> changes({"a": "a", "b c": "b_c"})
    "'b c' is b_c"
    """
    return ", ".join(f"{name!r} is {label}" for name, label in made.items() if name != label)


def _plain(name: str, allowed: str, limit: int) -> str:
    letters = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
    label = re.sub(rf"[^{allowed}]", "_", name if letters.isascii() and letters == name else letters)
    if not re.match(r"[A-Za-z]", label):
        label = "G_" + label
    return label[:limit]
