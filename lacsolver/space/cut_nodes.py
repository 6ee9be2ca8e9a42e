"""Nodes that a cut has made, found by its records, also in a mesh that was cut before and read from a file."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.facets import boundary_faces

Bools = NDArray[np.bool_]


def made_by_cut(mesh: Mesh) -> Bools:
    """Return the mask (n_nodes,) of the nodes that the cut made: those inside the children of one cell or slave face.

    >>> from lacmesh import cut_skin, read
    >>> mesh = cut_skin(read("data/two_blocks.msh"), "slave", hexa="hexa").mesh
    >>> int(made_by_cut(mesh).sum()), mesh.n_nodes - read("data/two_blocks.msh").n_nodes
    (288, 288)
    """
    return inside_children(mesh, mesh.dim) | inside_children(mesh, mesh.dim - 1)


def inside_children(mesh: Mesh, dim: int) -> Bools:
    """Return the mask (n_nodes,) of the nodes inside the children of one cell of a dimension, off their boundary.

    Of a cut that was recognised, and has no parents, the children are the faces of a macro-element.
    """
    out = np.zeros(mesh.n_nodes, bool)
    parent = mesh.cell_data.get("lac_parent", _several(mesh))
    chosen = np.flatnonzero((parent >= 0) & (mesh.cell_dim == dim))
    parts = [(kind, nodes + mesh.n_nodes * parent[cells].astype(np.int64)[:, None])
             for kind, cells, nodes in mesh.select(chosen)]  # fmt: skip
    if not parts:
        return out
    unique, place = np.unique(np.concatenate([keys.ravel() for _, keys in parts]), return_inverse=True)
    ends = np.cumsum([keys.size for _, keys in parts])[:-1]
    blocks = [(kind, own.reshape(keys.shape)) for (kind, keys), own in zip(parts, np.split(place, ends), strict=True)]
    inside = np.ones(len(unique), bool)
    inside[_boundary(Mesh.create(mesh.points[unique % mesh.n_nodes], blocks), dim)] = False
    out[unique[inside] % mesh.n_nodes] = True
    return out


def _several(mesh: Mesh) -> Ints:
    """Return the macro-element (n_cells,) of each slave face, -1 for one that is a macro-element alone."""
    macro = mesh.cell_data.get("lac_macro")
    if macro is None:
        return np.full(mesh.n_cells, -1)
    return np.where((macro >= 0) & (np.bincount(macro + 1)[macro + 1] > 1), macro, -1)


def _boundary(mesh: Mesh, dim: int) -> Ints:
    """Return the nodes (k,) on the boundary of a mesh of cells of one dimension."""
    if dim == 1:
        return np.flatnonzero(np.bincount(np.concatenate([block.nodes[:, :2].ravel() for block in mesh.blocks])) == 1)
    faces = boundary_faces(mesh)[0].nodes
    return faces[faces >= 0]
