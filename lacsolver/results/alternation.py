"""Warnings about pressures that alternate from one macro-element to the next, where the roles of the skins explain it.

Each pressure is compared with the mean of its neighbours', so that a pressure that falls evenly counts nothing, and one
that alternates counts in full. A slave that is stiffer than its master, with more macro-elements than the master has
nodes in front of them, follows the master's polygon and not its surface (docs/theory.md, 'Slave and master').
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacmesh.mesh import Floats
from lacmesh.topology.skin import TYPE_CODE
from lacsolver.contact import Zone
from lacsolver.equilibrium.state import CONTACT, State
from lacsolver.problem.hypothesis import ALTERNATING, finer, judged
from lacsolver.problem.problem import Problem

#: difference of pressures from the mean of their neighbours', relative to the pressures, above which they alternate
_ALTERNATE = 0.15
#: fewest macro-elements, with pressure or beside one that has, of which that can be said
_FEWEST = 12
_LINEAR = [TYPE_CODE[name] for name in ("SEG2", "TRIA3", "QUAD4")]


def alternating(problem: Problem, state: State) -> Iterator[str]:
    """Yield a warning for each contact or tie of a converged state whose pressures alternate."""
    for joint, zone in zip(problem.joints, state.zones, strict=True):
        part = 2 * roughness(joint.zone, zone.pressure)
        inside = _inside(joint.zone, zone.status >= CONTACT)
        within = 0.0 if joint.tie else 2 * roughness(joint.zone, zone.pressure, inside)
        if max(part, within) <= _ALTERNATE:
            continue
        face = joint.integrate(problem.space, state.u, state.time)
        judgement = judged(joint, face, problem.space, problem.constraints, problem.materials)
        poor = finer(joint, face, judgement.lacking | (judgement.ratio >= ALTERNATING), problem.constraints)
        record = joint.record
        message = f"pressures of {record.SECTION.name} {joint.name!r} alternate: they differ by "
        if poor:
            message += f"{100 * part:.0f} % from their neighbours' mean, a known effect where slave {record.slave!r} "
            message += f"has finer faces than master {record.master!r} and is stiffer for its size"
            yield f"{message}; exchange slave and master, or refine the master"
        elif within > _ALTERNATE:
            message += f"{100 * within:.0f} % from the mean of their neighbours' inside the contact area, "
            mesh, slave = problem.space.mesh, joint.zone.slave
            parent = mesh.cell_data.get("lac_parent", np.full(mesh.n_cells, -1))[slave.cell]
            cut = np.isin(slave.faces.type, _LINEAR) & (parent >= 0)
            stars = 'macro = "stars" on the uncut mesh, ' if cut.any() else ""
            message += f"an effect of the mesh; {stars}quadratic cells, or exchanging slave and master reduce it, "
            yield f"{message}and the recovered pressure evens it out (lacsolver plot --field recovered)"


def roughness(zone: Zone, pressure: Floats, chosen: np.ndarray | None = None) -> float:
    """Return the sum of |p - mean of its neighbours'|, relative to that of their sums, of `chosen` (m,) or all.

    Macro-elements with fewer than two neighbours do not count, nor those without a pressure beside them; 0 for a few.
    It is 0 for a pressure that is even, or falls evenly in a plane, and 1 for a checkerboard.
    """
    a, b = _pairs(zone)
    n, p = np.bincount(a, minlength=zone.n_macros), np.abs(pressure)
    mean = np.bincount(a, p[b], zone.n_macros) / np.maximum(n, 1)
    on = (n > 1) & (p + mean > 0) & (True if chosen is None else chosen)
    total = float((p + mean)[on].sum())
    return float(np.abs(p - mean)[on].sum()) / total if np.count_nonzero(on) >= _FEWEST else 0.0


def _pairs(zone: Zone) -> tuple[np.ndarray, np.ndarray]:
    """Return the neighbouring macro-elements (k,), (k,), each pair once in each order."""
    beyond = zone.slave.neighbours
    face, k = np.nonzero(beyond >= 0)
    pairs = np.unique(np.stack([zone.macro[face], zone.macro[beyond[face, k]]]), axis=1)
    a, b = pairs[:, pairs[0] != pairs[1]]
    return a, b


def _inside(zone: Zone, closed: np.ndarray) -> np.ndarray:
    """Return a mask (m,) of closed macro-elements whose neighbours are all closed."""
    a, b = _pairs(zone)
    return closed & (np.bincount(a[~closed[b]], minlength=zone.n_macros) == 0)
