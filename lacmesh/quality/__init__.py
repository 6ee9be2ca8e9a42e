"""Quality of cells: their validity, their quality measures, and the statistics of these over a mesh.

geometry = the measures that lacmesh computes, such as validity and the least corner Jacobian (`geometry`)
measures = all measures by name, Verdict's by pyvista among them                              (`measures`)
quality = statistics of the measures, by type and by group, and the worst cells               (`summary`)
"""

from __future__ import annotations

from lacmesh.quality.geometry import Validity, corner_jacobian, validity, validity_at, validity_of
from lacmesh.quality.measures import measure_cells, measures_of
from lacmesh.quality.summary import Quality, measure_quality

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
]
