"""Internal forces, tangent, stress and energy of bodies, with one interface for small and finite strains.

Everything is evaluated at a displacement u (n_dof,) and a time t, on which temperatures depend, with the `history`
that the laws committed at the end of the last step (`pointwise`). Springs are included in forces, tangent and energy;
the energy is that of this process's own cells and nodes, stress has the components of `space.COMPONENTS`. In
equilibrium `internal_force` balances the loads of `problem.acting`, which contain the thermal forces of linear laws;
those of other laws are part of the internal forces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats
from lacsolver.bodies import small
from lacsolver.bodies.line_springs import LineSprings
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import Field, checked
from lacsolver.bodies.pointwise import DisplacedBodies, LawHistory
from lacsolver.bodies.temperature import TemperatureField, stretches, warming
from lacsolver.linear import Matrix
from lacsolver.space.space import Space


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Small strains: bodies in balance undeformed; or `finite` ones: in balance where they are displaced to.

    `springs` (n_dof, n_dof): stiffness of springs that do not turn; `lines`: springs that do, of finite strains only.
    Raises RequestError for laws of the other strains, InadmissibleError where a displacement inverts a cell.
    """

    space: Space
    materials: Materials
    finite: bool
    springs: csr_array | None = None
    lines: LineSprings | None = None
    temperature: TemperatureField | None = None
    threads: int = 1

    @property
    def linear(self) -> bool:
        """True for small strains of linear laws: the tangent is the same for all u and t."""
        return not self.finite and not any(self.materials.pointwise)

    def at(self, u: Floats, t: float, history: LawHistory = ()) -> DisplacedBodies:
        """Return the bodies without the springs."""
        return DisplacedBodies(self.space, self.materials, u, self._warming(t), history, self.threads, self.finite)

    def internal_force(self, u: Floats, t: float, history: LawHistory = ()) -> NDArray[np.floating]:
        """Return f_int of bodies and springs: K u of linear laws and springs, and the forces of other laws."""
        u, K, own = checked(self.space, u), self._constant, self.materials.pointwise
        f = np.zeros(self.space.n_dof) if self.linear else self.at(u, t, history).internal_force(own)
        f = f if K is None else f + K @ u
        return f if self.lines is None else f + self.lines.internal_force(u)

    def tangent(self, u: Floats, t: float, history: LawHistory = ()) -> Matrix:
        """Return K at u: of linear laws alone in blocks and the same for all u, symmetric but for laws that are not."""
        if self.linear:
            assert self._constant is not None
            return self._constant
        own = self.at(u, t, history).tangent(self._values, self.materials.pointwise)
        K = csr_array((own if self._constant is None else own + self._constant).tocsr())
        return K if self.lines is None else csr_array(K + self.lines.tangent(u))

    def commit(self, u: Floats, t: float, history: LawHistory = ()) -> LawHistory:
        """Return the history of the laws at the end of a step, () if none has one."""
        return () if self.linear else self.at(u, t, history).commit()

    def stress(self, u: Floats, t: float, history: LawHistory = ()) -> Field:
        """Return the Cauchy stress."""
        return self.at(u, t, history).cauchy_stress()

    def energy(self, u: Floats, t: float, history: LawHistory = ()) -> float:
        """Return the energy stored in bodies and springs."""
        own, springs = self.space.own, self.springs
        of_springs = 0.0 if springs is None else 0.5 * float((own(u) * own(springs @ u)).sum())
        of_lines = 0.0 if self.lines is None else self.lines.energy(u)
        return self.at(u, t, history).energy() + of_springs + of_lines

    def stretches(self, t: float) -> Field | None:
        """Return the thermal stretches (cells, points) of finite strains at a time; None without temperature."""
        warmer = self._warming(t)
        return None if warmer is None else stretches(self.space, self.materials, warmer)

    @cached_property
    def _warming(self) -> Callable[[float], Field | None]:
        """t -> T - T0 at the points, None without temperature; those of the last time are kept."""
        return lru_cache(maxsize=1)(lambda t: warming(self.space, self.materials, self.temperature, t))

    @cached_property
    def _constant(self) -> Matrix | None:
        """Stiffness of springs and of cells with linear laws, (n_dof, n_dof); None without either."""
        if all(self.materials.pointwise):
            return self.springs
        K = small.assemble_stiffness(self.space, self.materials, self.threads)
        return K if self.springs is None else bsr_array(K + self.springs.tobsr(K.blocksize))

    @cached_property
    def _values(self) -> NDArray[np.floating]:
        """Array for the blocks of K, reused by each evaluation."""
        return np.empty((len(self.space.pattern.indices), self.space.dim, self.space.dim))


def kinematics_of(
    name: str,
    space: Space,
    materials: Materials,
    *,
    springs: csr_array | None = None,
    lines: LineSprings | None = None,
    temperature: TemperatureField | None = None,
    threads: int = 1,
) -> Kinematics:
    """Return the kinematics for the name that a case gives, `small` or `finite`.

    `springs` (n_dof, n_dof): stiffness of springs that do not turn; `lines`: springs that do, which only finite
    kinematics have.
    """
    if name not in ("small", "finite"):
        raise ValueError(f"kinematics are small or finite, not {name!r}")
    if name == "small" and lines is not None:
        raise ValueError("springs do not turn in small kinematics; give the stiffness along their undeformed lines")
    return Kinematics(space, materials, name == "finite", springs, lines, temperature, threads)
