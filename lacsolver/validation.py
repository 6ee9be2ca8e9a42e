"""Validation of a case on its mesh: every mistake that would prevent a run, at once, and the sizes of the problem.

groups -> mesh cut -> space -> laws, places, loads -> zones paired -> rigid-body motions. A stage is left out if one
that it depends on has failed; the others are run in any case, so that one validation reports all mistakes.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array, vstack

import lacmesh
from lacmesh.cutting.records import Cut, is_cut
from lacmesh.errors import LacmeshError
from lacmesh.mesh import Mesh
from lacsolver.case import Case, CaseError, Contact, Displacement, Issue, Rigid, Tie, check_groups
from lacsolver.case.records import Entry
from lacsolver.constraints import Constraints
from lacsolver.contact import Interface
from lacsolver.linear import choose
from lacsolver.problem import acting
from lacsolver.problem.overlap import check_overlap, deepest
from lacsolver.problem.problem import ContactPair, joint_of, materials_of
from lacsolver.problem.rigid_modes import describe, free_motions, still_free
from lacsolver.problem.skin import check_mesh, prepared
from lacsolver.space.places import nodes_of
from lacsolver.space.space import Space

#: sections whose records are loads, each evaluated by itself
_LOADS = ("pressure", "traction", "force", "body_force", "temperature")


@dataclass(frozen=True)
class ZoneFound:
    """A zone in the undeformed configuration.

    `macros`: number of macro-elements; `unpaired`: number of those that are not paired; `covered`: fraction of the
    slave's area. `gap`: least and largest mean gap of paired macro-elements, clearance included; NaN if there are none.
    `overlap`: largest penetration of the slave into the master, 0 without overlap.
    """

    name: str
    tie: bool
    slave: str
    master: str
    macros: int
    unpaired: int
    covered: float
    gap: tuple[float, float]
    overlap: float = 0.0


@dataclass
class Validation:
    """Result of a validation.

    `mesh`: the cut mesh; `cut_here`: True if the cut was made here and not read from the file; `whole`: True if each
    slave face is a macro-element by itself, so that nothing has to be cut; `unknowns`: number of unknowns q.

    `held`: rigid-body motions that only contact constrains, in words. `problems`: mistakes that would prevent a run.
    """

    mesh: Mesh
    cut_here: bool = False
    whole: bool = False
    dim: int = 0
    unknowns: int = 0
    zones: list[ZoneFound] = field(default_factory=list)
    held: list[str] = field(default_factory=list)
    problems: list[Issue] = field(default_factory=list)

    @contextmanager
    def looking(self, place: str = "") -> Iterator[None]:
        """Collect errors in this context; `place`: file and line of the record, for messages that do not name it."""
        try:
            yield
        except LacmeshError as error:
            lines = str(error).splitlines() if isinstance(error, CaseError) else [str(error)]
            self.problems += [Issue(line if place in line else f"{place}: {line}") for line in lines]


def validate(case: Case, mesh: Mesh | None = None) -> Validation:
    """Check everything that a run of a case needs, without solving it. Raises ReadError for the mesh's file.

    Mistakes are returned in `problems`, and no error is raised for them.

    >>> from lacsolver import read_case
    >>> validate(read_case("data/two_blocks.toml")).problems
    []
    """
    mesh = lacmesh.read(case.mesh) if mesh is None else mesh
    found = Validation(mesh)
    with found.looking():
        check_groups(case, mesh)
    if not found.problems:
        _look(case, found)
    found.problems = list(dict.fromkeys(found.problems))
    return found


def _look(case: Case, found: Validation) -> None:
    """Check everything except the names of groups."""
    before = found.mesh
    with found.looking():
        check_mesh(case, before)
    with found.looking():
        found.mesh = prepared(case, before)
    cut = not found.problems
    found.cut_here = found.mesh.n_cells > before.n_cells
    found.whole = cut and _whole(found.mesh)
    space = None
    with found.looking():
        space = Space.of(found.mesh, case.model, case.thickness)
    if space is None:
        return
    found.dim = space.dim
    _look_at_laws_and_loads(case, space, found)
    constraints = _constraints(case, space, found)
    if constraints is not None:
        found.unknowns = constraints.n_q
        with found.looking():
            choose(case.solver.backend, constraints.n_q)
    if cut:
        before_zones = len(found.problems)
        faces = _zones(case, space, found)
        if constraints is not None and len(found.problems) == before_zones:
            _look_at_motions(case, constraints, faces, found)


def _whole(mesh: Mesh) -> bool:
    """True if the mesh has macro-elements, each of one face."""
    return is_cut(mesh) and Cut(mesh).n_macros == np.count_nonzero(Cut(mesh).macro_of_face >= 0)


def _look_at_laws_and_loads(case: Case, space: Space, found: Validation) -> None:
    materials = None
    with found.looking():
        materials = materials_of(case, space)
    none: dict[str, Any] = {**dict.fromkeys(_LOADS, ()), "gravity": None}
    bare = replace(case, **none)
    parts: list[tuple[Entry, dict[str, Any]]]
    parts = [(record, {name: (record,)}) for name in _LOADS for record in getattr(case, name)]
    if case.gravity is not None:
        parts.append((case.gravity, {"gravity": case.gravity}))
    for record, only in parts if materials is not None else ():
        with found.looking(record.place):
            for t in {case.steps.planned[0], case.steps.last}:
                acting.load(space, materials, replace(bare, **only), t)


def _constraints(case: Case, space: Space, found: Validation) -> Constraints | None:
    """Return the constraints, or None if the nodes of a prescribed record are not found or the constraints fail."""
    before = len(found.problems)
    placed: tuple[Displacement | Rigid, ...] = (*case.displacement, *case.rigid)
    for record in placed:
        with found.looking():
            nodes_of(space, record)
    if len(found.problems) == before:
        with found.looking():
            return Constraints.of(space, case)
    return None


def _zones(case: Case, space: Space, found: Validation) -> list[tuple[ContactPair, Interface]]:
    """Return the contact pairs with their interfaces at the start; add the zones and mistakes to `found`."""
    faces: list[tuple[ContactPair, Interface]] = []
    records: tuple[Contact | Tie, ...] = (*case.contact, *case.tie)
    for record in records:
        with found.looking(record.place):
            joint = joint_of(space, record)
            face = joint.integrate(space, np.zeros(space.n_dof), case.steps.planned[0])
            found.zones.append(_zone_found(joint, face))
            faces.append((joint, face))
            check_overlap(joint, face, space)
            joint.check_facing(face)
    return faces


def _zone_found(joint: ContactPair, face: Interface) -> ZoneFound:
    record, on = joint.record, joint.covered(face)
    gap = face.gap[on] if on.any() else np.array([np.nan])
    return ZoneFound(
        record.name, joint.tie, record.slave, record.master, len(on), int((~on).sum()),
        float(face.w.sum() / face.area.sum()), (float(gap.min()), float(gap.max())), deepest(face),
    )  # fmt: skip


def _look_at_motions(
    case: Case, constraints: Constraints, faces: list[tuple[ContactPair, Interface]], found: Validation
) -> None:
    """Find rigid-body motions that only contact constrains, and report those that nothing constrains as a mistake."""
    space = constraints.space
    springs = None
    for probe in case.probe:
        with found.looking():
            nodes_of(space, probe)
    with found.looking():
        springs = acting.springs(space, case)
    motions = free_motions(space, constraints, springs)
    if not motions:
        return
    B = csr_array(vstack([csr_array((0, space.n_dof)), *(_paired_rows(joint, face) for joint, face in faces)]))
    free = still_free(B, motions)
    if free:
        said = "; ".join(describe(motion) for motion in free)
        message = f"nothing holds a part of the model: {said}; add a displacement, a spring or a contact"
        found.problems.append(Issue(message))
    else:
        found.held = [describe(motion) for motion in motions]


def _paired_rows(joint: ContactPair, face: Interface) -> csr_array:
    on = joint.covered(face)
    return csr_array(face.B[np.flatnonzero(np.repeat(on, len(face.G) // len(on)))])
