"""**Robustness bank.** A block on a block of another stiffness, its top moved at random in four steps: pressed,
sheared, rocked and twisted by as much as or four times as much as it is pressed, so that macro-elements open, close,
stick, slide and turn round in one step; mu from 0.1 to 1.5. Every step must be solved at once, without a cutback. In
the plane the tractions are those of Lemke's method and of a fixed point on Tresca's bounds; in space they meet all
conditions on matrices that are condensed by other means. Other units of length and stress give the same iterations.

**Lids.** A lid, tied to a column, is pressed and pushed on two blocks: rows of the two zones depend on each other
through the column, and sets of rows return under pivoting in several of a hundred such lids. All random lids must be
solved at once, without a cutback, with small strains on either geometry and with finite ones; two known ones with the
forces of projected Gauss-Seidel on the same matrices.

**Seats.** A cylinder settles under its weight in a groove of 90 degrees, and a ball in a cone: it slides down the
flank, which carries it with N and mu N. So the force across is (1 - mu) / (1 + mu) times the weight. Sets of rows of
such a seat return under pivoting; all must be solved without a cutback.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacsolver import NotConvergedError
from lacsolver.contact import integrate
from lacsolver.equilibrium.state import State
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from verification.exact.coulomb import Condensed, condensed, lemke, tresca
from verification.meshes.blocks import bent, joined
from verification.meshes.friction import seated
from verification.meshes.half_spaces import piece
from verification.meshes.stacks import stack
from verification.records import Case, Result, at_most, equal, problem, row
from verification.solving import balanced, case_text, contact, entry, fixed, material, model_of, solve, with_motions

Floats = NDArray[np.floating]

FRICTION, SEVERITY, STEPS = (0.1, 0.3, 0.6, 1.0, 1.5), (1.0, 4.0), 4
#: how far the top comes down; lengths are in sides of the blocks
PRESS = 0.02
#: iterations of a step, mean; of the tractions, relative to the largest pressure
ITERATIONS, SAME = {2: 5.0, 3: 8.0}, 1e-8
_SOURCE = {2: "measured on a prototype: 4.2, at most 57", 3: "measured on a prototype: 7.1, at most 15"}


def mesh_of(cell: str, dim: int, unit: float = 1.0) -> Mesh:
    """The blocks of cells of a type, the lower one with the slave."""
    counts = (8, 7) if dim == 2 else (4, 3)
    return bent(stack(cell, cell, dim, counts=counts, bend=0.3, skew=0.1 * (dim - 2)), lambda x: unit * x)


def case_of(
    dim: int, friction: float, severity: float, seed: int, unit: float = 1.0, stress: float = 1.0
) -> lacsolver.Case:
    """The case: STEPS steps, the top moved in each by a random rigid motion."""
    text = case_text(
        model_of(dim), material(stress, 0.3, groups=["lower"]), material(3 * stress, 0.2, groups=["upper"]),
        contact(friction=friction), fixed("bottom", "xyz"[:dim]),
        entry("steps", times=[float(k + 1) for k in range(STEPS)], max_halvings=0), entry("solver", max_iterations=100),
    )  # fmt: skip
    shift, turn = motions(dim, friction, severity, seed)

    def moved(x: Floats, t: float) -> Floats:
        step, centre = min(round(t), STEPS) - 1, unit * np.array([0.5, *([0.5] * (dim - 2)), 2.0])
        return np.asarray(unit * shift[step] + (x[:, :dim] - centre) @ turn[step].T)

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


class Condenser:
    """The problem of a case on its matrices: dense, the supports taken out; the anchors of slip as steps go on."""

    def __init__(self, problem: Problem, friction: float) -> None:
        (joint,) = problem.joints
        face = integrate(joint.zone, problem.space.dim, replace(joint.pairing, friction=True))
        assert face.B_T is not None
        self.K = problem.kinematics.tangent(np.zeros(problem.space.n_dof), 1.0).toarray()
        self.B, self.B_T, self.G = face.B.toarray(), face.B_T.toarray(), face.G
        self.constraints, self.friction, self.anchor = problem.constraints, friction, np.zeros(len(self.B_T))

    def at(self, t: float) -> Condensed:
        """The condensed problem of the step that ends at t."""
        u0, free = self.constraints.u0(t), self.constraints.free
        return condensed(
            self.K[np.ix_(free, free)], -(self.K @ u0)[free], (self.B[:, free], self.B_T[:, free]),
            self.G - self.B @ u0, self.friction, (self.B_T @ u0 - self.anchor).reshape(len(self.G), -1),
        )  # fmt: skip

    def commit(self, state: State) -> None:
        """Slip is counted from the last state in which a macro-element did not stick."""
        moves = np.repeat(state.zones[0].status != 1, len(self.B_T) // len(self.G))
        self.anchor[moves] = (self.B_T @ state.u)[moves]


@dataclass
class BankRun:
    """A problem of the bank: its states, and how far tractions are from others' and from the conditions."""

    states: list[State] = field(default_factory=list)
    lost: int = 0
    apart: list[float] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    oracle_lost: int = 0


def run(mesh: Mesh, friction: float, severity: float, seed: int) -> BankRun:
    """Solve one problem, and each of its steps by the oracles from the same start."""
    problem = Problem.of(case_of(mesh.space_dim, friction, severity, seed), mesh)
    oracle, out = Condenser(problem, friction), BankRun()
    try:
        for state in march(problem):
            out.states.append(state)
            given, (zone,) = oracle.at(state.time), state.zones
            assert zone.friction is not None
            p, t = zone.pressure, zone.friction.shear
            size = max(float(np.abs(p).max()), float(np.abs(given.G / np.diag(given.A)[: len(p)]).max()))
            out.residual.append(given.residual(p, t))
            for way in (lemke, tresca) if mesh.space_dim == 2 else ():
                try:
                    right, shear = way(given)
                except ArithmeticError:
                    out.oracle_lost += 1
                else:
                    out.apart.append(float(max(np.abs(p - right).max(), np.abs(t - shear).max()) / size))
            oracle.commit(state)
    except NotConvergedError:
        out.lost = STEPS - len(out.states)
    return out


@problem
def solve_bank(cells: tuple[str, ...], dim: int, *, levels: int) -> Iterator[Result]:
    """So many problems on blocks of each of some cells, for every mu and severity."""
    every = product([mesh_of(cell, dim) for cell in cells], FRICTION, SEVERITY, range(levels))
    runs = [run(*each) for each in every]
    lost, each = sum(own.lost for own in runs), [state.iterations for own in runs for state in own.states]
    yield at_most(f"steps that are not solved at once, of {STEPS * len(runs)}", lost, 0, source=_SOURCE[dim])
    yield at_most("iterations of a step, mean", float(np.mean(each)), ITERATIONS[dim], source=_SOURCE[dim])
    off, source = max(r for own in runs for r in own.residual), "matrices condensed by other means"
    yield at_most("largest violation of the conditions, of the largest pressure", off, SAME, source=source)
    if dim == 2:
        apart = max(a for own in runs for a in own.apart)
        yield at_most("largest difference from Lemke's method and Tresca's fixed point", apart, SAME,
                      source="Klarbring 1986; Haslinger 1980", reason="in parts of the largest pressure")  # fmt: skip


@problem
def solve_units(cell: str, dim: int, *, levels: int) -> Iterator[Result]:
    """Numbers of iterations of problems of the bank, in these and in other units of length and of stress."""

    def iterations(friction: float, severity: float, seed: int) -> Iterator[list[int]]:
        for unit, stress in ((1.0, 1.0), (1e3, 1e-6)):
            steps = march(Problem.of(case_of(dim, friction, severity, seed, unit, stress), mesh_of(cell, dim, unit)))
            counts: list[int] = []
            try:
                counts.extend(state.iterations for state in steps)
            except NotConvergedError:
                counts.append(-1)
            yield counts

    every = list(product(FRICTION, SEVERITY, range(levels)))
    changed = sum(own != other for own, other in (iterations(*each) for each in every))
    yield at_most(f"problems with other iterations, of {len(every)}", changed, 0, source="units are arbitrary")


# ---- lids

#: kinematics and geometry of contact
KINDS = {"reference": ("small", "reference"), "current": ("small", "current"), "finite": ("finite", "current")}
#: friction, and the forces along y and x of the blocks on the lid; violations of the conditions are below 4e-16
_KNOWN = ((0.2, 2.7830869501, 0.5231004109), (0.3, 2.7427535141, 0.5553778340))


def lid(n_block: int, n_lid: int) -> Mesh:
    """Two blocks of n_block cells across beside a column, and a lid of n_lid on all three."""
    x, up, lid_y = np.linspace, np.linspace(0, 4, 5), np.linspace(4, 5, 3)
    parts = [
        (piece("QUAD4", [x(-0.5, 0.5, 3), up]), {"": "column", "y0": "foot", "y1": "head"}),
        (piece("QUAD4", [x(-2, 2, n_lid + 1), lid_y]), {"": "lid", "y0": "under", "y1": "top"}),
    ]
    for low in (-2.0, 1.0):
        block = piece("QUAD4", [x(low, low + 1, n_block + 1), up])
        parts.append((block, {"": "blocks", "y0": "base", "y1": "skin"}))
    return joined(parts)


def lid_text(kind: str, friction: float, push: float, poisson: float) -> str:
    """The case of a lid pressed with 4."""
    kinematics, geometry = KINDS[kind]
    law = {"law": "neo_hookean"} if kinematics == "finite" else {}
    return case_text(
        "plane_strain", material(1000.0, poisson, **law),
        contact("skin", "under", name="joint", friction=friction, geometry=geometry),
        entry("tie", name="tie", slave="head", master="under"), fixed("foot", "xy"), fixed("base", "xy"),
        entry("force", group="top", fx=push, fy=-4.0, total=True), entry("steps", count=2, max_halvings=0),
        kinematics=kinematics,
    )  # fmt: skip


@problem
def solve_lids(kind: str, *, levels: int) -> Iterator[Result]:
    """So many random lids: cells, friction, push and Poisson's ratio."""
    random, lost = np.random.default_rng(5), 0
    for _ in range(levels):
        mesh = lid(int(random.integers(2, 7)), int(random.integers(5, 17)))
        friction, push = float(random.choice([0.1, 0.2, 0.3, 0.4])), float(random.uniform(-1.5, 1.5))
        try:
            solve(lid_text(kind, friction, push, float(random.choice([0.0, 0.3]))), mesh)
        except NotConvergedError:
            lost += 1
    yield at_most(f"lids that are not solved at once, of {levels}", lost, 0, source="a solution exists")


@problem
def solve_known_lids(push: float) -> Iterator[Result]:
    """Two lids whose sets return, under a push."""
    for friction, normal, shear in _KNOWN:
        zone = solve(lid_text("reference", friction, push, 0.3), lid(3, 8)).state.zones[0]
        assert zone.friction is not None
        forces = zone.pressure @ zone.area, zone.friction.shear[:, 0] @ zone.area
        for name, value, right in zip(("pressure", "friction"), forces, (normal, shear), strict=True):
            yield equal(f"force of {name}, coefficient {friction}", float(value), right, 1e-8 * right,
                        source="projected Gauss-Seidel on the same matrices",
                        reason="digits of the reference")  # fmt: skip


# ---- seats

_RADIUS, _HOLE = 10.0, 3.0
#: model, weight of half a cylinder or of a ball without a hole, and the power of the hole's radius in its volume
_SEATS = {
    "groove": ("plane_strain", np.pi / 2 * _RADIUS**2, 2),
    "cone": ("axisymmetric", 4 / 3 * np.pi * _RADIUS**3, 3),
}
#: friction, slave, geometry; the first two are those of the quick suite
_ROLES = [(0.2, "round", "reference"), (0.5, "flank", "current")]
_ROLES += [
    one for one in product((0.1, 0.2, 0.3, 0.4, 0.5), ("round", "flank"), ("reference", "current")) if one not in _ROLES
]


@problem
def solve_seats(kind: str, *, levels: int) -> Iterator[Result]:
    """So many seats, each with skins whose faces, in the middle, are parallel where they touch."""
    solutions, (model, weight, power) = [], _SEATS[kind]
    for friction, slave, geometry in _ROLES[:levels]:
        master = {"round": "flank", "flank": "round"}[slave]
        text = case_text(
            model, material(210e3, 0.3), contact(slave, master, friction=friction, geometry=geometry),
            fixed("base", "xy"), fixed("axis", "x"),
            entry("body_force", groups=["ball"], fy=float(-1 / (1 - (_HOLE / _RADIUS) ** power))),
            entry("steps", count=4, max_halvings=0),
        )  # fmt: skip
        one = solve(text, seated("QUAD4", 26, _RADIUS, _HOLE))
        zone, ratio = one.zone, (1 - friction) / (1 + friction)
        across, along = np.abs(zone.area @ (zone.pressure[:, None] * zone.normal + one.shear))
        name, source = f"mu {friction}, {slave} the slave, {geometry}", "balance on flanks of 45 degrees"
        yield equal(f"force across over that along, {name}", float(across / along), ratio, 1e-3 * ratio, source=source,
                    reason="flanks that give way turn a little")  # fmt: skip
        yield equal(f"force across, {name}", float(across), weight * ratio, 0.005 * weight * ratio, source=source,
                    reason="13 chords to a right angle")  # fmt: skip
        solutions.append(one)
    yield from balanced(solutions)


def cases(family: str) -> Iterator[Case]:
    """960 steps of blocks in the plane, 480 in space; 300 lids; a groove and a cone, with every slave and geometry."""
    what, plane, space = "random steps of blocks", ("TRIA3", "QUAD4", "TRIA6", "QUAD8"), ("TETRA4", "HEXA8")
    yield row(family, "bank-plane", what, solve_bank, plane, 2, quick=1, full=6, seconds=150.0)
    yield row(family, "bank-space", what, solve_bank, space, 3, full=6, seconds=300.0)
    for cell, dim in (("QUAD4", 2), ("HEXA8", 3)):
        what = "lengths times 1e3, stresses times 1e-6"
        yield row(family, f"units-{cell}", what, solve_units, cell, dim, full=2, seconds=20.0)
    yield row(family, "lids-known", "forces of two lids", solve_known_lids, 1.0, quick=1, seconds=2.0)
    for kind in KINDS:
        yield row(family, f"lids-{kind}", f"random lids, {kind}", solve_lids, kind, quick=4, full=100, seconds=150.0)
    for kind, what in (("groove", "a cylinder in a groove"), ("cone", "a ball in a cone")):
        yield row(family, f"seat-{kind}", what, solve_seats, kind, quick=2, full=len(_ROLES), seconds=10.0)
