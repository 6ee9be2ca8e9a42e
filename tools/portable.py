"""Run the tests of the numbers as processors of several kinds would compute them: a line for each configuration.

python tools/portable.py              all; the exit status is 1 where one has a failure, and it goes on to the others
python tools/portable.py NAME ...     some of them
python tools/portable.py --list       what each sets, and whether this machine can run it

The last bits of a result come from OpenBLAS (numpy and scipy bring one each), from what numba compiles for the
processor, from numpy's own loops, and from the number of threads. Each configuration changes one of these, `oldest` all
of them. What took effect is asked of a process that computes so, and told; a configuration that computes here as one
before it (OpenBLAS has no kernels of that name, or the processor is of that kind) is not run a second time.
numba keeps what it compiles for each kind of processor apart: only the first run of a kind compiles.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT / "build" / "portable"
#: what is run: lacsolver, and what is computed by the compiled kernels of lacmesh
TESTS = (
    "tests/lacsolver",
    "tests/surface",
    "tests/smooth",
    "tests/topology",
    "tests/test_quality.py",
    "tests/test_quality_verdict.py",
    "tests/test_kernels.py",
    "tests/checks/test_corpus.py",
    "tests/checks/test_healthy.py",
)
#: but neither what takes long nor what draws, nor what runs in the environment of PETSc
MARKS = "not slow and not vtk and not browser and not petsc"
#: Look at what computes: run in a process that is set up as a configuration says.
PROBE = """
import json
from pathlib import Path
import numba, numpy.linalg, scipy.linalg
from numba.core.registry import cpu_target
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__
from threadpoolctl import threadpool_info
from lacmesh.kernels.threads import available_cores
blas = [lib for lib in threadpool_info() if lib["internal_api"] == "openblas"]
features = sorted(name for name, there in __cpu_features__.items() if there)
print(json.dumps({
    "openblas": {Path(lib["filepath"]).parent.name: lib["architecture"] for lib in blas},
    "numba": cpu_target.target_context.codegen().magic_tuple()[1],
    "numpy": [name for name in __cpu_dispatch__ if name in features],
    "threads": {lib["num_threads"] for lib in blas} | {available_cores()},
    "features": features,
}, default=sorted))
"""


class Configuration(NamedTuple):
    """A name, the variables it sets, the features of a processor and the number of cores that it needs."""

    name: str
    sets: Mapping[str, str] = {}
    needs: tuple[str, ...] = ()
    cores: int | None = None


def configurations(switchable: str) -> tuple[Configuration, ...]:
    """All of them; `switchable`: the features that numpy can be told not to use."""
    old_numba = {"NUMBA_CPU_NAME": "generic"}
    old_numpy = {"NPY_DISABLE_CPU_FEATURES": switchable}
    return (
        Configuration("own"),
        Configuration("nehalem", {"OPENBLAS_CORETYPE": "Nehalem"}, ("SSE42",)),
        Configuration("haswell", {"OPENBLAS_CORETYPE": "Haswell"}, ("AVX2", "FMA3")),
        Configuration("zen", {"OPENBLAS_CORETYPE": "Zen"}, ("AVX2", "FMA3")),
        Configuration("skylakex", {"OPENBLAS_CORETYPE": "SkylakeX"}, ("AVX512_SKX",)),
        Configuration("sapphirerapids", {"OPENBLAS_CORETYPE": "Sapphirerapids"}, ("AVX512_SPR",)),
        Configuration("generic", old_numba),
        Configuration("plain-numpy", old_numpy),
        Configuration("one-thread", cores=1),
        Configuration("two-threads", cores=2),
        Configuration("oldest", {"OPENBLAS_CORETYPE": "Nehalem", **old_numba, **old_numpy}, ("SSE42",), cores=1),
    )


#: variables that would change what computes, and are taken away where a configuration does not set them
TAKEN_AWAY = {name for made in configurations("") for name in made.sets} | {
    *("NPY_ENABLE_CPU_FEATURES", "NUMBA_CPU_FEATURES", "NUMBA_DISABLE_JIT", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
}


def started(configuration: Configuration, words: list[str], **rest: object) -> subprocess.CompletedProcess:
    """Run Python with some words as a configuration says, whatever is set outside, and wait for its end."""
    environment = {name: value for name, value in os.environ.items() if name not in TAKEN_AWAY}
    path = filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))  # the checkout, also beside an installed lacmesh
    environment |= {**configuration.sets, "PYTHONPATH": os.pathsep.join(path)}
    hold = None
    if configuration.cores:
        hold = partial(os.sched_setaffinity, 0, sorted(os.sched_getaffinity(0))[: configuration.cores])
    return subprocess.run(
        [sys.executable, *words],
        env=environment,
        cwd=ROOT,
        text=True,
        check=False,
        preexec_fn=hold,
        **rest,
    )


def look(configuration: Configuration) -> dict:
    """Probe a configuration: names of the libraries that compute, and the numbers of threads and cores."""
    done = started(configuration, ["-c", PROBE], stdout=subprocess.PIPE)
    if done.returncode:
        raise SystemExit(f"{configuration.name}: numpy, scipy and numba do not start (exit status {done.returncode})")
    return json.loads(done.stdout)


def lacking(configuration: Configuration, own: dict) -> str | None:
    """Why this machine cannot run a configuration, or None."""
    missing = [name for name in configuration.needs if name not in own["features"]]
    if missing:
        return f"the processor has no {' and no '.join(missing)}"
    if configuration.cores and not hasattr(os, "sched_setaffinity"):
        return "this system does not hold a process to some cores"
    if (configuration.cores or 0) > max(own["threads"]):
        return f"there are fewer than {configuration.cores} cores"
    return None


def said(got: dict) -> str:
    """Describe the libraries that compute in words."""
    blas = " and ".join(sorted(set(got["openblas"].values()))) or "not found"
    numpy = ", ".join(got["numpy"]) or "baseline"
    return f"OpenBLAS {blas}; numba {got['numba']}; numpy {numpy}; threads {' or '.join(map(str, got['threads']))}"


def counts(report: Path) -> dict[str, int]:
    """Passed, failed and skipped tests, from pytest's report in XML; nothing where there is none."""
    if not report.exists():
        return {}
    (suite,) = ElementTree.parse(report).getroot().iter("testsuite")
    failed, skipped = int(suite.get("failures")) + int(suite.get("errors")), int(suite.get("skipped"))
    return {"passed": int(suite.get("tests")) - failed - skipped, "failed": failed, "skipped": skipped}


def tested(configuration: Configuration, tests: list[str]) -> tuple[bool, str]:
    """Run the tests as a configuration says: whether all passed, and how many did, in words. A log is kept."""
    LOGS.mkdir(parents=True, exist_ok=True)
    log, report = (LOGS / f"{configuration.name}.{suffix}" for suffix in ("txt", "xml"))
    report.unlink(missing_ok=True)
    words = ["-m", "pytest", "-q", "-n", "2", "-m", MARKS, "-p", "no:cacheprovider", f"--junitxml={report}", *tests]
    begun = time.monotonic()
    with log.open("w") as file:  # what is not compiled yet would run as it stands, as Python
        started(configuration, ["-m", "lacmesh", "compile"], stdout=file, stderr=subprocess.STDOUT)
        status = started(configuration, words, stdout=file, stderr=subprocess.STDOUT).returncode
    told = ", ".join(f"{count:,} {word}" for word, count in counts(report).items()) or "no result"
    where = f" (exit status {status}, {log})" if status else ""
    return status == 0, f"{told} in {time.monotonic() - begun:.0f} s{where}"


def results(chosen: list[str], tests: list[str] | None) -> Iterator[tuple[str, bool, str]]:
    """Name, whether it is well, and a line, of each configuration that is chosen; `tests` None: look, run nothing."""
    own = look(Configuration("own"))
    seen: list[tuple[str, dict]] = []
    for configuration in configurations(" ".join(own["numpy"])):
        if configuration.name not in chosen:
            continue
        reason = lacking(configuration, own)
        if reason:
            yield configuration.name, True, f"left out: {reason}"
            continue
        got = look(configuration)
        same = next((name for name, other in seen if other == got), None)
        seen.append((configuration.name, got))
        if same or tests is None:
            well, told = True, f"computes as {same} does" if same else "can be run"
        else:
            well, told = tested(configuration, tests)
        yield configuration.name, well, f"{told}; {said(got)}"


def main() -> int:
    """Print a line for each configuration; 1 where a test failed in one."""
    names = [made.name for made in configurations("")]
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(names)}; all where there is none")
    parser.add_argument("--list", action="store_true", help="tell what computes in each, and run nothing")
    parser.add_argument("--tests", nargs="+", default=list(TESTS), metavar="PATH", help="other tests than the usual")
    args = parser.parse_args()
    unknown = sorted(set(args.names) - set(names))
    if unknown:
        parser.error(f"no configuration {', '.join(unknown)}; there are {', '.join(names)}")
    bad = []
    for name, well, line in results(args.names or names, None if args.list else args.tests):
        print(f"{name:15} {line}", flush=True)
        bad += [] if well else [name]
    if bad:
        print(f"tests fail in: {', '.join(bad)}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
