"""Solve the peers' problem, a cylinder on a block, with lacsolver and with every other contact code that is here.

    OMP_NUM_THREADS=1 python -m benchmarks.peers.compare [--quick] [--sizes N ...] [--python kratos=PATH ...]

The same mesh, one process and one thread each, start-up and input included. CalculiX is the program ccx; NGSolve and
Kratos are packages of this Python, or of the one that --python names. Pressures are measured alike (`problems.py`): p_m
at the middle of each macro-element, the others at the slave's nodes, NGSolve's as means of slave faces. Seconds are
medians of three runs after a first one, of the clock and, in brackets, of the processor. Rows "before" are figures of
`figures.json`: of codes that are not here, and of GetFEM and other methods. That file also has what these codes gave
for two blocks (patch test) and for two sheared cylinders (Cattaneo and Mindlin).
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

from benchmarks.common import main
from benchmarks.peers import calculix, ours
from benchmarks.peers.problems import HertzErrors, Pair, hertz, hertz_errors

ROOT = Path(__file__).resolve().parents[2]
#: seconds after which a run is stopped
PATIENCE = 900.0
#: names of pressures in the table, where a code has several
KINDS = {"p_m": ", p_m", "recovered": ", recovered", "nodes": "", "faces": ""}
TITLE = "Hertz: error of the peak / rms error of p for r < 0.9 a, %"


class Code(NamedTuple):
    """A code and its method: what writes its input and says how to run it, reads its answer, says why it is absent."""

    name: str
    write: Callable[[Pair, Path], list[str]]
    read: Callable[[Pair, Path], dict]
    absent: Callable[[], str | None] = lambda: None


class Run(NamedTuple):
    """An answer, and the seconds of the clock and of the processor that it took."""

    answer: dict
    wall: float
    own: float


def in_python(module: str, name: str, package: str, python: str) -> Code:
    """A code that is a package of some Python."""

    def absent() -> str | None:
        child = subprocess.run([python, "-c", f"import {package}"], capture_output=True, text=True, check=False)
        return child.stderr.strip().splitlines()[-1] if child.returncode else None

    def write(pair: Pair, folder: Path) -> list[str]:
        n = round(hertz(1).h / pair.h)
        return [python, "-m", f"benchmarks.peers.{module}", str(n), "answer.npz"]

    return Code(name, write, lambda _, folder: dict(np.load(folder / "answer.npz")), absent)


def codes(pythons: dict[str, str]) -> list[Code]:
    """Ours, then the others."""
    current, mortar = 'geometry = "current"', "KratosMultiphysics.ContactStructuralMechanicsApplication"
    kratos, ngsolve = (pythons.get(name, sys.executable) for name in ("kratos", "ngsolve"))
    name = "CalculiX, surface to surface penalty, K = {:g} E"
    stiff = {name.format(K): partial(calculix.write, stiffness=K) for K in calculix.STIFFNESSES}
    return [
        Code("**lacsolver**", ours.write, ours.read),
        Code(f"**lacsolver**, `{current}`", partial(ours.write, contact=current), ours.read),
        in_python("kratos", "Kratos, dual mortar, augmented Lagrangian", mortar, kratos),
        in_python("ngsolve", "NGSolve, penalty 10 E / h, order 30", "ngsolve", ngsolve),
        *(Code(name, write, calculix.read, calculix.absent) for name, write in stiff.items()),
    ]


def solved(code: Code, pair: Pair, folder: Path) -> Run | str:
    """A run in a folder of its own; where it failed, its last words."""
    command = code.write(pair, folder)
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    env = {**os.environ, **threads, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    options = {"capture_output": True, "text": True, "check": False, "timeout": PATIENCE}
    try:
        child = subprocess.run(command, cwd=folder, env=env, **options)
    except subprocess.TimeoutExpired:
        return f"not done in {PATIENCE:g} s"
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        own = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return Run(code.read(pair, folder), wall, own)
    except (OSError, ValueError, RuntimeError) as error:
        lines = (child.stderr or child.stdout).strip().splitlines()
        return f"failed: {lines[-1] if lines else error}"


def measured(code: Code, n: int, repeats: int) -> Run | str:
    """The answer, and the medians of the seconds of some runs after a first one."""
    runs = []
    for _ in range(1 + repeats):
        with tempfile.TemporaryDirectory() as folder:
            runs.append(solved(code, hertz(n), Path(folder)))
        if isinstance(runs[0], str):
            return runs[0]
    good = [run for run in runs[1:] if isinstance(run, Run)]
    return Run(runs[0].answer, median(run.wall for run in good), median(run.own for run in good))


def errors(answer: dict) -> dict[str, HertzErrors]:
    """Errors of each kind of pressure in an answer."""
    return {kind: hertz_errors(*answer[kind], float(answer["force"])) for kind in KINDS if kind in answer}


def rows(sizes: list[int], repeats: int, pythons: dict[str, str]):
    """A row for each kind of pressure of each code that is here, then those from before."""
    here = [code for code in codes(pythons) if not code.absent()]
    for code in here:
        runs = [measured(code, n, repeats) for n in sizes]
        found = [errors(run.answer) if isinstance(run, Run) else run for run in runs]
        counts = ", ".join("-" if isinstance(run, str) else str(int(run.answer["iterations"])) for run in runs)
        seconds = ", ".join("-" if isinstance(run, str) else f"{run.wall:.1f} ({run.own:.1f})" for run in runs)
        for kind in next((list(each) for each in found if not isinstance(each, str)), [""]):
            cells = [e if isinstance(e, str) else f"{100 * e[kind].peak:+.2f} / {100 * e[kind].rms:.2f}" for e in found]
            widths = ", ".join("-" if isinstance(e, str) else f"{100 * e[kind].width:+.2f}" for e in found)
            yield [code.name + KINDS.get(kind, ""), *cells, widths, counts, seconds]
    for kept in json.loads(Path(__file__).with_name("figures.json").read_text())["hertz"]:
        if kept["code"] not in {code.name for code in here}:
            cells = [kept["errors"].get(str(n), "") for n in sizes]
            yield [f"*before: {kept['code']}*", *cells, kept["width"], kept["iterations"], kept["seconds"]]


def tables(asked):
    sizes, repeats = ([4, 8], 1) if asked.quick else (asked.sizes, 3)
    heads = [TITLE, *(f"N = {n}" for n in sizes), "half-width, %", "iterations", "seconds (processor)"]
    yield heads, rows(sizes, repeats, dict(pair.split("=", 1) for pair in asked.python))


if __name__ == "__main__":
    sizes = {"nargs": "+", "type": int, "default": [4, 8, 16, 32], "metavar": "N", "help": "slave faces / half-width"}
    python = {"nargs": "*", "default": [], "metavar": "NAME=PATH", "help": "which has ngsolve, kratos"}
    main(__doc__, tables, sizes=sizes, python=python)
