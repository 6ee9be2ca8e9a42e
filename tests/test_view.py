"""`lacmesh view`: what a scene holds (faces, colours, camera, legend), pictures, pages in a browser, refusals."""

from __future__ import annotations

import base64
import json
import os
import re
import signal
import subprocess
import sys
import time
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin, generate, raise_order, scene
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning, RequestError, WriteError
from lacmesh.reference.quadrature import measure
from lacmesh.scene import camera_of, colours, make_scene
from lacmesh.scene.edges import edges_of
from lacmesh.scene.marks import Values, cell_values, find_marks
from lacmesh.scene.placing import SEEN_AT
from lacmesh.scene.request import BODIES_AS
from lacmesh.scene.visible import BODY, MASTER, SLAVE, find_visible
from lacmesh.topology.skin import FACE_TYPES
from lacmesh.view import page, page_text, picture, png
from tests.meshes import cell_with_faces, facets_of, random_mesh
from tests.viewing import Browser, cut_blocks, status, tones

SOLIDS = [name for name, cell in CELLS.items() if cell.dim == 3]
SURFACES = [name for name, cell in CELLS.items() if cell.dim == 2]


class Said(NamedTuple):
    """A finding, as a check would say it."""

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


def layers(drawn, kind):
    return [layer for layer in drawn.layers if layer.kind == kind]


def coloured(layer, colour):
    return (layer.rgb == colours.rgb((colour,))).all(axis=1)


def words_of(drawn):
    return [entry.words for entry in drawn.legend]


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


# ---- faces


@pytest.mark.parametrize("name", SOLIDS + SURFACES)
def test_the_skin_of_a_solid_is_closed_and_turns_outward_and_a_surface_is_drawn_whole(name):
    mesh = cell_with_faces(name, facets=())
    volume, area = flux(make_scene(mesh))
    size = measure(name, mesh.points[mesh.block(name)]).sum()
    assert (volume if CELLS[name].dim == 3 else area) == pytest.approx(size, rel=1e-12)


def test_curved_faces_are_drawn_curved():
    """A unit disc of one QUAD9: its edges are arcs to second order."""
    angle = np.pi / 4 * np.array([-3, -1, 1, 3, -2, 0, 2, 4])
    x = np.vstack([np.column_stack([np.cos(angle), np.sin(angle)]), [[0, 0]]])
    drawn = make_scene(Mesh.create(x, [("QUAD9", [np.arange(9)])]))
    assert flux(drawn)[1] == pytest.approx(measure("QUAD9", np.pad(x, ((0, 0), (0, 1)))[None]).sum(), rel=0.02)
    assert np.linalg.norm(np.vstack([layer.points for layer in layers(drawn, "lines")]), axis=1).min() > 0.98


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (3, 1), (3, 2), (3, 3)])
@pytest.mark.parametrize("seed", range(2))
def test_neighbours_have_different_colours(dim, order, seed):
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves=100)
    visible = find_visible(cut_skin(mesh, "slave").mesh)
    slaves, macro = visible.faces.take(visible.rows(SLAVE)), visible.macro[visible.rows(SLAVE)]
    colour = colours.paint(macro, slaves.corners)
    ends, _, face = edges_of(slaves) if dim == 3 else (slaves.nodes[:, :2], None, np.arange(len(slaves)))
    for key in {tuple(sorted(e[:2])) for e in ends}:
        faces = face[[tuple(sorted(e[:2])) == key for e in ends]]
        assert len(set(colour[faces])) == len(set(macro[faces]))
    for name in np.unique(macro):
        assert len(set(colour[macro == name])) == 1


@pytest.mark.parametrize("order", ["1", "2", "2-full"])
def test_a_cut_shows_its_macros_and_internal_nodes(order):
    cut = cut_skin(cube(3) if order == "1" else raise_order(cube(3), order), "slave")
    drawn = make_scene(cut.mesh)
    (dots,) = layers(drawn, "dots")
    np.testing.assert_array_equal(dots.points, cut.mesh.points[np.sort(np.concatenate(cut.internal_nodes))])
    assert coloured(dots, colours.DOT).all()
    assert flux(drawn) == pytest.approx((1.0, 6.0))
    assert words_of(drawn)[0].startswith("9 macro-elements")
    assert [entry.kind for entry in drawn.legend] == ["area", "dot"]


def test_the_master_has_a_colour_of_its_own_and_a_face_of_both_groups_is_slave():
    mesh = cut_skin(two_cubes(), "slave").mesh
    visible = find_visible(mesh, None, "master")
    assert [len(visible.rows(role)) for role in (BODY, SLAVE, MASTER)] == [5 * 4 + 5 * 9, 16, 9]
    assert (visible.skin[visible.role == MASTER] >= 0).all() and (mesh.cell_dim[visible.cell] == 3).all()
    drawn = make_scene(mesh, None, "master")
    assert words_of(drawn)[1] == "9 master faces"
    (master,) = [layer for layer in layers(drawn, "faces") if coloured(layer, colours.MASTER).all()]
    assert len(master.cells) == 18 and flux(drawn) == pytest.approx((2.0, 12.0))
    both = find_visible(cube(2), "slave", "slave")
    assert (len(both.rows(SLAVE)), len(both.rows(MASTER))) == (4, 0)


# ---- places and the camera


def test_a_hidden_skin_is_turned_towards_the_eye_and_one_that_nothing_hides_stays():
    mesh = cut_skin(two_cubes(), "slave").mesh
    drawn = make_scene(mesh)
    body, skin = layers(drawn, "faces")
    assert skin.normals.mean(axis=0) @ drawn.eye == pytest.approx(np.cos(np.radians(SEEN_AT)))
    assert skin.points[:, 2].min() > 0.1 and body.points[:, 2].min() == -1  # the lower cube ends at z = 0
    assert flux(drawn)[0] == pytest.approx(2.0)
    assert np.ptp(make_scene(mesh, explode=0, tilt=0).layers[1].points[:, 2]) == 0
    assert make_scene(mesh, explode=0.5, tilt=0).layers[1].points[:, 2] == pytest.approx(0.5 * np.sqrt(6))
    with pytest.warns(LacmeshWarning, match="moves nothing.* none is shown"):
        make_scene(two_cubes(), explode=0.5)
    with pytest.warns(LacmeshWarning, match="moves nothing.* no other body"):
        alone = make_scene(cut_skin(cube(2), "slave").mesh, explode=0.5, tilt=30)
    assert alone.layers[1].points[:, 2] == pytest.approx(0) and alone.eye[2] < 0


def test_near_and_cutaway_lay_the_inside_bare_whatever_the_length_of_a_direction():
    mesh = cut_skin(cube(4), "slave").mesh
    assert flux(make_scene(mesh, "slave", near=0.2))[0] == pytest.approx(0.25)
    for scale in (2, 1e-320, 1e-200, 1e300):
        drawn = make_scene(mesh, cutaway=(0, 0, scale), camera=(scale, 0, scale))
        bare = drawn.layers[0]
        inside = coloured(bare, colours.INSIDE)
        assert inside.sum() == 4 * 16 and bare.points[inside][:, 2] == pytest.approx(0.5)
        np.testing.assert_allclose(drawn.eye, [np.sqrt(0.5), 0, np.sqrt(0.5)], rtol=1e-3)
    for options, words in (
        *(({"near": 0.2}, "near means near"), ({"near": float("nan"), "slave": "slave"}, "near nan")),
        *(
            ({"bodies": "gost"}, "bodies are drawn"),
            ({"camera": (1, 0)}, "camera 1 0"),
            ({"explode": -1.0}, "explode -1"),
        ),
    ):
        with pytest.raises(RequestError, match=f"^{words}"):
            page_text(cube(4), **options)


@pytest.mark.parametrize("eye", [(1, -1.6, 0.9), (0, 0, 1), (0, 0, -3), (0, 1, 0)])
def test_everything_is_inside_the_frame(eye):
    """Nodes of no cell and groups of none are not part of it."""
    near, findings = two_cubes(), [Said("error", "one", cells=(3,)), Said("warning", "two", nodes=(1,))]
    points, groups = np.vstack([near.points, [[1e3, 0, 0], [0, 1e3, 5]]]), {**near.cell_groups, "none": []}
    mesh = Mesh.create(points, near.blocks, cell_groups=groups)
    assert make_scene(near).legend == make_scene(mesh, "none").legend == ()
    for skins, said in ((None, None), (["slave", "none"], findings)):
        drawn = make_scene(mesh, skins, camera=eye, findings=said)
        for size in ((1600, 1000), (400, 900)):
            camera = camera_of(drawn, size)
            back, up = np.subtract(camera["position"], camera["focal"]), np.array(camera["up"])
            x = np.vstack([layer.points for layer in drawn.layers]) - camera["focal"]
            height, width = x @ up / camera["scale"], x @ np.cross(up, back / np.linalg.norm(back)) / camera["scale"]
            assert 2 * drawn.low - 1 - 1e-9 < height.min() < height.max() < 2 * scene.HIGH - 1 + 1e-9
            assert (np.abs(width) < size[0] / size[1]).all()
            filled = np.ptp(height) / 2 / (scene.HIGH - drawn.low), np.ptp(width) / 2 / 0.94 / size[0] * size[1]
            assert max(filled) > 0.999


BELOW = {"camera": (1, -1, 1), "explode": 0, "tilt": 0}


@pytest.mark.parametrize(
    ("mesh", "slave", "options", "moved", "ghost"),
    [
        (sandwich, "slave", {}, "", True),  # a skin on both sides of a body
        (sandwich, "slave", {"bodies": "solid"}, None, False),
        (two_cubes, "slave", BELOW, "", True),  # an underside where bodies stay
        (two_cubes, "slave", {**BELOW, "cutaway": (1, 0, 0)}, None, False),
        (two_cubes, "slave", {}, "opened, tilted", False),
        (cube, "slave", {}, None, False),
        (flange, "face_upper", {}, "opened, tilted", False),
        (flange, "nut", {}, "", True),  # above it the bolt hides the skin by itself, however it is moved
        (flange, "head", {}, "", True),
        (flange, ["face_upper", "nut", "head"], {}, "", True),
    ],
)
def test_bodies_are_ghosts_where_nothing_can_be_moved_to_show_the_slave(mesh, slave, options, moved, ghost):
    drawn = make_scene(mesh(), slave, **options)
    assert next(layer.opacity for layer in layers(drawn, "faces")) == (BODIES_AS["ghost"] if ghost else 1.0)
    assert moved is None or drawn.moved == moved
    if options.keys() <= {"camera", "explode", "tilt"}:
        text = page_text(mesh(), slave=slave, **options)
        assert f'"bodiesAs":"{"ghost" if ghost else "solid"}"' in text
        assert moved is None or f'"opened":{"true" if moved else "false"}' in text


def test_bodies_may_be_seen_through_or_hidden_and_have_the_names_of_their_groups():
    """Names in the legend with their colours, and on a page under the pointer."""
    for bodies, opacity in (("solid", [1.0]), ("ghost", [0.16]), ("hidden", [])):
        drawn = layers(make_scene(two_cubes(), "slave", bodies=bodies), "faces")
        assert [layer.opacity for layer in drawn] == [*opacity, 1.0]
    (line,) = [entry for entry in make_scene(sandwich()).legend if entry.words.startswith("bodies")]
    assert line.words == "bodies: 'foot', 'core', 'lid'" and line.colours == colours.BODIES[:3]
    assert """"bodyNames":["'foot'","'core'","'lid'"]""" in page_text(sandwich())
    assert '"bodyNames":["the body with \'master\'"' in page_text(two_cubes())  # skins alone name them


# ---- findings and values


def test_findings_name_cells_by_the_numbers_of_the_file():
    mesh = two_cubes()
    cells, nodes = 1000 - 3 * np.arange(mesh.n_cells), 5 * np.arange(mesh.n_nodes) + 7
    mesh = replace(mesh, cell_number=cells, node_number=nodes)
    one, other = mesh.cell_groups["slave"][:2]
    solid = int(np.flatnonzero(mesh.cell_dim == 3)[0])
    findings = [
        Said("info", "by the way", cells=(cells[one],)),
        Said("warning", "poor", cells=(cells[solid], 999_999)),
        Said("error", "twice", cells=(cells[one], cells[other]), nodes=(12,)),
    ]
    marks = find_marks(mesh, findings)
    assert marks.severity == ("error", "warning", "info") and marks.message[0] == "twice"
    assert sorted(marks.cell[marks.of == 0]) == [one, other] and marks.nodes.tolist() == [1]
    assert marks.cell[marks.of == 1].tolist() == [solid] * 6
    drawn = make_scene(mesh, "slave", findings=findings)
    red, orange = (colours.SEVERITIES[severity] for severity in ("error", "warning"))
    marked = [layer for layer in layers(drawn, "faces") if coloured(layer, red).any()]
    assert [layer.opacity for layer in marked] == [1.0, scene.layers.THROUGH]
    assert [(coloured(layer, red).sum(), coloured(layer, orange).sum()) for layer in marked] == [(8, 24), (8, 24)]
    assert words_of(drawn)[-3:] == ["error: twice", "warning: poor", "info: by the way"]
    assert {label.words for label in drawn.labels} == {*map(str, cells[[one, other, solid]]), "node 12"}
    assert not any(coloured(layer, colours.PALETTE[0]).any() for layer in drawn.layers)


def test_findings_on_what_is_cut_away_and_many_findings():
    mesh = cube(2)
    findings = [Said("warning", "all", cells=tuple(mesh.cell_number[mesh.cell_dim == 3].tolist()))]
    drawn = make_scene(mesh, "slave", findings=findings, cutaway=(0, 0, 1))
    marked = [layer for layer in layers(drawn, "faces") if coloured(layer, colours.SEVERITIES["warning"]).any()]
    assert [len(layer.cells) for layer in marked] == [4 * 12, 4 * 12]
    many = make_scene(two_cubes(), findings=[Said("warning", f"finding {k}", cells=(k + 1,)) for k in range(12)])
    assert words_of(many)[-1] == "and 7 more findings" and len(many.labels) == scene.LABELLED


def test_cells_are_coloured_by_a_value_and_invalid_ones_are_red():
    mesh = cut_skin(two_cubes(), "slave").mesh
    values = cell_values(mesh, "corner_jacobian")
    assert np.isnan(values.values[mesh.cell_dim < 2]).all()
    drawn = make_scene(mesh, None, "master", values=values)
    found = np.vstack([layer.rgb for layer in layers(drawn, "faces")])
    visible = find_visible(mesh, None, "master")
    expected = np.unique(colours.on_ramp(values.values[visible.cell], 0.0, 1.0), axis=0)
    np.testing.assert_array_equal(np.unique(found, axis=0), expected)
    assert any(f"cell {mesh.cell_number[values.worst(1)[0]]}" in words for words in words_of(drawn))
    slave, master, *_ = [entry for entry in drawn.legend if entry.kind == "outline"]
    assert slave.colours == (colours.INK,) and master.colours == (colours.MASTER,)
    some = make_scene(mesh, values=cell_values(mesh, "diagonal"))  # of HEXA8 alone; the children are PYRAM5
    assert "not defined" in words_of(some)[-1]
    for of, name, words in (
        (mesh, "corner_jacobia", "did you mean"),
        (cell_with_faces("TETRA4"), "oddy", "no cell of"),
    ):
        with pytest.raises(RequestError, match=words):
            cell_values(of, name)
    folded = cube(2).moved(lambda x: x + 0.7 * (x == 0.5).all(axis=0))  # the inner node, beyond a corner
    values = cell_values(folded, "corner_jacobian")
    drawn = make_scene(folded, values=values)
    assert words_of(drawn)[-1].startswith(f"{values.invalid.sum()} invalid cell") and values.invalid.any()
    assert coloured(drawn.layers[0], colours.INVALID).any()


@pytest.mark.parametrize("value", [5.0, 0.0, -3.0, 1e-12, 1e300, 1e-300])
def test_values_that_differ_by_round_off_have_one_colour_and_what_has_none_is_grey(value):
    values = np.array([value, value * (1 + 4e-15), value * (1 - 3e-15), np.nan])
    for low, high in (colours.ends_of(values), colours.ends_of(values, zero=True), (value, value)):
        found = colours.on_ramp(values, low, high)
        assert np.array_equal(found[3:], colours.rgb(colours.BODIES[:1]))
        assert low == high or np.ptp(found[:3].astype(int), axis=0).max() <= 1  # one of 256 steps
        assert low == high or (low < high and f"{low:.3g}" != f"{high:.3g}")
    ramp = Values("aspect", np.array([1.0, np.nan, 9.0, 4.0]), 9.0, 1.0, np.zeros(4, bool))
    assert ramp.worst(2).tolist() == [2, 3] and ramp.worst(9).tolist() == [2, 3, 0]
    found = colours.on_ramp(ramp.values, ramp.bad, ramp.good)
    np.testing.assert_array_equal(found[[2, 0]], colours.rgb((colours.RAMP[0], colours.RAMP[-1])))
    assert (np.diff(colours.on_ramp(np.linspace(0, 1, 50), 0.0, 1.0) @ [0.299, 0.587, 0.114]) > 0).all()


# ---- pictures


@pytest.mark.vtk
def test_pictures_have_their_size_and_colours_and_are_twice_the_same(tmp_path, capsys):
    from PIL import Image

    cut = cut_blocks(tmp_path)
    for name in ("one.png", "two.png"):
        code, said = status(capsys, cut, "--master", "master", "-o", tmp_path / name, "--size", "480x300")
        assert code == 0 and said.startswith(f"{tmp_path / name}: ")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    assert min(tones(tmp_path / "one.png", *colours.PALETTE[:4], colours.MASTER)) > 60
    assert sorted(p.name for p in tmp_path.iterdir()) == ["blocks.msh", "one.png", "two.png"]
    values = cell_values(two_cubes(), "corner_jacobian")
    picture(two_cubes(), tmp_path / "valued.png", values=values, size=(480, 300))
    assert tones(tmp_path / "valued.png", colours.RAMP[-1])[0] > 5000  # cubes are ideal
    picture(two_cubes(), tmp_path / "pixel.png", size=(1, 1))
    picture(generate.line(2, (0, 0), (1, 0)), tmp_path / "lines.png", size=(60, 200))
    for name, size in (("one.png", (480, 300)), ("pixel.png", (1, 1)), ("lines.png", (60, 200))):
        with Image.open(tmp_path / name) as image:
            assert image.size == size


# ---- refused


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        *(("-o a", "nothing is drawn"), ("-o a.html --mesh other", "other")),
        ("-o a.html --size 300x200", "--size is for"),
        *((f"-o a.html {rest}", "did you mean") for rest in ("--master mastre", "--quality corner_jacobia")),
        *(("-o a.png --camera nan 0 0", "--camera nan 0"), ("-o a.html --camera 0 inf 0", "--camera 0 inf")),
        *(("-o a.html --cutaway 0 0 0", "no direction"), ("-o a.png --cutaway 0 0 inf", "--cutaway 0 0")),
        *((f"-o a.html --explode {gap}", f"--explode {float(gap):g} is") for gap in ("nan", "inf", "-1", "100.1")),
        *((f"-o a.png --size={size}", "1600x1000") for size in ("100", "0x5", "axb", "-3x4")),
    ],
)
def test_a_wrong_request(arguments, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        code, said = status(capsys, cut_blocks(tmp_path), *arguments.split())
        assert len(said.strip().splitlines()) == 1
    except SystemExit as ended:
        code, said = ended.code, capsys.readouterr().err
    assert code == 2 and words in said and [p.name for p in tmp_path.iterdir()] == ["blocks.msh"]


def test_a_picture_without_the_extra_or_into_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(png, "find_spec", lambda name: None)
    with pytest.raises(RequestError, match="pip install"):
        picture(cube(), tmp_path / "a.png")
    page(cube(), tmp_path / "a.html")  # needs none
    monkeypatch.setattr(png, "find_spec", lambda name: True)
    monkeypatch.setattr(png, "render", lambda *arguments, **options: [b"image"])
    with pytest.raises(WriteError, match="nowhere"):
        picture(cube(), tmp_path / "nowhere" / "a.png")
    with pytest.raises(RequestError, match="nothing to draw"):
        page(Mesh.create([[0, 0], [1, 0]], [("POI1", [[0]])]), tmp_path / "a.html")
    for draw, name in ((picture, "a.jpg"), (page, "a.png")):
        with pytest.raises(RequestError, match="is written as"):
            draw(cube(), tmp_path / name)


# ---- what a renderer does


def fake_pyvista(folder, code):
    """A folder in which `import pyvista` runs some code."""
    (folder / "fake" / "pyvista").mkdir(parents=True)
    (folder / "fake" / "pyvista" / "__init__.py").write_text(code)
    return str(folder / "fake")


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "apt-get install libegl1"),
        ("raise ImportError('libX11.so.6: no such file')", "(ImportError: libX11.so.6"),
        ("import sys; sys.exit(0)", "nothing can be"),
    ],
)
def test_a_renderer_that_dies_is_one_sentence(code, words, tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(fake_pyvista(tmp_path, code))
    found, said = status(capsys, cut_blocks(tmp_path), "-o", tmp_path / "a.png")
    assert found == 3 and words in said and len(said.strip().splitlines()) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["blocks.msh", "fake"]


@pytest.mark.vtk
def test_a_drawing_that_takes_too_long(tmp_path):
    with pytest.raises(WriteError, match="was not drawn"):
        picture(cube(), tmp_path / "a.png", timeout=0.01)
    assert not (tmp_path / "a.png").exists()


def test_an_interruption_ends_the_drawing_too(tmp_path):
    pid, scratch = tmp_path / "pid", tmp_path / "scratch"
    scratch.mkdir()
    code = f"import os, pathlib, time; pathlib.Path({str(pid)!r}).write_text(str(os.getpid())); time.sleep(600)"
    env = {**os.environ, "PYTHONPATH": fake_pyvista(tmp_path, code), "TMPDIR": str(scratch)}
    command = [sys.executable, "-m", "lacmesh", "view", str(cut_blocks(tmp_path)), "-o", str(tmp_path / "a.png")]
    with subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True, start_new_session=True) as running:
        while not (pid.exists() and pid.read_text()):
            assert running.poll() is None
            time.sleep(0.05)
        running.send_signal(signal.SIGINT)
        said = running.stderr.read()
    assert running.returncode == 130 and "nothing was written" in said and len(said.strip().splitlines()) == 1
    with suppress(OSError):  # it has ended, or is about to
        assert Path(f"/proc/{pid.read_text()}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    assert not list(scratch.iterdir()) and not (tmp_path / "a.png").exists()


# ---- pages

#: names that would be markup, script or a mark of the template if they were not text
NASTY = (
    "</script><script>document.title='owned'</script>",
    "<img src=x onerror=alert(1)>",
    "%BLOCK% & %HEAD%",
    "a\"b'c\\",
)


def unpacked(path):
    """Contents of a page: its head, and its arrays."""
    text = path.read_text(encoding="utf-8")
    head = json.loads(re.search(r'id="head">(.*?)</script>', text, re.S)[1])
    block = zlib.decompress(base64.b64decode(re.search(r'id="block">(.*?)</script>', text, re.S)[1]))
    arrays = {
        name: np.frombuffer(block, np.dtype(kind).newbyteorder("<"), count, start)
        for name, (kind, start, count) in head["arrays"].items()
    }
    return head, arrays


@pytest.mark.filterwarnings("ignore:slave faces stand twice")
@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2), (3, 3)])
@pytest.mark.parametrize("seed", range(2))
def test_a_page_holds_the_faces_with_their_numbers_and_groups(dim, order, seed, tmp_path):
    """All that one cell alone has, against a table of corners; skin cells, twins, orphans and inner faces included."""
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves=6, twins=True)
    mesh = cut_skin(mesh, "slave").mesh
    mesh = replace(mesh, cell_number=mesh.cell_number + 2**40 * (seed == 0))  # beyond four bytes
    page(mesh, tmp_path / "a.html")
    head, arrays = unpacked(tmp_path / "a.html")
    cell_of, node_of = ({int(n): k for k, n in enumerate(numbers)} for numbers in (mesh.cell_number, mesh.node_number))
    on_face = {}
    for name, ids, nodes in mesh.select(np.flatnonzero((mesh.cell_dim < mesh.dim) & (mesh.cell_dim > 0))):
        for cell, row in zip(ids, nodes, strict=True):
            on_face.setdefault(frozenset(row[: CELLS[name].n_corners].tolist()), []).append(cell)
    single = {key for key, owners in facets_of(mesh).items() if len(owners) == 1}
    start, seen = 0, []
    assert len(arrays["role"]) == len(arrays["cell"]) > 0
    for f, code in enumerate(arrays["type"]):
        face = CELLS[FACE_TYPES[code]]
        own = arrays["nodes"][start : start + face.n_nodes]
        start += face.n_nodes
        nodes = [node_of[int(n)] for n in arrays["nodeNumber"][own]]
        cell = cell_of[int(arrays["cell"][f])]
        seen.append(tuple(sorted(nodes[: face.n_corners])))
        ((kind, _, _),) = mesh.select([cell])
        assert head["cellTypes"][arrays["cellType"][f]] == kind
        members = {cell, *on_face.get(frozenset(nodes[: face.n_corners]), [])}
        groups = {g for g, ids in mesh.cell_groups.items() if members & set(ids.tolist())}
        assert {head["groups"][g]["name"] for g in head["combinations"][arrays["groups"][f]]} == groups
        assert (arrays["role"][f] == SLAVE) == (arrays["skin"][f] >= 0)
        kept = np.array(head["centre"]) + head["half"] * arrays["points"].reshape(-1, 3)[own]
        np.testing.assert_allclose(kept, mesh.points[nodes], atol=1e-6 * head["half"])
    assert start == len(arrays["nodes"]) and (dim == 2 or single <= set(seen)) and len(seen) == len(set(seen))
    internal = mesh.node_number[mesh.node_data["lac_internal"] >= 0]
    assert sorted(arrays["nodeNumber"][arrays["internal"]]) == sorted(internal)


def test_a_page_is_whole_and_small_and_names_stay_text(tmp_path):
    mesh, target = two_cubes(), tmp_path / "a.html"
    groups = {**mesh.cell_groups, **{name: [k] for k, name in enumerate(NASTY)}}
    given = {"findings": [Said("error", NASTY[0], cells=(1,))], "title": NASTY[1] + "\udcff"}
    page(Mesh.create(mesh.points, mesh.blocks, cell_groups=groups), target, slave="slave", **given)
    text = target.read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:)|@import|url\(""", text)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert text.count("<script") == text.count("</script>") == 3
    assert "<img" not in text and "connect-src" not in text and "default-src 'none'" in text
    head, _ = unpacked(target)
    assert [g["name"] for g in head["groups"]][-len(NASTY) :] == list(NASTY)
    assert head["findings"][0]["message"] == NASTY[0]
    page(generate.box(70).only("body"), target)
    assert target.stat().st_size < 3e6 and len(unpacked(target)[1]["role"]) == 6 * 70**2


# ---- pages, in a browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A browser, started once."""
    started = Browser(tmp_path_factory.mktemp("browser"))
    yield started
    started.close()


def button(browser, text):
    """Press the button with some words on it."""
    found = f"[...document.querySelectorAll('aside button')].find(b => b.textContent.startsWith({text!r}))"
    browser.value(f"{found}.click()")


@pytest.mark.browser
def test_a_page_draws_every_face(tmp_path, capsys, browser):
    target = tmp_path / "blocks.html"
    assert status(capsys, cut_blocks(tmp_path), "--master", "master", "--quality", "-o", target)[0] == 0
    browser.open(target)
    _, arrays = unpacked(target)
    bodies, skins = (int(np.isin(arrays["role"], roles).sum()) for roles in ([BODY], [SLAVE, MASTER]))
    assert (browser.data("state"), browser.data("glError")) == ("ready", "0")
    assert int(browser.data("faces")) == bodies + skins > 600
    assert browser.value("document.title") == "blocks.msh"
    panel = browser.value("document.getElementById('panel').innerText")
    assert "36 macro-elements" in panel and "corner jacobian" in panel
    button(browser, "hidden")
    assert int(browser.data("faces")) == skins > 0
    button(browser, "solid")
    worst = browser.value("document.querySelector('#worst button').textContent")
    assert worst.startswith(f"cell {arrays['cell'][np.flatnonzero(arrays['of'] == 0)[0]]}")
    button(browser, worst[:8])
    assert int(browser.data("faces")) == bodies + skins + int((arrays["of"] == 0).sum())
    assert browser.said == []


@pytest.mark.browser
def test_a_click_tells_the_numbers_of_the_file(tmp_path, browser):
    """The middle of a 3 x 3 x 3 cube seen from above is the top of its middle column."""
    mesh, numbers = generate.box(3).only("body"), 7000 + 11 * np.arange(27)
    points, hexahedra = mesh.points, mesh.block("HEXA8")
    groups = {"core": np.arange(27), NASTY[0]: np.array([0])}
    page(replace(mesh, cell_number=numbers, cell_groups=groups), tmp_path / "a.html")
    browser.open(tmp_path / "a.html", "eye=0,0,1")
    middle = browser.value("(c => [c.clientWidth / 2, c.clientHeight / 2])(document.getElementById('canvas'))")

    def click_on(centre, corners):
        browser.click(*middle)
        browser.wait("!document.getElementById('details').hidden")
        lines = browser.value("[...document.querySelectorAll('#detail > div')].map(e => e.textContent)")
        nodes = browser.value("[...document.querySelectorAll('#detail td:first-child')].map(e => +e.textContent)")
        cell = np.linalg.norm(points[hexahedra].mean(axis=1) - centre, axis=1).argmin()
        assert lines == [f"cell {numbers[cell]}, HEXA8", "group core"]
        near = np.linalg.norm(points - corners, axis=1) < 0.3
        assert set(nodes) == set(mesh.node_number[near].tolist())
        assert browser.value("document.getElementById('tip').hidden") is False
        browser.value("document.getElementById('close').click()")

    names = browser.value("[...document.querySelectorAll('#groups li span')].map(e => e.textContent)")
    assert NASTY[0] in names and browser.value("document.title") != "owned"  # names are not run
    click_on([0.5, 0.5, 5 / 6], [0.5, 0.5, 1])
    browser.drag(middle, [middle[0], middle[1] - 600])  # turned over: the other way round, seen from below
    click_on([0.5, 0.5, 1 / 6], [0.5, 0.5, 0])
    browser.click(20, 20)
    browser.wait("document.getElementById('details').hidden")
    assert browser.said == []
