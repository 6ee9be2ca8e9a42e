# ruff: noqa: RUF009 (key and section make fields)
"""The rest of the table of keys: the whole case, its steps, solver, output and probes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from lacmesh.errors import RequestError
from lacmesh.facts import Described, listed
from lacsolver.case.draft import Draft
from lacsolver.case.dynamics import Dynamics, Initial
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.keys import As, Section, key, keys_of, section, section_of, sections_of
from lacsolver.case.kinds import POSITIVE, Bounds, Choice, Count, MeshFile, Number, Option, Text, Times
from lacsolver.case.records import (
    NOT_KIND_OF_AT,
    WHERE,
    AtNodes,
    BodyForce,
    Contact,
    Displacement,
    Entry,
    Force,
    Gravity,
    Material,
    Pressure,
    Rigid,
    Spring,
    Temperature,
    Tie,
    Traction,
)
from lacsolver.case.rules import BACKENDS_OF, check
from lacsolver.case.toml import section_text
from lacsolver.case.value import Value, with_values

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh, MeshLike

#: fields that are written of a motion, if [output] does not tell
_OUTPUTS = 100


@dataclass(frozen=True, kw_only=True, repr=False)
class Probe(AtNodes):
    """[[probe]]: a displacement that is recorded after every step.

    >>> Probe(group="top").name
    'top'
    """

    SECTION: ClassVar = Section(
        "probe", True, "displacement kept step by step: the mean over the nodes of a group, or of one node",
        one_of=WHERE, not_both=NOT_KIND_OF_AT,
    )  # fmt: skip
    name: str = key(Text("a name"), "", "name in the results", default=None, default_words="the group's name")

    def _complete(self, values: Mapping[str, Any]) -> None:
        """Take the values that were read, and name the probe after its group if it has no name."""
        super()._complete(values)
        if self.name is None:
            object.__setattr__(self, "name", self.group)


@dataclass(frozen=True, kw_only=True, repr=False)
class Steps(Entry):
    """[steps]: the steps from time 0 to the end. A step that does not converge is halved.

    >>> Steps(count=4).planned
    (0.25, 0.5, 0.75, 1.0)
    """

    SECTION: ClassVar = Section(
        "steps", False, "times, from 0 on; a step that does not converge is halved",
        not_both=(("end", "times"), ("count", "times")),
    )  # fmt: skip
    end: float = key(
        Number(POSITIVE), "time", "end of the analysis; numbers given as loads reach their value then", default=1.0
    )
    count: int = key(Count(1), "", "number of equal steps", default=1)
    times: As[tuple[float, ...] | None, Sequence[float] | None] = key(
        Times(), "time", "instead of end and count: the times at which steps end", default=None
    )
    growth: float = key(
        Number(Bounds(low=1, open=False)),
        "",
        "factor from a halved step that converged to the step after it",
        default=2.0,
    )
    max_halvings: int = key(
        Count(0), "", "cutbacks in a row, each to half the step, before the run gives up", default=6
    )

    @property
    def planned(self) -> tuple[float, ...]:
        """Times at which steps end, if none is halved."""
        return self.times or tuple(self.end * k / self.count for k in range(1, self.count + 1))

    @property
    def last(self) -> float:
        """Time at which the last step ends."""
        return self.times[-1] if self.times else self.end


@dataclass(frozen=True, kw_only=True, repr=False)
class Solver(Entry):
    """[solver]: engine, linear solver, tolerance, iterations and tangent."""

    SECTION: ClassVar = Section("solver", False, "solution of the equations")
    engine: str = key(
        Choice(
            (
                Option("auto", "that of the backend; else petsc in several processes of mpiexec, and serial in one"),
                Option("serial", "one process"),
                Option("petsc", "PETSc, in any number of processes of mpiexec"),
            )
        ),
        "", "program part that solves", default="auto",
    )  # fmt: skip
    backend: str = key(
        Choice(
            (
                Option("auto", "the best one installed, by the size of the model"),
                Option("rslab", "direct"),
                Option("pardiso", "direct"),
                Option("mumps", "direct, of both engines"),
                Option("cholmod", "direct"),
                Option("superlu", "direct, slow"),
                Option("multigrid", "iterative, for large models; of both engines"),
                Option("gamg", "iterative: PETSc's own multigrid, of the engine petsc"),
                Option("hypre", "iterative: multigrid of hypre, of the engine petsc"),
            )
        ),
        "", "the linear solver", default="auto",
    )  # fmt: skip
    threads: int | None = key(
        Count(1), "", "largest number of cores to use, of each process", default=None,
        default_words="all cores that the process may use; 1 in several processes",
    )  # fmt: skip
    tolerance: float = key(
        Number(Bounds(0, 1)), "", "for a step: residual relative to forces, and violation of the contact conditions",
        default=1e-10,
    )  # fmt: skip
    max_iterations: int = key(Count(1), "", "per attempt; a damped second attempt precedes cutback", default=50)
    tangent: str = key(
        Choice(
            (
                Option("consistent", "exact derivative"),
                Option("symmetric", "without the derivatives of normal and measure"),
            )
        ),
        "", "tangent matrix of Newton's method", default="consistent",
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


@dataclass(frozen=True, kw_only=True, repr=False)
class Output(Entry):
    """[output]: format of the fields, and steps or times at which they are written.

    >>> Output(format="med", times=(0.5, 1)).times
    (0.5, 1.0)
    """

    SECTION: ClassVar = Section("output", False, "fields to be written", not_both=(("every", "times"),))
    format: str = key(
        Choice((Option("vtu", "for ParaView"), Option("med", "for Salome"))),
        "",
        "file format of the fields",
        default="vtu",
    )
    every: int | None = key(
        Count(1), "", "write the fields of every k-th step, and of the last one", default=None,
        default_words="1; with [dynamics] what gives about a hundred",
    )  # fmt: skip
    times: As[tuple[float, ...] | None, Sequence[float] | None] = key(
        Times(), "time", "instead of every: write the fields at these times, at which steps then end", default=None
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Case(Entry):
    """The whole problem to solve. It is checked when it is made; raises CaseError with every mistake.

    Plain numbers of loads are ramped up to `steps.last`, with [dynamics] up to its start. The default of a contact's
    `geometry` depends on the kinematics. `path`: the file that the case was read from.

    >>> from lacsolver.case import Displacement, Material, Pressure
    >>> load = Pressure(group="top", value=25)
    >>> steel, clamp = Material(young=210e3, poisson=0.3), Displacement(group="bottom", ux=0, uy=0)
    >>> Case(mesh="a.msh", model="plane_strain", material=steel, displacement=clamp, pressure=load).kinematics
    'small'
    """

    SECTION: ClassVar = Section("", False, "the problem to solve")
    mesh: As[Path | Mesh | None, MeshLike | None] = key(
        MeshFile(), "", "mesh file; lacsolver cuts the slaves where the mesh is not cut yet", default=None,
        default_words="required",
    )  # fmt: skip
    model: str = key(
        Choice(
            (
                Option("3d", "three dimensions"),
                Option("plane_strain", "no strain normal to the plane; forces are per unit of thickness"),
                Option("plane_stress", "no stress normal to the plane"),
                Option("axisymmetric", "r = x, axis y; forces and areas are those of the full circle"),
            )
        ),
        "", "dimension and plane hypothesis",
    )  # fmt: skip
    thickness: float | None = key(
        Number(POSITIVE),
        "length",
        "thickness of the plane body",
        default=None,
        models=("plane_stress",),
        default_words="1.0",
    )
    kinematics: str = key(
        Choice(
            (
                Option("small", "small strains and rotations"),
                Option("finite", "large strains and rotations (total Lagrangian)"),
            )
        ),
        "", "size of the displacements", default="small",
    )  # fmt: skip
    material: As[tuple[Material, ...], Material | Sequence[Material]] = section(Material)
    contact: As[tuple[Contact, ...], Contact | Sequence[Contact]] = section(Contact)
    tie: As[tuple[Tie, ...], Tie | Sequence[Tie]] = section(Tie)
    rigid: As[tuple[Rigid, ...], Rigid | Sequence[Rigid]] = section(Rigid)
    displacement: As[tuple[Displacement, ...], Displacement | Sequence[Displacement]] = section(Displacement)
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
    path: Path | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the whole case, then set the values that depend on it. Raises CaseError, TypeError."""
        super().__post_init__()
        self._take_records()
        found = check(drafted(self, ()), (drafted(r, path) for path, r in self.records()))
        if found:
            raise CaseError([Issue(f.message) for f in found], self.path)
        self._settle()

    @classmethod
    def of_read(cls, values: Mapping[str, Any]) -> Case:
        """Return the case of values and records that were read and checked already."""
        made = super().of_read(values)
        made._take_records()
        made._settle()
        return made

    @property
    def skins(self) -> tuple[str, ...]:
        """Groups of the slaves and masters of all contacts and ties, each once."""
        pairs = (record.surfaces or (record.slave, record.master) for record in (*self.contact, *self.tie))
        named = (name for pair in pairs for name in pair)
        return tuple(dict.fromkeys(named))

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
        top = drafted(self, ()).told() | {"mesh": Path(relpath(self.mesh, path.parent))}
        sections = [section_text("", top)]
        for name, record in self.records():
            keys = drafted(record, name).told()
            if keys or section_of(type(record)).several or name == ("dynamics",):
                sections.append(section_text(section_of(type(record)).header, keys))
        from lacmesh.formats.output import replace_file  # reading a case needs no numpy

        replace_file(path, "\n".join(sections).encode())

    def _facts(self) -> dict[str, str]:
        facts = {"model": f"{self.model}, {self.kinematics} displacements"}
        facts["mesh"] = "in memory" if self.mesh is not None and not isinstance(self.mesh, Path) else str(self.mesh)
        for name in sections_of(Case):
            held = getattr(self, name)
            if isinstance(held, tuple) and held:
                facts[name] = listed(_named(record) for record in held)
        return facts | {"steps": f"{len(self.steps.planned)}, up to t = {self.steps.last:g}"}

    def __repr__(self) -> str:
        return Described.__repr__(self)

    def _take_records(self) -> None:
        """Store the records of each section as a tuple of them, or as a single one. Raises TypeError."""
        for name, record in sections_of(Case).items():
            object.__setattr__(self, name, _records(name, record, getattr(self, name)))

    def _settle(self) -> None:
        """Set the values of records that depend on the whole case."""
        for name in sections_of(Case):
            held = getattr(self, name)
            done = tuple(_settled(r, self) for r in held) if isinstance(held, tuple) else held and _settled(held, self)
            object.__setattr__(self, name, done)

    def records(self) -> Iterator[tuple[tuple[str | int, ...], Entry]]:
        """Yield every record of the sections with its path: `("contact", 0)`, `("steps",)`."""
        for name in sections_of(Case):
            held = getattr(self, name)
            if isinstance(held, tuple):
                yield from (((name, k), record) for k, record in enumerate(held))
            elif held is not None:
                yield (name,), held


def _named(record: Any) -> str:
    """Return what names a record in a list: its name, group, groups, law or place."""
    for name in ("name", "group", "groups", "law", "at"):
        value = getattr(record, name, None)
        if value:
            return " + ".join(value) if isinstance(value, tuple) and isinstance(value[0], str) else str(value)
    return "the whole mesh"


def drafted(record: Entry, path: tuple[str | int, ...]) -> Draft:
    """Return the draft of a finished record, with the values that differ from their defaults."""
    values = {name: getattr(record, name) for name in keys_of(type(record))}
    whole = Draft(type(record), path, values, values)
    told = whole.told()
    return Draft(type(record), path, told, told)


def _records(name: str, record: type, held: Any) -> Any:
    several = section_of(record).several
    items = tuple(held) if several and isinstance(held, (list, tuple)) else (held,)
    if not several and held is None:
        return None if name in ("gravity", "dynamics") else record()
    if not all(isinstance(item, record) for item in items):
        what = f"a list of {record.__name__} records" if several else f"a {record.__name__} record"
        raise TypeError(f"{name} is {what}, not {held!r}")
    return items if several else held


def _settled(record: Any, case: Case) -> Any:
    """Return the record with the values that depend on the whole case: ramps, default of a contact's geometry."""
    changes: dict[str, Any] = {}
    for name, row in keys_of(type(record)).items():
        if row.load:
            changes[name] = with_values(getattr(record, name), lambda v: replace(v, ramp_end=_ramp_end(v, case)))
    if isinstance(record, Contact) and record.geometry is None:
        changes["geometry"] = "current" if case.kinematics == "finite" else "reference"
    if isinstance(record, Output) and record.every is None:
        changes["every"] = 1 if case.dynamics is None else max(1, round(len(case.steps.planned) / _OUTPUTS))
    return record.of_read({**vars(record), **changes}) if changes else record


def _ramp_end(value: Value, case: Case) -> float | None:
    """Return the time at which a number is reached: the end of the steps, or the start of motion; None for at once."""
    end = case.steps.last if case.dynamics is None else case.dynamics.start
    return end if isinstance(value.source, float) and end > 0 else None
