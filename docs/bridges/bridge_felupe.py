"""LAC contact for felupe: its stiffness of a press fit, and lacsolver's contact. See docs/python.md."""

import sys

import felupe
import numpy as np

import lacmesh
import lacsolver as ls

YOUNG, POISSON = 210e3, 0.3


def stiffness(mesh):
    """K (3 n_nodes, 3 n_nodes) by felupe; unknown 3 i + k is component k of node i, as in B."""
    quadratic = len(mesh.block("TETRA10")) > 0
    name, kind = ("TETRA10", "tetra10") if quadratic else ("TETRA4", "tetra")
    region = felupe.RegionQuadraticTetra if quadratic else felupe.RegionTetra
    rule = felupe.TetrahedronQuadrature(order=5 if quadratic else 1)  # that of order 2 has eight digits
    cells = mesh.block(name)
    cells = cells[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]] if quadratic else cells  # two nodes change places
    solid = felupe.Mesh(mesh.points, cells, kind)
    field = felupe.FieldContainer([felupe.Field(region(solid, quadrature=rule), dim=3)])
    return felupe.SolidBody(felupe.LinearElastic(E=YOUNG, nu=POISSON), field).assemble.matrix()


def supports(mesh):
    """Unknowns (k,) held on planes of symmetry and at the ends, each across itself: 3 i + k of node i."""
    sides = (("symmetry_x", 0), ("symmetry_y", 1), ("ends", 2))
    nodes = [(np.unique(np.concatenate([n.ravel() for *_, n in mesh.select(mesh.cells_of(g))])), k) for g, k in sides]
    return np.unique(np.concatenate([3 * i + k for i, k in nodes]))


def solve(path, order=1):
    """The displacements and pressures of the fit, with linear or quadratic tetrahedra."""
    mesh = lacmesh.read(path)
    pair = ls.contact_matrices(lacmesh.raise_order(mesh) if order == 2 else mesh, "slave", "master", clearance=-0.02)
    K = stiffness(pair.mesh)
    return ls.solve_contact(K, np.zeros(K.shape[0]), pair.B, pair.G, fixed=supports(pair.mesh))


if __name__ == "__main__":
    found = solve(sys.argv[1])
    closed, highest = (found.status == 1).sum(), found.pressure.max()
    print(f"{closed} of {len(found.status)} macro-elements are closed; the largest pressure is {highest:.4f}")
