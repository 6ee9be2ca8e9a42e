""".mail, the text format of code_aster's own meshes (documentation U3.01.00).

A file is a list of sub-files: coordinates, cells of one type, groups, a title. It keeps nodes, cells, groups of both
(overlapping and empty ones too), their numbers, the order of cells within a type, the number of coordinates, and the
mesh's name as title; no fields, and so no records of a cut.
"""

from __future__ import annotations

from lacmesh.formats.mail.reader import read
from lacmesh.formats.mail.writer import write

__all__ = ["read", "write"]
