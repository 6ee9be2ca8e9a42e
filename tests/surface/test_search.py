"""Search and clipping: the tree against brute force, kernels against their plain twins."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lacmesh import Mesh
from lacmesh.surface import contact_points
from lacmesh.surface.clip import clip
from lacmesh.surface.patches import patches
from lacmesh.surface.points import reaches
from lacmesh.surface.polygon import CHORD
from lacmesh.surface.search import _sort, candidates
from tests.samples import samples
from tests.surface.plain import all_candidates, shared_area
from tests.surface.surfaces import line, mapped, sheet, whole

KINDS = ("QUAD4", "TRIA3", "mixed", "QUAD8", "TRIA6", "QUAD9", "TRIA7", "mixed2")


def random_pair(seed):
    """Two random surfaces that face each other: holes, several parts, unequal sizes, curved, tilted, any types."""
    rng = np.random.default_rng(seed)
    if rng.random() < 0.2:
        kinds = rng.choice(["SEG2", "SEG3"], 2)
        a = line(int(rng.integers(1, 12)), 0.0, kind=kinds[0], skew=0.3, seed=seed)
        b = line(
            int(rng.integers(1, 12)), 0.05, kind=kinds[1], down=True, a=rng.uniform(-0.5, 0.3), b=rng.uniform(0.5, 1.5)
        )
        return whole(a), whole(b)
    made = []
    for down in (False, True):
        holes = rng.random((3, 3)) < rng.choice([0.0, 0.35])
        holes[tuple(rng.integers(0, 3, 2))] = False

        def keep(c, holes=holes):
            cell = np.clip((c[:, :2] * 3).astype(int), 0, 2)
            return ~holes[cell[:, 0], cell[:, 1]]

        n = int(rng.integers(3, 8)) * (1 + 2 * (rng.random() < 0.15))
        mesh = sheet(
            n,
            0.03 * down,
            kind=str(rng.choice(KINDS[: 3 if n > 8 else 8])),
            skew=rng.choice([0, 0.2]),
            seed=seed,
            down=down,
            keep=keep,
        )
        made.append(mesh)
    turn, shift, bend = rng.uniform(-0.5, 0.5), rng.uniform(-0.2, 0.2, 2), rng.choice([0.0, 0.0, 0.3, -0.3])
    c, s = np.cos(turn), np.sin(turn)
    made[1] = mapped(made[1], lambda x: x @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [*shift, 0])
    tilt = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    tilt *= np.sign(np.linalg.det(tilt))
    if bend:
        made = [mapped(m, lambda x: x + np.outer((x[:, :2] ** 2).sum(axis=1) * bend, [0, 0, 1])) for m in made]
    return tuple(whole(mapped(m, lambda x: x @ tilt)) for m in made)


@pytest.mark.fuzz
def test_the_tree_finds_what_brute_force_finds():
    for seed in range(samples(20, 40)):
        slave, master = random_pair(seed)
        s, m = patches(slave), patches(master)
        reach = reaches(slave, master, s, m, 0.2 if seed % 2 else None)
        pairs = candidates(s, m, reach)
        rows = all_candidates(s, m, reach) if len(s.n) * len(m.n) < 20000 else None
        for k, row in enumerate(rows or []):
            assert pairs.master[pairs.start[k] : pairs.start[k + 1]].tolist() == row


@pytest.mark.fuzz
def test_pieces_are_what_the_plain_clip_gives():
    for seed in range(samples(12, 60)):
        slave, master = random_pair(seed)
        if slave.dim == 1:
            continue
        s, m = patches(slave), patches(master)
        if len(s.n) * len(m.n) > 4000:
            continue
        reach = reaches(slave, master, s, m, 10.0, 10.0)
        pieces = clip(candidates(s, m, reach), s, m, reach)
        found = np.zeros((len(s.n), len(m.n)))
        np.add.at(found, (pieces.slave, pieces.master), pieces.area)
        plain = np.array([[shared_area(s, a, m, b) for b in range(len(m.n))] for a in range(len(s.n))])
        layered = plain.sum(axis=1) > s.area * (1 + 1e-9)
        assert np.abs(found - plain)[~layered].max(initial=0) < 1e-12
        assert (found.sum(axis=1) <= s.area * (1 + 1e-12)).all()


def quadrangle(corners, z, down):
    order = [0, 3, 2, 1] if down else [0, 1, 2, 3]
    points = np.column_stack([corners, np.broadcast_to(z, 4)])
    return whole(Mesh.create(points, [("QUAD4", [order])], space_dim=3))


corner = st.tuples(*[st.floats(-1, 1)] * 2)


@pytest.mark.fuzz
@settings(max_examples=samples(100, 300), deadline=None)
@given(st.lists(corner, min_size=4, max_size=4), st.lists(corner, min_size=4, max_size=4))
def test_any_two_quadrangles_convex_or_not(a, b):
    def simple(p):
        p = np.array(p) - np.mean(p, axis=0)
        return p[np.argsort(np.arctan2(p[:, 1], p[:, 0]))]

    a, b = simple(a), simple(b)
    slave, master = quadrangle(a, 0.0, False), quadrangle(b, 0.1, True)
    s, m = patches(slave), patches(master)
    reach = reaches(slave, master, s, m, 10.0, 10.0)
    pieces = clip(candidates(s, m, reach), s, m, reach)
    if not len(s.n) or not len(m.n):
        assert not len(pieces.slave)
        return
    plain = sum(shared_area(s, k, m, j) for k in range(len(s.n)) for j in range(len(m.n)))
    assert np.isclose(pieces.area.sum(), plain, atol=1e-9)
    rounding = 8 * np.finfo(float).eps * np.ptp(a, axis=0).max() ** 2  # of eight products, however thin the patch
    assert pieces.area.sum() <= s.area.sum() * (1 + 1e-12) + rounding


def test_edges_know_what_made_them():
    slave, master = whole(sheet(3, skew=0.2)), whole(sheet(4, kind="mixed", skew=0.2, down=True))
    s, m = patches(slave), patches(master)
    reach = reaches(slave, master, s, m)
    p = clip(candidates(s, m, reach), s, m, reach)
    assert (p.edges < CHORD).all()
    for k in range(len(p.slave)):
        at = np.arange(p.start[k], p.start[k + 1])
        there = ((m.x[p.master[k]] - s.centre[p.slave[k]]) @ s.e[p.slave[k]].T)[:, :2]
        for a, b in zip(at, np.roll(at, -1), strict=True):
            label = p.edges[a]
            corners, n = (s.y[p.slave[k], :, :2], s.n[p.slave[k]]) if label < 4 else (there, m.n[p.master[k]])
            c, d = corners[label % 4], corners[(label % 4 + 1) % n]
            for v in p.vertices[[a, b]]:
                off = (d[0] - c[0]) * (v[1] - c[1]) - (d[1] - c[1]) * (v[0] - c[0])
                assert abs(off) < 1e-13


def test_a_slave_face_under_ten_thousand_master_faces():
    slave, master = whole(sheet(1)), whole(sheet(100, kind="QUAD4", down=True, skew=0.1))
    points = contact_points(slave, master)
    assert np.unique(points.master).size == 10000
    assert np.isclose(points.weight.sum(), 1, rtol=1e-12, atol=0)


def test_long_lists_of_candidates_are_sorted_without_comparing_all():
    def seconds(n):
        values = np.arange(n + 2)[::-1].copy()
        begin = time.process_time()
        _sort(values, 1, n + 1)
        spent = time.process_time() - begin
        assert values[0] == n + 1 and values[-1] == 0 and np.array_equal(values[1:-1], np.arange(1, n + 1))
        return spent

    for n in (0, 1, 2, 9, 10, 63, 1000):
        seconds(n)
    assert min(seconds(300_000) for _ in range(3)) < 60 * min(seconds(15_000) for _ in range(9))  # insertion alone: 400


def test_two_layers_of_many_faces_over_one_cost_no_more_than_a_few_times_one():
    def seconds(master):
        clip(candidates(s, master, reach), s, master, reach)  # compiled
        begin = time.process_time()
        pieces = clip(candidates(s, master, reach), s, master, reach)
        return time.process_time() - begin, pieces

    near, far = sheet(70, 0.05, down=True, skew=0.1), sheet(71, 0.1, down=True, skew=0.1)
    nodes = np.concatenate([far.block("QUAD4"), near.block("QUAD4") + far.n_nodes])
    both = whole(Mesh.create(np.concatenate([far.points, near.points]), [("QUAD4", nodes)], space_dim=3))
    slave = whole(sheet(1))
    s, m = patches(slave), patches(both)
    reach = reaches(slave, both, s, m, 10.0, 10.0)
    two, pieces = seconds(m)
    assert abs(pieces.area.sum() - 1) < 1e-8 and (pieces.area[pieces.master < 71**2].sum() < 1e-8)
    reach = reaches(slave, whole(far), s, patches(whole(far)), 10.0, 10.0)
    one, _ = seconds(patches(whole(far)))
    assert two < 20 * one


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
