"""Values on nodes kept in slices: the process that has a node in its slice is its home, and is asked for its values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lacmesh.communicator import Communicator
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.faces import cells_of_dim


class Homes:
    """Homes of all nodes; this process is that of the nodes `start` to `stop`, the next one of those after them."""

    def __init__(self, comm: Communicator, start: int, stop: int) -> None:
        self.comm, self._start, self._n = comm, start, stop - start
        self._ends = comm.gather(np.array([stop]))

    def _counts(self, node: Ints) -> Ints:
        """Return how many of some nodes, ascending, are at home on each process, (size,)."""
        return np.diff(np.searchsorted(node, self._ends), prepend=0)

    def ask(self, node: Ints) -> Callable[[NDArray], NDArray]:
        """Return a function of the values at home (stop - start, ...) that returns those of some nodes, ascending."""
        own = self._counts(node)
        asked, counts = self.comm.exchange(node, own)
        return lambda values: self.comm.exchange(values[asked - self._start], counts, own)[0]

    def give(self, node: Ints, values: Ints) -> Ints:
        """Return the values (stop - start,) at home that all processes give to their nodes, ascending; -1 for none."""
        given = np.full(self._n, -1, values.dtype)
        index, counts = self.comm.exchange(node, self._counts(node))
        given[index - self._start] = self.comm.exchange(values, self._counts(node), counts)[0]
        return given


def join_bodies(mesh: Mesh, dim: int, node: Ints, own: NDArray[np.bool_], homes: Homes) -> tuple[Ints, int]:
    """Return the body (n_nodes,) of the whole mesh to which each node of a part belongs, and the number of bodies.

    `dim`: the highest dimension of the whole mesh's cells; `node`, `own` (n_nodes,): as in a Part. Bodies of the part
    are joined where an owner has a node in another one, and numbered by their first nodes, as by `label_bodies`.
    """
    comm = homes.comm
    label = label_bodies([nodes for _, nodes, _ in cells_of_dim(mesh, dim)], mesh.n_nodes)
    count = int(label.max(initial=-1)) + 1
    label[label >= 0] += comm.before(count)
    n_labels = int(comm.total(np.array(count)))
    of_owner = homes.ask(node)(homes.give(node[own], label[own]))
    joined = label_bodies([comm.gather(_pairs(label, of_owner))], n_labels)
    first = np.full(int(joined.max(initial=-1)) + 1, np.iinfo(np.int64).max)
    ours = own & (label >= 0)
    np.minimum.at(first, joined[label[ours]], node[ours])
    first = -comm.greatest(-first)
    number = np.argsort(np.argsort(first))
    return np.where(of_owner < 0, -1, number[joined[of_owner]] if len(number) else -1), len(number)


def _pairs(one: Ints, other: Ints) -> Ints:
    """Return the different pairs (k, 2) of labels of the nodes that have one in both."""
    both = (one >= 0) & (other >= 0)
    return np.unique(np.column_stack([one[both], other[both]]), axis=0)
