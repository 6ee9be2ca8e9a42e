"""A material with memory, added from outside: elasticity that is damaged by the largest energy it has had."""

import numpy as np
import pytest

from lacsolver.bodies.material import Elastic, _to_tensor
from lacsolver.bodies.pointwise import PointResponse
from lacsolver.case import parse_case
from lacsolver.case.added import MATERIAL_LAWS
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import point_stress
from lacsolver.results.figures import step_figures
from lacsolver.results.results import Restart
from tests.lacsolver.bodies import cube
from tests.lacsolver.held import with_sides

YOUNG, SCALE = 1000.0, 0.1


class Damaged:
    """Stress exp(-w) C e, with w the largest e.C.e / 2 so far over a scale."""

    finite, n_history, density, reference_temperature = False, 1, 0.0, 0.0

    def __init__(self, young, scale):
        self.scale, self.C = scale, _to_tensor(Elastic(young, 0.0).elasticity())

    def respond(self, H, history):
        e = (H + H.swapaxes(1, 2)) / 2
        stress = np.einsum("sitj,ktj->ksi", self.C, e)
        energy = np.einsum("ksi,ksi->k", stress, e) / 2
        w = np.maximum(history[:, 0], energy / self.scale)
        grows, left = (w > history[:, 0]) / self.scale, np.exp(-w)
        softer = np.einsum("k,ksi,ktj->ksitj", left * grows, stress, stress)
        tangent = left[:, None, None, None, None] * self.C - softer
        return PointResponse(left[:, None, None] * stress, tangent, left * energy, w[:, None])


def test_a_bar_is_loaded_and_unloaded_and_a_restart_remembers(monkeypatch):
    """The exact solution: unloading goes back along the secant exp(-w) E of the largest strain."""
    monkeypatch.setitem(MATERIAL_LAWS, "damaged", Damaged)
    text = 'mesh = "bar.msh"\nmodel = "3d"\n[steps]\ntimes = [1.0, 2.0, 3.0]\n'
    text += f'[[material]]\nlaw = "damaged"\nconstants = {{ young = {YOUNG}, scale = {SCALE} }}\n'
    text += "".join(f'[[displacement]]\ngroup = "{a}0"\nu{a} = 0.0\n' for a in "xyz")
    text += '[[displacement]]\ngroup = "x1"\nux = [[0, 0.0], [1, 0.004], [2, 0.001], [3, 0.005]]\n'
    problem = Problem.of(parse_case(text), with_sides(cube("HEXA8", 2)))
    states = list(march(problem))
    for state, strain, largest in zip(states, (0.004, 0.001, 0.005), (0.004, 0.004, 0.005), strict=True):
        stress = np.exp(-YOUNG * largest**2 / 2 / SCALE) * YOUNG * strain
        (reaction,) = [problem.constraints.reaction("x1", state.reaction)[0]]
        assert reaction == pytest.approx(stress, rel=1e-9)
        (sigma,) = point_stress(problem, state)
        np.testing.assert_allclose(sigma[..., 0], stress, rtol=1e-9)
        assert step_figures(problem, state).energy == pytest.approx(stress * strain / 2, rel=1e-9)
    again = list(march(problem, start=Restart.of(states[1], states[1].step.step_size, 2)))
    np.testing.assert_array_equal(again[0].u, states[2].u)
