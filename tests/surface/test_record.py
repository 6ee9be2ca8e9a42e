"""Surfaces: faces once, outward, with neighbours; patches of every shape."""

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.surface import Surface
from lacmesh.surface.coverage import face_measure
from lacmesh.surface.maps import AFFINE, BILINEAR, CURVED, basis, coefficients, kinds, monomials
from lacmesh.surface.patches import patches, reference_grid
from lacmesh.surface.record import mean_normals
from lacmesh.topology.skin import FACE_TYPES
from tests.meshes import cell_with_faces
from tests.surface.surfaces import TYPES, blocks, line, mapped, sheet, whole

SOLIDS = [name for name, cell in CELLS.items() if cell.dim >= 2 and cell.facets]


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("inward", [False, True])
def test_normals_leave_the_cell_behind_whatever_way_faces_are_listed(name, inward):
    mesh = cell_with_faces(name, range(len(CELLS[name].facets)), rotation=1, inward=inward)
    surface = Surface.of(mesh, mesh.cell_groups["slave"])
    normal, centre = mean_normals(surface)
    (corners,) = [b.nodes[0, : CELLS[name].n_corners] for b in mesh.blocks if b.type == name]
    out = centre - mesh.points[corners].mean(axis=0)
    assert ((normal * out).sum(axis=1) > 0).all()
    assert (surface.depth > 0).all()
    assert np.allclose((face_measure(surface)[:, None] * normal).sum(axis=0), 0, atol=1e-12)


def test_a_cell_that_is_inside_out_still_has_an_outside():
    mesh = cell_with_faces("HEXA8", range(6))
    turned = Mesh.create(
        mesh.points,
        [(b.type, b.nodes[:, [4, 5, 6, 7, 0, 1, 2, 3]] if b.type == "HEXA8" else b.nodes) for b in mesh.blocks],
    )
    skin = mesh.cell_groups["slave"]
    assert np.array_equal(Surface.of(turned, skin).faces.nodes, Surface.of(mesh, skin).faces.nodes)


def test_duplicates_are_taken_once_and_bare_skins_keep_their_orientation():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    mesh = Mesh.create(points, [("QUAD4", [[3, 2, 1, 0], [0, 1, 2, 3]])], space_dim=3)
    surface = whole(mesh)
    assert surface.cell.tolist() == [0] and surface.faces.nodes[0, :4].tolist() == [3, 2, 1, 0]
    assert np.isnan(surface.depth[0])


def test_a_face_between_two_cells_keeps_its_orientation():
    mesh = blocks(1, 0.0, 1.0)
    lower = mesh.block("HEXA8")[0]
    points = np.concatenate([mesh.points, mesh.points[lower[:4]] - [0, 0, 1]])
    second = np.concatenate([len(mesh.points) + np.arange(4), lower[:4]])
    for face in (lower[:4], lower[[0, 3, 2, 1]]):
        both = Mesh.create(points, [("HEXA8", [lower, second]), ("QUAD4", [face])])
        surface = Surface.of(both, np.array([2]))
        assert np.array_equal(surface.faces.nodes[0, :4], face) and np.isnan(surface.depth[0])


@pytest.mark.parametrize(("cells", "words"), [([], "at least one"), ([0, 1], "dimensions 2, 3"), ([0], "dimensions 3")])
def test_what_is_no_surface_is_refused(cells, words):
    mesh = cell_with_faces("HEXA8")
    with pytest.raises(DataError, match=words):
        Surface.of(mesh, np.array(cells, int))


def test_segments_in_space_are_refused():
    mesh = Mesh.create([[0, 0, 0], [1, 0, 1.0]], [("SEG2", [[0, 1]])], space_dim=3)
    with pytest.raises(DataError, match="z = constant"):
        whole(mesh)


def test_higher_order_faces_are_refused_by_name():
    mesh = Mesh.create(np.random.default_rng(0).random((10, 3)), [("TRIA10", [list(range(10))])])
    with pytest.raises(DataError, match="TRIA10"):
        whole(mesh)


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA6", "mixed"])
def test_neighbours_share_an_edge_and_are_mutual(kind):
    surface = whole(sheet(4, kind=kind))
    for f, row in enumerate(surface.neighbours):
        n = surface.n_corners[f]
        for k, other in enumerate(row):
            if k >= n or other < 0:
                continue
            edge = {surface.faces.nodes[f, k], surface.faces.nodes[f, (k + 1) % n]}
            assert edge <= set(surface.faces.nodes[other].tolist()) and f in surface.neighbours[other]
    border = (surface.neighbours < 0).sum() - (4 - surface.n_corners).sum()
    assert border == 16


def test_neighbours_of_segments():
    surface = whole(line(3))
    assert sorted(surface.neighbours[1][:2].tolist()) == [0, 2]
    assert (surface.neighbours[[0, 2]] >= 0).sum() == 2


@pytest.mark.parametrize("name", FACE_TYPES[1:])
def test_maps_in_monomials_are_those_of_the_shape_functions(name):
    from lacmesh.reference.shapes import shape

    X = np.random.default_rng(1).uniform(-1, 1, (5, 2))
    if CELLS[name].dim == 1:
        X[:, 1] = 0
    N = shape(name, X[:, : CELLS[name].dim])
    assert np.allclose(monomials(X) @ basis(FACE_TYPES.index(name)), N, atol=1e-14)


def test_kinds_of_maps():
    flat = whole(sheet(3, kind="mixed 2"))
    assert set(kinds(coefficients(flat), flat.n_corners)[0]) == {AFFINE}
    skewed = whole(sheet(3, kind="QUAD8", skew=0.2))
    kind, warp, curved = kinds(coefficients(skewed), skewed.n_corners)
    assert set(kind) == {BILINEAR} and not warp.any() and not curved.any()
    rng = np.random.default_rng(0)
    bent = whole(mapped(sheet(3, kind="QUAD8"), lambda x: x + 0.01 * rng.uniform(-1, 1, x.shape) * [1, 1, 0]))
    kind, warp, curved = kinds(coefficients(bent), bent.n_corners)
    assert set(kind) == {CURVED} and not warp.any() and (curved > 0).all()
    warped = whole(mapped(sheet(3), lambda x: x + np.outer(x[:, 0] * x[:, 1], [0, 0, 1])))
    kind, warp, _ = kinds(coefficients(warped), warped.n_corners)
    assert set(kind) == {BILINEAR} and (warp > 0.01).all()


@pytest.mark.parametrize("family", ["SEG", "TRIA", "QUAD"])
@pytest.mark.parametrize("n", [1, 2, 4])
def test_reference_grids_tile_the_element(family, n):
    cells = reference_grid(family, n)
    if family == "SEG":
        assert np.isclose(np.diff(cells[:, :2, 0], axis=1).sum(), 2)
        return
    q = np.roll(cells, -1, axis=1)
    areas = (cells[..., 0] * q[..., 1] - cells[..., 1] * q[..., 0]).sum(axis=1) / 2
    assert len(cells) == n * n and (areas > 0).all() and np.isclose(areas.sum(), 0.5 if family == "TRIA" else 4)


def test_a_quadrangle_that_goes_in_is_two_triangles():
    points = np.array([[0, 0, 0], [1, 0, 0], [0.3, 0.3, 0], [0, 1, 0.0]])
    p = patches(whole(Mesh.create(points, [("QUAD4", [[0, 1, 2, 3]])], space_dim=3)))
    assert p.n.tolist() == [3, 3] and np.isclose(p.area.sum(), 0.3)


def test_faces_without_extent_or_with_nan_have_no_patch():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [np.nan, 0, 0], [1, 1, 0]])
    mesh = Mesh.create(points, [("TRIA3", [[0, 1, 2], [0, 1, 3], [0, 1, 4]]), ("QUAD4", [[0, 1, 1, 0]])], space_dim=3)
    assert patches(whole(mesh)).face.tolist() == [1]


@pytest.mark.parametrize("kind", TYPES)
def test_moved_surfaces_keep_their_faces(kind):
    surface = whole(sheet(2, kind=kind))
    moved = surface.at(surface.x + 1)
    assert moved.faces is surface.faces and np.allclose(face_measure(moved), face_measure(surface))
    with pytest.raises(ValueError, match="coordinates"):
        surface.at(surface.x[:2])
