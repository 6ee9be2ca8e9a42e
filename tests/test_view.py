"""Pictures: what is in the scene, of every cell type; what is said where nothing can be drawn; a PNG."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, raise_order, scene, view
from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import GroupNotFoundError, RequestError, WriteError
from lacmesh.quadrature import measure
from lacmesh.scene import PALETTE, camera_of, make_scene
from tests.meshes import box, cell_with_faces, random_mesh

SOLIDS = [name for name, cell in CELLS.items() if cell.dim == 3]
SURFACES = [name for name, cell in CELLS.items() if cell.dim == 2]


def cube(n=2, slave_side=0, **rest):
    """A cube of HEXA8 whose facets at z = 0 (or 1) are the group `slave`."""
    points, hexahedra = box(n)
    low = hexahedra[:, [0, 3, 2, 1]] if slave_side == 0 else hexahedra[:, 4:]
    skin = low[(points[low][:, :, 2] == slave_side).all(axis=1)]
    faces = np.arange(len(skin))
    return Mesh.create(points, [("QUAD4", skin), ("HEXA8", hexahedra)], cell_groups={"slave": faces}, **rest)


def two_cubes():
    """A cube on another; the upper one carries the slave skin."""
    upper = cube(2)
    points, hexahedra = box(3)
    return Mesh.create(
        np.vstack([upper.points, points - [0, 0, 1]]),
        [("QUAD4", upper.block("QUAD4")), ("HEXA8", np.vstack([upper.block("HEXA8"), hexahedra + upper.n_nodes]))],
        cell_groups=upper.cell_groups,
    )


def layers(drawn, kind):
    return [layer for layer in drawn.layers if layer.kind == kind]


def flux(drawn):
    """The volume inside the triangles of a scene, by the divergence theorem; and their area."""
    volume = area = 0.0
    for layer in layers(drawn, "faces"):
        a, b, c = np.moveaxis(layer.points[layer.cells], 1, 0)
        n = np.cross(b - a, c - a) / 2
        assert ((n * layer.normals[layer.cells[:, 0]]).sum(axis=1) > 0).all()
        volume += (n * (a + b + c)).sum() / 9
        area += np.linalg.norm(n, axis=1).sum()
    return volume, area


@pytest.mark.parametrize("name", SOLIDS)
def test_the_skin_of_every_solid_is_closed_and_turns_outward(name):
    mesh = cell_with_faces(name, facets=())
    volume = measure(name, mesh.points[mesh.block(name)]).sum()
    assert flux(make_scene(mesh))[0] == pytest.approx(volume, rel=1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_every_surface_cell_is_drawn_whole(name):
    mesh = cell_with_faces(name, facets=())
    assert flux(make_scene(mesh))[1] == pytest.approx(measure(name, mesh.points[mesh.block(name)]).sum(), rel=1e-12)


@pytest.mark.parametrize("name", [n for n, c in ALL_CELLS.items() if c.order == 3 and c.dim > 1])
def test_cells_of_higher_order_are_drawn_by_their_corners(name):
    cell, linear = ALL_CELLS[name], CELLS[ALL_CELLS[name].linear]
    corners = np.pad(np.array(linear.reference), ((0, cell.n_nodes - cell.n_corners), (0, 3 - cell.dim)))
    drawn = make_scene(Mesh.create(corners, [(name, [np.arange(cell.n_nodes)])]))
    assert sum(len(layer.cells) for layer in layers(drawn, "lines")) == len(linear.edges)


def test_curved_faces_are_drawn_curved():
    """A unit disc of one QUAD9: its edges are arcs to second order."""
    angle = np.pi / 4 * np.array([-3, -1, 1, 3, -2, 0, 2, 4])
    x = np.vstack([np.column_stack([np.cos(angle), np.sin(angle)]), [[0, 0]]])
    mesh = Mesh.create(x, [("QUAD9", [np.arange(9)])])
    assert flux(make_scene(mesh))[1] == pytest.approx(measure("QUAD9", mesh.points[None]).sum(), rel=0.02)
    radius = np.linalg.norm(np.vstack([layer.points for layer in layers(make_scene(mesh), "lines")]), axis=1)
    assert radius.min() > 0.98


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (3, 1), (3, 2), (3, 3)])
@pytest.mark.parametrize("seed", range(4))
def test_neighbours_have_different_colours(dim, order, seed):
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves=100)
    cut = cut_skin(mesh, "slave").mesh
    shown = scene._find_shown(cut, np.flatnonzero(cut.cell_data["lac_macro"] >= 0), None, None)
    colour = scene._paint(shown)
    ends, face = scene._edges(shown.slaves) if dim == 3 else (shown.slaves.nodes[:, :2], np.arange(len(shown.slaves)))
    for key in {tuple(sorted(e[:2])) for e in ends}:
        faces = face[[tuple(sorted(e[:2])) == key for e in ends]]
        assert len(set(colour[faces])) == len(set(shown.macro[faces]))
    for macro in np.unique(shown.macro):
        assert len(set(colour[shown.macro == macro])) == 1


@pytest.mark.parametrize("order", ["1", "2", "2-full"])
def test_a_cut_shows_its_macros_and_internal_nodes(order):
    mesh = cube(3) if order == "1" else raise_order(cube(3), order)
    cut = cut_skin(mesh, "slave")
    drawn = make_scene(cut.mesh)
    (dots,) = layers(drawn, "dots")
    expected = np.concatenate(cut.internal_nodes)
    np.testing.assert_array_equal(dots.points, cut.mesh.points[np.sort(expected)])
    assert flux(drawn) == pytest.approx((1.0, 6.0))
    assert drawn.legend[0][1].startswith("9 macro-elements")
    assert {"macro", "dot"} == {kind for kind, _ in drawn.legend}


def test_segments_of_a_plane_cut():
    square = Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1]], [("SEG2", [[0, 1]]), ("QUAD4", [[0, 1, 2, 3]])], cell_groups={"slave": [0]}
    )
    cut = cut_skin(square, "slave")
    drawn = make_scene(cut.mesh)
    ends, internal = layers(drawn, "dots")
    assert {tuple(p) for p in ends.points} == {(0, 0, 0), (1, 0, 0)}
    assert len(internal.points) == len(cut.internal_nodes[0])
    assert tuple(drawn.eye) == (0, 0, 1)


def test_a_hidden_skin_is_turned_towards_the_eye():
    mesh = cut_skin(two_cubes(), "slave").mesh
    drawn = make_scene(mesh)
    body, skin = layers(drawn, "faces")
    normal = skin.normals.mean(axis=0)
    assert normal @ drawn.eye == pytest.approx(np.cos(np.radians(scene.SEEN_AT)))
    assert skin.points[:, 2].min() > 0.1  # the lower cube ends at z = 0
    assert flux(drawn)[0] == pytest.approx(2.0)
    still = make_scene(mesh, explode=0, tilt=0)
    assert np.ptp(still.layers[1].points[:, 2]) == 0
    lifted = make_scene(mesh, explode=0.5, tilt=0)
    assert lifted.layers[1].points[:, 2] == pytest.approx(0.5 * np.sqrt(6))
    assert body.points[:, 2].min() == -1


def test_a_skin_that_nothing_hides_stays():
    mesh = cut_skin(cube(2), "slave").mesh
    drawn = make_scene(mesh, explode=0.5, tilt=30)
    assert drawn.layers[1].points[:, 2] == pytest.approx(0)
    assert drawn.eye[2] < 0


def test_cutaway_and_near():
    mesh = cube(4)
    assert flux(make_scene(mesh, cutaway=(1, 0, 0)))[0] == pytest.approx(0.5)
    assert flux(make_scene(mesh, "slave", near=0.2))[0] == pytest.approx(0.25)
    bare = make_scene(mesh, cutaway=(0, 0, 2)).layers[0]
    inside = (bare.rgb == scene._rgb((scene.INSIDE,))).all(axis=1)
    assert inside.sum() == 4 * 16
    assert bare.points[inside][:, 2] == pytest.approx(0.5)
    with pytest.raises(RequestError, match="near means near slave faces"):
        make_scene(mesh, near=0.2)


def test_groups_of_a_mesh_without_a_cut_and_of_one_with():
    mesh = two_cubes()
    assert make_scene(mesh).legend == ()
    assert make_scene(mesh, "slave").legend == (("macro", "4 slave faces"),)
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        make_scene(mesh, ["slav"])
    with pytest.raises(RequestError, match="nothing to draw"):
        make_scene(Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])]))


def test_loose_shells_are_drawn_but_not_the_skin_twice():
    points, hexahedra = box(1)
    points = np.vstack([points, [[0, 0, -1], [1, 0, -1], [0, 1, -1]]])
    skin = hexahedra[:, [0, 3, 2, 1]]
    mesh = Mesh.create(points, [("HEXA8", hexahedra), ("QUAD4", skin), ("TRIA3", [[8, 9, 10]])])
    assert flux(make_scene(mesh))[1] == pytest.approx(6.5)


@pytest.mark.parametrize("eye", [(1, -1.6, 0.9), (0, 0, 1), (0, 0, -3), (0, 1, 0)])
def test_everything_is_inside_the_frame(eye):
    drawn = make_scene(two_cubes(), camera=eye)
    for size in ((1600, 1000), (400, 900)):
        camera = camera_of(drawn, size)
        back, up = np.subtract(camera["position"], camera["focal"]), np.array(camera["up"])
        x = np.vstack([layer.points for layer in drawn.layers]) - camera["focal"]
        height, width = x @ up / camera["scale"], x @ np.cross(up, back / np.linalg.norm(back)) / camera["scale"]
        assert 2 * scene.LOW - 1 - 1e-9 < height.min() < height.max() < 2 * scene.HIGH - 1 + 1e-9
        assert (np.abs(width) < size[0] / size[1]).all()
        assert max(np.ptp(height) / 2 / (scene.HIGH - scene.LOW), np.ptp(width) / 2 / 0.94 / size[0] * size[1]) > 0.999


def test_what_is_said_where_nothing_can_be_drawn(tmp_path, monkeypatch):
    mesh, target = cube(), tmp_path / "cube.png"
    with pytest.raises(RequestError, match="is written as"):
        view.picture(mesh, tmp_path / "cube.jpg")
    with monkeypatch.context() as m, pytest.raises(RequestError, match=r"pip install 'lacmesh\[view\]'"):
        m.setattr(view, "find_spec", lambda name: None)
        view.picture(mesh, target)
    monkeypatch.setattr(view, "find_spec", lambda name: True)
    died = subprocess.CompletedProcess([], -11, "", "")
    monkeypatch.setattr(view, "_draw_apart", lambda folder, window: died)
    with pytest.raises(RequestError, match=r"nothing can be drawn here; apt-get install .*libegl1"):
        view.picture(mesh, target)
    raised = subprocess.CompletedProcess([], 1, "", "Traceback\nImportError: libX11.so.6: no such file\n")
    monkeypatch.setattr(view, "_draw_apart", lambda folder, window: raised)
    with pytest.raises(RequestError, match=r"\(ImportError: libX11.so.6: no such file\)"):
        view.picture(mesh, target)
    assert not target.exists()


def test_the_modules_need_no_pyvista():
    code = "import sys, lacmesh.view; assert not {'pyvista', 'vtk', 'vtkmodules'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.vtk
def test_a_picture(tmp_path):
    from PIL import Image

    cut = cut_skin(two_cubes(), "slave")
    target = tmp_path / "cubes.png"
    view.picture(cut.mesh, target, size=(480, 300), title="two cubes")
    pixels = np.asarray(Image.open(target).convert("RGB")).reshape(-1, 3).astype(int)
    assert len(pixels) == 480 * 300
    assert 0.3 < (pixels == 255).all(axis=1).mean() < 0.9
    hue = pixels - pixels.mean(axis=1, keepdims=True)  # the light changes a colour's strength, not its tone
    for colour in scene._rgb(PALETTE[:4]).astype(float):
        tone = colour - colour.mean()
        likeness = hue @ tone / np.maximum(np.linalg.norm(hue, axis=1), 1e-9) / np.linalg.norm(tone)
        assert ((likeness > 0.98) & (np.linalg.norm(hue, axis=1) > 20)).sum() > 100
    with pytest.raises(WriteError, match="nowhere"):
        view.picture(cut.mesh, tmp_path / "nowhere" / "cubes.png", size=(80, 50))
