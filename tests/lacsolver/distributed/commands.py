"""Commands of lacsolver, one after the other in the same processes: a program for `mpiexec`.

Its arguments are JSON, a list of the words of each command, and the bytes of a mesh from which on processes read slices
of it. The first process prints a line of JSON each: the status, and the lines on its standard error, which a user sees.
"""

from __future__ import annotations

import io
import json
from contextlib import redirect_stderr, redirect_stdout

from lacsolver.cli import main as solver_main
from lacsolver.distributed import processes


def main(comm, commands, large):
    """Run the commands."""
    processes.LARGE = int(large)
    for words in json.loads(commands):
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
            status = solver_main(words)
        if comm.rank == 0:
            print(json.dumps({"status": status, "said": said.getvalue().splitlines()}), flush=True)
