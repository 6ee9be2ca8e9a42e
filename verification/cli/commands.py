"""`python -m verification list`, `run`, `report` and `compare`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Argument, BadParameter, Option

from lacmesh.cli.program import Run, on_one_line
from lacmesh.cli.terminal import print_table
from lacmesh.errors import LacmeshError, RequestError

if TYPE_CHECKING:
    from verification.running.folder import CaseResult
    from verification.running.folder import Run as Finished
    from verification.running.plan import Planned
    from verification.running.suite import Progress


class FallsShortError(LacmeshError):
    """Results are not met."""


@dataclass
class Choice:
    """The cases of a command."""

    suite: Annotated[
        Literal["quick", "full", "all"] | None,
        Option(help="10 minutes on two cores, 90 minutes, or hours (default: quick, or the first that has the family)"),
    ] = None
    family: Annotated[str | None, Option(metavar="F", help="the cases of one family")] = None
    case: Annotated[str | None, Option(metavar="C", help="one case, by its name or as family/name")] = None


def _jobs(text: str) -> int:
    if not text.isdecimal() or not int(text):
        raise BadParameter(f"{text} is no number of processes")
    return int(text)


def list_(
    *,
    choice: Choice,
    as_json: Annotated[bool, Option("--json", help="as JSON, with all that each case is made of")] = False,
    run: Run,
) -> None:
    """List the cases of a suite (default: all).

    $ python -m verification list --suite quick
    $ python -m verification list --family patch --json
    """
    from verification.running.plan import plan, suite_of

    planned = plan(suite_of(choice.suite, choice.family, "all"), choice.family, choice.case)
    if as_json:
        print(json.dumps([_record(p) for p in planned], indent=1))
        return
    print_table(("case", "levels", "what"), [(p.case.id, str(p.levels), p.case.description) for p in planned])
    minutes = sum(p.case.seconds for p in planned) / 60
    print(f"{len(planned)} cases, about {minutes:.0f} minutes of one core")


def _record(planned: Planned) -> dict[str, Any]:
    from verification.running.folder import parameters_of

    case = planned.case
    named = {"family": case.family, "case": case.name, "about": case.description, "levels": dict(case.levels)}
    return {**named, "seconds": case.seconds, "alone": case.exclusive, "given": parameters_of(case)}


def run_command(
    *,
    choice: Choice,
    jobs: Annotated[
        int | None, Option("--jobs", "-j", metavar="N", parser=_jobs, help="processes at once (default: the cores)")
    ] = None,
    output: Annotated[
        str | None, Option("--output", "-o", metavar="DIR", help="default: build/verification-SUITE")
    ] = None,
    resume: Annotated[bool, Option("--resume", help="go on with the run that is in DIR: what is done stays")] = False,
    run: Run,
) -> None:
    """Run the cases of a suite, each in a process of its own, and write results and report.

    $ python -m verification run --suite quick
    $ python -m verification run --family hertz -j 1
    """
    from verification import report
    from verification.running.environment import cores
    from verification.running.plan import plan, suite_of
    from verification.running.suite import locked_run, run_suite

    suite = suite_of(choice.suite, choice.family, "quick")
    planned = _possible(plan(suite, choice.family, choice.case))
    folder = Path(output) if output else Path("build") / f"verification-{suite}"
    with locked_run(folder, resume=resume):
        run.left = lambda: f"finished cases are kept in {folder}; --resume goes on"
        finished = run_suite(planned, suite, folder, jobs or cores(), _print_start, _print_case)
        report.write(finished, folder / "report.html")
    _end(finished)


def _possible(planned: Sequence[Planned]) -> list[Planned]:
    """Return what can be run here, with a line about each family that cannot.

    Raises RequestError, with what is missing, if nothing is left.
    """
    from verification.families import family

    lacking = {name: why for name in {p.case.family for p in planned} if (why := family(name).missing())}
    left = [p for p in planned if p.case.family not in lacking]
    if not left:
        raise RequestError("; ".join(f"family {name} cannot be run: {why}" for name, why in lacking.items()))
    for name, why in lacking.items():
        count = sum(p.case.family == name for p in planned)
        print(f"family {name} is left out ({count} of the cases): {why}", flush=True)
    return left


def _print_start(progress: Progress) -> None:
    """Print a line before the first case."""
    kept = f", {progress.kept} are done already" if progress.kept else ""
    print(f"{progress.count} cases to run{kept}; {_left(progress)}", flush=True)


def _print_case(done: CaseResult, progress: Progress) -> None:
    """Print a line for a case that has ended."""
    judged = [result.passed for result in done.results if result.bound != "informative" or not result.passed]
    short = judged.count(False)
    verdict = f"{f'MISSED {short}' if short else f'met {len(judged)}'} of {len(judged)} results"
    if done.failure:
        verdict = f"FAILED: {on_one_line(shorten(done.failure, 200))}"
    place = f"[{progress.ended}/{progress.count}] {done.id}"
    print(f"{place}: {verdict}, {done.seconds:.1f} s; {_left(progress)}", flush=True)


def _left(progress: Progress) -> str:
    minutes = progress.left > 90
    return f"about {progress.left / 60:.0f} min left" if minutes else f"about {progress.left:.0f} s left"


def _end(run: Finished) -> None:
    """Print the last line. Raises FallsShortError where a result is not met."""
    results = [result for done in run.done for result in done.results]
    page = run.path / "report.html"
    print(f"{len(run.done)} cases, {len(results)} results, {run.seconds / 60:.1f} min; {page}", flush=True)
    failed = [f"{done.id} has no outcome" for done in run.done if done.failure]
    short = [*failed, *(f"{done.id}: {r.quantity}" for done in run.done for r in done.results if not r.passed)]
    if short:
        names = "; ".join(short[:8]) + ("; ..." if len(short) > 8 else "")
        raise FallsShortError(f"{len(short)} of the results fall short ({names}); see the report")


def report(
    folder: Annotated[str, Argument(metavar="DIR", help="folder of a run")],
    *,
    output: Annotated[
        str | None, Option("--output", "-o", metavar="FILE", help="the page (default: DIR/report.html)")
    ] = None,
    run: Run,
) -> None:
    """Write the report of a run again, and Markdown beside it; the results too where it is not in their folder.

    $ python -m verification report build/verification-quick
    $ python -m verification report build/verification-quick -o report.html
    """
    from verification import report
    from verification.running.folder import read_run

    path = Path(output) if output else Path(folder) / "report.html"
    report.write(read_run(Path(folder)), path)
    print(path)


def compare(
    before: Annotated[str, Argument(metavar="DIR1", help="folder of a run")],
    after: Annotated[str, Argument(metavar="DIR2", help="folder of a later run")],
    *,
    run: Run,
) -> None:
    """Print what changed from one run to another.

    $ python -m verification compare build/verification-before build/verification-quick
    $ python -m verification compare build/a build/b
    """
    from verification import report
    from verification.running.folder import read_run

    print(report.compare(read_run(Path(before)), read_run(Path(after))))
