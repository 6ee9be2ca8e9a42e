"""Linear systems: K x = b with K sparse, symmetric, positive definite, by the best solver that is installed.

analyse (pattern) -> factor (values) -> solve (right-hand sides), the same for all backends, and the choice of `auto`
                                                                                                (backends)
factorisation, with shared tests for rigid-body modes and refinement                    (direct/, regular, accuracy)
smoothed aggregation, and the Krylov loop that it preconditions                              (multigrid/, krylov)
operations on vectors                                                                         (vectors)

There are no saddle-point systems here: contact is solved by iterations on the factor of K. (SuperLU takes minutes for a
saddle-point matrix of 8e4 unknowns that others factorise in seconds.)
"""

from lacsolver.linear.accuracy import TOLERANCE, Matrix
from lacsolver.linear.backends import (
    BACKENDS,
    MULTIGRID_ABOVE,
    Analysis,
    Backend,
    Factor,
    analyse,
    backends,
    choose,
)
from lacsolver.linear.errors import LinearError, SingularError

__all__ = [
    "BACKENDS",
    "MULTIGRID_ABOVE",
    "TOLERANCE",
    "Analysis",
    "Backend",
    "Factor",
    "LinearError",
    "Matrix",
    "SingularError",
    "analyse",
    "backends",
    "choose",
]
