"""The sections of msh 2.2: nodes, elements in the file's order, periodic links.

A cell is written once, with the first physical group of its entity; further groups stand in our notes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.entities import Assignment
from lacmesh.formats.msh.output import Output, pieces, ragged_lines
from lacmesh.formats.writing import file_order
from lacmesh.mesh import Ints, Mesh

#: Elements put together at a time.
_WINDOW = 1 << 17


def write_sections(
    out: Output, mesh: Mesh, entities: Assignment, node_number: Ints, cell_number: Ints, partition: Ints | None
) -> None:
    """Write $Nodes, $Elements, $Periodic; `partition` (n_cells,) or None becomes tags. Types msh lacks are skipped."""
    out.text(f"$Nodes\n{mesh.n_nodes}\n")
    out.numbered_rows(node_number, mesh.points)
    out.end("Nodes")
    _write_elements(out, mesh, entities, node_number, cell_number, partition)
    _write_periodic(out, mesh, node_number)


def first_group(entities: Assignment) -> Ints:
    """Tag of the one physical group of each entity that msh 2.2 has room for, 0 for none."""
    return np.array([e.groups[0] if e.groups else 0 for e in entities.entities], np.int64)


def _write_elements(
    out: Output, mesh: Mesh, entities: Assignment, node_number: Ints, cell_number: Ints, partition: Ints | None
) -> None:
    order = file_order(mesh)
    lacking = [ALL_CELLS[b.type].msh is None for b in mesh.blocks]
    if any(lacking):
        order = order[~np.array(lacking)[np.searchsorted(mesh.offsets, order, side="right") - 1]]
    tags = np.stack([first_group(entities), [e.tag for e in entities.entities]], axis=1)
    out.text(f"$Elements\n{len(order)}\n")
    for part in pieces(len(order), _WINDOW):
        cells = order[part]
        block = np.searchsorted(mesh.offsets, cells, side="right") - 1
        parted = np.zeros(len(cells), bool) if partition is None else partition[cells] > 0
        rows = _Rows(mesh, block, parted, out.binary)
        rows.put(0, cell_number[cells])
        rows.put(rows.head, tags[entities.cell[cells], 0])
        rows.put(rows.head + 1, tags[entities.cell[cells], 1])
        if partition is not None:
            rows.put(rows.head + 2, 1, parted)
            rows.put(rows.head + 3, partition[cells[parted]], parted)
        for b in np.unique(block).tolist():
            here = block == b
            nodes = mesh.blocks[b].nodes[cells[here] - mesh.offsets[b]]
            for j in range(nodes.shape[1]):
                rows.put(rows.head + rows.n_tags[here] + j, node_number[nodes[:, j]], here)
        rows.write(out)
    out.end("Elements")


class _Rows:
    """Elements of many lengths in one array; in binary a header stands before each run of elements alike."""

    def __init__(self, mesh: Mesh, block: Ints, parted: NDArray[np.bool_], binary: bool) -> None:
        self.n_tags = np.where(parted, 4, 2)
        self.head = 1 if binary else 3
        kind = np.array([ALL_CELLS[b.type].msh or 0 for b in mesh.blocks])[block]
        size = self.head + self.n_tags + np.array([b.nodes.shape[1] for b in mesh.blocks])[block]
        alike = kind * 8 + self.n_tags
        begins = np.append(True, alike[1:] != alike[:-1]) if binary else np.zeros(len(block), bool)
        end = np.cumsum(size + 3 * begins)
        self.start = end - size
        self.size = size
        self.values = np.empty(end[-1], "<i4")
        if binary:
            run = np.flatnonzero(begins)
            at = self.start[run] - 3
            self.values[at] = kind[run]
            self.values[at + 1] = np.diff(np.append(run, len(block)))
            self.values[at + 2] = self.n_tags[run]
        else:
            self.put(1, kind)
            self.put(2, self.n_tags)

    def put(self, place: Ints | int, values: Ints | int, which: NDArray[np.bool_] | slice = slice(None)) -> None:
        """Write values at a place in each row, or in some of the rows."""
        self.values[self.start[which] + place] = values

    def write(self, out: Output) -> None:
        if out.binary:
            out.array(self.values)
        else:
            out.text(ragged_lines(self.size.tolist(), self.values.tolist()))


def _write_periodic(out: Output, mesh: Mesh, node_number: Ints) -> None:
    """Write the periodic links, as text in binary files too."""
    links = () if mesh.model is None else mesh.model.periodic
    if not links:
        return
    out.text(f"$Periodic\n{len(links)}\n")
    for link in links:
        out.text(f"{link.slave[0]} {link.slave[1]} {link.master[1]}\n")
        if len(link.affine) == 16:
            out.text(f"Affine {' '.join(map(str, link.affine))}\n")
        pairs = node_number[np.asarray(link.nodes, np.int64).reshape(-1, 2)]
        out.text(f"{len(pairs)}\n" + "".join(f"{a} {b}\n" for a, b in pairs.tolist()))
    out.text("$EndPeriodic\n")
