"""Meshes of other projects, which are read where they stand beside this one and are no part of it, and their twins:
meshes of our own of the same bodies, with the same groups, that are always there.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import Mesh
from verification.grids import box, half_disc, turned
from verification.meshes.blocks import nodes_of
from verification.meshes.bodies import at, body, joined

Floats = NDArray[np.floating]

_FOLDER = Path(os.environ.get("LACMESH_SHARED") or Path(__file__).parents[3] / "shared") / "reference" / "meshes"


def there(name: str) -> bool:
    """True if a mesh can be read."""
    return (_FOLDER / f"{name}.med").is_file()


def code_aster(name: str) -> Mesh:
    """The mesh of one of code_aster's tests."""
    return lacmesh.read(_FOLDER / f"{name}.med")


def mesh_of(name: str, twin: bool) -> Mesh:
    """The mesh of one of code_aster's tests, or its twin, of those in `TWINS`."""
    return TWINS[name]() if twin else code_aster(name)


def _plate() -> Mesh:
    """ssnv128m: a square plate on a rigid strip."""
    side = np.linspace(0, 0.04, 33)
    skins = {"LCONTA": at(1, 0.0), "LPRESV": at(1, 0.04), "LPRESH": at(0, 0.0), "LBLOCX": at(0, 0.04)}
    return joined(
        {
            "SPLAQ": body(box(side, np.linspace(0, 0.04, 11)), skins=skins),
            "SBATI": body(box(side, np.array([-0.001, 0.0])), skins={"LBATI": at(1, 0.0)}),
        }
    )


def _roller() -> Mesh:
    """ssnp154a: one half of a cylinder of radius 50 on a block; its faces grow from the block on, 0.9 degrees there."""
    axis, radius = {"Axe": at(0, 0.0)}, 50.0

    def finer_below(grid: Floats) -> Floats:
        x, y = np.moveaxis(turned(grid, 1), -1, 0)
        angle = np.pi * np.expm1(2 * np.arctan2(x, -y) / np.pi) / np.expm1(2)
        return np.stack([np.hypot(x, y) * np.sin(angle), radius - np.hypot(x, y) * np.cos(angle)], axis=-1)

    def below(x: Floats, y: Floats) -> NDArray[np.bool_]:
        return np.isclose(np.hypot(x, y - radius), radius) & (y < radius)

    wide = np.concatenate([np.linspace(0, 30, 31), np.linspace(30, 100, 11)[1:]])
    deep = np.concatenate([np.linspace(0, 30, 25), np.linspace(30, 200, 13)[1:]])
    skins = {"Top_B": lambda x, y: np.isclose(y, 0) & (x < 30 + 1e-9), "Encast": at(1, -200.0), **axis}
    mesh = joined(
        {
            "Cylinder": body(*map(finer_below, half_disc(radius, 16, 12)), skins={"Bottom_C": below, **axis}),
            "Block": body(box(wide, -deep[::-1]), skins=skins),
        }
    )
    return _with_nodes(mesh, {"B": ("Block", (0.0, 0.0)), "Force": ("Cylinder", (0.0, 2 * radius))})


def _punch() -> Mesh:
    """ssna122a: a punch of radius 50 with an edge that is rounded by 10, on a block."""
    angle = np.linspace(0, np.pi / 2, 7)[1:]
    wide = np.concatenate([np.linspace(0, 40, 11), 40 + 10 * np.sin(angle)])
    low = np.concatenate([np.zeros(11), 10 - 10 * np.cos(angle)])
    up = np.linspace(0, 1, 16) ** 1.3
    grid = np.stack(np.broadcast_arrays(wide[:, None], low[:, None] + (100 - low[:, None]) * up), axis=-1)
    along = np.concatenate([np.linspace(0, 49, 15), np.linspace(49, 100, 9)[1:]])
    deep = 200 * np.linspace(0, 1, 22) ** 1.6
    mesh = joined(
        {
            "Poincon": body(grid, skins={"P_cont": _on(wide, low), "Force": at(1, 100.0), "Axe": at(0, 0.0)}),
            "Massif": body(box(along, -deep[::-1]), skins={
                "M_cont": at(1, 0.0), "Encast": at(1, -200.0), "Axe": at(0, 0.0),
            }),
        }
    )  # fmt: skip
    return _with_nodes(mesh, {"M": ("Massif", (0.0, 0.0))})


def _pin() -> Mesh:
    """ssnp156a: one half of a pin of radius 50 in a sheet with a round end, loaded at its centre, x = 200."""
    radius, middle = 50.0, np.array([200.0, 0.0])
    angle = np.linspace(0, np.pi, 45)
    hole = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    outline = np.where(hole[:, :1] < 0, hole / np.abs(hole).max(axis=1, keepdims=True), hole)
    out = (np.linspace(0, 1, 9) ** 1.3)[:, None, None]
    around = middle + radius * ((1 - out) * hole + 2 * out * outline)
    beside = box(np.linspace(0, 100, 9), 100 * np.tan(np.linspace(0, np.pi / 4, 12)))

    def round_it(x: Floats, y: Floats) -> NDArray[np.bool_]:
        return np.isclose(np.hypot(x - middle[0], y), radius)

    pin = (middle + turned(grid, 2) for grid in half_disc(radius, 10, 8))
    mesh = joined(
        {
            "Pin": body(*pin, skins={"Slave": round_it, "Axe": at(1, 0.0)}),
            "Sheet": body(around, beside, skins={"Master": round_it, "Axe": at(1, 0.0), "Encast": at(0, 0.0)}),
        }
    )
    return _with_nodes(mesh, {"F": ("Pin", (200.0, 0.0))})


def _ironing() -> Mesh:
    """ssnp153a: a die with a round foot of radius 0.75 over a slab; cells of 0.15 and 0.2, of 0.1 there."""
    wide = 0.8 + 0.75 * np.sin(np.linspace(-1, 1, 9) * np.arcsin(0.8))
    low = 0.95 - np.sqrt(0.75**2 - (wide - 0.8) ** 2)
    die = np.stack(np.broadcast_arrays(wide[:, None], low[:, None] + (1.4 - low[:, None]) * np.linspace(0, 1, 7)), -1)
    foot, sides = _on(wide, low), at(0, *wide[[0, -1]])
    slab = box(np.linspace(0, 12, 61), -4 * np.linspace(1, 0, 15) ** 1.3)
    return joined(
        {
            "Hard": body(die, skins={"Master": lambda x, y: foot(x, y) | sides(x, y), "Depl": at(1, 1.4)}),
            "Soft": body(slab, skins={"Slave": at(1, 0.0), "Bloq": at(1, -4.0)}),
        }
    )


def _on(wide: Floats, high: Floats) -> Callable[..., NDArray[np.bool_]]:
    """Condition that holds on the line through points."""
    return lambda x, y: np.asarray(np.isclose(y, np.interp(x, wide, high)))


def _with_nodes(mesh: Mesh, which: Mapping[str, tuple[str, tuple[float, float]]]) -> Mesh:
    """The mesh with groups of single nodes: name -> the body and the place."""
    groups = {}
    for name, (group, place) in which.items():
        nodes = nodes_of(mesh, group)
        groups[name] = nodes[[np.linalg.norm(mesh.points[nodes, :2] - place, axis=1).argmin()]]
    return replace(mesh, node_groups=groups)


TWINS: Mapping[str, Callable[[], Mesh]] = {
    "ssnv128m": _plate, "ssnp154a": _roller, "ssna122a": _punch, "ssnp156a": _pin, "ssnp153a": _ironing,
}  # fmt: skip
