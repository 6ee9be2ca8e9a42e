"""The pieces of two half-spaces near their contact, between grid lines whose places follow the edge of contact.

The contact is where |x| <= 1 (lengths are in its half-width a): the slave is above y = 0 (z = 0 in space), its grid
lines stand h = 1 / (k + f) apart up to the one beyond the edge, so that on every level the edge lies at the same
fraction f inside its macro-element. The pieces reach to 2 a sideways and in depth. Bodies are cut at their planes of
symmetry x = 0 (y = 0). The lines of the master are spread evenly and do not match.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.meshes.blocks import SPLITS, assembled, divided, grid, raised, rows_of, with_sides

#: how far the pieces reach, in half-widths
REACH = 2.0
Floats = NDArray[np.floating]


def half_spaces(kind: str, k: int, fraction: float, *, rigid: bool = False) -> Mesh:
    """Slave and master of cells of type `kind`, about k slave cells to the half-width (k even), or a flat rigid master.

    Groups: `upper`, `lower`, `slave`, `master`; `axis_x` (and `axis_y`): x = 0, y = 0; `far_upper`, `far_lower`.
    """
    dim = CELLS[kind].dim
    aside, even = edge_lines(k, fraction), np.linspace(0, REACH, 3 * k // 2 + 1)
    deep = depth_lines(k)
    up = "xyz"[dim - 1]
    upper = piece(kind, [*[aside] * (dim - 1), deep])
    rows = _named(upper, "upper", {f"{up}0": "slave", f"{up}1": "far_upper"})
    if rigid:
        x = (np.array(CELLS["SEG2" if dim == 2 else "QUAD4"].reference) + 1) / 2
        x = np.column_stack([x if dim == 3 else 1 - x, np.zeros(len(x))]) * (REACH + 1)  # it faces up
        rows["SEG2" if dim == 2 else "QUAD4", "master"] = upper.n_nodes + np.arange(len(x))[None]
        points = np.concatenate([upper.points, np.pad(x, ((0, 0), (0, 3 - dim)))])
        return assembled(points, rows, dim)
    lower = piece(kind, [*[even] * (dim - 1), -deep[::-1]])
    named = _named(lower, "lower", {f"{up}1": "master", f"{up}0": "far_lower"})
    for key, nodes in named.items():
        rows[key] = np.concatenate([*([rows[key]] if key in rows else []), nodes + upper.n_nodes])
    return assembled(np.concatenate([upper.points, lower.points]), rows, dim)


def edge_lines(k: int, fraction: float) -> Floats:
    """Lines from 0 to REACH: k + 1 even steps, the last around the edge of contact at 1, then half as many as k.

    >>> edge_lines(2, 0.5).round(12).tolist()
    [0.0, 0.4, 0.8, 1.2, 2.0]
    """
    inner = np.arange(k + 2) / (k + fraction)
    return np.concatenate([inner, np.linspace(inner[-1], REACH, k // 2 + 1)[1:]])


def depth_lines(k: int) -> Floats:
    """Lines from the surface to REACH: k steps down to 1, then half as many."""
    return np.concatenate([np.linspace(0, 1, k + 1), np.linspace(1, REACH, k // 2 + 1)[1:]])


def piece(kind: str, lines: Sequence[Floats]) -> Mesh:
    """A box of cells of type `kind` between grid lines, its sides as groups."""
    counts = [len(line) - 1 for line in lines]
    places, boxes = grid(counts, (0,) * len(lines), counts)
    placed = np.stack([np.interp(places[:, s], np.arange(len(v)), v) for s, v in enumerate(lines)], axis=1)
    points, cells = divided(placed, boxes, [SPLITS[CELLS[kind].linear]], np.zeros(len(boxes), int))
    mesh = raised(Mesh.create(points, cells.items(), space_dim=len(lines)), kind)
    return with_sides(mesh, [line[0] for line in lines], [line[-1] for line in lines])


def _named(mesh: Mesh, body: str, names: dict[str, str]) -> dict[tuple[str, str], NDArray[np.integer]]:
    """Cells of a piece by (type, group), with groups named by their role: symmetry, surface, far boundary."""
    symmetric = ("x0", "y0")[: mesh.space_dim - 1]
    known = {"": body, **{side: f"axis_{side[0]}" for side in symmetric}, **names}
    rows: dict[tuple[str, str], list[NDArray[np.integer]]] = {}
    for (kind, name), nodes in rows_of(mesh).items():
        rows.setdefault((kind, known.get(name, f"far_{body}")), []).append(nodes)
    return {key: np.concatenate(parts) for key, parts in rows.items()}
