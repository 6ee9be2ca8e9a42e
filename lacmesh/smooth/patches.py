"""Patches: sets of faces joined without a crease, each with its own copies of the nodes, so that creases separate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.surface.record import Surface, mean_normals
from lacmesh.topology.bodies import label_components
from lacmesh.topology.skin import MAX_CORNERS, edge_uses

Bools = NDArray[np.bool_]


class Joints(NamedTuple):
    """Pairs of faces that meet at an edge without a crease: rows `i`, `j` (k,), and the number of the edge in each."""

    i: Ints
    j: Ints
    edge_i: Ints
    edge_j: Ints


def joints_of(surface: Surface, normal: Floats, crease_angle: float, taken: Ints | None = None) -> Joints:
    """Find edges at which exactly two faces meet, with an angle below `crease_angle` (degrees) between their normals.

    `normal`: (f, 3). `taken` (f,): faces with the same number, 0 or more, join at any angle. In the plane, the ends of
    segments.
    """
    uses = edge_uses(surface.faces)
    order = np.argsort(uses.edge, kind="stable")
    two = np.bincount(uses.edge)[uses.edge[order]] == 2
    a, b = order[two].reshape(-1, 2).T
    i, j = uses.face[a], uses.face[b]
    smooth = (normal[i] * normal[j]).sum(axis=1) > np.cos(np.radians(crease_angle))
    if taken is not None:
        smooth |= (taken[i] == taken[j]) & (taken[i] >= 0)
    a, b = a[smooth], b[smooth]
    return Joints(uses.face[a], uses.face[b], uses.place[a], uses.place[b])


@dataclass(frozen=True, eq=False)
class SmoothPatches:
    """Faces (f,) in patches: `patch` (f,) from 0, `node` (f, 4) rows of `x` (n, 3), -1 where a face has fewer corners.

    A node that two patches share occurs in `x` once for each. `owner` (n,): its patch; `normal` (f, 3) and `area` (f,)
    of the faces, `joints` between them (also across the borders of patches).
    """

    x: Floats
    node: Ints
    owner: Ints
    patch: Ints
    normal: Floats
    area: Floats
    joints: Joints
    dim: int

    @classmethod
    def of(cls, surface: Surface, crease_angle: float, x: Floats, taken: Ints | None = None) -> SmoothPatches:
        """Return the patches of a surface of linear faces at coordinates x (n_nodes of the mesh, 3).

        `taken` (f,): as in `joints_of`.
        """
        surface = surface.at(x)
        normal = mean_normals(surface)[0]
        joints = joints_of(surface, normal, crease_angle, taken)
        node = surface.faces.corners
        return cls(x, node, np.zeros(len(x), int), np.zeros(len(node), int), normal, _areas(surface), joints,
                   surface.dim).split(np.zeros(len(node), int))  # fmt: skip

    def split(self, kind: Ints) -> SmoothPatches:
        """Split the patches into connected ones of faces of the same kind (f,)."""
        i, j = self.joints.i, self.joints.j
        same = kind[i] == kind[j]
        patch = label_components(i[same], j[same], len(kind)) if len(kind) else self.patch
        there = self.node >= 0
        row = np.nonzero(there)[0]
        n_patches = int(patch.max(initial=-1)) + 1
        code = self.node[there].astype(np.int64) * max(n_patches, 1) + patch[row]
        one, inverse = np.unique(code, return_inverse=True)
        node = np.full(self.node.shape, -1, np.int64)
        node[there] = inverse
        old, owner = np.divmod(one, max(n_patches, 1))
        return SmoothPatches(self.x[old], node, owner, patch, self.normal, self.area, self.joints, self.dim)

    @cached_property
    def node_normal(self) -> Floats:
        """(n, 3): unit normals at the nodes, the area-weighted mean of those of the patch's faces there."""
        out = np.zeros_like(self.x)
        weighted = self.normal * self.area[:, None]
        for k in range(MAX_CORNERS):
            rows = self.node[:, k] >= 0
            np.add.at(out, self.node[rows, k], weighted[rows])
        size = np.linalg.norm(out, axis=1, keepdims=True)
        return np.divide(out, size, out=out, where=size > 0)

    @cached_property
    def edge_normal(self) -> Floats:
        """(f, 4, 3): unit normals at the midpoints of the edges, equal for two faces that meet without a crease."""
        out = np.repeat(self.normal[:, None], MAX_CORNERS, axis=1)
        if self.dim == 2:
            i, j, a, b = self.joints
            out[i, a] += self.normal[j]
            out[j, b] += self.normal[i]
        size = np.linalg.norm(out, axis=2, keepdims=True)
        return np.divide(out, size, out=out, where=size > 0)

    def edges(self) -> tuple[Ints, Ints, Ints, Ints]:
        """Faces, edge numbers, and the two nodes of each edge (e,): the edges whose midpoints have a height."""
        n = (self.node >= 0).sum(axis=1)
        face, k = np.nonzero(np.arange(MAX_CORNERS) < np.where(n == 2, 1, n)[:, None])
        return face, k, self.node[face, k], self.node[face, (k + 1) % n[face]]


def _areas(surface: Surface) -> Floats:
    """(f,): areas of the faces, lengths of segments."""
    x = surface.x[surface.faces.nodes[:, :MAX_CORNERS]]
    if surface.dim == 1:
        return np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    last = np.where((surface.n_corners == 4)[:, None], x[:, 3], x[:, 0])
    return np.linalg.norm(np.cross(x[:, 2] - x[:, 0], last - x[:, 1]), axis=1) / 2
