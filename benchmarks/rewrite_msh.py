"""Rewrite a binary msh 4.1 file: the reference of `lacmesh cut`.

    python benchmarks/rewrite_msh.py IN OUT

numpy parses the blocks of nodes and elements and writes them again, nothing more (no checks, no groups), and forces the
file to the disk as lacmesh does.
"""

import os
import sys
from pathlib import Path

import numpy as np

NODES_OF = {1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 15: 1}


def rewrite(source: str, target: str) -> None:
    raw = np.fromfile(source, np.uint8).tobytes()
    with Path(target).open("wb") as out:
        at = 0
        for section in (b"$Nodes\n", b"$Elements\n"):
            start = raw.index(section) + len(section)
            out.write(raw[at : start + 32])
            at = start + 32
            for _ in range(int(np.frombuffer(raw, np.uint64, 1, start)[0])):
                entity = np.frombuffer(raw, np.int32, 3, at)
                n = int(np.frombuffer(raw, np.uint64, 1, at + 12)[0])
                out.write(raw[at : at + 20])
                at += 20
                if section == b"$Nodes\n":
                    tags = np.frombuffer(raw, np.uint64, n, at).astype(np.int64)
                    points = np.frombuffer(raw, float, 3 * n, at + 8 * n).reshape(n, 3).copy()
                    tags.astype(np.uint64).tofile(out)
                    points.tofile(out)
                    at += 32 * n
                    continue
                table = np.frombuffer(raw, np.uint64, n * (1 + NODES_OF[int(entity[2])]), at).reshape(n, -1)
                tags, nodes = table[:, 0].astype(np.int64), table[:, 1:].astype(np.int64) - 1
                again = np.empty(table.shape, np.uint64)
                again[:, 0], again[:, 1:] = tags, nodes + 1
                again.tofile(out)
                at += again.nbytes
        out.write(raw[at:])
        out.flush()
        os.fsync(out.fileno())


if __name__ == "__main__":
    rewrite(*sys.argv[1:])
