"""Contact system: the contact rows of all pairs in one configuration, from their pairing to the report of a step.

B v = int (v(x) - v(x_bar)).n, D = -dG/du; both are the same if a pair is paired only once, or if a symmetric tangent is
required. Rows of equality (`constraints.equality_rows`) follow those of all pairs. A system is made on the unknowns of
all nodes and reduced once to the unknowns q, by B T and D T. What the rows obey is left to the contact law of their
pair (`lacsolver.contact.laws`).

A pair with friction has rows along its tangents after those along its normals: B_T v = int e . (v(x) - v(x_bar) + g
dn(v)), D_T = dS/du, and -S in the place of G, with the slip S. Vectors p of pressures have the tractions t there, so
that B^T p is the whole force. What these rows obey is in `lacsolver.contact.friction`, and their part in a linear
system in `row_set`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, vstack

from lacmesh.errors import DataError
from lacmesh.mesh import Floats, mask_of
from lacsolver.constraints.equality_rows import Free, moves
from lacsolver.contact import Interface
from lacsolver.contact.anchors import Anchors, all_anchors, own_anchors, renewed
from lacsolver.contact.friction import Bounds, Kept, Slid, Solved, States, defect, next_states, within
from lacsolver.contact.laws import Bools, ContactLaw, RowState, Unilateral
from lacsolver.problem.problem import Problem
from lacsolver.saddle.iterate import Histories
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_group import EqualityGroup, PairGroup, RowGroup, Rows
from lacsolver.saddle.row_set import IN, OUT, LinearRows, RowSet, ShearRows, Slides, combined


@dataclass(frozen=True, eq=False)
class ContactSystem:
    """Contact rows of all pairs, one after the other (m,), in one configuration.

    `rows`: B, D and w, 1 for rows that are not covered; `G` (m,): gap integrals, with what slivers may overlap;
    `groups`: the rows of each pair, with their law. `above_threshold` (m,): True if the coverage reaches that of the
    pair; `enforceable` (m,): those of them whose law can be fulfilled, since some unknown moves them or they are
    springs. `skin_stiffness` (m,): of each row's own skin, stress per length. `nodal`: the rows on the unknowns of all
    nodes.
    """

    rows: Rows
    G: NDArray[np.floating]
    groups: tuple[RowGroup, ...]
    above_threshold: Bools
    enforceable: Bools
    skin_stiffness: NDArray[np.floating]
    nodal: Rows | None = None

    @classmethod
    def of(cls, rows: Rows, G: Floats, law: ContactLaw, K: Operator) -> ContactSystem:
        """Return the system of covered rows on the unknowns of a stiffness K that obey one law."""
        m = len(G)
        group = RowGroup(law, slice(0, m), np.zeros((m, law.n_history)))
        every = np.ones(m, bool)
        return cls(rows, G, (group,), every, every, skin_stiffness(K, rows))

    def reduced(self, T: csr_array, K: Operator) -> ContactSystem:
        """Return the system on the unknowns q of a stiffness K, with T = du/dq."""
        rows = self.rows.reduced(T)
        made = replace(self, rows=rows, skin_stiffness=self.skin_stiffness_of(K, rows), nodal=self.rows)
        moved, yields = moves(rows.B, self.rows.B), mask_of(len(self.G), *(g.rows for g in self.groups if g.law.yields))
        fixed = self._held(rows.B)
        if fixed.any():
            left = csr_array(rows.B @ diags_array((~fixed).astype(float)))
            moved &= self.of_equality | moves(left, self.rows.B)
        return replace(made, enforceable=self.above_threshold & (moved | yields))

    def _held(self, B: csr_array) -> Bools:
        """Return a mask (n_q,) of unknowns that rows of equality hold one by one, as late supports do; B (m, n_q).

        Rows that have no others carry no pressure, as those of skins that are prescribed on both sides.
        """
        if not self.equalities:
            return np.zeros(B.shape[1], bool)
        row, column = B.nonzero()
        alone = (np.bincount(row, minlength=len(self.G)) == 1) & self.of_equality & ~self._let_go
        return mask_of(B.shape[1], column[alone[row]])

    def skin_stiffness_of(self, K: Operator, rows: Rows) -> NDArray[np.floating]:
        """Return the stiffness (m,) of each row's skin, for rows along tangents the mean of their macro-element's."""
        return self.alike(skin_stiffness(K, rows))

    def alike(self, values: Floats) -> NDArray[np.floating]:
        """Return values (m,), those of the tangents of each macro-element as their mean."""
        out = values.copy()
        for shear in self.sheared:
            shear.vectors(out)[:] = shear.vectors(out).mean(axis=1, keepdims=True)
        return out

    def with_gaps(self, G: Floats) -> ContactSystem:
        """Return these rows with other gap integrals G."""
        return replace(self, G=G)

    def states(self, p: Floats, active: Bools) -> Iterator[tuple[RowGroup, RowState]]:
        """Yield the groups and the states of their rows at pressures p (m,), zeros where a row is not enforceable."""
        gap, p = self._mean_gaps, np.where(self.enforceable, p, 0.0)
        for group in self.groups:
            own = group.rows
            kept = group.history[:, : group.law.n_history]
            yield group, RowState(gap[own], p[own], active[own], self.skin_stiffness[own], kept)

    def next_active(self, active: Bools, p: Floats) -> Bools:
        """Return the active set (m,) that the laws ask for after a solve with `active`, without rows along tangents."""
        out = np.zeros(len(self.G), bool)
        for group, state in self.states(p, active):
            out[group.rows] = group.law.next_active(state)
        return self.enforceable & out

    def next_rows(self, now: RowSet, p: Floats, allowed: Floats | float) -> RowSet:
        """Return the row set that the laws and friction ask for after a solve with a set.

        A row that fulfils its law to `allowed`, a length or (m,), stays open or closed, whatever its round-off.
        """
        fulfilled = np.abs(self.residuals(p, now.active)) <= allowed
        active = self.enforceable & np.where(fulfilled, now.active, self.next_active(now.active, p))
        if not self.sheared:
            return RowSet.of(active)

        def states(shear: ShearRows) -> States:
            return next_states(shear.states(now), self._solved(shear, p, active), shear.bounds)

        return self._row_set(active, states)

    def first_rows(self, active: Bools, p: Floats, held: bool = False) -> RowSet:
        """Return the row set to start from: the `active` rows (m,), and those that the laws always close.

        Macro-elements with friction stick where their rows along tangents are active, and slide along p elsewhere.
        Those without a traction stick, or, if the bodies are `held` without it, press without friction in the first
        solve, whose slip tells what they do.
        """
        closed = self.start_active(active)
        if not self.sheared:
            return RowSet.of(closed)

        def states(shear: ShearRows) -> States:
            return States.of(closed[shear.normal], shear.sticks(active), shear.vectors(p), shear.bounds, held)

        return self._row_set(closed, states)

    def _row_set(self, active: Bools, states: Callable[[ShearRows], States]) -> RowSet:
        """Return the set of `active` rows (m,), with these states of macro-elements with friction."""
        m, macro = len(active), np.arange(len(active))
        rows = RowSet(active.astype(np.int8), np.zeros(m), np.zeros(m, bool), macro)
        for shear in self.sheared:
            shear.put(rows, states(shear), self.enforceable)
            macro[shear.at] = np.arange(shear.normal.start, shear.normal.stop)[:, None]
        return rows

    def with_closed(self, rows: RowSet, row: int) -> RowSet:
        """Return a set with one more row, along the normal; a macro-element with friction sticks."""
        state = rows.state.copy()
        state[row] = IN
        for shear in self.sheared:
            if shear.normal.start <= row < shear.normal.stop:
                at = shear.at[row - shear.normal.start]
                state[at] = np.where(self.enforceable[at] & shear.bounds.any[row - shear.normal.start], IN, OUT)
        return rows._replace(state=state)

    @cached_property
    def pairs(self) -> tuple[PairGroup, ...]:
        """The groups of contact pairs, in the order of these."""
        return tuple(group for group in self.groups if isinstance(group, PairGroup))

    @cached_property
    def equalities(self) -> tuple[EqualityGroup, ...]:
        """The groups of rows of equality."""
        return tuple(group for group in self.groups if isinstance(group, EqualityGroup))

    @cached_property
    def sheared(self) -> tuple[ShearRows, ...]:
        """Rows of the pairs with friction."""
        return tuple(group.shear for group in self.groups if group.shear is not None)

    @cached_property
    def along_tangents(self) -> Bools:
        """True for rows along tangents, (m,)."""
        return mask_of(len(self.G), *(shear.tangential for shear in self.sheared))

    @cached_property
    def of_equality(self) -> Bools:
        """True for rows of equality, (m,)."""
        return mask_of(len(self.G), *(group.rows for group in self.equalities))

    @cached_property
    def may_carry(self) -> Bools:
        """True for rows that may carry a force, (m,): enforceable ones that their law does not let go at this time."""
        return self.enforceable & ~self._let_go

    @cached_property
    def _let_go(self) -> Bools:
        """True for rows, (m,), that their law lets go at this time."""
        return mask_of(len(self.G), *(group.rows for group in self.groups if isinstance(group.law, Free)))

    def _solved(self, shear: ShearRows, p: Floats, presses: Bools) -> Solved:
        """Return what friction needs of a solve that gave p (m,); `presses` (m,): rows that the laws close."""
        t, slip = shear.vectors(p), -shear.vectors(self._mean_gaps)
        overlap = np.maximum(-self._mean_gaps[shear.normal], 0.0)
        pressing, stiffness = self.skin_stiffness[shear.normal] * overlap, self.skin_stiffness[shear.tangential]
        step = max(shear.n_tangents, 1)
        return Solved(p[shear.normal], t, slip, pressing, presses[shear.normal], stiffness[::step])

    @cached_property
    def _mean_gaps(self) -> NDArray[np.floating]:
        """The mean gaps (m,), along tangents slips with the sign changed; 0 in rows that are not enforceable."""
        return np.where(self.enforceable, self.G / self.rows.w, 0.0)

    def sliding_tractions(self, p: Floats, before: RowSet, after: RowSet) -> NDArray[np.floating] | None:
        """Return p (m,) with the tractions of what slides in the set `after`; None where less than a half begins to.

        p: pressures and tractions, whose macro-elements under pressure count; most of these stick in the set `before`.
        """
        out, pressed, leaving = p.copy(), 0, 0
        for shear in self.sheared:
            own, states = p[shear.normal], shear.states(after)
            pressed += int((own > 0).sum())
            leaving += int(((own > 0) & shear.sticks(before.active) & states.slides).sum())
            sliding = np.where(states.slides, shear.bounds.at(own)[0], 0.0)[:, None] * states.direction
            shear.vectors(out)[:] = np.where(states.slides[:, None], sliding, shear.vectors(p))
        return out if leaving > pressed / 2 else None

    def start_active(self, closed: Bools) -> Bools:
        """Return the active set (m,) to start from: the rows `closed`, and those that the laws always close."""
        out = closed.copy()
        for group, state in self.states(np.zeros(len(self.G)), np.zeros(len(self.G), bool)):
            if not group.law.compressive:
                out[group.rows] |= group.law.next_active(state)
        return self.enforceable & out

    def residuals(self, p: Floats, active: Bools) -> NDArray[np.floating]:
        """Return the residual (m,) of the laws at pressures p, lengths."""
        out = np.zeros(len(self.G))
        for group, state in self.states(p, active):
            out[group.rows] = group.law.residual(state)
            if not np.isfinite(out[group.rows]).all():
                raise DataError(f"the contact law {type(group.law).__name__} gives a residual that is not finite")
        for shear in self.sheared:
            solved = self._solved(shear, p, active)
            own = defect(solved.t, solved.s, shear.bounds.at(solved.p)[0], solved.stiffness)
            out[shear.tangential] = own.ravel()
        return np.where(self.enforceable, out, 0.0)

    def lawful(self, p: Floats) -> NDArray[np.floating]:
        """Return pressures and tractions p (m,) without tension where it can open, and with t within its bound."""
        out = p.copy()
        for group in self.groups:
            if group.law.compressive:
                out[group.rows] = np.maximum(p[group.rows], 0.0)
        for shear in self.sheared:
            shear.vectors(out)[:] = within(shear.vectors(p), shear.bounds.at(p[shear.normal])[0])
        return out

    def lawful_rows(self, z: Floats) -> RowSet:
        """Return the row set of z (m,) made `lawful`: rows that this opens, tractions that it shortens, and others."""
        p = self.lawful(z)
        active = self.start_active(self.one_sided & ~self.along_tangents & (p > 0))

        def states(shear: ShearRows) -> States:
            t, b = shear.vectors(z), shear.bounds.at(p[shear.normal])[0]
            closed, beyond = active[shear.normal], np.linalg.norm(t, axis=1) > b
            return States.of(closed, ~beyond, t, shear.bounds)

        return self._row_set(active, states) if self.sheared else RowSet.of(active)

    def of_macro_elements(self, rows: Bools) -> Bools:
        """Return which rows (m,) can be solved, of macro-elements with some of these rows."""
        out = rows.copy()
        for shear in self.sheared:
            any_row = rows[shear.normal] | shear.vectors(rows).any(axis=1)
            out[shear.normal] = any_row
            shear.vectors(out)[:] = any_row[:, None]
        return self.enforceable & out

    @cached_property
    def one_sided(self) -> Bools:
        """True for rows of laws without tension, (m,), and those along their tangents."""
        return mask_of(len(self.G), *(group.every for group in self.groups if group.law.compressive))

    def equations(self, p: Floats, active: Bools) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return (G, S), (m,) each: the laws' equations at these gaps and pressures, D dq - S p = G for active rows."""
        offset, compliance = np.zeros((2, len(self.G)))
        for group, state in self.states(p, active):
            offset[group.rows], compliance[group.rows] = group.law.linearise(state)
            own = offset[group.rows], compliance[group.rows]
            if not (np.isfinite(own).all() and (own[1] >= 0).all()):
                message = f"the contact law {type(group.law).__name__} gives an offset or compliance that is not finite"
                raise DataError(f"{message}, or a compliance below 0; check its `linearise`")
        return self.G - self.rows.w * offset, self.rows.w * compliance

    def linear(self, rows: RowSet, p: Floats) -> LinearRows:
        """Return the linear system of a row set at these gaps, pressures and tractions p (m,)."""
        G, S = self.equations(p, rows.active)
        slides = [Slides.of(shear, rows, p, self.G) for shear in self.sheared]
        return combined(LinearRows(self.rows, np.flatnonzero(rows.active), G, S), slides, Rows.combined)

    def with_springs(self, compliance: float) -> ContactSystem | None:
        """Return these rows with springs of a compliance, length per stress, between skins in unilateral contact.

        None with friction, and where some rows obey a law that is not linear: they have no energy that springs keep.
        """
        groups = []
        for group in self.groups:
            law = group.law
            if group.shear is not None or (law.compressive and type(law) is not Unilateral):
                return None
            if isinstance(law, Unilateral):
                law = replace(law, compliance=law.compliance + compliance)
            groups.append(replace(group, law=law))
        return replace(self, groups=tuple(groups))

    @cached_property
    def skin_compliance(self) -> float:
        """Compliance of the skins of a macro-element, length per stress: the median."""
        return float(np.median(1 / self.skin_stiffness[self.enforceable])) if self.enforceable.any() else 0.0

    def least_energy(self, G: Floats, p_before: Floats, p: Floats) -> float:
        """Return the part, at most 1, of a step at which the energy of bodies and springs is least.

        The step is from gap integrals G (m,) and pressures `p_before` (m,) to those of this system and p (m,), with
        forces in balance at both ends. The slope of the energy is dG . (p - p(G)), with the pressures p of the balance
        and those of the springs, and it does not fall.
        """
        from scipy.optimize import brentq

        on = self.enforceable & mask_of(len(G), *(group.rows for group in self.groups if group.law.compressive))
        S = self.equations(p_before, on)[1][on]
        dG, dp = (self.G - G)[on], (p - p_before)[on]

        def slope(part: float) -> float:
            springs = np.maximum(-(G[on] + part * dG) / S, 0.0)
            return float(dG @ (p_before[on] + part * dp - springs))

        if not slope(0.0) < 0 < slope(1.0):
            return 1.0
        return float(brentq(slope, 0.0, 1.0))

    def commit(self, p: Floats, active: Bools) -> tuple[Floats, ...]:
        """Return the history of each pair's law and friction at the end of a step."""
        rows = []
        for group, state in self.states(p, active):
            own = group.law.commit(state)
            rows.append(own if group.shear is None else np.hstack([own, self.slid(group, p, active).kept.columns]))
        return tuple(rows)

    def slid(self, group: RowGroup, p: Floats, active: Bools) -> Slid:
        """Return what the friction of a pair has done in a step that has converged."""
        assert group.shear is not None
        shear, kept = group.shear, group.kept
        S, w = -shear.vectors(self.G), self.rows.w[shear.normal]
        mean = S / shear.vectors(self.rows.w)
        closed, sticks = active[shear.normal], shear.sticks(active)
        t = np.where(closed[:, None], shear.vectors(p), 0.0)
        slides = closed & ~sticks & shear.bounds.any
        slip = np.where(slides[:, None], mean, 0.0)
        energy = w * (t * slip).sum(axis=1)
        anchor = np.where(sticks[:, None], kept.anchor, kept.anchor + S)
        now = Kept(anchor, kept.path + np.linalg.norm(slip, axis=1), kept.dissipation + energy)
        return Slid(t, slip, energy, slides, shear.bounds.at(p[shear.normal])[0], now)

    def anchors(self, active: Bools) -> tuple[Anchors, ...]:
        """Return the anchors of each pair at the end of a step: kept where it sticks, renewed elsewhere."""
        out: list[Anchors] = []
        if all(group.since is None for group in self.pairs):
            return ()
        for group in self.groups:
            if not isinstance(group, PairGroup) or group.since is None or group.shear is None or group.slip is None:
                out.append(Anchors.none())
                continue
            sticks = active[group.shear.normal] & group.shear.sticks(active)
            own = renewed(group.since[0], group.face, ~sticks | group.slip.entered)
            out.append(all_anchors(own, group.share))
        return tuple(out)

    def damped(self, u: Floats, p: Floats) -> float:
        """Return the energy that damping of contact takes in a step, at u (n_dof,) and pressures p (m,)."""
        return sum((float(w @ group.law.taken(rows)) for group, rows, w in self._soft(u, p)), 0.0)

    def stored(self, u: Floats, p: Floats) -> float:
        """Return the energy that soft contact stores at u (n_dof,) and pressures p (m,)."""
        return sum((float(w @ group.law.stored(rows)) for group, rows, w in self._soft(u, p)), 0.0)

    def _soft(self, u: Floats, p: Floats) -> Iterator[tuple[RowGroup, RowState, Floats]]:
        """Yield the groups whose law yields, with their rows at u (n_dof,) and p (m,), and their areas.

        Areas are 0 where a row is not enforceable.
        """
        soft, G = [pair for pair in self.pairs if pair.law.yields], self.G.copy()
        for pair in soft:
            G[pair.every] = pair.gaps(u)
        w = np.where(self.enforceable, self.rows.w, 0.0)
        for group, rows in self.with_gaps(G).states(p, np.zeros(len(G), bool)):
            if group in soft:
                yield group, rows, w[group.rows]

    @property
    def exact(self) -> bool:
        """True if a law asks for exact solves."""
        return any(group.law.exact for group in self.groups)

    @property
    def moving(self) -> bool:
        """True if the direction or position of contact forces depends on the displacement."""
        return any(not group.symmetric for group in self.groups)

    def geometric_stiffness(self, p: Floats) -> csr_array:
        """Return d(B^T p)/du (n_dof, n_dof) at pressures and tractions p (m,), on the unknowns of all nodes."""
        n = (self.nodal or self.rows).B.shape[1]
        total = csr_array((n, n))
        for one in self.equalities:
            bent = one.equality.curvature(*one.here, p[one.rows])
            total = total if bent is None else csr_array(total + bent)
        for group in self.pairs:
            own = group.geometric_stiffness(p)
            if own is not None:
                total = csr_array(total + group.share.add_matrices(own, (True, True)))
        return total


def contact_system(
    problem: Problem, interfaces: Sequence[Interface], u: Floats, histories: Histories | None = None, t: float = 1.0,
    before: Floats | None = None, bounds: Sequence[Bounds | None] | None = None, dt: float = 0.0,
) -> ContactSystem:  # fmt: skip
    """Return the contact rows of all pairs at u (n_dof,) and time t, on the unknowns of all nodes.

    `histories`: those of the last state; `before` (n_dof,): its displacement, 0 by default. `bounds`: those of the
    friction of each pair at the time t, where they are known. `dt`: size of a step in motion, 0 at rest.
    """
    if bounds is None:
        bounds = [pair.bounds(problem.space, t) for pair in problem.joints]
    histories = Histories() if histories is None else histories
    history = histories.contact
    n, symmetric = problem.space.n_dof, problem.case.solver.tangent == "symmetric"
    groups: list[RowGroup] = []
    first = 0
    G: list[Floats] = [np.empty(0)]
    w: list[Floats] = [np.empty(0)]
    covered = [np.empty(0, bool)]
    for k, (pair, face, bound) in enumerate(zip(problem.joints, interfaces, bounds, strict=True)):
        own = slice(first, first + face.B.shape[0])
        shear = None if face.B_T is None or bound is None else ShearRows.after(own, face.B_T.shape[0], bound)
        columns = pair.law.n_history + (0 if shear is None else Kept.n_columns(shear.n_tangents))
        memory = history[k] if history else np.zeros((own.stop - first, columns))
        since = None
        if shear is not None and pair.moving:
            anchors = histories.anchors[k] if histories.anchors else Anchors.none()
            anchors = own_anchors(anchors, pair.zone, problem.space.share)
            since = anchors, pair.places(problem.space, np.zeros_like(u) if before is None else before)
        x = problem.space.places(u) if pair.has_turning_arm(face, problem.space) else None
        fixed = symmetric or not (pair.moving or x is not None)
        group = PairGroup(
            pair.law_at(t, dt), own, memory, shear, fixed, pair=pair, face=face, share=problem.space.share, since=since,
            x=x,
        )  # fmt: skip
        groups.append(group)
        first = group.every.stop
        G.append(group.gaps(u))
        w.append(group.measure)
        covered.append(group.on_rows(pair.above_threshold(face)))
    matrices = [face.all_rows for face in interfaces]
    for k, rows in enumerate(problem.equalities, len(groups)):
        there, law = rows.at(u, t), rows.law(t)
        own = slice(first, first + len(there.gap))
        memory = history[k] if history else np.zeros((len(there.gap), law.n_history))
        groups.append(EqualityGroup(law, own, memory, symmetric=rows.linear, equality=rows, here=(u, t)))
        first = own.stop
        matrices.append(there.C)
        G.append(there.gap)
        w.append(np.ones(len(there.gap)))
        covered.append(np.ones(len(there.gap), bool))
    on = np.concatenate(covered)
    B = csr_array(vstack([csr_array((0, n)), *matrices]))
    w_or_1 = np.where(on, np.concatenate(w), 1.0)
    typical = typical_measures(w_or_1, on, groups)
    moves = any(not (g.symmetric and g.since is None) for g in groups if isinstance(g, PairGroup))
    made = Rows(B, w_or_1, (lambda: _derivatives(groups, matrices, n)) if moves else None, typical)
    return ContactSystem(made, np.concatenate(G), tuple(groups), on, on, np.ones(len(on)))


def typical_measures(w: Floats, covered: Bools, groups: Sequence[RowGroup]) -> NDArray[np.floating]:
    """Return the mean measure (m,) of the covered rows of each row's group; w, `covered` (m,)."""
    out = np.ones(len(w))
    for group in groups:
        own = w[group.every][covered[group.every]]
        out[group.every] = own.mean() if len(own) else 1.0
    return out


def _derivatives(groups: Sequence[RowGroup], matrices: Sequence[csr_array], n: int) -> csr_array:
    """Return D (m, n_dof) of all pairs, and of rows of equality, whose B it is; `matrices`: B of each group."""
    own = (g.derivative() if isinstance(g, PairGroup) else B for g, B in zip(groups, matrices, strict=True))
    return csr_array(vstack([csr_array((0, n)), *own]))


def skin_stiffness(K: Operator, rows: Rows) -> NDArray[np.floating]:
    """Return c (m,) = w (b K b^T) / (b b^T)^2, stress per length; 1 where a row is zero or has no stiffness."""
    energy, size = row_energies(rows.B[:, rows.touched], K.restricted(rows.touched))
    with np.errstate(invalid="ignore", divide="ignore"):
        c = rows.w * energy / size**2
    return np.where(np.isfinite(c) & (c > 0), c, 1.0)


def row_energies(B: csr_array, K: csr_array) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return b K b^T and b b^T (m,) of each row b of B (m, n)."""
    energy, size = (B @ K).multiply(B).sum(axis=1), B.multiply(B).sum(axis=1)
    return np.asarray(energy).ravel(), np.asarray(size).ravel()
