"""Contact points: exact integrals on flat interfaces, balance, gaps against closed forms, bodies that must not pair."""

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, raise_order
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacmesh.reference.shapes import shape
from lacmesh.surface import Surface, contact_points, coverage
from lacmesh.surface.coverage import face_measure
from lacmesh.surface.lines import _nearest_only
from lacmesh.surface.normals import smoothed
from lacmesh.surface.patches import patches
from lacmesh.topology.skin import FACE_TYPES
from lacmesh.topology.winding import REVERSED
from tests.samples import each_option, samples
from tests.surface.surfaces import TYPES, blocks, errors, line, mapped, positions, sheet, whole


def rotation(seed):
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize(
    ("slave_kind", "master_kind", "skew"),
    each_option(itertools.product(TYPES, TYPES, (0.05, 0.0, 0.2)), of=lambda row: [row[:2], row[1:], (row[0], row[2])]),
)
def test_flat_interfaces_are_integrated_exactly(slave_kind, master_kind, skew):
    slave = whole(sheet(5, kind=slave_kind, skew=skew))
    master = whole(sheet(4, 0.01, kind=master_kind, skew=skew, seed=1, down=True))
    points = contact_points(slave, master)
    assert max(errors(points, slave, master)) < 1e-11
    found = coverage(points, slave)
    assert np.abs(found.covered / found.area - 1).max() < 1e-12
    assert np.abs(points.gap - 0.01).max() < 1e-14


@pytest.mark.parametrize("skew", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("order", ["1", "2", "2-full"])
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
def test_cut_interfaces_are_integrated_exactly_in_either_role(hexa, order, skew):
    # a distorted quadratic face that is cut has children with curved sides, in its plane
    cut = cut_skin(blocks(5, 0.0, 0.5, order=order, skew=skew), "skin", hexa=hexa)
    one = Surface.of(cut.mesh, cut.mesh.cell_groups["skin"])
    two = blocks(4, -0.5, 0.0, skew=skew, seed=1)
    two = Surface.of(two, two.cell_groups["skin"])
    macro = cut.macro_of_face[one.cell]
    points = contact_points(one, two, macro=macro)
    assert max(errors(points, one, two)) < 1e-11
    assert np.abs(coverage(points, one, macro).covered / coverage(points, one, macro).area - 1).max() < 1e-12
    assert max(errors(contact_points(two, one), two, one)) < 1e-11


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(samples(2, 12)))
@pytest.mark.parametrize("kind", ["QUAD8", "QUAD9", "TRIA6", "TRIA7"])
def test_sides_that_are_curved_in_the_plane(kind, seed):
    def swirl(x):
        r2 = ((x[:, :2] - 0.5) ** 2).sum(axis=1)
        turn = 0.6 * np.exp(-8 * r2) * (x[:, 0] * (1 - x[:, 0]) * x[:, 1] * (1 - x[:, 1]) * 16) ** 2
        c, s = np.cos(turn), np.sin(turn)
        d = x - [0.5, 0.5, 0]
        return np.stack([0.5 + c * d[:, 0] - s * d[:, 1], 0.5 + s * d[:, 0] + c * d[:, 1], x[:, 2]], axis=1)

    slave = whole(mapped(sheet(6, kind=kind, seed=seed, skew=0.1), swirl))
    master = whole(sheet(5, 0.01, kind="mixed", skew=0.15, seed=seed + 100, down=True))
    assert max(errors(contact_points(slave, master), slave, master)) < 1e-10
    assert max(errors(contact_points(master, slave), master, slave)) < 1e-10


@pytest.mark.parametrize("kinds", [("SEG2", "SEG2"), ("SEG3", "SEG2"), ("SEG2", "SEG3"), ("SEG3", "SEG3")])
@pytest.mark.parametrize("skew", [0.0, 0.3])
def test_flat_lines_are_integrated_exactly_also_with_middle_nodes_off_the_middle(kinds, skew):
    slave = whole(line(7, kind=kinds[0], skew=skew))
    master = whole(line(5, 0.1, kind=kinds[1], skew=skew, seed=1, down=True))
    points = contact_points(slave, master)
    assert max(errors(points, slave, master)) < 1e-10
    assert np.abs(coverage(points, slave).ratio - 1).max() < 1e-12


@pytest.mark.parametrize("normals", ["facet", "smoothed"])
@pytest.mark.parametrize("kind", [*TYPES, "SEG2", "SEG3"])
def test_balance_partition_of_unity_and_rays_along_the_normal(kind, normals):
    rng = np.random.default_rng(0)
    if kind.startswith("SEG"):
        slave, master = line(9, kind=kind), line(7, 0.02, kind=kind, down=True)
        wave = lambda x: x + np.outer(0.1 * np.sin(3 * x[:, 0]), [0, 1, 0])  # noqa: E731
    else:
        slave, master = sheet(6, kind=kind, skew=0.2), sheet(5, 0.02, kind=kind, skew=0.2, seed=1, down=True)
        wave = lambda x: x + np.outer(0.1 * np.sin(3 * x[:, 0]) * np.cos(2 * x[:, 1]), [0, 0, 1])  # noqa: E731
    slave, master = whole(mapped(slave, wave)), whole(mapped(master, wave))
    p = contact_points(slave, master, normals=normals)
    x = positions(p, slave, p.slave, p.xi_slave)
    x_bar = positions(p, master, p.master, p.xi_master)
    assert np.abs(np.linalg.norm(p.normal, axis=1) - 1).max() < 1e-14
    assert np.abs(np.cross(x_bar - x, p.normal)).max() < 1e-13
    assert np.abs(((x_bar - x) * p.normal).sum(axis=1) - p.gap).max() < 1e-14
    pressure = rng.random(len(slave))[p.slave] * p.weight
    force = pressure[:, None] * p.normal
    arm = np.cross(x_bar - x, force).sum(axis=0)
    assert np.abs(arm).max() < 1e-13
    assert (p.weight > 0).all() or (p.weight.min() > -1e-5)


def test_gaps_are_signed_open_positive():
    slave = whole(sheet(3))
    for z in (0.2, -0.05):
        found = coverage(contact_points(slave, whole(sheet(4, z, down=True))), slave)
        assert np.allclose([found.min_gap, found.mean_gap, found.max_gap], z)
        assert np.allclose(found.gap_integral, z / 9)


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA3", "QUAD8", "mixed2"])
def test_a_rigid_motion_changes_nothing(kind):
    def bend(x):
        return x + np.outer(0.2 * x[:, 0] ** 2 - 0.1 * x[:, 0] * x[:, 1], [0, 0, 1])

    slave, master = mapped(sheet(5, kind=kind, skew=0.2), bend), mapped(sheet(4, 0.03, kind=kind, down=True), bend)
    q = rotation(3)
    here = contact_points(whole(slave), whole(master))
    there = contact_points(*(whole(mapped(m, lambda x: x @ q.T + [3, -2, 1])) for m in (slave, master)))
    a, b = coverage(here, whole(slave)), coverage(there, whole(slave))
    assert np.allclose(a.ratio, b.ratio, atol=1e-9) and np.allclose(a.gap_integral, b.gap_integral, atol=1e-9)
    assert len(here) == len(there)


@pytest.mark.parametrize("kind", ["QUAD8", "QUAD9", "TRIA6", "TRIA7"])
def test_concentric_spheres_at_the_geometrys_rate(kind):
    """The quadratic geometry is off by O(h^3) or better, and so is the gap."""
    off = []
    for n in (4, 8, 16):
        pair = []
        for radius, down, cells, half in ((1.0, False, n, 0.5), (1.05, True, n + 1, 0.6)):
            flat = sheet(cells, kind=kind, down=down)
            ball = mapped(flat, lambda x, h=half: np.column_stack([(2 * x[:, :2] - 1) * h, np.ones(len(x))]))
            pair.append(whole(mapped(ball, lambda x, r=radius: r * x / np.linalg.norm(x, axis=1, keepdims=True))))
        p = contact_points(*pair)
        found = coverage(p, pair[0])
        assert np.abs(found.covered / found.area - 1).max() < 1e-8
        off.append(np.abs(p.gap - 0.05).max())
    assert np.log2(off[0] / off[1]) > 2.3 and np.log2(off[1] / off[2]) > 2.3


def arc(n, radius, down, angle=1.0, kind="SEG3"):
    return mapped(
        line(n, kind=kind, down=not down),
        lambda x: radius * np.stack([np.cos(x[:, 0] * angle), np.sin(x[:, 0] * angle), 0 * x[:, 0]], axis=1),
    )


def test_concentric_cylinders_in_the_plane_and_axisymmetric_area():
    off, areas = [], []
    for n in (4, 8, 16, 32):
        slave, master = whole(arc(n, 1.0, False)), whole(arc(n + 1, 1.1, True))
        p = contact_points(slave, master, axisymmetric=True)
        found = coverage(p, slave)
        off.append(np.abs(p.gap - 0.1).max())
        areas.append(abs(found.area.sum() - 2 * np.pi * np.sin(1.0)))
        assert np.abs(found.covered / found.area - 1).max() < 1e-7
    assert off[-1] < 1e-8 and (np.diff(np.log2(off)) < -3.5).all() and (np.diff(np.log2(areas)) < -3.5).all()


def test_axisymmetric_weights_are_exact_on_straight_lines():
    slave, master = whole(line(5)), whole(line(3, 0.1, down=True))
    found = coverage(contact_points(slave, master, axisymmetric=True), slave)
    edges = np.linspace(0, 1, 6)
    assert np.allclose(np.sort(found.area), np.pi * np.diff(edges**2)) and np.allclose(found.ratio, 1, atol=1e-14)


def test_hertz_like_gap():
    """A paraboloid under a plane: heights integrated over its facets tend to r^2 over the square, at order 2."""
    off = []
    over = whole(mapped(sheet(5, 0.0, down=True), lambda x: 5 * x - [2, 2, 0]))
    for n in (8, 16, 32):
        bowl = whole(
            mapped(sheet(n, kind="TRIA3"), lambda x: x - np.outer(((x[:, :2] - 0.5) ** 2).sum(axis=1), [0, 0, 1]))
        )
        p = contact_points(bowl, over, search_distance=2.0)
        assert np.allclose(coverage(p, bowl).ratio, 1)
        # along the normal, on the inclined face: twice the cosine makes it the height over the plane
        off.append(abs((p.weight * p.gap * p.normal[:, 2] ** 2).sum() - 1 / 6))
    assert off[2] < 1e-3 and np.allclose(np.array(off[:-1]) / off[1:], 4, rtol=0.02)


def test_smoothed_normals_turn_from_face_to_face_and_stop_at_creases():
    ball = lambda x: x / np.linalg.norm(x, axis=1, keepdims=True)  # noqa: E731
    slave = mapped(sheet(8, kind="TRIA3"), lambda x: ball(np.column_stack([x[:, :2] - 0.5, np.ones(len(x))])))
    master = mapped(
        sheet(9, kind="TRIA3", down=True),
        lambda x: 1.05 * ball(np.column_stack([1.2 * (x[:, :2] - 0.5), np.ones(len(x))])),
    )
    slave, master = whole(slave), whole(master)
    worst = {}
    for normals in ("facet", "smoothed"):
        p = contact_points(slave, master, normals=normals)
        x = positions(p, slave, p.slave, p.xi_slave)
        # in the last row of faces a nodal normal is a mean over one side only, and no better than the facet's
        inner = (np.abs(x[:, :2] / x[:, 2:]) < 3 / 8).all(axis=1)
        worst[normals] = np.linalg.norm(np.cross(ball(x), p.normal), axis=1)[inner].max()
    assert worst["smoothed"] < 0.15 * worst["facet"]
    roof = whole(mapped(sheet(4), lambda x: x - np.outer(np.abs(x[:, 0] - 0.5), [0, 0, 1])))
    over = whole(mapped(sheet(4, 0.05, down=True), lambda x: x - np.outer(np.abs(x[:, 0] - 0.5), [0, 0, 1])))
    sharp = contact_points(roof, over, normals="smoothed", crease_angle=40)
    blunt = contact_points(roof, over, normals="smoothed", crease_angle=100)
    assert np.allclose(np.abs(sharp.normal[:, 0]), np.sqrt(0.5)) and np.abs(blunt.normal[:, 0]).min() < 0.6


def cube(low, high):
    """The skin of a box, outward, its corners at low and high; 2 x 2 faces a side."""
    faces = []
    for axis in range(3):
        for side in (0, 1):
            flat = sheet(2, down=side == 0).points
            mesh = sheet(2, down=side == 0)
            x = np.empty_like(flat)
            x[:, (axis + 1) % 3], x[:, (axis + 2) % 3], x[:, axis] = flat[:, 0], flat[:, 1], side
            faces.append((x * (np.array(high) - low) + low, mesh.block("QUAD4")))
    points = np.concatenate([x for x, _ in faces])
    quads = np.concatenate([q + 9 * k for k, (_, q) in enumerate(faces)])
    return Mesh.create(points, [("QUAD4", quads)], space_dim=3)


def plate(z0, z1):
    """A plate one hexahedron thick and 4 x 4 wide, with its whole skin in the group `skin`."""
    flat = sheet(4)
    q = flat.block("QUAD4")
    points = np.concatenate([flat.points + np.array([0, 0, z0]), flat.points + np.array([0, 0, z1])])
    skin = np.concatenate([q[:, ::-1], q + len(flat.points)])
    mesh = Mesh.create(points, [("HEXA8", np.concatenate([q, q + len(flat.points)], axis=1)), ("QUAD4", skin)])
    return Surface.of(mesh, np.arange(len(q), mesh.n_cells))


@pytest.mark.parametrize("gap", [0.0, 0.01, -0.01])
def test_thin_plates_pair_only_the_sides_that_face(gap):
    upper, lower = plate(gap, gap + 0.05), plate(-0.05, 0.0)
    p = contact_points(upper, lower)
    found = coverage(p, upper)
    assert np.array_equal(found.ratio > 0.5, np.arange(32) < 16)
    assert np.allclose(found.ratio[:16], 1) and not found.ratio[16:].any()
    assert np.allclose(p.gap, gap, atol=1e-14) and (p.master >= 16).all()


def test_of_two_layers_the_nearest_counts_and_coverage_stays_below_one():
    near, far = sheet(4, 0.05, down=True), sheet(3, 0.1, down=True)
    near = mapped(near, lambda x: x * [0.6, 1, 1])
    both = Mesh.create(
        np.concatenate([far.points, near.points]),
        [("QUAD4", np.concatenate([far.block("QUAD4"), near.block("QUAD4") + far.n_nodes]))],
        space_dim=3,
    )
    slave = whole(sheet(5, skew=0.2))
    p = contact_points(slave, whole(both))
    found = coverage(p, slave)
    assert np.abs(found.covered / found.area - 1).max() < 1e-11
    x = positions(p, slave, p.slave, p.xi_slave)[:, 0]
    assert np.allclose(p.gap, np.where(x < 0.6, 0.05, 0.1))


def test_layers_of_lines():
    near, far = line(4, 0.05, down=True, b=0.6), line(3, 0.1, down=True)
    both = Mesh.create(
        np.concatenate([far.points, near.points]),
        [("SEG2", np.concatenate([far.block("SEG2"), near.block("SEG2") + far.n_nodes]))],
        space_dim=2,
    )
    slave = whole(line(5))
    p = contact_points(slave, whole(both))
    assert np.allclose(coverage(p, slave).ratio, 1)
    assert np.isclose((p.weight * p.gap).sum(), 0.6 * 0.05 + 0.4 * 0.1)


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


@pytest.mark.parametrize("side", ["slave", "master"])
def test_nodes_beyond_the_axis_of_an_axisymmetric_model(side):
    def left(x):
        return x - [0.5, 0, 0]

    def rounding(x):
        return x - [1e-12, 0, 0]

    slave, master = line(4), line(3, 0.1, down=True)
    moved = {"slave": (mapped(slave, left), master), "master": (slave, mapped(master, left))}[side]
    with pytest.raises(DataError, match=f"2 of {5 if side == 'slave' else 4} nodes of the {side} have x < 0"):
        contact_points(*map(whole, moved), axisymmetric=True)
    assert len(contact_points(*map(whole, moved)))
    assert len(contact_points(*(whole(mapped(m, rounding)) for m in (slave, master)), axisymmetric=True))


def test_smoothed_normals_where_many_faces_meet_cost_no_more():
    n, pole = 150, 600
    flat = sheet(n).points
    angle = 2 * np.pi * np.arange(pole) / pole
    fan = np.tile([5.0, 0.0, 0.0], (1 + pole, 1))
    fan[1:] += np.column_stack([np.cos(angle), np.sin(angle), 0.1 * np.sin(2 * angle)])
    k = len(flat) + 1 + np.arange(pole)
    rim = np.column_stack([np.full(pole, len(flat)), k, np.roll(k, -1)])
    cells = [("QUAD4", sheet(n).block("QUAD4"))]
    plain, with_pole = (
        whole(Mesh.create(np.concatenate([flat, fan]), c, space_dim=3)) for c in (cells, [*cells, ("TRIA3", rim)])
    )

    def seconds(surface):
        begin = time.process_time()
        smoothed(surface, 40.0)
        return time.process_time() - begin

    found = smoothed(with_pole, 40.0)[with_pole.faces.nodes[:, 0] == len(flat), 0]
    assert np.abs(found - [0, 0, 1]).max() < 1e-12
    assert min(seconds(with_pole) for _ in range(3)) < 5 * min(seconds(plain) for _ in range(3))


def test_partial_overlap_in_the_shape_of_a_t():
    slave = whole(sheet(7, skew=0.2))
    master = whole(sheet(12, 0.01, down=True, keep=lambda c: (c[:, 1] > 0.5) | (np.abs(c[:, 0] - 0.5) < 1 / 12)))
    p = contact_points(slave, master)
    area = face_measure(master).sum()
    assert np.isclose(p.weight.sum(), area, rtol=1e-12, atol=0)
    back = contact_points(master, slave)
    assert np.isclose(back.weight.sum(), area, rtol=1e-12, atol=0)


def test_nothing_in_reach_and_holes():
    slave = whole(sheet(3))
    p = contact_points(slave, whole(sheet(3, 5.0, down=True)))
    assert len(p) == 0 and len(p.groups) == 0
    found = coverage(p, slave)
    assert not found.ratio.any() and np.isnan(found.mean_gap).all() and np.isnan(found.min_gap).all()
    assert len(contact_points(slave, whole(sheet(3, 5.0, down=True)), search_distance=6.0)) > 0
    assert len(contact_points(slave, whole(sheet(3, 0.1, down=False)))) == 0


def test_max_penetration_bounds_how_deep_a_pair_may_lie():
    slave, master = whole(sheet(3)), whole(sheet(3, -0.4, down=True))
    assert len(contact_points(slave, master, max_penetration=0.3)) == 0
    assert np.allclose(contact_points(slave, master, max_penetration=0.5).gap, -0.4)


def test_degenerate_faces_yield_nothing_and_no_nan():
    rng = np.random.default_rng(0)
    mesh = sheet(6, kind="mixed")
    points = mesh.points.copy()
    points[10] = points[9]
    points[20:22] = np.nan
    points[30] = 1e300
    slave = whole(Mesh.create(points, [(b.type, b.nodes) for b in mesh.blocks], space_dim=3))
    master = whole(sheet(5, 0.01, down=True))
    for one, two in ((slave, master), (master, slave)):
        p = contact_points(one, two, search_distance=0.5)
        assert len(p)
        for name in ("xi_slave", "xi_master", "weight", "normal", "gap"):
            assert np.isfinite(getattr(p, name)).all()
        assert np.isfinite(coverage(p, one).ratio).all()
    flat = sheet(2)
    line_of_faces = whole(mapped(flat, lambda x: x * [1, 0, 0]))
    assert not len(contact_points(line_of_faces, master)) and rng


def test_warped_and_steep_faces_keep_coverage_within_one():
    rng = np.random.default_rng(1)
    for _ in range(10):
        slave = whole(mapped(sheet(5), lambda x: x + 0.08 * rng.normal(size=x.shape)))
        master = whole(mapped(sheet(6, 0.05, down=True), lambda x: x + 0.08 * rng.normal(size=x.shape)))
        p = contact_points(slave, master)
        found = coverage(p, slave)
        # where a face goes in at a corner its Jacobian all but vanishes along a line: no rule integrates that well
        folded = np.bincount(patches(slave).face) > 1
        assert (found.covered[~folded] <= found.area[~folded] * (1 + 1e-3)).all() and (found.ratio <= 1).all()
        assert (found.covered <= found.area * 1.02).all() and folded.sum() < 13
        assert np.isfinite(p.gap).all()


def test_points_are_sorted_by_types_and_rule_and_macros_are_kept():
    slave, master = whole(sheet(6, kind="mixed", skew=0.1)), whole(sheet(5, 0.01, kind="mixed", skew=0.1, down=True))
    macro = np.arange(len(slave)) // 3
    macro[:4] = -1
    p = contact_points(slave, master, macro=macro)
    assert not np.isin(p.slave, np.arange(4)).any() and np.array_equal(p.macro, macro[p.slave])
    assert p.groups[0, 3] == 0 and p.groups[-1, 4] == len(p)
    assert np.array_equal(p.groups[1:, 3], p.groups[:-1, 4])
    keys = [tuple(row[:3]) for row in p.groups]
    assert keys == sorted(set(keys)) and len(keys) >= 4
    for s, m, _, a, b in p.groups:
        assert (slave.faces.type[p.slave[a:b]] == s).all() and (master.faces.type[p.master[a:b]] == m).all()
        assert "TRIA3" in FACE_TYPES[s] or "QUAD4" in FACE_TYPES[s]
    found = coverage(p, slave, macro)
    assert len(found.area) == macro.max() + 1 and np.allclose(found.ratio[2:], 1)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"normals": "nodal"}, RequestError),
        ({"search_distance": -1.0}, RequestError),
        ({"max_penetration": float("nan")}, RequestError),
        ({"axisymmetric": True}, RequestError),
        ({"macro": [0, 1]}, ValueError),
    ],
)
def test_wrong_requests(options, error):
    slave, master = whole(sheet(2)), whole(sheet(2, 0.1, down=True))
    with pytest.raises(error):
        contact_points(slave, master, **options)
    with pytest.raises(RequestError, match="dimension"):
        contact_points(slave, whole(line(2)))


def test_raised_solids_give_the_same_coverage():
    lower, upper = blocks(3, -0.5, 0.0), blocks(4, 0.01, 0.5, seed=1)
    out = []
    for order in ("1", "2", "2-full"):
        one, two = (m if order == "1" else raise_order(m, order) for m in (upper, lower))
        s, m = (Surface.of(k, k.cell_groups["skin"]) for k in (one, two))
        out.append(coverage(contact_points(s, m), s).gap_integral)
    assert np.allclose(out[0], out[1:], rtol=1e-12, atol=0)


def _bent(surface, amount, over=1.0):
    """A surface bent by so much, mirrored where `over` is -1 (its faces turn the other way then)."""
    x = surface.x
    up = amount * (np.sin(3 * x[:, 0]) * np.cos(3 * x[:, 1]) + x[:, 0] * x[:, 1])
    faces = surface.faces
    if over < 0:
        nodes = faces.nodes.copy()
        for name, rows, own in surface.by_type():
            nodes[rows, : own.shape[1]] = own[:, np.array(REVERSED[name])]
        faces = replace(faces, nodes=nodes)
    return replace(surface, x=np.column_stack([over * x[:, 0], x[:, 1], x[:, 2] + up]), faces=faces)


def _pressing(slave, master, normals, over=1.0):
    """(slave faces, 3 n_nodes), (slave faces,): what a pressure on each slave face does to nodes, and gap integrals."""
    points = contact_points(slave, master, normals=normals)
    q = points.weight[:, None] * points.normal * [over, 1, 1]
    out = np.zeros((len(slave), len(slave.x) + len(master.x), 3))
    sides = ((slave, points.slave, points.xi_slave, 0), (master, points.master, points.xi_master, len(slave.x)))
    for surface, faces, xi, first in sides:
        for code in np.unique(surface.faces.type[faces]):
            at = surface.faces.type[faces] == code
            cell = CELLS[FACE_TYPES[code]]
            N = shape(cell.name, xi[at][:, : cell.dim])
            nodes = first + surface.faces.nodes[faces[at], : cell.n_nodes]
            np.add.at(out, (points.macro[at, None], nodes), N[..., None] * q[at, None])
    return out, np.bincount(points.macro, points.weight * points.gap, len(slave))


@pytest.mark.fuzz
@pytest.mark.parametrize(
    "kind, normals",
    each_option(itertools.product(("mixed", "QUAD4", "TRIA3"), ("smoothed", "facet"))),
)
def test_what_presses_does_not_jump_as_faces_bend_and_is_mirrored(kind, normals):
    slave = whole(sheet(5, kind=kind, skew=0.1))
    master = whole(sheet(4, 0.01, kind=kind, skew=0.1, seed=1, down=True))
    last = None
    for amount in np.geomspace(1e-7, 1e-2, samples(31, 61)):  # faces bend by less and by more than what counts as flat
        made = _pressing(_bent(slave, amount), _bent(master, amount), normals)
        if last is not None:  # bends grow by a fifth or half, and what presses by no more than that
            step = amount - last[0]
            for a, b in zip(last[1], made, strict=True):
                assert np.abs(b - a).max() <= 20 * step * np.abs(b).max()
        last = amount, made
        over = _pressing(_bent(slave, amount, -1), _bent(master, amount, -1), normals, -1)
        for a, b in zip(made, over, strict=True):
            assert np.abs(b - a).max() <= 1e-10 * np.abs(a).max()


FOLDED = {
    "SEG2": [[1.0, 0.02], [0.1, -0.05]],
    "SEG3": [[1.0, 0.02], [0.1, -0.05], [0.5, 0.0]],
    "TRIA3": [[0.1, 0.1, 0.02], [1.0, 0.2, -0.05], [0.3, 0.9, 0.1]],
    "QUAD4": [[0.1, 0.1, 0.02], [1.0, 0.1, -0.05], [1.0, 0.8, -0.05], [0.1, 0.8, 0.02]],
}


@pytest.mark.parametrize("kind", FOLDED)
def test_a_face_that_has_turned_away_keeps_to_a_plane_master(kind):
    """As a face with its nodes in reverse does, which faces the master: the direction is the master's."""
    x, line = np.array(FOLDED[kind]), kind.startswith("SEG")
    plane = [[2.0, 0.0], [-1.0, 0.0]] if line else [[-1.0, -1.0, 0.0], [2.0, -1, 0], [2, 2, 0], [-1, 2, 0]]

    def points(order, **options):
        own, other = Mesh.create(x[order], [(kind, [np.arange(len(x))])]), "SEG2" if line else "TRIA3"
        whole = Mesh.create(plane, [(other, [[0, 1]] if line else [[0, 1, 2], [0, 2, 3]])])
        slave, master = Surface.of(own, [0]), Surface.of(whole, np.arange(whole.n_cells))
        found = contact_points(slave, master, normals="master", **options)
        return found, positions(found, slave, found.slave, found.xi_slave)

    (away, _), (kept, at) = points(np.arange(len(x))), points(np.arange(len(x)), keeps=np.array([True]))
    facing, there = points(np.array(REVERSED[kind]))
    assert len(away) == 0 and len(kept) == len(facing) > 0
    assert (kept.weight > 0).all() and kept.normal == pytest.approx(facing.normal)
    for own, same in ((kept.gap, facing.gap), (np.ones(len(at)), np.ones(len(there))), (at, there)):
        assert kept.weight @ own == pytest.approx(facing.weight @ same, rel=1e-12)


@pytest.mark.parametrize("height, master, keeps", [(0.2, "plate", False), (1.2, "plane", False), (0.2, "plane", True)])
def test_no_face_keeps_to_a_far_master_or_to_one_with_two_sides(height, master, keeps):
    """The back of a face would meet the far side of a plate."""
    x = [[1.0, -height], [0.0, -height], [2.0, 0.0], [-1.0, 0.0], [-1.0, -0.3], [2.0, -0.3]]
    mesh = Mesh.create(x, [("SEG2", [[0, 1], [2, 3], [4, 5]])])
    slave, skin = Surface.of(mesh, [0]), Surface.of(mesh, [1] if master == "plane" else [1, 2])
    before, after = (contact_points(slave, skin, normals="master", keeps=k) for k in (None, np.array([True])))
    assert (after.weight.sum() > before.weight.sum()) == keeps
    assert keeps or np.array_equal(before.master, after.master)
