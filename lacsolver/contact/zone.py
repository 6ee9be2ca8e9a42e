"""Zones: the slave and the master of a contact or a tie, and the macro-element of each slave face."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lacmesh.cutting.records import Cut
from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.smooth import surface_of
from lacmesh.surface import Surface, default_distance
from lacmesh.surface.points import face_measure


@dataclass(frozen=True, eq=False)
class Zone:
    """Two skins that may touch. `macro` (slave faces,): macro-element of each face, 0 to `n_macros` - 1 in the zone.

    `number` (n_macros,): number of each macro-element in the mesh's cut. Both surfaces are undeformed.
    """

    name: str
    slave: Surface
    master: Surface
    macro: Ints
    number: Ints

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        slave: str,
        master: str,
        name: str | None = None,
        *,
        surface: str = "smooth",
        crease_angle: float | None = None,
    ) -> Zone:
        """Return the zone between two groups of skin cells of a mesh whose slave is cut.

        `surface`: the gap is measured between the `faces`, or between `smooth` surfaces through their nodes, on which
        edges with an angle above `crease_angle` degrees stay sharp.

        Raises GroupNotFoundError; RequestError if slave and master are the same or share faces; DataError if faces of
        the slave belong to no macro-element of the cut, or to one that extends beyond the group.
        """
        cells, others = mesh.cells_of(slave), mesh.cells_of(master)
        if slave == master or len(np.intersect1d(cells, others)):
            raise RequestError(f"slave {slave!r} and master {master!r} share faces; a contact needs two surfaces")
        made, other = (surface_of(mesh, c, surface, crease_angle) for c in (cells, others))
        if made.dim != other.dim:
            raise DataError(f"slave {slave!r} and master {master!r} are surfaces of different dimensions")
        cut = Cut(mesh)
        macro = cut.macro_of_face[made.cell]
        without = made.cell[macro < 0]
        if len(without):
            message = f"faces {mesh.cell_names(without)} of slave {slave!r} belong to no macro-element"
            raise DataError(f"{message}; cut this group: lacmesh cut --slave {slave}", mesh.cell_number[without])
        number, macro = np.unique(macro, return_inverse=True)
        size = np.bincount(cut.macro_of_face[cut.macro_of_face >= 0], minlength=cut.n_macros)
        partial = number[np.bincount(macro) < size[number]]
        if len(partial):
            message = f"{len(partial)} macro-elements of slave {slave!r} have faces outside the group"
            raise DataError(f"{message}; take all the faces of each, as they were cut", partial)
        return cls(name or slave, made, other, macro, number)

    @property
    def n_macros(self) -> int:
        """Number of macro-elements."""
        return len(self.number)

    @cached_property
    def area(self) -> Floats:
        """Areas (n_macros,) of the undeformed macro-elements, lengths in a plane, without 2 pi r."""
        return self.sums(face_measure(self.slave))

    @cached_property
    def area_of_revolution(self) -> Floats:
        """Areas (n_macros,) of the undeformed macro-elements around the axis, in axisymmetry."""
        return self.sums(face_measure(self.slave, axisymmetric=True))

    @cached_property
    def area_of_master(self) -> float:
        """Area of the whole undeformed master, as `area`."""
        return float(face_measure(self.master).sum())

    @cached_property
    def search_distance(self) -> float:
        """Search distance of the undeformed skins, where no other is given."""
        return default_distance(self.slave, self.master, self.macro)

    def sums(self, values: Floats) -> Floats:
        """Return the sums (n_macros, ...) of values (faces, ...) over the faces of each macro-element."""
        out = np.zeros((self.n_macros, *values.shape[1:]))
        np.add.at(out, self.macro, values)
        return out
