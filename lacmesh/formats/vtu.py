"""VTU, the XML files of VTK's unstructured grids, which ParaView, pyvista and dolfinx read and write.

Our own reader and writer, on numpy alone: VTK weighs 600 MB, and meshio joins the names of sets that overlap, and
crashes on sets that are empty somewhere. What is written is described in `vtu_write.py`; every encoding that VTK
writes is read (`vtu_xml.py`).
"""

from __future__ import annotations

from lacmesh.formats.vtu_read import read
from lacmesh.formats.vtu_write import write

__all__ = ["read", "write"]
