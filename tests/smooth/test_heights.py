"""Heights against the surface itself: their rates, their continuity, on cut meshes, at creases and rims."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, generate, raise_order
from lacmesh.cells import CELLS
from lacmesh.reference.shapes import shape
from lacmesh.smooth import find, height_of
from lacmesh.smooth.heights import smooth_of
from lacmesh.smooth.parents import inverse, parents_of
from lacmesh.surface import contact_points
from lacmesh.surface.maps import coefficients, slopes, values
from lacmesh.surface.normals import smooth_normals, unit
from lacmesh.surface.record import mean_normals
from lacmesh.topology.skin import FACE_TYPES
from tests.smooth import skins
from tests.smooth.skins import KINDS, LEVEL, ROUND, along, block, chain, heights, rolled, skin_of, worst
from tests.surface.surfaces import mapped, sheet, whole


def with_heights(mesh, skin=None):
    """The surface of a mesh of faces with its heights."""
    faces = whole(mesh) if skin is None else skin
    return replace(faces, height=height_of(mesh, faces))


@cache
def skin_with_heights(surface, n, kind):
    return with_heights(rolled(surface, n, kind))


def rate(surface, kind, sizes, rim=True):
    """The rate at which the largest error of a height falls, over skins of so many faces, and the errors."""
    errors = []
    for n in sizes:
        faces = skin_with_heights(surface, n, kind)
        centre = mean_normals(whole(sheet(n, kind=kind, skew=0.25)))[1]
        some = rim | (np.abs(centre[:, :2] - 0.5) < 0.5 - 1.2 / n).all(axis=1)
        errors.append(worst(surface, faces, faces.height, np.flatnonzero(some)))
    return np.log2(errors[0][0] / errors[-1][0]) / np.log2(sizes[-1] / sizes[0]), errors


def at_edges(surface, faces, way):
    """(f, 4): the exact heights at the middles of edges, along `way` (f, 4, 3); 0 where there is no edge."""
    out = np.zeros((len(faces), 4))
    for name, rows, nodes in faces.by_type():
        for k, (a, b) in enumerate(CELLS[name].edges):
            out[rows, k] = along(LEVEL[surface], faces.x[nodes[:, [a, b]]].mean(axis=1), way[rows, k])
    return out


def shared_normals(faces):
    """(f, 4, 3): the mean of the normals of the two faces at each edge, of the one at a rim."""
    normal = mean_normals(faces)[0]
    beyond = faces.neighbours
    out = normal[:, None] + np.where((beyond >= 0)[..., None], normal[beyond], 0.0)
    return out / np.linalg.norm(out, axis=2, keepdims=True)


@pytest.mark.rows("cylinder-TRIA3", "cone-QUAD4")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("surface", ROUND)
def test_heights_of_an_exact_shape_are_its_own_at_edges_and_centres(surface, kind):
    """Exact along what both faces at an edge take for the normal, the same for both; O(h^4) along a face's own."""
    errors = []
    for size in (1.0, 0.25):  # the same faces, a quarter as large
        mesh = rolled(surface, 6, kind, size=size)
        faces = whole(mesh)
        value, normal = heights(mesh, faces), mean_normals(faces)[0]
        np.testing.assert_allclose(value[:, :4], at_edges(surface, faces, shared_normals(faces)), atol=1e-12)
        quads = faces.n_corners == 4
        x = faces.x[faces.faces.nodes[quads, :4]].mean(axis=1)
        np.testing.assert_allclose(value[quads, 4], along(LEVEL[surface], x, normal[quads]), atol=1e-12)
        own = at_edges(surface, faces, np.repeat(normal[:, None], 4, axis=1))
        errors.append(np.sqrt(((value[:, :4] - own) ** 2).mean()))
    assert np.log2(errors[0] / errors[1]) / 2 > 3.5, errors


@pytest.mark.rows("waves-mixed")
@pytest.mark.parametrize(("surface", "kind"), [*product((skins.ellipsoid, skins.saddle, skins.waves), KINDS)])
def test_heights_of_a_free_form(surface, kind):
    """O(h^3) inside, on meshes whose nodes stand anywhere; not much less at the rim, where fits are one-sided."""
    for rim, least, share in ((False, 2.6, 0.05), (True, 2.2, 0.15)):
        found, errors = rate(surface, kind, (8, 32), rim)
        assert found > least and errors[-1][0] < share * errors[-1][1], errors


def test_heights_over_triangles_are_those_of_a_cubic():
    """Anywhere in faces off the rim, where fits are one-sided; a parabola over a face leaves 6 % of its height."""
    faces = skin_with_heights(skins.slight, 8, "TRIA3")
    inside = np.flatnonzero((np.abs(mean_normals(faces)[1][:, :2]) < 0.25).all(axis=1))
    error, largest = worst(skins.slight, faces, faces.height, inside)
    assert error < 1e-3 * largest


def test_heights_over_segments_are_those_of_a_cubic():
    """Anywhere but at the ends of the chain, on nodes that stand anywhere."""
    x = np.linspace(-1, 1, 11) + np.array([0, *np.random.default_rng(0).uniform(-0.04, 0.04, 9), 0])
    faces = with_heights(chain(np.stack([x, 1e-3 * x**3], axis=1), closed=False))
    rows = np.repeat(np.arange(2, 8), 3)
    xi = np.tile([[-0.6, 0.0], [0.2, 0.0], [0.7, 0.0]], (6, 1))
    at = values(coefficients(faces), rows, xi)
    exact = along(lambda p: p[:, 1] - 1e-3 * p[:, 0] ** 3, at, mean_normals(faces)[0][rows])
    np.testing.assert_allclose(faces.height.at(rows, xi), exact, atol=1e-3 * np.abs(exact).max())


@pytest.mark.parametrize("kind", KINDS)
def test_local_fits_are_exact_on_a_sphere_up_to_the_face(kind, monkeypatch):
    """With the chord's length for that of its shadow, the fits miss of a sphere what three turns of the frame leave."""
    monkeypatch.setattr(find, "simplest", lambda *_: None)
    mesh = rolled(skins.sphere, 7, kind)
    faces = whole(mesh)
    smooth = smooth_of(mesh, faces, 40.0)
    assert smooth.fit.free.all()
    patches = smooth.fit.patches
    value, lacking = smooth.heights
    face, k, i, j = patches.edges()
    chord = np.linalg.norm(patches.x[i] - patches.x[j], axis=1)
    np.testing.assert_allclose(value[face, k], 1 - np.sqrt(1 - chord**2 / 4), rtol=1e-6)
    assert not lacking.any()


def test_what_is_flat_and_curved_quadratic_faces_have_no_height():
    cube, ball = generate.box(3).only("body", "top"), raise_order(rolled(skins.sphere, 5), "2")
    ball = replace(ball, points=ball.points / np.linalg.norm(ball.points, axis=1, keepdims=True))
    for mesh, skin in (
        (cube, skin_of(cube, "top")),
        *((one, whole(one)) for one in (rolled(skins.plane, 5, "mixed"), ball)),
    ):
        assert height_of(mesh, skin) is None


@pytest.mark.parametrize(("kind", "order"), [("TRIA3", "2"), ("QUAD4", "2"), ("QUAD4", "2-full"), ("mixed", "2")])
@pytest.mark.parametrize("digits", [16, 6])
def test_quadratic_faces_that_are_straight_have_the_heights_of_linear_ones(kind, order, digits):
    """Also where mid-nodes are off the chord by the digits of a file: the height is measured from where they are."""
    linear = rolled(skins.cylinder, 6, kind)
    mesh = raise_order(linear, order)
    points = mesh.points.copy()
    points[linear.n_nodes :] = points[linear.n_nodes :].round(digits)
    mesh = replace(mesh, points=points)
    want, got = with_heights(linear), with_heights(mesh)
    rows = np.arange(len(want))
    xi = np.random.default_rng(0).uniform(0.1, 0.4, (len(rows), 2))
    np.testing.assert_allclose(got.heights(rows, xi), want.heights(rows, xi), atol=max(10.0**-digits, 1e-14))
    np.testing.assert_allclose(got.leans(rows, xi), want.leans(rows, xi), atol=10 * max(10.0**-digits, 1e-14))


@pytest.mark.parametrize("surface", ROUND)
def test_normals_are_those_of_the_shape(surface):
    """Over flat faces, at a rim too: to h^3, and those of a cylinder have nothing along its axis."""
    worst = []
    for n in (5, 10):
        skin = with_heights(rolled(surface, n))
        rows = np.repeat(np.arange(len(skin)), 3)
        xi = np.tile([[0.2, 0.2], [0.6, 0.1], [0.1, 0.6]], (len(skin), 1))
        J = slopes(coefficients(skin), rows, xi, 2)
        got = smooth_normals(J, skin.leans(rows, xi))
        x, level = values(coefficients(skin), rows, xi), LEVEL[surface]
        steps = 1e-6 * np.eye(3)
        want = unit(np.stack([level(x + step) - level(x - step) for step in steps], axis=1))
        worst.append(np.abs(np.cross(got, want)).max())
        if surface is skins.cylinder:
            assert np.abs(got[:, 2]).max() < 1e-6
    assert worst[0] < 1e-6 or worst[1] < worst[0] / 5 < 1e-3


# ---- cut meshes


CUTS = [("HEXA8", "pyramid"), ("HEXA8", "hexa"), ("PENTA6", "pyramid"), ("TETRA4", "pyramid"), ("PYRAM5", "pyramid")]
CUTS += [("mixed", "pyramid"), ("mixed", "hexa"), ("mixed", "auto")]


def by_corners(faces):
    """The corners of faces, sorted, and the rows of the faces in their order."""
    ordered = np.sort(faces.faces.corners, axis=1)
    rows = np.lexsort(ordered.T)
    return ordered[rows], rows


@pytest.mark.rows("HEXA8-pyramid", "PENTA6-pyramid", "TETRA4-pyramid", "PYRAM5-pyramid", "mixed-auto")
@pytest.mark.parametrize(("kind", "hexa"), CUTS)
def test_children_take_the_heights_of_their_parents(kind, hexa):
    mesh = block(kind)
    cut = cut_skin(mesh, "skin", hexa=hexa).mesh
    before, after = skin_of(mesh), skin_of(cut)
    old, new = height_of(mesh, before), height_of(cut, after)
    parents = parents_of(cut, after)
    (corners, rows), (theirs, mine) = by_corners(before), by_corners(parents.faces)
    assert (corners == theirs).all() and len(after) > len(before)
    row = np.empty(len(mine), int)
    row[mine] = rows  # of the parents among the faces that were not cut
    for k, n in enumerate(after.n_corners):  # the parent's map takes the corners' places in it to the corners
        parent = parents.faces.faces.take(parents.of[[k]])
        name = FACE_TYPES[parent.type[0]]
        there = shape(name, parents.corner[k, :n]) @ after.x[parent.nodes[0, : CELLS[name].n_nodes]]
        np.testing.assert_allclose(there, after.x[after.faces.nodes[k, :n]], atol=1e-14)
    at_node = {}
    for name, faces, nodes in after.by_type():
        place = np.array([[0.3, 0.2]]) if name == "TRIA3" else np.array([[0.4, -0.3]])
        x = np.einsum("pn,kns->ks", shape(name, place), after.x[nodes])
        b = new.at(faces, np.tile(place, (len(faces), 1)))
        for face, at, one in zip(faces, x, b, strict=True):
            parent = row[parents.of[face]]
            ring = before.faces.corners[parent]
            ring = before.x[ring[ring >= 0]]
            xi = inverse(FACE_TYPES[before.faces.type[parent]], ring[None], at[None])[0]
            off = (shape(FACE_TYPES[before.faces.type[parent]], xi) @ ring - at) @ mean_normals(after)[0][face]
            assert abs(one - off[0] - old.at(np.array([parent]), xi)[0]) < 2e-2 * old.value.max()
        for corner, place in enumerate(CELLS[name].reference):
            b = new.at(faces, np.tile(place, (len(faces), 1)))
            for node, one in zip(nodes[:, corner], b, strict=True):
                at_node.setdefault(int(node), []).append(one)
    outer = np.unique(corners[corners >= 0])
    assert all(np.ptp(values) < 1e-15 for values in at_node.values())
    assert all(abs(at_node[int(node)][0]) < 1e-15 for node in outer)
    assert all(values[0] > 1e-3 for node, values in at_node.items() if node not in outer)
    assert 1.4**2 * 0.25**2 / 8 / 1.4 / 2 < max(v[0] for v in at_node.values()) < 1.4 * 0.25**2 / 2


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA3"])
def test_children_in_the_plane(kind):
    """Two or three pieces of a segment carry the arc of the whole."""
    n = 10
    mesh = generate.ring((1, n), (0.7, 1.0), kind, angle=np.degrees(1.5)).renamed(outer="skin").only("body", "skin")
    cut = cut_skin(mesh, "skin").mesh
    faces = skin_of(cut)
    height = height_of(cut, faces)
    assert len(height.value) == len(faces) == (3 * n if kind == "QUAD4" else 2 * n)
    for end in (-1.0, 0.0, 1.0):
        place = np.linalg.norm(np.array([1 - end, 1 + end]) / 2 @ faces.x[faces.faces.nodes[:, :2]], axis=1)
        b = height.at(np.arange(len(faces)), np.tile([end, 0.0], (len(faces), 1)))
        np.testing.assert_allclose(place + b, 1.0, atol=3e-6)


def test_a_part_of_a_macro_element_has_its_parent_whole():
    cut = cut_skin(block("HEXA8"), "skin", hexa="hexa").mesh
    faces = skin_of(cut)
    part = faces.take(np.flatnonzero(cut.cell_data["lac_child"][faces.cell] == 5))  # centres, which touch nothing outer
    some = parents_of(cut, part)
    assert (by_corners(parents_of(cut, faces).faces)[0] == by_corners(some.faces)[0]).all()
    np.testing.assert_allclose(np.abs(some.corner), 1 / 3, atol=1e-14)


# ---- creases and rims


@pytest.mark.slow
def test_fits_do_not_reach_over_a_crease():
    """Two skins of free form that meet at right angles: what one is changes nothing of the other."""
    found = []
    for bump in (0.1, 0.2):

        def folded(x, bump=bump):
            u, v = x[:, 0], 2 * x[:, 1] - 1
            low, high = np.minimum(v, 0), np.maximum(v, 0)
            return np.stack([u, low - bump * high * np.sin(3 * u), high + 0.1 * np.sin(2 * u + v) * low], axis=1)

        mesh = mapped(sheet(8, ny=16), folded)
        found.append(heights(mesh))
    upper = mesh.points[mesh.block("QUAD4")][:, :, 2].max(axis=1) > 0.05
    a, b = found
    lower = ~upper & (np.abs(a).max(axis=1) > 0)
    assert lower.sum() > 30 and np.abs(a[upper] - b[upper]).max() > 1e-4
    np.testing.assert_allclose(a[lower], b[lower], rtol=0, atol=1e-14)


def test_a_bare_skin_and_a_body_have_the_same_heights():
    """Convex > 0, along the outward normal; concave < 0."""
    mesh = block("HEXA8")
    turned = Mesh.create(mesh.points, [("QUAD4", mesh.block("QUAD4")[:, ::-1])], space_dim=3)
    bare = Mesh.create(mesh.points, [("QUAD4", mesh.block("QUAD4"))], space_dim=3)
    np.testing.assert_allclose(height_of(bare, whole(bare)).value, height_of(mesh, skin_of(mesh)).value, atol=1e-14)
    assert heights(mesh, skin_of(mesh)).min() > 0 > heights(turned).max()


@pytest.mark.parametrize("extent", [False, True])
def test_coordinates_that_are_no_numbers_and_faces_without_extent_are_passed_over(extent):
    mesh = rolled(skins.waves, 6)
    x = mesh.points.copy()
    x[24] = x[25] if extent else np.nan
    height = with_heights(replace(mesh, points=x)).height
    assert np.isfinite(height.value).all() and np.abs(height.value).max() > 1e-4


def gaps(*sides, **options):
    """Integrals of the gap over the slave faces of meshes of faces with heights."""
    points = contact_points(*sides, **options)
    return np.bincount(points.macro, points.weight * points.gap)


@pytest.mark.parametrize(("kind", "skew"), [*product(("TRIA3", "QUAD4"), (0.02, 0.25))])
def test_gaps_of_smooth_skins_have_the_round_off_of_those_of_faces(kind, skew):
    """Skins have the same nodes: last bits say into how many triangles a common part is divided.

    Along normals that lean a rule of few points leaves as much however the corners of a part are numbered.
    """
    both = [
        with_heights(rolled(skins.cylinder, 5, each, skew, down=down))
        for each, down in ((kind, False), ("QUAD4", True))
    ]
    rng = np.random.default_rng(0)
    found = [gaps(*(side.at(side.x + 1e-15 * rng.uniform(-1, 1, side.x.shape)) for side in both)) for _ in range(8)]
    assert np.ptp(found, axis=0).max() < 1e-15
