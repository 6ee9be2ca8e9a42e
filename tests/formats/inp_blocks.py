"""Jobs of CalculiX on meshes of ours: two blocks pressed together, and a pressure on one facet of one cell."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.generate.parts import assembled
from verification.meshes.blocks import block, joined, rows_of

#: Young's modulus, pressure, stiffness of the contact (pressure over overclosure).
E, P, K = 1000.0, 2.0, 1e5
PRESSED = f"""\
*INCLUDE, INPUT=mesh.inp
*MATERIAL, NAME=M
*ELASTIC
{E}, 0.
*SOLID SECTION, ELSET=lower, MATERIAL=M
*SOLID SECTION, ELSET=upper, MATERIAL=M
*SURFACE INTERACTION, NAME=I
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
{K}
*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE
slave, master
*BOUNDARY
base, 1, 3, 0.
all, 1, 2, 0.
*STEP
*STATIC
*DSLOAD
press, P, {P}
*NODE PRINT, NSET=base, TOTALS=ONLY
RF
*NODE PRINT, NSET=press
U
*EL PRINT, ELSET=upper
S
*EL PRINT, ELSET=lower
S
*END STEP
"""
#: To be filled with springs, three at each node: their elements, and sets of those along x, y and z.
ONE_FACET = f"""\
*INCLUDE, INPUT=mesh.inp
{{springs}}
*MATERIAL, NAME=M
*ELASTIC
{E}, 0.
*SOLID SECTION, ELSET=body, MATERIAL=M
*STEP
*STATIC
*DSLOAD
slave, P, {P}
*NODE PRINT, NSET=all
U
*END STEP
"""


def on_springs(n_nodes, section="", axes=(1, 2, 3)):
    """`ONE_FACET` with springs of stiffness E at nodes 1 to n_nodes; `section`: of a plane cell, or a shell."""
    lines = []
    for axis in axes:
        lines.append(f"*ELEMENT, TYPE=SPRING1, ELSET=along{axis}")
        lines += [f"{1000 * axis + node}, {node}" for node in range(1, n_nodes + 1)]
        lines += [f"*SPRING, ELSET=along{axis}", f"{axis}", f"{E}"]
    job = ONE_FACET.replace("{springs}", "\n".join(lines))
    return job.replace("*SOLID SECTION, ELSET=body, MATERIAL=M", section) if section else job


def two_blocks(kind):
    """Unit cubes, or squares one unit from the axis, of 2 and 3 cells a side, the second on the first.

    Their groups are those of `PRESSED`; other sides have no cells.
    """
    dim = CELLS[kind].dim
    up, low = "xyz"[dim - 1], np.array([1.0, 0.0]) if dim == 2 else np.zeros(3)
    parts = []
    for body, n, below, above in (("lower", 2, "base", "slave"), ("upper", 3, "master", "press")):
        names = {"": body, f"{up}0": below, f"{up}1": above}
        box = block(kind, n, low, low + 1)
        rows = {(face, names[side]): nodes for (face, side), nodes in rows_of(box).items() if side in names}
        parts.append((assembled(box.points, rows, dim), {}))
        low[-1] += 1
    mesh = joined(parts, keep=True)
    return replace(mesh, node_groups={"all": np.arange(mesh.n_nodes)})


def run(folder, program, job):
    """Run a job in a folder that holds mesh.inp: CalculiX's words, and tables of its results by what they are."""
    (folder / "job.inp").write_text(job)
    done = subprocess.run([program, "job"], cwd=folder, capture_output=True, text=True, timeout=1500, check=False)
    results = (folder / "job.dat").read_text() if (folder / "job.dat").exists() else ""
    parts = [part for part in re.split(r"\n\s*\n", results) if part.strip()]
    tables = {}
    for head, body in zip(parts[::2], parts[1::2], strict=True):
        what = head.split("(")[0].strip()
        tables.setdefault(what, []).append(np.array([row.split() for row in body.splitlines() if row.strip()], float))
    return done.stdout + done.stderr, tables
