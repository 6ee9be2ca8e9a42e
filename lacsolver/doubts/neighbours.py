"""Pressures against those of neighbouring macro-elements: doubts where they differ as a mesh or the roles explain it.

*Alternating* pressures are compared with the mean of their neighbours', so that a pressure that falls evenly counts
nothing, and one that alternates counts in full. A slave that is stiffer than its master, with more macro-elements than
the master has nodes in front of them, follows the master's polygon and not its surface (docs/theory.md, 'Slave and
master').

*Flat faces* of size h deviate from a skin of radius R by h^2 / 8R, and a gap d changes the pressure of a macro-element
by about E d / h: with an angle theta = h / R between neighbouring faces the error is E theta / 8 (docs/theory.md,
'Smooth surfaces over flat faces'). If that is not small compared with the computed pressures, and these differ between
neighbouring macro-elements, they reflect the mesh more than the contact.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacmesh.smooth import unresolved
from lacmesh.surface import Surface
from lacmesh.topology.skin import TYPE_CODE
from lacsolver.case import Contact
from lacsolver.contact import Zone
from lacsolver.doubts.determined import stiffer_and_finer
from lacsolver.doubts.run import Doubt, Run
from lacsolver.equilibrium.state import CONTACT

#: difference of pressures from the mean of their neighbours', relative to the pressures, above which they alternate
_ALTERNATE = 0.15
#: fewest macro-elements, with pressure or beside one that has, of which that can be said
_FEWEST = 12
#: flat faces are doubted above both of these: relative difference between pressures of neighbours, and error of flat
#: faces relative to the mean pressure of the macro-elements in contact
_DIFFER, _WORTH = 0.3, 0.5
#: the first of these where only a few faces may be off, as at a fillet
_LOCAL = 0.1
_LINEAR = [TYPE_CODE[name] for name in ("SEG2", "TRIA3", "QUAD4")]


class Neighbours:
    """The neighbouring macro-elements of a zone."""

    def __init__(self, zone: Zone) -> None:
        beyond = zone.slave.neighbours
        face, k = np.nonzero(beyond >= 0)
        pairs = np.unique(np.stack([zone.macro[face], zone.macro[beyond[face, k]]]), axis=1)
        #: neighbours (k,), (k,), each pair once in each order
        self.a, self.b = pairs[:, pairs[0] != pairs[1]]
        self.n = zone.n_macros

    def differing(self, pressure: Floats) -> float:
        """Return the sum of the differences of neighbours' pressures (m,), relative to the sum of these pressures."""
        p, q = np.abs(pressure[self.a]), np.abs(pressure[self.b])
        total = float((p + q).sum())
        return float(np.abs(p - q).sum()) / total if total > 0 else 0.0

    def roughness(self, pressure: Floats, chosen: NDArray[np.bool_] | None = None) -> float:
        """Return the sum of |p - mean of its neighbours'|, relative to that of their sums, of `chosen` (m,) or all.

        Macro-elements with fewer than two neighbours do not count, nor those without a pressure beside them; 0 for a
        few. It is 0 for a pressure that is even, or falls evenly in a plane, and 1 for a checkerboard.
        """
        count, p = np.bincount(self.a, minlength=self.n), np.abs(pressure)
        mean = np.bincount(self.a, p[self.b], self.n) / np.maximum(count, 1)
        on = (count > 1) & (p + mean > 0) & (True if chosen is None else chosen)
        total = float((p + mean)[on].sum())
        return float(np.abs(p - mean)[on].sum()) / total if np.count_nonzero(on) >= _FEWEST else 0.0

    def inside(self, closed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return a mask (m,) of closed macro-elements whose neighbours are all closed."""
        return closed & (np.bincount(self.a[~closed[self.b]], minlength=self.n) == 0)


def alternating(run: Run) -> Iterator[Doubt]:
    """Doubt contacts and ties whose pressures alternate at the end."""
    for pair, zone in run.zones:
        near = Neighbours(pair.zone)
        part = 2 * near.roughness(zone.pressure)
        within = 0.0 if pair.tie else 2 * near.roughness(zone.pressure, near.inside(zone.status >= CONTACT))
        if max(part, within) <= _ALTERNATE:
            continue
        record = pair.record
        message = f"pressures of {record.SECTION.name} {pair.name!r} alternate: they differ by "
        if stiffer_and_finer(run, pair):
            message += f"{100 * part:.0f} % from their neighbours' mean, a known effect where slave {record.slave!r} "
            message += f"has finer faces than master {record.master!r} and is stiffer for its size"
            yield Doubt(f"{message}; exchange slave and master, or refine the master", record)
        elif within > _ALTERNATE:
            message += f"{100 * within:.0f} % from the mean of their neighbours' inside the contact area, an effect of "
            message += f"the mesh; {_stars(run, pair.zone)}quadratic cells, or exchanging slave and master reduce it, "
            yield Doubt(f"{message}and the recovered pressure evens it out (lacsolver plot --field recovered)", record)


def _stars(run: Run, zone: Zone) -> str:
    """Return the advice to take stars, for linear faces that were cut; "" for others."""
    mesh, slave = run.space.mesh, zone.slave
    parent = mesh.cell_data.get("lac_parent", np.full(mesh.n_cells, -1))[slave.cell]
    cut = np.isin(slave.faces.type, _LINEAR) & (parent >= 0)
    return 'macro = "stars" on the uncut mesh, ' if cut.any() else ""


def faceted(run: Run) -> Iterator[Doubt]:
    """Doubt contacts whose pressures at the end look like those of flat faces, or of faces of doubtful height."""
    moduli = (material.young for material in run.problem.case.material if material.young is not None)
    young = min((float(np.min(one)) for one in moduli), default=0.0)
    for pair, zone in run.zones:
        part, on = Neighbours(pair.zone).differing(zone.pressure), zone.pressure > 0
        if not isinstance(pair.record, Contact) or part <= _LOCAL or not on.any():
            continue
        record, skins = pair.record, (pair.zone.slave, pair.zone.master)
        turn, doubt = max(_turn(run, record, skin) for skin in skins), max(map(_height_doubt, skins))
        worth, mean = young * turn / 8, float(np.average(zone.pressure[on], weights=zone.area[on]))
        message = (
            f"pressures of contact {pair.name!r} differ by {100 * part:.0f} % from one macro-element to the next, "
        )
        if part > _DIFFER and worth > _WORTH * mean:
            message += f"a known effect of flat faces on curved surfaces: normals turn by {np.degrees(turn):.2g} "
            message += (
                f"degrees from face to face, an error of E h / 8R = {worth:.4g} for a mean pressure of {mean:.4g}"
            )
            advice = 'take surface = "smooth", or ' if record.surface == "faces" else ""
            advice += "refine both surfaces, or mesh with quadratic cells, whose mid-nodes lie on them"
            yield Doubt(f"{message}; {advice}", record)
        elif young * doubt > _WORTH * mean:
            message += f"where heights of curved surfaces are uncertain by {doubt:.2g} of a face's size, an error of "
            message += f"{young * doubt:.4g} for a mean pressure of {mean:.4g}"
            advice = "refine both surfaces where their curvature changes, put nodes on the line where two shapes touch"
            yield Doubt(f"{message}; {advice}, or mesh with quadratic cells", record)


def _turn(run: Run, record: Contact, skin: Surface) -> float:
    """Return the median angle between normals of neighbouring flat faces on a curved skin."""
    turns = unresolved(run.space.local, skin, how=record.surface, crease_angle=record.crease_angle)
    return float(np.median(turns)) if len(turns) else 0.0


def _height_doubt(skin: Surface) -> float:
    """Return how far the heights of a skin may be off, over the size of a face; 0 if it has none."""
    return 0.0 if skin.height is None or skin.height.doubt is None else float(skin.height.doubt.max(initial=0.0))
