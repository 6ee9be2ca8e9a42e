"""The processes of a run, and the share of the model that each of them has (`share`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

import lacmesh
from lacmesh.cutting.records import is_cut
from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.partition import Part, cut_part, describe_parts, distribute_nodes, part_of, read_part
from lacmesh.partition.parts import skin_name
from lacsolver.distributed.mpi import MpiCommunicator
from lacsolver.distributed.share import ALONE, Distribution, Share, Slaves

#: bytes of a mesh file from which on the first process alone reads it; every process reads a smaller one
LARGE = 1 << 26


class Processes(Distribution):
    """The processes of an MPI communicator `comm`, each of which takes a part of a mesh."""

    def __init__(self, comm: Any) -> None:
        self.comm = MpiCommunicator(comm)
        self._read: Part | None = None  # as the file has it
        self._part: Part | None = None  # with the slaves cut

    @property
    def divided(self) -> bool:  # type: ignore[override]
        """True once a mesh was read of which each process has its part."""
        return self._part is not None

    def read(self, path: Path, skins: Sequence[str], slaves: Slaves, whole: bool = False) -> Mesh:
        """Return the mesh of a file, or this process's part, cut, of a large file or the folder of a divided mesh.

        `skins`: groups that all processes need; `slaves`: those to cut, and how;
        `whole`: True for the whole mesh of a large file, too. Raises ReadError, CutError, and RequestError for a folder
        with parts for another number of processes.
        """
        names = sorted(set(skins))
        part = self._divided(path, names) if path.is_dir() else None if whole else self._dealt(path, names)
        if part is None:
            return lacmesh.read(path)
        self._read = part
        if names and len(part.everywhere) == len(names) and not is_cut(part.mesh):
            groups, options = slaves(part.mesh)
            part = cut_part(part, groups, **options)
        self._part = part
        return part.mesh

    def _divided(self, path: Path, skins: Sequence[str]) -> Part:
        """Return this process's part from a folder. Raises ReadError, RequestError."""
        there = len(describe_parts(path)["parts"]["nodes"])
        n = self.comm.size
        if there != n:
            again = f"divide it again: lacmesh partition MESH -n {n} -o {path}"
            advice = f"start {there} processes, name the mesh file itself, or {again}"
            raise RequestError(f"{path} has {there} parts, and {n} processes were started; {advice}")
        return read_part(path, self.comm.rank, everywhere=skins)

    def _dealt(self, path: Path, skins: Sequence[str]) -> Part | None:
        """Return this process's part of the mesh in a large file, which the first process reads; None for a small file.

        Groups that are not there are left to the check of the case, which knows its lines.
        """
        large = self.comm.on_each(lambda: path.is_file() and path.stat().st_size >= LARGE)
        if self.comm.size == 1 or not large:
            return None

        def prepare() -> Callable[[int], Part]:
            mesh, names = lacmesh.read(path), []
            for name in skins:
                with suppress(RequestError):
                    mesh.cells_of(name)
                    names.append(skin_name(mesh, name))
            owner = distribute_nodes(mesh, self.comm.size)
            first = part_of(mesh, owner, 0, everywhere=names)
            return lambda rank: part_of(mesh, owner, rank, everywhere=names) if rank else first

        return self.comm.hand_out(self.comm.on_first(prepare))

    def as_read(self, mesh: Mesh) -> tuple[Mesh, Share]:
        """Return a mesh of `read` before its cut, and its share in the mesh of the file."""
        if self._read is None or self._part is None or self._part.mesh is not mesh:
            return mesh, ALONE
        return self._read.mesh, PartShare(self.comm.mpi, self._read)

    def take(self, mesh: Mesh, skins: Sequence[str], sets: Ints | None = None) -> tuple[Mesh, ProcessShare]:
        """Return the part of a mesh that this process takes, and its share; all processes have the groups `skins`.

        `sets` (n_nodes,): a number for nodes that all processes have, -1 for others; nodes of one number are those of
        one process. Raises RequestError where a process would be left without nodes.
        """
        part, common = self._part, np.zeros(mesh.n_nodes, bool)
        if part is None or part.mesh is not mesh:
            joined = np.full(mesh.n_nodes, -1) if sets is None else sets
            owner = _owners(mesh, self.comm.size, joined)
            part = part_of(mesh, owner, self.comm.rank, everywhere=skins, nodes=joined >= 0)
            common = (joined >= 0)[part.node]
        for name in skins:
            common[part.mesh.nodes_on(part.mesh.cells_of(name))] = True
        return part.mesh, ProcessShare(self.comm.mpi, part, common)


def _owners(mesh: Mesh, n: int, sets: Ints) -> Ints:
    """Return the process (n_nodes,) of each node: of nodes of one set that of the first; `sets`: -1 for none."""
    owner = distribute_nodes(mesh, n)
    nodes = np.flatnonzero(sets >= 0)
    _, first, which = np.unique(sets[nodes], return_index=True, return_inverse=True)
    owner[nodes] = owner[nodes[first]][which]
    empty = n - len(np.unique(owner))
    if empty:
        message = f"{empty} of {n} processes would have no nodes, as equations join so many in one process"
        raise RequestError(f"{message}; start fewer processes")
    return owner


class PartShare(MpiCommunicator, Share):
    """The part of a mesh that one process of a communicator has: its `own` nodes, and indices in the whole mesh."""

    def __init__(self, comm: Any, part: Part) -> None:
        super().__init__(comm)
        self.own: NDArray[np.bool_] = part.own
        self.node: Ints = part.node
        self.cell: Ints = part.cell


class ProcessShare(PartShare):
    """The share of one process in a model that the processes of a communicator hold together.

    `number` (n_nodes,): number of each node in the order of the processes, each of which has consecutive ones.
    """

    def __init__(self, comm: Any, part: Part, common: NDArray[np.bool_]) -> None:
        super().__init__(comm, part)
        self.part, self.common, self.origin, self.body = part, common, part.origin, part.body
        others = np.flatnonzero(~self.own)
        self._asked = others[np.argsort(part.owner[others], kind="stable")]
        self._counts = np.bincount(part.owner[others], minlength=self.size)
        wanted, self._given_counts = self.exchange(self.node[self._asked], self._counts)
        self._given = np.searchsorted(self.node, wanted)
        first = self.before(int(self.own.sum()))
        mine = np.zeros(len(self.node))
        mine[self.own] = first + np.arange(int(self.own.sum()))
        self.number: Ints = self.update(mine[:, None]).ravel().astype(np.int64)

    def update(self, x: Floats) -> NDArray[np.floating]:
        """Return x (n_nodes, k) with the values at other nodes that their own processes have."""
        out = np.array(x, float)
        out[self._asked] = self.exchange(out[self._given], self._given_counts, self._counts)[0]
        return out

    def add_matrices(self, A: csr_array, nodal: tuple[bool, bool]) -> csr_array:
        """Return the sum over all processes of matrices of one size, see `Share`."""
        if not any(nodal):
            return self.total_matrix(A)
        entries, dim, index = A.tocoo(), max(A.shape) // max(len(self.node), 1), []
        for own, by_node in zip(entries.coords, nodal, strict=True):
            everywhere = self.gather((self._to_whole(own, dim) if by_node else own).astype(np.int64))
            index.append(self._from_whole(everywhere, dim) if by_node else everywhere)
        return csr_array(coo_array((self.gather(entries.data), tuple(index)), shape=A.shape).tocsr())

    def _to_whole(self, unknown: Ints, dim: int) -> Ints:
        """Return the index in the whole model of unknowns at nodes of this process."""
        return dim * self.node[unknown // dim].astype(np.int64) + unknown % dim

    def _from_whole(self, unknown: Ints, dim: int) -> Ints:
        """Return the index here of unknowns of the whole model, at nodes that this process has."""
        return dim * np.searchsorted(self.node, unknown // dim) + unknown % dim
