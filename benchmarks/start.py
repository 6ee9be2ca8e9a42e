"""Measure how long small work takes: commands on data/two_blocks, against importing what they build on, in one run.

    python -m benchmarks.start [--repeats N] [-o TABLE.md]

Warm: all that is compiled is kept; `check`, `quality`, `view` and `lacsolver run` against the imports of numpy,
scipy.sparse.linalg and numba (asked: at most 1.5 times as long); `info`, `convert` and `cut`, which import no numba.
First: nothing compiled before (asked: at most 4 s each; 6 s for two blocks of HEXA8, four and three cells to a side,
whose skins move). Processor time of user and system, so that others who use the machine count less, and time by the
clock, for a machine that nobody else uses; Python keeps its bytecode, as installed.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.common import blocks, main
from lacmesh import write

DATA = Path(__file__).parents[1] / "data"
#: cases whose skins move: kinematics, law of the material, and keys of the contact
MOVING = {
    "finite strains": ("finite", "neo_hookean", ""),
    "finite strains with friction": ("finite", "neo_hookean", ", friction = 0.3"),
    "smoothed normals, small strains": ("small", "elastic", ', geometry = "current", normals = "smoothed"'),
}
CASE = """mesh = "blocks.msh"
model = "3d"
kinematics = "{}"
material = [{{ law = "{}", young = 1000.0, poisson = 0.3 }}]
contact = [{{ slave = "slave", master = "master", clearance = "0.1*((x-0.5)**2+(y-0.5)**2)"{} }}]
displacement = [
  {{ group = "bottom", ux = 0.0, uy = 0.0, uz = 0.0 }},
  {{ group = "top", ux = 0.01, uy = 0.0, uz = -0.05 }},
]
"""
LACMESH, LACSOLVER = ([sys.executable, "-m", name] for name in ("lacmesh", "lacsolver"))


def commands(folder):
    """The commands, by their names."""
    mesh, out = str(DATA / "two_blocks.msh"), str(folder / "out")
    return {
        "imports": [sys.executable, "-c", "import numpy, scipy.sparse.linalg, numba"],
        "check": [*LACMESH, "check", mesh, "--slave", "slave", "--master", "master"],
        "quality": [*LACMESH, "quality", mesh],
        "view": [*LACMESH, "view", mesh, "-o", out + ".html", "--force"],
        "run": [*LACSOLVER, "run", str(DATA / "two_blocks.toml"), "-o", out, "--force"],
        "info": [*LACMESH, "info", mesh],
        "convert": [*LACMESH, "convert", mesh, out + ".vtu", "--force"],
        "cut": [*LACMESH, "cut", mesh, "--slave", "slave", "-o", out + ".msh", "--force"],
    }


def moving(folder):
    """Commands that run the cases whose skins move, by their names."""
    write(folder / "blocks.msh", blocks(4, 3, 2))
    for name, values in MOVING.items():
        (folder / f"{name}.toml").write_text(CASE.format(*values))
        yield name, [*LACSOLVER, "run", str(folder / f"{name}.toml"), "-o", str(folder / "out"), "--force"]


def seconds(command, kept):
    """Processor time of a command, and its time by the clock; `kept`: the folder of what is compiled."""
    env = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"} | {"NUMBA_CACHE_DIR": str(kept)}
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, env=env)
    if done.returncode not in (0, 1):  # `check` finds fault with a mesh that is not cut
        raise SystemExit(done.stderr)
    after, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - began
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, clock


def rows(repeats):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        every = commands(folder)
        first = {name: (every[name], 4) for name in ("check", "quality", "view", "run")}
        first |= {f"run, {name}": (command, 6) for name, command in moving(folder)}
        for name, (command, most) in first.items():
            took, _ = seconds(command, Path(tempfile.mkdtemp(dir=folder)))
            yield f"{name}, nothing compiled before", f"{took:.2f} s", f"asked: {most} s"
        seconds([*LACMESH, "compile"], folder / "kept")
        measured = {name: [] for name in every}
        for _ in range(repeats):  # in turn, so that a slow moment falls on all
            for name, command in every.items():
                measured[name].append(seconds(command, folder / "kept"))
        for name, values in measured.items():
            of_both = [np.array(pair) / base for pair, base in zip(values, measured["imports"], strict=True)]
            (processor, clock), (ratio, by_clock) = np.median(values, axis=0), np.median(of_both, axis=0)
            yield name, f"{processor:.2f} s, {clock:.2f} s", f"this / imports: {ratio:.2f}, {by_clock:.2f}"


if __name__ == "__main__":
    heads = ("what", "processor time, by the clock", "against")
    main(__doc__, lambda asked: [(heads, rows(asked.repeats))], repeats={"type": int, "default": 7})
