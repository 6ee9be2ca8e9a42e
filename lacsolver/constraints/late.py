"""Supports that begin in the course of a case: [[displacement]] with `begin`.

Its nodes are free until then. From then on d . u follows the value, by rows of equality that remember what they were:

    value(t) - d . u(t) = (1 - r(t)) (value(begin) - d . u(begin))

with r = 0, so that the value's increments count from where a node is, or with r that grows evenly from 0 at `begin` to
1 at `reached`, from which time on the value is the displacement itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, concatenated
from lacsolver.case.case import Case
from lacsolver.case.records import Displacement
from lacsolver.constraints.conditions import Prescribed, along_axes, rows_of, values_of
from lacsolver.constraints.constraints import Constraints
from lacsolver.constraints.equality_rows import EqualityAt, EqualityRows, Locked, Unlocked, moves, until
from lacsolver.constraints.local import combine
from lacsolver.constraints.rigid import check_apart
from lacsolver.constraints.supports import probed_times
from lacsolver.contact.laws import ContactLaw
from lacsolver.space.places import name_of, nodes_of, said, wrong
from lacsolver.space.space import Space

#: relative difference of displacements that count as the same
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class LateSupport:
    """The conditions d . u = value of one record from its `begin` on, but for those that others hold already.

    `number`: its place in the case; `C` (k, n_dof): the directions d, in the order of `parts`.
    """

    space: Space
    number: int
    record: Displacement
    parts: tuple[Prescribed, ...]
    C: csr_array
    linear = True

    @classmethod
    def of(cls, space: Space, number: int, record: Displacement, parts: Sequence[Prescribed]) -> LateSupport:
        """Return the rows of some conditions of a record."""
        return cls(space, number, record, tuple(parts), rows_of(space, parts))

    @property
    def name(self) -> str:
        """Name of its forces in a state."""
        return f"displacement {self.number + 1} {name_of(self.record)}"

    @property
    def begin(self) -> float:
        """Time from which on it holds."""
        assert self.record.begin is not None
        return self.record.begin

    def values(self, t: float) -> NDArray[np.floating]:
        """Return the value (k,) of each condition at time t."""
        return values_of(self.space, self.parts, t)

    def remembered(self, t: float) -> float:
        """Return 1 - r at time t: what counts of the difference of value and displacement at `begin`."""
        end = self.record.reached
        return 1.0 if end is None else float(np.clip((end - t) / (end - self.begin), 0.0, 1.0))

    def at(self, u: Floats, t: float) -> EqualityAt:
        """Return value - d . u, and the directions."""
        return EqualityAt(self.values(max(t, self.begin)) - self.C @ u, self.C)

    def curvature(self, u: Floats, t: float, p: Floats) -> csr_array | None:
        """Return None: the rows are constant."""
        return None

    def law(self, t: float) -> ContactLaw:
        """Return what lets the nodes go and remembers where they are until `begin`, and what holds them after that."""
        return Unlocked() if until(t, self.begin) else Locked(part=self.remembered(t))

    def without(self, dropped: NDArray[np.bool_]) -> LateSupport:
        """Return these conditions without some, a mask (k,)."""
        ends = np.cumsum([len(part.nodes) for part in self.parts])[:-1]
        kept = [part.take(own) for part, own in zip(self.parts, np.split(~dropped, ends), strict=True)]
        return LateSupport.of(self.space, self.number, self.record, kept)


def is_late(record: Displacement) -> bool:
    """True for a support that does not hold from the start."""
    return record.begin is not None


def late_supports(constraints: Constraints, case: Case) -> Iterator[EqualityRows]:
    """Yield the rows of the supports of a case that begin late, in the order in which they begin.

    Raises CaseError for nodes of rigid bodies, and for conditions that contradict others at a node.
    """
    space, earlier = constraints.space, list[LateSupport]()
    late = [(k, record) for k, record in enumerate(case.displacement) if is_late(record)]
    for k, record in sorted(late, key=lambda one: one[1].begin or 0.0):
        nodes = space.known(nodes_of(space, record))
        parts = along_axes(space, record, nodes[space.agreed(space.attached)[nodes]])
        check_apart(space, constraints.rigid, parts)
        own = LateSupport.of(space, k, record, parts)
        own = own.without(_held_already(constraints, own, probed_times(case)))
        own = own.without(_held_by_others(own, earlier))
        earlier.append(own)
        if own.C.shape[0]:
            yield own


def _held_already(constraints: Constraints, own: LateSupport, times: Sequence[float]) -> NDArray[np.bool_]:
    """Return a mask (k,) of conditions that hold from the start on. Raises CaseError where these contradict."""
    fixed = ~moves(csr_array(own.C @ constraints.T), own.C)
    if not fixed.any():
        return fixed
    space = constraints.space

    def apart(t: float) -> NDArray[np.floating]:
        return np.asarray(np.where(fixed, own.values(t) - own.C @ constraints.u0(t), 0.0))

    first = apart(own.begin)
    for t in (time for time in times if time > own.begin):
        off = np.abs(apart(t) - own.remembered(t) * first)
        if off.max() > _SAME * max(space.largest(constraints.u0(t)), float(np.abs(own.values(t)).max())):
            node = int(concatenated(part.nodes for part in own.parts)[off.argmax()])
            local = constraints.local
            before = [part.record for part in local.parts if node in part.nodes]
            other = said(before[0]) if before else "an equation"
            number = space.mesh.node_number[node]
            message = f"at t = {t:g} it contradicts {other}, which constrains node {number} from the start"
            raise wrong(own.record, f"{message}; leave one out, or make them agree")
    return fixed


def _held_by_others(own: LateSupport, earlier: Sequence[LateSupport]) -> NDArray[np.bool_]:
    """Return a mask (k,) of conditions that others, which begin before, have too. Raises CaseError if they differ."""
    local = combine(own.space, [part for one in (*earlier, own) for part in one.parts])
    start = len(local.node) - own.C.shape[0]
    dropped = np.diff(local.P.tocsc().indptr)[start:] == 0
    owner = np.repeat(np.arange(len(earlier)), [one.C.shape[0] for one in earlier])
    names = [part.component for part in own.parts for _ in part.nodes]
    for k in np.flatnonzero(dropped).tolist():
        there = np.flatnonzero(local.node[:start] == local.node[start + k])
        there = there[np.abs(local.direction[there] @ local.direction[start + k]).argsort()]
        other = earlier[int(owner[there[-1]])]
        if not _agree(own, other, names[k]):
            number = own.space.mesh.node_number[local.node[start + k]]
            message = f"{names[k]} of node {number} is prescribed by {said(other.record)} too, with other values, begin"
            raise wrong(own.record, f"{message} or axes; leave one out, or make them agree")
    return np.asarray(dropped)


def _agree(one: LateSupport, other: LateSupport, component: str) -> bool:
    """True if two records hold a component alike."""
    return all(
        getattr(one.record, name) == getattr(other.record, name) for name in (component, "begin", "reached", "axes")
    )


def support_forces(
    constraints: Constraints, equalities: Sequence[EqualityRows], forces: Mapping[str, Floats]
) -> Iterator[tuple[str, Floats]]:
    """Yield the name of the reaction of each support that acts by equations, and its forces (n_dof,) on the nodes.

    They are those on nodes of rigid bodies, and those that begin late. `forces`: of all equations, by name.
    """
    yield from late_forces(equalities, forces)
    for one in constraints.equations:
        if one.support and one.name in forces:
            yield one.support, np.asarray(one.C.T @ forces[one.name])


def late_forces(equalities: Sequence[EqualityRows], forces: Mapping[str, Floats]) -> Iterator[tuple[str, Floats]]:
    """Yield the name of the reaction of each late support, and its forces (n_dof,) on the nodes.

    `forces`: those of all rows of equality, by name.
    """
    for one in equalities:
        if isinstance(one, LateSupport) and one.name in forces:
            yield name_of(one.record), np.asarray(one.C.T @ forces[one.name])
