"""Measure the partition of large meshes: to read, distribute, write, read a part back, and cut a part.

    python benchmarks/partition.py [--quick]

Blocks of 1e6 and 1e7 HEXA8 with the group 'slave' on top, in 64 parts. Seconds of the processor, and of the clock where
the disk is in them. The parts of the smaller one are cut too, all of them, and compared with the cut of the whole mesh.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from meshes import box

import lacmesh
from lacmesh.mesh import Mesh
from lacmesh.partition import Part, cut_part, describe_parts, distribute_nodes, read_part, write_parts

RANKS = 64
T = TypeVar("T")


def timed(run: Callable[[], T]) -> tuple[T, str]:
    """Return the result of a function, and the seconds it took of the processor and, in brackets, of the clock."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = run()
    return result, f"{time.process_time() - cpu:.2f} ({time.perf_counter() - wall:.2f})"


def divided(n: int, folder: Path) -> tuple[Mesh, str]:
    """Write a block of n^3 cells and its parts into a folder; return the block and a line of the table."""
    made = box(n, n, n)
    lacmesh.write(folder / "block.msh", made)
    mesh, reading = timed(lambda: lacmesh.read(folder / "block.msh"))
    owner, distributing = timed(lambda: distribute_nodes(mesh, RANKS))
    _, writing = timed(lambda: write_parts(folder / "parts", mesh, owner))
    _, one = timed(lambda: read_part(folder / "parts", RANKS // 2, everywhere=["slave"]))
    copies = describe_parts(folder / "parts")["copies"]
    return mesh, f"| {mesh.n_cells:,} | {reading} | {distributing} | {writing} | {one} | {copies:.2f} |"


def cut_by_parts(mesh: Mesh, folder: Path, hexa: str) -> str:
    """Return a line on the cut of every part, each compared with the cut of the whole mesh cell by cell."""
    whole, serial = timed(lambda: lacmesh.cut_skin(mesh, "slave", hexa=hexa, recognise=False).mesh)
    owned, seconds = 0, []
    for rank in range(RANKS):
        part = read_part(folder / "parts", rank, everywhere=["slave"])
        start = time.process_time()
        cut = cut_part(part, "slave", hexa=hexa)
        seconds.append(time.process_time() - start)
        compare(cut, whole)
        owned += np.count_nonzero(cut.own)
    assert owned == whole.n_nodes
    return f"| {hexa} | {whole.n_cells - mesh.n_cells:,} | {serial} | {np.mean(seconds):.2f}, {max(seconds):.2f} |"


def compare(part: Part, whole: Mesh) -> None:
    """Raise AssertionError unless the nodes and cells of a part are those of the whole mesh."""
    assert (part.mesh.points == whole.points[part.node]).all()
    assert (part.mesh.node_number == whole.node_number[part.node]).all()
    assert (part.mesh.cell_number == whole.cell_number[part.cell]).all()
    cells = zip(part.mesh.select(np.arange(part.mesh.n_cells)), whole.select(part.cell), strict=True)
    for (kind, _, nodes), (other, _, expected) in cells:
        assert kind == other and (part.node[nodes] == expected).all()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the size")
    sizes = (46, 100) if parser.parse_args().quick else (100, 216)
    print(f"| cells | read | distribute | write {RANKS} parts | read one | copies of a node |")
    print("|---:|---:|---:|---:|---:|---:|")
    lines = []
    for n in sizes:
        with tempfile.TemporaryDirectory() as name:
            mesh, line = divided(n, Path(name))
            print(line)
            if n == sizes[0]:
                lines = [cut_by_parts(mesh, Path(name), hexa) for hexa in ("pyramid", "hexa")]
    print(
        "\n| variant | new cells | whole cut | cut of a part: mean, slowest |\n|---|---:|---:|---:|", *lines, sep="\n"
    )


if __name__ == "__main__":
    main()
