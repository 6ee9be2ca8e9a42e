"""Entry point of the linear solvers: analysis and factorisation of a matrix by the backend of a given name."""

from __future__ import annotations

from importlib import import_module

import numpy as np
from scipy.sparse import issparse

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats
from lacsolver.linear.backends import MULTIGRID_ABOVE, choose
from lacsolver.linear.direct import rslab
from lacsolver.linear.direct.factor import DirectAnalysis
from lacsolver.linear.multigrid.factor import MultigridAnalysis
from lacsolver.linear.protocol import Analysis, Factor, Matrix


def analyse(
    K: Matrix,
    *,
    backend: str = "auto",
    threads: int = 1,
    modes: Floats | None = None,
    block: int | None = None,
    multigrid_above: int = MULTIGRID_ABOVE,
    definite: bool = True,
) -> Analysis:
    """Analyse a sparse, symmetric positive definite matrix (n, n), with both triangles and the whole diagonal stored.

    With `definite` false it may have negative eigenvalues, like the tangent of a buckling structure: it is then
    factorised by rslab, whose L D L^T pivots, whatever the backend.

    `.factor(K)` may be called repeatedly, with values in the same pattern; `.factor(K).solve(b)` gives K^-1 b for b
    (n,) or (n, k): for a direct backend, columns solved together cost much less than one by one.

    `threads`: cores, for all backends except superlu. `modes` (n, r) and `block` are for multigrid: the rigid-body
    modes, at least those of every body, and the number of unknowns of a node (that of a block matrix if None). `auto`
    takes multigrid above `multigrid_above` unknowns, see `choose`. A direct solution is exact to round-off, one of
    multigrid to the `tolerance` that `solve` takes.

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
    if not definite:
        return DirectAnalysis("rslab", K, lambda triangle: rslab.analyse(triangle, threads, definite=False), False)
    name = choose(backend, K.shape[0], 0 if modes is None else np.shape(modes)[-1], multigrid_above).name
    if name == "multigrid":
        return MultigridAnalysis(K, modes, block, threads)
    method = import_module(f"lacsolver.linear.direct.{name}")
    return DirectAnalysis(name, K, lambda triangle: method.analyse(triangle, threads))


def factorise(
    K: Matrix,
    *,
    backend: str = "auto",
    threads: int = 1,
    modes: Floats | None = None,
    block: int | None = None,
    multigrid_above: int = MULTIGRID_ABOVE,
) -> Factor:
    """Return the factor of a matrix that is factorised only once: `analyse` and `factor` in one call."""
    made = analyse(K, backend=backend, threads=threads, modes=modes, block=block, multigrid_above=multigrid_above)
    return made.factor(K)
