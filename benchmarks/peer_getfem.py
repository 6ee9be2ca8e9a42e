"""The peers' problems for GetFEM, run by a Python that has it: python peer_getfem.py PAIR.npz ANSWER.npz.

Ray tracing from the slave, an augmented Lagrangian whose multiplier lives on the slave's nodes, order 25 on the skin.
With friction the top goes down in `PRESSES` steps, then aside in one; slip counts from the last step.
"""

from __future__ import annotations

import sys

import getfem as gf
import numpy as np
from peer_problems import FORCE, LIKE_FORCE, PRESSES, lame, load

#: order of the integration in the bodies, on the skin
BODY, SKIN = 3, 25
#: residual at which the search ends, of the load
TOLERANCE = 1e-9
SLAVE, MASTER, TOP = 1, 2, 3


class Part:
    """A body in GetFEM's terms: mesh, displacements, integration; its sides slave, master, top as regions."""

    def __init__(self, body, name, pair):
        dim = pair.dim
        self.u, self.body, self.mesh = name, body, gf.Mesh("empty", dim)
        order = [0, 1, 3, 2] if dim == 2 else [0, 1, 3, 2, 4, 5, 7, 6]
        shape = gf.GeoTrans(f"GT_QK({dim},1)")
        at = np.array([self.mesh.add_convex(shape, body.points[cell].T)[0] for cell in body.cells[:, order]])
        assert (at == np.arange(len(at))).all()
        self.mf = gf.MeshFem(self.mesh, dim)
        self.mf.set_fem(gf.Fem(f"FEM_QK({dim},1)"))
        self.mim = gf.MeshIm(self.mesh, gf.Integ(f"IM_GAUSS_PARALLELEPIPED({dim},{BODY})"))
        self.skin = gf.MeshIm(self.mesh, gf.Integ(f"IM_GAUSS_PARALLELEPIPED({dim},{SKIN})"))
        self.nodes = self._nodes(self.mf.basic_dof_nodes()[:, ::dim].T)
        for region, side in ((SLAVE, "slave"), (MASTER, "master"), (TOP, "top")):
            if side in body.sides:
                points = self.mesh.pid_from_coords(body.points[np.unique(body.sides[side])].T)
                self.mesh.set_region(region, self.mesh.faces_from_pid(points))

    def _nodes(self, places):
        """The body's node at each of GetFEM's places."""
        key = {tuple(np.round(x, 9)): k for k, x in enumerate(self.body.points)}
        return np.array([key[tuple(np.round(x, 9))] for x in places])

    def held(self, pair, down=1.0, aside=1.0):
        """Degrees of freedom that are prescribed, and their values, with parts of the way down and aside."""
        dim, value = pair.dim, {}
        conditions = [(side, axis, 0.0) for side, axis in pair.held]
        conditions += [("top", dim - 1, pair.push * down)] if pair.push else []
        conditions += [("top", 0, pair.aside * aside)] if pair.friction else []
        for side, axis, amount in conditions:
            if side in self.body.sides:
                rows = np.flatnonzero(np.isin(self.nodes, self.body.sides[side]))
                value |= dict.fromkeys((dim * rows + axis).tolist(), amount)
        return np.array(list(value)), np.array(list(value.values()))


def model_of(pair):
    """The model, its parts, the slave among them, where the multiplier lives."""
    md, parts = gf.Model("real"), [Part(b, u, pair) for b, u in zip(pair.bodies, ("ul", "uu"), strict=True)]
    for part in parts:
        md.add_fem_variable(part.u, part.mf)
        first, second = (f"{name}_{part.u}" for name in ("first", "second"))
        for name, value in zip((first, second), lame(part.body.young, pair.poisson), strict=True):
            md.add_initialized_data(name, value)
        md.add_isotropic_linearized_elasticity_brick(part.mim, part.u, first, second)
        dofs, values = part.held(pair)
        B = gf.Spmat("empty", len(dofs), part.mf.nbdof())
        B.assign(np.arange(len(dofs)), dofs, np.eye(len(dofs)))
        md.add_variable(f"hold_{part.u}", len(dofs))
        part.hold = md.add_constraint_with_multipliers(part.u, f"hold_{part.u}", B, values)
    if pair.pressure:
        md.add_initialized_data("load", [0.0] * (pair.dim - 1) + [-pair.pressure])
        md.add_source_term_brick(parts[1].mim, "uu", "load", TOP)
    slave, master = parts if "slave" in pair.lower.sides else parts[::-1]
    mf = gf.MeshFem(slave.mesh, pair.dim)
    mf.set_fem(gf.Fem(f"FEM_QK({pair.dim},1)"))
    md.add_filtered_fem_variable("force", mf, SLAVE)
    md.add_initialized_data("r", min(b.young for b in pair.bodies) / pair.h)
    rubbing, before = (), {part: () for part in parts}
    if pair.friction:
        md.add_initialized_data("friction", pair.friction)
        md.add_initialized_data("rate", 1.0)
        rubbing, before = ("friction", "rate"), {part: (f"before_{part.u}",) for part in parts}
        for part in parts:
            md.add_initialized_fem_data(*before[part], part.mf, np.zeros(part.mf.nbdof()))
    brick = md.add_integral_large_sliding_contact_brick_raytracing("r", 10 * pair.h, *rubbing)
    add_slave = md.add_slave_contact_boundary_to_large_sliding_contact_brick
    add_slave(brick, slave.skin, SLAVE, slave.u, "force", *before[slave])
    add_master = md.add_master_contact_boundary_to_large_sliding_contact_brick
    add_master(brick, master.skin, MASTER, master.u, *before[master])
    return md, parts, slave


def balanced(md, pair):
    """Solve the model for what is prescribed now; return the number of iterations."""
    tolerance = TOLERANCE * (pair.pressure or (LIKE_FORCE if pair.friction else FORCE))
    search = ("lsolver", "mumps", "lsearch", "simplest", "alpha min", 0.3)
    count, converged = md.solve("max_res", tolerance, "max_iter", 100, *search)[:2]
    if not converged:
        raise RuntimeError(f"no equilibrium found in {count} iterations")
    return count


def solve(pair):
    """Solve a pair and return its results by name."""
    md, parts, slave = model_of(pair)
    if pair.pressure:  # closed from the start: nothing else holds the upper block
        start = md.variable("force").reshape(-1, pair.dim)
        start[:, -1] = -0.1 * pair.pressure
        md.set_variable("force", start.ravel())
    presses = PRESSES if pair.friction else 1
    steps = [(k / presses, 0.0) for k in range(1, presses + 1)] + ([(1.0, 1.0)] if pair.friction else [])
    count = 0
    for down, aside in steps:
        for part in parts:
            md.set_private_rhs(part.hold, part.held(pair, down, aside)[1])
        count += balanced(md, pair)
        if pair.friction:
            for part in parts:
                md.set_variable(f"before_{part.u}", md.variable(part.u))
    out = {"iterations": count}
    if pair.dim == 3:
        worst = []
        for part in parts:
            grad, data = f"Grad_{part.u}", gf.MeshImData(part.mim, -1, 1)
            stress = f"first_{part.u}*Trace({grad}) + 2*second_{part.u}*{grad}(3,3)"
            worst.append(np.abs(md.interpolation(stress, data) + pair.pressure).max())
        return out | {"stress": max(worst)}
    mf = md.mesh_fem_of_variable("force")
    x = mf.basic_dof_nodes(mf.basic_dof_on_region(SLAVE))[0, ::2]
    traction = md.variable("force").reshape(-1, 2)
    shear, force = (abs(gf.asm_generic(slave.skin, 0, f"force({k})", SLAVE, md)) for k in (1, 2))
    if pair.friction:  # like bodies: where they are pressed together they are flat
        return out | {"force": force, "shear": shear, "nodes": np.stack([x, np.abs(traction[:, 0])])}
    return out | {"force": 2 * force, "nodes": np.stack([x, np.linalg.norm(traction, axis=1)])}


if __name__ == "__main__":
    np.savez(sys.argv[2], **solve(load(sys.argv[1])))
