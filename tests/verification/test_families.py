"""The cheapest cases of every family meet their figures; those of a broken solver, or of another problem, do not."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pytest

import lacsolver
from lacmesh.cells import CELLS
from lacsolver import NotConvergedError
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.samples import each_option
from tests.verification import mutations
from tests.verification.projections import gauss_seidel
from tests.verification.test_exact import hooke
from verification.exact.coulomb import lemke, tresca
from verification.families import cases as cases_of
from verification.families import (
    curved,
    distributed,
    family,
    friction_blocks,
    levels_in,
    manufactured,
    patch,
    peeling,
    press_fit,
    punches,
)
from verification.families import friction_bank as bank
from verification.families import friction_bodies as bodies
from verification.families import friction_cattaneo as cattaneo
from verification.families.impact_runs import Bar, on_wall
from verification.families.inf_sup import WHOLE, ZERO, Skin
from verification.families.manufactured import LAW, ROWS, WANTED, case_of, solution
from verification.meshes import stacks
from verification.meshes.plates import plates
from verification.solving import BALANCED, case_text, entry, solve


class Run(NamedTuple):
    """A case of a family on so many levels; `changes`: of its first argument."""

    family: str
    case: str
    levels: int = 1
    changes: dict[str, Any] = {}
    marks: tuple[Any, ...] = ()

    @property
    def id(self):
        return f"{self.family}-{self.case}"

    def outcome(self):
        one = case(self.case, self.family)
        first, *others = one.solve.args or (None,)
        solve = partial(one.solve.func, replace(first, **self.changes), *others) if self.changes else one.solve
        return solve(levels=min(self.levels, max(one.levels.values())))


def case(name, of):
    (found,) = (case for case in family(of).cases if case.name == name)
    return found


def missed(outcome):
    """Quantities that are missed, by name."""
    assert not outcome.failure
    return {result.quantity for result in outcome.results if not result.passed}


def pairs(of, name, first=0):
    """A run of one of the pairs of bodies that a case has."""
    given = case(name, of).solve.args[0]
    return Run(of, name, 1, {"pairs": given.pairs[first : first + 1]})


SLOW = (pytest.mark.slow,)
QUIET = (pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning"),)
REFERENCE = (pytest.mark.shared, *QUIET)
THREE = {"steps": 3, "way": 0.8}
PLANE, SOLID = pairs("patch", "2d-QUAD8"), pairs("patch", "3d-TETRA10", 1)
SKIN, PRESSED = Run("inf-sup", "TETRA4", 3), Run("inf-sup", "pressed-TRIA3", 2)
WAVES, WARPED = pairs("balance", "waves-facet-2d"), pairs("balance", "warped-hexa-3d")
OVER_WAVES, HERTZ = Run("sliding", "waves_QUAD4_facet"), Run("hertz", "2d-QUAD8-rigid", 3)
CURVED = Run("curved", "cylinders-QUAD4-within", 2)
BLOCK = Run("sliding", "block_QUAD4_facet", 1, THREE)
RUNS = (
    PLANE, SOLID, PRESSED, WAVES, WARPED,
    *(run._replace(marks=SLOW) for run in (SKIN, OVER_WAVES, HERTZ, CURVED, BLOCK)),
    *(pairs("balance", name)._replace(marks=QUIET)
      for name in ("waves-smoothed-2d", "overhang-3d", "rigid-small-2d", "tie-gap-3d", "tower-small-3d")),
    *(Run("cut", name) for name in ("mixed-2d", "counts", "HEXA8-stars")),
    *(Run("cut", name, marks=SLOW) for name in ("TRIA", "QUAD", "TETRA", "TETRA4-stars")),
    *(Run("inf-sup", name, 3) for name in ("QUAD4", "QUAD9", "TRIA3-on-QUAD4")),
    Run("inf-sup", "HEXA8", 2),
    Run("inf-sup", "HEXA8", 3, marks=SLOW),
    *(Run("inf-sup", f"{kind}-stars", 3) for kind in ("QUAD4", "HEXA8")),
    pairs("patch", "stars-tie-3d", 1)._replace(marks=QUIET),
    *(Run("joints", name, 3, marks=SLOW) for name in ("yielding_sphere_quad4", "cyclic_plate")),
    Run("joints", "first_yield_axisymmetric", 3),
    Run("manufactured", "QUAD4", 3),
    Run("press-fit", "spheres-QUAD8-smoothed", 3),
    *(Run("press-fit", f"ssnp173a-{name}") for name in ("TRIA6-facet", "TRIA6-smoothed", "QUAD8-smoothed")),
    *(Run("press-fit", one.name, levels_in(one, "quick"), marks=SLOW)
      for one in press_fit.FAMILY.cases if {"quick", "full"} <= set(one.levels)),
    Run("sliding", "waves_QUAD4_smoothed", 1, THREE),
    *(Run("sliding", name, 1, THREE, SLOW)
      for name in ("block_QUAD4_stars", "block_QUAD8_smoothed", "block_HEXA8_smoothed", "waves_HEXA8_facet")),
    *(Run("friction", name)
      for name in ("incline-below-TRIA3", "incline-above-TRIA3", "belt-180", "pull-out-below", "torque-above")),
    Run("friction", "dragged-QUAD4-upper", marks=SLOW),
    Run("friction", "crack-QUAD8", marks=QUIET),
    *(Run("friction", name, marks=REFERENCE) for name in ("ssnv128", "ssnp156a")),
    *(Run("friction", name, marks=SLOW)
      for name in ("carried-24", "cycled-2d", "rolls-QUAD4", "thrown", "rod-slides", "rod-jams", "units-QUAD4")),
    Run("impact", "plain-mass"),
    Run("impact", "frequencies-QUAD8", 3, marks=SLOW),
)  # fmt: skip


@pytest.mark.parametrize("run", [pytest.param(run, marks=run.marks, id=f"{run.id}-{run.levels}") for run in RUNS])
def test_a_case_meets_its_figures(run):
    outcome = run.outcome()
    assert missed(outcome) == set() and outcome.results


JOINTS = {case.name: case for case in cases_of("quick", ("joints",))}


def kind(row):
    """The function that solves a joint's case, with whether it is of finite kinematics or of two halves."""
    (name,) = row
    return [(JOINTS[name].solve.func.__name__, "finite" in name or "halves" in name)]


@pytest.mark.parametrize("name", each_option([(name,) for name in JOINTS], of=kind))
def test_a_joint_meets_its_figures(name):
    assert missed(JOINTS[name].solve(levels=levels_in(JOINTS[name], "quick"))) == set()


SMALLER = {
    "strips": partial(peeling.solve_strips, 30),
    "lifted": partial(peeling.solve_lifted, 240),
    "leaves": partial(peeling.solve_leaves, 2, False, 40),
    "two leaves, finite": partial(peeling.solve_leaves, 2, True, 100),
    "three leaves, finite": partial(peeling.solve_leaves, 3, True, 160),
    **{f"{name} {number}": partial(punches.solve_case, *case(name, "punches").solve.args[:2], number)
       for name, number in (("plane_block_1", 1), ("plane_block_1", 3), ("space_block", 3))},
    **{f"slides {slides}":
       partial(friction_blocks.solve_sheared, friction_blocks.Sheared((("QUAD4", "TRIA6"),), 2, slides, tilted=True))
       for slides in (False, True)},
}  # fmt: skip


LONGER = ("plane_block_1 3", "space_block 3", "two leaves, finite", "three leaves, finite")


@pytest.mark.parametrize("name", [pytest.param(name, marks=SLOW * (name in LONGER)) for name in SMALLER])
def test_a_smaller_problem_meets_its_figures(name):
    assert missed(SMALLER[name](levels=1)) == set()


@pytest.mark.rows("4-3", "15-1")
@pytest.mark.filterwarnings("ignore::lacmesh.errors.LacmeshWarning")  # of stiff plates with fine faces
@pytest.mark.parametrize("first, count", [(0, 3), (4, 3), (15, 1)])  # 15: tensions within the tolerance carry 1 %
def test_random_stacks_have_an_equilibrium(first, count):
    lost, halved, *_ = peeling.solve_bank(first, levels=count).results
    assert lost.passed and halved.passed


def test_a_plate_that_tips_over_is_not_told_to_take_more_steps():
    """A plate of 10 on a table, whose end is pulled up by more than its weight."""
    text = case_text(
        "plane_strain",
        entry("material", groups=["plate1"], young=1e5, poisson=0.3),
        entry("contact", slave="under1", master="table"),
        entry("rigid", group="table"),
        entry("body_force", groups=["plate1"], fy=-0.01),
        entry("displacement", at=[0.0, 0.0], ux=0.0),
        entry("force", at=[10.0, 0.5], fy=0.04),
        entry("steps", count=1, max_halvings=0),
    )
    with pytest.raises(NotConvergedError) as caught:
        solve(text, plates([(np.array([0.0, 0.0]), np.array([10.0, 0.5]))], [(10, 1)], table=True))
    assert "more steps" not in str(caught.value)


# ---- what is broken on purpose

#: mutant -> case, and what must be among its failures
MUTANTS = [
    (mutations.tilted_normal, PLANE, "stress at integration points"),
    (mutations.tilted_normal, SOLID, "stress at integration points"),
    (mutations.tilted_normal, WAVES, "balance of moments"),
    (mutations.masters_normal, WAVES, "balance of moments"),
    (mutations.masters_normal, WARPED, "balance of moments"),
    (mutations.few_points, PLANE, "contact pressure p_m"),
    (mutations.few_points, SOLID, "contact pressure p_m"),
    (mutations.dropped_macro, PLANE, "contact pressure p_m"),
    (mutations.dropped_macro, SOLID, "contact pressure p_m"),
    (mutations.frozen_set, HERTZ, "p_m, L2"),
    (mutations.not_cut, SKIN, "least beta, cut, rim fixed"),
    (mutations.not_cut, PRESSED, "error of p_m over that of the best, cut"),
    (mutations.stiff_normal, OVER_WAVES, "share of steps whose last 2 iterations are quadratic"),
    (mutations.no_heights, CURVED, "p_m in L2 over that with the true gap, worst mesh"),
    (mutations.no_heights, CURVED, "p_m in L2, second mesh"),
    (mutations.apart, WAVES, "macro-elements in contact"),
    (mutations.unequal_forces, WAVES, "balance of forces"),
    (mutations.unequal_forces, WAVES, "balance of moments"),
    (mutations.other_pressure, BLOCK, "worst of all steps"),
]


@pytest.mark.parametrize(
    ("mutant", "run", "quantity"),
    each_option(MUTANTS, of=lambda row: [row[0].__name__]),
    ids=[f"{m.__name__}-{run.case}-{name[:20]}" for m, run, name in MUTANTS],
)
def test_a_mutant_is_seen(mutant, run, quantity, monkeypatch):
    mutant(monkeypatch)
    assert any(name.startswith(quantity) or quantity in name for name in missed(run.outcome()))


def test_a_frozen_set_does_not_converge(monkeypatch):
    mutations.frozen_set(monkeypatch, blind=False)
    with pytest.raises(NotConvergedError):
        HERTZ.outcome()


def test_another_problem_is_found_out():
    """Less friction than sticks; a closer bound; mass on the skin."""
    given = friction_blocks.Sheared((("QUAD4", "QUAD4"),), 2, False, keys=(("friction", 0.19),))
    assert patch.STRESS in missed(friction_blocks.solve_sheared(given, levels=1))
    name = "ssnp173a-TRIA6-facet"
    closer = replace(case(name, "press-fit").solve.args[0], allowed=1e-5)
    results = press_fit.solve_case(closer, levels=1).results
    assert not all(result.passed for result in results[:2])
    assert [result.published[0].value for result in results[:2]] == [4.89487252903, 4.89334316287]
    wall = Bar(cfl=0.25, scheme="newmark")
    plain, error = on_wall(replace(wall, massless="none"), 8)
    assert error > 0.02 and plain.whole.max() > 1.001 and on_wall(wall, 8)[1] < error / 5


# ---- what the cases are


def test_every_type_is_the_slave_and_the_master_of_every_other():
    for dim, kinds in ((2, stacks.PLANE_KINDS), (3, stacks.SOLID_KINDS)):
        assert {kind.split()[0] for kind in kinds} - {"mixed"} == {n for n, cell in CELLS.items() if cell.dim == dim}
        for tilted in (False, True):
            own = [c for c in patch.FAMILY.cases if c.name.startswith(f"{dim}d") and c.parameters["tilted"] == tilted]
            assert {pair for one in own for pair in one.solve.args[0].pairs} == set(product(kinds, kinds))
    named = {kind for pairs in (distributed.PLANE, distributed.SOLID) for pair in pairs for kind in pair}
    types = {kind.split()[0] for kind in (*stacks.PLANE_KINDS, *stacks.SOLID_KINDS)}
    assert {kind.split()[0] for kind in named} >= types
    kinds = {one.parameters["kind"] for one in family("inf-sup").cases}
    assert set(stacks.PLANE_KINDS) | set(stacks.SOLID_KINDS) == kinds and not set(WHOLE) & set(ZERO)


@pytest.mark.shared
def test_manufactured_rows_are_those_of_the_reference(shared):
    listed = json.loads((shared / "reference" / "cases.json").read_text())["cases"]
    asked = {case["id"]: case for case in listed if case["kind"] == "manufactured_rates"}
    rows = {row.test: row for row in ROWS.values() if row.test}
    assert set(asked) == set(rows)
    for name, given in asked.items():
        row, theirs = rows[name], given["code_aster"]
        assert (row.cell, row.levels, row.solution.model) == (given["cell"], given["levels"], given["model"])
        rates = tuple(theirs[f"rate_L2_{what}"] for what in ("displacement", "pressure"))
        assert (row.displacement_rate, row.pressure_rate) == rates and given["hexa"] == row.hexa
        assert given["material"] == {"young": LAW.young, "poisson": LAW.poisson}
        points = dict(zip("xyz", np.random.default_rng(0).random((3, 9)), strict=True))
        for own, other in zip(row.solution.displacement, given["displacement"], strict=True):
            np.testing.assert_allclose(eval(own, {}, points), eval(other, {}, points), rtol=1e-14)


@pytest.mark.slow
def test_a_manufactured_row_has_the_rates_asked_for(monkeypatch):
    quad4 = case("QUAD4", "manufactured")
    held = [result for result in quad4.solve(levels=3).results if result.bound == "at least"]
    assert tuple(result.expected for result in held) == WANTED[1] and [len(result.levels) for result in held] == [3] * 3
    assert held[0].published[0].value == ROWS["QUAD4"].displacement_rate
    residuals = solution(ROWS["QUAD8"], 0).solved.state.residuals
    assert residuals[-1] < 1e-10 < residuals[0]
    slow = iter([0.1, 0.04, 0.02])  # errors of u that fall by a half and a little

    def solved(row, level):
        one = solution(row, 0)
        return replace(one, h=0.5**level, errors={**one.errors, "displacement": next(slow)})

    monkeypatch.setattr(manufactured, "solution", solved)
    first, *_ = quad4.solve(levels=3).results
    assert not first.passed and first.value == pytest.approx(np.log2(5) / 2)


def test_a_manufactured_row_of_hexahedra_is_that_of_the_reference():
    solid = lacsolver.parse_case(case_of(ROWS["HEXA8-hexa"]))
    own = {"measure": "reference", "geometry": "current", "hexa": "hexa"}
    assert solid.kinematics == "finite" and vars(solid.contact[0]).items() >= own.items()
    assert {load.group for load in solid.traction} == {"z0", "x0", "x1", "y0", "y1"}


# ---- patch tests


def options_of(row):
    """Model, frame, contact and distortion of a case that `row` names."""
    given = case(row[0], "patch").solve.args[0]
    return given.model, ("tilted", given.tilted), given.contact, ("skew", given.skew)


SMOOTHED = [
    patch.Press((("HEXA8", "HEXA8"),), contact=(("hexa", way), ("geometry", own), ("normals", "smoothed")), skew=0.2)
    for way in ("pyramid", "hexa")
    for own in ("reference", "current")
]


@pytest.mark.parametrize(
    "given",
    [
        *each_option([(one.name,) for one in patch.FAMILY.cases], of=options_of),
        *SMOOTHED,
        patch.Press((("QUAD4", "TRIA6"),), "plane_strain", True),
        patch.Press((("HEXA8", "HEXA8"),), "3d", contact=(("hexa", "hexa"),), bend=0.0),
    ],
    ids=str,
)
def test_a_stack_is_exact(given):
    at = 1
    if isinstance(given, str):
        given, at = case(given, "patch").solve.args[0], len(given)
    one = patch.errors(given, *given.pairs[at % len(given.pairs)], at % 2 == 0)
    assert max(one.errors.values()) <= patch.EXACT and max(one.solved.balance) <= BALANCED, one


@pytest.mark.parametrize(
    "model, tilted",
    [*product(("3d", "plane_strain", "plane_stress"), (False, True)), ("axisymmetric", False), ("ring", False)],
)
def test_the_exact_stress_of_a_patch_obeys_hooke_and_bears_the_pressure(model, tilted):
    given = patch.Press((), model, tilted)
    dim = given.dim
    strain, stress = np.zeros((3, 3)), np.zeros((3, 3))
    strain[:dim, :dim] = patch.exact_displacement(given, np.eye(3)[:dim]).T
    np.testing.assert_allclose(strain, strain.T, atol=1e-18)
    for value, (a, b) in zip(patch.exact_stress(given), patch._AXES, strict=True):
        stress[a, b] = stress[b, a] = value
    if model in ("axisymmetric", "ring"):
        strain[2, 2] = strain[0, 0]
    if model == "plane_stress":
        strain[2, 2] = -patch.POISSON / (1 - patch.POISSON) * (strain[0, 0] + strain[1, 1])
    np.testing.assert_allclose(hooke(strain[None], patch.YOUNG, patch.POISSON)[0], stress, atol=1e-14)
    normal = given.turn[:, dim - 1]
    np.testing.assert_allclose(stress @ normal, -patch.PRESSURE * normal, atol=1e-15)


def test_errors_of_a_patch_are_seen_and_the_worst_stack_is_named(monkeypatch):
    given = patch.Press((("QUAD4", "TRIA3"),), "plane_strain")
    made = patch.errors(given, "QUAD4", "TRIA3", True)
    monkeypatch.setattr(patch, "POISSON", 0.31)
    (zone,) = made.solved.state.zones
    zone.pressure[0] *= 1 + 1e-6
    monkeypatch.setattr(patch, "solve", lambda *_: made.solved)
    wrong = patch.errors(given, "QUAD4", "TRIA3", True)
    assert min(wrong.errors[patch.STRESS], wrong.errors[patch.DISPLACEMENT]) > 1e-3
    assert wrong.errors[patch.PRESSURES] == pytest.approx(1e-6, rel=1e-6)
    for quantity in made.errors:
        lost = made._replace(label="lost", errors={**made.errors, quantity: np.nan})
        result = patch.worst(quantity, [wrong, lost, made])
        assert not result.passed and result.reason.endswith("lost")


# ---- curved skins and press fits


@pytest.mark.rows("octants-HEXA8-around")
@pytest.mark.parametrize("name", ["cylinders-TRIA3-within", "spheres-QUAD4-around", "octants-HEXA8-around"])
def test_smooth_surfaces_are_as_good_as_the_true_gap_and_faces_are_not(name):
    given = case(name, "curved").solve.args[0].problem
    faces, smooth, true = (curved.solution(given, 1, gap) for gap in curved.GAPS)
    assert smooth.errors["p_m"] < 1.05 * true.errors["p_m"] and faces.errors["p_m"] > 20 * smooth.errors["p_m"]
    assert (smooth.solved.zone.pressure > 0).all()


@pytest.mark.rows("hertz-2d-QUAD4")
@pytest.mark.parametrize("name", ["hertz-2d-QUAD4", "socket-3d-TETRA4"])
def test_hertz_on_curved_skins_is_hertz_on_flat_ones_with_a_clearance(name):
    smooth, true = (curved.solution(case(name, "curved").solve.args[0].problem, 0, gap) for gap in ("smooth", "true"))
    assert smooth.errors["p_m"] == pytest.approx(true.errors["p_m"], rel=1e-3)


def test_the_pin_has_its_force_and_its_angle():
    smooth = curved.solution(case("pin-QUAD4-within", "curved").solve.args[0].problem, 1, "smooth")
    assert abs(smooth.errors["force"]) < 0.006 and abs(smooth.errors["angle of contact"]) < 0.02
    assert smooth.errors["p_m"] < 0.035


def test_an_interference_alone_presses_and_an_octant_is_solved_in_space():
    given = case("cylinders-strain-QUAD8", "press-fit").solve.args[0]
    parsed = lacsolver.parse_case(press_fit.case_of(given))
    assert not parsed.pressure and parsed.contact[0].clearance([[30.0, 0.0]], t=1.0) == [-0.1]
    pressure = press_fit.solution(given, 0).solved.zone.pressure
    assert np.abs(pressure / given.exact.between - 1).max() < 2e-3
    found = press_fit.solution(case("octant-HEXA20", "press-fit").solve.args[0], 0)
    assert found.solved.problem.space.dim == 3 and max(found.errors["mean"], found.errors["displacement"]) < 0.02
    mesh = press_fit.mesh_of(case("ssnp173a-TRIA6-facet", "press-fit").solve.args[0], 0)
    assert [len(mesh.cell_groups[name]) for name in ("slave", "master", "inner")] == [23, 46, 46]
    assert mesh.cells_by_type["TRIA6"] == 874


# ---- friction: loads and constants of its problems


def test_cylinders_meet_their_figures_on_a_coarse_mesh():
    """With 8 macro-elements to the half-width the edge of stick is known to a macro-element alone."""
    one = cattaneo.solve_level(cattaneo.PressedCylinders("QUAD4"), 0)
    assert one.errors["t_m"] < 1.5 * one.errors["best"]
    assert one.errors["c"] < 0.06 and one.errors["work"] < 0.02
    for turns in ((0.6, -0.6), (0.6, -0.6, 0.6)):
        given = cattaneo.PressedCylinders("QUAD4", turns)
        errors = cattaneo.shear_errors(cattaneo.solved(given, 8), given.loads(given.times[-1]))
        assert errors.exact < 1.5 * errors.best


def test_loads_and_times_of_cylinders():
    given = cattaneo.PressedCylinders("QUAD4", (0.6, -0.6), steps=4)
    assert given.times == (1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0)
    for t, turns in ((1.0, ()), (1.5, (0.3,)), (2.0, (0.6,)), (2.5, (0.6, 0.0)), (3.0, (0.6, -0.6))):
        loads = given.loads(t), given.exact.sheared(*turns)
        x = np.linspace(-1, 1, 11)
        shears = [cattaneo.cattaneo.shear(x, each) for each in loads]
        np.testing.assert_allclose(*shears, atol=1e-15)


@pytest.mark.slow
def test_the_first_step_over_a_node_takes_more_iterations_where_the_lower_body_is_the_slave():
    outcome = case("dragged-QUAD8-lower", "friction").solve(levels=1)
    assert missed(outcome) <= {"iterations of a step of sliding, mean"}


def test_a_fit_with_less_friction_slides():
    exact = replace(bodies.FIT, friction=0.9 * bodies.FIT.friction)
    assert missed(bodies.solve_fit("pulled", 1.0 / 0.9, exact, levels=1)) == set()
    assert missed(bodies.solve_fit("pulled", 1.0, bodies.FIT, levels=1)) <= {"macro-elements that slide"}


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")  # its faces share the nodes of the tips
def test_slip_of_a_crack_is_counted_where_its_tips_open():
    """The last macro-element of linear triangles opens; its faces pass one another all the same."""
    one = bodies.crack_solution(*case("crack-TRIA3", "friction").solve.args, 8).solved
    open_ = one.zone.status == 0
    assert open_.any() and not one.slip[open_].any() and one.passed[open_, 0].all()
    assert one.passed[~open_] == pytest.approx(one.slip[~open_], rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(("kind", "dim"), [("QUAD4", 2), ("TETRA4", 3)])
def test_the_constant_of_tractions_is_that_of_pressures(kind, dim):
    constants, _ = friction_blocks.constants(Skin(kind, dim), 0.0, 4)
    assert constants["p"] > 0.1
    assert [constants["t"], constants["both"]] == pytest.approx([constants["p"]] * 2, rel=1e-10)


def test_constants_of_curved_skins_tend_to_one_another():
    found = [friction_blocks.constants(Skin("QUAD4", 2, master="QUAD4"), friction_blocks.CURVED, n)[0] for n in (4, 16)]
    coarse, fine = (max(abs(own[name] / own["p"] - 1) for name in ("t", "both")) for own in found)
    assert 1e-4 < coarse < 0.03 and fine < coarse / 4


# ---- the robustness bank, against Lemke's method and Tresca's fixed point


def bank_problem(cell, dim, friction, severity, seed, told=None):
    """A problem of the bank, and what condenses it for another solver; `told`: another friction for that one."""
    problem = Problem.of(bank.case_of(dim, friction, severity, seed=seed), bank.mesh_of(cell, dim))
    return problem, bank.Condenser(problem, told or friction)


@pytest.mark.rows("1.5-TRIA3")
@pytest.mark.parametrize(("friction", "cell"), each_option(product((0.1, 0.6, 1.5), ("TRIA3", "QUAD8"))))
def test_violent_steps_are_solved_as_by_lemke_and_tresca(cell, friction):
    mesh = bank.mesh_of(cell, 2)
    for severity in bank.SEVERITY:
        run = bank.run(mesh, friction, severity, seed=100)
        assert run.lost == run.oracle_lost == 0
        assert len(run.apart) == 2 * bank.STEPS and max(run.apart) < bank.SAME
        assert max(run.residual) < bank.SAME


def test_a_violent_step_in_space_is_solved_as_by_projections():
    problem, oracle = bank_problem("HEXA8", 3, 0.3, 1.0, seed=100)
    state = next(iter(march(problem)))
    (zone,) = state.zones
    p, t = gauss_seidel(oracle.at(state.time), tolerance=1e-9)
    np.testing.assert_allclose(zone.pressure, p, atol=1e-7 * p.max())
    np.testing.assert_allclose(zone.friction.shear, t, atol=1e-7 * p.max())


def test_oracles_start_where_the_solver_does():
    """Slip from an anchor: without it, the later steps would be other problems."""
    problem, oracle = bank_problem("QUAD4", 2, 1.5, 1.0, seed=3)
    apart, other = [], []
    for state in march(problem):
        (zone,) = state.zones
        apart += [np.abs(way(oracle.at(state.time))[1] - zone.friction.shear).max() for way in (lemke, tresca)]
        oracle.commit(state)
        anchor, oracle.anchor = oracle.anchor, np.zeros_like(oracle.anchor)
        other.append(np.abs(lemke(oracle.at(state.time))[1] - zone.friction.shear).max())
        oracle.anchor = anchor
    assert max(apart) < 1e-8 < 1e-4 < max(other)
