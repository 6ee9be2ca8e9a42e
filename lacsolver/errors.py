"""Errors of lacsolver, one class per condition; those of meshes and files are in `lacmesh.errors`."""

from lacmesh.errors import DataError, GroupNotFoundError, LacmeshError, LacmeshWarning, ReadError, RequestError
from lacsolver.case.errors import CaseError, EvaluationError
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.linear.errors import LinearError, SingularError

__all__ = [
    "CaseError",
    "DataError",
    "EvaluationError",
    "GroupNotFoundError",
    "LacmeshError",
    "LacmeshWarning",
    "LinearError",
    "NotConvergedError",
    "ReadError",
    "RequestError",
    "SingularError",
]
