"""What can go wrong with a linear system."""

from __future__ import annotations

from lacmesh.errors import LacmeshError
from lacmesh.mesh import Floats


class LinearError(LacmeshError):
    """A linear system that could not be solved to the accuracy that was asked for."""

    status = 4


class SingularError(LinearError):
    """A matrix that is singular to rounding, or not positive definite.

    `dof`: the row where it shows most, None if that is not known. `mode` (n,): a motion that costs no energy, its
    largest entry 1, at `dof`; None where no such motion was found (a matrix that is not positive definite at all).
    """

    status = 1

    def __init__(self, message: str, dof: int | None = None, mode: Floats | None = None) -> None:
        super().__init__(message)
        self.dof = dof
        self.mode = mode


class Breakdown(Exception):  # noqa: N818 (never leaves this package: it becomes a SingularError)
    """A backend met a pivot that is not positive, at the row `dof` if it can tell."""

    def __init__(self, dof: int | None = None) -> None:
        super().__init__(dof)
        self.dof = dof
