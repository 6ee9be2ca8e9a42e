"""The linear solvers: their properties, installation, and the choice of `auto`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from types import MappingProxyType

from lacmesh.errors import RequestError, did_you_mean
from lacsolver.linear.direct.mkl import library

#: above this number of unknowns in 3D, contact costs less with multigrid than with a factorisation
#: (docs/solver_backends.md)
MULTIGRID_ABOVE = 80_000
#: rigid-body modes of a body in 3D; a problem with fewer is plane, where a factorisation stays cheap
_MODES_3D = 6


@dataclass(frozen=True)
class Backend:
    """A linear solver. `module`: Python module that it needs ('' if none); `extra`: extra of lacmesh that has it."""

    name: str
    direct: bool
    module: str
    extra: str
    note: str

    @property
    def installed(self) -> bool:
        """True if the solver is installed."""
        if self.name == "pardiso":
            return library() is not None
        return find_spec(self.module) is not None

    @property
    def install(self) -> str:
        """Command that installs the solver."""
        return f"pip install 'lacmesh[{self.extra}]'" if self.extra else "pip install lacmesh"


#: every backend by its name, the direct ones in the order in which `auto` prefers them
BACKENDS: Mapping[str, Backend] = MappingProxyType(
    {
        b.name: b
        for b in (
            Backend("pardiso", True, "", "pardiso", "Intel MKL: proprietary, free of charge, some 900 MB"),
            Backend("rslab", True, "rslab", "", "comes with lacmesh"),
            Backend("mumps", True, "mumps", "mumps", "its wheels need numpy below 2"),
            Backend("cholmod", True, "kvxopt", "cholmod", "SuiteSparse through kvxopt: GPL"),
            Backend("superlu", True, "scipy", "", "SciPy's, always there: for small models"),
            Backend("multigrid", False, "pyamg", "multigrid", "smoothed aggregation and conjugate gradients"),
        )
    }
)


def backends() -> Mapping[str, Backend]:
    """Return the backends by name; `.installed` tells if one can be used, `.install` is the command to install it.

    >>> [b.name for b in backends().values() if not b.direct], backends()["superlu"].installed
    (['multigrid'], True)
    """
    return BACKENDS


def choose(backend: str, n: int, n_modes: int = 0, multigrid_above: int = MULTIGRID_ABOVE) -> Backend:
    """Return the backend of a name, or for `auto` the best one that is installed for n unknowns.

    `auto` takes multigrid above `multigrid_above` unknowns if the rigid-body modes of 3D (`n_modes` >= 6) are given,
    else the first direct one. Raises RequestError for a name that is unknown or not installed.

    >>> choose("superlu", 10).direct
    True
    """
    if backend == "auto":
        large = n > multigrid_above and n_modes >= _MODES_3D
        if large and BACKENDS["multigrid"].installed:
            return BACKENDS["multigrid"]
        return next(b for b in BACKENDS.values() if b.direct and b.installed)
    if backend not in BACKENDS:
        raise RequestError(f"no linear solver named {backend!r}{did_you_mean(backend, ('auto', *BACKENDS))}")
    chosen = BACKENDS[backend]
    if not chosen.installed:
        raise RequestError(f"the linear solver {backend} is not installed; {chosen.install}, or take another backend")
    return chosen
