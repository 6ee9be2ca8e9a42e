"""A surface: faces of one dimension, oriented outward, and the coordinates of their nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.facts import Described
from lacmesh.mesh import Floats, Ints, Mesh, codes
from lacmesh.surface.maps import Height, values
from lacmesh.topology.orientation import corner_normals, is_inverted, relative_listing, turned_over
from lacmesh.topology.skin import (
    FACE_TYPES,
    MAX_CORNERS,
    N_CORNERS,
    N_NODES,
    FaceIncidence,
    Faces,
    cells_of_dim,
    distinct_faces,
    facets_of,
    find_owners,
    neighbours,
)

#: z of a plane mesh may differ by this much of its extent
_PLANE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Surface(Described):
    """Distinct faces of one dimension, one per row, with the winding whose normal points out of the cells behind.

    `x` (n_nodes of the mesh, 3): coordinates. `faces`: types and nodes. `cell` (f,): the mesh's cell each row is.
    `dim`: 2 for faces of solids, 1 for segments (whose normal lies in their plane, z constant). `depth` (f,): depth of
    the cell behind, at its deepest corner below the face; NaN unless there is exactly one cell behind. `height`: that
    of the smooth surface that the faces approximate; None if the surface consists of the faces themselves. `x_0`
    (n_nodes of the mesh, 3): coordinates before the deformation (`at`); None without one.
    """

    x: Floats
    faces: Faces
    cell: Ints
    dim: int
    depth: Floats
    height: Height | None = None
    x_0: Floats | None = None

    @classmethod
    def of(cls, mesh: Mesh, cells: Ints) -> Surface:
        """Build the surface of some skin cells (indices) of a mesh.

        The faces are in the order of `cells`; one with the same corners as an earlier one is left out. A face with one
        cell behind it is oriented outward (also if that cell is inverted); between two cells, or with none, it keeps
        the orientation it has in the mesh. Raises DataError for cells that are no faces, or of several dimensions.

        >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]]), ("SEG2", [[2, 1]])])
        >>> Surface.of(square, np.array([1])).faces.nodes[0, :2]
        array([1, 2])
        """
        cells = np.asarray(cells, np.int64)
        dim = _dimension(mesh, cells)
        faces, first = distinct_faces(mesh, cells)
        cells = cells[first]
        parents = find_owners(faces, cells_of_dim(mesh, dim + 1), mesh.n_nodes)
        alone = np.bincount(parents.face, minlength=len(faces)) == 1
        parents = parents.take(np.flatnonzero(alone[parents.face]))
        inward = relative_listing(facets_of(mesh, parents), faces.take(parents.face)) % 2 == 1
        inward ^= is_inverted(mesh, parents.cell, plane=True)  # the normal points into the only cell behind
        faces = turned_over(faces, parents.face[inward])
        surface = cls(mesh.points, faces, cells, dim, np.full(len(faces), np.nan))
        return replace(surface, depth=_depth(mesh, surface, parents))

    def __len__(self) -> int:
        return len(self.cell)

    def at(self, x: Floats) -> Surface:
        """Return the deformed surface: these faces at other coordinates x (n_nodes, 3)."""
        x = np.asarray(x, dtype=float)
        if x.shape != self.x.shape:
            raise ValueError(f"coordinates must be {self.x.shape}, not {x.shape}")
        return replace(self, x=x, x_0=self.x if self.x_0 is None else self.x_0)

    @property
    def undeformed(self) -> Surface:
        """The surface before its deformation."""
        return self if self.x_0 is None else replace(self, x=self.x_0, x_0=None)

    def take(self, rows: Ints) -> Surface:
        """Some of the faces."""
        height = None if self.height is None else self.height.take(rows)
        return replace(self, faces=self.faces.take(rows), cell=self.cell[rows], depth=self.depth[rows], height=height)

    def turned_over(self, rows: Ints) -> Surface:
        """Return the surface with some rows of faces flipped, and without heights."""
        return replace(self, faces=turned_over(self.faces, rows), height=None)

    def heights(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n,): heights of the smooth surface, outward, over reference points xi (n, 2) of faces (n,)."""
        return np.zeros(len(face)) if self.height is None else self.height.at(face, xi)

    def leans(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n, dim): slopes of the normals of the smooth surface to the faces there (`Height.lean`)."""
        shape = len(face), self.dim
        return np.zeros(shape) if self.height is None else values(self.height.leans, face, xi)[:, : self.dim]

    def by_type(self) -> Iterator[tuple[str, Ints, Ints]]:
        """Iterate over the faces type by type: (type, rows, nodes (k, n_nodes of the type))."""
        for code in codes(self.faces.type):
            rows = np.flatnonzero(self.faces.type == code)
            yield FACE_TYPES[code], rows, self.faces.nodes[rows, : N_NODES[code]]

    @cached_property
    def n_corners(self) -> Ints:
        """(f,): number of corners of each face."""
        return N_CORNERS[self.faces.type]

    @cached_property
    def size(self) -> Floats:
        """(f,): the largest distance between two corners of each face."""
        corners = self.faces.corners
        x = self.x[np.where(corners < 0, corners[:, :1], corners)]
        with np.errstate(over="ignore", invalid="ignore"):
            return np.linalg.norm(x[:, :, None] - x[:, None], axis=3).max(axis=(1, 2))

    @cached_property
    def neighbours(self) -> Ints:
        """(f, 4): the neighbour across the edge from corner k to the next (at corner k, for segments), or -1.

        At an edge of more than two faces it is one of the others.
        """
        return neighbours(self.faces)

    @cached_property
    def boundary(self) -> NDArray[np.bool_]:
        """(f, 4): True for edges that no other face has, in the order of `neighbours` (for segments, corners)."""
        return (self.neighbours < 0) & (np.arange(self.neighbours.shape[1]) < self.n_corners[:, None])


def _dimension(mesh: Mesh, cells: Ints) -> int:
    if not len(cells):
        raise DataError("a surface needs at least one face: the list of cells is empty")
    dims = codes(mesh.cell_dim[cells])
    if len(dims) > 1 or dims[0] not in (1, 2):
        raise DataError(
            f"a surface is made of faces of one dimension, 1 or 2, and cells {mesh.cell_names(cells)} have dimensions "
            f"{', '.join(map(str, dims))}",
            mesh.cell_number[cells],
        )
    for kind, which, nodes in mesh.select(cells):
        if kind not in CELLS:
            message = f"cells {mesh.cell_names(which)} are of type {kind}; a surface is made of linear or quadratic"
            raise DataError(f"{message} faces", mesh.cell_number[which])
        z = mesh.points[nodes, 2]
        if dims[0] == 1 and np.ptp(z) > _PLANE * np.ptp(mesh.points, axis=0).max():
            message = f"segments {mesh.cell_names(which)} do not lie in a plane z = constant: their normal is unknown"
            raise DataError(message, mesh.cell_number[which])
    return int(dims[0])


def _depth(mesh: Mesh, surface: Surface, parents: FaceIncidence) -> Floats:
    """Depth of the cell behind each face, down to its deepest corner; NaN for faces that are not in the match."""
    depth = np.full(len(surface), np.nan)
    normal, centre = mean_normals(surface)
    order = np.argsort(parents.cell, kind="stable")
    done = 0
    for kind, cells, nodes in mesh.select(parents.cell[order]):
        rows = parents.face[order[done : done + len(cells)]]
        x = mesh.points[nodes[:, : CELLS[kind].n_corners]]
        with np.errstate(over="ignore", invalid="ignore"):
            depth[rows] = np.einsum("fcs,fs->fc", centre[rows][:, None] - x, normal[rows]).max(axis=1)
        done += len(cells)
    return depth


def mean_vectors(surface: Surface) -> Floats:
    """(f, 3): normals of the faces' mean planes; as long as segments, twice as long as the area of other faces."""
    return corner_normals(surface.x[surface.faces.nodes[:, :MAX_CORNERS]], surface.n_corners)


def mean_normals(surface: Surface) -> tuple[Floats, Floats]:
    """(f, 3): unit normals of the faces' mean planes, 0 for degenerate faces; (f, 3): means of the faces' corners."""
    corners = np.arange(MAX_CORNERS) < surface.n_corners[:, None]
    x = surface.x[surface.faces.nodes[:, :MAX_CORNERS]]
    with np.errstate(over="ignore", invalid="ignore"):  # wild coordinates have no normal
        normal = mean_vectors(surface)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        centre = np.where(corners[..., None], x, 0.0).sum(axis=1) / surface.n_corners[:, None]
    fine = (size > 0) & np.isfinite(size)
    return np.divide(normal, size, out=np.zeros_like(normal), where=fine), centre
