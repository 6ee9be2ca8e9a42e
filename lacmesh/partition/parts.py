"""Parts of a mesh for several processes: the owner of each node, the cells that a process needs, and their cut.

Nodes are distributed by recursive bisection of the coordinates, or by METIS on the graph of nodes. Bisection divides
each box of nodes across its longest side, in the ratio of the processes on both sides. Berger and Bokhari, IEEE Trans.
Comput. C-36 (1987) 570-580. Coordinates are compared on a lattice that divides the longest side of the box in 2^20, so
that nodes in one plane of the model are in one plane here, wherever it lies and in whatever units. METIS cuts few edges
of the graph. Karypis and Kumar, SIAM J. Sci. Comput. 20 (1998) 359-392. It needs pymetis.

Each process cuts its own part, and the parts together are those of the whole cut. A cut changes the slave faces, the
cells on them and the cells behind them, and nothing else. Where the slave groups are in every part (`Part.everywhere`),
as the pairing of slave and master needs it anyway, each process cuts all of them: it knows every new node and every
child in the order of the whole cut, and computes their indices and numbers without communication. What the variant of a
hexahedron depends on, which spreads from face to face, is known to it too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.cut import cut_skin
from lacmesh.errors import DataError, RequestError
from lacmesh.joining import restrict
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, mask_of, spec_list
from lacmesh.origin import bounds_of, bounds_of_mesh, origin_of
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.skin import cells_of_dim

Bools = NDArray[np.bool_]

#: bits of the planes of the lattice along the longest side of a box
_BITS = 20
#: two sides whose lengths differ by less are of one length, relative to the longer one
_EQUAL = 1e-6


def distribute_nodes(mesh: Mesh, n: int) -> Ints:
    """Return the rank (n_nodes,), 0 to n - 1, that owns each node, so that all ranks own about as many nodes.

    All nodes are distributed together, whatever body they belong to, and those of no cell too; the result does not
    depend on the position or the units of the model. Nodes at one place are taken in the order of the mesh. Raises
    RequestError if there are fewer nodes than ranks, DataError for coordinates that are not finite.

    >>> row = Mesh.create([[0, 0], [4, 0], [1, 0], [3, 0], [2, 0]], [("POI1", [[0]])])
    >>> distribute_nodes(row, 2)
    array([0, 1, 0, 1, 1], dtype=int32)
    """
    _check_count(mesh, n)
    with np.errstate(over="ignore", invalid="ignore"):
        finite = np.isfinite(np.ptp(mesh.points, axis=0)).all() if mesh.n_nodes else True
    if not finite:
        node = mesh.node_number[np.nan_to_num(np.abs(mesh.points), nan=np.inf).max(axis=1).argmax()]
        raise DataError(f"node {node} has a coordinate that is not finite, or is huge; repair or remove it")
    return bisect(np.ascontiguousarray(mesh.points.T), n)


def _check_count(mesh: Mesh, n: int) -> None:
    if not 1 <= n <= max(mesh.n_nodes, 1):
        raise RequestError(f"a mesh of {mesh.n_nodes:,} nodes has from 1 to {mesh.n_nodes:,} parts, not {n:,}")


def bisect(x: Floats, n: int) -> Ints:
    """Return the box (k,), 0 to n - 1, that each of the points x (3, k) belongs to."""
    box = np.zeros(x.shape[1], np.int32)
    left = [(np.arange(x.shape[1]), x, 0, n)]
    while left:
        nodes, x, first, count = left.pop()
        if count == 1:
            box[nodes] = first
            continue
        low = count // 2
        lower = _lower_points(x, len(nodes) * low // count)
        left.append((nodes[lower], np.compress(lower, x, axis=1), first, low))
        left.append((nodes[~lower], np.compress(~lower, x, axis=1), first + low, count - low))
    return box


def _lower_points(x: Floats, size: int) -> NDArray[np.bool_]:
    """Return a mask (k,) of the first `size` (>= 1) of the points x (3, k) along the longest side of their box.

    Of points in one plane across it the other coordinates decide, of points at one place their order.
    """
    corner = x.min(axis=1)
    sides = x.max(axis=1) - corner
    longest = sides.max()
    axis = int(np.argmax(sides >= (1 - _EQUAL) * longest))
    key = np.zeros(x.shape[1], np.int64)
    for k in (axis, (axis + 1) % 3, (axis + 2) % 3):
        key <<= _BITS + 1
        key += np.rint((x[k] - corner[k]) / (longest or 1.0) * 2**_BITS).astype(np.int64)
    last = np.partition(key, size - 1)[size - 1]
    lower = key < last
    lower[np.flatnonzero(key == last)[: size - np.count_nonzero(lower)]] = True
    return lower


def distribute_by_metis(mesh: Mesh, n: int) -> Ints:
    """Return the rank (n_nodes,), 0 to n - 1, that owns each node, by METIS.

    Raises RequestError if pymetis is not installed or there are fewer nodes than ranks, DataError if METIS leaves a
    rank without nodes.
    """
    try:
        import pymetis
    except ImportError:
        raise RequestError("the method metis needs pymetis: pip install 'lacmesh[metis]'") from None
    from scipy.sparse import coo_array

    _check_count(mesh, n)
    cells = list(cells_of_dim(mesh, mesh.dim))
    node = np.concatenate([np.empty(0, np.int64), *(nodes.ravel() for _, nodes, _ in cells)])
    cell = np.concatenate([np.empty(0, np.int64), *(np.repeat(index, nodes.shape[1]) for _, nodes, index in cells)])
    member = coo_array((np.ones(len(node), np.int32), (cell, node)), shape=(mesh.n_cells, mesh.n_nodes)).tocsr()
    graph = (member.T @ member).tocsr()  # nodes that share a cell of the highest dimension
    graph.setdiag(0)
    graph.eliminate_zeros()
    owner = np.asarray(pymetis.part_graph(n, xadj=graph.indptr, adjncy=graph.indices)[1], np.int32)
    count = np.bincount(owner, minlength=n)
    if not count.all():
        raise DataError(f"METIS leaves {np.count_nonzero(count == 0)} of {n} parts without nodes; ask for fewer parts")
    return owner


@dataclass(frozen=True, eq=False)
class Part:
    """The part of a mesh that process `rank` of `n_ranks` needs.

    `mesh`: the cells that touch a node of this process, those of the groups `everywhere`, and the nodes that all
    processes need, with the cells that have no others; nodes and cells are in the order of the whole mesh, so that sums
    over the cells at a node have the terms of the whole mesh in the same order. It has all groups, numbers, data and
    records of a cut of the whole mesh, as far as they are on its nodes and cells. `node` (k,), `cell` (c,): the indices
    of its nodes and cells in the whole mesh, ascending. `owner` (k,): the rank that owns each node. `body` (k,): the
    connected body of the whole mesh, of the cells of its highest dimension, to which each node belongs, numbered by
    `topology.bodies.label_bodies`; -1 for none.

    The rest are figures of the whole mesh. `types`: each type of cells, in the order of the blocks, with the number of
    its cells. `dim`: the highest dimension of a cell. `largest_node`, `largest_cell`: the largest of the file's
    numbers. `used` (2, 3), `box` (2, 3): lower and upper corner of the box of the nodes of all cells, and of those of
    the highest dimension.
    """

    mesh: Mesh
    rank: int
    n_ranks: int
    node: Ints
    owner: Ints
    cell: Ints
    body: Ints
    everywhere: tuple[str, ...]
    n_nodes: int
    types: tuple[tuple[str, int], ...]
    dim: int
    n_bodies: int
    largest_node: int
    largest_cell: int
    used: NDArray[np.floating]
    box: NDArray[np.floating]

    @property
    def own(self) -> Bools:
        """(k,): True for the nodes that this process owns."""
        return np.asarray(self.owner == self.rank)

    @property
    def n_cells(self) -> int:
        """Number of cells of the whole mesh."""
        return sum(count for _, count in self.types)

    @cached_property
    def origin(self) -> NDArray[np.floating]:
        """(3,): the origin of the coordinates of the whole mesh, as by `origin_of_mesh`."""
        return origin_of(self.used)


def part_of(mesh: Mesh, owner: Ints, rank: int, *, everywhere: Sequence[str] = (), nodes: Bools | None = None) -> Part:
    """Return the part of a mesh that process `rank` needs.

    `owner` (n_nodes,): the rank that owns each node, as by `distribute_nodes`. `everywhere`: groups of skin faces, such
    as slaves and masters, that are in every part, with all cells that touch them. `nodes` (n_nodes,): a mask of nodes
    that are in every part, with the cells all of whose nodes are among them. Raises GroupNotFoundError, and
    RequestError.

    >>> row = Mesh.create([[0, 0], [1, 0], [2, 0], [3, 0]], [("SEG2", [[0, 1], [1, 2], [2, 3]])])
    >>> part = part_of(row, np.array([0, 0, 1, 1]), 1)
    >>> part.node.tolist(), part.cell.tolist(), part.own.tolist()
    ([1, 2, 3], [1, 2], [False, True, True])
    """
    owner = np.asarray(owner)
    n_ranks = int(owner.max(initial=0)) + 1
    if owner.shape != (mesh.n_nodes,) or not 0 <= rank < n_ranks:
        raise ValueError(f"no rank {rank} of {n_ranks} owns nodes of a mesh of {mesh.n_nodes} nodes")
    node, cell = needed(mesh, owner == rank, everywhere, nodes)
    body = bodies_of(mesh)
    return Part(
        mesh=restrict(mesh, node, cell),
        rank=rank,
        n_ranks=n_ranks,
        node=node,
        owner=owner[node],
        cell=cell,
        body=body[node],
        everywhere=tuple(skin_name(mesh, name) for name in everywhere),
        **figures_of(mesh, body),
    )


def bodies_of(mesh: Mesh) -> Ints:
    """Return the connected body (n_nodes,) of each node, of the cells of the highest dimension; -1 for none."""
    return label_bodies([nodes for _, nodes, _ in cells_of_dim(mesh, mesh.dim)], mesh.n_nodes)


def figures_of(mesh: Mesh, body: Ints) -> dict[str, Any]:
    """Return the figures of a whole mesh that each `Part` has; `body` (n_nodes,): the result of `bodies_of`."""
    return {
        "n_nodes": mesh.n_nodes,
        "types": tuple((block.type, len(block.nodes)) for block in mesh.blocks),
        "dim": mesh.dim,
        "n_bodies": int(body.max(initial=-1)) + 1,
        "largest_node": int(mesh.node_number.max(initial=0)),
        "largest_cell": int(mesh.cell_number.max(initial=0)),
        "used": bounds_of_mesh(mesh),
        "box": bounds_of(mesh.points[body >= 0]),
    }


def needed(mesh: Mesh, own: Bools, everywhere: Sequence[str] = (), nodes: Bools | None = None) -> tuple[Ints, Ints]:
    """Return the nodes and the cells, ascending, that a process needs: see `Part`; `own` (n_nodes,): its own nodes.

    `nodes` (n_nodes,): nodes that all processes need.
    """
    cells = _touching(mesh, own)
    for name in everywhere:
        cells |= cells_of_skin(mesh, name)
    if nodes is not None:
        own = own | nodes
        cells |= ~_touching(mesh, ~nodes)
    index = np.flatnonzero(cells)
    return np.flatnonzero(mask_of(mesh.n_nodes, mesh.nodes_on(index), own)), index


def _touching(mesh: Mesh, nodes: Bools) -> Bools:
    """Return a mask (n_cells,) of the cells with at least one of the nodes of a mask (n_nodes,)."""
    touched = np.zeros(mesh.n_cells, bool)
    for k, block in enumerate(mesh.blocks):
        of_block = touched[mesh.offsets[k] : mesh.offsets[k + 1]]
        for column in block.nodes.T:
            of_block |= nodes[column]
    return touched


def cells_of_skin(mesh: Mesh, name: str) -> Bools:
    """Return a mask (n_cells,) of the cells of a group of skin faces, and of all cells that touch one of their nodes.

    Where a cut has made such a cell, the other children of the same parent are there, too. Raises GroupNotFoundError,
    and RequestError for a group that has cells of the highest dimension.
    """
    faces = mesh.cells_of(name)
    if (mesh.cell_dim[faces] == mesh.dim).any():
        raise RequestError(f"group {name!r} holds cells of dimension {mesh.dim}; name a group of faces")
    cells = _touching(mesh, mask_of(mesh.n_nodes, mesh.nodes_on(faces)))
    parent = mesh.cell_data.get("lac_parent")
    if parent is not None:
        cells |= (parent >= 0) & np.isin(parent, parent[cells])
    return cells


def skin_name(mesh: Mesh, spec: str) -> str:
    """Return the name of the group that `spec` denotes (`Mesh.group`), or `spec` if it is an entity of msh.

    Raises GroupNotFoundError.
    """
    return spec if spec.startswith("entity:") and spec not in mesh.cell_groups else mesh.group(spec)


def cut_part(part: Part, slave: str | Sequence[str], **options: Any) -> Part:
    """Cut the slave groups in a part of a mesh; return the part of the mesh that `cut_skin` makes of the whole mesh.

    `slave` and the options `hexa`, `macro`, `crease_angle` and `dirichlet` are as for `cut_skin`. A new node
    belongs to the owner of the first node of the face or cell that it was put into (`Origin`). A part of a cut mesh
    is returned unchanged; an earlier cut without records is not recognised. Raises RequestError for a slave group
    that is not in every part, and what `cut_skin` raises, on every process alike.
    """
    specs = spec_list(slave)
    missing = [spec for spec in specs if skin_name(part.mesh, spec) not in part.everywhere]
    if missing:
        raise RequestError(f"slave {missing[0]!r} is not in every part; read the parts with everywhere={specs}")
    if part.mesh.zones:
        cut_skin(part.mesh, specs)
        return part
    cut = cut_skin(part.mesh, specs, recognise=False, **options)
    old, origin = part.mesh, cut.origin
    assert origin is not None
    more = cut.mesh.points[old.n_nodes :]
    nodes = np.concatenate([part.node, part.n_nodes + np.arange(len(more))])
    cells, types = _cells_of_whole(part, cut.mesh, mask_of(old.n_cells, origin.cell[origin.children]))
    owner, body = part.owner[origin.node], part.body[origin.node]
    new = _numbered(part, cut.mesh)
    node, cell = needed(new, owner == part.rank, part.everywhere)
    return replace(
        part,
        mesh=restrict(new, node, cell),
        node=nodes[node],
        owner=owner[node],
        cell=cells[cell],
        body=body[node],
        n_nodes=part.n_nodes + len(more),
        types=types,
        largest_node=max(part.largest_node, int(new.node_number.max(initial=0))),
        largest_cell=max(part.largest_cell, int(new.cell_number.max(initial=0))),
        used=bounds_of(np.vstack([part.used, more])),
        box=bounds_of(np.vstack([part.box, more])),
    )


def _cells_of_whole(part: Part, new: Mesh, removed: Bools) -> tuple[Ints, tuple[tuple[str, int], ...]]:
    """Return the index of each cell of `new` in the whole cut mesh, and the types of that with their numbers of cells.

    A block has the cells that stay, in their old order, and then the children, all of which are in the part.
    `removed` (c,): cells of the part that children replace.
    """
    old, indices, types, start, before = part.mesh, [], [], 0, 0
    for k, block in enumerate(new.blocks):
        rows, count = (slice(*old.offsets[k : k + 2]), part.types[k][1]) if k < len(old.blocks) else (slice(0), 0)
        cells, out = part.cell[rows], removed[rows]
        stay = cells[~out] - before - np.searchsorted(cells[out], cells[~out])
        n_stay, n_children = count - int(out.sum()), len(block.nodes) - len(stay)
        indices += [start + stay, start + n_stay + np.arange(n_children)]
        types.append((block.type, n_stay + n_children))
        start, before = start + n_stay + n_children, before + count
    return concatenated(indices), tuple(types)


def _numbered(part: Part, new: Mesh) -> Mesh:
    """Return the cut mesh with the numbers of the whole cut: those of new nodes and cells follow its largest ones."""
    added = new.n_nodes - part.mesh.n_nodes
    nodes = part.largest_node + 1 + np.arange(added)
    largest = int(part.mesh.cell_number.max(initial=0))
    cells = new.cell_number.astype(np.int64)
    cells[cells > largest] += part.largest_cell - largest
    return replace(new, node_number=np.concatenate([part.mesh.node_number, nodes]), cell_number=cells)
