""".inp, the input files of Abaqus and CalculiX: the mesh in them.

Read: nodes, elements of all kinds that are cells, sets (of sets, generated, of other files), surfaces of element faces
as skin cells, parts and their instances. Written: what CalculiX takes, or Abaqus on request. Numbers are the file's.
All cards, those of materials and steps too, are in the record `Mesh.deck`.
"""

from __future__ import annotations

from lacmesh.formats.inp.elements import losses
from lacmesh.formats.inp.reader import read
from lacmesh.formats.inp.writer import write

__all__ = ["losses", "read", "write"]
