"""A run: pytest solves the cases in several processes, and a folder keeps the outcome of each as soon as it is known.

    results.json      version, environment, suite, results; numbers that are not finite are null
    cases.jsonl       a line for each case that has ended, with its plots and pictures: `--resume` goes on with these
    report.html       made of both by `verification.report`

A process solves one case after the other. One that crashes, is killed or takes too long fails the case that it was
solving, and pytest-xdist starts another process in its place.
"""

from __future__ import annotations

import fcntl
import json
import os
import platform
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, cast

import pytest
from pydantic import TypeAdapter
from pydantic_core import to_json

from lacmesh import __version__
from lacmesh.cli.program import on_one_line
from lacmesh.errors import RequestError, writing
from lacmesh.formats.output import replace_file, signals_wait
from lacmesh.threads import available_cores
from verification.cases import as_text
from verification.comparison import RESULTS, FolderError
from verification.families import MODULES
from verification.plan import ROOT, sources
from verification.records import Case, Outcome, Result

CASES = "cases.jsonl"
#: seconds after which a case is given up
PATIENCE = 3600.0
#: of pytest: nothing of the user's configuration, no other plugins, one case at a time to each process
ARGUMENTS = [
    "-c", os.devnull, "--rootdir", str(ROOT), "--disable-plugin-autoload", "-p", "xdist", "-p", "no:terminal",
    "-p", "no:cacheprovider", "-p", "no:warnings", "--dist", "load", "--maxschedchunk", "1",
    str(Path(__file__).with_name("cases.py")),
]  # fmt: skip
#: what libraries read the number of threads from
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
#: packages whose versions may matter
_PACKAGES = ("numpy", "scipy", "numba", "rslab", "pyamg", "sympy", "gmsh", "pyvista", "matplotlib")


@dataclass(frozen=True)
class CaseResult:
    """Outcome of a case on so many meshes (`levels`). `sources`: digest of the code; `log`: output of a failed case."""

    family: str
    case: str
    levels: int
    seconds: float
    sources: str
    outcome: Outcome
    log: str = ""

    @property
    def id(self) -> str:
        """`family/case`."""
        return f"{self.family}/{self.case}"

    def results(self, *, informative: bool = False) -> list[Result]:
        """The results with a bound, or all on request; a failure is a result that is missed, and so is no number."""
        if self.outcome.failure:
            return [Result("outcome", float("nan"), None, None, False, "", self.outcome.failure, "informative")]
        return [r for r in self.outcome.results if informative or r.bound != "informative" or not r.passed]


@dataclass(frozen=True)
class Run:
    """Content of a folder. `done`: in the order of the families, each by the names of its cases."""

    path: Path
    version: str
    suite: str
    environment: Mapping[str, str]
    done: tuple[CaseResult, ...]


# ---- the folder


@contextmanager
def locked(folder: Path, *, resume: bool) -> Iterator[None]:
    """Keep the folder of a run for this process; the folder is made where it is missing.

    Raises RequestError where it has a run already (without `resume`) or another process is at work there, WriteError.
    """
    if (folder / CASES).exists() and not resume:
        raise RequestError(f"{folder} holds a run already; --resume goes on with it, or -o names another folder")
    with writing(folder, "cannot be used"):
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / CASES).open("ab")
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RequestError(f"another process runs cases in {folder}; wait for it or use another folder") from error
        except OSError:  # a file system without locks
            pass
        yield


def read_cases(folder: Path) -> dict[str, CaseResult]:
    """The cases that a folder keeps, by `family/case`; lines that cannot be read are left out."""
    reader, done = TypeAdapter(CaseResult), dict[str, CaseResult]()
    for line in (folder / CASES).read_bytes().splitlines():
        with suppress(ValueError):
            one = reader.validate_json(line)
            done[one.id] = one
    return done


def read_run(folder: Path) -> Run:
    """Read the folder of a run. Raises FolderError, with the reason."""
    try:
        head = json.loads((folder / RESULTS).read_text(encoding="utf-8"))
        return Run(folder, head["version"], head["suite"], head["environment"], _in_order(read_cases(folder).values()))
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise FolderError(f"{folder} is not the folder of a run ({error}); name one that `run -o` made") from error


def _in_order(done: Iterable[CaseResult]) -> tuple[CaseResult, ...]:
    return tuple(sorted(done, key=lambda one: ([*MODULES, one.family].index(one.family), one.case)))


def rows(run: Run, *, informative: bool) -> Iterator[dict[str, Any]]:
    """The results of a run as `results.json` has them."""
    for done in run.done:
        for result in done.results(informative=informative):
            plain = json.loads(to_json(result, inf_nan_mode="null", fallback=lambda v: v.tolist()))
            yield {"family": done.family, "case": done.case, **plain, "seconds": done.seconds}


# ---- the run


def run_suite(
    planned: Sequence[tuple[Case, int]], suite: str, folder: Path, jobs: int, *, informative: bool = False
) -> Run:
    """Solve the cases that the folder lacks, in so many processes; those that measure time come last, alone.

    A line is printed for each. The folder keeps its other cases where they are those of the present code. However the
    run ends, `results.json` has all that is known.
    """
    levels = {case.id: number for case, number in planned}
    known = {
        name: done for name, done in read_cases(folder).items()
        if done.sources == sources() and levels.get(name, done.levels) == done.levels
        and not (done.outcome.failure and name in levels)
    }  # fmt: skip
    _append(folder, known.values(), "wb")
    todo = sorted((one for one in planned if one[0].id not in known), key=lambda one: -one[0].seconds)
    expected = {case.id: case.seconds for case, _ in todo}
    began, everything, around = time.monotonic(), sum(expected.values()), environment()
    there = f", {len(planned) - len(todo)} are done already" if len(todo) < len(planned) else ""
    print(f"{len(todo)} cases to run{there}; {_about(everything / jobs)}", flush=True)

    def keep(done: CaseResult) -> None:
        known[done.id] = done
        _append(folder, [done])
        ended = [seconds for name, seconds in expected.items() if name in known]
        left = (time.monotonic() - began) * (everything / sum(ended) - 1)
        place, verdict = f"[{len(ended)}/{len(todo)}] {done.id}", f"{_verdict(done)}, {done.seconds:.1f} s"
        print(f"{place}: {verdict}; {_about(left)}", flush=True)

    try:
        _solve([one for one in todo if not one[0].exclusive], jobs, keep)
        _solve([one for one in todo if one[0].exclusive], 1, keep)
    finally:
        run = Run(folder, __version__, suite, around, _in_order(known.values()))
        listed = list(rows(run, informative=informative))
        content = {"version": __version__, "environment": around, "suite": suite, "results": listed}
        replace_file(folder / RESULTS, json.dumps(content, indent=1, allow_nan=False).encode())
    return run


def _append(folder: Path, cases: Iterable[CaseResult], mode: str = "ab") -> None:
    with signals_wait(), writing(folder / CASES), (folder / CASES).open(mode) as file:
        file.writelines(as_text(done).encode() + b"\n" for done in cases)


def _verdict(done: CaseResult) -> str:
    if done.outcome.failure:
        return f"FAILED: {on_one_line(done.outcome.failure[:200])}"
    judged = [result.passed for result in done.results()]
    missed = judged.count(False)
    return f"{f'MISSED {missed}' if missed else f'met {len(judged)}'} of {len(judged)} results"


def _about(seconds: float) -> str:
    return f"about {seconds / 60:.0f} min left" if seconds > 90 else f"about {seconds:.0f} s left"


def _solve(planned: Sequence[tuple[Case, int]], jobs: int, ended: Callable[[CaseResult], None]) -> None:
    """Solve cases by pytest, in at most so many processes. An exception that stops pytest is raised again."""
    if not planned:
        return
    jobs = min(jobs, len(planned))
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    parts = [cores[k::jobs] or cores for k in range(jobs)]
    session = _Session(planned, parts, ended)
    threads = "".join(f"//env:{name}={len(parts[0]) or 1}" for name in _THREADS)
    restarts = ["--max-worker-restart", str(len(planned))]  # each case may end a process once
    pytest.main([*ARGUMENTS, *restarts, "--tx", f"{jobs}*popen{threads}"], plugins=[session])
    if session.error is not None:
        raise session.error
    if session.left:
        raise RuntimeError(f"the processes that solve cases ended before {', '.join(sorted(session.left))}")


class _Session:
    """Plugin of pytest in the process that starts the others: it sends them the plan, and takes the outcomes."""

    def __init__(
        self, planned: Sequence[tuple[Case, int]], cores: list[list[int]], ended: Callable[[CaseResult], None]
    ) -> None:
        self.planned, self.ended, self.free = {case.id: (case, n) for case, n in planned}, ended, cores
        self.left = set(self.planned)
        self.cores, self.pids, self.began = dict[str, list[int]](), dict[str, int](), dict[str, float]()
        self.status, self.error = 0, cast("BaseException | None", None)

    def pytest_configure_node(self, node: Any) -> None:
        """Send a new process its plan."""
        name = node.gateway.id
        self.pids[name], self.cores[name] = node.gateway._rinfo().pid, self.free.pop()
        cases = [(case.family, case.name, levels) for case, levels in self.planned.values()]
        node.workerinput["verification"] = {"cases": cases, "cores": self.cores[name], "patience": PATIENCE}

    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """End the children of a process that has ended, and keep its exit status."""
        pid = self.pids.pop(node.gateway.id)
        self.free.append(self.cores[node.gateway.id])
        if error:
            _kill(pid)
            self.status = 0
            with suppress(ChildProcessError):  # execnet was there first
                _, self.status = os.waitpid(pid, 0)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Take the time at which a case is begun."""
        self.began[nodeid] = time.monotonic()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take the outcome of a case, or the reason why it has none."""
        if report.when in ("setup", "teardown"):
            return
        sent = dict(report.user_properties)
        seconds = float(str(sent.get("seconds", time.monotonic() - self.began[report.nodeid])))
        if "outcome" in sent:
            outcome = TypeAdapter(Outcome).validate_json(str(sent["outcome"]))
        else:
            outcome = Outcome(failure=_why(self.status, seconds))
        log = report.capstdout + report.capstderr if outcome.failure else ""
        case, levels = self.planned[report.nodeid.partition("[")[2][:-1]]
        self.left.discard(case.id)
        self.ended(CaseResult(case.family, case.name, levels, seconds, sources(), outcome, log))

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Keep the reason why a process cannot load the cases."""
        if report.failed:
            self.error = RuntimeError(report.longreprtext)

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        """Stop all processes."""
        self.error = self.error or excinfo.value
        for pid in self.pids.values():
            _kill(pid)

    def pytest_internalerror(self, excinfo: pytest.ExceptionInfo[BaseException]) -> bool:
        """Stop all processes; pytest prints nothing."""
        self.pytest_keyboard_interrupt(excinfo)
        return True


def _kill(pid: int) -> None:
    """End a process and those that it started: it leads their group."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def _why(status: int, seconds: float) -> str:
    """Reason why a process left no outcome. `status`: its exit status as `os.waitpid` has it."""
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        name = {int(one): one.name for one in signal.Signals}.get(-code, f"signal {-code}")
        return f"killed by {name}{', perhaps for want of memory' if -code == signal.SIGKILL else ''}"
    if seconds > PATIENCE:
        return f"not done in {PATIENCE:g} s"
    return f"the process ended with status {code} and no results"


# ---- the environment


def environment() -> dict[str, str]:
    """Versions, the machine and the commit of the sources, in the order of the report."""
    info, commit = Path("/proc/cpuinfo"), ""
    names = re.findall(r"model name\s*: (.*)", info.read_text()) if info.exists() else []
    if (ROOT / ".git").exists():
        with suppress(OSError):
            command = ["git", "describe", "--always", "--dirty=, with changes", "--abbrev=12", "--exclude=*"]
            commit = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
    machine = {
        "lacmesh": __version__,
        "commit": commit or "unknown",
        "Python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": names[0] if names else platform.processor() or "unknown",
        "cores": str(available_cores()),
    }
    installed = {one.name: one.version for one in distributions()}
    return {**machine, **{name: installed.get(name, "absent") for name in _PACKAGES}}
