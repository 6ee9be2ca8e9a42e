"""The peers' problem for NGSolve, run by a Python that has it: python -m benchmarks.peers.ngsolve N ANSWER.npz.

A contact energy, 10 E / h times half the square of the overlap (penalty), order 30 on the skin, by Newton's method.
"""

from __future__ import annotations

import ngsolve as ngs
import numpy as np
from netgen.meshing import Element1D, Element2D, Mesh, MeshPoint, Pnt

from benchmarks.peers.problems import FORCE, RADIUS, answer, lame

#: penalty over E / h, order of the integration on the skin
PENALTY, ORDER = 10.0, 30
#: force out of balance at which the search ends, of the load; the most iterations
TOLERANCE, LIMIT = 1e-8, 100


def mesh_of(pair):
    """The two bodies in NGSolve's mesh, bodies and sides by their names."""
    made = Mesh(dim=2)
    for name, body in pair.bodies.items():
        number = np.array([made.Add(MeshPoint(Pnt(x, y, 0))) for x, y in body.points], dtype=object)
        inside = made.AddRegion(name, dim=2)
        for cell in body.cells:
            made.Add(Element2D(inside, list(number[cell])))
        for side, faces in body.sides.items():
            label = made.AddRegion(f"{name}_{side}", dim=1)
            for nodes in number[faces]:
                made.Add(Element1D(list(nodes), index=label))
    return ngs.Mesh(made)


def forms(pair, mesh, space):
    """The energy of the bodies, the same with the contact to come, and the contact, whose pairs are not found yet."""
    first, second = (mesh.MaterialCF({name: lame(b.young)[k] for name, b in pair.bodies.items()}) for k in (0, 1))
    u, energies = space.TrialFunction(), []
    for _ in range(2):
        strain = (ngs.Grad(u) + ngs.Grad(u).trans) / 2
        stress = first * ngs.Trace(strain) * ngs.Id(2) + 2 * second * strain
        energies.append(ngs.BilinearForm(space, symmetric=True))
        energies[-1] += ngs.Variation(0.5 * ngs.InnerProduct(stress, ngs.Grad(u)) * ngs.dx)
    (slave,), (master,) = pair.named("slave"), pair.named("master")
    contact = ngs.ContactBoundary(mesh.Boundaries(f"{slave}_slave"), mesh.Boundaries(f"{master}_master"))
    X = ngs.CoefficientFunction((ngs.x, ngs.y))
    overlap = (X + u - X.Other() - u.Other()) * ngs.specialcf.normal(2)
    contact.AddEnergy(ngs.IfPos(overlap, 0.5 * stiffness(pair) * overlap * overlap, 0))
    return *energies, contact


def stiffness(pair):
    """Pressure of an overlap of one unit of length."""
    return PENALTY * min(body.young for body in pair.bodies.values()) / pair.h


def solve(pair):
    """Solve a pair and return its results by name."""
    mesh, fixed = mesh_of(pair), [[], []]
    for side, axis in (*pair.supports, ("top", 1)):
        fixed[axis] += [f"{name}_{side}" for name in pair.named(side)]
    space = ngs.VectorH1(mesh, order=1, dirichletx="|".join(fixed[0]), dirichlety="|".join(fixed[1]))
    elastic, a, contact = forms(pair, mesh, space)
    gf, r = ngs.GridFunction(space), ngs.GridFunction(space).vec
    gf.components[1].Set(pair.push, definedon=mesh.Boundaries("upper_top"))
    free = space.FreeDofs()
    keep = np.array(list(free))
    for count in range(LIMIT + 1):
        contact.Update(gf, a, intorder=ORDER, maxdist=2 * pair.h)
        a.Apply(gf.vec, r)
        if count and np.abs(r.FV().NumPy()[keep]).max() < TOLERANCE * FORCE:
            break
        a.AssembleLinearization(gf.vec)
        gf.vec.data -= a.mat.Inverse(free, inverse="sparsecholesky") * r
    else:
        raise RuntimeError(f"no equilibrium found in {LIMIT} iterations")
    elastic.Apply(gf.vec, r)
    u, force = (v.FV().NumPy().reshape(2, -1).T for v in (gf.vec, r))
    n = len(pair.lower.points)
    out = {"iterations": count, "force": 2 * abs(force[np.unique(pair.upper.sides["slave"]) + n, 1].sum())}
    return out | {"faces": pressures(pair, u[:n], u[n:])}


def pressures(pair, lower, upper):
    """(2, faces): x of the middle, mean pressure of the slave's faces: penalty times the overlap after displacements.

    The mean of what the method integrates; at nodes alone it waves (measured: ten to forty times the error).
    """
    faces, master = pair.upper.sides["slave"], np.unique(pair.lower.sides["master"])
    s = (np.arange(30) + 0.5) / 30
    shape = np.stack([1 - s, s])
    still, now = (np.einsum("fas,aq->fqs", x[faces], shape) for x in (pair.upper.points, pair.upper.points + upper))
    low = (pair.lower.points + lower)[master]
    low = low[np.argsort(low[:, 0])]
    overlap = np.interp(now[..., 0], low[:, 0], low[:, 1]) - now[..., 1]
    along_normal = overlap * np.sqrt(1 - (still[..., 0] / RADIUS) ** 2)
    return np.stack([still[..., 0].mean(axis=1), stiffness(pair) * np.maximum(along_normal, 0.0).mean(axis=1)])


if __name__ == "__main__":
    answer(solve)
