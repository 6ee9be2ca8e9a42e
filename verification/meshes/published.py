"""Meshes of other projects, which are read where they stand beside this one, and are no part of it."""

from __future__ import annotations

import os
from pathlib import Path

import lacmesh
from lacmesh import Mesh

_FOLDER = Path(os.environ.get("LACMESH_SHARED") or Path(__file__).parents[3] / "shared") / "reference" / "meshes"


def there(name: str) -> bool:
    """True if a mesh can be read."""
    return (_FOLDER / f"{name}.med").is_file()


def code_aster(name: str) -> Mesh:
    """The mesh of one of code_aster's tests."""
    return lacmesh.read(_FOLDER / f"{name}.med")
