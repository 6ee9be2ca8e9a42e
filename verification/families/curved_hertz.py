"""*Hertz*: the half-spaces of the family `hertz`, whose clearance is in the mesh: the slave's skin is lifted to a
parabola, alone or, in a *socket*, with the master's four times as curved as the difference. So slight are the slopes
(R = 1000 a) that the half-space is exact, and as the problem is linear nothing else depends on R. A parabola is no
shape that is looked for: what is found are local fits.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacsolver.case import Value
from verification.families import hertz
from verification.meshes.blocks import nodes_of
from verification.meshes.half_spaces import half_spaces
from verification.solving import Solved

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Lifted:
    """`hertz`: the half-spaces; `socket`: curvature of the master over 1 / R."""

    hertz: hertz.Given
    socket: float = 0.0
    second: float | None = None
    uniform: bool = False
    exact: bool = False
    cubic: bool = False

    @property
    def axisymmetric(self) -> bool:
        """True for an axisymmetric model."""
        return self.hertz.model == "axisymmetric"

    def sets(self, level: int, levels: int) -> int:
        """One set of meshes."""
        return 1

    def mesh(self, level: int, number: int = 0) -> Mesh:
        """The bodies, each moved up by its parabola."""
        given = self.hertz
        mesh = half_spaces(given.cell, given.levels[level], given.fraction)
        points, up = mesh.points.copy(), given.dim - 1
        for group, curved in (("upper", 1 + self.socket), ("lower", self.socket)):
            nodes = nodes_of(mesh, group)
            points[nodes, up] += curved * self._parabola(mesh.points[nodes, : given.dim])
        return replace(mesh, points=points)

    def h(self, level: int) -> float:
        """The size of the slave's faces."""
        return 1 / (self.hertz.levels[level] + self.hertz.fraction)

    def case(self, surface: str) -> lacsolver.Case:
        """The case of the half-spaces, without their clearance."""
        case = hertz.case_of(self.hertz)
        (contact,) = case.contact
        return replace(case, contact=(replace(contact, clearance=Value.of(0.0), surface=surface),))

    def gap(self, x: Floats) -> Floats:
        """True gap (n,): r^2 / 2R."""
        return self._parabola(x)

    def _parabola(self, x: Floats) -> Floats:
        return (x[:, :-1] ** 2).sum(axis=1) / (2 * self.hertz.radius)

    def pressure(self, x: Floats) -> Floats:
        """Hertz's pressure (n, 1)."""
        return hertz.pressure(self.hertz, x)

    def quantities(self, solved: Solved) -> dict[str, float]:
        """The error of the half-width."""
        zone = solved.zone
        return {"half-width": hertz.half_width(zone.centre, zone.pressure, self.hertz.p0) - 1}


def cases() -> Iterator[tuple[str, str, Lifted, Mapping[str, int], float]]:
    """Cases of curved half-spaces."""
    for model, cells, sizes in (
        ("plane_strain", ("TRIA3", "QUAD4"), (4, 8, 16, 32)),
        ("axisymmetric", ("TRIA3", "QUAD4"), (4, 8, 16, 32)),
        ("3d", ("TETRA4", "HEXA8", "PENTA6"), (4, 6, 10)),
    ):
        for cell in cells:
            for socket in (0.0, 4.0):
                given = hertz.Given(model, cell, "pyramid", False, sizes, radius=1000.0)
                start = {"plane_strain": "2d"}.get(model, model)
                called = "socket" if socket else "hertz"
                name = f"{called}-{start}-{cell}"
                quick = {"quick": 3} if (model, cell, socket) == ("plane_strain", "QUAD4", 4.0) else {}
                description = f"Hertz on skins of {cell} that are curved, {start}{', in a socket' if socket else ''}"
                yield (name, description, Lifted(given, socket), {**quick, "full": len(sizes)}, 10.0)
