"""Values of clearances and temperatures: a number, or a function of position and time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError
from lacmesh.mesh import Floats

#: a number, or f(points (n, 3), t) -> (n,)
ScalarField = float | Callable[[Floats, float], Floats]


def evaluate(value: ScalarField, points: Floats, t: float, what: str) -> NDArray[np.floating]:
    """Evaluate a value at points (..., 3) and time t; return an array (...). `what` names it in errors.

    Raises DataError for a value that is not finite (the message names the first place) or has the wrong shape.

    >>> evaluate(lambda x, t: t * x[:, 0], np.array([[1.0, 0, 0], [2.0, 0, 0]]), 0.5, "pressure")
    array([0.5, 1. ])
    """
    flat = points.reshape(-1, 3)
    got = np.asarray(value(flat, t) if callable(value) else value, dtype=float)
    if got.shape not in ((), (len(flat),)):
        raise DataError(f"{what}: the function returned {got.shape} for {len(flat)} points; return ({len(flat)},)")
    out = np.broadcast_to(got, len(flat))
    bad = np.flatnonzero(~np.isfinite(out))
    if len(bad):
        place = ", ".join(f"{c:.6g}" for c in flat[bad[0]])
        raise DataError(f"{what} is {out[bad[0]]} at ({place}), t = {t:.6g}; give a formula that is finite there")
    return out.reshape(points.shape[:-1])
