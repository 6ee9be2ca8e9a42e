"""Jobs of CalculiX on meshes of ours: two blocks pressed together, and a pressure on one facet of one cell."""

from __future__ import annotations

import re
import subprocess
from itertools import permutations

import numpy as np

from lacmesh import Mesh, raise_order
from lacmesh.cells import CELLS
from tests.meshes import box

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
    """Unit cubes of 2 x 2 x 2 and 3 x 3 x 3 cells, the second on the first, with the groups of `PRESSED`."""
    points, hexa = zip(*(box(n) for n in (2, 3)), strict=True)
    x = np.vstack([points[0], points[1] + [0, 0, 1]])
    n_first = len(points[0])
    lower, upper = (h if "HEXA" in kind else _tetrahedra(h) for h in (hexa[0], hexa[1] + n_first))
    cells, solid = np.concatenate([lower, upper]), CELLS[CELLS[kind].linear]
    sides = np.concatenate([cells[:, f.nodes] for f in solid.facets])
    z = x[sides, 2]
    of = {
        "base": (z == 0).all(axis=1),
        "slave": (z == 1).all(axis=1) & (sides[:, 0] < n_first),
        "master": (z == 1).all(axis=1) & (sides[:, 0] >= n_first),
        "press": (z == 2).all(axis=1),
    }
    groups = {"lower": np.arange(len(lower)), "upper": len(lower) + np.arange(len(upper))}
    faces, start = [], len(cells)
    for name, which in of.items():
        faces.append(sides[which])
        groups[name] = start + np.arange(which.sum())
        start += which.sum()
    blocks = [(solid.name, cells), (solid.facets[0].type, np.concatenate(faces))]
    mesh = Mesh.create(x, blocks, cell_groups=groups, node_groups={"all": np.arange(len(x))})
    return raise_order(mesh) if CELLS[kind].order == 2 else mesh


def _tetrahedra(hexa):
    """Each hexahedron as six tetrahedra about a diagonal, so that neighbours match."""
    corner = {tuple(map(int, (c + 1) / 2)): k for k, c in enumerate(np.array(CELLS["HEXA8"].reference))}
    found = []
    for axes in permutations(np.eye(3, dtype=int)):
        a, b, c, d = (corner[tuple(p)] for p in np.cumsum([[0, 0, 0], *axes], axis=0))
        found.append(hexa[:, [a, b, c, d] if np.linalg.det(axes) > 0 else [a, c, b, d]])
    return np.concatenate(found)


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
