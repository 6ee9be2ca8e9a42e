"""What a mesh has and gmsh's model has not, in the model's attribute `LacMesh`: the text of msh's section of that name.

gmsh reads the section of a msh file into such an attribute, and writes the attribute into the files that it saves.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lacmesh.formats.msh.notes import SECTION, Notes, from_text, to_text
from lacmesh.formats.msh.scan import Source


def read_notes(gmsh: Any, name: str) -> Notes:
    """The notes of the current model, called `name`; empty where it has none. Raises ReadError."""
    if SECTION not in gmsh.model.getAttributeNames():
        return Notes()
    text = "\n".join(gmsh.model.getAttribute(SECTION))
    return from_text(text.encode(), Source(Path(f"gmsh's model {name!r}"), b"-")) or Notes()


def write_notes(gmsh: Any, notes: Notes) -> None:
    """Give the current model the notes on its mesh; none where there is nothing to say."""
    text = to_text(notes)
    if text:
        gmsh.model.setAttribute(SECTION, text.split("\n")[1:-2])
    elif SECTION in gmsh.model.getAttributeNames():
        gmsh.model.removeAttribute(SECTION)
