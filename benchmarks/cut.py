"""Measure the cut and its command, as ratios against references timed in the same run.

    python -m benchmarks.cut [--quick] [-o TABLE.md]

`cut_skin` on 1e6 HEXA8 and 1e6 TETRA4 with 1e4 slave faces, and its memory beside the mesh's; the whole command on
binary msh 4.1 against `rewrite_msh.py` and against gmsh's open and write (all force their file to the disk); growth
with the mesh, and on a slab whose every cell is cut.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from statistics import median

import lacmesh
from benchmarks.common import HEADS, box, growth, in_turn, main, n_bytes, peak, ratio, seconds

GMSH = "import gmsh,sys; gmsh.initialize(); gmsh.option.setNumber('General.Terminal',0); gmsh.open(sys.argv[1]); \
gmsh.option.setNumber('Mesh.SaveAll',1); gmsh.option.setNumber('Mesh.Binary',1); gmsh.write(sys.argv[2]); \
import os; os.fsync(os.open(sys.argv[2], os.O_RDONLY))"
#: in a mesh of a million cells there are slave faces in ten thousand
SIZES = {"HEXA8": (100, 100, 100), "TETRA4": (71, 71, 33)}
QUICK = {"HEXA8": (100, 100, 10), "TETRA4": (71, 71, 4)}
#: as installed: Python keeps its bytecode, which the first, untimed turn writes
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def cut_rows(sizes):
    for cell, shape in sizes.items():
        mesh = box(*shape, cell)
        for hexa in ("pyramid", "hexa") if cell == "HEXA8" else ("pyramid",):
            cut = partial(lacmesh.cut_skin, mesh, "slave", hexa=hexa)
            took = median(seconds(cut) for _ in range(5))
            memory = f"memory beside the mesh: {peak(cut)[0] / n_bytes(mesh):.2f} of its own"
            yield f"cut_skin, {mesh.n_cells:,} cells, {cell} {hexa}", f"{took:.2f} s", memory


def command_rows(sizes, folder):
    for cell, shape in sizes.items():
        source, target = folder / f"{cell}.msh", folder / "out.msh"
        lacmesh.write(source, box(*shape, cell))
        lacmesh_cut = ["-m", "lacmesh", "cut", source, "--slave", "slave", "-o", target, "--force"]
        rivals = {
            "lacmesh cut": lacmesh_cut,
            "numpy rewrite": [Path(__file__).with_name("rewrite_msh.py"), source, target],
            "gmsh open and write": ["-c", GMSH, source, target],
        }
        run = partial(subprocess.run, check=True, capture_output=True, env=ENVIRONMENT)
        took = in_turn({name: partial(run, [sys.executable, *words]) for name, words in rivals.items()}, 5)
        for name, values in took.items():
            what = f"{name}, {cell}, {source.stat().st_size / 1e6:.0f} MB"
            yield what, f"{median(values):.2f} s", f"lacmesh / this: {ratio(took['lacmesh cut'], values):.2f}"


def growth_rows(series):
    for name, shapes in series.items():
        meshes = (box(*shape) for shape in shapes)
        rows = [(m.n_cells, min(seconds(partial(lacmesh.cut_skin, m, "slave")) for _ in "12")) for m in meshes]
        yield growth(name, *zip(*rows, strict=True))


def rows(quick):
    sizes = QUICK if quick else SIZES
    yield from cut_rows(sizes)
    with tempfile.TemporaryDirectory() as folder:
        yield from command_rows(sizes, Path(folder))
    high, wide = ((10, 30), (100, 200)) if quick else ((10, 30, 100, 300, 1000), (100, 200, 300, 500, 1000))
    series = {"mesh, 1e4 slave faces": [(100, 100, n) for n in high]}
    yield from growth_rows(series | {"slab, every cell cut": [(n, n, 1) for n in wide]})


if __name__ == "__main__":
    main(__doc__, lambda asked: [(HEADS, rows(asked.quick))])
