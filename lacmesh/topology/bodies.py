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
from lacmesh.origin import told

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
    parent = np.arange(n)
    _join(np.column_stack([i, j]).astype(np.int64, copy=False), parent)
    return np.asarray(_number(parent))


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
    solid, skin = _bodies_of_cells(mesh, of_node, own)
    node = of_node if own is None else np.where(own, of_node, -1)
    names, among = _by_cells(mesh.cell_groups, solid, n, total)
    if n == 1 or all(names):
        return [name or "the body" for name in names]
    on = _alone_on(mesh.node_groups, node, n, total) | _alone_on(mesh.cell_groups, skin, n, total)
    of = [f"the body of {name!r}" if name else "the body" for name in among]
    names = [name or (f"{of[k]} with {on[k]!r}" if k in on else "") for k, name in enumerate(names)]
    often = Counter(names)
    if all(name and often[name] == 1 for name in names):
        return names
    boxes = _boxes(mesh, node, n, largest)
    return [
        name if name and often[name] == 1 else f"{name or of[k]} {box}"
        for k, (name, box) in enumerate(zip(names, boxes, strict=True))
    ]


def _bodies_of_cells(mesh: Mesh, of_node: Ints, own: Array | None) -> tuple[Ints, Ints]:
    """Return the body (n_cells,) of each cell of the mesh's dimension, and that of each other; -1 for none."""
    body = np.full(mesh.n_cells, -1)
    for _, cells, nodes in mesh.select(np.arange(mesh.n_cells)):
        first = nodes[:, 0]
        body[cells] = of_node[first] if own is None else np.where(own[first], of_node[first], -1)
    full = mesh.cell_dim == mesh.dim
    return np.where(full, body, -1), np.where(full, -1, body)


def _counts(groups: Mapping[str, Ints], body: Ints, n: int, total: OverAll) -> Iterator[tuple[str, Ints, Ints]]:
    """Yield each group, the bodies (k,) that its items belong to, and the number (n,) of its items of each body."""
    for name, items in groups.items():
        at = body[items]
        count = total(np.bincount(at[at >= 0], minlength=n))
        yield name, np.flatnonzero(count), count


def _by_cells(groups: Mapping[str, Ints], solid: Ints, n: int, total: OverAll) -> tuple[list[str], list[str]]:
    """Return the names that groups of cells give the bodies, and the smallest group that has all cells of each.

    Both are empty where there is none.
    """
    whole = total(np.bincount(solid[solid >= 0], minlength=n))
    names, among = [""] * n, [""] * n
    least, size = (np.full(n, np.iinfo(np.int64).max) for _ in range(2))
    parts: dict[int, list[tuple[int, str]]] = {}
    for name, there, count in _counts(groups, solid, n, total):
        length = int(total(np.array([len(groups[name])]))[0])
        for k in there[(count[there] == whole[there]) & (length < size[there])].tolist():
            among[k], size[k] = name, length
        if len(there) == 1:
            k = int(there[0])
            parts.setdefault(k, []).append((int(count[k]), name))
            if count[k] == whole[k] and length < least[k]:
                names[k], least[k] = repr(name), length
    for k, own in parts.items():
        names[k] = names[k] or f"the body of {_most(own, int(whole[k]))}"
    return names, among


def _most(parts: list[tuple[int, str]], whole: int) -> str:
    """Return the largest groups, as many as have all cells of a body, if these are few."""
    parts = sorted(parts, key=lambda part: -part[0])
    enough = int(np.searchsorted(np.cumsum([count for count, _ in parts]), whole)) + 1
    return listed([repr(name) for _, name in parts[: min(enough, _SHOWN)]], "and")


def _alone_on(groups: Mapping[str, Ints], body: Ints, n: int, total: OverAll) -> dict[int, str]:
    """Return, for each body, the largest group whose items belong to it alone."""
    name_of: dict[int, str] = {}
    size = np.zeros(n, np.int64)
    for name, there, count in _counts(groups, body, n, total):
        if len(there) == 1 and count[there[0]] > size[there[0]]:
            name_of[int(there[0])], size[there[0]] = name, count[there[0]]
    return name_of


def _boxes(mesh: Mesh, node: Ints, n: int, largest: OverAll) -> Iterator[str]:
    """Yield the bounding box of each body in words."""
    ends = np.full((2, n, 3), -np.inf)
    there = node >= 0
    for end, x in zip(ends, (-mesh.points[there], mesh.points[there]), strict=True):
        np.maximum.at(end, node[there], x)
    low, high = -(both := largest(ends))[0], both[1]
    size = float((high.max(axis=0) - low.min(axis=0)).max())
    for corners in zip(low, high, strict=True):
        a, b = (", ".join(told(corner[: mesh.space_dim], size)) for corner in corners)
        yield f"between ({a}) and ({b})"
