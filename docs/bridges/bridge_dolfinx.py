"""LAC contact for dolfinx: its stiffness of a press fit, and lacsolver's contact. See docs/python.md."""

import sys
from dataclasses import replace

import numpy as np
from mpi4py import MPI  # before dolfinx, whose wheel finds MPI once it is loaded

# isort: split
import basix.ufl
import ufl
from dolfinx import fem
from dolfinx.mesh import create_mesh

import lacsolver as ls

YOUNG, POISSON = 210e3, 0.3


def dolfinx_mesh(mesh):
    """The cut mesh in dolfinx: TETRA4, whose cells and nodes dolfinx puts into an order of its own."""
    lagrange = ufl.Mesh(basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,)))
    return create_mesh(MPI.COMM_SELF, mesh.block("TETRA4"), lagrange, mesh.points)


def stiffness(space):
    """K by dolfinx; unknown 3 i + k is component k of its node i."""
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain, lame = ufl.sym(ufl.grad(u)), YOUNG / (1 + POISSON)
    stress = lame * strain + lame * POISSON / (1 - 2 * POISSON) * ufl.tr(strain) * ufl.Identity(3)
    return fem.assemble_matrix(fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx)).to_scipy()


def supports(mesh, number):
    """Unknowns (k,) held on planes of symmetry and at the ends, each across itself; `number`: dolfinx's nodes."""
    sides = (("symmetry_x", 0), ("symmetry_y", 1), ("ends", 2))
    nodes = [(np.unique(np.concatenate([n.ravel() for *_, n in mesh.select(mesh.cells_of(g))])), k) for g, k in sides]
    return np.unique(np.concatenate([3 * number[i] + k for i, k in nodes]))


def solve(path):
    """The displacements (N, 3) in the order of the cut mesh, and the pressures of the fit."""
    pair = ls.contact_matrices(path, "slave", "master", clearance=-0.02)
    copy = dolfinx_mesh(pair.mesh)
    space = fem.functionspace(copy, ("Lagrange", 1, (3,)))
    number = np.empty(pair.mesh.n_nodes, int)
    number[pair.mesh.block("TETRA4")[copy.topology.original_cell_index]] = space.dofmap.list
    theirs = pair.renumber(nodes=number)
    K = stiffness(space)
    found = ls.solve_contact(K, np.zeros(K.shape[0]), theirs.B, theirs.G, fixed=supports(pair.mesh, number))
    return replace(found, u=found.u.reshape(-1, 3)[number])


if __name__ == "__main__":
    found = solve(sys.argv[1])
    closed, highest = (found.status == 1).sum(), found.pressure.max()
    print(f"{closed} of {len(found.status)} macro-elements are closed; the largest pressure is {highest:.4f}")
