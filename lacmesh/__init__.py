"""Cut meshes for Local Average Contact: read, cut, check, export. `import lacmesh` loads nothing until it is used."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

#: public name -> the module that holds it: verbs, records, errors
_PUBLIC = {
    "example": "lacmesh.examples",
    "read": "lacmesh.formats",
    "write": "lacmesh.formats",
    "cut_skin": "lacmesh.cutting.cut",
    "raise_order": "lacmesh.cutting.order",
    "split": "lacmesh.cutting.split",
    "recognise": "lacmesh.cutting.recognition",
    "orient": "lacmesh.topology.orientation",
    "check": "lacmesh.checks",
    "measure_quality": "lacmesh.quality",
    "contact_points": "lacmesh.surface",
    "coverage": "lacmesh.surface",
    "fit_surface": "lacmesh.smooth",
    "join": "lacmesh.joining",
    "from_meshio": "lacmesh.exchange.libraries",
    "aster_multipliers": "lacmesh.exchange.multipliers",
    "Mesh": "lacmesh.mesh",
    "Cut": "lacmesh.cutting.records",
    "Finding": "lacmesh.checks",
    "Findings": "lacmesh.checks",
    "Quality": "lacmesh.quality",
    "Surface": "lacmesh.surface",
    "FittedShape": "lacmesh.smooth",
    "LacmeshError": "lacmesh.errors",
    "LacmeshWarning": "lacmesh.errors",
}
__all__ = sorted(_PUBLIC)

if TYPE_CHECKING:
    from lacmesh.checks import Finding as Finding
    from lacmesh.checks import Findings as Findings
    from lacmesh.checks import check as check
    from lacmesh.cutting.cut import cut_skin as cut_skin
    from lacmesh.cutting.order import raise_order as raise_order
    from lacmesh.cutting.recognition import recognise as recognise
    from lacmesh.cutting.records import Cut as Cut
    from lacmesh.cutting.split import split as split
    from lacmesh.errors import LacmeshError as LacmeshError
    from lacmesh.errors import LacmeshWarning as LacmeshWarning
    from lacmesh.examples import example as example
    from lacmesh.exchange.libraries import from_meshio as from_meshio
    from lacmesh.exchange.multipliers import aster_multipliers as aster_multipliers
    from lacmesh.formats import read as read
    from lacmesh.formats import write as write
    from lacmesh.joining import join as join
    from lacmesh.mesh import Mesh as Mesh
    from lacmesh.quality import Quality as Quality
    from lacmesh.quality import measure_quality as measure_quality
    from lacmesh.smooth import FittedShape as FittedShape
    from lacmesh.smooth import fit_surface as fit_surface
    from lacmesh.surface import Surface as Surface
    from lacmesh.surface import contact_points as contact_points
    from lacmesh.surface import coverage as coverage
    from lacmesh.topology.orientation import orient as orient


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC and not name.startswith("_") and find_spec(f"lacmesh.{name}"):  # a module
        return import_module(f"lacmesh.{name}")
    return _named("lacmesh", name, _PUBLIC)


def _named(package: str, name: str, public: Mapping[str, str]) -> Any:
    """Return what a public name of a package stands for. Raises AttributeError for any other."""
    if name in public:
        return getattr(import_module(public[name]), name)
    raise AttributeError(f"module {package!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
