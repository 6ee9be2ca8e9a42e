"""The processes of a run, and the share of the model that each of them has (`lacsolver.space.share`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

import lacmesh
from lacmesh.cutting.records import is_cut
from lacmesh.errors import LacmeshError, RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.partition import Part, cut_part, describe_parts, distribute_nodes, part_of, read_part

T = TypeVar("T")


class Processes:
    """The processes of an MPI communicator `comm`, each of which takes a part of a mesh."""

    def __init__(self, comm: Any) -> None:
        self.comm, self.rank, self.n = comm, comm.Get_rank(), comm.Get_size()
        self._part: Part | None = None

    def read(self, path: Path, skins: Sequence[str], slaves: Mapping[str, str]) -> Mesh:
        """Return the mesh of a file, or this process's part from a folder that `lacmesh partition` wrote, cut.

        `skins`: groups that all processes need; `slaves`: the groups to cut, each with its kind of `hexa` cut. Raises
        ReadError, CutError, and RequestError for a folder with parts for another number of processes.
        """
        if not path.is_dir():
            return lacmesh.read(path)
        there = len(describe_parts(path)["parts"]["nodes"])
        if there != self.n:
            advice = f"start {there} processes, or divide it again: lacmesh partition MESH -n {self.n} -o {path}"
            raise RequestError(f"{path} has {there} parts, and {self.n} processes were started; {advice}")
        part = read_part(path, self.rank, everywhere=sorted(set(skins)))
        if slaves and not is_cut(part.mesh):
            if len(set(slaves.values())) > 1:
                advice = "cut the slaves before the mesh is divided"
                raise RequestError(f"the slaves in {path} are cut at once, so hexa must be the same for all; {advice}")
            part = cut_part(part, list(slaves), hexa=next(iter(slaves.values())))
        self._part = part
        return part.mesh

    def take(self, mesh: Mesh, skins: Sequence[str]) -> tuple[Mesh, ProcessShare]:
        """Return the part of a mesh that this process takes, and its share; all processes have the groups `skins`."""
        part = self._part
        if part is None or part.mesh is not mesh:
            part = part_of(mesh, distribute_nodes(mesh, self.n), self.rank, everywhere=skins)
        common = np.zeros(part.mesh.n_nodes, bool)
        for name in skins:
            for _, _, nodes in part.mesh.select(part.mesh.cells_of(name)):
                common[nodes] = True
        return part.mesh, ProcessShare(self.comm, part, common)


class ProcessShare:
    """The share of one process in a model that the processes of a communicator hold together.

    `number` (n_nodes,): number of each node in the order of the processes, each of which has consecutive ones.
    """

    def __init__(self, comm: Any, part: Part, common: NDArray[np.bool_]) -> None:
        from mpi4py.MPI import MAX

        self.comm, self.rank, self.n, self.part, self.common = comm, part.rank, part.n_ranks, part, common
        self._maximum = MAX
        self.own, self.node, self.cell, self.origin, self.body = part.own, part.node, part.cell, part.origin, part.body
        self._asked, self._given = self._neighbours()
        first = sum(comm.allgather(int(self.own.sum()))[: self.rank])
        mine = np.zeros(len(self.node))
        mine[self.own] = first + np.arange(int(self.own.sum()))
        self.number: Ints = self.update(mine[:, None]).ravel().astype(np.int64)

    def _neighbours(self) -> tuple[Sequence[Ints], Sequence[Ints]]:
        """Return the nodes that this process asks each of the others for, and those that it gives to each."""
        others = np.flatnonzero(~self.own)
        others = others[np.argsort(self.part.owner[others], kind="stable")]
        ends = np.searchsorted(self.part.owner[others], np.arange(1, self.comm.Get_size()))
        asked = np.split(others, ends)
        wanted = self.comm.alltoall([self.node[nodes] for nodes in asked])
        return asked, [np.searchsorted(self.node, nodes) for nodes in wanted]

    def update(self, x: Floats) -> NDArray[np.floating]:
        """Return x (n_nodes, k) with the values at other nodes that their own processes have."""
        k, out = x.shape[1], np.array(x, float)
        sent = np.ascontiguousarray(out[np.concatenate(self._given)])
        there = np.concatenate(self._asked)
        got = np.empty((len(there), k))
        self.comm.Alltoallv([sent, _counts(self._given, k)], [got, _counts(self._asked, k)])
        out[there] = got
        return out

    def total(self, x: Floats) -> NDArray[np.floating]:
        """Return the sum of an array over all processes."""
        sent = np.ascontiguousarray(x)
        got = np.empty_like(sent)
        self.comm.Allreduce(sent, got)
        return got if sent.ndim else got[()]

    def largest(self, x: float) -> float:
        """Return the largest value of all processes; NaN if one is."""
        got = np.empty(2)
        sent = np.array([np.isnan(x), -np.inf if np.isnan(x) else x])  # the maximum of MPI does not keep NaN
        self.comm.Allreduce(sent, got, self._maximum)
        return float("nan") if got[0] else float(got[1])

    def gather(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other."""
        sent, counts = self._rows(x)
        got = np.empty((int(counts.sum()), *sent.shape[1:]), sent.dtype)
        size = _width(sent)
        self.comm.Allgatherv(sent, [got, (size * counts).tolist()])
        return got

    def _rows(self, x: NDArray) -> tuple[NDArray, Ints]:
        """Return an array (k, ...) as it is sent, and the number of rows (n,) of all processes."""
        sent, counts = np.ascontiguousarray(x), np.empty(self.n, np.int64)
        self.comm.Allgather(np.array([len(sent)], np.int64), counts)
        return sent, counts

    def same(self, x: NDArray) -> NDArray:
        """Return the array that the first process has."""
        out = np.ascontiguousarray(x)
        self.comm.Bcast(out)
        return out

    def collect(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other, on the first process; on others what is empty."""
        sent, counts = self._rows(x)
        got = np.empty((int(counts.sum()) if self.rank == 0 else 0, *sent.shape[1:]), sent.dtype)
        size = _width(sent)
        self.comm.Gatherv(sent, [got, (size * counts).tolist()] if self.rank == 0 else None)
        return got

    def deal(self, x: NDArray, counts: Ints) -> NDArray:
        """Return this process's part of an array that the first process has, of which each takes as many rows."""
        kind, shape = self.comm.bcast((x.dtype, x.shape[1:]) if self.rank == 0 else None)
        got = np.empty((int(counts[self.rank]), *shape), kind)
        size = _width(got)
        sent = [np.ascontiguousarray(x), (size * counts).tolist()] if self.rank == 0 else None
        self.comm.Scatterv(sent, got)
        return got

    def gather_rows(self, A: csr_array) -> csr_array:
        """Return the rows of all processes, one process after the other; columns mean the same on all."""
        A = csr_array(A)
        ends = np.concatenate([[0], np.cumsum(self.gather(np.diff(A.indptr).astype(np.int64)))])
        columns = self.gather(A.indices.astype(np.int64))
        return csr_array((self.gather(A.data), columns, ends), shape=(len(ends) - 1, A.shape[1]))

    def add_matrices(self, A: csr_array, nodal: tuple[bool, bool]) -> csr_array:
        """Return the sum over all processes of matrices of one size, see `lacsolver.space.share.Share`."""
        entries, dim = A.tocoo(), max(A.shape) // max(len(self.node), 1)
        places = [self._to_whole(i, dim) if by_node else i for i, by_node in zip(entries.coords, nodal, strict=True)]
        row, column, value = (self.gather(part) for part in (*(i.astype(np.int64) for i in places), entries.data))
        row, column = (
            self._from_whole(i, dim) if by_node else i for i, by_node in zip((row, column), nodal, strict=True)
        )
        made = coo_array((value, (row, column)), shape=A.shape).tocsr()
        made.sum_duplicates()
        return csr_array(made)

    def _to_whole(self, unknown: Ints, dim: int) -> Ints:
        """Return the index in the whole model of unknowns at nodes of this process."""
        return dim * self.node[unknown // dim].astype(np.int64) + unknown % dim

    def _from_whole(self, unknown: Ints, dim: int) -> Ints:
        """Return the index here of unknowns of the whole model, at nodes that this process has."""
        return dim * np.searchsorted(self.node, unknown // dim) + unknown % dim

    def texts(self, own: Sequence[str]) -> tuple[str, ...]:
        """Return the different texts of all processes, those of the first one first."""
        return tuple(dict.fromkeys(text for texts in self.comm.allgather(tuple(own)) for text in texts))

    def agree(self, error: Exception | None) -> None:
        """Raise the error of the first process that has one, on all of them."""
        first = int(-self.largest(-float(self.rank if error is not None else self.n)))
        if first == self.n:
            return
        found = self.comm.bcast(None if error is None else (type(error), str(error)), root=first)
        raise error if error is not None else _made(*found)

    def on_first(self, work: Callable[[], T]) -> T | None:
        """Do something on the first process alone, and return its result there; raise its error on all of them."""
        made, failed = None, None
        if self.rank == 0:
            try:
                made = work()
            except Exception as error:
                failed = error
        self.agree(failed)
        return made


def _made(kind: type[Exception], message: str) -> Exception:
    """Return an error with a message; a LacmeshError if errors of this kind are made of more."""
    try:
        return kind(message)
    except (TypeError, AttributeError):
        return LacmeshError(message)


def _width(x: NDArray) -> int:
    """Return the number of values in a row of an array (k, ...)."""
    return int(np.prod(x.shape[1:], dtype=np.int64))


def _counts(nodes: Sequence[Ints], k: int) -> Any:
    return [k * len(part) for part in nodes]
