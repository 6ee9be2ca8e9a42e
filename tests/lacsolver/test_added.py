"""Laws and schemes that the packages do not have, added from outside, each against its exact solution.

A contact that is a bond which breaks at a tension, for good. Materials: Blatz and Ko's foam rubber, 1962; elasticity
that is damaged by the largest energy it has had, so that it has a memory. A time scheme: bodies that move slowly
through a viscous medium.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from lacsolver.bodies.material import Elastic, _to_tensor
from lacsolver.bodies.pointwise import PointResponse
from lacsolver.case import Force, Material, Steps
from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.contact.laws import CONTACT, Bilateral, Unilateral
from lacsolver.equilibrium.schemes import StepTerms
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import point_stress
from lacsolver.results.figures import step_figures
from tests.lacsolver.bodies import cube, square
from tests.lacsolver.held import with_sides
from tests.lacsolver.patch_meshes import stack
from tests.problems import ELASTIC, case_of, contact, fix, move

YOUNG, SCALE = 1000.0, 0.1
DRAG, FORCE, GAP = 50.0, -0.2, 0.05


def marched(mesh, *records, model="3d", scheme=None, **keys):
    """The problem of some records, and its states."""
    problem = Problem.of(case_of(mesh, *records, model=model, **keys), mesh)
    return problem, list(march(problem, scheme=scheme))


def columns(path, joint, *records):
    """The contact of two columns without Poisson's ratio, whose top moves along a path, in each step."""
    held = fix("x0", "x"), fix("y0", "y"), fix("bottom", "z"), move("top", uz=path)
    law = Material(young=YOUNG, poisson=0.0)
    _, states = marched(stack("HEXA8", "TETRA4", 3), law, joint, *held, *records)
    return [(state.zones[0], state.iterations) for state in states]


@dataclass(frozen=True)
class Bond(Bilateral):
    """No gap while the pressure is at least -strength; broken, pressure or gap. History: 1 where it is broken."""

    strength: float = 0.0

    n_history, exact = 1, True

    def next_active(self, rows):
        holds = rows.active & (rows.history[:, 0] == 0) & (rows.pressure >= -self.strength)
        return holds | Unilateral().next_active(rows)

    def residual(self, rows):
        beyond = np.minimum(rows.pressure + self.strength, 0.0) / rows.skin_stiffness
        bonded = rows.active & (rows.history[:, 0] == 0)
        return np.where(bonded, rows.gap + beyond, Unilateral().residual(rows))

    def status(self, rows):
        return np.where(rows.active, CONTACT, 0).astype(np.int8)

    def commit(self, rows):
        return np.maximum(rows.history, ~rows.active[:, None])


def test_a_bond_between_two_columns(monkeypatch):
    """Tension E u / 2 up to the strength, then a gap, and only pressure ever after."""
    monkeypatch.setitem(CONTACT_LAWS, "bond", Bond)
    path = [[0, 0], [1, 0.002], [2, 0.004], [3, 0.006], [4, -0.001], [5, 0.001]]
    zones = columns(path, contact(type="bond", constants={"strength": 2.5}), Steps(count=5, end=5.0))
    for (zone, _), pressure, gap in zip(zones, (-1, -2, 0, 0.5, 0), (0, 0, 0.006, 0, 0.001), strict=True):
        np.testing.assert_allclose(zone.pressure, pressure, atol=1e-9)
        np.testing.assert_allclose(zone.gap, gap, atol=1e-12)


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


@pytest.mark.parametrize(("model", "axes"), [("3d", "xyz"), ("plane_stress", "xy")])
@pytest.mark.parametrize("stretch", [0.7, 1.5])
def test_a_bar_of_foam_rubber(monkeypatch, model, axes, stretch):
    """Cauchy stress mu (1 - L^-5/2) along the bar, stretches L^-1/4 across it."""
    monkeypatch.setitem(MATERIAL_LAWS, "blatz_ko", BlatzKo)
    mesh = with_sides(cube("HEXA8", 2) if model == "3d" else square("QUAD4", 2))
    held = [fix(f"{a}0", a) for a in axes]
    law = Material(law="blatz_ko", constants={"mu": 2.0})
    problem, (state,) = marched(mesh, law, *held, move("x1", ux=stretch - 1), model=model, kinematics="finite")
    moved = state.u.reshape(-1, len(axes))
    x = (mesh.points - mesh.points.min(axis=0))[:, : len(axes)]
    np.testing.assert_allclose(moved, x * np.where(np.arange(len(axes)) > 0, stretch**-0.25, stretch) - x, atol=1e-9)
    for sigma in problem.kinematics.stress(state.u, state.time):
        np.testing.assert_allclose(sigma[..., 0], 2.0 * (1 - stretch**-2.5), rtol=1e-8)
        np.testing.assert_allclose(sigma[..., 1:], 0.0, atol=1e-8)


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


def test_a_bar_that_is_damaged_and_unloaded_and_a_restart_remembers(monkeypatch):
    """Unloading goes back along the secant exp(-w) E of the largest strain."""
    monkeypatch.setitem(MATERIAL_LAWS, "damaged", Damaged)
    law = Material(law="damaged", constants={"young": YOUNG, "scale": SCALE})
    pulled = move("x1", ux=[[0, 0.0], [1, 0.004], [2, 0.001], [3, 0.005]])
    held = [fix(f"{a}0", a) for a in "xyz"]
    problem, states = marched(with_sides(cube("HEXA8", 2)), law, *held, pulled, Steps(times=[1.0, 2.0, 3.0]))
    for state, strain, largest in zip(states, (0.004, 0.001, 0.005), (0.004, 0.004, 0.005), strict=True):
        stress = np.exp(-YOUNG * largest**2 / 2 / SCALE) * YOUNG * strain
        assert problem.constraints.reaction("x1", state.reaction)[0] == pytest.approx(stress, rel=1e-9)
        (sigma,) = point_stress(problem, state)
        np.testing.assert_allclose(sigma[..., 0], stress, rtol=1e-9)
        assert step_figures(problem, state).energy == pytest.approx(stress * strain / 2, rel=1e-9)
    again = list(march(problem, start=states[1].step))
    np.testing.assert_array_equal(again[0].u, states[2].u)


class Viscous:
    """Drag c on the velocity of each unknown, by the implicit Euler method: forces c (q - q_before) / dt."""

    resists_rigid_motion = True

    def __init__(self, drag):
        self.drag = drag

    def begin(self, model, state, t):
        return state

    def terms(self, model, state, t):
        n = model.problem.constraints.n_q
        before = np.zeros(n) if state.iterate is None else state.iterate.q
        c = self.drag / (t - state.time)
        return StepTerms(lambda q: c * (q - before), csr_array(c * eye_array(n)))

    def predict(self, state, t):
        return None

    def commit(self, step, q, p):
        state = step.state
        return {
            "velocity": np.zeros_like(q) if state.iterate is None else (q - state.iterate.q) / (step.t - state.time)
        }

    def too_coarse(self, model, state, kept):
        return False


@pytest.mark.rows("reference")
@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_a_block_sinks_onto_another(geometry):
    """It sinks as a rigid body by f t / c, until the other one carries all its load."""
    mesh = stack("HEXA8", "HEXA8", 3, gap=GAP, counts=(2, 2))
    upper = np.flatnonzero(mesh.points[:, 2] > 1 + GAP / 2)
    loads = fix("bottom", "xyz"), Force(group="upper", fz=f"{FORCE}"), Steps(count=15, end=60.0)
    problem, states = marched(mesh, ELASTIC, contact(geometry=geometry), *loads, scheme=Viscous(DRAG))
    sinking, resting = states[1], states[-1]
    sunk = np.tile([0, 0, FORCE * sinking.time / DRAG], (len(upper), 1))
    np.testing.assert_allclose(sinking.u.reshape(-1, 3)[upper], sunk, atol=1e-12)
    assert not sinking.zones[0].pressure.any()
    assert sinking.step.histories.scheme["velocity"].min() == pytest.approx(FORCE / DRAG)
    below = problem.space.mesh.points[:, 2] < 1e-9
    assert resting.reaction.reshape(-1, 3)[below, 2].sum() == pytest.approx(-FORCE * len(upper), rel=1e-3)
    assert np.abs(resting.step.histories.scheme["velocity"]).max() < 1e-5
