"""The macro-elements of the slave skin, from the records of the cut, or found again where these are gone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import CutError
from lacmesh.mesh import Ints, Mesh
from lacmesh.patterns import WHOLE_FACES
from lacmesh.recognition import find_macros, with_records
from lacmesh.records import Cut, is_cut
from lacmesh.skin import FACE_TYPES

if TYPE_CHECKING:
    from lacmesh.checks.subject import Side

#: types of faces that own an internal dof as they are
_WHOLE = np.array([name in WHOLE_FACES for name in FACE_TYPES])


@dataclass(frozen=True)
class Macros:
    """The macro-elements of the slave faces: `of_face` (f,) numbered from 0, and their `count`.

    `cut` (f,): faces that a cut made or left as a macro-element, by its records or as they were `recognised`; every
    other face is a macro-element by itself. `whole` (f,): faces of types that need no cut (SEG3, TRIA7, QUAD9).
    `broken`: why the records cannot be used.
    """

    of_face: Ints
    count: int
    cut: NDArray[np.bool_]
    whole: NDArray[np.bool_]
    recognised: bool = False
    broken: str = ""

    def faces(self, some: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(f,): the faces of some macro-elements (count,)."""
        return some[self.of_face]


def macros_of(mesh: Mesh, side: Side) -> Macros:
    """From the records, or found again, or each face its own."""
    own, recognised, broken = np.full(len(side), -1, np.int64), False, ""
    if is_cut(mesh):
        try:
            own = Cut(mesh).macro_of_face[side.cells].astype(np.int64)
        except (CutError, IndexError, ValueError) as error:
            broken = str(error)
    if len(side) and (broken or not is_cut(mesh)):
        found = find_macros(mesh, list(side.names))
        if found.n_cut:
            recognised = True
            own = with_records(mesh, found).cell_data["lac_macro"][side.cells].astype(np.int64)
    made = own >= 0
    own[~made] = int(own.max(initial=-1)) + 1 + np.arange(np.count_nonzero(~made))
    _, of_face = np.unique(own, return_inverse=True)
    return Macros(of_face, int(of_face.max(initial=-1)) + 1, made, _WHOLE[side.faces.type], recognised, broken)
