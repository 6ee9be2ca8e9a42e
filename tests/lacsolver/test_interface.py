"""Interfaces: rows, gaps and measures against closed forms, balance, ties, tractions, zones, numbers."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cutting.records import Cut
from lacmesh.errors import DataError, GroupNotFoundError, RequestError
from lacsolver.contact import Pairing, Zone, integrate
from lacsolver.contact.shear import first_directions
from tests.lacsolver.patch_meshes import placed, stack, three_blocks, waves
from tests.problem_meshes import nodes_of
from tests.samples import each_option

#: (slave, master, dimension): every family of faces, linear and quadratic
PAIRS = [
    ("QUAD4", "TRIA3", 2),
    ("TRIA6", "QUAD8", 2),
    ("HEXA8", "TETRA4", 3),
    ("TETRA10", "HEXA20", 3),
    ("mixed 2-full", "HEXA27", 3),
]
#: every family of faces that a slave or a master can have
EVERY = [
    *PAIRS, ("TRIA3", "QUAD9", 2), ("QUAD8", "TRIA6", 2), ("PENTA6 triangle", "HEXA20", 3), ("HEXA20", "TETRA10", 3)
]  # fmt: skip
MEASURES, NORMALS = ("reference", "current"), ("facet", "smoothed", "master")
FAR = Pairing(search_distance=0.5)


@cache
def wavy(slave, master, dim, gap=0.1, counts=(3, 4), margin=0.0, surface="smooth"):
    """Two blocks that wave, from x = 1 on; the slave stops short of its master's rim by `margin` on each side."""
    return zone_of(waves(slave, master, dim, gap=gap, counts=counts, margin=margin), surface=surface)


def zone_of(mesh, slave="slave", master="master", surface="smooth"):
    """(the mesh cut, its zone)."""
    made = lacmesh.cut_skin(mesh, slave).mesh
    return made, Zone.of(made, slave, master, surface=surface)


def rigid_motions(x, dim):
    """Translations and rotations of points x (n, 3), each (n, dim)."""
    for k in range(dim):
        yield np.tile(np.eye(dim)[k], (len(x), 1))
    for axis in np.eye(3)[[2]] if dim == 2 else np.eye(3):
        yield np.cross(axis, x)[:, :dim]


def distorted(slave, master, dim, measure="reference", normals="facet", margin=0.15, **options):
    """A zone with friction whose wavy skins are deformed at random, and its coordinates and interface there."""
    mesh, zone = wavy(slave, master, dim, gap=0.1, counts=(2, 3), margin=margin)
    x = mesh.points.copy()
    x[:, :dim] += 4e-3 * np.random.default_rng(1).uniform(-1, 1, (len(x), dim))
    pairing = Pairing(search_distance=0.6, normals=normals, measure=measure, friction=True, **options)
    return zone, x, integrate(zone, dim, pairing, x=x)


def uniform(mesh, group, motion):
    """Displacements (n_dof,) that move a group of cells, and nothing else."""
    v = np.zeros((mesh.n_nodes, len(motion)))
    v[nodes_of(mesh, group)] = motion
    return v.ravel()


def assert_no_work(rows, x, dim, within):
    """Rigid motions of both skins are no work of any row, to rounding of what is summed."""
    for motion in rigid_motions(x, dim):
        work = np.abs(rows) @ np.abs(motion.ravel())
        np.testing.assert_array_less(np.abs(rows @ motion.ravel()), within * work + 1e-300)


@pytest.mark.parametrize(
    "pair, measure, normals, margin", each_option(itertools.product(EVERY, MEASURES, NORMALS, (0.15, 0.0))), ids=str
)
def test_forces_and_moments_balance(pair, measure, normals, margin):
    """A rigid motion of both skins is no closing and no slip, across gaps, with any normals, at a rim too."""
    zone, x, face = distorted(*pair, measure, normals, margin)
    dim = pair[2]
    assert face.B_T.shape == (zone.n_macros * (dim - 1), dim * len(x)) and np.abs(face.points.ray).min() > 0.05
    assert (face.coverage.min() > 0.99) == (margin > 0)
    assert_no_work(face.B, x, dim, 1e-14)
    assert_no_work(face.B_T, x, dim, 1e-12)


# ---- gaps and measures


@pytest.mark.parametrize("measure", MEASURES)
def test_measures_about_an_axis(measure):
    """Rings of 2 pi r: of a slave at x in [1, 2], moved out by 1."""
    mesh, zone = zone_of(placed(stack("QUAD4", "TRIA3", 2, gap=0.1), shift=(1, 0, 0)))
    pairing = Pairing(search_distance=0.5, axisymmetric=True, measure=measure)
    before, after = (integrate(zone, 2, pairing, x=np.add(mesh.points, [out, 0, 0])) for out in (0.0, 1.0))
    assert before.area.sum() == pytest.approx(np.pi * (4 - 1), rel=1e-13)
    total = np.pi * (9 - 4) if measure == "current" else np.pi * (4 - 1)
    assert after.area.sum() == pytest.approx(total, rel=1e-13)
    np.testing.assert_allclose(after.w, after.area, rtol=1e-12)
    assert (after.B @ uniform(mesh, "lower", [0.0, 1.0])).sum() == pytest.approx(total, rel=1e-12)


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
    pairing, plain = replace(FAR, clearance=clearance), integrate(zone, 3, FAR)
    for t, shift in ((1.0, [0, 0, 0]), (0.25, [3, 4, 5])):
        face = integrate(zone, 3, pairing, x=mesh.points + shift, t=t)
        np.testing.assert_allclose(face.gap, 0.1 + wanted(*plain.centre[:, :2].T, t), rtol=1e-11)
        np.testing.assert_allclose(face.G, face.gap * face.w, rtol=1e-11)
        np.testing.assert_allclose(face.weight @ face.distance, face.G.sum(), rtol=1e-12)


# ---- ties


# ---- tractions


@pytest.mark.parametrize("pair, normals", each_option(itertools.product(EVERY, NORMALS)))
def test_a_traction_has_its_size_at_every_point(pair, normals):
    _, _, face = distorted(*pair, normals=normals)
    points, dim = face.points, pair[2]
    e = face.tangents.e
    axes = np.concatenate([e, points.normal[:, None, :dim]], axis=1)
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), np.tile(np.eye(dim), (len(e), 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(axes), 1 if dim == 3 else -1, atol=1e-13)


@pytest.mark.parametrize("pair", [("TRIA6", "QUAD8", 2), ("HEXA8", "TETRA4", 3), ("TETRA10", "HEXA20", 3)], ids=str)
@pytest.mark.parametrize("normals", NORMALS)
def test_the_frame_is_the_mean_direction_of_the_force_and_turns_with_the_skin(pair, normals):
    """The force of tractions t on the slave is -sum w t_alpha times the frame, whatever the curvature.

    A rotation by 1.4 of skins that are deformed turns the tangents by it, and the rows.
    """
    (zone, x, face), dim, random = distorted(*pair, normals=normals), pair[2], np.random.default_rng(2)
    t = random.uniform(-1, 1, (zone.n_macros, dim - 1))
    forces = (face.B_T.T @ t.ravel()).reshape(-1, dim)
    of_slave = np.unique(zone.slave.faces.nodes[zone.slave.faces.nodes >= 0])
    want = np.einsum("m,ma,mas->s", face.w, t, face.frame)
    np.testing.assert_allclose(forces[of_slave].sum(axis=0), want, atol=1e-13)
    assert np.linalg.norm(np.einsum("ma,mas->ms", t, face.frame), axis=1).max() <= np.linalg.norm(t, axis=1).max()
    axis, angle = (np.array([0, 0, 1.0]) if dim == 2 else np.array([1.0, 2.0, -2.0]) / 3), 1.4
    W = np.cross(np.eye(3), axis)
    R = np.eye(3) - np.sin(angle) * W + (1 - np.cos(angle)) * W @ W
    turned = integrate(zone, dim, Pairing(search_distance=0.6, normals=normals, friction=True), x=x @ R.T)
    np.testing.assert_allclose(turned.frame, face.frame @ R[:dim, :dim].T, atol=1e-12)
    v = random.uniform(-1, 1, (len(x), dim))
    np.testing.assert_allclose(turned.B_T @ (v @ R[:dim, :dim].T).ravel(), face.B_T @ v.ravel(), atol=1e-11)


def test_first_directions():
    """Along the first axis that is most tangential to the whole zone; a macro-element across it takes the next."""
    _, zone = zone_of(stack("HEXA8", "TETRA4", 3))
    np.testing.assert_allclose(first_directions(zone), np.broadcast_to([1.0, 0, 0], (zone.n_macros, 3)), atol=1e-14)
    x = zone.slave.x[:, [2, 0, 1]]
    turned = replace(zone, slave=zone.slave.at(x))
    np.testing.assert_allclose(first_directions(turned), np.broadcast_to([0, 1.0, 0], (zone.n_macros, 3)), atol=1e-14)


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
        numbers.append(zone.number)
    assert not np.intersect1d(*numbers).size and len(np.concatenate(numbers)) == cut.n_macros


@pytest.mark.parametrize(
    "slave, master, error, words",
    [
        ("slave1", "slave1", RequestError, "share faces"),
        ("slave1", "both", RequestError, "share faces"),
        ("slave2", "master2", DataError, "belong to no"),
        ("part", "master1", DataError, "faces outside the"),
        ("slave3", "master1", GroupNotFoundError, "slave3"),
        ("slave1", "mster1", GroupNotFoundError, "master1"),
    ],
)
def test_what_is_no_zone_is_said(slave, master, error, words):
    """Three blocks of which slave1 is cut, and groups that are no zone."""
    mesh = lacmesh.cut_skin(three_blocks(), "slave1").mesh
    faces = mesh.cell_groups["slave1"]
    both = np.sort(np.append(mesh.cell_groups["master1"], faces[0]))
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "part": faces[:-1], "both": both})
    with pytest.raises(error, match=words):
        Zone.of(mesh, slave, master)


# ---- on the unknowns of other programs


@pytest.fixture(scope="module")
def given():
    """(system, pair) of the two blocks."""
    system = ls.assemble("data/two_blocks.toml")
    return system, ls.contact_matrices(system.mesh, "slave", "master")


def test_every_layout_gives_the_same_gaps_and_slips(given):
    """Node-major, component-major, permuted nodes, and an unknown of its own for each displacement."""
    _, pair = given
    u, rng = np.random.default_rng(1).uniform(size=(pair.mesh.n_nodes, 3)), np.random.default_rng(2)
    n = u.size
    order, each = rng.permutation(len(u)), rng.permutation(2 * n)[:n]
    of_order = np.empty_like(u)
    of_order[order] = u
    of_each = np.full(2 * n, np.nan)
    of_each[each] = u.ravel()
    for theirs, v in (
        (pair.renumber(), u.ravel()),
        (pair.renumber("components"), u.T.ravel()),
        (pair.renumber(nodes=order), of_order.ravel()),
        (pair.renumber("components", nodes=order), of_order.T.ravel()),
        (pair.renumber(each.reshape(u.shape), n=2 * n), np.nan_to_num(of_each)),
    ):
        np.testing.assert_allclose(theirs.B @ v, pair.B @ u.ravel(), atol=1e-12)
        np.testing.assert_allclose(theirs.B_T @ v, pair.B_T @ u.ravel(), atol=1e-12)


def test_slips_are_those_of_a_case_with_friction_and_a_tie_has_none(given):
    _, pair = given
    case = ls.read_case("data/two_blocks.toml")
    (rubbed,) = ls.contact_matrices(replace(case, contact=[replace(case.contact[0], friction=0.3)])).values()
    np.testing.assert_allclose((rubbed.B_T - pair.B_T).toarray(), 0, atol=1e-15)
    np.testing.assert_allclose(rubbed.tangents, pair.tangents, atol=1e-15)
    (tied,) = ls.contact_matrices(replace(case, contact=[], tie=[ls.Tie(slave="slave", master="master")])).values()
    assert tied.B_T is None and tied.tangents is None


def test_eliminated_unknowns_move_the_gaps(given):
    """Supports that are gone, one of them moved: the solution is that with all unknowns."""
    system, pair = given
    u0 = system.u0.copy()
    u0[system.fixed[system.fixed % 3 == 2]] = 0.01  # the bottom is lifted
    whole = ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=u0)
    free = np.setdiff1d(np.arange(len(u0)), system.fixed)
    numbers = np.full(len(u0), -1)
    numbers[free] = np.arange(len(free))
    theirs = pair.renumber(numbers.reshape(-1, 3), u0=u0.reshape(-1, 3))
    part = ls.solve_contact(system.K[free][:, free], (system.f - system.K @ u0)[free], theirs.B, theirs.G)
    np.testing.assert_allclose(part.u, whole.u[free], atol=1e-9 * abs(whole.u).max())
    np.testing.assert_allclose(part.pressure, whole.pressure, atol=1e-9 * whole.pressure.max())


@pytest.mark.parametrize("order", [1, 2])
def test_cells_with_nodes_in_another_order_are_found(order):
    """Two blocks whose skins have nodes at the same places, numbered at random, the nodes of each cell shuffled."""
    mesh = lacmesh.read("data/two_blocks.msh")
    mesh = lacmesh.raise_order(mesh) if order == 2 else mesh
    pair = ls.contact_matrices(mesh, "slave", "master", hexa="hexa")
    rng = np.random.default_rng(3)
    number = rng.permutation(pair.mesh.n_nodes)
    points = np.empty_like(pair.mesh.points)
    points[number] = pair.mesh.points
    solids = [name for name in ("TETRA4", "HEXA8", "TETRA10", "HEXA20", "HEXA27") if len(pair.mesh.block(name))]
    cells = {name: rng.permuted(number[pair.mesh.block(name)], axis=1) for name in solids}
    theirs, ours = pair.renumber(nodes=cells, points=points), pair.renumber(nodes=number)
    assert len(solids) == 2 and abs(theirs.B - ours.B).max() == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"unknowns": "rows"}, "nodes, components"),
        ({"unknowns": np.zeros((512, 3), int)}, "that of 1536"),
        ({"unknowns": np.arange(1536).reshape(512, 3), "n": 1000}, "are 1000 unknowns"),
        ({"unknowns": np.arange(1024).reshape(512, 2)}, "is needed"),
        ({"nodes": np.arange(5)}, "has 512 nodes"),
        ({"nodes": {"HEXA8": np.zeros((3, 8), int)}, "points": np.zeros((512, 3))}, "cut mesh has"),
        ({"nodes": {"TETRA4": 0}}, "give points="),
        ({"nodes": np.full(512, -1)}, "nodes in contact"),
        ("cells in another order", "lies elsewhere"),
        ("moved unknowns of friction", "counts slips"),
    ],
)
def test_what_does_not_fit_is_refused(given, options, words):
    mesh, pair = given[1].mesh, given[1]
    if options == "cells in another order":
        options = {"nodes": {"TETRA4": mesh.block("TETRA4")[::-1]}, "points": mesh.points}
    elif options == "moved unknowns of friction":
        numbers = np.arange(1536).reshape(512, 3)
        numbers[np.unique(pair.B_T.indices // 3)[0]] = -1
        options = {"unknowns": numbers, "u0": np.ones((512, 3))}
    with pytest.raises(RequestError, match=words):
        pair.renumber(**options)
