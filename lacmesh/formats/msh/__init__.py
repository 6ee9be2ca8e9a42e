"""msh, gmsh's format: versions 4.1 and 2.2, ASCII and binary.

Reader and writer are our own, since all others lose something (measured with gmsh 4.15 and meshio 5.3): gmsh writes a
cell of k groups k times in msh 2.2 and keeps such copies when it reads, and with Mesh.SaveAll it loses all groups;
meshio loses numbers and second memberships, and fails on entities without a group; both accept truncated files, and
meshio wraps node 0 to the last one. What msh cannot hold (node groups, overlaps in 2.2, zones, TRIA7 ...) goes into a
section of our own, which gmsh skips; see `reader.NOTE`.
"""

from __future__ import annotations

from pathlib import Path

from lacmesh.formats.msh.reader import LAYOUTS, read_format
from lacmesh.formats.msh.streams import MshSource
from lacmesh.formats.msh.writer import write
from lacmesh.mesh import Mesh

__all__ = ["header", "read", "write"]


def read(path: Path) -> Mesh:
    """Read the mesh in a msh file of version 2.0, 2.1, 2.2 or 4.1, ASCII or binary. Raises ReadError.

    Warns of content that a mesh has no place for, of unknown sections, and of whatever looks wrong.
    """
    source = MshSource(path)
    read_format(source)
    if source.version == "4.1":
        from lacmesh.formats.msh.version4 import Reader4 as Reader
    else:
        from lacmesh.formats.msh.version2 import Reader2 as Reader
    return Reader(source).mesh()


def header(path: Path, head: bytes) -> tuple[str, bool]:
    """The layout ("4.1" or "2.2") of a msh file, and whether it is binary; `head`: its first bytes.

    Raises ReadError for a version that is not read.
    """
    source = MshSource(path, head if b"$EndMeshFormat" in head else b"")
    read_format(source)
    return LAYOUTS[source.version], source.binary
