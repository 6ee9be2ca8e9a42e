"""Cut meshes for Local Average Contact: read, cut, check, export. `import lacmesh` loads nothing until it is used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

#: public name -> the module that holds it
_PUBLIC = {
    "Mesh": "lacmesh.mesh",
    "Block": "lacmesh.mesh",
    "CELLS": "lacmesh.cells",
    "read": "lacmesh.formats",
    "write": "lacmesh.formats",
    "Cut": "lacmesh.cutting.records",
    "cut_skin": "lacmesh.cutting.cut",
    "raise_order": "lacmesh.cutting.order",
    "orient": "lacmesh.topology.orientation",
    "recognise": "lacmesh.cutting.recognition",
    "aster_multipliers": "lacmesh.exchange.multipliers",
    "check": "lacmesh.checks",
    "Finding": "lacmesh.checks",
    "Findings": "lacmesh.checks",
    "Quality": "lacmesh.quality",
    "measure_quality": "lacmesh.quality",
    "Surface": "lacmesh.surface",
    "contact_points": "lacmesh.surface",
    "coverage": "lacmesh.surface",
    "FittedShape": "lacmesh.smooth",
    "fit_surface": "lacmesh.smooth",
    "from_meshio": "lacmesh.exchange.libraries",
    "to_meshio": "lacmesh.exchange.libraries",
    "to_pyvista": "lacmesh.exchange.libraries",
    "to_trimesh": "lacmesh.exchange.libraries",
    "LacmeshError": "lacmesh.errors",
    "LacmeshWarning": "lacmesh.errors",
}
__all__ = [
    "CELLS",
    "Block",
    "Cut",
    "Finding",
    "Findings",
    "FittedShape",
    "LacmeshError",
    "LacmeshWarning",
    "Mesh",
    "Quality",
    "Surface",
    "__version__",
    "aster_multipliers",
    "check",
    "contact_points",
    "coverage",
    "cut_skin",
    "fit_surface",
    "from_meshio",
    "measure_quality",
    "orient",
    "raise_order",
    "read",
    "recognise",
    "to_meshio",
    "to_pyvista",
    "to_trimesh",
    "write",
]

if TYPE_CHECKING:
    from lacmesh.cells import CELLS
    from lacmesh.checks import Finding, Findings, check
    from lacmesh.cutting.cut import cut_skin
    from lacmesh.cutting.order import raise_order
    from lacmesh.cutting.recognition import recognise
    from lacmesh.cutting.records import Cut
    from lacmesh.errors import LacmeshError, LacmeshWarning
    from lacmesh.exchange.libraries import from_meshio, to_meshio, to_pyvista, to_trimesh
    from lacmesh.exchange.multipliers import aster_multipliers
    from lacmesh.formats import read, write
    from lacmesh.mesh import Block, Mesh
    from lacmesh.quality import Quality, measure_quality
    from lacmesh.smooth import FittedShape, fit_surface
    from lacmesh.surface import Surface, contact_points
    from lacmesh.surface.coverage import coverage
    from lacmesh.topology.orientation import orient


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    if name in _modules():
        return import_module(f"lacmesh.{name}")
    raise AttributeError(f"module 'lacmesh' has no attribute {name!r}")


def _modules() -> set[str]:
    """Names of the modules of this package; each can be accessed as an attribute without an import of its own."""
    from pkgutil import iter_modules

    return {module.name for module in iter_modules(__path__) if not module.name.startswith("_")}


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC, *_modules()})
