"""Normals of contact that are not those of the slave's faces, each once, and their derivative by the displacement.

They are smoothed ones at the nodes of the slave, or those of the master turned round. As in
`lacmesh.surface.normals.smoothed`, the normal at a node of a face is the area-weighted mean of the normals of the faces
that meet there, without those across a crease:

    h = H / |H|,  H = sum_f A_f n_f,        dh = P sum_f (A_f dn_f + n_f dA_f),  P = (1 - h h^T) / |H|

All faces at a node have the same normal there, unless a crease runs through it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient
from lacmesh.surface import Surface
from lacmesh.surface.normals import at_nodes, crease_pairs, dual_vectors, normals_of, smooth_normals, unit
from lacsolver.space.sparse import sparse


class OtherNormals(NamedTuple):
    """Unit normals `n` (k, 3); `of_faces` (f, 9): those at the nodes of each face of the slave, -1 beyond.

    `of_master`: of the master's faces instead. `derivative` (d k, d n): of their components, by the displacements of
    the n nodes of both skins.
    """

    of_faces: Ints
    n: Floats
    derivative: csr_array
    of_master: bool = False


def other_normals(
    slave: Surface, master: Surface, normals: str, crease_angle: float | None, d: int, nodes: Ints
) -> OtherNormals | None:
    """Return the normals of a pairing that are not those of the slave's faces, None for those.

    `normals`, `crease_angle`: as in `lacmesh.contact_points`; `nodes` (n,): those of both skins, ascending.
    """
    if normals == "facet":
        return None
    if normals != "master":
        return nodal_normals(slave, crease_angle, d, nodes)
    of_faces, n, derivative, _ = nodal_normals(master, crease_angle, d, nodes)
    return OtherNormals(of_faces, -n, -derivative, of_master=True)


def nodal_normals(skin: Surface, crease_angle: float | None, d: int, nodes: Ints) -> OtherNormals:
    """Return the smoothed normals of a skin; `nodes` as in `other_normals`."""
    faces, position = [], np.zeros(len(skin), np.int64)
    for name, rows, of_face in skin.by_type():
        term, change = _face_normals(name, *at_nodes(skin, name, rows, skin.x[of_face]), skin.x[of_face], d)
        faces.append((rows, of_face, term, change))
        position[rows] = np.arange(len(rows))
    at, other = crease_pairs(skin, crease_angle)
    of_faces, first = _distinct(skin.faces.nodes, np.bincount(at, minlength=9 * len(skin)))
    taken = first[of_faces.ravel()[at]] == at  # of positions with the same normal, one is enough
    row, face, corner = of_faces.ravel()[at[taken]], *np.divmod(other[taken], 9)
    parts = []
    for rows, of_face, term, change in faces:
        some = np.flatnonzero(np.isin(face, rows))
        f, a = position[face[some]], corner[some]
        parts.append((row[some], np.searchsorted(nodes, of_face[f]), term[f, a], change[f, a]))
    return _normalised(of_faces, parts, len(first), len(nodes), d)


def _distinct(nodes: Ints, n_faces: Ints) -> tuple[Ints, Ints]:
    """Return the normal of each face's nodes (f, 9), numbered without repetition, and the first place of each.

    `n_faces` (9 f,): number of faces whose normals are averaged there: where it is that of all faces at the node, all
    have the same normal.
    """
    flat = nodes.ravel()
    there = np.flatnonzero(flat >= 0)
    every = np.bincount(flat[there])[flat[there]]
    key = np.where(n_faces[there] == every, flat[there], flat.max() + 1 + there)
    _, first, normal = np.unique(key, return_index=True, return_inverse=True)
    out = np.full(len(flat), -1, np.int64)
    out[there] = normal
    return out.reshape(nodes.shape), there[first]


def _normalised(of_faces: Ints, parts: list, k: int, n_nodes: int, d: int) -> OtherNormals:
    """Return the normals from sums over faces: rows (e,), nodes (e, b), terms (e, d), changes (e, d, b, d)."""
    H = np.zeros((k, d))
    for row, _, term, _ in parts:
        np.add.at(H, row, term)
    size = np.linalg.norm(H, axis=1)
    h = np.divide(H, size[:, None], out=np.zeros_like(H), where=size[:, None] > 0)
    P = (np.eye(d) - h[:, :, None] * h[:, None, :]) / np.where(size > 0, size, 1.0)[:, None, None]
    entries = []
    for row, nodes, _, change in parts:
        i, j = d * row[:, None] + np.arange(d), d * nodes[:, :, None] + np.arange(d)
        along = (P[row] @ change.reshape(len(row), d, -1)).reshape(change.shape)
        entries.append((i[:, :, None, None], j[:, None], along))
    n = np.zeros((k, 3))
    n[:, :d] = h
    return OtherNormals(of_faces, n, sparse((d * k, d * n_nodes), *entries))


def _face_normals(name: str, J: Floats, lean: Floats, x: Floats, d: int) -> tuple[Floats, Floats]:
    """Return A n (k, a, d) at the nodes of faces of one type, with nodes at x (k, b, 3), and its derivative.

    A is the area of the face, n the unit normal. The derivative is (k, a, d, b, d), by the displacements of the nodes
    b. `J`, `lean`: tangents and slopes of the normals at the nodes; n changes as in `chain`.
    """
    dN = gradient(name, np.array(CELLS[name].reference, dtype=float)[:, : CELLS[name].dim])
    n, N = smooth_normals(J, lean)[..., :d], unit(normals_of(J))[..., :d]
    c = -dual_vectors(J)[..., :d, :] @ dN.transpose(0, 2, 1)
    out, leans = -(n[..., None] * c).sum(axis=2), N - (N * n).sum(axis=2, keepdims=True) * n
    c += n[..., None] * out[:, :, None]
    dn = c[..., None] * n[:, :, None, None, :] + (leans[..., None] * out[:, :, None])[..., None] * N[:, :, None, None]
    A, dA = _areas(name, x, d)
    change = A[:, None, None, None, None] * dn + n[..., None, None] * dA[:, None, None]
    return A[:, None, None] * n, change


def _areas(name: str, x: Floats, d: int) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the size (k,) of the vector area of faces with nodes at x (k, b, 3), and its derivative (k, b, d)."""
    X, w = rule(CELLS[name].family, 4)
    dN = gradient(name, X[:, : CELLS[name].dim])
    J = np.einsum("qbc,kbs->kqsc", dN, x)
    vector = np.einsum("q,kqs->ks", w, normals_of(J))
    size = np.linalg.norm(vector, axis=1)
    unit = vector / size[:, None]
    if CELLS[name].dim == 1:
        along = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
        return size, ((w @ dN[..., 0])[:, None] * along[:, None])[..., :d]
    change = (w * dN[..., 0].T) @ np.cross(J[..., 1], unit[:, None])
    return size, change + (w * dN[..., 1].T) @ np.cross(unit[:, None], J[..., 0])
