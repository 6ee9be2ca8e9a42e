"""The section `$LacMesh` of a msh file: what the format cannot hold, as JSON text.

It is written only where something is needed, in ASCII (also in a binary file) and without a `$`, so that gmsh, which
looks for the next line that starts with one, passes it. Nodes and cells are named by their numbers. gmsh keeps such a
section when it saves a file as msh 4.1: `nodes` and `cells` say which mesh the numbers were meant for. Names and types
of the notes are listed in `formats.notes.MSH_NOTES`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field

from lacmesh.formats.note_types import DAMAGE, INTEGER, from_plain, to_plain
from lacmesh.formats.notes import MSH_NOTES, VERSION, CellsNote, FieldNote
from lacmesh.formats.source import SourceFile
from lacmesh.mesh import Ints, Tag

SECTION = "LacMesh"
#: Sections of older tools, passed without a word.
FORMER = ("LacNodeGroups",)
_LINE = 160
#: Notes that every section has.
_COUNTS = ("nodes", "cells")


@dataclass
class Notes:
    """The content of the section; `nodes`, `cells` count those of the mesh it belongs to.

    `groups`: names (and tags) of groups that $PhysicalNames cannot hold; `node_groups`, `cell_groups`: members by
    number, for cell groups those that the elements' tags do not give; `node_entity` (r, 3): dimension, tag and how many
    nodes of $Nodes in a row have it; `boundary`: entities and their signed boundary; `fields`: (on "node" or "cell",
    name in the file, step in the file) -> what is to be added.
    """

    nodes: int = 0
    cells: int = 0
    name: str | None = None
    space_dim: int | None = None
    zones: tuple[str, ...] = ()
    groups: dict[str, tuple[Tag, ...]] = field(default_factory=dict)
    node_groups: dict[str, Ints] = field(default_factory=dict)
    cell_groups: dict[str, Ints] = field(default_factory=dict)
    extra_cells: tuple[CellsNote, ...] = ()
    node_entity: Ints | None = None
    boundary: dict[Tag, tuple[int, ...]] = field(default_factory=dict)
    fields: dict[tuple[str, str, int], FieldNote] = field(default_factory=dict)


def to_text(notes: Notes) -> str:
    """The lines of the section, or "" where there is nothing to say."""
    plain = to_plain(vars(notes), MSH_NOTES)
    if plain.keys() == set(_COUNTS):
        return ""
    text = json.dumps({"version": VERSION, **plain}, separators=(",\n", ":")).replace("$", "\\u0024")
    return f"${SECTION}\n{_filled(text)}\n$End{SECTION}\n"


def _filled(text: str) -> str:
    """Join lines as long as they stay short."""
    lines: list[str] = []
    room = 0
    for line in text.split("\n"):
        if len(line) <= room:
            lines[-1] += line
            room -= len(line)
        else:
            lines.append(line)
            room = _LINE - len(line)
    return "\n".join(lines)


def from_text(text: bytes, source: SourceFile) -> Notes | None:
    """The content of a section; None where a newer lacmesh wrote it. Raises ReadError where it makes no sense."""
    try:
        data = json.loads(text.decode())
        notes = from_plain(data, {"version": INTEGER})
        if notes.get("version", VERSION) > VERSION:
            return None
        for key in ("version", *_COUNTS):
            data[key]  # a KeyError names the first that is missing
        return Notes(**from_plain(data, MSH_NOTES))
    except DAMAGE as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise source.error(
            f"the section ${SECTION} is damaged ({what[:80]}); without it the rest can be read"
        ) from None
