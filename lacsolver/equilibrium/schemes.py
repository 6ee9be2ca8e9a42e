"""Time schemes: what a step adds to static equilibrium.

A scheme answers for the terms of a step beside the static residual and tangent, predicts the next iterate, and commits
what it keeps, such as velocities. `QuasiStatic` adds nothing. Another scheme is a class with the members of
`TimeScheme`, and is given to `march`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple, Protocol

from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.equilibrium.state import Iterate, StepState

if TYPE_CHECKING:
    from lacsolver.equilibrium.load_step import LoadStep
    from lacsolver.equilibrium.reduced import ReducedProblem


class StepTerms(NamedTuple):
    """Terms of a step from one state to one time: the residual is r - force(q), the tangent K_q + matrix.

    `force(q)`: forces (n_q,) of inertia or damping at unknowns q; `matrix` (n_q, n_q): their derivative, constant over
    the step. The same matrix object for several steps means that its factor may be kept. `bent(q)`: what the derivative
    has beside it where it is not constant, on few unknowns. `reaction(q, out)`: forces of the supports (n_dof,) at q,
    from the unbalanced forces f_int - f + B^T p without terms of the scheme.
    """

    force: Callable[[Floats], Floats]
    matrix: csr_array
    bent: Callable[[Floats], csr_array | None] = lambda q: None
    reaction: Callable[[Floats, Floats], Floats] = lambda q, out: out


class TimeScheme(Protocol):
    """Interface of a time scheme."""

    @property
    def resists_rigid_motion(self) -> bool:
        """True if the matrix of each step makes the stiffness of free bodies definite, as a mass matrix does."""

    def begin(self, model: ReducedProblem, state: StepState, t: float) -> StepState:
        """Return the state that the first step, which ends at time t, starts from."""

    def terms(self, model: ReducedProblem, state: StepState, t: float) -> StepTerms | None:
        """Return the terms of the step from a state to time t; None if there are none."""

    def predict(self, state: StepState, t: float) -> Iterate | None:
        """Return an iterate to start from at time t; None for the linear predictor from the last state."""

    def commit(self, step: LoadStep, q: Floats, p: Floats) -> Mapping[str, NDArray]:
        """Return what the scheme keeps, by name, of a converged step with unknowns q (n_q,) and pressures p (m,)."""

    def too_coarse(self, model: ReducedProblem, state: StepState, kept: Mapping[str, NDArray]) -> bool:
        """True if a step from a state that converged, of which `kept` would be committed, is to be halved."""


class QuasiStatic:
    """Static equilibrium at each time. Rigid-body modes that only contact stops are stabilised (`stabilization`)."""

    resists_rigid_motion = False

    def begin(self, model: ReducedProblem, state: StepState, t: float) -> StepState:
        """Return the state."""
        return state

    def terms(self, model: ReducedProblem, state: StepState, t: float) -> StepTerms | None:
        """Return None."""
        return None

    def predict(self, state: StepState, t: float) -> Iterate | None:
        """Return the linear extrapolation of the last two steps."""
        return state.extrapolated(t)

    def commit(self, step: LoadStep, q: Floats, p: Floats) -> Mapping[str, NDArray]:
        """Return nothing."""
        return {}

    def too_coarse(self, model: ReducedProblem, state: StepState, kept: Mapping[str, NDArray]) -> bool:
        """Return False."""
        return False
