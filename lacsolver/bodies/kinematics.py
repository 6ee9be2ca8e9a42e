"""Internal forces, tangent, stress and energy of bodies, with one interface for small and finite strains.

Everything is evaluated at a displacement u (n_dof,) and a time t, on which temperatures depend. Springs
are included in forces, tangent and energy. In equilibrium `internal_force` balances the loads of `problem.acting`,
which contain thermal forces under small kinematics; under finite kinematics temperature is part of the law instead.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats
from lacmesh.records import dataclass
from lacsolver.bodies import small
from lacsolver.bodies.finite import thermal_stretches
from lacsolver.bodies.line_springs import LineSprings
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import Field, checked
from lacsolver.bodies.pointwise import DisplacedBodies, LawHistory
from lacsolver.bodies.small.fields import TemperatureField
from lacsolver.linear import Matrix
from lacsolver.space.space import Space


class Kinematics(Protocol):
    """Interface of bodies for equilibrium and output, at a displacement u (n_dof,) and a time t.

    `history`: what the laws committed at the end of the last step, () for none, see `pointwise`.
    """

    @property
    def linear(self) -> bool:
        """True if the tangent is the same for all u and t."""

    @property
    def finite(self) -> bool:
        """True if the bodies are in balance where they are displaced to, False if undeformed."""

    def internal_force(self, u: Floats, t: float, history: LawHistory = ()) -> NDArray[np.floating]:
        """Return f_int (n_dof,), spring forces included. Raises InadmissibleError where u inverts a cell."""

    def tangent(self, u: Floats, t: float, history: LawHistory = ()) -> Matrix:
        """Return K = df_int/du (n_dof, n_dof), symmetric for hyperelastic laws. Raises InadmissibleError."""

    def commit(self, u: Floats, t: float, history: LawHistory = ()) -> LawHistory:
        """Return the history of the laws at the end of a step; () if no law has one."""

    def stress(self, u: Floats, t: float, history: LawHistory = ()) -> Field:
        """Return the Cauchy stress (cells, points, 4 or 6) of each block, in the components of `space.COMPONENTS`."""

    def energy(self, u: Floats, t: float, history: LawHistory = ()) -> float:
        """Return the energy stored in bodies and springs, of this process's own cells and nodes."""


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
        """True without laws that are evaluated at points."""
        return not any(self.materials.pointwise)

    @cached_property
    def _K(self) -> bsr_array:
        """Stiffness of springs and of cells with linear laws, (n_dof, n_dof)."""
        K = small.assemble_stiffness(self.space, self.materials, self.threads)
        return K if self.springs is None else bsr_array(K + self.springs.tobsr(K.blocksize))

    def _by_points(self, u: Floats, t: float, history: LawHistory) -> DisplacedBodies:
        """Return the cells whose laws are evaluated at points."""
        stretches = self._stretches(t)
        return DisplacedBodies(self.space, self.materials, u, stretches, history, self.threads, finite=False)

    @cached_property
    def _stretches(self) -> Callable[[float], Field | None]:
        return _stretches_at(self.space, self.materials, self.temperature)

    def internal_force(self, u: Floats, t: float, history: LawHistory = ()) -> NDArray[np.floating]:
        """Return K u, and the forces of laws at points."""
        f = np.asarray(self._K @ checked(self.space, u))
        return f if self.linear else f + self._by_points(u, t, history).internal_force()

    def tangent(self, u: Floats, t: float, history: LawHistory = ()) -> Matrix:
        """Return K, as blocks, and the tangent of laws at points."""
        return self._K if self.linear else csr_array(self._K + self._by_points(u, t, history).tangent())

    def commit(self, u: Floats, t: float, history: LawHistory = ()) -> LawHistory:
        """Return the history of laws at points."""
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
        """Return f_int of the bodies plus the springs' forces."""
        f = self.at(u, t, history).internal_force()
        f = f if self.springs is None else f + self.springs @ u
        return f if self.lines is None else f + self.lines.internal_force(u)

    def tangent(self, u: Floats, t: float, history: LawHistory = ()) -> csr_array:
        """Return K at u."""
        K = csr_array(self.at(u, t, history).tangent(self._values).tocsr())
        K = K if self.springs is None else csr_array(K + self.springs)
        return K if self.lines is None else csr_array(K + self.lines.tangent(u))

    def commit(self, u: Floats, t: float, history: LawHistory = ()) -> LawHistory:
        """Return the history of the laws."""
        return self.at(u, t, history).commit()

    def stress(self, u: Floats, t: float, history: LawHistory = ()) -> Field:
        """Return the Cauchy stress."""
        return self.at(u, t, history).cauchy_stress()

    def energy(self, u: Floats, t: float, history: LawHistory = ()) -> float:
        """Return the energy stored in bodies and springs."""
        of_lines = 0.0 if self.lines is None else self.lines.energy(u)
        return self.at(u, t, history).energy() + _stored(self.space, self.springs, u) + of_lines

    def stretches(self, t: float) -> Field | None:
        """Return the thermal stretches at time t; those of the last time are cached."""
        return self._stretches(t)

    @cached_property
    def _stretches(self) -> Callable[[float], Field | None]:
        return _stretches_at(self.space, self.materials, self.temperature)

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
    if name == "finite":
        return Finite(space, materials, springs, temperature, threads, lines)
    if lines is not None:
        raise ValueError("springs do not turn in small kinematics; give the stiffness along their undeformed lines")
    return Small(space, materials, springs, temperature, threads)


def _stored(space: Space, springs: csr_array | None, u: Floats) -> float:
    return 0.0 if springs is None else 0.5 * float((space.own(u) * space.own(springs @ u)).sum())
