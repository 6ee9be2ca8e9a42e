"""*Fits*: two bodies that fit each other meet in a circle or a sphere (Lame's solution, pressed from outside, or one
shrunk onto the other), or in these stretched along the axes and pressed evenly from all sides, so that the pressure is
uniform in both bodies, which are of one material. An ellipse is no shape that is looked for: what is found of it are
local fits. Meshes are unlike and irregular, several of each size (errors are root mean squares over these); nothing is
told of symmetry.

*Pin*: a pin in the hole of an infinite plate, with clearance, contact over 120 degrees (Persson 1964). The mesh is a
quarter of a ring of each, on the outer sides of which the exact displacements are imposed, so that the mesh is the only
error. Beside the pressure: the force on the quarter, and the angle at which contact ends.

*Hertz*: the half-spaces of the family `hertz`, whose clearance is in the mesh: the slave's skin is lifted to a
parabola, alone or, in a *socket*, with the master's four times as curved as the difference. So slight are the slopes
(R = 1000 a) that the half-space is exact, and as the problem is linear nothing else depends on R. A parabola is no
shape that is looked for: what is found are local fits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacsolver.case import Value
from verification.exact.pin import PinInHole
from verification.families import hertz, press_fit
from verification.families.press_fit import Body, PressFit
from verification.measures.edge import edge_of_contact
from verification.meshes.blocks import joined, nodes_of
from verification.meshes.half_spaces import half_spaces
from verification.meshes.rings import pair, ring
from verification.solving import Solved, case_text, entry, fixed, with_motions

Floats = NDArray[np.floating]
#: how the curved skins are known: a circle or sphere is found, or heights are fits of a few nodes, of a parabola
#: exactly, of an ellipse but for its third derivatives
Skins = Literal["found", "parabola", "ellipse"]


@dataclass(frozen=True)
class Curved:
    """A problem with one contact whose skins are curved, by what it is on a level of mesh size and at places.

    `mesh`: level, number of the set -> the two bodies, not cut; `h`: level -> size of the slave's faces; `case`: what
    the gap is measured between -> the case; `gap`, `pressure`: points (n, dim) -> true gap (n,), exact pressure (n, 1).

    `uniform`: the exact pressure is; `second`: largest error of p_m on the second mesh; `least_sets`: of meshes of a
    size, of which there are twice as many on each coarser level, or None for one on every level; `more`: further
    relative errors of a solution.
    """

    mesh: Callable[[int, int], Mesh]
    h: Callable[[int], float]
    case: Callable[[str], lacsolver.Case]
    gap: Callable[[Floats], Floats]
    pressure: Callable[[Floats], Floats]
    skins: Skins = "found"
    axisymmetric: bool = False
    uniform: bool = False
    second: float | None = None
    least_sets: int | None = None
    more: Callable[[Solved], dict[str, float]] = lambda solved: {}

    def sets(self, level: int, levels: int) -> int:
        """Number of sets of meshes on a level: more where few faces make the result depend on chance."""
        return 1 if self.least_sets is None else max(self.least_sets, 1 << (levels - 1 - level))


@dataclass(frozen=True)
class Fitted:
    """A press fit. `stretch` (dim,): of both bodies along the axes; the pressures inside and outside of the `fit` are
    equal then, so that it is uniform.
    """

    fit: PressFit
    stretch: tuple[float, ...] | None = None

    @property
    def problem(self) -> Curved:
        """The problem."""
        fit, found = self.fit, self.stretch is None
        right = fit.exact.between if found else fit.pressure
        factors = np.ones(3)
        factors[: fit.dim] = self.stretch or 1.0

        def mesh(level: int, number: int) -> Mesh:
            own = press_fit.mesh_of(fit, level, number)
            return replace(own, points=own.points * factors)

        return Curved(
            mesh,
            fit.h,
            lambda surface: lacsolver.parse_case(press_fit.case_of(fit, surface)),
            lambda x: np.full(len(x), -fit.interference),
            lambda x: np.full((len(x), 1), right),
            skins="found" if found else "ellipse",
            axisymmetric=fit.model == "axisymmetric",
            uniform=True,
            # of shapes that are found, and bodies that are pressed evenly
            second={2: 0.01, 3: 0.12}[fit.dim] if found and not fit.interference else None,
            # errors of p_m on a plane mesh of 72 faces differ by a sixth from one mesh to the next
            least_sets={2: 4, 3: 1}[fit.dim],
        )


#: the pin in the plate; radii of both, of which the outermost is far from the hole; on the first mesh, counts along the
#: radius and around of each
PIN = PinInHole(radius=12.0, clearance=0.2, young=210e3, poisson=0.3, angle=60.0)
_RADII, _COUNTS = (5.0, 12.0, 26.0), ((5, 12), (6, 9))


@dataclass(frozen=True)
class Pin:
    """The quarters of the pin and of the plate; the slave is the pin (`within`) or the plate."""

    cell: str
    slave: Body

    @property
    def problem(self) -> Curved:
        """The problem; both skins have the radius of the hole, so that the true gap is the clearance."""

        def case(surface: str) -> lacsolver.Case:
            text = case_text(
                "plane_strain",
                entry("material", young=PIN.young, poisson=PIN.poisson),
                entry("contact", slave="slave", master="master", clearance=PIN.clearance, surface=surface),
                fixed("y0", "y"),
            )
            of_pin = dict.fromkeys(("inner", "x0_within"), lambda x, t: PIN.displacement(x[:, :2], "pin"))
            of_plate = dict.fromkeys(("outer", "x0_around"), lambda x, t: PIN.displacement(x[:, :2], "plate"))
            return with_motions(text, of_pin | of_plate)

        return Curved(
            self.mesh,
            lambda level: PIN.radius * np.pi / 2 / (_COUNTS[self.slave == "around"][1] << level),
            case,
            lambda x: np.full(len(x), PIN.clearance),
            _persson,
            more=_force_and_angle,
        )

    def mesh(self, level: int, number: int) -> Mesh:
        """The two bodies: groups as `rings.pair`, the sides x = 0 as `x0_within` and `x0_around`."""
        parts = []
        for k, (name, counts) in enumerate(zip(("within", "around"), _COUNTS, strict=True)):
            own = [n << level for n in counts]
            layer = ring(self.cell, own, _RADII[k : k + 2], jitter=0.1, seed=100 * k + level)
            parts.append(joined([(layer, {"x0": f"x0_{name}"})], keep=True))
        return pair(*parts, slave=self.slave)


def _persson(x: Floats) -> Floats:
    """Pressure (n, 1) of the pin."""
    return PIN.pressure(np.arctan2(x[:, 1], x[:, 0]))[:, None]


def _force_and_angle(solved: Solved) -> dict[str, float]:
    """Errors of the force on the quarter, and of the half-angle of contact, which is beyond 30 degrees."""
    zone = solved.zone
    resultant, exact = abs(float(solved.figures.contact["slave"].resultant[0])), _persson(zone.centre)[:, 0]
    angle = np.degrees(np.arctan2(zone.centre[:, 1], zone.centre[:, 0]))
    ends = [edge_of_contact(angle, p, exact.max(), 30.0) for p in (zone.pressure, exact)]
    return {"force": resultant / (PIN.force / 2) - 1, "angle of contact": ends[0] / ends[1] - 1}


@dataclass(frozen=True)
class Lifted:
    """`hertz`: the half-spaces; `socket`: curvature of the master over 1 / R."""

    hertz: hertz.Given
    socket: float = 0.0

    @property
    def problem(self) -> Curved:
        """The problem: half-spaces without their clearance, each moved up by its parabola."""
        half = self.hertz

        def gap(x: Floats) -> Floats:
            return np.asarray((x[:, :-1] ** 2).sum(axis=1) / (2 * half.radius))

        def mesh(level: int, number: int) -> Mesh:
            own = half_spaces(half.cell, half.levels[level], half.fraction)
            points, up = own.points.copy(), half.dim - 1
            for group, curved in (("upper", 1 + self.socket), ("lower", self.socket)):
                nodes = nodes_of(own, group)
                points[nodes, up] += curved * gap(own.points[nodes, : half.dim])
            return replace(own, points=points)

        def case(surface: str) -> lacsolver.Case:
            flat = hertz.case_of(half)
            (contact,) = flat.contact
            return replace(flat, contact=(replace(contact, clearance=Value.of(0.0), surface=surface),))

        def half_width(solved: Solved) -> dict[str, float]:
            return {"half-width": hertz.half_width(solved.zone.centre, solved.zone.pressure, half.p0) - 1}

        return Curved(
            mesh,
            lambda level: 1 / (half.levels[level] + half.fraction),
            case,
            gap,
            lambda x: hertz.pressure(half, x),
            skins="parabola",
            axisymmetric=half.model == "axisymmetric",
            more=half_width,
        )


# ---- the table

PLANE = PressFit(
    "TRIA3", "plane_strain", "facet", radii=(0.4, 1.0, 2.0), pressure=0.0, outside=25.0, counts=((5, 12), (6, 9)),
    jitter=0.1,
)  # fmt: skip
_SPACE = replace(PLANE, cell="TETRA4", shape="sphere", radii=(0.55, 1.0, 1.7), counts=((2, 4), (2, 3)), jitter=0.15)
_EVEN, _EVEN_SPACE = (replace(fit, pressure=fit.outside) for fit in (PLANE, _SPACE))
#: name, problem, the cells, and the one that is in the quick suite too
_FITS = (
    ("cylinders", Fitted(PLANE), ("TRIA3", "QUAD4"), "TRIA3"),
    ("shrunk", Fitted(replace(PLANE, outside=0.0, interference=0.02)), ("TRIA3", "QUAD4"), ""),
    ("spheres", Fitted(replace(PLANE, shape="sphere")), ("TRIA3", "QUAD4"), ""),
    ("octants", Fitted(_SPACE), ("TETRA4", "HEXA8", "PENTA6"), ""),
    ("ellipses", Fitted(_EVEN, (1.4, 0.8)), ("TRIA3", "QUAD4"), "QUAD4"),
    ("ellipsoids", Fitted(_EVEN_SPACE, (1.3, 1.0, 0.8)), ("TETRA4", "HEXA8"), ""),
)
_HALVES = (
    ("plane_strain", "2d", ("TRIA3", "QUAD4"), (4, 8, 16, 32)),
    ("axisymmetric", "axisymmetric", ("TRIA3", "QUAD4"), (4, 8, 16, 32)),
    ("3d", "3d", ("TETRA4", "HEXA8", "PENTA6"), (4, 6, 10)),
)


def problems() -> Iterator[tuple[str, str, Fitted | Pin | Lifted, dict[str, Any]]]:
    """Name, description, problem, and numbers of meshes in the suites with the seconds that it takes."""
    slaves: tuple[Body, ...] = "within", "around"
    for name, like, cells, quick in _FITS:
        levels = {"full": 4, "every": 5, "seconds": 10.0} if like.fit.dim == 2 else {"full": 3, "seconds": 15.0}
        for cell in cells:
            for slave in slaves:
                given = replace(like, fit=replace(like.fit, cell=cell, slave=slave))
                what = f"{name} of {cell} that fit, the slave {slave}"
                few = {"quick": 3} if (cell, slave) == (quick, "within") else {}
                yield f"{name}-{cell}-{slave}", what, given, few | levels
    for cell in ("TRIA3", "QUAD4"):
        for slave in slaves:
            levels = {"quick": 3 * ((cell, slave) == ("TRIA3", "within")), "full": 4, "every": 5, "seconds": 4.0}
            yield f"pin-{cell}-{slave}", f"a pin in a hole of {cell}, the slave {slave}", Pin(cell, slave), levels
    for model, start, cells, sizes in _HALVES:
        for cell in cells:
            for called, socket in (("hertz", 0.0), ("socket", 4.0)):
                half = hertz.Given(model, cell, "pyramid", False, sizes, radius=1000.0)
                what = f"Hertz on skins of {cell} that are curved, {start}{', in a socket' if socket else ''}"
                few = {"quick": 3} if (model, cell, called) == ("plane_strain", "QUAD4", "socket") else {}
                levels = few | {"full": len(sizes), "seconds": 10.0}
                yield f"{called}-{start}-{cell}", what, Lifted(half, socket), levels
