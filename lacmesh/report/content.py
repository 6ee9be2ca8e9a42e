"""Content of a mesh as plain data, and lengths, areas and volumes of its cells."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.records import cut_of
from lacmesh.mesh import ENTITY_CODE, Ints, Mesh, mask_of
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.reference.quadrature import measure

#: cells whose Jacobians are in memory at once
_PIECE = 1 << 16


def describe(mesh: Mesh) -> dict[str, Any]:
    """All that `lacmesh info --json` says of a mesh; counts are of distinct cells."""
    low_high = [mesh.points.min(axis=0).tolist(), mesh.points.max(axis=0).tolist()] if mesh.n_nodes else None
    cut = cut_of(mesh)
    return {
        "nodes": mesh.n_nodes,
        "cells": mesh.n_cells,
        "cells_by_type": mesh.cells_by_type,
        "groups": {
            name: {"dim": mesh.group_dim(name), "cells": len(g), "size": size if np.isfinite(size) else None}
            for (name, g), size in zip(mesh.cell_groups.items(), group_sizes(mesh).values(), strict=True)
        },
        "node_groups": {name: len(members) for name, members in mesh.node_groups.items()},
        "entities": list(_entities(mesh)),
        "bounding_box": low_high,
        "lac": cut and {"macro_elements": cut.n_macros, "zones": list(cut.zones)},
    }


def _entities(mesh: Mesh) -> Iterator[dict[str, Any]]:
    """Yield each elementary entity of msh: dimension, tag, the number of its cells, and the box around them."""
    known = mesh.entities
    if not known:
        return
    entity = mesh.cell_data["entity"].astype(np.int64)
    place = np.searchsorted(np.array(known) @ ENTITY_CODE, entity @ ENTITY_CODE)
    place[entity[:, 0] < 0] = len(known)  # cells of none: one row more
    cells = np.bincount(place)
    low, high = np.full((len(known) + 1, 3), np.inf), np.full((len(known) + 1, 3), -np.inf)
    for (_, nodes), first in zip(mesh.blocks, mesh.offsets, strict=False):
        rows = place[first : first + len(nodes)]
        x = mesh.points[nodes]
        for axis in range(3):  # numpy is quick at this with one index only
            np.minimum.at(low[:, axis], rows, x[..., axis].min(axis=1))
            np.maximum.at(high[:, axis], rows, x[..., axis].max(axis=1))
    for k, (dim, tag) in enumerate(known):
        yield {"dim": dim, "tag": tag, "cells": int(cells[k]), "box": [low[k].tolist(), high[k].tolist()]}


def cell_sizes(mesh: Mesh, cells: Ints | None = None) -> NDArray[np.floating]:
    """Return the length, area or volume of cells (indices; all if None), 0 of points, NaN of types without shapes.

    >>> square = Mesh.create([[0, 0], [2, 0], [2, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]]), ("SEG2", [[0, 1]])])
    >>> cell_sizes(square).tolist()
    [2.0, 2.0]
    """
    cells = np.arange(mesh.n_cells) if cells is None else cells
    out, x = np.full(mesh.n_cells, np.nan), from_origin(mesh, origin_of_mesh(mesh)).points
    for name, chosen, nodes in mesh.select(cells):
        dim = CELLS[name].dim if name in CELLS else -1
        for first in range(0, len(chosen), _PIECE) if dim >= 0 else ():
            rows = slice(first, first + _PIECE)
            out[chosen[rows]] = np.abs(measure(name, x[nodes[rows]])) if dim else 0.0
    return out[cells]


def group_sizes(mesh: Mesh) -> dict[str, float]:
    """Return the length, area or volume of each group of cells, of its cells of the highest dimension."""
    used = mask_of(mesh.n_cells, *mesh.cell_groups.values())
    every = np.full(mesh.n_cells, np.nan)
    every[used] = cell_sizes(mesh, np.flatnonzero(used))
    return {
        name: float(every[cells[mesh.cell_dim[cells] == mesh.group_dim(name)]].sum()) if len(cells) else 0.0
        for name, cells in mesh.cell_groups.items()
    }
