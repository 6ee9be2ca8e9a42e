"""Records of results: figures of every step, fields of the steps that are written, and the state for a restart.

`lacsolver.output` writes them. Vectors have the space's dimension d; a moment has three components in space and is one
number, shape (), in a plane. Forces and areas are those of the whole thickness or circle. Figures without a value are
NaN. Units are those of the case.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.facts import Described
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacsolver.constraints.coupling import CouplingState
from lacsolver.constraints.pretension import SectionForces
from lacsolver.equilibrium.state import CONTACT, OPEN, SLIDES, State, StepState, Work, ZoneState
from lacsolver.problem.adjust import Adjustment
from lacsolver.problem.resultants import Resultant

#: values of `Results.status`; a run that was killed keeps the first
STATUSES = ("running", "done", "interrupted", "failed")


class FrictionFigures(NamedTuple):
    """Figures of the friction of a zone at one time: numbers of macro-elements that stick and that slide.

    `slip_max`: largest slip of the step; `dissipation`: energy taken in the step, and so far; `friction` (d,): its
    resultant on the slave.
    """

    sticking: int
    sliding: int
    slip_max: float
    dissipation: tuple[float, float]
    friction: Floats


@dataclass(frozen=True, eq=False, repr=False)
class ZoneFigures(Described):
    """Figures of a zone at one time.

    Minima and maxima of pressure and gap are over paired macro-elements, those of coverage over all. `pressure_mean`:
    mean over the covered area of the macro-elements in contact. `contact_area`: covered area of the macro-elements in
    contact. `resultant` (d,) and `moment` (3,) or (), about the origin, of the contact forces on the slave, friction
    included. `active`, `open`, `unpaired`: numbers of macro-elements. `friction`: figures of friction, None without it.

    >>> from tempfile import TemporaryDirectory
    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> with TemporaryDirectory() as folder:
    ...     zone = ls.run(example("two_blocks.toml"), f"{folder}/results").steps[-1].contact["joint"]
    >>> zone.active, zone.open, float(zone.resultant[2].round(6))
    (36, 0, 10.435185)
    """

    pressure_min: float
    pressure_max: float
    pressure_mean: float
    gap_min: float
    gap_max: float
    contact_area: float
    resultant: Floats
    moment: Floats
    coverage_min: float
    coverage_max: float
    active: int
    open: int
    unpaired: int
    friction: FrictionFigures | None = None


@dataclass(frozen=True, eq=False, repr=False)
class MotionFigures(Described):
    """Figures of a step in motion (NaN in static steps before the start of [dynamics]).

    `energies`: named as in `equilibrium.motion.ENERGIES`, kinetic + strain + soft_contact - external + damped +
    contact + friction + numerical = 0; `momentum`: `linear` (d,) and `angular`, (3,) or () in a plane, about the
    origin. `impulse`: by zone, that of the contact forces on the slave since the start, (d,). `velocities`,
    `accelerations`: of each probe, (d,).
    """

    energies: Mapping[str, float]
    momentum: Mapping[str, Floats]
    impulse: Mapping[str, Floats]
    velocities: Mapping[str, Floats]
    accelerations: Mapping[str, Floats]


class PlasticFigures(NamedTuple):
    """Figures of materials that yield, over their integration points and volume.

    `strain_max`: largest accumulated plastic strain; `von_mises_max`: largest equivalent stress; `dissipation`: energy
    that the flow took in the step, and so far.
    """

    strain_max: float
    von_mises_max: float
    dissipation: tuple[float, float]


@dataclass(frozen=True, eq=False, repr=False)
class StepFigures(Described):
    """Figures of a converged step that ends at `time`.

    `iterations`: number of iterations, failed attempts included; `residuals`: residual after each iteration;
    `reactions`: force (d,) of each displacement condition on the body; `probes`: displacement (d,) of each probe;
    `contact`: figures of each zone; the names are the same in every step. `balance`: relative error of the balance of
    forces and of moments. `energy`: strain energy. `displacement`: largest magnitude of a nodal displacement. `motion`:
    energies, velocities and the like of a case with [dynamics], None for others. `work`: ledger of a static case with
    friction so far, None for others. `plastic`: figures of materials that yield, None without. `equations`: force of
    each equation, which acts on each of its terms times the term's factor. `couplings`: motion, force and moment of
    each coupling. `pretension`: forces and shortening of each section of a bolt.

    >>> from tempfile import TemporaryDirectory
    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> with TemporaryDirectory() as folder:
    ...     steps = ls.run(example("two_blocks.toml"), f"{folder}/results").steps
    >>> [(step.time, float(step.reactions["bottom"][2].round(6))) for step in steps]
    [(0.5, 5.217593), (1.0, 10.435185)]
    """

    time: float
    iterations: int
    halvings: int
    residuals: tuple[float, ...]
    reactions: Mapping[str, Floats]
    probes: Mapping[str, Floats]
    contact: Mapping[str, ZoneFigures]
    balance: tuple[float, float]
    energy: float
    displacement: float = float("nan")
    motion: MotionFigures | None = None
    work: Work | None = None
    plastic: PlasticFigures | None = None
    equations: Mapping[str, float] = field(default_factory=dict)
    couplings: Mapping[str, CouplingState] = field(default_factory=dict)
    pretension: Mapping[str, SectionForces] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class Results(Described):
    """All figures of a run so far.

    `version`: version of lacsolver; `status`: one of STATUSES; `message`: reason why the run is not done, or doubts
    about its results, one per line. `steps`: steps of this run (for a restart, those after its initial state).
    `stress`: group -> component -> least and largest value at integration points, in the last step. `sizes`: numbers
    of nodes, cells, unknowns ... `timings`: seconds by phase. `memory`: peak memory in bytes. `held`: for a finished
    run, rigid-body motions that only contact constrains, in words. `roles`: by zone its slave, its master, and why the
    slave was chosen, "" where the case says which it is. `loads`: for a finished run, the resultant of
    each load at its end. `overlap`: by zone, the deepest overlap of the undeformed bodies, clearance included;
    `bridged`: by tie, the widest gap across it.
    `units`: the names of units that the case gives. `adjusted`: by zone, how far slave nodes were moved onto the
    master. `sectors`: by name, the sides, the axis and the number of the sectors of a ring.

    >>> results = Results(version="0.1.0")
    >>> results.status, len(results.steps)
    ('running', 0)
    """

    version: str
    status: str = "running"
    message: str = ""
    steps: tuple[StepFigures, ...] = ()
    stress: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    sizes: Mapping[str, int] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    memory: int = 0
    held: tuple[str, ...] = ()
    roles: Mapping[str, tuple[str, str, str]] = field(default_factory=dict)
    loads: tuple[Resultant, ...] = ()
    overlap: Mapping[str, float] = field(default_factory=dict)
    bridged: Mapping[str, float] = field(default_factory=dict)
    units: str = ""
    adjusted: Mapping[str, Adjustment] = field(default_factory=dict)
    sectors: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"status is one of {', '.join(STATUSES)}, not {self.status!r}")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ZoneFields(ZoneState):
    """Fields of a zone at one time: its state, and what is recovered of it on the slave skin.

    `surface`: the slave's faces; `macro` (n_faces,): row of each face's macro-element, -1 for none. `number` (n,):
    number of each macro-element (`lac_macro` of the mesh). `recovered` (n,): mean of the recovered pressure over each.
    On the mesh's nodes: `pressure_recovered` (n_nodes,), NaN off the slave, and with friction `shear_recovered`
    (n_nodes, d), the continuous traction of friction on the master.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> zone = ls.solve(example("two_blocks.toml")).contact["joint"]
    >>> len(zone.pressure), zone.contact_force.shape, bool((zone.status == 1).all())
    (36, (512, 3), True)
    """

    surface: Surface
    macro: Ints
    number: Ints
    recovered: Floats
    pressure_recovered: Floats
    shear_recovered: Floats | None = None

    @property
    def contact_force(self) -> Floats:
        """Contact force (n_nodes, d) on each node of slave and master: `force`."""
        return self.force

    @property
    def resultant(self) -> Floats:
        """Resultant (d,) of the contact forces on the slave."""
        total: Floats = self.force[self.surface.faces.distinct_nodes].sum(axis=0)
        return total

    def _title(self) -> str:
        return "Contact"

    def _facts(self) -> dict[str, str]:
        on = self.status >= CONTACT
        facts = {"macro-elements": f"{len(on):,}: {int(on.sum()):,} closed, {int((self.status == OPEN).sum()):,} open"}
        facts["pressure"] = f"at most {self.pressure.max(initial=0.0):.6g}; pressure, recovered ({len(on)},)"
        facts["gap"] = (
            f"{np.nanmin(self.gap):.6g} to {np.nanmax(self.gap):.6g}" if np.isfinite(self.gap).any() else "none"
        )
        facts["resultant"] = ", ".join(f"{part:.6g}" for part in self.resultant)
        facts["area"] = f"{self.area.sum():.6g}"
        if self.friction is not None:
            sticks, slides = ((self.status == status).sum() for status in (CONTACT, SLIDES))
            facts["friction"] = f"{sticks:,} stick, {slides:,} slide; shear, slip, path, use, dissipation"
        return facts | {"also": "status, coverage, centre, normal, force, surface, macro, number"}


@dataclass(frozen=True, eq=False, repr=False)
class Fields(Described):
    """Fields at one time on the mesh's nodes: `displacement`, `reaction` (n_nodes, d), `stress` (n_nodes, n_stress).

    Stress has the components of `space.COMPONENTS`; it is NaN on nodes of no cell of the body. `velocity` and
    `acceleration` (n_nodes, d) are those of a case with [dynamics], 0 in its static steps; None for other cases.
    `plastic_strain` (n_nodes,): accumulated plastic strain, None if no material yields.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> fields = ls.solve(example("two_blocks.toml")).fields
    >>> fields.time, fields.displacement.shape, fields.stress.shape
    (1.0, (512, 3), (512, 6))
    """

    time: float
    displacement: Floats
    stress: Floats
    reaction: Floats
    zones: Mapping[str, ZoneFields]
    velocity: Floats | None = None
    acceleration: Floats | None = None
    plastic_strain: Floats | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Restart(Described):
    """State for a restart: the `step` that was committed, and what a reader of the file wants to see of it.

    `number`: number of converged steps so far. `u` (n_dof,). By zone, `multipliers`: pressures (n,) of a contact,
    tractions (n, d) of a tie; and `status` (n,). `rigid`: motion of each rigid body. `folder`: folder that the state
    was read from, None for a state of this run. `case`: fingerprint of its case and mesh, None if it was not computed.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import read_case, run
    >>> from lacsolver.output import create_output, read_state
    >>> case = read_case("data/two_blocks.toml")
    >>> with TemporaryDirectory() as folder:
    ...     done = run(case, create_output(folder))
    ...     restart = read_state(folder, case, 0.5)
    >>> restart.time, restart.number, list(restart.multipliers)
    (0.5, 1, ['joint'])
    """

    step: StepState
    number: int
    u: NDArray
    multipliers: Mapping[str, NDArray]
    status: Mapping[str, Ints]
    rigid: Mapping[str, NDArray]
    folder: Path | None = None
    case: Mapping[str, str] | None = None

    @property
    def time(self) -> float:
        """Time of the state."""
        return self.step.time

    @property
    def step_size(self) -> float:
        """Size of the next step."""
        return self.step.step_size

    @classmethod
    def of(cls, state: State, step_size: float, number: int) -> Restart:
        """Make the restart of a converged state, the `number`-th; `step_size`: size of the next step."""
        multipliers = {zone.name: zone.traction if zone.tie else zone.pressure for zone in state.zones}
        status = {zone.name: zone.status for zone in state.zones}
        return cls(state.step.with_step_size(step_size), number, state.u, multipliers, status, state.rigid)
