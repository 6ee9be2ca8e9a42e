"""The whole ring of a sector with cyclic symmetry, for ParaView: cells and fields, turned sector by sector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Mesh
from lacsolver.case import Case, Cyclic
from lacsolver.constraints.cyclic import turn_of

#: places of the components xx, yy, zz, xy, yz, xz of a stress in a matrix
_ROWS, _COLUMNS = [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]


def asked(case: Case) -> Cyclic | None:
    """Return the sector of a case whose whole ring is to be written; None if there is none."""
    return next((record for record in case.cyclic if record.ring), None)


def ring_of(mesh: Mesh, record: Cyclic) -> Mesh:
    """Return the sector's mesh with its fields, repeated about the axis; nodes of neighbouring sectors are not joined.

    Nodal fields of three components are turned as vectors, those of six as stresses, others are repeated. Cells have
    the data `sector`, counted from 0.
    """
    step = turn_of(record, mesh.dim)
    points, fields = [], []
    for k in range(record.sectors):
        turn = step._replace(R=np.linalg.matrix_power(step.R, k))
        points.append(turn.places(mesh.points))
        fields.append({name: _turned(np.asarray(values), turn.R) for name, values in mesh.node_data.items()})
    n = mesh.n_nodes
    blocks = [
        (block.type, np.concatenate([block.nodes + k * n for k in range(record.sectors)])) for block in mesh.blocks
    ]
    sector = [np.repeat(np.arange(record.sectors), len(block.nodes)) for block in mesh.blocks]
    data = {name: np.concatenate([one[name] for one in fields]) for name in mesh.node_data}
    whole = Mesh.create(np.concatenate(points), blocks, space_dim=mesh.dim)
    return replace(whole, node_data=data, cell_data={"sector": np.concatenate(sector).astype(np.int32)})


def _turned(values: NDArray, R: NDArray) -> NDArray:
    """Return nodal values, turned by R (3, 3)."""
    if values.ndim == 2 and values.shape[1] == 3:
        return np.asarray(values @ R.T)
    if values.ndim == 2 and values.shape[1] == 6:
        full = np.zeros((len(values), 3, 3))
        full[:, _ROWS, _COLUMNS] = full[:, _COLUMNS, _ROWS] = values
        return (R @ full @ R.T)[:, _ROWS, _COLUMNS]
    return values
