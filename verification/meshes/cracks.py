"""Meshes with faces inside a body: cracks that are to be split, sections of bolts, and parts clamped by a bolt."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import assembled
from verification.meshes.blocks import block, joined, rows_of
from verification.meshes.bodies import Where, at, body
from verification.meshes.half_spaces import piece
from verification.meshes.revolved import revolved

Floats = NDArray[np.floating]


def with_inner(mesh: Mesh, group: str, where: Where) -> Mesh:
    """The mesh and a group of the facets between two cells all of whose corners meet a condition."""
    rows = rows_of(mesh)
    for kind, nodes in mesh.blocks:
        cell = CELLS[kind]
        for facet in cell.facets if cell.dim == mesh.dim else ():
            own = nodes[:, list(facet.nodes)]
            corners = own[:, : CELLS[facet.type].n_corners]
            hit = own[where(*mesh.points.T)[corners].all(axis=1)]
            before = rows.get((facet.type, group))
            rows[facet.type, group] = hit if before is None else np.vstack([before, hit])
    for key in [key for key in rows if key[1] == group]:
        rows[key] = rows[key][np.unique(np.sort(rows[key], axis=1), axis=0, return_index=True)[1]]
        if not len(rows[key]):
            del rows[key]
    return assembled(mesh.points, rows, mesh.space_dim)


def edge_cracked(kind: str, n: int) -> Mesh:
    """A square, or a plate of one cell, from -1 to 1 with 2 n cells a side; `crack`: y = 0, x < 0. Sides x0, x1 ..."""
    lines = [np.linspace(-1, 1, 2 * n + 1)] * 2 + [np.array([0.0, 1 / n])] * (CELLS[kind].dim - 2)
    mesh = piece(kind, lines)
    return with_inner(mesh, "crack", lambda x, y, z: (np.abs(y) < 1e-9) & (x < 1e-9))


def penny(kind: str, n: int) -> Mesh:
    """A plane 0 < x < 2, -2 < y < 2 of a body of revolution about y, n cells to the crack x < 1 on y = 0."""
    mesh = piece(kind, [np.linspace(0, 2, 2 * n + 1), np.linspace(-2, 2, 4 * n + 1)])
    return with_inner(mesh, "crack", lambda x, y, z: (np.abs(y) < 1e-9) & (x < 1 + 1e-9))


def penny_in_space(n: int) -> Mesh:
    """A quarter of a cylinder of radius 2, -2 < z < 2, of HEXA20 and PENTA15; `crack`: r < 1 on z = 0; `far`."""
    r, z = np.meshgrid(np.linspace(0, 2, 2 * n + 1), np.linspace(-2, 2, 4 * n + 1), indexing="ij")
    section = body(np.stack([r, z], axis=-1), skins={"far": lambda r, z: (r > 2 - 1e-9) | (np.abs(z) > 2 - 1e-9)})
    mesh = revolved(section, 2 * n, "body")
    return with_inner(mesh, "crack", lambda x, y, z: (np.abs(z) < 1e-9) & (np.hypot(x, y) < 1 + 1e-9))


def clamped(kind: str, counts: Sequence[int], *, halves: bool = False) -> Mesh:
    """A bolt 2 high and 1 wide, and beside it two columns, one on the other, of the same size; cells of one type.

    `counts`: cells across the bolt, the lower and the upper column. Groups: `foot`, `head` (ends), `slave`, `master`
    between the columns, and `shank`, a section of the bolt in its middle; with `halves` the bolt is of two bodies whose
    meshes differ, and `shank_a`, `shank_b` are their skins.
    """
    d = CELLS[kind].dim
    up = "xyz"[d - 1]

    def column(x: float, low: float, high: float, n: int) -> Mesh:
        return block(kind, n, (x, *[0.0] * (d - 2), low), (x + 1, *[1.0] * (d - 2), high))

    bolt, foot, lid = counts
    columns = [
        (column(2, 0, 1, foot), {"": "lower", f"{up}0": "foot", f"{up}1": "slave"}),
        (column(2, 1, 2, lid), {"": "upper", f"{up}0": "master", f"{up}1": "head"}),
    ]
    if halves:
        columns += [
            (column(0, 0, 1, bolt), {"": "bolt", f"{up}0": "foot", f"{up}1": "shank_a"}),
            (column(0, 1, 2, bolt + 1), {"": "bolt", f"{up}0": "shank_b", f"{up}1": "head"}),
        ]
        return joined(columns)
    columns.append((column(0, 0, 2, 2 * bolt), {"": "bolt", f"{up}0": "foot", f"{up}1": "head"}))
    inside = at(d - 1, 1.0)
    return with_inner(joined(columns), "shank", lambda *x: inside(*x) & (x[0] < 1.5))


def split_at(mesh: Mesh, group: str) -> Mesh:
    """The mesh split at a group of faces, cut on side a."""
    return lacmesh.cut_skin(lacmesh.split(mesh, group), f"{group}_a").mesh
