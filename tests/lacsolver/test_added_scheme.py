"""A time scheme that the packages do not have, added from outside: bodies that move slowly through a viscous medium."""

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from lacsolver.case import parse_case
from lacsolver.equilibrium.schemes import StepTerms
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.patch_meshes import stack

DRAG, FORCE, GAP = 50.0, -0.2, 0.05


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


@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_a_block_sinks_onto_another(geometry):
    """The exact solution: it sinks as a rigid body by f t / c, until the other one carries all its load."""
    mesh = stack("HEXA8", "HEXA8", 3, gap=GAP, counts=(2, 2))
    upper = np.flatnonzero(mesh.points[:, 2] > 1 + GAP / 2)
    text = (
        'mesh = "two.msh"\nmodel = "3d"\n[steps]\ncount = 15\nend = 60.0\n[[material]]\nyoung = 1000.0\npoisson = 0.3\n'
    )
    text += f'[[contact]]\nslave = "slave"\nmaster = "master"\ngeometry = "{geometry}"\n'
    text += '[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\nuz = 0.0\n'
    text += f'[[force]]\ngroup = "upper"\nfz = "{FORCE}"\n'
    problem = Problem.of(parse_case(text), mesh)
    states, below = list(march(problem, scheme=Viscous(DRAG))), problem.space.mesh.points[:, 2] < 1e-9
    sinking, resting = states[1], states[-1]
    sunk = np.tile([0, 0, FORCE * sinking.time / DRAG], (len(upper), 1))
    np.testing.assert_allclose(sinking.u.reshape(-1, 3)[upper], sunk, atol=1e-12)
    assert not sinking.zones[0].pressure.any() and sinking.step.histories.scheme["velocity"].min() == pytest.approx(
        FORCE / DRAG
    )
    carried = resting.reaction.reshape(-1, 3)[below, 2].sum()
    assert carried == pytest.approx(-FORCE * len(upper), rel=1e-3)
    assert np.abs(resting.step.histories.scheme["velocity"]).max() < 1e-5
