"""Parts of meshes that processes read by slices, compared with those of the whole mesh: a program for `test_slices`."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import lacmesh
from lacmesh.errors import LacmeshError
from lacmesh.kernels import Kernel
from lacmesh.partition import cut_part, distribute_nodes, part_of
from lacmesh.partition.slices import read_in_slices
from lacsolver.distributed.launch import import_mpi
from lacsolver.distributed.mpi import MpiCommunicator
from tests.lacsolver.distributed.allocations import watched
from tests.partition.compare import differences

#: groups of skin faces that each part is to have, as far as the file has them
SKINS = ("slave", "master", "none", "absent", "entity:2:7", "entity:2:99", "entity:surface")


def main(comm, folder):
    """Print what is told of each file."""
    for kernel in Kernel.known:  # in the parts of any number of processes: what runs compiled allocates nothing here
        kernel.least = 0
    told(import_mpi(), Path(folder))


def told(MPI, folder):
    """Print for each file, and for 1, 2 and all processes, what differs on any of them; then the allocations."""
    world = MPI.COMM_WORLD
    for n in (1, 2, world.size):
        group = MpiCommunicator(world.Split(min(world.rank // n, 1)))
        for path in sorted(folder.glob("*.m[es][dh]")) if world.rank < n else ():  # .med, .msh
            told = group.mpi.gather(found(path, group))
            if world.rank == 0:
                print(json.dumps([n, path.name, told]), flush=True)
        for path in sorted(folder.glob("large/*")) if n > 1 and world.rank < n else ():
            sizes = watched(MPI, lambda path=path, group=group: read_in_slices(path, group, ["slave", "master"]))
            told = group.mpi.gather(sizes)
            if world.rank == 0:
                print(json.dumps([n, f"allocations of {path.name}", told]), flush=True)


def found(path, group):
    """Return what differs in the part of this process, as it is and cut; or the error."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            part = read_in_slices(path, group, SKINS)
        except LacmeshError as error:
            return f"{error.status} {error}"
    if part is None:
        return "read as a whole"
    with warnings.catch_warnings(record=True) as heard_of_one:
        warnings.simplefilter("always")
        mesh = lacmesh.read(path)
    skins = [name for name in SKINS if name in mesh.cell_groups or ((2, 7) in mesh.entities and name == "entity:2:7")]
    there = part_of(mesh, distribute_nodes(mesh, group.size), group.rank, everywhere=skins)
    told = differences(there, part)
    if [str(one.message) for one in heard] != [str(one.message) for one in heard_of_one]:
        told.append(f"warnings: {[str(one.message) for one in heard]}")
    if "blocks" in path.name:
        told += differences(cut_part(there, "slave"), cut_part(part, "slave"), "part")
    return told
