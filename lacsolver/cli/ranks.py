"""Refuse to run as one of several processes of `mpiexec` or `srun`.

Each process would solve the whole problem and write the same files.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

from lacmesh.errors import RequestError

#: environment variables with the number of processes: of Open MPI; of MPICH, Intel MPI and others
_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")


def check_alone(environment: Mapping[str, str] = os.environ) -> None:
    """Raise RequestError if this process is one of several, for which there is no solver yet."""
    for name in (*_SIZES, *_sizes_of_slurm(environment)):
        count = _count(environment.get(name))
        if count > 1:
            raise RequestError(
                f"{count} processes were started ({name}), and each would solve the whole and write the same files; "
                "start one, whose cores are [solver] threads; for one with a case of its own, unset that variable"
            )


def _sizes_of_slurm(environment: Mapping[str, str]) -> tuple[str, ...]:
    """Return Slurm's variable with the number of processes that were started, () if none tells it.

    `srun` sets SLURM_STEP_NUM_TASKS for each task. Without it SLURM_NTASKS is used, which counts the tasks that a job
    may start. It is not used where the process runs alone: a command of `salloc` has no SLURM_PROCID, and the script of
    `sbatch` is task 0 of a job of many tasks (ENVIRONMENT is BATCH).
    """
    if "SLURM_STEP_NUM_TASKS" in environment:
        return ("SLURM_STEP_NUM_TASKS",)
    alone = _count(environment.get("SLURM_PROCID", "0")) == 0 and environment.get("ENVIRONMENT") == "BATCH"
    return () if "SLURM_PROCID" not in environment or alone else ("SLURM_NTASKS",)


def _count(text: str | None) -> int:
    return int(text) if text and text.isdecimal() else 0
