"""Plain twins of the solver's compiled kernels: textbook forms, in numpy and COO."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from lacmesh.reference.shapes import gradient, jacobian, shape
from lacsolver.space.rules import cell_rule

I = np.eye(3)  # noqa: E741
#: pairs of indices of the components of a strain or a stress
PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]


def variations(space, name, nodes):
    """D (c, q, 3, 3, n, dim): dF_si/du_at, and weights (c, q), thickness or 2 pi r in them."""
    X, w = cell_rule(name, space.model.axisymmetric)
    x = space.mesh.points[nodes]
    N, dN = shape(name, X), gradient(name, X)
    J = jacobian(name, x, X)[:, :, : space.dim]
    G = np.einsum("qnd,cqds->cqns", dN, np.linalg.inv(J))
    W = np.abs(np.linalg.det(J)) * w * space.thickness
    D = np.zeros((*G.shape[:2], 3, 3, G.shape[2], space.dim))
    for s in range(space.dim):
        for i in range(space.dim):
            D[:, :, s, i, :, s] = G[..., i]
    if space.model.axisymmetric:
        r = x[:, :, 0] @ N.T
        D[:, :, 2, 2, :, 0] += N / r[..., None]
        W = W * 2 * np.pi * r
    return D, W


def strain_matrices(space, name, nodes):
    """B (c, q, n_stress, d n) as in any textbook, and weights (c, q), thickness or 2 pi r in them."""
    D, W = variations(space, name, nodes)
    B = [D[:, :, s, t] + (s != t) * D[:, :, t, s] for s, t in PAIRS[: space.model.n_stress]]
    return np.stack(B, axis=2).reshape(*W.shape, space.model.n_stress, -1), W


def assembled(space, parts):
    """K (n_dof, n_dof), csr, from (nodes, K of each cell) of each block, through COO."""
    rows, columns, values = [], [], []
    for nodes, K in parts:
        dofs = space.dofs(nodes.ravel()).reshape(len(nodes), -1)
        rows.append(np.broadcast_to(dofs[:, :, None], K.shape).ravel())
        columns.append(np.broadcast_to(dofs[:, None], K.shape).ravel())
        values.append(K.ravel())
    made = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.coo_array(made, shape=(space.n_dof, space.n_dof)).tocsr()


def stiffness(space, materials, mean=False):
    """K (n_dof, n_dof), csr: B^T C B by einsum; `mean`: with the mean of the divergence over the cell."""
    parts = []
    for (name, nodes, _), law in zip(space.blocks, materials.law, strict=True):
        B, W = strain_matrices(space, name, nodes)
        if mean:
            div = B[:, :, :3].sum(axis=2)
            change = np.einsum("cq,cqi->ci", W, div)[:, None] / W.sum(axis=1)[:, None, None] - div
            B = B + np.isin(np.arange(B.shape[2]), (0, 1, 2))[:, None] * change[:, :, None] / 3
        C = np.stack([constitutive(one, space.model) for one in materials.laws])[law]
        parts.append((nodes, np.einsum("cqki,ckm,cqmj,cq->cij", B, C, B, W, optimize=True)))
    return assembled(space, parts)


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


def mean_force(space, materials, u, theta=1.0):
    """f (n_dof,) and the energy of a neo-Hookean law, F (e^j / J)^(1/3) for F in every cell."""
    f, energy = np.zeros(space.n_dof), 0.0
    (law,) = materials.laws
    lam, mu = law.lame
    for name, nodes, _ in space.blocks:
        D, W = variations(space, name, nodes)
        D, W = D.reshape(*D.shape[:4], -1) / theta, W * theta**3
        v = u.reshape(-1, space.dim)[nodes].reshape(len(nodes), -1)
        F = I / theta + np.einsum("cqsia,ca->cqsi", D, v)
        J, inv = np.linalg.det(F), np.linalg.inv(F)
        j = np.log((W * J).sum(axis=1) / W.sum(axis=1))[:, None]
        change = np.einsum("cqis,cqsia->cqa", inv, D)  # of ln J
        of_mean = np.einsum("cq,cqa->ca", W * J, change) / (W * J).sum(axis=1)[:, None]
        factor = (np.exp(j) / J) ** (1 / 3)
        there = F * factor[..., None, None]
        C = np.linalg.inv(np.einsum("...ki,...kj->...ij", there, there))
        ln_J = np.log(np.linalg.det(there))[..., None, None]
        P = there @ (mu * (I - C) + lam * ln_J * C)  # second Piola-Kirchhoff stress
        moved = D + np.einsum("cqsi,cqa->cqsia", F, of_mean[:, None] - change) / 3
        dofs = space.dofs(nodes.ravel()).reshape(len(nodes), -1)
        np.add.at(f, dofs, np.einsum("cqsi,cqsia,cq->ca", P, moved, W * factor))
        w = mu / 2 * ((there**2).sum(axis=(2, 3)) - 3) - mu * j + lam / 2 * j**2
        energy += (W * w).sum()
    return f, energy
