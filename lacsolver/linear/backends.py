"""The linear solvers: their properties, installation, the choice of `auto`, and analysis and factorisation by one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.sparse import csr_array, issparse

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.mesh import Floats
from lacsolver.linear.accuracy import Matrix
from lacsolver.linear.direct.factor import DirectAnalysis, DirectFactor
from lacsolver.linear.direct.pardiso import library
from lacsolver.linear.direct.reserve import superlu_serves

if TYPE_CHECKING:
    from lacsolver.linear.multigrid.factor import MultigridAnalysis, MultigridFactor

#: factor of a matrix; `iterative` if its basic operation approximates K^-1, and a solution takes many of them
Factor: TypeAlias = "DirectFactor | MultigridFactor"
Analysis: TypeAlias = "DirectAnalysis | MultigridAnalysis"

#: above this number of unknowns in 3D, contact costs less with multigrid than with a factorisation
#: (docs/benchmarks.md)
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
        if self.name == "rslab":
            return not why_no_rslab()
        return find_spec(self.module) is not None

    @property
    def install(self) -> str:
        """Command that installs the solver."""
        return f"pip install 'lacmesh[{self.extra}]'" if self.extra else "pip install lacmesh"


@cache
def why_no_rslab() -> str:
    """Return why rslab cannot be loaded, "" if it can: a wheel may be there that does not fit the system."""
    try:
        import_module("rslab")
    except Exception as error:
        return str(error) or type(error).__name__
    return ""


#: every backend by its name, the direct ones in the order in which `auto` prefers them
BACKENDS: Mapping[str, Backend] = MappingProxyType(
    {
        b.name: b
        for b in (
            Backend("pardiso", True, "", "pardiso", "Intel MKL: proprietary, free of charge, some 900 MB"),
            Backend("rslab", True, "rslab", "", "comes with lacmesh"),
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


def choose(backend: str, n: int, n_modes: int = 0) -> Backend:
    """Return the backend of a name, or for `auto` the best one that is installed for n unknowns.

    `auto` takes multigrid above `MULTIGRID_ABOVE` unknowns if the rigid-body modes of 3D (`n_modes` >= 6) are given,
    else the first direct one. Raises RequestError for a name that is unknown or not installed.

    >>> choose("superlu", 10).direct
    True
    """
    if backend == "auto":
        large = n > MULTIGRID_ABOVE and n_modes >= _MODES_3D
        if large and BACKENDS["multigrid"].installed:
            return BACKENDS["multigrid"]
        return next(b for b in BACKENDS.values() if b.direct and b.installed)
    if backend not in BACKENDS:
        raise RequestError(f"no linear solver named {backend!r}{did_you_mean(backend, ('auto', *BACKENDS))}")
    chosen = BACKENDS[backend]
    if not chosen.installed:
        raise RequestError(f"the linear solver {backend} is not installed; {chosen.install}, or take another backend")
    return chosen


def analyse(
    K: Matrix,
    *,
    backend: str = "auto",
    threads: int = 1,
    modes: Floats | None = None,
    block: int | None = None,
    near: csr_array | None = None,
    definite: bool = True,
) -> Analysis:
    """Analyse a sparse, symmetric positive definite matrix (n, n), with both triangles and the whole diagonal stored.

    With `definite` false it may have negative eigenvalues, like the tangent of a buckling structure: it is then
    factorised by rslab, whose L D L^T pivots, whatever the backend. SuperLU takes the place of rslab where that cannot
    be loaded (for `auto`) or fails: a warning says so, and the analysis has it as its `note`.

    `.factor(K)` may be called repeatedly, with values in the same pattern; `.factor(K).solve(b)` gives K^-1 b for b
    (n,) or (n, k): for a direct backend, columns solved together cost much less than one by one.

    `threads`: cores, for all backends except superlu. `modes` (n, r), `block` and `near` are for multigrid: the
    rigid-body modes, at least those of every body; the number of unknowns of a node (that of a block matrix if None);
    and which nodes may be in one aggregate (`multigrid.aggregation.aggregated`). `auto` takes multigrid above
    `MULTIGRID_ABOVE` unknowns, see `choose`. A direct solution is exact to round-off, one of multigrid to the
    `tolerance` that `solve` takes.

    Raises RequestError for a backend that is unknown or not installed; `factor` raises SingularError.

    >>> from scipy.sparse import csr_array
    >>> K = csr_array(np.array([[2.0, -1.0], [-1.0, 2.0]]))
    >>> factor = analyse(K, backend="superlu").factor(K)
    >>> factor.solve(np.array([0.0, 3.0])).round(12).tolist(), factor.n_solves
    ([1.0, 2.0], 1)
    """
    if not issparse(K) or K.shape[0] != K.shape[1]:
        raise RequestError("a linear solver takes a sparse square matrix")
    if threads < 1:
        raise RequestError(f"threads is 1 or more, not {threads}")
    if definite:
        name = choose(backend, K.shape[0], 0 if modes is None else np.shape(modes)[-1]).name
    else:
        name = "superlu" if why_no_rslab() else "rslab"
    if name == "multigrid":
        from lacsolver.linear.multigrid.factor import MultigridAnalysis

        return MultigridAnalysis(K, modes, block, threads, near)
    note = ""
    if name == "superlu" and why_no_rslab() and backend != "superlu":
        note = superlu_serves("cannot be loaded", why_no_rslab(), "pip install rslab")
    return DirectAnalysis(name, K, threads, definite, note)
