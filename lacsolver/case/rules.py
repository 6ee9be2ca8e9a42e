"""Rules on combinations of keys in a case, beyond those in the rows of the table; one function per rule."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from math import inf, sqrt
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.case.errors import Issue
from lacsolver.case.value_kinds import FREE

if TYPE_CHECKING:
    from lacsolver.case.case import Case
    from lacsolver.case.records import Material

#: the linear solvers of each engine, beside `auto`
BACKENDS_OF = {
    "serial": ("rslab", "pardiso", "superlu", "multigrid"),
    "petsc": ("multigrid", "gamg", "hypre", "mumps"),
}


def check(case: Case) -> Iterator[Issue]:
    """Yield the mistakes that only the case as a whole shows; each key by itself is right."""
    for record in (case, *(record for _, record in case.records())):
        yield from record.against(case.model, case.kinematics)
    for rule in RULES:
        yield from rule(case)


def _repeated(records: Iterable[Any], key: str) -> Iterator[Any]:
    """Yield the records whose key has a value that an earlier one has."""
    taken = set()
    for record in records:
        value = getattr(record, key)
        if value is not None and value in taken:
            yield record
        taken.add(value)


def _materials(case: Case) -> Iterator[Issue]:
    """Check that each material has the constants of its law."""
    for record in case.material:
        law, poisson = record.law, record.poisson
        if law == "orthotropic":
            yield from _orthotropic(record)
            continue
        for name in [name for name in ("young", "poisson", "expansion") if record.has(name)]:
            if law in MATERIAL_LAWS:
                yield record.wrong(f'is not a key of law = "{law}"; give it as one of its constants', name)
            elif isinstance(getattr(record, name), tuple):
                message = f'has three numbers; only law = "orthotropic" takes three, and the law is "{law}"'
                yield record.wrong(message, name)
        if law == "plastic" and not record.has("hardening"):
            rows = "hardening = [[yield stress, 0.0], ...]"
            yield record.wrong(f'needs {rows} with law = "plastic"; one row is perfect plasticity')
        if law not in MATERIAL_LAWS and isinstance(poisson, float) and not -1 < poisson < 0.5:
            hint = "; use 0.49 for rubber" if poisson >= 0.5 else ""
            yield record.wrong(f"is {poisson:g}; it must be > -1 and < 0.5{hint}", "poisson")


def _orthotropic(record: Material) -> Iterator[Issue]:
    young, poisson = record.young, record.poisson
    if not record.has("shear"):
        yield record.wrong('needs shear = [G12, G13, G23] with law = "orthotropic"')
    for name, value in (("young", young), ("poisson", poisson)):
        if isinstance(value, float):
            yield record.wrong('is one number; law = "orthotropic" takes three', name)
    if isinstance(young, tuple) and isinstance(poisson, tuple) and not _stores_energy(young, poisson):
        message = "gives, with these young, a strain energy below 0; poisson is [nu12, nu13, nu23], and "
        yield record.wrong(f"{message}nu_ij² < E_i / E_j must hold", "poisson")


def _stores_energy(young: tuple[float, ...], poisson: tuple[float, ...]) -> bool:
    """True if the compliance is positive definite: every leading minor of S_ij / sqrt(S_ii S_jj) is positive."""
    (e1, e2, e3), (nu12, nu13, nu23) = young, poisson
    a, b, c = nu12 * sqrt(e2 / e1), nu13 * sqrt(e3 / e1), nu23 * sqrt(e3 / e2)
    return abs(a) < 1 and 1 - a * a - b * b - c * c - 2 * a * b * c > 0


def _groups_once(case: Case) -> Iterator[Issue]:
    """Check that groups do not give a cell two laws or two temperatures."""
    for records in (case.material, case.temperature):
        taken: set[str] = set()
        for record in records:
            if not record.has("groups") and len(records) > 1:
                yield record.wrong(
                    "has no groups, so it applies to the whole mesh and to cells of other sections; give it groups"
                )
            for group in record.groups or ():
                if group in taken:
                    yield record.wrong(f"names {group!r}, which an earlier {record.SECTION.header} names too", "groups")
                taken.add(group)


def _pairs(case: Case) -> Iterator[Issue]:
    """Check that the master is another skin than the slave, and that no slave is rigid."""
    pairs, rigid = [*case.contact, *case.tie, *case.cyclic], {record.group for record in case.rigid}
    for record in [record for record in pairs if record.slave is not None]:
        slave, master = record.slave, record.master
        if slave == master:
            message = f"is {master!r}, the same group as the slave; give the master surface a group of its own"
            if record not in case.cyclic:
                mesh = case.mesh.name if isinstance(case.mesh, Path) else "MESH"
                message += f": lacmesh split {mesh} --faces {quote(master)} makes two surfaces from faces inside a body"
            yield record.wrong(message, "master")
        if slave in rigid:
            yield record.wrong(f"is {slave!r}, which is [[rigid]]; make the rigid surface the master", "slave")


def _creases(case: Case) -> Iterator[Issue]:
    """Check that crease_angle is given only where smooth surfaces or smoothed normals use it."""
    for record in (*case.contact, *case.tie):
        normals = getattr(record, "normals", "facet")  # a tie has no normals
        if "crease_angle" in record.told() and record.surface == "faces" and normals in ("facet", "slave"):
            also = ' or normals = "smoothed"' if record in case.contact else ""
            message = f'has an effect only with surface = "smooth"{also}; set that, or remove this key'
            yield record.wrong(message, "crease_angle")


def _constants(case: Case) -> Iterator[Issue]:
    """Check that constants are given to laws that a program has added, and only to these."""
    laws = [(record, "law", record.law, MATERIAL_LAWS) for record in case.material]
    types = [(record, "type", record.type, CONTACT_LAWS) for record in case.contact]
    for record, key, name, added in (*laws, *types):
        if record.has("constants") and name not in added:
            message = f'belong to laws that a Python program adds, and {key} is "{name}"; remove them'
            yield record.wrong(message, "constants")


def _contacts(case: Case) -> Iterator[Issue]:
    """Check that laws of soft contact are whole, and that the deformed area is the measure on deformed skins only."""
    usual = "current" if case.kinematics == "finite" else "reference"
    wanted = {"exponential": ("pressure_at_contact", "clearance_at_zero"), "table": ("pressures",)}
    for record in case.contact:
        if record.law in wanted and record.has("stiffness"):
            yield record.wrong(f'cannot be combined with law = "{record.law}"; give one of the two', "stiffness")
        for name in wanted.get(record.law, ()):
            if not record.has(name):
                yield record.wrong(f'needs {name} with law = "{record.law}"', "law")
        if record.damping and case.dynamics is None:
            yield record.wrong("has no effect without [dynamics]; remove it", "damping")
        elif record.damping and not record.is_soft:
            message = "needs soft contact, since rigid contact has no overlap; give a stiffness, or a law"
            yield record.wrong(message, "damping")
        if record.measure == "current" and (record.geometry or usual) == "reference":
            yield record.wrong(
                'is "current", which needs geometry = "current"; set that, or remove this key', "measure"
            )


def _friction(case: Case) -> Iterator[Issue]:
    """Check that friction is of contact that can open, and that its keys go together."""
    for record in case.contact:
        if not record.has_friction:
            if record.has("shear_limit"):
                message = "has an effect only with friction or cohesion; give one of them, or remove this key"
                yield record.wrong(message, "shear_limit")
            continue
        source = "friction" if record.has("friction") else "cohesion"
        if record.type != "unilateral":
            message = f'needs contact that can open, and type is "{record.type}"; remove one of the two'
            yield record.wrong(message, source)
        if record.friction.source == inf and record.has("cohesion"):
            message = "has no effect with friction = inf, which excludes slip; remove it"
            yield record.wrong(message, "cohesion")


def _names(case: Case) -> Iterator[Issue]:
    """Check that the names, by which results are called, are given and unique."""
    pairs = (*case.contact, *case.tie, *case.cyclic)
    for records in (pairs, case.probe, case.equation, case.coupling, case.pretension):
        for record in _repeated(records, "name"):
            source = "name" if record.has("name") else record.SECTION.named_after
            message = f"is {record.name!r}, which is the name of an earlier section too; give this one another name"
            yield record.wrong(message, source)
    for probe in case.probe:
        if probe.has("at") and not probe.has("name"):
            yield probe.wrong("needs a name, since it has no group to be named after")


def _prescribed_once(case: Case) -> Iterator[Issue]:
    """Check that a component of a group is prescribed once, or alike, and that of a rigid group only by [[rigid]]."""
    taken: dict[tuple[Any, ...], Any] = {}
    rigid = {record.group for record in case.rigid}
    for record in case.displacement:
        where = record.group or record.at
        if where in rigid:
            yield record.wrong(f"is {where!r}, which is [[rigid]]; prescribe the motion in [[rigid]]", "group")
        if record.has("un") and record.kind == "node":
            message = 'is along the normal of faces, and a group of nodes (kind = "node") has no faces'
            yield record.wrong(message, "un")
        for name in [n for n in ("ux", "uy", "uz", "un") if record.has(n)]:
            first = taken.setdefault((where, record.kind, name, str(record.axes)), record)
            if any(getattr(first, key) != getattr(record, key) for key in (name, "begin", "reached")):
                by = f"the [[displacement]] of {first.place}" if first.place else "an earlier [[displacement]]"
                yield record.wrong(
                    f"is prescribed at {where!r} by {by} too, with another value or time; remove one", name
                )


def _groups_of_joints(case: Case) -> Iterator[Issue]:
    """Check that displacements that nodes share, and a moment, have a whole group."""
    for equation in case.equation:
        if equation.has("same") and not equation.has("group"):
            yield equation.wrong("needs a group, whose nodes share the component", "same")
    for force in case.force:
        if force.has("moment") and not force.total:
            message = "acts on the whole group; set total = true, which makes fx, fy and fz totals too"
            yield force.wrong(message, "moment")


def _sectors(case: Case) -> Iterator[Issue]:
    """Check that sectors are of a model that has them, and turn alike."""
    for record in case.cyclic:
        if case.model == "axisymmetric":
            yield record.wrong("is a sector, and an axisymmetric model is a whole ring; remove it")
        if record.harmonic:
            message = f"is {record.harmonic}; only 0 is available: all sectors deform alike"
            yield record.wrong(message, "harmonic")
        if record.ring and case.output.format == "med":
            yield record.wrong('is written for ParaView; set [output] format = "vtu"', "ring")
        if not any(record.axis):
            yield record.wrong("has the length 0; give its direction", "axis")


def _round_axes(case: Case) -> Iterator[Issue]:
    """Check that no axes are cylindrical where components are Cartesian, or cylindrical already."""
    reasons: list[tuple[Sequence[Any], str]] = [
        (case.coupling, "; the point of a coupling needs Cartesian axes"),
        ([one for one in case.spring if one.to is not None], "; a spring between two nodes needs Cartesian axes"),
    ]
    if case.model == "axisymmetric":
        turned = (*case.displacement, *case.force, *case.spring)
        reasons += [(turned, ", as ux and uy of an axisymmetric model are anyway; remove them")]
    for records, reason in reasons:
        for record in records:
            if record.axes is not None and "axis" in record.axes:
                yield record.wrong(f"are cylindrical{reason}", "axes")


def _springs(case: Case) -> Iterator[Issue]:
    """Check that a spring along a line has another node, which is not its own."""
    for record in case.spring:
        if record.has("k") and not record.has("to"):
            message = "is the stiffness along the line to another node; give this node as to, or use kx, ky, kz"
            yield record.wrong(message, "k")
        if record.to is not None and record.to == record.group:
            yield record.wrong(f"is {record.to!r}, the group itself; name the node at the other end", "to")


def _sections(case: Case) -> Iterator[Issue]:
    """Check that each section is tightened along a direction, and locked while the case runs."""
    for record in case.pretension:
        if record.normal is not None and not any(record.normal):
            yield record.wrong("has length 0; give a direction", "normal")
        if record.lock is not None and record.lock >= case.steps.last:
            message = f"is {record.lock:g}, and the steps end at {case.steps.last:g}; remove it, or lock earlier"
            yield record.wrong(message, "lock")


def _turns(case: Case) -> Iterator[Issue]:
    """Check that moments act about axes whose rotation is free."""
    records: tuple[Any, ...] = (*case.rigid, *case.coupling)
    for record in [one for one in records if one.rotation is not None and one.moment is not None]:
        both = [m for theta, m in zip(record.rotation, record.moment, strict=False) if theta != FREE]
        if len(both) == len(record.rotation):
            yield record.wrong(
                'cannot be combined with rotation; give one of the two, or set some rotations to "free"', "moment"
            )
        elif any(m.source != 0 for m in both):
            yield record.wrong(
                "has a component about an axis whose rotation is prescribed; set this component to 0", "moment"
            )


def _late(case: Case) -> Iterator[Issue]:
    """Check that a support that begins late does so while the case runs, and before bodies move."""
    last, moving = case.steps.last, case.dynamics
    for record in case.displacement:
        begin, reached = record.begin, record.reached
        if begin is None:
            if reached is not None:
                message = "has an effect only with begin, the time at which the support begins"
                yield record.wrong(message, "reached")
            continue
        if moving is not None and begin >= moving.start:
            why = f"[dynamics] starts at {moving.start:g}: moving nodes would stop abruptly"
            yield record.wrong(f"is {begin:g}, and {why}; choose an earlier time", "begin")
        elif begin >= last:
            yield record.wrong(f"is {begin:g}, and the steps end at {last:g}; choose an earlier time", "begin")
        if reached is not None and reached <= begin:
            yield record.wrong(f"is {reached:g}, and the support begins at {begin:g}; choose a later time", "reached")


def _once(case: Case) -> Iterator[Issue]:
    """Check that a surface is one slave, and that a group is one rigid body, and one section of a bolt."""
    pairs = (*case.contact, *case.tie, *case.cyclic)
    for records, key, words in (
        (pairs, "slave", "which is the slave of an earlier section too; put both masters into one group"),
        (case.rigid, "group", "the group of an earlier [[rigid]] too"),
        (case.pretension, "group", "the group of an earlier section too; keep one of the two"),
    ):
        for record in _repeated(records, key):
            yield record.wrong(f"is {getattr(record, key)!r}, {words}", key)


def _fields(case: Case) -> Iterator[Issue]:
    """Check that gravity and temperature have a material that they act on."""
    gravity = () if case.gravity is None else (case.gravity,)
    for records, constant in ((gravity, "a density"), (case.temperature, "an expansion")):
        if case.material and not any(constant.split()[1] in record.told() for record in case.material):
            for one in records[:1]:
                yield one.wrong(f"has no effect: no [[material]] has {constant}")


def _engine(case: Case) -> Iterator[Issue]:
    """Check that the linear solver is one of the engine, if that is named."""
    engine, backend = case.solver.engine, case.solver.backend
    fitting = BACKENDS_OF.get(engine, ())
    if fitting and backend not in ("auto", *fitting):
        others = f'the linear solvers of engine = "{engine}" are auto, {", ".join(fitting)}'
        yield case.solver.wrong(f'is "{backend}"; {others}', "backend")


def _output(case: Case) -> Iterator[Issue]:
    """Check that no output time is after the end of the steps."""
    if late := [t for t in case.output.times or () if t > case.steps.last]:
        yield case.output.wrong(f"has {late[0]:g}, after the end of the steps at {case.steps.last:g}", "times")


def _motion(case: Case) -> Iterator[Issue]:
    """Check that bodies that move have a mass, and that the scheme is stable."""
    moving, end = case.dynamics, case.steps.last
    if moving is None:
        for record in case.initial:
            yield record.wrong("has an effect only with [dynamics]; add that section, or remove this one")
        return
    for material in case.material:
        if material.density == 0.0:
            groups = ", ".join(map(repr, material.groups or ()))
            where = f"the cells of {groups}" if groups else "the cells"
            yield material.wrong(f"needs a density, since [dynamics] needs the mass of {where}")
    beta, gamma, start = moving.beta, moving.gamma, moving.start
    if moving.scheme == "newmark" and not 0.5 <= gamma <= 2 * beta:
        message = f"and gamma are {beta:g} and {gamma:g}, which is unstable"
        yield moving.wrong(f"{message}; use gamma >= 1/2 and beta >= gamma / 2", "beta")
    if start >= end:
        yield moving.wrong(f"is {start:g}, and the steps end at {end:g}; choose an earlier time", "start")
    for record in case.initial:
        if record.has("centre") and not record.has("rotation"):
            yield record.wrong("has an effect only with rotation; give that, or remove this key", "centre")
        for name in [n for n in ("ux", "uy", "uz") if start and record.has(n)]:
            message = f"has an effect only with start = 0, and dynamics.start is {start:g}"
            yield record.wrong(f"{message}: the static steps before it give the displacement", name)


def _inertia(case: Case) -> Iterator[Issue]:
    """Check that the inertia of rigid bodies has a mass, and is that of a body."""
    space = case.model == "3d"
    for record in [record for record in case.rigid if record.inertia is not None]:
        inertia = record.inertia
        if not record.has("mass"):
            yield record.wrong("needs a mass; give mass too", "inertia")
        if space != isinstance(inertia, tuple):
            words = "is one number; in 3d it is three" if space else "is three numbers; in a plane it is one"
            yield record.wrong(words, "inertia")
        elif isinstance(inertia, tuple) and not 2 * max(inertia) <= sum(inertia) * (1 + 1e-9):
            yield record.wrong("has a moment larger than the sum of the other two, which no body can have", "inertia")


RULES: tuple[Callable[[Case], Iterator[Issue]], ...] = (
    *(_materials, _groups_once, _constants, _fields, _pairs, _once, _creases, _contacts, _friction, _names),
    *(_prescribed_once, _late, _inertia, _turns, _groups_of_joints, _round_axes, _springs, _sectors),
    *(_sections, _motion, _engine, _output),
)
