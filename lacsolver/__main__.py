"""`lacsolver` and `python -m lacsolver`: the command, interrupted or not while it is still being loaded."""

import gc
import signal
import sys


def main() -> int:
    """Run the command; the exit status."""
    try:
        from lacsolver.cli import main as run

        status = run()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done and said
        gc.freeze()  # nor does Python look for cycles in all that was imported, a fifth of a short run
        return status
    except KeyboardInterrupt:
        print("lacsolver: error: interrupted; nothing was written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
