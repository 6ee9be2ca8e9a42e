"""The boundary value problem of a case: its mesh, cut where necessary, and everything that is constant over the steps.

mesh -> space, materials -> kinematics; constraints; contact pairs; loads. `build` goes through these stages, for a run
and for a validation alike; `march` solves for the rest.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import DataError, LacmeshWarning, RequestError
from lacmesh.facts import Described
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.threads import available_cores
from lacsolver.bodies.kinematics import Kinematics, kinematics_of
from lacsolver.bodies.material import Materials
from lacsolver.case import Case, CaseError, Contact, Displacement, Rigid, Tie, check_groups
from lacsolver.case.errors import Issue
from lacsolver.constraints import Constraints, constraints_of, equalities_of
from lacsolver.constraints.coupling import rigid_records
from lacsolver.constraints.equality_rows import EqualityRows
from lacsolver.constraints.equations import Equations
from lacsolver.constraints.of_case import equations_of, joining, node_sets
from lacsolver.constraints.pretension import BoltSection, section_of, sides_of
from lacsolver.distributed.share import ALONE, UNDIVIDED, Distribution, Share
from lacsolver.problem.adjust import Adjustment, adjusted
from lacsolver.problem.laws import law_of
from lacsolver.problem.loads import Loads, temperature_of
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.roles import directed, slaves_of, with_roles
from lacsolver.problem.sections import with_sections
from lacsolver.problem.skin import check_mesh, check_mesh_file, mesh_of, prepared
from lacsolver.problem.springs import line_springs, springs_of
from lacsolver.space.places import nodes_of, said, wrong
from lacsolver.space.space import Space, check_dimension
from lacsolver.space.thickness import thickness_of

if TYPE_CHECKING:
    from lacsolver.problem.inertia import Inertia

#: nodes of the largest model whose fields are gathered on one process for MED: some 2 GB of fields and mesh
MED_NODES = 5_000_000


@dataclass(frozen=True, eq=False, repr=False)
class Problem(Described):
    """The problem of a case on its mesh; built by `Problem.of`. `joints`: contacts, then ties, in the case's order.

    `adjusted`: by contact, how far slave nodes were moved onto the master in the mesh of `space`.

    >>> from lacsolver import read_case
    >>> problem = Problem.of(read_case("data/two_blocks.toml"))
    >>> problem.space.n_dof, [pair.name for pair in problem.joints]
    (1536, ['joint'])
    """

    case: Case
    space: Space
    materials: Materials
    constraints: Constraints
    joints: tuple[ContactPair, ...]
    source: Mesh | None = None
    adjusted: Mapping[str, Adjustment] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        case: Case,
        mesh: Mesh | None = None,
        distribution: Distribution = UNDIVIDED,
        like: Problem | None = None,
    ) -> Problem:
        """Read the mesh of a case (or take `mesh`), cut slaves that are not cut, and check everything against the case.

        `distribution`: the processes that share the model; each gets the problem of its own part. `like`: another
        problem, whose parts are taken where they are the same.
        Raises CaseError, ReadError, CutError, DataError, RequestError, each with a sentence for the user.
        """
        source = read_mesh(case, distribution) if mesh is None else mesh
        parts = build(case, source, distribution=distribution, like=like)
        assert parts.space is not None and parts.materials is not None and parts.constraints is not None
        pairs = tuple(parts.pairs)
        return cls(parts.case, parts.space, parts.materials, parts.constraints, pairs, source, parts.adjusted)

    def shares_bodies_with(self, other: Problem) -> bool:
        """True if another problem has the same bodies: cells, materials, springs and temperatures."""
        same = all(getattr(self.case, name) == getattr(other.case, name) for name in ("spring", "temperature", "steps"))
        return same and self.space is other.space and self.materials is other.materials

    @cached_property
    def kinematics(self) -> Kinematics:
        """Internal forces, tangent, stress and energy of the bodies and the springs."""
        temperature = temperature_of(self.space, self.materials, self.case.temperature)
        lines = line_springs(self.space, self.case) if self.case.kinematics == "finite" else None
        springs = self.springs if lines is None else springs_of(self.space, self.case, along_lines=False)
        return kinematics_of(
            self.case.kinematics, self.space, self.materials,
            springs=springs, lines=lines, temperature=temperature, threads=self.threads,
        )  # fmt: skip

    @cached_property
    def equalities(self) -> tuple[EqualityRows, ...]:
        """Rows of equality, with multipliers. Raises CaseError for mistakes in their records."""
        return equalities_of(self.constraints, self.case)

    @cached_property
    def sections(self) -> tuple[BoltSection, ...]:
        """Sections of bolts, in the order of [[pretension]]."""
        return tuple(section_of(self.space, record) for record in self.case.pretension)

    @cached_property
    def probes(self) -> dict[str, Ints]:
        """Nodes (k,) of each probe, by its name."""
        return {probe.name: nodes_of(self.space, probe) for probe in self.case.probe}

    @cached_property
    def springs(self) -> csr_array | None:
        """Stiffness (n_dof, n_dof) of all springs, undeformed; None if there are none."""
        return springs_of(self.space, self.case)

    @cached_property
    def inertia(self) -> Inertia | None:
        """Mass of the nodes and of rigid bodies; None without [dynamics]."""
        if self.case.dynamics is None:
            return None
        from lacsolver.problem.inertia import Inertia

        zones = [pair.zone for pair in self.joints]
        return Inertia.of(
            self.space, self.materials, self.constraints, zones, self.case.dynamics, self.case.kinematics == "finite"
        )

    @cached_property
    def loads(self) -> Loads:
        """All loads but springs and loads on rigid bodies. Raises CaseError for mistakes in their records."""
        weight = None if self.inertia is None else self.inertia.weight
        return Loads.of(self.space, self.materials, self.case, weight=weight, threads=self.threads)

    @property
    def threads(self) -> int:
        """Number of cores to use: that of the case, at most those available to the process, which are the default."""
        return min(self.case.solver.threads or available_cores(), available_cores())

    def load(self, t: float, u: Floats | None = None) -> NDArray[np.floating]:
        """Return the nodal forces f (n_dof,) of all loads at time t, with the faces of follower loads at u (n_dof,)."""
        return self.loads.force(t, u)


#: context of one stage, which may keep the errors raised in it; `place`: file and line of the record concerned
Attempt = Callable[[str], AbstractContextManager[None]]


@dataclass
class ProblemParts:
    """Parts of a problem as `build` returns them: the mesh, cut if `prepared`; others are None where they failed.

    `case`: with the roles of all surfaces, if they could be chosen. `equations`: those to eliminate, for several
    processes only, which cannot make them of their parts.
    """

    case: Case
    mesh: Mesh
    prepared: bool = False
    space: Space | None = None
    equations: tuple[Equations, ...] | None = None
    materials: Materials | None = None
    constraints: Constraints | None = None
    pairs: list[ContactPair] = field(default_factory=list)
    adjusted: Mapping[str, Adjustment] = field(default_factory=dict)


def build(
    case: Case,
    mesh: Mesh,
    attempt: Attempt | None = None,
    *,
    bodies: bool = True,
    distribution: Distribution = UNDIVIDED,
    like: Problem | None = None,
) -> ProblemParts:
    """Build the parts of a case's problem stage by stage: for a run, for a validation, and for contact matrices.

    `attempt`: context of each stage; by default the first error is raised, and the stages after one that they depend on
    are left out if it was kept. `bodies`: False for the contact pairs alone, without materials and constraints. `like`:
    another problem, whose space, materials and pairs are taken where they are the same.
    """
    attempt = attempt or (lambda place: nullcontext())
    parts, source, usable = ProblemParts(case, mesh), mesh, False
    with attempt(""):
        _check_divided(case, distribution)
        parts.mesh = mesh = with_sections(case, mesh)
        if distribution is UNDIVIDED:
            named = f" {case.mesh.name}" if isinstance(case.mesh, Path) else ""
            check_dimension(mesh, case.model, f"the mesh{named}")
        check_groups(case, mesh)
        parts.case = case = with_roles(case, distribution.as_read(mesh)[0])
        _check_divided(case, distribution)
        usable = True
    if not usable:
        return parts
    if like is not None and _same_space(case, source, like, distribution):
        parts.mesh, parts.prepared, parts.space = like.space.mesh, True, like.space
        parts.adjusted = like.adjusted
    else:
        like = None
        _space(case, parts, attempt, distribution)
    if parts.space is not None and bodies:
        with attempt(""):
            kept = like is not None and (case.material, case.kinematics) == (like.case.material, like.case.kinematics)
            parts.materials = like.materials if like and kept else materials_of(case, parts.space)
        parts.constraints = _constraints(case, parts.space, attempt, parts.equations)
    if parts.space is not None and parts.prepared:
        pairs = like.joints if like is not None else ()
        records: tuple[Contact | Tie, ...] = (*case.contact, *case.ties)
        for record in records:
            with attempt(record.place):
                same = next((pair for pair in pairs if pair.record == record), None)
                pair = same or ContactPair.of(parts.space, record)
                parts.pairs.append(directed(pair, case, parts.mesh))
    return parts


def _same_space(case: Case, mesh: Mesh, like: Problem, distribution: Distribution) -> bool:
    """True if a problem has the space of this case on this mesh: the same model, slaves and masters."""

    def settings(case: Case) -> tuple:
        pairs = (*case.contact, *case.ties)
        skins = [(pair.slave, pair.master, pair.hexa, pair.macro) for pair in pairs]
        rims = [*(pair.crease_angle for pair in pairs), *(record.group for record in case.displacement)]
        stars = any(pair.macro == "stars" for pair in pairs) and rims
        moves = [(record.adjust, record.surface, record.crease_angle) for record in case.contact if record.adjust]
        return case.model, case.thickness, skins, stars, moves, [record.group for record in case.pretension]

    return distribution is UNDIVIDED and like.source is mesh and settings(case) == settings(like.case)


def _space(case: Case, parts: ProblemParts, attempt: Attempt, distribution: Distribution) -> None:
    """Check and cut the mesh of `parts`, move its slave nodes onto their masters, and make its space."""
    with attempt(""):
        check_mesh(case, parts.mesh)
    with attempt(""):
        parts.mesh = prepared(case, parts.mesh)
        parts.prepared = True
    with attempt(""):
        if distribution is not UNDIVIDED and any(joining(case)):
            _joined_space(case, parts, distribution)
        else:
            parts.mesh, share = distribution.take(parts.mesh, case.skins)
            parts.mesh, parts.adjusted = adjusted(case, parts.mesh, share.origin)
            parts.space = _space_of(case, parts.mesh, share)
        assert parts.space is not None
        if parts.space.share.own is not None:
            _check_shared(case, parts.space.share)


def _space_of(case: Case, mesh: Mesh, share: Share = ALONE) -> Space:
    """Return the space of a case on a mesh. Raises CaseError for cells without a thickness, or with several."""
    try:
        thickness_of(mesh, case.model, case.thickness)
    except DataError as error:
        raise CaseError([Issue(f"{case.before('thickness')}: {error}")]) from None
    return Space.of(mesh, case.model, case.thickness, share)


def _joined_space(case: Case, parts: ProblemParts, distribution: Distribution) -> None:
    """Make the space of this process for a case that joins nodes, and its equations, of those of the whole mesh."""
    parts.mesh, parts.adjusted = adjusted(case, parts.mesh, None)
    whole = _space_of(case, parts.mesh)
    equations = equations_of(whole, case)
    sides = [side for record in case.pretension for side in sides_of(parts.mesh, record)]
    sets = node_sets(whole, case, equations)
    parts.mesh, share = distribution.take(parts.mesh, [*case.skins, *sides], sets)
    parts.space = _space_of(case, parts.mesh, share)
    if share.node is not None:
        equations = tuple(one.on(whole.dofs(share.node).ravel()) for one in equations)
    parts.equations = equations


def _check_divided(case: Case, distribution: Distribution) -> None:
    """Raise CaseError for records that join nodes of a mesh that was divided without them."""
    for record in joining(case) if distribution.divided else ():
        message = "it joins nodes, which must belong to one process, and the mesh was divided without it"
        raise wrong(record, f"{message}; name the mesh file itself, not the folder of its parts")


def _check_shared(case: Case, share: Share) -> None:
    """Raise RequestError for what one process does alone: springs between nodes, whole rings, MED of a large model."""
    if any(record.ring for record in case.cyclic):
        raise RequestError("[[cyclic]] ring = true is written by one process only; leave it out, or run in one")
    if any(record.to is not None for record in case.spring):
        raise RequestError("a [[spring]] between two nodes (to) is computed by one process only; run in one")
    assert share.node is not None
    n = int(share.largest(float(share.node.max(initial=-1)))) + 1
    if case.output.format == "med" and n > MED_NODES:
        message = f'[output] format = "med" of several processes is gathered on one, for at most {MED_NODES:,} nodes'
        raise RequestError(f'{message}, and the mesh has {n:,}; take format = "vtu", of which each writes its own part')


def read_mesh(case: Case, distribution: Distribution = UNDIVIDED) -> Mesh:
    """Return the mesh of a case, or this process's part of it. Raises ReadError, RequestError, CutError."""
    if not isinstance(case.mesh, Path):
        return mesh_of(case)
    check_mesh_file(case)
    whole = bool(case.cyclic) or any(joining(case))
    return distribution.read(case.mesh, case.skins, lambda mesh: slaves_of(case, mesh), whole)


def _constraints(
    case: Case, space: Space, attempt: Attempt, equations: tuple[Equations, ...] | None
) -> Constraints | None:
    """Return the constraints; None if the nodes of a prescribed record are not found, or if they contradict."""
    placed: tuple[Displacement | Rigid, ...] = (*case.displacement, *rigid_records(case))
    there = []
    for record in placed:
        with attempt(""):
            there.append(nodes_of(space, record))
            if isinstance(record, Displacement):
                _tell_of_no_body(space, record, there[-1])
    if len(there) == len(placed):
        with attempt(""):
            return constraints_of(space, case, equations)
    return None


def _tell_of_no_body(space: Space, record: Displacement, nodes: Ints) -> None:
    """Warn of a displacement without effect, as of faces whose body's cells the mesh lacks."""
    if not space.share.largest(float(space.attached[nodes].any())):
        message = (
            f"{said(record)} has no effect: none of its nodes belongs to a cell of a body; were the cells behind them"
        )
        warnings.warn(
            LacmeshWarning(f"{message} saved with the mesh? A surface without them is rigid and at rest"), stacklevel=3
        )


def materials_of(case: Case, space: Space) -> Materials:
    """Return the laws of a case on its cells.

    Raises CaseError, DataError and RequestError as `Materials.of` and the laws do.
    """
    return Materials.of(space, [(law_of(m, case.kinematics), m.groups) for m in case.material])
