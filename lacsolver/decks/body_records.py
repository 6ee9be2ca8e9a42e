"""Records of loads per volume: gravity and centrifugal loads."""

from __future__ import annotations

import numpy as np

from lacmesh.mesh import Floats, Ints
from lacsolver.decks.cards import Refused, look_up
from lacsolver.decks.draft import AXES, CaseDraft
from lacsolver.decks.histories import written
from lacsolver.decks.load_records import orders, scaled
from lacsolver.decks.parts import parts_of


def gravity(draft: CaseDraft) -> None:
    """Add [gravity] if it acts on all that has a density, else a [[body_force]] for each density. Raises Refused."""
    density, mesh = densities(draft), draft.groups.mesh
    parts = list(parts_of(draft.reading.content, orders(draft, "gravity"), once=True))
    heavy = np.flatnonzero(density)
    for part in parts:
        keys = {f"{AXES[c]}": written(points, draft.ramped) for c, points in part.histories.items() if c < draft.dim}
        if not np.isin(part.items, heavy).any():
            raise Refused("gravity acts on elements without a density; give their material a *DENSITY", part.line.row)
        if len(parts) == 1 and np.isin(heavy, part.items).all():
            if mesh.plane == "CAX" and keys.pop("x", 0.0):
                raise Refused(
                    "gravity along the radius has no meaning in a full circle; give it along y", part.line.row
                )
            draft.add("gravity", {f"g{axis}": value for axis, value in keys.items()}, part.line.card)
            continue
        for rho, cells in _by_density(density, part.items):
            group = draft.groups.add_cells(part.name or "heavy", cells)
            loads = {f"f{axis}": scaled(value, rho) for axis, value in keys.items()}
            draft.add("body_force", {"groups": [group]} | loads, part.line.card)


def _by_density(density: Floats, cells: Ints) -> list[tuple[float, Ints]]:
    """Return the densities of some cells, and the cells of each."""
    found = [(float(rho), cells[density[cells] == rho]) for rho in np.unique(density[cells])]
    return [(rho, some_cells) for rho, some_cells in found if rho]


def densities(draft: CaseDraft) -> Floats:
    """Return the density (n_cells,) of each cell, 0 without one."""
    content = draft.reading.content
    out = np.zeros(draft.groups.mesh.n_cells)
    for section in content.sections:
        key = look_up(content.materials, section.material, "*MATERIAL")
        out[section.cells] = content.materials[key].keys.get("density", 0.0)
    return out


def centrifugal(draft: CaseDraft) -> None:
    """Add a [[body_force]] for each centrifugal load. Raises Refused."""
    content, density = draft.reading.content, densities(draft)
    for line in (one for one in content.assigned if one.kind == "centrifugal"):
        if draft.large or line.amplitude or len(content.steps) > 1:
            message = (
                "a centrifugal load is taken in one step, without NLGEOM and without amplitude; write a [[body_force]]"
            )
            raise Refused(message, line.row)
        for rho, cells in _by_density(density, line.items):
            group = draft.groups.add_cells(line.name or "turning", cells)
            factor = rho * line.value
            time = "" if content.steps[0].sudden else f" * t / {draft.end!r}"
            outward = _outward(np.array(line.data[:3]), np.array(line.data[3:]))
            loads = {f"f{AXES[c]}": f"{factor!r} * ({outward[c]}){time}" for c in range(draft.dim) if outward[c]}
            draft.add("body_force", {"groups": [group]} | loads, line.card)


def _outward(origin: Floats, way: Floats) -> list[str]:
    """Return the vector from an axis to a place, as formulas of x, y, z; "" for a component that is 0.

    >>> _outward(np.zeros(3), np.array([0.0, 2.0, 0.0]))
    ['1.0 * x', '', '1.0 * z']
    """
    across = np.eye(3) - np.outer(way, way) / (way @ way)
    rows = []
    for row in across:
        terms = [(float(a), AXES[k], float(origin[k])) for k, a in enumerate(row) if abs(a) > 1e-15]
        rows.append(" + ".join(f"{a!r} * ({axis} - {o!r})" if o else f"{a!r} * {axis}" for a, axis, o in terms))
    return rows
