"""Internal forces, tangent, stress and energy of bodies, with one interface for small and finite strains.

Everything is evaluated at a displacement u (n_dof,) and a time t, on which temperatures depend. Springs to the ground
are included in forces, tangent and energy. In equilibrium `internal_force` balances the loads of `problem.acting`,
which contain thermal forces under small kinematics; under finite kinematics temperature is part of the law instead.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.bodies import finite
from lacsolver.bodies import small as assemble
from lacsolver.bodies.material import Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.bodies.small.fields import Field, TemperatureField, checked
from lacsolver.space.space import Space


class Kinematics(Protocol):
    """Interface of bodies for equilibrium and output. `constant`: the tangent is the same for all u and t."""

    @property
    def constant(self) -> bool:
        """True if the tangent is the same for all u and t."""

    def internal_force(self, u: Floats, t: float) -> NDArray[np.floating]:
        """Return f_int (n_dof,), spring forces included. Raises InadmissibleError where u inverts a cell."""

    def tangent(self, u: Floats, t: float) -> csr_array:
        """Return K = df_int/du (n_dof, n_dof), symmetric. Raises InadmissibleError."""

    def force_and_tangent(self, u: Floats, t: float) -> tuple[NDArray[np.floating], csr_array]:
        """Return f_int and K, at a lower cost than by two calls."""

    def stress(self, u: Floats, t: float) -> Field:
        """Return the Cauchy stress (cells, points, 4 or 6) of each block, in the components of `space.COMPONENTS`."""

    def energy(self, u: Floats, t: float) -> float:
        """Return the energy stored in bodies and springs."""


@dataclass(frozen=True, eq=False)
class Small:
    """Small strains: linear laws, and a constant K."""

    space: Space
    materials: Materials
    springs: csr_array | None = None
    temperature: TemperatureField | None = None
    threads: int = 1

    constant = True

    @cached_property
    def K(self) -> csr_array:
        """Stiffness of bodies and springs, (n_dof, n_dof)."""
        K = csr_array(assemble_stiffness(self.space, self.materials, self.threads).tocsr())
        return K if self.springs is None else csr_array(K + self.springs)

    def internal_force(self, u: Floats, t: float) -> NDArray[np.floating]:
        """Return K u."""
        return np.asarray(self.K @ checked(self.space, u))

    def tangent(self, u: Floats, t: float) -> csr_array:
        """Return K."""
        return self.K

    def force_and_tangent(self, u: Floats, t: float) -> tuple[NDArray[np.floating], csr_array]:
        """Return K u and K."""
        return self.internal_force(u, t), self.K

    def stress(self, u: Floats, t: float) -> Field:
        """Return the stress C (strain - thermal strain)."""
        space, materials, threads = self.space, self.materials, self.threads
        return assemble.stress(space, materials, u, temperature=self.temperature, t=t, threads=threads)

    def energy(self, u: Floats, t: float) -> float:
        """Return half the integral of stress times elastic strain, C^-1 stress, plus the springs' energy."""
        C, _ = self.materials.tables
        inverse = np.linalg.pinv(C)  # plane stress: C has zeros for zz
        total = _stored(self.springs, u)
        parts = zip(self.stress(u, t), assemble.weights(self.space), self.materials.law, strict=True)
        for stress, w, law in parts:
            for k in np.unique(law):
                rows = law == k
                work = np.einsum("cqk,cqk->cq", stress[rows] @ inverse[k], stress[rows])
                total += 0.5 * float((w[rows] * work).sum())
        return total


@dataclass(frozen=True, eq=False)
class Finite:
    """Finite strains: hyperelastic laws, and a K that depends on u.

    Its methods raise RequestError for laws of small strains.
    """

    space: Space
    materials: Materials
    springs: csr_array | None = None
    temperature: TemperatureField | None = None
    threads: int = 1
    _kept: dict[float, Field | None] = field(default_factory=dict, repr=False)

    constant = False

    def internal_force(self, u: Floats, t: float) -> NDArray[np.floating]:
        """Return f_int of the bodies plus the springs' forces."""
        theta, threads = self.stretches(t), self.threads
        f = finite.internal_force(self.space, self.materials, u, stretches=theta, threads=threads)
        return f if self.springs is None else f + self.springs @ u

    def tangent(self, u: Floats, t: float) -> csr_array:
        """Return K at u."""
        return self.force_and_tangent(u, t)[1]

    def force_and_tangent(self, u: Floats, t: float) -> tuple[NDArray[np.floating], csr_array]:
        """Return f_int and K, in one pass over the cells."""
        theta, threads, values = self.stretches(t), self.threads, self._values
        f, blocks = finite.force_and_tangent(
            self.space, self.materials, u, stretches=theta, threads=threads, out=values
        )
        K = csr_array(blocks.tocsr())
        return (f, K) if self.springs is None else (f + self.springs @ u, csr_array(K + self.springs))

    def stress(self, u: Floats, t: float) -> Field:
        """Return the Cauchy stress."""
        theta, threads = self.stretches(t), self.threads
        return finite.cauchy_stress(self.space, self.materials, u, stretches=theta, threads=threads)

    def energy(self, u: Floats, t: float) -> float:
        """Return the energy stored in bodies and springs."""
        theta, threads = self.stretches(t), self.threads
        stored = finite.energy(self.space, self.materials, u, stretches=theta, threads=threads)
        return stored + _stored(self.springs, u)

    def stretches(self, t: float) -> Field | None:
        """Return the thermal stretches at time t; those of the last time are cached."""
        if t not in self._kept:
            self._kept.clear()
            self._kept[t] = finite.thermal_stretches(self.space, self.materials, self.temperature, t)
        return self._kept[t]

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
    temperature: TemperatureField | None = None,
    threads: int = 1,
) -> Kinematics:
    """Return the kinematics for the name that a case gives, `small` or `finite`."""
    if name not in ("small", "finite"):
        raise ValueError(f"kinematics are small or finite, not {name!r}")
    make = Small if name == "small" else Finite
    return make(space, materials, springs, temperature, threads)


def _stored(springs: csr_array | None, u: Floats) -> float:
    return 0.0 if springs is None else 0.5 * float(u @ (springs @ u))
