"""The matrices of a case without its contact, for a solver of your own: K, M, f, and the prescribed displacements.

    K u + (contact) = f,    u = u0 at the `fixed` unknowns         and M for motion

The rows of contact are `contact["name"]`: B, G and w of each pair, as the case says. `lacsolver.solve_contact` solves
contact on them, or your own loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import RequestError
from lacmesh.facts import Described
from lacmesh.mesh import Ints, Mesh, MeshLike
from lacsolver.bodies.mass import assemble_mass, check_densities
from lacsolver.case import Case, as_case
from lacsolver.doubts.rules import Doubts
from lacsolver.matrices import ContactMatrices, matrices_of
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import mesh_of


@dataclass(frozen=True, eq=False, repr=False)
class System(Described):
    """Matrices of a case at one time, without contact; n = d n_nodes unknowns, component k of node i at d i + k.

    `K` (n, n): stiffness of the undeformed bodies, springs included; it is singular for bodies that nothing holds. `f`
    (n,): forces of all loads and temperatures. `u0` (n,): prescribed displacements, 0 elsewhere. `time` of f and u0.
    `mesh`: the cut mesh, whose nodes the unknowns are.

    >>> system = assemble("data/two_blocks.toml", t=0.5)
    >>> float(system.f.sum().round(6)), bool(system.u0.any())
    (-5.217593, False)
    >>> system.contact["joint"].B.shape
    (36, 1536)
    """

    problem: Problem
    K: csr_array
    f: NDArray[np.floating]
    u0: NDArray[np.floating]
    time: float

    @property
    def mesh(self) -> Mesh:
        """The cut mesh."""
        return self.problem.space.mesh

    @property
    def dofs(self) -> Ints:
        """Indices (n_nodes, d) of the unknowns of each node."""
        return self.problem.space.dofs(np.arange(self.mesh.n_nodes))

    @cached_property
    def contact(self) -> dict[str, ContactMatrices]:
        """Matrices B, G, w of each contact and tie in the undeformed configuration, by its name, at `time`."""
        return matrices_of(self.problem.joints, self.mesh, self.time)

    @cached_property
    def M(self) -> csr_array:
        """Consistent mass matrix (n, n). Raises DataError for cells whose material has no density."""
        check_densities(self.problem.space, self.problem.materials)
        return assemble_mass(self.problem.space, self.problem.materials)

    @property
    def T(self) -> csr_array:
        """Derivative (n, r) of the displacements by the r unknowns that the supports and rigid bodies leave, du/dq."""
        return self.problem.constraints.T

    @property
    def fixed(self) -> Ints:
        """Indices (k,) of the prescribed unknowns, those of nodes without cells included.

        Raises RequestError for supports across the axes and for free rigid bodies, which couple unknowns: use `T`.
        """
        constraints = self.problem.constraints
        if not constraints.is_selection:
            message = (
                "a support across the axes (un) or a free rigid body couples unknowns, so that no list of fixed ones"
            )
            raise RequestError(f"{message} describes them; take u = T q + u0 with T of the system")
        return np.setdiff1d(np.arange(len(self.f)), constraints.free)

    def _facts(self) -> dict[str, str]:
        n, free = len(self.f), self.problem.constraints.n_q
        return {
            "unknowns": f"{n:,}, of which {n - free:,} are fixed",
            "K": f"({n}, {n}), {self.K.nnz:,} entries",
            "f, u0": f"({n},), at time {self.time:.6g}",
        }


def assemble(case: Case | str | Path, mesh: MeshLike | None = None, *, t: float | None = None) -> System:
    """Return the matrices of a case without its contact, at time t, the end of the steps by default.

    `case`, `mesh`: as for `lacsolver.solve`; slaves that are not cut are cut here. Raises CaseError, ReadError,
    CutError, DataError, RequestError.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> system = ls.assemble(example("two_blocks.toml"))
    >>> system.K.shape, system.f.shape, system.dofs.shape, len(system.fixed)
    ((1536, 1536), (1536,), (512, 3), 230)
    """
    case = as_case(case)
    if t is not None and not t >= 0:
        raise RequestError(f"t is a time of the steps, which begin at 0, not {t:g}")
    problem = Problem.of(case, mesh_of(case, mesh))
    Doubts(problem).ask("matrices")
    t = case.steps.last if t is None else t
    none = np.zeros(problem.space.n_dof)
    K = csr_array(problem.kinematics.tangent(none, t))
    return System(problem, K, problem.load(t), problem.constraints.u0(t).copy(), t)
