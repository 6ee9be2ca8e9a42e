"""solid.pvd and contact_NAME.pvd: what ParaView's own reader finds in them, and what lacmesh does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, Surface, read
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning, ReadError
from lacmesh.formats.vtu.collection import read_pvd
from lacsolver.output.names import contact_stems
from lacsolver.output.parts import body
from lacsolver.output.vtu import VtuSeries
from lacsolver.results.nodal import PRINCIPAL, principal, von_mises
from lacsolver.results.results import Fields
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANES, SOLIDS, cube, mixture, square
from tests.lacsolver.written import MODELS, ZONES, displacement, fields, made_up, two_blocks, zone_fields

TIMES = (0.25, 0.5, 0.75)


@pytest.fixture(scope="module", params=MODELS)
def run(request, tmp_path_factory):
    made = made_up(tmp_path_factory.mktemp("vtu"), request.param)
    made.steps(made.writer(), len(TIMES))
    return made


def at_last(run, stem):
    """The last time of a PVD, by pyvista, with the nodes of the mesh that its points are."""
    import pyvista

    reader = pyvista.PVDReader(str(run.folder / f"{stem}.pvd"))
    assert tuple(reader.time_values) == TIMES
    reader.set_active_time_value(TIMES[-1])
    (grid,) = reader.read()
    nodes = np.searchsorted(run.space.mesh.node_number, grid.point_data["node_number"])
    assert np.array_equal(run.space.mesh.node_number[nodes], grid.point_data["node_number"])
    assert np.array_equal(grid.points, run.space.mesh.points[nodes])
    return grid, nodes


@pytest.mark.vtk
def test_the_body_has_its_fields(run):
    grid, nodes = at_last(run, "solid")
    space, mesh = run.space, run.space.mesh
    expected = fields(space, TIMES[-1])
    d = space.dim
    for name, values in (("displacement", expected.displacement), ("reaction", expected.reaction)):
        assert np.array_equal(grid.point_data[name][:, :d], values[nodes])
        assert grid.point_data[name].shape == (len(nodes), 3) and not grid.point_data[name][:, d:].any()
    assert grid.point_data["stress"].shape == (len(nodes), 6)
    width = space.model.n_stress
    np.testing.assert_array_equal(grid.point_data["stress"][:, :width], expected.stress[nodes])
    np.testing.assert_array_equal(grid.point_data["von_mises"], von_mises(expected.stress[nodes]))
    for name, values in zip(PRINCIPAL, principal(expected.stress[nodes]).T, strict=True):
        np.testing.assert_array_equal(grid.point_data[name], values)
    solids = np.flatnonzero(mesh.cell_dim == d)
    bare = mesh.cell_groups["plate"]
    assert set(grid.cell_data["cell_number"]) == set(mesh.cell_number[np.concatenate([solids, bare])])
    assert np.array_equal(np.isnan(grid.point_data["stress"][:, 0]), ~space.attached[nodes])
    groups = {name.removeprefix("group:") for name in grid.cell_data if name.startswith("group:")}
    assert groups == {"lower", "upper", "plate"}
    lower = grid.cell_data["cell_number"][grid.cell_data["group:lower"] == 1]
    assert set(lower) == set(mesh.cell_number[mesh.cell_groups["lower"]])
    measure = "Volume" if d == 3 else "Area"
    sizes = grid.compute_cell_sizes(length=False)[measure]
    kept = np.isin(grid.cell_data["cell_number"], mesh.cell_number[solids])
    assert sizes[kept].min() > 0 and sizes[kept].sum() == pytest.approx(2.0, rel=1e-6)


@pytest.mark.vtk
def test_warping_by_the_displacement_moves_the_points(run):
    grid, nodes = at_last(run, "solid")
    d = run.space.dim
    moved = displacement(run.space.mesh.points, TIMES[-1])[nodes] * (np.arange(3) < d)
    np.testing.assert_allclose(grid.warp_by_vector("displacement").points, grid.points + moved, atol=1e-15)


@pytest.mark.vtk
@pytest.mark.parametrize("k", range(len(ZONES)))
def test_a_slave_skin_has_its_fields(run, k):
    grid, nodes = at_last(run, contact_stems(ZONES)[ZONES[k]])
    zone, mesh = zone_fields(run.space, TIMES[-1], k), run.space.mesh
    order = np.argsort(mesh.cell_number[zone.surface.cell])
    rows = order[np.searchsorted(mesh.cell_number[zone.surface.cell][order], grid.cell_data["cell_number"])]
    assert np.array_equal(mesh.cell_number[zone.surface.cell[rows]], grid.cell_data["cell_number"])
    assert sorted(rows) == list(range(len(zone.surface)))
    for name in ("pressure", "gap", "coverage", "status"):
        np.testing.assert_array_equal(grid.cell_data[name], getattr(zone, name)[zone.macro[rows]])
    assert np.isnan(grid.cell_data["gap"]).any() and -1 in grid.cell_data["status"]
    np.testing.assert_array_equal(grid.cell_data["macro"], zone.number[zone.macro[rows]])
    d = run.space.dim
    np.testing.assert_array_equal(grid.cell_data["normal"][:, :d], zone.normal[zone.macro[rows]])
    np.testing.assert_array_equal(grid.point_data["pressure_recovered"], zone.pressure_recovered[nodes])
    np.testing.assert_array_equal(grid.point_data["contact_force"][:, :d], zone.contact_force[nodes])
    if d == 3:  # faces turn outward, as the normals do
        turned = grid.extract_surface(algorithm="dataset_surface").compute_normals(
            auto_orient_normals=False, consistent_normals=False, cell_normals=True, point_normals=False
        )
        assert np.allclose(turned.cell_data["Normals"], (0, 0, 1), atol=1e-6)


def test_lacmesh_reads_what_is_written(run):
    mesh = read(run.folder / "fields" / "solid_0003.vtu")
    expected = fields(run.space, 0.75)
    nodes = np.searchsorted(run.space.mesh.node_number, mesh.node_number)
    assert np.array_equal(mesh.node_data["displacement"][:, : run.space.dim], expected.displacement[nodes])
    assert "lac_parent" in mesh.cell_data and set(mesh.node_groups) == {"first"}


def test_faces_of_several_types_keep_their_values(tmp_path):
    mesh = two_blocks(3, ("HEXA8", "HEXA8"), plate=False)
    space = Space.of(mesh, "3d")
    cells = np.random.default_rng(3).permutation(np.flatnonzero(mesh.cell_dim == 2))
    surface = Surface.of(mesh, cells)
    rows = np.arange(len(surface))
    zone = zone_fields(space, 1.0)
    own = {name: rows * 1.0 for name in ("pressure", "gap", "coverage")}
    zone = replace(zone, surface=surface, macro=rows, number=rows, status=rows, normal=np.eye(3)[rows % 3], **own)
    VtuSeries(tmp_path, space).write(replace(fields(space, 1.0), zones={"a": zone}), 1)
    back = read(tmp_path / "fields" / "contact_a_0001.vtu")
    assert set(back.cells_by_type) == {"TRIA3", "QUAD4"}
    expected = dict(zip(mesh.cell_number[surface.cell].tolist(), rows, strict=True))
    assert [expected[n] for n in back.cell_number.tolist()] == back.cell_data["pressure"].tolist()


def whole_fields(space):
    n = space.mesh.n_nodes
    return Fields(1.0, np.zeros((n, space.dim)), np.ones((n, space.model.n_stress)), np.zeros((n, space.dim)), {})


@pytest.mark.vtk
@pytest.mark.parametrize("name", [*SOLIDS, *PLANES])
def test_every_cell_of_a_body_is_shown(tmp_path, name):
    import pyvista

    space = Space.of(*((cube(name, 1), "3d") if CELLS[name].dim == 3 else (square(name, 1), "plane_stress")))
    if name == "PYRAM14":
        with pytest.warns(LacmeshWarning, match="6 PYRAM14 are written as PYRAM13"):
            VtuSeries(tmp_path, space).write(whole_fields(space), 1)
    else:
        VtuSeries(tmp_path, space).write(whole_fields(space), 1)
    grid = pyvista.read(tmp_path / "fields" / "solid_0001.vtu")
    assert grid.n_cells == sum(len(b.nodes) for b in space.blocks)
    if name != "TRIA7":  # VTK has no measure of it
        sizes = grid.compute_cell_sizes(length=False)["Volume" if space.dim == 3 else "Area"]
        assert sizes.min() > 0 and sizes.sum() == pytest.approx(1.0, rel=1e-6)


def test_pyramids_of_13_and_14_nodes_stand_together():
    full, serendipity = mixture("2-full"), mixture("2")
    n = full.n_nodes
    blocks = {b.type: [b.nodes] for b in full.blocks}
    blocks["PYRAM13"] = [serendipity.block("PYRAM13") + n]
    points = np.vstack([full.points, serendipity.points + 9.0])
    mesh = Mesh.create(points, [(kind, np.concatenate(rows)) for kind, rows in blocks.items()])
    with pytest.warns(LacmeshWarning, match="PYRAM14"):
        part = body(Space.of(mesh, "3d"))
    assert part.mesh.cells_by_type["PYRAM13"] == 2 * len(serendipity.block("PYRAM13"))
    assert sorted(part.cells) == list(range(mesh.n_cells))
    for kind, rows, nodes in part.mesh.select(np.arange(part.mesh.n_cells)):
        for row, ours in zip(rows, nodes, strict=True):
            ((was, _, theirs),) = mesh.select(part.cells[[row]])
            assert CELLS[was].linear == CELLS[kind].linear
            assert np.array_equal(part.nodes[ours], theirs[0, : len(ours)])


def test_a_pvd_that_is_damaged_is_told(tmp_path):
    (tmp_path / "solid.pvd").write_text('<VTKFile><Collection><DataSet file="a"/></Collection></VTKFile>')
    with pytest.raises(ReadError, match="cannot be gone on with"):
        read_pvd(tmp_path / "solid.pvd")
