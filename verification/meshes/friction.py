"""Meshes of problems with friction: a plane with a crack, a shaft in a hub, a belt around a cylinder, a block under a
punch, a pad, a slider, a ring on a hub, a wheel, a rod, a cylinder in a groove.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh, generate
from lacmesh.generate.parts import assembled
from verification.meshes import rings
from verification.meshes.blocks import bent, joined, polar, rows_of, with_skin
from verification.meshes.half_spaces import depth_lines, piece

Floats = NDArray[np.floating]

#: how far the plane around a crack reaches, in half-lengths; the block around a punch, in its half-widths
REACH = 3.0


def _on_line(mesh: Mesh, start: float, end: float, height: float = 0.0) -> Mesh:
    """The mesh and a rigid plane, `master`: one face from x = start to x = end, which faces up where start > end."""
    return with_skin(mesh, "SEG2", np.array([[start, height], [end, height]]), np.array([[0, 1]]), "master")


def cracked(kind: str, n: int) -> Mesh:
    """A square from -REACH to REACH with a crack |x| < 1 on y = 0 of n cells to its half, the bodies one beyond it.

    Groups: `slave` (the upper face), `master`, `far`, and `upper`, `lower` (cells).
    """
    half = np.concatenate([np.linspace(0, 1, n + 1), np.linspace(1, REACH, n + 1)[1:]])
    along = np.concatenate([-half[:0:-1], half])
    parts = []
    for body, lines, face, role in (("upper", half, "y0", "slave"), ("lower", -half[::-1], "y1", "master")):
        names = dict.fromkeys(("x0", "x1", "y0", "y1"), "far") | {"": body, face: role}
        parts.append((piece(kind, [along, lines]), names))
    mesh = joined(parts)
    x, y, _ = mesh.points.T
    # nodes of both bodies at one place are made one on the line of the crack, but for its tips' inside
    place = np.where((y == 0) & (np.abs(x) > 1 - 1e-9), x.round(9), REACH + 1.0 + np.arange(len(x)))
    _, first, new = np.unique(place, return_index=True, return_inverse=True)
    rows = {}
    for (cell, name), nodes in rows_of(mesh).items():
        inside = np.abs(x[nodes]).max(axis=1) < 1 + 1e-9 if name in ("slave", "master") else np.ones(len(nodes), bool)
        rows[cell, name] = new.ravel()[nodes[inside]]
    return assembled(mesh.points[first], rows, 2)


def pulled_fit(kind: str, n: int) -> Mesh:
    """A shaft 0.5 < r < 1 in a hub up to 2, r along x and 1 high; n cells along the shaft, n + 1 along the hub.

    Groups: `within`, `around` (cells), `slave` (of the shaft), `master`, `far_within`, `far_around`.
    """
    within = piece(kind, [np.linspace(0.5, 1, n // 2 + 1), np.linspace(0, 1, n + 1)])
    around = piece(kind, [np.linspace(1, 2, n // 2 + 1), np.linspace(0, 1, n + 2)])
    return _fit(within, around, "x1", "x0")


def _fit(within: Mesh, around: Mesh, slave: str, master: str) -> Mesh:
    """Two bodies that meet in these sides; the others are those where they are moved."""
    return joined([
        (mesh, dict.fromkeys(mesh.cell_groups, f"far_{body}") | {"": body, side: role})
        for mesh, body, side, role in ((within, "within", slave, "slave"), (around, "around", master, "master"))
    ])  # fmt: skip


def turned_fit(kind: str, n: int) -> Mesh:
    """A quarter of a shaft 0.5 < r < 1 in a hub up to 2; groups as those of `pulled_fit`."""
    within = rings.ring(kind, (n // 2, n), (0.5, 1.0))
    return _fit(within, rings.ring(kind, (n // 2, n + 1), (1.0, 2.0)), "high", "low")


def belt(kind: str, thickness: float, angle: float, n: int) -> Mesh:
    """A belt around a rigid cylinder of radius 1, from the angle 0 to `angle` (radians), n cells along it, 2 across.

    Groups: `belt` (cells), `slave` (its inner face), `master` (the cylinder, a bare skin), `first`, `last` (its ends).
    """
    flat = piece(kind, [np.linspace(1, 1 + thickness, 3), np.linspace(0, angle, n + 1)])
    mesh = bent(joined([(flat, {"": "belt", "x0": "slave", "y0": "first", "y1": "last"})]), polar)
    wide = np.linspace(-0.5 * angle / n, angle * (1 + 0.5 / n), 2 * (2 * n + 1) + 1)
    points = np.stack([np.cos(wide), np.sin(wide)], axis=1)
    start = np.arange(0, len(wide) - 2, 2)
    faces = np.stack([start, start + 2, start + 1], axis=1)  # normals outwards, to the belt
    return with_skin(mesh, "SEG3", points, faces, "master")


def laid_belt(n: int) -> Mesh:
    """A belt of QUAD4, 0.1 thick, n cells along it, on a quarter of a drum of radius 10, which is longer, of 60 cells.

    Groups: `belt`, `drum` (cells), `slave`, `master`, `first` (on the axis x), `last`.
    """
    belt = piece("QUAD4", [np.linspace(10, 10.1, 3), np.linspace(0, np.pi / 2, n + 1)])
    drum = piece("QUAD4", [np.linspace(8, 10, 3), np.linspace(-0.1, np.pi / 2 + 0.1, 61)])

    return bent(joined([(belt, {"": "belt", "x0": "slave", "y0": "first", "y1": "last"}),
                        (drum, {"": "drum", "x1": "master"})]), polar)  # fmt: skip


def punched_half(kind: str, n: int) -> Mesh:
    """Half of a block under a flat rigid punch |x| < 1 on y = 0, n cells to its half-width.

    The block goes down. Groups: `block` (cells), `slave` (its top under the punch), `master` (the punch, a bare skin),
    `axis`, `far`.
    """
    near, out = np.linspace(0, 1, n + 1), 1 + (REACH - 1) * np.linspace(0, 1, n // 2 + 1)[1:] ** 1.5
    deep = np.concatenate([depth_lines(n), 2 + (REACH - 2) * np.linspace(0, 1, max(n // 4, 2) + 1)[1:]])
    mesh = joined([(piece(kind, [np.concatenate([near, out]), -deep[::-1]]),
                    {"": "block", "x0": "axis", "x1": "far", "y0": "far", "y1": "top"})])  # fmt: skip
    rows = rows_of(mesh)
    (top,) = (key for key in rows if key[1] == "top")
    under = rows.pop(top)
    rows[top[0], "slave"] = under[mesh.points[under, 0].max(axis=1) < 1 + 1e-9]
    return _on_line(assembled(mesh.points, rows, 2), -0.5, 1.0)


def pad(kind: str, n: int) -> Mesh:
    """A pad 1 long and 0.2 high on a longer rigid plane. Groups: `pad`, `slave`, `top`, `left`, `right`, `master`."""
    names = {"": "pad", "y0": "slave", "y1": "top", "x0": "left", "x1": "right"}
    mesh = joined([(piece(kind, [np.linspace(0, 1, n + 1), np.linspace(0, 0.2, max(n // 4, 2) + 1)]), names)])
    return _on_line(mesh, 2.0, -1.0)


def slider(kind: str, n: int, below: bool) -> Mesh:
    """A block 1 long and 0.5 high at x = 0 on one 4 long and 1 high from x = -0.5, n cells along the upper one.

    `below`: the slave is the top of the lower one. Groups: `upper`, `lower` (cells), `slave`, `master`, `top`,
    `bottom`.
    """
    aside = 0.5 * np.linspace(-1, 7, 3 * n + 1)
    roles = ("master", "slave") if below else ("slave", "master")
    upper = piece(kind, [np.linspace(0, 1, n + 1), np.linspace(0, 0.5, n // 2 + 1)])
    lower = piece(kind, [aside, np.linspace(-1, 0, n // 2 + 1)])
    return joined([
        (upper, {"": "upper", "y0": roles[0], "y1": "top"}), (lower, {"": "lower", "y1": roles[1], "y0": "bottom"}),
    ])  # fmt: skip


def ring_on_hub(kind: str, n: int) -> Mesh:
    """A whole ring 1 < r < 1.5, n cells around, on a hub, a bare skin of radius 1: `ring`, `slave`, `master`."""
    whole = joined([(generate.ring((2, n), (1.0, 1.5), kind), {"body": "ring", "inner": "slave"})])
    angle = 2 * np.pi * (np.arange(2 * (n + 3)) + 0.3) / (2 * (n + 3))
    start = np.arange(0, len(angle), 2)
    faces = np.stack([start, (start + 2) % len(angle), start + 1], axis=1)
    return with_skin(whole, "SEG3", np.stack([np.cos(angle), np.sin(angle)], axis=1), faces, "master")


def wheel(kind: str, n: int) -> Mesh:
    """The sector of a wheel, 0.5 < r < 1 about the origin, from 0.3 (radians) before its lowest point to 0.9 behind it,
    that rolls along x on a rigid plane; n cells along it. Groups: `wheel`, `slave`, `hub`, `master`.
    """
    flat = piece(kind, [np.linspace(0.5, 1, n // 5 + 1), np.linspace(-0.3, 0.9, n + 1)])

    sector = joined([(flat, {"": "wheel", "x0": "hub", "x1": "slave"})])
    return _on_line(bent(sector, lambda x: polar(x - [0.0, np.pi / 2, 0.0])), 2.0, -1.0, -1.0)


def rod(kind: str, n: int, angle: float) -> Mesh:
    """A rod 1 long and 0.1 wide that stands at an angle on a rigid plane, with a foot parallel to it, n cells along it.

    Groups: `rod`, `slave` (the foot), `master`.
    """
    upright = piece(kind, [np.linspace(-0.05, 0.05, max(n // 8, 2) + 1), np.linspace(0, np.sin(angle), n + 1)])
    leaning = bent(joined([(upright, {"": "rod", "y0": "slave"})]),
                   lambda x: x + x[:, 1:2] * [[1 / np.tan(angle), 0, 0]])  # fmt: skip
    return _on_line(leaning, 9.0, -9.0)


def seated(kind: str, n: int, radius: float, hole: float) -> Mesh:
    """Half (x > 0) of a cylinder with a hole in a groove of 90 degrees, or of a ball in a cone, n cells around it.

    Nodes of both skins are where they touch, if n is a multiple of 4. Groups: `ball`, `seat` (cells), `round`, `flank`,
    `base`, `axis`.
    """
    ball = piece(kind, [np.linspace(hole, radius, max(n // 4, 2) + 1), np.linspace(-np.pi / 2, np.pi / 2, n + 1)])
    seat = piece(kind, [np.linspace(0, np.sqrt(2), n // 2 + 1), np.linspace(-2, 0, max(n // 4, 2) + 1)])

    def above(x: Floats) -> Floats:
        points = polar(x) + np.array([0.0, np.sqrt(2) * radius, 0.0])
        points[np.abs(points[:, 0]) < 1e-12 * radius, 0] = 0.0
        return points

    def below(x: Floats) -> Floats:
        return radius * np.stack([x[:, 0], x[:, 1] + x[:, 0] * (1 + x[:, 1] / 2), x[:, 2]], axis=1)

    return joined([(bent(ball, above), {"": "ball", "x1": "round", "y0": "axis", "y1": "axis"}),
                   (bent(seat, below), {"": "seat", "y1": "flank", "x1": "base", "x0": "axis"})])  # fmt: skip
