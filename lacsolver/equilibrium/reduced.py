"""A problem on its constrained unknowns q: what is constant over its steps.

u = u(q, t) is T q + u0(t), except for finite rotations of rigid bodies; T = du/dq, K_q = T^T K T.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.errors import DataError, LacmeshWarning, some
from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.contact import Interface
from lacsolver.equilibrium.kept_columns import SAVED, KeptColumns, same_entries
from lacsolver.equilibrium.schemes import QuasiStatic, TimeScheme
from lacsolver.equilibrium.stabilization import Stabilization
from lacsolver.linear import Matrix, SingularError, choose
from lacsolver.linear.vectors import WHOLE, BodyVectors, SharedVectors, Vectors
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.problem import Problem
from lacsolver.problem.rigid_modes import (
    FreeMotion,
    body_names,
    free_motions,
    rigid_modes,
    still_free,
    unheld,
)
from lacsolver.saddle.node_blocks import with_held
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_group import Rows
from lacsolver.saddle.stiffness import FactorCache, NodalEmbedding, Stiffness, embed
from lacsolver.space.sparse import joined_columns, sparse

if TYPE_CHECKING:
    from lacsolver.saddle.shared_stiffness import SharedFactors

#: how far a node may be across the axis of symmetry, relative to the bodies' extent
_AXIS = 1e-9
#: extent of a body, relative to the largest, from which on one scale of forces and displacements does for all
_OF_ONE_SIZE = 1e-3


@dataclass(eq=False)
class ReducedProblem:
    """A problem on its constrained unknowns, and the time scheme of its steps.

    `motions`: rigid-body motions that only contact constrains; `stabilization`: theirs, unless the scheme resists rigid
    motion; `length`: size of the coordinates, whose round-off limits the accuracy of gaps.
    """

    problem: Problem
    scheme: TimeScheme = field(default_factory=QuasiStatic)

    def __post_init__(self) -> None:
        self._reference: tuple[csr_array | None, Operator] | None = None
        self._columns: KeptColumns | None = None

    def take_from(self, before: ReducedProblem | None = None) -> None:
        """Take what another static problem has found and what is the same here: stiffness and its factor.

        Results are the same as without it.
        """
        if before is None or self.scheme.resists_rigid_motion or before.scheme.resists_rigid_motion:
            return
        now, then = self.problem, before.problem
        pairs = [pair for pair in now.joints if any(pair is one for one in then.joints) and not pair.timed]
        if not now.shares_bodies_with(then):
            return
        now.__dict__["kinematics"] = then.kinematics
        T, solver = same_entries(now.constraints.T, then.constraints.T), now.case.solver == then.case.solver
        if not (T and solver and self.linear == before.linear):
            return
        names = ("K", "K_q", "motions", "stabilization", "factors", "_whole")
        self.__dict__.update({name: before.__dict__[name] for name in names if name in before.__dict__})
        self._reference = before._reference
        if len(pairs) == len(then.joints) and now.case.steps == then.case.steps:
            self._columns = before._columns

    @cached_property
    def K(self) -> Matrix:
        """Stiffness (n_dof, n_dof) of the undeformed bodies."""
        return self.problem.kinematics.tangent(np.zeros(self.problem.space.n_dof), 0.0)

    @cached_property
    def K_q(self) -> csr_array:
        """Stiffness (n_q, n_q) of the undeformed bodies, T^T K T."""
        return self.problem.constraints.reduced(self.K, self.problem.constraints.T)

    @cached_property
    def motions(self) -> tuple[FreeMotion, ...]:
        """Rigid-body motions that prescribed displacements and springs leave free."""
        return free_motions(self.problem.space, self.problem.constraints, self.problem.springs)

    @cached_property
    def stabilization(self) -> Stabilization:
        """Rigid-body modes that contact alone, or soft springs resist; none if the scheme resists rigid motion."""
        if self.scheme.resists_rigid_motion:
            return Stabilization.none(self.problem.constraints.n_q)
        return Stabilization.of(self.problem, self.motions, self.K, self.linear, self.vectors)

    @cached_property
    def vectors(self) -> Vectors:
        """Operations on vectors of the unknowns q."""
        share, c = self.problem.space.share, self.problem.constraints
        if c.own is not None:
            return SharedVectors(c.own, c.summed, share)
        modes = 0 if self._whole is None else self._whole.modes.shape[1]
        direct = choose(self.problem.case.solver.backend, c.n_q, modes).direct
        if self.body.max(initial=0) and not direct and self._extents.min() < _OF_ONE_SIZE:
            message = f"a body has {self._extents.min():.1e} of the size of the largest one, and multigrid solves all"
            message += " with one accuracy; take a direct [solver] backend, or a model of its own for the small body"
            warnings.warn(LacmeshWarning(message), stacklevel=2)
        return BodyVectors(self.body, self._extents) if direct and self.body.max(initial=0) > 0 else WHOLE

    @cached_property
    def _extents(self) -> Floats:
        """Extent (n_q,) of the body of each unknown, relative to the largest; 1 for those of no node."""
        space, n = self.problem.space, int(self.body.max(initial=-1)) + 2
        first, last = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
        place = self._body_of_dof[:: space.dim]
        np.minimum.at(first, place, space.local.points)
        np.maximum.at(last, place, space.local.points)
        extent = np.linalg.norm(np.maximum(last - first, 0.0), axis=1)[:-1]
        return np.where(extent > 0, extent / max(extent.max(initial=0.0), 1e-300), 1.0)[self.body]

    @cached_property
    def body(self) -> Ints:
        """Number (n_q,) of the body that each unknown moves; bodies that have an unknown in common are one."""
        return joined_columns(self._moved_bodies)

    @cached_property
    def _moved_bodies(self) -> csr_array:
        """Matrix (n_bodies, n_q) with an entry where an unknown moves a node of a body."""
        of_dof = np.repeat(self.problem.space.bodies, self.problem.space.dim)
        on = np.flatnonzero(of_dof >= 0)
        member = sparse((int(of_dof.max(initial=-1)) + 1, len(of_dof)), (of_dof[on], on, 1.0))
        return csr_array(member @ abs(self.problem.constraints.T))

    @cached_property
    def _body_of_dof(self) -> Ints:
        """Number (n_dof,) of the body of each displacement, as `body` counts; the one after the last for others."""
        moved, n = self._moved_bodies, int(self.body.max(initial=-1)) + 1
        some = np.flatnonzero(np.diff(moved.indptr))
        number = np.full(moved.shape[0] + 1, n)
        number[some] = self.body[moved.indices[moved.indptr[some]]]
        return np.repeat(number[self.problem.space.bodies], self.problem.space.dim)

    def largest_forces(self, nodal: Sequence[Floats], own: Sequence[Floats]) -> Floats | float:
        """Return for each unknown the largest of some forces on its body, (n_q,); a number if all are one body.

        nodal (n_dof,): forces on nodes, at supports as well; own (n_q,): forces on unknowns.
        """
        if not isinstance(self.vectors, BodyVectors):
            return max(*map(self.problem.space.largest, nodal), *map(self.vectors.largest, own))
        largest = np.zeros(int(self.body.max(initial=-1)) + 2)
        for place, forces in ((self._body_of_dof, nodal), (self.body, own)):
            for force in forces:
                np.maximum.at(largest, place, np.abs(force))
        return largest[self.body]

    @cached_property
    def factors(self) -> FactorCache | SharedFactors:
        """Factorisation of tangents by the case's backend."""
        solver, constraints = self.problem.case.solver, self.problem.constraints
        if constraints.own is not None:
            from lacsolver.saddle.shared_stiffness import SharedFactors

            return SharedFactors(self.stabilization.R, solver.backend, constraints, self.vectors)
        return FactorCache(self.stabilization.R, solver.backend, self.problem.threads, self._whole, self.vectors)

    def reference(self, matrix: csr_array | None = None) -> Operator:
        """Return the stabilised K_q of the undeformed bodies plus a scheme's matrix (n_q, n_q), factorised.

        The last one is kept. Raises SingularError, in terms of the mesh.
        """
        if self._reference is None or self._reference[0] is not matrix:
            self.factors.forget()  # the size of a step changes the matrix by orders of magnitude
            try:
                self._reference = matrix, self._factorised(matrix)
            except SingularError as error:
                raise self.explained(error) from error
        return self._reference[1]

    def kept_columns(self, K: Operator, rows: Rows) -> KeptColumns | None:
        """Return the columns of the Schur complement of K and contact rows, the last ones as long as these serve.

        None with multigrid, which has no factor.
        """
        if not isinstance(K, Stiffness) or K.iterative:
            return None
        later = len(self.problem.case.steps.planned) - 1
        if self._columns is None or not self._columns.serve(K, rows):
            self._columns = KeptColumns(K, rows, SAVED * later)
        return self._columns

    def _factorised(self, matrix: csr_array | None) -> Operator:
        """Return the stabilised K_q plus a scheme's matrix, factorised; for multigrid without a copy of K_q."""
        K, factors, springs = self.K, self.factors, self.stabilization.springs
        if not (factors.on_nodes and isinstance(K, bsr_array) and self.problem.constraints.is_selection):
            return factors.factorise(self.stabilized(self.K_q, matrix))
        free = self.problem.constraints.free
        on_nodes = with_held(K, free, self.problem.space.share.own)
        for part in (springs, matrix):
            if part is not None:
                added = embed(part, free, K.shape[0], diagonal=0.0)
                on_nodes = bsr_array(on_nodes + added.tobsr(K.blocksize))
        return factors.factorise(on_nodes)

    def stabilized(self, K_q: csr_array, matrix: csr_array | None = None) -> csr_array:
        """Return K_q with the springs of the stabilisation, and a scheme's matrix."""
        parts = [part for part in (K_q, self.stabilization.springs, matrix) if part is not None]
        return K_q if len(parts) == 1 else csr_array(sum(parts[1:], parts[0]))

    def explained(self, error: SingularError) -> SingularError:
        """Return the error of a singular stiffness in terms of the mesh: the node that moves most, and its axis."""
        space = self.problem.space
        if error.dof is None:
            return error
        q = np.eye(1, self.problem.constraints.n_q, error.dof)[0] if error.mode is None else error.mode
        u = self.problem.constraints.T @ q
        node, axis = divmod(int(np.abs(u).argmax()), space.dim)
        place = ", ".join(space.told(space.mesh.points[node]))
        who = f"node {space.mesh.node_number[node]} ({place}) along {'xyz'[axis]}"
        of_node = space.bodies
        body = "a body" if space.share.size > 1 else body_names(space, of_node)[of_node[node]]
        message = f"the stiffness is singular: a part of {body} can move without any force, most of all {who}"
        advice = "check how it is connected there, or support it by a displacement or a spring"
        return SingularError(f"{message}; {advice}", error.dof, error.mode)

    @cached_property
    def _whole(self) -> NodalEmbedding | None:
        """Embedding of q in the unknowns of all nodes, with the rigid-body modes, for multigrid.

        None if some unknowns belong to no node.
        """
        space, constraints, free = self.problem.space, self.problem.constraints, self.problem.constraints.places
        if free is None:
            return None
        of_bodies = rigid_modes(space, space.bodies)
        modes = np.zeros_like(of_bodies)
        modes[free] = constraints.at_nodes.T.T @ of_bodies
        near = space.neighbours if constraints.equations else None
        return NodalEmbedding(free, space.n_dof, space.dim, modes, near)

    @cached_property
    def length(self) -> float:
        """Extent of the bodies, in axisymmetry at least the largest radius, since radii are measured from the axis."""
        space = self.problem.space
        if not space.model.axisymmetric:
            return space.extent
        radius = space.mesh.points[space.attached, 0].max(initial=0.0)
        return max(space.extent, space.share.largest(float(radius)))

    @cached_property
    def longest(self) -> float:
        """Extent of the largest cell."""
        space = self.problem.space
        longest = (np.ptp(space.local.points[b.nodes], axis=1).max(initial=0.0) for b in space.blocks)
        return space.share.largest(float(max(longest)))

    @cached_property
    def linear(self) -> bool:
        """True if forces and gaps are linear in q: linear bodies, and skins that are paired once."""
        moving = any(pair.moving for pair in self.problem.joints)
        rows = all(rows.linear for rows in self.problem.equalities)
        return self.problem.kinematics.linear and rows and not moving

    def check_beside_axis(self, u: Floats) -> None:
        """Raise InadmissibleError if u (n_dof,) moves nodes of an axisymmetric model across the axis.

        Nodes within round-off of the axis are accepted.
        """
        space = self.problem.space
        if space.model.axisymmetric:
            x = space.mesh.points[:, 0] + u[:: space.dim]
            beyond = np.flatnonzero((x < -_AXIS * space.extent) & (space.mesh.points[:, 0] >= 0))
            numbers = some(space.mesh.node_number[beyond])
            failed = InadmissibleError(f"nodes {numbers} are taken across the axis; take smaller steps")
            space.share.agree(failed if len(beyond) else None)

    def check_held(self, rows: csr_array) -> None:
        """Raise DataError, with a description, if a rigid-body motion is constrained by nothing, contact included.

        `rows` (k, n_dof): those of contacts, ties and equalities that may carry a force.
        """
        if not self.motions or self.scheme.resists_rigid_motion:
            return
        free = still_free(rows, self.motions)
        if free:
            raise DataError(unheld(free))

    def interface(self, pair: ContactPair, u: Floats, t: float, closed: NDArray[np.bool_] | None = None) -> Interface:
        """Return a pair's interface, on the skins displaced by u (n_dof,) if it is paired again, else undeformed.

        `closed` (n_macros,): macro-elements that were in contact before.
        """
        if pair.moving:
            return pair.integrate(self.problem.space, u, t, closed)
        return pair.turned(pair.undeformed(self.problem.space, t), self.problem.space, u)
