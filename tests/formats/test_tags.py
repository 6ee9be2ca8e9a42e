"""Files without names of groups: their tags are groups. Parts of a divided mesh, and formats that are not read."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import lacmesh
from lacmesh.errors import LacmeshWarning, ReadError
from tests.checks.blocks import two_blocks

WORDS = "no group has a name in this file: the tags .* are groups, named by their numbers"


def tagged(**arrays):
    """Two blocks without groups, and arrays on their cells."""
    mesh = two_blocks("TETRA4")
    return lacmesh.Mesh.create(mesh.points, mesh.blocks, cell_data=arrays), mesh


def dolfinx(path, mesh, tags, with_names=False):
    """Write XDMF as dolfinx does: a grid of the cells, and one for the tags of each dimension on some cells."""
    h5py = pytest.importorskip("h5py")
    shapes = {"TETRA4": "Tetrahedron", "TRIA3": "Triangle"}
    grids = []
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        file["points"] = mesh.points

        def grid(name, kind, nodes, values=None):
            file[f"{name}/nodes"] = nodes
            item = f'<DataItem Dimensions="{{}}" NumberType="Int" Format="HDF">{path.stem}.h5:/{name}/{{}}</DataItem>'
            topology = item.format(f"{nodes.shape[0]} {nodes.shape[1]}", "nodes")
            text = (
                f'<Grid Name="{name}" GridType="Uniform"><Topology TopologyType="{shapes[kind]}">{topology}</Topology>'
            )
            text += f'<Geometry GeometryType="XYZ"><DataItem Dimensions="{len(mesh.points)} 3" Format="HDF">'
            text += f"{path.stem}.h5:/points</DataItem></Geometry>"
            if values is not None:
                file[f"{name}/values"] = values
                values = item.format(f"{len(values)} 1", "values")
                text += f'<Attribute Name="{name}" AttributeType="Scalar" Center="Cell">{values}</Attribute>'
            grids.append(text + "</Grid>")

        grid("mesh", "TETRA4", mesh.block("TETRA4"))
        for name, (kind, rows, values) in tags.items():
            grid(name, kind, mesh.block(kind)[rows], np.asarray(values, np.int32))
    path.write_text(f'<?xml version="1.0"?><Xdmf Version="3.0"><Domain>{"".join(grids)}</Domain></Xdmf>')
    return path


def test_tags_of_dolfinx_are_groups(tmp_path):
    """Cells tagged 1 and 2, some facets tagged 21 and 22, the others not."""
    _, mesh = tagged()
    n = len(mesh.block("TETRA4"))
    tags = {
        "cells": ("TETRA4", np.arange(n), np.where(np.arange(n) < n // 2, 1, 2)),
        "facets": ("TRIA3", np.arange(6), [21, 21, 22, 22, 22, 22]),
    }
    with pytest.warns(LacmeshWarning, match=WORDS) as told:
        read = lacmesh.read(dolfinx(tmp_path / "tagged.xdmf", mesh, tags))
    assert len(told) == 1 and "'cells' and 'facets'" in str(told[0].message)
    assert {name: len(cells) for name, cells in read.cell_groups.items()} == {
        "1": n // 2, "2": n - n // 2, "21": 2, "22": 4,
    }  # fmt: skip
    assert read.group_dim("21") == 2 and read.group_dim("2") == 3
    (_, _, nodes), *_ = read.select(read.cells_of("21"))
    assert np.array_equal(np.sort(nodes), np.sort(mesh.block("TRIA3")[:2]))


@pytest.mark.parametrize("name", ["a.mesh", "a.vtk"])
def test_tags_of_formats_of_meshio_are_groups(name, tmp_path):
    meshio = pytest.importorskip("meshio")
    _, mesh = tagged()
    n, m = len(mesh.block("TETRA4")), len(mesh.block("TRIA3"))
    array = "medit:ref" if name == "a.mesh" else "material"
    tags = [np.r_[np.ones(n - 1, int), 5], np.r_[np.zeros(m - 2, int), 1, 7]]
    cells = [("tetra", mesh.block("TETRA4")), ("triangle", mesh.block("TRIA3"))]
    meshio.Mesh(mesh.points, cells, cell_data={array: tags}).write(tmp_path / name)
    with pytest.warns(LacmeshWarning, match=WORDS):
        read = lacmesh.read(tmp_path / name)
    counts = {one: len(cells) for one, cells in read.cell_groups.items()}
    none = {} if name == "a.mesh" else {"0": m - 2}  # 0 is no reference in Medit
    assert counts == {"3:1": n - 1, "2:1": 1, "5": 1, "7": 1} | none
    assert lacmesh.check(read, "7").summary["slave_faces"] == 1


@pytest.mark.parametrize("name", ["a.vtu", "a.xdmf", "a.vtk"])
def test_integers_of_a_mesh_that_lacmesh_wrote_are_fields(name, tmp_path):
    pytest.importorskip("meshio")
    mesh, _ = tagged(level=np.arange(two_blocks("TETRA4").n_cells) % 3)
    lacmesh.write(tmp_path / name, mesh)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read = lacmesh.read(tmp_path / name)
    assert not read.cell_groups and "level" in read.cell_data


@pytest.mark.gmsh
@pytest.mark.parametrize("version", ["4.1", "2.2"])
def test_a_part_of_a_divided_mesh_is_called_one(gmsh, version, tmp_path):
    gmsh.model.occ.addBox(0, 0, 0, 2, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], name="body")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.partition(3)
    gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
    gmsh.option.setNumber("Mesh.PartitionSplitMeshFiles", 0)
    gmsh.write(str(tmp_path / "whole.msh"))
    gmsh.option.setNumber("Mesh.PartitionSplitMeshFiles", 1)
    gmsh.write(str(tmp_path / "part.msh"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = lacmesh.read(tmp_path / "whole.msh")
    of = " of 3" if version == "4.1" else ""
    with pytest.warns(LacmeshWarning, match=f"partition 2{of} alone, a part of a mesh that gmsh divided"):
        part = lacmesh.read(tmp_path / "part_2.msh")
    assert part.n_cells < whole.n_cells


@pytest.mark.gmsh
def test_groups_that_msh_22_loses_are_missed(gmsh, tmp_path):
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [1], name="slave")
    gmsh.model.mesh.generate(3)
    for option, value in (("MshFileVersion", 2.2), ("SaveAll", 0)):
        gmsh.option.setNumber(f"Mesh.{option}", value)
    gmsh.write(str(tmp_path / "alone.msh"))
    gmsh.option.setNumber("Mesh.SaveAll", 1)
    gmsh.write(str(tmp_path / "all.msh"))
    with pytest.warns(LacmeshWarning, match=r"no cell is in any of its groups, .*SaveAll = 1; save as msh 4\.1"):
        lacmesh.read(tmp_path / "all.msh")
    with pytest.raises(lacmesh.errors.CutError, match=r"save as msh 4\.1 with Mesh\.SaveAll = 1"):
        lacmesh.cut_skin(lacmesh.read(tmp_path / "alone.msh"), "slave")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("two.mesh", "MFEM mesh v1.0\n\ndimension\n2\n", "is a mesh of MFEM, which is not read; .* saves it as .vtu"),
        ("two.unv", "    -1\n  2411\n", r"is a universal file \(.unv\), which is not read; gmsh makes a .msh of it"),
        ("two.bdf", "$ Created by Gmsh\nGRID    1       0       0.00E+000.00E+000.00E+00\n", "gmsh makes a .msh of it"),
    ],
)
def test_other_formats_are_named_with_the_way_to_read_them(name, text, words, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(ReadError, match=words):
        lacmesh.read(tmp_path / name)
