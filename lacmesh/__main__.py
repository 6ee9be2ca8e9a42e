"""`lacmesh` and `python -m lacmesh`; `start` is the entry point of every command of the project."""

import gc
import os
import signal
import sys
from importlib import import_module


def start(program: str) -> int:
    """Run the command of a package in a process of its own, which may be interrupted even while modules load.

    Return its exit status. Of what is imported nothing is garbage: to look for some takes a tenth of a short run.
    """
    # matrices of BLAS are small here, and its threads, which wait in loops, take a tenth of a short run
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.disable()  # `Program.main` collects while the command runs, if that is worth its time
    try:
        status: int = import_module(f"{program}.cli").main()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # everything is written and printed
        gc.freeze()  # nor at exit
        return status
    except KeyboardInterrupt:
        print(f"{program}: error: interrupted; nothing was written", file=sys.stderr)
        return 130


def main() -> int:
    """Run the command and return its exit status."""
    return start("lacmesh")


if __name__ == "__main__":
    sys.exit(main())
