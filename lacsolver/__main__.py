"""Entry point of `lacsolver` and `python -m lacsolver`; an interruption while modules load is handled too."""

import gc
import signal
import sys


def main() -> int:
    """Run the command and return its exit status."""
    try:
        from lacsolver.cli import main as run

        status = run()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # everything is written and printed
        gc.freeze()  # no garbage collection of all imports at exit, a fifth of a short run
        return status
    except KeyboardInterrupt:
        print("lacsolver: error: interrupted; nothing was written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
