"""Guard of meshio's readers: a file that ends too early is an error, not a part of a mesh nor an endless loop.

Some readers of meshio go on reading at the end of a file for ever; others take a truncated file for a whole one. A
stream from here stops the first, after a number of reads beyond the end: no clock is needed. For the second, a text is
searched for the words that end its format; if a format has none, its last line must be ended; and points and cells that
a format announces are counted. A file of a format that neither counts nor ends (`AT_RISK`) may still have lost whole
lines, which cannot be noticed.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree import ElementTree

from lacmesh.errors import ReadError

#: formats whose text does not say where it ends: a file that lost its last lines reads as a smaller mesh
AT_RISK = ("flac3d", "mdpa", "obj")
#: meshio's formats whose reader takes a stream -> whether of text. The others open the file by its name: libraries
#: (HDF5, netCDF, XML) and readers that look at the suffix, or open it twice; they stop where the file does
_STREAMS = {
    **dict.fromkeys(("avsucd", "nastran", "netgen", "obj", "off", "permas", "su2", "tecplot"), True),
    **dict.fromkeys(("mdpa", "ply"), False),
}
#: how often a reader may look beyond the end
_PATIENCE = 1000
#: what stands at the end of a text of a format
_END = {
    "mdpa": (rb"^\s*End [^\n]*\s*\Z", "End"),
    "medit": (rb"^\s*End\b", "End"),
    "netgen": (rb"^endmesh\b", "endmesh"),
    "permas": (rb"^\$FIN\b", "$FIN"),
    "stl": (rb"^\s*endsolid\b", "endsolid"),
}
#: what says in a file how many points, and how many cells, it has
_COUNTS = {
    "ply": (rb"^element vertex (\d+)", rb"^element face (\d+)"),
    "su2": (rb"^NPOIN\s*=\s*(\d+)", rb"^(?:NELEM|MARKER_ELEMS)\s*=\s*(\d+)"),
}
#: formats of text that end with a number
_LINES = ("avsucd", "flac3d", "obj", "off", "ply", "su2", "tecplot", "vtk")
#: binary medit's last word, before the place of the next
_GMF_END = 54


class _Watched:
    """Mixin for files that raises EOFError in a reader which goes on beyond the end."""

    _beyond = 0

    def readline(self, size: int | None = -1, /) -> Any:
        """Read a line as a file does, and count the reads beyond the end."""
        return self._counted(super().readline(size))  # type: ignore[misc]

    def read(self, size: int | None = -1, /) -> Any:
        """Read as a file does, and count the reads beyond the end."""
        return self._counted(super().read(size))  # type: ignore[misc]

    def _counted(self, content: Any) -> Any:
        self._beyond += not content
        if self._beyond > _PATIENCE:
            raise EOFError("the file ends before the mesh does")
        return content


class _Bytes(_Watched, io.BufferedReader):
    pass


class _Text(_Watched, io.TextIOWrapper):
    pass


def read_watched(read: Callable[..., Any], path: Path, name: str) -> Any:
    """Call `read` (meshio's) on a file of its format `name`. Raises EOFError if it would go on beyond the end."""
    if name not in _STREAMS or path.suffix == ".gz":
        return read(path, file_format=name)
    with _Bytes(io.FileIO(path)) as file:
        if not _STREAMS[name]:
            return read(file, file_format=name)
        with _Text(file) as text:
            return read(text, file_format=name)


def check_whole(path: Path, name: str) -> None:
    """Raise ReadError where a file of meshio's format `name` was cut short, as far as the format tells."""
    if name == "dolfin-xml":
        _check_dolfin(path)
    elif path.suffix != ".gz":  # a packed file that is cut short cannot be unpacked
        with path.open("rb") as file:
            _check_end(path, name, file)


def check_counts(path: Path, name: str, points: int, cells: int) -> None:
    """Raise ReadError where a file says that it has more points or cells than meshio found."""
    content = path.read_bytes() if name in _COUNTS else b""
    for pattern, count, what in zip(_COUNTS.get(name, ()), (points, cells), ("points", "cells"), strict=False):
        announced = sum(map(int, re.findall(pattern, content, re.MULTILINE)))
        if count < announced:
            raise ReadError(path, f"is cut short: it has {count} of the {announced} {what} that it announces")


def _check_end(path: Path, name: str, file: BinaryIO) -> None:
    content = file.read()
    if not _is_text(content):
        words = [int.from_bytes(content[at : at + 4], order) for at in (-8, -12) for order in ("little", "big")]
        if name == "medit" and _GMF_END not in words:
            raise ReadError(path, "is cut short: its end is missing (GmfEnd)")
    elif name in _END:
        pattern, word = _END[name]
        if not re.search(pattern, content, re.MULTILINE):
            raise ReadError(path, f"is cut short: {word!r} is missing, which ends a file of {name}")
    elif name in _LINES and content[-1:] not in (b"\n", b"\r"):
        raise ReadError(path, "ends within a line, so it may be cut short; if it is whole, end its last line")


def _is_text(content: bytes) -> bool:
    """True if a file is text, judged by its beginning and its end."""
    return not any(b"\0" in part for part in (content[:4096], content[-4096:]))


def _check_dolfin(path: Path) -> None:
    """Count the vertices and cells of a mesh of dolfin: each must be there, once."""
    size, indices = 0, set[str]()
    try:
        for event, element in ElementTree.iterparse(path, events=("start", "end")):
            if event == "start":
                if element.tag in ("vertices", "cells"):
                    size, indices = int(element.attrib["size"]), set()
                elif "index" in element.attrib:
                    indices.add(element.attrib["index"])
            elif element.tag in ("vertices", "cells"):
                if indices != set(map(str, range(size))):
                    raise ReadError(path, f"has {len(indices)} of {size} {element.tag}, or others than it should")
                element.clear()
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise ReadError(path, f"is no whole mesh of dolfin ({error})") from error
