"""`python -m verification list`, `run`, `report` and `compare`."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Argument, BadParameter, Option

from lacmesh.cli.program import Run
from lacmesh.cli.terminal import print_table
from lacmesh.errors import LacmeshError, RequestError, check_installed

if TYPE_CHECKING:
    from verification.records import Case


class FallsShortError(LacmeshError):
    """Results are not met."""


@dataclass
class Choice:
    """The cases of a command."""

    suite: Annotated[
        Literal["quick", "full", "all"] | None,
        Option(help="4 minutes on two cores, 90 minutes, or hours (default: quick, or the first that has the family)"),
    ] = None
    family: Annotated[str | None, Option(metavar="F", help="the cases of one family")] = None
    case: Annotated[str | None, Option(metavar="C", help="one case, by its name or as family/name")] = None


Informative = Annotated[bool, Option("--informative", help="list results without a bound, too")]


def _jobs(text: str) -> int:
    if not text.isdecimal() or not int(text):
        raise BadParameter(f"{text} is no number of processes")
    return int(text)


def _check_extra() -> None:
    """Raise RequestError where a package is missing that runs and reports need."""
    for package in ("xdist", "matplotlib", "markdown_it"):
        check_installed(package, "verification", "python -m verification")


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
    from verification.plan import plan, suite_of

    planned = plan(suite_of(choice.suite, choice.family, "all"), choice.family, choice.case)
    if as_json:
        print(json.dumps([_record(case) for case, _ in planned], indent=1))
        return
    print_table(("case", "levels", "what"), [(case.id, str(levels), case.description) for case, levels in planned])
    minutes = sum(case.seconds for case, _ in planned) / 60
    print(f"{len(planned)} cases, with the levels of full about {minutes:.0f} minutes of one core")


def _record(case: Case) -> dict[str, Any]:
    from pydantic_core import to_json

    given = json.loads(to_json(case.parameters, inf_nan_mode="null", fallback=lambda v: v.tolist()))
    named = {"family": case.family, "case": case.name, "about": case.description, "levels": dict(case.levels)}
    return {**named, "seconds": case.seconds, "alone": case.exclusive, "given": given}


def run_command(
    *,
    choice: Choice,
    jobs: Annotated[
        int | None, Option("--jobs", "-j", metavar="N", parser=_jobs, help="processes at once (default: the cores)")
    ] = None,
    output: Annotated[
        str | None, Option("--output", "-o", metavar="DIR", help="default: build/verification-SUITE")
    ] = None,
    resume: Annotated[bool, Option("--resume", help="continue the run in DIR, without its finished cases")] = False,
    informative: Informative = False,
    run: Run,
) -> None:
    """Run the cases of a suite, and write results and report.

    $ python -m verification run --suite quick
    $ python -m verification run --family hertz -j 1
    """
    _check_extra()
    from lacmesh.threads import available_cores
    from verification import report
    from verification.plan import plan, suite_of
    from verification.running import locked, run_suite

    suite = suite_of(choice.suite, choice.family, "quick")
    planned = _possible(plan(suite, choice.family, choice.case))
    folder = Path(output) if output else Path("build") / f"verification-{suite}"
    began = time.monotonic()
    with locked(folder, resume=resume):
        run.left = lambda: f"finished cases are kept in {folder}; --resume goes on"
        finished = run_suite(planned, suite, folder, jobs or available_cores(), informative=informative)
        report.write(finished, folder / "report.html", informative=informative)
    results = [(f"{done.id}: {r.quantity}", r.passed) for done in finished.done for r in done.results()]
    missed = [name for name, passed in results if not passed]
    minutes = (time.monotonic() - began) / 60
    print(f"{len(finished.done)} cases, {len(results)} results, {minutes:.1f} min; {folder / 'report.html'}")
    if missed:
        names = "; ".join(missed[:8]) + ("; ..." if len(missed) > 8 else "")
        raise FallsShortError(f"{len(missed)} of the results miss their bound ({names}); see the report")


def _possible(planned: Sequence[tuple[Case, int]]) -> list[tuple[Case, int]]:
    """Return the cases that can be run here, with a line about each family that cannot.

    Raises RequestError, with what is missing, if no case is left.
    """
    from verification.families import family

    lacking = {name: why for name in {case.family for case, _ in planned} if (why := family(name).missing())}
    left = [one for one in planned if one[0].family not in lacking]
    if not left:
        raise RequestError("; ".join(f"family {name} cannot be run: {why}" for name, why in lacking.items()))
    for name, why in lacking.items():
        count = sum(case.family == name for case, _ in planned)
        print(f"family {name} is left out ({count} of the cases): {why}", flush=True)
    return left


def report(
    folder: Annotated[str, Argument(metavar="DIR", help="folder of a run")],
    *,
    output: Annotated[
        str | None, Option("--output", "-o", metavar="FILE", help=".html or .json (default: DIR/report.html)")
    ] = None,
    informative: Informative = False,
    run: Run,
) -> None:
    """Write the report of a run again, or its figures alone.

    $ python -m verification report build/verification-quick
    $ python -m verification report build/verification-full -o figures.json
    """
    _check_extra()
    from verification import report
    from verification.running import read_run

    path = Path(output) if output else Path(folder) / "report.html"
    report.write(read_run(Path(folder)), path, informative=informative)
    print(path)


def compare(
    before: Annotated[str, Argument(metavar="RUN1", help="folder of a run, or a file of its figures (.json)")],
    after: Annotated[str, Argument(metavar="RUN2", help="of a later run")],
    *,
    run: Run,
) -> None:
    """Print what changed from one run to another.

    $ python -m verification compare build/verification-before build/verification-quick
    $ python -m verification compare docs/verification/figures.json build/verification-full
    """
    from verification.comparison import changes

    print("\n".join(changes(Path(before), Path(after))))
