"""The height of a smooth surface over the flat faces that approximate it, along their outward normals.

A linear face of a curved skin is flat, and misses the skin by up to h^2 / 8R. Its height is a quadratic field of the
face,

    b(xi) = sum_i N_i(xi) b_i,

with N_i the functions of SEG3, TRIA6 and QUAD9. It is 0 at the corners, which lie on the skin, except at those that a
cut has put inside a face of the original mesh. The heights b_i are computed by `lacmesh.smooth`. Faces of quadratic
types are curved themselves and have no height, unless they are straight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.surface.maps import N_MONOMIALS, basis, slopes, values
from lacmesh.topology.skin import TYPE_CODE

#: the quadratic type whose functions carry the height of a face
QUADRATIC = {
    "SEG2": "SEG3", "SEG3": "SEG3", "TRIA3": "TRIA6", "TRIA6": "TRIA6", "TRIA7": "TRIA6", "QUAD4": "QUAD9",
    "QUAD8": "QUAD9", "QUAD9": "QUAD9",
}  # fmt: skip
#: types with heights in both directions
QUADRANGLES = [TYPE_CODE[name] for name, quadratic in QUADRATIC.items() if quadratic == "QUAD9"]
#: most nodes of such a type
N_HEIGHTS = 9


@dataclass(frozen=True, eq=False)
class Height:
    """The heights of a surface's faces (f,).

    `type` (f,): codes in skin.FACE_TYPES; `value` (f, 9): heights at the nodes of each face's quadratic type, in their
    order, padded with 0; `lean` (f, 9, 2): slopes of the smooth surface's normals to the face there, None: those of
    the heights. `taken` (f,): faces with the same number, 0 or more, are taken as one smooth shape although they turn
    by more than the crease angle; None if there are none. `doubt` (f,): how far the heights of faces of free form may
    be off (`lacmesh.smooth`), over the size of the faces; None: not known.
    """

    type: Ints
    value: Floats
    lean: Floats | None = None
    taken: Ints | None = None
    doubt: Floats | None = None

    @property
    def degree(self) -> int:
        """Degree of the heights as polynomials in the plane of a face."""
        return 4 if np.isin(self.type, QUADRANGLES).any() else 2

    def take(self, rows: Ints) -> Height:
        """Return the heights of some of the faces."""
        taken = None if self.taken is None else self.taken[rows]
        doubt = None if self.doubt is None else self.doubt[rows]
        lean = None if self.lean is None else self.lean[rows]
        return replace(self, type=self.type[rows], value=self.value[rows], lean=lean, taken=taken, doubt=doubt)

    def at(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n,): heights at reference points xi (n, 2) of faces (n,)."""
        return values(self._map, face, xi)[:, 0]

    def slope(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n, 2): derivatives of the heights by the faces' reference coordinates; the second is 0 on segments."""
        return slopes(self._map, face, xi, 2)[:, 0]

    @cached_property
    def _map(self) -> NDArray[np.floating]:
        """(f, 9, 1): coefficients of the heights."""
        return self._interpolated(self.value[:, :, None])

    @cached_property
    def leans(self) -> NDArray[np.floating]:
        """(f, 9, 2): coefficients of the slopes of the normals."""
        return self._interpolated(self.slopes_at_nodes if self.lean is None else self.lean)

    @property
    def slopes_at_nodes(self) -> NDArray[np.floating]:
        """(f, 9, 2): slopes of the heights at the nodes of each face's quadratic type, padded with 0."""
        out = np.zeros((*self.value.shape, 2))
        for name, quadratic in QUADRATIC.items():
            rows, X = np.flatnonzero(self.type == TYPE_CODE[name]), padded_nodes(quadratic)
            at = self.slope(np.repeat(rows, len(X)), np.tile(X, (len(rows), 1)))
            out[rows, : len(X)] = at.reshape(len(rows), len(X), 2)
        return out

    def _interpolated(self, values: Floats) -> NDArray[np.floating]:
        """(f, 9, k): coefficients of fields with values (f, 9, k) at the nodes of each face's quadratic type."""
        G = np.zeros((len(self.type), N_MONOMIALS, values.shape[2]))
        for name, quadratic in QUADRATIC.items():
            rows, C = self.type == TYPE_CODE[name], basis(TYPE_CODE[quadratic])
            G[rows] = C @ values[rows, : C.shape[1]]
        return G


def padded_nodes(name: str) -> NDArray[np.floating]:
    """(n, 2): reference coordinates of the nodes of a type of face; the second is 0 on segments."""
    X = np.array(CELLS[name].reference, dtype=float)
    return np.pad(X, ((0, 0), (0, 2 - X.shape[1])))
