"""Two surfaces of which a rule chooses the slave: each rule, in every unit, numbering and order of their names."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacsolver.case import CaseError, Contact, fingerprint, parse_case
from lacsolver.cli import main
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import Problem
from lacsolver.problem.roles import with_roles
from lacsolver.running import run
from lacsolver.validation import validate
from verification.meshes.stacks import stack

HELD = '[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\n[[displacement]]\ngroup = "top"\nux = 0.0\nuy = -0.01\n'


def blocks(upper=4, lower=2, wide=1.0, scale=1.0):
    """Two blocks in a plane: `a` is the lower's skin, `b` the upper's; `wide`: how wide the upper one is."""
    made = stack("QUAD4", "QUAD4", 2, slave_below=False, counts=(lower, upper))
    points = made.points.copy()
    up = np.unique(np.concatenate([nodes.ravel() for _, _, nodes in made.select(made.cells_of("upper"))]))
    points[up, 0] = 0.5 + (points[up, 0] - 0.5) * wide
    groups = {{"master": "a", "slave": "b"}.get(name, name): cells for name, cells in made.cell_groups.items()}
    return lacmesh.Mesh.create(scale * points, made.blocks, cell_groups=groups, space_dim=2)


def text(surfaces=("a", "b"), young=(1.0, 1.0), supports=HELD, section="contact", more=""):
    made = 'mesh = "a.msh"\nmodel = "plane_strain"\n'
    for group, modulus in zip(("lower", "upper"), young, strict=True):
        made += f'[[material]]\ngroups = ["{group}"]\nyoung = {modulus}\npoisson = 0.3\n'
    return made + f"[[{section}]]\nsurfaces = {list(surfaces)}\n{more}{supports}"


def chosen(case, mesh):
    (record,) = with_roles(case, mesh).contact or with_roles(case, mesh).tie
    assert {record.slave, record.master} == {"a", "b"} and record.name == record.slave
    return record.slave, record.why


def renumbered(mesh, seed=1):
    """Return the same mesh with nodes and cells in another order."""
    order = np.random.default_rng(seed).permutation(mesh.n_nodes)
    place = np.argsort(order)
    made, groups, first = [], {}, 0
    new = np.empty(mesh.n_cells, int)
    for block in mesh.blocks:
        rows = np.random.default_rng(seed + 1).permutation(len(block.nodes))
        made.append((block.type, place[block.nodes[rows]]))
        new[first + rows] = first + np.arange(len(rows))
        first += len(rows)
    groups = {name: np.sort(new[cells]) for name, cells in mesh.cell_groups.items()}
    return lacmesh.Mesh.create(mesh.points[order], made, cell_groups=groups, space_dim=mesh.space_dim)


RIGID = '[[rigid]]\ngroup = "upper"\nuy = -0.01\n'
RULES = {
    "free": (text(supports=HELD.replace("top", "upper")), blocks(), "a", "the displacement of 'b' is prescribed"),
    "rigid": (text(supports=RIGID + HELD[: HELD.rindex("[[")]), blocks(), "a", "that of a rigid body"),
    "few": (text(young=(1.0, 0.5)), blocks(1, 4), "a", "'b' has few faces, 1"),
    "covered": (text(young=(1.0, 2.0)), blocks(3, 8, wide=0.4), "b", "it faces the other with its whole area"),
    "softer": (text(young=(2.0, 1.0)), blocks(3, 5), "b", "it is softer: Young's modulus 1 beside 2"),
    "finer": (text(), blocks(4, 2), "b", "it is finer"),
    "alike": (text(), blocks(3, 3), "a", "its name comes first"),
}  # fmt: skip


@pytest.mark.parametrize("rule", RULES)
def test_each_rule_chooses_the_slave_and_says_why(rule):
    said, mesh, slave, why = RULES[rule]
    found = chosen(parse_case(said), mesh)
    assert found[0] == slave and why in found[1]
    assert chosen(parse_case(said.replace("['a', 'b']", "['b', 'a']")), mesh) == found
    assert chosen(parse_case(said), renumbered(mesh)) == found
    large = replace(mesh, points=1e3 * mesh.points + np.array([5e5, -2e5, 0.0]))
    assert chosen(parse_case(said), large)[0] == slave


def test_the_more_convex_of_two_like_skins_is_the_slave():
    mesh = blocks(4, 4)
    points = mesh.points.copy()
    up = np.unique(np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cells_of("upper"))]))
    points[up, 1] += 0.05 * (2 * points[up, 0] - 1) ** 2 * (2 - points[up, 1])
    slave, why = chosen(parse_case(text()), replace(mesh, points=points))
    assert (slave, why) == ("b", "it is more convex")


def test_what_is_cut_already_is_the_slave():
    mesh = lacmesh.cut_skin(blocks(4, 2), ["a"]).mesh
    assert chosen(parse_case(text()), mesh) == ("a", "it has macro-elements in the mesh")


def test_a_tie_takes_its_roles_as_a_contact_does():
    assert chosen(parse_case(text(section="tie")), blocks(4, 2))[0] == "b"


def test_a_support_at_the_sides_of_a_surface_leaves_it_free():
    case = text(young=(2.0, 1.0), supports=HELD + '[[displacement]]\ngroup = "x0"\nux = 0.0\n')
    assert chosen(parse_case(case), blocks(3, 3))[0] == "b"


def test_results_say_which_and_why_and_are_those_of_roles_by_hand(tmp_path):
    mesh, case = blocks(4, 2), parse_case(text())
    (zone,) = validate(case, mesh).zones
    assert (zone.name, zone.slave, zone.master) == ("b", "b", "a") and zone.why.startswith("it is finer")
    results = run(case, create_output(tmp_path / "out"), mesh=mesh)
    told = json.loads((tmp_path / "out" / "results.json").read_text())["contact"]["b"]
    assert (told["slave"], told["master"], told["why"]) == ("b", "a", zone.why)
    by_hand = parse_case(text().replace("surfaces = ['a', 'b']", 'slave = "b"\nmaster = "a"'))
    same = run(by_hand, create_output(tmp_path / "same"), mesh=mesh)
    assert same.steps[-1].energy == results.steps[-1].energy
    told = json.loads((tmp_path / "same" / "results.json").read_text())["contact"]["b"]
    assert told["master"] == "a" and "why" not in told
    swapped = parse_case(text(("b", "a")))
    for other in (case, by_hand, swapped):
        assert read_state(tmp_path / "out", other, mesh=mesh).time == 1.0
    assert fingerprint(with_roles(case, mesh), mesh) == fingerprint(by_hand, mesh)


def test_the_commands_take_surfaces(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lacmesh.write("a.msh", blocks(4, 2))
    (tmp_path / "case.toml").write_text(text())
    assert main(["validate", "case.toml"]) == 0
    assert "slave chosen" in capsys.readouterr().out
    assert main(["run", "case.toml"]) == 0
    assert "b, with master a: it is finer" in " ".join(capsys.readouterr().out.split())
    assert main(["matrices", "case.toml", "-o", "m.npz", "-q"]) == 0
    assert len(np.load("m.npz")["G"]) == 4


@pytest.mark.parametrize(
    "lines, said",
    [
        ('surfaces = ["a"]', "has 1 groups; it takes two"),
        ('surfaces = ["a", "a"]', "twice"),
        ('surfaces = "a"', "takes a list of groups"),
        ('surfaces = ["a", "b"]\nslave = "a"', "stands beside"),
        ('surfaces = ["a", "b"]\nmaster = "a"', "stands beside"),
        ('slave = "a"', "needs master or surfaces"),
        ("", "needs slave or surfaces"),
    ],
)
def test_mistakes_are_told(lines, said):
    with pytest.raises(CaseError, match=said):
        parse_case(text().replace("surfaces = ['a', 'b']", lines))


def test_a_group_that_is_not_there_is_told_with_its_line():
    (problem,) = validate(parse_case(text(("a", "c"))), blocks()).problems
    assert "contact.surfaces" in problem.message and "line 11" in problem.message


def test_a_surface_is_the_slave_of_one():
    """`b` would be the slave, as it is finer, but it is that of a tie already."""
    tie = '[[tie]]\nslave = "b"\nmaster = "top"\n'
    (record,) = with_roles(parse_case(text() + tie), blocks(4, 2)).contact
    assert (record.slave, record.why) == ("a", "'b' is the slave of another")


def test_surfaces_are_taken_from_python():
    record = Contact(surfaces=("b", "a"), type="bilateral")
    assert record.surfaces == ("a", "b") and record.slave is None and record.name is None
    case = replace(parse_case(text()), contact=[record])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        problem = Problem.of(case, blocks(4, 2))
    (pair,) = problem.joints
    assert (pair.name, pair.record.master, pair.record.type) == ("b", "a", "bilateral")
    assert case.skins == ("a", "b")
