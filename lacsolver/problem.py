"""The problem of a case: its mesh, cut where it has to be, and all that stays the same from step to step.

mesh -> space, materials -> K; constraints; zones; loads f(t). What changes is found by `march`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Mesh
from lacsolver import loads
from lacsolver.assemble import assemble_stiffness
from lacsolver.assemble.fields import Temperature
from lacsolver.case import Case, Contact, Tie
from lacsolver.case.groups import check_groups
from lacsolver.case.value import Value
from lacsolver.constraints import Constraints
from lacsolver.interface import Pairing, Zone
from lacsolver.laws import law_of
from lacsolver.material import Materials
from lacsolver.places import nodes_of
from lacsolver.skin import prepared
from lacsolver.space import Space

AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Joint:
    """A zone of the problem and how it is treated. `record`: the case's contact or tie."""

    record: Contact | Tie
    zone: Zone
    pairing: Pairing

    @property
    def name(self) -> str:
        """What results are called by."""
        return self.record.name

    @property
    def tie(self) -> bool:
        """Whether all components are joined."""
        return isinstance(self.record, Tie)

    @property
    def one_sided(self) -> bool:
        """Whether the pressure is >= 0 and the gap may open."""
        return isinstance(self.record, Contact) and self.record.type == "unilateral"

    @property
    def timed(self) -> bool:
        """Whether the clearance changes with time."""
        return isinstance(self.record, Contact) and self.record.clearance.depends_on_time

    @property
    def moving(self) -> bool:
        """Whether the zone is paired again on the deformed skins."""
        return isinstance(self.record, Contact) and self.record.geometry == "current"


@dataclass(frozen=True, eq=False)
class Problem:
    """What a case asks, on its mesh; built by `Problem.of`. `joints`: contacts, then ties, in the case's order."""

    case: Case
    space: Space
    materials: Materials
    constraints: Constraints
    joints: tuple[Joint, ...]

    @classmethod
    def of(cls, case: Case, mesh: Mesh | None = None) -> Problem:
        """Read the mesh of a case (or take `mesh`), cut what slaves are whole, and check that all of it fits.

        Raises CaseError, ReadError, CutError, DataError, RequestError, each with a sentence for the user.
        """
        mesh = prepared(case, mesh)
        check_groups(case, mesh)
        space = Space.of(mesh, case.model, case.thickness)
        materials = Materials.of(space, [(law_of(m), m.groups) for m in case.material])
        joints = tuple(_joint(space, case, record) for record in (*case.contact, *case.tie))
        return cls(case, space, materials, Constraints.of(space, case), joints)

    @cached_property
    def K(self) -> csr_array:
        """(n_dof, n_dof): stiffness of the bodies and of springs to the ground."""
        K = csr_array(assemble_stiffness(self.space, self.materials, self.threads).tocsr())
        return K if self.springs is None else csr_array(K + self.springs)

    @cached_property
    def springs(self) -> csr_array | None:
        """(n_dof, n_dof): springs to the ground; None if there are none."""
        made = None
        for spring in self.case.spring:
            stiffness = [getattr(spring, f"k{a}") or 0.0 for a in AXES[: self.space.dim]]
            own = loads.springs(self.space, nodes_of(self.space, spring), stiffness)
            made = own if made is None else csr_array(made + own)
        return made

    @property
    def threads(self) -> int:
        """Cores to use."""
        return self.case.solver.threads or available_threads()

    def temperature(self, t: float) -> Temperature | None:
        """What `assemble.stress` takes: (value, cells) of each [[temperature]], numbers ramped from the reference."""
        if not self.case.temperature:
            return None
        return [(fixed, cells) for record in self.case.temperature for fixed, cells in self._ramped(record, t)]

    def _ramped(self, record, t: float):
        """A temperature on the cells of each law apart, since a ramp starts from the law's reference."""
        mesh = self.space.mesh
        chosen = self.space.cells(record.groups)
        for k, law in enumerate(self.materials.laws):
            ours = np.zeros(mesh.n_cells, bool)
            for block, which in zip(self.space.blocks, self.materials.law, strict=True):
                ours[block.cell[which == k]] = True
            cells = chosen[ours[chosen]]
            if len(cells):
                start = law.reference_temperature
                yield (lambda x, t, v=record.value, s=start: v(x[:, : self.space.dim], t, start=s)), cells

    def load(self, t: float) -> NDArray[np.floating]:
        """f (n_dof,): nodal forces of everything that acts at time t."""
        space, case, dim = self.space, self.case, self.space.dim
        mesh, f = space.mesh, np.zeros(space.n_dof)
        for p in case.pressure:
            f += loads.pressure(space, mesh.cells_of(p.group), self._at(p.value), t)
        for q in case.traction:
            f += loads.traction(space, mesh.cells_of(q.group), self._traction(q), t)
        for force in case.force:
            f += loads.nodal_force(space, nodes_of(space, force), self._vector(force, "f"), t)
        for b in case.body_force:
            f += loads.body_force(space, self._vector(b, "f"), t, cells=space.cells(b.groups))
        if case.gravity is not None:
            f += loads.gravity(space, self.materials, self._vector(case.gravity, "g"), t)
        temperature = self.temperature(t)
        if temperature is not None:
            f += loads.thermal_force(space, self.materials, temperature, t, threads=self.threads)
        assert f.shape == (dim * mesh.n_nodes,)
        return f

    def _at(self, value: Value) -> Callable[[Floats, float], Floats]:
        """A value as loads take it: of points with three coordinates."""
        return lambda x, t: value(x[:, : self.space.dim], t)

    def _vector(self, record: object, letter: str) -> list:
        values = [getattr(record, f"{letter}{a}") for a in AXES[: self.space.dim]]
        return [0.0 if v is None else self._at(v) for v in values]

    def _traction(self, record):
        values = [getattr(record, f"t{a}") for a in AXES[: self.space.dim]]
        dim = self.space.dim

        def traction(x: Floats, n: Floats, t: float) -> Floats:
            told = [
                np.zeros(len(x)) if v is None else v(x[:, :dim], t, normals=n[:, :dim]) for v in values
            ]
            return np.stack(told, axis=1)

        return traction


def available_threads() -> int:
    """Cores that this process may use."""
    import os

    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _joint(space: Space, case: Case, record: Contact | Tie) -> Joint:
    zone = Zone.of(space.mesh, record.slave, record.master, record.name)
    common = {
        "search_distance": record.search_distance,
        "axisymmetric": space.model.axisymmetric,
        "thickness": space.thickness,
    }
    if isinstance(record, Tie):
        return Joint(record, zone, Pairing(**common))
    clearance = record.clearance
    if clearance.depends_on_place or clearance.depends_on_time:
        value = lambda x, t: clearance(x[:, : space.dim], t)  # noqa: E731
    else:
        value = clearance.at(0.0)
    return Joint(
        record,
        zone,
        Pairing(
            normals=record.normals, crease_angle=record.crease_angle, measure=record.measure, clearance=value, **common
        ),
    )
