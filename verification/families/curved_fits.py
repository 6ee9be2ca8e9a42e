"""*Fits*: two bodies that fit each other meet in a circle or a sphere (Lame's solution, pressed from outside, or one
shrunk onto the other), or in these stretched along the axes and pressed evenly from all sides, so that the pressure is
uniform in both bodies, which are of one material. An ellipse is no shape that is looked for: what is found of it are
local fits. Meshes are unlike and irregular, several of each size (errors are root mean squares over these); nothing is
told of symmetry.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from verification.families import press_fit
from verification.families.press_fit import PressFit
from verification.solving import Solved

Floats = NDArray[np.floating]

#: how large an error of p_m may be on the second mesh, by the dimension of space
_SECOND = {2: 0.01, 3: 0.12}
#: the least number of sets of meshes of a size, by the dimension of space: errors of p_m on a plane mesh of 72 faces
#: differ by a sixth from one mesh to the next
_SETS = {2: 4, 3: 1}


@dataclass(frozen=True)
class Fitted:
    """A press fit. `stretch` (dim,): of both bodies along the axes; the pressures inside and outside of the `fit` are
    equal then, so that it is uniform.
    """

    fit: PressFit
    stretch: tuple[float, ...] | None = None
    uniform: bool = True

    @property
    def exact(self) -> bool:
        """True if the skins are circles or spheres."""
        return self.stretch is None

    @property
    def cubic(self) -> bool:
        """True if the skins have third derivatives."""
        return self.stretch is not None

    @property
    def axisymmetric(self) -> bool:
        """True for an axisymmetric model."""
        return self.fit.model == "axisymmetric"

    @property
    def second(self) -> float | None:
        """The largest error of p_m on the second mesh: of shapes that are found, and bodies that are pressed evenly."""
        return _SECOND[self.fit.dim] if self.exact and not self.fit.interference else None

    def sets(self, level: int, levels: int) -> int:
        """Number of sets of meshes, doubled on each coarser level, where few faces make the result depend on chance."""
        return max(_SETS[self.fit.dim], 1 << (levels - 1 - level))

    def mesh(self, level: int, number: int = 0) -> Mesh:
        """The two bodies, not cut."""
        mesh = press_fit.mesh_of(self.fit, level, number)
        factors = np.ones(3)
        factors[: self.fit.dim] = self.stretch or 1.0
        return replace(mesh, points=mesh.points * factors)

    def h(self, level: int) -> float:
        """The size of the slave's faces, before they are stretched."""
        return self.fit.h(level)

    def case(self, surface: str) -> lacsolver.Case:
        """The case."""
        return lacsolver.parse_case(press_fit.case_of(self.fit, surface))

    def gap(self, x: Floats) -> Floats:
        """True gap (n,): minus the interference, because the surfaces fit."""
        return np.full(len(x), -self.fit.interference)

    def pressure(self, x: Floats) -> Floats:
        """Exact pressure (n, 1), which is uniform."""
        return np.full((len(x), 1), self.fit.exact.between if self.exact else self.fit.pressure)

    def quantities(self, solved: Solved) -> dict[str, float]:
        """No further errors."""
        return {}


_PLANE = PressFit(
    "TRIA3", "plane_strain", "facet", radii=(0.4, 1.0, 2.0), pressure=0.0, outside=25.0,
    counts=((5, 12), (6, 9)), jitter=0.1,
)  # fmt: skip
_SPACE = replace(_PLANE, cell="TETRA4", shape="sphere", radii=(0.55, 1.0, 1.7), counts=((2, 4), (2, 3)), jitter=0.15)
_IN_PLANE, _SOLIDS = ("TRIA3", "QUAD4"), ("TETRA4", "HEXA8", "PENTA6")


def cases() -> Iterator[tuple[str, str, Fitted, Mapping[str, int], float]]:
    """Cases of the curved press fits."""
    few, many = {"full": 4, "all": 5}, {"full": 3}
    shrunk = replace(_PLANE, outside=0.0, interference=0.02)
    yield from _each(_IN_PLANE, Fitted(_PLANE), "cylinders", few, 10.0, "TRIA3")
    yield from _each(_IN_PLANE, Fitted(shrunk), "shrunk", few, 10.0)
    yield from _each(_IN_PLANE, Fitted(replace(_PLANE, shape="sphere")), "spheres", few, 10.0)
    yield from _each(_SOLIDS, Fitted(_SPACE), "octants", many, 15.0)
    yield from _each(_IN_PLANE, _stretched(_PLANE, (1.4, 0.8)), "ellipses", few, 10.0, "QUAD4")
    yield from _each(_SOLIDS[:2], _stretched(_SPACE, (1.3, 1.0, 0.8)), "ellipsoids", many, 15.0)


def _stretched(fit: PressFit, factors: tuple[float, ...]) -> Fitted:
    return Fitted(replace(fit, pressure=fit.outside), factors)


def _each(
    cells: Sequence[str], like: Fitted, name: str, levels: Mapping[str, int], seconds: float,
    quick: str = "",
) -> Iterator[tuple[str, str, Fitted, Mapping[str, int], float]]:  # fmt: skip
    for cell in cells:
        for slave in ("within", "around"):
            given = replace(like, fit=replace(like.fit, cell=cell, slave=slave))
            few = {"quick": 3} if cell == quick and slave == "within" else {}
            description = f"{name} of {cell} that fit, the slave {slave}"
            yield (f"{name}-{cell}-{slave}", description, given, {**few, **levels}, seconds)
