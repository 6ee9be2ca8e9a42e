"""Results of a run: figures against its states and by hand, laws of mechanics, and the end of a run that fails."""

import json
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.kernels import Kernel
from lacsolver.bodies.points import points
from lacsolver.case import Contact, Material, Pressure, Probe, Solver, Spring, Steps, Tie
from lacsolver.equilibrium.state import CONTACT, OPEN, UNPAIRED
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output.states import read_state
from lacsolver.problem.problem import Problem
from lacsolver.results.figures import balance, moment, probe, stress_ranges, with_invariants
from lacsolver.running import Clock, run
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube, plane_mixture, square
from tests.lacsolver.contact_cases import nodes_of
from tests.lacsolver.held import with_sides
from tests.lacsolver.patch_meshes import stack, three_blocks
from tests.lacsolver.tables import table
from tests.problem_meshes import overhang, punch
from tests.problems import ELASTIC, case_of, contact, fix, move

#: its slave is finer than its master, which is said
pytestmark = pytest.mark.filterwarnings("ignore:pressures of contact 'foot' alternate")

#: a contact that opens in part, a tie, springs, two conditions and three probes
SEVERAL = (
    ELASTIC,
    Contact(name="foot", slave="slave1", master="master1", clearance="0.03 * x"),
    Tie(name="glue", slave="slave2", master="master2"),
    Spring(group="x1", kx=3.0, kz=2.0),
    Probe(group="top"),
    Probe(at=[0.0, 0.0, 3.0], name="corner"),
    Steps(count=3),
    *(fix("x0", "x"), fix("y0", "y"), fix("bottom", "z")),
    Pressure(group="top", value="5 * t * (1 + x)"),
)


@cache
def blocks():
    return three_blocks().with_groups(x1=lambda x: np.abs(x[0] - 1) < 1e-9)


class Made:
    """A run of a case in a folder, and the states that its steps were."""

    def __init__(self, folder, mesh, *records, **keys):
        self.case, self.folder, self.stepped = case_of(mesh, *records, **keys), folder / "out", []
        self.results = run(self.case, self.folder, stepped=self.stepped.append)
        self.told = json.loads((self.folder / "results.json").read_text())
        self.problem = Problem.of(self.case, mesh)
        self.states = list(march(self.problem))

    def table(self, name):
        return table(self.folder / f"{name}.csv")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return Made(tmp_path_factory.mktemp("run"), blocks(), *SEVERAL, model="3d")


# ---- figures of states


def test_steps_are_the_states_and_the_last_is_kept(made):
    assert len(made.told["steps"]) == len(made.states) == len(made.stepped) == 3
    by_node = [state.u.reshape(-1, 3) for state in made.states]
    corner = np.abs(made.problem.space.mesh.points - [0, 0, 3]).max(axis=1).argmin()
    for told, state, u in zip(made.told["steps"], made.states, by_node, strict=True):
        assert (told["time"], told["iterations"], told["halvings"]) == (state.time, state.iterations, 0)
        assert len(told["residuals"]) == state.iterations and told["residuals"][-1] <= 1e-10
        np.testing.assert_allclose(told["probes"]["corner"], u[corner], rtol=1e-10, atol=1e-15)
        np.testing.assert_allclose(told["probes"]["top"], u[nodes_of(made.problem, "top")].mean(axis=0), rtol=1e-9)
    history = made.table("history")
    assert list(history) == [
        *("time", "iterations", *(f"reaction.{name}.{a}" for name in ("x0", "y0", "bottom") for a in "xyz")),
        *(f"probe.{name}.u{a}" for name in ("top", "corner") for a in "xyz"),
        *(f"contact.{zone}.{of}" for zone in ("foot", "glue") for of in ("fx", "fy", "fz", "area", "pressure_max")),
    ]
    for k, told in enumerate(made.told["steps"]):
        assert (history["time"][k], history["iterations"][k]) == (told["time"], told["iterations"])
        assert [history[f"probe.top.u{a}"][k] for a in "xyz"] == told["probes"]["top"]
        assert [history[f"reaction.bottom.{a}"][k] for a in "xyz"] == told["reactions"]["bottom"]
    kept = read_state(made.folder, made.case, mesh=blocks())
    assert (kept.time, kept.number) == (1.0, 3)
    for zone in state.zones:
        own = zone.traction if zone.tie else zone.pressure
        np.testing.assert_allclose(kept.multipliers[zone.name], own, atol=1e-10)
        np.testing.assert_array_equal(kept.status[zone.name], zone.status)


def test_zones_are_the_states_too(made):
    state = made.states[-1]
    assert [zone.name for zone in state.zones] == list(made.told["contact"]) == ["foot", "glue"]
    for zone in state.zones:
        told, on = made.told["contact"][zone.name], zone.status != UNPAIRED
        slave = np.unique(next(j.zone.slave.faces.nodes for j in made.problem.joints if j.name == zone.name))
        force = zone.force[slave[slave >= 0]]
        x = made.problem.space.mesh.points[slave[slave >= 0]]
        area = (zone.area * zone.coverage)[zone.status == CONTACT]
        figures = {
            "pressure_min": zone.pressure[on].min(),
            "pressure_max": zone.pressure[on].max(),
            "pressure_mean": area @ zone.pressure[zone.status == CONTACT] / area.sum(),
            "gap_min": zone.gap[on].min(),
            "gap_max": zone.gap[on].max(),
            "contact_area": area.sum(),
            "resultant": force.sum(axis=0),
            "moment": np.cross(x, force).sum(axis=0),
            "coverage_min": zone.coverage.min(),
            "coverage_max": zone.coverage.max(),
            "active": (zone.status == CONTACT).sum(),
            "open": (zone.status == OPEN).sum(),
            "unpaired": (~on).sum(),
        }
        assert list(told) == ["slave", "master", *figures, "overlap_at_start"]
        assert (told["slave"], told["overlap_at_start"]) == ({"foot": "slave1", "glue": "slave2"}[zone.name], 0)
        for name, value in figures.items():
            np.testing.assert_allclose(told[name], value, rtol=1e-9, atol=1e-11, err_msg=name)
    foot, zone = made.told["contact"]["foot"], state.zones[0]
    assert 0 < foot["active"] < foot["active"] + foot["open"] and foot["unpaired"] == 0, "it opens in part"
    np.testing.assert_allclose(foot["resultant"][2], zone.pressure @ (zone.area * zone.coverage), rtol=1e-12)


@pytest.mark.parametrize("initial", ["none", "all"])
def test_a_body_that_is_touched_and_not_pressed_is_held(tmp_path, initial):
    """Without a load rounding alone says which macro-elements are closed: nothing is warned of, whichever these are."""
    records = ELASTIC, contact(initial=initial), fix("x0", "x"), fix("bottom", "y")
    made = Made(tmp_path, stack("QUAD8", "TRIA3", 2), *records, model="plane_strain")
    assert made.results.held == ("'upper' moves along y",) and made.results.message == ""


def test_a_zone_of_which_nothing_is_in_contact(tmp_path):
    """Figures that are none are null, and there is nothing to be in balance."""
    apart = contact(search_distance=0.7), fix("bottom", "xy"), move("top", ux=0.0, uy=0.01)
    made = Made(tmp_path, overhang(0.6), ELASTIC, *apart, model="plane_strain")
    zone = made.told["contact"]["slave"]
    assert (zone["active"], zone["open"], zone["unpaired"]) == (0, 3, 1)
    assert zone["pressure_min"] == zone["pressure_max"] == zone["contact_area"] == 0
    assert zone["resultant"] == [0, 0] and zone["moment"] == 0 and zone["coverage_min"] == 0
    assert zone["gap_min"] == pytest.approx(0.61, rel=1e-12) and zone["gap_max"] == pytest.approx(0.61, rel=1e-12)
    assert made.told["balance"] == {"force": 0.0, "moment": 0.0}


# ---- the run itself


def test_phases_add_up_to_the_time_that_it_took(tmp_path, made):
    begin = time.perf_counter()
    done = run(made.case, tmp_path / "out")
    spent = time.perf_counter() - begin
    assert {"mesh", "solve", "results"} <= set(done.timings) and min(done.timings.values()) > 0
    assert 0.5 * spent < sum(done.timings.values()) <= spent
    assert 2**24 < done.memory < 2**40, "bytes"
    told, space = json.loads((tmp_path / "out" / "results.json").read_text()), made.problem.space
    assert told["timings"] == done.timings and told["memory"] == done.memory
    assert told["version"] == lacmesh.__version__
    assert told["sizes"] == {
        "nodes": space.mesh.n_nodes,
        "cells": int((space.mesh.cell_dim == 3).sum()),
        "unknowns": made.problem.constraints.n_q,
        "macro_elements": sum(len(zone.pressure) for zone in made.states[0].zones),
    }


def test_a_phase_inside_another_counts_for_itself(monkeypatch):
    ticks = iter([0.0, 1.0, 4.0, 9.0, 16.0, 25.0])
    monkeypatch.setattr(time, "perf_counter", lambda: next(ticks))
    clock = Clock()
    with clock.phase("out"):  # from 0
        with clock.phase("in"):  # 1 to 4
            pass
        with pytest.raises(ValueError), clock.phase("in"):  # 9 to 16
            raise ValueError
    assert clock.seconds == {"out": 1 + 5 + 9, "in": 3 + 7}


def test_a_run_that_fails_says_so_and_leaves_the_state_tried(tmp_path):
    pushed = fix("bottom", "xy"), move("top", ux=0.0, uy=[[0, 0], [1, -0.0001], [2, -0.04]])
    steps = Steps(end=2.0, count=2, max_halvings=1), Solver(max_iterations=4)
    case = case_of(punch(), ELASTIC, contact(geometry="current"), *pushed, *steps, model="plane_strain")
    with pytest.raises(NotConvergedError) as error:
        run(case, out := tmp_path / "out")
    told = json.loads((out / "results.json").read_text())
    assert told["status"] == "failed" and told["message"] == str(error.value)
    assert [step["time"] for step in told["steps"]] == [1.0] and told["timings"]["solve"] > 0
    assert "found at time 1.5 after 4 iterations" in told["message"]
    assert "node" in told["message"] and "try more steps" in told["message"]
    assert error.value.state.time == 1.5 and error.value.state.halvings == 2
    assert [p.name for p in sorted(out.glob("state_*"))] == ["state_0001.npz"]
    (tried,) = (out / "unconverged" / "fields").glob("solid_*.vtu")
    u = lacmesh.read(tried).node_data["displacement"][:, :2]
    np.testing.assert_allclose(u.ravel(), error.value.state.u, atol=1e-12)
    assert read_state(out, case, mesh=punch()).time == 1.0


PRESSED = fix("bottom", "xyz"), move("top", ux=0.01, uy=0.0, uz=-0.01)
SMALL = {
    "finite": ((Material(law="neo_hookean", young=1000.0, poisson=0.3), contact(friction=0.3)), "finite"),
    "small": ((ELASTIC, contact(geometry="current", normals="smoothed")), "small"),
}


@pytest.mark.parametrize("kinematics", SMALL)
def test_nothing_is_compiled_for_a_small_model(monkeypatch, kinematics):
    """To compile the loop of the contact's derivative takes seconds, the whole run as it stands less."""

    def compiled(kernel, *_):
        raise AssertionError(f"{kernel.__name__} is compiled")

    monkeypatch.setattr(Kernel, "_is_cached", property(lambda _: False))
    monkeypatch.setattr(Kernel, "fast", compiled)
    monkeypatch.setattr("lacmesh.kernels.writable", lambda _: False)
    mesh, (records, kind) = stack("HEXA8", "HEXA8", 3, counts=(3, 2)), SMALL[kinematics]
    *_, state = march(Problem.of(case_of(mesh, *records, *PRESSED, model="3d", kinematics=kind), mesh))
    assert state.iterations < 10 and (state.zones[0].pressure > 0).any()


# ---- figures by hand: moments and balance


def pushed(x, pairs):
    """Forces (n, d) of (node, force) pairs."""
    force = np.zeros(x.shape)
    for node, f in pairs:
        force[node] += f
    return force


X2 = np.array([[1.0, 0], [3.0, 0], [1.0, 1], [3.0, 1]])
X3 = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 1], [2, 0, 1], [0, 3, 1]])


def test_the_moment_about_the_origin_is_a_number_in_the_plane_and_a_vector_in_space():
    force = pushed(X2, [(0, [0, -4.0]), (3, [1, -2.0])])
    assert moment(force, X2).shape == () and moment(force, X2) == pytest.approx(1 * -4 + 3 * -2 - 1 * 1)
    force = pushed(X3, [(0, [0, 0, -1.0]), (1, [0, 0, -2.0]), (2, [5.0, 0, -3.0])])
    assert moment(force, X3) == pytest.approx([-9, 4, -15])
    assert moment(force, X3 + np.array([0, 0, 2.0])) == pytest.approx([-9, 14, -15])


def test_a_missing_force_and_a_couple_are_measured():
    even = pushed(X3, [(0, [0, 0, -1.0]), (2, [0, 0, -3.0]), (3, [0, 0, 1.0]), (5, [0, 0, 3.0])])
    assert balance([(even, X3)]) == pytest.approx((0, 0), abs=1e-15)
    assert balance([(np.zeros((6, 3)), X3)]) == balance([]) == (0, 0)
    missing = pushed(X2, [(0, [0, -4.0]), (2, [0, 3.0])])
    assert balance([(missing, X2)])[0] == pytest.approx(1 / 3.5)
    couple = pushed(X2, [(0, [0, -4.0]), (3, [0, 4.0])])  # not on one line, two apart
    arm = np.hypot(1, 0.5)
    assert balance([(couple, X2)]) == pytest.approx((0, 2 * 4 / (4 * arm)))
    assert balance([(missing, X2), (couple, X2)]) == pytest.approx((1 / 3.5, 2 / arm))


# ---- figures by hand: stress, energy, probes


def test_stress_ranges_of_every_group_and_of_the_whole():
    mesh = plane_mixture()
    first = np.arange(len(mesh.blocks[0].nodes))
    groups = {"left": first[:2], "mixed": np.array([0, len(first)]), "empty": np.empty(0, int)}
    space = Space.of(Mesh.create(mesh.points, mesh.blocks, cell_groups=groups, space_dim=2), "plane_strain")
    rng = np.random.default_rng(1)
    field = tuple(rng.uniform(-1, 1, (*at.shape[:2], 4)) for at in points(space))
    told = stress_ranges(space, field)
    assert set(told) == {"", "left", "mixed"} and len(field) == 2
    flat = np.concatenate([f.reshape(-1, 4) for f in field])
    mixed = np.concatenate([field[0][0, :, 3], field[1][0, :, 3]])
    for group, name, values in (
        *(("", name, flat[:, k]) for k, name in enumerate(("xx", "yy", "zz", "xy"))),
        *(("left", "yy", field[0][:2, :, 1]), ("mixed", "xy", mixed)),
    ):
        assert told[group][name] == pytest.approx((values.min(), values.max()))


@pytest.mark.parametrize(
    ("mesh", "model", "n"), [(square("QUAD4", 2), "plane_strain", 4), (cube("TETRA4", 1), "3d", 6)]
)
def test_ranges_of_von_mises_and_of_the_principal_stresses(mesh, model, n):
    """Against the eigenvalues of each tensor, in the plane and in space."""
    space, rng = Space.of(with_sides(mesh), model), np.random.default_rng(n)
    field = tuple(rng.uniform(-1, 1, (*at.shape[:2], n)) for at in points(space))
    told = stress_ranges(space, field)[""]
    flat = np.concatenate([f.reshape(-1, n) for f in field])
    xx, yy, zz, xy, yz, xz = np.pad(flat, ((0, 0), (0, 6 - n))).T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    c, b, a = np.linalg.eigvalsh(tensor).T
    mises = np.sqrt(((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 2)
    for name, values in (("principal_1", a), ("principal_2", b), ("principal_3", c), ("von_mises", mises)):
        assert told[name] == pytest.approx((values.min(), values.max()), rel=1e-12)


def test_skin_cells_of_a_group_say_nothing():
    space = Space.of(with_sides(square("QUAD4", 1)), "plane_strain")
    assert set(stress_ranges(space, (np.full((1, 4, 4), 7.0),))) == {"", "body"}  # x0, x1, y0, y1 hold segments alone
    both = Space.of(replace(space.mesh, cell_groups={"both": np.arange(space.mesh.n_cells)}), "plane_strain")
    assert stress_ranges(both, (np.full((1, 4, 4), 7.0),))["both"]["xy"] == (7, 7)


def test_a_probe_is_the_mean_over_its_nodes_and_no_cells_have_no_invariants():
    space = Space.of(square("QUAD4", 1), "plane_strain")
    assert probe(space, np.arange(8.0), np.array([0, 3])) == pytest.approx([3, 4])
    assert with_invariants(np.empty((0, 4, 6))).shape == (0, 4, 10)  # a process without cells of a type
