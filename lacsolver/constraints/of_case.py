"""The constraints of a case: its prescribed displacements and rigid bodies, its equations, and its rows of equality."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from scipy.sparse import csr_array, diags_array, vstack

from lacmesh.mesh import Ints, mask_of
from lacsolver.case.case import Case
from lacsolver.case.entry import Entry
from lacsolver.case.joints import Coupling
from lacsolver.case.records import Displacement, Force
from lacsolver.constraints import coupling, cyclic, pretension, shared, terms
from lacsolver.constraints.constraints import Constraints
from lacsolver.constraints.equality_rows import EqualityRows, lengths, moves
from lacsolver.constraints.equations import Equations
from lacsolver.constraints.late import is_late, late_supports
from lacsolver.constraints.supports import probed_times
from lacsolver.space.places import in_words, nodes_of, wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import joined_columns

#: least eigenvalue of the products of rows of equality, of unit length, below which one follows from others; part of
#: the largest coefficient from which on a row is named
_FOLLOWS, _SHARE = 1e-12, 1e-3

#: functions that return the equations that are eliminated, each for its own records of a case
EQUATIONS: list[Callable[[Space, Case], Iterable[Equations]]] = [
    terms.equations_of,
    coupling.equations_of,
    pretension.equations_of,
    cyclic.equations_of,
    shared.equations_of,
]
#: functions that return the rows of equality, each for its own records of a case
EQUALITIES: list[Callable[[Space, Case], Iterable[EqualityRows]]] = [coupling.rows_of, pretension.locks_of]


def equations_of(space: Space, case: Case) -> tuple[Equations, ...]:
    """Return the equations of a case that are eliminated, on a space that has all nodes. Raises CaseError."""
    return tuple(one for of_records in EQUATIONS for one in of_records(space, case))


def constraints_of(space: Space, case: Case, equations: tuple[Equations, ...] | None = None) -> Constraints:
    """Return the constraints of a case, with its equations: those of `equations_of` unless they are given.

    Raises CaseError for records that contradict one another, as `Constraints.of` and `with_equations` do.
    """
    supported = Constraints.of(space, case)
    equations = equations_of(space, case) if equations is None else equations
    return supported.with_equations(equations, probed_times(case))


def equalities_of(constraints: Constraints, case: Case) -> tuple[EqualityRows, ...]:
    """Return the rows of equality of a case. Raises CaseError for mistakes, and for rows that follow from others."""
    rows = tuple(rows for of_records in EQUALITIES for rows in of_records(constraints.space, case))
    rows += tuple(late_supports(constraints, case))
    if rows:
        _check_apart(constraints, rows)
    return rows


def _check_apart(constraints: Constraints, rows: tuple[EqualityRows, ...]) -> None:
    """Raise CaseError for rows of equality that follow from others, or contradict them: forces are not determined."""
    nothing = np.zeros(constraints.space.n_dof)
    parts = [one.at(nothing, 0.0).C for one in rows]
    C = csr_array(vstack(parts))
    N = csr_array(C @ constraints.T)
    moved, size = np.flatnonzero(moves(N, C)), lengths(N)
    unit = csr_array(diags_array(1 / size[moved]) @ N[moved])
    products = csr_array(unit @ unit.T)
    sharing = np.flatnonzero(np.diff(products.indptr) > 1)  # rows that share no unknown with another follow from none
    alike, way = np.linalg.eigh(products[sharing][:, sharing].toarray())
    if not len(alike) or alike[0] > _FOLLOWS:
        return
    at = np.repeat(np.arange(len(rows)), [part.shape[0] for part in parts])[moved[sharing]]
    named = np.unique(at[np.abs(way[:, 0]) > _SHARE * np.abs(way[:, 0]).max()])
    last, others = rows[named[-1]].record, " and ".join(in_words(rows[k].record) for k in named[:-1])
    message = f"its constraints follow from {others or 'another part of it'}, or contradict it"
    raise wrong(last, f"{message}; leave one out")


# ---- for several processes


def joining(case: Case) -> Iterator[Entry]:
    """Yield the records of a case that join nodes which several processes may have, but for rigid bodies."""
    yield from (*case.pretension, *case.equation, *(one for one in case.cyclic if one.matching))
    yield from (one for one in case.coupling if not coupling.is_body(one))
    yield from (one for one in case.force if one.moment is not None)
    yield from (one for one in case.displacement if is_late(one))


def node_sets(space: Space, case: Case, equations: tuple[Equations, ...]) -> Ints:
    """Return a number (n_nodes,) for each node that all processes need, -1 for others, on a space that has all nodes.

    Nodes of one number are joined by equations, and one process owns them.
    """
    C = csr_array(vstack([csr_array((0, space.n_dof)), *(one.C for one in equations)]))
    node, n = C.indices // space.dim, space.mesh.n_nodes
    label = joined_columns(csr_array((C.data, node, C.indptr), shape=(C.shape[0], n)))
    used = mask_of(n, node)
    for record in joining(case):
        if isinstance(record, Coupling | Force | Displacement):
            used[nodes_of(space, record)] = True
    return np.where(used, label, -1)
