"""Several processes against one: problems of the other families, divided among 1 to 8 processes of PETSc over MPI.

The reference is lacsolver in one process, whose results the other families compare with exact solutions: here they must
not depend on the number of processes, nor on the preconditioner. Each process reads its part of the mesh alone, as
`lacmesh partition` divides it, and cuts it there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from verification.divided import FailedError, WholeState, found, solve_divided
from verification.families import balance, patch, sliding
from verification.families.balance import Touch
from verification.families.patch import Press
from verification.families.sliding import MESHES, Dragged, Slider
from verification.meshes.bars import bar_on_wall, bars
from verification.meshes.sliding import slider
from verification.mpiexec import missing
from verification.records import Case, Family, Rows, at_least, at_most, problem, row
from verification.solving import Solved, balance_of, case_text, contact, entry, fixed, solve, worst

_SIDES = [(axis, f"{axis}{end}") for axis in "xy" for end in "01"]


@dataclass(frozen=True)
class Free:
    """A problem of this module, by its name."""

    name: str

    @property
    def text(self) -> str:
        """The case, as TOML."""
        return _PROBLEMS[self.name][0]

    @property
    def mesh(self) -> Mesh:
        """The mesh, not cut."""
        return _PROBLEMS[self.name][1]()


def _text(model: str, *tables: str, finite: bool = False, end: float = 1.0, count: int = 2) -> str:
    """A case of bodies of density 1 with these tables; `end`, `count`: of its steps."""
    law = {"law": "neo_hookean"} if finite else {}
    body = entry("material", **law, young=1.0, poisson=0.3, density=1.0)
    kinematics = "finite" if finite else "small"
    return case_text(model, body, *tables, entry("steps", end=end, count=count), kinematics=kinematics)


def _held(dim: int) -> list[str]:
    """Conditions by which waves are those of one dimension."""
    return [fixed(side, axis) for axis, side in _SIDES[: 2 * (dim - 1)]]


_CONTACT = contact()
_BOTTOM = fixed("bottom", "xyz")
_NO_LOAD = {"fx": 0.0, "fy": 0.0, "fz": 0.0, "moment": [0.0, 0.0, 0.0]}
#: name -> the text of the case, and what makes the mesh
_PROBLEMS: dict[str, tuple[str, Callable[[], Mesh]]] = {
    "bars": (
        _text(
            "plane_strain", _CONTACT, *_held(2), entry("initial", groups=["upper"], vy=-0.05), "[dynamics]",
            end=1.2, count=15,
        ),
        lambda: bars(("QUAD8", "TRIA3"), (8, 7), (2, 1), 0.01),
    ),
    "spin": (
        _text(
            "3d", _CONTACT, entry("initial", groups=["upper"], vz=-0.15, rotation=[0.0, 0.1, 0.05]),
            '[dynamics]\nscheme = "newmark"\nrayleigh = [0.02, 0.01]', finite=True, end=1.2, count=8,
        ),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1), 0.02),
    ),
    "top": (
        _text(
            "3d", _CONTACT, _BOTTOM, entry("spring", group="top", kx=1e-3, ky=1e-3),
            entry("rigid", group="top", fz="-1e-4 * t", moment=[0.0, "1e-6 * t", 0.0]),
        ),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1)),
    ),
    "plate": (
        _text(
            "plane_strain", entry("contact", slave="slave", master="wall"),
            fixed("top", "xy"),
            entry("rigid", group="wall", fy="0.01 * t", moment=0.0), finite=True,
        ),
        lambda: bar_on_wall("QUAD8", 8),
    ),
    "wall": (
        _text(
            "plane_strain", entry("contact", slave="slave", master="wall"),
            entry("rigid", group="wall", fx=0.0, fy=0.0, moment=0.0, mass=0.5, inertia=0.01), "[gravity]\ngx = 0.1",
            "[dynamics]", entry("initial", groups=["wall"], rotation=2.0), entry("initial", groups=["bar"], vy=-0.53),
            finite=True, end=0.4, count=8,
        ),
        lambda: bar_on_wall("QUAD4", 6, 0.05),
    ),
    "thrown": (
        _text(
            "3d", _CONTACT, _BOTTOM, entry("rigid", group="top", **_NO_LOAD, mass=0.01, inertia=[1e-4, 1e-4, 2e-4]),
            "[dynamics]", entry("initial", groups=["upper"], vz=-0.1), count=6,
        ),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1), 0.01),
    ),
}  # fmt: skip


Floats = NDArray[np.floating]
Borrowed = Touch | Press | Slider | Dragged | Free
Ranks = tuple[tuple[int, tuple[str, ...]], ...]

FAMILY_NAME = "distributed"
BACKENDS = ("multigrid", "gamg", "hypre", "mumps")
#: numbers of processes, and the backends that each solves with
RANKS: Ranks = (*((n, BACKENDS) for n in (1, 2, 3, 4)), (8, ("multigrid",)))
#: the same for cases of dozens of steps: each backend, and several numbers, once
FEW: Ranks = ((2, ("multigrid", "mumps")), (3, ("hypre", "gamg")), (4, ("multigrid",)))
#: tolerance of Newton's method in these
_TIGHT = 1e-11
#: bounds of the difference from one process, relative to the largest value of the step
U, P, BALANCED = 1e-9, 5e-9, 1e-10
_SOURCE = "one process (engine serial), on the whole mesh"
_LINEAR = "linear systems are solved to 1e-10 of the forces; the condition of the bodies multiplies it"
#: what is compared: fields of a `Difference`, names, bounds, sources and reasons
_COMPARED = (
    ("sets", "macro-elements in another state", 0, _SOURCE, "the active set is the same, or it is another solution"),
    ("u", "displacement, relative difference", U, _SOURCE, _LINEAR),
    ("p", "pressure, relative difference", P, _SOURCE,
     "the same, and a pressure is a difference of neighbouring forces"),
    ("motion", "velocities and energies, relative difference", U, _SOURCE, _LINEAR),
    ("balance", "balance of forces and moments", BALANCED, "action and reaction",
     "of the contact forces that are gathered from all processes"),
)  # fmt: skip


@dataclass(frozen=True)
class Difference:
    """A solution by n processes against that by one, the worst of all steps: `sets` macro-elements whose state differs,
    displacement and pressure relative to the largest of the step, and the balance of the contact forces. `motion`:
    velocities and energies, relative to the largest of the step; None without inertia.
    """

    n: int
    backend: str
    sets: int
    u: float
    p: float
    balance: float
    motion: float | None = None


def problems(given: Borrowed) -> Iterator[tuple[str, Mesh]]:
    """The cases, as TOML, and the meshes, not cut, of a problem of another family, on its coarsest mesh."""
    if isinstance(given, Touch):
        yield from ((balance.text(given), balance.mesh_of(given, *pair)) for pair in given.pairs)
    elif isinstance(given, Press):
        yield from ((patch.text(given), patch.mesh_of(given, *pair)) for pair in given.pairs)
    elif isinstance(given, Free):
        yield given.text, given.mesh
    elif isinstance(given, Slider):
        yield sliding.slider_text(given), slider(given.cell, given.n, given.faces, given.wave)
    else:
        yield sliding.dragged_text(given, given.steps[0]), MESHES[given.mesh](given.sizes[0])


@problem
def run(problem: Borrowed, title: str, ranks: Ranks = RANKS) -> Rows:
    """Solve a problem of another family, or a `Free` one, in one process and in several, and compare.

    `ranks`: numbers of processes, and the backends that each solves with.
    """
    cases = {f"case{k}": each for k, each in enumerate(problems(problem))}
    alone = {name: solve(*each) for name, each in cases.items()}
    differences = []
    for n, backend in ((n, backend) for n, backends in ranks for backend in backends):
        with tempfile.TemporaryDirectory() as folder:
            several = solve_divided(cases, n, backend, Path(folder))
        differences += [compared(alone[name], states, n, backend) for name, states in several.items()]
    yield from _judged(differences)
    closed = min(int((_found(solved)[-1].status == 1).sum()) for solved in alone.values())
    name = "closed macro-elements at the end, the least of all problems"
    reason = "processes agree on nothing where nothing touches"
    yield at_least(name, closed, 1, source="the load", reason=reason)


def compared(alone: Solved, states: Sequence[WholeState], n: int, backend: str) -> Difference:
    """The difference of states of n processes from those of one. Raises FailedError where they are at other times."""
    expected = _found(alone)
    times, wanted = [s.time for s in states], [s.time for s in expected]
    if len(times) != len(wanted) or not np.allclose(times, wanted, rtol=1e-12, atol=0.0):
        raise FailedError(f"{n} processes with {backend} took {len(times)} steps, and one process {len(wanted)}")
    pairs = list(zip(states, expected, strict=True))
    forces = worst(balance_of(alone.problem, one.u.ravel(), list(one.force)) for one in states)

    def largest(*fields: str) -> float | None:
        values = ((getattr(one, field), getattr(other, field)) for field in fields for one, other in pairs)
        return max((_relative(*two) for two in values if two[1].size), default=None)

    sets = max(int((one.status != other.status).sum()) for one, other in pairs)
    u, p, motion = largest("u"), largest("pressure"), largest("velocity", "energies")
    assert u is not None and p is not None
    return Difference(n, backend, sets, u, p, max(forces), motion)


def _found(alone: Solved) -> list[WholeState]:
    return [found(state, alone.problem) for state in alone.states]


def _relative(values: Floats, expected: Floats) -> float:
    """Largest difference, relative to the largest value; inf where that is 0 and the values are not."""
    far, size = float(np.abs(values - expected).max()), float(np.abs(expected).max())
    return far / size if size else np.inf if far else 0.0


def _judged(differences: Sequence[Difference]) -> Rows:
    """Criteria for each backend: the worst of all numbers of processes and problems."""
    for backend in dict.fromkeys(one.backend for one in differences):
        own = [one for one in differences if one.backend == backend]
        which = f"{backend}, n = {', '.join(map(str, dict.fromkeys(one.n for one in own)))}"
        for field, name, bound, source, reason in _COMPARED:
            values = [getattr(one, field) for one in own if getattr(one, field) is not None]
            if values:
                yield at_most(f"{name}: {which}", max(values), bound, source=source, reason=reason)


# ---- the cases

_FACET = (("normals", "facet"),)
_SMOOTHED = (("normals", "smoothed"),)
#: every kind of cells, as slave or as master
PLANE = (*(("TRIA3", "QUAD8"), ("QUAD4", "TRIA7"), ("TRIA6", "QUAD4"), ("QUAD9", "QUAD8")), ("mixed 1", "mixed 2-full"))
SOLID = (
    *(("TETRA4", "HEXA8"), ("HEXA8", "TETRA10"), ("TETRA10", "HEXA20"), ("HEXA20", "PENTA6 triangle")),
    *(("HEXA27", "PYRAM5 quadrangle"), ("PENTA15 quadrangle", "HEXA27"), ("PYRAM13 triangle", "TETRA4")),
    *(("PENTA18 triangle", "HEXA8"), ("TETRA4", "PYRAM14 quadrangle"), ("mixed 2", "mixed 1")),
)
_FEW = {"2d": PLANE[:2], "axisymmetric": PLANE[1:3], "3d": (("HEXA8", "TETRA4"),)}
_MODELS = {"2d": "plane_strain", "axisymmetric": "axisymmetric", "3d": "3d"}


def _case(name: str, words: str, problem: Borrowed, seconds: float = 60.0, ranks: Ranks = RANKS) -> Case:
    return row(FAMILY_NAME, name, words, run, problem, words, ranks, every=1, seconds=seconds)


def _cases() -> Iterator[Case]:
    """Problems of the family `balance`; bodies that contact alone holds; motions; problems of the family `sliding`."""
    for dim, model in _MODELS.items():
        every = Touch(SOLID if dim == "3d" else PLANE, model, "waves", _FACET)
        yield _case(f"cells-{dim}", f"every kind of cells, {dim}", every, 120.0)
        finite = Touch(_FEW[dim], model, "waves", _SMOOTHED, "finite", steps=2)
        yield _case(f"finite-{dim}", f"finite kinematics, smoothed normals, {dim}", finite)
    for dim in ("2d", "3d"):
        few, model = _FEW[dim], _MODELS[dim]
        yield _case(f"tie-{dim}", f"a tie across a gap, {dim}", Touch(few, model, "waves", joint="tie", gap=0.07))
        yield _case(f"overhang-{dim}", f"a slave wider than its master, {dim}", Touch(few, model, "overhang"))
        rigid = Touch(few[:1], model, "rigid", (), "finite", steps=2)
        yield _case(f"rigid-{dim}", f"a rigid skin that comes down and turns, finite kinematics, {dim}", rigid)
    one, both = _FEW["3d"], (("TETRA4", "HEXA8"), ("HEXA8", "TETRA4"))
    floats = "patch test: the upper block floats on the lower one under a pressure"
    plane = Press((("QUAD4", "TRIA3"), ("TRIA6", "QUAD8")), "plane_strain", contact=_FACET)
    solid = Press((("HEXA8", "TETRA4"), ("TETRA10", "HEXA8")), contact=_FACET)
    three = Touch(one, "3d", "tower", ())
    warped = Touch((("HEXA20", "HEXA8"),), "3d", "saddle", (("hexa", "hexa"),))
    bilateral = Touch(one, "3d", "waves", (("type", "bilateral"),))
    yield _case("stars-3d", "macro-elements of whole faces, 3d", Touch(both, "3d", "waves", (("macro", "stars"),)))
    yield _case("bilateral-3d", "pressure of either sign, 3d", bilateral)
    yield _case("warped-3d", "quadrangles that are not plane, cut hexa, 3d", warped)
    yield _case("floating-2d", f"{floats}, 2d", plane)
    yield _case("floating-3d", f"{floats}, 3d", solid)
    yield _case("tower-small", "three blocks, two zones, the middle one fixed by contact alone", three)
    yield _case("tower-finite", "the same, finite kinematics", replace(three, kinematics="finite"), 90.0)
    for name, words, ranks in (
        ("bars", "a bar hits another, 2d", FEW),
        ("spin", "a bar that spins hits another, finite kinematics, 3d", FEW),
        ("top", "a rigid top that is pushed and turned, 3d", RANKS),
        ("plate", "a rigid plate that contact alone stops, finite kinematics, 2d", RANKS),
        ("wall", "a bar hits a free wall that turns, finite kinematics, 2d", FEW),
        ("thrown", "a body with a free rigid top is thrown on another, 3d", FEW),
    ):
        yield _case(f"free-{name}", words, Free(name), 90.0, ranks)
    for case in sliding.FAMILY.cases:
        given = case.solve.args[0]
        if isinstance(given, Dragged):  # of its own tolerance 1e-7 of u is left near a limit point
            yield _case(case.name, case.description, replace(given, tolerance=_TIGHT), 2 * case.seconds, FEW)
        else:
            yield _case(case.name, case.description, given, 15 * case.seconds)


TEXT = f"""
Problems of the families balance, patch and sliding, on their coarsest meshes: every kind of cells, bodies that float,
ties, rigid skins, finite kinematics, several zones and large sliding; and impacts and free rigid bodies on few cells.
Each is solved by one process on the whole mesh, and by 1, 2, 3, 4 and 8 processes of `mpiexec`, of which each reads its
own part of the mesh and cuts it, with multigrid, with PETSc's GAMG, with hypre and with MUMPS (8 processes with
multigrid). Impacts, the ring and the ironing, of 6 to 36 steps, are solved by 2 processes with multigrid and MUMPS, by
3 with hypre and GAMG, and by 4 with multigrid.

At every step the same macro-elements must be closed, displacements differ by at most {U:g} of the largest, pressures by
at most {P:g}, and the contact forces that are gathered from all processes be in balance to {BALANCED:g}.
Of impacts velocities and energies are compared, too.
"""

FAMILY = Family(FAMILY_NAME, "Several processes", TEXT, tuple(_cases()), missing)
