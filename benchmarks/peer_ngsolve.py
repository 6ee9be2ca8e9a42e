"""The peers' problems for NGSolve, run by a Python that has it: python peer_ngsolve.py PAIR.npz ANSWER.npz.

A contact energy, 10 E / h times half the square of the overlap (penalty), order 30 on the skin, by Newton's method.
"""

from __future__ import annotations

import sys

import ngsolve as ngs
import numpy as np
from netgen.meshing import Element1D, Element2D, Element3D, Mesh, MeshPoint, Pnt
from peer_problems import FORCE, RADIUS, lame, load

#: penalty over E / h, order of the integration on the skin
PENALTY, ORDER = 10.0, 30
#: force out of balance at which the search ends, of the load; the most iterations
TOLERANCE, LIMIT = 1e-8, 100


def mesh_of(pair):
    """The two bodies in NGSolve's mesh, bodies and sides by their names."""
    made, dim = Mesh(dim=pair.dim), pair.dim
    for name, body in zip(("lower", "upper"), pair.bodies, strict=True):
        points = np.column_stack([body.points, np.zeros((len(body.points), 3 - dim))])
        number = np.array([made.Add(MeshPoint(Pnt(*x))) for x in points], dtype=object)
        inside = made.AddRegion(name, dim=dim)
        for cell in body.cells:
            nodes = list(number[cell])
            made.Add(Element2D(inside, nodes) if dim == 2 else Element3D(inside, nodes))
        for side, faces in body.sides.items():
            label = made.AddRegion(f"{name}_{side}", dim=dim - 1)
            for nodes in number[faces]:
                made.Add(Element1D(list(nodes), index=label) if dim == 2 else Element2D(label, list(nodes)))
    return ngs.Mesh(made)


def named(pair, side):
    """The bodies that have a side."""
    return [name for name, body in zip(("lower", "upper"), pair.bodies, strict=True) if side in body.sides]


def space_of(pair, mesh):
    """Displacements of first order, what is prescribed held axis by axis."""
    held = [[], [], []]
    for side, axis in (*pair.held, *((("top", pair.dim - 1),) if pair.push else ())):
        held[axis] += [f"{name}_{side}" for name in named(pair, side)]
    names = dict(zip(("dirichletx", "dirichlety", "dirichletz"), ("|".join(h) for h in held), strict=True))
    return ngs.VectorH1(mesh, order=1, **names)


def stiffness(pair):
    """Pressure of an overlap of one unit of length."""
    return PENALTY * min(body.young for body in pair.bodies) / pair.h


def forms(pair, mesh, space):
    """Stress of a displacement, energy of bodies, of these and the load, and the contact, its pairs yet to be found."""
    moduli = zip(*(lame(body.young, pair.poisson) for body in pair.bodies), strict=True)
    first, second = (mesh.MaterialCF(dict(zip(("lower", "upper"), pair, strict=True))) for pair in moduli)

    def stress(u):
        strain = (ngs.Grad(u) + ngs.Grad(u).trans) / 2
        return first * ngs.Trace(strain) * ngs.Id(pair.dim) + 2 * second * strain

    u = space.TrialFunction()
    elastic = ngs.BilinearForm(space, symmetric=True)
    elastic += ngs.Variation(0.5 * ngs.InnerProduct(stress(u), ngs.Grad(u)) * ngs.dx)
    a = ngs.BilinearForm(space, symmetric=True)
    a += ngs.Variation(0.5 * ngs.InnerProduct(stress(u), ngs.Grad(u)) * ngs.dx)
    if pair.pressure:
        a += ngs.Variation(pair.pressure * u[pair.dim - 1] * ngs.ds("upper_top"))
    (slave,), (master,) = named(pair, "slave"), named(pair, "master")
    contact = ngs.ContactBoundary(mesh.Boundaries(f"{slave}_slave"), mesh.Boundaries(f"{master}_master"))
    X = ngs.CoefficientFunction((ngs.x, ngs.y, ngs.z)[: pair.dim])
    overlap = (X + u - X.Other() - u.Other()) * ngs.specialcf.normal(pair.dim)
    contact.AddEnergy(ngs.IfPos(overlap, 0.5 * stiffness(pair) * overlap * overlap, 0))
    return stress, elastic, a, contact


def solve(pair):
    """Solve a pair and return its results by name."""
    mesh = mesh_of(pair)
    space = space_of(pair, mesh)
    stress, elastic, a, contact = forms(pair, mesh, space)
    gf, r = ngs.GridFunction(space), ngs.GridFunction(space).vec
    if pair.push:
        gf.components[pair.dim - 1].Set(pair.push, definedon=mesh.Boundaries("upper_top"))
    else:  # closed from the start: nothing else holds the upper block
        gf.components[pair.dim - 1].Set(mesh.MaterialCF({"upper": -1e-3 * pair.h}))
    free = space.FreeDofs()
    keep = np.array(list(free))
    for count in range(LIMIT + 1):
        contact.Update(gf, a, intorder=ORDER, maxdist=2 * pair.h)
        a.Apply(gf.vec, r)
        if count and np.abs(r.FV().NumPy()[keep]).max() < TOLERANCE * (pair.pressure * pair.h**2 or FORCE):
            break
        a.AssembleLinearization(gf.vec)
        gf.vec.data -= a.mat.Inverse(free, inverse="sparsecholesky") * r
    else:
        raise RuntimeError(f"no equilibrium found in {LIMIT} iterations")
    out = {"iterations": count}
    if pair.dim == 3:
        points = ngs.IntegrationRule(ngs.HEX, 3)
        made = mesh.MapToAllElements(points, ngs.VOL)
        return out | {"stress": np.abs(stress(gf)[2, 2](made) + pair.pressure).max()}
    elastic.Apply(gf.vec, r)
    u, force = (v.FV().NumPy().reshape(2, -1).T for v in (gf.vec, r))
    return (
        out
        | {"force": 2 * abs(force[np.unique(pair.upper.sides["slave"]) + len(pair.lower.points), 1].sum())}
        | {"faces": pressures(pair, *np.split(u, [len(pair.lower.points)]))}
    )


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
    np.savez(sys.argv[2], **solve(load(sys.argv[1])))
