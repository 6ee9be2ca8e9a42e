"""Values on nodes kept in slices: the process that has a node in its slice is its home, and is asked for its values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.faces import cells_of_dim
from lacsolver.distributed.collective import Collective, Routes


class Homes:
    """Homes of all nodes; this process is that of the nodes `start` to `stop`, the next one of those after them."""

    def __init__(self, together: Collective, start: int, stop: int) -> None:
        self.together, self._start, self._n = together, start, stop - start
        self._ends = together.gather(np.array([stop]))

    def routes(self, node: Ints) -> Routes:
        """Return the ways to the homes of some nodes, by their indices, ascending."""
        return Routes(self.together, np.diff(np.searchsorted(node, self._ends), prepend=0))

    def ask(self, node: Ints) -> Callable[[NDArray], NDArray]:
        """Return a function of the values at home (stop - start, ...) that returns those of some nodes, ascending."""
        routes = self.routes(node)
        asked = routes.there(node) - self._start
        return lambda values: routes.back(values[asked])

    def give(self, node: Ints, values: Ints) -> Ints:
        """Return the values (stop - start,) at home that all processes give to their nodes, ascending; -1 for none."""
        routes = self.routes(node)
        given = np.full(self._n, -1, values.dtype)
        given[routes.there(node) - self._start] = routes.there(values)
        return given


def join_bodies(mesh: Mesh, dim: int, node: Ints, own: NDArray[np.bool_], homes: Homes) -> tuple[Ints, int]:
    """Return the body (n_nodes,) of the whole mesh to which each node of a part belongs, and the number of bodies.

    `dim`: the highest dimension of the whole mesh's cells; `node`, `own` (n_nodes,): as in a Part. Bodies of the part
    are joined where an owner has a node in another one, and numbered by their first nodes, as by `label_bodies`.
    """
    together = homes.together
    label = label_bodies([nodes for _, nodes, _ in cells_of_dim(mesh, dim)], mesh.n_nodes)
    count = int(label.max(initial=-1)) + 1
    label[label >= 0] += together.before(count)
    n_labels = int(together.total(np.array(count)))
    of_owner = homes.ask(node)(homes.give(node[own], label[own]))
    joined = label_bodies([together.gather(_pairs(label, of_owner))], n_labels)
    first = np.full(int(joined.max(initial=-1)) + 1, np.iinfo(np.int64).max)
    ours = own & (label >= 0)
    np.minimum.at(first, joined[label[ours]], node[ours])
    first = -together.greatest(-first)
    number = np.argsort(np.argsort(first))
    return np.where(of_owner < 0, -1, number[joined[of_owner]] if len(number) else -1), len(number)


def _pairs(one: Ints, other: Ints) -> Ints:
    """Return the different pairs (k, 2) of labels of the nodes that have one in both."""
    both = (one >= 0) & (other >= 0)
    return np.unique(np.column_stack([one[both], other[both]]), axis=0)
