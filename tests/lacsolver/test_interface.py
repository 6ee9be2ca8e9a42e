"""Interfaces: B, G and w against plain sums and closed forms, balance, ties across a gap, numbers, errors."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.cutting.records import Cut
from lacmesh.errors import DataError, GroupNotFoundError, RequestError
from lacmesh.reference.shapes import shape
from lacmesh.topology.skin import FACE_TYPES, N_NODES
from lacsolver.contact import Pairing, Zone, integrate
from lacsolver.contact.interface import positions
from lacsolver.contact.rows import macro_rows
from tests.lacsolver.finite_cases import waves
from tests.lacsolver.patch_meshes import placed, stack, three_blocks
from tests.problem_meshes import nodes_of, overhang
from verification.meshes.stacks import tilt

#: (slave, master, dimension): every family of faces, linear and quadratic
PAIRS = [
    ("QUAD4", "TRIA3", 2),
    ("TRIA6", "QUAD8", 2),
    ("HEXA8", "TETRA4", 3),
    ("TETRA10", "HEXA20", 3),
    ("mixed 2-full", "HEXA27", 3),
]
ALL = pytest.mark.parametrize("slave, master, dim", PAIRS)


@cache
def wavy(slave, master, dim, gap=0.1, counts=(3, 4), margin=0.0, surface="smooth"):
    """Two blocks that wave, from x = 1 on; the slave stops short of its master's rim by `margin` on each side."""
    return zone_of(waves(slave, master, dim, gap=gap, counts=counts, margin=margin), surface=surface)


def zone_of(mesh, slave="slave", master="master", surface="smooth"):
    """(the mesh cut, its zone)."""
    made = lacmesh.cut_skin(mesh, slave).mesh
    return made, Zone.of(made, slave, master, surface=surface)


def values(surface, faces, xi):
    """(points, 9) shape functions and nodes at points of faces; -1 where a face has fewer nodes."""
    N, nodes = np.zeros((len(faces), 9)), surface.faces.nodes[faces]
    kind = surface.faces.type[faces]
    for code in np.unique(kind):
        rows = kind == code
        N[rows, : N_NODES[code]] = shape(FACE_TYPES[code], xi[rows, : surface.dim])
    return N, nodes


# ---- rows


@ALL
def test_rows_are_plain_sums_over_points(slave, master, dim):
    mesh, zone = wavy(slave, master, dim)
    points = integrate(zone, dim, Pairing(search_distance=0.5)).points
    q = np.random.default_rng(0).uniform(-1, 1, (len(points), 2))
    want = np.zeros((zone.n_macros, mesh.n_nodes, 2))
    for surface, faces, xi, sign in (
        (zone.slave, points.slave, points.xi_slave, 1.0),
        (zone.master, points.master, points.xi_master, -1.0),
    ):
        N, nodes = values(surface, faces, xi)
        for k in range(9):
            on = nodes[:, k] >= 0
            np.add.at(want, (points.macro[on], nodes[on, k]), sign * N[on, k, None] * q[on])
    found = macro_rows(points, zone.slave, zone.master, q, zone.n_macros)
    np.testing.assert_allclose(found.toarray().reshape(want.shape), want, atol=1e-14 * np.abs(want).max())
    assert found.has_sorted_indices and found.has_canonical_format


@ALL
@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_rigid_motions_do_no_work(slave, master, dim, normals):
    """Forces and moments of every macro-element are in balance, on skins of any shape, with a gap between them."""
    mesh, zone = wavy(slave, master, dim)
    face = integrate(zone, dim, Pairing(normals=normals, search_distance=0.5))
    assert face.coverage.min() < 0.99 and np.abs(face.distance).min() > 0.05
    for motion in rigid_motions(mesh.points, dim):
        work = np.abs(face.B) @ np.abs(motion.ravel())
        np.testing.assert_array_less(np.abs(face.B @ motion.ravel()), 1e-14 * work + 1e-300)


def rigid_motions(x, dim):
    """Translations and rotations of points x (n, 3), each (n, dim)."""
    for k in range(dim):
        yield np.tile(np.eye(dim)[k], (len(x), 1))
    for axis in np.eye(3)[[2]] if dim == 2 else np.eye(3):
        yield np.cross(axis, x)[:, :dim]


@ALL
def test_a_row_is_the_integral_of_the_closing(slave, master, dim):
    """The slave moved by h along the normal of a flat interface: B v = h w, and G falls by as much."""
    mesh, zone = zone_of(stack(slave, master, dim, gap=0.1))
    face = integrate(zone, dim, Pairing(search_distance=0.5))
    v = np.zeros((mesh.n_nodes, dim))
    v[nodes_of(mesh, "lower"), dim - 1] = 0.03
    np.testing.assert_allclose(face.B @ v.ravel(), 0.03 * face.w, rtol=1e-12)
    moved = mesh.points.copy()
    moved[:, :dim] += v
    after = integrate(zone, dim, Pairing(search_distance=0.5), x=moved)
    np.testing.assert_allclose(after.G, face.G - face.B @ v.ravel(), rtol=1e-12)


# ---- gaps and measures


@ALL
def test_the_gap_to_a_sloping_plane(slave, master, dim):
    """g = 0.2 + 0.1 x - 0.05 y: its mean over a flat macro-element is that at its centroid."""
    mesh = stack(slave, master, dim, skew=0.1)
    x, high = mesh.points.copy(), nodes_of(mesh, "upper")
    slope = np.array([0.1, -0.05, 0.0])[:dim]
    slope[dim - 1] = 0.0
    x[high, dim - 1] += 0.2 + x[high][:, :dim] @ slope
    _, zone = zone_of(Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=dim))
    face = integrate(zone, dim, Pairing(search_distance=0.5))
    np.testing.assert_allclose(face.coverage, 1.0, rtol=1e-12)
    at = positions(zone.slave, face.points)[:, :dim] @ slope
    mean = np.bincount(face.points.macro, face.weight * at) / face.w
    np.testing.assert_allclose(face.gap, 0.2 + mean, rtol=1e-11)
    if FACE_TYPES[zone.slave.faces.type[0]] in ("SEG2", "SEG3", "TRIA3", "TRIA6"):
        np.testing.assert_allclose(face.gap, 0.2 + face.centre @ slope, rtol=1e-11)
    np.testing.assert_allclose(face.G, face.gap * face.area, rtol=1e-11)


@pytest.mark.parametrize("measure", ["reference", "current"])
@pytest.mark.parametrize("slave, master, dim", PAIRS[:4])
def test_measures_of_a_slave_that_has_stretched(slave, master, dim, measure):
    """Both skins twice as wide along x, and turned: the current measure is double, the nominal one as it was."""
    mesh, zone = zone_of(stack(slave, master, dim, gap=0.1, skew=0.1))
    x = (mesh.points * [2.0, 1.0, 1.0]) @ tilt(dim).T
    before = integrate(zone, dim, Pairing(search_distance=0.5))
    after = integrate(zone, dim, Pairing(search_distance=0.5, measure=measure), x=x)
    size = 2.0 if measure == "current" else 1.0
    np.testing.assert_allclose(after.area, size * before.area, rtol=1e-12)
    np.testing.assert_allclose(after.w, size * before.w, rtol=1e-10)
    np.testing.assert_allclose(after.gap, 0.1, rtol=1e-11)
    np.testing.assert_allclose(after.coverage, 1.0, rtol=1e-10)


@pytest.mark.parametrize("measure", ["reference", "current"])
def test_measures_about_an_axis(measure):
    """Rings of 2 pi r: of a slave at x in [1, 2], moved out by 1."""
    mesh, zone = zone_of(placed(stack("QUAD4", "TRIA3", 2, gap=0.1), shift=(1, 0, 0)))
    pairing = Pairing(search_distance=0.5, axisymmetric=True, measure=measure)
    before = integrate(zone, 2, pairing)
    x = nodes_x(mesh, "slave")
    assert before.area.sum() == pytest.approx(np.pi * (4 - 1), rel=1e-13)
    np.testing.assert_allclose(before.area, np.pi * np.diff(np.array(x) ** 2), rtol=1e-12)
    after = integrate(zone, 2, pairing, x=mesh.points + np.array([1.0, 0, 0]))
    total = np.pi * (9 - 4) if measure == "current" else np.pi * (4 - 1)
    assert after.area.sum() == pytest.approx(total, rel=1e-13)
    np.testing.assert_allclose(after.w, after.area, rtol=1e-12)
    v = np.zeros((mesh.n_nodes, 2))
    v[nodes_of(mesh, "lower"), 1] = 1.0
    assert (after.B @ v.ravel()).sum() == pytest.approx(total, rel=1e-12)


def nodes_x(mesh, group):
    """Ends of the macro-elements of a plane slave, along x."""
    cut = Cut(mesh)
    cells = mesh.cells_of(group)
    macro = cut.macro_of_face[cells]
    rows = {c: nodes for _, chosen, nodes in mesh.select(cells) for c, nodes in zip(chosen, nodes, strict=True)}
    ends = [[mesh.points[rows[c], 0] for c in cells[macro == m]] for m in np.unique(macro)]
    low = [min(e.min() for e in own) for own in ends]
    return [*low, max(e.max() for e in ends[-1])]


def test_thickness_multiplies_everything():
    _, zone = wavy("QUAD4", "TRIA3", 2)
    one, other = (integrate(zone, 2, Pairing(search_distance=0.5, thickness=h)) for h in (1.0, 2.5))
    for name in ("G", "w", "area"):
        np.testing.assert_allclose(getattr(other, name), 2.5 * getattr(one, name), rtol=1e-15)
    np.testing.assert_allclose(other.B.toarray(), 2.5 * one.B.toarray(), rtol=1e-14)
    np.testing.assert_allclose(other.gap, one.gap, rtol=1e-14)


@pytest.mark.parametrize(
    "clearance, wanted",
    [
        (-0.02, lambda x, y, t: -0.02 + 0 * x),
        (lambda x, t: 0.1 * x[:, 0] - 0.2 * x[:, 1] + 0.3 * t, lambda x, y, t: 0.1 * x - 0.2 * y + 0.3 * t),
    ],
)
def test_a_clearance_is_that_of_the_undeformed_place(clearance, wanted):
    """Also where the slave has moved away from it."""
    mesh, zone = zone_of(stack("HEXA8", "TETRA4", 3, gap=0.1))
    pairing = Pairing(search_distance=0.5, clearance=clearance)
    plain = integrate(zone, 3, Pairing(search_distance=0.5))
    for t, shift in ((1.0, [0, 0, 0]), (0.25, [3, 4, 5])):
        face = integrate(zone, 3, pairing, x=mesh.points + shift, t=t)
        x, y = plain.centre[:, 0], plain.centre[:, 1]
        np.testing.assert_allclose(face.gap, 0.1 + wanted(x, y, t), rtol=1e-11)
        np.testing.assert_allclose(face.G, face.gap * face.w, rtol=1e-11)
        np.testing.assert_allclose(face.weight @ face.distance, face.G.sum(), rtol=1e-12)


def test_what_is_not_covered_has_no_gap():
    _, zone = zone_of(overhang())
    face = integrate(zone, 2)
    order = np.argsort(face.centre[:, 0])
    np.testing.assert_allclose(face.coverage[order], [1, 1, 0.5, 0], atol=1e-12)
    assert np.isnan(face.gap[order[3]]) and face.w[order[3]] == 0 and np.isfinite(face.gap[order[:3]]).all()
    assert face.B[[order[3]]].nnz == 0
    np.testing.assert_allclose(face.area, 0.25, rtol=1e-13)


def test_points_know_where_they_are():
    _, zone = wavy("TRIA6", "QUAD8", 2)
    face = integrate(zone, 2, Pairing(search_distance=0.5))
    N, nodes = values(zone.slave, face.points.slave, face.points.xi_slave)
    x = np.einsum("pa,pas->ps", N, zone.slave.x[nodes])
    np.testing.assert_allclose(positions(zone.slave, face.points), x, atol=1e-15)
    N, nodes = values(zone.master, face.points.master, face.points.xi_master)
    there = np.einsum("pa,pas->ps", N, zone.master.x[nodes])
    np.testing.assert_allclose(there, x + face.points.gap[:, None] * face.points.normal, atol=1e-13)


# ---- ties


@pytest.mark.parametrize("slave, master, dim", [("QUAD4", "TRIA3", 2), ("HEXA8", "TETRA4", 3), ("TETRA4", "HEXA8", 3)])
@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_a_tie_lets_rigid_motions_be(slave, master, dim, gap):
    """Also across a gap: the moment_arm of the rotation is part of the jump."""
    mesh, zone = zone_of(placed(stack(slave, master, dim, gap=gap, skew=0.1), tilt(dim)))
    face = integrate(zone, dim, Pairing(search_distance=0.5), tie=True)
    assert face.B.shape == (dim * zone.n_macros, dim * mesh.n_nodes) and (face.G == 0).all()
    np.testing.assert_allclose(face.w, face.area, rtol=1e-12)
    for motion in rigid_motions(mesh.points, dim):
        work = np.abs(face.B) @ np.abs(motion.ravel())
        np.testing.assert_array_less(np.abs(face.B @ motion.ravel()), 1e-13 * work + 1e-300)


@pytest.mark.parametrize("slave, master, dim", [("QUAD4", "TRIA3", 2), ("HEXA8", "TETRA4", 3)])
def test_the_lever_of_a_tie_is_what_a_rotation_costs_without_it(slave, master, dim):
    """Without the gap's moment_arm a turn by 1 about an axis moves the far side by the gap, w times."""
    mesh, zone = zone_of(stack(slave, master, dim, gap=0.1))
    face = integrate(zone, dim, Pairing(search_distance=0.5), tie=True)
    plain = macro_rows(face.points, zone.slave, zone.master, face.weight[:, None], zone.n_macros)
    *_, turn = rigid_motions(mesh.points, dim)
    if dim == 3:
        turn = np.cross([0.0, 1.0, 0.0], mesh.points)
    jump = plain @ turn
    along = -0.1 * face.w if dim == 3 else 0.1 * face.w
    np.testing.assert_allclose(jump[:, 0], along, rtol=1e-11)
    np.testing.assert_allclose(jump[:, 1:], 0, atol=1e-12)


@pytest.mark.parametrize("slave, master, dim", PAIRS)
def test_the_rows_of_a_tie_are_the_jump(slave, master, dim):
    """A master that moves away along each axis: minus its motion, w times."""
    mesh, zone = zone_of(stack(slave, master, dim, gap=0.0))
    face = integrate(zone, dim, Pairing(search_distance=0.5), tie=True)
    move = np.array([0.5, -1.0, 2.0])[:dim]
    v = np.zeros((mesh.n_nodes, dim))
    v[nodes_of(mesh, "upper")] = move
    np.testing.assert_allclose((face.B @ v.ravel()).reshape(-1, dim), -face.w[:, None] * move, rtol=1e-11)


# ---- zones


def test_macro_elements_keep_the_number_of_the_cut():
    """A second zone's begin after the first's; rows stand in the order of their numbers."""
    mesh = lacmesh.cut_skin(three_blocks(), ["slave1", "slave2"]).mesh
    cut = Cut(mesh)
    numbers = []
    for k in (1, 2):
        zone = Zone.of(mesh, f"slave{k}", f"master{k}")
        assert zone.name == f"slave{k}"
        np.testing.assert_array_equal(zone.number[zone.macro], cut.macro_of_face[zone.slave.cell])
        assert (np.diff(zone.number) > 0).all()
        face = integrate(zone, 3)
        for row in (0, zone.n_macros - 1):
            cells = np.flatnonzero(cut.macro_of_face == zone.number[row])
            x = np.concatenate([mesh.points[nodes].mean(axis=1) for _, _, nodes in mesh.select(cells)])
            assert x.min(axis=0)[0] <= face.centre[row, 0] <= x.max(axis=0)[0]
            assert np.isin(face.B[[row]].indices // 3, nodes_of(mesh, f"slave{k}")).any()
        numbers.append(zone.number)
    assert not np.intersect1d(*numbers).size and len(np.concatenate(numbers)) == cut.n_macros


def test_sums_over_macro_elements():
    _, zone = wavy("HEXA8", "TETRA4", 3)
    values = np.arange(2.0 * len(zone.slave)).reshape(-1, 2)
    want = [values[zone.macro == m].sum(axis=0) for m in range(zone.n_macros)]
    np.testing.assert_allclose(zone.sums(values), want)


def bad_zones():
    """Three blocks of which slave1 is cut, and groups that are no zone."""
    mesh = lacmesh.cut_skin(three_blocks(), "slave1").mesh
    faces = mesh.cell_groups["slave1"]
    both = np.sort(np.append(mesh.cell_groups["master1"], faces[0]))
    return replace(mesh, cell_groups={**mesh.cell_groups, "part": faces[:-1], "both": both})


@pytest.mark.parametrize(
    "slave, master, error, says",
    [
        ("slave1", "slave1", RequestError, "slave 'slave1' and master 'slave1' share faces; a zone needs two skins"),
        ("slave1", "both", RequestError, "slave 'slave1' and master 'both' share faces"),
        ("slave2", "master2", DataError, "of slave 'slave2' belong to no macro-element; cut this group: lacmesh cut"),
        ("part", "master1", DataError, "1 macro-elements of slave 'part' have faces outside the group"),
        ("slave3", "master1", GroupNotFoundError, "slave3"),
        ("slave1", "mster1", GroupNotFoundError, "master1"),
    ],
)
def test_what_is_no_zone_is_said(slave, master, error, says):
    with pytest.raises(error, match=says):
        Zone.of(bad_zones(), slave, master)
