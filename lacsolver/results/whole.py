"""Arrays of the whole model, in the order of its nodes and cells, from and for the shares of several processes.

One process alone has the unknowns of a state in this order, so that a run may go on with any number of processes. An
array goes through the first process piece after piece: none has the whole of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints
from lacsolver.constraints import Constraints
from lacsolver.distributed.share import Share
from lacsolver.equilibrium.motion import AT_NODES, WITH_POINTS, MotionState
from lacsolver.space.space import Space

#: number of places in the order of the model that a piece is from
PIECE = 1 << 18
#: paths in a `Restart` of the unknowns of the last two steps, and of the histories of blocks of cells
_UNKNOWNS, _MATERIALS = ("step.iterate.q", "step.earlier.1.q"), "step.histories.materials."


class Order:
    """Places in the whole model of rows that processes have: `key` (k,), the place of each, ascending.

    `own` (k,): True for rows that this process gives; each place is given by one process. `n`: number of all rows.
    """

    def __init__(self, share: Share, key: Ints, own: NDArray[np.bool_]) -> None:
        self._share, self._key, self._own = share, key, np.flatnonzero(own)
        self._end = int(share.largest(float(key.max(initial=-1)))) + 1
        self.n = int(share.total(np.array(len(self._own))))

    def pieces(self, values: NDArray) -> Iterator[NDArray]:
        """Yield the rows of the whole model from those (k, ...) of each process, on the first; others get empty ones.

        All processes go through all pieces.
        """
        key = self._key[self._own]
        for rows in self._ranges(key):
            order = np.argsort(self._share.collect(key[rows]), kind="stable")
            yield self._share.collect(values[self._own[rows]])[order]

    def deal(self, read: Callable[[int], NDArray]) -> NDArray:
        """Return the rows (k, ...) of this process; `read(n)` returns the next n of the model, on the first one."""
        share, parts = self._share, []
        for rows in self._ranges(self._key):
            asked = share.collect(self._key[rows])
            counts = share.gather(np.array([len(self._key[rows])]))
            places, inverse = np.unique(asked, return_inverse=True)
            given = read(len(places))[inverse] if share.rank == 0 else np.empty(0)
            parts.append(share.deal(given, counts))
        return np.concatenate(parts) if parts else np.empty(0)

    def _ranges(self, key: Ints) -> Iterator[slice]:
        """Yield the rows of this process in each piece."""
        for start in range(0, self._end, PIECE):
            yield slice(*np.searchsorted(key, (start, start + PIECE)).tolist())


def orders_of(constraints: Constraints, points: int = 0) -> Mapping[str, Order]:
    """Return the order of each array of a `Restart` that grows with the model, by its path; {} for a process alone.

    `points`: number of entries of a motion for the points of rigid bodies, which all processes have.
    """
    space = constraints.space
    if constraints.own is None:
        return {}
    assert space.share.own is not None and space.share.node is not None
    node = np.repeat(np.arange(space.mesh.n_nodes), space.dim)
    u = _at_nodes(space, node, np.repeat(space.share.own, space.dim))
    q = _at_nodes(space, constraints.node_of_unknown, constraints.own)  # with the motions of rigid bodies
    cells = [_of_cells(space, k) for k in range(len(space.blocks))]
    materials = {f"{_MATERIALS}{k}": order for k, order in enumerate(cells)}
    w = _at_nodes(space, node, np.append(np.repeat(space.share.own, space.dim), np.full(points, space.share.rank == 0)))
    motion = {_path_of(name): order for names, order in ((WITH_POINTS, w), (AT_NODES, u)) for name in names}
    return {"u": u, **dict.fromkeys(_UNKNOWNS, q), **materials, **motion}


def grows(path: str) -> bool:
    """True for the path of an array of a `Restart` that grows with the model."""
    return path in ("u", *_UNKNOWNS, *map(_path_of, (*WITH_POINTS, *AT_NODES))) or path.startswith(_MATERIALS)


def _path_of(name: str) -> str:
    """Return the path of an array of a motion in a `Restart`."""
    return f"step.histories.scheme.{MotionState._fields.index(name)}"


def _at_nodes(space: Space, node: Ints, own: NDArray[np.bool_]) -> Order:
    """Return the order of unknowns at nodes (k,) of this process, node by node; `own` (k + m,).

    The last m are no unknowns of nodes, and come last in the model, too; all processes have them.
    """
    assert space.share.node is not None
    which = np.arange(len(node)) - np.searchsorted(node, node)
    key = space.dim * space.share.node[node].astype(np.int64) + which
    end = space.dim * (int(space.share.largest(float(space.share.node.max(initial=-1)))) + 1)
    return Order(space.share, np.append(key, end + np.arange(len(own) - len(node))), own)


def _of_cells(space: Space, k: int) -> Order:
    """Return the order of the cells of a block."""
    block = space.blocks[k]
    assert space.share.cell is not None
    return Order(space.share, space.share.cell[block.cell], space.own_cells(block))
