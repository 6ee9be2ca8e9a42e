"""VTU, the XML files of VTK's unstructured grids, which ParaView, pyvista and dolfinx read and write.

Our own reader and writer, on numpy alone: VTK weighs 600 MB, and meshio joins the names of sets that overlap, and
crashes on sets that are empty somewhere. What is written is described in `vtu/writer.py`; every encoding that VTK
writes is read (`vtu/xml.py`).
"""

from __future__ import annotations

from lacmesh.formats.vtu.reader import read
from lacmesh.formats.vtu.writer import write

__all__ = ["read", "write"]
