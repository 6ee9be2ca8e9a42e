"""Rates of convergence: how fast an error e falls with the mesh size h, e ~ C h^r."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def pairwise(h: Sequence[float], error: Sequence[float]) -> NDArray[np.floating]:
    """Rates (n - 1,) of convergence from each level to the next.

    >>> pairwise([1, 0.5, 0.25], [8, 2, 0.5]).round(12).tolist()
    [2.0, 2.0]
    """
    return np.asarray(np.diff(_log(error)) / np.diff(_log(h)))


def fitted(h: Sequence[float], error: Sequence[float], last: int | None = None) -> float:
    """The slope of log e on log h by least squares, over the last few levels or all. Raises ValueError below two.

    >>> round(fitted([1, 0.5, 0.25], [8, 2.1, 0.5]), 12)
    2.0
    """
    x, y = (_log(values[-last if last else None :]) for values in (h, error))
    if len(x) < 2:
        raise ValueError(f"a rate takes two levels or more, not {len(x)}")
    x = x - x.mean()
    return float(x @ y / (x @ x))


def _log(values: Sequence[float]) -> NDArray[np.floating]:
    """Logarithms; NaN for values that have none, because a rate to or from an error of zero is undefined."""
    array = np.asarray(values, dtype=float)
    return np.log(np.where(array > 0, array, np.nan))
