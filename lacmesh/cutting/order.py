"""Elevate the order of a mesh: linear cells to serendipity ("2"), or linear and serendipity ones to full quadratic.

New nodes lie at the middle of edges, faces and cells, on the cell's own map if it is quadratic already; on the curved
skin of a body they lie on its smooth surface (`lacmesh.smooth`), unless a cell would become invalid. Edges and
faces are identified by their corners, so that the mesh stays conforming; an edge that has a mid-node already keeps it.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS, Cell
from lacmesh.cutting.assemble import node_entities, nodes_of
from lacmesh.cutting.records import is_cut
from lacmesh.cutting.subdivide import NewNodes
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Block, Ints, Mesh, MeshLike, as_mesh, places_of
from lacmesh.quality import validity_of
from lacmesh.smooth.middles import ways_to_surface
from lacmesh.smooth.surfaces import SURFACES
from lacmesh.topology.skin import label_rows

#: family -> the type of its serendipity cell, and of its full quadratic one
_RAISED = {
    "POI": ("POI1", "POI1"),
    "SEG": ("SEG3", "SEG3"),
    "TRIA": ("TRIA6", "TRIA6"),
    "QUAD": ("QUAD8", "QUAD9"),
    "TETRA": ("TETRA10", "TETRA10"),
    "HEXA": ("HEXA20", "HEXA27"),
    "PENTA": ("PENTA15", "PENTA18"),
    "PYRAM": ("PYRAM13", "PYRAM14"),
}
ORDERS = ("2", "2-full")
#: least Jacobian determinant of a cell, over its mean (`validity`), that curved edges may leave
_LEAST = 0.2
_ROUNDING = 1e-9


@dataclass(frozen=True)
class _Wanted:
    """Nodes of order 2 that the cells of a block need: `corners` (m, c) sorted, and the column they go to."""

    block: int
    column: int
    corners: Ints
    known: Ints  # (m,) the node there already, or -1


def raise_order(mesh: MeshLike, order: str = "2", *, extend: bool = True, surface: str = "smooth") -> Mesh:
    """Make the cells quadratic: `order` is "2" (serendipity) or "2-full" (HEXA27, QUAD9, PENTA18, PYRAM14).

    `surface`: `smooth`, new nodes on the outer faces of bodies lie on the smooth surface that these stand for, with
    edges where it turns by more than 40 degrees; or `faces`, on the faces as they are. A cell whose least Jacobian
    determinant, over the mean, would fall below 0.2 keeps straight edges; a LacmeshWarning gives their number.

    Cells of that order or higher stay as they are. Numbers, groups and data are kept; new nodes are numbered after the
    largest number, and enter a node group that holds every corner of their edge, face or cell (`extend`). If two types
    become one, their cells keep their order in the file. Raises CutError for a mesh that carries a cut.

    >>> triangle = Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]])])
    >>> raise_order(triangle).blocks[0].type
    'TRIA6'
    """
    mesh = as_mesh(mesh)
    if order not in ORDERS:
        raise RequestError(f"order is one of {', '.join(ORDERS)}, not {order!r}")
    if surface not in SURFACES:
        raise RequestError(f"surface is one of {', '.join(SURFACES)}, not {surface!r}")
    if is_cut(mesh):
        raise CutError("this mesh carries a cut, whose macro-elements depend on the order; elevate the order, then cut")
    targets = [_target(block.type, ORDERS.index(order)) for block in mesh.blocks]
    wanted = [w for k, target in enumerate(targets) for w in _wanted(mesh.blocks[k], k, target)]
    raised = [_widen(block, target) for block, target in zip(mesh.blocks, targets, strict=True)]
    new_nodes = _place(mesh, wanted, raised, targets)
    blocks = tuple(Block(t, nodes) for t, nodes in zip(targets, raised, strict=True))
    new = replace(mesh, blocks=blocks, **nodes_of(mesh, new_nodes, extend))
    if "entity" in new.node_data and "entity" in new.cell_data:
        entities = np.split(new.cell_data["entity"], new.offsets[1:-1])
        cells = ((b.type, b.nodes, own) for b, own in zip(new.blocks, entities, strict=True))
        entity = node_entities(new.node_data["entity"], mesh.n_nodes, cells)
        new = replace(new, node_data={**new.node_data, "entity": entity})
    if new_nodes and mesh.model is not None and mesh.model.periodic:
        message = "the mesh has periodic links: the new nodes on them have no periodic partner"
        warnings.warn(message, LacmeshWarning, stacklevel=2)
    return _merge_blocks(_on_surface(mesh, new, new_nodes) if new_nodes and surface == "smooth" else new)


def _on_surface(mesh: Mesh, new: Mesh, new_nodes: list[NewNodes]) -> Mesh:
    """Move the new nodes of a mesh onto the smooth surface of its bodies, except those of cells that it would spoil."""
    way = np.zeros_like(new.points)
    for nodes, ways in zip(new_nodes, ways_to_surface(mesh, [nodes.on for nodes in new_nodes]), strict=True):
        way[nodes.ids[:, 0]] = ways
    touched = np.flatnonzero(_of_cells(new, (way != 0).any(axis=1)))
    least = np.minimum(validity_of(new, touched), _LEAST)
    straight = np.zeros(len(touched), bool)
    while True:
        moved = replace(new, points=new.points + way)
        spoilt = ~straight & ~(validity_of(moved, touched) >= least * (1 - _ROUNDING))
        if not spoilt.any():
            break
        straight |= spoilt
        for _, _, spoiling in new.select(touched[spoilt]):
            way[spoiling] = 0.0
    if straight.any():
        cells = touched[straight & (new.cell_dim[touched] == new.dim)]
        message = (
            f"{len(cells)} cells on curved skins keep straight edges, with which they have a better shape: "
            f"{new.cell_names(cells)}; refine the mesh there"
        )
        warnings.warn(message, LacmeshWarning, stacklevel=3)
    return moved if way.any() else new


def _of_cells(mesh: Mesh, nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(n_cells,): True for cells with some of the nodes (n_nodes,)."""
    return np.concatenate([nodes[block.nodes].any(axis=1) for block in mesh.blocks])


def _target(name: str, full: int) -> str:
    cell = CELLS.get(name)
    if cell is None or cell.name == "TRIA7":
        return name
    raised = _RAISED[cell.family][full]
    return raised if CELLS[raised].n_nodes > cell.n_nodes else name


def _wanted(block: Block, k: int, target: str) -> list[_Wanted]:
    cell = CELLS.get(target)
    if cell is None:
        return []
    has = block.nodes.shape[1]
    out = []
    for column in range(cell.n_corners, cell.n_nodes):
        corners = np.sort(block.nodes[:, cell.corners_of_node[column]], axis=1)
        known = block.nodes[:, column] if column < has else np.full(len(block.nodes), -1)
        out.append(_Wanted(k, column, corners, known))
    return out


def _widen(block: Block, target: str) -> Ints:
    if target == block.type:
        return block.nodes
    nodes = np.full((len(block.nodes), CELLS[target].n_nodes), -1, np.int64)
    nodes[:, : block.nodes.shape[1]] = block.nodes
    return nodes


def _place(mesh: Mesh, wanted: list[_Wanted], raised: list[Ints], targets: list[str]) -> list[NewNodes]:
    """Write the id of every wanted node into `raised`; the first cell that needs a missing node creates it."""
    new_nodes: list[NewNodes] = []
    next_id = mesh.n_nodes
    for width in sorted({w.corners.shape[1] for w in wanted}):  # edges, then faces, then cells
        alike = [w for w in wanted if w.corners.shape[1] == width]
        labels, count = label_rows(np.vstack([w.corners for w in alike]))
        known = np.concatenate([w.known for w in alike])
        node = np.full(count, -1, np.int64)
        node[labels[known >= 0]] = known[known >= 0]
        for w, mine in zip(alike, np.split(labels, np.cumsum([len(w.known) for w in alike])[:-1]), strict=True):
            absent = np.flatnonzero(node[mine] < 0)
            _, first = np.unique(mine[absent], return_index=True)
            rows = absent[np.sort(first)]
            ids = next_id + np.arange(len(rows))
            node[mine[rows]] = ids
            next_id += len(rows)
            if len(rows):
                new_nodes.append(_nodes_at(mesh.blocks[w.block], CELLS[targets[w.block]], w.column, rows, ids))
            if targets[w.block] != mesh.blocks[w.block].type:
                raised[w.block][:, w.column] = np.where(w.known >= 0, w.known, node[mine])
    return new_nodes


def _nodes_at(block: Block, target: Cell, column: int, rows: Ints, ids: Ints) -> NewNodes:
    sources = block.nodes[rows]
    on = sources[:, target.corners_of_node[column]]
    return NewNodes(block.type, sources, np.array([target.reference[column]]), ids[:, None], on)


def _merge_blocks(mesh: Mesh) -> Mesh:
    """Merge blocks of the same type, where two types have become one, and renumber the cell indices accordingly."""
    names = [b.type for b in mesh.blocks]
    if len(set(names)) == len(names):
        return mesh
    order, blocks = [], []
    for name in dict.fromkeys(names):
        same = [k for k, n in enumerate(names) if n == name]
        blocks.append(Block(name, np.concatenate([mesh.blocks[k].nodes for k in same])))
        order += [np.arange(mesh.offsets[k], mesh.offsets[k + 1]) for k in same]
    old = np.concatenate(order)
    new = places_of(old, len(old))
    file_order = np.arange(mesh.n_cells) if mesh.file_order is None else mesh.file_order
    return replace(
        mesh,
        blocks=tuple(blocks),
        cell_number=mesh.cell_number[old],
        file_order=new[file_order],
        cell_groups={name: np.sort(new[ids]) for name, ids in mesh.cell_groups.items()},
        cell_data={name: values[old] for name, values in mesh.cell_data.items()},
    )
