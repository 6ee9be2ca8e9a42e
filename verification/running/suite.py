"""A suite from its plan to the files that all results are in."""

from __future__ import annotations

import fcntl
import json
import os
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from lacmesh import __version__
from lacmesh.cli.program import on_one_line
from lacmesh.errors import RequestError, WriteError
from lacmesh.formats.output import replace_file
from verification.families import MODULES
from verification.running.environment import environment
from verification.running.folder import RESULTS, CaseResult, Run, read_case_result, sweep, write_results
from verification.running.plan import Planned, in_order, sources
from verification.running.pool import solve_all


@dataclass
class Progress:
    """Progress of a run: `ended` of `count` cases; `kept`: done before; `left`: estimated seconds until the end."""

    count: int
    kept: int
    left: float
    ended: int = 0
    expected: float = 0.0
    began: float = field(default_factory=time.monotonic)


@contextmanager
def locked_run(folder: Path, *, resume: bool) -> Iterator[None]:
    """Hold the folder of a run, which is made where it is missing.

    Raises RequestError where it has a run already (and no `resume`) or another process is at work there, WriteError.
    """
    cases = folder / "cases"
    try:
        if cases.exists() and not resume:
            raise RequestError(f"{folder} holds a run already; --resume goes on with it, or -o names another folder")
        cases.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(cases, os.O_RDONLY)
    except OSError as error:
        raise WriteError(folder, f"cannot be used ({error.strerror or error})") from error
    try:
        _lock(descriptor, folder)
        sweep(folder)
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int, folder: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise RequestError(
            f"another process runs cases in {folder}; wait for its end, or name another folder"
        ) from error
    except OSError:  # a file system without locks
        return


def run_suite(
    planned: Sequence[Planned],
    suite: str,
    folder: Path,
    jobs: int,
    begun: Callable[[Progress], None],
    ended: Callable[[CaseResult, Progress], None],
) -> Run:
    """Run what the folder lacks; `begun` hears how much that is, `ended` of each case as it ends.

    `results.json` and `junit.xml` are always whole: they have what is known so far, with the folder's other cases.
    """
    known = _kept(planned, folder)
    todo = [p for p in planned if p.case.id not in known]
    before, around = _seconds(folder), environment()
    progress = Progress(len(todo), len(planned) - len(todo), _seconds_of(todo) / jobs)

    def run_so_far() -> Run:
        seconds = before + time.monotonic() - progress.began
        return Run(folder, __version__, suite, around, seconds, in_order(known.values()))

    run = run_so_far()
    save_results(run)
    begun(progress)
    with closing(solve_all(todo, folder, jobs)) as outcomes:
        for done in outcomes:
            known[done.id] = done
            _count(progress, todo, done, jobs)
            run = run_so_far()
            save_results(run)
            ended(done, progress)
    return run


def _kept(planned: Sequence[Planned], folder: Path) -> dict[str, CaseResult]:
    """Stored outcomes that are valid for the present code, of all cases; planned cases that failed are left out."""
    mine = {p.case.id: p for p in planned}
    places = sorted((folder / "cases").glob("*/*.json"))
    earlier = [done for place in places if (done := read_case_result(folder, place.parent.name, place.stem))]
    return {done.id: done for done in earlier if _stays(done, mine)}


def _stays(done: CaseResult, planned: Mapping[str, Planned]) -> bool:
    if done.id in planned:
        return planned[done.id].is_done(done)
    return done.family in MODULES and done.sources == sources(done.family)


def save_results(run: Run) -> None:
    """Write the results of a run, as far as they are known, to `results.json` and `junit.xml`."""
    write_results(run.path, run)
    replace_file(run.path / "junit.xml", junit(run))


def _count(progress: Progress, todo: Sequence[Planned], done: CaseResult, jobs: int) -> None:
    """Update the estimate of the remaining time by the time that a case took."""
    progress.ended += 1
    progress.expected += next(p.case.seconds for p in todo if p.case.id == done.id)
    spent = time.monotonic() - progress.began
    slower = spent * jobs / max(progress.expected, 1e-9)
    progress.left = (_seconds_of(todo) - progress.expected) * slower / jobs


def _seconds_of(planned: Sequence[Planned]) -> float:
    return sum(p.case.seconds for p in planned)


def _seconds(folder: Path) -> float:
    """Seconds that earlier sessions of this run took."""
    try:
        return float(json.loads((folder / RESULTS).read_text(encoding="utf-8"))["seconds"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0.0


# ---- the results as JUnit has them, so that programs that watch tests can read them: a suite a family, a test a case


def junit(run: Run) -> bytes:
    """The XML of a run."""
    root = ET.Element("testsuites", name=f"verification {run.suite}", time=f"{run.seconds:.3f}")
    for family, group in groupby(run.done, key=lambda done: done.family):
        cases = list(group)
        short, errors = (sum(map(f, cases)) for f in (_short, lambda done: bool(done.failure)))
        count = {"tests": str(len(cases)), "failures": str(short), "errors": str(errors)}
        time = f"{sum(done.seconds for done in cases):.3f}"
        suite = ET.SubElement(root, "testsuite", {"name": family, "time": time, **count})
        for done in cases:
            suite.append(_case(done))
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _short(done: CaseResult) -> bool:
    return not done.failure and not done.passed


def _case(done: CaseResult) -> ET.Element:
    element = ET.Element("testcase", classname=done.family, name=done.case, time=f"{done.seconds:.3f}")
    if done.failure:
        ET.SubElement(element, "error", message=on_one_line(done.failure))
    for result in done.results:
        if not result.passed:
            message = f"{result.quantity} is {result.value:.6g}, {result.bound} {result.expected}"
            ET.SubElement(element, "failure", message=on_one_line(message)).text = on_one_line(result.reason)
    return element
