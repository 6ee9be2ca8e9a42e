"""Plain twins of the solver's compiled kernels: textbook forms, in numpy and COO."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from lacmesh.reference.shapes import jacobian, shape
from lacsolver.space.rules import cell_rule


def strain_matrices(space, name, nodes):
    """B (c, q, n_stress, d n) as in any textbook, and weights (c, q), thickness or 2 pi r in them."""
    from lacmesh.reference.shapes import gradient

    X, w = cell_rule(name, space.model.axisymmetric)
    x = space.mesh.points[nodes]
    N, dN = shape(name, X), gradient(name, X)
    J = jacobian(name, x, X)[:, :, : space.dim]
    G = np.einsum("qnd,cqds->cqns", dN, np.linalg.inv(J))
    W = np.abs(np.linalg.det(J)) * w
    c, q, n = len(nodes), len(w), nodes.shape[1]
    B = np.zeros((c, q, 6, n, space.dim))
    for k, s in ((0, 0), (1, 1), (3, 0), (3, 1)):
        B[:, :, k, :, s] = G[..., 1 - s if k == 3 else k]
    if space.dim == 3:
        B[:, :, 2, :, 2] = G[..., 2]
        for k, s, i in ((4, 1, 2), (4, 2, 1), (5, 0, 2), (5, 2, 0)):
            B[:, :, k, :, s] = G[..., i]
    elif space.model.axisymmetric:
        r = x[:, :, 0] @ N.T
        B[:, :, 2, :, 0] = N / r[..., None]
        W = W * 2 * np.pi * r
    else:
        W = W * space.thickness
    return B[:, :, : space.model.n_stress].reshape(c, q, space.model.n_stress, n * space.dim), W


def stiffness(space, materials, mean=False):
    """K (n_dof, n_dof), csr: B^T C B by einsum, through COO; `mean`: with the mean of the divergence over the cell."""
    rows, columns, values = [], [], []
    for (name, nodes, _), law in zip(space.blocks, materials.law, strict=True):
        B, W = strain_matrices(space, name, nodes)
        if mean:
            div = B[:, :, :3].sum(axis=2)
            change = np.einsum("cq,cqi->ci", W, div)[:, None] / W.sum(axis=1)[:, None, None] - div
            B = B + np.isin(np.arange(B.shape[2]), (0, 1, 2))[:, None] * change[:, :, None] / 3
        C = np.stack([constitutive(materials.laws[k], space.model) for k in range(len(materials.laws))])[law]
        K = np.einsum("cqki,ckm,cqmj,cq->cij", B, C, B, W, optimize=True)
        dofs = space.dofs(nodes.ravel()).reshape(len(nodes), -1)
        rows.append(np.broadcast_to(dofs[:, :, None], K.shape).ravel())
        columns.append(np.broadcast_to(dofs[:, None], K.shape).ravel())
        values.append(K.ravel())
    made = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.coo_array(made, shape=(space.n_dof, space.n_dof)).tocsr()


def constitutive(law, model):
    """C in the model's components, from the compliance: zz of plane stress is left out before it is inverted."""
    C = law.elasticity()
    if model.dim == 3:
        return C
    if not model.plane_stress:
        return C[:4, :4]
    out = np.zeros((4, 4))
    keep = [0, 1, 3]
    out[np.ix_(keep, keep)] = np.linalg.inv(np.linalg.inv(C)[np.ix_(keep, keep)])
    return out


def strain(space, u):
    """(c, q, n_stress) for each block, from B."""
    out = []
    for name, nodes, _ in space.blocks:
        B, _ = strain_matrices(space, name, nodes)
        out.append(np.einsum("cqki,ci->cqk", B, u[space.dofs(nodes.ravel())].reshape(len(nodes), -1)))
    return out


def pattern(cells, n_nodes):
    """indptr, indices of the nodes that share a cell, from the product of incidence matrices."""
    rows = np.concatenate([np.repeat(np.arange(len(c)), c.shape[1]) for c in cells])
    start = np.repeat(np.cumsum([0, *(len(c) for c in cells[:-1])]), [c.size for c in cells])
    nodes = np.concatenate([c.ravel() for c in cells])
    shared = sp.coo_array((np.ones(len(nodes)), (rows + start, nodes)), shape=(sum(map(len, cells)), n_nodes)).tocsr()
    made = (shared.T @ shared).tocsr()
    made.sort_indices()
    return made.indptr, made.indices
