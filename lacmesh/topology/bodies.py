"""Connected components of a graph, the bodies of a mesh (cells that share nodes), and names of bodies in messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import listed
from lacmesh.kernels import kernel
from lacmesh.mesh import Ints, Mesh
from lacmesh.origin import format_coordinates

Array = NDArray[Any]
#: a sum, or the largest values, over all processes
OverAll = Callable[[Array], Array]
#: numbers below which components are found as the code stands, in milliseconds: to load numba takes longer
_SMALL = 8_000
#: at most so many groups name one body
_SHOWN = 3


def label_bodies(cells: Iterable[Ints], n_nodes: int) -> Ints:
    """(n_nodes,): the body of each node, numbered from 0 by their first nodes; -1 for nodes of no cell.

    `cells`: parts (k, n), the nodes of cells, padded with -1. Compiled: several times faster than scipy.

    >>> label_bodies([np.array([[0, 4], [1, 3]]), np.array([[4, 5, -1]])], 6)
    array([ 0,  1, -1,  1,  0,  0])
    """
    parent = np.full(n_nodes, -1, np.int64)
    for nodes in cells:
        _join(nodes, parent)
    return np.asarray(_number(parent))


def label_components(i: Ints, j: Ints, n: int) -> Ints:
    """(n,): the connected component of each of n nodes, joined by edges from i (e,) to j (e,); numbered by first nodes.

    >>> label_components(np.array([0, 3]), np.array([2, 1]), 5)
    array([0, 1, 0, 1, 2])
    """
    first = np.arange(n)
    while not np.array_equal(a := first[i], b := first[j]):
        np.minimum.at(first, np.maximum(a, b), np.minimum(a, b))  # the first node of each component
        while not np.array_equal(up := first[first], first):
            first = up
    return np.unique(first, return_inverse=True)[1]


@kernel
def _top(parent: Array, node: int) -> int:
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@kernel(least=_SMALL)
def _join(cells: Array, parent: Array) -> None:
    """Join the nodes of each cell in a forest: `parent` (n_nodes,), -1 for nodes of no cell so far."""
    for cell in range(len(cells)):
        first = cells[cell, 0]
        if parent[first] < 0:
            parent[first] = first
        a = _top(parent, first)
        for k in range(1, cells.shape[1]):
            node = cells[cell, k]
            if node < 0:
                break
            if parent[node] < 0:
                parent[node] = a
                continue
            b = _top(parent, node)
            if b < a:
                parent[a] = b
                a = b
            else:
                parent[b] = a


@kernel(least=_SMALL)
def _number(parent: Array) -> Array:
    """(n_nodes,): the trees of a forest, numbered by their first nodes."""
    body = np.full(len(parent), -1, np.int64)
    count = 0
    for node in range(len(parent)):
        if parent[node] < 0:
            continue
        root = _top(parent, node)
        if body[root] < 0:
            body[root] = count
            count += 1
        body[node] = body[root]
    return body


# ---- names


def body_names(
    mesh: Mesh,
    of_node: Ints,
    n: int,
    *,
    own: Array | None = None,
    total: OverAll = np.asarray,
    largest: OverAll = np.asarray,
) -> list[str]:
    """Return a name for each of n bodies, for a sentence: `'punch'`, `the body of 'core' and 'shell'`.

    It is the smallest group that has all cells of the body and no other body's; else groups that have cells of this
    body alone; else the smallest group with all its cells, with the largest group of faces or nodes on it alone. Where
    no group tells a body from the others, its bounding box does, never the number of a node. `of_node`
    (n_nodes,): body of each node, -1 for none, as of `label_bodies`.

    For a mesh of which each process has a part: `own` (n_nodes,), True for nodes that count for this process; `total`
    and `largest` return the sum and the largest values of an array over all processes.

    >>> cells = [("QUAD4", [[0, 1, 2, 3], [4, 5, 6, 7]]), ("SEG2", [[4, 5]])]
    >>> points = [[x + k, y] for k in (0, 3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    >>> mesh = Mesh.create(points, cells, cell_groups={"left": [0], "all": [0, 1], "foot": [2]})
    >>> body_names(mesh, np.repeat([0, 1], 4), 2)
    ["'left'", "the body of 'all' with 'foot'"]
    """
    node = of_node if own is None else np.where(own, of_node, -1)
    of_cell = np.full(mesh.n_cells, -1)
    for _, cells, nodes in mesh.select(np.arange(mesh.n_cells)):
        of_cell[cells] = node[nodes[:, 0]]
    full = mesh.cell_dim == mesh.dim
    solid, skin = np.where(full, of_cell, -1), np.where(full, -1, of_cell)

    def counts(groups: Mapping[str, Ints], body: Ints) -> tuple[Ints, Ints]:
        """(groups, n): the number of items of each body in each group; (groups,): the sizes of the groups."""
        rows = [[*np.bincount(body[items][body[items] >= 0], minlength=n), len(items)] for items in groups.values()]
        table = total(np.array(rows, np.int64).reshape(len(groups), n + 1))
        return table[:, :-1], table[:, -1]

    whole = total(np.bincount(solid[solid >= 0], minlength=n))
    count, size = counts(mesh.cell_groups, solid)
    by_cells = [_by_cells(list(mesh.cell_groups), count, size, k, int(whole[k])) for k in range(n)]
    names = [name for name, _ in by_cells]
    if n == 1 or all(names):
        return [name or "the body" for name in names]
    on: dict[int, str] = {}  # the largest group whose items belong to the body alone
    for groups, body in ((mesh.node_groups, node), (mesh.cell_groups, skin)):
        count, _ = counts(groups, body)
        alone = np.where(((count > 0).sum(axis=1) == 1)[:, None], count, 0)
        on |= {k: list(groups)[alone[:, k].argmax()] for k in range(n) if alone[:, k].any()}
    of = [f"the body of {group!r}" if group else "the body" for _, group in by_cells]
    names = [name or (f"{of[k]} with {on[k]!r}" if k in on else "") for k, name in enumerate(names)]
    often = Counter(names)
    if all(name and often[name] == 1 for name in names):
        return names
    boxes = _boxes(mesh, node, n, largest)
    return [
        name if name and often[name] == 1 else f"{name or of[k]} {box}"
        for k, (name, box) in enumerate(zip(names, boxes, strict=True))
    ]


def _by_cells(groups: list[str], count: Ints, size: Ints, k: int, whole: int) -> tuple[str, str]:
    """Return the name that groups of cells give body k of `whole` cells, and the smallest group that has all its cells.

    Both are empty where there is none. `count` (groups, n): cells of each body; `size` (groups,): those of all.
    """
    with_all = np.flatnonzero((count[:, k] == whole) & (count[:, k] > 0))
    alone = (count > 0).sum(axis=1) == 1
    around = groups[with_all[size[with_all].argmin()]] if len(with_all) else ""
    itself = with_all[alone[with_all]]
    if len(itself):
        return repr(groups[itself[size[itself].argmin()]]), around
    parts = np.flatnonzero(alone & (count[:, k] > 0))
    if not len(parts):
        return "", around
    parts = parts[np.argsort(-count[parts, k], kind="stable")]
    enough = int(np.searchsorted(np.cumsum(count[parts, k]), whole)) + 1
    return f"the body of {listed([repr(groups[p]) for p in parts[: min(enough, _SHOWN)]], 'and')}", around


def _boxes(mesh: Mesh, node: Ints, n: int, largest: OverAll) -> Iterator[str]:
    """Yield the bounding box of each body in words."""
    ends = np.full((2, n, 3), -np.inf)
    there = node >= 0
    for end, x in zip(ends, (-mesh.points[there], mesh.points[there]), strict=True):
        np.maximum.at(end, node[there], x)
    low, high = -(both := largest(ends))[0], both[1]
    size = float((high.max(axis=0) - low.min(axis=0)).max())
    for corners in zip(low, high, strict=True):
        a, b = (", ".join(format_coordinates(corner[: mesh.space_dim], size)) for corner in corners)
        yield f"between ({a}) and ({b})"
