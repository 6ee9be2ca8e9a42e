"""A first case for a mesh: the skins that may touch, and a text that a case is read from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacsolver.cli import main
from lacsolver.first_case import facing_pairs, first_case
from tests.lacsolver.patch_meshes import stack, three_blocks

DATA = Path(__file__).resolve().parents[2] / "data"


@pytest.mark.parametrize(
    ("name", "pairs"),
    [
        ("two_blocks", [{"slave", "master"}]),
        ("press_fit", [{"slave", "master"}]),
        ("disc_on_block", [{"slave", "master"}]),
        ("friction/clamp", [{"slave", "master"}]),
        ("sliding/ball", [{"upper", "top_plate"}, {"lower", "bottom_plate"}]),
        ("sliding/ironing_3d", [{"slave", "master"}]),
        ("impact/dropping_ball", [{"slave", "floor"}]),
        ("sliding/snap_fit", []),  # the hook is far from the ledge
    ],
)
def test_pairs_of_the_examples(name, pairs):
    assert [set(pair) for pair in facing_pairs(lacmesh.read(DATA / f"{name}.msh"))] == pairs


@pytest.mark.parametrize("dim", [2, 3])
def test_pairs_do_not_hang_on_place_units_or_names(dim):
    mesh = stack("QUAD4" if dim == 2 else "HEXA8", "TRIA3" if dim == 2 else "TETRA4", dim, gap=0.01)
    first = facing_pairs(mesh)
    assert {"slave", "master"} in [set(pair) for pair in first]
    moved = replace(mesh, points=1e-3 * mesh.points + np.array([5.0, -7.0, 3.0 * (dim == 3)]))
    assert facing_pairs(moved) == first
    far = stack("QUAD4" if dim == 2 else "HEXA8", "TRIA3" if dim == 2 else "TETRA4", dim, gap=5.0)
    assert {"slave", "master"} not in [set(pair) for pair in facing_pairs(far)]


def test_of_groups_within_one_another_the_smallest_are_named():
    mesh = lacmesh.read(lacmesh.example("two_blocks.msh"))
    skin = np.sort(np.concatenate([mesh.cells_of("slave"), mesh.cells_of("top")]))
    wider = replace(mesh, cell_groups={"foot": skin, **mesh.cell_groups}, group_tags={})
    assert facing_pairs(wider) == [("slave", "master")]


def test_pairs_stand_in_the_order_of_the_mesh():
    """Pairs that face each other wholly are not sorted by the round-off of their areas, nor by their names."""
    mesh = three_blocks()
    names = {"slave2": "b", "master2": "d", "slave1": "a", "master1": "c"}
    groups = {names[name]: mesh.cell_groups[name] for name in names}
    assert facing_pairs(replace(mesh, cell_groups=groups, group_tags={})) == [("b", "d"), ("a", "c")]


@pytest.mark.parametrize("name", ["two_blocks", "press_fit", "disc_on_block", "sliding/ball", "sliding/snap_fit"])
def test_a_first_case_is_a_case(name, tmp_path):
    mesh = lacmesh.read(DATA / f"{name}.msh")
    pairs = facing_pairs(mesh)
    text = first_case(mesh, DATA / f"{name}.msh", pairs)
    case = ls.parse_case(text, tmp_path / "case.toml")
    assert [one.surfaces for one in case.contact] == [tuple(sorted(pair)) for pair in pairs]
    assert case.model == ("3d" if mesh.dim == 3 else "plane_strain")
    assert all(f"#   {group}: " in text for group in mesh.cell_groups)
    named = [name for one in case.material for name in one.groups or ()]
    assert all(mesh.group_dim(name) == mesh.dim for name in named)


def test_the_command_writes_what_a_run_completes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["example", "two_blocks", "-q"]) == 0
    assert main(["run", "two_blocks.msh"]) == 3
    assert "lacsolver new two_blocks.msh writes a first case for it" in capsys.readouterr().err
    assert main(["new", "two_blocks.msh"]) == 2  # the example's own case is there
    assert main(["new", "two_blocks.msh", "-o", "first.toml"]) == 0
    assert "'slave' and 'master'" in capsys.readouterr().out
    text = Path("first.toml").read_text()
    for group, keys in (
        ("bottom", "ux = 0.0\nuy = 0.0\nuz = 0.0"),
        ("symmetry_x", "ux = 0.0"),
        ("symmetry_y", "uy = 0.0"),
    ):
        text += f'[[displacement]]\ngroup = "{group}"\n{keys}\n'
    Path("first.toml").write_text(text + '[[pressure]]\ngroup = "top"\nvalue = 25.0\n')
    assert main(["run", "first.toml", "-q"]) == 0
    zone = ls.read_results("first").solution().contact["slave"]
    assert (zone.status == 1).all()
    assert main(["new", "two_blocks.msh", "-o", "first.txt"]) == 2
