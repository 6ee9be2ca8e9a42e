"""LAC contact for sfepy: its stiffness of a press fit, and lacsolver's contact. See docs/python.md."""

import sys

import numpy as np
import sfepy.discrete as sfepy
from scipy.sparse import csr_array
from sfepy.discrete.fem import FEDomain, Field, Mesh
from sfepy.mechanics.matcoefs import stiffness_from_youngpoisson
from sfepy.terms import Term

import lacsolver as ls

YOUNG, POISSON = 210e3, 0.3


def stiffness(mesh):
    """K (3 n_nodes, 3 n_nodes) by sfepy; unknown 3 i + k is component k of node i, as in B."""
    cells = mesh.block("TETRA4")
    arrays = mesh.points, np.zeros(mesh.n_nodes, np.int32), [cells.astype(np.int32)], [np.zeros(len(cells), np.int32)]
    domain = FEDomain("bodies", Mesh.from_data("bodies", *arrays, ["3_4"]))
    omega = domain.create_region("Omega", "all")
    field = Field.from_args("displacement", np.float64, "vector", omega, approx_order=1)
    u, v = sfepy.FieldVariable("u", "unknown", field), sfepy.FieldVariable("v", "test", field, primary_var_name="u")
    law = sfepy.Material("law", D=stiffness_from_youngpoisson(3, YOUNG, POISSON))
    term = Term.new("dw_lin_elastic(law.D, v, u)", sfepy.Integral("i", order=1), omega, law=law, v=v, u=u)
    equations = sfepy.Equations([sfepy.Equation("balance", term)])
    problem = sfepy.Problem("press_fit", equations=equations)
    problem.time_update()
    problem.update_materials()
    return csr_array(equations.evaluate(mode="weak", dw_mode="matrix", asm_obj=problem.mtx_a))


def supports(mesh):
    """Unknowns (k,) held on planes of symmetry and at the ends, each across itself: 3 i + k of node i."""
    sides = (("symmetry_x", 0), ("symmetry_y", 1), ("ends", 2))
    nodes = [(np.unique(np.concatenate([n.ravel() for *_, n in mesh.select(mesh.cells_of(g))])), k) for g, k in sides]
    return np.unique(np.concatenate([3 * i + k for i, k in nodes]))


def solve(path):
    """The displacements and pressures of the fit."""
    pair = ls.contact_matrices(path, "slave", "master", clearance=-0.02)
    K = stiffness(pair.mesh)
    return ls.solve_contact(K, np.zeros(K.shape[0]), pair.B, pair.G, fixed=supports(pair.mesh))


if __name__ == "__main__":
    found = solve(sys.argv[1])
    closed, highest = (found.status == 1).sum(), found.pressure.max()
    print(f"{closed} of {len(found.status)} macro-elements are closed; the largest pressure is {highest:.4f}")
