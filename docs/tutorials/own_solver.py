"""Contact in a finite-element code of your own: scikit-fem's stiffness, lacsolver's contact. See own_mesh.md."""

import sys

import numpy as np
from scipy.sparse import csr_array
from skfem import Basis, ElementQuad1, ElementTriP1, ElementVector, MeshQuad, MeshTri
from skfem.models.elasticity import lame_parameters, linear_elasticity

import lacsolver as ls

YOUNG, POISSON, PRESSED = 1.0, 0.3, 0.1


def stiffness(mesh):
    """(n_dof, n_dof): of both bodies by scikit-fem, a mesh each; unknown 2 i + k is component k of node i, as in B."""
    form = linear_elasticity(*lame_parameters(YOUNG, POISSON))
    K = csr_array((2 * mesh.n_nodes, 2 * mesh.n_nodes))
    for kind, make, element in (("TRIA3", MeshTri, ElementTriP1), ("QUAD4", MeshQuad, ElementQuad1)):
        used, local = np.unique(mesh.block(kind), return_inverse=True)
        body = make(mesh.points[used, :2].T, local.reshape(mesh.block(kind).shape).T)
        dofs = (2 * used[:, None] + [0, 1]).ravel()
        to_all = csr_array((np.ones(len(dofs)), (dofs, np.arange(len(dofs)))), shape=(K.shape[0], len(dofs)))
        K = K + to_all @ form.assemble(Basis(body, ElementVector(element()))) @ to_all.T
    return csr_array(K)


def supports(mesh):
    """Constrained unknowns, and their prescribed displacement (n_dof,), 0 elsewhere."""
    u0, fixed = np.zeros(2 * mesh.n_nodes), []
    for group, k, value in (("bottom", 0, 0), ("bottom", 1, 0), ("symmetry_x", 0, 0), ("top", 1, -PRESSED)):
        for _, _, nodes in mesh.select(mesh.cells_of(group)):
            fixed.append(2 * np.unique(nodes) + k)
            u0[fixed[-1]] = value
    return np.unique(np.concatenate(fixed)), u0


def solve(path):
    """The contact matrices of the mesh, and the displacements and pressures."""
    pair = ls.contact_matrices(path, "slave", "master")
    fixed, u0 = supports(pair.mesh)
    loads = np.zeros(len(u0))
    return pair, ls.solve_contact(stiffness(pair.mesh), loads, pair.B, pair.G, fixed=fixed, u0=u0)


def main(path):
    """Print the output that the page shows."""
    _, found = solve(path)
    closed, highest = (found.status == 1).sum(), found.pressure.max()
    print(f"{closed} of {len(found.status)} macro-elements are closed; the largest pressure is {highest:.4f}")


if __name__ == "__main__":
    main(sys.argv[1])
