"""The inf-sup constant of contact pressures and displacements on a mesh, numerically.

    beta = min over p of max over v of  sum_m p_m B_m v / (||v|| |p|)

with ||v|| the full norm of H1, int v.v + grad v : grad v, over displacements v that are zero at some nodes, and
|p|^2 = sum_m h_m |T_m| p_m^2, L2 weighted by the size h_m of the macro-element T_m, its area (length in a plane) to
the power 1 / (d - 1): the discrete stand-in for the dual norm of H^1/2 (Pitkaranta, Math. Comput. 35, 1980, 1113). With
A the matrix of the norm and D that of the weight, beta^2 is the least eigenvalue of B A^-1 B^T p = beta^2 D p.

A is scalar, the same for each component of v; it is assembled here by quadrature.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from lacmesh import Mesh
from lacsolver import ContactMatrices
from verification.measures.norms import points_of

Floats = NDArray[np.floating]
#: of the rule for the norm: exact for the products of quadratic functions on cells with straight edges
_DEGREE = 4


def constant(matrices: ContactMatrices, moving: NDArray[np.bool_]) -> float:
    """beta of contact matrices, over displacements of the nodes that are `moving` (n_nodes,), the others fixed.

    A constant of zero is computed as some 1e-8, the square root of rounding.
    """
    dim = matrices.normal.shape[1]
    nodes = np.flatnonzero(moving & in_body(matrices.mesh))
    if not len(nodes):
        return 0.0
    N = norm(matrices.mesh)[nodes][:, nodes]
    solve = splu(N, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve
    S = np.zeros((len(matrices.area),) * 2)
    for axis in range(dim):
        B = matrices.B[:, dim * nodes + axis]
        if B.nnz and np.abs(B.data).max() > 1e-14 * matrices.area.max():
            S += B @ solve(B.toarray().T)
    weight = matrices.area ** (-0.5 * dim / (dim - 1))  # (h_m |T_m|)^-1/2
    least = np.linalg.eigvalsh(weight[:, None] * S * weight)[0]
    return float(np.sqrt(max(least, 0.0)))


def in_body(mesh: Mesh) -> NDArray[np.bool_]:
    """Mask (n_nodes,) of the nodes that belong to a cell of the body."""
    return np.isin(np.arange(mesh.n_nodes), mesh.nodes_on(_body(mesh)))


def norm(mesh: Mesh) -> csc_array:
    """Matrix A (n_nodes, n_nodes) of the H1 norm of a scalar field v: v^T A v = ||v||^2."""
    entries, rows, columns = [], [], []
    for at in points_of(mesh, _body(mesh), degree=_DEGREE):
        dN = at.dN @ np.linalg.inv(at.J[..., : at.J.shape[-1], :])
        value = np.einsum("kp,kpaj,kpbj->kab", at.w, dN, dN, optimize=True)
        value += np.einsum("kp,pa,pb->kab", at.w, at.N, at.N, optimize=True)
        entries.append(value.ravel())
        rows.append(np.broadcast_to(at.nodes[:, :, None], value.shape).ravel())
        columns.append(np.broadcast_to(at.nodes[:, None, :], value.shape).ravel())
    parts = np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))
    return csc_array(coo_array(parts, shape=(mesh.n_nodes, mesh.n_nodes)))


def _body(mesh: Mesh) -> NDArray[np.integer]:
    return np.flatnonzero(mesh.cell_dim == mesh.space_dim)
