"""Rules on combinations of keys in a case, beyond those in the rows of the table; one function per rule."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import sqrt
from typing import Any

from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.case.draft import Draft, Found, by_section, check_context

#: the linear solvers of each engine, beside `auto`
BACKENDS_OF = {
    "serial": ("rslab", "pardiso", "mumps", "cholmod", "superlu", "multigrid"),
    "petsc": ("multigrid", "gamg", "hypre", "mumps"),
}
#: the drafts of each section; the top of the file is section ""
Sections = dict[str, list[Draft]]


def check(top: Draft, drafts: Iterable[Draft]) -> list[Found]:
    """Return the mistakes that only the case as a whole shows."""
    drafts = list(drafts)
    model, kinematics = top.get("model"), top.get("kinematics")
    found = [f for made in (top, *drafts) for f in check_context(made, model, kinematics)]
    sections = by_section((top, *drafts))
    return found + [f for rule in RULES for f in rule(sections)]


def _materials(sections: Sections) -> Iterator[Found]:
    """Check that each material has the constants of its law."""
    for made in sections.get("material", []):
        law, young, poisson = made.get("law"), made.get("young"), made.get("poisson")
        if law == "orthotropic":
            yield from _orthotropic(made, young, poisson)
        elif law in MATERIAL_LAWS:
            for name in ("young", "poisson", "expansion"):
                if made.has(name):
                    yield made.wrong(f'is no key of law = "{law}", which takes constants; give it there', name)
        elif law is not None:
            for name in ("young", "poisson", "expansion"):
                if isinstance(made.get(name), tuple):
                    message = f'has three numbers, which only law = "orthotropic" takes; here it is "{law}"'
                    yield made.wrong(message, name)
            if isinstance(poisson, float) and not -1 < poisson < 0.5:
                hint = "; take 0.49 for rubber" if poisson >= 0.5 else ""
                yield made.wrong(f"is {poisson:g}; it must be > -1 and < 0.5{hint}", "poisson")


def _orthotropic(made: Draft, young: Any, poisson: Any) -> Iterator[Found]:
    if not made.has("shear"):
        yield made.wrong('needs shear = [G12, G13, G23] with law = "orthotropic"')
    for name, value in (("young", young), ("poisson", poisson)):
        if isinstance(value, float):
            yield made.wrong('is one number; law = "orthotropic" takes three', name)
    if isinstance(young, tuple) and isinstance(poisson, tuple) and not _stores_energy(young, poisson):
        yield made.wrong(
            "makes a law that gives energy when it is strained, with these young; it is [nu12, nu13, nu23], and "
            "nu_ij² < E_i / E_j must hold",
            "poisson",
        )


def _stores_energy(young: tuple[float, ...], poisson: tuple[float, ...]) -> bool:
    """True if the compliance is positive definite: every leading minor of S_ij / sqrt(S_ii S_jj) is positive."""
    (e1, e2, e3), (nu12, nu13, nu23) = young, poisson
    a, b, c = nu12 * sqrt(e2 / e1), nu13 * sqrt(e3 / e1), nu23 * sqrt(e3 / e2)
    return abs(a) < 1 and 1 - a * a - b * b - c * c - 2 * a * b * c > 0


def _groups_once(sections: Sections) -> Iterator[Found]:
    """Check that groups do not give a cell two laws or two temperatures."""
    for name in ("material", "temperature"):
        all_ = sections.get(name, [])
        taken: set[str] = set()
        for made in all_:
            if not made.has("groups") and len(all_) > 1:
                yield made.wrong("has no groups and so is for the whole mesh, beside others; give it groups")
            for group in made.get("groups") or ():
                if group in taken:
                    yield made.wrong(f"names {group!r}, which an earlier [[{name}]] has", "groups")
                taken.add(group)


def _pairs(sections: Sections) -> Iterator[Found]:
    """Check that each slave has one master, which is another skin, and that no slave is rigid."""
    slaves: set[str] = set()
    rigid = {made.get("group") for made in sections.get("rigid", [])}
    for made in [*sections.get("contact", []), *sections.get("tie", [])]:
        slave, master = made.get("slave"), made.get("master")
        if slave is None:
            continue
        if slave == master:
            yield made.wrong(f"is {master!r}, the slave itself; two skins meet, so give each a group", "master")
        if slave in slaves:
            yield made.wrong(f"is {slave!r}, the slave of an earlier one; join the masters in one group", "slave")
        if slave in rigid:
            yield made.wrong(f"is {slave!r}, which is [[rigid]]; let the rigid skin be the master", "slave")
        slaves.add(slave)


def _creases(sections: Sections) -> Iterator[Found]:
    """Check that crease_angle is given only where smooth surfaces or smoothed normals use it."""
    for made in (*sections.get("contact", []), *sections.get("tie", [])):
        smoothed = made.section == "contact" and made.get("normals") != "facet"
        if "crease_angle" in made.told() and made.get("surface") == "faces" and not smoothed:
            also = ' or normals = "smoothed"' if made.section == "contact" else ""
            message = f'means something only with surface = "smooth"{also}; leave it out, or say that'
            yield made.wrong(message, "crease_angle")


def _constants(sections: Sections) -> Iterator[Found]:
    """Check that constants are given to laws that a program has added, and only to these."""
    for section, key, added in (("material", "law", MATERIAL_LAWS), ("contact", "type", CONTACT_LAWS)):
        for made in sections.get(section, []):
            name = made.get(key)
            if made.has("constants") and name is not None and name not in added:
                message = f'are of laws that a Python program has added, and {key} is "{name}"; leave them out'
                yield made.wrong(message, "constants")


def _contacts(sections: Sections) -> Iterator[Found]:
    """Check that the deformed area is the measure only of contact on the deformed skins."""
    usual = "current" if sections[""][0].get("kinematics") == "finite" else "reference"
    for made in sections.get("contact", []):
        if made.get("measure") == "current" and (made.get("geometry") or usual) == "reference":
            yield made.wrong('is "current", which needs geometry = "current": say that, or leave it out', "measure")


def _names(sections: Sections) -> Iterator[Found]:
    """Check that the names, by which results are called, are given and unique."""
    for kinds, default in ((("contact", "tie"), "slave"), (("probe",), "group")):
        taken: set[str] = set()
        for made in [m for kind in kinds for m in sections.get(kind, [])]:
            source = "name" if made.has("name") else default
            name = made.get(source)
            if name is not None and name in taken:
                yield made.wrong(f"calls it {name!r}, as an earlier one is; give it a name of its own", source)
            taken |= {name} - {None}
    for made in sections.get("probe", []):
        if made.has("at") and not made.has("name"):
            yield made.wrong("needs a name, for it has no group to be called by")


def _prescribed_once(sections: Sections) -> Iterator[Found]:
    """Check that each component of a group is prescribed once, and that of a rigid group only by [[rigid]]."""
    taken: set[tuple[Any, ...]] = set()
    rigid = {made.get("group") for made in sections.get("rigid", [])}
    for made in sections.get("displacement", []):
        where = made.get("group") or made.get("at")
        if where is None:
            continue
        if where in rigid:
            yield made.wrong(f"is {where!r}, which is [[rigid]]; move it there", "group")
        if made.has("un") and made.get("kind") == "node":
            yield made.wrong('is along the normal of faces, which a group of nodes (kind = "node") does not have', "un")
        for name in [n for n in ("ux", "uy", "uz", "un") if made.has(n)]:
            if (where, made.get("kind"), name) in taken:
                yield made.wrong(f"is prescribed at {where!r} by an earlier [[displacement]] too; keep one", name)
            taken.add((where, made.get("kind"), name))


def _rigid_once(sections: Sections) -> Iterator[Found]:
    taken: set[Any] = set()
    for made in sections.get("rigid", []):
        group = made.get("group")
        if group is not None and group in taken:
            yield made.wrong(f"is {group!r}, which an earlier [[rigid]] has", "group")
        taken.add(group)


def _fields(sections: Sections) -> Iterator[Found]:
    """Check that gravity and temperature have a material that they act on."""
    materials = sections.get("material", [])
    for section, constant, effect in (("gravity", "density", "weighs"), ("temperature", "expansion", "expands")):
        if materials and not any(constant in made.told() for made in materials):
            for made in sections.get(section, [])[:1]:
                yield made.wrong(f"has no effect: no [[material]] has {_article(constant)}, so that nothing {effect}")


def _article(noun: str) -> str:
    """Return the noun with its indefinite article."""
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def _engine(sections: Sections) -> Iterator[Found]:
    """Check that the linear solver is one of the engine, if that is named."""
    for made in sections.get("solver", []):
        engine, backend = made.get("engine"), made.get("backend")
        fitting = BACKENDS_OF.get(engine, ())
        if fitting and backend not in (None, "auto", *fitting):
            others = f'the linear solvers of engine = "{engine}" are auto, {", ".join(fitting)}'
            yield made.wrong(f'is "{backend}"; {others}', "backend")


def _output(sections: Sections) -> Iterator[Found]:
    """Check that no output time is after the end of the steps."""
    steps, outputs = sections.get("steps", []), sections.get("output", [])
    if not outputs or outputs[0].get("times") is None:
        return
    end = 1.0
    if steps:
        times = steps[0].get("times")
        end = times[-1] if times else steps[0].get("end")
    late = [t for t in outputs[0].get("times") if end is not None and t > end]
    if late:
        yield outputs[0].wrong(f"has {late[0]:g}, after the end of the steps at {end:g}", "times")


def _motion(sections: Sections) -> Iterator[Found]:
    """Check that bodies that move have a mass, and that the scheme is stable."""
    if not sections.get("dynamics"):
        for made in sections.get("initial", []):
            yield made.wrong("means something only with [dynamics]; add that section, or leave this one out")
        return
    (moving, *_) = sections["dynamics"]
    for made in sections.get("material", []):
        if made.get("density") == 0.0:
            groups = ", ".join(repr(name) for name in made.get("groups") or ())
            where = f"the cells of {groups}" if groups else "the cells"
            yield made.wrong(f"needs a density, for {where} have a mass with [dynamics]")
    beta, gamma = moving.get("beta"), moving.get("gamma")
    if moving.get("scheme") == "newmark" and None not in (beta, gamma) and not 0.5 <= gamma <= 2 * beta:
        message = f"and gamma are {beta:g} and {gamma:g}, which is not stable"
        yield moving.wrong(f"{message}; take gamma >= 1/2 and beta >= gamma / 2", "beta")
    start = moving.get("start")
    steps = sections.get("steps", [])
    end = (steps[0].get("times") or [steps[0].get("end")])[-1] if steps else 1.0
    if None not in (start, end) and start >= end:
        yield moving.wrong(f"is {start:g}, and the steps end at {end:g}; inertia must act in some of them", "start")
    for made in sections.get("initial", []):
        if made.has("centre") and not made.has("rotation"):
            yield made.wrong("means something only with rotation; give that, or leave it out", "centre")
    for made in sections.get("initial", []) if start else []:
        for name in [n for n in ("ux", "uy", "uz") if made.has(n)]:
            message = f"means something only with start = 0, and dynamics.start is {start:g}"
            yield made.wrong(f"{message}: the static steps before give the displacement", name)


def _inertia(sections: Sections) -> Iterator[Found]:
    """Check that the inertia of rigid bodies has a mass, and is that of a body."""
    space = sections[""][0].get("model") == "3d"
    for made in sections.get("rigid", []):
        inertia = made.get("inertia")
        if inertia is None:
            continue
        if not made.has("mass"):
            yield made.wrong("needs the mass that it is of; give mass too", "inertia")
        if space != isinstance(inertia, tuple):
            words = "is one number; in 3d it is three" if space else "is three numbers; in a plane it is one"
            yield made.wrong(words, "inertia")
        elif space and not 2 * max(inertia) <= sum(inertia) * (1 + 1e-9):
            yield made.wrong("has a moment larger than the sum of the other two, as no body has", "inertia")


RULES: tuple[Callable[[Sections], Iterator[Found]], ...] = (
    _materials,
    _groups_once,
    _pairs,
    _creases,
    _constants,
    _contacts,
    _names,
    _prescribed_once,
    _rigid_once,
    _fields,
    _motion,
    _inertia,
    _engine,
    _output,
)
