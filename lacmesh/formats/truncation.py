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
from typing import Any

from lacmesh.errors import ReadError

#: formats whose text does not say where it ends: a file that lost its last lines reads as a smaller mesh
AT_RISK = ("flac3d", "mdpa", "obj")
#: meshio's formats whose reader takes a stream, of text or of bytes. The others open the file by its name: libraries
#: (HDF5, netCDF, XML) and readers that look at the suffix, or open it twice; they stop where the file does
_OF_TEXT = ("avsucd", "nastran", "netgen", "obj", "off", "permas", "su2", "tecplot")
_OF_BYTES = ("mdpa", "ply")
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
    """Mixin for streams that raises EOFError in a reader which goes on beyond the end."""

    _beyond = 0

    def readline(self, size: int | None = -1, /) -> Any:
        """Read a line as a stream does, and count the reads beyond the end."""
        return self._counted(super().readline(size))  # type: ignore[misc]

    def read(self, size: int | None = -1, /) -> Any:
        """Read as a stream does, and count the reads beyond the end."""
        return self._counted(super().read(size))  # type: ignore[misc]

    def _counted(self, content: Any) -> Any:
        self._beyond += not content
        if self._beyond > _PATIENCE:
            raise EOFError("the file ends before the mesh does")
        return content


class _Bytes(_Watched, io.BytesIO):
    pass


class _Text(_Watched, io.TextIOWrapper):
    pass


def read_whole(read: Callable[..., Any], path: Path, name: str) -> Any:
    """Call `read` (meshio's) on a file of its format `name`.

    Raises ReadError where the file was cut short, as far as its format tells; EOFError if `read` goes on at its end.
    """
    packed = path.suffix == ".gz"  # a packed file that is cut short cannot be unpacked
    content = b"" if packed else path.read_bytes()
    if not packed:
        _check_end(path, name, content)
    if name in _OF_TEXT and not packed:
        given = read(_Text(_Bytes(content)), file_format=name)
    else:
        given = read(_Bytes(content) if name in _OF_BYTES else path, file_format=name)
    counts = len(given.points), sum(len(block.data) for block in given.cells)
    for pattern, count, what in zip(_COUNTS.get(name, ()), counts, ("points", "cells"), strict=False):
        announced = sum(map(int, re.findall(pattern, content, re.MULTILINE)))
        if count < announced:
            raise ReadError(path, f"is cut short: it has {count} of the {announced} {what} that it announces")
    return given


def _check_end(path: Path, name: str, content: bytes) -> None:
    if b"\0" in content[:4096] or b"\0" in content[-4096:]:  # no text
        words = [int.from_bytes(content[at : at + 4], order) for at in (-8, -12) for order in ("little", "big")]
        if name == "medit" and _GMF_END not in words:
            raise ReadError(path, "is cut short: its end is missing (GmfEnd)")
    elif name == "dolfin-xml":
        for whole, part in ((b"vertices", b"vertex"), (b"cells", b"interval|triangle|tetrahedron")):
            announced = sum(map(int, re.findall(b"<%b\\s[^>]*?size=[\"'](\\d+)" % whole, content)))
            n = len(set(re.findall(b"<(?:%b)\\s[^>]*?index=[\"'](\\d+)" % part, content)))
            if n != announced:
                raise ReadError(path, f"has {n} of {announced} {whole.decode()}, or others than it should")
    elif name in _END:
        pattern, word = _END[name]
        if not re.search(pattern, content, re.MULTILINE):
            raise ReadError(path, f"is cut short: {word!r} is missing, which ends a file of {name}")
    elif name in _LINES and content[-1:] not in (b"\n", b"\r"):
        raise ReadError(path, "ends within a line, so it may be cut short; if it is whole, end its last line")
