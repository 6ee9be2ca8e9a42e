"""Meshes that lack the cells of the bodies, as gmsh writes them where only surfaces are physical groups."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver
from lacmesh import Mesh
from lacmesh.cli import main as lacmesh_main
from lacsolver.cli import main
from tests.lacsolver.bad_cases import GOOD, blocks
from tests.lacsolver.patch_meshes import stack

SOLID = GOOD.replace("plane_strain", "3d").replace("uy = 0.0", "uz = 0.0")
WHY = "where there are physical groups, gmsh saves their cells alone: add one of the {}, or save as msh 4.1 with "
WHY += "Mesh.SaveAll = 1 (msh 2.2 loses all groups then)"


def without(mesh, dim):
    """The mesh without its cells of a dimension."""
    kept = mesh.cell_dim != dim
    new = np.cumsum(kept) - 1
    parts = [(b.type, b.nodes) for k, b in enumerate(mesh.blocks) if kept[mesh.offsets[k] : mesh.offsets[k + 1]].all()]
    groups = {name: new[cells[kept[cells]]] for name, cells in mesh.cell_groups.items()}
    return Mesh.create(mesh.points, parts, cell_groups={name: cells for name, cells in groups.items() if len(cells)})


CASES = [
    (without(stack("HEXA8", "TETRA4", 3, counts=(3, 2)), 3), SOLID, "volumes"),
    (without(blocks(), 2), GOOD, "surfaces"),
]


@pytest.fixture(params=CASES, ids=["space", "plane"])
def bare(request, tmp_path):
    """The case, the mesh, and what the mesh lacks."""
    mesh, text, lacks = request.param
    lacmesh.write(tmp_path / "blocks.msh", mesh)
    (tmp_path / "case.toml").write_text(text)
    return tmp_path / "case.toml", tmp_path / "blocks.msh", lacks


@pytest.mark.parametrize("command", ["run", "validate", "modes"])
def test_a_case_says_that_its_mesh_has_no_bodies(bare, capsys, command):
    case, _, lacks = bare
    assert main([command, str(case), "-q"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert f"needs {lacks}: the mesh blocks.msh has no {lacks}, only cells of type" in line
    assert line.endswith(WHY.format(lacks))


def test_so_do_the_commands_for_meshes(bare, capsys):
    _, mesh, lacks = bare
    assert lacmesh_main(["cut", str(mesh), "--slave", "slave", "-o", str(mesh.with_name("cut.msh"))]) == 1
    said = capsys.readouterr().err
    assert said.startswith("lacmesh: error: ") and str(mesh) in said
    assert f"has no {lacks}" in said and WHY.format(lacks) in said
    findings = lacmesh.check(lacmesh.read(mesh), "slave", "master")
    assert findings.errors[0].rule == "no-cells" and WHY.format(lacks) in findings.errors[0].message
    assert lacmesh_main(["info", str(mesh)]) == 0
    assert f"the mesh has no {lacks}" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("mesh", "text", "says"),
    [
        (blocks(), SOLID, 'the model 3d needs volumes, and the mesh blocks.msh is plane; take model = "plane_strain"'),
        (
            stack("HEXA8", "TETRA4", 3, counts=(3, 2)),
            GOOD,
            'the model plane_strain is plane, and the mesh blocks.msh has volumes; take model = "3d"',
        ),
    ],
    ids=["plane", "space"],
)
def test_a_model_of_another_dimension_than_its_mesh(tmp_path, capsys, mesh, text, says):
    lacmesh.write(tmp_path / "blocks.msh", mesh)
    (tmp_path / "case.toml").write_text(text)
    assert main(["run", str(tmp_path / "case.toml"), "-q"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_a_skin_that_is_a_group_of_nodes(tmp_path, capsys):
    mesh = blocks()
    groups = dict(mesh.cell_groups)
    nodes = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(groups.pop("slave"))]))
    lacmesh.write(tmp_path / "blocks.med", replace(mesh, cell_groups=groups, node_groups={"slave": nodes}))
    (tmp_path / "case.toml").write_text(GOOD.replace("blocks.msh", "blocks.med"))
    assert main(["validate", str(tmp_path / "case.toml"), "-q"]) == 1
    assert "contact.slave: 'slave' is a group of nodes, and a group of cells is needed" in capsys.readouterr().err


def test_a_support_of_a_body_that_was_not_saved_is_told():
    """Without its volume the master is rigid, and what holds its lower side holds nothing."""
    mesh = lacmesh.read("data/two_blocks.msh")
    kept = np.setdiff1d(np.arange(mesh.n_cells), mesh.cells_of("lower"))
    place = np.full(mesh.n_cells, -1)
    place[kept] = np.arange(len(kept))
    groups = {name: place[cells][place[cells] >= 0] for name, cells in mesh.cell_groups.items() if name != "lower"}
    blocks = [(kind, nodes) for kind, _, nodes in mesh.select(kept)]
    case = lacsolver.Case(
        model="3d",
        material=[lacsolver.Material(young=1.0, poisson=0.3)],
        contact=[lacsolver.Contact(slave="slave", master="master")],
        displacement=[
            lacsolver.Displacement(group="bottom", uz=0.0),
            lacsolver.Displacement(group="symmetry_x", ux=0.0),
            lacsolver.Displacement(group="symmetry_y", uy=0.0),
        ],
        pressure=[lacsolver.Pressure(group="top", value=0.01)],
    )
    with pytest.warns(lacmesh.LacmeshWarning, match="displacement 'bottom' has no effect: none of its nodes belongs"):
        lacsolver.solve(case, lacmesh.Mesh.create(mesh.points, blocks, cell_groups=groups))
