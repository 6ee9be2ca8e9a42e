"""Keep the report of a run of the harness in docs/verification.

    python docs/make_verification.py DIR     DIR: what `python -m verification run -o DIR` made
    python docs/make_verification.py --check say what is out of date, and exit with 1 if anything is

What is kept is current where its results are of the cases that the harness has now.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from verification import families, report
from verification.running.folder import Run, read_results, read_run

KEPT = Path(__file__).resolve().parent / "verification"


def main(arguments: list[str]) -> int:
    """Keep, or check."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, metavar="DIR")
    parser.add_argument("--check", action="store_true")
    given = parser.parse_args(arguments)
    if given.folder:
        keep(given.folder)
    if given.check:
        wrong = out_of_date()
        print("\n".join(wrong) or "docs/verification is current")
        return int(bool(wrong))
    return 0


def keep(folder: Path) -> None:
    """Write a run's report, and its results beside it, into docs/verification."""
    KEPT.mkdir(exist_ok=True)
    report.write(read_run(folder), KEPT / "report.html")


def out_of_date() -> list[str]:
    """Messages on the cases of the run that is kept and those that there are."""
    run = kept()
    ours, theirs = {case.id for case in families.cases(run.suite)}, {done.id for done in run.done}
    found = [f"{name} is new, and was not run: run the suite {run.suite} again" for name in sorted(ours - theirs)]
    gone = [name for name in sorted(theirs - ours) if f"{name}-twin" not in ours]  # else its mesh is not at hand
    found += [f"{name} was run, and is no case any more" for name in gone]
    return found


def kept() -> Run:
    """The run whose results are kept."""
    return read_results(KEPT / "report.json")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
