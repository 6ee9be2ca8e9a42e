"""Two surfaces of which a rule chooses the slave: each rule, in every unit, numbering and order of their names."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh.generate import rectangle, stack
from lacsolver.case import Contact, Material, Rigid, Tie, fingerprint
from lacsolver.cli import main
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import Problem
from lacsolver.problem.roles import with_roles
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.invariant_cases import permuted
from tests.problems import case_of, fix, move

GROUND, PUSH = fix("bottom", "xy"), move("top", ux=0.0, uy=-0.01)


def blocks(upper=4, lower=2, wide=1.0):
    """Two blocks in a plane: `a` is the lower's skin, `b` the upper's; `wide`: how wide the upper one is."""
    mesh = stack(rectangle(lower), rectangle(upper, (wide, 1.0)).moved(((1 - wide) / 2, 0, 0)))
    return mesh.renamed(master="a", slave="b")


def case(mesh, surfaces=("a", "b"), young=(1.0, 1.0), supports=(GROUND, PUSH), kind=Contact, **keys):
    """A case on the blocks; `keys`: of its contact."""
    materials = [Material(groups=[g], young=e, poisson=0.3) for g, e in zip(("lower", "upper"), young, strict=True)]
    joint = kind(**({"surfaces": surfaces} if surfaces else {}), **keys)
    return case_of(mesh, *materials, joint, *supports, model="plane_strain")


def chosen(own, mesh):
    roles = with_roles(own, mesh)
    (record,) = roles.contact or roles.tie
    assert {record.slave, record.master} == {"a", "b"} and record.name == record.slave
    return record.slave, record.why


RULES = {
    "free": ({"supports": (GROUND, replace(PUSH, group="upper"))}, blocks(), "a", "displacement of 'b' is prescribed"),
    "rigid": ({"supports": (GROUND, Rigid(group="upper", uy=-0.01))}, blocks(), "a", "that of a rigid body"),
    "few": ({"young": (1.0, 0.5)}, blocks(1, 4), "a", "'b' has few faces, 1"),
    "covered": ({"young": (1.0, 2.0)}, blocks(3, 8, wide=0.4), "b", "it faces the other with its whole area"),
    "softer": ({"young": (2.0, 1.0)}, blocks(3, 5), "b", "it is softer: Young's modulus 1 beside 2"),
    "finer": ({}, blocks(4, 2), "b", "it is finer"),
    "alike": ({}, blocks(3, 3), "a", "its name comes first"),
    "of a tie": ({"kind": Tie}, blocks(4, 2), "b", "it is finer"),
    "held at a side": (
        {"young": (2.0, 1.0), "supports": (GROUND, PUSH, fix("left", "x"))}, blocks(3, 3), "b", "it is softer",
    ),
    "cut": ({}, lacmesh.cut_skin(blocks(4, 2), ["a"]).mesh, "a", "it has macro-elements in the mesh"),
    "taken": (
        {"supports": (GROUND, PUSH, Tie(slave="b", master="top"))}, blocks(4, 2), "a", "'b' is the slave of another",
    ),
}  # fmt: skip


@pytest.mark.parametrize("rule", RULES)
def test_each_rule_chooses_the_slave_and_says_why(rule):
    keys, mesh, slave, why = RULES[rule]
    own = case(mesh, **keys)
    if rule == "taken":  # beside a tie
        (record,) = with_roles(own, mesh).contact
        assert record.slave == slave and why in record.why
        return
    found = chosen(own, mesh)
    assert found[0] == slave and why in found[1]
    assert chosen(case(mesh, ("b", "a"), **keys), mesh) == found
    assert rule == "cut" or chosen(own, permuted(mesh, seed=1)[0]) == found
    assert chosen(own, replace(mesh, points=1e3 * mesh.points + np.array([5e5, -2e5, 0.0])))[0] == slave


def test_the_more_convex_of_two_like_skins_is_the_slave():
    mesh = blocks(4, 4)
    points = mesh.points.copy()
    up = mesh.nodes_on(mesh.cells_of("upper"))
    points[up, 1] += 0.05 * (2 * points[up, 0] - 1) ** 2 * (2 - points[up, 1])
    assert chosen(case(mesh), replace(mesh, points=points)) == ("b", "it is more convex")


def test_results_say_which_and_why_and_are_those_of_roles_by_hand(tmp_path):
    mesh = blocks(4, 2)
    own, by_hand = case(mesh), case(mesh, None, slave="b", master="a")
    (zone,) = validate(own).zones
    assert (zone.name, zone.slave, zone.master) == ("b", "b", "a") and zone.why.startswith("it is finer")
    results, same = (run(one, create_output(tmp_path / name)) for name, one in (("out", own), ("same", by_hand)))
    assert same.steps[-1].energy == results.steps[-1].energy
    told, by = (json.loads((tmp_path / n / "results.json").read_text())["contact"]["b"] for n in ("out", "same"))
    assert (told["slave"], told["master"], told["why"]) == ("b", "a", zone.why)
    assert by["master"] == "a" and "why" not in by
    for other in (own, by_hand, case(mesh, ("b", "a"))):
        assert read_state(tmp_path / "out", other, mesh=mesh).time == 1.0
    assert fingerprint(with_roles(own, mesh), mesh) == fingerprint(by_hand, mesh)


def test_the_commands_take_surfaces(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lacmesh.write("a.msh", blocks(4, 2))
    case("a.msh").write("case.toml")
    assert main(["validate", "case.toml"]) == 0
    assert "slave chosen" in capsys.readouterr().out
    assert main(["run", "case.toml"]) == 0
    assert "b, with master a: it is finer" in " ".join(capsys.readouterr().out.split())
    assert main(["matrices", "case.toml", "-o", "m.npz", "-q"]) == 0
    assert len(np.load("m.npz")["G"]) == 4
    (problem,) = validate(case("a.msh", ("a", "c")), blocks()).problems
    assert "contact.surfaces" in problem.message


def test_surfaces_are_taken_in_the_order_of_the_alphabet():
    own = case(blocks(4, 2), ("b", "a"), type="bilateral")
    (record,) = own.contact
    assert record.surfaces == ("a", "b") and record.slave is None and record.name is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (pair,) = Problem.of(own, own.mesh).joints
    assert (pair.name, pair.record.master, pair.record.type) == ("b", "a", "bilateral")
    assert own.skins == ("a", "b")
