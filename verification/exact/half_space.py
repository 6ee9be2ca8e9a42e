"""Hertz's contact of half-spaces in closed form: displacements and strains at any depth, in a plane, about an axis.

A frictionless half-space z >= 0 (z the depth) under a normal pressure has one harmonic potential phi (Barber,
Elasticity, 3rd ed., solution F, with omega = d phi / dz, mu the shear modulus):

    2 mu u_r = (1 - 2 nu) phi_r + z omega_r          2 mu u_z = -2 (1 - nu) omega + z omega_z
    p = omega_z at z = 0

Plane (Muskhelishvili; Johnson, Contact Mechanics, 4.2), p = p0 sqrt(1 - x^2 / a^2), zeta = x + i z:

    W = p0 / a (sqrt(a^2 - zeta^2) + i zeta),  omega_z = Re W,  omega = Im int W,  phi = -Re int int W

about an axis (Green and Collins' complex shift; Barber, 30.2), p = p0 sqrt(1 - r^2 / a^2), w = z + i a,
S = sqrt(r^2 + w^2), L = ln(w + S), C = -p0 / (2 a):

    omega = C Im [(a^2 + z^2 - r^2 / 2) L - 2 z S + w S / 2]
    omega_z = C Im [2 z L - 2 S],  omega_zz = C Im [2 L - 2 i a / S]

Signs here: omega < 0 under pressure, so that u_z > 0 into the body. In the plane omega is known up to a constant; here
it is 0 at the surface's point x = 0. `p0`, E: stress; lengths as given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Complex = NDArray[np.complexfloating]


@dataclass(frozen=True)
class Potential:
    """Derivatives of phi at points, each (n,): by r (or x) and by z; `hoop`: phi_r / r, `omega_hoop`: omega_r / r."""

    phi_r: Floats
    phi_rr: Floats
    omega: Floats
    omega_r: Floats
    omega_z: Floats
    omega_rr: Floats
    omega_rz: Floats
    omega_zz: Floats
    hoop: Floats
    omega_hoop: Floats


def plane(x: Floats, z: Floats, a: float, p0: float) -> Potential:
    """Potential of Hertz's pressure of peak p0 on the strip |x| <= a of the plane."""
    zeta: Complex = np.asarray(x + 1j * z)
    root = _root_plane(zeta, a)
    c = p0 / a
    # d zeta = i dz: V is the integral of W, U that of V
    W = c * (root + 1j * zeta)
    arc = np.arcsin(_inside(np.asarray(zeta / a)))
    V = c / 2 * (zeta * root + a**2 * arc + 1j * zeta**2)
    dW = c * (-zeta / np.where(root == 0, 1e-300, root) + 1j)
    zero = np.zeros_like(x)
    return Potential(
        phi_r=-V.real, phi_rr=-W.real, omega=V.imag, omega_r=W.imag, omega_z=W.real,
        omega_rr=dW.imag, omega_rz=dW.real, omega_zz=-dW.imag, hoop=zero, omega_hoop=zero,
    )  # fmt: skip


def _inside(zeta: Complex) -> Complex:
    """Points in the upper half of the plane, those on its edge from above."""
    return zeta.real + 1j * np.maximum(zeta.imag, 1e-300)


def _root_plane(zeta: Complex, a: float) -> Complex:
    """sqrt(a^2 - zeta^2), positive inside and continuous in the upper half, where it tends to -i zeta."""
    return np.sqrt(a - _inside(zeta)) * np.sqrt(a + _inside(zeta))


def about_axis(r: Floats, z: Floats, a: float, p0: float) -> Potential:
    """Potential of Hertz's pressure of peak p0 on the disc r <= a."""
    w = z + 1j * a
    S = np.sqrt(r**2 + w**2)
    S = np.where(S.imag < 0, -S, S)  # on the surface inside the disc
    S = np.where(S == 0, 1e-300, S)
    L = np.log(w + S)
    c = -p0 / (2 * a)
    omega = c * ((a**2 + z**2 - r**2 / 2) * L - 2 * z * S + w * S / 2).imag
    omega_z = c * (2 * z * L - 2 * S).imag
    omega_zz = c * (2 * L - 2j * a / S).imag
    ring = 1 / (S * (w + S))  # L_r = r ring; S_r = r / S
    omega_hoop = c * ((a**2 + z**2 - r**2 / 2) * ring - L - 2 * z / S + w / (2 * S)).imag
    omega_rz_hoop = c * (2 * z * ring - 2 / S).imag
    hoop = _hoop(r, z, w, S, L, omega_z, a, c)
    return Potential(
        phi_r=r * hoop, phi_rr=-omega_z - hoop, omega=omega, omega_r=r * omega_hoop, omega_z=omega_z,
        omega_rr=-omega_zz - omega_hoop, omega_rz=r * omega_rz_hoop, omega_zz=omega_zz,
        hoop=hoop, omega_hoop=omega_hoop,
    )  # fmt: skip


def _hoop(r: Floats, z: Floats, w: Complex, S: Complex, L: Complex, omega_z: Floats, a: float, c: float) -> Floats:
    """phi_r / r, from r phi_r = C Im int (a^2 + (w - z)^2) (1 - w / S) dw; near r = 0 its limit."""
    t = w - z
    # int w / S = S; int w^2 / S = (w S - r^2 L) / 2; int w^3 / S = w^2 S / 3 - 2 r^2 S / 3
    over = (a**2 + z**2) * S - z * (w * S - r**2 * L) + w**2 * S / 3 - 2 * r**2 * S / 3
    square = c * (a**2 * t + t**3 / 3 - over).imag
    near = r < 1e-4 * a
    return np.where(near, -omega_z / 2, square / np.where(near, 1.0, r**2))


@dataclass(frozen=True)
class Strains:
    """Displacement and strain at points (n,): u_r outward, u_z into the body; `tt` is the hoop strain."""

    u_r: Floats
    u_z: Floats
    rr: Floats
    tt: Floats
    zz: Floats
    rz: Floats


def strains(of: Potential, z: Floats, young: float, poisson: float) -> Strains:
    """Displacements and strains that a potential gives at depths z (n,) for these elastic constants."""
    nu, two_mu = poisson, young / (1 + poisson)
    return Strains(
        u_r=((1 - 2 * nu) * of.phi_r + z * of.omega_r) / two_mu,
        u_z=(-2 * (1 - nu) * of.omega + z * of.omega_z) / two_mu,
        rr=((1 - 2 * nu) * of.phi_rr + z * of.omega_rr) / two_mu,
        tt=((1 - 2 * nu) * of.hoop + z * of.omega_hoop) / two_mu,
        zz=((2 * nu - 1) * of.omega_z + z * of.omega_zz) / two_mu,
        rz=z * of.omega_rz / two_mu,  # (u_r,z + u_z,r) / 2, in which the terms of omega_r cancel
    )


def peak_pressure(a: float, radius: float, modulus: float, *, plane: bool) -> float:
    """p0 of a half-width or radius a under a clearance r^2 / 2R (Johnson, 4.24 and 4.45); `modulus` is E*."""
    return modulus * a / radius * (0.5 if plane else 2 / np.pi)


def contact_modulus(bodies: list[tuple[float, float]]) -> float:
    """E* of two bodies, or of one on a rigid one: 1 / E* = sum of (1 - nu^2) / E of (E, nu)."""
    return 1 / sum((1 - nu**2) / young for young, nu in bodies)
