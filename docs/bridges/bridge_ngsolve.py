"""LAC contact for NGSolve: its stiffness of a press fit, and lacsolver's contact. See docs/python.md."""

import sys

import netgen.meshing as netgen
import ngsolve
import numpy as np
from scipy.sparse import csr_array

import lacsolver as ls

YOUNG, POISSON = 210e3, 0.3


def netgen_mesh(mesh):
    """The cut mesh in NGSolve: the same nodes in the same order, TETRA4."""
    copy = netgen.Mesh(dim=3)
    numbers = [copy.Add(netgen.MeshPoint(netgen.Pnt(*x))) for x in mesh.points.tolist()]
    for cell in mesh.block("TETRA4").tolist():
        copy.Add(netgen.Element3D(1, [numbers[i] for i in cell]))
    return ngsolve.Mesh(copy)


def stiffness(mesh):
    """K by NGSolve; unknown i + k N is component k of node i: all ux come first."""
    space = ngsolve.VectorH1(netgen_mesh(mesh), order=1)
    u, v = space.TnT()
    strain, lame = ngsolve.Sym(ngsolve.Grad(u)), YOUNG / (1 + POISSON)
    stress = lame * strain + lame * POISSON / (1 - 2 * POISSON) * ngsolve.Trace(strain) * ngsolve.Id(3)
    form = ngsolve.BilinearForm(ngsolve.InnerProduct(stress, ngsolve.Sym(ngsolve.Grad(v))) * ngsolve.dx).Assemble()
    rows, columns, values = form.mat.COO()
    return csr_array((np.array(values), (np.array(rows), np.array(columns))), shape=(space.ndof, space.ndof))


def supports(mesh):
    """Unknowns (k,) held on planes of symmetry and at the ends, each across itself: i + k N of node i."""
    sides = (("symmetry_x", 0), ("symmetry_y", 1), ("ends", 2))
    nodes = [(np.unique(np.concatenate([n.ravel() for *_, n in mesh.select(mesh.cells_of(g))])), k) for g, k in sides]
    return np.unique(np.concatenate([i + k * mesh.n_nodes for i, k in nodes]))


def solve(path):
    """The displacements, all ux first, and the pressures of the fit."""
    pair = ls.contact_matrices(path, "slave", "master", clearance=-0.02)
    theirs = pair.renumber("components")
    K = stiffness(pair.mesh)
    return ls.solve_contact(K, np.zeros(K.shape[0]), theirs.B, theirs.G, fixed=supports(pair.mesh))


if __name__ == "__main__":
    found = solve(sys.argv[1])
    closed, highest = (found.status == 1).sum(), found.pressure.max()
    print(f"{closed} of {len(found.status)} macro-elements are closed; the largest pressure is {highest:.4f}")
