"""Sets and surfaces of an .inp file: members by number and by name, faces of elements as skin cells, and the way back.

A face of an element becomes a cell unless a cell lies on it already; faces are known by their corners. A surface that
names a shell's own side means the shell itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.deck import DeckCard, key_of
from lacmesh.errors import did_you_mean
from lacmesh.formats.inp.cards import Members
from lacmesh.formats.inp.elements import FACETS, LINE, PLANE, SHELL, SIDES, SOLID, DeckElement
from lacmesh.joining import with_cells
from lacmesh.mesh import Ints, Mesh, concatenated, positions
from lacmesh.topology.orientation import relative_listing
from lacmesh.topology.skin import (
    FACE_TYPES,
    N_NODES,
    TYPE_CODE,
    FaceIncidence,
    Faces,
    cells_of_dim,
    faces_of,
    facets_of,
    find_owners,
    find_repeats,
    first_of_each,
    label_faces,
)

#: Kinds of sets: of nodes and of elements, and surfaces of nodes and of element faces -> what their members are.
OF_KIND = {"NSET": "node", "ELSET": "element", "NODE": "node", "ELEMENT": "element"}
#: Sets inside sets: how deep.
_DEEPEST = 500
#: Kind of a set, and its name for comparison.
SetKey = tuple[str, str]


@dataclass
class ElementCard:
    """Elements of one card: its index, their type, numbers (k,), nodes (k, n) by number, further ones in its lines."""

    card: DeckCard
    index: int
    element: DeckElement
    number: Ints
    nodes: Ints
    surplus: int


@dataclass
class NamedSet:
    """A set or a surface: the name of its group, the first of its cards, and its members."""

    shown: str
    card: DeckCard
    members: list[Members] = field(default_factory=list)


class Resolver:
    """Resolves sets, nested ones too, into numbers; `strays`: count of members that are no nodes or cells."""

    def __init__(self, sets: Mapping[SetKey, NamedSet], nodes: Ints, cells: list[ElementCard]) -> None:
        self.sets, self.cells = sets, cells
        self.present = {"node": np.sort(nodes), "element": np.sort(concatenated(e.number for e in cells))}
        self.strays = 0
        self._resolved: dict[SetKey, Ints] = {}
        self._open: list[SetKey] = []

    def numbers(self, kind: str, name: str, card: DeckCard) -> Ints:
        """Return the sorted numbers in a set; `card`: the one that refers to it, for the error. Raises ReadError."""
        at = kind, key_of(name)
        at = at if at in self.sets else (kind, name)  # the name in an instance is one for comparison already
        if at not in self.sets:
            shown = [one.shown for (other, _), one in self.sets.items() if other == kind]
            raise card.error(f"there is no set of {OF_KIND[kind]}s named {name!r}{did_you_mean(name, shown)}")
        if at in self._resolved:
            return self._resolved[at]
        if at in self._open or len(self._open) >= _DEEPEST:
            raise card.error(f"the set {name!r} contains itself, or too many sets inside one another")
        self._open.append(at)
        one = self.sets[at]
        parts: list[Ints] = [np.empty(0, np.int64)]
        for members in one.members:
            listed = self.members(members, one.card)
            if OF_KIND[kind] == "node" and members.of == "element":
                parts += [e.nodes[positions(np.sort(listed), e.number) >= 0].ravel() for e in self.cells]
            else:
                parts.append(listed)
        self._open.pop()
        self._resolved[at] = np.unique(np.concatenate(parts))
        return self._resolved[at]

    def members(self, members: Members, card: DeckCard) -> Ints:
        """Return the numbers of some members that exist. Raises ReadError."""
        listed, present = members.listed, self.present[members.of]
        if isinstance(listed, str):
            return self.numbers("NSET" if members.of == "node" else "ELSET", listed, card)
        if isinstance(listed, range):
            inside = present[np.searchsorted(present, listed.start) : np.searchsorted(present, listed.stop)]
            return inside[(inside - listed.start) % listed.step == 0]
        if np.array_equal(listed, present):
            return present
        known = positions(present, listed) >= 0
        self.strays += int((~known).sum())
        return listed[known]


# ---- faces of surfaces


#: One face of some cells, sorted indices: its label, "" for all faces that no other cell shares; the cells; its card.
Sides = tuple[str, Ints, DeckCard]


def with_surfaces(
    mesh: Mesh, kind: Ints, surfaces: Mapping[str, Sequence[Sides]], largest: int, warnings: list[str]
) -> Mesh:
    """Return the mesh with a group of cells for each surface; new cells are numbered from `largest` on.

    `kind` (n_cells,): SOLID ... of each. A face on which a cell of the group of the same name lies adds no other cell.
    Raises ReadError; a side that no face has is named in `warnings`.
    """
    known = [(t, nodes, cells) for t, cells, nodes in mesh.select(np.arange(mesh.n_cells))]
    solid = [(t, nodes, cells) for t, cells, nodes in mesh.select(np.flatnonzero(np.isin(kind, (SOLID, PLANE))))]
    unknown: dict[str, None] = {}
    groups = dict(mesh.cell_groups)
    members = {name: groups.get(name, np.empty(0, np.int64)) for name in surfaces}
    parts: list[tuple[str, Ints]] = []
    of_part: list[int] = []  # the surface of each part
    for s, (name, sides) in enumerate(surfaces.items()):
        for side in sides:
            shells, of_side = _faces_of_side(mesh, kind, side, solid, unknown)
            groups[name] = np.append(groups.get(name, shells[:0]), shells)
            parts += of_side
            of_part += [s] * len(of_side)
    if unknown:
        warnings.append(f"surfaces name sides that are no faces, left out: {', '.join(unknown)}")
    faces = Faces.join(parts)
    surface = np.repeat(np.array(of_part, int), [len(nodes) for _, nodes in parts])
    first, label = first_of_each(*label_faces(faces))
    distinct = faces.take(first)
    repeats = find_repeats(distinct, known, mesh.n_nodes)
    cell = np.full(len(first), -1)
    cell[repeats.face[::-1]] = repeats.cell[::-1]  # the first cell on a face
    new: list[tuple[str, Ints]] = []
    n = mesh.n_cells
    for code in dict.fromkeys(distinct.type[cell < 0].tolist()):
        rows = np.flatnonzero((cell < 0) & (distinct.type == code))
        new.append((FACE_TYPES[code], distinct.nodes[rows][:, : N_NODES[code]]))
        cell[rows] = n + np.arange(len(rows))
        n += len(rows)
    for s, name in enumerate(surfaces):
        own = label[surface == s]
        there = repeats.face[np.isin(repeats.cell, members[name])]
        groups[name] = np.append(groups.get(name, members[name]), cell[own[~np.isin(own, there)]])
    return with_cells(mesh, new, largest + 1, groups)


def _faces_of_side(
    mesh: Mesh, kind: Ints, side: Sides, solid: list[tuple[str, Ints, Ints]], unknown: dict[str, None]
) -> tuple[Ints, list[tuple[str, Ints]]]:
    """Return the cells that a side of some cells means themselves, and faces as parts (type, nodes)."""
    label, sided, card = side
    shells = sided[kind[sided] == SHELL]
    if not label:
        return shells, _free_faces(mesh, sided[np.isin(kind[sided], (SOLID, PLANE))], solid)
    themselves = shells if label in SIDES else shells[:0]
    parts = []
    for cell_type, cells, nodes in mesh.select(np.setdiff1d(sided, themselves)):
        for code in np.unique(kind[cells]).tolist():
            facet = _facet(cell_type, code, label)
            if facet is not None:
                face = CELLS[cell_type].facets[facet]
                parts.append((face.type, nodes[kind[cells] == code][:, face.nodes]))
            elif label[:1] in "SE" and label[1:].isdecimal() and code in (SOLID, PLANE):
                raise card.error(f"a surface names the face {label} of a {cell_type}, which has none")
            else:
                unknown[f"{label} of {cell_type}"] = None
    return themselves, parts


def _free_faces(mesh: Mesh, cells: Ints, solid: list[tuple[str, Ints, Ints]]) -> list[tuple[str, Ints]]:
    """Return the faces of some cells that no other cell shares."""
    faces = Faces.join((f.type, nodes[:, f.nodes]) for t, _, nodes in mesh.select(cells) for f in CELLS[t].facets)
    distinct = faces.take(first_of_each(*label_faces(faces))[0])
    owners = find_owners(distinct, solid, mesh.n_nodes)
    free = distinct.take(np.flatnonzero(np.bincount(owners.face, minlength=len(distinct)) == 1))
    codes = np.unique(free.type).tolist()
    return [(FACE_TYPES[code], free.nodes[free.type == code][:, : N_NODES[code]]) for code in codes]


def _facet(cell: str, kind: int, label: str) -> int | None:
    """Index of the facet of a cell that a face label means; None for an unknown label."""
    facets = FACETS.get(CELLS[cell].family, ())
    number = int(label[1:]) if label[1:].isdecimal() and len(label) < 4 else 0
    if kind == LINE and label in ("END1", "END2"):
        return int(label == "END2")
    if kind == SHELL:  # Abaqus counts a shell's edges from E1, CalculiX from S3
        number = number if label[0] == "E" else number - 2 if label[0] == "S" else 0
    elif kind not in (SOLID, PLANE) or label[0] != "S":
        return None
    return facets[number - 1] if 1 <= number <= len(facets) else None


def roles_of(mesh: Mesh, all_cells: bool) -> tuple[NDArray[np.bool_], Ints, Ints]:
    """Return which cells (n_cells,) are elements, and for skin the cell behind it (-1 for none) and its facet.

    Of two cells behind, it is the one whose facet has the same orientation.
    """
    parent, facet = np.full(mesh.n_cells, -1), np.full(mesh.n_cells, -1)
    below = mesh.cell_dim == mesh.dim - 1
    types = np.repeat(
        [b.type in TYPE_CODE for b in mesh.blocks] or [False], np.diff(mesh.offsets) if mesh.blocks else 0
    )
    skin = np.flatnonzero(below & types) if mesh.dim > 1 else np.empty(0, np.int64)
    faces = faces_of(mesh, skin)
    first, which = first_of_each(*label_faces(faces))
    solid = [part for part in cells_of_dim(mesh, mesh.dim) if part[0] in CELLS and CELLS[part[0]].family in FACETS]
    owners = find_owners(faces.take(first), solid, mesh.n_nodes)
    count = np.bincount(owners.face, minlength=len(first))
    begin, count = (np.cumsum(count) - count)[which], count[which]
    rows = np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(count.sum())
    face = np.repeat(np.arange(len(faces)), count)  # a face and a cell behind it, pair by pair
    pairs = FaceIncidence(face, owners.cell[rows], owners.facet[rows], owners.same[rows])
    opposite = relative_listing(faces.take(face), facets_of(mesh, pairs)) % 2
    best = np.lexsort((opposite, face))
    best = best[np.append(True, np.diff(face[best]) != 0)[: len(best)]]
    parent[skin[face[best]]], facet[skin[face[best]]] = pairs.cell[best], pairs.facet[best]
    element = (mesh.cell_dim == mesh.dim) | (below & (parent < 0))
    return element | all_cells, parent, facet
