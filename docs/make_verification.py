"""Keep the report of a run of the harness in docs/verification, and write its summary into docs/verification.md.

    python docs/make_verification.py DIR     DIR: what `python -m verification run -o DIR` made
    python docs/make_verification.py         the summary again, from the results that are kept
    python docs/make_verification.py --check say what is out of date, and exit with 1 if anything is

The summary is made from docs/verification/report.json alone. It is current where the page holds what these results
say, and the results are of the cases that the harness has now.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from verification import families, report
from verification.running.folder import Run, read_results, read_run

DOCS = Path(__file__).resolve().parent
PAGE, KEPT = DOCS / "verification.md", DOCS / "verification"
MARKS = "<!-- summary: begin -->\n", "<!-- summary: end -->"


def main(arguments: list[str]) -> int:
    """Keep, write, or check."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, metavar="DIR")
    parser.add_argument("--check", action="store_true")
    given = parser.parse_args(arguments)
    if given.folder:
        keep(given.folder)
    if given.check:
        wrong = out_of_date()
        print("\n".join(wrong) or "docs/verification.md is current")
        return int(bool(wrong))
    PAGE.write_text(page(), encoding="utf-8")
    return 0


def keep(folder: Path) -> None:
    """Write a run's report, and its results beside it, into docs/verification."""
    KEPT.mkdir(exist_ok=True)
    report.write(read_run(folder), KEPT / "report.html")


def page() -> str:
    """The page, with the summary of the results that are kept."""
    text = report.summary(kept())
    return re.sub(
        f"{MARKS[0]}.*?{MARKS[1]}",
        lambda _: f"{MARKS[0]}\n{text}\n{MARKS[1]}",
        PAGE.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )


def out_of_date() -> list[str]:
    """Messages on what is out of date: the page, and the cases of the run that is kept."""
    found = []
    if PAGE.read_text(encoding="utf-8") != page():
        found.append("docs/verification.md is not what docs/verification/report.json says: make it again")
    run = kept()
    ours, theirs = {case.id for case in families.cases(run.suite)}, {done.id for done in run.done}
    found += [f"{name} is new, and was not run: run the suite {run.suite} again" for name in sorted(ours - theirs)]
    gone = [name for name in sorted(theirs - ours) if f"{name}-twin" not in ours]  # else its mesh is not at hand
    found += [f"{name} was run, and is no case any more" for name in gone]
    return found


def kept() -> Run:
    """The run whose results are kept."""
    return read_results(KEPT / "report.json")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
