"""Results of a run: figures against its states, laws of mechanics, and the end of a run that fails."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lacmesh
from lacmesh.errors import DataError
from lacsolver.bodies.small import stress
from lacsolver.case import read_case
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output
from lacsolver.output.states import read_state
from lacsolver.problem.problem import Problem
from lacsolver.results.nodal import principal, von_mises
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED
from lacsolver.running import Clock, run
from tests.lacsolver.contact_cases import JOINT, MATERIAL, SLIDING, held, nodes_of, pressed
from tests.lacsolver.patch_meshes import stack, three_blocks
from tests.lacsolver.tables import table
from tests.problem_meshes import overhang, punch

#: its slave is finer than its master, which is said
pytestmark = pytest.mark.filterwarnings("ignore:pressures of contact 'foot' alternate")

#: a contact that opens in part, a tie, springs, two conditions and three probes
TEXT = (
    """mesh = "blocks.msh"
model = "3d"
"""
    + MATERIAL
    + """[[contact]]
name = "foot"
slave = "slave1"
master = "master1"
clearance = "0.03 * x"
[[tie]]
name = "glue"
slave = "slave2"
master = "master2"
[[spring]]
group = "x1"
kx = 3.0
kz = 2.0
[[probe]]
group = "top"
[[probe]]
at = [0.0, 0.0, 3.0]
name = "corner"
[steps]
count = 3
"""
    + SLIDING
    + held("bottom", uz=0.0)
    + pressed("top", "5 * t * (1 + x)")
)


@cache
def blocks():
    mesh = three_blocks()
    faces = mesh.select(np.flatnonzero(mesh.cell_dim == 2))
    x1 = np.concatenate([cells[(mesh.points[nodes, 0] > 1 - 1e-9).all(axis=1)] for _, cells, nodes in faces])
    return replace(mesh, cell_groups={**mesh.cell_groups, "x1": np.sort(x1)})


class Made:
    """A run of a case in a folder, and the states that its steps were."""

    def __init__(self, folder, mesh, text):
        lacmesh.write(folder / "blocks.msh", mesh)
        (folder / "case.toml").write_text(text)
        self.case, self.folder = read_case(folder / "case.toml"), folder / "out"
        self.stepped = []
        self.results = run(self.case, create_output(self.folder), stepped=self.stepped.append)
        self.told = json.loads((self.folder / "results.json").read_text())
        self.problem = Problem.of(self.case)
        self.states = list(march(self.problem))

    def table(self, name):
        return table(self.folder / f"{name}.csv")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return Made(tmp_path_factory.mktemp("run"), blocks(), TEXT)


# ---- figures of states


def test_steps_are_the_states(made):
    assert len(made.told["steps"]) == len(made.states) == len(made.stepped) == 3
    by_node = [state.u.reshape(-1, 3) for state in made.states]
    corner = np.abs(made.problem.space.mesh.points - [0, 0, 3]).max(axis=1).argmin()
    for told, state, u in zip(made.told["steps"], made.states, by_node, strict=True):
        assert (told["time"], told["iterations"], told["halvings"]) == (state.time, state.iterations, 0)
        assert len(told["residuals"]) == state.iterations and told["residuals"][-1] <= 1e-10
        np.testing.assert_allclose(told["probes"]["corner"], u[corner], rtol=1e-10, atol=1e-15)
        np.testing.assert_allclose(told["probes"]["top"], u[nodes_of(made.problem, "top")].mean(axis=0), rtol=1e-9)
    history = made.table("history")
    for k, told in enumerate(made.told["steps"]):
        assert (history["time"][k], history["iterations"][k]) == (told["time"], told["iterations"])
        assert [history[f"probe.top.u{a}"][k] for a in "xyz"] == told["probes"]["top"]
        assert [history[f"reaction.bottom.{a}"][k] for a in "xyz"] == told["reactions"]["bottom"]


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
        table = made.table(f"contact_{zone.name}")
        last = table["time"] == state.time
        for name in ("pressure", "gap", "status", "coverage", "area"):
            np.testing.assert_allclose(table[name][last], getattr(zone, name), rtol=1e-9, atol=1e-12, err_msg=name)
    foot = made.told["contact"]["foot"]
    assert 0 < foot["active"] < foot["active"] + foot["open"] and foot["unpaired"] == 0, "it opens in part"
    np.testing.assert_allclose(foot["resultant"][2], foot_force(made), rtol=1e-12)


def foot_force(made):
    """Pressures times the areas that they act on."""
    zone = made.states[-1].zones[0]
    return zone.pressure @ (zone.area * zone.coverage)


def test_stress_is_that_at_integration_points(made):
    space, state = made.problem.space, made.states[-1]
    found = stress(space, made.problem.materials, state.u)
    whole = np.concatenate([values.reshape(-1, 6) for values in found])
    assert "" in made.told["stress"] and set(made.told["stress"]) == {""}, "no group has cells of the body"
    whole = np.concatenate([whole, von_mises(whole)[:, None], principal(whole)], axis=1)
    for k, ends in enumerate(made.told["stress"][""].values()):
        np.testing.assert_allclose(ends, [whole[:, k].min(), whole[:, k].max()], rtol=1e-9)


def test_stress_of_groups_of_cells(tmp_path):
    text = 'mesh = "blocks.msh"\nmodel = "3d"\n' + MATERIAL + JOINT + SLIDING + held("bottom", uz=0.0)
    made = Made(tmp_path, stack("HEXA8", "TETRA4", 3), text + pressed("top", "1 + x"))
    found = made.told["stress"]
    assert set(found) == {"", "lower", "upper"}
    for component, (low, high) in found[""].items():
        ends = np.array([found[group][component] for group in ("lower", "upper")])
        assert (low, high) == (ends[:, 0].min(), ends[:, 1].max())
    assert found["lower"] != found["upper"]


# ---- mechanics


def test_reactions_and_springs_bear_the_load(made):
    for told, state in zip(made.told["steps"], made.states, strict=True):
        u = state.u.reshape(-1, 3)[nodes_of(made.problem, "x1")]
        springs = -np.array([3.0, 0.0, 2.0]) * u.sum(axis=0)
        reactions = np.sum(list(told["reactions"].values()), axis=0)
        load = np.array([0, 0, -7.5 * state.time])
        np.testing.assert_allclose(reactions + springs + load, 0, atol=1e-11)
    assert set(told["reactions"]) == {"x0", "y0", "bottom"}


def test_contact_forces_balance(made):
    assert max(made.told["balance"].values()) <= 1e-12
    assert made.told["balance"] == {
        "force": max(step.balance[0] for step in made.stepped),
        "moment": max(step.balance[1] for step in made.stepped),
    }


def test_the_energy_is_half_the_work_of_the_load(tmp_path):
    """The problem is linear; the energy includes the springs'."""
    text = 'mesh = "blocks.msh"\nmodel = "3d"\n' + MATERIAL + JOINT.replace("[[contact]]", "[[tie]]") + SLIDING
    text += '[[spring]]\ngroup = "bottom"\nkz = 3.0\n' + pressed("top", "1 + x * y") + "[steps]\ncount = 2\n"
    made = Made(tmp_path, stack("HEXA8", "TETRA4", 3), text)
    for step, state in zip(made.stepped, made.states, strict=True):
        assert step.energy == pytest.approx(0.5 * made.problem.load(state.time) @ state.u, rel=1e-11)
    assert made.told["energy"] == step.energy


@pytest.mark.parametrize("model, modulus", [("3d", 1000.0), ("plane_strain", 1000 / 0.91), ("axisymmetric", 1000.0)])
def test_the_energy_of_a_body_that_is_warm(tmp_path, model, modulus):
    """Free, it has none (but for plane strain, which is held across); held along the height, E (alpha T)^2 / 2 each."""
    mesh = stack("HEXA8", "TETRA4", 3) if model == "3d" else stack("QUAD8", "TRIA3", 2)
    up = "z" if model == "3d" else "y"
    head = f'mesh = "blocks.msh"\nmodel = "{model}"\n' + MATERIAL + "expansion = 1e-4\n" + JOINT
    head += (SLIDING if model == "3d" else held("x0", ux=0.0)) + held("bottom", **{f"u{up}": 0.0})
    head += "[[temperature]]\nvalue = 100.0\n"
    volume = 2 * np.pi if model == "axisymmetric" else 2.0
    for name, top, held_along in (("free", "", 0.0), ("held", held("top", **{f"u{up}": 0.0}), 1.0)):
        folder = tmp_path / name
        folder.mkdir()
        found = Made(folder, mesh, head + top).told["energy"]
        across = 1000 * 1e-4 if model == "plane_strain" else 0.0  # E (alpha T)^2, of which zz has its half
        along = modulus * (1.3 if model == "plane_strain" else 1.0) ** 2 * 1e-4 * held_along
        assert found == pytest.approx(volume * (along + across) / 2, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("initial", ["none", "all"])
def test_a_body_that_is_touched_and_not_pressed_is_held(tmp_path, initial):
    """Without a load rounding alone says which macro-elements are closed: nothing is warned of, whichever these are."""
    text = 'mesh = "blocks.msh"\nmodel = "plane_strain"\n' + MATERIAL + JOINT + f'initial = "{initial}"\n'
    made = Made(tmp_path, stack("QUAD8", "TRIA3", 2), text + held("x0", ux=0.0) + held("bottom", uy=0.0))
    assert made.results.held == ("'upper' moves along y",) and made.results.message == ""


# ---- the run itself


def test_phases_add_up_to_the_time_that_it_took(tmp_path):
    lacmesh.write(tmp_path / "blocks.msh", blocks())
    (tmp_path / "case.toml").write_text(TEXT)
    case = read_case(tmp_path / "case.toml")
    begin = time.perf_counter()
    made = run(case, create_output(tmp_path / "out"))
    spent = time.perf_counter() - begin
    assert {"mesh", "solve", "results"} <= set(made.timings) and min(made.timings.values()) > 0
    assert 0.5 * spent < sum(made.timings.values()) <= spent
    assert 2**24 < made.memory < 2**40, "bytes"
    told = json.loads((tmp_path / "out" / "results.json").read_text())
    assert told["timings"] == made.timings and told["memory"] == made.memory
    assert set(told["sizes"]) == set(made.sizes) and told["version"] == lacmesh.__version__


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


def test_sizes(made):
    space = made.problem.space
    assert made.told["sizes"] == {
        "nodes": space.mesh.n_nodes,
        "cells": int((space.mesh.cell_dim == 3).sum()),
        "unknowns": made.problem.constraints.n_q,
        "macro_elements": sum(len(zone.pressure) for zone in made.states[0].zones),
    }


def test_the_state_is_kept(made):
    kept = read_state(made.folder, made.case)
    state = made.states[-1]
    assert (kept.time, kept.number) == (1.0, 3)
    np.testing.assert_allclose(kept.u, state.u, atol=1e-12 * np.abs(state.u).max())
    for zone in state.zones:
        own = zone.traction if zone.tie else zone.pressure
        np.testing.assert_allclose(kept.multipliers[zone.name], own, atol=1e-10)
        np.testing.assert_array_equal(kept.status[zone.name], zone.status)


# ---- runs that end otherwise

FAILING = (
    'mesh = "blocks.msh"\nmodel = "plane_strain"\n'
    + MATERIAL
    + JOINT
    + 'geometry = "current"\n'
    + held("bottom", ux=0.0, uy=0.0)
    + held("top", ux=0.0, uy=[[0, 0], [1, -0.0001], [2, -0.04]])
    + "[steps]\nend = 2.0\ncount = 2\nmax_halvings = 1\n[solver]\nmax_iterations = 4\n"
)


@pytest.mark.parametrize("kind", ["vtu", "med"])
def test_a_run_that_fails_says_so_and_leaves_the_state_tried(tmp_path, kind):
    lacmesh.write(tmp_path / "blocks.msh", punch())
    (tmp_path / "case.toml").write_text(FAILING + f'[output]\nformat = "{kind}"\n')
    case, out = read_case(tmp_path / "case.toml"), tmp_path / "out"
    with pytest.raises(NotConvergedError) as error:
        run(case, create_output(out))
    told = json.loads((out / "results.json").read_text())
    assert told["status"] == "failed" and told["message"] == str(error.value)
    assert [step["time"] for step in told["steps"]] == [1.0] and told["timings"]["solve"] > 0
    assert "no equilibrium found at time 1.5 after 4 iterations" in told["message"]
    assert "node" in told["message"] and "try more steps" in told["message"]
    assert error.value.state.time == 1.5 and error.value.state.halvings == 2
    assert [p.name for p in sorted(out.glob("state_*"))] == ["state_0001.npz"]
    if kind == "vtu":
        (tried,) = (out / "unconverged" / "fields").glob("solid_*.vtu")
        u = lacmesh.read(tried).node_data["displacement"][:, :2]
        np.testing.assert_allclose(u.ravel(), error.value.state.u, atol=1e-12)
    else:
        assert (out / "unconverged" / "results.med").stat().st_size > 1000
    assert read_state(out, case).time == 1.0


def test_a_run_that_is_refused_writes_nothing(tmp_path):
    lacmesh.write(tmp_path / "blocks.msh", stack("HEXA8", "TETRA4", 3))
    (tmp_path / "case.toml").write_text('mesh = "blocks.msh"\nmodel = "3d"\n' + MATERIAL + JOINT + pressed("top", 1.0))
    with pytest.raises(DataError, match="nothing holds a part of the model"):
        run(read_case(tmp_path / "case.toml"), create_output(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_run_that_is_stopped_keeps_what_converged(tmp_path):
    lacmesh.write(tmp_path / "blocks.msh", blocks())
    (tmp_path / "case.toml").write_text(TEXT)

    def stop(step):
        if step.time > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(read_case(tmp_path / "case.toml"), create_output(tmp_path / "out"), stepped=stop)
    told = json.loads((tmp_path / "out" / "results.json").read_text())
    assert told["status"] == "interrupted" and len(told["steps"]) == 2


def test_a_zone_of_which_nothing_is_in_contact(tmp_path):
    """Figures that are none are null, and there is nothing to be in balance."""
    text = 'mesh = "blocks.msh"\nmodel = "plane_strain"\n' + MATERIAL + JOINT + "search_distance = 0.7\n"
    made = Made(tmp_path, overhang(0.6), text + held("bottom", ux=0.0, uy=0.0) + held("top", ux=0.0, uy=0.01))
    zone = made.told["contact"]["slave"]
    assert (zone["active"], zone["open"], zone["unpaired"]) == (0, 3, 1)
    assert zone["pressure_min"] == zone["pressure_max"] == zone["contact_area"] == 0
    assert zone["resultant"] == [0, 0] and zone["moment"] == 0 and zone["coverage_min"] == 0
    assert zone["gap_min"] == pytest.approx(0.61, rel=1e-12) and zone["gap_max"] == pytest.approx(0.61, rel=1e-12)
    assert made.told["balance"] == {"force": 0.0, "moment": 0.0}
