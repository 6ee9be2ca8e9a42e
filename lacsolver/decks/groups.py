"""Groups of the mesh that an import writes: sets of the deck, and what supports, loads and contact need besides."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lacmesh.mesh import Ints, Mesh, concatenated, places_of
from lacmesh.topology.skin import FACE_TYPES, N_NODES, cells_of_dim
from lacsolver.decks.names import faces_at


@dataclass
class DeckGroups:
    """Groups by name: `nodes`, solid `cells`, and `skins` of facets (numbers), all of the mesh of the deck."""

    mesh: Mesh
    nodes: dict[str, Ints] = field(default_factory=dict)
    cells: dict[str, Ints] = field(default_factory=dict)
    skins: dict[str, Ints] = field(default_factory=dict)

    @classmethod
    def of(cls, mesh: Mesh) -> DeckGroups:
        """Return the sets of nodes and of elements that a deck has."""
        solid = {name: cells[mesh.cell_dim[cells] == mesh.dim] for name, cells in mesh.cell_groups.items()}
        nodes = {name: np.asarray(some) for name, some in mesh.node_groups.items() if len(some)}
        return cls(mesh, nodes, {name: cells for name, cells in solid.items() if len(cells)})

    def add(self, kind: str, name: str, members: Ints) -> str:
        """Return the name of the group of `nodes`, `cells` or `skins`: `name`, with a number if others have it."""
        own: dict[str, Ints] = getattr(self, kind)
        others = {"nodes": {}, "cells": self.skins, "skins": self.cells}[kind]
        chosen, k, members = name, 1, np.unique(members)
        while chosen in others or (chosen in own and not np.array_equal(own[chosen], members)):
            k += 1
            chosen = f"{name}_{k}"
        own[chosen] = members
        return chosen

    def written(self) -> Mesh:
        """Return the mesh: the deck's nodes and solid cells, and skin cells, one for each facet of a skin."""
        mesh = self.mesh
        blocks = [(kind, nodes) for kind, nodes, _ in cells_of_dim(mesh, mesh.dim)]
        old = np.concatenate([cells for _, _, cells in cells_of_dim(mesh, mesh.dim)])
        place = places_of(old, mesh.n_cells)
        facets = np.unique(concatenated(self.skins.values()))
        faces = faces_at(mesh, facets)
        rows = [np.flatnonzero(faces.type == code) for code in np.unique(faces.type)]
        blocks += [(FACE_TYPES[faces.type[of[0]]], faces.nodes[of, : N_NODES[faces.type[of[0]]]]) for of in rows]
        new = np.empty(len(facets), np.int64)
        new[concatenated(rows)] = len(old) + np.arange(len(facets))
        groups = {name: place[cells] for name, cells in self.cells.items()}
        groups |= {name: new[np.searchsorted(facets, some)] for name, some in self.skins.items()}
        number = mesh.cell_number[old]
        return Mesh.create(
            mesh.points,
            blocks,
            space_dim=mesh.dim,
            node_number=mesh.node_number,
            cell_number=np.append(number, number.max() + 1 + np.arange(len(facets))),
            cell_groups=groups,
            node_groups=self.nodes,
            name=mesh.name,
        )
