"""What a run has to tell: figures of every step, fields of the steps that are written, and what a restart goes on from.

Made by the stages that know them, written by `lacsolver.output`. Vectors have the space's dimension d; a moment has
three components in space and is one number, shape (), in a plane. Forces and areas are those of the whole thickness or
circle. Where there is nothing to tell a figure is NaN. Units are the case's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacsolver.results.state import Iterate, State, ZoneState

#: what `Results.status` may be: a run that was killed stays at the first
STATUSES = ("running", "done", "interrupted", "failed")


@dataclass(frozen=True, eq=False)
class ZoneFigures:
    """A zone at a time. Minima and maxima of pressure and gap are over paired macro-elements, of coverage over all.

    `contact_area`: of the covered parts of those in contact. `resultant` (d,), `moment` (3,) or (), about the origin:
    of the contact forces on the slave. `active`, `open`, `unpaired`: numbers of macro-elements.
    """

    pressure_min: float
    pressure_max: float
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


@dataclass(frozen=True, eq=False)
class StepFigures:
    """A converged step that ends at `time`. `iterations`: failed attempts included; `residuals`: of each iteration.

    `reactions`: what each displacement condition gives the body (d,); `probes`: their displacements (d,); `contact`:
    each zone's figures; always the same names. `balance`: relative error of the balance of forces and of moments.
    `energy`: strain energy. `displacement`: the largest of a node, its size.
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


@dataclass(frozen=True, eq=False)
class Results:
    """All figures of a run up to now. `version`: lacsolver's; `status`: one of STATUSES, `message` why it is not done,
    or what looks wrong in the answer, a line each.

    `steps`: those of this run (a restart's first is the one after the state that it goes on from). `stress`: group ->
    component -> least and largest at integration points, of the last step. `sizes`: how many nodes, cells, unknowns ...
    `timings`: seconds by phase. `memory`: bytes at the peak. `held`: of a run that is done, motions of bodies that
    nothing but contact stops, in words.
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

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"status is one of {', '.join(STATUSES)}, not {self.status!r}")


@dataclass(frozen=True, eq=False)
class ZoneFields:
    """A zone at a time, on the slave skin; arrays (n,) have a row each macro-element, as in `ZoneState`.

    `surface`: the slave's faces; `macro` (n_faces,): the row of each face's macro-element, -1 for none. `number` (n,):
    what a macro-element is called (`lac_macro` of the mesh). `recovered`: mean of the recovered pressure over each.
    `centre`, `normal` (n, d). On the mesh's nodes: `contact_force` (n_nodes, d), `pressure_recovered` (n_nodes,), NaN
    off the slave.
    """

    surface: Surface
    macro: Ints
    number: Ints
    pressure: Floats
    recovered: Floats
    gap: Floats
    status: Ints
    coverage: Floats
    area: Floats
    centre: Floats
    normal: Floats
    contact_force: Floats
    pressure_recovered: Floats

    @classmethod
    def of(
        cls, state: ZoneState, surface: Surface, macro: Ints, number: Ints, recovered: Floats, nodal: Floats
    ) -> ZoneFields:
        """The fields of a zone's state; `nodal` is `pressure_recovered`."""
        told = ("pressure", "gap", "status", "coverage", "area", "centre", "normal")
        own = {name: getattr(state, name) for name in told}
        return cls(
            surface, macro, number, recovered=recovered, contact_force=state.force, pressure_recovered=nodal, **own
        )


@dataclass(frozen=True, eq=False)
class Fields:
    """Fields at a time, on the mesh's nodes: `displacement` and `reaction` (n_nodes, d), `stress` (n_nodes, n_stress).

    Stress has the components of `space.COMPONENTS`; NaN on nodes of no cell of the body.
    """

    time: float
    displacement: Floats
    stress: Floats
    reaction: Floats
    zones: Mapping[str, ZoneFields]


@dataclass(frozen=True, eq=False)
class Restart:
    """What a run goes on from. `number`: converged steps up to here; `step_size`: of the step that would come next.

    `u` (n_dof,). By zone, `multipliers`: pressures (n,) of a contact, tractions (n, d) of a tie; and `status` (n,).
    `rigid`: by body, its dofs. `iterate`, `earlier`: as in `State`. `folder`: where it was read from, None for one of
    this run. `case`: the fingerprint of its case and mesh, None where nobody took it.
    """

    time: float
    step_size: float
    number: int
    u: NDArray
    multipliers: Mapping[str, NDArray]
    status: Mapping[str, Ints]
    rigid: Mapping[str, NDArray]
    iterate: Iterate
    earlier: tuple[float, Iterate] | None = None
    folder: Path | None = None
    case: Mapping[str, str] | None = None

    @classmethod
    def of(cls, state: State, step_size: float, number: int) -> Restart:
        """What to keep of a converged state, the `number`-th; `step_size`: of the next step."""
        multipliers = {zone.name: zone.traction if zone.tie else zone.pressure for zone in state.zones}
        status = {zone.name: zone.status for zone in state.zones}
        assert state.iterate is not None
        return cls(
            state.time, step_size, number, state.u, multipliers, status, state.rigid, state.iterate, state.earlier
        )
