"""Edges of the faces in sight, each once: where a body has a crease, where a macro-element ends, and the others.

An edge is (end, end, mid-node or -1), three indices of nodes.
"""

from __future__ import annotations

import numpy as np

from lacmesh.mesh import Floats, Ints
from lacmesh.scene.visible import is_segment
from lacmesh.topology.skin import N_CORNERS, N_NODES, Faces, edge_uses

#: cosine of the angle from which an edge between two faces is a crease
CREASE_COSINE = 0.77
TINY = 1e-300


def edges_of(faces: Faces) -> tuple[Ints, Ints, Ints]:
    """Every edge of every face but segments, (e, 3), its label from 0, and the row of the face."""
    rows = np.flatnonzero(~is_segment(faces))
    flat = faces.take(rows)
    uses = edge_uses(flat)
    corners = N_CORNERS[flat.type[uses.face]]
    curved = N_NODES[flat.type[uses.face]] > corners
    middle = np.where(curved, flat.nodes[uses.face, np.where(curved, corners + uses.place, 0)], -1)
    return np.stack([uses.start, uses.stop, middle], axis=1), uses.edge, rows[uses.face]


def body_edges(points: Floats, faces: Faces) -> tuple[Ints, Ints]:
    """Edges of bodies, each once: those between smooth faces, and those where the body ends or has a crease."""
    ends, label, face = edges_of(faces)
    count = int(label.max(initial=-1)) + 1
    x = points[faces.nodes[:, :3]]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), TINY)
    order = np.argsort(label, kind="stable")
    first = np.searchsorted(label[order], np.arange(count))
    times = np.bincount(label, minlength=count)
    other = order[np.minimum(first + 1, len(order) - 1)] if len(order) else order
    turn = np.abs((normal[face[order[first]]] * normal[face[other]]).sum(axis=1))
    sharp = (times != 2) | (turn < CREASE_COSINE)
    return ends[order[first[~sharp]]], ends[order[first[sharp]]]


def group_edges(faces: Faces, group: Ints) -> tuple[Ints, Ints]:
    """The edges of faces that stand in groups (f,), each once: those inside a group, and those on its outline."""
    ends, label, face = edges_of(faces)
    count = int(label.max(initial=-1)) + 1
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(low, label, group[face])
    np.maximum.at(high, label, group[face])
    inside = (np.bincount(label, minlength=count) == 2) & (low == high)
    once = np.unique(label, return_index=True)[1]
    return ends[once[inside]], ends[once[~inside]]


def segments(faces: Faces) -> tuple[Ints, Ints]:
    """The faces that are segments, as edges (e, 3), and their rows."""
    rows = np.flatnonzero(is_segment(faces))
    return faces.nodes[rows][:, :3], rows


def group_ends(faces: Faces, group: Ints) -> Ints:
    """Nodes where a group of segments ends: `group` (f,)."""
    line = np.flatnonzero(is_segment(faces))
    nodes = faces.nodes[line][:, :2]
    pairs = np.stack([nodes.ravel(), np.repeat(group[line], 2)], axis=1)
    pairs, times = np.unique(pairs, axis=0, return_counts=True)
    return np.unique(pairs[times == 1, 0])
