"""`lacmesh view`: what is drawn (faces, colours, places, legend), pictures, pages in a browser, refusals."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin, generate, raise_order, view
from lacmesh.cells import CELLS
from lacmesh.drawing import BODIES, MASTER, OPACITY, RAMP, SEVERITIES, Drawing, rgb
from lacmesh.errors import DataError, LacmeshWarning, RequestError, WriteError
from lacmesh.grids import PALETTE, face_colours, grid_of, outer_faces
from lacmesh.reference.quadrature import measure
from lacmesh.view import cell_values, page, picture, plotter
from tests.meshes import cell_with_faces, random_mesh
from tests.viewing import DATA, DRAG, shown, tones

pyvista = pytest.importorskip("pyvista")
pytestmark = pytest.mark.vtk
SOLIDS = [name for name, cell in CELLS.items() if cell.dim == 3]
SURFACES = [name for name, cell in CELLS.items() if cell.dim == 2]
SMALL = (480, 300)


@pytest.fixture
def blocks(tmp_path):
    """The two blocks, cut, in the file blocks.msh."""
    lacmesh.write(tmp_path / "blocks.msh", cut_skin(lacmesh.read(DATA / "two_blocks.msh"), "slave").mesh)


class Finding(NamedTuple):
    """A finding, as a check has it."""

    severity: str
    message: str
    cells: tuple[int, ...] = ()
    nodes: tuple[int, ...] = ()


def cube(n=2):
    """A cube of HEXA8 whose facets at z = 0 are the group `slave`."""
    return generate.box(n).only("body", "bottom").renamed(bottom="slave", body="")


def two_cubes():
    """A cube on another; the upper one, from z = 0 on, carries the slave skin, the lower one the master."""
    lower, upper = generate.box(3).only("body", "top"), generate.box(2).only("body", "bottom")
    return generate.stack(lower, upper).moved((0, 0, -1)).renamed(lower="", upper="")


def sandwich():
    """Three cubes on one another, each a group; the group `slave` is on both sides of the middle one."""
    foot, core, lid = (
        generate.box(2).renamed(body=name).moved((0, 0, k)) for k, name in enumerate(("foot", "core", "lid"))
    )
    skin = core.only("core", "bottom", "top").renamed(bottom="slave", top="slave")
    return lacmesh.join(foot.only("foot"), skin, lid.only("lid"))


def flange():
    return lacmesh.read(lacmesh.example("flange.msh"))


def drawing_of(mesh, slave=None, master=None, cutaway=None):
    return Drawing(mesh, slave, master, cutaway, SMALL, off_screen=True)


def actors_of(plot):
    """The actors in space of a plotter, up to date."""
    actors = [actor for actor in plot.renderer.actors.values() if isinstance(actor, pyvista.Actor)]
    for actor in actors:
        actor.mapper.Update()
    return actors


def drawn(plot):
    """The colours of the faces of each actor in a plotter, with their number and opacity."""
    faces = [actor for actor in actors_of(plot) if "colour" in actor.mapper.dataset.cell_data]
    return [(np.asarray(a.mapper.dataset["colour"]), a.mapper.dataset.n_cells, a.prop.opacity) for a in faces]


def words_of(plot):
    return [actor.input for actor in plot.renderer.actors.values() if isinstance(actor, pyvista.Text)]


# ---- faces


@pytest.mark.parametrize("name", SOLIDS + SURFACES)
def test_the_skin_of_a_solid_is_closed_and_a_surface_is_drawn_whole(name):
    mesh = cell_with_faces(name, facets=())
    faces = outer_faces(grid_of(mesh)).extract_surface(algorithm="dataset_surface", nonlinear_subdivision=4)
    size = measure(name, mesh.points[mesh.block(name)]).sum()
    assert (faces.triangulate().volume if CELLS[name].dim == 3 else faces.area) == pytest.approx(size, rel=2e-3)
    assert CELLS[name].dim < 3 or faces.clean().n_open_edges == 0


def test_curved_faces_are_drawn_curved():
    """A unit disc of one QUAD9: its edges are arcs to second order."""
    angle = np.pi / 4 * np.array([-3, -1, 1, 3, -2, 0, 2, 4])
    x = np.vstack([np.column_stack([np.cos(angle), np.sin(angle)]), [[0, 0]]])
    drawing = drawing_of(Mesh.create(x, [("QUAD9", [np.arange(9)])]))
    drawing.add_bodies(1.0)
    parts = [actor.mapper.dataset for actor in actors_of(drawing.plot)]
    assert min(np.linalg.norm(part.points, axis=1).min() for part in parts if part.n_lines) > 0.98
    assert max(part.area for part in parts) == pytest.approx(3.1, rel=0.02)


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (3, 1), (3, 2), (3, 3)])
def test_neighbours_have_different_colours(dim, order):
    drawing = drawing_of(cut_skin(random_mesh(np.random.default_rng(1), dim, order, slaves=100), "slave").mesh)
    slave = drawing.part(drawing.slaves)
    macro = drawing._macros(slave)
    colour = face_colours(slave, macro)
    nodes = [set(slave.get_cell(k).point_ids) for k in range(slave.n_cells)]
    for a in range(slave.n_cells):
        for b in range(a):
            assert macro[a] != macro[b] or colour[a] == colour[b]
            assert macro[a] == macro[b] or len(nodes[a] & nodes[b]) < dim - 1 or colour[a] != colour[b]


@pytest.mark.parametrize("order", ["1", "2", "2-full"])
def test_a_cut_shows_its_macros_and_internal_nodes_and_the_master_a_colour_of_its_own(order):
    mesh = two_cubes() if order == "1" else raise_order(two_cubes(), order)
    plot = plotter(cut_skin(mesh, "slave").mesh, master="master", size=SMALL)
    colours = np.unique(np.concatenate([faces for faces, _, _ in drawn(plot)]), axis=0).tolist()
    assert set(map(tuple, colours)) <= set(map(tuple, rgb([*BODIES, *PALETTE, MASTER]).tolist()))
    assert rgb([MASTER])[0].tolist() in colours and sum(c in rgb(PALETTE).tolist() for c in colours) == 4
    words = " ".join(words_of(plot))
    assert "4 macro-elements, made of" in words and "9 master faces" in words and "internal nodes, each with" in words
    both = drawing_of(cube(2), "slave", "slave")
    assert (len(both.slaves), len(both.masters)) == (4, 0)
    plot.close()


# ---- places and the camera


def test_bodies_move_apart_where_a_gap_is_given():
    mesh = cut_skin(two_cubes(), "slave").mesh
    moved = drawing_of(mesh)
    assert moved.move_apart(0.5) and not drawing_of(mesh).move_apart(None)
    assert moved.part(moved.slaves).points[:, 2] == pytest.approx(0.5 * np.sqrt(6))
    assert drawing_of(generate.stack(generate.rectangle(2), generate.rectangle(2)), "slave", "master").move_apart(None)
    alone = cut_skin(cube(2), "slave").mesh
    for words, other in (("no other body", alone), ("no other body", two_cubes()), ("every way", sandwich())):
        with pytest.warns(LacmeshWarning, match=f"moves nothing.* {words}"):
            drawing_of(other, "slave" if other.zones or words == "every way" else None).move_apart(0.5)


@pytest.mark.parametrize(
    ("mesh", "slave", "bodies"),
    [(sandwich, "slave", "ghost"), (two_cubes, "slave", "ghost"), (cube, "slave", "solid"), (flange, "nut", "ghost")],
)
def test_bodies_are_ghosts_where_others_hide_the_slave(mesh, slave, bodies):
    plot = plotter(mesh(), slave=slave, size=SMALL)
    assert drawn(plot)[0][2] == OPACITY[bodies]
    plot.close()
    plot = plotter(mesh(), slave=slave, values=cell_values(mesh()), size=SMALL)
    assert drawn(plot)[0][2] == 1.0
    plot.close()


def test_bodies_may_be_seen_through_or_hidden_and_have_the_names_of_their_groups():
    for bodies in ("solid", "ghost", "hidden"):
        plot = plotter(two_cubes(), slave="slave", bodies=bodies, size=SMALL)
        assert [opacity for _, _, opacity in drawn(plot)] == [OPACITY[bodies]] * (bodies != "hidden") + [1.0]
        plot.close()
    words = words_of(plotter(sandwich(), size=SMALL))
    assert [line for line in words if line.startswith("body")][::-1] == ["body 'foot'", "body 'core'", "body 'lid'"]


def test_a_cutaway_leaves_half_whatever_the_length_of_a_direction():
    for scale in (2, 1e-320, 1e-200, 1e300):
        drawing = drawing_of(cut_skin(cube(4), "slave").mesh, cutaway=(0, 0, scale))
        assert drawing.part(drawing.bodies).bounds[5] == pytest.approx(0.5)
        np.testing.assert_allclose(drawing.eye((scale, 0, scale)), [np.sqrt(0.5), 0, np.sqrt(0.5)], rtol=1e-3)


@pytest.mark.rows("size0-eye3", "size1-eye2")
@pytest.mark.parametrize("eye", [(1, -1.6, 0.9), (0, 0, 1), (0, 0, -3), (0, 1, 0)])
@pytest.mark.parametrize("size", [(1600, 1000), (400, 900)])
def test_everything_is_inside_the_frame(eye, size):
    """Nodes of no cell and groups of none are not part of it."""
    near = two_cubes()
    points, groups = np.vstack([near.points, [[1e3, 0, 0], [0, 1e3, 5]]]), {**near.cell_groups, "none": []}
    plot = plotter(Mesh.create(points, near.blocks, cell_groups=groups), slave=["slave", "none"], camera=eye, size=size)
    camera = plot.camera
    back, up = np.subtract(camera.position, camera.focal_point), np.array(camera.up)
    x = np.vstack([actor.mapper.dataset.points for actor in actors_of(plot)]) - camera.focal_point
    height, width = (
        x @ up / camera.parallel_scale,
        x @ np.cross(up, back / np.linalg.norm(back)) / camera.parallel_scale,
    )
    assert -1 < height.min() < height.max() < 0.87 and (np.abs(width) < size[0] / size[1]).all()
    plot.close()


# ---- findings and values


def test_findings_name_cells_by_the_numbers_of_the_file():
    mesh = two_cubes()
    cells, nodes = 1000 - 3 * np.arange(mesh.n_cells), 5 * np.arange(mesh.n_nodes) + 7
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_groups=mesh.cell_groups, cell_number=cells, node_number=nodes)
    one, other = mesh.cell_groups["slave"][:2]
    solid = int(np.flatnonzero(mesh.cell_dim == 3)[0])
    findings = [
        Finding("info", "by the way", cells=(cells[one],)),
        Finding("warning", "poor", cells=(cells[solid], 999_999)),
        Finding("error", "twice", cells=(cells[one], cells[other]), nodes=(12,)),
    ]
    plot = plotter(mesh, slave="slave", findings=findings, size=SMALL)
    red, orange = (rgb([SEVERITIES[severity]])[0].tolist() for severity in ("error", "warning"))
    marked = [(n, opacity) for colours, n, opacity in drawn(plot) for c in (red, orange) if (colours == c).all()]
    assert marked == [(6, 1.0), (6, 0.3), (2, 1.0), (2, 0.3)]
    words = words_of(plot)
    assert [w for w in words if ":" in w][::-1] == ["error: twice", "warning: poor", "info: by the way"]
    assert not any((colours == rgb(PALETTE[:1])).all(axis=1).any() for colours, _, _ in drawn(plot))
    plot.close()
    many = [Finding("warning", f"finding {k}", cells=(k + 1,)) for k in range(12)]
    assert "and 7 more findings" in words_of(plotter(two_cubes(), findings=many, size=SMALL))
    assert "the check found nothing to say" in words_of(plotter(two_cubes(), findings=[], size=SMALL))


def test_cells_are_coloured_by_a_value_and_invalid_ones_are_red():
    mesh = cut_skin(two_cubes(), "slave").mesh
    values = cell_values(mesh)
    assert np.isnan(values.values[mesh.cell_dim < 2]).all() and (values.bad, values.good) == (0.0, 1.0)
    faces, _, _ = drawn(plotter(mesh, values=values, size=SMALL))[0]
    assert set(np.unique(faces)) <= set(values.values)
    worse = cell_values(mesh, "edge_ratio")
    assert worse.bad > worse.good == 1.0
    for name, words in (("jacobia", "did you mean"), ("warpage", "no cell of this mesh")):
        with pytest.raises(RequestError, match=words):
            cell_values(mesh.only("slave") if name == "warpage" else mesh, name)
    folded = cube(2).moved(lambda x: x + 0.7 * (x == 0.5).all(axis=0))  # the inner node, beyond a corner
    values = cell_values(folded)
    plot = plotter(folded, values=values, size=SMALL)
    assert any(w.startswith(f"{values.invalid.sum()} invalid cell") for w in words_of(plot)) and values.invalid.any()
    assert any((colours == rgb(["#cc1f1a"])).all() for colours, _, _ in drawn(plot) if colours.ndim == 2)


# ---- pictures


@pytest.mark.slow
def test_pictures_have_their_size_and_colours_and_are_twice_the_same(blocks, run, tmp_path):
    from PIL import Image

    for name in ("one.png", "two.png"):
        assert run(f"view blocks.msh --master master -o {name} --size 480x300").startswith(f"{name}: ")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    assert min(tones(tmp_path / "one.png", *PALETTE[:4], MASTER)) > 60
    assert sorted(p.name for p in tmp_path.iterdir()) == ["blocks.msh", "one.png", "two.png"]
    picture(two_cubes(), tmp_path / "valued.png", values=cell_values(two_cubes()), size=SMALL)
    assert tones(tmp_path / "valued.png", RAMP[-1])[0] > 5000  # cubes are ideal
    picture(two_cubes(), tmp_path / "pixel.png", size=(1, 1))
    picture(generate.line(2, (0, 0), (1, 0)), tmp_path / "lines.png", size=(60, 200))
    for name, size in (("one.png", SMALL), ("pixel.png", (1, 1)), ("lines.png", (60, 200))):
        with Image.open(tmp_path / name) as image:
            assert image.size == size


# ---- refused


def test_a_picture_without_a_package_a_renderer_or_a_folder(tmp_path, monkeypatch):
    with pytest.raises(WriteError, match="nowhere"):
        picture(cube(), tmp_path / "nowhere" / "a.png", size=SMALL)
    with pytest.raises(RequestError, match="nothing to draw"):
        picture(Mesh.create([[0, 0], [1, 0]], [("POI1", [[0]])]), tmp_path / "a.png")
    for draw, name in ((picture, "a.jpg"), (page, "a.png")):
        with pytest.raises(RequestError, match="is written as"):
            draw(cube(), tmp_path / name)
    with pytest.raises(DataError, match="too far away"):
        picture(cube().moved(lambda x: 1e200 * x), tmp_path / "a.png")
    for package, draw, name in (("pyvista", picture, "a.png"), ("trame_pyvista", page, "a.html")):
        monkeypatch.setattr("lacmesh.errors.find_spec", lambda name, missing=package: None if name == missing else name)
        with pytest.raises(RequestError, match=f"needs {package}; pip install"):
            draw(cube(), tmp_path / name)
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: name)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(view.sys, "platform", "linux")
    monkeypatch.setattr(view.subprocess, "run", lambda *words, **options: SimpleNamespace(returncode=-11))
    view.check_renderer.cache_clear()
    with pytest.raises(WriteError, match="apt-get install libegl1"):
        picture(cube(), tmp_path / "a.png")
    view.check_renderer.cache_clear()
    assert not list(tmp_path.iterdir())


# ---- pages


@pytest.mark.browser
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_page_opens_offline_and_turns(blocks, run):
    pytest.importorskip("trame_pyvista")
    run("view blocks.msh --master master -o blocks.html")
    page, dragged = Path("blocks.html").resolve(), Path("dragged.html").resolve()
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["']https?:""", text) and page.stat().st_size < 5e6
    dragged.write_text(text.replace("</body>", f"{DRAG}</body>"), encoding="utf-8")
    (before, said), (after, _) = shown(page), shown(dragged)
    assert before != after and not [line for line in said if "error" in line.lower()]
