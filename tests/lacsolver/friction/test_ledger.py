"""The ledger of work: against works that are summed from reactions, gaps and slips of the states, and in motion."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import Mesh
from lacsolver.case import Case, Contact, Coupling, Displacement, Dynamics, Gravity, Initial, Material, Spring, Steps
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import Problem
from lacsolver.results.motion import ENERGIES
from tests.lacsolver.friction.test_output import rubbed
from tests.lacsolver.friction.test_sliding import block_on_block

# few steps leave over much of the energy that friction takes, as they should say
pytestmark = pytest.mark.filterwarnings("ignore:steps are too long for the energy")


def states_of(case, mesh):
    """Return the problem, its states, and the sum over steps of mean forces times displacements of what is given."""
    problem = Problem.of(case, mesh)
    states = list(march(problem))

    def work(force):
        u = [np.zeros_like(states[0].u), *(state.u for state in states)]
        f = [np.zeros_like(u[0]), *map(force, states)]
        return sum(0.5 * (a + b) @ (y - x) for a, b, x, y in zip(f, f[1:], u, u[1:], strict=False))

    return problem, states, work


@pytest.mark.parametrize(
    ("model", "geometry"), [("plane_strain", "small"), ("plane_strain", "current"), ("3d", "small")]
)
def test_the_parts_are_those_of_the_states(model, geometry):
    case, mesh = rubbed(model, geometry)
    problem, states, work = states_of(case, mesh)
    own = states[-1].step.work
    assert own.external == pytest.approx(work(lambda state: state.reaction), rel=1e-9)
    K = problem.kinematics.tangent(np.zeros_like(states[-1].u), 1.0)
    assert own.strain == pytest.approx(0.5 * states[-1].u @ (K @ states[-1].u), rel=1e-9)
    assert own.dissipation == pytest.approx(states[-1].zones[0].friction.energy[1], rel=1e-8) and own.dissipation > 0
    rubbing = work(lambda state: -state.zones[0].force.ravel()) - own.pressures  # of friction, by mean forces
    assert own.left == pytest.approx(rubbing - own.dissipation, rel=1e-6)
    assert own.external == pytest.approx(own.strain + own.dissipation + own.pressures + own.left, rel=1e-12)


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_springs_between_the_bodies_store_their_part(kinematics):
    """Springs between a node of each body, along a line and by axes: supports do as much more work as these store."""
    case, mesh = rubbed("plane_strain", "current")
    low, high = (np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cells_of(g))]))[-1:]
                 for g in ("bottom", "top"))  # fmt: skip
    mesh = Mesh.create(
        mesh.points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups={"low": low, "high": high}, space_dim=2
    )
    if kinematics == "finite":
        case = replace(case, kinematics="finite", material=[Material(law="neo_hookean", young=1000.0, poisson=0.3)])
    springs = (Spring(group="low", to="high", k=30.0), Spring(group="low", to="high", kx=20.0))
    (_, alone, _), (_, states, work) = (states_of(replace(case, spring=s), mesh) for s in ((), springs))
    own, before = states[-1].step.work, alone[-1].step.work
    d, u = np.subtract(*mesh.points[[high[0], low[0]], :2]), states[-1].u.reshape(-1, 2)
    du = u[high[0]] - u[low[0]]
    longer = np.linalg.norm(d + du) - np.linalg.norm(d) if kinematics == "finite" else du @ d / np.linalg.norm(d)
    stored = 15.0 * longer**2 + 10.0 * du[0] ** 2
    assert own.external == pytest.approx(work(lambda state: state.reaction), rel=1e-9)
    assert own.strain - before.strain == pytest.approx(stored, rel=1e-8) and stored > 1e-3 * before.strain
    assert own.external - before.external == pytest.approx(stored, rel=1e-2)  # of mean forces


def test_what_moves_a_coupling_works_from_outside():
    case, mesh = rubbed("plane_strain", "small")
    bottom, top = case.displacement
    motion = Coupling(group="top", ux=top.ux, uy=top.uy, rotation=0.0)
    _, states, _ = states_of(replace(case, displacement=(bottom,), coupling=(motion,)), mesh)
    own = states[-1].step.work
    assert own.external > own.strain > 0.1 and abs(own.pressures) < 1e-12


def test_what_is_left_falls_with_the_steps():
    case, mesh = rubbed("plane_strain", "small")
    left = [states_of(replace(case, steps=Steps(end=1.0, count=n)), mesh)[1][-1].step.work.left for n in (8, 32)]
    assert 3.5 < left[0] / left[1] < 4.5


def test_gross_sliding_leaves_nothing():
    """A pad that slides at a constant pressure: all work goes into friction, mu N times the way."""
    mesh = block_on_block(((0, 4), (0, 1), 12, 3), ((1.0, 2.0), (1, 1.5), 5, 3))
    case = Case(
        model="plane_strain", material=[Material(young=1000.0, poisson=0.3)],
        contact=[Contact(name="joint", slave="above", master="below", friction=0.3)],
        displacement=[
            Displacement(group="bottom", ux=0, uy=0),
            Displacement(group="top", ux=[[0, 0], [1, 0], [2, 0.1], [3, 0.2]], uy=[[0, 0], [1, -0.01], [3, -0.01]]),
        ],
        steps=Steps(times=[1.0, 2.0, 3.0]),
    )  # fmt: skip
    _, states, _ = states_of(case, mesh)
    (before, after), zone = (state.step.work for state in states[1:]), states[-1].zones[0]
    way, force = 0.1, 0.3 * float(zone.pressure @ zone.area)
    assert after.external - before.external == pytest.approx(force * way, rel=1e-6)
    assert after.dissipation - before.dissipation == pytest.approx(force * way, rel=1e-6)
    assert abs(after.left - before.left) < 1e-9 * force * way
    assert abs(after.pressures) < 1e-9 * force * way


def test_files_have_it_and_a_restart_goes_on_with_it(tmp_path):
    case, mesh = rubbed("plane_strain", "current")
    whole = ls.run(case, tmp_path / "a", mesh=mesh)
    state = read_state(tmp_path / "a", case, 0.5, mesh=mesh)
    assert state.step.work == whole.steps[1].work
    again = ls.run(case, create_output(tmp_path / "b"), mesh=mesh, start=state)
    assert again.steps[-1].work == whole.steps[-1].work
    (*_, last) = json.loads((tmp_path / "a" / "results.json").read_text())["steps"]
    assert last["work"] == whole.steps[-1].work._asdict()
    assert "work.left" in (tmp_path / "a" / "history.csv").read_text().splitlines()[0]
    without = replace(case, contact=(replace(case.contact[0], friction=0.0),), steps=Steps())
    assert ls.run(without, tmp_path / "c", mesh=mesh).steps[-1].work is None


def test_friction_takes_the_energy_of_a_thrown_block():
    mesh = block_on_block(((0, 4), (0, 1), 8, 1), ((0.5, 1.5), (1, 1.5), 3, 2))
    case = Case(
        model="plane_strain", material=[Material(young=2e6, poisson=0.3, density=1000.0)],
        contact=[Contact(name="joint", slave="above", master="below", friction=0.4)],
        displacement=[Displacement(group="lower", ux=0, uy=0)], gravity=Gravity(gy=-10.0),
        initial=[Initial(groups=["upper"], vx=1.0)], dynamics=Dynamics(), steps=Steps(end=0.3, count=60),
    )  # fmt: skip
    *_, state = march(Problem.of(case, mesh))
    energies = dict(zip(ENERGIES, state.step.motion.energies, strict=True))
    assert abs(state.step.motion.account) < 1e-10 * energies["external"]
    assert energies["friction"] == pytest.approx(state.zones[0].friction.energy[1], rel=1e-6)
    assert 0.9 < energies["friction"] / (0.5 * 1000.0 * 0.5) < 1.0  # the block sways for a while
    assert abs(energies["contact"]) < 0.05 * energies["friction"]
    assert state.step.work is None


def test_too_long_steps_are_warned_of_once_at_the_end(tmp_path):
    """A block that is pressed onto another, and moved to and fro: in four steps the ledger leaves over half."""
    case, mesh = rubbed("plane_strain", "small")
    for count, warned in ((4, 1), (128, 0)):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            results = ls.run(replace(case, steps=Steps(count=count)), tmp_path / str(count), mesh=mesh)
        words = [str(one.message) for one in caught if "too long" in str(one.message)]
        work = results.steps[-1].work
        assert len(words) == warned == (abs(work.left) > 0.05 * work.dissipation)
        if words:
            left = f"{work.left:.4g} ({abs(work.left) / work.dissipation:.0%})"
            assert f"leaves over {left}; take more steps" in words[0] and words[0] in results.message
