"""Winding: how faces list their nodes relative to each other, flipped faces, and inverted cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints, Mesh, codes
from lacmesh.reference.quadrature import measure, signed_area
from lacmesh.topology.skin import FACE_TYPES, N_CORNERS, Faces

#: the same face, flipped: it starts from the same corner and has the opposite winding
REVERSED = {
    "POI1": (0,),
    "SEG2": (1, 0),
    "SEG3": (1, 0, 2),
    "TRIA3": (0, 2, 1),
    "TRIA6": (0, 2, 1, 5, 4, 3),
    "TRIA7": (0, 2, 1, 5, 4, 3, 6),
    "QUAD4": (0, 3, 2, 1),
    "QUAD8": (0, 3, 2, 1, 7, 6, 5, 4),
    "QUAD9": (0, 3, 2, 1, 7, 6, 5, 4, 8),
}


def relative_listing(faces: Faces, listed: Faces) -> Ints:
    """(f,): relative orientation 2 s + r of each row of `listed`: it starts at corner s; r = 1 for opposite winding."""
    corners, other = faces.corners, listed.corners
    start = (corners == other[:, :1]).argmax(axis=1)
    n = N_CORNERS[faces.type]
    following = corners[np.arange(len(faces)), (start + 1) % n]
    back = following != other[:, 1]
    segment = n == 2  # two corners only: the start says it all
    return 2 * start + np.where(segment, start, back)


def turned_over(faces: Faces, rows: Ints) -> Faces:
    """Flip some rows of the faces."""
    nodes = faces.nodes.copy()
    for code in codes(faces.type[rows]):
        some = rows[faces.type[rows] == code]
        order = REVERSED[FACE_TYPES[code]]
        nodes[some[:, None], np.arange(len(order))] = faces.nodes[some[:, None], order]
    return Faces(faces.type, nodes)


def is_inverted(mesh: Mesh, cells: Ints, plane: bool) -> NDArray[np.bool_]:
    """(k,): True for inverted cells, whose node order makes their facets point inward (real meshes contain some).

    Solids are tested by the signed volume of their linear cell, surface cells in a `plane` z = constant by their signed
    area. Surface cells in space are never inverted: they have no preferred orientation.
    """
    wrong = np.zeros(mesh.n_cells, bool)
    for kind, chosen, nodes in mesh.select(cells):
        flat = CELLS[CELLS[kind].linear]
        if flat.dim == 3:
            wrong[chosen] = measure(flat.name, mesh.points[nodes[:, : flat.n_corners]]) < 0
        elif plane:
            wrong[chosen] = signed_area(kind, mesh.points[nodes]) < 0
    return wrong[cells]


def face_normals(mesh: Mesh, faces: Faces) -> Floats:
    """(f, 3): normals of faces by their corners, as long as the faces' areas; of lines in space, their tangents."""
    x = mesh.points[faces.corners]
    line = N_CORNERS[faces.type] == 2
    t = x[:, 1] - x[:, 0]
    plane = np.stack([t[:, 1], -t[:, 0], 0 * t[:, 0]], axis=1) if mesh.space_dim == 2 else t
    last = np.where((N_CORNERS[faces.type] == 4)[:, None], x[:, 3], x[:, 0])
    return np.where(line[:, None], plane, np.cross(x[:, 2] - x[:, 0], last - x[:, 1]) / 2)
