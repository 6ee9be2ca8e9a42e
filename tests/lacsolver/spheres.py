"""Twins of the press fit and the Hertz spheres of `cases.json`, meshed here: axisymmetric, quarter discs and rings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh, raise_order

RADIUS = 50.0


def rings(n: int, m: int, radial: int = 6, *, quadratic: bool = True) -> Mesh:
    """Spheres of radii 20, 30 and 30, 40, as quarter rings of quadrangles, n and m along the interface.

    Groups: inner (pressed), slave (outside of the inner ring), master, axis_x (x = 0), axis_y (y = 0).
    """
    parts = [_ring(20.0, 30.0, n, radial), _ring(30.0, 40.0, m, radial)]
    shift = len(parts[0][0])
    points = np.concatenate([parts[0][0], parts[1][0]])
    quads = np.concatenate([parts[0][1], parts[1][1] + shift])
    names = ("inner", "slave", "axis_x", "axis_y", "master", "axis_x", "axis_y")
    sides = [parts[0][2][k] for k in ("low", "high", "first", "last")]
    sides += [parts[1][2][k] + shift for k in ("low", "first", "last")]
    segments = np.concatenate(sides)
    groups: dict[str, list[NDArray]] = {}
    start = len(quads)
    for name, side in zip(names, sides, strict=True):
        groups.setdefault(name, []).append(np.arange(start, start + len(side)))
        start += len(side)
    joined = {name: np.concatenate(found) for name, found in groups.items()}
    mesh = Mesh.create(points, [("QUAD4", quads), ("SEG2", segments)], cell_groups=joined)
    return _curved(raise_order(mesh)) if quadratic else mesh


def _ring(low: float, high: float, n: int, radial: int) -> tuple[NDArray, NDArray, dict[str, NDArray]]:
    """Points, quadrangles and sides of a quarter ring between two radii: `first` on x = 0, `last` on y = 0."""
    r, a = np.linspace(low, high, radial + 1), np.linspace(np.pi / 2, 0, n + 1)
    x = np.stack([np.outer(np.cos(a), r), np.outer(np.sin(a), r)], axis=-1).reshape(-1, 2)
    x[np.abs(x) < 1e-12] = 0.0
    g = np.arange(len(x)).reshape(n + 1, radial + 1)
    quads = np.stack([g[1:, :-1], g[1:, 1:], g[:-1, 1:], g[:-1, :-1]], axis=-1).reshape(-1, 4)
    ends = {"low": g[:, 0], "high": g[:, -1], "first": g[0], "last": g[-1]}
    return x, quads, {name: np.stack([line[:-1], line[1:]], axis=1) for name, line in ends.items()}


def _curved(mesh: Mesh) -> Mesh:
    """Nodes between two of the same radius are put on that radius."""
    points = mesh.points.copy()
    for kind, nodes in mesh.blocks:
        pairs = [(0, 1, 2)] if kind == "SEG3" else [(0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7)]
        for a, b, middle in pairs:
            ends = np.linalg.norm(mesh.points[nodes[:, [a, b]]], axis=2)
            round_ = np.abs(ends[:, 0] - ends[:, 1]) < 1e-9
            at = nodes[round_, middle]
            points[at] = mesh.points[at] * (ends[round_, 0] / np.linalg.norm(mesh.points[at], axis=1))[:, None]
    return replace(mesh, points=points)


def spheres(size: float, far: float, *, order: int = 1, reach: float = 17.0) -> Mesh:
    """Two hemispheres of radius 50 that touch at the origin, as quarter discs of triangles meshed by gmsh.

    `size` of the cells at the contact (the master's are 1.1 times as large), `far` away from it. Groups: slave (upper),
    master, up, down (the flats), axis.
    """
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("spheres")
        for sign, name, own in ((1.0, "slave", size), (-1.0, "master", 1.1 * size)):
            _disc(gmsh.model, sign, name, own, far, reach)
        gmsh.model.geo.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        return _read(gmsh.model)
    finally:
        gmsh.finalize()


def _disc(model, sign: float, name: str, size: float, far: float, reach: float) -> None:
    geo, angle = model.geo, np.arcsin(reach / RADIUS)
    low = geo.addPoint(0, 0, 0, size)
    edge = geo.addPoint(RADIUS * np.sin(angle), sign * RADIUS * (1 - np.cos(angle)), 0, size)
    side = geo.addPoint(RADIUS, sign * RADIUS, 0, far)
    centre = geo.addPoint(0, sign * RADIUS, 0, far)
    depth = geo.addPoint(0, sign * reach, 0, 3 * size)
    lines = [
        geo.addCircleArc(low, centre, edge),
        geo.addCircleArc(edge, centre, side),
        geo.addLine(side, centre),
        geo.addLine(centre, depth),
        geo.addLine(depth, low),
    ]
    face = geo.addPlaneSurface([geo.addCurveLoop([int(sign) * k for k in lines[:: int(sign)]])])
    geo.synchronize()
    model.addPhysicalGroup(2, [face], name=f"body of {name}")
    model.addPhysicalGroup(1, [lines[0]], name=name)
    model.addPhysicalGroup(1, [lines[2]], name="up" if sign > 0 else "down")
    model.addPhysicalGroup(1, lines[3:], name=f"axis of {name}")


def _read(model) -> Mesh:
    import tempfile
    from pathlib import Path

    import gmsh

    import lacmesh

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "spheres.msh"
        gmsh.write(str(path))
        return lacmesh.read(path)
