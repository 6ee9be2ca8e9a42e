"""A material law that the packages do not have, added from outside: Blatz and Ko's foam rubber, 1962."""

import numpy as np
import pytest

from lacsolver.bodies.pointwise import PointResponse
from lacsolver.case import parse_case
from lacsolver.case.added import MATERIAL_LAWS
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.bodies import cube, square
from tests.lacsolver.held import with_sides


class BlatzKo:
    """W = mu/2 (tr C^-1 + 2 J - 5), so that P = mu (J G - G G^T G) with G = F^-T."""

    finite, n_history, density, reference_temperature = True, 0, 0.0, 0.0

    def __init__(self, mu):
        self.mu = mu

    def respond(self, H, history):
        F = H + np.eye(3)
        J, G = np.linalg.det(F)[:, None, None], np.linalg.inv(F).swapaxes(1, 2)
        N, M = G @ G.swapaxes(1, 2), G.swapaxes(1, 2) @ G
        NG, J4 = N @ G, J[..., None, None]
        A = J4 * np.einsum("ksi,ktj->ksitj", G, G) - J4 * np.einsum("ksj,kti->ksitj", G, G)
        A += np.einsum("ksj,kti->ksitj", G, NG) + np.einsum("kst,kij->ksitj", N, M) + np.einsum("ksj,kti->ksitj", NG, G)
        energy = self.mu / 2 * (np.trace(M, axis1=1, axis2=2) + 2 * J[:, 0, 0] - 5)
        return PointResponse(self.mu * (J * G - NG), self.mu * A, energy, history)


@pytest.mark.parametrize("model, axes", [("3d", "xyz"), ("plane_stress", "xy")])
@pytest.mark.parametrize("stretch", [0.7, 1.5])
def test_a_bar_in_tension(monkeypatch, model, axes, stretch):
    """The exact solution: Cauchy stress mu (1 - L^-5/2) along the bar, stretches L^-1/4 across it."""
    monkeypatch.setitem(MATERIAL_LAWS, "blatz_ko", BlatzKo)
    mesh = with_sides(cube("HEXA8", 2) if model == "3d" else square("QUAD4", 2))
    text = f'mesh = "bar.msh"\nmodel = "{model}"\nkinematics = "finite"\n'
    text += '[[material]]\nlaw = "blatz_ko"\nconstants = { mu = 2.0 }\n'
    text += "".join(f'[[displacement]]\ngroup = "{a}0"\nu{a} = 0.0\n' for a in axes)
    text += f'[[displacement]]\ngroup = "x1"\nux = {stretch - 1}\n'
    problem = Problem.of(parse_case(text), mesh)
    (state,) = march(problem)
    moved = state.u.reshape(-1, len(axes))
    x = (mesh.points - mesh.points.min(axis=0))[:, : len(axes)]
    np.testing.assert_allclose(moved, x * np.where(np.arange(len(axes)) > 0, stretch**-0.25, stretch) - x, atol=1e-9)
    for sigma in problem.kinematics.stress(state.u, state.time):
        np.testing.assert_allclose(sigma[..., 0], 2.0 * (1 - stretch**-2.5), rtol=1e-8)
        np.testing.assert_allclose(sigma[..., 1:], 0.0, atol=1e-8)
