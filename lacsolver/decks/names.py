"""Look-up of the names and numbers of a deck in its mesh: nodes, cells, facets, skins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.deck import Deck
from lacmesh.formats.inp.elements import FACETS
from lacmesh.indices import Index
from lacmesh.mesh import Ints, Mesh, mask_of
from lacmesh.topology.facets import Facets
from lacmesh.topology.skin import FaceIncidence, Faces, cells_of_dim, faces_of, facets_of, find_owners
from lacsolver.decks.cards import DeckLine, Refused, look_up

#: number of a facet: this times its cell, and its place
SIDES = 8
#: digits of a number that no node and no element has
_DIGITS = 18


@dataclass
class Names:
    """Look-up of names and numbers of a deck in its mesh."""

    mesh: Mesh

    @property
    def deck(self) -> Deck:
        """The deck of the mesh."""
        assert self.mesh.deck is not None
        return self.mesh.deck

    def nodes(self, text: str, row: DeckLine | None) -> tuple[str, Ints]:
        """Return the name of a set and its nodes (k,), or "" and the node of a number. Raises Refused."""
        if _is_number(text):
            return "", self._place(self._node_index, text, "node", row)
        sets = self.deck.groups_of("NSET")
        name = sets[look_up(sets, text, "set of nodes", row)]
        if not len(self.mesh.node_groups[name]):
            raise Refused(f"the set of nodes {name!r} is empty", row)
        return name, np.asarray(self.mesh.node_groups[name])

    def node(self, text: str) -> int:
        """Return the node of a number, or the first one of a set. Raises Refused."""
        return int(self.nodes(text, None)[1][0])

    def cells(self, text: str, row: DeckLine | None) -> tuple[str, Ints]:
        """Return the name of a set and its solid cells (k,), or "" and the cell of a number. Raises Refused."""
        name, cells = self._cells(text, row)
        cells = cells[self.mesh.cell_dim[cells] == self.mesh.dim]
        if not len(cells):
            raise Refused(f"{text} has no solid elements", row)
        return name, cells

    def points(self, text: str) -> tuple[str, Ints]:
        """Return the name of a set of elements of one node, springs or masses, and their nodes (k,). Raises Refused."""
        name, cells = self._cells(text, None)
        nodes = [nodes[:, 0] for _, _, nodes in self.mesh.select(cells[self.mesh.cell_dim[cells] == 0])]
        if not nodes:
            raise Refused(f"{text} has no elements of one node, such as SPRING1 or MASS")
        return name, np.concatenate(nodes)

    def pairs(self, text: str) -> Ints:
        """Return the two nodes (m, 2) of each element of a set, (0, 2) of one of points. Raises Refused."""
        _, cells = self._cells(text, None)
        dims = self.mesh.cell_dim[cells]
        if dims.any() and (dims != 1).any():
            raise Refused(f"{text} has elements of other kinds beside springs between two nodes; give them a set each")
        pairs = [nodes for _, _, nodes in self.mesh.select(cells[dims == 1])]
        return np.concatenate([np.empty((0, 2), np.int64), *pairs])

    def _cells(self, text: str, row: DeckLine | None) -> tuple[str, Ints]:
        if _is_number(text):
            return "", self._place(self._cell_index, text, "element", row)
        sets = self.deck.groups_of("ELSET")
        name = sets[look_up(sets, text, "set of elements", row)]
        return name, np.asarray(self.mesh.cell_groups[name])

    def _place(self, index: Index, text: str, what: str, row: DeckLine | None) -> Ints:
        """Return the index (1,) of a number. Raises Refused."""
        place = index.places(np.array([int(text)])) if len(text) < _DIGITS else np.array([-1])
        if place[0] < 0:
            raise Refused(f"there is no {what} {text[:40]}", row)
        return place

    def facets(self, cells: Ints, side: str, row: DeckLine) -> Ints:
        """Return the numbers of the facets `side` ("1", "2" ... of the deck) of some cells. Raises Refused."""
        facets = []
        for kind, chosen, _ in self.mesh.select(cells):
            places = FACETS[CELLS[kind].family]
            if not (_is_number(side) and 1 <= int(side) <= len(places)):
                raise Refused(f"a {kind} has the faces 1 to {len(places)}, and no face {side!r}", row)
            facets.append(chosen * SIDES + places[int(side) - 1])
        return np.concatenate(facets)

    def skin(self, text: str, row: DeckLine | None) -> tuple[str, Ints]:
        """Return the name of a surface and its facets (k,): of a surface of nodes, the faces on these nodes alone.

        Raises Refused for a surface that is not there, or has no faces of solid cells.
        """
        there = self.deck.surface_group(text)
        if there is None:
            look_up(self.deck.groups_of("NODE", "ELEMENT"), text, "surface", row)
        assert there is not None
        kind, name = there
        if kind == "NODE":
            return name, self._faces_on(name, row)
        cells = self.mesh.cell_groups[name]
        faces = faces_of(self.mesh, cells[self.mesh.cell_dim[cells] == self.mesh.dim - 1])
        owners = find_owners(faces, list(cells_of_dim(self.mesh, self.mesh.dim)), self.mesh.n_nodes)
        if not len(owners.face):
            raise Refused(f"the surface {name!r} has no faces of solid elements", row)
        first = np.unique(owners.face, return_index=True)[1]
        return name, owners.cell[first] * SIDES + owners.facet[first]

    def inner(self, facets: Ints) -> Ints:
        """Return those of some facets that lie between two cells."""
        return facets[~np.isin(facets, self._boundary)]

    def of_nodes(self, text: str) -> bool:
        """True if a surface is one of nodes."""
        there = self.deck.surface_group(text)
        return there is not None and there[0] == "NODE"

    def _faces_on(self, name: str, row: DeckLine | None) -> Ints:
        """Return the facets of the boundary whose nodes all belong to a group of nodes. Raises Refused."""
        chosen = mask_of(self.mesh.n_nodes + 1, self.mesh.node_groups[name])
        chosen[-1] = True  # faces of few nodes are padded with -1
        inside = chosen[faces_at(self.mesh, self._boundary).nodes].all(axis=1)
        if not inside.any():
            message = f"no face of the bodies has all its nodes in the surface of nodes {name!r}"
            raise Refused(f"{message}; name a surface of element faces", row)
        return self._boundary[inside]

    @cached_property
    def in_cells(self) -> NDArray[np.bool_]:
        """Mask (n_nodes,), True for nodes of a solid cell."""
        return mask_of(self.mesh.n_nodes, *(nodes for _, nodes, _ in cells_of_dim(self.mesh, self.mesh.dim)))

    @cached_property
    def _boundary(self) -> Ints:
        """Numbers of the facets that belong to one cell only."""
        facets = Facets.of(self.mesh)
        rows, facet = facets.boundary
        return np.asarray(facets.solid.cells[rows].astype(np.int64) * SIDES + facet)

    @cached_property
    def _node_index(self) -> Index:
        return Index(self.mesh.node_number)

    @cached_property
    def _cell_index(self) -> Index:
        """Cells by number; skin cells, whose numbers are no elements of the deck, come after these."""
        return Index(self.mesh.cell_number)


def faces_at(mesh: Mesh, facets: Ints) -> Faces:
    """Return the faces of some facets (k,), in their order."""
    cells, places = np.divmod(facets, SIDES)
    return facets_of(mesh, FaceIncidence(np.arange(len(cells)), cells, places, np.ones(len(cells), bool)))


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdigit()
