"""Quality of cells: their validity, their quality measures, and the statistics of these over a mesh.

corner = the least corner Jacobian, by which the variants of a cut are ranked     (`corner`)
validity = the least Jacobian determinant where solvers evaluate it               (`determinant`)
measures = Verdict's measures of the linear cells, and ours of every cell          (`measures`)
quality = statistics of the measures, by type and by group, and the worst cells    (`summary`)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from lacmesh.quality.corner import corner_jacobian, worst

#: name -> the module that holds it, imported when it is used: a cut needs the corner Jacobian only, and starts quickly
_LATE = {
    "Quality": "summary",
    "Validity": "determinant",
    "measure_cells": "measures",
    "measure_quality": "summary",
    "measures_of": "measures",
    "validity": "determinant",
    "validity_at": "determinant",
    "validity_of": "determinant",
}

__all__ = [
    "Quality",
    "Validity",
    "corner_jacobian",
    "measure_cells",
    "measure_quality",
    "measures_of",
    "validity",
    "validity_at",
    "validity_of",
    "worst",
]

if TYPE_CHECKING:
    from lacmesh.quality.determinant import Validity, validity, validity_at, validity_of
    from lacmesh.quality.measures import measure_cells, measures_of
    from lacmesh.quality.summary import Quality, measure_quality


def __getattr__(name: str) -> Any:
    if name in _LATE:
        return getattr(import_module(f"lacmesh.quality.{_LATE[name]}"), name)
    raise AttributeError(f"module 'lacmesh.quality' has no attribute {name!r}")
