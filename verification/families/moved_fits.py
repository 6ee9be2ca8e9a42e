"""Fits whose bodies are moved along one another, by motions that change nothing: their pressures stay what they are.

A hub is shrunk onto a shaft, both of linear cells with unlike faces. It is then moved along their axis, or turned about
it, by several times the interference, in small kinematics and without friction. Cylinders slide on themselves, and so
the pressures are those of the fit that is not moved. A cone that is pressed into its seat along the axis by s closes a
gap of s sin(a), with a its half angle: pressures and the axial force are those of such an interference, however large s
is. The normals of contact must therefore be those of the cylinder or the cone, not of the flat faces, which are at up
to h / 2R to them. Elliptic bodies slide on themselves along their axis; their normals are those of fits.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.meshes.blocks import bent, nodes_of
from verification.meshes.rings import pair, ring, sleeve
from verification.records import Case, Family, Result, at_most, problem, row
from verification.solving import balanced, case_text, contact, entry, fixed, material, model_of, solve

#: displacement along each axis, a number or a formula
Formulas = tuple[float | str, float | str, float | str]

RADII, LONG = (0.5, 1.0, 1.75), 0.6
INTERFERENCE = 1e-3
#: way along the axis or around, in interferences
_FAR = 5.0
#: how far p_m may be from those of the fit that is not moved, of their mean: on exact shapes, and on fits
_ALLOWED, _OF_FITS = 0.005, 0.12
_STILL: Formulas = (0.0, 0.0, 0.0)
_AROUND: Formulas = (f"{-_FAR * INTERFERENCE} * y", f"{_FAR * INTERFERENCE} * x", 0.0)
_ALONG: Formulas = (0.0, 0.0, _FAR * INTERFERENCE)


@dataclass(frozen=True)
class MovedFit:
    """A hub around a shaft. `slope`: growth of the radii along the axis, over those at its start; 0 for cylinders.

    `oval`: height of their sections over their width.
    `counts`: of quadrangles of the shaft and of the hub, along the radius, around, and along the axis.
    """

    cell: str
    slope: float = 0.0
    oval: float = 1.0
    normals: str = "facet"
    slave: str = "within"
    counts: tuple[tuple[int, ...], tuple[int, ...]] = ((3, 9, 4), (3, 8, 3))

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return CELLS[self.cell].dim

    def mesh(self) -> Mesh:
        """The two bodies, not cut."""
        parts = []
        for k, counts in enumerate(self.counts):
            kind, radii = self.cell, RADII[k : k + 2]
            if self.dim == 2:
                parts.append(ring(kind, counts[:2], radii, jitter=0.15, seed=k))
            else:
                parts.append(sleeve(kind, counts, radii, LONG, slope=self.slope, jitter=0.15, seed=k))
        return bent(pair(parts[0], parts[1], slave=self.slave), lambda x: x * [1.0, self.oval, 1.0])

    def case(self, clearance: float, motion: Formulas = _STILL) -> str:
        """The case, as TOML, with a clearance and the motion of the hub, which its outer face has."""
        axes = "xyz"[: self.dim]
        return case_text(
            model_of(self.dim), material(2000.0, 0.3), contact(normals=self.normals, clearance=clearance),
            fixed("inner", axes),
            entry("displacement", group="outer", **{f"u{a}": u for a, u in zip(axes, motion, strict=False)}),
        )  # fmt: skip

    def motions(self) -> Mapping[str, tuple[float, Formulas]]:
        """The motions of the hub by name, each with the clearance that it has beside it."""
        if self.slope:
            sine = self.slope / float(np.hypot(1.0, self.slope))
            pressed: Formulas = (0.0, 0.0, INTERFERENCE / sine)
            return {"pressed along the axis": (0.0, pressed), "turned": (-INTERFERENCE, _AROUND)}
        along = {"moved along the axis": (-INTERFERENCE, _ALONG)} if self.dim == 3 else {}
        return along if self.oval != 1 else {**along, "turned": (-INTERFERENCE, _AROUND)}


@problem
def solve_case(given: MovedFit) -> Iterator[Result]:
    """A fit that is not moved, and by each motion: macro-elements in contact, pressures, force along a cone's axis."""
    mesh = given.mesh()
    still = solve(given.case(-INTERFERENCE), mesh)
    every, p = [still], still.zone.pressure
    mean = float(np.average(p, weights=still.zone.area))
    source = "a motion of the surface into itself, or the interference that it is worth"
    for name, (clearance, motion) in given.motions().items():
        moved = solve(given.case(clearance, motion), mesh)
        every.append(moved)
        q = moved.zone.pressure
        other, worst = float(((p > 0) != (q > 0)).sum()), float(np.abs(q - p).max()) / mean
        yield at_most(f"macro-elements that open or close, {name}", other, 0.0, source=source)
        reason = "normals are interpolated over faces, or those of fits"
        allowed = _ALLOWED if given.oval == 1 else _OF_FITS
        yield at_most(f"change of p_m, of its mean, {name}", worst, allowed, source=source, reason=reason)
        if given.slope:
            want, got = (float(one.zone.force[nodes_of(one.mesh, "slave"), 2].sum()) for one in (still, moved))
            yield at_most(f"change of the axial force, relative, {name}", abs(got / want - 1), 0.01, source=source)
    yield from balanced(every)


def _cases() -> Iterator[Case]:
    for cell in ("TRIA3", "QUAD4"):
        yield _row(f"rings-{cell}", f"Rings of {cell}, turned", MovedFit(cell), quick=True)
    for cell in ("TETRA4", "HEXA8", "PENTA6"):
        quick = cell == "TETRA4"
        yield _row(f"cylinders-{cell}", f"Cylinders of {cell}, moved along and around", MovedFit(cell), quick)
        yield _row(f"cones-{cell}", f"Cones of {cell}, pressed and turned", MovedFit(cell, slope=0.3), quick)
    yield _row("ellipses-TETRA4", "Elliptic sleeves of TETRA4, moved along", MovedFit("TETRA4", oval=0.7), quick=True)
    for slave, normals in (("around", "facet"), ("within", "smoothed")):
        given = MovedFit("TETRA4", normals=normals, slave=slave)
        words = f"Cylinders of TETRA4, the slave {slave}, {normals} normals"
        yield _row(f"cylinders-TETRA4-{slave}-{normals}", words, given, quick=False)


def _row(name: str, what: str, given: MovedFit, quick: bool) -> Case:
    return row("moved-fits", name, what, solve_case, given, quick=int(quick), full=int(not quick), seconds=3.0)


FAMILY = Family("moved-fits", "Fits that are moved by motions that change nothing", __doc__, tuple(_cases()))
