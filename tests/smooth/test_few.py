"""Shapes of few faces: what is taken as round although it turns by more than 40 degrees, and what stays sharp."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, check, cut_skin, write
from lacmesh.cli import main
from lacmesh.smooth import fit_surface, height_of
from lacmesh.surface.normals import smoothed
from tests.coarse_rings import rings
from tests.surface.surfaces import whole


def around(n, start=0.0, turn=2 * np.pi):
    """Points on the unit circle: n of a full turn, or n + 1 of a part of it."""
    angle = start + turn * np.arange(n + (turn < 2 * np.pi)) / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def chain(points, closed=True):
    """Segments from each point to the next, as the group `skin`."""
    n = len(points)
    segments = np.stack([np.arange(n), np.roll(np.arange(n), -1)], axis=1)[: n if closed else n - 1]
    return Mesh.create(points, [("SEG2", segments)], cell_groups={"skin": np.arange(len(segments))}, space_dim=2)


def revolved(meridian, n, kind="QUAD4", twist=0.0):
    """A skin of revolution about z of n faces around, through rings of nodes (r, z), or poles where r is 0."""
    r, z = np.transpose(meridian)
    i, j = np.meshgrid(np.arange(n), np.arange(len(r)), indexing="ij")
    angle = 2 * np.pi * i / n + twist * j
    points = np.stack([r[j] * np.cos(angle), r[j] * np.sin(angle), z[j]], axis=-1).reshape(-1, 3)
    number = np.where(r[j] == 0, j, i * len(r) + j)
    low, high = number[:, :-1].ravel(), number[:, 1:].ravel()
    quads = np.stack([low, np.roll(number, -1, 0)[:, :-1].ravel(), np.roll(number, -1, 0)[:, 1:].ravel(), high], axis=1)
    at_low, at_high = quads[:, 0] == quads[:, 1], quads[:, 2] == quads[:, 3]
    four = quads[~at_low & ~at_high]
    three = np.concatenate([quads[at_low][:, [0, 2, 3]], quads[at_high][:, [0, 1, 2]]])
    if kind == "TRIA3":
        three, four = np.concatenate([three, four[:, [0, 1, 2]], four[:, [0, 2, 3]]]), four[:0]
    blocks = [(name, nodes) for name, nodes in (("QUAD4", four), ("TRIA3", three)) if len(nodes)]
    return Mesh.create(points, blocks, cell_groups={"skin": np.arange(len(four) + len(three))})


def names(mesh, **options):
    return sorted({one.shape for one in fit_surface(mesh, "skin", **options)})


def straight(n):
    return np.stack([np.ones(4), np.linspace(0, 1, 4)], axis=1)


def ball(n, low=-np.pi / 2):
    way = np.linspace(low, np.pi / 2, max(n // 2, 2) + 1)
    return np.stack([np.cos(way).round(15), np.sin(way)], axis=1)


@pytest.mark.parametrize("n", [5, 6, 7, 8, 9])
def test_a_circle_of_few_faces(n):
    (one,) = fit_surface(chain(around(n, 0.1)), "skin")
    assert one.shape == "circle" and one.radius == pytest.approx(1, rel=1e-12) and one.nodes == n
    assert one.turn == (None if n == 9 else pytest.approx(360 / n))
    mesh = chain(around(n))
    height = height_of(mesh, whole(mesh))
    assert height.value[:, 2] == pytest.approx(1 - np.cos(np.pi / n), rel=1e-9)


def test_an_angle_that_is_given_is_kept():
    assert names(chain(around(8)), crease_angle=40.0) == ["line"]
    assert names(chain(around(8)), crease_angle=44.9) == ["line"]
    assert names(chain(around(8)), crease_angle=45.1) == ["circle"]


@pytest.mark.parametrize("start", [0.0, 0.3, 2.0])
def test_parts_of_circles_of_few_faces(start):
    """Four faces to a half circle are an arc; two to a quarter, or three to a half, might be any polygon."""
    assert names(chain(around(4, start, np.pi), closed=False)) == ["circle"]
    assert names(chain(around(2, start, np.pi / 2), closed=False)) == ["line"]
    assert names(chain(around(3, start, np.pi), closed=False)) == ["line"]


def test_a_slot():
    """Half circles of four faces between lines on which they go on smoothly."""
    arc, x = around(4, -np.pi / 2, np.pi), np.linspace(0, -3, 5)[1:-1]
    top = np.stack([x, np.ones(3)], axis=1)
    made = fit_surface(chain(np.concatenate([arc, top, -arc - [3.0, 0.0], -top - [3.0, 0.0]])), "skin")
    assert sorted((one.shape, one.nodes) for one in made) == [("circle", 5), ("circle", 5), ("line", 5), ("line", 5)]


POLYGONS = {
    "a triangle": around(3),
    "a square": around(4),
    "a square of two faces to a side": np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]]),
    "a square without its corners": np.array(
        [[3, 2.2], [2.2, 3], [-2.2, 3], [-3, 2.2], [-3, -2.2], [-2.2, -3], [2.2, -3], [3, -2.2]]
    ),
    "a hexagon of two faces to a side": np.repeat(around(6), 2, axis=0) / 2
    + np.stack([around(6), np.roll(around(6), -1, 0)], axis=1).reshape(-1, 2) / 2,
    "six faces on an ellipse": around(6) * [1.5, 1.0],
    "a house": np.array([[0, 0], [2, 0], [2, 1], [1, 1.6], [0, 1]]),
}


@pytest.mark.parametrize("name", POLYGONS)
def test_polygons_stay_sharp(name):
    assert names(chain(POLYGONS[name])) == ["line"]
    prism = revolved(np.array([[1.0, 0.0], [1.0, 0.5], [1.0, 1.0]]), len(POLYGONS[name]))
    x = np.column_stack([np.repeat(POLYGONS[name], 3, axis=0), prism.points[:, 2]])
    assert names(Mesh.create(x, prism.blocks, cell_groups=prism.cell_groups)) == ["plane"]


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA3"])
@pytest.mark.parametrize("n", [5, 6, 8])
@pytest.mark.parametrize(
    ("shape", "meridian"),
    [
        ("cylinder", straight),
        ("sphere", ball),
        ("sphere", lambda n: ball(n, 0.0)),
        ("cone", lambda n: straight(n) * [1, 2] + np.stack([np.linspace(0, 0.7, 4), np.zeros(4)], axis=1)),
    ],
)
def test_skins_of_few_faces(shape, meridian, kind, n):
    (one,) = fit_surface(revolved(meridian(n), n, kind), "skin")
    assert one.shape == shape and one.turn > 40 and one.distance < 1e-14


@pytest.mark.parametrize("meridian", [straight, ball, lambda n: ball(n, 0.0)])
def test_four_faces_are_a_square(meridian):
    assert set(names(revolved(meridian(4), 4))) <= {"plane", "free form"}


def test_a_pin_with_its_end_and_a_chamfer():
    """The end is a plane, the chamfer a cone, although all three turn by 45 degrees from one another."""
    meridian = np.array([[1, -1], [1, -0.5], [1, 0], [0.8, 0.2], [0.4, 0.2]])
    assert names(revolved(meridian, 8)) == ["cone", "cylinder", "plane"]


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA3"])
@pytest.mark.parametrize("n", [5, 6, 8])
def test_a_pin_with_a_round_end(n, kind):
    """A cylinder goes over into a sphere, each found from a node around which it is alone."""
    way = np.linspace(0, np.pi / 2, 3)
    cap = np.stack([np.cos(way).round(15), 1 + np.sin(way)], axis=1)
    found = fit_surface(revolved(np.concatenate([[[1, -0.5], [1, 0], [1, 0.5]], cap]), n, kind), "skin")
    assert sorted(one.shape for one in found) == ["cylinder", "sphere"]


def test_tetrahedra_that_turn_by_more_than_others():
    """Twelve faces around, of which some turn by 41 degrees: such a skin was of free form, sharp here and there."""
    mesh = rings({"kind": "TETRA4", "n": 12, "radii": (0.6, 1), "heights": (0, 0.4, 0.8, 1.2), "twist": 0.15}, dim=3)
    (one,) = fit_surface(mesh, "outer")
    assert (one.shape, one.nodes) == ("cylinder", 48) and one.turn > 40


@pytest.mark.parametrize("scale, shift", [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e7)])
def test_units_and_origin(scale, shift):
    mesh = chain(scale * (around(8) + shift))
    (one,) = fit_surface(mesh, "skin")
    assert one.shape == "circle" and one.radius == pytest.approx(scale, rel=1e-6)


def test_smoothed_normals_go_over_the_same_edges():
    """Normals at the nodes of a circle are radial, and those of the faces where the angle is given."""
    mesh = chain(around(8)[::-1])
    surface = replace(whole(mesh), height=height_of(mesh, whole(mesh)))
    radial = surface.x[surface.faces.nodes[:, :2]]
    sides = smoothed(surface, None)[:, :2]
    assert np.abs((sides * radial).sum(axis=2)) == pytest.approx(1)
    assert height_of(mesh, whole(mesh), 40.0) is None
    own = smoothed(whole(mesh), 40.0)[:, :2]
    assert np.abs((own * radial).sum(axis=2)) == pytest.approx(np.cos(np.pi / 8))


@pytest.mark.parametrize(("inner", "outer"), [(8, 8), (12, 8), (8, 12), (24, 6)])
def test_faces_of_coarse_circles_find_each_other(inner, outer):
    """Thin cells, and corners that reach deeper into the faces opposite than these cells do."""
    radii = np.linspace(0.9, 1, 8)
    pin = {"kind": "QUAD4", "n": inner, "radii": radii, "names": ("pin", "bore", "out")}
    hole = {"kind": "QUAD4", "n": outer, "radii": radii + 0.1, "turn": 0.2, "names": ("hole", "in", "rim")}
    found = check(cut_skin(rings(pin, hole, dim=2), "out").mesh, "out", "in").summary
    assert found["covered"] == pytest.approx(1)
    assert abs(found["gap"]["mean"]) < 0.15 * (1 - np.cos(np.pi / min(inner, outer)))


def test_what_was_taken_is_said(tmp_path, capsys):
    ends = {"kind": "QUAD4", "radii": (0.5, 1), "names": ("pin", "bore", "out")}
    hole = {"kind": "QUAD4", "n": 12, "radii": (1, 2), "names": ("hole", "in", "rim")}
    file = str(tmp_path / "pin.msh")
    write(file, cut_skin(rings({**ends, "n": 8}, hole, dim=2), "out").mesh)
    assert main(["info", file, "--verbose"]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("out:")]
    assert "circle, radius 1, 8 nodes" in line and "taken as one over edges of up to 45 degrees" in line
    assert main(["check", file, "--slave", "out", "--master", "in", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    (one,) = [one for one in found["findings"] if one["rule"] == "few-faces"]
    assert one["message"].startswith(
        "8 faces that turn by up to 45 degrees lie on one circle of radius 1 and are taken as it; give --crease-angle "
    )
    assert found["summary"]["shapes"]["out"][0]["turn"] == pytest.approx(45)
    assert abs(found["summary"]["gap"]["mean"]) < 1e-3
    for given in (["--crease-angle", "40"], ["--surface", "faces"]):
        assert main(["check", file, "--slave", "out", "--master", "in", "--json", *given]) == 0
        found = json.loads(capsys.readouterr().out)
        assert not [one for one in found["findings"] if one["rule"] == "few-faces"]
        assert found["summary"]["gap"]["mean"] > 0.02
