"""Contact points: exact integrals, balance, gaps against closed forms, bodies that must not pair, mortar matrices."""

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, generate, join, raise_order
from lacmesh.errors import DataError, RequestError
from lacmesh.surface import Surface, contact_points, coverage
from lacmesh.surface.normals import smoothed
from lacmesh.surface.patches import patches
from lacmesh.topology.orientation import REVERSED
from tests.samples import each_option, samples
from tests.surface.surfaces import TYPES, blocks, errors, line, mapped, of_types, positions, sheet, whole

KINDS = {"1": "HEXA8", "2": "HEXA20", "2-full": "HEXA27"}


def skin(mesh):
    return Surface.of(mesh, mesh.cell_groups["skin"])


@pytest.mark.rows("TRIA3-QUAD4-0.0", "TRIA6-TRIA6-0.05", "TRIA7-TRIA3-0.0", "QUAD8-QUAD9-0.0")
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


@pytest.mark.rows("pyramid-1-0.2", "hexa-2-full-0.0")
@pytest.mark.parametrize("skew", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("order", KINDS)
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
def test_cut_interfaces_are_integrated_exactly_in_either_role(hexa, order, skew):
    # a distorted quadratic face that is cut has children with curved sides, in its plane
    cut = cut_skin(blocks(5, 0.0, 0.5, kind=KINDS[order], skew=skew), "skin", hexa=hexa)
    one, two = skin(cut.mesh), skin(blocks(4, -0.5, 0.0, skew=skew, seed=1))
    macro = cut.macro_of_face[one.cell]
    points = contact_points(one, two, macro=macro)
    assert max(errors(points, one, two)) < 1e-11
    assert np.abs(coverage(points, one, macro).covered / coverage(points, one, macro).area - 1).max() < 1e-12
    assert max(errors(contact_points(two, one), two, one)) < 1e-11


@pytest.mark.rows("QUAD8-0", "QUAD9-1", "TRIA6-1", "TRIA7-1")
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


def test_gaps_are_signed_as_a_solver_moves_the_surfaces_and_deep_ones_are_bounded():
    slave, master = whole(sheet(3)), whole(sheet(4, down=True))
    for z in (0.2, -0.05):
        found = coverage(contact_points(slave, master.at(master.x + np.array([0, 0, z]))), slave)
        assert np.allclose([found.min_gap, found.mean_gap, found.max_gap], z)
        assert np.allclose(found.gap_integral, z / 9)
    deep = master.at(master.x - np.array([0, 0, 0.4]))
    assert len(contact_points(slave, deep, max_penetration=0.3)) == 0
    assert np.allclose(contact_points(slave, deep, max_penetration=0.5).gap, -0.4)


def ball(x):
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def cap(n, radius, half, **options):
    """A sheet on a sphere about 0, over the square of the plane z = 1 with sides 2 half."""
    raised = lambda x: ball(np.column_stack([(2 * x[:, :2] - 1) * half, np.ones(len(x))]))  # noqa: E731
    return whole(mapped(sheet(n, **options), lambda x: radius * raised(x)))


def test_smoothed_normals_turn_from_face_to_face_and_stop_at_creases():
    slave, master = cap(8, 1.0, 0.5, kind="TRIA3"), cap(9, 1.05, 0.6, kind="TRIA3", down=True)
    worst = {}
    for normals in ("facet", "smoothed"):
        p = contact_points(slave, master, normals=normals)
        x = positions(p, slave, p.slave, p.xi_slave)
        # in the last row of faces a nodal normal is a mean over one side only, and no better than the facet's
        inner = (np.abs(x[:, :2] / x[:, 2:]) < 3 / 8).all(axis=1)
        worst[normals] = np.linalg.norm(np.cross(ball(x), p.normal), axis=1)[inner].max()
    assert worst["smoothed"] < 0.15 * worst["facet"]
    fold = lambda x: x - np.outer(np.abs(x[:, 0] - 0.5), [0, 0, 1])  # noqa: E731
    roof, over = whole(mapped(sheet(4), fold)), whole(mapped(sheet(4, 0.05, down=True), fold))
    sharp = contact_points(roof, over, normals="smoothed", crease_angle=40)
    blunt = contact_points(roof, over, normals="smoothed", crease_angle=100)
    assert np.allclose(np.abs(sharp.normal[:, 0]), np.sqrt(0.5)) and np.abs(blunt.normal[:, 0]).min() < 0.6


def test_creases_are_those_of_the_undeformed_surface():
    """A plane that folds has one normal at each node of the fold: normals would jump at the limit of a crease."""
    plane, roof = whole(sheet(4)), whole(mapped(sheet(4), lambda x: x - np.outer(np.abs(x[:, 0] - 0.5), [0, 0, 1])))
    on_fold = (roof.faces.nodes >= 0) & np.isclose(roof.x[roof.faces.nodes, 0], 0.5)
    assert np.allclose(smoothed(plane.at(roof.x), 40)[on_fold], [0, 0, 1])
    assert np.allclose(np.abs(smoothed(roof.at(2 * roof.x), 40)[on_fold][:, 0]), np.sqrt(0.5))


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


@pytest.mark.slow
def test_smoothed_normals_where_many_faces_meet_cost_no_more():
    pole = 600
    angle = 2 * np.pi * np.arange(pole) / pole
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * np.sin(2 * angle)])
    nodes = np.column_stack([np.zeros(pole, int), 1 + np.arange(pole), 1 + np.roll(np.arange(pole), -1)])
    fan = Mesh.create(np.concatenate([np.zeros((1, 3)), rim]) + np.array([5.0, 0, 0]), [("TRIA3", nodes)], space_dim=3)
    flat, with_pole = whole(sheet(150)), whole(join(sheet(150), fan))

    def seconds(surface):
        begin = time.process_time()
        smoothed(surface, 40.0)
        return time.process_time() - begin

    assert np.abs(smoothed(with_pole, 40.0)[-pole:, 0] - [0, 0, 1]).max() < 1e-12
    assert min(seconds(with_pole) for _ in range(3)) < 5 * min(seconds(flat) for _ in range(3))


def test_nothing_in_reach_and_holes():
    slave = whole(sheet(3))
    p = contact_points(slave, whole(sheet(3, 5.0, down=True)))
    assert len(p) == 0 and len(p.groups) == 0
    found = coverage(p, slave)
    assert not found.ratio.any() and np.isnan(found.mean_gap).all() and np.isnan(found.min_gap).all()
    assert len(contact_points(slave, whole(sheet(3, 5.0, down=True)), search_distance=6.0)) > 0
    assert len(contact_points(slave, whole(sheet(3, 0.1, down=False)))) == 0


def test_degenerate_faces_yield_nothing_and_no_nan():
    mesh = sheet(6, kind="mixed")
    points = mesh.points.copy()
    points[10] = points[9]
    points[20:22] = np.nan
    points[30] = 1e300
    slave = whole(replace(mesh, points=points))
    master = whole(sheet(5, 0.01, down=True))
    for one, two in ((slave, master), (master, slave)):
        p = contact_points(one, two, search_distance=0.5)
        assert len(p)
        for name in ("xi_slave", "xi_master", "weight", "normal", "gap"):
            assert np.isfinite(getattr(p, name)).all()
        assert np.isfinite(coverage(p, one).ratio).all()
    assert not len(contact_points(whole(mapped(sheet(2), lambda x: x * [1, 0, 0])), master))


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
    found = coverage(p, slave, macro)
    assert len(found.area) == macro.max() + 1 and np.allclose(found.ratio[2:], 1)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"normals": "nodal"}, RequestError), ({"search_distance": -1.0}, RequestError),
        ({"max_penetration": np.nan}, RequestError), ({"macro": [0, 1]}, ValueError),
        ({"axisymmetric": True}, RequestError),
    ],
)  # fmt: skip
def test_wrong_requests(options, error):
    slave, master = whole(sheet(2)), whole(sheet(2, 0.1, down=True))
    with pytest.raises(error):
        contact_points(slave, master, **options)
    with pytest.raises(RequestError, match="dimension"):
        contact_points(slave, whole(line(2)))


def of_macros(points, slave, master, values):
    """(n_macros, n_nodes, k) of slave and of master: integrals of shape functions times values (n, k) at the points."""
    out = []
    for surface, faces, xi in ((slave, points.slave, points.xi_slave), (master, points.master, points.xi_master)):
        own = np.zeros((points.macro.max() + 1, len(surface.x), values.shape[1]))
        for at, nodes, N in of_types(surface, faces, xi):
            weight = points.weight[at, None, None]
            np.add.at(own, (points.macro[at, None], nodes), N[..., None] * weight * values[at, None])
        out.append(own)
    return out


@pytest.mark.rows("QUAD4-facet")
@pytest.mark.fuzz
@pytest.mark.parametrize(
    "kind, normals", each_option(itertools.product(("mixed", "QUAD4", "TRIA3"), ("smoothed", "facet")))
)
def test_what_presses_does_not_jump_as_faces_bend_and_is_mirrored(kind, normals):
    def pressing(amount, over=1):
        """What a pressure on each slave face does to nodes, and gap integrals; -1: of the mirror image."""

        def bent(x):
            up = amount * (np.sin(3 * x[:, 0]) * np.cos(3 * x[:, 1]) + x[:, 0] * x[:, 1])
            return np.column_stack([over * x[:, 0], x[:, 1], x[:, 2] + up])

        slave = whole(mapped(sheet(5, kind=kind, skew=0.1, down=over < 0), bent))
        master = whole(mapped(sheet(4, 0.01, kind=kind, skew=0.1, seed=1, down=over > 0), bent))
        points = contact_points(slave, master, normals=normals)
        forces = of_macros(points, slave, master, points.normal * [over, 1, 1])
        return *forces, np.bincount(points.macro, points.weight * points.gap)

    last = None
    for amount in np.geomspace(1e-7, 1e-2, samples(31, 61)):  # faces bend by less and by more than what counts as flat
        made = pressing(amount)
        if last is not None:  # bends grow by a fifth or half, and what presses by no more than that
            for a, b in zip(last[1], made, strict=True):
                assert np.abs(b - a).max() <= 20 * (amount - last[0]) * np.abs(b).max()
        last = amount, made
        for a, b in zip(made, pressing(amount, -1), strict=True):
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


# ---- mortar matrices, averaged over macro-elements, that a solver builds from points of cut skins


def strip(n, low, high):
    """n x 1 quadrangles over x in [0, 1], group `skin`: their upper side (high = 0) or their lower one."""
    x = np.linspace(0, 1, n + 1)
    x[1:-1] += 0.2 / n * np.random.default_rng(n).uniform(-1, 1, n - 1)
    mesh = generate.rectangle((x, [low, high]))
    return mesh.renamed(**{"top" if high == 0 else "bottom": "skin"}).only("body", "skin")


@pytest.mark.parametrize("space", ["plane", "axisymmetric", "pyramid", "hexa"])
@pytest.mark.parametrize("order", ["1", "2"])
def test_both_sides_of_every_macro_element_sum_to_its_area(space, order):
    flat = space in ("plane", "axisymmetric")
    lower, upper = (strip(5, -0.3, 0.0), strip(7, 0.02, 0.4)) if flat else (blocks(4, -0.4, 0), blocks(5, 0.02, 0.4))
    if order == "2":
        lower, upper = raise_order(lower, "2"), raise_order(upper, "2")
    cut = cut_skin(upper, "skin", **({} if flat else {"hexa": space}))
    slave, master = skin(cut.mesh), skin(lower)
    macro = cut.macro_of_face[slave.cell]
    points = contact_points(slave, master, macro=macro, axisymmetric=space == "axisymmetric")
    found = coverage(points, slave, macro)
    D, M = (side[..., 0] for side in of_macros(points, slave, master, np.ones((len(points), 1))))
    assert np.allclose(found.ratio, 1, rtol=1e-12, atol=0)
    for side in (D, M):
        assert np.allclose(side.sum(axis=1), found.area, rtol=1e-12, atol=0)
    whole = np.pi if space == "axisymmetric" else 1.0
    assert np.isclose(found.area.sum(), whole, rtol=1e-12, atol=0)
    # a linear displacement has the same average on either side: what a patch test asks
    for axis in range(1 if flat else 2):
        assert np.allclose(D @ slave.x[:, axis], M @ master.x[:, axis], rtol=1e-11, atol=0)
    # the node inside each macro-element has a column that no other macro-element shares: the cut's own freedom
    own = (np.abs(D) > 1e-14).sum(axis=0) == 1
    assert ((np.abs(D) > 1e-14) & own).any(axis=1).all()
