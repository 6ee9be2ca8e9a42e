"""Share of one process in a model that several processes hold together, and how a mesh is divided among them.

A process has its `own` nodes, all cells that touch them, and the skins of contact with the cells that touch them.
Forces, and rows of matrices, are complete at own nodes only; displacements are known at all nodes of the share, those
of other processes by `update`. Contact is the same on every process. A process that has the whole model is `ALONE`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh.communicator import Communicator
from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: groups to cut in a mesh, and the options of their cut
Slaves = Callable[[Mesh], tuple[list[str], dict[str, Any]]]


class Share(Communicator):
    """The share of a process that has the whole model; `processes.ProcessShare` is that of one of several.

    `own` (n_nodes,): True for its own nodes, None if all are. What follows is None for the whole model: `number`
    (n_nodes,), which counts the nodes through one process after the other; `node` (n_nodes,) and `cell` (n_cells,), the
    indices in the whole model; `common` (n_nodes,): True for nodes of contact skins and of equations, which all
    processes have; `origin` (3,) of the coordinates of the whole model, and `body` (n_nodes,), the connected body of
    each node in it.
    """

    own: NDArray[np.bool_] | None = None
    number: Ints | None = None
    node: Ints | None = None
    cell: Ints | None = None
    common: NDArray[np.bool_] | None = None
    origin: Floats | None = None
    body: Ints | None = None

    def update(self, x: Floats) -> NDArray[np.floating]:
        """Return x (n_nodes, k) with the values at other nodes that their own processes have."""
        return x

    def add_matrices(self, A: csr_array, nodal: tuple[bool, bool]) -> csr_array:
        """Return the sum over all processes of matrices of one size, each entry of which one process has.

        `nodal`: True for rows, and for columns, that are unknowns at nodes of this process's mesh; all processes have
        those nodes. Others mean the same on all.
        """
        return A


#: the share of a process that has the whole model
ALONE = Share()


class Distribution:
    """Division of a model among processes: here none; `processes.Processes` divides it.

    `divided`: True once a mesh was read of which each process has its part.
    """

    divided = False

    def read(self, path: Path, skins: Sequence[str], slaves: Slaves, whole: bool = False) -> Mesh:
        """Return the mesh of a file, or a part of one that has been divided, with its slaves cut.

        `skins`: groups that all processes need; `slaves`: those to cut, and how.
        `whole`: True if every process needs the whole mesh of a file first. Raises ReadError, and RequestError for a
        mesh that is divided otherwise.
        """
        if path.is_dir():
            raise RequestError(f"{path} is a folder; if it has parts of a mesh, start as many processes: mpiexec -n N")
        return lacmesh.read(path)

    def as_read(self, mesh: Mesh) -> tuple[Mesh, Share]:
        """Return a mesh of `read` before its cut, and its share in the mesh of the file."""
        return mesh, ALONE

    def take(self, mesh: Mesh, skins: Sequence[str], sets: Ints | None = None) -> tuple[Mesh, Share]:
        """Return the part of a mesh that this process takes, and its share; all processes have the groups `skins`.

        `sets` (n_nodes,): a number for nodes that all processes have, -1 for others; nodes of one number are those of
        one process. Raises RequestError where a process would be left without nodes.
        """
        return mesh, ALONE


#: a model that is not divided
UNDIVIDED = Distribution()
