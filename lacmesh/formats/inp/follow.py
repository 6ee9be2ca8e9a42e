"""Fate of a deck's elements and nodes in a mesh that was made of it: children, faces of children, new nodes.

A cut leaves every facet of a parent whole but those on the slave skin. The faces that lie on a facet of a parent are
therefore found by their nodes alone, whatever the patterns: the facets of its children that no two of them share
bound the parent, and two of them lie on the same facet if they meet at a node or an edge that the parent has not.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.deck import Deck
from lacmesh.formats.inp.types import FACETS
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, positions

#: a face of an element: the element's number, and the face's number as S1, S2 ... count
Side = tuple[int, int]


class Followed:
    """The elements and nodes of a deck, followed into a mesh made of it."""

    def __init__(self, deck: Deck, mesh: Mesh) -> None:
        self.deck, self.mesh = deck, mesh
        cards = [(k, c.numbers) for k, c in enumerate(deck.cards) if c.key == "ELEMENT" and c.numbers is not None]
        number = concatenated(n for _, n in cards)
        card = concatenated(np.full(len(n), k) for k, n in cards)
        order = np.argsort(number, kind="stable")
        self._number, self._card = number[order], card[order]

    @cached_property
    def root(self) -> Ints:
        """(n_cells,): number of the deck's element that each cell is, or is a part of; its own number where of none."""
        return self.deck.roots_of(self.mesh.cell_number.astype(np.int64))

    @cached_property
    def home(self) -> Ints:
        """(n_cells,): index of the *ELEMENT card of each cell, -1 for a cell that is of no element of the deck."""
        return np.append(self._card, -1)[positions(self._number, self.root)]

    @cached_property
    def changed(self) -> Ints:
        """Sorted numbers of the deck's elements that were replaced by children."""
        return np.intersect1d(self.deck.root, self._number)

    @property
    def n_read(self) -> int:
        """Number of the deck's nodes, which are the first ones of the mesh."""
        return self.deck.mesh.n_nodes

    @property
    def same(self) -> bool:
        """True if no element was replaced and no node added."""
        return not len(self.changed) and self.mesh.n_nodes == self.n_read

    def misfit(self) -> str:
        """Reason why the mesh is not one of this deck; empty if it is."""
        if self.deck.instances and self.untouched:
            return ""
        if not np.array_equal(self.mesh.node_number[: self.n_read], self.deck.mesh.node_number):
            return "its nodes have other numbers in the mesh"
        if len(np.unique(self.root[self.home >= 0])) < len(self._number):
            return "some of its elements are not in the mesh"
        elements = self.mesh.cell_number[self.home >= 0]
        if len(np.unique(elements)) < len(elements) or len(np.unique(self.mesh.node_number)) < self.mesh.n_nodes:
            return "numbers stand twice in the mesh"
        return ""

    @cached_property
    def untouched(self) -> bool:
        """True if nodes and groups are those that were read."""
        mesh, read = self.mesh, self.deck.mesh
        pairs = [(mesh.cell_groups, read.cell_groups), (mesh.node_groups, read.node_groups)]
        same_groups = all(
            a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a) for a, b in pairs
        )
        return self.same and same_groups and np.array_equal(mesh.points, read.points)

    def is_changed(self, number: int) -> bool:
        """True if the element was replaced by children."""
        return _among(number, self.changed)

    def exists(self, number: int) -> bool:
        """True if the deck has an element of this number that is a cell."""
        return _among(number, self._number)

    def children(self, number: int) -> list[int]:
        """Numbers of the children of an element that was replaced."""
        return self.mesh.cell_number[self._parts(number)].tolist()

    def _parts(self, number: int) -> Ints:
        root, cells = self._by_root
        return cells[np.searchsorted(root, number) : np.searchsorted(root, number, side="right")]

    @cached_property
    def _by_root(self) -> tuple[Ints, Ints]:
        cells = np.flatnonzero(np.isin(self.root, self.changed))
        cells = cells[np.argsort(self.root[cells], kind="stable")]
        return self.root[cells], cells

    def members(self, name: str) -> Ints | None:
        """Numbers of the elements that an element set of the deck had; None if there is no such set."""
        group = self.deck.element_group(name)
        if group is None:
            return None
        numbers = self.deck.mesh.cell_number[self.deck.mesh.cell_groups[group]]
        return numbers[np.isin(numbers, self._number)]

    def faces(self, number: int, face: int) -> list[Side]:
        """Faces of children that lie on face S`face` of an element that was replaced; an empty list if it has none."""
        (cell,) = np.flatnonzero(self.deck.mesh.cell_number == number)[:1]
        ((kind, _, nodes),) = self.deck.mesh.select(np.array([cell]))
        facets = FACETS.get(CELLS[kind].family, ())
        if not 1 <= face <= len(facets):
            return []
        wanted = set(_corners(kind, facets[face - 1], nodes[0]))
        old = set(nodes[0][: CELLS[kind].n_corners].tolist())
        for members in _connected(self._boundary(number), old, CELLS[kind].dim):
            if set().union(*(corners for _, corners in members)) & old == wanted:
                return [side for side, _ in members]
        return []

    def _boundary(self, number: int) -> list[tuple[Side, frozenset[int]]]:
        """Facets of the children of an element that no two of them share: the side, and its corners by index."""
        sides: dict[frozenset[int], list[Side]] = {}
        for kind, cells, nodes in self.mesh.select(self._parts(number)):
            for k, row in zip(cells.tolist(), nodes, strict=True):
                for label, facet in enumerate(FACETS[CELLS[kind].family], start=1):
                    side = int(self.mesh.cell_number[k]), label
                    sides.setdefault(frozenset(_corners(kind, facet, row)), []).append(side)
        return [(of[0], corners) for corners, of in sides.items() if len(of) == 1]

    def extended(self, nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Add to a set of nodes (n_nodes,) the new ones on faces, edges and cells whose corners are all in it."""
        return self.interpolated(nodes, np.zeros((len(nodes), 0)))[0]

    def interpolated(self, has: NDArray[np.bool_], values: Floats) -> tuple[NDArray[np.bool_], Floats]:
        """Values (n_nodes, m) of nodes that have some, `has` (n_nodes,), carried to the new nodes among them.

        A new node has one if all corners have of the face, edge or cell that it lies on: interpolated as fields are, or
        the mean of these corners where mid-nodes have none.
        """
        has, values = has.copy(), np.where(has[:, None], values, np.nan)
        for block in self.deck.added:
            inside = has[block.on].all(axis=1)
            new = block.values(values)[inside]
            mean = np.broadcast_to(values[block.on[inside]].mean(axis=1)[:, None], new.shape)
            ids = block.ids[inside]
            values[ids] = np.where(np.isnan(new), mean, new)
            has[ids] = True
        return has, values


def _among(number: int, numbers: Ints) -> bool:
    at = int(np.searchsorted(numbers, number))
    return at < len(numbers) and int(numbers[at]) == number


def _corners(kind: str, facet: int, nodes: Ints) -> list[int]:
    side = CELLS[kind].facets[facet]
    return nodes[list(side.nodes[: CELLS[side.type].n_corners])].tolist()


def _connected(
    facets: list[tuple[Side, frozenset[int]]], old: set[int], dim: int
) -> list[list[tuple[Side, frozenset[int]]]]:
    """Groups of facets that meet at `dim` - 1 nodes, one of them at least not `old`: those on one facet of a cell."""
    groups: list[list[tuple[Side, frozenset[int]]]] = []
    for facet in facets:
        meets = [g for g in groups if any(_meet(facet[1], other, old, dim) for _, other in g)]
        groups = [g for g in groups if g not in meets]
        groups.append([facet, *(member for g in meets for member in g)])
    return groups


def _meet(a: frozenset[int], b: frozenset[int], old: set[int], dim: int) -> bool:
    common = a & b
    return len(common) >= dim - 1 and bool(common - old)
