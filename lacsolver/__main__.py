"""Entry point of `lacsolver` and `python -m lacsolver`."""

import sys

from lacmesh.__main__ import start


def main() -> int:
    """Run the command and return its exit status."""
    return start("lacsolver")


if __name__ == "__main__":
    sys.exit(main())
