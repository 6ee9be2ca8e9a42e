"""Share of one process in a model that several processes hold together, and the sums that they agree on.

A process has its `own` nodes, all cells that touch them, and the skins of contact with the cells that touch them.
Forces, and rows of matrices, are complete at own nodes only; displacements are known at all nodes of the share, those
of other processes by `update`. Contact is the same on every process. A process that has the whole model is `ALONE`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

import lacmesh
from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacsolver.case.mesh_digest import MeshPart

T = TypeVar("T")


class Distribution(Protocol):
    """Interface of what divides a model among processes."""

    def read(self, path: Path, skins: Sequence[str], slaves: Callable[[Mesh], Mapping[str, str]]) -> Mesh:
        """Return the mesh of a file, or a part of one, that has been divided, with its slaves cut.

        `skins`: groups that all processes need; `slaves`: the groups to cut in a mesh, each with its kind of `hexa`.
        """

    def as_read(self, mesh: Mesh) -> tuple[Mesh, MeshPart | None]:
        """Return a mesh of `read` before its cut, and which part it is of the mesh in the file; None for the whole."""

    def take(self, mesh: Mesh, skins: Sequence[str]) -> tuple[Mesh, Share]:
        """Return the part of a mesh that this process takes, and its share; all processes have the groups `skins`."""


class Share(Protocol):
    """Interface of the share of a process.

    `own` (n_nodes,): True for its own nodes, None if all are; `origin` (3,) of the coordinates of the whole model and
    `body` (n_nodes,), the connected body of each node in it, None if the share is the whole. All processes call each
    method at the same time.
    """

    @property
    def rank(self) -> int:
        """Number of the process, from 0."""

    @property
    def n(self) -> int:
        """Number of processes."""

    @property
    def comm(self) -> Any:
        """The communicator of the processes; None for one alone."""

    @property
    def number(self) -> Ints | None:
        """Number (n_nodes,) of each node, counted through one process after the other; None for one alone."""

    @property
    def own(self) -> NDArray[np.bool_] | None:
        """Mask (n_nodes,) of own nodes; None if all are."""

    @property
    def origin(self) -> Floats | None:
        """Origin (3,) of the coordinates; None for that of the mesh."""

    @property
    def node(self) -> Ints | None:
        """Index (n_nodes,) in the whole model of each node; None if the share is the whole."""

    @property
    def cell(self) -> Ints | None:
        """Index (n_cells,) in the whole model of each cell; None if the share is the whole."""

    @property
    def common(self) -> NDArray[np.bool_] | None:
        """Mask (n_nodes,) of the nodes of contact skins, which all processes have; None for one alone."""

    @property
    def body(self) -> Ints | None:
        """Connected body (n_nodes,) of each node; None for those of the mesh."""

    def update(self, x: Floats) -> NDArray[np.floating]:
        """Return x (n_nodes, k) with the values at other nodes that their own processes have."""

    def total(self, x: Floats) -> NDArray[np.floating]:
        """Return the sum of an array over all processes."""

    def largest(self, x: float) -> float:
        """Return the largest value of all processes."""

    def gather(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other."""

    def same(self, x: NDArray) -> NDArray:
        """Return the array that the first process has."""

    def collect(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other, on the first process; on others what is empty."""

    def deal(self, x: NDArray, counts: Ints) -> NDArray:
        """Return this process's part of an array that the first process has, of which each takes as many rows."""

    def gather_rows(self, A: csr_array) -> csr_array:
        """Return the rows of all processes, one process after the other; columns mean the same on all."""

    def add_matrices(self, A: csr_array, nodal: tuple[bool, bool]) -> csr_array:
        """Return the sum over all processes of matrices of one size, each entry of which one process has.

        `nodal`: True for rows, and for columns, that are unknowns at nodes of this process's mesh; all processes have
        those nodes. Others mean the same on all.
        """

    def texts(self, own: Sequence[str]) -> tuple[str, ...]:
        """Return the different texts of all processes, those of the first one first."""

    def agree(self, error: Exception | None) -> None:
        """Raise the error of the first process that has one, on all of them."""

    def on_first(self, work: Callable[[], T]) -> T | None:
        """Do something on the first process alone, and return its result there; raise its error on all of them."""


class Alone:
    """The share of a process that has the whole model.

    >>> ALONE.total(np.ones(2)), ALONE.largest(3.0)
    (array([1., 1.]), 3.0)
    """

    rank, n = 0, 1
    comm = number = common = own = origin = node = cell = body = None

    def read(self, path: Path, skins: Sequence[str], slaves: Callable[[Mesh], Mapping[str, str]]) -> Mesh:
        """Return the mesh of a file. Raises ReadError, and RequestError for a mesh that is divided."""
        if path.is_dir():
            raise RequestError(f"{path} is a folder; if it has parts of a mesh, start as many processes: mpiexec -n N")
        return lacmesh.read(path)

    def as_read(self, mesh: Mesh) -> tuple[Mesh, None]:
        """Return the mesh, which is whole."""
        return mesh, None

    def take(self, mesh: Mesh, skins: Sequence[str]) -> tuple[Mesh, Share]:
        """Return the whole mesh and this share."""
        return mesh, self

    def update(self, x: Floats) -> NDArray[np.floating]:
        """Return x."""
        return x

    def total(self, x: Floats) -> NDArray[np.floating]:
        """Return x."""
        return x

    def largest(self, x: float) -> float:
        """Return x."""
        return x

    def gather(self, x: NDArray) -> NDArray:
        """Return x."""
        return x

    def same(self, x: NDArray) -> NDArray:
        """Return x."""
        return x

    def collect(self, x: NDArray) -> NDArray:
        """Return x."""
        return x

    def deal(self, x: NDArray, counts: Ints) -> NDArray:
        """Return x."""
        return x

    def gather_rows(self, A: csr_array) -> csr_array:
        """Return A."""
        return A

    def add_matrices(self, A: csr_array, nodal: tuple[bool, bool]) -> csr_array:
        """Return A."""
        return A

    def texts(self, own: Sequence[str]) -> tuple[str, ...]:
        """Return the different texts."""
        return tuple(dict.fromkeys(own))

    def agree(self, error: Exception | None) -> None:
        """Raise the error, if there is one."""
        if error is not None:
            raise error

    def on_first(self, work: Callable[[], T]) -> T | None:
        """Do something, and return its result."""
        return work()


#: the share of a process that has the whole model
ALONE = Alone()
