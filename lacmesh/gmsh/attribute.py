"""Attribute `LacMesh` of gmsh's model: data of a mesh that the model has no place for, as in msh's section $LacMesh.

gmsh reads the section of a msh file into such an attribute, and writes the attribute into the files that it saves.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lacmesh.formats.msh.notes import SECTION, Notes, from_text, to_text
from lacmesh.formats.source import SourceFile


def read_notes(gmsh: Any, name: str) -> Notes:
    """Read the notes of the current model, called `name`; empty if it has none. Raises ReadError."""
    if SECTION not in gmsh.model.getAttributeNames():
        return Notes()
    text = "\n".join(gmsh.model.getAttribute(SECTION))
    return from_text(text.encode(), SourceFile(Path(f"gmsh's model {name!r}"), b"-")) or Notes()


def write_notes(gmsh: Any, notes: Notes) -> None:
    """Write the notes on its mesh to the current model; remove the attribute if there is nothing to note."""
    text = to_text(notes)
    if text:
        gmsh.model.setAttribute(SECTION, text.split("\n")[1:-2])
    elif SECTION in gmsh.model.getAttributeNames():
        gmsh.model.removeAttribute(SECTION)
