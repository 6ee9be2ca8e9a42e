"""Plain twins of the solver's compiled kernels: textbook forms, in numpy and COO."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq

from lacmesh.reference.shapes import gradient, jacobian, shape
from lacsolver.bodies.hyperelastic import NeoHookean
from lacsolver.space.rules import cell_rule

I = np.eye(3)  # noqa: E741
#: pairs of indices of the components of a strain or a stress
PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]


def points(space, name, nodes):
    """(c, q, n, dim) gradients, (c, q, n) N / r or 0, (c, q) weights."""
    X, w = cell_rule(name, space.model.axisymmetric)
    x = space.mesh.points[nodes]
    N, dN = shape(name, X), gradient(name, X)
    J = jacobian(name, x, X)[:, :, : space.dim]
    G = np.einsum("qnd,cqds->cqns", dN, np.linalg.inv(J))
    W = np.abs(np.linalg.det(J)) * w
    hoop = np.zeros(G.shape[:3])
    if space.model.axisymmetric:
        r = x[:, :, 0] @ N.T
        hoop, W = N / r[..., None], W * 2 * np.pi * r
    return G, hoop, W * space.thickness


def variations(space, name, nodes):
    """D (c, q, 3, 3, n, dim): dF_si/du_at, and weights."""
    G, hoop, W = points(space, name, nodes)
    D = np.zeros((*G.shape[:2], 3, 3, G.shape[2], space.dim))
    for s in range(space.dim):
        for i in range(space.dim):
            D[:, :, s, i, :, s] = G[..., i]
    D[:, :, 2, 2, :, 0] += hoop
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


def pattern(cells, n_nodes):
    """indptr, indices of the nodes that share a cell, from the product of incidence matrices."""
    rows = np.concatenate([np.repeat(np.arange(len(c)), c.shape[1]) for c in cells])
    start = np.repeat(np.cumsum([0, *(len(c) for c in cells[:-1])]), [c.size for c in cells])
    nodes = np.concatenate([c.ravel() for c in cells])
    shared = sp.coo_array((np.ones(len(nodes)), (rows + start, nodes)), shape=(sum(map(len, cells)), n_nodes)).tocsr()
    made = (shared.T @ shared).tocsr()
    made.sort_indices()
    return made.indptr, made.indices


# ---- finite strains: second Piola stress and its tangent


def second_piola(law, F):
    """S (..., 3, 3)."""
    lam, mu = law.lame
    C = np.einsum("...ki,...kj->...ij", F, F)
    if isinstance(law, NeoHookean):
        inv = np.linalg.inv(C)
        return mu * (I - inv) + lam * np.log(np.linalg.det(F))[..., None, None] * inv
    E = (C - I) / 2
    return lam * np.trace(E, axis1=-2, axis2=-1)[..., None, None] * I + 2 * mu * E


def material_tangent(law, F):
    """2 dS/dC (..., 3, 3, 3, 3)."""
    lam, mu = law.lame
    if isinstance(law, NeoHookean):
        inv = np.linalg.inv(np.einsum("...ki,...kj->...ij", F, F))
        m = (mu - lam * np.log(np.linalg.det(F)))[..., None, None, None, None]
        pairs = np.einsum("...ik,...jl->...ijkl", inv, inv) + np.einsum("...il,...jk->...ijkl", inv, inv)
        return lam * np.einsum("...ij,...kl->...ijkl", inv, inv) + m * pairs
    pairs = np.einsum("ik,jl->ijkl", I, I) + np.einsum("il,jk->ijkl", I, I)
    return np.broadcast_to(lam * np.einsum("ij,kl->ijkl", I, I) + mu * pairs, (*F.shape[:-2], 3, 3, 3, 3))


def stress_and_tangent(law, F, plane_stress):
    """P (..., 3, 3) and A (..., 3, 3, 3, 3), with F_22 found and eliminated in plane stress; F as completed."""
    if plane_stress:
        F = F.copy()
        for place in np.ndindex(F.shape[:-2]):
            F[place][2, 2] = across(law, F[place])
    S, C = second_piola(law, F), material_tangent(law, F)
    A = np.einsum("...sk,...kilj,...tl->...sitj", F, C, F) + np.einsum("...ij,st->...sitj", S, I)
    if plane_stress:
        out = A[..., :, :, 2, 2]
        A = A - np.einsum("...si,...tj->...sitj", out, out) / A[..., 2, 2, 2, 2][..., None, None, None, None]
    return F @ S, A, F


def across(law, F):
    def off(z):
        there = F.copy()
        there[2, 2] = z
        return second_piola(law, there)[2, 2]

    return brentq(off, 0.2, 5.0, xtol=1e-15, rtol=1e-15)


def fields(space, materials, u, theta=1.0):
    """(D, W, P, A, F) of each block, a law at a time; `theta`: the thermal stretch."""
    for (name, nodes, _), which in zip(space.blocks, materials.law, strict=True):
        D, W = variations(space, name, nodes)
        F = I + np.einsum("cqsiat,cat->cqsi", D, u.reshape(-1, space.dim)[nodes])
        P, A = np.zeros_like(F), np.zeros((*F.shape, 3, 3))
        for k, law in enumerate(materials.laws):
            rows = which == k
            P[rows], A[rows], there = stress_and_tangent(law, F[rows] / theta, space.model.plane_stress)
            F[rows] = there * theta
        yield D, W, P * theta**2, A * theta, F


def force_and_tangent(space, materials, u, theta=1.0):
    """f (n_dof,), and K as csr."""
    f, parts = np.zeros(space.n_dof), []
    for block, (D, W, P, A, _) in zip(space.blocks, fields(space, materials, u, theta), strict=True):
        dofs = space.dofs(block.nodes.ravel()).reshape(len(block.nodes), -1)
        D = D.reshape(*D.shape[:4], -1)
        np.add.at(f, dofs, np.einsum("cqsia,cqsi,cq->ca", D, P, W))
        parts.append((block.nodes, np.einsum("cqsia,cqsitj,cqtjb,cq->cab", D, A, D, W, optimize=True)))
    return f, assembled(space, parts)


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
        P = there @ second_piola(law, there)
        moved = D + np.einsum("cqsi,cqa->cqsia", F, of_mean[:, None] - change) / 3
        dofs = space.dofs(nodes.ravel()).reshape(len(nodes), -1)
        np.add.at(f, dofs, np.einsum("cqsi,cqsia,cq->ca", P, moved, W * factor))
        w = mu / 2 * ((there**2).sum(axis=(2, 3)) - 3) - mu * j + lam / 2 * j**2
        energy += (W * w).sum()
    return f, energy
