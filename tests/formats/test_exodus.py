"""Exodus II, whose types and sides are those of VTK; tags that are groups; parts of a mesh; formats not read."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning, ReadError
from lacmesh.formats.exodus import _MIDDLES, _SIDES
from tests.checks.blocks import two_blocks
from tests.samples import samples

netcdf = pytest.importorskip("netCDF4")
#: our type -> the format's name, for all that VTK reads too
TYPES = {
    "HEXA8": "HEX8", "HEXA20": "HEX20", "HEXA27": "HEX27", "TETRA4": "TETRA", "TETRA10": "TETRA10", "PENTA6": "WEDGE",
    "PENTA15": "WEDGE15", "PENTA18": "WEDGE18", "PYRAM5": "PYRAMID5", "PYRAM13": "PYRAMID13", "QUAD4": "QUAD4",
    "QUAD8": "QUAD8", "QUAD9": "QUAD9", "TRIA3": "TRI3", "TRIA6": "TRI6",
}  # fmt: skip


def texts(file, name, dim, given):
    variable = file.createVariable(name, "S1", (dim, "len_name"))
    for k, text in enumerate(given):
        variable[k] = np.array(list(text.ljust(33, "\0")), "S1")


def exodus(path, points, blocks, sides=(), nodes=(), names=True, fields=(), maps=(), form="NETCDF3_64BIT_OFFSET"):
    """Write a file as Cubit does: blocks (name, type, connectivity), sets of sides (name, elements, sides), of nodes.

    All numbers from 1. `fields`: (name, values (times, nodes)); `maps`: (variable, dimension, numbers).
    """
    points, n = np.asarray(points, float), sum(len(cells) for _, _, cells in blocks)
    with netcdf.Dataset(path, "w", format=form) as file:
        file.setncatts({"title": "made by hand", "floating_point_word_size": 8, "file_size": 1})
        file.setncatts({"api_version": np.float32(8.03), "version": np.float32(8.03)})
        sizes = {"len_string": 33, "len_name": 33, "num_dim": points.shape[1], "num_nodes": len(points), "num_elem": n}
        sizes |= {"num_el_blk": len(blocks), "num_side_sets": len(sides), "num_node_sets": len(nodes)}
        sizes |= {"num_nod_var": len(fields)}
        for name, size in sizes.items():
            if size:
                file.createDimension(name, size)
        file.createDimension("time_step", None)
        for axis, column in zip("xyz", points.T, strict=False):
            file.createVariable(f"coord{axis}", "f8", ("num_nodes",))[:] = column
        for k, (_, kind, cells) in enumerate(blocks, start=1):
            file.createDimension(f"num_el_in_blk{k}", len(cells))
            file.createDimension(f"num_nod_per_el{k}", len(cells[0]))
            variable = file.createVariable(f"connect{k}", "i4", (f"num_el_in_blk{k}", f"num_nod_per_el{k}"))
            variable.elem_type, variable[:] = kind, cells
        for k, (_, elements, numbers) in enumerate(sides, start=1):
            file.createDimension(f"num_side_ss{k}", len(elements))
            for stem, values in (("elem", elements), ("side", numbers)):
                file.createVariable(f"{stem}_ss{k}", "i4", (f"num_side_ss{k}",))[:] = values
        for k, (_, members) in enumerate(nodes, start=1):
            file.createDimension(f"num_nod_ns{k}", len(members))
            file.createVariable(f"node_ns{k}", "i4", (f"num_nod_ns{k}",))[:] = members
        given = (("eb", "num_el_blk", blocks), ("ss", "num_side_sets", sides), ("ns", "num_node_sets", nodes))
        for stem, dim, sets in given:
            if len(sets):
                variable = file.createVariable(f"{stem}_prop1", "i4", (dim,))
                variable.setncattr("name", "ID")
                variable[:] = np.arange(1, len(sets) + 1)
                if names:
                    texts(file, f"{stem}_names", dim, [one[0] for one in sets])
        for name, dim, numbers in maps:
            file.createVariable(name, "i4", (dim,))[:] = numbers
        if fields:
            texts(file, "name_nod_var", "num_nod_var", [name for name, _ in fields])
        for k, (_, values) in enumerate(fields, start=1):
            file.createVariable(f"vals_nod_var{k}", "f8", ("time_step", "num_nodes"))[:] = values
    return path


def one_element(kind):
    """The reference cell of a type with its nodes in a random order, and the numbers of these in Exodus' order."""
    cell = CELLS[kind]
    points = np.pad(np.array(cell.reference, float), ((0, 0), (0, 3 - cell.dim)))
    order = np.random.default_rng(1).permutation(cell.n_nodes)
    theirs = [(str(k),) for k in range(cell.n_corners)] + [tuple(one) for one in _MIDDLES[cell.family]]
    corners = [tuple(map(str, sorted(one))) for one in cell.corners_of_node]
    ours = [corners.index(one) for one in theirs if one in corners]
    return points[order], np.argsort(order)[ours] + 1


@pytest.mark.vtk
@pytest.mark.parametrize("kind", TYPES)
def test_nodes_and_sides_are_those_of_vtk(kind, tmp_path):
    """VTK reads Exodus by the library of those who defined it: the same nodes of each cell, the same nodes of sides."""
    pyvista = pytest.importorskip("pyvista")
    reader_of = pytest.importorskip("vtkmodules.vtkIOExodus").vtkExodusIIReader
    points, numbers = one_element(kind)
    n_sides = len(_SIDES[CELLS[kind].family]) if CELLS[kind].dim == 3 else 0
    sides = [(f"side{k}", [1], [k]) for k in range(1, n_sides + 1)]
    path = exodus(tmp_path / "one.e", points, [("all", TYPES[kind], [numbers])], sides)
    reader = reader_of()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for k in range(n_sides):
        reader.SetObjectStatus(reader.SIDE_SET, k, 1)
    reader.Update()
    read, whole = lacmesh.read(path), pyvista.wrap(reader.GetOutput())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = lacmesh.Mesh.from_pyvista(whole[0][0])
    (block,), ours = theirs.blocks, read.block(kind)
    assert block.type == kind
    assert np.allclose(theirs.points[block.nodes[0]], read.points[ours[0]])
    for k in range(n_sides):
        (_, _, nodes), *_ = read.select(read.cells_of(f"side{k + 1}"))
        there = whole[4][k].points
        assert np.allclose(sorted(there.tolist()), sorted(read.points[nodes[0]].tolist()))


HEXES = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
POINTS = [*HEXES, *((x, y, 2) for x, y, _ in HEXES[:4])]
BLOCKS = [("lower", "HEX8", [[1, 2, 3, 4, 5, 6, 7, 8]]), ("upper", "HEX", [[5, 6, 7, 8, 9, 10, 11, 12]])]
SIDES = [("joint", [1, 2], [6, 5]), ("top", [2], [6])]
forms = pytest.mark.parametrize("form", ["NETCDF3_64BIT_OFFSET", "NETCDF4"])


@forms
def test_blocks_and_sets_are_groups(form, tmp_path):
    path = exodus(tmp_path / "two.e", POINTS, BLOCKS, SIDES, [("bottom", [1, 2, 3, 4])], form=form)
    mesh = lacmesh.read(path)
    assert {name: len(cells) for name, cells in mesh.cell_groups.items()} == {
        "lower": 1, "upper": 1, "joint": 1, "top": 1,
    }  # fmt: skip
    assert mesh.cells_by_type == {"HEXA8": 2, "QUAD4": 2}  # the face that two elements name is one
    (_, _, nodes), *_ = mesh.select(mesh.cells_of("top"))
    assert (mesh.points[nodes[0], 2] == 2).all()
    assert mesh.node_groups["bottom"].tolist() == [0, 1, 2, 3]
    whole = path.read_bytes()
    for part in (0.1, 0.5, 0.9):
        path.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(ReadError, match=r"two\.e"):
            lacmesh.read(path)
    mesh = lacmesh.read(exodus(path, POINTS, BLOCKS, SIDES, [("", [1, 2])], names=False, form=form))
    assert sorted(mesh.cell_groups) == ["1", "2", "side set 1", "side set 2"] and sorted(mesh.node_groups) == ["1"]


def test_sides_of_shells_are_their_faces_and_edges(tmp_path):
    shell = [("skin", "SHELL4", [[1, 2, 3, 4]])]
    mesh = lacmesh.read(exodus(tmp_path / "shell.e", HEXES[:4], shell, [("face", [1], [1]), ("edge", [1], [3])]))
    assert mesh.cells_by_type == {"QUAD4": 1, "SEG2": 1}
    assert mesh.group_dim("face") == 2 and mesh.group_dim("edge") == 1
    flat = [("skin", "QUAD4", [[1, 2, 3, 4]])]
    plane = np.array(HEXES)[:4, :2]
    edges = lacmesh.read(exodus(tmp_path / "plane.e", plane, flat, [("left", [1], [4])]))
    (_, _, nodes), *_ = edges.select(edges.cells_of("left"))
    assert edges.space_dim == 2 and (edges.points[nodes[0], 0] == 0).all()


@forms
def test_numbers_and_fields_are_read(form, tmp_path):
    fields = [(f"disp{axis}", np.outer([1.0, 5.0], np.arange(12.0) + k)) for k, axis in enumerate("XYZ")]
    fields.append(("heat", np.ones((2, 12))))
    maps = [("elem_num_map", "num_elem", [70, 40]), ("node_num_map", "num_nodes", np.arange(101, 113))]
    path = exodus(tmp_path / "two.e", POINTS, BLOCKS, SIDES, fields=fields, maps=maps, form=form)
    with pytest.warns(LacmeshWarning, match="fields are read at the first time alone"):
        mesh = lacmesh.read(path)
    assert mesh.node_number.tolist() == list(range(101, 113)) and mesh.cell_number[:2].tolist() == [70, 40]
    assert sorted(mesh.node_data) == ["disp", "heat"]
    assert np.allclose(mesh.node_data["disp"], np.arange(12.0)[:, None] + [0, 1, 2])


@pytest.mark.fuzz
def test_no_damaged_file_ends_the_process(tmp_path):
    """netCDF4 does on some in HDF5."""
    path = exodus(tmp_path / "two.e", POINTS, BLOCKS, SIDES, [("bottom", [1, 2, 3, 4])], form="NETCDF4")
    rng, whole, refused = np.random.default_rng(2), path.read_bytes(), 0
    for _ in range(samples(60, 2000)):
        content = bytearray(whole)
        for at in rng.integers(0, len(whole), rng.integers(1, 5)):
            content[at] = rng.integers(256)
        path.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LacmeshWarning)
            try:
                lacmesh.read(path)
            except ReadError as error:
                assert "\n" not in str(error)
                refused += 1
    assert refused


@pytest.mark.parametrize(
    ("blocks", "sides", "words"),
    [
        ([("b", "NSIDED", [[1, 2, 3]])], [], "cells of type NSIDED with 3 nodes, which are not read"),
        ([("b", "HEX8", [[1, 2, 3, 4, 5, 6, 7, 99]])], [], "names 99 of 12 nodes or elements"),
        (BLOCKS, [("s", [3], [1])], "names 3 of 2 nodes or elements"),
        (BLOCKS, [("s", [1], [7])], "names side 7 of a HEXA8"),
    ],
)
def test_a_damaged_file_is_an_error_with_its_place(blocks, sides, words, tmp_path):
    with pytest.raises(ReadError, match=words):
        lacmesh.read(exodus(tmp_path / "bad.e", POINTS, blocks, sides))


WORDS = "no group has a name in this file: the tags .* are groups, named by their numbers"


def tagged(**arrays):
    """Two blocks without groups, and arrays on their cells."""
    mesh = two_blocks("TETRA4")
    return lacmesh.Mesh.create(mesh.points, mesh.blocks, cell_data=arrays), mesh


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
