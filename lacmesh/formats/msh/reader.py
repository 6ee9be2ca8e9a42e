"""Reading msh: the version, then section by section."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lacmesh.communicator import SERIAL, Communicator
from lacmesh.errors import LacmeshWarning
from lacmesh.formats.msh import fields as msh_fields
from lacmesh.formats.msh import names as msh_names
from lacmesh.formats.msh import notes as msh_notes
from lacmesh.formats.msh import reader4 as msh_read4
from lacmesh.formats.msh.assembly import to_mesh, to_slice
from lacmesh.formats.msh.content import Content
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.formats.slices import MeshSlice, Slice
from lacmesh.mesh import Mesh

if TYPE_CHECKING:
    from lacmesh.formats.msh.reader2 import Reader2

#: Versions that we read -> the layout they have.
LAYOUTS = {"2": "2.2", "2.0": "2.2", "2.1": "2.2", "2.2": "2.2", "4.1": "4.1"}
#: Sections that a mesh has no place for.
_DROPPED = ("GhostElements", "ElementNodeData", "InterpolationScheme", "Parametrizations")
_SAVE_AS = "open it in gmsh and save it as msh 4.1"


def read(path: Path) -> Mesh:
    """Read the mesh in a msh file of version 2.0, 2.1, 2.2 or 4.1, ASCII or binary. Raises ReadError.

    Warns of content that a mesh has no place for, of unknown sections, and of whatever looks wrong.
    """
    source = MshBytes(path)
    read_format(source)
    content, said = _read_content(source, Slice())
    for message in said:
        warnings.warn(LacmeshWarning(message), stacklevel=3)
    return to_mesh(content)


def slice_of(path: Path, comm: Communicator = SERIAL) -> MeshSlice | None:
    """Return the slice that this process reads of the mesh in a file; None for a file that is read as a whole.

    Such a file is not msh 4.1 in binary, or has cells of a type that msh lacks. Raises ReadError.
    """

    def content() -> tuple[Content, list[str]] | None:
        source = MshBytes(path)
        read_format(source)
        if not source.binary or source.version != "4.1":
            return None
        return _read_content(source, Slice(comm.rank, comm.size))

    read = comm.on_each(content)
    if read is None or read[0].notes.extra_cells:
        return None
    part = to_slice(read[0], comm)
    return replace(part, said=(*read[1], *part.said))


def _read_content(source: MshBytes, piece: Slice) -> tuple[Content, list[str]]:
    """Read what follows the format, of msh 4.1 a slice of the nodes; return what is left out, too. Raises ReadError."""
    dropped: dict[str, None] = {}
    reader = msh_read4.Reader4(source, dropped, piece) if source.version == "4.1" else _reader2(source)
    unknown, seen = _sections(source, reader, dropped)
    if "Nodes" not in seen:
        raise source.error("the file has no section $Nodes", source.size)
    content, said = reader.finish(), []
    name = source.path.name
    for about, names in (("what a mesh has no place for is left out", dropped), ("unknown sections", unknown)):
        if names:
            said.append(f"{name}: {about}: {', '.join(names)}")
    said += [f"{name}: {message}" for message in (_part(content), _lost(content)) if message]
    if "Elements" not in seen:
        said.append(f"{name}: the file has no section $Elements, so no cells")
    return content, said


def _part(content: Content) -> str:
    """Return a sentence about a file that has one part of a mesh that gmsh divided; "" for a whole mesh.

    msh 2.2 does not give the number of parts, and a whole mesh has cells of several, or of none.
    """
    parts = {int(p) for piece in content.pieces for p in np.unique(piece.partition)} if content.pieces else set()
    there, n = sorted(parts - {-1}), content.n_partitions
    if not there or (len(there) >= n if n else -1 in parts or len(there) > 1):
        return ""
    of = f" of {n}" if n else ""
    what = f"partition {there[0]}{of} alone" if len(there) == 1 else f"{len(there)} partitions{of}"
    return f"it has {what}, a part of a mesh that gmsh divided; save the whole mesh: Mesh.PartitionSplitMeshFiles = 0"


def _lost(content: Content) -> str:
    """Return a sentence about a file of msh 2.2 whose groups have no cells, as with Mesh.SaveAll; "" for others."""
    physical = [piece.physical for piece in content.pieces if piece.physical is not None]
    if not content.names or not physical or any(tags.any() for tags in physical):
        return ""
    return "no cell is in any of its groups, as gmsh saves msh 2.2 with Mesh.SaveAll = 1; save as msh 4.1"


def _reader2(source: MshBytes) -> Reader2:
    from lacmesh.formats.msh.reader2 import Reader2

    return Reader2(source)


def read_format(source: MshBytes) -> None:
    """Pass $MeshFormat (and comments before it); the source then knows its version and byte order. Raises ReadError."""
    name = source.section()
    while name == "Comments":
        source.body(name)
        name = source.section()
    if name in ("NOD", "NOE"):
        raise source.error(f"this is msh version 1; {_SAVE_AS}")
    if name != "MeshFormat":
        raise source.error("a msh file should begin with $MeshFormat", source.section_start)
    _read_version(source)


def _read_version(source: MshBytes) -> None:
    at = source.position
    match = re.fullmatch(rb"\s*(\d+(?:\.\d+)?)\s+([01])\s+(\d{1,4})\s*", source.line())
    if match is None:
        raise source.error("$MeshFormat should hold a version, 0 or 1, and a size", at)
    version = match[1].decode()
    if version not in LAYOUTS:
        raise source.error(f"msh version {version} is not read (2.0 to 2.2 and 4.1 are); {_SAVE_AS}", at)
    if int(match[3]) != 8:
        raise source.error(f"numbers of {int(match[3])} bytes are not read, only of 8; {_SAVE_AS}", at)
    source.version = "2.0" if version == "2" else version
    if match[2] == b"1":
        source.binary = True
        mark = bytes(source.take("u1", 4))
        if mark not in (b"\1\0\0\0", b"\0\0\0\1"):
            raise source.error("the file says that it is binary, but its byte order mark is missing", at)
        source.order = "<" if mark == b"\1\0\0\0" else ">"
    source.end("MeshFormat")


def _sections(
    source: MshBytes, reader: Reader2 | msh_read4.Reader4, dropped: dict[str, None]
) -> tuple[dict[str, None], set[str]]:
    """Read all sections; return the names of the unknown ones, and of all that are there. Raises ReadError."""
    content = reader.content
    unknown: dict[str, None] = {}
    seen: set[str] = set()
    while (name := source.section()) is not None:
        if name in seen and name in ("PhysicalNames", "Entities", "Nodes", "Elements"):
            raise source.error(f"there is a second section ${name}")
        if name == "Elements" and "Nodes" not in seen:
            raise source.error("the section $Elements stands before $Nodes")
        seen.add(name)
        if name == "Nodes":
            content.nodes_at = source.section_start
        elif name == "Elements":
            content.elements_at = source.section_start
        if reader.read(name):
            continue
        if name == "MeshFormat":
            before = source.version, source.binary, source.order
            _read_version(source)
            if before != (source.version, source.binary, source.order):
                raise source.error("a second $MeshFormat that differs from the first stands here")
        elif name == "PhysicalNames":
            content.names = msh_names.physical_names(source)
        elif name in msh_fields.SECTIONS:
            content.rows.append(msh_fields.read_rows(source, name))
        elif name == msh_notes.SECTION:
            notes = msh_notes.from_text(source.body(name), source)
            if notes is None:
                unknown[f"${name} of a newer lacmesh"] = None
            else:
                content.notes = notes
        else:
            source.body(name)
            if name in _DROPPED:
                dropped[f"${name}"] = None
            elif name not in ("Comments", *msh_notes.FORMER):
                unknown[f"${name}"] = None
    return unknown, seen
