"""A flat rigid punch on an elastic half-plane with friction: the part that sticks, by integral equations.

Spence, Proc. R. Soc. A 305, 1968, 55; J. Elasticity 5, 1975, 297. Under a load that grows, |x| < c sticks and slides
outside, the same c at all loads. With beta = (1 - 2 nu) / (2 (1 - nu)), p and q (along x) on the half-plane (Johnson,
Contact Mechanics, 2.25), H f = 1 / pi of the principal value of int f(s) / (x - s) ds:

    H p = beta q on |x| < 1,   H q = -beta p on |x| < c,   q = mu p sign(x) on c < |x| < 1

Integrated along x, with ln |x - s| for 1 / (x - s), they are solved by constants on elements between x = sin(angle),
angles even, with the equations in their middle in angle; c is where q, which sticks, comes to mu p. `coupled=False`
leaves beta q out: then c is known, K'(c) / K(c) = beta / mu.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipk, ellipkm1

Floats = NDArray[np.floating]
#: elements to half of the punch, of the coarser of two solutions that are extrapolated
ELEMENTS = 100


def stick_edge(poisson: float, friction: float, *, coupled: bool = True, elements: int = ELEMENTS) -> float:
    """c over the half-width of the punch: from two numbers of elements, the error falling like their inverse."""
    beta = (1 - 2 * poisson) / (2 * (1 - poisson))
    coarse, fine = (_edge(beta, friction, coupled, n) for n in (elements, 2 * elements))
    return 2 * fine - coarse


def uncoupled_edge(poisson: float, friction: float) -> float:
    """c where shear does not act on the pressure, K'(c) / K(c) = beta / mu with the modulus c."""
    ratio = (1 - 2 * poisson) / (2 * (1 - poisson)) / friction
    return float(brentq(lambda c: ellipkm1(c**2) / ellipk(c**2) - ratio, 1e-12, 1 - 1e-12))


def tractions(beta: float, friction: float, sticking: int, coupled: bool, n: int) -> tuple[Floats, Floats, Floats]:
    """Middles x, p and q (n,) on elements of half of the punch under unit load, of which the first so many stick."""
    edges = np.sin(np.linspace(0, np.pi / 2, n + 1))
    x = np.sin((np.arange(n) + 0.5) / n * np.pi / 2)
    even, odd = _logarithm(x, edges, 1), _logarithm(x, edges, -1)
    before = np.tril(np.broadcast_to(np.diff(edges), (n, n)), -1) + np.diag(x - edges[:-1])  # int from 0 to x
    A, B = np.zeros((2 * n + 1, 2 * n + 1)), np.zeros(2 * n + 1)  # the last unknown: the depth of the punch
    A[:n, :n], A[:n, n:-1], A[:n, -1] = even, -beta * before if coupled else 0.0, 1.0
    A[n:-1, n:-1], A[n:-1, :n] = odd, beta * before
    A[-1, :n], B[-1] = 2 * np.diff(edges), 1.0
    slides = n + np.arange(sticking, n)
    A[slides] = 0.0
    A[slides, slides], A[slides, slides - n] = 1.0, -friction
    p, q = np.split(np.linalg.solve(A, B)[:-1], 2)
    return x, p, q


def _logarithm(x: Floats, edges: Floats, parity: int) -> Floats:
    """1 / pi int ln |x - s| ds of constants on elements (n,) at places x (n,), with as much, or its negative, at -s."""

    def primitive(s: Floats) -> Floats:
        return np.asarray(s * np.log(np.abs(s)) - s)

    near, far = primitive(x[:, None] - edges), primitive(x[:, None] + edges)
    return np.asarray((-np.diff(near, axis=1) + parity * np.diff(far, axis=1)) / np.pi)


def _edge(beta: float, friction: float, coupled: bool, n: int) -> float:
    """Place where the shear stress that sticks comes to friction times the pressure."""
    low, high = 1, n - 1
    while high - low > 1:  # where few stick, q of the last stays below mu p
        middle = (low + high) // 2
        if _excess(beta, friction, middle, coupled, n) > 0:
            high = middle
        else:
            low = middle
    a, b = (_excess(beta, friction, k, coupled, n) for k in (low, high))
    share = low + a / (a - b)
    return float(np.sin(share / n * np.pi / 2))


def _excess(beta: float, friction: float, sticking: int, coupled: bool, n: int) -> float:
    _, p, q = tractions(beta, friction, sticking, coupled, n)
    return float(q[sticking - 1] - friction * p[sticking - 1])
