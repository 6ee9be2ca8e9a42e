"""Solution of a case, and what is computed for every solution: the last state, its fields, the balance of forces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacsolver import Solution
from lacsolver.case import Displacement, Value
from lacsolver.contact import integrate
from lacsolver.equilibrium.state import State, ZoneFriction, ZoneState
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import state_fields
from lacsolver.results.figures import step_figures
from lacsolver.results.results import Fields, StepFigures
from verification.measures.balance import Balance, unbalanced
from verification.records import Level, Picture, Result, at_most, levels_of

Floats = NDArray[np.floating]
#: displacement (n, dim) at points (n, 3) and a time
Motion = Callable[[Floats, float], Floats]

#: what is left of forces and moments, of their own size (design: rounding of some thousand terms)
BALANCED = 1e-12
_SOURCE = "action and reaction; one quadrature and one normal for both sides"


@dataclass(frozen=True, eq=False)
class Solved:
    """A problem and the states that it went through, the last at the end of its steps."""

    problem: Problem
    states: tuple[State, ...]

    @property
    def state(self) -> State:
        """The last state."""
        return self.states[-1]

    @property
    def mesh(self) -> Mesh:
        """The cut mesh that was solved on."""
        return self.problem.space.mesh

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns."""
        return int(self.problem.constraints.n_q)

    @property
    def zone(self) -> ZoneState:
        """State of the one zone at the end."""
        (zone,) = self.state.zones
        return zone

    @property
    def friction(self) -> ZoneFriction:
        """Friction of the one zone at the end. Raises ValueError without any."""
        if self.zone.friction is None:
            raise ValueError("the contact has no friction")
        return self.zone.friction

    @property
    def shear(self) -> NDArray[np.floating]:
        """Traction of friction on the master (m, d), along the slave's slip."""
        return self.friction.in_space(self.friction.shear)

    @property
    def slip(self) -> NDArray[np.floating]:
        """Mean slip (m, d) of the last step."""
        return self.friction.in_space(self.friction.slip)

    @property
    def passed(self) -> NDArray[np.floating]:
        """Mean way (m, d) of the slave along the master, of open macro-elements too, where skins are paired once."""
        (joint,), d = self.problem.joints, self.problem.space.dim
        face = integrate(joint.zone, d, joint.pairing)
        assert face.B_T is not None
        return self.friction.in_space((face.B_T @ self.state.u).reshape(-1, d - 1) / face.w[:, None])

    @property
    def recovered(self) -> NDArray[np.floating]:
        """Recovered pressure (n_nodes,) at the end, on the slave of the one zone; NaN elsewhere."""
        return self.fields.zones[self.zone.name].pressure_recovered

    @property
    def iterations(self) -> int:
        """Number of Newton iterations of all steps."""
        return sum(state.iterations for state in self.states)

    @property
    def halvings(self) -> int:
        """Number of times that a step was halved."""
        return sum(state.halvings for state in self.states)

    @cached_property
    def u(self) -> NDArray[np.floating]:
        """(n_nodes, dim): displacement at the end."""
        return self.state.u.reshape(-1, self.problem.space.dim)

    @cached_property
    def figures(self) -> StepFigures:
        """The last step's figures."""
        return step_figures(self.problem, self.state)

    @cached_property
    def fields(self) -> Fields:
        """The last state's fields: nodal stress, recovered pressures."""
        return state_fields(self.problem, self.state)

    @cached_property
    def balance(self) -> Balance:
        """Worst balance of all states and zones, computed here from the nodal forces."""
        return worst(balance_of(self.problem, s.u, [zone.force for zone in s.zones]) for s in self.states)

    def picture(self, title: str) -> Picture:
        """The deformed bodies with the contact pressure, drawn by lacsolver."""
        drawn = Solution.of(self.problem, self.state).plot()
        return Picture(title, f"{title}: the deformed model, and its contact pressure", drawn.png)


@dataclass(frozen=True, eq=False)
class LevelSolution:
    """A solution on one mesh of several: the size `h` of the mesh, and errors by their names."""

    solved: Solved
    h: float
    errors: Mapping[str, float]


def solve(case: lacsolver.Case | str, mesh: Mesh) -> Solved:
    """Solve a case, or its text, on a mesh. Raises what `Problem.of` and `march` raise."""
    return finished(Problem.of(lacsolver.parse_case(case) if isinstance(case, str) else case, mesh))


def with_motions(case: lacsolver.Case | str, motions: Mapping[str, Motion]) -> lacsolver.Case:
    """A case, or its text, with groups that are moved by functions."""
    case = lacsolver.parse_case(case) if isinstance(case, str) else case
    axes = "xyz" if case.model == "3d" else "xy"

    def moved(group: str, motion: Motion) -> Displacement:
        u: dict[str, Any] = {f"u{axis}": Value.of(lambda x, t, k=k: motion(x, t)[:, k]) for k, axis in enumerate(axes)}
        return Displacement(group=group, **u)

    more = (moved(group, motion) for group, motion in motions.items())
    return replace(case, displacement=(*case.displacement, *more))


def finished(problem: Problem) -> Solved:
    """Solve a problem. Raises what `march` raises."""
    return Solved(problem, tuple(march(problem)))


def balance_of(problem: Problem, u: Floats, forces: Sequence[Floats]) -> Balance:
    """Worst balance of all zones under u (n_dof,), with the contact force (n_nodes, dim) of each on all nodes."""
    space = problem.space
    moved = np.zeros_like(space.mesh.points)
    moved[:, : space.dim] = u.reshape(-1, space.dim)
    return worst(
        unbalanced(space.mesh.points + pair.moving * moved, force, axisymmetric=space.model.axisymmetric)
        for pair, force in zip(problem.joints, forces, strict=True)
        if pair.pairing.turn is None  # forces on the next sector are turned
    )


def worst(balances: Iterable[Balance]) -> Balance:
    """The largest of several balances, of forces and of moments."""
    listed = list(balances)
    return Balance(max(b.force for b in listed), max(b.moment for b in listed))


def with_true_gap(problem: Problem, gap: Callable[[Floats, Floats], Floats]) -> Problem:
    """The problem with the true gap at every point of its contact, whatever lies between the faces there.

    `gap`: (n,) at points (n, 3) of the slave, in the coordinates of the mesh, along its normals there (n, 3).
    """
    (joint,), places = problem.joints, []

    def none(x: Floats, t: float) -> Floats:
        places.append(x + problem.space.origin)
        return np.zeros(len(x))

    pairing = replace(joint.pairing, clearance=none)
    points = integrate(joint.zone, problem.space.dim, pairing).points
    missing = gap(places[0], points.normal) - points.gap
    return replace(problem, joints=(replace(joint, pairing=replace(pairing, clearance=lambda x, t: missing)),))


def convergence(solutions: Sequence[LevelSolution], error: str) -> tuple[Level, ...]:
    """Table of convergence of an error, by its name in solutions on finer and finer meshes."""
    errors = [s.errors[error] for s in solutions]
    return levels_of([s.h for s in solutions], [s.solved.unknowns for s in solutions], errors)


def balanced(solutions: Sequence[Solved], *, moments: bool = True) -> tuple[Result, ...]:
    """The results that every case with contact has: the worst balance of its solutions."""
    force = max(solved.balance.force for solved in solutions)
    reason = "rounding of sums of nodal forces"
    results = [at_most("balance of forces", force, BALANCED, source=_SOURCE, reason=reason)]
    if moments:
        moment = max(solved.balance.moment for solved in solutions)
        results.append(at_most("balance of moments", moment, BALANCED, source=_SOURCE, reason=reason))
    return tuple(results)


#: tables that a case file has once
_ONCE = ("dynamics", "gravity", "solver", "steps")


def case_text(model: str, *tables: str, **keys: object) -> str:
    """The text of a case file: its model and other keys, and its tables (`entry`).

    >>> print(case_text("3d", entry("rigid", group="wall"), kinematics="finite"))
    mesh = "mesh.msh"
    model = "3d"
    kinematics = "finite"
    <BLANKLINE>
    [[rigid]]
    group = "wall"
    <BLANKLINE>
    """
    return "\n\n".join([_keys(mesh="mesh.msh", model=model, **keys), *tables]) + "\n"


def model_of(dim: int) -> str:
    """The model of solids: plane strain in a plane."""
    return "3d" if dim == 3 else "plane_strain"


def entry(table: str, **keys: object) -> str:
    """A table of a case file; keys whose value is None are left out.

    >>> print(entry("displacement", group="x0", ux=0.0))
    [[displacement]]
    group = "x0"
    ux = 0.0
    """
    head = f"[{table}]" if table in _ONCE else f"[[{table}]]"
    return "\n".join([head, *filter(None, [_keys(**keys)])])


def material(young: float, poisson: float, **keys: object) -> str:
    """The table of a material."""
    return entry("material", young=young, poisson=poisson, **keys)


def contact(slave: str = "slave", master: str = "master", **keys: object) -> str:
    """The table of a contact."""
    return entry("contact", slave=slave, master=master, **keys)


def fixed(group: str, axes: str) -> str:
    """The table of a group whose displacement along some axes, such as "xy", is zero.

    >>> print(fixed("bottom", "xy"))
    [[displacement]]
    group = "bottom"
    ux = 0.0
    uy = 0.0
    """
    return entry("displacement", group=group, **{f"u{axis}": 0.0 for axis in axes})


def times(*counts: int) -> list[float]:
    """Ends of time steps: so many in each unit of time.

    >>> times(1, 4)
    [1.0, 1.25, 1.5, 1.75, 2.0]
    """
    return [unit + (k + 1) / count for unit, count in enumerate(counts) for k in range(count)]


def _keys(**keys: object) -> str:
    return "\n".join(f"{key} = {_toml(value)}" for key, value in keys.items() if value is not None)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_toml, value))}]"
    return repr(value)
