"""The rest of the table of keys: the whole case, its steps, solver, output and probes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.errors import RequestError
from lacmesh.facts import Described, listed
from lacsolver.case.entry import Entry
from lacsolver.case.errors import Issue
from lacsolver.case.joints import Coupling, Cyclic, Equation, Pretension, Spring
from lacsolver.case.keys import MODELS, As, Groups, Load, Needs, Numbers, Values, hidden, key, section
from lacsolver.case.kinds import (
    GROUPS,
    MESH_FILE,
    NOT_NEGATIVE,
    POINT,
    POSITIVE,
    THICKNESS,
    UNITS,
    choice,
    number,
    numbers,
    text,
    whole,
)
from lacsolver.case.records import (
    NOT_KIND_OF_AT,
    PLANAR,
    SPACE,
    WHERE,
    AtNodes,
    BodyForce,
    Contact,
    Displacement,
    Force,
    Gravity,
    Material,
    Pressure,
    Rigid,
    Temperature,
    Tie,
    Traction,
)
from lacsolver.case.rules import BACKENDS_OF, check
from lacsolver.case.toml import section_text
from lacsolver.case.value import Value, with_values
from lacsolver.case.value_kinds import TIMES, VALUE, VECTOR_OF_TIME

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh, MeshLike
else:  # pydantic looks at the names of types, and reading a case needs no numpy
    Mesh = MeshLike = Any

#: fields that are written of a motion, if [output] does not tell
_OUTPUTS = 100


class Probe(AtNodes, header="[[probe]]", one_of=WHERE, not_both=NOT_KIND_OF_AT, named_after="group"):
    """[[probe]]: displacement recorded in each step: the mean over the nodes of a group, or of one node.

    >>> Probe(group="top").name
    'top'
    """

    name: str = key(text("a name"), "", "name in the results", None, "the group's name")


_HHT, _NEWMARK = Needs("scheme", ("hht",)), Needs("scheme", ("newmark",))


class Dynamics(Entry, header="[dynamics]"):
    """[dynamics]: motion with inertia; without this section all steps are in static equilibrium.

    >>> Dynamics(scheme="newmark").beta
    0.25
    """

    scheme: str = key(
        choice({
            "hht": "Hilber, Hughes and Taylor, second order, damps the highest frequencies",
            "newmark": "Newmark's method; without damping if beta = 1/4, gamma = 1/2",
        }), "", "time scheme", "hht",
    )  # fmt: skip
    alpha: float = key(number(0, 1 / 3, open=False), "", "numerical damping; 0 is Newmark's method", 0.02, needs=_HHT)
    beta: float = key(NOT_NEGATIVE, "", "weight of the acceleration in displacements", 0.25, needs=_NEWMARK)
    gamma: float = key(NOT_NEGATIVE, "", "weight of the acceleration in velocities", 0.5, needs=_NEWMARK)
    start: float = key(
        NOT_NEGATIVE, "time", "time from which inertia acts; static equilibrium before, as under a preload", 0.0
    )
    massless: str = key(
        choice({
            "skins": "slave and master surfaces, and the nodes that the cut made",
            "slave": "slave surfaces, and the nodes that the cut made",
            "internal": "the internal nodes of the macro-elements",
            "none": "no nodes: pressures oscillate, and energy is created at impacts",
        }), "", "nodes without mass, whose mass goes to their neighbours", "skins",
    )  # fmt: skip
    mass: str = key(
        choice({
            "consistent": "by the shape functions of displacements",
            "lumped": "diagonal (Hinton, Rock and Zienkiewicz)",
        }), "", "mass matrix of the cells", "consistent",
    )  # fmt: skip
    rayleigh: As[tuple[float, float], Sequence[float]] = key(
        numbers(2, NOT_NEGATIVE), "1 / time, time",
        "[a, b] of the damping matrix a M + b K, with K of the undeformed bodies", (0.0, 0.0), "[0.0, 0.0]",
    )  # fmt: skip


def _initial(unit: str, meaning: str, models: tuple[str, ...] = MODELS) -> Any:
    return key(VALUE, unit, meaning, None, models=models)


class Initial(Entry, header="[[initial]]", some_of=(("vx", "vy", "vz", "rotation", "ux", "uy", "uz"),)):
    """[[initial]]: velocity and displacement at the start of [dynamics]; later sections replace what earlier ones give.

    >>> Initial(groups=["ball"], vy=-3.0)
    Initial(groups=('ball',), vy=-3.0)
    """

    groups: Groups = key(GROUPS, "", "groups of cells that move in this way", None, "the whole mesh")
    vx: Load = _initial("length / time", "velocity along x")
    vy: Load = _initial("length / time", "velocity along y")
    vz: Load = _initial("length / time", "velocity along z", SPACE)
    rotation: Values = key(
        VECTOR_OF_TIME, "radian / time",
        "angular velocity about the centre, added to vx, vy, vz; one number in a plane", None, models=PLANAR,
    )  # fmt: skip
    centre: Numbers = key(
        POINT, "length", "centre of the rotation", None, "the mean of the groups' nodes", models=PLANAR
    )
    ux: Load = _initial("length", "displacement along x")
    uy: Load = _initial("length", "displacement along y")
    uz: Load = _initial("length", "displacement along z", SPACE)


class Steps(Entry, header="[steps]", not_both=(("end", "times"), ("count", "times"))):
    """[steps]: times, from 0 on; a step that does not converge is halved.

    >>> Steps(count=4).planned
    (0.25, 0.5, 0.75, 1.0)
    """

    end: float = key(POSITIVE, "time", "end of the analysis; numbers given as loads reach their value then", 1.0)
    count: int = key(whole(1), "", "number of equal steps", 1)
    times: Numbers = key(TIMES, "time", "instead of end and count: the times at which steps end", None)
    growth: float = key(
        number(low=1, open=False), "", "factor from a halved step that converged to the step after it", 2.0
    )
    max_halvings: int = key(whole(0), "", "cutbacks in a row, each to half the step, before the run gives up", 6)

    @property
    def planned(self) -> tuple[float, ...]:
        """Times at which steps end, if none is halved."""
        return self.times or tuple(self.end * k / self.count for k in range(1, self.count + 1))

    @property
    def last(self) -> float:
        """Time at which the last step ends."""
        return self.times[-1] if self.times else self.end


class Solver(Entry, header="[solver]"):
    """[solver]: solution of the equations."""

    engine: str = key(
        choice({
            "auto": "that of the backend; else petsc in several processes of mpiexec, and serial in one",
            "serial": "one process",
            "petsc": "PETSc, in any number of processes of mpiexec",
        }), "", "program part that solves", "auto",
    )  # fmt: skip
    backend: str = key(
        choice({
            "auto": "the best one installed, by the size of the model",
            "rslab": "direct",
            "pardiso": "direct",
            "superlu": "direct, slow",
            "multigrid": "iterative, for large models; of both engines",
            "gamg": "iterative: PETSc's own multigrid, of the engine petsc",
            "hypre": "iterative: multigrid of hypre, of the engine petsc",
            "mumps": "direct, of the engine petsc",
        }), "", "the linear solver", "auto",
    )  # fmt: skip
    threads: int | None = key(
        whole(1), "", "largest number of cores to use, of each process", None,
        "all cores that the process may use; 1 in several processes",
    )  # fmt: skip
    tolerance: float = key(
        number(0, 1), "", "for a step: residual relative to forces, and violation of the contact conditions", 1e-10
    )
    max_iterations: int = key(whole(1), "", "per attempt; a damped second attempt precedes cutback", 50)
    tangent: str = key(
        choice({"consistent": "exact derivative", "symmetric": "without the derivatives of normal and measure"}), "",
        "tangent matrix of Newton's method", "consistent",
    )  # fmt: skip

    def engine_for(self, n_ranks: int) -> str:
        """Return the engine, `serial` or `petsc`, of a run in so many processes.

        >>> Solver().engine_for(1), Solver().engine_for(4), Solver(backend="gamg").engine_for(1)
        ('serial', 'petsc', 'petsc')
        """
        if self.engine != "auto":
            return self.engine
        owners = [engine for engine, backends in BACKENDS_OF.items() if self.backend in backends]
        return owners[0] if len(owners) == 1 else "petsc" if n_ranks > 1 else "serial"


class Output(Entry, header="[output]", not_both=(("every", "times"),)):
    """[output]: fields to be written.

    >>> Output(format="med", times=(0.5, 1)).times
    (0.5, 1.0)
    """

    format: str = key(choice({"vtu": "for ParaView", "med": "for Salome"}), "", "file format of the fields", "vtu")
    every: int | None = key(
        whole(1), "", "write the fields of every k-th step, and of the last one", None,
        "1; with [dynamics] what gives about a hundred",
    )  # fmt: skip
    units: str | None = key(
        UNITS, "", "names of the units of the case, for pictures and reports; nothing is computed with them", None
    )
    times: Numbers = key(
        TIMES, "time", "instead of every: write the fields at these times, at which steps then end", None
    )


class Case(Entry, header=""):
    """The problem to solve.

    It is checked when it is made; raises CaseError with every mistake. Plain numbers of loads are ramped up to
    `steps.last`, with [dynamics] up to its start. The default of a contact's `geometry` depends on the kinematics.
    `path`: the file that the case was read from.

    >>> from lacsolver.case import Displacement, Material, Pressure
    >>> load = Pressure(group="top", value=25)
    >>> steel, clamp = Material(young=210e3, poisson=0.3), Displacement(group="bottom", ux=0, uy=0)
    >>> Case(mesh="a.msh", model="plane_strain", material=steel, displacement=clamp, pressure=load).kinematics
    'small'
    """

    mesh: As[Path | Mesh | None, MeshLike | None] = key(
        MESH_FILE, "", "mesh file; lacsolver cuts the slaves if the mesh is not cut yet", None, "required"
    )
    model: str = key(
        choice({
            "3d": "three dimensions",
            "plane_strain": "no strain normal to the plane",
            "plane_stress": "no stress normal to the plane",
            "axisymmetric": "r = x, axis y; forces and areas are those of the full circle",
        }), "", "dimension and plane hypothesis",
    )  # fmt: skip
    thickness: float | dict[str, float] | None = key(
        THICKNESS, "length", "thickness of plane bodies: one for all, or one for each group of cells", None,
        "1.0", models=("plane_strain", "plane_stress"),
    )  # fmt: skip
    kinematics: str = key(
        choice({"small": "small strains and rotations", "finite": "large strains and rotations (total Lagrangian)"}),
        "", "size of the displacements", "small",
    )  # fmt: skip
    material: As[tuple[Material, ...], Material | Sequence[Material]] = section(Material)
    contact: As[tuple[Contact, ...], Contact | Sequence[Contact]] = section(Contact)
    tie: As[tuple[Tie, ...], Tie | Sequence[Tie]] = section(Tie)
    cyclic: As[tuple[Cyclic, ...], Cyclic | Sequence[Cyclic]] = section(Cyclic)
    rigid: As[tuple[Rigid, ...], Rigid | Sequence[Rigid]] = section(Rigid)
    displacement: As[tuple[Displacement, ...], Displacement | Sequence[Displacement]] = section(Displacement)
    equation: As[tuple[Equation, ...], Equation | Sequence[Equation]] = section(Equation)
    coupling: As[tuple[Coupling, ...], Coupling | Sequence[Coupling]] = section(Coupling)
    pretension: As[tuple[Pretension, ...], Pretension | Sequence[Pretension]] = section(Pretension)
    spring: As[tuple[Spring, ...], Spring | Sequence[Spring]] = section(Spring)
    pressure: As[tuple[Pressure, ...], Pressure | Sequence[Pressure]] = section(Pressure)
    traction: As[tuple[Traction, ...], Traction | Sequence[Traction]] = section(Traction)
    force: As[tuple[Force, ...], Force | Sequence[Force]] = section(Force)
    body_force: As[tuple[BodyForce, ...], BodyForce | Sequence[BodyForce]] = section(BodyForce)
    gravity: Gravity | None = section(Gravity)
    temperature: As[tuple[Temperature, ...], Temperature | Sequence[Temperature]] = section(Temperature)
    dynamics: Dynamics | None = section(Dynamics)
    initial: As[tuple[Initial, ...], Initial | Sequence[Initial]] = section(Initial)
    probe: As[tuple[Probe, ...], Probe | Sequence[Probe]] = section(Probe)
    steps: Steps = section(Steps, Steps())
    solver: Solver = section(Solver, Solver())
    output: Output = section(Output, Output())
    path: Path | None = hidden(None)

    def mistakes(self) -> Iterator[Issue]:
        """Yield the mistakes of the keys at the top, and those that only the case as a whole shows."""
        yield from super().mistakes()
        yield from check(self)

    def before(self, key: str) -> str:
        """Return the subject of a message about a key of the top: its place in the file, if there is one, and name."""
        return f"{self.place}, line {self._lines[(key,)]}: {key}" if self._lines else key

    @property
    def ties(self) -> tuple[Tie, ...]:
        """The ties, and the sides of sectors that are ties, as their nodes do not match."""
        return (*self.tie, *(one for one in self.cyclic if not one.matching))

    @property
    def skins(self) -> tuple[str, ...]:
        """Groups of the slaves and masters of all contacts and ties, each once."""
        pairs = (
            record.surfaces or (record.slave, record.master) for record in (*self.contact, *self.tie, *self.cyclic)
        )
        named = (name for pair in pairs for name in pair)
        return tuple(dict.fromkeys(named))

    def cut_options(self) -> dict[str, Any]:
        """Options of `lacmesh.cut_skin`, which makes the macro-elements of all slaves at once.

        Stars have no dof at nodes whose displacement is given. Raises RequestError for slaves with unlike options.
        """
        records = (*self.contact, *self.ties)
        for name in ("hexa", "macro"):
            if len({getattr(record, name) for record in records}) > 1:
                raise RequestError(f"slaves of one mesh are cut at once, so {name} must be the same for all of them")
        if not records:
            return {}
        options: dict[str, Any] = {"hexa": records[0].hexa, "macro": records[0].macro}
        if records[0].macro == "stars":
            angles = [record.crease_angle for record in records if record.crease_angle is not None]
            options["crease_angle"] = min(angles, default=None)
            options["dirichlet"] = [record.group for record in self.displacement if record.group is not None]
        return options

    def write(self, path: str | PathLike[str]) -> None:
        """Write the case into a file, which `read_case` reads; the mesh is named relative to its folder.

        Raises RequestError for a mesh that is in memory and for values that are Python functions, WriteError.

        >>> from tempfile import TemporaryDirectory
        >>> from lacsolver import read_case
        >>> case = read_case("data/two_blocks.toml")
        >>> with TemporaryDirectory() as folder:
        ...     case.write(f"{folder}/again.toml")
        ...     print(read_case(f"{folder}/again.toml").contact == case.contact)
        True
        """
        path = Path(path)
        if not isinstance(self.mesh, Path):
            advice = "write the mesh with lacmesh.write, and name its file, as dataclasses.replace(case, mesh=path)"
            raise RequestError(f"a case file names its mesh by a path, and the mesh of this case is none; {advice}")
        sections = [section_text("", self.told() | {"mesh": Path(relpath(self.mesh, path.parent))})]
        for (name, *_), record in self.records():
            keys = record.told()
            if keys or record.SECTION.several or name == "dynamics":
                sections.append(section_text(record.SECTION.header, keys))
        from lacmesh.formats.output import replace_file  # reading a case needs no numpy

        replace_file(path, "\n".join(sections).encode())

    def _facts(self) -> dict[str, str]:
        facts = {"model": f"{self.model}, {self.kinematics} displacements"}
        facts["mesh"] = "in memory" if self.mesh is not None and not isinstance(self.mesh, Path) else str(self.mesh)
        for name in self.SECTIONS:
            records = getattr(self, name)
            if isinstance(records, tuple) and records:
                facts[name] = listed(map(_named, records))
        return facts | {"steps": f"{len(self.steps.planned)}, up to t = {self.steps.last:g}"}

    def __repr__(self) -> str:
        return Described.__repr__(self)

    def settle(self) -> None:
        """Set the values of records that depend on the whole case."""
        for name in self.SECTIONS:
            one = getattr(self, name)
            done = tuple(_settled(r, self) for r in one) if isinstance(one, tuple) else one and _settled(one, self)
            self._set(name, done)

    def records(self) -> Iterator[tuple[tuple[str | int, ...], Entry]]:
        """Yield every record of the sections with its path: `("contact", 0)`, `("steps",)`."""
        for name in self.SECTIONS:
            one = getattr(self, name)
            if isinstance(one, tuple):
                yield from (((name, k), record) for k, record in enumerate(one))
            elif one is not None:
                yield (name,), one


def _named(record: Any) -> str:
    """Return what names a record in a list: its name, group, groups, law or place."""
    for name in ("name", "group", "groups", "law", "at"):
        value = getattr(record, name, None)
        if value:
            return " + ".join(value) if isinstance(value, tuple) and isinstance(value[0], str) else str(value)
    return "the whole mesh"


def _settled(record: Any, case: Case) -> Any:
    """Return the record with the values that depend on the whole case: ramps, default of a contact's geometry."""
    changes: dict[str, Any] = {}
    for name, row in record.KEYS.items():
        if row.load:
            changes[name] = with_values(getattr(record, name), lambda v: _ramped(v, record, case))
    if isinstance(record, Contact) and record.geometry is None:
        changes["geometry"] = "current" if case.kinematics == "finite" else "reference"
    if isinstance(record, Equation) and record.name is None:
        changes["name"] = f"equation {1 + next(k for k, one in enumerate(case.equation) if one is record)}"
    if isinstance(record, Output) and record.every is None and record.times is None:
        changes["every"] = 1 if case.dynamics is None else max(1, round(len(case.steps.planned) / _OUTPUTS))
    return record.altered(**changes) if changes else record


def _ramped(value: Value, record: Any, case: Case) -> Value:
    """Return a value of a record with its ramp: that of a late support goes from its beginning to the end."""
    begin = getattr(record, "begin", None)
    if begin is not None and isinstance(value.source, float):
        return replace(value, ramp_start=begin, ramp_end=case.steps.last)
    return replace(value, ramp_end=_ramp_end(value, case))


def _ramp_end(value: Value, case: Case) -> float | None:
    """Return the time at which a number is reached: the end of the steps, or the start of motion; None for at once."""
    end = case.steps.last if case.dynamics is None else case.dynamics.start
    return end if isinstance(value.source, float) and end > 0 else None
