"""The macro-elements of the slave skin, from the records of the cut, or recognised from the faces without records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lacmesh.checks.recorded import Fault, record_faults
from lacmesh.cutting.patterns import WHOLE_FACES
from lacmesh.cutting.recognition import as_cut, find_macros
from lacmesh.cutting.records import Cut, is_cut
from lacmesh.cutting.select import slave_skin
from lacmesh.errors import CutError
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.skin import FACE_TYPES

if TYPE_CHECKING:
    from lacmesh.checks.subject import CheckedSkin

#: types of faces that own an internal dof as they are
_WHOLE = np.array([name in WHOLE_FACES for name in FACE_TYPES])


@dataclass(frozen=True)
class Macros:
    """The macro-elements of the slave faces: `of_face` (f,) numbered from 0, and their `count`.

    `cut` (f,): faces that a cut made or left as a macro-element, by its records or as they were `recognised`; every
    other face is a macro-element by itself. `whole` (f,): faces of types that need no cut (SEG3, TRIA7, QUAD9).
    `number` (count,): number of each macro-element in the records, -1 without one. `faults`: reasons why the records
    cannot be used.
    """

    of_face: Ints
    count: int
    cut: NDArray[np.bool_]
    whole: NDArray[np.bool_]
    number: Ints
    recognised: bool = False
    faults: tuple[Fault, ...] = ()

    def faces(self, some: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(f,): mask of the faces that belong to some macro-elements, given as a mask (count,)."""
        return some[self.of_face]


def macros_of(mesh: Mesh, side: CheckedSkin, recognise: bool | None = None) -> Macros:
    """Return the macro-elements of a skin: from the records, else recognised, else each face by itself.

    `recognise`: as in `cut_skin`.
    """
    own, recognised = np.full(len(side), -1, np.int64), False
    faults = _faults(mesh) if is_cut(mesh) else []
    if recognise is False:
        faults = []
    elif is_cut(mesh) and not faults:
        own = Cut(mesh).macro_of_face[side.cells].astype(np.int64)
    elif len(side):
        recognised_cut = find_macros(mesh, slave_skin(mesh, side.names))
        if recognised_cut.n_cut and (recognise or not recognised_cut.doubt):
            recognised = True
            own = as_cut(mesh, recognised_cut).macro_of_face[side.cells].astype(np.int64)
    whole = own >= 0
    last = int(own.max(initial=-1))
    own[~whole] = last + 1 + np.arange(np.count_nonzero(~whole))
    values, of_face = np.unique(own, return_inverse=True)
    number = np.where((values <= last) & (not recognised), values, -1)
    return Macros(of_face, len(values), whole, _WHOLE[side.faces.type], number, recognised, tuple(faults))


def _faults(mesh: Mesh) -> list[Fault]:
    """List the reasons why the records of a mesh cannot be used."""
    try:
        return record_faults(Cut(mesh))
    except (CutError, IndexError, ValueError) as error:
        return [Fault(str(error))]
