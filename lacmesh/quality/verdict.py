"""Table of Verdict's measures for each cell type, with the range that it accepts: one row per measure, None for none.

Names and ranges: Stimpson et al., *The Verdict Library Reference Manual*, Sandia report SAND2007-1751, 2007. A measure
that is not listed for a type is not defined for it. `docs/quality.md` says what each is.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

Range = tuple[float, float]
_INF = float("inf")

_TRIA3: dict[str, Range | None] = {
    "area": (0, _INF),
    "aspect_frobenius": (1, 1.3),
    "aspect_ratio": (1, 1.3),
    "condition": (1, 1.3),
    "distortion": (0.5, 1),
    "max_angle": (60, 90),
    "min_angle": (30, 60),
    "radius_ratio": (1, 3),
    "relative_size_squared": None,
    "scaled_jacobian": (0.5, 2 / 3**0.5),
    "shape": (0.25, 1),
    "shape_and_size": (0.25, 1),
}
_QUAD4: dict[str, Range | None] = {
    "area": (0, _INF),
    "aspect_ratio": (1, 1.3),
    "condition": (1, 4),
    "distortion": (0.5, 1),
    "jacobian": (0, _INF),
    "max_angle": (90, 135),
    "max_aspect_frobenius": (1, 1.3),
    "max_edge_ratio": (1, 1.3),
    "med_aspect_frobenius": (1, 1.3),
    "min_angle": (45, 90),
    "oddy": (0, 0.5),
    "radius_ratio": (1, 1.3),
    "relative_size_squared": (0.3, 1),
    "scaled_jacobian": (0.3, 1),
    "shape": (0.3, 1),
    "shape_and_size": (0.2, 1),
    "shear": (0.3, 1),
    "shear_and_size": (0.2, 1),
    "skew": (0, 0.5),
    "stretch": (0.25, 1),
    "taper": (0, 0.7),
    "warpage": (0.3, 1),
}
_TETRA4: dict[str, Range | None] = {
    "aspect_frobenius": (1, 1.3),
    "aspect_gamma": (1, 3),
    "aspect_ratio": (1, 3),
    "collapse_ratio": (0.1, _INF),
    "condition": (1, 3),
    "distortion": (0.5, 1),
    "jacobian": (0, _INF),
    "min_angle": (40, 70.528779365509308),
    "radius_ratio": (1, 3),
    "relative_size_squared": (0.3, 1),
    "scaled_jacobian": (0.5, 1),
    "shape": (0.3, 1),
    "shape_and_size": (0.2, 1),
    "volume": (0, _INF),
}
_HEXA8: dict[str, Range | None] = {
    "condition": None,
    "diagonal": (0.65, 1),
    "dimension": (0, _INF),
    "distortion": (0.5, 1),
    "jacobian": (0, _INF),
    "max_aspect_frobenius": (1, 3),
    "max_edge_ratio": (1, 1.3),
    "med_aspect_frobenius": (1, 3),
    "oddy": (0, 0.5),
    "relative_size_squared": (0.5, 1),
    "scaled_jacobian": (0.5, 1),
    "shape": (0.3, 1),
    "shape_and_size": (0.2, 1),
    "shear": (0.3, 1),
    "shear_and_size": (0.2, 1),
    "skew": (0, 0.5),
    "stretch": (0.25, 1),
    "taper": (0, 0.5),
    "volume": (0, _INF),
}
_PENTA6: dict[str, Range | None] = {
    "condition": None,
    "distortion": None,
    "jacobian": None,
    "max_aspect_frobenius": None,
    "scaled_jacobian": None,
    "shape": None,
    "volume": (0, _INF),
}
_PYRAM5: dict[str, Range | None] = {"jacobian": None, "scaled_jacobian": None, "shape": None, "volume": (0, _INF)}

#: type -> measure -> the range that Verdict accepts
ACCEPTED: Mapping[str, Mapping[str, Range | None]] = MappingProxyType(
    {"TRIA3": _TRIA3, "QUAD4": _QUAD4, "TETRA4": _TETRA4, "HEXA8": _HEXA8, "PENTA6": _PENTA6, "PYRAM5": _PYRAM5}
)
