"""The mass matrix M_ab,st = delta_st int rho N_a N_b dV: consistent, or lumped on its diagonal.

The integrals are exact on any cell, distorted or curved: the integrand is a polynomial, and a rule of its degree is
taken (`DEGREE`). Pyramids are integrated in u, v, z of `lacsolver.space.rules`, in which their rational functions are
polynomials.

A lumped mass is that of Hinton, Rock and Zienkiewicz (A note on mass lumping and related processes in the finite
element method, Earthq. Engng Struct. Dyn. 4, 1976): the diagonal of the consistent mass of each cell, scaled to the
mass of the cell. It is positive for every cell. With quadratic cells its eigenfrequencies converge at a low rate only.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array

from lacmesh.errors import DataError
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints, mask_of
from lacsolver.bodies.assembly import scatter, sort_places
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import parts_of, piece, table
from lacsolver.space.space import Space

#: degree of N N det J in each reference coordinate, on TRIA and TETRA in all of them together; then that with r, which
#: has the degree of N, in axisymmetry. Degrees of N and det J are 2 and 2 of TRIA6, 3 and 4 of TRIA7, 2 and 3 of QUAD8
#: and TETRA10, 2 and 5 of quadratic solids
DEGREE = {
    "TRIA3": (2, 3), "TRIA6": (6, 8), "TRIA7": (10, 13), "QUAD4": (3, 4), "QUAD8": (7, 9), "QUAD9": (7, 9),
    "TETRA4": (2, 2), "TETRA10": (7, 7), "HEXA8": (4, 4), "HEXA20": (9, 9), "HEXA27": (9, 9), "PENTA6": (4, 4),
    "PENTA15": (9, 9), "PENTA18": (9, 9), "PYRAM5": (3, 3), "PYRAM13": (9, 9), "PYRAM14": (9, 9),
}  # fmt: skip
#: kinds of mass matrix
KINDS = ("consistent", "lumped")


def assemble_mass(space: Space, materials: Materials, kind: str = "consistent") -> csr_array:
    """Return the mass matrix (n_dof, n_dof), symmetric: `consistent`, on the pattern of K, or `lumped`, diagonal.

    It is that of the whole thickness or circle, as the stiffness is. Nodes of no cell have no mass. Of several
    processes each gets the rows of its own nodes complete. Raises DataError for cells without density, with their
    groups, and ValueError for another kind.

    >>> from lacmesh import Mesh
    >>> from lacsolver.bodies.material import Elastic
    >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> space = Space.of(square, "plane_strain")
    >>> M = assemble_mass(space, Materials.of(space, Elastic(young=1.0, poisson=0.0, density=9.0)))
    >>> M.shape, [float(round(M[0, k], 12)) for k in (0, 2, 4)], float(round(M.sum(), 12))
    ((8, 8), [1.0, 0.5, 0.25], 18.0)
    """
    if kind not in KINDS:
        raise ValueError(f"a mass matrix is {' or '.join(KINDS)}, not {kind!r}")
    check_densities(space, materials)
    return _lumped(space, materials) if kind == "lumped" else _consistent(space, materials)


def check_densities(space: Space, materials: Materials) -> None:
    """Raise DataError if cells have no density; the message names the groups that they make up."""
    light = (block.cell[materials.densities(block=number) == 0.0] for number, block in enumerate(space.blocks))
    lacking = mask_of(space.mesh.n_cells, *light)
    cells, failed = np.flatnonzero(lacking), None
    if len(cells):
        groups = [name for name, held in space.mesh.cell_groups.items() if len(held) and lacking[held].all()]
        who = f"group {', '.join(map(repr, groups))}: " if groups else ""
        message = f"{who}{len(cells)} cells have no density: {space.mesh.cell_names(cells)}"
        failed = DataError(f"{message}; a mass needs the density of their [[material]]", space.mesh.cell_number[cells])
    space.share.agree(failed)


def _consistent(space: Space, materials: Materials) -> csr_array:
    """Return the consistent mass matrix: one of the nodes, the same along every axis."""
    n, (indptr, indices) = space.mesh.n_nodes, space.pattern
    values = np.zeros(len(indices))
    for nodes, M, at, _ in _cells(space, materials):
        add_pairs(nodes, M.take(at, axis=1), indptr, indices, values)
    of_nodes = csr_array((values, indices, indptr), shape=(n, n))
    rows = of_nodes[np.repeat(np.arange(n), space.dim)]
    axis = np.repeat(np.tile(np.arange(space.dim, dtype=rows.indices.dtype), n), np.diff(rows.indptr))
    return csr_array((rows.data, space.dim * rows.indices + axis, rows.indptr), shape=(space.n_dof, space.n_dof))


def _lumped(space: Space, materials: Materials) -> csr_array:
    """Return the mass matrix of Hinton, Rock and Zienkiewicz."""
    out = np.zeros((space.mesh.n_nodes, 1))
    for nodes, M, at, mass in _cells(space, materials):
        diagonal = M.take(at.diagonal(), axis=1)
        share = diagonal * (mass / diagonal.sum(axis=1))[:, None]
        scatter(out, nodes, share[..., None])
    return csr_array(diags_array(np.repeat(out[:, 0], space.dim)).tocsr())


def _cells(space: Space, materials: Materials) -> Iterator[tuple[Ints, Floats, Ints, Floats]]:
    """Yield (nodes (c, n), M, at, mass (c,)), piece by piece: int rho N_a N_b dV is M[:, at[a, b]], computed once."""
    for number, block in enumerate(space.blocks):
        degree = DEGREE[block.type][space.model.axisymmetric]
        pairs, at = _pairs(block.type, space.model.axisymmetric)
        densities = materials.densities(number)
        for cells in parts_of(space, number, np.arange(len(block.nodes)), degree):
            W = piece(space, (number, -1, cells), degree).W * densities[cells, None]
            yield block.nodes[cells], W @ pairs, at, W.sum(axis=1)


@cache
def _pairs(name: str, axisymmetric: bool) -> tuple[Floats, Ints]:
    """Return N_a N_b (q, pairs) at the points of the mass for a <= b, and the column (n, n) of each pair (a, b)."""
    N = table(name, axisymmetric, DEGREE[name][axisymmetric]).N
    a, b = np.triu_indices(N.shape[1])
    at = np.empty((N.shape[1], N.shape[1]), np.int64)
    at[a, b] = at[b, a] = np.arange(len(a))
    return N[:, a] * N[:, b], at


@kernel
def add_pairs(nodes: Any, M: Any, indptr: Any, indices: Any, out: Any) -> None:
    """Add M (c, n, n) of cells of nodes (c, n) to the values `out` of a pattern, in their order."""
    n = nodes.shape[1]
    order = np.empty(n, np.int64)
    for e in range(len(nodes)):
        sort_places(nodes, e, order)
        for a in range(n):
            at = indptr[nodes[e, a]]
            for b in order:
                while indices[at] != nodes[e, b]:
                    at += 1
                out[at] += M[e, a, b]
