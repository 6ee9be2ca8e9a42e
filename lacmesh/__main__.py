"""`lacmesh` and `python -m lacmesh`: the command, which may be interrupted even while it is being loaded."""

import gc
import signal
import sys


def main() -> int:
    """Run the command and return its exit status."""
    try:
        from lacmesh.cli import main as run

        status = run()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done and said
        gc.freeze()  # nor does Python look for cycles in all that was imported, a fifth of a short run
        return status
    except KeyboardInterrupt:
        print("lacmesh: error: interrupted; nothing was written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
