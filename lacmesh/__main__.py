"""`lacmesh` and `python -m lacmesh`; `start` is the entry point of every command of the project."""

import os
import signal
import sys
from functools import partial
from importlib import import_module


def start(program: str) -> int:
    """Run the command of a package in a process of its own, which may be interrupted even while modules load.

    Return its exit status.
    """
    # matrices of BLAS are small here, and its threads, which wait in loops, take a tenth of a short run
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        status: int = import_module(f"{program}.cli").main()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # everything is written and printed
        return status
    except KeyboardInterrupt:
        print(f"{program}: error: interrupted; nothing was written", file=sys.stderr)
        return 130


#: runs the command and returns its exit status
main = partial(start, "lacmesh")

if __name__ == "__main__":
    sys.exit(main())
