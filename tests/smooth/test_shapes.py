"""Exact shapes are found on meshes whose nodes lie on them, and nowhere else."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import FittedShape, Mesh, fit_surface
from lacmesh.smooth import height_of
from tests.samples import each_option
from tests.smooth.skins import ANGLE, cone, cylinder, ellipsoid, over, plane, rolled, saddle, sphere, torus, waves
from tests.surface.surfaces import whole

#: surface -> its shape, and the lengths and angles that it has
EXACT = {
    plane: ("plane", {}),
    cylinder: ("cylinder", {"radius": 1.0}),
    sphere: ("sphere", {"radius": 1.0}),
    cone: ("cone", {"angle": np.degrees(ANGLE)}),
    torus: ("torus", {"radius": 3.0, "tube": 1.0}),
}


def only(found):
    assert len(found) == 1, [str(one) for one in found]
    return found[0]


@pytest.mark.parametrize("n", [4, 9])
@pytest.mark.parametrize("kind", ["TRIA3", "QUAD4", "mixed"])
@pytest.mark.parametrize("surface", EXACT)
def test_a_skin_on_an_exact_shape_is_that_shape(surface, kind, n):
    mesh = rolled(surface, n, kind)
    one = only(fit_surface(mesh, "skin"))
    name, sizes = EXACT[surface]
    assert one.shape == name
    for what in ("radius", "tube", "angle"):
        assert getattr(one, what) == (pytest.approx(sizes[what], rel=1e-12) if what in sizes else None)
    assert one.distance < 1e-13 and one.nodes == mesh.n_nodes and len(one.faces) == mesh.n_cells
    if name in ("cylinder", "cone", "torus"):
        np.testing.assert_allclose(np.abs(one.axis), [0, 0, 1], atol=1e-12)
    if name != "plane":
        np.testing.assert_allclose(one.centre[:2], 0, atol=1e-12)


def segments(angle, curve):
    """A chain of segments, the group `skin`."""
    n = len(angle) - 1
    pairs = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    return Mesh.create(curve(angle), [("SEG2", pairs)], cell_groups={"skin": np.arange(n)})


def test_lines_and_circles_in_the_plane():
    t = np.sort(np.random.default_rng(0).random(9))
    line = only(fit_surface(segments(t, lambda t: np.stack([t, 2 * t + 1], axis=1)), "skin"))
    assert line.shape == "line" and line.distance < 1e-15 and line.flat
    np.testing.assert_allclose(line.axis, [2 / 5**0.5, -1 / 5**0.5, 0], atol=1e-14)  # to the right of the tangent
    circle = only(fit_surface(segments(t, lambda t: 3 * np.stack([np.cos(t), np.sin(t)], axis=1) + 7), "skin"))
    assert circle.shape == "circle" and circle.radius == pytest.approx(3, rel=1e-12)
    np.testing.assert_allclose(circle.centre, [7, 7, 0], atol=1e-11)
    assert (
        height_of(
            segments(t, lambda t: np.stack([t, 2 * t], axis=1)), whole(segments(t, lambda t: t[:, None] * [1, 2]))
        )
        is None
    )


def test_lines_and_an_arc_that_go_smoothly_into_each_other():
    """A fillet in the plane: two lines with a quarter of a circle of radius 2 between them."""
    t = np.linspace(0, 1, 11)
    parts = [np.stack([0 * t - 2, 4 * t - 4], axis=1)[:-1]]
    parts += [np.stack([-2 * np.cos(np.pi / 2 * t), 2 * np.sin(np.pi / 2 * t)], axis=1)]
    parts += [np.stack([5 * t, 0 * t + 2], axis=1)[1:]]
    x = np.concatenate(parts)
    found = fit_surface(segments(np.arange(len(x)), lambda _: x), "skin")
    assert sorted(one.shape for one in found) == ["circle", "line", "line"]
    assert next(one.radius for one in found if one.shape == "circle") == pytest.approx(2, rel=1e-12)
    assert sum(len(one.faces) for one in found) == len(x) - 1


def turned(mesh, seed=3):
    """The mesh with its nodes and cells in another order."""
    rng = np.random.default_rng(seed)
    place = rng.permutation(mesh.n_nodes)
    x = np.empty_like(mesh.points)
    x[place] = mesh.points
    blocks = []
    for name, nodes in mesh.blocks:
        rows = place[nodes[rng.permutation(len(nodes))]]
        shift = rng.integers(nodes.shape[1], size=len(rows))
        columns = (np.arange(nodes.shape[1]) + shift[:, None]) % nodes.shape[1]
        blocks.append((name, np.take_along_axis(rows, columns, axis=1)))
    return Mesh.create(x, blocks, cell_groups=dict(mesh.cell_groups), space_dim=3)


ROTATION = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
ROTATION *= np.linalg.det(ROTATION)
CHANGES = {
    "units": (lambda mesh: replace(mesh, points=1e-3 * mesh.points), 1e-3),
    "large": (lambda mesh: replace(mesh, points=1e6 * mesh.points), 1e6),
    "place": (lambda mesh: replace(mesh, points=mesh.points + np.array([3e3, -2e3, 1e3])), 1.0),
    "turned": (lambda mesh: replace(mesh, points=mesh.points @ ROTATION.T), 1.0),
    "numbers": (turned, 1.0),
}


def sorted_values(mesh):
    height = height_of(mesh, whole(mesh))
    return np.zeros(1) if height is None else np.sort(over(height)[:, :4].ravel())


@pytest.mark.parametrize("surface, change", each_option(itertools.product([*EXACT, ellipsoid, waves], CHANGES)))
def test_nothing_depends_on_units_place_turn_or_numbers(surface, change):
    mesh = rolled(surface, 7, "mixed")
    move, size = CHANGES[change]
    other = move(mesh)
    before, after = only(fit_surface(mesh, "skin")), only(fit_surface(other, "skin"))
    assert before.shape == after.shape
    if before.radius is not None:
        assert after.radius == pytest.approx(size * before.radius, rel=1e-10)
    a, b = sorted_values(mesh), sorted_values(other) / size
    scale = 1e-9 if change == "place" else 1e-11  # coordinates 3e3 away are rounded to 4e-13
    np.testing.assert_allclose(b, a, atol=scale * max(np.abs(a).max(), 1e-3))


@pytest.mark.parametrize(("surface", "n"), each_option(itertools.product((ellipsoid, saddle, waves), (5, 12, 40))))
def test_what_is_no_shape_is_of_free_form(surface, n):
    one = only(fit_surface(rolled(surface, n), "skin"))
    assert one.shape == "free form" and one.no_height == 0
    assert one.radius is one.axis is one.centre is one.distance is None


def test_a_shape_off_by_more_than_rounding_is_of_free_form():
    """A millionth of the size is what a drawing has, not what rounding leaves; 1e-10 is what files round to."""
    mesh = rolled(cylinder, 8)
    noise = np.random.default_rng(0).uniform(-1, 1, mesh.points.shape)
    assert only(fit_surface(replace(mesh, points=mesh.points + 1e-10 * noise), "skin")).shape == "cylinder"
    assert only(fit_surface(replace(mesh, points=mesh.points + 1e-6 * noise), "skin")).shape == "free form"


def test_a_strip_of_one_row_of_faces_is_the_straight_shape():
    """Two circles about one axis also lie on a sphere: the strip between them is a cylinder or a cone."""
    for surface, name in ((cylinder, "cylinder"), (cone, "cone")):
        mesh = rolled(surface, 12, "QUAD4", ny=1, skew=0)
        assert only(fit_surface(mesh, "skin")).shape == name
        faces = whole(mesh)
        value = over(height_of(mesh, faces))[:, :4]
        x = mesh.points[faces.faces.nodes[:, :4]]
        straight = np.abs(np.roll(x, -1, axis=1) - x)[..., 2] > 1e-9
        assert np.abs(value[straight]).max() < 1e-14 and np.abs(value[~straight]).min() > 1e-4


def test_closed_shapes_and_a_cone_with_its_apex():
    ring = lambda n: np.arange(n) * 2 * np.pi / n  # noqa: E731
    i, j = np.meshgrid(np.arange(24), np.arange(18), indexing="ij")
    a, b = ring(24)[i], ring(18)[j]
    node = lambda p, q: (p % 24) * 18 + q % 18  # noqa: E731
    quads = np.stack([node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)], axis=-1).reshape(-1, 4)
    x = torus(np.stack([a.ravel(), b.ravel()], axis=1))
    found = only(fit_surface(Mesh.create(x, [("QUAD4", quads)], cell_groups={"skin": np.arange(len(quads))}), "skin"))
    assert found.shape == "torus" and found.tube == pytest.approx(1, rel=1e-12)
    box = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 2), axis=-1).reshape(-1, 2)
    faces = [np.insert(box, k, s, axis=1) for k in range(3) for s in (-1.0, 1.0)]
    grid = np.arange(81).reshape(9, 9)
    one = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    quads = np.concatenate([81 * k + (one if k in (0, 3, 4) else one[:, ::-1]) for k in range(6)])
    x, same = np.unique(np.round(np.concatenate(faces), 12), axis=0, return_inverse=True)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    from lacmesh import orient

    mesh = orient(Mesh.create(x, [("QUAD4", same[quads])], cell_groups={"skin": np.arange(len(quads))}), "skin")
    found = only(fit_surface(mesh, "skin"))
    assert found.shape == "sphere" and found.nodes == mesh.n_nodes
    r, t = np.repeat(np.arange(1, 5), 16), np.tile(ring(16), 4)
    x = np.vstack([[0, 0, 0], np.stack([r * np.cos(t), r * np.sin(t), -0.3 * r], axis=1)])
    k = np.arange(16)
    fan = np.stack([0 * k, 1 + k, 1 + (k + 1) % 16], axis=1)
    rows = [
        np.stack([1 + 16 * m + k, 17 + 16 * m + k, 17 + 16 * m + (k + 1) % 16, 1 + 16 * m + (k + 1) % 16], 1)
        for m in range(3)
    ]
    cells = [("TRIA3", fan), ("QUAD4", np.concatenate(rows))]
    found = only(fit_surface(Mesh.create(x, cells, cell_groups={"skin": np.arange(64)}), "skin"))
    assert found.shape == "cone" and found.angle == pytest.approx(np.degrees(np.arctan2(1, 0.3)), rel=1e-12)
    np.testing.assert_allclose(found.centre, 0, atol=1e-12)
    np.testing.assert_allclose(found.axis, [0, 0, -1], atol=1e-12)


def test_few_nodes_are_no_shape():
    """Any four nodes lie on a sphere, any six on a few cylinders: a bent strip of two faces is of free form."""
    x = np.array([[0, 0, 0], [1, 0, 0.2], [2, 0, 0.1], [0, 1, 0], [1, 1.2, 0.3], [2, 1, 0]], float)
    mesh = Mesh.create(x, [("QUAD4", [[0, 1, 4, 3], [1, 2, 5, 4]])], cell_groups={"skin": [0, 1]})
    one = only(fit_surface(mesh, "skin"))
    assert one.shape == "free form"


def test_words():
    one = FittedShape("cylinder", np.arange(162), 98, radius=12.000000000000002, distance=1.04e-13)
    assert str(one) == "cylinder, radius 12, 98 nodes within 1e-13"
    assert str(FittedShape("torus", np.arange(4), 1200, radius=11.0, tube=3.0, distance=5e-15)) == (
        "torus, radii 11 and 3, 1,200 nodes within 5e-15"
    )
    assert str(FittedShape("free form", np.arange(4), 7, no_height=1)) == "free form, 7 nodes, 1 face without a fit"
    assert str(FittedShape("cone", np.arange(4), 9, angle=45.0, distance=1e-12)) == (
        "cone, half angle 45 degrees, 9 nodes within 1e-12"
    )


@pytest.mark.gmsh
@pytest.mark.parametrize(("size", "quads"), [(4.0, False), (2.0, False), (2.0, True)])
def test_a_bore_its_fillet_and_the_planes_beside_it(size, quads):
    """A CAD model whose bore goes by a tangential fillet into the plane on top: one patch, three shapes."""
    from tests.smooth.cad import plate

    found = fit_surface(plate(size, quads), "skin")
    kinds = [one.shape for one in found]
    assert kinds.count("plane") == 6 and kinds.count("cylinder") == 1 and "free form" not in kinds
    tori = [one for one in found if one.shape == "torus"]
    assert tori and all(abs(t.radius - 11) < 1e-10 and abs(t.tube - 3) < 1e-10 for t in tori)
    assert next(one.radius for one in found if one.shape == "cylinder") == pytest.approx(8, rel=1e-12)
