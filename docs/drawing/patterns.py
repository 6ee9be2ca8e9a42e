"""Every pattern of the cut, once, with what the pages and drawings say of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import (
    CONE,
    RING,
    RING_PARENTS,
    WHOLE,
    WHOLE_FACES,
    Template,
    face_pattern,
    internal_points,
    parent_pattern,
)


class Pattern(NamedTuple):
    """A way to cut: a cell type, the first of its facets of some type, and the kind of cut."""

    cell: str
    facet: int
    kind: str

    @property
    def face(self) -> str:
        """Type of the slave face."""
        return CELLS[self.cell].facets[self.facet].type

    @property
    def variant(self) -> str:
        """Name by which the user selects this kind; empty if there is no choice."""
        if self.kind == WHOLE:
            return "whole"
        if self.cell not in RING_PARENTS:
            return ""
        if self.cell == "QUAD4":
            return "default" if self.kind == RING else "beside a TRIA3"
        return "hexa" if self.kind == RING else "pyramid"

    @property
    def figure(self) -> str:
        """Name of the figure's file."""
        return f"{self.cell}_{self.face}_{self.kind}.svg".lower()

    @property
    def title(self) -> str:
        """One line that says what is cut, and into what."""
        variant = f", {self.variant}" if self.variant not in ("", "whole") else ""
        what = "left whole" if self.kind == WHOLE else children_text(self.volume)
        return f"{self.cell} by a {self.face}{variant}: {what}"

    @property
    def volume(self) -> Template:
        """The cut of the cell."""
        return parent_pattern(self.cell, self.facet, self.kind)

    @property
    def carriers(self) -> set[int]:
        """The nodes that carry an internal dof: the cell's own, or new ones, counted as the template's frame counts."""
        cell = CELLS[self.cell]
        if self.kind == WHOLE:
            return {cell.facets[self.facet].nodes[WHOLE_FACES[self.face]]}
        return {cell.n_nodes + int(p) for p in internal_points(self.face, self.kind)}

    @property
    def skin(self) -> Template:
        """The cut of the face."""
        return face_pattern(self.face, self.kind)


def patterns() -> list[Pattern]:
    """Every pattern, once: facets of the same type are cut alike."""
    found = []
    for cell in CELLS.values():
        faces = [f.type for f in cell.facets] if cell.dim > 1 else []
        for face in dict.fromkeys(faces):
            kinds = [WHOLE] if face in WHOLE_FACES else [RING, CONE] if cell.name in RING_PARENTS else [CONE]
            found += [Pattern(cell.name, faces.index(face), kind) for kind in kinds]
    return found


#: the patterns of the overview, row by row
_SHOWN = (
    ("TRIA3", "SEG2", CONE),
    ("QUAD4", "SEG2", RING),
    ("TETRA4", "TRIA3", CONE),
    ("TETRA10", "TRIA6", CONE),
    ("HEXA8", "QUAD4", CONE),
    ("HEXA8", "QUAD4", RING),
    ("PENTA6", "TRIA3", CONE),
    ("PENTA6", "QUAD4", CONE),
    ("PYRAM5", "QUAD4", CONE),
    ("PYRAM5", "TRIA3", CONE),
)


def shown() -> list[Pattern]:
    """The patterns of the overview."""
    return [next(p for p in patterns() if (p.cell, p.face, p.kind) == key) for key in _SHOWN]


def children_text(template: Template) -> str:
    """The children of a pattern by type, as `3 PYRAM5 + 1 TETRA4`."""
    return " + ".join(f"{len(block.rank)} {block.type}" for block in template.children)


def in_order(template: Template) -> list[tuple[str, NDArray[np.intp]]]:
    """The children of a pattern, in their order: type and nodes."""
    ranked = [(r, b.type, nodes) for b in template.children for r, nodes in zip(b.rank, b.nodes, strict=True)]
    return [(kind, nodes) for _, kind, nodes in sorted(ranked, key=lambda child: child[0])]
