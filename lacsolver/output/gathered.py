"""Fields of several processes in one file of MED, gathered on the first process: for models of moderate size."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD
from lacmesh.mesh import Ints, Mesh
from lacsolver.output.med import MedSeries
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.results.whole import Order
from lacsolver.space.space import Space


class GatheredSeries:
    """The file results.med of several processes, all of which call the same methods; see `MedSeries`."""

    def __init__(self, folder: Path, space: Space, zones: Iterable[str], end: float | None = None) -> None:
        assert space.share.own is not None and space.share.node is not None and space.share.cell is not None
        self._space, self._share, self._node, self._cell = space, space.share, space.share.node, space.share.cell
        self._nodes = Order(space.share, space.share.node, space.share.own)
        mesh = self._whole_mesh(_cells_of(space))
        self._series: MedSeries | None = None

        def begin() -> None:
            self._series = MedSeries(folder, replace(space, mesh=mesh), zones, end)

        self._share.on_first(begin)

    def write(self, fields: Fields, number: int) -> None:
        """Add the fields after `number` steps. Raises WriteError, on all processes."""
        whole = replace(
            fields,
            displacement=self._at_nodes(fields.displacement),
            stress=self._at_nodes(fields.stress),
            reaction=self._at_nodes(fields.reaction),
            velocity=self._at_nodes_if(fields.velocity),
            acceleration=self._at_nodes_if(fields.acceleration),
            plastic_strain=self._at_nodes_if(fields.plastic_strain),
            zones={name: self._zone(zone) for name, zone in fields.zones.items()},
        )

        def add() -> None:
            assert self._series is not None
            self._series.write(whole, number)

        self._share.on_first(add)

    def _zone(self, zone: ZoneFields) -> ZoneFields:
        """Return the fields of a zone, which are the same on all processes, with nodes and cells of the whole mesh."""
        surface = zone.surface
        nodes = np.where(surface.faces.nodes >= 0, self._node[surface.faces.nodes], -1)
        faces = replace(surface.faces, nodes=nodes)
        return replace(
            zone,
            surface=replace(surface, faces=faces, cell=self._cell[surface.cell]),
            contact_force=self._at_nodes(zone.contact_force),
            pressure_recovered=self._at_nodes(zone.pressure_recovered),
            shear_recovered=self._at_nodes_if(zone.shear_recovered),
        )

    def _at_nodes(self, values: NDArray) -> NDArray:
        """Return values (n_nodes, ...) at the nodes of the whole mesh, on the first process."""
        return _all(self._nodes, values)

    def _at_nodes_if(self, values: NDArray | None) -> NDArray | None:
        """Return values at the nodes of the whole mesh; None for a field that the case does not have."""
        return None if values is None else self._at_nodes(values)

    def _whole_mesh(self, own: NDArray[np.bool_]) -> Mesh:
        """Return the whole mesh on the first process, the part on others. `own` (n_cells,): each is in one process."""
        mesh, blocks = self._space.mesh, []
        cells = Order(self._share, self._cell, own)
        for k, block in enumerate(mesh.blocks):
            here = slice(mesh.offsets[k], mesh.offsets[k + 1])
            order = Order(self._share, self._cell[here], own[here])
            blocks.append((block.type, _all(order, self._node[block.nodes])))
        rest: dict[str, Any] = {
            "node_number": self._at_nodes(mesh.node_number),
            "cell_number": _all(cells, mesh.cell_number),
            "node_groups": {k: self._members(v, self._node) for k, v in mesh.node_groups.items()},
            "cell_groups": {k: self._members(v, self._cell) for k, v in mesh.cell_groups.items()},
            "node_data": {k: self._at_nodes(mesh.node_data[k]) for k in (NODE_RECORD,) if k in mesh.node_data},
            "cell_data": {k: _all(cells, mesh.cell_data[k]) for k in CELL_RECORDS if k in mesh.cell_data},
        }
        points = self._at_nodes(mesh.points)
        if self._share.rank > 0:
            return mesh
        return Mesh.create(points, blocks, space_dim=mesh.space_dim, zones=mesh.zones, name=mesh.name, **rest)

    def _members(self, members: Ints, place: Ints) -> Ints:
        """Return the members of a group of the whole mesh, ascending, on the first process."""
        return np.unique(self._share.collect(place[members].astype(np.int64)))


def _all(order: Order, values: NDArray) -> NDArray:
    return np.concatenate([values[:0], *order.pieces(values)])


def _cells_of(space: Space) -> NDArray[np.bool_]:
    """Return a mask (n_cells,) of the cells of every dimension that count for this process, by their first nodes."""
    assert space.share.own is not None
    own = np.zeros(space.mesh.n_cells, bool)
    for k, block in enumerate(space.mesh.blocks):
        own[space.mesh.offsets[k] : space.mesh.offsets[k + 1]] = space.share.own[block.nodes[:, 0]]
    return own
