"""Supports that begin late: a bar in closed form, its reactions, a restart, and supports that are refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshError
from lacsolver.case import Case, CaseError, Contact, Displacement, Dynamics, Material, Rigid, Steps, Traction
from lacsolver.output import create_output
from lacsolver.output.states import read_state
from lacsolver.running import run
from lacsolver.validation import validate
from tests.checks.blocks import block, join, skin

E = 1000.0
#: force per area that pulls the bar: 10 at t = 1, 30 at t = 2; its length and section are 1
PULL = [[0, 0], [1, 10], [2, 30]]


def ends(low=0.0, kind="HEXA8", names=("left", "right")):
    """A cube from x = low on, as (points, cells, skins), with the names of its faces across x, and `side` at y = 0."""
    d = CELLS[kind].dim
    made = block((2,) * d, (low, *[0] * (d - 1)), (low + 1, *[1] * (d - 1)), kind)
    faces = {
        name: skin(*made, lambda x, at=at: abs(x[..., 0] - at) < 1e-9)
        for name, at in zip(names, (low, low + 1), strict=True)
    }
    return (*made, faces | {"side": skin(*made, lambda x: abs(x[..., 1]) < 1e-9)})


def bar(kinematics="small", kind="HEXA8", **late):
    """(case, mesh): a bar that is pulled, whose end is held from t = 1 on."""
    mesh = join([ends(kind=kind)])
    d = mesh.space_dim
    held = {name: 0.0 for name in ("ux", "uy", "uz")[:d]}
    law = {} if kinematics == "small" else {"law": "saint_venant_kirchhoff"}
    case = Case(
        model="3d" if d == 3 else "plane_stress", kinematics=kinematics, material=Material(young=E, poisson=0.0, **law),
        displacement=[Displacement(group="left", **held), Displacement(group="right", begin=1.0, **late)],
        traction=Traction(group="right", tx=PULL), steps=Steps(times=(0.5, 1.5, 2.0)),
    )  # fmt: skip
    return case, mesh


def ways(case, mesh):
    """[(time, displacement of the end, its reaction)] of all steps: all nodes of the end move alike."""
    out = []
    for solution in ls.march(case, mesh):
        right = mesh.nodes_on(mesh.cells_of("right"))
        along = solution.u[right, 0]
        np.testing.assert_allclose(along, along.mean(), rtol=1e-9, atol=1e-12)
        force = solution.figures.reactions["right"][0]
        assert solution.reaction[right, 0].sum() == pytest.approx(force, abs=1e-9)
        out.append((solution.time, along.mean(), force))
    return np.array(out)


@pytest.mark.parametrize("kind", ["HEXA8", "QUAD4"])
@pytest.mark.parametrize(
    "late, moved",
    [
        ({"ux": 0.0}, [0.01, 0.01]),
        ({"ux": [[0, 0.3], [1, 0.3], [2, 0.35]]}, [0.035, 0.06]),
        ({"ux": 0.05}, [0.035, 0.06]),
        ({"ux": 0.0, "reached": 2.0}, [0.005, 0.0]),
        ({"ux": 0.05, "reached": 1.5}, [0.025, 0.05]),
        ({"uy": 0.01, "axes": {"x": [0, 1], "xy": [-1, 0]}}, [0.005, 0.0]),
    ],
)
def test_an_end_is_held_where_it_is_or_goes_to_the_value(kind, late, moved):
    """Free, u = F / E; held, the support takes what the bar's stiffness does not: R = E u - F."""
    if kind == "HEXA8" and "axes" in late:
        late = late | {"axes": {name: [*row, 0] for name, row in late["axes"].items()}}
    steps = ways(*bar(kind=kind, **late))
    np.testing.assert_allclose(steps[:, 0], [0.5, 1.0, 1.5, 2.0], rtol=1e-12)
    np.testing.assert_allclose(steps[:, 1], [0.005, 0.01, *moved], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(steps[:, 2], [0, 0, E * moved[0] - 20, E * moved[1] - 30], rtol=1e-9, atol=1e-9)


def test_with_large_strains():
    """S = E (l^2 - 1) / 2, force l S; the support holds the end where the first force took it."""
    steps = ways(*bar("finite", ux=0.0))
    stretch = 1 + steps[1, 1]
    assert stretch * E * (stretch**2 - 1) / 2 == pytest.approx(10, rel=1e-9)
    np.testing.assert_allclose(steps[2:, 1], steps[1, 1], rtol=1e-12)
    np.testing.assert_allclose(steps[2:, 2], [-10, -20], rtol=1e-8)


def test_a_restart_is_the_run_in_one_go(tmp_path):
    case, mesh = bar(ux=0.0)
    path = tmp_path / "bar.msh"
    lacmesh.write(path, mesh)
    whole = replace(case, mesh=path)
    run(whole, create_output(tmp_path / "whole"))
    run(replace(whole, steps=Steps(times=(0.5, 1.5))), create_output(tmp_path / "parts"))
    run(whole, create_output(tmp_path / "parts", force=True), start=read_state(tmp_path / "parts", whole))
    one, two = (json.loads((tmp_path / name / "results.json").read_text()) for name in ("whole", "parts"))
    one, two = ([step["reactions"] for step in results["steps"]] for results in (one, two))
    np.testing.assert_allclose(one[-1]["right"], two[-1]["right"], rtol=1e-12)
    assert one[-1]["right"][0] == pytest.approx(-20, rel=1e-9)


def pushed(**keys):
    """(case, mesh): a block pressed on another one; nothing else holds it along x from the start."""
    mesh = join([ends(), ends(1.0, names=("slave", "far"))])
    zero = {"uy": 0.0, "uz": 0.0}
    case = Case(
        model="3d", material=Material(young=E, poisson=0.0), contact=Contact(slave="slave", master="right"),
        displacement=[Displacement(group="left", ux=0.0, **zero), Displacement(group="far", **zero),
                      Displacement(group="far", ux=0.0, begin=1.0)],
        traction=Traction(group="far", tx=[[0, 0], [1, -10], [2, 10]]), steps=Steps(times=(1.0, 2.0)), **keys,
    )  # fmt: skip
    return case, mesh


def test_contact_holds_a_body_until_its_support_begins():
    """The blocks shorten by 2 F / E; the support then keeps the far end, and takes the change of the load."""
    case, mesh = pushed()
    assert any("moves along x" in words for words in validate(case, mesh).held)
    first, last = ls.march(case, mesh)
    far = mesh.nodes_on(mesh.cells_of("far"))
    for solution in (first, last):
        np.testing.assert_allclose(solution.u[far, 0], -0.02, rtol=1e-9)
    assert first.figures.reactions["far"][0] == pytest.approx(0, abs=1e-9)
    assert last.figures.reactions["far"][0] == pytest.approx(-20, rel=1e-9)
    assert last.figures.contact["slave"].resultant[0] == pytest.approx(10, rel=1e-9)


@pytest.mark.parametrize("master", ["left", "body0"])
def test_a_slave_that_is_held_late(master):
    """A slave on a free master takes what comes after; on a master that is held all, as where both are prescribed."""
    case, mesh = pushed()
    zero = {"uy": 0.0, "uz": 0.0}
    supports = [
        Displacement(group=master, ux=0.0, **zero),
        Displacement(group="far", **zero),
        Displacement(group="slave", ux=0.0, uy=0.0, begin=1.0),
    ]
    load = Traction(group="far", tx=[[0, 0], [1, -10], [2, -20]])
    first, last = ls.march(replace(case, displacement=supports, traction=load), mesh)
    assert first.figures.contact["slave"].resultant[0] == pytest.approx(10, rel=1e-9)
    carried = 10.0 if master == "left" else 0.0
    assert last.figures.contact["slave"].resultant[0] == pytest.approx(carried, abs=1e-8)
    assert last.figures.reactions["slave"][0] == pytest.approx(20 - carried, rel=1e-9)


def test_a_support_that_does_not_hold_yet_holds_nothing():
    case, mesh = pushed()
    alone = replace(case, contact=())
    problems = [issue.message for issue in validate(alone, mesh).problems]
    assert len(problems) == 1 and "nothing holds a part of the model" in problems[0]
    with pytest.raises(LacmeshError, match="nothing holds a part of the model"):
        ls.solve(alone, mesh)


def shared(*records):
    """A bar whose `records` begin late, marched to its end."""
    case, mesh = bar(ux=0.0)
    return list(ls.march(replace(case, displacement=[case.displacement[0], *records]), mesh))[-1]


def test_supports_that_agree_on_shared_nodes():
    """Nodes of the end and of the side have the same condition twice, or one that holds from the start."""
    end, side = Displacement(group="right", ux=0.0, begin=1.0), Displacement(group="side", ux=0.0, begin=1.0)
    one, both = shared(end), shared(end, side)
    total = sum(both.figures.reactions[name][0] for name in ("left", "right", "side"))
    assert total == pytest.approx(-30, rel=1e-9)
    assert one.figures.reactions["right"][0] == pytest.approx(-20, rel=1e-9)
    fixed = Displacement(group="side", uy=0.0)
    again = shared(end, fixed, Displacement(group="right", uy=0.0, begin=0.5))
    assert again.figures.reactions["right"][0] == pytest.approx(-20, rel=1e-9)


@pytest.mark.parametrize(
    "record, words",
    [
        (Displacement(at=(1, 0.5, 0.5), ux=0.01, begin=1.0), r"node \d+ has its ux by displacement 'right' too"),
        (Displacement(group="side", ux=0.0, begin=1.5), r"node \d+ has its ux by displacement 'right' too"),
        (Displacement(group="side", ux=0.01, begin=1.0), r"contradicts displacement 'left', which holds node \d+"),
    ],
)
def test_supports_that_contradict(record, words):
    with pytest.raises(CaseError, match=words):
        shared(Displacement(group="right", ux=0.0, begin=1.0), record)


def test_nodes_of_a_rigid_body_are_refused():
    case, mesh = bar(ux=0.0)
    with pytest.raises(CaseError, match=r"prescribes ux of nodes .*, which rigid 'right' moves"):
        ls.solve(
            replace(
                case,
                displacement=[*case.displacement[:1], Displacement(group="side", ux=0.0, begin=1.0)],
                rigid=Rigid(group="right", fx=0.0),
            ),
            mesh,
        )


@pytest.mark.parametrize(
    "keys, more, words",
    [
        ({"begin": 2.0}, {}, "is 2, and the steps end at 2; let it begin before"),
        ({"reached": 1.0}, {}, "means something only with begin"),
        ({"begin": 1.0, "reached": 1.0}, {}, "is 1, and it begins at 1; take a later time"),
        ({"begin": 1.0}, {"dynamics": Dynamics(start=0.5)}, r"\[dynamics\] starts at 0.5: what moves would stop"),
    ],
)
def test_times_that_are_refused(keys, more, words):
    case, _ = bar(ux=0.0)
    with pytest.raises(CaseError, match=words):
        replace(case, displacement=[case.displacement[0], Displacement(group="right", ux=0.0, **keys)], **more)
