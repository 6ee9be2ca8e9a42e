"""The height of a smooth surface over the flat faces that stand for it, along their outward normals.

A linear face of a curved skin is flat, and misses the skin by up to h^2 / 8R. Its height is a field of the face as the
user meshed it, the parent: zero at the corners, quadratic between them,

    b(xi) = sum over edges of N_k(xi) b_k + N_c(xi) b_c,

with N_k, N_c the functions of the mid-nodes and of the centre of SEG3, TRIA6 and QUAD9. Children of a parent that was
cut take it at their places in the parent, which are those of their corners interpolated. The heights b_k, b_c are found
by `lacmesh.smooth`; faces of quadratic types have their curve already, and no height.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.shapes import gradient, shape
from lacmesh.skin import FACE_TYPES

#: the quadratic type whose functions of mid-nodes and centre carry the height of a linear one
QUADRATIC = {"SEG2": "SEG3", "TRIA3": "TRIA6", "QUAD4": "QUAD9"}
#: most edges of a face, and its centre
N_HEIGHTS = 5


@dataclass(frozen=True, eq=False)
class Height:
    """The heights of a surface's faces (f,).

    `type` (f,): of each face (code in skin.FACE_TYPES); `parent` (f,): row of its parent; `corner` (f, 4, 2): its
    corners' reference coordinates in the parent. A row each parent (p,): `parent_type`, and `value` (p, 5) the heights
    at the middles of its edges, in their order, and after them that at a quadrangle's centre; 0 where there is none.
    """

    type: Ints
    parent: Ints
    corner: Floats
    parent_type: Ints
    value: Floats

    def take(self, rows: Ints) -> Height:
        """Those of some of the faces."""
        return replace(self, type=self.type[rows], parent=self.parent[rows], corner=self.corner[rows])

    def at(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n,): heights at reference points xi (n, 2) of faces (n,)."""
        out = np.zeros(len(face))
        for rows, own, parent, place in self._by_types(face, xi):
            N = shape(QUADRATIC[parent], place)[:, CELLS[parent].n_corners :]
            out[rows] = (N * own[:, : N.shape[1]]).sum(axis=1)
        return out

    def slope(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n, 2): derivatives of the heights by the faces' own reference coordinates; the second is 0 on lines."""
        out = np.zeros((len(face), 2))
        for rows, own, parent, place in self._by_types(face, xi):
            dN = gradient(QUADRATIC[parent], place)[:, CELLS[parent].n_corners :]
            dim = dN.shape[2]
            name = FACE_TYPES[self.type[face[rows[0]]]]
            own_dN = gradient(name, xi[rows, :dim])
            J = np.einsum("pnd,pne->ped", own_dN, self.corner[face[rows], : own_dN.shape[1], :dim])
            out[rows, :dim] = np.einsum("pn,pne,ped->pd", own[:, : dN.shape[1]], dN, J)
        return out

    def _by_types(self, face: Ints, xi: Floats) -> Iterator[tuple[Any, Floats, str, Floats]]:
        """Points by the types of face and parent: (rows, the parents' heights, parent type, places in the parent)."""
        key = self.type[face] * len(FACE_TYPES) + self.parent_type[self.parent[face]]
        for code in np.unique(key):
            name, parent = FACE_TYPES[code // len(FACE_TYPES)], FACE_TYPES[code % len(FACE_TYPES)]
            if parent not in QUADRATIC:
                continue
            rows = np.flatnonzero(key == code)
            dim = CELLS[parent].dim
            N = shape(name, xi[rows, :dim])
            place = np.einsum("pn,pne->pe", N, self.corner[face[rows], : N.shape[1], :dim])
            yield rows, self.value[self.parent[face[rows]]], parent, place
