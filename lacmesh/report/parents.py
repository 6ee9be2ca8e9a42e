"""Reconstruction of a cut's parents from their children, if the original mesh is not available, and quality of both.

Children know their parent's number (`lac_parent`) and their order (the first keeps that number, the others follow). The
template of each way to cut is tried on them: if the types agree and every position in the template gets one node only,
its first nodes are the parent's. A parent cut by several of its faces has children of children, which no single
template fits: it stays unknown, and is counted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import Cut
from lacmesh.cutting.patterns import CONE, RING, RING_PARENTS, WHOLE_FACES, Template, face_pattern, parent_pattern
from lacmesh.mesh import Floats, Ints
from lacmesh.quality import corner_jacobian
from lacmesh.quality.determinant import validity_among
from lacmesh.quality.statistics import Statistics, statistics


@dataclass(frozen=True)
class ChildrenQuality:
    """The children of a cut against their parents, by the least corner Jacobian.

    `child` and `parent`: statistics over the children, and over the parents that could be reconstructed; `ratio`: the
    child's over its parent's, over the children of those; lines, which have none, are left out of these. `unknown`:
    number of parents that could not be reconstructed; `invalid`: number of invalid children.
    """

    children: int
    parents: int
    unknown: int
    invalid: int
    child: Statistics
    parent: Statistics
    ratio: Statistics

    def as_json(self) -> dict[str, Any]:
        """The comparison as plain data."""
        return {
            "children": self.children,
            "parents": self.parents,
            "parents_unknown": self.unknown,
            "invalid_children": self.invalid,
            "corner_jacobian": self.child.as_json(),
            "corner_jacobian_of_parents": self.parent.as_json(),
            "ratio_to_parent": self.ratio.as_json(),
        }


def children_quality(cut: Cut) -> ChildrenQuality | None:
    """Quality of the children of a cut, by themselves and against their parents; None if no cell was cut."""
    mesh = cut.mesh
    children = np.flatnonzero(cut.parent_of_cell >= 0)
    if not len(children):
        return None
    quality, valid = np.ones(mesh.n_cells), np.ones(mesh.n_cells, bool)
    for kind, cells, nodes in mesh.select(children):
        quality[cells] = corner_jacobian(kind, mesh.points[nodes])
        valid[cells] = validity_among(kind, mesh.points, nodes).least > 0
    groups = list(parents_of(cut))
    ranked = [group for group in groups if CELLS[group[0]].dim > 1]
    parent = [corner_jacobian(kind, mesh.points[nodes]) for kind, nodes, _ in ranked]
    ratios = [_ratio(quality[own], q[:, None]).ravel() for (_, _, own), q in zip(ranked, parent, strict=True)]
    known = sum(len(nodes) for _, nodes, _ in groups)
    return ChildrenQuality(
        children=len(children),
        parents=known,
        unknown=len(np.unique(cut.parent_of_cell[children])) - known,
        invalid=int(np.count_nonzero(~valid[children])),
        child=statistics("corner_jacobian", quality[children[mesh.cell_dim[children] > 1]]),
        parent=statistics("corner_jacobian", _joined(parent)),
        ratio=statistics("corner_jacobian", _joined(ratios)),
    )


def _joined(parts: list[Floats]) -> Floats:
    return np.concatenate(parts) if parts else np.empty(0)


def _ratio(child: Floats, parent: Floats) -> Floats:
    """Child over parent; NaN where the parent was not valid itself."""
    child, parent = np.broadcast_arrays(child, parent)
    return np.divide(child, parent, out=np.full(child.shape, np.nan), where=parent > 0)


def parents_of(cut: Cut) -> Iterator[tuple[str, Ints, Ints]]:
    """Reconstruct the parents of a cut from their children where possible, type by type.

    Yields the type, the parents' nodes (p, n), and the indices (p, c) of their children.
    """
    mesh = cut.mesh
    for kinds, cells in _broods(cut):
        nodes = [mesh.blocks[_block(cut, cells[0, k])].nodes for k in range(cells.shape[1])]
        start = [mesh.offsets[_block(cut, cells[0, k])] for k in range(cells.shape[1])]
        rows = [block[cells[:, k] - first] for k, (block, first) in enumerate(zip(nodes, start, strict=True))]
        left = np.ones(len(cells), bool)
        for name, template in _templates(kinds):
            parents, fits = _lay_over(name, template, rows)
            fits &= left
            left &= ~fits
            if fits.any():
                yield name, parents[fits], cells[fits]


def _block(cut: Cut, cell: int) -> int:
    return int(np.searchsorted(cut.mesh.offsets, cell, side="right")) - 1


def _broods(cut: Cut) -> Iterator[tuple[tuple[str, ...], Ints]]:
    """Yield the children of each parent, in order (p, c), grouped by their types."""
    mesh = cut.mesh
    cells = np.flatnonzero(cut.parent_of_cell >= 0)
    parent, number = cut.parent_of_cell[cells], mesh.cell_number[cells]
    order = np.lexsort((number, number != parent, parent))
    cells, parent = cells[order], parent[order]
    block = np.searchsorted(mesh.offsets, cells, side="right") - 1
    first = np.flatnonzero(np.diff(parent, prepend=-1))
    count = np.diff(first, append=len(cells))
    for size in np.unique(count):
        starts = first[count == size]
        table = block[starts[:, None] + np.arange(size)]
        for kinds in np.unique(table, axis=0):
            mine = starts[(table == kinds).all(axis=1)]
            yield tuple(mesh.blocks[k].type for k in kinds), cells[mine[:, None] + np.arange(size)]


@cache
def _templates(kinds: tuple[str, ...]) -> tuple[tuple[str, Template], ...]:
    """Pairs (parent, template) of every way to cut whose children have these types, in this order."""
    templates = []
    for cell in CELLS.values():
        if cell.dim < 1 or cell.name == "SEG3":
            continue
        ways = [face_pattern(cell.name, kind) for kind in _kinds(cell.name)] if cell.dim < 3 else []
        if cell.dim > 1:
            cuttable = [j for j, f in enumerate(cell.facets) if f.type not in WHOLE_FACES]
            kinds_of = (CONE, RING) if cell.name in RING_PARENTS else (CONE,)
            ways += [parent_pattern(cell.name, j, kind) for kind in kinds_of for j in cuttable]
        templates += [(cell.name, way) for way in ways if _types(way) == kinds]
    return tuple(templates)


def _kinds(face: str) -> tuple[str, ...]:
    if face in WHOLE_FACES:
        return ()
    return (CONE, RING) if CELLS[face].family in ("SEG", "QUAD") else (CONE,)


def _types(template: Template) -> tuple[str, ...]:
    ranked = sorted((int(rank), block.type) for block in template.children for rank in block.rank)
    return tuple(kind for _, kind in ranked)


def _lay_over(name: str, template: Template, rows: list[Ints]) -> tuple[Ints, NDArray[np.bool_]]:
    """Nodes (p, n) of the parents whose children's nodes are `rows`, child by child; True where the template fits."""
    size = CELLS[name].n_nodes
    width = size + len(template.on_face) + len(template.inside)
    frame = np.full((len(rows[0]), width), -1, np.int64)
    fits = np.ones(len(frame), bool)
    for block in template.children:
        for places, rank in zip(block.nodes, block.rank, strict=True):
            there = frame[:, places]
            fits &= ((there < 0) | (there == rows[rank])).all(axis=1)
            frame[:, places] = rows[rank]
    ordered = np.sort(frame, axis=1)
    fits &= (ordered[:, 0] >= 0) & (np.diff(ordered, axis=1) > 0).all(axis=1)
    return frame[:, :size], fits
