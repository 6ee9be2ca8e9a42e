"""Access to the package gmsh: is it installed, loaded, initialised?"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from lacmesh.errors import RequestError

_MISSING = "this needs gmsh; pip install 'lacmesh[gmsh]' brings it"


def find() -> None:
    """Raise RequestError if the gmsh package is missing."""
    try:
        missing = find_spec("gmsh") is None
    except ValueError:  # a module that is blocked
        missing = True
    if missing:
        raise RequestError(_MISSING)


def load() -> Any:
    """Import the gmsh package. Raises RequestError, with the line that installs what is missing."""
    try:
        return import_module("gmsh")
    except ModuleNotFoundError as error:
        raise RequestError(_MISSING) from error
    except OSError as error:  # the package is there, a system library is not
        libraries = "libglu1-mesa libgl1 libxrender1 libxcursor1 libxft2 libxinerama1 libgomp1"
        raise RequestError(f"gmsh cannot be loaded ({error}); on Debian: apt-get install {libraries}") from error


def running() -> Any:
    """The gmsh package, which the caller must have initialised. Raises RequestError."""
    gmsh = load()
    if not gmsh.isInitialized():
        raise RequestError("gmsh is not running: call gmsh.initialize(), then open or build a model")
    return gmsh
