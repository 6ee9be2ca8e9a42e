"""Internal forces, tangent, stress and energy of bodies, with one interface for small and finite strains.

Everything is evaluated at a displacement u (n_dof,) and a time t, on which temperatures depend, with the `history`
that the laws committed at the end of the last step (`pointwise`). Springs are included in forces, tangent and energy;
the energy is that of this process's own cells and nodes, stress has the components of `space.COMPONENTS`. In
equilibrium `internal_force` balances the loads of `problem.acting`, which contain thermal forces under small
kinematics; under finite kinematics temperature is part of the law instead.
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
from lacsolver.bodies.finite import thermal_stretches
from lacsolver.bodies.line_springs import LineSprings
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import Field, checked
from lacsolver.bodies.pointwise import DisplacedBodies, LawHistory
from lacsolver.bodies.small.fields import TemperatureField
from lacsolver.linear import Matrix
from lacsolver.space.space import Space


def _stretches_at(
    space: Space, materials: Materials, temperature: TemperatureField | None
) -> Callable[[float], Field | None]:
    """Return t -> the thermal stretches of bodies, None without temperature; those of the last time are kept."""
    return lru_cache(maxsize=1)(lambda t: thermal_stretches(space, materials, temperature, t))


@dataclass(frozen=True, eq=False)
class Small:
    """Small strains: bodies in balance undeformed, and a constant K of the linear laws."""

    space: Space
    materials: Materials
    springs: csr_array | None = None
    temperature: TemperatureField | None = None
    threads: int = 1

    finite = False

    @property
    def linear(self) -> bool:
        """True without laws that are evaluated at points: the tangent is the same for all u and t."""
        return not any(self.materials.pointwise)

    @cached_property
    def _K(self) -> bsr_array:
        """Stiffness of springs and of cells with linear laws, (n_dof, n_dof)."""
        K = small.assemble_stiffness(self.space, self.materials, self.threads)
        return K if self.springs is None else bsr_array(K + self.springs.tobsr(K.blocksize))

    def _by_points(self, u: Floats, t: float, history: LawHistory) -> DisplacedBodies:
        """Return the cells whose laws are evaluated at points."""
        stretches = self.stretches(t)
        return DisplacedBodies(self.space, self.materials, u, stretches, history, self.threads, finite=False)

    @cached_property
    def stretches(self) -> Callable[[float], Field | None]:
        """The thermal stretches at a time."""
        return _stretches_at(self.space, self.materials, self.temperature)

    def internal_force(self, u: Floats, t: float, history: LawHistory = ()) -> NDArray[np.floating]:
        """Return K u, and the forces of laws at points."""
        f = np.asarray(self._K @ checked(self.space, u))
        return f if self.linear else f + self._by_points(u, t, history).internal_force()

    def tangent(self, u: Floats, t: float, history: LawHistory = ()) -> Matrix:
        """Return K, as blocks, and the tangent of laws at points."""
        return self._K if self.linear else csr_array(self._K + self._by_points(u, t, history).tangent())

    def commit(self, u: Floats, t: float, history: LawHistory = ()) -> LawHistory:
        """Return the history of laws at points at the end of a step, () if none has one."""
        return () if self.linear else self._by_points(u, t, history).commit()

    def stress(self, u: Floats, t: float, history: LawHistory = ()) -> Field:
        """Return the stress C (strain - thermal strain), and that of laws at points."""
        space, materials, threads = self.space, self.materials, self.threads
        stress = small.stress(space, materials, u, temperature=self.temperature, t=t, threads=threads)
        if self.linear:
            return stress
        return tuple(a + b for a, b in zip(stress, self._by_points(u, t, history).cauchy_stress(), strict=True))

    def energy(self, u: Floats, t: float, history: LawHistory = ()) -> float:
        """Return half the integral of stress times elastic strain, C^-1 stress, plus the springs' energy."""
        C, _ = self.materials.tables
        inverse = np.linalg.pinv(C)  # plane stress: C has zeros for zz; laws at points: zeros
        total = _stored(self.space, self.springs, u) + (0.0 if self.linear else self._by_points(u, t, history).energy())
        space = self.space
        parts = zip(self.stress(u, t, history), small.weights(space), self.materials.law, space.blocks, strict=True)
        for stress, w, law, block in parts:
            for k in np.unique(law):
                rows = (law == k) & space.own_cells(block)
                work = np.einsum("cqk,cqk->cq", stress[rows] @ inverse[k], stress[rows])
                total += 0.5 * float((w[rows] * work).sum())
        return total


@dataclass(frozen=True, eq=False)
class Finite:
    """Finite strains: bodies in balance where they are displaced to, and a K that depends on u.

    `springs` (n_dof, n_dof): stiffness of springs that do not turn; `lines`: springs that do.
    Its methods raise RequestError for laws of small strains.
    """

    space: Space
    materials: Materials
    springs: csr_array | None = None
    temperature: TemperatureField | None = None
    threads: int = 1
    lines: LineSprings | None = None

    finite = True
    linear = False

    def at(self, u: Floats, t: float, history: LawHistory = ()) -> DisplacedBodies:
        """Return the bodies without the springs."""
        return DisplacedBodies(self.space, self.materials, u, self.stretches(t), history, self.threads)

    def internal_force(self, u: Floats, t: float, history: LawHistory = ()) -> NDArray[np.floating]:
        """Return f_int of the bodies plus the springs' forces. Raises InadmissibleError where u inverts a cell."""
        f = self.at(u, t, history).internal_force()
        f = f if self.springs is None else f + self.springs @ u
        return f if self.lines is None else f + self.lines.internal_force(u)

    def tangent(self, u: Floats, t: float, history: LawHistory = ()) -> csr_array:
        """Return K at u, symmetric for hyperelastic laws. Raises InadmissibleError."""
        K = csr_array(self.at(u, t, history).tangent(self._values).tocsr())
        K = K if self.springs is None else csr_array(K + self.springs)
        return K if self.lines is None else csr_array(K + self.lines.tangent(u))

    def commit(self, u: Floats, t: float, history: LawHistory = ()) -> LawHistory:
        """Return the history of the laws at the end of a step, () if none has one."""
        return self.at(u, t, history).commit()

    def stress(self, u: Floats, t: float, history: LawHistory = ()) -> Field:
        """Return the Cauchy stress."""
        return self.at(u, t, history).cauchy_stress()

    def energy(self, u: Floats, t: float, history: LawHistory = ()) -> float:
        """Return the energy stored in bodies and springs."""
        of_lines = 0.0 if self.lines is None else self.lines.energy(u)
        return self.at(u, t, history).energy() + _stored(self.space, self.springs, u) + of_lines

    @cached_property
    def stretches(self) -> Callable[[float], Field | None]:
        """The thermal stretches at a time."""
        return _stretches_at(self.space, self.materials, self.temperature)

    @cached_property
    def _values(self) -> NDArray[np.floating]:
        """Array for the blocks of K, reused by each evaluation."""
        return np.empty((len(self.space.pattern.indices), self.space.dim, self.space.dim))


#: what a case may have, with the same attributes and methods
Kinematics = Small | Finite


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
    if name == "finite":
        return Finite(space, materials, springs, temperature, threads, lines)
    if lines is not None:
        raise ValueError("springs do not turn in small kinematics; give the stiffness along their undeformed lines")
    return Small(space, materials, springs, temperature, threads)


def _stored(space: Space, springs: csr_array | None, u: Floats) -> float:
    return 0.0 if springs is None else 0.5 * float((space.own(u) * space.own(springs @ u)).sum())
