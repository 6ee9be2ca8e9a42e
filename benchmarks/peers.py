"""Solve the problems that contact codes are compared on, with lacsolver and with every other code that is here.

    OMP_NUM_THREADS=1 python benchmarks/peers.py [--quick] [--python getfem=PATH ...] [-o TABLE.md]

The same mesh, one process and one thread each, start-up and input included; what is absent is named. CalculiX is the
program ccx; GetFEM, NGSolve and Kratos are asked of this Python, or of the one that --python names. Pressures are
measured alike (`peer_problems`): p_m at the middle of each macro-element, the others at the slave's nodes, NGSolve's
as means of slave faces. Seconds are medians, of the clock and, in brackets, of the processor.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
import peer_calculix
import peer_ours
from peer_problems import HertzErrors, Pair, blocks, cattaneo, hertz, hertz_errors, save, shear_errors

HERE = Path(__file__).resolve().parent
#: a run that takes longer is given up
PATIENCE = 900.0
#: what pressures are called in the table, where a code has several
KINDS = {"p_m": ", p_m", "recovered": ", recovered", "nodes": "", "faces": ""}
PATCHES = {
    "3x3x2 under 2x2x2": blocks((3, 3, 2), (2, 2, 2)),
    "5x5x2 under 4x4x2, skew 0.05": blocks((5, 5, 2), (4, 4, 2), 0.05),
}
#: what others published or measured elsewhere: patch, and of the peak / rms in % by N
PUBLISHED_PATCH = {
    "code_aster LAC, hexa / pyramid": ("1.2e-13 / 3.5e-13", "1.2e-9 / 2.2e-9", "2"),
    "Kratos, dual mortar, augmented Lagrangian": ("2.4e-13", "3.8e-5", "1"),
    "CalculiX, surface to surface penalty": ("1.5e-10 to 2.7e-12", "3.4e-6", "2"),
    "CalculiX, mortar variants": ("1e-7 (printed digits)", "3.4e-6", "2"),
    "NGSolve, contact energy, order 30": ("1.5e-4", "6.8e-5", "5 to 6"),
    "GetFEM, integral or ray tracing, default / order 20": ("2.7e-2 / 5.2e-4", "2.7e-2", "2 to 4"),
}
PUBLISHED_HERTZ = {
    "Kratos, dual mortar, augmented Lagrangian": {4: "-2.1 / 1.7", 8: "-.39 / .59", 16: "+.07 / .32", 32: "+.21 / .37"},
    "CalculiX LINMORTAR (full width, nu = 0)": {4: "-.69 / .71", 8: "-.49 / .29", 16: "-.45 / .28"},
    "CalculiX, surface to surface, K = 50 E": {4: "+16 / 19", 8: "+6.1 / 5.4", 16: "+1.3 / 1.0"},
    "GetFEM, ray tracing, order 25": {8: "+.18 / 2.9", 16: "+.48 / .44"},
    "NGSolve, penalty 10": {4: "+3.8 / 4.1", 8: "+2.3 / 2.5", 16: "+1.3 / 1.3"},
}


@dataclass(frozen=True)
class Code:
    """A code and its method: why it is absent; what writes its input and says how to run it; what reads its answer.

    `friction`: whether its input here has friction.
    """

    name: str
    absent: Callable[[], str | None]
    write: Callable[[Pair, Path], list[str]]
    read: Callable[[Pair, Path], dict]
    friction: bool = False


class Run(NamedTuple):
    """An answer, and the seconds of the clock and of the processor that it took."""

    answer: dict
    wall: float
    own: float


def in_python(module: str, name: str, package: str, python: str, friction: bool = False) -> Code:
    """A code that is a package of some Python."""

    def absent() -> str | None:
        child = subprocess.run([python, "-c", f"import {package}"], capture_output=True, text=True, check=False)
        return child.stderr.strip().splitlines()[-1] if child.returncode else None

    def write(pair: Pair, folder: Path) -> list[str]:
        save(pair, folder / "pair.npz")
        (folder / "answer.npz").unlink(missing_ok=True)
        return [python, str(HERE / f"{module}.py"), "pair.npz", "answer.npz"]

    def read(pair: Pair, folder: Path) -> dict:
        with np.load(folder / "answer.npz") as answer:
            return dict(answer)

    return Code(name, absent, write, read, friction)


def codes(pythons: dict[str, str]) -> list[Code]:
    """Ours, then the others."""
    python = {name: pythons.get(name, sys.executable) for name in ("getfem", "ngsolve", "kratos")}
    stiff = [
        Code(
            f"CalculiX, surface to surface penalty, K = {K:g} E",
            peer_calculix.absent,
            lambda pair, folder, K=K: peer_calculix.write(pair, folder, K),
            peer_calculix.read,
            friction=True,
        )
        for K in peer_calculix.STIFFNESSES
    ]
    return [
        Code("**lacsolver**", lambda: None, peer_ours.write, peer_ours.read, friction=True),
        Code(
            '**lacsolver**, `geometry = "current"`',
            lambda: None,
            lambda pair, folder: peer_ours.write(pair, folder, contact='geometry = "current"'),
            peer_ours.read,
            friction=True,
        ),
        in_python("peer_kratos", "Kratos, dual mortar, augmented Lagrangian", _KRATOS, python["kratos"], friction=True),
        in_python("peer_getfem", "GetFEM, ray tracing, order 25", "getfem", python["getfem"], friction=True),
        in_python("peer_ngsolve", "NGSolve, penalty 10 E / h, order 30", "ngsolve", python["ngsolve"]),
        *stiff,
    ]


_KRATOS = "KratosMultiphysics.ContactStructuralMechanicsApplication"


def solved(code: Code, pair: Pair, folder: Path) -> Run | str:
    """A run in a folder of its own; where it failed, its last words."""
    command = code.write(pair, folder)
    one = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")}
    paths = os.pathsep.join(filter(None, [str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH")]))
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    try:
        child = subprocess.run(
            command, cwd=folder, env={**os.environ, **one, "PYTHONPATH": paths}, timeout=PATIENCE,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"not done in {PATIENCE:g} s"
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    own = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    try:
        return Run(code.read(pair, folder), wall, own)
    except (OSError, ValueError, RuntimeError) as error:
        words = (child.stderr or child.stdout).strip().splitlines()
        return f"failed: {words[-1] if words else error}"


def measured(code: Code, pair: Pair, repeats: int) -> Run | str:
    """The answer, and the medians of the seconds of some runs after a first one."""
    with tempfile.TemporaryDirectory() as folder:
        first = solved(code, pair, Path(folder))
        if isinstance(first, str):
            return first
        runs = [run for _ in range(repeats) if isinstance(run := solved(code, pair, Path(folder)), Run)] or [first]
    return Run(first.answer, median(run.wall for run in runs), median(run.own for run in runs))


def errors(answer: dict) -> dict[str, HertzErrors]:
    """Errors of each kind of pressure in an answer."""
    return {kind: hertz_errors(*answer[kind], float(answer["force"])) for kind in KINDS if kind in answer}


def patch_rows(code: Code, repeats: int) -> list[list[str]]:
    """The row of a code: errors, iterations, seconds."""
    runs = [measured(code, pair, repeats) for pair in PATCHES.values()]
    if any(isinstance(run, str) for run in runs):
        return [[code.name, *(run if isinstance(run, str) else _stress(run.answer) for run in runs), "", ""]]
    count = " / ".join(str(int(run.answer["iterations"])) for run in runs)
    seconds = ", ".join(f"{run.wall:.2f} ({run.own:.2f})" for run in runs)
    return [[code.name, *(_stress(run.answer) for run in runs), count, seconds]]


def _stress(answer: dict) -> str:
    stress, other = float(answer["stress"]), answer.get("other")
    if stress == 0.0 and other is not None:
        return f"none in 7 printed digits (other components {other:.1e})"
    return f"{stress:.1e}"


def hertz_rows(code: Code, sizes: tuple[int, ...], repeats: int) -> list[list[str]]:
    """A row for each kind of pressure of a code."""
    runs = [measured(code, hertz(n), repeats) for n in sizes]
    good = [run for run in runs if isinstance(run, Run)]
    if not good:
        return [[code.name, *map(str, runs), "", "", ""]]
    rows = []
    for kind in errors(good[0].answer):
        found = [errors(run.answer)[kind] if isinstance(run, Run) else run for run in runs]
        cells = [f if isinstance(f, str) else f"{100 * f.peak:+.2f} / {100 * f.rms:.2f}" for f in found]
        widths = ", ".join("-" if isinstance(f, str) else f"{100 * f.width:+.2f}" for f in found)
        counts = ", ".join("-" if isinstance(run, str) else str(int(run.answer["iterations"])) for run in runs)
        seconds = ", ".join("-" if isinstance(run, str) else f"{run.wall:.1f} ({run.own:.1f})" for run in runs)
        rows.append([code.name + KINDS[kind], *cells, widths, counts, seconds])
    return rows


def cattaneo_rows(code: Code, sizes: tuple[int, ...], repeats: int) -> list[list[str]]:
    """A row for each kind of traction of a code whose input has friction."""
    if not code.friction:
        return []
    runs = [measured(code, cattaneo(n), repeats) for n in sizes]
    good = [run for run in runs if isinstance(run, Run)]
    counts = ", ".join("-" if isinstance(run, str) else str(int(run.answer["iterations"])) for run in runs)
    seconds = ", ".join("-" if isinstance(run, str) else f"{run.wall:.1f} ({run.own:.1f})" for run in runs)
    rows = []
    for kind in [kind for kind in KINDS if good and kind in good[0].answer] or [""]:
        cells, widths = [], []
        for run in runs:
            if isinstance(run, str):
                cells, widths = [*cells, run], [*widths, "-"]
                continue
            found = shear_errors(*run.answer[kind], float(run.answer["force"]), float(run.answer["shear"]))
            unsolved = int(run.answer.get("unsolved", 0))
            cells.append(f"{100 * found.rms:.2f}" + (f" ({unsolved} steps not in equilibrium)" if unsolved else ""))
            widths.append(f"{100 * found.stick:+.2f}" if np.isfinite(found.stick) else "-")
        name = code.name + KINDS.get(kind, "").replace("p_m", "t_m")
        rows.append([name, *cells, ", ".join(widths), counts, seconds])
    return rows


def line(cells: list[str]) -> str:
    """A row of a Markdown table, its bars kept out of the cells."""
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def table(title: str, heads: list[str], rows: list[list[str]]) -> list[str]:
    """A table under its title."""
    return [f"### {title}", "", line(heads), line(["---"] * len(heads)), *map(line, rows), ""]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="N = 4 and 8, one run each")
    parser.add_argument(
        "--sizes", nargs="+", type=int, default=[4, 8, 16, 32], metavar="N", help="slave faces to a half-width"
    )
    parser.add_argument("--repeats", type=int, default=3, help="runs that seconds are the median of, after a first one")
    problems = ("patch", "hertz", "cattaneo")
    parser.add_argument("--problems", nargs="+", choices=problems, default=problems, help="all by default")
    parser.add_argument("--only", default="", metavar="WORD", help="codes with this word in their name")
    parser.add_argument(
        "--python", nargs="*", default=[], metavar="NAME=PATH", help="which has getfem, ngsolve, kratos"
    )
    parser.add_argument("-o", metavar="TABLE.md", help="write the tables here too")
    args = parser.parse_args()
    if args.quick:
        args.sizes, args.repeats = [4, 8], 1
    sizes, patch, cylinder, sheared = tuple(args.sizes), [], [], []
    for code in codes(dict(pair.split("=", 1) for pair in args.python)):
        if args.only.lower() not in code.name.lower():
            continue
        why = code.absent()
        if why:
            patch.append([code.name, f"absent: {why}", "", "", ""])
            cylinder.append([code.name, f"absent: {why}", *[""] * (len(sizes) + 2)])
            continue
        rows = {
            "patch": lambda code=code: patch_rows(code, args.repeats),
            "hertz": lambda code=code: hertz_rows(code, sizes, args.repeats),
            "cattaneo": lambda code=code: cattaneo_rows(code, sizes, args.repeats),
        }
        for name, into in (("patch", patch), ("hertz", cylinder), ("cattaneo", sheared)):
            if name in args.problems:
                into += rows[name]()
                print(*map(line, into[-2:]), sep="\n", file=sys.stderr, flush=True)
    patch += [[f"*published: {name}*", *cells, ""] for name, cells in PUBLISHED_PATCH.items()]
    for name, cells in PUBLISHED_HERTZ.items():
        cylinder.append([f"*published: {name}*", *(cells.get(n, "") for n in sizes), "", "", ""])
    seconds = "seconds (processor)"
    lines = table("Patch: worst |sigma_zz + P| / P", ["code, method", *PATCHES, "iterations", seconds], patch)
    heads = ["code, method", *(f"N = {n}" for n in sizes), "half-width, %", "iterations", seconds]
    lines += table("Hertz: error of the peak / rms error of p for r < 0.9 a, %", heads, cylinder)
    heads = ["code, method", *(f"N = {n}" for n in sizes), "half-width of stick, %", "iterations", seconds]
    lines += table("Cattaneo and Mindlin: rms error of t for r < 0.9 a over mu p0, %", heads, sheared)
    print("\n".join(lines))
    if args.o:
        Path(args.o).write_text("\n".join(lines))


if __name__ == "__main__":
    main()
