"""The peers' problems for CalculiX: surface to surface contact, a linear pressure of the overclosure (penalty)."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from peer_ours import mesh_of
from peer_problems import PRESSES, Pair

import lacmesh

NAME = "CalculiX"
#: pressures for an overclosure of one unit of length, over the softer body's modulus: the ends of what is advised
STIFFNESSES = (50.0, 5.0)
#: shear stress for a slip of one unit of length while it sticks, over that
STICKS = 0.1


def absent() -> str | None:
    """Reason why CalculiX cannot be run here."""
    return None if shutil.which("ccx") else "ccx is not installed (Debian: calculix-ccx)"


def write(pair: Pair, folder: Path, stiffness: float = 50.0) -> list[str]:
    """Write the input; the command that solves it."""
    lacmesh.write(folder / "pair.inp", mesh_of(pair), target="calculix", plane="CPE")
    with (folder / "pair.inp").open("a", encoding="ascii") as file:
        file.write(_cards(pair, stiffness))
    return ["ccx", "-i", "pair"]


def _cards(pair: Pair, stiffness: float) -> str:
    """Materials, contact, conditions, one step, what is printed."""
    up, K = pair.dim, stiffness * min(body.young for body in pair.bodies)
    lines = []
    for name, body in zip(("lower", "upper"), pair.bodies, strict=True):
        lines += [f"*MATERIAL, NAME=M{name}", "*ELASTIC", f"{body.young:.9g}, {pair.poisson:.9g}"]
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=M{name}", *(["1."] if pair.dim == 2 else [])]
    lines += ["*SURFACE INTERACTION, NAME=touch", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{K:.9g}"]
    lines += ["*FRICTION", f"{pair.friction:.9g}, {STICKS * K:.9g}"] if pair.friction else []
    lines += ["*CONTACT PAIR, INTERACTION=touch, TYPE=SURFACE TO SURFACE", "slave, master"]
    lines += ["*BOUNDARY", *(f"{side}, {axis + 1}, {axis + 1}" for side, axis in pair.held)]
    if pair.friction:
        lines += ["*STEP, INC=100, NLGEOM", "*STATIC, DIRECT", f"{1 / PRESSES}, 1."]
        lines += ["*BOUNDARY", "top, 1, 1", f"top, 2, 2, {pair.push:.9g}", "*END STEP"]
        lines += ["*STEP, INC=100, NLGEOM", "*STATIC", "1., 1.", "*BOUNDARY", f"top, 1, 1, {pair.aside:.9g}"]
    else:
        lines += ["*STEP, INC=100", "*STATIC", "1., 1."]
    if pair.friction:
        lines += [f"top, 2, 2, {pair.push:.9g}"]
    elif pair.push:
        lines += ["*BOUNDARY", f"top, {up}, {up}, {pair.push:.9g}"]
    else:
        lines += ["*DSLOAD", f"top, P, {pair.pressure:.9g}"]
    lines += ["*NODE PRINT, NSET=top, TOTALS=ONLY", "RF"] if pair.push else []
    lines += (
        [line for name in ("lower", "upper") for line in (f"*EL PRINT, ELSET={name}", "S")] if pair.pressure else []
    )
    lines += ["*NODE FILE, OUTPUT=2D" if pair.dim == 2 else "*NODE FILE", "U", "*CONTACT FILE", "CSTR", "*END STEP"]
    return "\n".join([*lines, ""])


def read(pair: Pair, folder: Path) -> dict[str, object]:
    """`iterations`; `stress` and the largest other component `other`; or `force`, `nodes` (x, p) of the slave."""
    steps = [line.split() for line in (folder / "pair.sta").read_text().splitlines() if line.split()[0].isdigit()]
    out: dict[str, object] = {"iterations": sum(int(step[3]) for step in steps)}
    if not steps or float(steps[-1][4]) < 1:
        raise RuntimeError("the step was not completed")
    rows = [line.split() for line in (folder / "pair.dat").read_text().splitlines()]
    if pair.dim == 3:
        s = np.array([[float(v) for v in row[2:8]] for row in rows if len(row) == 8 and row[0].isdigit()])
        if len(s) != 8 * sum(len(body.cells) for body in pair.bodies):
            raise RuntimeError(f"{len(s)} integration points were printed")
        return out | {"stress": np.abs(s[:, 2] + pair.pressure).max(), "other": np.abs(np.delete(s, 2, axis=1)).max()}
    *_, forces = (list(map(float, row)) for row in rows if len(row) == 3 and "total" not in row and _number(row[0]))
    places = np.concatenate([body.points for body in pair.bodies])
    slave = np.unique(pair.upper.sides["slave"]) + len(pair.lower.points)
    contact = _contact(folder / "pair.frd", len(places))[slave]
    if pair.friction:
        shear, force = np.abs(forces[:2])
        return out | {
            "force": force,
            "shear": shear,
            "nodes": (places[slave, 0], np.linalg.norm(contact[:, 4:6], axis=1)),
        }
    return out | {"force": 2 * abs(forces[1]), "nodes": (places[slave, 0], contact[:, 3])}


def _number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _contact(path: Path, count: int) -> np.ndarray:
    """Values (count, 6) of the last CONTACT block at nodes 1, 2 ..., 0 where none are told: the fourth is the pressure,
    the last two are shear stresses.
    """
    values, inside = np.zeros((count, 6)), False
    for line in path.read_text().splitlines():
        if line.startswith(" -4"):
            inside = line.split()[1] == "CONTACT"
            values[:] = 0.0 if inside else values
        elif inside and line.startswith(" -1"):
            values[int(line[3:13]) - 1] = [float(line[13 + 12 * k : 25 + 12 * k]) for k in range(6)]
    return values
