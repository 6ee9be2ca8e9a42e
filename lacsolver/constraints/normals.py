"""Outward normals at the nodes of skins, for displacements prescribed along them.

Faces at a node whose normals differ by less than the crease angle share one normal, the mean of theirs at the node,
each weighted with the face's area. So do faces that are linked by others in between: the tip of a blunt cone has one
normal. A sharp edge or a corner has one normal for each side. A skin that is split into several groups is one skin
here, so that a seam in a cylinder is no edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import DataError, some
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.surface import Surface
from lacmesh.surface.normals import weighted
from lacmesh.topology.bodies import label_components
from lacmesh.topology.skin import Faces, label_faces
from lacsolver.space.space import Space

#: degrees; faces whose normals differ by more meet in a sharp edge
CREASE_ANGLE = 40.0
#: a component of a normal below this is round-off and set to 0: the normal of a face along x, y is exactly z
_ROUNDING = 1e-12


class Normals(NamedTuple):
    """Unit outward normals (k, dim) at nodes (k,); a node is listed once for each distinct normal that it has."""

    nodes: Ints
    normals: NDArray[np.floating]


class _Sides(NamedTuple):
    """One row for each node of each face: node, skin, face, the face's normal at the node, the face's area."""

    node: Ints
    skin: Ints
    face: Ints
    normal: Floats
    area: Floats


def nodal_normals(space: Space, skins: Sequence[Surface]) -> list[Normals]:
    """Return the normals at the nodes of each of some skins. Raises DataError where a node has none.

    >>> from lacmesh import Mesh
    >>> sides = ("SEG2", [[0, 1], [1, 2]])
    >>> mesh = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]]), sides])
    >>> (found,) = nodal_normals(Space.of(mesh, "plane_strain"), [Surface.of(mesh, np.array([1, 2]))])
    >>> found.nodes.tolist(), found.normals.tolist()
    ([0, 1, 1, 2], [[0.0, -1.0], [0.0, -1.0], [1.0, 0.0], [1.0, 0.0]])
    """
    sides = _sides(skins)
    shared = _shared(sides)
    total = np.zeros((shared.max(initial=-1) + 1, 3))
    np.add.at(total, shared, np.where(_first(sides), sides.area, 0.0)[:, None] * sides.normal)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    normal = np.divide(total, size, out=np.zeros_like(total), where=size > 0)
    lost = np.flatnonzero(size[shared, 0] == 0)
    if len(lost):
        numbers = some(np.unique(space.mesh.node_number[sides.node[lost]]))
        raise DataError(f"the surface has no normal at nodes {numbers}; mesh its faces again, or prescribe ux, uy, uz")
    normal[np.abs(normal) < _ROUNDING] = 0.0
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return [_of_skin(sides, shared, normal[:, : space.dim], k) for k in range(len(skins))]


def _of_skin(sides: _Sides, shared: Ints, normal: Floats, skin: int) -> Normals:
    mine = np.flatnonzero(sides.skin == skin)
    chosen, first = np.unique(shared[mine], return_index=True)
    nodes = sides.node[mine[first]]
    order = np.argsort(nodes, kind="stable")
    return Normals(nodes[order], normal[chosen[order]])


def _sides(skins: Sequence[Surface]) -> _Sides:
    label, _ = label_faces(Faces.stack([skin.faces for skin in skins]))
    parts: list[_Sides] = []
    start = 0
    for number, skin in enumerate(skins):
        for name, rows, nodes in skin.by_type():
            normal, area = _at_nodes(skin, name, nodes)
            n = nodes.shape[1]
            face = np.repeat(label[start + rows], n)
            skin_of = np.full(nodes.size, number)
            parts.append(_Sides(nodes.ravel(), skin_of, face, normal.reshape(-1, 3), np.repeat(area, n)))
        start += len(skin)
    node, skin_of, face, normal, area = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.lexsort((face, node))
    return _Sides(node[order], skin_of[order], face[order], normal[order], area[order])


def _at_nodes(skin: Surface, name: str, nodes: Ints) -> tuple[Floats, Floats]:
    """Return unit normals (k, n, 3) of faces of one type at their nodes, and areas (k,).

    Where the normal at a node is 0, it is the mean normal of the face.
    """
    x = skin.x[nodes]
    X, w = rule(CELLS[name].family, 4)
    mean = np.einsum("fps,p->fs", weighted(name, x, X), w)
    area = np.linalg.norm(mean, axis=1)
    there = weighted(name, x, np.array(CELLS[name].reference))
    size = np.linalg.norm(there, axis=2, keepdims=True)
    there = np.where(size > 1e-9 * area[:, None, None], there, mean[:, None])
    size = np.linalg.norm(there, axis=2, keepdims=True)
    return np.divide(there, size, out=np.zeros_like(there), where=size > 0), area


def _first(sides: _Sides) -> NDArray[np.bool_]:
    """Return a mask (s,), True for the first row of a face and node, so that a face in two groups counts once."""
    repeated = (sides.node[1:] == sides.node[:-1]) & (sides.face[1:] == sides.face[:-1])
    return np.concatenate([[True], ~repeated])


def _shared(sides: _Sides) -> Ints:
    """Return the number of each row's normal, (s,); rows of a node within the crease angle share one."""
    least = np.cos(np.radians(CREASE_ANGLE)) - 1e-12
    end = np.searchsorted(sides.node, sides.node, side="right")
    rows = np.arange(len(end))
    pairs: list[tuple[Ints, Ints]] = []
    other = rows + 1
    while len(rows):  # the next side of the same node, the one after ...; only those that have one go on
        more = other < end[rows]
        rows, other = rows[more], other[more]
        close = (sides.normal[rows] * sides.normal[other]).sum(axis=1) >= least
        pairs.append((rows[close], other[close]))
        other = other + 1
    a, b = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return label_components(a, b, len(end))
