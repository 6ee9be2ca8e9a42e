"""`python -m tests.fuzz`: spoilt files of every format; a table of what became of them, status 1 where any failed.

A file is made from its format and number, always the same. One that fails is kept in build/fuzz.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.fuzz.pool import Tally, fuzz
from tests.fuzz.seeds import FORMATS
from tests.fuzz.trial import FAILED, spoilt, tried


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("format", nargs="*", help=f"of {', '.join(FORMATS)} (default: all)")
    parser.add_argument("--files", type=int, default=10_000, help="for each format (default: 10000)")
    parser.add_argument("--first", type=int, default=0, help="number of the first (default: 0)")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--only", type=int, metavar="NUMBER", help="one file again, in this process; it stays in build/fuzz"
    )
    args = parser.parse_args()
    names = args.format or list(FORMATS)
    if args.only is not None:
        folder = _kept(names[0], args.only)
        outcome = tried(names[0], args.only, folder)
        print(f"{folder}: {outcome.what}\n{outcome.text}")
        return outcome.what == FAILED
    failed = 0
    print(Tally.head(), flush=True)
    for name in names:
        tally = fuzz(name, range(args.first, args.first + args.files), args.workers)
        print(tally.line(), flush=True)
        kinds: dict[str, list[int]] = {}
        for number, text in tally.failed.items():
            kinds.setdefault(text.strip().rpartition("\n")[2], []).append(number)
        for last, numbers in kinds.items():  # one of each kind whole
            print(f"--- {len(numbers)} times: {last[:200]}\n{tally.failed[numbers[0]]}")
            print(f'{_kept(name, numbers[0])}; again: python -m tests.fuzz "{name}" --only {numbers[0]}', flush=True)
        failed += len(tally.failed)
    return 1 if failed else 0


def _kept(name: str, number: int) -> Path:
    """A folder in which the spoilt file of that number lies."""
    folder = Path("build", "fuzz", f"{name.replace(' ', '_')}-{number}")
    folder.mkdir(parents=True, exist_ok=True)
    for file, content in spoilt(name, number).files.items():
        (folder / file).write_bytes(content)
    return folder


if __name__ == "__main__":
    sys.exit(main())
