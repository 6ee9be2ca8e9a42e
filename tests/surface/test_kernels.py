"""Surfaces and their neighbours; compiled polygons, rules, tree and clip, against plain twins."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lacmesh import Mesh, join
from lacmesh.errors import DataError
from lacmesh.surface import Surface, contact_points
from lacmesh.surface.clip import FACING, clip, mean_plane, project
from lacmesh.surface.fit import correct
from lacmesh.surface.lines import _nearest_only
from lacmesh.surface.maps import AFFINE, BILINEAR, CURVED, coefficients, in_quadrangle, kinds, quadrangle
from lacmesh.surface.patches import candidates, patches
from lacmesh.surface.points import face_measure, reaches
from lacmesh.surface.polygon import ROOM, make_room, nearest_only
from tests.meshes import cell_with_faces
from tests.samples import samples
from tests.surface.surfaces import TYPES, mapped, sheet, whole

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])

# ---- plain twins


def area(p):
    """Area of a polygon (n, 2), counter-clockwise."""
    p = np.asarray(p).reshape(-1, 2)
    if len(p) < 3:
        return 0.0
    q = np.roll(p, -1, axis=0)
    return float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2)


def inside(polygon, by):
    """The part of a polygon inside a convex one, side by side, on lists of points."""
    for a, b in zip(by, np.roll(by, -1, axis=0), strict=True):
        side = [(b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) for p in polygon]
        out = []
        for k, p in enumerate(polygon):
            q, f, g = polygon[k - 1], side[k], side[k - 1]
            if f * g < 0:
                out.append(q + (p - q) * g / (g - f))
            if f >= 0:
                out.append(p)
        polygon = out
    return polygon


def fan(p):
    """Triangles, counter-clockwise, that with their signs make up a polygon."""
    for k in range(1, len(p) - 1):
        corners = p[[0, k, k + 1]]
        yield (1, corners) if area(corners) >= 0 else (-1, corners[::-1])


def shared_area(slave, s, master, m):
    """Area that two patches share in the slave's plane; both may be any quadrangles that do not cross themselves."""
    p = slave.y[s, : slave.n[s], :2]
    q = (((master.x[m, : master.n[m]] - slave.centre[s]) @ slave.e[s].T)[::-1])[:, :2]
    if area(p) <= 0 or area(q) <= 0:
        return 0.0
    return sum(i * j * area(inside(list(b), a)) for i, a in fan(p) for j, b in fan(q) if area(a) > 0)


# ---- polygons and places


def convex(rng, n=None):
    """A convex polygon: points on an ellipse, turned and moved, in room for more."""
    n = int(rng.integers(3, 9)) if n is None else n
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    p = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ rng.normal(size=(2, 2)) + rng.normal(size=2)
    p = p[::-1] if area(p) < 0 else p
    room = np.zeros((ROOM, 2))
    room[:n] = p
    return room, n


@pytest.mark.fuzz
def test_layers_keep_the_nearest_and_the_union():
    rng = np.random.default_rng(3)
    for _ in range(samples(3, 50)):
        of = make_room(1000)
        n = int(rng.integers(2, 9))
        polygons = [convex(rng) for _ in range(n)]
        for k, (p, v) in enumerate(polygons):
            of.shape[k], of.size[k], of.plane[k], of.who[k] = p, v, [rng.random(), 0, 0], k
        height = of.plane[:n, 0].copy()
        count = nearest_only(of, n, 1e-14, 1e-11)
        parts = [(of.shape[k, : of.size[k]].copy(), of.who[k]) for k in range(count) if of.size[k]]
        X = rng.normal(size=(200, 2)) * 2
        under = [_holds(p[:v], X) for p, v in polygons]
        kept = [(_holds(p, X), who) for p, who in parts]
        for x in range(len(X)):
            over = [k for k, holds in enumerate(under) if holds[x]]
            there = [who for holds, who in kept if holds[x]]
            assert there == ([min(over, key=lambda k: height[k])] if over else [])


def _holds(p, X):
    """(n,): whether a polygon (m, 2) holds points (n, 2)."""
    q, x, y = np.roll(p, -1, axis=0), X[:, 0, None], X[:, 1, None]
    return ((q[:, 0] - p[:, 0]) * (y - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x - p[:, 0]) > 0).all(axis=1)


def test_places_in_a_quadrangle_two_of_whose_corners_are_one():
    y = np.array([[-1.0, -1], [1, 0], [1, 0], [-1, 1]])
    for s, t in ((-0.5, 0.3), (0.9, -0.8)):
        p = ((1 + SQUARE[:, 0] * s) * (1 + SQUARE[:, 1] * t) / 4) @ y
        assert np.allclose(in_quadrangle(*quadrangle(y), *p)[:2], [s, t], atol=1e-10)


def test_corrected_weights_are_exact_and_nearest_to_those_given():
    rng = np.random.default_rng(0)
    for n, k in ((7, 7), (12, 7), (16, 11)):
        phi, weight = rng.normal(size=(k, n)), rng.uniform(0.5, 1.5, n)
        phi[2] = 2 * phi[0] - phi[1]  # one that depends on the others
        target = phi @ weight * 1.01
        new, used = weight.copy(), phi.copy()
        correct(new, n, used, k, target.copy(), 0.0, 1)
        assert np.allclose(phi @ new, target, rtol=1e-10, atol=0)
        # least squares with weights: the change is in the span of the functions
        change = new / weight - 1
        assert np.allclose(np.linalg.lstsq(phi.T, change, rcond=None)[0] @ phi, change, atol=1e-9)


def test_mean_planes_go_through_the_corners_and_face_by_their_turn():
    x = np.array([[0, 0, 0.3], [0, 1, 0.2], [1, 0, 0.5], [0, 0, 0.3]])
    for corners, back, faces in (([0, 1, 2, 0], True, True), ([0, 2, 1, 0], True, False), ([0, 2, 1, 0], False, True)):
        y = np.empty((4, 3))
        project(x[corners], 3, np.zeros(3), np.eye(3), back, y)
        cosine, c0, c1, c2 = mean_plane(y, 3)
        assert np.allclose(c0 + y[:3, :2] @ [c1, c2], y[:3, 2])
        assert (cosine > FACING) == faces
    assert abs(cosine - 1 / np.sqrt(1 + 0.1**2 + 0.2**2)) < 1e-15


# ---- layers of lines


@pytest.mark.parametrize("patch", [1, 10**5, 10**7])
def test_layers_of_lines_on_any_patch(patch):
    """Neighbours share 5e-13, which is rounding; a third interval shares 5e-12 with a farther one, which is cut."""
    low, high = np.array([0.0, 0.1 - 5e-13, 0.7]), np.array([0.1, 0.7 + 5e-12, 1.0])
    h0, slope = np.array([1.0, 2.0, 1.0]), np.zeros(3)
    first = _nearest_only(np.zeros(3, int), np.arange(3), low, high, h0, slope)
    there = _nearest_only(np.full(3, patch), np.arange(3), low, high, h0, slope)
    assert (there[0] == patch).all() and all(np.array_equal(a, b) for a, b in zip(first[1:], there[1:], strict=True))
    assert there[3][there[1] == 1].max() == 0.7
    here = _nearest_only(np.full(2, patch), np.arange(2), low[:2], high[:2], h0[:2], slope[:2])
    assert here[2].tolist() == low[:2].tolist() and here[3].tolist() == high[:2].tolist()


def test_of_crossing_lines_on_many_patches_the_nearest_counts_everywhere():
    rng = np.random.default_rng(0)
    s = np.sort(rng.integers(0, 300, 1200))
    low, high = np.sort(rng.random((2, len(s))), axis=0)
    h0, slope = rng.uniform(-1, 1, (2, len(s)))
    patch, m, a, b = _nearest_only(s, np.arange(len(s)), low, high, h0, slope)
    for one in range(300):
        mine, found = np.flatnonzero(s == one), np.flatnonzero(patch == one)
        for t in rng.random(20):
            over = mine[(low[mine] < t) & (high[mine] > t)]
            hit = found[(a[found] < t) & (b[found] > t)]
            assert len(hit) == (len(over) > 0)
            if len(hit):  # the nearest in the middle of its part, where they are compared
                middle = (a[hit] + b[hit]) / 2
                assert m[hit] == over[np.abs(h0[over] + slope[over] * middle).argmin()]


# ---- search and clip


corner = st.tuples(*[st.floats(-1, 1)] * 2)


@pytest.mark.fuzz
@settings(max_examples=samples(100, 300), deadline=None)
@given(st.lists(corner, min_size=4, max_size=4), st.lists(corner, min_size=4, max_size=4))
def test_any_two_quadrangles_convex_or_not(a, b):
    def face(p, z, order):
        p = np.array(p) - np.mean(p, axis=0)
        points = np.pad(p[np.argsort(np.arctan2(p[:, 1], p[:, 0]))], ((0, 0), (0, 1)), constant_values=z)
        return whole(Mesh.create(points, [("QUAD4", [order])], space_dim=3))

    slave, master = face(a, 0.0, [0, 1, 2, 3]), face(b, 0.1, [0, 3, 2, 1])
    s, m = patches(slave), patches(master)
    reach = reaches(slave, master, s, m, 10.0, 10.0)
    pieces = clip(candidates(s, m, reach), s, m, reach)
    if not len(s.n) or not len(m.n):
        assert not len(pieces.slave)
        return
    shared = sum(shared_area(s, k, m, j) for k in range(len(s.n)) for j in range(len(m.n)))
    assert np.isclose(pieces.area.sum(), shared, atol=1e-9)
    rounding = 8 * np.finfo(float).eps * np.ptp(a, axis=0).max() ** 2  # of eight products, however thin the patch
    assert pieces.area.sum() <= s.area.sum() * (1 + 1e-12) + rounding


def test_two_layers_of_many_faces_over_one_cost_no_more_than_a_few_times_one():
    def seconds(master):
        clip(candidates(s, master, reach), s, master, reach)  # compiled
        begin = time.process_time()
        pieces = clip(candidates(s, master, reach), s, master, reach)
        return time.process_time() - begin, pieces

    near, far = sheet(70, 0.05, down=True, skew=0.1), sheet(71, 0.1, down=True, skew=0.1)
    slave, both = whole(sheet(1)), whole(join(far, near))
    s, m = patches(slave), patches(both)
    reach = reaches(slave, both, s, m, penetration=10.0)
    two, pieces = seconds(m)
    assert abs(pieces.area.sum() - 1) < 1e-8 and (pieces.area[pieces.master < 71**2].sum() < 1e-8)
    reach = reaches(slave, whole(far), s, patches(whole(far)), 10.0, 10.0)
    one, _ = seconds(patches(whole(far)))
    assert two < 20 * one


@pytest.mark.rows("QUAD4-0.0", "TRIA3-1e-07", "QUAD8-1e-15", "TRIA6-1e-11")
@pytest.mark.parametrize("shift", [0.0, *(10.0**-k for k in range(15, 5, -1))])
@pytest.mark.parametrize("kind", ["QUAD4", "TRIA3", "QUAD8", "TRIA6"])
def test_meshes_that_coincide_or_nearly_do(kind, shift):
    for turn in (0.0, shift):
        c, s = np.cos(turn), np.sin(turn)
        turned = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        slave = whole(sheet(5, kind=kind))
        master = whole(mapped(sheet(5, kind=kind, down=True), lambda x, q=turned: x @ q + shift))
        points = contact_points(slave, master)
        covered = np.bincount(points.slave, points.weight, minlength=len(slave))
        assert np.isfinite(points.weight).all() and np.isfinite(points.xi_master).all()
        assert (covered <= 1 / 25 / (2 if "TRIA" in kind else 1) * (1 + 1e-12)).all()
        assert points.weight.sum() >= 1 - 10 * shift - 1e-12
        assert np.abs(points.gap - shift).max() <= 2 * shift + 1e-15


# ---- surfaces


TILTED = Mesh.create([[0, 0, 0], [1, 0, 1.0]], [("SEG2", [[0, 1]])], space_dim=3)
ORDER_3 = Mesh.create(np.random.default_rng(0).random((10, 3)), [("TRIA10", [list(range(10))])])
HEXA = cell_with_faces("HEXA8")


@pytest.mark.parametrize(
    ("mesh", "cells", "words"),
    [
        (HEXA, [], "at least one"), (HEXA, [0, 1], "dimensions 2, 3"), (HEXA, [0], "dimensions 3"),
        (TILTED, [0], "z = constant"), (ORDER_3, [0], "TRIA10"),
    ],
)  # fmt: skip
def test_what_is_no_surface_is_refused(mesh, cells, words):
    with pytest.raises(DataError, match=words):
        Surface.of(mesh, np.array(cells, int))


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
