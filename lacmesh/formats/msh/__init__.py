"""msh, gmsh's format: versions 4.1 and 2.2, ASCII and binary.

Reader and writer are our own, since all others lose something (measured with gmsh 4.15 and meshio 5.3): gmsh writes a
cell of k groups k times in msh 2.2 and keeps such copies when it reads, and with Mesh.SaveAll it loses all groups;
meshio loses numbers and second memberships, and fails on entities without a group; both accept truncated files, and
meshio wraps node 0 to the last one. What msh cannot hold (node groups, overlaps in 2.2, zones, TRIA7 ...) goes into a
section of our own, which gmsh skips; see `msh.notes`.
"""

from __future__ import annotations

from pathlib import Path

from lacmesh.formats.msh.reader import LAYOUTS, read, read_format
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.formats.msh.writer import write

__all__ = ["header", "read", "write"]


def header(path: Path, head: bytes) -> tuple[str, bool]:
    """The layout ("4.1" or "2.2") of a msh file, and whether it is binary; `head`: its first bytes.

    Raises ReadError for a version that is not read.
    """
    source = MshBytes(path, head if b"$EndMeshFormat" in head else b"")
    read_format(source)
    return LAYOUTS[source.version], source.binary
