"""Programs in several processes of `mpiexec`, on as many cores as there are.

A program is a module of this folder with a function `main(comm, *arguments)`, whose first process prints JSON.
"""

import io
import json
import subprocess
import sys
import traceback
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module

from lacsolver.cli import main as solver_main
from lacsolver.distributed import processes
from lacsolver.distributed.launch import import_mpi
from verification.mpiexec import ROOT, environment
from verification.mpiexec import words as words_of

__all__ = ["ROOT", "commands", "environment", "in_ranks", "own_lines", "printed", "words"]


def words(n, code, *arguments):
    """The words of a command that runs some code in n processes."""
    return words_of(n, "-c", code, *arguments)


def in_ranks(n, code, *arguments, timeout=60, **more):
    """Run some code in n processes, to their end; a hang is an error."""
    given, env = words(n, code, *arguments), environment(**more)
    return subprocess.run(given, env=env, capture_output=True, text=True, timeout=timeout, check=False)


def printed(n, program, *arguments, timeout=300):
    """Objects that a program prints in n processes, one a line."""
    code = f"from tests.lacsolver.distributed.mpi import started; started({program!r})"
    done = in_ranks(n, code, *arguments, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def started(program):
    """Run a program in this process; an error ends all processes."""
    comm = import_mpi().COMM_WORLD
    try:
        import_module(f"{__package__}.{program}").main(comm, *sys.argv[1:])
    except Exception:
        traceback.print_exc()
        comm.Abort(1)


def commands(n, *rows, dealt=()):
    """The status of each command of lacsolver, and its lines, in n processes that are started once.

    The rows `dealt` come last; their first process reads every mesh, and deals it out.
    """
    every = [[[str(word) for word in row] for row in some] for some in (rows, dealt)]
    told = printed(n, "mpi", json.dumps(every))
    return [(one["status"], own_lines("\n".join(one["lines"]))) for one in told]


def main(comm, rows):
    """Run commands of lacsolver; the first process prints the status of each, and the lines that a user sees."""
    rows, dealt = json.loads(rows)
    for large, some in ((processes.LARGE, rows), (0, dealt)):
        processes.LARGE = large
        for row in some:
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as lines:
                status = solver_main(row)
            if comm.rank == 0:
                print(json.dumps({"status": status, "lines": lines.getvalue().splitlines()}), flush=True)


def own_lines(text):
    """Lines of lacsolver in a text to which mpiexec adds its own."""
    return [line for line in text.splitlines() if line.startswith("lacsolver: ")]
