"""The macro-elements of a cut: the records of its faces and of the nodes that carry an internal dof (`records`)."""

from __future__ import annotations

import numpy as np

from lacmesh.cutting.patterns import WHOLE_FACES, internal_points
from lacmesh.cutting.records import CELL_RECORDS, Cut, Origin, with_records
from lacmesh.cutting.select import Selection
from lacmesh.cutting.subdivide import CutFaces
from lacmesh.mesh import Ints, Mesh


def with_macros(mesh: Mesh, new: Mesh, origin: Origin, selection: Selection, internal: Ints) -> Cut:
    """Return the cut: the new mesh of `origin` in the old one, with its records; `internal`: `internal_nodes`."""
    macro_of_old = np.full(mesh.n_cells, -1, np.int32)
    macro_of_old[selection.slave] = np.arange(len(selection.slave), dtype=np.int32)
    macro = macro_of_old[origin.cell]
    faces = np.flatnonzero(macro >= 0)
    zone, child = (np.full(new.n_cells, -1, np.int32) for _ in range(2))
    zone[faces] = selection.zone[macro[faces]]
    order = faces[np.argsort(macro[faces], kind="stable")]  # E1, E2, ... of each, as the children of a face follow
    first = np.flatnonzero(np.diff(macro[order], prepend=-1))
    child[order] = 1 + np.arange(len(order)) - np.repeat(first, np.diff(first, append=len(order)))
    wide = int(mesh.cell_number.max(initial=0)) > np.iinfo(np.int32).max
    parent: Ints = np.full(new.n_cells, -1, np.int64 if wide else np.int32)
    parent[origin.children] = mesh.cell_number[origin.cell[origin.children]]
    records = dict(zip(CELL_RECORDS, (macro, zone, child, parent), strict=True))
    return Cut(with_records(new, records, internal, selection.zones), origin)


def internal_nodes(cut: CutFaces, n_nodes: int) -> Ints:
    """(n_nodes,): the macro-element whose internal dof each node carries, or -1."""
    owner = np.full(n_nodes, -1, np.int32)
    for face, pattern, rows in cut.by_pattern():
        if face in WHOLE_FACES:
            owner[cut.faces.nodes[rows, WHOLE_FACES[face]]] = rows
        else:
            owner[cut.points[rows][:, internal_points(face, pattern, cut.ring)]] = rows[:, None]
    return owner
