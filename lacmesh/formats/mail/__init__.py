""".mail, the text format of code_aster's own meshes (documentation U3.01.00).

A file is a list of sub-files: coordinates, cells of one type, groups, a title. It keeps nodes, cells, groups of both
(overlapping and empty ones too), their numbers, the order of cells within a type, the number of coordinates, and the
mesh's name as title; no fields, and so no records of a cut.
"""

from __future__ import annotations

import re

from lacmesh.formats.mail.reader import read
from lacmesh.formats.mail.types import NODES
from lacmesh.formats.mail.writer import write

__all__ = ["begins", "read", "write"]

_KEYWORD = re.compile(rb"\s*(?:%[^\n]*\n\s*)*([A-Z][A-Z0-9_]+)")


def begins(head: bytes) -> bool:
    """True if a file's first bytes are those of a .mail file: a keyword, after blank lines and comments.

    >>> begins(b"% a mesh\\n COOR_2D\\nN1 0. 0."), begins(b"*NODE")
    (True, False)
    """
    keyword = _KEYWORD.match(head)
    return keyword is not None and keyword[1].decode() in {
        *NODES,
        "TITRE",
        "COOR_1D",
        "COOR_2D",
        "COOR_3D",
        "GROUP_NO",
        "GROUP_MA",
    }
