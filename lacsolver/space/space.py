"""The displacement space: its cells, the numbering of its unknowns, and the strain of each model.

Node i has the unknowns d i, ..., d i + d - 1, its displacement along x, y (and z). Every node of the mesh has them,
including nodes that belong to no cell of the model's dimension: `attached` distinguishes these, and constraints leave
their unknowns out. Stress and strain have components xx, yy, zz, xy (plane, axisymmetric), and yz, xz (3D), in the
order of VTK. Shear strains are engineering strains, 2 eps_xy.

The gradient of displacement H_si = du_s/dX_i, (3, 3) in every model, is computed from the generalised gradient L u:
du_s/dX_i, and in axisymmetry, where H_22 is the hoop, a third row u_x / r.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import DataError, RequestError, did_you_mean
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, fixed, mask_of
from lacmesh.origin import format_coordinates, from_origin, origin_of_mesh
from lacmesh.reference.shapes import gradient
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.skin import lacking
from lacsolver.distributed.share import ALONE, Share
from lacsolver.space.cut_nodes import made_by_cut
from lacsolver.space.determinant import determinant
from lacsolver.space.pattern import Pattern, node_pattern
from lacsolver.space.rules import cell_rule
from lacsolver.space.thickness import thickness_of

#: components of stress and strain, in their order; plane and axisymmetric models have the first four
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
#: tolerance for z in a plane mesh, and for a negative radius, relative to the mesh's extent
_ROUNDING = 1e-9
_PIECE = 1 << 18


@dataclass(frozen=True)
class ModellingHypothesis:
    """Kinematic model: 3d, plane strain, plane stress or axisymmetric.

    `dim` d: components of displacement. `plane_stress`: True if the strain zz is free.
    """

    name: str
    dim: int
    axisymmetric: bool = False
    plane_stress: bool = False

    @property
    def rows(self) -> int:
        """Rows l of the generalised gradient L u."""
        return self.dim + self.axisymmetric

    @property
    def n_stress(self) -> int:
        """Number of components of stress and strain."""
        return 6 if self.dim == 3 else 4

    @cached_property
    def selector(self) -> NDArray[np.floating]:
        """S (3, 3, l, d): H_si = sum over k, a of S_sika L_k u_a."""
        S = np.zeros((3, 3, self.rows, self.dim))
        for s in range(self.dim):
            for i in range(self.dim):
                S[s, i, i, s] = 1.0
        if self.axisymmetric:
            S[2, 2, 2, 0] = 1.0
        return S


#: the models, by name
MODELS: Mapping[str, ModellingHypothesis] = MappingProxyType(
    {
        m.name: m
        for m in (
            ModellingHypothesis("3d", 3),
            ModellingHypothesis("plane_strain", 2),
            ModellingHypothesis("plane_stress", 2, plane_stress=True),
            ModellingHypothesis("axisymmetric", 2, axisymmetric=True),
        )
    }
)


class Cells(NamedTuple):
    """Cells of one type that carry displacements: type, nodes (k, n) int32, and indices `cell` (k,) in the mesh."""

    type: str
    nodes: Ints
    cell: Ints


@dataclass(frozen=True, eq=False)
class Space:
    """Displacements on the cells of a mesh that have the model's dimension; built by `Space.of`.

    `blocks`: these cells, one block per type, in the mesh's order. `thickness`: that of a plane model, one for all
    cells or that of each cell of the mesh; 1 for others.
    `share`: what this process holds of a model that several processes share; then `blocks` are the cells that touch its
    own nodes.

    Computations use the points of `local`; formulas, places and messages to the user use those of `mesh`.
    """

    mesh: Mesh
    model: ModellingHypothesis
    blocks: tuple[Cells, ...]
    thickness: float | NDArray[np.floating] = 1.0
    share: Share = ALONE

    @classmethod
    def of(
        cls, mesh: Mesh, model: str, thickness: float | Mapping[str, float] | None = None, share: Share = ALONE
    ) -> Space:
        """Make the space of a mesh for a model: `3d`, `plane_strain`, `plane_stress`, `axisymmetric` (r = x, axis y).

        `thickness` is for plane models (1 if None), one or that of each group of cells. Raises RequestError for a wrong
        model or thickness, DataError for cells that have none or several, and for a mesh that the model cannot use: no
        cells of its dimension, cells of order 3, a plane mesh out of its plane, a negative radius, cells whose Jacobian
        changes sign or is 0 (a cell with reversed numbering is fine).

        >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
        >>> space = Space.of(square, "plane_strain")
        >>> space.n_dof, space.dofs(np.array([2])).tolist()
        (8, [[4, 5]])
        """
        if model not in MODELS:
            raise RequestError(f"no model named {model!r}{did_you_mean(model, MODELS)}")
        thick = thickness_of(mesh, model, thickness)
        space = cls(mesh, MODELS[model], _solid_blocks(mesh, MODELS[model], share), thick, share)
        _check_plane(space)
        _check_volume(space)
        return space

    @cached_property
    def origin(self) -> NDArray[np.floating]:
        """Origin (3,) of the coordinates of `local`; in axisymmetry it is on the axis, so that x remains the radius."""
        origin = origin_of_mesh(self.mesh) if self.share.origin is None else self.share.origin
        return origin * [0.0, 1.0, 1.0] if self.model.axisymmetric else origin

    @cached_property
    def local(self) -> Mesh:
        """The mesh with points relative to `origin`, so that they keep their digits wherever the model lies."""
        return from_origin(self.mesh, self.origin)

    def places(self, u: Floats) -> NDArray[np.floating]:
        """Return the coordinates (n_nodes, 3) of the nodes displaced by u (n_dof,), relative to `origin`."""
        x = self.local.points.copy()
        x[:, : self.dim] += u.reshape(-1, self.dim)
        return x

    @cached_property
    def extent(self) -> float:
        """Largest side of the bounding box of the nodes that belong to cells of the space."""
        return self.extent_of(np.flatnonzero(self.attached))

    def extent_of(self, nodes: Ints) -> float:
        """Return the largest side of the bounding box of some nodes, those of all processes together."""
        x, largest = self.local.points[nodes], self.share.largest
        ends = zip(x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf), strict=True)
        return max(largest(float(high)) + largest(-float(low)) for low, high in ends)

    def largest(self, u: Floats) -> float:
        """Return the largest magnitude of a vector u (n_dof,) or (n_nodes,) at the nodes of all processes."""
        return self.share.largest(float(np.abs(self.own(u)).max(initial=0.0)))

    def mean(self, u: Floats) -> float:
        """Return the mean of a vector (n_dof,) over the nodes of all processes."""
        own = self.own(u)
        return float(np.divide(*self.share.total(np.array([own.sum(), own.size]))))

    def dot(self, x: Floats, y: Floats) -> float:
        """Return the product x . y of vectors (n_dof,), over the nodes of all processes."""
        if self.share.own is None:
            return float(x @ y)
        return float(self.share.total(np.asarray(self.own(x).ravel() @ self.own(y).ravel())))

    def agreed(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return a mask (n_nodes,) as the processes have it at their own nodes."""
        return np.asarray(self.updated(mask.astype(float)) > 0)

    def own(self, values: NDArray) -> NDArray:
        """Return the values (n_nodes, k), from (n_nodes k,), at this process's own nodes only: all, if it is alone."""
        by_node = values.reshape(self.mesh.n_nodes, -1)
        return by_node if self.share.own is None else by_node[self.share.own]

    def updated(self, u: Floats) -> NDArray[np.floating]:
        """Return u (n_dof,) with the values at the nodes of other processes that they have."""
        return self.share.update(u.reshape(self.mesh.n_nodes, -1)).ravel()

    def told(self, x: Floats, digits: int = 6) -> list[str]:
        """Return the formatted coordinates of a place x (3,) or (dim,), those of the model only."""
        return format_coordinates(x[: self.dim], self.extent, digits)

    @property
    def dim(self) -> int:
        """Number of components of a displacement."""
        return self.model.dim

    @property
    def n_dof(self) -> int:
        """Number of unknowns: `dim` for every node of the mesh."""
        return self.dim * self.mesh.n_nodes

    def dofs(self, nodes: Ints) -> Ints:
        """Return the unknowns (k, dim) of some nodes."""
        return self.dim * np.asarray(nodes)[:, None] + np.arange(self.dim)

    @cached_property
    def attached(self) -> NDArray[np.bool_]:
        """Mask (n_nodes,), True for nodes that belong to a cell of the space."""
        return mask_of(self.mesh.n_nodes, *(block.nodes for block in self.blocks))

    @cached_property
    def bodies(self) -> Ints:
        """Connected body of each node, (n_nodes,), counted from 0 by their first nodes; -1 for nodes of no cell.

        Cells that share a node belong to the same body.
        """
        if self.share.body is not None:
            return self.share.body
        return label_bodies((block.nodes for block in self.blocks), self.mesh.n_nodes)

    @cached_property
    def made_by_cut(self) -> NDArray[np.bool_]:
        """Mask (n_nodes,), True for nodes that the cut of the slaves made."""
        return made_by_cut(self.mesh)

    @cached_property
    def pattern(self) -> Pattern:
        """Pattern of the nonzero blocks of the stiffness."""
        return node_pattern((block.nodes for block in self.blocks), self.mesh.n_nodes)

    @property
    def neighbours(self) -> csr_array:
        """Matrix (n_nodes, n_nodes) with 1 for nodes of one cell."""
        indptr, indices = self.pattern
        n = self.mesh.n_nodes
        return csr_array((np.ones(len(indices), np.int8), indices, indptr), shape=(n, n))

    def depth(self, x: Floats, cells: Ints) -> NDArray[np.floating]:
        """Return the factor (k, ...) on areas or lengths at points x (k, ..., 3) of cells (k,): thickness or 2 pi r.

        Raises DataError as `thick` does.
        """
        if self.model.axisymmetric:
            return 2 * np.pi * x[..., 0]
        depth: NDArray[np.floating] = np.empty(x.shape[:-1])
        depth.T[:] = self.thick(cells)
        return depth

    def thick(self, cells: Ints) -> float | NDArray[np.floating]:
        """Return the thickness of all cells, or that (k,) of some, indices in the mesh.

        Raises DataError for edges of no cell, and for those between cells of several thicknesses.
        """
        if isinstance(self.thickness, float):
            return self.thickness
        out = self.thickness[cells]
        unknown = np.asarray(cells)[np.isnan(out)]
        if len(unknown):
            message = f"cells {self.mesh.cell_names(unknown)} lie on no cell of the body, or between two thicknesses"
            raise DataError(f"{message}; name edges of one body", self.mesh.cell_number[unknown])
        return out

    def known(self, own: Ints) -> Ints:
        """Return the nodes (k,) of this process's mesh that are among some, of which each process gives its own."""
        if self.share.own is None:
            return own
        mask = mask_of(self.mesh.n_nodes, own)
        return np.flatnonzero(self.agreed(mask))

    def mask_own(self, nodes: Ints) -> NDArray[np.bool_]:
        """Return a mask (k,) of those of some nodes that this process has as its own."""
        return np.ones(len(nodes), bool) if self.share.own is None else self.share.own[nodes]

    def of_own(self, f: Floats) -> NDArray[np.floating]:
        """Return forces f (n_dof,) with 0 at the nodes of other processes, where they are not complete."""
        return f if self.share.own is None else f * np.repeat(self.share.own, self.dim)

    def own_nodes(self, nodes: Ints) -> Ints:
        """Return those of some nodes that this process has as its own."""
        return nodes if self.share.own is None else nodes[self.share.own[nodes]]

    def near(self, cells: Ints) -> Ints:
        """Return those of some cells (indices in the mesh) that touch an own node of this process, sorted."""
        if self.share.own is None:
            return cells
        near = [chosen[self.share.own[nodes].any(axis=1)] for _, chosen, nodes in self.mesh.select(cells)]
        return np.sort(concatenated(near))

    def own_cells(self, block: Cells) -> NDArray[np.bool_]:
        """Return a mask (k,) of the cells of a block that count for this process in sums over all cells."""
        own = self.share.own
        return np.ones(len(block.nodes), bool) if own is None else own[block.nodes[:, 0]]

    def cells(self, groups: tuple[str, ...] | None = None) -> Ints:
        """Return the sorted indices of the space's cells in some groups of the mesh; all cells if None.

        Raises GroupNotFoundError, and DataError for a group without any cell of the space.
        """
        ours = np.concatenate([block.cell for block in self.blocks])
        if groups is None:
            return np.sort(ours)
        chosen = np.zeros(self.mesh.n_cells, bool)
        for name in groups:
            members = self.mesh.cells_of(name)
            members = members[np.isin(members, ours, assume_unique=True)]
            if not self.share.total(np.array(len(members))):
                raise DataError(f"group {name!r} has no cell of dimension {self.dim}; name a group of the body's cells")
            chosen[members] = True
        return np.flatnonzero(chosen)


def _solid_blocks(mesh: Mesh, model: ModellingHypothesis, share: Share) -> tuple[Cells, ...]:
    """Return the cells of the model's dimension, one block per type; of several processes, those at own nodes.

    All processes have a block for each type of the model, which is empty where no cell touches an own node.
    """
    blocks = []
    for k, (kind, nodes) in enumerate(mesh.blocks):
        if ALL_CELLS[kind].dim != model.dim or not share.total(np.array(len(nodes))):
            continue
        index = np.arange(mesh.offsets[k], mesh.offsets[k + 1])
        if kind not in CELLS:
            message = f"cells {mesh.cell_names(index[:10])} are of type {kind}, of order 3 or more"
            raise DataError(f"{message}; mesh the body with linear or quadratic cells", mesh.cell_number[index])
        if share.own is not None:
            touching = share.own[nodes].any(axis=1)
            nodes, index = nodes[touching], index[touching]
        blocks.append(Cells(kind, fixed(np.ascontiguousarray(nodes, np.int32)), index))
    if not blocks:
        check_dimension(mesh, model.name)
    return tuple(blocks)


def check_dimension(mesh: Mesh, model: str, called: str = "the mesh") -> None:
    """Raise DataError for a mesh, `called` so, without cells of a model's dimension, or with volumes if plane."""
    dim = MODELS[model].dim
    if mesh.dim > dim:
        raise DataError(f'the model {model} is plane, and {called} has volumes; take model = "3d", or a plane mesh')
    if mesh.dim == 2 == mesh.space_dim < dim:
        raise DataError(f'the model {model} needs volumes, and {called} is plane; take model = "plane_strain" or such')
    if mesh.dim < dim:
        raise DataError(
            f"the model {model} needs {'volumes' if dim == 3 else 'surfaces'}: {lacking(mesh, dim, called)}"
        )


def _check_plane(space: Space) -> None:
    """Raise DataError unless a plane model's nodes lie in one plane z = constant, an axisymmetric one's at x >= 0."""
    mesh = space.mesh
    if space.dim == 3 or not space.attached.any():
        return
    x = mesh.points[space.attached]
    extent = np.ptp(x, axis=0)[:2].max()
    if np.ptp(x[:, 2]) > _ROUNDING * extent:
        raise DataError(f"the model {space.model.name} needs a mesh in a plane z = constant; turn it into x, y")
    if space.model.axisymmetric and x[:, 0].min() < -_ROUNDING * extent:
        where = np.flatnonzero(space.attached)[x[:, 0].argmin()]
        message = f"node {mesh.node_number[where]} has radius x = {x[:, 0].min():.6g}"
        raise DataError(f"{message}; an axisymmetric mesh lies at x >= 0, its axis along y")


def _check_volume(space: Space) -> None:
    """Raise DataError unless det J has the same sign, and is not 0, at all integration points of each cell."""
    wrong: list[Ints] = [np.empty(0, np.int64)]
    for block in space.blocks:
        dN = gradient(block.type, cell_rule(block.type, space.model.axisymmetric)[0])
        size = max(1, _PIECE // dN[..., 0].size)
        for start in range(0, len(block.nodes), size):
            det = determinant(block.nodes[start : start + size], space.local.points, dN)
            folded = ~((det > 0).all(axis=1) | (det < 0).all(axis=1))
            wrong.append(block.cell[start + np.flatnonzero(folded)])
    cells = np.concatenate(wrong)
    if len(cells):
        message = f"cells {space.mesh.cell_names(cells)} are folded, or have no volume, at a quadrature point"
        raise DataError(f"{message}; mesh them again, or move their nodes", space.mesh.cell_number[cells])
