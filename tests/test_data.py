"""The meshes of data/: what the manifest says of them, their scripts, and that they are fit to be cut."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS

DATA = Path(__file__).resolve().parents[1] / "data"
README = (DATA / "README.md").read_text(encoding="utf-8")
MESHES = sorted(p.name for p in DATA.glob("*.msh"))
ROWS = [
    [cell.strip() for cell in line.strip("| \n").split("|")]
    for line in README.splitlines()
    if re.match(r"\| \S+\.msh \|", line)
]
FILES = {row[0]: row[1:] for row in ROWS if len(row) == 4}


def test_the_manifest_lists_every_mesh():
    assert sorted(FILES) == MESHES
    assert len(MESHES) <= 3


@pytest.mark.parametrize("name", MESHES)
def test_the_manifest_says_what_is_there(name):
    mesh = lacmesh.read(DATA / name)
    script, nodes, cells = FILES[name]
    assert (DATA / script).is_file()
    assert int(nodes) == mesh.n_nodes
    assert cells == ", ".join(f"{count} {kind}" for kind, count in mesh.cells_by_type.items())
    groups = {row[1]: (int(row[2]), int(row[3])) for row in ROWS if row[0] == name and len(row) == 5}
    assert groups == {g: (mesh.group_dim(g), len(ids)) for g, ids in mesh.cell_groups.items()}
    assert (DATA / name).stat().st_size < 600_000


@pytest.mark.parametrize("name", MESHES)
def test_bodies_are_apart_and_skins_turn_outward(name):
    mesh = lacmesh.read(DATA / name)
    bodies = [ids for name, ids in mesh.cell_groups.items() if mesh.group_dim(name) == mesh.dim]
    first, second = (np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(ids)])) for ids in bodies)
    assert not np.intersect1d(first, second).size
    assert len(first) + len(second) == mesh.n_nodes
    for group in ("slave", "master", *({"top", "bottom"} & set(mesh.cell_groups))):
        for kind, ids, nodes in mesh.select(mesh.cell_groups[group]):
            owners = owners_of(mesh, nodes[:, : CELLS[kind].n_corners])
            x = mesh.points[nodes]
            along = x[:, 1] - x[:, 0]
            other = x[:, 2] - x[:, 0] if mesh.dim == 3 else np.broadcast_to([0.0, 0.0, 1.0], along.shape)
            outward = np.cross(along, other)
            assert (np.einsum("fd,fd->f", outward, x.mean(axis=1) - owners) > 0).all(), (group, ids)


def owners_of(mesh, corners):
    """The centre of the cell behind each face."""
    centres = []
    for face in corners:
        for block in mesh.blocks:
            if CELLS[block.type].dim == mesh.dim:
                found = np.flatnonzero(np.isin(block.nodes, face).sum(axis=1) == len(face))
                centres += [mesh.points[block.nodes[k]].mean(axis=0) for k in found]
    assert len(centres) == len(corners)
    return np.array(centres)


@pytest.mark.gmsh
@pytest.mark.parametrize("name", MESHES)
def test_the_scripts_still_make_them(name, tmp_path):
    """Counts of the structured parts; gmsh is free to change the others."""
    script = FILES[name][0]
    subprocess.run([sys.executable, str(DATA / script), str(tmp_path / name)], check=True, capture_output=True)
    made, kept = lacmesh.read(tmp_path / name), lacmesh.read(DATA / name)
    assert list(made.cell_groups) == list(kept.cell_groups)
    fixed = {"HEXA8", "QUAD4"}
    assert {k: n for k, n in made.cells_by_type.items() if k in fixed} == {
        k: n for k, n in kept.cells_by_type.items() if k in fixed
    }
    assert lacmesh.cut_skin(made, "slave").n_macros == len(made.cell_groups["slave"])


def test_the_deck_is_what_its_script_makes(tmp_path):
    subprocess.run([sys.executable, DATA / "make_punch.py", tmp_path / "punch.inp"], check=True)
    assert (tmp_path / "punch.inp").read_text() == (DATA / "punch.inp").read_text()
    mesh = lacmesh.read(DATA / "punch.inp")
    told = re.search(r"\((\d+) CPE4,\nslave of (\d+) faces\).*\((\d+) CPE4, master of (\d+)", README)
    assert told and [int(n) for n in told.groups()] == [
        len(mesh.cell_groups[name]) for name in ("punch", "slave", "block", "master")
    ]
