"""**Robustness bank.** A block on a block of another stiffness, its top moved at random in four steps: pressed,
sheared, rocked and twisted by as much as or four times as much as it is pressed, so that macro-elements open, close,
stick, slide and turn round in one step; mu from 0.1 to 1.5. Every step must be solved at once, without a cutback. In
the plane the tractions are those of Lemke's method and of a fixed point on Tresca's bounds; in space they meet all
conditions on matrices that are condensed by other means. Other units of length and stress give the same iterations.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacsolver import NotConvergedError
from lacsolver.contact import integrate
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.state import State
from verification.exact.coulomb import Condensed, condensed, lemke, tresca
from verification.meshes.blocks import bent
from verification.meshes.stacks import stack
from verification.records import Case, Outcome, at_most, informative
from verification.solving import case_text, entry, model_of, with_motions

Floats = NDArray[np.floating]

FRICTION, SEVERITY, STEPS = (0.1, 0.3, 0.6, 1.0, 1.5), (1.0, 4.0), 4
#: how far the top comes down; lengths are in sides of the blocks
PRESS = 0.02
#: iterations of a step, mean; of the tractions, relative to the largest pressure
ITERATIONS, SAME = {2: 5.0, 3: 8.0}, 1e-8
_SOURCE = {2: "measured on a prototype: 4.2, at most 57", 3: "measured on a prototype: 7.1, at most 15"}


@dataclass(frozen=True)
class FrictionBank:
    """Random problems on blocks of each of some cells, for every mu and severity."""

    cells: tuple[str, ...]
    dim: int

    @property
    def counts(self) -> tuple[int, int]:
        """Cells along a side of the lower and of the upper block."""
        return (8, 7) if self.dim == 2 else (4, 3)


def mesh_of(bank: FrictionBank, cell: str, unit: float = 1.0) -> Mesh:
    """The blocks, the lower one with the slave."""
    mesh = stack(cell, cell, bank.dim, counts=bank.counts, bend=0.3, skew=0.1 if bank.dim == 3 else 0.0)
    return bent(mesh, lambda x: unit * x)


def case_of(
    bank: FrictionBank, friction: float, severity: float, seed: int, unit: float = 1.0, stress: float = 1.0
) -> lacsolver.Case:
    """The case: STEPS steps, the top moved in each by a random rigid motion."""
    axes = "xyz"[: bank.dim]
    text = case_text(
        model_of(bank.dim),
        entry("material", groups=["lower"], young=stress, poisson=0.3),
        entry("material", groups=["upper"], young=3 * stress, poisson=0.2),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("displacement", group="bottom", **{f"u{a}": 0.0 for a in axes}),
        entry("steps", times=[float(k + 1) for k in range(STEPS)], max_halvings=0),
        entry("solver", max_iterations=100),
    )
    shift, turn = motions(bank.dim, friction, severity, seed)

    def moved(x: Floats, t: float) -> Floats:
        step, centre = min(round(t), STEPS) - 1, unit * np.array([0.5, *([0.5] * (bank.dim - 2)), 2.0])
        arm = x[:, : bank.dim] - centre
        return np.stack([unit * shift[step, k] + arm @ turn[step, k] for k in range(bank.dim)], axis=1)

    return with_motions(text, {"top": moved})


def motions(dim: int, friction: float, severity: float, seed: int) -> tuple[Floats, Floats]:
    """Shifts (steps, dim) and gradients (steps, dim, dim) of the top's motion, skew."""
    random = np.random.default_rng([dim, seed, round(100 * friction), round(10 * severity)])
    shift, turn = np.zeros((STEPS, dim)), np.zeros((STEPS, dim, dim))
    for k in range(STEPS):
        size = 1.5 * PRESS * severity
        shift[k, :-1] = size * random.standard_normal(dim - 1)
        shift[k, -1] = -PRESS * random.uniform(0.2, 1.5)
        spin = size * random.standard_normal((dim, dim))
        turn[k] = (spin - spin.T) / 2
    return shift, turn


# ---- the same problem on condensed matrices


@dataclass
class Condenser:
    """The problem of a case on its matrices: dense, the supports taken out; the anchors of slip as steps go on."""

    problem: Problem
    friction: float

    def __post_init__(self) -> None:
        (joint,) = self.problem.joints
        face = integrate(joint.zone, self.problem.space.dim, replace(joint.pairing, friction=True))
        none = np.zeros(self.problem.space.n_dof)
        self.K = self.problem.kinematics.tangent(none, 1.0).toarray()
        assert face.B_T is not None
        self.B, self.B_T, self.G, self.w = face.B.toarray(), face.B_T.toarray(), face.G, face.w
        self.free = self.problem.constraints.free
        self.anchor = np.zeros(len(self.B_T))

    def at(self, t: float) -> Condensed:
        """The condensed problem of the step that ends at t."""
        u0, free = self.problem.constraints.u0(t), self.free
        m = len(self.G)
        return condensed(
            self.K[np.ix_(free, free)], -(self.K @ u0)[free], (self.B[:, free], self.B_T[:, free]),
            self.G - self.B @ u0, self.friction, (self.B_T @ u0 - self.anchor).reshape(m, -1),
        )  # fmt: skip

    def commit(self, state: State) -> None:
        """Slip is counted from the last state in which a macro-element did not stick."""
        (zone,) = state.zones
        across = len(self.B_T) // len(self.G)
        moves = np.repeat(zone.status != 1, across)
        self.anchor[moves] = (self.B_T @ state.u)[moves]


@dataclass
class BankRun:
    """A problem of the bank: its states, and how far tractions are from others' and from the conditions."""

    states: list[State]
    lost: int
    apart: list[float]
    residual: list[float]
    oracle_lost: int


def run(bank: FrictionBank, mesh: Mesh, friction: float, severity: float, seed: int) -> BankRun:
    """Solve one problem, and each of its steps by the oracles from the same start."""
    problem = Problem.of(case_of(bank, friction, severity, seed), mesh)
    oracle = Condenser(problem, friction)
    out = BankRun([], 0, [], [], 0)
    steps = march(problem)
    try:
        for state in steps:
            out.states.append(state)
            _compare(bank, oracle, state, out)
            oracle.commit(state)
    except NotConvergedError:
        out.lost = STEPS - len(out.states)
    return out


def _compare(bank: FrictionBank, oracle: Condenser, state: State, out: BankRun) -> None:
    given, (zone,) = oracle.at(state.time), state.zones
    assert zone.friction is not None
    p, t = zone.pressure, zone.friction.shear
    size = max(float(np.abs(p).max()), float(np.abs(given.G / np.diag(given.A)[: len(p)]).max()))
    out.residual.append(given.residual(p, t))
    for way in (lemke, tresca) if bank.dim == 2 else ():
        try:
            right, shear = way(given)
        except ArithmeticError:
            out.oracle_lost += 1
            continue
        out.apart.append(float(max(np.abs(p - right).max(), np.abs(t - shear).max()) / size))


def solve_bank(bank: FrictionBank, *, levels: int) -> Outcome:
    """So many problems for every mu and severity."""
    runs, own_means = [], {}
    for cell in bank.cells:
        mesh = mesh_of(bank, cell)
        ways = itertools.product(FRICTION, SEVERITY, range(levels))
        own = [run(bank, mesh, friction, severity, seed) for friction, severity, seed in ways]
        own_means[cell] = float(np.mean([state.iterations for one in own for state in one.states]))
        runs += own
    each = [state.iterations for own in runs for state in own.states]
    steps, source = STEPS * len(runs), _SOURCE[bank.dim]
    off = max(r for own in runs for r in own.residual)
    results = [
        at_most(f"steps that are not solved at once, of {steps}", sum(own.lost for own in runs), 0, source=source),
        at_most("iterations of a step, mean", float(np.mean(each)), ITERATIONS[bank.dim], source=source),
        *(informative(f"iterations of a step, mean, {cell}", m, reason="no bound") for cell, m in own_means.items()),
        informative("iterations of a step, largest", max(each), reason="no bound"),
        at_most("largest violation of the conditions, of the largest pressure", off, SAME,
                source="matrices condensed by other means"),
    ]  # fmt: skip
    if bank.dim == 2:
        apart = [a for own in runs for a in own.apart]
        results += [
            at_most("largest difference from Lemke's method and Tresca's fixed point", max(apart), SAME,
                    source="Klarbring 1986; Haslinger 1980", reason="in parts of the largest pressure"),
            informative("steps that these did not solve", sum(own.oracle_lost for own in runs), reason="rounding"),
        ]  # fmt: skip
    return Outcome(tuple(results))


# ---- units


def solve_units(bank: FrictionBank, unit: float = 1e3, stress: float = 1e-6, *, levels: int) -> Outcome:
    """Problems of a bank in other units of length and of stress. Numbers of iterations in both units."""
    changed, count = 0, 0
    for friction in FRICTION:
        for severity in SEVERITY:
            for seed in range(levels):
                own = _iterations(bank, friction, severity, seed, 1.0, 1.0)
                other = _iterations(bank, friction, severity, seed, unit, stress)
                changed, count = changed + (own != other), count + 1
    return Outcome((at_most(f"problems with other iterations, of {count}", changed, 0, source="units are arbitrary"),))


def _iterations(
    bank: FrictionBank, friction: float, severity: float, seed: int, unit: float, stress: float
) -> list[int]:
    mesh = mesh_of(bank, bank.cells[0], unit)
    problem = Problem.of(case_of(bank, friction, severity, seed, unit, stress), mesh)
    iterations: list[int] = []
    try:
        iterations.extend(state.iterations for state in march(problem))
    except NotConvergedError:
        iterations.append(-1)
    return iterations


def cases(family: str) -> Iterator[Case]:
    """960 steps in the plane, 480 in space."""
    plane, space = ("TRIA3", "QUAD4", "TRIA6", "QUAD8"), ("TETRA4", "HEXA8")
    solve = partial(solve_bank, FrictionBank(plane, 2))
    yield Case(family, "bank-plane", "random steps of blocks", solve, {"quick": 1, "full": 6}, 150.0)
    yield Case(
        family, "bank-space", "random steps of blocks", partial(solve_bank, FrictionBank(space, 3)), {"full": 6}, 300.0
    )
    for cell, dim in (("QUAD4", 2), ("HEXA8", 3)):
        description = "lengths times 1e3, stresses times 1e-6"
        yield Case(
            family, f"units-{cell}", description, partial(solve_units, FrictionBank((cell,), dim)), {"full": 2}, 20.0
        )
