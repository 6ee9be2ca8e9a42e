"""Geometry from an STL file: surfaces between its sharp edges, and the volumes that they enclose.

triangles = checked: every edge joins two of them                    (`_check_closed`)
surfaces = parts between sharp edges, each with a parametrization    (gmsh's classifySurfaces, createGeometry)
shells = surfaces that are connected; those inside another are its voids, or bodies inside a void   (`_nested`)
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import DataError, ReadError
from lacmesh.mesh import Floats, Ints
from lacmesh.topology.skin import distinct_edges

#: degrees between triangles from which an edge is sharp
_SHARP = 40.0


def make_geometry(gmsh: Any, path: Path, volumes: bool) -> None:
    """Make surfaces of the triangles of the current model, and the volumes inside. Raises ReadError, DataError."""
    gmsh.model.mesh.removeDuplicateNodes()
    triangles = _triangles(gmsh)
    if not len(triangles):
        raise ReadError(path, "there is no triangle in it; is it STL?")
    if volumes:
        _check_closed(gmsh, triangles)
    try:
        gmsh.model.mesh.classifySurfaces(np.radians(_SHARP), True, True, np.pi)
        shells = {t: _corners(gmsh, t) for _, t in gmsh.model.getEntities(2)}
        gmsh.model.mesh.createGeometry()
    except Exception as error:  # gmsh's own class of errors
        raise DataError(f"gmsh finds no surfaces in the triangles ({error}); repair them") from error
    if volumes:
        gmsh.model.removeEntities(gmsh.model.getEntities(3))
        for loops in _nested(gmsh, shells):
            gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(loop) for loop in loops])
    gmsh.model.geo.synchronize()


def _triangles(gmsh: Any, tag: int = -1) -> Ints:
    """Nodes of all triangles, or of those of a surface, (n, 3)."""
    return np.asarray(gmsh.model.mesh.getElementsByType(2, tag)[1], np.int64).reshape(-1, 3)


def _corners(gmsh: Any, tag: int = -1) -> Floats:
    """Corners of the triangles, (n, 3, 3)."""
    number, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(number)
    rows = order[np.searchsorted(number[order], _triangles(gmsh, tag))]
    corners: Floats = points.reshape(-1, 3)[rows]
    return corners


def _check_closed(gmsh: Any, triangles: Ints) -> None:
    """Raise DataError if an edge does not join exactly two triangles."""
    distinct, count = distinct_edges(triangles)
    for wrong, what, cure in (
        (count == 1, "it is not closed: {} edges have a triangle on one side only", "close it, or mesh it as a shell"),
        (count > 2, "{} edges have more than two triangles", "save its bodies as separate, closed surfaces"),
    ):
        if wrong.any():
            place = gmsh.model.mesh.getNode(int(distinct[wrong][0, 0]))[0]
            where = ", ".join(f"{x:.6g}" for x in place)
            cure = f"{cure} (--dim 2)" if "shell" in cure else cure
            raise DataError(f"{what.format(int(wrong.sum()))}, the first at ({where}); {cure}")


def _nested(gmsh: Any, corners: dict[int, Floats]) -> list[list[list[int]]]:
    """Shells of each volume, the outer one first, then its voids; a shell is a list of surfaces."""
    shells = connected(gmsh, [*corners])
    soup = [np.concatenate([corners[t] for t in shell]) for shell in shells]
    inside = np.array(
        [[i != j and _encloses(soup[j], soup[i][0].mean(axis=0)) for j in range(len(soup))] for i in range(len(soup))]
    )
    depth = inside.sum(axis=1)
    volumes = []
    for i in np.flatnonzero(depth % 2 == 0):
        voids = [j for j in range(len(soup)) if inside[j, i] and depth[j] == depth[i] + 1]
        volumes.append([shells[i], *(shells[j] for j in voids)])
    return volumes


def connected(gmsh: Any, surfaces: list[int]) -> list[list[int]]:
    """Group surfaces that are connected by their curves."""
    shells: list[tuple[set[int], list[int]]] = []
    for tag in surfaces:
        curves = {abs(int(t)) for _, t in gmsh.model.getBoundary([(2, tag)], oriented=False)}
        joined = [s for s in shells if s[0] & curves]
        shells = [s for s in shells if not s[0] & curves]
        shells.append((curves.union(*(s[0] for s in joined)), [*(t for s in joined for t in s[1]), tag]))
    return [tags for _, tags in shells]


def _encloses(corners: Floats, point: Floats) -> bool:
    """True if a closed surface of triangles (n, 3, 3) encloses a point, by the sum of their solid angles.

    Van Oosterom, Strackee, IEEE Trans. Biomed. Eng. 30, 1983.
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = (np.cross(a, b) * c).sum(axis=1)
    rest = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return bool(abs(2 * np.arctan2(volume, rest).sum()) > 2 * np.pi)
