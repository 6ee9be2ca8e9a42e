"""The problem of a case: its mesh, cut where it has to be, and all that stays the same from step to step.

mesh -> space, materials -> kinematics; constraints; joints; loads. What changes is found by `march`.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

import lacmesh
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacmesh.mesh import Floats, Mesh
from lacmesh.quality.kernels import available_cores
from lacsolver.bodies.finite import locking
from lacsolver.bodies.kinematics import Kinematics, kinematics_of
from lacsolver.bodies.material import Materials
from lacsolver.case import Case, Contact, Tie, check_groups
from lacsolver.constraints import Constraints
from lacsolver.contact import Interface, Pairing, Zone
from lacsolver.problem import acting
from lacsolver.problem.laws import law_of
from lacsolver.problem.skin import check_mesh, prepared
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: what rounding leaves of a coverage
_ROUNDING = 1e-9


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
    def initial(self) -> str:
        """Which of its rows are closed at the start: `all`, `none`, or those without a gap (`gap`)."""
        return self.record.initial if isinstance(self.record, Contact) and self.one_sided else "all"

    @property
    def timed(self) -> bool:
        """Whether the clearance changes with time."""
        return isinstance(self.record, Contact) and self.record.clearance.depends_on_time

    @property
    def moving(self) -> bool:
        """Whether the zone is paired again on the deformed skins."""
        return isinstance(self.record, Contact) and self.record.geometry == "current"

    def places(self, space: Space, u: Floats) -> NDArray[np.floating]:
        """(n_nodes, 3): where the skins meet when displaced by u (n_dof,): there if they move, else where they were.

        Counted from the space's origin.
        """
        return space.places(u) if self.moving else space.local.points

    def paired(self, face: Interface) -> NDArray[np.bool_]:
        """(n_macros,): which macro-elements of an interface of the zone have enough of the master in front of them.

        Those without any never do. What rounding leaves of a coverage is not asked for: all of it is 1.
        """
        coverage = face.coverage
        return np.asarray((coverage >= self.record.coverage_threshold - _ROUNDING) & (coverage > 0))

    def check_facing(self, face: Interface) -> None:
        """Raises CaseError where no macro-element has a master and, since the skins stay where they are, none will."""
        if not self.moving and not self.paired(face).any():
            message = f"no face of slave {self.record.slave!r} has master {self.record.master!r} in front of it"
            advice = "check which groups these are and that their faces turn outward, or raise search_distance"
            raise wrong(self.record, f"{message}; {advice}")


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
        mesh = lacmesh.read(case.mesh) if mesh is None else mesh
        check_groups(case, mesh)
        check_mesh(case, mesh)
        mesh = prepared(case, mesh)
        space = Space.of(mesh, case.model, case.thickness)
        materials = materials_of(case, space)
        joined: tuple[Contact | Tie, ...] = (*case.contact, *case.tie)
        joints = tuple(joint_of(space, record) for record in joined)
        return cls(case, space, materials, Constraints.of(space, case), joints)

    @cached_property
    def kinematics(self) -> Kinematics:
        """How the bodies, and springs to the ground, answer a displacement."""
        temperature = acting.temperature(self.space, self.materials, self.case)
        return kinematics_of(
            self.case.kinematics, self.space, self.materials,
            springs=self.springs, temperature=temperature, threads=self.threads,
        )  # fmt: skip

    @cached_property
    def springs(self) -> csr_array | None:
        """(n_dof, n_dof): springs to the ground; None if there are none."""
        return acting.springs(self.space, self.case)

    @property
    def threads(self) -> int:
        """Cores to use: those asked for, as far as the process may use them, or all of these."""
        return min(self.case.solver.threads or available_cores(), available_cores())

    def load(self, t: float, u: Floats | None = None) -> NDArray[np.floating]:
        """f (n_dof,): nodal forces of everything that acts at time t; followers find their faces at u (n_dof,)."""
        return acting.load(self.space, self.materials, self.case, t, self.threads, u=u)


def materials_of(case: Case, space: Space) -> Materials:
    """The laws of a case on its cells; warns of those that lock under finite kinematics.

    Raises CaseError, DataError and RequestError as `Materials.of` and the laws do.
    """
    materials = Materials.of(space, [(law_of(m), m.groups) for m in case.material])
    if case.kinematics == "finite":
        for told in locking(space, materials):
            warnings.warn(LacmeshWarning(told), stacklevel=3)
    return materials


def zone_of(mesh: Mesh, record: Contact | Tie) -> Zone:
    """The zone of a contact or a tie. Raises as `Zone.of`."""
    return Zone.of(
        mesh, record.slave, record.master, record.name, surface=record.surface, crease_angle=record.crease_angle
    )


def joint_of(space: Space, record: Contact | Tie) -> Joint:
    """The joint of a contact or a tie. Raises CaseError, with its line, where the two groups make no zone."""
    try:
        zone = zone_of(space.local, record)
    except LacmeshError as error:
        raise wrong(record, str(error)) from None
    if isinstance(record, Tie):
        pairing = Pairing()
    else:
        value = record.clearance
        fixed = not (value.depends_on_place or value.depends_on_time)
        clearance = value.at(0.0) if fixed else acting.at_local_points(space, value)
        pairing = Pairing(
            record.normals, record.crease_angle, max_penetration=record.max_penetration, measure=record.measure,
            clearance=clearance,
        )  # fmt: skip
    return Joint(record, zone, pairing.within(space, record.search_distance))
