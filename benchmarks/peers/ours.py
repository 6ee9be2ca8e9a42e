"""The peers' problem for lacsolver: mesh and case written here, solved by the command, read from its results."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

import lacmesh
from benchmarks.peers.problems import POISSON, Pair
from lacmesh import Mesh


def mesh_of(pair: Pair) -> Mesh:
    """Both bodies as one mesh; sides of one name are one group, bodies are `lower` and `upper`."""
    start, first = len(pair.lower.points), len(pair.lower.cells)
    cells, faces = np.concatenate([pair.lower.cells, pair.upper.cells + start]), []
    at, groups = len(cells), {"lower": np.arange(first), "upper": np.arange(first, len(cells))}
    for body, shift in ((pair.lower, 0), (pair.upper, start)):
        for name, nodes in body.sides.items():
            groups[name] = np.concatenate([groups.get(name, np.empty(0, int)), at + np.arange(len(nodes))])
            faces.append(nodes + shift)
            at += len(nodes)
    points = np.concatenate([pair.lower.points, pair.upper.points])
    return Mesh.create(points, [("QUAD4", cells), ("SEG2", np.concatenate(faces))], cell_groups=groups, space_dim=2)


def case_of(pair: Pair, contact: str = "") -> str:
    """The case's text; `contact`: more lines of [[contact]]."""
    lines = ['mesh = "pair.msh"', 'model = "plane_strain"']
    for name, body in pair.bodies.items():
        lines += ["[[material]]", f'groups = ["{name}"]', f"young = {body.young!r}", f"poisson = {POISSON!r}"]
    lines += ["[[contact]]", 'slave = "slave"', 'master = "master"', contact]
    for side, axis, value in (*((*one, 0.0) for one in pair.supports), ("top", 1, pair.push)):
        lines += ["[[displacement]]", f'group = "{side}"', f"u{'xy'[axis]} = {value!r}"]
    return "\n".join([*lines, "[solver]", "threads = 1", ""])


def write(pair: Pair, folder: Path, contact: str = "") -> list[str]:
    """Write mesh and case; the command that solves them."""
    lacmesh.write(folder / "pair.msh", mesh_of(pair))
    (folder / "pair.toml").write_text(case_of(pair, contact))
    return [sys.executable, "-m", "lacsolver", "run", str(folder / "pair.toml"), "--force", "--quiet"]


def read(pair: Pair, folder: Path) -> dict[str, object]:
    """`iterations`, `force` a length, `p_m` and `recovered` as (x, p)."""
    results = json.loads((folder / "pair" / "results.json").read_text())
    table = np.genfromtxt(folder / "pair" / "contact_slave.csv", delimiter=",", names=True)
    skin = lacmesh.read(max((folder / "pair" / "fields").glob("contact_slave*.vtu")))
    out = {"iterations": sum(step["iterations"] for step in results["steps"])}
    out |= {"force": 2 * abs(results["contact"]["slave"]["resultant"][1]), "p_m": (table["x"], table["pressure"])}
    return out | {"recovered": (skin.points[:, 0], skin.node_data["pressure_recovered"])}
