"""The constraints of a case: its prescribed displacements and rigid bodies, its equations, and its rows of equality."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from lacsolver.case.case import Case
from lacsolver.constraints import coupling, cyclic, pretension, terms
from lacsolver.constraints.constraints import Constraints, probed_times
from lacsolver.constraints.equality_rows import EqualityRows
from lacsolver.constraints.equated import EquatedConstraints
from lacsolver.constraints.equations import Equations
from lacsolver.space.space import Space

#: functions that return the equations that are eliminated, each for its own records of a case
EQUATIONS: list[Callable[[Space, Case], Iterable[Equations]]] = [
    terms.equations_of,
    coupling.equations_of,
    pretension.equations_of,
    cyclic.equations_of,
]
#: functions that return the rows of equality, each for its own records of a case
EQUALITIES: list[Callable[[Space, Case], Iterable[EqualityRows]]] = [coupling.rows_of, pretension.locks_of]


def constraints_of(space: Space, case: Case) -> Constraints:
    """Return the constraints of a case, with its equations.

    Raises CaseError for records that contradict one another, as `Constraints.of` and `EquatedConstraints` do.
    """
    plain = Constraints.of(space, case)
    equations = tuple(one for of_records in EQUATIONS for one in of_records(space, case))
    return EquatedConstraints.with_equations(plain, equations, probed_times(case))


def equalities_of(space: Space, case: Case) -> tuple[EqualityRows, ...]:
    """Return the rows of equality of a case. Raises CaseError for mistakes in its records."""
    return tuple(rows for of_records in EQUALITIES for rows in of_records(space, case))
