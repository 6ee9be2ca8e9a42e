"""A run that is interrupted and restarted gives the same results as an uninterrupted one."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.errors import DataError, ReadError
from lacsolver.case import fingerprint, fingerprint_as, parse_case, read_case
from lacsolver.cli import main
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.output import create_output
from lacsolver.output.states import read_state
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from tests.lacsolver.patch_meshes import three_blocks
from tests.lacsolver.tables import table
from tests.problem_meshes import punch

HEAD = """mesh = "blocks.msh"
model = "{model}"
[[material]]
young = 1000.0
poisson = 0.3
"""
#: a contact that opens and closes, a tie, a rigid body that is loaded and one that is moved
SEVERAL = (
    HEAD.format(model="3d")
    + """[[contact]]
name = "foot"
slave = "slave1"
master = "master1"
clearance = "0.002 * x - 0.001"
[[tie]]
name = "glue"
slave = "slave2"
master = "master2"
[[rigid]]
group = "top"
fz = "-3 * sin(t)"
fx = "0.1 * t"
moment = [0.0, "0.2 * t", 0.0]
[[rigid]]
group = "bottom"
uz = "1e-4 * t * t"
[[displacement]]
group = "y0"
uy = 0.0
[[spring]]
group = "master2"
kx = 50.0
kz = 2.0
"""
)
#: two skins that are paired again and again, over a slave that slides
SLIDING = (
    HEAD.format(model="plane_strain")
    + """[[contact]]
slave = "slave"
master = "master"
geometry = "current"
normals = "smoothed"
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
[[rigid]]
group = "top"
ux = "0.05 * t"
uy = "-0.04 * sin(t)"
"""
)
STILL = SLIDING.replace('geometry = "current"', 'geometry = "reference"')


#: a body that goes over its master's faces, finite: pressed down, then along
FAR = (
    HEAD.format(model="plane_strain").replace(
        "[[material]]", 'kinematics = "finite"\n[[material]]\nlaw = "neo_hookean"'
    )
    + """[[contact]]
slave = "slave"
master = "master"
normals = "smoothed"
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
[[rigid]]
group = "top"
ux = [[1.0, 0.0], [3.0, 0.4]]
uy = [[0.0, 0.0], [1.0, -0.08]]
rotation = "0.02 * t"
"""
)


@cache
def blocks():
    """Three blocks on one another, y0 without what the rigid bodies hold."""
    return held_between(three_blocks(("HEXA8", "TETRA4", "PENTA6 quadrangle")))


def held_between(mesh):
    """The mesh, its side y0 without faces that touch the bottom or the top."""
    ends = {n for g in ("bottom", "top") for _, _, nodes in mesh.select(mesh.cells_of(g)) for n in nodes.ravel()}
    kept = [c for _, cells, rows in mesh.select(mesh.cells_of("y0")) for c, r in zip(cells, rows, strict=True)
            if not ends & set(r.tolist())]  # fmt: skip
    groups = {**mesh.cell_groups, "y0": np.array(sorted(kept))}
    return lacmesh.Mesh.create(mesh.points, mesh.blocks, cell_groups=groups)


CASES = {"several": (blocks, SEVERAL), "current": (punch, SLIDING), "reference": (punch, STILL)}
PUNCHED = SLIDING.replace('"-0.04 * sin(t)"', '"-0.04 * t"').replace('"0.05 * t"', "0.0")


#: what a column's figures are compared with the largest of: forces with forces, places with the body
KINDS = {
    "force": ("reaction.", ".fx", ".fy", ".fz"),
    "pressure": ("pressure", "pressure_recovered"),
    "length": ("probe.", "x", "y", "z", "gap"),
}
END = "[steps]\nend = 3.0\ncount = 6\n"
EXACT = "[solver]\ntolerance = 1e-13\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))  # for commands in their own processes
    return tmp_path


def put(name, more, file="case.toml"):
    """A case and its mesh, in the folder that is worked in."""
    mesh, text = CASES[name]
    if not Path("blocks.msh").exists():
        lacmesh.write("blocks.msh", mesh())
    Path(file).write_text(text + more)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """The folder of a case that has run as `END + EXACT` says, by its name; its results are in `whole`."""

    @cache
    def ran(name):
        made = tmp_path_factory.mktemp(name)
        with contextlib.chdir(made):
            put(name, END + EXACT)
            solve("case.toml", "-o", "whole")
        return made

    return ran


@pytest.fixture
def whole(folder, kept):
    """Puts such a case, its mesh and its results into the folder that is worked in."""
    return lambda name: shutil.copytree(kept(name), folder, dirs_exist_ok=True)


def solve(*words):
    assert main(["run", *words, "-q"]) == 0


def kind_of(column):
    for kind, parts in KINDS.items():
        if any(column == part or ("." in part and part in column) for part in parts):
            return kind
    return column


def assert_same(found, wanted, times):
    """Every table of `found` has these times, with the figures of `wanted` to 1e-12.

    Iterations are left out: a first step after a restart has no step before it to go on from.
    """
    for name in sorted(path.name for path in wanted.glob("*.csv")):
        one, other = table(found / name), table(wanted / name)
        assert list(one) == list(other)
        rows = np.isin(other["time"].round(9), np.round(times, 9))
        assert sorted({*one["time"].round(9)}) == pytest.approx(times)
        size = {"length": 1.0}
        for column, values in other.items():
            known = np.abs(values[np.isfinite(values)]).max(initial=0.0)
            size[kind_of(column)] = max(size.get(kind_of(column), 0.0), known)
        for column in [c for c in one if c != "iterations"]:
            a, b = one[column], other[column][rows]
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * size[kind_of(column)], err_msg=f"{name}: {column}")


for_all = pytest.mark.parametrize("name", CASES)


@for_all
def test_three_steps_and_three_more_are_six(folder, whole, name):
    whole(name)
    put(name, "[steps]\nend = 1.5\ncount = 3\n" + EXACT, "first.toml")
    solve("first.toml", "-o", "first")
    solve("case.toml", "--restart", "first", "-o", "then")
    assert_same(folder / "then", folder / "whole", [2.0, 2.5, 3.0])
    all_of_it, then = (json.loads((folder / d / "results.json").read_text()) for d in ("whole", "then"))
    assert then["status"] == "done" and [s["time"] for s in then["steps"]] == [2.0, 2.5, 3.0]
    assert then["energy"] == pytest.approx(all_of_it["energy"], rel=1e-12)
    for group, ranges in all_of_it["stress"].items():
        big = np.abs(list(ranges.values())).max()
        for component, ends in ranges.items():
            np.testing.assert_allclose(then["stress"][group][component], ends, atol=1e-12 * big)
    assert sorted(p.name for p in (folder / "then").glob("state_*")) == [f"state_000{k}.npz" for k in (4, 5, 6)]


def test_the_cases_open_and_close(kept):
    """The restarted cases have contact that changes during the run, before the restart and after it."""
    for name, zone in (("several", "foot"), ("current", "slave"), ("reference", "slave")):
        rows = table(kept(name) / "whole" / f"contact_{zone}.csv")
        closed = [(rows["status"][rows["time"] == t] == 1).sum() for t in np.unique(rows["time"])]
        assert 0 < min(closed) < max(closed) and len(set(closed[2:])) > 1, (name, closed)


@pytest.mark.parametrize(
    "name", ["several", *(pytest.param(name, marks=pytest.mark.slow) for name in ("current", "reference"))]
)
def test_an_earlier_time_is_gone_on_from_in_the_same_folder(folder, whole, name):
    whole(name)
    shutil.copytree("whole", "again")
    solve("case.toml", "--restart", "again", "--from", "1", "-o", "again", "--force")
    assert_same(folder / "again", folder / "whole", [0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    solve("case.toml", "--restart", "whole", "--from", "2.5", "-o", "last")
    assert_same(folder / "last", folder / "whole", [3.0])


@for_all
def test_a_state_keeps_all_that_a_run_goes_on_from(whole, name):
    """A restart that has nothing left to solve knows it; the state is the one that was written."""
    whole(name)
    case = read_case("case.toml")
    states = [read_state("whole", case, t) for t in (1.0, 3.0)]
    assert [(s.time, s.number) for s in states] == [(1.0, 2), (3.0, 6)]
    assert not np.allclose(states[0].u, states[1].u)
    if name == "several":
        assert list(states[1].multipliers) == ["foot", "glue"] and states[1].multipliers["glue"].shape[1] == 3
        assert states[1].rigid["bottom"][2] == pytest.approx(9e-4, rel=1e-12)
    done = run(case, create_output("nothing"), start=states[1])
    assert done.status == "done" and done.steps == ()


@for_all
def test_what_is_kept_is_in_equilibrium(whole, name):
    """Displacements and pressures as they were, ties' too: there is nothing left for a solve to do."""
    whole(name)
    case = read_case("case.toml")
    model = ReducedProblem(Problem.of(case))
    now = LoadStep(model, 3.0)
    q, p, active = read_state("whole", case).step.iterate
    contact = now.contact(q)
    forces = contact.rows.B_T @ p
    np.testing.assert_allclose(now.reference.K @ q + forces, now.f, atol=1e-11 * np.abs(forces).max())
    assert (p[~active] == 0).all() and np.abs(contact.residuals(p, active)).max() <= 1e-12 and active.any()
    np.testing.assert_array_equal(contact.next_active(active, p), active)


@pytest.mark.parametrize(
    "old, new, part",
    [
        ("young = 1000.0", "young = 1001.0", "material"),
        ("kz = 2.0", "kz = 2.5", "spring"),
        ('fx = "0.1 * t"', 'fx = "0.2 * t"', "rigid"),
        ('clearance = "0.002 * x - 0.001"', "", "contact"),
        ('name = "glue"', "coverage_threshold = 0.1", "tie"),
    ],
)
def test_a_case_that_changed_is_refused(folder, capsys, old, new, part):
    put("several", "[steps]\nend = 0.5\n")
    solve("case.toml", "-o", "out")
    text = SEVERAL.replace(old, new)
    assert text != SEVERAL
    Path("case.toml").write_text(text + END)
    assert main(["run", "case.toml", "--restart", "out", "-o", "then", "-q"]) == 1
    assert f"are of another case: {part} changed" in capsys.readouterr().err
    assert not (folder / "then").exists()


def test_a_mesh_that_changed_is_refused(folder):
    put("several", "[steps]\nend = 0.5\n")
    solve("case.toml", "-o", "out")
    mesh = lacmesh.read("blocks.msh")
    moved = lacmesh.Mesh.create(mesh.points * 1.001, mesh.blocks, cell_groups=mesh.cell_groups)
    lacmesh.write("blocks.msh", moved, force=True)
    with pytest.raises(DataError, match="another case: mesh changed"):
        read_state("out", read_case("case.toml"))


def test_a_run_that_is_interrupted_goes_on(folder):
    """SIGINT in the middle: what had converged is kept, and the rest comes to what it would have."""
    steps = "[steps]\nend = 3.0\ncount = 12\n" + EXACT
    put("several", steps)
    solve("case.toml", "-o", "whole")
    words = [sys.executable, "-m", "lacsolver", "run", "case.toml", "-o", "out"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if line.split()[:1] == ["3"]:
                process.send_signal(signal.SIGINT)
                break
        error = process.communicate(timeout=600)[1]
    assert process.returncode == 130 and "goes on from there" in error
    told = json.loads((folder / "out" / "results.json").read_text())
    assert told["status"] == "interrupted" and 3 <= len(told["steps"]) < 12
    solve("case.toml", "--restart", "out", "-o", "out")
    assert_same(folder / "out", folder / "whole", [0.25 * k for k in range(1, 13)])
    told = json.loads((folder / "out" / "results.json").read_text())
    assert told["status"] == "done" and len(told["steps"]) == 12


def test_a_step_that_was_halved_goes_on_as_long_as_it_was(folder):
    """The length of the step that comes next is kept with the state."""
    steps = "[steps]\nend = 1.0\ngrowth = 1.0\n[solver]\nmax_iterations = 4\n"
    put("current", steps)
    Path("case.toml").write_text(PUNCHED + steps)
    solve("case.toml", "-o", "whole")
    times = [s["time"] for s in json.loads((folder / "whole" / "results.json").read_text())["steps"]]
    assert len(times) > 2 and times[0] < 0.5
    solve("case.toml", "--restart", "whole", "--from", str(times[0]), "-o", "then")
    told = json.loads((folder / "then" / "results.json").read_text())
    assert told["steps"][0]["time"] == pytest.approx(times[1], rel=1e-12)


@pytest.mark.parametrize(
    "steps",
    [
        pytest.param(END, id="whole"),
        pytest.param(
            "[steps]\nend = 3.0\ncount = 2\ngrowth = 1.0\n[solver]\nmax_iterations = 6\n",
            id="halved",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_bodies_that_go_far_go_on_to_the_last_bit(folder, monkeypatch, steps):
    """Finite kinematics: a run goes on from its states with the same iterations, to the same figures, bit by bit."""
    monkeypatch.setitem(CASES, "far", (punch, FAR))
    put("far", steps)
    solve("case.toml", "-o", "whole")
    told = json.loads((folder / "whole" / "results.json").read_text())["steps"]
    assert any(step["halvings"] for step in told) == ("max_iterations" in steps)
    for first in (1, len(told) - 1):
        since = told[first - 1]["time"]
        solve("case.toml", "--restart", "whole", "--from", str(since), "-o", f"from{first}")
        case = read_case("case.toml")
        for step in told[first:]:
            one, other = (read_state(d, case, step["time"]) for d in (f"from{first}", "whole"))
            np.testing.assert_array_equal(one.u, other.u)
            np.testing.assert_array_equal(one.step.iterate.p, other.step.iterate.p)
            np.testing.assert_array_equal(one.step.iterate.active, other.step.iterate.active)
        for name in ("history.csv", "contact_slave.csv"):
            head, *rows = (folder / "whole" / name).read_text().splitlines()
            after = [row for row in rows if float(row.split(",")[0]) > since]
            assert after and (folder / f"from{first}" / name).read_text().splitlines() == [head, *after]


# ---- the mesh of a run is the one in memory


def halves():
    """The case of sliding blocks in two halves, its mesh, and the same mesh a little wider; no file is there."""
    mesh = lacmesh.cut_skin(punch(), "slave").mesh
    wider = lacmesh.Mesh.create(mesh.points * [1.001, 1.0, 1.0], mesh.blocks, cell_groups=mesh.cell_groups)
    return (*(parse_case(STILL + f"[steps]\nend = {end}\ncount = {end}\n") for end in (1, 2)), mesh, wider)


def test_a_mesh_in_memory_needs_no_file(folder):
    """A run on it, and a restart from what the run kept; the mesh that the case names is nowhere."""
    first, whole, mesh, _ = halves()
    assert run(first, create_output("first"), mesh=mesh).status == "done"
    then = run(whole, create_output("then"), mesh=mesh, start=read_state("first", whole, mesh=mesh))
    assert then.status == "done" and [step.time for step in then.steps] == [2.0]


def test_a_restart_on_another_mesh_in_memory_is_refused(folder):
    """By `read_state`, and by a run whose mesh is not that of the state, whatever file stands where the case says."""
    first, whole, mesh, wider = halves()
    lacmesh.write("blocks.msh", mesh)
    run(first, create_output("first"), mesh=mesh)
    with pytest.raises(DataError, match="first are of another case: mesh changed"):
        read_state("first", whole, mesh=wider)
    with pytest.raises(DataError, match="first are of another case: mesh changed"):
        run(whole, create_output("then"), mesh=wider, start=read_state("first", whole))
    assert not (folder / "then").exists()


def test_states_that_know_their_mesh_by_the_older_digest_are_gone_on_from(folder, monkeypatch):
    """On the same mesh; the following states have the digest of this version."""
    first, whole, mesh, wider = halves()
    older = fingerprint_as({}, {}, first, mesh)["mesh"]
    with monkeypatch.context() as before:
        before.setattr("lacsolver.running.fingerprint", lambda *given: {**fingerprint(*given), "mesh": older})
        run(first, create_output("first"), mesh=mesh)
    start = read_state("first", whole, mesh=mesh)
    assert start.case["mesh"] == older
    with pytest.raises(DataError, match="mesh changed; restore it, start as many processes as that run of an older"):
        read_state("first", whole, mesh=wider)
    assert run(whole, create_output("then"), mesh=mesh, start=start).status == "done"
    assert dict(read_state("then", whole, mesh=mesh).case) == fingerprint(whole, mesh)
    assert fingerprint(whole, mesh)["mesh"] != older


def test_states_of_an_older_version_are_refused(folder, monkeypatch):
    """Their mesh is known by its file alone."""
    first, whole, mesh, _ = halves()
    monkeypatch.setattr("lacsolver.output.states.VERSION", 2)
    run(first, create_output("first"), mesh=mesh)
    monkeypatch.undo()
    with pytest.raises(ReadError, match="do not tell which mesh they are of; run"):
        read_state(folder / "first", whole, mesh=mesh)
