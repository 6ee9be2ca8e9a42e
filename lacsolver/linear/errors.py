"""Errors of linear systems: singular matrices and insufficient accuracy."""

from __future__ import annotations

from collections.abc import Callable

from lacmesh.errors import LacmeshError
from lacmesh.mesh import Floats


class LinearError(LacmeshError):
    """A linear system could not be solved to the required accuracy.

    >>> from lacsolver import NotConvergedError
    >>> LinearError.status == NotConvergedError.status  # of the command: no solution was found
    True
    """

    status = 4


class SingularError(LinearError):
    """A matrix is singular to round-off, or not positive definite.

    `dof`: the row that is most affected, None if not known. `mode` (n,): a motion that costs no energy, whose largest
    entry is 1, at `dof`; None if no such motion was found (a matrix that is not positive definite at all).

    >>> import numpy as np
    >>> from scipy.sparse import csr_array
    >>> from lacsolver.linear import analyse
    >>> chain = csr_array(np.array([[1.0, -1.0], [-1.0, 1.0]]))
    >>> try:
    ...     analyse(chain, backend="superlu").factor(chain)
    ... except SingularError as error:
    ...     print(error.mode)
    [1. 1.]
    """

    status = 1

    def __init__(self, message: str, dof: int | None = None, mode: Floats | None = None) -> None:
        super().__init__(message)
        self.dof = dof
        self.mode = mode


class Breakdown(Exception):  # noqa: N818 (never leaves this package: it becomes a SingularError)
    """A backend met a pivot that is not positive, at the row `dof` if it can tell.

    `solve`: the solution with the factor that it has all the same, which shows if the signs of its pivots are right.
    """

    def __init__(self, dof: int | None = None, solve: Callable[[Floats], Floats] | None = None) -> None:
        super().__init__(dof)
        self.dof, self.solve = dof, solve


class Doubted(Exception):  # noqa: N818 (never leaves this package)
    """A backend calls a matrix singular, by `error`, and neither a motion nor a factor shows that it is."""

    def __init__(self, error: SingularError) -> None:
        super().__init__("it calls a matrix singular without a motion that shows it")
        self.error = error
