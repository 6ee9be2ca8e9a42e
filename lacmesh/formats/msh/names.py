"""Names in a msh file: between double quotes, on one line, short enough for gmsh; the true ones are kept in our notes.

gmsh reads a line of 255 bytes, takes the text before the second quote, and rejects the whole file if a line is longer
(measured with 4.15).
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from lacmesh.formats.msh.source import MshSource
from lacmesh.formats.text import decoded
from lacmesh.mesh import Tag

_LONGEST = 120  # bytes; gmsh cuts at 128 when it saves


def quoted(line: bytes) -> str:
    """Text between the first and the last quote of a line; the whole line if there are not two quotes."""
    between = re.search(rb'"(.*)"', line)
    return decoded(between[1] if between else line.strip().strip(b'"'))


def safe_names(names: Iterable[str]) -> dict[str, str]:
    """Name in the file for each name: without quotes and control characters, not too long, distinct and not empty.

    >>> safe_names(["slave", 'a "b"', "a 'b'"])
    {'slave': 'slave', 'a "b"': "a 'b'~2", "a 'b'": "a 'b'"}
    """
    names = list(dict.fromkeys(names))
    safe = {name: _safe(name) for name in names}
    taken = {name for name in names if safe[name] == name}
    for name in names:
        if safe[name] != name:
            stem, k = safe[name], 2
            while safe[name] in taken:
                safe[name], k = f"{stem}~{k}", k + 1
            taken.add(safe[name])
    return safe


def _safe(name: str) -> str:
    short = re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029\ud800-\udfff]", "_", name).replace('"', "'")
    short = short.encode()[:_LONGEST].decode("utf-8", "ignore")
    return short or "_"


def physical_names(source: MshSource) -> list[tuple[int | None, int, str]]:
    """Read (dimension, tag, name) of each line of $PhysicalNames; msh 2.0 has no dimension. Raises ReadError."""
    n = source.count("PhysicalNames")
    start = source.position
    lines = [line for line in source.body("PhysicalNames").splitlines() if line.strip()]
    if len(lines) != n:
        raise source.error(f"{n} names should follow here, and there are {len(lines)}", start)
    pattern = re.compile(rb'\s*(\d{1,9})\s+"' if source.version == "2.0" else rb'\s*([0-3])\s+(-?\d{1,9})\s+"')
    names: list[tuple[int | None, int, str]] = []
    for line in lines:
        match = pattern.match(line)
        if match is None:
            raise source.error(f"{decoded(line)[:60]!r} should be a dimension, a tag and a name in quotes", start)
        numbers = [int(g) for g in match.groups()]
        names.append((None if len(numbers) == 1 else numbers[0], abs(numbers[-1]), quoted(line)))
    return names


def unnamed(tag: Tag) -> str:
    """The key of a physical group that has no name.

    >>> unnamed((2, 5))
    '2:5'
    """
    return f"{tag[0]}:{tag[1]}"
