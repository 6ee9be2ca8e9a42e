"""Several contacts in one mesh: each pair is examined by itself, in Python, in `check`, in `cut` and in `view`."""

import json
from dataclasses import replace

import pytest

import lacmesh
from lacmesh import Mesh, check
from lacmesh.checks.pairs import split_pairs
from lacmesh.cli import main
from lacmesh.errors import RequestError
from verification.meshes.blocks import block, joined

PAIRS = [("head", "flange"), ("base", "floor")]


def bolted():
    """A head that stands 0.7 wide on a flange, with the rest 0.5 above a floor, on which a base stands as well."""
    parts = [
        (block("QUAD4", 10, [0.0, 0.0], [1.0, 1.0]), {"y0": "head"}),
        (block("QUAD4", 7, [0.0, -1.0], [0.7, 0.0]), {"y1": "flange"}),
        (block("QUAD4", 11, [0.7, -1.5], [1.8, -0.5]), {"y1": "floor"}),
        (block("QUAD4", 6, [1.2, -0.5], [1.8, 0.5]), {"y0": "base"}),
    ]
    return joined(parts)


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
    assert partial.message.startswith("head on flange: of 10 macro-elements, 3 do not")
    assert partial.as_dict()["where"]["pair"] == ["head", "flange"] and partial.where.group == "head"
    assert [f.message.split(":")[0] for f in found.of_rule("gap")] == ["head on flange", "base on floor"]


def test_what_one_pair_has_is_no_fault_of_another():
    """Nodes that the slave of one pair shares with the master of another are told where it is its own master."""
    mesh = bolted()
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "under": mesh.cell_groups["head"][:1]})
    pairs = [*PAIRS, ("flange", "under")]
    assert not check(mesh, pairs=pairs).of_rule("shared-nodes")
    (shared,) = check(mesh, pairs=[*PAIRS, ("head", "under")]).of_rule("shared-nodes")
    assert shared.message.startswith("head on under: slave and master share")


def test_a_skin_in_two_pairs_is_told_once():
    mesh = bolted()
    pairs = [("head", "flange"), ("head", "floor")]
    found, alone = check(mesh, pairs=pairs, search_distance=1.0), check(mesh, "head", "flange")
    assert len(found.of_rule("not-cut")) == len(alone.of_rule("not-cut")) == 1
    assert [round(one["covered"], 9) for one in found.summary["pairs"]] == [0.7, 0.3]


def test_one_pair_is_a_slave_and_a_master():
    mesh = bolted()
    one, other = check(mesh, pairs=PAIRS[:1]), check(mesh, "head", "flange")
    assert one.as_dict() == other.as_dict()


def test_several_of_both_need_pairs():
    mesh = bolted()
    with pytest.raises(RequestError, match=r"2 slaves and 2 masters .* name the pairs with --pair .*pairs=\[") as told:
        check(mesh, ["head", "base"], ["flange", "floor"])
    assert str(told.value).endswith("lacmesh check IN --pair head:flange --pair base:floor")
    with pytest.raises(RequestError, match="give pairs, or slave and master"):
        check(mesh, "head", pairs=PAIRS)
    cut = lacmesh.cut_skin(mesh, ["head", "base"])
    with pytest.raises(RequestError, match="--pair"):
        check(cut, master=["flange", "floor"])
    assert check(cut, master="flange").summary["slave"] == ["head", "base"]
    assert not check(cut, pairs=PAIRS).errors


def test_a_pair_is_split_where_both_sides_are_groups():
    cells = [("SEG2", [[0, 1], [1, 2]])]
    tags = {"top": ((1, 5),), "low": ((1, 6),)}
    mesh = Mesh.create([[0, 0], [1, 0], [2, 0]], cells, cell_groups={"top": [0], "low": [1]}, group_tags=tags)
    assert split_pairs(mesh, ["top:low", "1:5:low", "1:5:1:6", "6:top"]) == [
        ("top", "low"), ("1:5", "low"), ("1:5", "1:6"), ("6", "top"),
    ]  # fmt: skip
    groups = {"a": [0], "b": [0], "a:b": [1], "b:c": [1], "c": [0]}
    named = Mesh.create([[0, 0], [1, 0], [2, 0]], cells, cell_groups=groups)
    assert split_pairs(named, ["a:b:a"]) == [("a:b", "a")]
    for given, text, says in (
        (named, "a:b:c", r"--pair a:b:c is slave 'a' with master 'b:c' or slave 'a:b' with master 'c'; name one"),
        (named, "a", "has no colon; write it as SLAVE:MASTER"),
        (named, "a:d:e", "no colon in it has a group on both sides"),
        (named, "a:", "no cell group named ''"),
        (mesh, "tip:low", "no cell group named 'tip'; did you mean top?"),
    ):
        with pytest.raises(RequestError, match=says):
            split_pairs(given, [text])


def test_entities_of_msh_are_sides_of_a_pair(fresh):
    """`entity:1:2` has colons of its own."""
    mesh = bolted()
    lacmesh.write("bolted.msh", mesh)
    mesh = lacmesh.read("bolted.msh")
    entity = f"entity:{mesh.entities[0][0]}:{mesh.entities[0][1]}"
    assert split_pairs(mesh, [f"head:{entity}", f"{entity}:head"]) == [("head", entity), (entity, "head")]


def test_the_commands_take_pairs(fresh, capsys):
    lacmesh.write("bolted.msh", bolted())
    pairs = [word for a, b in PAIRS for word in ("--pair", f"{a}:{b}")]
    assert main(["cut", "bolted.msh", *pairs, "-o", "cut.msh", "--report", "cut.html"]) == 0
    told = capsys.readouterr()
    assert "partial-coverage: head on flange: of 10 macro-elements" in told.err
    assert "head on flange: gap from" in (fresh / "cut.html").read_text()
    assert main(["check", "cut.msh", *pairs]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "pair head on flange" in out and "70 % of the slave; macro-elements: 7 whole, 0 in part, 3 not" in out
    assert main(["check", "cut.msh", *pairs, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one["covered_macro_elements"] for one in found["summary"]["pairs"]] == [7, 6]
    assert main(["view", "cut.msh", *pairs, "--check", "-o", "cut_view.html", "-q"]) == 0
    assert "head on flange" in (fresh / "cut_view.html").read_text()


@pytest.mark.parametrize("command", ["check", "cut", "view"])
def test_several_of_both_are_a_wrong_command(fresh, capsys, command):
    lacmesh.write("bolted.msh", bolted())
    groups = ["--slave", "head", "--slave", "base", "--master", "flange", "--master", "floor"]
    more = {"check": [], "cut": ["-o", "cut.msh"], "view": ["--check", "-o", "page.html"]}[command]
    assert main([command, "bolted.msh", *groups, *more]) == 2
    told = capsys.readouterr().err
    assert f"lacmesh {command} bolted.msh --pair head:flange --pair base:floor" in told
    assert not (fresh / "cut.msh").exists() and not (fresh / "page.html").exists()
    assert main([command, "bolted.msh", "--pair", "head:flange", "--master", "floor", *more]) == 2
    assert "leave out --slave and --master" in capsys.readouterr().err
    if command != "view":
        assert main([command, "bolted.msh", *more]) == 2
        assert "give --slave GROUP, or --pair SLAVE:MASTER" in capsys.readouterr().err
