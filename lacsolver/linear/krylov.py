"""Generalised conjugate residuals (GCR): the Krylov loop of all iterative solutions; and conjugate gradients.

For A x = b with any preconditioner, one that changes included (GMRES with a flexible preconditioner, Saad 1993). Each
direction z is stored with its image A z; the images are made orthonormal, A Z = I T^T with rows I, so that the residual
is the smallest over all directions, and the step follows from a small triangular system.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from lacmesh.mesh import Floats
from lacsolver.linear.vectors import Vectors

#: orthogonalise a second time when the first pass leaves less than this fraction of the norm; fraction that is noise
_LOST, _NOISE = 0.1, 1e-12
#: a known direction whose image depends on the earlier ones but for this fraction is passed over
_REPEATED = 1e-8
#: a residual that is below this fraction of the least before has made progress
_PROGRESS = 0.9


class LinearSystem(Protocol):
    """Interface of a system for `minimise`."""

    vectors: Vectors

    def precondition(self, r: Floats) -> Floats:
        """Return a direction for a residual."""

    def image(self, z: Floats) -> Floats:
        """Return A z."""


def minimise(
    system: LinearSystem,
    r: Floats,
    excess: Callable[[Floats], float],
    limit: int,
    *,
    known: Floats | Sequence[Floats] = (),
    least: float = 0.0,
    patience: int | None = None,
) -> tuple[NDArray[np.floating], NDArray[np.floating], int]:
    """Return the step x (n,) that minimises the residual r (m,) over `known` directions and at most `limit` others.

    With it, the residual (m,) that it leaves by recurrence, and the number of those others that it took.

    `excess(r)`: a residual relative to its tolerance; the loop ends where it is 1 or less, once the known directions
    are used. It also ends at a norm of `least`, at a direction that depends on the earlier ones up to round-off, and
    when the norm has not fallen by a tenth for `patience` directions. Known directions that depend on one another are
    passed over.
    """
    vectors, k, r, n_new = system.vectors, 0, r.copy(), 0
    given, most = iter(known), len(known) + limit
    Z = images = np.empty((0, 0))  # made at the first direction; the system gives memory to a row when it is written
    T, along = np.zeros((most, most)), np.zeros(most)
    best, since = np.inf, 0
    while n_new < limit and vectors.norm(r) > least:
        z = next(given, None)
        is_known = z is not None
        if z is None:
            left = vectors.norm(r)
            best, since = (left, 0) if left < _PROGRESS * best else (best, since + 1)
            if excess(r) <= 1 or (patience is not None and since >= patience):
                break
            z = system.precondition(r)
        image = system.image(z)
        if not k:
            Z, images = np.empty((most, len(z))), np.empty((most, len(image)))
        Z[k] = z
        before = vectors.norm(image)
        T[k, :k], T[k, k] = _orthogonalise(image, images[:k], vectors)
        if not T[k, k] > (_REPEATED if is_known else _NOISE) * before:
            if is_known:
                continue
            break
        images[k] = image / T[k, k]
        along[k] = vectors.dots(images[k : k + 1], r)[0]
        r -= along[k] * images[k]
        k, n_new = k + 1, n_new + (not is_known)
    x = np.zeros(Z.shape[1])
    if k:
        part = solve_triangular(T[:k, :k], along[:k], trans="T", lower=True)
        vectors.subtract(-vectors.same(part), Z[:k], x)
    return x, r, n_new


def _orthogonalise(image: Floats, others: Floats, vectors: Vectors) -> tuple[NDArray[np.floating], float]:
    """Orthogonalise an image against orthonormal rows `others`, in place; return the products and the norm left."""
    before = vectors.norm(image)
    parts = vectors.dots(others, image)
    vectors.subtract(parts, others, image)
    left = vectors.norm(image)
    if left < _LOST * before:
        again = vectors.dots(others, image)
        vectors.subtract(again, others, image)
        parts, left = parts + again, vectors.norm(image)
    return parts, left


def conjugate_gradients(
    apply: Callable[[Floats], Floats], b: Floats, vectors: Vectors, reduction: float, most: int
) -> NDArray[np.floating]:
    """Return x (n,) with A x = b for a symmetric positive definite A = `apply` that is well conditioned.

    It ends where the residual by recurrence is `reduction` times that at 0, or after `most` steps (Hestenes and Stiefel
    1952). Of several processes `apply` takes and returns own entries, as b has them.

    >>> from lacsolver.linear.vectors import WHOLE
    >>> conjugate_gradients(lambda x: np.array([2.0, 4.0]) * x, np.array([2.0, 8.0]), WHOLE, 1e-15, 10).round(12)
    array([1., 2.])
    """
    x, r = np.zeros_like(b), b.copy()
    direction, square = r.copy(), vectors.dots(r[None], r)[0]
    least = reduction**2 * square
    for _ in range(most):
        if not square > least:
            break
        image = apply(direction)
        step = square / vectors.dots(image[None], direction)[0]
        x += step * direction
        r -= step * image
        before, square = square, vectors.dots(r[None], r)[0]
        direction = r + (square / before) * direction
    return x
