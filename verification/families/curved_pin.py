"""*Pin*: a pin in the hole of an infinite plate, with clearance, contact over 120 degrees (Persson 1964). The mesh is a
quarter of a ring of each, on the outer sides of which the exact displacements are imposed, so that the mesh is the only
error. Beside the pressure: the force on the quarter, and the angle at which contact ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from verification.exact.pin import PinInHole
from verification.measures.edge import edge_of_contact
from verification.meshes.blocks import joined
from verification.meshes.rings import pair, ring
from verification.solving import Solved, case_text, entry, with_motions

Floats = NDArray[np.floating]


_PIN = PinInHole(radius=12.0, clearance=0.2, young=210e3, poisson=0.3, angle=60.0)


@dataclass(frozen=True)
class Pin:
    """The quarters of the pin, from `inner` on, and of the plate, to `outer`; `counts`: along the radius and around, of
    each on the first mesh; the slave is the pin (`within`) or the plate.
    """

    cell: str
    slave: Literal["within", "around"]
    pin: PinInHole = _PIN
    inner: float = 5.0
    outer: float = 26.0
    counts: tuple[tuple[int, int], tuple[int, int]] = ((5, 12), (6, 9))
    jitter: float = 0.1
    axisymmetric: bool = False
    second: float | None = None
    uniform: bool = False
    exact: bool = True
    cubic: bool = False

    def sets(self, level: int, levels: int) -> int:
        """One set of meshes."""
        return 1

    def mesh(self, level: int, number: int = 0) -> Mesh:
        """The two bodies, not cut: groups as `rings.pair`, the sides x = 0 as `x0_within` and `x0_around`."""
        radii = (self.inner, self.pin.radius, self.outer)
        parts = []
        for k, (name, counts) in enumerate(zip(("within", "around"), self.counts, strict=True)):
            own = [n << level for n in counts]
            layer = ring(self.cell, own, radii[k : k + 2], jitter=self.jitter, seed=100 * k + level)
            parts.append(joined([(layer, {"x0": f"x0_{name}"})], keep=True))
        return pair(*parts, slave=self.slave)

    def h(self, level: int) -> float:
        """The size of the slave's faces."""
        return self.pin.radius * np.pi / 2 / (self.counts[self.slave == "around"][1] << level)

    def case(self, surface: str) -> lacsolver.Case:
        """The case; the displacements of the outer sides are functions."""
        text = case_text(
            "plane_strain",
            entry("material", young=self.pin.young, poisson=self.pin.poisson),
            entry("contact", slave="slave", master="master", clearance=self.pin.clearance, surface=surface),
            entry("displacement", group="y0", uy=0.0),
        )
        body_of: dict[str, Literal["pin", "plate"]]
        body_of = {"inner": "pin", "x0_within": "pin", "outer": "plate", "x0_around": "plate"}
        motions = {group: partial(self._moved, body) for group, body in body_of.items()}
        return with_motions(text, motions)

    def _moved(self, body: Literal["pin", "plate"], x: Floats, t: float) -> Floats:
        return self.pin.displacement(x[:, :2], body)

    def gap(self, x: Floats) -> Floats:
        """True gap (n,): the clearance; both skins have the radius of the hole."""
        return np.full(len(x), self.pin.clearance)

    def pressure(self, x: Floats) -> Floats:
        """Persson's pressure (n, 1)."""
        return self.pin.pressure(np.arctan2(x[:, 1], x[:, 0]))[:, None]

    def quantities(self, solved: Solved) -> dict[str, float]:
        """Relative errors of the force and of the angle."""
        zone, force = solved.zone, self.pin.force / 2
        resultant = abs(float(solved.figures.contact["slave"].resultant[0]))
        exact = self.pressure(zone.centre)[:, 0]
        ends = [half_angle(zone.centre, p, exact.max()) for p in (zone.pressure, exact)]
        return {"force": resultant / force - 1, "angle of contact": ends[0] / ends[1] - 1}


def half_angle(centre: Floats, p: Floats, peak: float) -> float:
    """Half-angle of contact, degrees, from pressures (n,) beyond 30 degrees; NaN with too few faces."""
    return edge_of_contact(np.degrees(np.arctan2(centre[:, 1], centre[:, 0])), p, peak, 30.0)


def cases() -> Iterator[tuple[str, str, Pin, Mapping[str, int], float]]:
    """Cases of the pin."""
    for cell in ("TRIA3", "QUAD4"):
        for slave in ("within", "around"):
            quick = {"quick": 3} if (cell, slave) == ("TRIA3", "within") else {}
            description = f"a pin in a hole of {cell}, the slave {slave}"
            yield (f"pin-{cell}-{slave}", description, Pin(cell, slave), {**quick, "full": 4, "all": 5}, 4.0)
