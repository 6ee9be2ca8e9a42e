"""The family friction: loads and constants of its problems, and its bank against Lemke's and Tresca's solutions."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.samples import each_option
from verification.exact.coulomb import gauss_seidel, lemke, tresca
from verification.families import family
from verification.families import friction_bank as bank
from verification.families import friction_bodies as bodies
from verification.families import friction_cattaneo as cattaneo
from verification.families import friction_inf_sup as inf_sup
from verification.families.inf_sup import Skin

CASES = {case.name: case for case in family("friction").cases}


def missed(outcome):
    """Names of the results that fall short."""
    assert not outcome.failure
    return [result.quantity for result in outcome.results if not result.passed]


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


def test_the_first_step_over_a_node_takes_more_iterations_where_the_lower_body_is_the_slave():
    outcome = CASES["dragged-QUAD8-lower"].solve(levels=1)
    assert set(missed(outcome)) <= {"iterations of a step of sliding, mean"}


def test_a_fit_with_less_friction_slides():
    case = CASES["pull-out-below"]
    *given, _, fit = case.solve.args
    exact = replace(fit, friction=0.9 * fit.friction)
    assert missed(bodies.solve_fit(*given, 1.0 / 0.9, exact, levels=1)) == []
    assert missed(bodies.solve_fit(*given, 1.0, fit, levels=1)) in (
        [],
        ["macro-elements that slide"],
    )


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")  # its faces share the nodes of the tips
def test_slip_of_a_crack_is_counted_where_its_tips_open():
    """The last macro-element of linear triangles opens; its faces pass one another all the same."""
    one = bodies._crack(*CASES["crack-TRIA3"].solve.args, 8).solved
    open_ = one.zone.status == 0
    assert open_.any() and not one.slip[open_].any() and one.passed[open_, 0].all()
    assert one.passed[~open_] == pytest.approx(one.slip[~open_], rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(("kind", "dim"), [("QUAD4", 2), ("TETRA4", 3)])
def test_the_constant_of_tractions_is_that_of_pressures(kind, dim):
    constants, _ = inf_sup.constants(Skin(kind, dim), 0.0, 4)
    assert constants["p"] > 0.1
    assert constants["t"] == pytest.approx(constants["p"], rel=1e-10)
    assert constants["both"] == pytest.approx(constants["p"], rel=1e-10)


def test_constants_of_curved_skins_tend_to_one_another():
    skin = Skin("QUAD4", 2, master="QUAD4")
    apart = [max(abs(own[name] / own["p"] - 1) for name in ("t", "both")) for own in
             (inf_sup.constants(skin, inf_sup.CURVED, n)[0] for n in (4, 16))]  # fmt: skip
    assert 1e-4 < apart[0] < 0.03 and apart[1] < apart[0] / 4


# ---- the robustness bank, against Lemke's method and Tresca's fixed point


@pytest.mark.parametrize(("friction", "cell"), each_option(product((0.1, 0.6, 1.5), ("TRIA3", "QUAD8"))))
def test_violent_steps_are_solved_as_by_lemke_and_tresca(cell, friction):
    own = bank.FrictionBank((cell,), 2)
    mesh = bank.mesh_of(own, own.cells[0])
    for severity in bank.SEVERITY:
        run = bank.run(own, mesh, friction, severity, seed=100)
        assert run.lost == run.oracle_lost == 0
        assert len(run.apart) == 2 * bank.STEPS and max(run.apart) < bank.SAME
        assert max(run.residual) < bank.SAME


def test_a_violent_step_in_space_is_solved_as_by_projections():
    own = bank.FrictionBank(("HEXA8",), 3)
    problem = Problem.of(bank.case_of(own, 0.3, 1.0, seed=100), bank.mesh_of(own, own.cells[0]))
    oracle, (state, *_) = bank.Condenser(problem, 0.3), march(problem)
    (zone,) = state.zones
    p, t = gauss_seidel(oracle.at(state.time), tolerance=1e-9)
    np.testing.assert_allclose(zone.pressure, p, atol=1e-7 * p.max())
    np.testing.assert_allclose(zone.friction.shear, t, atol=1e-7 * p.max())


def test_oracles_start_where_the_solver_does():
    """Slip from an anchor: without it, the later steps would be other problems."""
    own = bank.FrictionBank(("QUAD4",), 2)
    problem = Problem.of(bank.case_of(own, 1.5, 1.0, seed=3), bank.mesh_of(own, own.cells[0]))
    oracle, apart, other = bank.Condenser(problem, 1.5), [], []
    for state in march(problem):
        (zone,) = state.zones
        apart += [np.abs(way(oracle.at(state.time))[1] - zone.friction.shear).max() for way in (lemke, tresca)]
        oracle.commit(state)
        anchor, oracle.anchor = oracle.anchor, np.zeros_like(oracle.anchor)
        other.append(np.abs(lemke(oracle.at(state.time))[1] - zone.friction.shear).max())
        oracle.anchor = anchor
    assert max(apart) < 1e-8 < 1e-4 < max(other)


def test_more_friction_than_lemke_is_told_is_seen():
    own = bank.FrictionBank(("QUAD4",), 2)
    problem = Problem.of(bank.case_of(own, 0.3, 4.0, seed=0), bank.mesh_of(own, own.cells[0]))
    oracle, worst = bank.Condenser(problem, 0.33), 0.0
    for state in march(problem):
        (zone,) = state.zones
        worst = max(worst, oracle.at(state.time).residual(zone.pressure, zone.friction.shear))
        oracle.commit(state)
    assert worst > 1e-3
