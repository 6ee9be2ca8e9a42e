"""The reference that the command is measured against: numpy parses the node and element blocks of a binary msh 4.1 file
and writes them again, nothing more (no checks, no groups looked at), and syncs to the disk as lacmesh does.

    python benchmarks/rewrite_msh.py IN OUT
"""

import os
import sys
from pathlib import Path

import numpy as np

NODES_OF = {1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 15: 1}


def rewrite(source: str, target: str) -> None:
    data = np.fromfile(source, np.uint8)
    raw = data.tobytes()
    nodes, elements = raw.index(b"$Nodes\n") + 7, raw.index(b"$Elements\n") + 10
    with Path(target).open("wb") as out:
        out.write(raw[:nodes])
        at = nodes
        head = np.frombuffer(raw, np.uint64, 4, at)
        out.write(head.tobytes())
        at += 32
        for _ in range(int(head[0])):
            entity = np.frombuffer(raw, np.int32, 3, at)
            n = int(np.frombuffer(raw, np.uint64, 1, at + 12)[0])
            tags = np.frombuffer(raw, np.uint64, n, at + 20).astype(np.int64)
            points = np.frombuffer(raw, float, 3 * n, at + 20 + 8 * n).reshape(n, 3).copy()
            at += 20 + 32 * n
            out.write(entity.tobytes() + np.uint64(n).tobytes())
            tags.astype(np.uint64).tofile(out)
            points.tofile(out)
        out.write(raw[at:elements])
        at = elements
        head = np.frombuffer(raw, np.uint64, 4, at)
        out.write(head.tobytes())
        at += 32
        for _ in range(int(head[0])):
            entity = np.frombuffer(raw, np.int32, 3, at)
            n = int(np.frombuffer(raw, np.uint64, 1, at + 12)[0])
            width = 1 + NODES_OF[int(entity[2])]
            rows = np.frombuffer(raw, np.uint64, n * width, at + 20).reshape(n, width)
            tags, connectivity = rows[:, 0].astype(np.int64), rows[:, 1:].astype(np.int64) - 1
            at += 20 + 8 * n * width
            out.write(entity.tobytes() + np.uint64(n).tobytes())
            again = np.empty((n, width), np.uint64)
            again[:, 0], again[:, 1:] = tags, connectivity + 1
            again.tofile(out)
        out.write(raw[at:])
        out.flush()
        os.fsync(out.fileno())


if __name__ == "__main__":
    rewrite(*sys.argv[1:])
