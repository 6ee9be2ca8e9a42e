"""The check: each broken mesh is named by its rule; records, places, crossing faces; pairs; the page and commands."""

import json
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin
from lacmesh.cells import CELLS, PIECES
from lacmesh.checks import RULES, check
from lacmesh.checks.bodies import _on_sides, _unexplained, crossing, inside_edges, pieces_of, same_place
from lacmesh.checks.request import split_pairs
from lacmesh.errors import RequestError
from lacmesh.generate import rectangle
from lacmesh.topology.skin import Faces
from tests import REPOSITORY
from tests.checks.blocks import two_blocks
from tests.checks.corpus import CORPUS, HALVES
from tests.meshes import pad
from tests.samples import samples


@pytest.mark.parametrize("name", CORPUS)
def test_one_defect_is_named_and_no_other(name):
    case = CORPUS[name]
    found = check(case.make(), **case.asked)
    own = found.of_rule(case.rule)
    assert {f.rule for f in found.errors + found.warnings} - {case.rule} == {*case.also} and own
    assert (sum(len(f.cells) for f in own) or sum(len(f.nodes) for f in own)) == case.count
    for f in found:
        assert f.severity == RULES[f.rule].severity
        assert f.message and f.message[-1] != "."
    json.dumps(found.as_dict(), allow_nan=False)


def test_the_corpus_covers_every_rule():
    always = {"bodies", "internal-dof", "gap"}  # said of healthy meshes
    assert set(RULES) - {case.rule for case in CORPUS.values()} == always | {"not-checked"}


# ---- records that no cut produces

NODES = "lac_internal names nodes"
FAULTS = {
    "an_internal_dof_recorded_at_a_vertex": {NODES},
    "an_internal_dof_recorded_at_a_vertex_of_the_rim": {NODES},
    "dofs that are not recorded": {"lac_internal names no node"},
    "all are the first": {"lac_child does not"},
    "macro_elements_of_two_bodies_with_one_number": {"are not connected", "in several zones", "lac_child does not"},
    "a_macro_element_in_two_zones": {"in several zones"},
    "a huge number": {"lac_macro does not"},
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_of_records_is_told_apart_in_the_numbers_of_the_file(name):
    case = CORPUS[name]
    mesh = case.make()
    mesh = replace(mesh, cell_number=mesh.cell_number + 1000, node_number=mesh.node_number + 5000)
    found = check(mesh, **case.asked).of_rule("broken-records")
    every = set().union(*FAULTS.values())
    assert {fault for fault in every for f in found if fault in f.message} == FAULTS[name]
    for f in found:
        numbers = f.nodes if NODES in f.message else f.cells
        assert numbers and min(numbers) > (5000 if f.nodes else 1000)
        assert str(numbers[0]) in f.message


def test_some_zones_may_be_asked_for_also_of_neighbours():
    meshes = [(two_blocks(kind, reach=0.2), ("master", "slave")) for kind in ("TRIA6", "QUAD4", "TETRA4", "HEXA20")]
    for mesh, zones in (*meshes, (two_blocks("HEXA20", n=4).with_groups(**HALVES), ("left", "right"))):
        cut = cut_skin(mesh, zones).mesh
        for asked in (*zones, zones):
            assert not check(cut, asked).of_rule("broken-records")


# ---- nodes at one place


@pytest.mark.parametrize("seed", range(5))
def test_places_are_those_of_every_pair_compared(seed):
    random = np.random.default_rng(seed)
    x = random.choice(random.integers(0, 4, (60, 3)).astype(float), 200) * 1e3
    x += random.uniform(-1, 1, x.shape) * 1e-7
    label = same_place(x, 1e-6)
    near = np.abs(x[:, None] - x).max(axis=2) <= 1e-6
    assert np.array_equal(label[:, None] == label, near)
    assert near.sum() > len(x)


@pytest.mark.parametrize("with_master", [False, True])
def test_unexplained_nodes_are_those_of_the_unexplained_pairs(with_master):
    random = np.random.default_rng(7)
    n = 600
    place, body = random.integers(0, 150, n), random.integers(0, 3, n)
    sides = [SimpleNamespace(nodes=np.flatnonzero(random.random(n) < 0.4)) for _ in range(1 + with_master)]
    subject = SimpleNamespace(
        mesh=SimpleNamespace(n_nodes=n), bodies=body, slave=sides[0], master=(*sides, None)[1], sides=sides
    )
    a, b = np.nonzero(np.triu(place[:, None] == place, 1))
    keep = ~_on_sides(subject, a, b)
    a, b = a[keep], b[keep]
    again, torn = _unexplained(subject, np.arange(n), place)
    assert np.array_equal(np.flatnonzero(again), np.unique([a, b]))
    same = body[a] == body[b]
    assert np.array_equal(np.flatnonzero(torn), np.unique([a[same], b[same]]))
    assert 0 < torn.sum() < again.sum() < n


def test_a_stray_node_does_not_bring_the_others_together():
    mesh = two_blocks("TETRA4", reach=0.2)
    points = mesh.points.copy()
    points[0] = 1e14
    assert "coincident-nodes" not in check(replace(mesh, points=points), "slave", "master").rules


@pytest.mark.slow
def test_thousands_of_nodes_at_one_place():
    n = 4000
    turn = np.linspace(0, 1, n + 1)[:-1] * 0.5 * np.pi
    rings = [np.stack([np.cos(turn + more), np.sin(turn + more)], axis=1) for more in (0, 1e-4)]
    cells = np.arange(3 * n).reshape(3, n).T
    blocks = [("TRIA3", cells), ("SEG2", cells[:1, 1:])]
    mesh = Mesh.create(np.concatenate([np.zeros((n, 2)), *rings]), blocks, cell_groups={"slave": [n]})
    (finding,) = check(mesh, "slave").of_rule("coincident-nodes")
    assert len(finding.nodes) == n and "1 point " in finding.message


def test_every_node_of_a_place_inside_an_edge_is_found():
    points = np.array([[0, 0, 0], [2, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0.5, 0, 0]])
    subject = SimpleNamespace(mesh=SimpleNamespace(points=points), finite=np.ones(6, bool))
    node, edge = inside_edges(subject, np.arange(6), np.array([0, 0]), np.array([1, 2]))
    assert sorted(zip(node.tolist(), edge.tolist(), strict=True)) == [(2, 0), (4, 0), (5, 0), (5, 1)]
    node, edge = inside_edges(subject, np.arange(0), np.array([0]), np.array([1]))
    assert not len(node) and not len(edge)


# ---- faces that cross


def enters(x, other):
    """(k,): True where an edge of pieces x (k, m, 3) meets the inside of other ones, by the equations of that point."""
    m = x.shape[1]
    out = np.zeros(len(x), bool)
    for k in range(m if m == 3 else 1):
        start, stop = x[:, k, :m], x[:, (k + 1) % m, :m]
        columns = np.concatenate([(start - stop)[:, None], other[:, 1:, :m] - other[:, :1, :m]], axis=1)
        right = (start - other[:, 0, :m])[..., None]
        t, *u = np.linalg.solve(columns.transpose(0, 2, 1), right)[..., 0].T
        out |= (t >= 0) & (t <= 1) & (np.min(u, axis=0) > 0) & (np.sum(u, axis=0) < 1)
    return out


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(samples(1, 4)))
@pytest.mark.parametrize("kinds", [("SEG2", "SEG3"), ("TRIA3", "QUAD4"), ("TRIA6", "QUAD8"), ("TRIA7", "QUAD9")])
def test_faces_that_cross_are_those_of_all_pieces_compared(kinds, seed):
    rng = np.random.default_rng(seed)
    parts, points = [], []
    for kind in kinds:
        x = pad(CELLS[kind].reference) + rng.normal(0, 0.05, (15, CELLS[kind].n_nodes, 3))
        x = x @ np.linalg.qr(rng.normal(size=(15, 3, 3)))[0] + rng.uniform(0, 6, (15, 1, 3))
        parts.append((kind, sum(map(len, points)) + np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])))
        points.append(x.reshape(-1, 3))
    x = np.concatenate(points) * (np.array([1, 1, 0]) if kinds[0] == "SEG2" else 1)
    faces = Faces.join(parts)
    nodes, face = pieces_of(faces)
    i, j = np.array([pair for pair in combinations(range(len(face)), 2) if face[pair[0]] != face[pair[1]]]).T
    both = enters(x[nodes[i]], x[nodes[j]]) | (enters(x[nodes[j]], x[nodes[i]]) if nodes.shape[1] == 3 else False)
    expected = np.unique(np.sort(np.stack([face[i], face[j]], axis=1)[both], axis=1), axis=0)
    assert np.array_equal(crossing(x, faces), expected)
    assert 0 < len(expected) < 400


def test_neighbours_do_not_cross_and_a_copy_does():
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.2], [0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    assert not len(crossing(x, Faces.join([("TRIA3", np.array([[0, 1, 2], [2, 1, 3]]))])))
    assert crossing(x, Faces.join([("TRIA3", np.array([[0, 1, 2], [4, 5, 6]]))])).tolist() == [[0, 1]]
    assert set(PIECES) == {name for name, cell in CELLS.items() if cell.dim in (1, 2)}


# ---- several contacts in one mesh

PAIRS = [("head", "flange"), ("base", "floor")]


def bolted():
    """A head that stands 0.7 wide on a flange, with the rest 0.5 above a floor, on which a base stands as well."""
    return lacmesh.join(
        rectangle(10).renamed(bottom="head"),
        rectangle(7, (0.7, 1), corner=(0, -1)).renamed(top="flange"),
        rectangle(11, (1.1, 1), corner=(0.7, -1.5)).renamed(top="floor"),
        rectangle(6, (0.6, 1), corner=(1.2, -0.5)).renamed(bottom="base"),
    ).only("body", "head", "flange", "floor", "base")


@pytest.mark.slow
def test_each_pair_is_examined_by_itself():
    """With both masters at once the head is whole, with a gap up to 0.5; alone 7 of its 10 faces have a master."""
    mesh = bolted()
    mixed = check(mesh, "head", ["flange", "floor"], search_distance=1.0).summary
    assert mixed["covered"] == pytest.approx(1.0) and mixed["gap"]["max"] == pytest.approx(0.5)
    found = check(mesh, pairs=PAIRS, search_distance=1.0)
    head, base = found.summary["pairs"]
    alone = check(mesh, "head", "flange", search_distance=1.0).summary
    assert (head["slave"], head["master"]) == PAIRS[0] and (base["slave"], base["master"]) == PAIRS[1]
    assert head["gap"] == alone["gap"] and head["covered"] == alone["covered"] == pytest.approx(0.7)
    counts = [head[f"{what}_macro_elements"] for what in ("covered", "partly_covered", "uncovered")]
    assert counts == [7, 0, 3] and base["covered"] == pytest.approx(1.0)
    assert "gap" not in found.summary and found.summary["slave"] == ["head", "base"]
    (partial,) = found.of_rule("partial-coverage")
    assert partial.message.startswith("head on flange: the master does not cover 3 of 10 macro-elements")
    assert partial.as_dict()["where"]["pair"] == ("head", "flange") and partial.where.group == "head"
    assert [f.message.split(":")[0] for f in found.of_rule("gap")] == ["head on flange", "base on floor"]
    # a skin in two pairs is told once
    found = check(mesh, pairs=[("head", "flange"), ("head", "floor")], search_distance=1.0)
    assert len(found.of_rule("not-cut")) == len(check(mesh, "head", "flange").of_rule("not-cut")) == 1
    assert [round(one["covered"], 9) for one in found.summary["pairs"]] == [0.7, 0.3]
    # one pair is a slave and a master, and a group may be a number
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "5": mesh.cell_groups["head"]})
    for slave in ("head", np.int64(5), [np.int32(5)]):
        one = check(mesh, slave, "flange").as_dict()
        name = "head" if slave == "head" else "5"
        assert one == check(mesh, pairs=[(name, "flange")]).as_dict()


def test_what_one_pair_has_is_no_fault_of_another():
    """Nodes that the slave of one pair shares with the master of another are told where it is its own master."""
    mesh = bolted()
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "under": mesh.cell_groups["head"][:1]})
    assert not check(mesh, pairs=[*PAIRS, ("flange", "under")]).of_rule("shared-nodes")
    (shared,) = check(mesh, pairs=[*PAIRS, ("head", "under")]).of_rule("shared-nodes")
    assert shared.where.pair == ("head", "under")


def test_several_of_both_need_pairs():
    mesh = bolted()
    with pytest.raises(RequestError, match="name the pairs") as told:
        check(mesh, ["head", "base"], ["flange", "floor"])
    assert str(told.value).endswith("lacmesh check IN --pair head:flange --pair base:floor")
    with pytest.raises(RequestError, match="give pairs, or"):
        check(mesh, "head", pairs=PAIRS)
    cut = cut_skin(mesh, ["head", "base"])
    with pytest.raises(RequestError, match="--pair"):
        check(cut, master=["flange", "floor"])
    assert check(cut, master="flange").summary["slave"] == ["head", "base"]
    assert not check(cut, pairs=PAIRS).errors


def test_a_pair_is_split_where_both_sides_are_groups(fresh):
    cells, x = [("SEG2", [[0, 1], [1, 2]])], [[0, 0], [1, 0], [2, 0]]
    tags = {"top": ((1, 5),), "low": ((1, 6),)}
    mesh = Mesh.create(x, cells, cell_groups={"top": [0], "low": [1]}, group_tags=tags)
    split = [("top", "low"), ("1:5", "low"), ("1:5", "1:6"), ("6", "top")]
    assert split_pairs(mesh, ["top:low", "1:5:low", "1:5:1:6", "6:top"]) == split
    named = Mesh.create(x, cells, cell_groups={"a": [0], "b": [0], "a:b": [1], "b:c": [1], "c": [0]})
    assert split_pairs(named, ["a:b:a"]) == [("a:b", "a")]
    for given, text, says in (
        (named, "a:b:c", "name one"), (named, "a", "has no colon"), (named, "a:d:e", "no colon in it"),
        (named, "a:", "named ''"), (mesh, "tip:low", "did you mean top"),
    ):  # fmt: skip
        with pytest.raises(RequestError, match=says):
            split_pairs(given, [text])
    lacmesh.write("bolted.msh", bolted())
    mesh = lacmesh.read("bolted.msh")
    entity = "entity:{}:{}".format(*mesh.entities[0])  # which has colons of its own
    assert split_pairs(mesh, [f"head:{entity}", f"{entity}:head"]) == [("head", entity), (entity, "head")]


# ---- the commands and the page


def test_the_commands_take_pairs(run, monkeypatch):
    lacmesh.write("bolted.msh", bolted())
    pairs = " ".join(f"--pair {a}:{b}" for a, b in PAIRS)
    said = run(f"cut bolted.msh {pairs} -o cut.msh --report cut.html")
    assert "partial-coverage: head on flange: the master does not cover 3 of 10 macro-elements" in said
    assert "head on flange: gap from" in Path("cut.html").read_text()
    out = " ".join(run(f"check cut.msh {pairs}").split())
    assert "pair head on flange" in out and "70 % of the slave; macro-elements: 7 whole, 0 in part, 3 not" in out
    found = json.loads(run(f"check cut.msh {pairs} --json"))
    assert [one["covered_macro_elements"] for one in found["summary"]["pairs"]] == [7, 6]
    plotter = Mock(wraps=lacmesh.view.plotter)
    monkeypatch.setattr(lacmesh.view, "plotter", plotter)
    run(f"view cut.msh {pairs} --check --title <pairs> -o cut_view.html -q")
    assert "<title>&lt;pairs&gt;</title>" in Path("cut_view.html").read_text()
    drawn = plotter.call_args.kwargs
    assert drawn["slave"] == [a for a, _ in PAIRS] and drawn["master"] == [b for _, b in PAIRS]
    assert any("head on flange" in finding.message for finding in drawn["findings"])


@pytest.mark.parametrize("command", ["check", "cut", "view"])
def test_several_of_both_are_a_wrong_command(run, command):
    lacmesh.write("bolted.msh", bolted())
    more = {"check": "", "cut": "-o cut.msh", "view": "--check -o page.html"}[command]
    pairs = f"lacmesh {command} bolted.msh --pair head:flange --pair base:floor"
    for words, told in (
        ("--slave head --slave base --master flange --master floor", pairs),
        ("--pair head:flange --master floor", "leave out --slave and --master"),
        *([] if command == "view" else [("", "give --slave GROUP")]),
    ):
        assert told in run(f"{command} bolted.msh {words} {more}", 2)
    assert [path.name for path in Path().iterdir()] == ["bolted.msh"]


def test_the_page_lists_every_rule():
    page = (REPOSITORY / "docs" / "check.md").read_text(encoding="utf-8")
    for severity, heading in (("error", "Errors"), ("warning", "Warnings"), ("info", "Info")):
        listed = re.search(rf"^- \*\*{heading}\.\*\*(.*?)(?=^- |^$)", page, re.MULTILINE | re.DOTALL)[1]
        assert sorted(re.findall(r"`([\w-]+)`", listed)) == sorted(
            name for name, rule in RULES.items() if rule.severity == severity
        )
