"""Plain records of the content of a mesh and of the effect of a cut: the command prints them, `--json` writes them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import Cut, is_cut
from lacmesh.cutting.patterns import CONE, RING, RING_PARENTS, WHOLE, WHOLE_FACES, face_pattern, parent_pattern
from lacmesh.errors import CutError
from lacmesh.mesh import ENTITY_CODE, Ints, Mesh
from lacmesh.quality import worst


@dataclass(frozen=True)
class PatternRow:
    """One line of the table of patterns; `added_nodes` and `added_cells` are net, skin and volume together."""

    cell: str
    face: str
    variant: str
    faces: str
    children: str
    added_nodes: int
    added_cells: int


@dataclass(frozen=True)
class CutSummary:
    """Summary of a cut; pairs are before and after it.

    `zones`: macro-elements of each; `replaced`, `children`: numbers of cells by type; `worst`: least quality of the
    touched cells (NaN: none).
    """

    zones: dict[str, int]
    replaced: dict[str, int]
    children: dict[str, int]
    nodes: tuple[int, int]
    cells: tuple[int, int]
    worst: tuple[float, float]


def describe(mesh: Mesh) -> dict[str, Any]:
    """All that `lacmesh info --json` says of a mesh; counts are of distinct cells."""
    low_high = [mesh.points.min(axis=0).tolist(), mesh.points.max(axis=0).tolist()] if mesh.n_nodes else None
    lac = None
    if is_cut(mesh):
        with suppress(CutError):  # records that mean something else
            cut = Cut(mesh)
            lac = {"macro_elements": cut.n_macros, "zones": list(cut.zones)}
    return {
        "nodes": mesh.n_nodes,
        "cells": mesh.n_cells,
        "cells_by_type": mesh.cells_by_type,
        "groups": {name: {"dim": mesh.group_dim(name), "cells": len(g)} for name, g in mesh.cell_groups.items()},
        "node_groups": {name: len(members) for name, members in mesh.node_groups.items()},
        "entities": list(_entities(mesh)),
        "bounding_box": low_high,
        "lac": lac,
    }


def _entities(mesh: Mesh) -> Iterator[dict[str, Any]]:
    """Yield each elementary entity of msh: dimension, tag, the number of its cells, and the box around them."""
    known = mesh.entities
    if not known:
        return
    entity = mesh.cell_data["entity"].astype(np.int64)
    place = np.searchsorted(np.array(known) @ ENTITY_CODE, entity @ ENTITY_CODE)
    place[entity[:, 0] < 0] = len(known)  # cells of none: one row more
    cells = np.bincount(place)
    low, high = np.full((len(known) + 1, 3), np.inf), np.full((len(known) + 1, 3), -np.inf)
    for (_, nodes), first in zip(mesh.blocks, mesh.offsets, strict=False):
        rows = place[first : first + len(nodes)]
        x = mesh.points[nodes]
        for axis in range(3):  # numpy is quick at this with one index only
            np.minimum.at(low[:, axis], rows, x[..., axis].min(axis=1))
            np.maximum.at(high[:, axis], rows, x[..., axis].max(axis=1))
    for k, (dim, tag) in enumerate(known):
        yield {"dim": dim, "tag": tag, "cells": int(cells[k]), "box": [low[k].tolist(), high[k].tolist()]}


def summarise(before: Mesh, cut: Cut) -> CutSummary:
    """Compare a mesh with its cut."""
    after = cut.mesh
    children = np.flatnonzero(cut.parent_of_cell >= 0)
    parents = rows_of(before, np.unique(cut.parent_of_cell[children]))
    macros = np.bincount(_zone_of_macro(cut), minlength=len(cut.zones))
    return CutSummary(
        zones={name: int(n) for name, n in zip(cut.zones, macros, strict=True)},
        replaced={kind: len(cells) for kind, cells, _ in before.select(parents)},
        children={kind: len(cells) for kind, cells, _ in after.select(children)},
        nodes=(before.n_nodes, after.n_nodes),
        cells=(before.n_cells, after.n_cells),
        worst=(worst(before, parents), worst(after, children)),
    )


def _zone_of_macro(cut: Cut) -> Ints:
    first = np.flatnonzero(cut.child_kind == 1)
    return cut.zone_of_face[first]


def rows_of(mesh: Mesh, numbers: Ints) -> Ints:
    """Sorted indices (k,) of the cells with these numbers, all of which the mesh must have."""
    if int(mesh.cell_number.max(initial=0)) > 10 * mesh.n_cells + 1000:
        order = np.argsort(mesh.cell_number, kind="stable")
        return np.sort(order[np.searchsorted(mesh.cell_number, numbers, sorter=order)])
    row = np.full(int(mesh.cell_number.max(initial=0)) + 1, -1, np.int32)
    row[mesh.cell_number] = np.arange(mesh.n_cells, dtype=np.int32)
    return np.sort(row[numbers])


def pattern_table() -> Iterator[PatternRow]:
    """Yield every way to cut a cell by one of its facets, one row for facets that are cut alike."""
    for cell in CELLS.values():
        if cell.dim < 2:
            continue
        seen = set()
        for j, facet in enumerate(cell.facets):
            for kind in _kinds(cell.name, facet.type):
                if (facet.type, kind) not in seen:
                    seen.add((facet.type, kind))
                    yield _row(cell.name, j, facet.type, kind)


def _kinds(cell: str, face: str) -> tuple[str, ...]:
    if face in WHOLE_FACES:
        return (WHOLE,)
    return (CONE, RING) if cell in RING_PARENTS else (CONE,)


def _row(cell: str, j: int, face: str, kind: str) -> PatternRow:
    volume, skin = parent_pattern(cell, j, kind), face_pattern(face, kind)
    variants = {"HEXA8": {CONE: "pyramid", RING: "hexa"}, "QUAD4": {CONE: "beside a triangle", RING: "default"}}
    variants["HEXA20"] = variants["HEXA8"]
    whole = kind == WHOLE
    return PatternRow(
        cell=cell,
        face=face,
        variant=variants.get(cell, {}).get(kind, "whole" if whole else ""),
        faces=f"1 {face}" if whole else _count(skin.children),
        children=f"1 {cell}" if whole else _count(volume.children),
        added_nodes=len(volume.on_face) + len(volume.inside),
        added_cells=0 if whole else volume.n_children + skin.n_children - 2,
    )


def _count(blocks: Any) -> str:
    return " + ".join(f"{len(b.rank)} {b.type}" for b in blocks)
