"""VTU, the XML files of VTK's unstructured grids, which ParaView, pyvista and dolfinx read and write.

Our own reader and writer, on numpy alone: VTK weighs 600 MB, and meshio joins the names of sets that overlap, and
crashes on sets that are empty somewhere. What is written is described in `vtu/writer.py`; every encoding that VTK
writes is read (`vtu/xml.py`).
"""

from __future__ import annotations

from pathlib import Path

from lacmesh.formats.vtu.writer import write
from lacmesh.mesh import Mesh

__all__ = ["read", "write"]


def read(path: Path) -> Mesh:
    """Read a VTU file, see `vtu/reader.py`, which needs a parser of XML."""
    from lacmesh.formats.vtu import reader

    return reader.read(path)
