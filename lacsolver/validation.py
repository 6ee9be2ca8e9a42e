"""Validation of a case on its mesh: every mistake that would prevent a run, at once, and the sizes of the problem.

The problem is built by the same stages as for a run (`problem.build`), which here go on after an error if they do not
depend on what failed, so that one validation reports all mistakes; then come loads, zones and rigid-body motions.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array, vstack

from lacmesh.cutting.records import Cut, is_cut
from lacmesh.errors import LacmeshError, LacmeshWarning, RequestError
from lacmesh.facts import Described, listed
from lacmesh.mesh import Mesh, MeshLike
from lacsolver.case import Case, CaseError, Issue, as_case
from lacsolver.constraints import Constraints, equalities_of
from lacsolver.constraints.equality_rows import EqualityRows, Free
from lacsolver.contact import Interface
from lacsolver.distributed.launch import absence
from lacsolver.doubts.overlap import covered_part, deepest_overlap, widest_gap
from lacsolver.doubts.rules import asked, texts_of
from lacsolver.doubts.run import Run
from lacsolver.linear import choose
from lacsolver.problem.adjust import Adjustment
from lacsolver.problem.first_look import MotionFound, motion_found
from lacsolver.problem.loads import Loads, load_of, load_records
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.problem import Problem, ProblemParts, build
from lacsolver.problem.resultants import Resultant, resultants
from lacsolver.problem.rigid_modes import FreeMotion, describe, free_motions, still_free, unheld
from lacsolver.problem.skin import mesh_of
from lacsolver.problem.springs import springs_of
from lacsolver.space.places import nodes_of
from lacsolver.space.space import Space

#: rules that are asked: those before a run, and what a run finds out at its end
_BEFORE = ("undeformed", "guess")
#: a motion that the pressures of contact do not resist
_FRICTION_ALONE = "{}, which friction alone resists"


@dataclass(frozen=True)
class ZoneFound:
    """A zone in the undeformed configuration.

    `macros`: number of macro-elements; `unpaired`: number of those that are not paired; `covered`: fraction of the
    slave's area. `gap`: least and largest mean gap of paired macro-elements, clearance included; NaN if there are none.
    `overlap`: largest penetration of the slave into the master, 0 without overlap; `bridged`: widest gap across a tie.
    `why`: why the slave was chosen, "" where the case says which it is. `told`: warnings. `adjusted`: how far slave
    nodes were moved onto the master, None where the case does not ask for it; the other figures are of the mesh after
    that.
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
    why: str = ""
    told: tuple[str, ...] = ()
    adjusted: Adjustment | None = None
    bridged: float = float("nan")


@dataclass(repr=False)
class Validation(Described):
    """Result of a validation.

    `mesh`: the cut mesh; `cut_here`: True if the cut was made here and not read from the file; `stars_here`: True if
    all macro-elements are stars, made here without a cut; `whole`: True if each slave face is a macro-element by
    itself, so that nothing has to be cut; `unknowns`: number of unknowns q.

    `held`: rigid-body motions that only contact constrains, in words; `motion`: figures of a case with [dynamics].
    `loads`: resultant of each load at the end of the steps, with follower loads on the undeformed faces.
    `problems`: mistakes that would prevent a run.
    """

    mesh: Mesh
    cut_here: bool = False
    stars_here: bool = False
    whole: bool = False
    dim: int = 0
    unknowns: int = 0
    zones: list[ZoneFound] = field(default_factory=list)
    held: list[str] = field(default_factory=list)
    motion: MotionFound | None = None
    loads: tuple[Resultant, ...] = ()
    problems: list[Issue] = field(default_factory=list)

    def _facts(self) -> dict[str, str]:
        problems = {f"problem {k}": one.message for k, one in enumerate(self.problems[:4], start=1)}
        if len(self.problems) > len(problems):
            problems["problems"] = f"{len(self.problems) - len(problems)} more"
        mesh = f"{self.mesh.n_nodes:,} nodes{', cut here' if self.cut_here else ''}"
        facts = {"mesh": mesh, "unknowns": f"{self.unknowns:,}", "contact": listed(one.name for one in self.zones)}
        return {**(problems or {"problems": "none"}), **facts, "held": listed(self.held) or "none"}

    @contextmanager
    def looking(self, place: str = "") -> Iterator[None]:
        """Collect errors in this context; `place`: file and line of the record, for messages that do not name it."""
        try:
            yield
        except LacmeshError as error:
            lines = str(error).splitlines() if isinstance(error, CaseError) else [str(error)]
            self.problems += [Issue(line if place in line else f"{place}: {line}") for line in lines]


def validate(case: Case | str | Path, mesh: MeshLike | None = None) -> Validation:
    """Check everything that a run of a case needs, without solving it. Raises ReadError for the mesh's file.

    Mistakes are returned in `problems`, and no error is raised for them.

    >>> from lacsolver import read_case
    >>> validate(read_case("data/two_blocks.toml")).problems
    []
    """
    case = as_case(case)
    mesh = mesh_of(case, mesh)
    validation = Validation(mesh)
    parts = build(case, mesh, validation.looking)
    case = parts.case
    validation.mesh, validation.cut_here = parts.mesh, parts.prepared and parts.mesh.n_cells > mesh.n_cells
    validation.stars_here = parts.prepared and is_cut(parts.mesh) and not (is_cut(mesh) or validation.cut_here)
    validation.whole = parts.prepared and _whole(parts.mesh)
    if parts.space is not None:
        validation.dim = parts.space.dim
        _look_at_loads(case, parts, validation)
    if parts.constraints is not None:
        validation.unknowns = parts.constraints.n_q
        with validation.looking():
            _check_solver(case, parts.constraints.n_q)
    if parts.space is not None:
        before = len(validation.problems)
        faces = _zones(parts, validation)
        whole = len(faces) == len(case.contact) + len(case.ties) and len(validation.problems) == before
        if parts.constraints is not None and whole and (case.dynamics is None or case.dynamics.start > 0):
            _look_at_motions(case, parts.constraints, faces, validation)
        run = Run(parts, ())
        with validation.looking():
            if parts.constraints is not None and parts.materials is not None and whole and case.dynamics is not None:
                problem = Problem(case, parts.space, parts.materials, parts.constraints, tuple(parts.pairs))
                validation.motion, run.parts = motion_found(problem), problem
        with validation.looking():
            _look_at_bodies(run, validation)
    validation.problems = list(dict.fromkeys(validation.problems))
    return validation


def _check_solver(case: Case, n: int) -> None:
    """Raise RequestError if the engine or the linear solver of a case is not installed."""
    if case.solver.engine_for(1) == "serial":
        choose(case.solver.backend, n)
    elif missing := absence():
        raise RequestError(missing)


def _whole(mesh: Mesh) -> bool:
    """True if the mesh has macro-elements, each of one face."""
    return is_cut(mesh) and bool(Cut(mesh).n_macros == np.count_nonzero(Cut(mesh).macro_of_face >= 0))


def _look_at_loads(case: Case, parts: ProblemParts, validation: Validation) -> None:
    """Evaluate each load by itself at the first and at the last time."""
    space, materials = parts.space, parts.materials
    if space is None or materials is None:
        return
    before, finite = len(validation.problems), case.kinematics == "finite"
    for record in (*load_records(case), *case.temperature):
        with validation.looking(record.place):
            load = load_of(space, materials, record, finite=finite)
            for t in {case.steps.planned[0], case.steps.last}:
                load.force(t, None)
    if len(validation.problems) == before:
        validation.loads = resultants(Loads.of(space, materials, case), case.steps.last)


def _zones(parts: ProblemParts, validation: Validation) -> list[tuple[ContactPair, Interface]]:
    """Return the contact pairs with their interfaces at the start; add the zones and mistakes to the validation."""
    faces: list[tuple[ContactPair, Interface]] = []
    for pair in parts.pairs:
        run = Run(parts, [pair])
        with validation.looking(pair.record.place):
            zone = replace(_zone_found(run, pair, run.face(pair)), adjusted=parts.adjusted.get(pair.name))
            validation.zones.append(zone)
            faces.append((pair, run.face(pair)))
            doubts = [doubt for doubt in asked(run, *_BEFORE) if doubt.record is pair.record]
            validation.zones[-1] = replace(zone, told=tuple(doubt.text for doubt in doubts if not doubt.fatal))
            texts_of(doubt for doubt in doubts if doubt.fatal)
    return faces


def _look_at_bodies(run: Run, validation: Validation) -> None:
    """Warn of doubts about the case as a whole; add those about its motion to the validation."""
    doubts = list(asked(run, *_BEFORE))
    if validation.motion is not None:
        told = tuple(doubt.text for doubt in doubts if doubt.record is run.parts.case.dynamics)
        validation.motion = validation.motion._replace(told=told)
    for doubt in doubts:
        if doubt.record is None:
            warnings.warn(LacmeshWarning(doubt.text), stacklevel=3)


def _zone_found(run: Run, pair: ContactPair, face: Interface) -> ZoneFound:
    record, on = pair.record, pair.above_threshold(face)
    gap = face.gap[on] if on.any() else np.array([np.nan])
    return ZoneFound(
        record.name, pair.tie, record.slave, record.master, len(on), int((~on).sum()),
        covered_part(face), (float(gap.min()), float(gap.max())), deepest_overlap(run, pair), record.why,
        bridged=widest_gap(run, pair) if pair.tie else float("nan"),
    )  # fmt: skip


def _look_at_motions(
    case: Case, constraints: Constraints, faces: list[tuple[ContactPair, Interface]], validation: Validation
) -> None:
    """Find rigid-body motions that only contact constrains, and report those that nothing constrains as a mistake."""
    space = constraints.space
    springs = None
    for probe in case.probe:
        with validation.looking():
            nodes_of(space, probe)
    with validation.looking():
        springs = springs_of(space, case)
    if case.spring and springs is None:  # a mistake that is told already: what the springs hold is not known
        return
    equalities: tuple[EqualityRows, ...] = ()
    with validation.looking():
        equalities = equalities_of(constraints, case)
    motions = free_motions(space, constraints, springs)
    if not motions:
        return
    nothing = np.zeros(space.n_dof)
    rows = [one.at(nothing, 0.0).C for one in equalities if not isinstance(one.law(0.0), Free)]
    joined = csr_array(vstack([csr_array((0, space.n_dof)), *rows]))
    B = csr_array(vstack([joined, *(_paired_rows(joint, face) for joint, face in faces)]))
    free = still_free(B, motions)
    if free:
        validation.problems.append(Issue(unheld(free)))
    else:
        motions = still_free(joined, motions) if rows else motions
        by_friction = _by_friction(space, faces, motions)
        words = [describe(motion) for motion in motions]
        validation.held = [*(w for w in words if w not in by_friction), *map(_FRICTION_ALONE.format, by_friction)]


def _by_friction(
    space: Space, faces: Sequence[tuple[ContactPair, Interface]], motions: Sequence[FreeMotion]
) -> list[str]:
    """Return the rigid-body motions, in words, that friction alone resists."""
    if all(face.B_T is None for _, face in faces):
        return []
    pressing = csr_array(vstack([csr_array((0, space.n_dof)), *(_normal_rows(*one) for one in faces)]))
    return [describe(motion) for motion in still_free(pressing, motions)]


def _paired_rows(joint: ContactPair, face: Interface) -> csr_array:
    rows = _normal_rows(joint, face)
    if face.B_T is None:
        return rows
    on = np.repeat(joint.above_threshold(face), face.B_T.shape[0] // len(face.w))
    return csr_array(vstack([rows, face.B_T[np.flatnonzero(on)]]))


def _normal_rows(joint: ContactPair, face: Interface) -> csr_array:
    on = joint.above_threshold(face)
    return csr_array(face.B[np.flatnonzero(np.repeat(on, len(face.G) // len(on)))])
