"""Programs in several processes of `mpiexec`, on as many cores as there are.

A program is a module of this folder with a function `main(comm, *arguments)`, whose first process prints JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import traceback
from importlib import import_module

from lacsolver.distributed.launch import import_mpi
from lacsolver.distributed.processes import LARGE
from verification.mpiexec import ROOT, environment
from verification.mpiexec import words as words_of

__all__ = ["ROOT", "commands", "environment", "in_ranks", "own_lines", "printed", "words"]


def words(n, code, *arguments):
    """The words of a command that runs some code in n processes."""
    return words_of(n, "-c", code, *arguments)


def in_ranks(n, code, *arguments, timeout=60, **more):
    """Run some code in n processes, to their end; a hang is an error."""
    return subprocess.run(
        words(n, code, *arguments),
        env=environment(**more),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def printed(n, program, *arguments, timeout=300):
    """Objects that a program prints in n processes, one a line."""
    code = f"from tests.lacsolver.distributed.mpi import main; main({program!r})"
    done = in_ranks(n, code, *arguments, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def commands(n, *rows, large=LARGE):
    """The status of each command of lacsolver, and its lines, in n processes that are started once."""
    told = printed(n, "commands", json.dumps([[str(word) for word in words] for words in rows]), large)
    return [(one["status"], own_lines("\n".join(one["said"]))) for one in told]


def main(program):
    """Run a program in this process; an error ends all processes."""
    comm = import_mpi().COMM_WORLD
    try:
        import_module(f"{__package__}.{program}").main(comm, *sys.argv[1:])
    except Exception:
        traceback.print_exc()
        comm.Abort(1)


def own_lines(text):
    """Lines of lacsolver in a text to which mpiexec adds its own."""
    return [line for line in text.splitlines() if line.startswith("lacsolver: ")]
