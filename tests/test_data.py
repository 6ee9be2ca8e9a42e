"""data/: its manifest, scripts and examples, a first case for a mesh; the sizes of cells and groups."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.cli import main as lacmesh_main
from lacmesh.errors import RequestError
from lacmesh.examples import CASES, MESHES, data_folder
from lacmesh.report import describe
from lacmesh.report.content import cell_sizes, group_sizes
from lacmesh.topology.orientation import analyse_orientation
from lacsolver.cli import main as lacsolver_main
from lacsolver.first_case import facing_pairs, first_case
from tests.lacsolver.bodies import PLANES, SOLIDS, body
from tests.lacsolver.patch_meshes import stack, three_blocks
from tests.viewing import DATA

README = (DATA / "README.md").read_text(encoding="utf-8")
ROWS = [
    [cell.strip() for cell in row.split("|")] for row in re.findall(r"^\| (\S+\.msh \|.*?) \|$", README, re.MULTILINE)
]
FILES = {row[0]: row[1:] for row in ROWS if len(row) == 4}


# ---- the meshes


@pytest.mark.parametrize("name", sorted(p.name for p in DATA.glob("*.msh")))
def test_the_manifest_says_what_is_there_and_bodies_are_apart_with_skins_that_turn_outward(name):
    mesh = lacmesh.read(DATA / name)
    script, nodes, cells = FILES[name]
    assert (DATA / script).is_file() and int(nodes) == mesh.n_nodes
    assert cells == ", ".join(f"{count} {kind}" for kind, count in mesh.cells_by_type.items())
    groups = {row[1]: (int(row[2]), int(row[3])) for row in ROWS if row[0] == name and len(row) == 5}
    assert groups == {g: (mesh.group_dim(g), len(ids)) for g, ids in mesh.cell_groups.items()}
    bodies = [ids for group, ids in mesh.cell_groups.items() if mesh.group_dim(group) == mesh.dim]
    first, second = (np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(ids)])) for ids in bodies)
    assert not np.intersect1d(first, second).size and len(first) + len(second) == mesh.n_nodes
    for group in {"slave", "master", "top", "bottom"} & set(mesh.cell_groups):
        assert not any(map(len, vars(analyse_orientation(mesh, mesh.cell_groups[group])).values())), group


@pytest.mark.gmsh
@pytest.mark.parametrize("name", sorted(FILES))
def test_the_scripts_still_make_them(name, tmp_path):
    """Counts of the structured parts; gmsh is free to change the others."""
    subprocess.run([sys.executable, DATA / FILES[name][0], tmp_path / name], check=True, capture_output=True)
    made, kept = lacmesh.read(tmp_path / name), lacmesh.read(DATA / name)
    assert list(made.cell_groups) == list(kept.cell_groups)
    counts = [[mesh.cells_by_type.get(kind) for kind in ("HEXA8", "QUAD4")] for mesh in (made, kept)]
    assert counts[0] == counts[1]
    assert lacmesh.cut_skin(made, "slave").n_macros == len(made.cell_groups["slave"])


def test_the_deck_is_what_its_script_makes(tmp_path):
    subprocess.run([sys.executable, DATA / "make_punch.py", tmp_path / "punch.inp"], check=True)
    assert (tmp_path / "punch.inp").read_text() == (DATA / "punch.inp").read_text()


# ---- examples


def test_every_case_and_mesh_of_the_folder_is_an_example_with_a_line_in_the_list(capsys):
    of_cases = {file for one in CASES.values() for file in one.files}
    assert {str(path.relative_to(DATA)) for path in DATA.rglob("*.toml")} <= of_cases
    named = of_cases | {file for one in MESHES.values() for file in one.files}
    kept = {str(p.relative_to(DATA)) for end in ("msh", "toml", "step", "inp") for p in DATA.rglob(f"*.{end}")}
    assert named == kept and data_folder() == DATA
    for main, examples in ((lacmesh_main, MESHES), (lacsolver_main, CASES)):
        assert main(["example"]) == 0
        assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(examples)
    assert lacsolver_main(["example", "clmp"]) == 2
    assert "did you mean clamp" in capsys.readouterr().err
    with pytest.raises(RequestError, match="did you mean"):
        lacmesh.example("clamp")


@pytest.mark.parametrize("name", [name for name, one in CASES.items() if one.files[0].endswith(".toml")])
def test_a_copied_case_has_its_mesh_beside_it(name, tmp_path, capsys):
    words = ["example", name, "-o", str(tmp_path / "new")]
    assert lacsolver_main(words) == 0
    copied = tmp_path / "new" / f"{name}.toml"
    assert ls.read_case(copied).mesh.is_file() and f"lacsolver run {copied}" in capsys.readouterr().out
    assert lacmesh.example(f"{name}.toml").read_bytes() == copied.read_bytes()
    assert lacsolver_main(words) == 2
    assert "--force" in capsys.readouterr().err
    assert lacsolver_main([*words, "--force", "-q"]) == 0 and capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.gmsh] * (name == "pin_in_lug")) for name in MESHES]
)
def test_the_command_of_a_mesh_runs(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert lacmesh_main(["example", name]) == 0
    program, *words = capsys.readouterr().out.split("next: ")[1].split()
    assert program == "lacmesh" and lacmesh_main([*words, "-q"]) == 0
    file = MESHES[name].files[0]
    assert lacmesh.example(file).read_bytes() == (tmp_path / file).read_bytes()


# ---- a first case: the skins that may touch, and a text that a case is read from


@pytest.mark.parametrize(
    ("name", "pairs"),
    [
        ("two_blocks", [("master", "slave")]),
        ("press_fit", [("master", "slave")]),
        ("disc_on_block", [("master", "slave")]),
        ("friction/clamp", [("master", "slave")]),
        ("sliding/ball", [("top_plate", "upper"), ("bottom_plate", "lower")]),
        ("sliding/ironing_3d", [("master", "slave")]),
        ("impact/dropping_ball", [("floor", "slave")]),
        ("sliding/snap_fit", []),  # the hook is far from the ledge
    ],
)
def test_a_first_case_of_an_example_has_its_pairs(name, pairs, tmp_path):
    mesh = lacmesh.read(DATA / f"{name}.msh")
    found = facing_pairs(mesh)
    assert [tuple(sorted(pair)) for pair in found] == pairs
    text = first_case(mesh, DATA / f"{name}.msh", found)
    case = ls.parse_case(text, tmp_path / "case.toml")
    assert [one.surfaces for one in case.contact] == pairs
    assert case.model == ("3d" if mesh.dim == 3 else "plane_strain")
    assert all(f"#   {group}: " in text for group in mesh.cell_groups)
    assert all(mesh.group_dim(group) == mesh.dim for one in case.material for group in one.groups or ())


@pytest.mark.parametrize(("lower", "upper", "dim"), [("QUAD4", "TRIA3", 2), ("HEXA8", "TETRA4", 3)])
def test_pairs_do_not_depend_on_place_or_units_but_on_distance(lower, upper, dim):
    mesh = stack(lower, upper, dim, gap=0.01)
    first = facing_pairs(mesh)
    assert {"slave", "master"} in [set(pair) for pair in first]
    assert facing_pairs(replace(mesh, points=1e-3 * mesh.points + np.array([5.0, -7.0, 3.0 * (dim == 3)]))) == first
    assert {"slave", "master"} not in [set(pair) for pair in facing_pairs(stack(lower, upper, dim, gap=5.0))]


def test_of_groups_within_one_another_the_smallest_are_named_and_pairs_stand_in_the_order_of_the_mesh():
    """Pairs that face each other wholly are not sorted by the round-off of their areas, nor by their names."""
    mesh = lacmesh.read(lacmesh.example("two_blocks.msh"))
    skin = np.sort(np.concatenate([mesh.cells_of("slave"), mesh.cells_of("top")]))
    wider = replace(mesh, cell_groups={"foot": skin, **mesh.cell_groups}, group_tags={})
    assert facing_pairs(wider) == [("slave", "master")]
    mesh = three_blocks()
    names = {"slave2": "b", "master2": "d", "slave1": "a", "master1": "c"}
    groups = {names[name]: mesh.cell_groups[name] for name in names}
    assert facing_pairs(replace(mesh, cell_groups=groups, group_tags={})) == [("b", "d"), ("a", "c")]


def test_the_command_writes_what_a_run_completes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert lacsolver_main(["example", "two_blocks", "-q"]) == 0
    assert lacsolver_main(["run", "two_blocks.msh"]) == 3
    assert "lacsolver new two_blocks.msh" in capsys.readouterr().err
    assert lacsolver_main(["new", "two_blocks.msh"]) == 2  # the example's own case is there
    assert lacsolver_main(["new", "two_blocks.msh", "-o", "first.txt"]) == 2
    assert lacsolver_main(["new", "two_blocks.msh", "-o", "first.toml"]) == 0
    assert "'slave' and 'master'" in capsys.readouterr().out
    case = tmp_path / "first.toml"
    supports = (DATA / "two_blocks.toml").read_text().partition("[[displacement]]")
    case.write_text(case.read_text() + "".join(supports[1:]))
    assert lacsolver_main(["run", "first.toml", "-q"]) == 0
    assert (ls.read_results("first").solution().contact["slave"].status == 1).all()


# ---- sizes of cells and groups


@pytest.mark.parametrize("name", SOLIDS + PLANES)
def test_cells_fill_their_box_wherever_it_lies(name):
    dim = CELLS[name].dim
    mesh = body(name, 2, [1.0] * dim, [2.0, 3.0, 1.5][:dim])
    assert cell_sizes(mesh).sum() == pytest.approx(2.0 if dim == 2 else 1.0, rel=1e-13)
    far = Mesh.create(mesh.points + 1e6 * np.eye(3)[:dim].sum(axis=0), mesh.blocks, space_dim=dim)
    assert cell_sizes(far).sum() == pytest.approx(2.0 if dim == 2 else 1.0, rel=1e-9)


def test_groups_count_their_cells_of_the_highest_dimension_and_a_curved_edge_has_its_length():
    points = [[0, 0], [2, 0], [2, 1], [0, 1]]
    blocks = [("QUAD4", [[0, 1, 2, 3]]), ("SEG2", [[0, 1], [1, 2]]), ("POI1", [[0]])]
    mesh = Mesh.create(points, blocks, cell_groups={"both": [0, 1], "edges": [1, 2], "point": [3]})
    assert group_sizes(mesh) == {"both": 2.0, "edges": 3.0, "point": 0.0}
    assert describe(mesh)["groups"]["edges"] == {"dim": 1, "cells": 2, "size": 3.0}
    a = np.linspace(0, np.pi / 2, 17)
    segments = [[2 * k, 2 * k + 2, 2 * k + 1] for k in range(8)]
    arc = Mesh.create(np.stack([np.cos(a), np.sin(a)], axis=1), [("SEG3", segments)])
    assert cell_sizes(arc).sum() == pytest.approx(np.pi / 2, rel=1e-5)
