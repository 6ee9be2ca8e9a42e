"""Shared by all benchmarks: meshes, seconds of runs in turn, their ratios, memory, and tables printed row by row."""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from lacmesh import Mesh, cut_skin, generate


def box(nx: int, ny: int, nz: int, cell: str = "HEXA8") -> Mesh:
    """A box of nx ny nz hexahedra, or six times as many tetrahedra; its top is the group 'slave'."""
    mesh = generate.box((nx, ny, nz), (nx, ny, nz), cell).renamed(top="slave").only("body", "slave")
    entity = np.stack([mesh.cell_dim, np.ones(mesh.n_cells, int)], axis=1).astype(np.int32)
    return replace(mesh, cell_data={"entity": entity})


def solid(kind: str, *n: int) -> Mesh:
    """A box of cells of a kind without surface cells."""
    mesh = generate.box(n, n, kind).only("body")
    return Mesh.create(mesh.points, [(kind, mesh.block(kind))], cell_groups={"body": np.arange(len(mesh.block(kind)))})


def blocks(
    n: int, m: int, depth: int, lower: str = "HEXA8", upper: str = "", hexa: str | None = "pyramid", top: int = 0
) -> Mesh:
    """Two blocks, n and m cells to a side, `depth` cells high (the upper one `top`); cut, unless `hexa` is None.

    Groups lower, upper, slave, master; top, bottom (of nodes).
    """
    low = generate.box((n, n, depth), (1, 1, 0.5), lower)
    up = generate.box((m, m, top or depth), (1, 1, 0.5), upper or lower)
    turned = up.moved(lambda x: [x[0], 1 - x[1], 0.5 - x[2]]).renamed(top="bottom", bottom="top")  # half a turn about x
    mesh = generate.stack(low, turned, slave="lower").only("lower", "upper", "slave", "master")
    mesh = mesh.with_groups("nodes", bottom=lambda x: x[2] == 0, top=lambda x: x[2] == 1)
    return mesh if hexa is None else cut_skin(mesh, "slave", hexa=hexa).mesh


def side(unknowns: int) -> int:
    """Cells along the side of the lower of two blocks (n, n - 3, n // 2) with so many unknowns."""
    return next(n for n in range(4, 200) if 3 * (n * n + (n - 3) ** 2) * (n // 2) > 0.98 * unknowns)


def n_bytes(mesh: Mesh) -> int:
    """Memory of all the arrays of a mesh."""
    arrays = [mesh.points, mesh.node_number, mesh.cell_number, *(b.nodes for b in mesh.blocks)]
    tables = (mesh.cell_groups, mesh.node_groups, mesh.cell_data, mesh.node_data)
    return sum(a.nbytes for a in (*arrays, *(a for table in tables for a in table.values())))


class Clock:
    """Seconds of the wall and of the processor, and calls, by phase."""

    def __init__(self) -> None:
        self.wall: dict[str, float] = {}
        self.cpu: dict[str, float] = {}
        self.calls: dict[str, int] = {}

    @contextmanager
    def __call__(self, phase: str) -> Iterator[None]:
        start = time.perf_counter(), time.process_time()
        yield
        self.wall[phase] = self.wall.get(phase, 0.0) + time.perf_counter() - start[0]
        self.cpu[phase] = self.cpu.get(phase, 0.0) + time.process_time() - start[1]
        self.calls[phase] = self.calls.get(phase, 0) + 1

    def around(self, phase: str, work: Callable[..., Any], kept: Any = None) -> Callable[..., Any]:
        """Wrap `work` so that its calls are timed as a phase; its results are appended to `kept`."""

        def timed(*arguments: Any, **options: Any) -> Any:
            with self(phase):
                made = work(*arguments, **options)
            if kept is not None:
                kept.append(made)
            return made

        return timed


def seconds(run: Callable[[], Any], clock: Callable[[], float] = time.perf_counter) -> float:
    """Seconds of one call, of the wall unless another clock is given."""
    start = clock()
    run()
    return clock() - start


def in_turn(runs: dict, repeats: int, clock: Callable = time.perf_counter) -> dict[Any, list[float]]:
    """Seconds of each run, several times after a first one, in turn, so that a slow moment falls on all."""
    for run in runs.values():
        run()
    took: dict[Any, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            took[name].append(seconds(run, clock))
    return took


def ratio(ours: Iterable[float], theirs: Iterable[float]) -> float:
    """The median of the ratios of runs that were timed in turn."""
    return median(a / b for a, b in zip(ours, theirs, strict=True))


def exponent(sizes: list, taken: list) -> float:
    """The slope of a line through logarithms: 1 where time grows as the size."""
    return float(np.polyfit(np.log(sizes), np.log(taken), 1)[0])


def growth(what: str, sizes: list, taken: list[float]) -> tuple[str, str, str]:
    """A row on how seconds grow with sizes."""
    listed = ", ".join(f"{n:,}: {s:.3g} s" for n, s in zip(sizes, taken, strict=True))
    return f"growth, {what}", listed, f"exponent {exponent(sizes, taken):.2f}"


def peak(run: Callable[[], Any]) -> tuple[int, Any]:
    """Bytes of memory that a call takes at most beside what is there, and its result."""
    tracemalloc.start()
    made = run()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most, made


HEADS = ("what", "measured", "against")


def main(doc: str, tables: Callable[[argparse.Namespace], Iterable], **options: dict) -> None:
    """Print the tables of a benchmark, each (heads, rows), and write them where `-o` says; `options`: argparse's."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes")
    parser.add_argument("-o", "--output", type=Path, metavar="TABLE.md", help="write the tables here too")
    for name, keywords in options.items():
        parser.add_argument(f"--{name}", **keywords)
    arguments, lines = parser.parse_args(), []
    for heads, rows in tables(arguments):
        for row in chain((heads, ["---" for _ in heads]), rows):
            lines.append(f"| {' | '.join(str(cell).replace('|', '/') for cell in row)} |")
            print(lines[-1], flush=True)
        lines.append("")
        print()
    if arguments.output:
        arguments.output.write_text("\n".join(lines))
