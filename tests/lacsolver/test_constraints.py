"""Prescribed displacements: what they hold, in which directions, what they carry; and what contradicts itself."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from lacmesh import Mesh, Surface
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.case import CaseError, Displacement, Rigid
from lacsolver.constraints import Constraints
from lacsolver.constraints.normals import nodal_normals
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANE_MODELS, cube, distorted, mixture
from tests.lacsolver.held import (
    box,
    case,
    check_map,
    conditions_at,
    held,
    joined,
    moved,
    nodes_in,
    ring,
    turn,
    with_sides,
)
from tests.problems import move
from tests.quality_cells import rotation

POISSON = 0.3
BOXES = [("HEXA8", "3d"), ("TETRA10", "3d"), ("HEXA27", "3d"), ("PENTA15", "3d"), ("PYRAM5", "3d")]
BOXES += [(name, model) for name in ("TRIA3", "QUAD8") for model in PLANE_MODELS]


def of(mesh, *given, model="3d", **rest):
    """The space of a mesh, and the constraints of displacements."""
    return held(mesh, model, displacement=given, **rest)


# ---- what is held


@pytest.mark.parametrize(("name", "model"), BOXES)
def test_components_along_axes_pick_unknowns(name, model):
    """So does the normal of a side along an axis, on distorted insides and whatever way the faces are listed."""
    mesh = box(name, model)
    space, constraints = of(mesh, move("x0", ux=0.25), move("y1", uy="0.1 * x * t"), model=model)
    x0, y1 = nodes_in(mesh, "x0"), nodes_in(mesh, "y1")
    fixed = np.concatenate([space.dim * x0, space.dim * y1 + 1])
    assert constraints.is_selection
    assert constraints.free.tolist() == np.setdiff1d(np.arange(space.n_dof), fixed).tolist()
    u = constraints.u0(0.5).reshape(-1, space.dim)
    assert (u[x0, 0] == 0.125).all()
    np.testing.assert_allclose(u[y1, 1], 0.05 * mesh.points[y1, 0], rtol=1e-15)
    assert np.count_nonzero(constraints.u0(1.0)) == np.count_nonzero(mesh.points[y1, 0]) + len(x0)
    check_map(space, constraints)
    _, along = of(mesh, move("x1", ux=0.2), move("y0", uy=0.1), model=model)
    _, normal = of(mesh, move("x1", un=0.2), move("y0", un=-0.1), model=model)
    assert normal.is_selection
    assert normal.free.tolist() == along.free.tolist()
    np.testing.assert_allclose(normal.u0(1.0), along.u0(1.0), rtol=1e-14)


def test_round_off_in_the_coordinates_does_not_tilt_a_normal():
    mesh = box("HEXA8", "3d")
    shaken = mesh.points + 1e-15 * np.random.default_rng(0).uniform(-1, 1, mesh.points.shape)
    assert of(replace(mesh, points=shaken), move("x1", un=0.2))[1].is_selection


@pytest.mark.parametrize(("name", "model"), [b for b in BOXES if b[1] not in ("axisymmetric", "plane_stress")])
def test_a_tilted_box_is_stretched_uniformly(name, model):
    """un = 0 on three tilted sides and 0.01 on a fourth: the exact solution is linear, in the box's own axes."""
    mesh = box(name, model)
    R = rotation(np.random.default_rng(7)) if model == "3d" else turn(0.7)
    tilted = moved(mesh, R, (3.0, 1.0, 0.0))
    sides = ["x0", "y0", "z0"][: tilted.space_dim]
    space, constraints = of(tilted, *(move(side, un=0) for side in sides), move("x1", un=0.01), model=model)
    assert not constraints.is_selection
    K = assemble_stiffness(space, Materials.of(space, Elastic(young=7.0, poisson=POISSON)))
    T, u0 = constraints.T, constraints.u0(1.0)
    q = spsolve((T.T @ K @ T).tocsc(), -T.T @ (K @ u0))
    u = constraints.displacement(q, 1.0).reshape(-1, space.dim) @ R[: space.dim, : space.dim]
    across = -POISSON if model == "3d" else -POISSON / (1 - POISSON)
    exact = 0.01 * (mesh.points - mesh.points.min(axis=0)) * [1, across, across]
    np.testing.assert_allclose(u, exact[:, : space.dim], atol=1e-14)
    check_map(space, constraints)
    modulus = 7.0 if model == "3d" else 7.0 / (1 - POISSON**2)
    reaction = K @ constraints.displacement(q, 1.0)
    np.testing.assert_allclose(constraints.reaction("x1", reaction), 0.01 * modulus * R[: space.dim, 0], atol=1e-13)
    np.testing.assert_allclose(sum(constraints.reactions(reaction).values()), 0, atol=1e-13)


@pytest.mark.parametrize("name", ["HEXA8", "HEXA20"])
def test_normals_of_a_cylinder_are_radial(name):
    """Prescribed values may vary over it, and faces that several groups share have no seam."""
    mesh = ring(name)
    space, constraints = of(mesh, move("outer", un=0.1), move("inner", un=0))
    x = mesh.points[constraints.local.node]
    outward = np.where(np.linalg.norm(x[:, :2], axis=1) > 1.5, 1.0, -1.0)[:, None]
    radial = outward * x[:, :2] / np.linalg.norm(x[:, :2], axis=1, keepdims=True)
    np.testing.assert_allclose(constraints.local.direction, np.c_[radial, 0 * radial[:, 0]], atol=1e-14)
    assert len(constraints.local.node) == len(constraints.local.nodes)
    check_map(space, constraints)
    if name == "HEXA20":
        return
    _, whole = of(mesh, move("outer", un=0.1))
    for given in ((move("east", un=0.1), move("west", un=0.1)), (move("outer", un=0.1), move("east", un=0.1))):
        space, shared = of(mesh, *given)
        np.testing.assert_allclose(shared.u0(1.0), whole.u0(1.0), atol=1e-15)
        assert shared.n_q == whole.n_q
        check_map(space, shared)
    _, constraints = of(mesh, move("outer", un=lambda x, t: t * x[:, 2]))
    u, outer = constraints.u0(0.5).reshape(-1, 3), nodes_in(mesh, "outer")
    np.testing.assert_allclose(np.linalg.norm(u[outer], axis=1), 0.5 * (mesh.points[outer, 2] == 1), atol=1e-15)


def test_normals_of_a_curved_face_are_those_at_the_node():
    """One QUAD8 of an eighth of a cylinder, on its own: exact in the middle, by symmetry."""
    mesh = ring("HEXA20", 8)
    face = mesh.cell_groups["outer"][:1]
    (found,) = nodal_normals(Space.of(mesh, "3d"), [Surface.of(mesh, face)])
    x = mesh.points[found.nodes]
    radial = x[:, :2] / np.linalg.norm(x[:, :2], axis=1, keepdims=True)
    cosine = (found.normals[:, :2] * radial).sum(axis=1)
    flat = Surface.of(mesh, face).faces.corners[0]
    middle = ~np.isin(found.nodes, flat) & (np.abs(x[:, 2] - 0.5) > 0.4)
    np.testing.assert_allclose(cosine[middle], 1, atol=1e-14)
    assert cosine.min() > np.cos(np.radians(2))  # of the flat face through the corners: 22.5 degrees


def bent(angle, first=1.0, second=2.0):
    """A strip whose lower side turns by `angle` degrees at node 1; sides of lengths `first` and `second`."""
    a = np.radians(angle)
    end = np.array([first + second * np.cos(a), second * np.sin(a)])
    points = np.array([[0, 0], [first, 0], end, [0, 3], [first, 3], end + np.array([0, 3])])
    cells = [("QUAD4", [[0, 1, 4, 3], [1, 2, 5, 4]]), ("SEG2", [[0, 1], [2, 1]])]
    return Mesh.create(points, cells, cell_groups={"s": [2, 3]})


@pytest.mark.parametrize(("angle", "normals"), [(30, 1), (39.9, 1), (40.1, 2), (-39.9, 1), (-40.1, 2)])
def test_a_blunt_bend_has_one_normal_weighted_with_the_lengths_and_a_sharp_one_two(angle, normals):
    space, constraints = of(bent(angle), move("s", un=0.5), model="plane_strain")
    D, c = conditions_at(constraints, 1)
    assert len(D) == normals
    np.testing.assert_allclose(D @ constraints.u0(1.0)[2:4], c, atol=1e-15)
    if normals == 1:
        a = np.radians(angle)
        n = 1.0 * np.array([0, -1]) + 2.0 * np.array([np.sin(a), -np.cos(a)])
        np.testing.assert_allclose(D, [n / np.linalg.norm(n)], atol=1e-15)
    check_map(space, constraints)


def test_faces_linked_by_others_share_one_normal():
    """The tip of a blunt cone of many sides, of which opposite ones turn by more than the crease angle."""
    n = 24
    a = 2 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(a), np.sin(a), np.zeros(n)], axis=1)
    k, m = np.arange(n), (np.arange(n) + 1) % n
    points = np.vstack([rim, [[0, 0, 0.7], [0, 0, -1]]])
    cells = [("TETRA4", np.stack([k, m, 0 * k + n, 0 * k + n + 1], axis=1)), ("TRIA3", np.stack([m, k, 0 * k + n], 1))]
    mesh = Mesh.create(points, cells, cell_groups={"cone": np.arange(n, 2 * n)})
    _, constraints = of(mesh, move("cone", un=0.2))
    D, _ = conditions_at(constraints, n)
    np.testing.assert_allclose(D, [[0, 0, 1]], atol=1e-14)


def test_a_corner_of_one_group_is_held_in_every_direction():
    mesh = with_sides(cube("HEXA8", 2), {"three": lambda x: (x < 1e-9).any(axis=1)})
    sheared = moved(mesh, [[1, 0.4, 0.1], [0, 1, -0.3], [0, 0, 1]])
    for body in (mesh, sheared):
        space, constraints = of(body, move("three", un=0.125))
        conditions = np.bincount(constraints.local.node, minlength=27)
        outside = (mesh.points < 1e-9).sum(axis=1)
        assert conditions.tolist() == outside.tolist()
        D, _ = conditions_at(constraints, 0)
        np.testing.assert_allclose(D @ constraints.u0(1.0)[:3], 0.125, atol=1e-15)
        assert constraints.n_q == 81 - outside.sum()
        check_map(space, constraints)
    _, constraints = of(mesh, move("three", un=0.125))
    assert constraints.u0(1.0)[:3].tolist() == pytest.approx([-0.125] * 3, rel=1e-14)


def test_the_same_condition_twice_is_one():
    mesh = box("HEXA8", "3d")
    again = Displacement(group="x0", kind="cell", un="-0.1 * t")
    _, constraints = of(mesh, move("x0", ux=0.1), again, move("y0", ux="0.1 * t * (1 - x)", uy=0))
    assert constraints.n_q == 81 - 9 - 15
    u = constraints.u0(1.0).reshape(-1, 3)
    np.testing.assert_allclose(u[nodes_in(mesh, "x0"), 0], 0.1, rtol=1e-15)


def test_the_axis_of_symmetry_stays_where_it_is():
    """ux = 0 there, by itself; a rigid body has its own nodes, and the case may say the same, but nothing else."""
    mesh = moved(box("QUAD8", "axisymmetric"), shift=(-1.0, 0, 0))
    axis = nodes_in(mesh, "x0")
    space, alone = of(mesh, move("y0", uy=0), model="axisymmetric")
    assert not np.isin(space.dim * axis, alone.free).any()
    assert np.isin(space.dim * axis[-1] + 1, alone.free)
    _, told = of(mesh, move("x0", ux=0), move("y0", uy=0), model="axisymmetric")
    assert told.free.tolist() == alone.free.tolist()
    assert list(alone.reactions(np.ones(space.n_dof))) == ["y0"]
    of(mesh, rigid=[Rigid(group="y1", fy=1.0)], model="axisymmetric")
    with pytest.raises(CaseError, match="displacement 'the axis"):
        of(mesh, move("x0", ux=lambda x, t: np.full(len(x), 0.1)), model="axisymmetric")


def test_nodes_of_no_cell_have_no_unknowns_but_may_be_moved():
    mesh = Mesh.create(
        [[0, 0], [1, 0], [0, 1], [2, 0], [2, 1], [7, 7]],
        [("TRIA3", [[0, 1, 2]]), ("SEG2", [[3, 4]]), ("POI1", [[5]])],
        cell_groups={"bare": [1]},
    )
    space, constraints = of(mesh, move("bare", ux=0.5), model="plane_strain")
    assert constraints.free.tolist() == list(range(6))
    assert constraints.u0(1.0).tolist() == [0] * 6 + [0.5, 0, 0.5, 0, 0, 0]
    check_map(space, constraints)


# ---- contradictions


def test_a_contradiction_names_node_lines_and_values():
    mesh = replace(box("HEXA8", "3d"), node_number=np.arange(100, 127))
    sections = '[[displacement]]\ngroup = "x0"\nux = 0.1\n[[displacement]]\ngroup = "y1"\nux = 0.2\nuy = 0\n'
    with pytest.raises(CaseError) as caught:
        Constraints.of(Space.of(mesh, "3d"), case(sections))
    shared = np.intersect1d(nodes_in(mesh, "x0"), nodes_in(mesh, "y1"))
    said = re.match(
        r"node (\d+) cannot have ux = (\S+) .*'x0' \(press\.toml, line 6\), and ux = (\S+) .*'y1' "
        r"\(press\.toml, line 9\), at t = (\S+);",
        str(caught.value),
    )
    assert said, str(caught.value)
    assert int(said[1]) - 100 in shared
    t = float(said[4])
    assert (float(said[2]), float(said[3])) == (pytest.approx(0.1 * t), pytest.approx(0.2 * t))


SQUARE, PLANE = box("QUAD4", "plane_strain"), {"model": "plane_strain"}


@pytest.mark.parametrize(
    ("mesh", "given", "words"),
    [
        (moved(SQUARE, turn(0.5)), [move("y0", ux=0, uy=0.0), move("x1", un=0.1)], r"along \(0\.8776, 0\.4794\)"),
        (SQUARE, [move("x0", ux=[[0, 0], [1, 1]]), move("y0", ux="t**2")], r"at t = 0\.618;"),
        (SQUARE, [move("x0", uy=1.0), move("y0", uy=1.0 + 1e-7)], "cannot have"),
    ],
)
def test_a_contradiction_is_found_at_once_also_between_the_steps(mesh, given, words):
    with pytest.raises(CaseError, match=words):
        of(mesh, *given, **PLANE)


def test_values_may_differ_by_round_off():
    of(SQUARE, move("x0", uy=1.0), move("y0", uy=1.0 + 1e-11), **PLANE)
    mesh = moved(SQUARE, 0.1 * np.eye(3), (0.1, 0, 0))
    assert mesh.points[:, 0].max() > 0.3  # by a bit
    of(mesh, move("x1", ux="7 * (x - 0.3)"), Displacement(group="x1", kind="cell", un=0), **PLANE)


def test_a_contradiction_at_some_other_time_is_found_when_that_time_comes():
    bump = move("y0", ux=lambda x, t: np.full(len(x), float(t == 0.25)))
    _, constraints = of(SQUARE, move("x0", ux=0), bump, **PLANE)
    constraints.u0(0.5)
    with pytest.raises(CaseError, match=r"ux = 1 .* at t = 0\.25"):
        constraints.u0(0.25)


def test_un_needs_a_skin_of_the_body():
    solid = joined(cube("HEXA8", 1), moved(cube("HEXA8", 1), shift=(5, 0, 0)))
    mesh = with_sides(solid, node_groups={"dots": [0, 1]})
    bare = Mesh.create(
        np.vstack([mesh.points, [[9, 0, 0], [9, 1, 0], [9, 0, 1]]]),
        [*mesh.blocks, ("TRIA3", [[16, 17, 18]])],
        cell_groups={**mesh.cell_groups, "bare": [mesh.n_cells], "both": [0, 2]},
        node_groups=mesh.node_groups,
    )
    mistakes = {"body": "cells 1, 2 are none", "both": "cells 1 are none", "bare": "cells 15 do not"}
    mistakes |= {"dots": "is one of nodes", "nothing": "no group named"}
    for group, message in mistakes.items():
        with pytest.raises(CaseError, match=message):
            of(bare, move(group, un=0))
    sections = "".join(f'[[displacement]]\ngroup = "{g}"\nun = 0\n' for g in mistakes)
    with pytest.raises(CaseError) as caught:
        Constraints.of(Space.of(bare, "3d"), case(sections))
    assert len(caught.value.problems) == len(mistakes)
    assert "press.toml, line 6: displacement: un needs" in str(caught.value)
    inside = Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1]],
        [("TRIA3", [[0, 1, 2], [0, 2, 3]]), ("SEG2", [[0, 2]])],
        cell_groups={"inside": [2]},
    )
    with pytest.raises(CaseError, match="cells 3 do not"):
        of(inside, move("inside", un=0), model="plane_stress")


# ---- large and odd


@pytest.mark.parametrize("seed", range(5))
def test_any_conditions_together(seed):
    """A random skin of a distorted mixture in overlapping groups, prescribed by a linear field: u0 and T are right."""
    rng = np.random.default_rng(seed)
    solid = distorted(mixture("1"), 0.1, seed)
    mesh = with_sides(solid, {"s": lambda x: rng.random(len(x)) < 0.2, "q": lambda x: rng.random(len(x)) < 0.2})
    A = rng.normal(size=(3, 3))
    linear = {f"u{a}": lambda x, t, row=A[k]: t * x @ row for k, a in enumerate("xyz")}
    given = [move(g, **{c: linear[c] for c in names}) for g, names in (("s", ("ux", "uz")), ("q", ("uy", "ux")))]
    check_map(*of(mesh, *given))
    check_map(*of(mesh, move("s", un=0), move("q", ux=0)))
