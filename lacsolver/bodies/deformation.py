"""Measures of a deformation F = I + H at a point, from its gradient of displacement H (3, 3), for kernels.

They are computed from H without subtracting 1 from numbers near 1, so that small strains keep their digits.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.kernels import kernel


@kernel
def change_of_volume(H: Any) -> float:
    """Return det(I + H) - 1 of H (3, 3)."""
    pairs = H[0, 0] * H[1, 1] - H[0, 1] * H[1, 0] + H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1]
    pairs += H[0, 0] * H[2, 2] - H[0, 2] * H[2, 0]
    det = (
        H[0, 0] * (H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1])
        - H[0, 1] * (H[1, 0] * H[2, 2] - H[1, 2] * H[2, 0])
        + H[0, 2] * (H[1, 0] * H[2, 1] - H[1, 1] * H[2, 0])
    )
    return H[0, 0] + H[1, 1] + H[2, 2] + pairs + det


@kernel
def inverse_transposed(H: Any, Y: Any) -> float:
    """Fill Y with F^-T of F = I + H, and return det F - 1; where F is singular Y is not finite."""
    change = change_of_volume(H)
    a, b, c, scale = 1.0 + H[0, 0], 1.0 + H[1, 1], 1.0 + H[2, 2], 1.0 / (1.0 + change)
    Y[0, 0] = (b * c - H[1, 2] * H[2, 1]) * scale
    Y[0, 1] = (H[1, 2] * H[2, 0] - H[1, 0] * c) * scale
    Y[0, 2] = (H[1, 0] * H[2, 1] - b * H[2, 0]) * scale
    Y[1, 0] = (H[0, 2] * H[2, 1] - H[0, 1] * c) * scale
    Y[1, 1] = (a * c - H[0, 2] * H[2, 0]) * scale
    Y[1, 2] = (H[0, 1] * H[2, 0] - a * H[2, 1]) * scale
    Y[2, 0] = (H[0, 1] * H[1, 2] - H[0, 2] * b) * scale
    Y[2, 1] = (H[0, 2] * H[1, 0] - a * H[1, 2]) * scale
    Y[2, 2] = (a * b - H[0, 1] * H[1, 0]) * scale
    return change


@kernel
def green_lagrange(H: Any, E: Any) -> None:
    """Fill E = (H + H^T + H^T H) / 2."""
    for i in range(3):
        for j in range(i + 1):
            E[i, j] = 0.5 * (H[i, j] + H[j, i] + H[0, i] * H[0, j] + H[1, i] * H[1, j] + H[2, i] * H[2, j])
            E[j, i] = E[i, j]


@kernel
def log_of_volume(E: Any) -> float:
    """Return ln J = ln det(I + 2 E) / 2."""
    a, b, c, d, e, f = 2.0 * E[0, 0], 2.0 * E[1, 1], 2.0 * E[2, 2], 2.0 * E[0, 1], 2.0 * E[1, 2], 2.0 * E[0, 2]
    pairs = a * b - d * d + b * c - e * e + a * c - f * f
    return 0.5 * np.log1p(a + b + c + pairs + a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f))


@kernel
def mark_inverted(H: Any, inverted: Any) -> None:
    """Set `inverted` (c,) for cells where det(I + H), H (c, q, 3, 3), is not above 0 at every point."""
    for e in range(len(H)):
        for q in range(H.shape[1]):
            if not change_of_volume(H[e, q]) > -1.0:
                inverted[e] = True
