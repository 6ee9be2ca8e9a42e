"""The macro-elements of a cut, written into the data of its mesh as records (`records`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh.cutting.assemble import Origin
from lacmesh.cutting.patterns import WHOLE_FACES, internal_points
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD
from lacmesh.cutting.select import Selection
from lacmesh.cutting.subdivide import PATTERNS
from lacmesh.mesh import Ints, Mesh, codes
from lacmesh.topology.skin import FACE_TYPES


def with_macros(mesh: Mesh, new: Mesh, selection: Selection, origin: Origin, internal: Ints) -> Mesh:
    """Return the new mesh with the records of its macro-elements; `mesh`: the old one, `internal`: `internal_nodes`."""
    wide = int(mesh.cell_number.max(initial=0)) > np.iinfo(np.int32).max
    macro, zone, child = (np.full(new.n_cells, -1, np.int32) for _ in range(3))
    parent = np.full(new.n_cells, -1, np.int64 if wide else np.int32)
    parent[origin.child] = mesh.cell_number[origin.parent]
    macro_of_old = np.full(mesh.n_cells, -1, np.int32)
    macro_of_old[selection.slave] = np.arange(len(selection.slave), dtype=np.int32)
    ours = macro_of_old[origin.parent] >= 0
    whole = np.flatnonzero(origin.followed >= 0)
    faces = np.concatenate([origin.child[ours], origin.followed[whole]])
    macro[faces] = np.concatenate([macro_of_old[origin.parent[ours]], whole])
    zone[faces] = selection.zone[macro[faces]]
    child[faces] = np.concatenate([origin.child_index[ours], np.zeros(len(whole), int)]) + 1
    records = dict(zip(CELL_RECORDS, (macro, zone, child, parent), strict=True))
    return replace(
        new,
        cell_data={**new.cell_data, **records},
        node_data={**new.node_data, NODE_RECORD: internal},
        zones=selection.zones,
    )


def internal_nodes(n_nodes: int, selection: Selection, patterns: Ints, face_points: Ints, ring: float) -> Ints:
    """(n_nodes,): the macro-element whose internal dof each node carries, or -1."""
    owner = np.full(n_nodes, -1, np.int32)
    code = selection.faces.type * len(PATTERNS) + patterns
    for value in codes(code):
        face, pattern = FACE_TYPES[value // len(PATTERNS)], PATTERNS[value % len(PATTERNS)]
        rows = np.flatnonzero(code == value)
        if face in WHOLE_FACES:
            owner[selection.faces.nodes[rows, WHOLE_FACES[face]]] = rows
        else:
            owner[face_points[rows][:, internal_points(face, pattern, ring)]] = rows[:, None]
    return owner
