"""Bolts that are tightened: columns in closed form on all cells, moments of a bent bolt, sections that are refused."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacsolver.case import (
    Case,
    CaseError,
    Contact,
    Displacement,
    Dynamics,
    Material,
    Pressure,
    Pretension,
    Rigid,
    Steps,
    Traction,
    parse_case,
)  # fmt: skip
from lacsolver.output import create_output
from lacsolver.output.states import read_state
from lacsolver.problem.problem import Problem
from lacsolver.results.figures import step_figures
from lacsolver.running import run
from lacsolver.validation import validate
from tests.checks.blocks import SOLIDS, block, join, skin
from tests.lacsolver.tables import table
from tests.samples import each_option

E = 1000.0
KINDS = [name for name, cell in CELLS.items() if cell.dim > 1]
SHORTENED = ["TRIA6", "QUAD4", "TETRA4", "HEXA20", "PENTA15"]
STEPS = [1.0, 2.0, 3.0, 4.0]


def level(up, value, low=-1.0, high=9.0):
    return lambda x: (abs(x[..., up] - value) < 1e-9) & (x[..., 0] > low) & (x[..., 0] < high)


def inner(points, cells, where):
    """The facets of cells at a place inside them, each once."""
    found = skin(points, cells, where)
    return {k: rows[np.unique(np.sort(rows, axis=1), axis=0, return_index=True)[1]] for k, rows in found.items()}


def joint(kind, n=2, m=2, halves=False, model="3d"):
    """A bolt on 0 < x < 1, and beside it a foot and a lid on 2 < x < 3 that touch; all are 2 high.

    `m`: cells of the lid to a side; `halves`: the bolt is of two bodies whose meshes differ.
    """
    linear, order = SOLIDS[kind]
    d = CELLS[linear].dim
    up = d - 1

    def column(x, low, high, n, tall):
        return block((n,) * up + (tall,), (x, *[0] * (d - 2), low), (x + 1, *[1] * (d - 2), high), linear)

    foot, lid = column(2, 0, 1, n, 2), column(2, 1, 2, m, 2)
    parts = [
        (*foot, {"foot": skin(*foot, level(up, 0)), "slave": skin(*foot, level(up, 1))}),
        (*lid, {"master": skin(*lid, level(up, 1)), "head": skin(*lid, level(up, 2))}),
    ]
    if halves:
        low, high = column(0, 0, 1, n, 2), column(0, 1, 2, n + 1, 2)
        parts += [
            (*low, {"foot": skin(*low, level(up, 0)), "shank_a": skin(*low, level(up, 1))}),
            (*high, {"shank_b": skin(*high, level(up, 1)), "head": skin(*high, level(up, 2))}),
        ]
    else:
        bolt = column(0, 0, 2, n, 4)
        parts.append((*bolt, {"foot": skin(*bolt, level(up, 0)), "head": skin(*bolt, level(up, 2)),
                              "shank": inner(*bolt, level(up, 1))}))  # fmt: skip
    mesh = join(parts)
    return lacmesh.raise_order(mesh, order) if order else mesh


def tightened(mesh, **keys):
    """The case: the feet are held, the heads move together under a force 0, 10, 20, 30 at the times 1 to 4."""
    d = mesh.space_dim
    zero = dict.fromkeys(("ux", "uy", "uz")[:d], 0.0)
    free = {name: 0.0 for name in zero if name != ("uy" if d == 2 else "uz")}
    pull = {"fy" if d == 2 else "fz": [[0, 0], [1, 0], [4, 30]]}
    return Case(
        model="3d" if d == 3 else "plane_stress",
        material=Material(young=E, poisson=0.0),
        contact=Contact(slave="slave", master="master"),
        displacement=Displacement(group="foot", **zero),
        rigid=Rigid(group="head", **free, **pull),
        pretension=Pretension(group="shank", **keys),
        steps=Steps(times=STEPS),
    )


def marched(case, mesh):
    """[(bolt, contact force on the master, state)] of each step."""
    out = []
    for solution in ls.march(case, mesh):
        problem, state, _ = solution._solved
        step = step_figures(problem, state)
        out.append((step.pretension[case.pretension[0].name], step.contact["slave"].resultant[-1], problem, state))
    return out


#: F0 + F kb / (kb + kc) until F = 20, where the lid leaves the foot, and F after it; kb = kc
LOCKED = [10.0, 15.0, 20.0, 30.0]


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind not in SHORTENED)) for kind in KINDS]
)
def test_a_locked_bolt_between_clamped_columns(kind):
    mesh = joint(kind, m=3)
    steps = marched(tightened(mesh, force=[[0, 0], [1, 10]], lock=1.0), mesh)
    np.testing.assert_allclose([bolt.force for bolt, *_ in steps], LOCKED, rtol=1e-10)
    np.testing.assert_allclose([-f for _, f, *_ in steps], [10, 5, 0, 0], atol=1e-9)
    np.testing.assert_allclose([bolt.shortening for bolt, *_ in steps], 10 * (2 / E + 2 / E), rtol=1e-10)


@pytest.mark.parametrize("kind, halves", each_option(itertools.product(SHORTENED, (False, True))))
def test_a_bolt_shortened_by_a_length(kind, halves):
    """Forces are as with a lock, also with a section between meshes that do not match."""
    mesh = joint(kind, halves=halves)
    steps = marched(tightened(mesh, shortening=[[0, 0], [1, 0.04]]), mesh)
    np.testing.assert_allclose([bolt.force for bolt, *_ in steps], LOCKED, rtol=1e-10)
    locked = marched(tightened(mesh, shortening=[[0, 0], [1, 0.04], [2, 0.5]], lock=1.0), mesh)
    np.testing.assert_allclose([bolt.force for bolt, *_ in locked], LOCKED, rtol=1e-10)


@pytest.mark.parametrize("halves", [False, True])
def test_a_force_without_a_lock_stays(halves):
    mesh = joint("HEXA8", halves=halves)
    case = replace(tightened(mesh, force=[[0, 0], [1, 40]]), steps=Steps(times=STEPS))
    steps = marched(case, mesh)
    np.testing.assert_allclose([bolt.force for bolt, *_ in steps], 40, rtol=1e-10)
    np.testing.assert_allclose([-f for _, f, *_ in steps], [40, 30, 20, 10], rtol=1e-9)
    np.testing.assert_allclose([bolt.shortening for bolt, *_ in steps], [0.16, 0.14, 0.12, 0.1], rtol=1e-10)


@pytest.mark.parametrize("geometry", ["reference", "current"])
@pytest.mark.parametrize("kind", ["QUAD4", "HEXA8"])
def test_a_locked_bolt_is_tightened_over_a_gap(kind, geometry):
    """The lid comes down by the gap of 0.01 before it is clamped; what is clamped is shorter by that."""
    mesh, gap = joint(kind), 0.01
    points = mesh.points.copy()
    points[mesh.nodes_on(mesh.cell_groups["master"]), mesh.space_dim - 1] += gap
    mesh = replace(mesh, points=points)
    case = tightened(mesh, force=[[0, 0], [1, 10]], lock=1.0)
    steps = marched(replace(case, contact=replace(case.contact[0], geometry=geometry)), mesh)
    np.testing.assert_allclose(steps[0][0].shortening, 10 * (2 / E + (2 - gap) / E) + gap, rtol=1e-3)
    k_bolt, k_clamped = E / 2, E / (2 - gap)
    pulled = np.array([0, 10, 20]) * k_bolt / (k_bolt + k_clamped)
    np.testing.assert_allclose([bolt.force for bolt, *_ in steps[:2]], 10 + pulled[:2], rtol=1e-9)
    np.testing.assert_allclose([-f for _, f, *_ in steps[:2]], pulled[:2] + 10 - [0, 10], atol=1e-8)


def test_two_sections_in_one_shank_are_refused():
    """Before their lock nothing holds the part between them: two forces cannot both be that of the shank."""
    bolt = block((1, 1, 3), (0, 0, 0), (1, 1, 3), "HEXA8")
    groups = {"foot": skin(*bolt, level(2, 0)), "end": skin(*bolt, level(2, 3))}
    mesh = join([(*bolt, {**groups, **{f"s{k}": inner(*bolt, level(2, k)) for k in (1, 2)}})])
    case = Case(
        model="3d", material=Material(young=E, poisson=0.0),
        displacement=[Displacement(group=name, ux=0, uy=0, uz=0) for name in ("foot", "end")],
        pretension=[Pretension(group=f"s{k}", force=[[0, 0], [1, 5.0 + 3 * k]], lock=1.0) for k in (1, 2)],
        steps=Steps(end=2.0, count=2),
    )  # fmt: skip
    with pytest.raises(DataError, match=r"nothing holds a part of the model: the body .* moves along z"):
        ls.solve(case, mesh)


def test_the_lock_holds_after_a_cutback_and_a_restart(tmp_path):
    """A run to the middle and on from there is the run in one go, to the last bit; and the files have the bolt."""
    mesh = joint("HEXA8")
    path = tmp_path / "joint.msh"
    lacmesh.write(path, mesh)
    whole = replace(tightened(mesh, force=[[0, 0], [1, 10]], lock=1.0), mesh=path)
    assert run(whole, create_output(tmp_path / "whole")).status == "done"
    first = replace(whole, steps=Steps(times=STEPS[:2]))
    run(first, create_output(tmp_path / "parts"))
    run(whole, create_output(tmp_path / "parts", force=True), start=read_state(tmp_path / "parts", whole))
    one, two = (json.loads((tmp_path / name / "results.json").read_text()) for name in ("whole", "parts"))
    assert one["pretension"] == two["pretension"] and set(one["pretension"]["shank"]) == {
        "force", "shortening", "moment", "resultant",
    }  # fmt: skip
    forces = [step["pretension"]["shank"]["force"] for step in one["steps"]]
    np.testing.assert_allclose(forces, LOCKED, rtol=1e-10)
    columns = table(tmp_path / "whole" / "history.csv")
    np.testing.assert_allclose(columns["pretension.shank.force"], forces, rtol=1e-12)
    assert "pretension.shank.moment.x" in columns


# ---- forces across the bolt, and moments


def beam(kind, tall=6, halves=False):
    """A bolt alone, 1 wide and 3 high, with a section at the height 1."""
    linear, order = SOLIDS[kind]
    d = CELLS[linear].dim
    up = d - 1
    if halves:
        low = block((2,) * up + (2,), (0,) * d, (1,) * up + (1,), linear)
        high = block((3,) * up + (4,), (0,) * up + (1,), (1,) * up + (3,), linear)
        mesh = join([
            (*low, {"foot": skin(*low, level(up, 0)), "shank_a": skin(*low, level(up, 1))}),
            (*high, {"end": skin(*high, level(up, 3)), "shank_b": skin(*high, level(up, 1))}),
        ])  # fmt: skip
    else:
        bolt = block((2,) * up + (tall,), (0,) * d, (1,) * up + (3,), linear)
        groups = {"foot": skin(*bolt, level(up, 0)), "end": skin(*bolt, level(up, 3))}
        mesh = join([(*bolt, {**groups, "shank": inner(*bolt, level(up, 1))})])
    return lacmesh.raise_order(mesh, order) if order else mesh


def bent(mesh, kinematics="small", **keys):
    d = mesh.space_dim
    pull = dict(zip(("tx", "ty", "tz"), (0.3, 0.2, 5.0) if d == 3 else (0.3, 5.0), strict=False))
    law = "elastic" if kinematics == "small" else "neo_hookean"
    return Case(
        model="3d" if d == 3 else "plane_strain",
        kinematics=kinematics,
        material=Material(young=E, poisson=0.3, law=law),
        displacement=Displacement(group="foot", **dict.fromkeys(("ux", "uy", "uz")[:d], 0.0)),
        traction=Traction(group="end", **pull),
        pretension=Pretension(group="shank", **{"shortening": 0.01, **keys}),
    )


@pytest.mark.parametrize("kind, halves", each_option(itertools.product(KINDS, (False, True))))
def test_moments_of_a_bent_bolt(kind, halves):
    """The section carries what acts beyond it: 5 along the bolt, 0.3 and 0.2 across it with an arm of 2."""
    mesh = beam(kind, halves=halves)
    problem = Problem.of(bent(mesh), mesh)
    *_, state = ls.equilibrium.stepping.march(problem)
    bolt = step_figures(problem, state).pretension["shank"]
    assert bolt.force == pytest.approx(5.0, rel=1e-10) and bolt.shortening == pytest.approx(0.01, rel=1e-10)
    sign = np.sign(problem.sections[0].normal[-1])  # side a is below or above
    if mesh.space_dim == 2:
        np.testing.assert_allclose(sign * bolt.resultant, [0.3, 5.0], rtol=1e-9)
        assert sign * bolt.moment == pytest.approx(-0.6, rel=1e-9)
    else:
        np.testing.assert_allclose(sign * bolt.resultant, [0.3, 0.2, 5.0], rtol=1e-9)
        np.testing.assert_allclose(sign * bolt.moment, [-0.4, 0.6, 0.0], atol=1e-9)


@pytest.mark.parametrize("halves", [False, True])
def test_a_bolt_with_large_displacements(halves):
    """The force is in balance; the moment has the arm of the deformed bolt."""
    mesh = beam("HEXA8", halves=halves)
    problem = Problem.of(bent(mesh, "finite"), mesh)
    *_, state = ls.equilibrium.stepping.march(problem)
    bolt, section = step_figures(problem, state).pretension["shank"], problem.sections[0]
    sign = np.sign(section.normal[2])
    np.testing.assert_allclose(sign * bolt.resultant, [0.3, 0.2, 5.0], rtol=1e-8)
    assert np.isclose(bolt.shortening, 0.01, rtol=1e-10)
    x = mesh.points if not halves else problem.space.mesh.points
    x = problem.space.mesh.points + state.u.reshape(-1, 3)
    f = problem.load(1.0, state.u).reshape(-1, 3)
    centre = x[section.nodes].mean(axis=0)
    np.testing.assert_allclose(sign * bolt.moment, np.cross(x - centre, f).sum(axis=0), atol=2e-2)


def test_a_bolt_in_axisymmetry():
    """The force of the full circle, p A, and no moment."""
    mesh = beam("QUAD8")
    case = Case(
        model="axisymmetric", material=Material(young=E, poisson=0.3),
        displacement=Displacement(group="foot", ux=0, uy=0), pressure=Pressure(group="end", value=-2.0),
        pretension=Pretension(group="shank", shortening=0.01),
    )  # fmt: skip
    problem = Problem.of(case, mesh)
    *_, state = ls.equilibrium.stepping.march(problem)
    bolt = step_figures(problem, state).pretension["shank"]
    assert bolt.force == pytest.approx(2 * np.pi, rel=1e-10) and bolt.moment is None


def test_the_normal_is_an_axis_whatever_its_length_and_sign():
    mesh = joint("HEXA8")
    forces = []
    for normal in (None, (0, 0, 1), (0, 0, -3), (0, 0.1, 1)):
        keys = {} if normal is None else {"normal": normal}
        forces.append(marched(tightened(mesh, force=[[0, 0], [1, 10]], lock=1.0, **keys), mesh)[1][0].force)
    np.testing.assert_allclose(forces[:3], 15.0, rtol=1e-10)
    assert abs(forces[3] - 15) > 1e-3


@pytest.mark.parametrize("spec", ["7", "2:7", "entity:2:3"])
def test_a_section_may_be_named_by_its_tag(spec):
    mesh = joint("HEXA8")
    entity = np.full((mesh.n_cells, 2), -1)
    entity[mesh.cell_groups["shank"]] = 2, 3
    mesh = replace(mesh, group_tags={"shank": ((2, 7),)}, cell_data={"entity": entity})
    case = tightened(mesh, force=[[0, 0], [1, 10]], lock=1.0)
    case = replace(case, pretension=Pretension(group=spec, name="bolt", force=[[0, 0], [1, 10]], lock=1.0))
    np.testing.assert_allclose([bolt.force for bolt, *_ in marched(case, mesh)], LOCKED, rtol=1e-10)


@pytest.mark.parametrize("lock", [None, 0.5])
def test_a_bolt_in_motion_swings_about_its_force(lock):
    """A static start tightens it; then an end is let go on its own, and the section holds its force or its length."""
    mesh = beam("HEXA8")
    case = replace(
        bent(mesh), traction=(), material=Material(young=E, poisson=0.0, density=1e-3), steps=Steps(count=40, end=1.0),
        displacement=[
            Displacement(group="foot", ux=0, uy=0, uz=0),
            Displacement(group="end", ux=0, uy=0, uz="where(t > 0.5, 1e-3, 0)"),
        ],
        pretension=Pretension(group="shank", force=[[0, 0], [0.4, 5]], lock=lock), dynamics=Dynamics(start=0.5),
    )  # fmt: skip
    forces = [solution.pretension["shank"] for solution in ls.march(case, mesh)]
    assert forces[19].force == pytest.approx(5.0, rel=1e-9)
    late = np.array([bolt.force for bolt in forces[20:]])
    if lock is None:
        np.testing.assert_allclose(late, 5.0, rtol=1e-8)
    else:
        np.testing.assert_allclose(late, 5 + E * 1e-3 / 3, atol=0.05)
        np.testing.assert_allclose([bolt.shortening for bolt in forces[20:]], forces[19].shortening, rtol=1e-9)


def test_a_mesh_that_is_split_and_cut_before_is_the_same():
    mesh = joint("HEXA8")
    case = tightened(mesh, force=[[0, 0], [1, 10]], lock=1.0)
    before = lacmesh.cut_skin(lacmesh.split(mesh, "shank"), "slave").mesh
    assert [b.force for b, *_ in marched(case, before)] == [b.force for b, *_ in marched(case, mesh)]


# ---- sections that are none


def problems(mesh, **keys):
    case = replace(bent(mesh), pretension=Pretension(**{"group": "shank", "force": 1.0, **keys}))
    with pytest.raises(CaseError) as caught:
        Problem.of(case, mesh)
    told = [str(issue) for issue in validate(case, mesh).problems]
    assert any(str(caught.value) in one or one in str(caught.value) for one in told)
    return str(caught.value)


def test_sections_that_are_refused():
    mesh = beam("HEXA8")
    assert "no cell group named 'shnk'; did you mean shank?, and no two skins 'shnk_a' and 'shnk_b'" in problems(
        mesh, group="shnk"
    )
    assert "the body is not divided: faces" in problems(mesh, group="end")
    assert "normal lies in the section, whose own is [0, 0, " in problems(mesh, normal=(1, 0, 0))
    cells = mesh.cell_groups["shank"]
    x = np.array([mesh.points[nodes].mean(axis=1)[:, 0] for _, _, nodes in mesh.select(cells)])[0]
    part = replace(mesh, cell_groups={**mesh.cell_groups, "part": cells[x < 0.5]})
    assert "its sides share nodes" in problems(part, group="part")
    pair = replace(mesh, cell_groups={**mesh.cell_groups, "far_a": mesh.cell_groups["end"], "far_b": cells})
    assert "do not lie on the surface of a body" in problems(pair, group="far")
    cut = lacmesh.cut_skin(mesh, "end").mesh
    assert "split the mesh before it is cut" in problems(cut)


def test_the_command_lists_the_bolt(tmp_path, capsys):
    from lacsolver.cli import main

    mesh = joint("QUAD4")
    lacmesh.write(tmp_path / "joint.msh", mesh)
    replace(tightened(mesh, force=10.0), mesh=tmp_path / "joint.msh").write(tmp_path / "joint.toml")
    assert main(["validate", str(tmp_path / "joint.toml")]) == 0
    assert "force = 10, ramped" in " ".join(capsys.readouterr().out.split())
    assert parse_case((tmp_path / "joint.toml").read_text()).pretension[0].force.at(4.0) == 10.0


def test_the_whole_body_is_back_without_a_shortening():
    """A section with a shortening of 0 is none: displacements as without it."""
    mesh = beam("PENTA15")
    case = bent(mesh, shortening=0.0)
    with_section, without = ls.solve(case, mesh), ls.solve(replace(case, pretension=()), mesh)
    np.testing.assert_allclose(with_section.u[: mesh.n_nodes], without.u, atol=1e-13)
    assert isinstance(with_section.mesh, Mesh)
