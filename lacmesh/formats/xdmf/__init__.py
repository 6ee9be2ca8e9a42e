"""XDMF 3 (an XML file, and an HDF5 file of arrays beside it), which dolfinx, legacy FEniCS and ParaView read."""

from __future__ import annotations

from lacmesh.formats.xdmf.reader import read
from lacmesh.formats.xdmf.writer import is_ours, write

__all__ = ["is_ours", "read", "write"]
