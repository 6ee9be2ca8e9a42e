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
    "Cut": "lacmesh.cut",
    "cut_skin": "lacmesh.cut",
    "raise_order": "lacmesh.order",
    "aster_multipliers": "lacmesh.multipliers",
    "LacmeshError": "lacmesh.errors",
    "LacmeshWarning": "lacmesh.errors",
}

__all__ = [
    "CELLS",
    "Block",
    "Cut",
    "LacmeshError",
    "LacmeshWarning",
    "Mesh",
    "__version__",
    "aster_multipliers",
    "cut_skin",
]
__all__ += ["raise_order", "read", "write"]

if TYPE_CHECKING:
    from lacmesh.cells import CELLS
    from lacmesh.cut import Cut, cut_skin
    from lacmesh.errors import LacmeshError, LacmeshWarning
    from lacmesh.formats import read, write
    from lacmesh.mesh import Block, Mesh
    from lacmesh.multipliers import aster_multipliers
    from lacmesh.order import raise_order


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'lacmesh' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})
