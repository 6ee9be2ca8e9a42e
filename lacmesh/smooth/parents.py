"""The faces of a surface before the cut, and patches: sets of them that are joined without a crease.

Parents are those of faces that a cut has made; the other faces are their own. The outline of a macro-element is its
parent: the edges that belong to one child only, with the winding of the children (in the plane, the two ends). The
positions of its other nodes in the parent are found by inverting the parent's map. Patches have their own copies of the
nodes, so that creases separate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints, Mesh, codes
from lacmesh.reference.shapes import gradient, shape
from lacmesh.surface.normals import unit
from lacmesh.surface.record import Surface, mean_normals, mean_vectors
from lacmesh.topology.bodies import label_components
from lacmesh.topology.skin import FACE_TYPES, MAX_CORNERS, MAX_NODES, TYPE_CODE, Faces, edge_uses

Bools = NDArray[np.bool_]

#: a node of a macro-element that is farther from its parent than this part of the parent's size was not put there by
#: a cut: the faces are then their own parents
_NEAR = 1e-3
#: mid-nodes that are off the chord by no more of the face's size were put there, up to the digits of a file
_STRAIGHT = 1e-4
#: of a face of so many corners
_LINEAR = np.array([0, 0, TYPE_CODE["SEG2"], TYPE_CODE["TRIA3"], TYPE_CODE["QUAD4"]])
#: (types, 4, 2): corners of each type in its own reference element
_REFERENCE = np.zeros((len(FACE_TYPES), MAX_CORNERS, 2))
for _code, _cell in enumerate(CELLS[name] for name in FACE_TYPES):
    _REFERENCE[_code, : _cell.n_corners, : _cell.dim] = np.reshape(
        _cell.reference[: _cell.n_corners], (_cell.n_corners, -1)
    )


class Parents(NamedTuple):
    """Parents of a surface's faces (f,): `faces`, the surface of the parents; `of` (f,), the row of each face's parent.

    `corner` (f, 4, 2): the faces' corners in their parents' reference elements.
    """

    faces: Surface
    of: Ints
    corner: Floats


def parents_of(mesh: Mesh, surface: Surface) -> Parents:
    """Find the parents of a surface's faces, from the records of the mesh's cut (`lacmesh.cutting.records`).

    A macro-element that is only partly in the surface still has its whole parent. If a macro-element is not like one
    that a cut makes, each of its faces is its own parent.
    """
    own = Parents(surface, np.arange(len(surface)), _REFERENCE[surface.faces.type])
    macro = _macro_of_cell(mesh)
    wanted = np.unique(macro[surface.cell])
    children = np.flatnonzero(np.isin(macro, wanted[wanted >= 0]))
    if not len(children):
        return own
    missing = np.setdiff1d(children, surface.cell)
    whole = surface
    if len(missing):
        whole = Surface.of(mesh, np.concatenate([surface.cell, missing])).at(surface.x)
    number = np.unique(macro[whole.cell], return_inverse=True)[1] - int((macro[whole.cell] < 0).any())
    outline = _outlines(whole, number)
    corner, good = _places(whole, number, outline)
    return _joined(own, number[: len(surface)], outline, corner[: len(surface)], good)


def are_straight(surface: Surface) -> NDArray[np.bool_]:
    """(f,): True for linear faces, and for those whose other nodes lie on the linear face between their corners."""
    out = np.ones(len(surface), bool)
    normal = mean_normals(surface)[0]
    for name, rows, nodes in surface.by_type():
        linear = CELLS[name].linear
        N = shape(linear, np.array(CELLS[name].reference, dtype=float)[:, : CELLS[name].dim])
        off = surface.x[nodes] - np.einsum("ac,fcs->fas", N, surface.x[nodes[:, : CELLS[linear].n_nodes]])
        out[rows] = np.abs(np.einsum("fas,fs->fa", off, normal[rows])).max(axis=1) <= _STRAIGHT * surface.size[rows]
    return out


def by_corners(surface: Surface) -> Surface:
    """Return the linear faces between the corners of a surface's faces."""
    kind = _LINEAR[surface.n_corners]
    nodes = np.where(np.arange(MAX_NODES) < surface.n_corners[:, None], surface.faces.nodes, -1)
    return Surface(surface.x, Faces(kind, nodes), surface.cell, surface.dim, surface.depth)


def _macro_of_cell(mesh: Mesh) -> Ints:
    """(n_cells,): a number for each cut face: that of its macro-element or, for duplicates, of its parent; else -1."""
    nothing = np.full(mesh.n_cells, -1, np.int64)
    macro = np.array(mesh.cell_data.get("lac_macro", nothing), np.int64)
    parent = np.array(mesh.cell_data.get("lac_parent", nothing), np.int64)
    copy = (macro < 0) & (parent >= 0) & (mesh.cell_dim < mesh.dim)
    macro[copy] = parent[copy] + macro.max(initial=0) + 1
    return macro


def _outlines(whole: Surface, macro: Ints) -> Ints:
    """(m, 4): corners of the parent of each macro-element, padded with -1; all -1 if the outline is not a parent's."""
    uses = edge_uses(whole.faces)
    mine = macro[uses.face]
    both = np.unique(uses.edge * (len(whole) + 1) + mine, return_inverse=True)[1]
    once = np.flatnonzero((np.bincount(both)[both] == 1) & (mine >= 0))
    once = once[np.lexsort((uses.place[once], uses.face[once], mine[once]))]
    mine, place, a, b = mine[once], uses.place[once], uses.start[once], uses.stop[once]
    size = int(macro.max()) + 1
    count = np.bincount(mine, minlength=size)
    start = np.cumsum(count) - count
    out = np.full((size, MAX_CORNERS), -1, np.int64)
    if whole.dim == 1:
        two = count[mine] == 2
        out[mine[two], place[two]] = a[two]
        out[(out[:, :2] < 0).any(axis=1)] = -1
        return out
    for n in (3, 4):
        which = np.flatnonzero(count == n)
        rows = start[which][:, None] + np.arange(n)
        corners = [a[rows[:, 0]]]
        here = b[rows[:, 0]]
        for _ in range(n - 1):
            corners.append(here)
            at = a[rows] == here[:, None]
            here = np.where(at.any(axis=1), b[rows][np.arange(len(rows)), at.argmax(axis=1)], -1)
        ring = np.stack(corners, axis=1) if len(which) else np.empty((0, n), np.int64)
        ordered = np.sort(ring, axis=1)
        closed = (here == ring[:, 0]) & (ordered[:, 0] >= 0) & (np.diff(ordered, axis=1) > 0).all(axis=1)
        out[which[closed], :n] = ring[closed]
    return out


def _places(whole: Surface, macro: Ints, outline: Ints) -> tuple[Floats, NDArray[np.bool_]]:
    """(f, 4, 2): the corners of the faces in their parents; (m,): True if a macro-element is a cut of its parent.

    It is one if its outer nodes are the parent's corners, and its other nodes, at least one, lie close to the parent.
    """
    corner = np.zeros((len(whole), MAX_CORNERS, 2))
    n_corners = (outline >= 0).sum(axis=1)
    good: NDArray[np.bool_] = n_corners > 1
    inner = np.zeros(len(good), bool)
    for n in codes(n_corners[good]):
        name = FACE_TYPES[_LINEAR[n]]
        X = np.array(CELLS[name].reference)
        rows, k = np.nonzero(
            (np.arange(MAX_CORNERS) < whole.n_corners[:, None]) & ((macro >= 0) & (n_corners[macro] == n))[:, None]
        )
        node, ring = whole.faces.nodes[rows, k], outline[macro[rows], :n]
        same = ring == node[:, None]
        outer = same.any(axis=1)
        place = X[same.argmax(axis=1)]
        place[~outer], far = inverse(name, whole.x[ring[~outer]], whole.x[node[~outer]])
        corner[rows, k, : X.shape[1]] = place
        inner[macro[rows[~outer]]] = True
        good[macro[rows[~outer][far > _NEAR]]] = False
    return corner, good & inner


def inverse(name: str, x: Floats, point: Floats) -> tuple[Floats, Floats]:
    """(n, dim): reference coordinates in linear faces with corners x (n, k, 3) nearest to points (n, 3); (n,): misfit.

    The misfit is the distance over the size of the face. By Newton's method (Gauss-Newton), which ends after one step
    except on quadrangles.
    """
    xi = np.zeros((len(x), CELLS[name].dim)) + np.mean(CELLS[name].reference, axis=0)
    size = np.linalg.norm(np.ptp(x, axis=1), axis=1)
    for _ in range(12):
        miss = point - np.einsum("pn,pns->ps", shape(name, xi), x)
        J = np.einsum("pns,pnd->psd", x, gradient(name, xi))
        A = np.einsum("psd,pse->pde", J, J)
        singular = np.linalg.det(A) <= 0  # a face without extent: it is found not to fit
        A[singular] = np.eye(A.shape[1])
        step = np.linalg.solve(A, np.einsum("psd,ps->pd", J, miss)[:, :, None])[:, :, 0]
        xi = xi + step
        if np.abs(step).max(initial=0.0) < 1e-8:  # the next would be its square
            break
    miss = point - np.einsum("pn,pns->ps", shape(name, xi), x)
    return xi, np.linalg.norm(miss, axis=1) / np.maximum(size, 1e-300)


def _joined(own: Parents, macro: Ints, outline: Ints, corner: Floats, good: NDArray[np.bool_]) -> Parents:
    """Join the parents of the `good` macro-elements and the other faces, in the order of their first faces."""
    surface = own.faces
    cut = (macro >= 0) & good[macro]
    key = np.where(cut, macro, len(good) + np.arange(len(macro)))
    first, of = np.unique(key, return_index=True, return_inverse=True)[1:]
    order = np.argsort(first)
    first, of = first[order], np.argsort(order)[of]
    faces = surface.faces.take(first)
    kind, nodes = faces.type.copy(), faces.nodes.copy()
    cut_cells = np.flatnonzero(cut[first])
    ring = outline[macro[first[cut_cells]]]
    kind[cut_cells] = _LINEAR[(ring >= 0).sum(axis=1)]
    nodes[cut_cells] = np.pad(ring, ((0, 0), (0, MAX_NODES - MAX_CORNERS)), constant_values=-1)
    parents = Surface(surface.x, Faces(kind, nodes), surface.cell[first], surface.dim, np.full(len(first), np.nan))
    return Parents(parents, of, np.where(cut[:, None, None], corner, own.corner))


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
    a, b = uses.pairs
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
        area = np.linalg.norm(mean_vectors(surface), axis=1) / surface.dim
        whole = cls(x, node, np.zeros(len(x), int), np.zeros(len(node), int), normal, area, joints, surface.dim)
        return whole.split(np.zeros(len(node), int))

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
        return replace(self, x=self.x[old], node=node, owner=owner, patch=patch)

    @cached_property
    def node_normal(self) -> Floats:
        """(n, 3): unit normals at the nodes, the area-weighted mean of those of the patch's faces there."""
        out = np.zeros_like(self.x)
        weighted = self.normal * self.area[:, None]
        for k in range(MAX_CORNERS):
            rows = self.node[:, k] >= 0
            np.add.at(out, self.node[rows, k], weighted[rows])
        return unit(out)

    @cached_property
    def edge_normal(self) -> Floats:
        """(f, 4, 3): unit normals at the midpoints of the edges, equal for two faces that meet without a crease."""
        out = np.repeat(self.normal[:, None], MAX_CORNERS, axis=1)
        if self.dim == 2:
            i, j, a, b = self.joints
            out[i, a] += self.normal[j]
            out[j, b] += self.normal[i]
        return unit(out)

    def edges(self) -> tuple[Ints, Ints, Ints, Ints]:
        """Faces, edge numbers, and the two nodes of each edge (e,): the edges whose midpoints have a height."""
        n = (self.node >= 0).sum(axis=1)
        face, k = np.nonzero(np.arange(MAX_CORNERS) < np.where(n == 2, 1, n)[:, None])
        return face, k, self.node[face, k], self.node[face, (k + 1) % n[face]]
