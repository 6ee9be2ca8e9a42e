"""Contact in a finite-element code of one's own: scikit-fem's stiffness, lacsolver's B and G. See own_solver.md."""

import sys

import numpy as np
from scipy.sparse import block_array, csr_array
from scipy.sparse.linalg import spsolve
from skfem import Basis, ElementQuad1, ElementTriP1, ElementVector, MeshQuad, MeshTri
from skfem.models.elasticity import lame_parameters, linear_elasticity

import lacmesh
from lacsolver import Case, contact_matrices
from lacsolver.case import Contact, Displacement, Material
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem

YOUNG, POISSON, PRESSED = 1.0, 0.3, 0.1


def stiffness(mesh):
    """(n_dof, n_dof): of both bodies by scikit-fem, a mesh each; unknown 2 i + k is component k of node i, as in B."""
    form = linear_elasticity(*lame_parameters(YOUNG, POISSON))
    kinds = {"TRIA3": (MeshTri, ElementTriP1), "QUAD4": (MeshQuad, ElementQuad1)}
    K = csr_array((2 * mesh.n_nodes, 2 * mesh.n_nodes))
    for name, nodes in mesh.blocks:
        if name in kinds:
            make, element = kinds[name]
            used, local = np.unique(nodes, return_inverse=True)
            body = make(mesh.points[used, :2].T, local.reshape(nodes.shape).T)
            dofs = (2 * used[:, None] + [0, 1]).ravel()
            to_all = csr_array((np.ones(len(dofs)), (dofs, np.arange(len(dofs)))), shape=(K.shape[0], len(dofs)))
            K = K + to_all @ form.assemble(Basis(body, ElementVector(element()))) @ to_all.T
    return csr_array(K)


def prescribed(mesh):
    """Constrained unknowns, and their prescribed displacement (n_dof,), 0 elsewhere."""

    def unknowns(group, k):
        nodes = [block.ravel() for _, _, block in mesh.select(mesh.cells_of(group))]
        return 2 * np.unique(np.concatenate(nodes)) + k

    u = np.zeros(2 * mesh.n_nodes)
    u[unknowns("top", 1)] = -PRESSED
    still = [unknowns("bottom", 0), unknowns("bottom", 1), unknowns("symmetry_x", 0), unknowns("top", 1)]
    return np.unique(np.concatenate(still)), u


def solve(K, B, G, fixed, u0):
    """u (n_dof,), p (m,): K u + B^T p = 0, p >= 0, G - B u >= 0, p (G - B u) = 0, by active sets."""
    free = np.setdiff1d(np.arange(len(u0)), fixed)
    u, active = u0.copy(), G < 0
    for _ in range(50):
        Ba, p = B[active], np.zeros(len(G))
        A = block_array([[K[free][:, free], Ba[:, free].T], [Ba[:, free], None]], format="csc")
        solved = spsolve(A, np.concatenate([-(K @ u0)[free], G[active] - Ba @ u0]))
        u[free], p[active] = solved[: len(free)], solved[len(free) :]
        closed = np.where(active, p > 0, G - B @ u < 0)
        if (closed == active).all():
            return u, p
        active = closed
    raise RuntimeError("the set of closed macro-elements still changes after 50 solves")


def reference(mesh):
    """Displacement u (n_dof,) and pressure p (m,) that lacsolver finds for the same problem."""
    case = Case(
        mesh="disc_on_block.msh",
        model="plane_strain",
        material=[Material(young=YOUNG, poisson=POISSON)],
        contact=[Contact(slave="slave", master="master")],
        displacement=[
            Displacement(group="bottom", ux=0.0, uy=0.0),
            Displacement(group="symmetry_x", ux=0.0),
            Displacement(group="top", uy=-PRESSED),
        ],
    )
    (state,) = march(Problem.of(case, mesh))
    return state.u, state.zones[0].pressure


def draw(name, made, u, p, theirs):
    """The deformed mesh, and both pressures along the slave."""
    import matplotlib.pyplot as plt
    from matplotlib.collections import PolyCollection

    mesh = made.mesh
    x = mesh.points[:, :2] + u.reshape(-1, 2)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    for kind, nodes in mesh.blocks:
        if kind in ("TRIA3", "QUAD4"):
            left.add_collection(PolyCollection(x[nodes], facecolor="#e8eef4", edgecolor="#4477aa", linewidth=0.6))
    left.autoscale_view()
    left.set(aspect="equal", xlabel="x", ylabel="y", title="deformed")
    order = np.argsort(made.centre[:, 0])
    right.plot(made.centre[order, 0], p[order], "o", markersize=11, markerfacecolor="none", label="own solver")
    right.plot(made.centre[order, 0], theirs[order], "x", label="lacsolver")
    right.set(xlabel="x of the macro-element", ylabel="pressure / Young's modulus", title="pressure")
    right.legend()
    figure.savefig(name, dpi=100)


def main(path):
    """Print what the page shows, and draw its picture."""
    made = contact_matrices(lacmesh.read(path), "slave", "master")
    u, p = solve(stiffness(made.mesh), made.B, made.G, *prescribed(made.mesh))
    print(f"{(p > 0).sum()} of {len(p)} macro-elements are closed; the largest pressure is {p.max():.4f}")
    u_ref, p_ref = reference(made.mesh)
    off = np.abs(u - u_ref).max() / np.abs(u_ref).max(), np.abs(p - p_ref).max() / p_ref.max()
    print("the same as lacsolver's, to 1e-9:", max(off) <= 1e-9)
    draw("own_solver.png", made, u, p, p_ref)


if __name__ == "__main__":
    main(sys.argv[1])
