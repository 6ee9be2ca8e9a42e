"""`python -m verification run`: a suite, a family or a case, each case in a process of its own."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from lacmesh.cli.program import on_one_line
from lacmesh.errors import LacmeshError, RequestError
from verification.cli.options import add_choice, add_command

if TYPE_CHECKING:
    from verification.running.folder import CaseResult, Run
    from verification.running.plan import Planned
    from verification.running.suite import Progress


class FallsShortError(LacmeshError):
    """Results are not met."""


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "run", run, "run the cases of a suite, and write what comes out")
    add_choice(parser, "quick")
    parser.add_argument(
        "-j", "--jobs", type=_jobs, metavar="N", help="processes at once (default: the cores there are)"
    )
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: build/verification-SUITE")
    parser.add_argument("--resume", action="store_true", help="go on with the run that is in DIR: what is done stays")


def run(args: argparse.Namespace) -> None:
    """Run, and write results and report. Raises FallsShortError where a result is not met."""
    from verification import report
    from verification.running.environment import cores
    from verification.running.plan import plan, suite_of
    from verification.running.suite import locked_run, run_suite

    suite = suite_of(args.suite, args.family, args.default_suite)
    planned = _possible(plan(suite, args.family, args.case))
    folder = args.output or Path("build") / f"verification-{suite}"
    jobs = args.jobs or cores()
    with locked_run(folder, resume=args.resume):
        args.left = lambda: f"finished cases are kept in {folder}; --resume goes on"
        finished = run_suite(planned, suite, folder, jobs, *((_quiet, _quiet) if args.quiet else (_begun, _said)))
        report.write(finished, folder / "report.html")
    _end(finished, quiet=args.quiet)


def _possible(planned: Sequence[Planned]) -> list[Planned]:
    """Return what can be run here, with a line about each family that cannot.

    Raises RequestError, with what is missing, if nothing is left.
    """
    from verification.families import family

    lacking = {name: said for name in {p.case.family for p in planned} if (said := family(name).missing())}
    left = [p for p in planned if p.case.family not in lacking]
    if not left:
        raise RequestError("; ".join(f"family {name} cannot be run: {said}" for name, said in lacking.items()))
    for name, said in lacking.items():
        count = sum(p.case.family == name for p in planned)
        print(f"family {name} is left out ({count} of the cases): {said}", flush=True)
    return left


def _begun(progress: Progress) -> None:
    """A line before the first case."""
    kept = f", {progress.kept} are done already" if progress.kept else ""
    print(f"{progress.count} cases to run{kept}; {_left(progress)}", flush=True)


def _said(done: CaseResult, progress: Progress) -> None:
    """A line for a case that has ended."""
    print(f"[{progress.ended}/{progress.count}] {done.id}: {_verdict(done)}, {done.seconds:.1f} s; {_left(progress)}")
    sys.stdout.flush()


def _verdict(done: CaseResult) -> str:
    if done.failure:
        return f"FAILED: {on_one_line(shorten(done.failure, 200))}"
    judged = [result.passed for result in done.results if result.bound != "informative" or not result.passed]
    short = judged.count(False)
    return f"{f'MISSED {short}' if short else f'met {len(judged)}'} of {len(judged)} results"


def _left(progress: Progress) -> str:
    minutes = progress.left > 90
    return f"about {progress.left / 60:.0f} min left" if minutes else f"about {progress.left:.0f} s left"


def _quiet(*progress: object) -> None:
    """Nothing."""


def _end(run: Run, *, quiet: bool) -> None:
    """The last line; FallsShortError where a result is not met."""
    results = [result for done in run.done for result in done.results]
    if not quiet:
        page = run.path / "report.html"
        print(f"{len(run.done)} cases, {len(results)} results, {run.seconds / 60:.1f} min; {page}", flush=True)
    failed = [f"{done.id} has no outcome" for done in run.done if done.failure]
    short = [*failed, *(f"{done.id}: {r.quantity}" for done in run.done for r in done.results if not r.passed)]
    if short:
        names = "; ".join(short[:8]) + ("; ..." if len(short) > 8 else "")
        raise FallsShortError(f"{len(short)} of the results fall short ({names}); see the report")


def _jobs(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is no number of processes")
    return value
