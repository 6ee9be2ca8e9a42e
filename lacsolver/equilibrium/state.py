"""States: what a step commits and a restart stores, and what is reported of a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.facts import Described
from lacmesh.mesh import Floats, Ints
from lacsolver.contact.laws import CONTACT, OPEN, SLIDES, UNPAIRED
from lacsolver.equilibrium.motion import MotionState
from lacsolver.saddle.iterate import Histories, Iterate

__all__ = [
    "CONTACT",
    "OPEN",
    "SLIDES",
    "UNPAIRED",
    "Held",
    "Histories",
    "Iterate",
    "State",
    "StepState",
    "Work",
    "ZoneFriction",
    "ZoneState",
]


class Work(NamedTuple):
    """Work in static steps with friction, from the undeformed bodies on (`equilibrium.ledger`).

    `external`: of loads, supports and heat; `strain`: energy that bodies and springs store; `dissipation`: what
    friction has taken; `pressures`: work of contact along normals; `left`: external less all of these.
    """

    external: float
    strain: float
    dissipation: float
    pressures: float
    left: float

    @classmethod
    def of(cls, external: float, strain: float, dissipation: float, pressures: float) -> Work:
        """Return them with what is left.

        >>> Work.of(3.0, 1.0, 2.0, 0.0).left
        0.0
        """
        return cls(external, strain, dissipation, pressures, external - strain - dissipation - pressures)


@dataclass(frozen=True, eq=False, repr=False)
class StepState(Described):
    """The state that a step starts from: what the step before has committed, and all that a restart needs.

    `iterate`: unknowns, pressures and active set at `time`; None for the undeformed bodies. `earlier`: those of the
    step before, with their time. `step_size`: size of the next step, unless a planned time is nearer. `work`: that of
    all steps so far in a static case with friction, else None.
    """

    time: float = 0.0
    iterate: Iterate | None = None
    earlier: tuple[float, Iterate] | None = None
    step_size: float = np.inf
    histories: Histories = field(default_factory=Histories)
    work: Work | None = None

    def commit(
        self, time: float, iterate: Iterate, step_size: float, histories: Histories, work: Work | None = None
    ) -> StepState:
        """Return the state after a converged step."""
        earlier = None if self.iterate is None else (self.time, self.iterate)
        return StepState(time, iterate, earlier, step_size, histories, work)

    @property
    def motion(self) -> MotionState | None:
        """Velocities, accelerations, energies and momentum of a state with inertia; None for a static one."""
        return MotionState.of(self.histories.scheme)

    def with_step_size(self, step_size: float) -> StepState:
        """Return this state with another size of the next step."""
        return replace(self, step_size=step_size)

    def extrapolated(self, time: float) -> Iterate | None:
        """Return the linear extrapolation of the last two iterates to a time; None if there are fewer."""
        if self.iterate is None or self.earlier is None:
            return None
        now, (then, last) = self.iterate, self.earlier
        part = (time - self.time) / (self.time - then)
        return Iterate(now.q + part * (now.q - last.q), now.p + part * (now.p - last.p), now.active)


class ZoneFriction(NamedTuple):
    """Friction of a contact zone, one row per macro-element (n,), with k tangents: 1 in the plane, 2 in space.

    `tangents` (n, k, d): mean unit tangents; `shear` (n, k): traction on the master along them, that is, along the
    slave's slip; `slip` (n, k): mean slip of the step. `path`: length slipped so far; `use`: |shear| over its bound, 0
    where open; `dissipation`: energy taken so far, per area. Of the zone: `energy`, taken in the step and so far;
    `resultant` (d,) of friction on the slave.
    """

    tangents: Floats
    shear: Floats
    slip: Floats
    path: Floats
    use: Floats
    dissipation: Floats
    energy: tuple[float, float]
    resultant: Floats

    def in_space(self, components: Floats) -> NDArray[np.floating]:
        """Return components (n, k) along the tangents as vectors (n, d)."""
        return np.einsum("nk,nkd->nd", components, self.tangents)


@dataclass(frozen=True, eq=False, repr=False)
class ZoneState(Described):
    """State of a contact zone or a tie, one row per macro-element (n,); vectors have the space's dimension d.

    `pressure`: p_m >= 0 in compression, 0 where open; for a tie -traction . normal. `traction` (n, d): force per area
    on the slave, -p n for a contact, less the shear of friction. `gap`: mean gap G / w, NaN where unpaired; for a tie
    the magnitude of the mean jump. `status`: CONTACT, SLIDES, OPEN, UNPAIRED. `coverage`: w / A; `area`: A, in the
    measure that pressures refer to (undeformed for a tie), with thickness or 2 pi r. `centre` and `normal` (n, d) of
    the macro-element: deformed where contact is paired again, and of a tie under finite kinematics.
    `force` (n_nodes, d): contact force on every node of slave and master. `friction`: None without it.
    `dip` (n,): how far the slave is inside the master beyond the mean gap, of the macro-element's size; None of a tie.
    """

    name: str
    tie: bool
    pressure: Floats
    traction: Floats
    gap: Floats
    status: Ints
    coverage: Floats
    area: Floats
    centre: Floats
    normal: Floats
    force: Floats
    friction: ZoneFriction | None = None
    dip: Floats | None = None

    @property
    def shear(self) -> Floats | None:
        """Traction of friction on the master (n, d - 1), along `friction.tangents`; None without friction."""
        return None if self.friction is None else self.friction.shear

    @property
    def shear_vector(self) -> Floats | None:
        """Traction of friction on the master as a vector of space (n, d)."""
        return None if self.friction is None else self.friction.in_space(self.friction.shear)

    @property
    def slip(self) -> Floats | None:
        """Mean slip of the step (n, d - 1), along `friction.tangents`."""
        return None if self.friction is None else self.friction.slip

    @property
    def slip_vector(self) -> Floats | None:
        """Mean slip of the step as a vector of space (n, d)."""
        return None if self.friction is None else self.friction.in_space(self.friction.slip)

    @property
    def path(self) -> Floats | None:
        """Length slipped so far (n,)."""
        return None if self.friction is None else self.friction.path

    @property
    def use(self) -> Floats | None:
        """Traction of friction over its bound (n,), 1 where it slides."""
        return None if self.friction is None else self.friction.use

    @property
    def dissipation(self) -> Floats | None:
        """Energy per area that friction has taken so far (n,)."""
        return None if self.friction is None else self.friction.dissipation

    @property
    def of_friction(self) -> dict[str, Floats]:
        """Values of friction by name, a row for each macro-element, vectors in space; {} without friction."""
        if self.friction is None:
            return {}
        vectors = {name: self.friction.in_space(getattr(self.friction, name)) for name in ("shear", "slip")}
        return vectors | {name: getattr(self.friction, name) for name in ("path", "use", "dissipation")}


class Held(NamedTuple):
    """A rigid-body motion that only contact constrains, in `words`.

    `moved`: largest nodal displacement by it; `size`: least extent of its bodies; `part`: fraction of the contact
    stiffness that resists it, NaN if that was not computed because it is sufficient.
    """

    words: str
    moved: float
    size: float
    part: float = float("nan")


@dataclass(frozen=True, eq=False, repr=False)
class State(Described):
    """A converged state (or the last one tried). `u` (n_dof,): displacement; `zones`: in the case's order, ties last.

    `reaction` (n_dof,): forces of the supports on the bodies. `rigid` (name -> dofs): motion of rigid bodies,
    displacement of the centre, then rotation. `iterations`, `halvings`: numbers of the step that led here; `residuals`:
    those of its iterations, the last `n_unchanged_sets` of which had the same active set. `step`: what the step
    committed, for the next one and for a restart (for a state that did not converge, what it started from); `history`:
    that of the materials before the step, with which stress and energy at u are evaluated. At the last time of a case,
    `held`: rigid-body motions that only contact constrains, and `prescribed`: largest prescribed displacement.
    `equations`: forces (k,) of the equations C u = g of each record that has some, by name, which act on the bodies by
    C^T times them; `further`: values (n_s,) of the further unknowns of equations, by name. `linear_solver`: a sentence
    about the solver that had to take the place of rslab, "" where none had; `folded`: one about cells that are folded
    at a node, "" without any.
    """

    time: float
    u: NDArray[np.floating]
    reaction: NDArray[np.floating]
    zones: tuple[ZoneState, ...]
    rigid: dict[str, NDArray[np.floating]]
    iterations: int = 0
    halvings: int = 0
    residuals: tuple[float, ...] = ()
    step: StepState = field(default_factory=StepState)
    n_unchanged_sets: int = 0
    history: tuple[NDArray[np.floating], ...] = ()
    held: tuple[Held, ...] = ()
    prescribed: float = 0.0
    equations: Mapping[str, NDArray[np.floating]] = field(default_factory=dict)
    further: Mapping[str, NDArray[np.floating]] = field(default_factory=dict)
    linear_solver: str = ""
    folded: str = ""
