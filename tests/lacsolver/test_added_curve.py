"""Contact laws that are not linear, added from outside: p = k g^2 of the overlap, and p = p0 exp(-g / c)."""

import numpy as np
import pytest
from scipy.optimize import brentq

from lacsolver.case import parse_case
from lacsolver.case.added import CONTACT_LAWS
from lacsolver.contact.laws import Unilateral
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.contact_cases import HEAD, JOINT, SLIDING, held
from tests.lacsolver.patch_meshes import stack
from tests.samples import each_option


class Curve(Unilateral):
    """p(g) up to a gap `reach`: its tangent at the gap where it is softer than the skin, at the pressure if stiffer."""

    yields = True

    def __init__(self, p, slope, gap, knee, reach):  # `gap`: of a pressure; `knee`: the pressure at a slope
        self.__dict__.update(p=p, slope=slope, gap=gap, knee=knee, reach=reach, compliance=0.0)  # frozen

    def next_active(self, rows):
        return rows.gap < self.reach

    def linearise(self, rows):
        knee = self.knee(rows.skin_stiffness)
        stiff = (rows.gap < self.gap(knee)) | (rows.pressure > knee)
        g = np.where(stiff, self.gap(np.maximum(rows.pressure, knee)), rows.gap)
        slope = np.maximum(self.slope(g), 1e-3 * rows.skin_stiffness)  # at first touch there may be none
        return g + self.p(g) / slope, 1 / slope

    def residual(self, rows):
        p, g = np.where(self.next_active(rows), self.p(rows.gap), 0.0), rows.gap
        return (p - rows.pressure) / (self.slope(g) + rows.skin_stiffness)


def quadratic(k):
    p, slope = lambda g: k * np.minimum(g, 0) ** 2, lambda g: -2 * k * np.minimum(g, 0)
    return Curve(p, slope, lambda p: -np.sqrt(p / k), lambda s: s**2 / k / 4, 0)


def exponential(c):
    p = lambda g: np.exp(np.minimum(-g / c, 300))  # noqa: E731
    return Curve(p, lambda g: p(g) / c, lambda p: -c * np.log(p), lambda s: s * c, 12 * c)


LAWS = [(quadratic, 1e9), (exponential, 1e-2), (quadratic, 1e3), (quadratic, 1e6), (exponential, 1e-4)]


@pytest.mark.parametrize(
    ("make", "size", "geometry"), each_option((*law, geometry) for law in LAWS for geometry in ("reference", "current"))
)
def test_columns(make, size, geometry, monkeypatch):
    """Pressed by d, 2 p / E - g(p) = d; then apart or nearly so, pressed again, and far apart."""
    law = make(size)
    monkeypatch.setitem(CONTACT_LAWS, "curve", lambda: law)
    text = HEAD.format(model="3d") + "[steps]\ncount = 4\nend = 4.0\nmax_halvings = 0\n[[material]]\nyoung = 1e3\n"
    text += f'poisson = 0.0\n{JOINT}type = "curve"\ngeometry = "{geometry}"\n' + SLIDING + held("bottom", uz=0.0)
    text += held("top", uz=[[0, 0], [1, -0.01], [2, 0.002], [3, -0.005], [4, 0.5]])
    states = march(Problem.of(parse_case(text), stack("HEXA8", "TETRA4", 3)))
    for state, d in zip(states, (0.01, -0.002, 0.005, -0.5), strict=True):
        p = brentq(lambda p, d=d: 2e-3 * p - law.gap(p) - d, 1e-9, 1e4, xtol=1e-14) if -d < law.reach else 0.0
        np.testing.assert_allclose(state.zones[0].pressure, p, rtol=2e-8, atol=1e-12)
        np.testing.assert_allclose(state.zones[0].gap, 2e-3 * p - d, rtol=1e-8, atol=1e-12)
        assert state.iterations <= 6
