"""Measure the cut and the command, as ratios against references timed in the same run.

    python benchmarks/run.py [--quick] [-o TABLE.md]

`cut_skin` on 1e6 HEXA8 and 1e6 TETRA4 with 1e4 slave faces, its memory beside the mesh's; the first mesh read from MED,
with the skin's numbers first, and with shuffled numbers (at most 1.3 times as long); the whole command on binary
msh 4.1 against `rewrite_msh.py` and against gmsh's open and write (all force their file to the disk); growth with the
mesh, with the skin, and on a slab whose every cell is touched.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
from meshes import box, n_bytes

import lacmesh

LACMESH = [sys.executable, "-m", "lacmesh", "cut"]
HERE = Path(__file__).parent
GMSH = "import gmsh,sys; gmsh.initialize(); gmsh.option.setNumber('General.Terminal',0); gmsh.open(sys.argv[1]); \
gmsh.option.setNumber('Mesh.SaveAll',1); gmsh.option.setNumber('Mesh.Binary',1); gmsh.write(sys.argv[2]); \
import os; os.fsync(os.open(sys.argv[2], os.O_RDONLY))"


def timed(run, repeats):
    """Seconds of each of several calls."""
    out = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        out.append(time.perf_counter() - start)
    return out


def cut_rows(sizes, repeats):
    for cell, shape in sizes.items():
        mesh = box(*shape, cell)
        for hexa in ("pyramid", "hexa") if cell == "HEXA8" else ("pyramid",):
            seconds = timed(lambda m=mesh, h=hexa: lacmesh.cut_skin(m, "slave", hexa=h), repeats)
            tracemalloc.start()
            lacmesh.cut_skin(mesh, "slave", hexa=hexa)
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            memory = f"memory beside the mesh: {peak / n_bytes(mesh):.2f} of its own"
            yield f"cut_skin, {mesh.n_cells:,} cells, {cell} {hexa}", f"{median(seconds):.2f} s", memory


def number_rows(sizes, repeats, folder):
    """Time the cut of one mesh under several numberings, in alternation with the original one."""
    mesh = box(*sizes["HEXA8"], "HEXA8")
    lacmesh.write(folder / "numbers.med", mesh)
    skin, mix = len(mesh.blocks[1].nodes), np.random.default_rng(0)
    others = {
        "read from MED": lacmesh.read(folder / "numbers.med"),
        "skin numbered first": replace(mesh, cell_number=1 + (np.arange(mesh.n_cells) + skin) % mesh.n_cells),
        "numbers shuffled": replace(
            mesh,
            cell_number=1 + mix.permutation(mesh.n_cells),
            node_number=1 + mix.permutation(mesh.n_nodes),
        ),
    }
    seconds = {name: [] for name in ("", *others)}
    for _ in range(repeats):
        for name, other in {"": mesh, **others}.items():
            seconds[name] += timed(lambda m=other: lacmesh.cut_skin(m, "slave"), 1)
    for name in others:
        ratio = median(a / b for a, b in zip(seconds[name], seconds[""], strict=True))
        yield f"cut_skin, HEXA8, {name}", f"{median(seconds[name]):.2f} s", f"this / as made: {ratio:.2f}"


def command_rows(sizes, repeats, folder):
    for cell, shape in sizes.items():
        source, target = folder / f"{cell}.msh", folder / "out.msh"
        lacmesh.write(source, box(*shape, cell))
        rivals = {
            "lacmesh cut": [
                sys.executable,
                "-m",
                "lacmesh",
                "cut",
                source,
                "--slave",
                "slave",
                "-o",
                target,
                "--force",
            ],
            "numpy rewrite": [sys.executable, HERE / "rewrite_msh.py", source, target],
            "gmsh open and write": [sys.executable, "-c", GMSH, source, target],
        }
        # as installed: Python keeps its bytecode, which the first, untimed turn writes
        env = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        for command in rivals.values():
            subprocess.run(command, check=True, capture_output=True, env=env)
        seconds = {name: [] for name in rivals}
        for _ in range(repeats):  # in turn, so that a slow moment falls on all
            for name, command in rivals.items():
                run = lambda c=command, e=env: subprocess.run(c, check=True, capture_output=True, env=e)  # noqa: E731
                seconds[name] += timed(run, 1)
        ours = seconds["lacmesh cut"]
        for name, values in seconds.items():
            ratio = median(a / b for a, b in zip(ours, values, strict=True))
            yield (f"{name}, {cell}, {source.stat().st_size / 1e6:.0f} MB", f"{median(values):.2f} s",
                   f"lacmesh / this: {ratio:.2f}")  # fmt: skip


def growth_rows(series, repeats):
    for name, shapes in series.items():
        sizes, seconds = [], []
        for shape in shapes:
            mesh = box(*shape)
            sizes.append(mesh.n_cells)
            seconds.append(min(timed(lambda m=mesh: lacmesh.cut_skin(m, "slave"), repeats)))
        slope = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
        listed = ", ".join(f"{n:,}: {s:.2f} s" for n, s in zip(sizes, seconds, strict=True))
        yield f"growth, {name}", listed, f"exponent {slope:.2f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the size")
    parser.add_argument("-o", "--output", type=Path, help="write the table here as well")
    args = parser.parse_args()
    k = 1 if args.quick else 2
    sizes = {"HEXA8": (100, 100, 10**k), "TETRA4": (71, 71, 33 if k == 2 else 4)}
    series = {
        "mesh, 1e4 slave faces": [(100, 100, n) for n in ((10, 30) if k == 1 else (10, 30, 100, 300, 1000))],
        "slab, every cell touched": [(n, n, 1) for n in ((100, 200) if k == 1 else (100, 200, 300, 500, 1000))],
    }
    rows = list(cut_rows(sizes, 5))
    with tempfile.TemporaryDirectory() as folder:
        rows += number_rows(sizes, 5, Path(folder))
        rows += command_rows(sizes, 5, Path(folder))
    rows += growth_rows(series, 2)
    text = "| what | measured | against |\n|---|---|---|\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows)
    print(text)
    if args.output:
        args.output.write_text(text)


if __name__ == "__main__":
    main()
