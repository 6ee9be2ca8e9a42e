"""The edge of contact, from pressures on macro-elements: where their square, linear in the square of the distance as in
Hertz's contact, falls to zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
#: part of the peak above which a pressure counts
COUNTED = 0.15


def edge_of_contact(s: Floats, p: Floats, peak: float, inner: float) -> float:
    """Zero of the line fitted to p^2 over s^2 beyond `inner`; NaN where there is none.

    `s` (n,): distances from the middle of contact; `p` (n,): pressures, of which those near their peak count.

    >>> s = np.linspace(0, 2, 41)
    >>> round(edge_of_contact(s, np.sqrt(np.maximum(1 - (s / 1.5) ** 2, 0)), 1.0, 0.5), 12)
    1.5
    """
    outer = (s > inner) & (p > COUNTED * peak)
    if outer.sum() < 2:
        return float("nan")
    slope, start = np.polyfit(s[outer] ** 2, p[outer] ** 2, 1)
    return float(np.sqrt(-start / slope)) if slope < 0 < start else float("nan")
