"""Noise: last bits of floating-point results as another processor or another build of BLAS would have them.

NOISE_SEED=1 pytest ...                      the tests with noise, and the commands that they start (`conftest.py`)
NOISE_SEED=1 pytest -p tests.noise lacmesh   the same where nothing of `tests` is run, as for examples in docstrings

`CHANGES` lists the functions that have noise, by module: elementary functions, dense and sparse linear algebra, and
what the kernels of `lacmesh.kernels` return. A result changes by a few units in the last place. The bits of a number
and the seed alone decide how much it changes. So a repetition and a restart agree to the last bit, as they do on any
one machine. numpy has another loop for arrays that are not contiguous, so their elementary functions have other noise.
Numbers of 29 significant bits or fewer stay, such as integers and halves.

A module is changed when a program imports it, so that a program imports nothing more than it does without noise.
"""

from __future__ import annotations

import functools
import os
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import PathFinder
from pathlib import Path

#: bits of a number: those that are zero if it stays, its exponent, and the exponent of the largest numbers
TAIL, EXPONENT, LARGEST = 0xFFFFFF, 0x7FF << 52, 0x7FE << 52


def shaken(x, ulps, salt=0):
    """Return float64 numbers (any shape), each changed by at most `ulps` units in its last place.

    `salt`: another number gives other changes.
    """
    import numpy as np

    bits = np.array(x, dtype=float, order="K").view(np.uint64)
    seed = (int(os.environ.get("NOISE_SEED") or 1) + (salt << 32)) * 0x9E3779B97F4A7C15 % 2**64
    mixed = (bits ^ np.uint64(seed)) * np.uint64(0xBF58476D1CE4E5B9)
    step = ((mixed ^ (mixed >> np.uint64(31))) % np.uint64(2 * ulps + 1)).astype(np.int64) - ulps
    exponent = bits & np.uint64(EXPONENT)
    stays = ((bits & np.uint64(TAIL)) == 0) | (exponent == 0) | (exponent >= np.uint64(LARGEST))
    return (bits.view(np.int64) + np.where(stays, 0, step)).view(np.float64)


def noisy(result, ulps, salt=0):
    """Return a result with noise: an array, a number, or a tuple of them; anything else stays."""
    import numpy as np

    if isinstance(result, tuple):
        parts = [noisy(part, ulps, salt) for part in result]
        return type(result)(*parts) if hasattr(result, "_fields") else tuple(parts)
    if type(result) in (float, np.float64):
        return type(result)(shaken([result], ulps, salt)[0])
    if type(result) is np.ndarray and result.dtype == np.float64 and result.size:
        return shaken(result, ulps, salt)
    return result


class Noisy:
    """A function whose results have noise. The function itself answers to everything else, such as `np.log.at`."""

    def __init__(self, function, ulps, elementary=False):
        functools.update_wrapper(self, function, updated=())
        self.function, self.ulps, self.elementary = function, ulps, elementary

    def __call__(self, *arguments, **options):
        """Call the function and return its result with noise, but for a view of an argument."""
        import numpy as np

        result = self.function(*arguments, **options)
        arrays = [a for a in arguments if isinstance(a, np.ndarray)]
        salt = int(self.elementary and not all(a.flags.forc for a in arrays))
        out = options.get("out")
        for one in out if isinstance(out, tuple) else () if out is None else (out,):
            one[...] = noisy(one, self.ulps, salt)
        if out is not None or (type(result) is np.ndarray and any(np.may_share_memory(result, a) for a in arrays)):
            return result
        return noisy(result, self.ulps, salt)

    def __getattr__(self, name):
        return getattr(self.function, name)


class Around:
    """An object of which some methods return results with noise, or such objects: `methods` by name."""

    def __init__(self, inner, methods):
        self._inner, self._methods = inner, methods

    def __getattr__(self, name):
        own = getattr(self._inner, name)
        return self._methods[name](own) if name in self._methods else own


#: noise of solutions of equations; of sums; of elementary functions, another for arrays that are not contiguous
solved = functools.partial(Noisy, ulps=4)
evaluated = functools.partial(Noisy, ulps=1)
elementary = functools.partial(Noisy, ulps=1, elementary=True)


def giving(**methods):
    """Return a change of a function to one that returns objects with noise in these methods."""
    return lambda function: functools.wraps(function)(lambda *a, **options: Around(function(*a, **options), methods))


def kernel(dispatch):
    """Return `Kernel.dispatch` with noise in what a kernel returns.

    What it writes into arrays stays: whether a number was written there depends on what a used buffer had before, and
    a restart has other buffers.
    """
    return functools.wraps(dispatch)(lambda self, *arguments: noisy(dispatch(self, *arguments), 1))


def known_to_numba(njit):
    """Let numba compile kernels that name functions with noise; what it compiles has none. Return `njit`."""
    from numba.core.registry import cpu_target
    from numba.extending import typeof_impl

    @typeof_impl.register(Noisy)
    def _(function, _):
        return cpu_target.typing_context.resolve_value_type(function.function)

    return njit


#: module -> (change of a function, names of functions). What is absent in a version of a module is left out
CHANGES = {
    "numpy": [
        (elementary, "exp exp2 expm1 log log2 log10 log1p sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh"),
        (elementary, "arcsinh arccosh arctanh power float_power cbrt hypot"),
        (evaluated, "einsum dot vdot inner matmul tensordot"),
    ],
    "numpy.linalg": [
        (solved, "solve inv pinv svd svdvals eig eigh eigvals eigvalsh qr cholesky lstsq det"),
        (evaluated, "norm"),
    ],
    "scipy.linalg": [
        (solved, "solve inv pinv svd svdvals eig eigh eigvals eigvalsh qr cholesky lstsq det expm solve_banded"),
        (solved, "lu_solve cho_solve solve_triangular"),
    ],
    "scipy.sparse.linalg": [(giving(solve=solved), "splu spilu"), (solved, "spsolve eigsh svds")],
    "rslab": [(giving(factor=giving(solve=solved, solve_many=solved)), "analyze")],
    "lacmesh.kernels": [(kernel, "Kernel.dispatch")],
    "numba": [(known_to_numba, "njit")],
}


def change(module):
    """Change the functions of a module, after the module ran."""
    for changed, names in CHANGES[module.__name__]:
        for name in names.split():
            *owner, last = name.split(".")
            where = functools.reduce(getattr, owner, module)
            if hasattr(where, last):
                setattr(where, last, changed(getattr(where, last)))


class AfterImport(MetaPathFinder):
    """Finder of the modules of `CHANGES`, which changes each of them after it is imported."""

    def find_spec(self, name, path, target=None):
        """Return the module's own spec, whose loader changes the module in the end."""
        spec = PathFinder.find_spec(name, path, target) if name in CHANGES else None
        if spec is None or spec.loader is None:
            return None
        execute = spec.loader.exec_module
        spec.loader.exec_module = lambda module: (execute(module), change(module))
        return spec


def install():
    """Change the modules of `CHANGES` once: now, or as they are imported, here and in the processes started here."""
    if any(isinstance(finder, AfterImport) for finder in sys.meta_path):
        return
    for name in CHANGES:
        if name in sys.modules:
            change(sys.modules[name])
    sys.meta_path.insert(0, AfterImport())
    folders = [str(Path(__file__).with_name("noise_at_start")), *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(folders)
    os.environ.setdefault("NOISE_SEED", "1")


install()
