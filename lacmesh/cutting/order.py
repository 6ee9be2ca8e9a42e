"""Elevate the order of a mesh: linear cells to serendipity ("2"), or linear and serendipity ones to full quadratic.

New nodes lie at the middle of edges, faces and cells, on the cell's own map if it is quadratic already; on the curved
skin of a body they lie on its smooth surface (`lacmesh.smooth`), unless a cell would become invalid. Edges and
faces are identified by their corners, so that the mesh stays conforming; an edge that has a mid-node already keeps it.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.assemble import NewNodes, NodeList, nodes_of, with_node_entities
from lacmesh.cutting.records import is_cut
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Block, Mesh, MeshLike, as_mesh, places_of
from lacmesh.quality import validity_of
from lacmesh.smooth.heights import SURFACES
from lacmesh.smooth.middles import ways_to_surface
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
    raised = [_widened(block, ORDERS.index(order)) for block in mesh.blocks]
    new_nodes = _middles(mesh, raised).parts
    new = replace(mesh, blocks=tuple(raised), **nodes_of(mesh, new_nodes, extend))
    rows = np.split(np.arange(mesh.n_cells), mesh.offsets[1:-1])
    cells = ((block.type, block.nodes, index) for block, index in zip(raised, rows, strict=True))
    new = with_node_entities(new, mesh, cells)
    if new_nodes and mesh.model is not None and mesh.model.periodic:
        message = "the mesh has periodic links: the new nodes on them have no periodic partner"
        warnings.warn(message, LacmeshWarning, stacklevel=2)
    return _merge_blocks(_on_surface(mesh, new, new_nodes) if new_nodes and surface == "smooth" else new)


def _on_surface(mesh: Mesh, new: Mesh, new_nodes: list[NewNodes]) -> Mesh:
    """Move the new nodes of a mesh onto the smooth surface of its bodies, except those of cells that it would spoil."""
    way = np.zeros_like(new.points)
    for nodes, ways in zip(new_nodes, ways_to_surface(mesh, [nodes.on for nodes in new_nodes]), strict=True):
        way[nodes.ids[:, 0]] = ways
    moved_nodes = (way != 0).any(axis=1)
    touched = np.flatnonzero(np.concatenate([moved_nodes[block.nodes].any(axis=1) for block in new.blocks]))
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
        message = f"{len(cells)} cells on curved surfaces keep straight edges, with which they have a better shape: "
        warnings.warn(f"{message}{new.cell_names(cells)}; refine the mesh there", LacmeshWarning, stacklevel=3)
    return moved if way.any() else new


def _widened(block: Block, full: int) -> Block:
    """Return the cells as those of the quadratic type, serendipity or full, with -1 for the nodes that they lack."""
    cell = CELLS.get(block.type)
    target = block.type if cell is None or cell.name == "TRIA7" else _RAISED[cell.family][full]
    if cell is None or CELLS[target].n_nodes <= cell.n_nodes:
        return block
    nodes = np.full((len(block.nodes), CELLS[target].n_nodes), -1, np.int64)
    nodes[:, : cell.n_nodes] = block.nodes
    return Block(target, nodes)


def _middles(mesh: Mesh, raised: list[Block]) -> NodeList:
    """Write the index of every node that cells lack into `raised`; the first cell that needs a node creates it."""
    # (block, column, corners (m, c) sorted, node (m,) that is there already or -1): nodes on edges, faces and in cells
    places = [
        (k, column, np.sort(block.nodes[:, corners], axis=1), block.nodes[:, column])
        for k, block in enumerate(raised)
        if block.type in CELLS
        for column, corners in enumerate(CELLS[block.type].corners_of_node)
        if column >= CELLS[block.type].n_corners
    ]
    new_nodes = NodeList(mesh.n_nodes)
    for width in sorted({corners.shape[1] for _, _, corners, _ in places}):  # edges, then faces, then cells
        alike = [place for place in places if place[2].shape[1] == width]
        labels, count = label_rows(np.vstack([corners for _, _, corners, _ in alike]))
        known = np.concatenate([node for *_, node in alike])
        nodes = np.full(count, -1, np.int64)
        nodes[labels[known >= 0]] = known[known >= 0]
        splits = np.cumsum([len(node) for *_, node in alike])[:-1]
        for (k, column, _, node), mine in zip(alike, np.split(labels, splits), strict=True):
            absent = np.flatnonzero(nodes[mine] < 0)
            rows = absent[np.sort(np.unique(mine[absent], return_index=True)[1])]
            if len(rows):
                target, sources = CELLS[raised[k].type], mesh.blocks[k].nodes[rows]
                at, on = np.array([target.reference[column]]), sources[:, target.corners_of_node[column]]
                nodes[mine[rows]] = new_nodes.add(mesh.blocks[k].type, sources, at, on)[:, 0]
            lacks = node < 0
            if lacks.any():
                raised[k].nodes[lacks, column] = nodes[mine[lacks]]
    return new_nodes


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
