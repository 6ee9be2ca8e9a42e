"""The peers' problem for CalculiX: surface to surface contact, a linear pressure of the overclosure (penalty)."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np

import lacmesh
from benchmarks.peers.ours import mesh_of
from benchmarks.peers.problems import POISSON, Pair

#: pressures for an overclosure of one unit of length, over the softer body's modulus: the ends of what is advised
STIFFNESSES = (50.0, 5.0)


def absent() -> str | None:
    """Reason why CalculiX cannot be run here."""
    return None if shutil.which("ccx") else "ccx is not installed (Debian: calculix-ccx)"


def write(pair: Pair, folder: Path, stiffness: float = 50.0) -> list[str]:
    """Write the input; the command that solves it."""
    lines = []
    for name, body in pair.bodies.items():
        lines += [f"*MATERIAL, NAME=M{name}", "*ELASTIC", f"{body.young:.9g}, {POISSON:.9g}"]
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=M{name}", "1."]
    lines += ["*SURFACE INTERACTION, NAME=touch", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{stiffness * min(body.young for body in pair.bodies.values()):.9g}"]
    lines += ["*CONTACT PAIR, INTERACTION=touch, TYPE=SURFACE TO SURFACE", "slave, master"]
    lines += ["*BOUNDARY", *(f"{side}, {axis + 1}, {axis + 1}" for side, axis in pair.supports)]
    lines += ["*STEP, INC=100", "*STATIC", "1., 1.", "*BOUNDARY", f"top, 2, 2, {pair.push:.9g}"]
    lines += ["*NODE PRINT, NSET=top, TOTALS=ONLY", "RF", "*NODE FILE, OUTPUT=2D", "U", "*CONTACT FILE", "CSTR"]
    lacmesh.write(folder / "pair.inp", mesh_of(pair), target="calculix", plane="CPE")
    with (folder / "pair.inp").open("a", encoding="ascii") as file:
        file.write("\n".join([*lines, "*END STEP", ""]))
    return ["ccx", "-i", "pair"]


def read(pair: Pair, folder: Path) -> dict[str, object]:
    """`iterations`, `force` a length, and pressures at the slave's nodes as (x, p)."""
    steps = [line.split() for line in (folder / "pair.sta").read_text().splitlines() if line.split()[0].isdigit()]
    if not steps or float(steps[-1][4]) < 1:
        raise RuntimeError("the step was not completed")
    *_, force = re.findall(r"^ +\S+ +(\S+) +\S+$", (folder / "pair.dat").read_text(), re.MULTILINE)
    places = np.concatenate([body.points for body in pair.bodies.values()])
    slave = np.unique(pair.upper.sides["slave"]) + len(pair.lower.points)
    out = {"iterations": sum(int(step[3]) for step in steps), "force": 2 * abs(float(force))}
    return out | {"nodes": (places[slave, 0], _pressures(folder / "pair.frd", len(places))[slave])}


def _pressures(path: Path, count: int) -> np.ndarray:
    """The fourth value of the last CONTACT block at nodes 1, 2 ..., 0 where there is none."""
    values, inside = np.zeros(count), False
    for line in path.read_text().splitlines():
        if line.startswith(" -4"):
            inside = line.split()[1] == "CONTACT"
            values[:] = 0.0 if inside else values
        elif inside and line.startswith(" -1"):
            values[int(line[3:13]) - 1] = float(line[49:61])
    return values
