"""Compiled polygons, inverse maps, moments and rules, each against its plain twin."""

import itertools

import numpy as np
import pytest

from lacmesh.reference.quadrature import rule
from lacmesh.surface.clip import FACING, mean_plane, project
from lacmesh.surface.fit import correct
from lacmesh.surface.layers import make_room, nearest_only
from lacmesh.surface.moments import functions, gauss_rules, straight_integrals
from lacmesh.surface.place import plane_rule
from lacmesh.surface.polygon import CHORD, MASTER, ROOM, area_of, centroid, cut_by_line, cut_by_polygon, outside, tidy
from lacmesh.surface.project import in_face, in_quadrangle, inverse, quadrangle
from lacmesh.surface.rules import DEGREE, FAN3, fan_rules
from tests.samples import each_option, samples
from tests.surface import plain

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def convex(rng, n=None):
    """A convex polygon: points on an ellipse, turned and moved, in room for more."""
    n = int(rng.integers(3, 9)) if n is None else n
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    p = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ rng.normal(size=(2, 2)) + rng.normal(size=2)
    p = p[::-1] if plain.area(p) < 0 else p
    room = np.zeros((ROOM, 2))
    room[:n] = p
    return room, n


def monomial_integral(p, a, b):
    """int x^a y^b over a polygon, by a high rule on its fan."""
    X, w = rule("TRIA", 12)
    total = 0.0
    for k in range(1, len(p) - 1):
        T = np.stack([p[k] - p[0], p[k + 1] - p[0]])
        x = p[0] + X @ T
        total += np.linalg.det(T) * (w @ (x[:, 0] ** a * x[:, 1] ** b))
    return total


@pytest.mark.parametrize("seed", range(50))
def test_areas_centroids_and_clips_are_those_of_the_plain_twins(seed):
    rng = np.random.default_rng(seed)
    (p, n), (q, m) = convex(rng), convex(rng)
    assert np.isclose(area_of(p, n), plain.area(p[:n]), rtol=1e-12, atol=0)
    mean = [monomial_integral(p[:n], *k) / plain.area(p[:n]) for k in ((1, 0), (0, 1))]
    assert np.allclose(centroid(p, n), mean, atol=1e-12)
    shared = plain.area(plain.inside(list(p[:n]), q[:m]))
    room, label = p.copy(), np.zeros(ROOM, np.int8)
    found = cut_by_polygon(room, label, n, q, m, MASTER, np.empty((ROOM, 2)), np.zeros(ROOM, np.int8))
    assert np.isclose(area_of(room, found) if found else 0.0, shared, atol=1e-13)
    if outside(p, n, q, m) or outside(q, m, p, n):
        assert shared < 1e-14
    half = np.zeros((ROOM, 2))
    areas = []
    for side in (1, -1):
        k = cut_by_line(p, label, n, *q[0], *q[1], CHORD, side, half, np.zeros(ROOM, np.int8))
        areas.append(area_of(half, k) if k > 2 else 0.0)
    assert np.isclose(sum(areas), plain.area(p[:n]), rtol=1e-12, atol=0)


def test_tidying_takes_out_what_adds_no_area_and_the_longer_edge_names_both():
    p = np.zeros((ROOM, 2))
    p[:6] = [[0, 0], [0.5, 0], [2, 0], [2, 0], [2, 1], [0, 1]]
    label = np.arange(ROOM).astype(np.int8)
    n = tidy(p, label, 6, 1e-14)
    assert n == 4 and np.array_equal(p[:4], [[0, 0], [2, 0], [2, 1], [0, 1]])
    assert label[0] == 1  # the edge from (0.5, 0)


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


@pytest.mark.parametrize("turn", [1, -1])
def test_places_in_quadrangles_and_triangles(turn):
    rng = np.random.default_rng(0)
    for _ in range(200):
        y = SQUARE[::turn] + 0.45 * rng.uniform(-1, 1, (4, 2))
        s, t = rng.uniform(-1, 1, 2)
        N = (1 + SQUARE[:, 0] * s) * (1 + SQUARE[:, 1] * t) / 4
        p = N @ y
        c, a, b, d = quadrangle(y)
        u, v, jacobian = in_quadrangle(c, a, b, d, *p)
        assert np.allclose([u, v], [s, t], atol=1e-12) and np.sign(jacobian) == turn
        u, v, ratio = in_face(inverse(y, 4, (SQUARE + 1) / 2), *p)
        assert np.allclose([u, v], [(s + 1) / 2, (t + 1) / 2], atol=1e-12) and np.isclose(ratio, 0.25 / jacobian)
        xi = rng.random((4, 2))
        weights = rng.dirichlet(np.ones(3))
        assert np.allclose(in_face(inverse(y, 3, xi), *(weights @ y[:3]))[:2], weights @ xi[:3], atol=1e-10)


def test_places_in_a_quadrangle_two_of_whose_corners_are_one():
    y = np.array([[-1.0, -1], [1, 0], [1, 0], [-1, 1]])
    c, a, b, d = quadrangle(y)
    for s, t in ((-0.5, 0.3), (0.9, -0.8)):
        p = ((1 + SQUARE[:, 0] * s) * (1 + SQUARE[:, 1] * t) / 4) @ y
        assert np.allclose(in_quadrangle(c, a, b, d, *p)[:2], [s, t], atol=1e-10)


@pytest.mark.fuzz
@pytest.mark.parametrize(("skew", "k"), each_option(itertools.product((0.0, 0.05, 0.3, 0.6), (3, 5, 7, 8))))
def test_moments_of_quadrangles_are_those_of_a_rule_of_many_points(skew, k):
    rng = np.random.default_rng(k)
    for turn in (1, -1):
        for _ in range(samples(1, 10)):
            y = SQUARE[::turn] + skew * rng.uniform(-1, 1, (4, 2))
            ring = y[::turn]
            p, n = convex(rng, 4)
            p[:n] = 0.4 * (p[:n] - p[:n].mean(axis=0)) / np.abs(p[:n] - p[:n].mean(axis=0)).max() + 0.3
            label = np.zeros(ROOM, np.int8)
            n = cut_by_polygon(p, label, n, ring, 4, CHORD, np.empty((ROOM, 2)), np.zeros(ROOM, np.int8))
            if n < 3 or area_of(p, n) < 1e-3:
                continue
            corner = np.array([in_face(inverse(y, 4, SQUARE), *x)[:2] for x in p[:n]])
            target = np.zeros(20)
            local = (corner[:, 0].mean(), corner[:, 1].mean(), 0.5)
            edges = np.full(n, CHORD, np.int8)
            straight_integrals(p[:n], corner, edges, 0, y, 4, local, k, 1, gauss_rules(), target)
            X, w = rule("TRIA", 60)
            exact, work = np.zeros(20), np.zeros(20)
            for j in range(1, n - 1):
                T = np.stack([p[j] - p[0], p[j + 1] - p[0]])
                for x, weight in zip(p[0] + X @ T, w * np.linalg.det(T), strict=True):
                    u, v, _ = in_face(inverse(y, 4, SQUARE), *x)
                    work[0] = 1.0
                    functions((u - local[0]) / 0.5, (v - local[1]) / 0.5, k, work, 1)
                    exact += weight * work
            assert np.abs(target - exact).max() < 1e-11 * np.abs(exact).max()


@pytest.mark.parametrize("code", range(len(DEGREE)))
def test_rules_on_polygons_are_exact_to_their_degree(code):
    rng = np.random.default_rng(code)
    for _ in range(20):
        p, n = convex(rng)
        X, w = np.empty((300, 2)), np.empty(300)
        m = plane_rule(p, n, code, fan_rules(), X, w)
        size = np.abs(X[:m]).max()
        for a in range(DEGREE[code] + 1):
            for b in range(DEGREE[code] + 1 - a):
                found = w[:m] @ (X[:m, 0] ** a * X[:m, 1] ** b)
                scale = plain.area(p[:n]) * size ** (a + b)
                assert abs(found - monomial_integral(p[:n], a, b)) < 1e-12 * scale
    if code >= FAN3:
        rows = slice(*fan_rules().start[code : code + 2])
        assert np.isclose(fan_rules().w[rows].sum(), 1)


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
