"""Finite rotations as functions of the rotation vector theta (axis times angle), and their derivatives.

    R = phi_0 I + phi_1 K + phi_2 theta theta^T,  K v = theta x v                        (Rodrigues)
    H = phi_1 I + phi_2 K + phi_3 theta theta^T:  the spin of a change d theta is H d theta

phi_n(s) = sum over k of (-s)^k / (2k + n)!, s = |theta|^2: cos, sin / |theta|, (1 - cos) / s, ... as functions of s
that are smooth at 0. They satisfy 2 s phi_n' + n phi_n = phi_(n-1), and phi_0' = -phi_1 / 2. H is singular where the
angle is a full turn: there d theta cannot represent every spin.
"""

from __future__ import annotations

from math import cos, factorial, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats

#: the series are used below this s, with this number of terms: the next term is below round-off
_SERIES, _TERMS = 1.0, 12


def turn(theta: Floats) -> NDArray[np.floating]:
    """Return R - I (3, 3), the displacement gradient of a rotation, without the round-off of subtracting I."""
    phi, _, _ = _phi(float(theta @ theta))
    K = _cross(theta)
    return np.asarray(phi[1] * K + phi[2] * K @ K)


def turn_derivative(theta: Floats) -> NDArray[np.floating]:
    """Return dR/dtheta_j at [j], (3, 3, 3)."""
    phi, d, _ = _phi(float(theta @ theta))
    K, square, axes = _cross(theta), np.outer(theta, theta), np.eye(3)
    along = 2 * theta[:, None, None] * (d[0] * axes + d[1] * K + d[2] * square)
    pairs = axes[:, :, None] * theta + theta[:, None] * axes[:, None]
    return np.asarray(along + phi[1] * _unit_cross() + phi[2] * pairs)


def turn_curvature(theta: Floats, M: Floats) -> NDArray[np.floating]:
    """Return the second derivative (3, 3) of R:M by theta, for a constant M (3, 3)."""
    phi, d, dd = _phi(float(theta @ theta))
    trace, w, N = np.trace(M), np.einsum("jsi,si->j", _unit_cross(), M), M + M.T
    whole = np.array([trace, theta @ w, theta @ M @ theta])
    slope = [np.outer(theta, v) + np.outer(v, theta) for v in (w, N @ theta)]
    out = 2 * np.eye(3) * (d[:3] @ whole) + 4 * np.outer(theta, theta) * (dd @ whole)
    return np.asarray(out + 2 * d[1] * slope[0] + 2 * d[2] * slope[1] + phi[2] * N)


def conjugate(theta: Floats, m: Floats) -> NDArray[np.floating]:
    """Return H^T m (3,), the force conjugate to theta of a moment m with fixed axes."""
    phi, _, _ = _phi(float(theta @ theta))
    return np.asarray(phi[1] * m - phi[2] * np.cross(theta, m) + phi[3] * theta * (theta @ m))


def conjugate_derivative(theta: Floats, m: Floats) -> NDArray[np.floating]:
    """Return d(H^T m)/dtheta (3, 3), column by column."""
    phi, d, _ = _phi(float(theta @ theta))
    along = d[1] * m - d[2] * np.cross(theta, m) + d[3] * theta * (theta @ m)
    # -e_j x m is m x e_j: the cross matrix of m
    out = 2 * np.outer(along, theta) + phi[2] * _cross(m) + phi[3] * ((theta @ m) * np.eye(3) + np.outer(theta, m))
    return np.asarray(out)


def _cross(v: Floats) -> NDArray[np.floating]:
    """Return the matrix (3, 3) that maps w to v x w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _unit_cross() -> NDArray[np.floating]:
    """Return the cross-product matrices of the three axes, (3, 3, 3)."""
    return np.stack([_cross(axis) for axis in np.eye(3)])


def _phi(s: float) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return phi_0 .. phi_3 at s, their first derivatives, and the second derivatives of the first three."""
    if s < _SERIES:
        return _series(s)
    a = sqrt(s)
    phi = [cos(a), sin(a) / a, (1 - cos(a)) / s, (a - sin(a)) / (a * s)]
    d = [-phi[1] / 2, *((phi[n - 1] - n * phi[n]) / (2 * s) for n in (1, 2, 3))]
    dd = [-d[1] / 2, *((d[n - 1] - (n + 2) * d[n]) / (2 * s) for n in (1, 2))]
    return np.array(phi), np.array(d), np.array(dd)


def _series(s: float) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    k = np.arange(_TERMS)
    power = np.array([(-1.0) ** j * s**j for j in k])
    c = np.array([[1 / factorial(2 * int(j) + n) for j in k] for n in range(4)])
    phi = c @ power
    d = -(c[:, 1:] * k[1:]) @ power[:-1]
    dd = (c[:3, 2:] * (k * (k - 1))[2:]) @ power[:-2]
    return phi, d, dd
