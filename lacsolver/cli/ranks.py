"""Whether `mpiexec` or `srun` started several processes: each would solve the whole and write the same files."""

from __future__ import annotations

import os
from collections.abc import Mapping

from lacmesh.errors import RequestError

#: what tells a process how many were started: by Open MPI; by MPICH, Intel MPI and others
_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")


def check_alone(environment: Mapping[str, str] = os.environ) -> None:
    """Raise RequestError where this process is one of several: there is no engine for that yet."""
    for name in (*_SIZES, *_sizes_of_slurm(environment)):
        count = _count(environment.get(name))
        if count > 1:
            raise RequestError(
                f"{count} processes were started ({name}), and each would solve the whole and write the same files; "
                "start one, whose cores are [solver] threads; for one with a case of its own, unset that variable"
            )


def _sizes_of_slurm(environment: Mapping[str, str]) -> tuple[str, ...]:
    """Slurm's variable that counts the processes of which this is one; none where it counts what could be started.

    `srun` tells each task how many its step has. Where that is not told, SLURM_NTASKS is of the job: what `salloc` runs
    has no SLURM_PROCID, and the script of `sbatch` is task 0 of a job of many, but runs alone (ENVIRONMENT is BATCH).
    """
    if "SLURM_STEP_NUM_TASKS" in environment:
        return ("SLURM_STEP_NUM_TASKS",)
    alone = _count(environment.get("SLURM_PROCID", "0")) == 0 and environment.get("ENVIRONMENT") == "BATCH"
    return () if "SLURM_PROCID" not in environment or alone else ("SLURM_NTASKS",)


def _count(text: str | None) -> int:
    return int(text) if text and text.isdecimal() else 0
