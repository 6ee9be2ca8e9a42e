"""Metals that yield: the law at a point against differences and exact solutions, bars, cells, output and restarts."""

import importlib.util
import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacsolver.bodies.material import Materials
from lacsolver.bodies.plastic import FinitePlastic, Plastic
from lacsolver.bodies.pointwise import DisplacedBodies, respond_in_plane_stress
from lacsolver.bodies.temperature import warming
from lacsolver.case import Dynamics, Initial, Material, Output, Solver, Steps, Temperature, Traction
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import Problem
from lacsolver.reading import read_results
from lacsolver.results.fields import point_stress, state_fields
from lacsolver.results.figures import step_figures
from lacsolver.running import run
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PAIRS, body, one_cell
from tests.lacsolver.held import with_sides
from tests.lacsolver.test_finite import by_differences, shaken
from tests.problems import case_of, fix, move
from tests.quality_cells import rotation
from tests.samples import each_option

YOUNG, NU, Y0, SLOPE, H = 1000.0, 0.3, 2.0, 100.0, 50.0
TABLE = ((Y0, 0.0), (3.0, 0.01), (3.0, 0.02), (4.0, 0.1))
LAWS = (Plastic, FinitePlastic)


def law_of(make, kinematic=H, **more):
    return make(YOUNG, NU, hardening=TABLE, kinematic=kinematic, **more)


# ---- at a point


def gradients(rng, size, plane_stress, n=4):
    """Random gradients of displacement, and a history that others have left."""
    out = rng.uniform(-size, size, (n, 3, 3))
    if plane_stress:
        out[:, 2, :] = out[:, :, 2] = 0.0
    return out


@pytest.mark.parametrize("plane_stress", [False, True])
@pytest.mark.parametrize("kinematic", [0.0, H])
@pytest.mark.parametrize("make", LAWS)
def test_the_tangent_is_the_derivative_of_the_stress_which_is_that_of_energy_and_dissipation(
    make, kinematic, plane_stress
):
    """After a history, in the elastic and the plastic range; a step minimises energy and dissipation."""
    law, rng = law_of(make, kinematic), np.random.default_rng(3)
    size = 0.2 if law.finite else 0.01
    start = gradients(rng, size, plane_stress)
    ask = partial(respond_in_plane_stress, law) if plane_stress else law.respond
    before = ask(start.copy(), np.zeros((4, law.n_history))).history
    moved = start + np.array([0.0, 0.3, 0.6, 1.0])[:, None, None] * gradients(rng, size, plane_stress)
    moved[0] -= 1e-3 * start[0] / np.abs(start[0]).max()  # unloads

    def respond(H):
        return ask(H.copy(), before)

    answer = respond(moved)
    flown = answer.history[:, 0] > before[:, 0]
    assert flown.any() and not flown[0]
    axes, h = range(2 if plane_stress else 3), 1e-6 * size / 0.01
    scale = np.abs(answer.tangent).max()
    for t in axes:
        for j in axes:
            step = np.zeros((3, 3))
            step[t, j] = h
            more, less = respond(moved + step), respond(moved - step)
            by_stress = (more.stress - less.stress) / (2 * h)
            np.testing.assert_allclose(by_stress, answer.tangent[:, :, :, t, j], rtol=0, atol=2e-5 * scale)
            potential = [a.energy + law.dissipated(a.history[:, 0]) for a in (more, less)]
            slope = (potential[0] - potential[1]) / (2 * h)
            np.testing.assert_allclose(slope, answer.stress[:, t, j], rtol=0, atol=1e-5 * np.abs(answer.stress).max())
    A = answer.tangent
    np.testing.assert_allclose(A, A.transpose(0, 3, 4, 1, 2), rtol=0, atol=1e-12 * scale)
    if plane_stress:
        np.testing.assert_array_equal(answer.stress[:, 2, 2], 0.0)


def test_a_rotation_turns_the_stress_and_leaves_the_history():
    law, rng = law_of(FinitePlastic), np.random.default_rng(1)
    before = law.respond(rng.uniform(-0.2, 0.2, (3, 3, 3)), np.zeros((3, 16))).history
    F, Q = np.eye(3) + rng.uniform(-0.3, 0.3, (3, 3, 3)), rotation(rng)
    one, other = law.respond(F - np.eye(3), before), law.respond(Q @ F - np.eye(3), before)
    np.testing.assert_allclose(other.stress, Q @ one.stress, rtol=0, atol=2e-14 * np.abs(one.stress).max())
    np.testing.assert_allclose(other.history, one.history, rtol=0, atol=1e-13)
    volume = np.linalg.det(one.history[:, 7:].reshape(-1, 3, 3) + np.eye(3))
    np.testing.assert_allclose(volume, 1.0, rtol=1e-13)


def test_a_table_is_followed_over_several_of_its_rows_and_its_end():
    """Uniaxial stress in one step, from a plastic strain of 0 into each row, and beyond the last."""
    law = Plastic(YOUNG, 0.0, hardening=TABLE, kinematic=H)
    for p in (0.005, 0.01, 0.015, 0.02, 0.05, 0.1, 0.3):
        stress = np.interp(p, *np.array(TABLE).T[::-1]) + H * p
        gradient = np.diag([stress / YOUNG + p, -p / 2, -p / 2])[None]
        answer = law.respond(gradient, np.zeros((1, 7)))
        np.testing.assert_allclose(answer.stress[0], np.diag([stress, 0, 0]), rtol=0, atol=1e-12)
        assert answer.history[0, 0] == pytest.approx(p, rel=1e-12)
        fine = np.linspace(0, p, 100_001)
        assert law.dissipated(np.array([p]))[0] == pytest.approx(np.trapezoid(law.yield_stress(fine), fine), rel=1e-8)


@pytest.mark.parametrize(
    "wrong",
    [
        {"hardening": ()},
        {"hardening": ((2.0, 0.1),)},
        {"hardening": ((2.0, 0.0), (1.0, 0.1))},
        {"hardening": ((2.0, 0.0), (3.0, 0.0))},
        {"hardening": ((-2.0, 0.0),)},
        {"hardening": ((2.0, 0.0),), "kinematic": -1.0},
    ],
)
def test_wrong_constants_are_refused(wrong):
    with pytest.raises(DataError, match=r"hardening|kinematic"):
        Plastic(YOUNG, NU, **wrong)


# ---- cells


CELLS_AND_MODELS = [("HEXA8", "3d"), ("PENTA6", "3d"), ("PYRAM5", "3d"), ("TETRA10", "3d")]
CELLS_AND_MODELS += [("QUAD4", "plane_strain"), ("QUAD4", "axisymmetric"), ("QUAD4", "plane_stress")]


@pytest.mark.parametrize(
    ("name", "model", "make"), each_option((*row, make) for row in CELLS_AND_MODELS for make in LAWS)
)
def test_the_tangent_of_a_cell_is_the_derivative_of_its_forces(name, model, make):
    """Distorted and warm, after a history, with mean dilatation where it is linear."""
    space = Space.of(one_cell(name, 0.1), model)
    materials = Materials.of(space, law_of(make, expansion=1e-4, reference_temperature=20.0))
    size = 1.0 if make.finite else 0.02
    rest = {"finite": make.finite, "warmer": warming(space, materials, 50.0)}
    first = DisplacedBodies(space, materials, size * shaken(space, 0.02), **rest)
    rest["history"] = first.commit()
    assert max(h[..., 0].max() for h in rest["history"]) > 0
    u = size * shaken(space, 0.05, seed=5)

    def at(v):
        return DisplacedBodies(space, materials, v, **rest)

    K, f = at(u).tangent(), at(u).internal_force()
    expected = by_differences(lambda v: at(v).internal_force(), u, 1e-5 * size)
    np.testing.assert_allclose(K.toarray(), expected, rtol=0, atol=1e-6 * abs(K).max())
    assert np.isfinite(f).all()


# ---- bars


def bar(name, model, kinematics, path, *records, steps=None, **keys):
    """(case, mesh) of a bar along y, moved at its end along a path of (time, displacement); `keys`: of its material."""
    low = None if model in ("3d", "axisymmetric") else (0.0, 0.0)
    mesh = with_sides(body(name, 1 if model == "3d" else 2, low=low))
    law = {"hardening": [[Y0, 0.0], [Y0 + SLOPE, 1.0]], "kinematic": H} | keys
    axes = {"3d": "xyz", "axisymmetric": "y"}.get(model, "xy")
    held = [fix(f"{axis}0", axis) for axis in axes]
    held += [] if path is None else [move("y1", uy=[list(row) for row in path])]
    held.append(steps or Steps(times=[t for t, _ in path[1:]]))
    law = Material(law="plastic", young=YOUNG, poisson=NU, **law)
    return case_of(mesh, law, *held, *records, model=model, kinematics=kinematics), mesh


def uniaxial(strains):
    """Exact stress along a bar, plastic strain and accumulated one, after strains one after another."""
    plastic, p = 0.0, 0.0
    for strain in strains:
        back = H * plastic
        trial = YOUNG * (strain - plastic) - back
        dp = max(abs(trial) - Y0 - SLOPE * p, 0.0) / (YOUNG + H + SLOPE)
        plastic, p = plastic + dp * np.sign(trial), p + dp
        yield YOUNG * (strain - plastic), plastic, p


MOVES = ((0.0, 0.0), (1.0, 0.01), (2.0, 0.0085), (3.0, -0.01), (4.0, 0.015))


@pytest.mark.rows("TETRA4-3d-small", "HEXA8-3d-finite", "TRIA3-plane_stress-small", "QUAD4-plane_stress-finite")
@pytest.mark.filterwarnings("ignore:law = .plastic. makes:lacmesh.errors.LacmeshWarning")
@pytest.mark.parametrize(
    ("name", "model", "kinematics"),
    each_option(
        ((*pair, kinematics) for pair in PAIRS if pair[1] != "plane_strain" for kinematics in ("small", "finite")),
        of=lambda row: [(CELLS[row[0]].family, row[1]), row[1:]],
    ),
)
def test_a_bar_is_pulled_unloaded_pushed_and_pulled(name, model, kinematics):
    """The exact solution; if finite in logarithmic strain, and Cauchy's stress is Kirchhoff's over the volume."""
    problem = Problem.of(*bar(name, model, kinematics, MOVES))
    finite = kinematics == "finite"
    strains = [np.log1p(u) if finite else u for _, u in MOVES[1:]]
    for state, (tau, plastic, p) in zip(march(problem), uniaxial(strains), strict=True):
        volume = np.exp((1 - 2 * NU) * tau / YOUNG) if finite else 1.0
        for sigma in point_stress(problem, state):
            np.testing.assert_allclose(sigma[..., 1], tau / volume, rtol=1e-7)
            np.testing.assert_allclose(np.delete(sigma, 1, axis=-1), 0.0, atol=1e-7)
        figures = step_figures(problem, state)
        assert figures.plastic.strain_max == pytest.approx(p, rel=1e-7)
        assert figures.plastic.von_mises_max == pytest.approx(abs(tau) / volume, rel=1e-7)
        size = np.pi * 3 if model == "axisymmetric" else 1.0
        whole = size * (Y0 * p + SLOPE * p * p / 2)
        assert figures.plastic.dissipation[1] == pytest.approx(whole, rel=1e-7)
        assert figures.energy == pytest.approx(size * (tau**2 / YOUNG + H * plastic**2) / 2, rel=1e-7)
        assert state.residuals[-1] < 1e-8
        np.testing.assert_allclose(state_fields(problem, state).plastic_strain, p, rtol=1e-7)


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_bar_that_is_held_yields_as_it_warms(kinematics):
    warm = {"expansion": 1e-3, "reference_temperature": 20.0}
    case = bar("HEXA8", "3d", kinematics, ((0.0, 0.0), (1.0, 0.0)), Temperature(value=30.0), **warm)
    problem = Problem.of(*case)
    (state,) = march(problem)
    strain, size = (-np.log(1.01), 1.01**3) if kinematics == "finite" else (-0.01, 1.0)
    ((tau, _, p),) = uniaxial([strain])
    volume = np.exp((1 - 2 * NU) * tau / YOUNG) if kinematics == "finite" else 1.0
    (sigma,) = point_stress(problem, state)
    np.testing.assert_allclose(sigma[..., 1], tau / volume, rtol=1e-7)
    dissipation = step_figures(problem, state).plastic.dissipation[1]
    assert dissipation == pytest.approx(size * (Y0 * p + SLOPE * p * p / 2), rel=1e-7)


# ---- steps, files and restarts


def plate(*records, kinematics="small", **rest):
    """(case, mesh) of a plate with uneven load, which yields in a part."""
    path = ((0.0, 0.0), (1.0, 0.004), (2.0, 0.008), (3.0, -0.002))
    return bar("QUAD4", "plane_strain", kinematics, path, Traction(group="x1", tx="0.3 * y * t"), *records, **rest)


@pytest.mark.rows("finite-med")
@pytest.mark.parametrize("kinematics, form", [("small", "vtu"), ("finite", "med")])
def test_what_a_run_writes_and_a_restart_goes_on_from(kinematics, form, tmp_path):
    case, mesh = plate(Output(format=form), kinematics=kinematics)
    states = list(march(problem := Problem.of(case, mesh)))
    run(case, create_output(tmp_path / "out"))
    (again,) = march(problem, start=read_state(tmp_path / "out", case, 2.0, mesh=mesh).step)
    np.testing.assert_array_equal(again.u, states[2].u)
    for one, other in zip(again.step.histories.materials, states[2].step.histories.materials, strict=True):
        np.testing.assert_array_equal(one, other)
    solution = ls.solve(case)
    figures, last = solution.figures.plastic, read_results(tmp_path / "out").solution(-1)
    assert figures.dissipation[1] > 0
    history = read_results(tmp_path / "out").history
    assert history["plastic.dissipation"][-1] == figures.dissipation[1]
    assert history["plastic.strain_max"][-1] == figures.strain_max
    kept = json.loads((tmp_path / "out" / "results.json").read_text())["steps"][-1]["plastic"]
    assert kept["von_mises_max"] == figures.von_mises_max and kept["dissipation"] == list(figures.dissipation)
    np.testing.assert_allclose(last.plastic_strain, solution.plastic_strain, rtol=1e-12)
    assert solution.plastic_strain.max() > 1e-3
    np.testing.assert_allclose(last.von_mises(), solution.von_mises(), rtol=1e-9)


def test_an_attempt_that_fails_leaves_no_flow_behind():
    """Steps that are halved, since an iteration more is not allowed, end as steps of these sizes do."""
    states = list(march(Problem.of(*plate(Solver(max_iterations=3)))))
    assert sum(state.halvings for state in states) > 0
    others = march(Problem.of(*plate(steps=Steps(times=[state.time for state in states]))))
    for one, other in zip(states, others, strict=True):
        np.testing.assert_allclose(one.u, other.u, rtol=0, atol=1e-9)
        (kept,), (wanted,) = one.step.histories.materials, other.step.histories.materials
        np.testing.assert_allclose(kept, wanted, rtol=0, atol=1e-7)


@pytest.mark.slow
def test_in_motion_the_energy_is_kept():
    """The flow takes what counts as damped, and the sum of all energies stays 0."""
    moving = Dynamics(), Initial(vy="0.5 * y")
    case = bar("QUAD4", "plane_strain", "small", None, *moving, steps=Steps(end=0.05, count=50), density=1.0)
    problem = Problem.of(*case)
    figures = [step_figures(problem, state) for state in march(problem)]
    taken = figures[-1].plastic.dissipation[1]
    assert taken > 0.01
    for one in figures:
        energies = one.motion.energies
        total = energies["kinetic"] + energies["strain"] - energies["external"] + energies["damped"]
        assert abs(total + energies["contact"] + energies["numerical"]) < 1e-9 * energies["external"]
        assert energies["damped"] == pytest.approx(one.plastic.dissipation[1], abs=0.02 * taken)


# ---- the case of data/plastic


DATA = Path(__file__).resolve().parents[2] / "data" / "plastic"


@pytest.fixture
def script():
    """The script that makes the mesh, as a module."""
    spec = importlib.util.spec_from_file_location("make_imprint", DATA / "make_imprint.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


@pytest.mark.filterwarnings("ignore:master .ball. is in front of")
def test_a_ball_leaves_an_imprint(script, tmp_path, monkeypatch):
    """Pressed in, nearly the pressure of full plasticity; taken off, what stays is deeper than what comes back.

    On a mesh twice as coarse.
    """
    script.main(tmp_path / "imprint.msh")
    made, kept = lacmesh.read(tmp_path / "imprint.msh"), lacmesh.read(DATA / "imprint.msh")
    np.testing.assert_allclose(made.points, kept.points, rtol=0, atol=1e-12)
    assert all((one.nodes == other.nodes).all() for one, other in zip(made.blocks, kept.blocks, strict=True))
    monkeypatch.setattr(script, "H", 2 * script.H)
    script.main(tmp_path / "imprint.msh")
    states = list(ls.march(DATA / "imprint.toml", tmp_path / "imprint.msh"))
    pressed, last = states[5], states[-1]
    zone = pressed.contact["top"]
    on = zone.status == 1
    mean = (zone.pressure @ zone.area) / zone.area[on].sum()
    assert pressed.time == 1.0 and 2.4 * 400 < mean < 3.1 * 475
    assert not last.contact["top"].pressure.any()
    (pole,) = last.mesh.node_groups["pole"]
    depth = [-state.u[pole, 1] for state in (pressed, last)]
    assert 0.0495 < depth[0] < 0.0505 and 0.8 * depth[0] < depth[1] < 0.95 * depth[0]
    taken = [state.figures.plastic.dissipation[1] for state in states]
    assert (np.diff(taken) >= 0).all() and 30 < taken[-1] < 40
    assert np.nanmax(last.plastic_strain) > 0.05  # the ball has none
