"""How bodies answer a displacement: forces, tangent, stress, energy, with one signature for small and finite strains.

Everything is asked for at a displacement u (n_dof,) and a time t, since temperatures depend on it. Springs to the
ground are in forces, tangent and energy. What equilibrium sets against `internal_force` is `acting.load`, in which
temperature is a load where kinematics are small, and is not where they are finite: there it is in the law.
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
from lacsolver.bodies.small.fields import Field, Temperature, checked
from lacsolver.space.space import Space


class Kinematics(Protocol):
    """What equilibrium and output ask of bodies. `constant`: the tangent is the same for all u and t."""

    @property
    def constant(self) -> bool:
        """Whether one tangent serves all u and t."""

    def internal_force(self, u: Floats, t: float) -> NDArray[np.floating]:
        """f_int (n_dof,). Raises InadmissibleError where u turns a cell inside out."""

    def tangent(self, u: Floats, t: float) -> csr_array:
        """K (n_dof, n_dof) = df_int/du, symmetric. Raises InadmissibleError."""

    def force_and_tangent(self, u: Floats, t: float) -> tuple[NDArray[np.floating], csr_array]:
        """Both, for less than one after the other."""

    def stress(self, u: Floats, t: float) -> Field:
        """(cells, points, 4 or 6) for each block: Cauchy stress, its components those of `space.COMPONENTS`."""

    def energy(self, u: Floats, t: float) -> float:
        """What bodies and springs store."""


@dataclass(frozen=True, eq=False)
class Small:
    """Small strains: linear laws, and a constant K."""

    space: Space
    materials: Materials
    springs: csr_array | None = None
    temperature: Temperature | None = None
    threads: int = 1

    constant = True

    @cached_property
    def K(self) -> csr_array:
        """(n_dof, n_dof): stiffness of bodies and springs."""
        K = csr_array(assemble_stiffness(self.space, self.materials, self.threads).tocsr())
        return K if self.springs is None else csr_array(K + self.springs)

    def internal_force(self, u: Floats, t: float) -> NDArray[np.floating]:
        """K u."""
        return np.asarray(self.K @ checked(self.space, u))

    def tangent(self, u: Floats, t: float) -> csr_array:
        """K."""
        return self.K

    def force_and_tangent(self, u: Floats, t: float) -> tuple[NDArray[np.floating], csr_array]:
        """K u, K."""
        return self.internal_force(u, t), self.K

    def stress(self, u: Floats, t: float) -> Field:
        """C (strain - thermal strain)."""
        space, materials, threads = self.space, self.materials, self.threads
        return assemble.stress(space, materials, u, temperature=self.temperature, t=t, threads=threads)

    def energy(self, u: Floats, t: float) -> float:
        """Half of stress times the strain that causes it, C^-1 stress."""
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
    """Finite strains: hyperelastic laws, K at every u. Raises RequestError for laws of small strains, when asked."""

    space: Space
    materials: Materials
    springs: csr_array | None = None
    temperature: Temperature | None = None
    threads: int = 1
    _kept: dict[float, Field | None] = field(default_factory=dict, repr=False)

    constant = False

    def internal_force(self, u: Floats, t: float) -> NDArray[np.floating]:
        """f_int of the bodies, and the springs' forces."""
        theta, threads = self.stretches(t), self.threads
        f = finite.internal_force(self.space, self.materials, u, stretches=theta, threads=threads)
        return f if self.springs is None else f + self.springs @ u

    def tangent(self, u: Floats, t: float) -> csr_array:
        """K at u."""
        return self.force_and_tangent(u, t)[1]

    def force_and_tangent(self, u: Floats, t: float) -> tuple[NDArray[np.floating], csr_array]:
        """Both, in one pass over the cells."""
        theta, threads, values = self.stretches(t), self.threads, self._values
        f, blocks = finite.force_and_tangent(
            self.space, self.materials, u, stretches=theta, threads=threads, out=values
        )
        K = csr_array(blocks.tocsr())
        return (f, K) if self.springs is None else (f + self.springs @ u, csr_array(K + self.springs))

    def stress(self, u: Floats, t: float) -> Field:
        """Cauchy stress."""
        theta, threads = self.stretches(t), self.threads
        return finite.cauchy_stress(self.space, self.materials, u, stretches=theta, threads=threads)

    def energy(self, u: Floats, t: float) -> float:
        """The bodies' energy, and the springs'."""
        theta, threads = self.stretches(t), self.threads
        stored = finite.energy(self.space, self.materials, u, stretches=theta, threads=threads)
        return stored + _stored(self.springs, u)

    def stretches(self, t: float) -> Field | None:
        """Thermal stretches at a time; those of the last time asked about are kept."""
        if t not in self._kept:
            self._kept.clear()
            self._kept[t] = finite.thermal_stretches(self.space, self.materials, self.temperature, t)
        return self._kept[t]

    @cached_property
    def _values(self) -> NDArray[np.floating]:
        """Where the blocks of K are written each time."""
        return np.empty((len(self.space.pattern.indices), self.space.dim, self.space.dim))


def kinematics_of(
    name: str,
    space: Space,
    materials: Materials,
    *,
    springs: csr_array | None = None,
    temperature: Temperature | None = None,
    threads: int = 1,
) -> Kinematics:
    """The kinematics that a case calls `small` or `finite`."""
    if name not in ("small", "finite"):
        raise ValueError(f"kinematics are small or finite, not {name!r}")
    make = Small if name == "small" else Finite
    return make(space, materials, springs, temperature, threads)


def _stored(springs: csr_array | None, u: Floats) -> float:
    return 0.0 if springs is None else 0.5 * float(u @ (springs @ u))
