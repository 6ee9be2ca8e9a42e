"""Compare sympy's derivatives with numerical ones of the displacement itself, and with laws of mechanics."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver import parse_case
from lacsolver.case import Value
from verification.exact.sources import Law, derive
from verification.families.manufactured import LAW, PLANE, ROWS, SOLID, case_of

PROBLEMS = {"plane": PLANE, "solid": SOLID}
#: of a pair of opposite differences of a polynomial of degree 10 with an exact gradient inside
STEP, ROUNDING = 1e-4, 1e-7
LAWS = pytest.mark.parametrize("law", [LAW, pytest.param(Law(7.0, 0.3), marks=pytest.mark.slow)])


@pytest.fixture(params=PROBLEMS)
def given(request):
    return PROBLEMS[request.param]


def places(given, n=40):
    return np.random.default_rng(1).uniform(given.low, given.high, (n, given.dim))


def displacement(given, points):
    names = dict(zip("xyz", points.T, strict=False))
    return np.stack([eval(text, {}, names) for text in given.displacement], axis=-1)


def gradient_of_motion(given, points):
    """F (n, dim, dim) by complex steps, which have no rounding."""
    F = np.tile(np.eye(given.dim), (len(points), 1, 1))
    for j in range(given.dim):
        F[:, :, j] += displacement(given, points + 1e-40j * np.eye(given.dim)[j]).imag / 1e-40
    return F


def nominal_stress(given, points, law=LAW):
    F = gradient_of_motion(given, points)
    E = 0.5 * (np.swapaxes(F, 1, 2) @ F - np.eye(given.dim))
    lame, mu = (
        law.young * law.poisson / ((1 + law.poisson) * (1 - 2 * law.poisson)),
        law.young / (2 * (1 + law.poisson)),
    )
    return F @ (lame * np.trace(E, axis1=1, axis2=2)[:, None, None] * np.eye(given.dim) + 2 * mu * E)


def told(texts, points):
    """Values at points that the solver gives to texts of the case."""
    return np.stack([Value.of(text)(points, 1.0) for text in texts], axis=-1)


@LAWS
def test_stress_is_that_of_the_law(given, law):
    points = places(given)
    made = np.stack([told(row, points) for row in derive(given.displacement, law).stress], axis=1)
    right = nominal_stress(given, points, law)
    np.testing.assert_allclose(made, right, rtol=0, atol=1e-13 * np.abs(right).max())


@LAWS
def test_body_force_is_minus_the_divergence_of_stress(given, law):
    points = places(given)
    right = np.zeros_like(points)
    for j, e in enumerate(STEP * np.eye(given.dim)):
        right -= (nominal_stress(given, points + e, law) - nominal_stress(given, points - e, law))[:, :, j] / (2 * STEP)
    made = told(derive(given.displacement, law).body_force, points)
    np.testing.assert_allclose(made, right, rtol=0, atol=ROUNDING * np.abs(right).max())


def on_slave(given):
    points = places(given)
    points[:, -1] = 0.0
    return points


def normal_of_slave(given, points):
    """Outward, on the deformed face: across the tangents, which are the first columns of F."""
    F = gradient_of_motion(given, points)
    m = np.stack([F[:, 1, 0], -F[:, 0, 0]], axis=1) if given.dim == 2 else -np.cross(F[:, :, 0], F[:, :, 1])
    return m / np.linalg.norm(m, axis=1, keepdims=True)


@LAWS
def test_the_slave_carries_its_load_and_the_pressure(given, law):
    points, sources = on_slave(given), derive(given.displacement, law)
    n = normal_of_slave(given, points)
    tangential, p = told(sources.tangential, points), told([sources.pressure], points)
    right = -nominal_stress(given, points, law)[:, :, -1]
    np.testing.assert_allclose(tangential - p * n, right, rtol=0, atol=1e-14)
    np.testing.assert_allclose((tangential * n).sum(axis=1), 0, atol=1e-15)
    assert p.min() > 0


def test_the_deformed_slave_lies_on_the_master(given):
    points = on_slave(given)
    where = points + displacement(given, points)
    height = eval(given.master_height, {}, dict(zip("xyz", where.T, strict=False)))
    np.testing.assert_allclose(where[:, -1], height, atol=1e-15)


def box_rule(low, high, n=8):
    """Gauss points and weights of a box, or of a side of it (where low and high agree)."""
    t, w = np.polynomial.legendre.leggauss(n)
    axes = [((a + b) / 2 + (b - a) / 2 * t, (b - a) / 2 * w) if b > a else (np.array([a]), np.ones(1)) for a, b in
            zip(low, high, strict=True)]  # fmt: skip
    points = np.stack(np.meshgrid(*(x for x, _ in axes), indexing="ij"), axis=-1).reshape(-1, len(axes))
    weights = np.stack(np.meshgrid(*(w for _, w in axes), indexing="ij"), axis=-1).prod(axis=-1)
    return points, weights.ravel()


def side(given, name):
    """The rule of a side, by its name in the mesh."""
    low, high = np.array(given.low), np.array(given.high)
    axis, end = "xyz".index(name[0]), int(name[1])
    at = (low, high)[end][axis]
    low[axis] = high[axis] = at
    return box_rule(low, high)


def loads_of_the_case(given):
    """Points, forces at them: all that the case of a row applies at t = 1."""
    case = parse_case(case_of(next(row for row in ROWS.values() if row.solution is given)))
    found = [(*box_rule(given.low, given.high), case.body_force[0], "f")]
    found += [(*side(given, load.group), load, "t") for load in case.traction]
    for points, w, record, letter in found:
        values = [getattr(record, letter + axis)(points, 1.0) for axis in "xyz"[: given.dim]]
        yield points, w[:, None] * np.stack(values, axis=-1)


def test_loads_pressure_and_hold_balance_each_other(given):
    """Resultant and, on the deformed block, moment: P F^T is symmetric, which no single formula knows."""
    up = "xyz"[given.dim - 1]
    bottom, w = side(given, f"{up}0")
    pressure = told([derive(given.displacement, LAW).pressure], bottom)
    acting = [*loads_of_the_case(given), (bottom, -w[:, None] * pressure * normal_of_slave(given, bottom))]
    top, w = side(given, f"{up}1")
    acting.append((top, w[:, None] * nominal_stress(given, top)[:, :, -1]))
    force = sum(f.sum(axis=0) for _, f in acting)
    size = sum(np.abs(f).sum() for _, f in acting)
    moment = sum(turning(points + displacement(given, points), f) for points, f in acting)
    np.testing.assert_allclose(force, 0, atol=1e-13 * size)
    np.testing.assert_allclose(moment, 0, atol=1e-13 * size)


def turning(x, f):
    return (x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]).sum() if x.shape[1] == 2 else np.cross(x, f).sum(axis=0)
