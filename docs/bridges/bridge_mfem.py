"""LAC contact for MFEM: its stiffness of a press fit, and lacsolver's contact. See docs/python.md."""

import sys

import mfem.ser as mfem
import numpy as np
from scipy.sparse import csr_array

import lacsolver as ls

YOUNG, POISSON = 210e3, 0.3


def mfem_mesh(mesh):
    """The cut mesh in MFEM: TETRA4, whose nodes MFEM puts into an order of its own within each cell."""
    copy = mfem.Mesh(3, mesh.n_nodes, len(mesh.block("TETRA4")), 0, 3)
    for x in mesh.points.tolist():
        copy.AddVertex(*x)
    for cell in mesh.block("TETRA4").tolist():
        copy.AddTet(*cell)
    copy.FinalizeTetMesh(1, 0, True)
    return copy


def stiffness(copy):
    """K by MFEM; unknown i + k N is component k of node i: all ux come first."""
    space = mfem.FiniteElementSpace(copy, mfem.H1_FECollection(1, 3), 3, mfem.Ordering.byNODES)
    shear, first = YOUNG / 2 / (1 + POISSON), YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)
    form = mfem.BilinearForm(space)
    lame = [mfem.ConstantCoefficient(c) for c in (first, shear)]
    form.AddDomainIntegrator(mfem.ElasticityIntegrator(*lame))
    form.Assemble()
    form.Finalize()
    K = form.SpMat()
    arrays = (K.GetDataArray(), K.GetJArray(), K.GetIArray())
    return csr_array(tuple(map(np.array, arrays)), shape=(K.Height(), K.Width()))


def supports(mesh):
    """Unknowns (k,) held on planes of symmetry and at the ends, each across itself: i + k N of node i."""
    sides = (("symmetry_x", 0), ("symmetry_y", 1), ("ends", 2))
    nodes = [(np.unique(np.concatenate([n.ravel() for *_, n in mesh.select(mesh.cells_of(g))])), k) for g, k in sides]
    return np.unique(np.concatenate([i + k * mesh.n_nodes for i, k in nodes]))


def solve(path):
    """The displacements, all ux first, and the pressures of the fit."""
    pair = ls.contact_matrices(path, "slave", "master", clearance=-0.02)
    copy = mfem_mesh(pair.mesh)
    cells = np.array([copy.GetElementVertices(k) for k in range(copy.GetNE())])
    points = np.array([copy.GetVertexArray(i) for i in range(copy.GetNV())])
    theirs = pair.renumber("components", nodes={"TETRA4": cells}, points=points)
    K = stiffness(copy)
    return ls.solve_contact(K, np.zeros(K.shape[0]), theirs.B, theirs.G, fixed=supports(pair.mesh))


if __name__ == "__main__":
    found = solve(sys.argv[1])
    closed, highest = (found.status == 1).sum(), found.pressure.max()
    print(f"{closed} of {len(found.status)} macro-elements are closed; the largest pressure is {highest:.4f}")
