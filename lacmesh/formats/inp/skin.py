"""Surfaces of an .inp file as skin cells: a face of an element becomes a cell unless a cell lies on it already.

A surface that names a shell's own side means the shell itself. Faces are identified by their corners; two surfaces, or
two elements, that name the same face get the same cell.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.formats.inp.cards import Card
from lacmesh.formats.inp.types import FACETS, LINE, PLANE, SHELL, SIDES, SOLID
from lacmesh.mesh import Ints
from lacmesh.topology.skin import FACE_TYPES, N_NODES, Faces, find_owners, find_repeats, first_of_each, label_faces


class CellBlock(NamedTuple):
    """All cells of one type: their nodes (k, n) as indices, and the kind (k,) of each, SOLID ... (`inp.types`)."""

    type: str
    nodes: Ints
    kind: Ints


@dataclass
class Skin:
    """Collector of surfaces: the existing cells and the faces of each; `unknown`: face labels without a meaning.

    `blocks`: the cells of the file, a cell's index counts through them.
    """

    blocks: list[CellBlock]
    n_nodes: int
    existing: list[Ints] = field(default_factory=list)
    faces: list[tuple[int, tuple[str, Ints]]] = field(default_factory=list)
    n_surfaces: int = 0
    unknown: dict[str, None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.offsets = np.cumsum([0, *(len(b.nodes) for b in self.blocks)])

    def _parts(self, which: Ints) -> list[tuple[CellBlock, Ints, Ints]]:
        """Blocks, the indices of their cells among `which` (sorted), and the rows of these in the block."""
        spans = zip(self.blocks, self.offsets[:-1].tolist(), self.offsets[1:].tolist(), strict=True)
        parts = [(b, which[np.searchsorted(which, lo) : np.searchsorted(which, hi)], lo) for b, lo, hi in spans]
        return [(b, cells, cells - lo) for b, cells, lo in parts]

    def begin(self) -> None:
        """Begin the next surface."""
        self.n_surfaces += 1
        self.existing.append(np.empty(0, np.int64))

    def add(self, card: Card, label: str, which: Ints) -> None:
        """Add to the surface begun last the face `label` of the cells `which` (sorted indices). Raises ReadError."""
        if not label:
            self._add_free(which)
            return
        for block, cells, rows in self._parts(which):
            for kind in np.unique(block.kind[rows]).tolist():
                alike = block.kind[rows] == kind
                self._add_side(card, label, block, kind, cells[alike], rows[alike])

    def _add_side(self, card: Card, label: str, block: CellBlock, kind: int, which: Ints, rows: Ints) -> None:
        """Add one face of cells of one block that are all of one kind. Raises ReadError."""
        if kind == SHELL and label in SIDES:
            self.existing[-1] = np.append(self.existing[-1], which)
            return
        facet = _facet(block.type, kind, label)
        if facet is None:
            if label[:1] in "SE" and label[1:].isdigit() and kind in (SOLID, PLANE):
                raise card.error(f"a surface names the face {label} of a {block.type}, which has none")
            self.unknown[f"{label} of {block.type}"] = None
            return
        side = CELLS[block.type].facets[facet]
        self.faces.append((self.n_surfaces - 1, (side.type, block.nodes[rows][:, side.nodes])))

    def _add_free(self, which: Ints) -> None:
        """Add all faces of some cells that no other cell shares, and shells themselves."""
        parts = []
        for block, cells, here in self._parts(which):
            shells = block.kind[here] == SHELL
            self.existing[-1] = np.append(self.existing[-1], cells[shells])
            solid = np.isin(block.kind[here], (SOLID, PLANE))
            parts += [(f.type, block.nodes[here[solid]][:, f.nodes]) for f in CELLS[block.type].facets if solid.any()]
        faces = Faces.join(parts)
        first = first_of_each(*label_faces(faces))[0]
        owners = find_owners(faces.take(first), self._volumes(), self.n_nodes)
        free = np.bincount(owners.face, minlength=len(first)) == 1
        for code in np.unique(faces.type[first[free]]).tolist():
            chosen = first[free & (faces.type[first] == code)]
            self.faces.append((self.n_surfaces - 1, (FACE_TYPES[code], faces.nodes[chosen][:, : N_NODES[code]])))

    def _volumes(self) -> list[tuple[str, Ints, Ints]]:
        """Solid and plane cells: (type, nodes, indices)."""
        volumes = []
        for block, lo in zip(self.blocks, self.offsets.tolist(), strict=False):
            solid = (block.kind == SOLID) | (block.kind == PLANE)
            volumes.append((block.type, block.nodes[solid], lo + np.flatnonzero(solid)))
        return volumes

    def finish(self, members: list[Ints]) -> tuple[list[tuple[str, Ints]], list[Ints]]:
        """Return the new cells, one (type, nodes) per type, and the cell indices of each surface.

        The indices of new cells follow the existing ones, counted through their types in this order. `members`: for
        each surface the cells of the element set of its name; a face on which one of them lies adds no other cell.
        """
        faces = Faces.join([side for _, side in self.faces])
        of_surface = np.repeat([s for s, _ in self.faces] or [0], [len(nodes) for _, (_, nodes) in self.faces] or [0])
        first, label = first_of_each(*label_faces(faces))
        distinct = faces.take(first)
        spans = zip(self.blocks, self.offsets.tolist(), strict=False)
        known = [(b.type, b.nodes, lo + np.arange(len(b.nodes))) for b, lo in spans]
        repeats = find_repeats(distinct, known, self.n_nodes)
        cell = np.full(len(first), -1)
        cell[repeats.face[::-1]] = repeats.cell[::-1]  # the first cell on a face
        new: list[tuple[str, Ints]] = []
        n = int(self.offsets[-1])
        for code in dict.fromkeys(distinct.type[cell < 0].tolist()):
            rows = np.flatnonzero((cell < 0) & (distinct.type == code))
            new.append((FACE_TYPES[code], distinct.nodes[rows][:, : N_NODES[code]]))
            cell[rows] = n + np.arange(len(rows))
            n += len(rows)
        groups = []
        for s, old in enumerate(self.existing):
            mine = label[of_surface == s]
            there = repeats.face[np.isin(repeats.cell, members[s])]
            groups.append(np.append(old, cell[mine[~np.isin(mine, there)]]))
        return new, groups


def _facet(cell: str, kind: int, label: str) -> int | None:
    """Index of the facet of a cell that a face label means; None for an unknown label."""
    family = CELLS[cell].family
    number = int(label[1:]) if label[1:].isdigit() and len(label) < 4 else 0
    if kind in (SOLID, PLANE) and label[0] == "S" and 1 <= number <= len(FACETS[family]):
        return FACETS[family][number - 1]
    if kind == SHELL:  # Abaqus counts a shell's edges from E1, CalculiX from S3
        edge = number if label[0] == "E" else number - 2 if label[0] == "S" else 0
        return FACETS[family][edge - 1] if 1 <= edge <= len(FACETS[family]) else None
    if kind == LINE and label in ("END1", "END2"):
        return int(label == "END2")
    return None
