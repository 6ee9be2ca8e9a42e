"""Pairs of a slave and a master group: as the command takes them, and what of the check is done pair by pair."""

from __future__ import annotations

from collections.abc import Sequence
from shlex import quote

from lacmesh.errors import GroupNotFoundError, RequestError, did_you_mean
from lacmesh.mesh import Mesh

Pair = tuple[str, str]


def split_pairs(mesh: Mesh, texts: Sequence[str]) -> list[Pair]:
    """Split each `SLAVE:MASTER` at the one colon on both sides of which there is a group. Raises RequestError.

    >>> mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], cell_groups={"a": [0], "b:c": [0]})
    >>> split_pairs(mesh, ["a:b:c", "b:c:a"])
    [('a', 'b:c'), ('b:c', 'a')]
    """
    return [_split(mesh, text) for text in texts]


def _split(mesh: Mesh, text: str) -> Pair:
    sides = [(text[:k], text[k + 1 :]) for k, letter in enumerate(text) if letter == ":"]
    pairs = [(slave, master) for slave, master in sides if _is_group(mesh, slave) and _is_group(mesh, master)]
    if len(pairs) == 1:
        return pairs[0]
    if pairs:
        readings = " or ".join(f"slave {slave!r} with master {master!r}" for slave, master in pairs)
        raise RequestError(f"--pair {quote(text)} is {readings}; name one of the groups by its tag, or rename it")
    if not sides:
        raise RequestError(f"--pair {quote(text)} has no colon; write it as SLAVE:MASTER")
    missing = [name for name in sides[0] if not _is_group(mesh, name)] if len(sides) == 1 else []
    if not missing:
        raise RequestError(f"--pair {quote(text)} is no SLAVE:MASTER: no colon in it has a group on both sides")
    hint = did_you_mean(missing[0], [*mesh.cell_groups])
    raise RequestError(f"--pair {quote(text)}: no cell group named {missing[0]!r}{hint}")


def _is_group(mesh: Mesh, name: str) -> bool:
    try:
        return bool(name) and len(mesh.cells_of(name)) >= 0
    except (GroupNotFoundError, RequestError):
        return False


def check_one_pair(slave: Sequence[str], master: Sequence[str], command: str = "lacmesh check IN") -> None:
    """Raise RequestError for several slaves with several masters, of which it is not known which belong together."""
    slave, master = (list(dict.fromkeys(names)) for names in (slave, master))
    if len(slave) < 2 or len(master) < 2:
        return
    n = max(len(slave), len(master))
    a, b = ([*names, *[names[-1]] * (n - len(names))] for names in (slave, master))
    words = " ".join(f"--pair {quote(f'{one}:{other}')}" for one, other in zip(a, b, strict=True))
    message = f"{len(slave)} slaves and {len(master)} masters were given, and not which of them belong together"
    raise RequestError(f"{message}; name the pairs with --pair (pairs=[...] in Python), as in: {command} {words}")
