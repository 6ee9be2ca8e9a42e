"""The peers' problems for lacsolver: mesh and case written here, solved by the command, read from what it writes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from peer_problems import PRESSES, Pair

import lacmesh
from lacmesh import Mesh

REPOSITORY = Path(__file__).resolve().parents[1]


def mesh_of(pair: Pair) -> Mesh:
    """Both bodies as one mesh; sides of one name are one group, bodies are `lower` and `upper`."""
    dim, start = pair.dim, len(pair.lower.points)
    solid, skin = ("QUAD4", "SEG2") if dim == 2 else ("HEXA8", "QUAD4")
    cells = [body.cells + shift for body, shift in zip(pair.bodies, (0, start), strict=True)]
    faces, groups = [], {"lower": np.arange(len(cells[0]))}
    at = sum(map(len, cells))
    groups["upper"] = np.arange(len(cells[0]), at)
    for body, shift in zip(pair.bodies, (0, start), strict=True):
        for name, nodes in body.sides.items():
            groups[name] = np.concatenate([groups.get(name, np.empty(0, int)), at + np.arange(len(nodes))])
            faces.append(nodes + shift)
            at += len(nodes)
    points = np.concatenate([body.points for body in pair.bodies])
    return Mesh.create(
        points, [(solid, np.concatenate(cells)), (skin, np.concatenate(faces))], cell_groups=groups, space_dim=dim
    )


def case_of(pair: Pair, contact: str = "", solver: str = "threads = 1") -> str:
    """The case's text; `contact`: more lines of [[contact]]."""
    up = "xyz"[pair.dim - 1]
    lines = ['mesh = "pair.msh"', f'model = "{"3d" if pair.dim == 3 else "plane_strain"}"']
    for name, body in zip(("lower", "upper"), pair.bodies, strict=True):
        lines += ["[[material]]", f'groups = ["{name}"]', f"young = {body.young!r}", f"poisson = {pair.poisson!r}"]
    lines += ["[[contact]]", 'slave = "slave"', 'master = "master"', contact]
    lines += [f"friction = {pair.friction!r}"] if pair.friction else []
    for side, axis in pair.held:
        lines += ["[[displacement]]", f'group = "{side}"', f"u{'xyz'[axis]} = 0.0"]
    if pair.friction:
        down, aside = [[0, 0], [1, pair.push], [2, pair.push]], [[0, 0], [1, 0], [2, pair.aside]]
        lines += ["[[displacement]]", 'group = "top"', f"ux = {aside}", f"uy = {down}", "[steps]"]
        lines += [f"times = {[*((k + 1) / PRESSES for k in range(PRESSES)), 2.0]}"]
    elif pair.push:
        lines += ["[[displacement]]", 'group = "top"', f"u{up} = {pair.push!r}"]
    else:
        lines += ["[[pressure]]", 'group = "top"', f"value = {pair.pressure!r}"]
    return "\n".join([*lines, "[solver]", solver, ""])


def write(pair: Pair, folder: Path, **options: str) -> list[str]:
    """Write mesh and case; the command that solves them."""
    lacmesh.write(folder / "pair.msh", mesh_of(pair))
    (folder / "pair.toml").write_text(case_of(pair, **options))
    return [sys.executable, "-m", "lacsolver", "run", str(folder / "pair.toml"), "--force", "--quiet"]


def read(pair: Pair, folder: Path) -> dict[str, object]:
    """`iterations`, `stress` (worst |sigma_zz + P|), `force` a length, `p_m` and `recovered` as (x, p).

    With friction also `shear` a length, and tractions in the places of pressures.
    """
    told = json.loads((folder / "pair" / "results.json").read_text())
    out: dict[str, object] = {"iterations": sum(step["iterations"] for step in told["steps"]), "told": told}
    if pair.dim == 3:
        ends = [end for body in ("lower", "upper") for end in told["stress"][body]["zz"]]
        return out | {"stress": max(abs(end + pair.pressure) for end in ends)}
    table = np.genfromtxt(folder / "pair" / "contact_slave.csv", delimiter=",", names=True)
    skin = lacmesh.read(max((folder / "pair" / "fields").glob("contact_slave*.vtu")))
    shear, force = (abs(v) for v in told["contact"]["slave"]["resultant"])
    if pair.friction:
        last = table[table["time"] == table["time"].max()]
        t = np.linalg.norm(skin.node_data["shear_recovered"], axis=1)
        means, nodal = (last["x"], np.abs(last["shear_1"])), (skin.points[:, 0], t)
        return out | {"force": force, "shear": shear, "p_m": means, "recovered": nodal}
    nodal = skin.node_data["pressure_recovered"]
    return out | {"force": 2 * force, "p_m": (table["x"], table["pressure"]), "recovered": (skin.points[:, 0], nodal)}
