"""Labels for names that a text format cannot hold: distinct, and as close to the names as possible."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable


def labels(
    names: Iterable[str], allowed: str, limit: int, reserved: Iterable[str] = (), first: str = "A-Za-z"
) -> dict[str, str]:
    """Label for each name, distinct regardless of case; a name that is allowed is its own label.

    `allowed`: characters allowed after the `first` one, written as in the brackets of a regular expression.

    >>> labels(["rive gauche", "Rive_gauche", "été", "2nd"], "A-Za-z0-9_", 24)
    {'rive gauche': 'rive_gauche_2', 'Rive_gauche': 'Rive_gauche', 'été': 'ete', '2nd': 'G_2nd'}
    """
    names = list(names)
    taken = {word.upper() for word in reserved}
    chosen = {}
    plain = {}
    for name in names:
        letters = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
        label = re.sub(rf"[^{allowed}]", "_", letters)
        plain[name] = (label if re.match(rf"[{first}]", label) else f"G_{label}")[:limit]
    for name in sorted(names, key=lambda name: plain[name] != name):  # names that fit come first
        label, k = plain[name], 1
        while label.upper() in taken:
            k += 1
            end = f"_{k}"
            label = plain[name][: limit - len(end)] + end
        taken.add(label.upper())
        chosen[name] = label
    return {name: chosen[name] for name in names}


def changes(chosen: dict[str, str]) -> str:
    """Text that lists the labels that differ from their names, for a warning; empty if none does.

    >>> changes({"a": "a", "b c": "b_c"})
    "'b c' is b_c"
    """
    return ", ".join(f"{name!r} is {label}" for name, label in chosen.items() if name != label)
