"""Bodies and the motions that nothing holds: counted against the null space of the stiffness, and named."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lacmesh import Mesh
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.case import Displacement, Rigid
from lacsolver.constraints.local import combine
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.problem import loads
from lacsolver.problem.rigid_modes import describe, free_motions, rigid_modes
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANE_MODELS, cube, distorted, mixture, plane_mixture, square
from tests.lacsolver.held import held, joined, moved, ring, turn, two, with_sides
from tests.quality_cells import rotation

MODELS = ["3d", *PLANE_MODELS]
X_TURN = "turns about an axis along x through (0.5, 0.5, 0.5)"
ALL = {"ux": 0, "uy": 0, "uz": 0}


def stiffness(space):
    return assemble_stiffness(space, Materials.of(space, Elastic(young=1.0, poisson=0.3))).tocsr()


def check(space, constraints, springs=None):
    """The motions are those that cost no energy: as many, independent, and each one free. Returns their names."""
    found = free_motions(space, constraints, springs)
    K, T = stiffness(space), constraints.T
    if springs is not None:
        K = K + springs
    values = np.linalg.eigvalsh((T.T @ K @ T).toarray())
    assert len(found) == (values < 1e-11 * values.max()).sum()
    R = np.array([motion.field for motion in found]).reshape(-1, space.n_dof).T
    if len(found):
        assert np.linalg.svd(R / np.linalg.norm(R, axis=0), compute_uv=False).min() > 0.05
        q = np.linalg.lstsq(T.toarray(), R, rcond=None)[0]
        np.testing.assert_allclose(T @ q, R, atol=1e-11)
        np.testing.assert_allclose(K @ R, 0, atol=1e-11)
    return [describe(motion) for motion in found]


# bodies


def test_bodies_are_counted_by_their_first_nodes():
    a, b = cube("TETRA4", 1), cube("HEXA20", 1)
    mesh = joined(a, b, b)
    order = np.random.default_rng(0).permutation(mesh.n_nodes)
    place = np.argsort(order)
    mixed = Mesh.create(
        np.vstack([mesh.points[order], [[9, 9, 9]]]),
        [*((t, place[nodes]) for t, nodes in mesh.blocks), ("POI1", [[mesh.n_nodes]])],
        cell_groups=mesh.cell_groups,
    )
    label = Space.of(mixed, "3d").bodies
    assert label[-1] == -1
    owner = np.repeat([0, 1, 2], [8, 20, 20])[order]
    for k in range(3):
        assert len(set(label[:-1][owner == k])) == 1
    first = [np.flatnonzero(label == k)[0] for k in range(3)]
    assert first == sorted(first)
    assert label.max() == 2


@pytest.mark.parametrize("model", MODELS)
def test_rigid_modes_cost_no_energy(model):
    mesh = distorted(mixture("2"), 0.05) if model == "3d" else distorted(plane_mixture("2"), 0.05)
    space = Space.of(mesh, model)
    R = rigid_modes(space, space.bodies)
    assert R.shape == (space.n_dof, {"3d": 6, "axisymmetric": 1}.get(model, 3))
    np.testing.assert_allclose(R.T @ R, np.eye(R.shape[1]), atol=1e-13)
    np.testing.assert_allclose(stiffness(space) @ R, 0, atol=1e-12)


def test_rigid_modes_of_few_nodes():
    space = Space.of(cube("HEXA8", 2), "3d")
    for nodes, n in (([4], 3), ([0, 1, 2], 5), ([0, 26], 5), ([0, 1, 3], 6)):
        of_node = np.full(27, -1)
        of_node[nodes] = 0
        R = rigid_modes(space, of_node)
        assert R.shape[1] == n
        np.testing.assert_allclose(R.T @ R, np.eye(n), atol=1e-13)
        assert not np.delete(R, space.dofs(np.array(nodes)).ravel(), axis=0).any()


def test_modes_of_many_bodies_take_memory_for_their_nodes():
    """Multigrid's modes of many bodies are each body's own, and memory does not grow with the number of bodies."""
    spaces = [held(joined(*[cube("HEXA8", 1)] * n), "3d") for n in (1, 4, 200)]
    models = [ReducedProblem(SimpleNamespace(space=space, constraints=constraints)) for space, constraints in spaces]
    one, four = (model._whole.modes for model in models[:2])
    np.testing.assert_allclose(four.reshape(4, *one.shape), np.tile(one, (4, 1, 1)), atol=1e-13)
    _ = models[2].problem.constraints.free
    tracemalloc.start()
    made = models[2]._whole
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 * made.modes.nbytes


# what nothing holds


@pytest.mark.parametrize("model", MODELS)
def test_nothing_is_held(model):
    mesh = with_sides(cube("HEXA8", 2) if model == "3d" else square("TRIA6", 2))
    names = check(*held(mesh, model))
    expected = {
        "3d": [
            *(f"'body' moves along {axis}" for axis in "xyz"),
            *(f"'body' turns about an axis along {axis} through (0.5, 0.5, 0.5)" for axis in "xyz"),
        ],
        "axisymmetric": ["'body' moves along y"],
    }
    plane = ["'body' moves along x", "'body' moves along y", "'body' turns about the point (1.5, 0.5)"]
    assert names == expected.get(model, plane)


@pytest.mark.parametrize(
    ("given", "left"),
    [
        ({"group": "x0", **ALL}, []),
        ({"group": "x0", "un": 0}, ["moves along y", "moves along z", X_TURN]),
        ({"group": "x0", "ux": 0, "uy": 0}, ["moves along z"]),
        (
            {"at": (0, 0, 0), **ALL},
            [
                "turns about an axis along x through (0.5, 0, 0)",
                "turns about an axis along y through (0, 0.5, 0)",
                "turns about an axis along z through (0, 0, 0.5)",
            ],
        ),
    ],
)  # fmt: skip
def test_what_is_left_of_a_cube(given, left):
    mesh = with_sides(cube("HEXA8", 2))
    assert check(*held(mesh, displacement=[Displacement(**given)])) == [f"'body' {words}" for words in left]


def test_an_edge_is_a_hinge():
    mesh = with_sides(cube("HEXA8", 2), node_groups={"edge": [0, 1, 2]})
    names = check(*held(mesh, displacement=[Displacement(group="edge", **ALL)]))
    assert names == ["'body' turns about an axis along z through (0, 0, 0.5)"]


def test_a_motion_along_no_axis_is_named_by_its_vector():
    mesh = moved(with_sides(cube("HEXA8", 2)), turn(np.arctan2(4, 3)))
    names = check(*held(mesh, displacement=[Displacement(group="x0", un=0), Displacement(group="z0", un=0)]))
    assert names == ["'body' moves along (0.8, -0.6, 0)"]
    names = check(*held(mesh, displacement=[Displacement(group="x0", un=0)]))
    assert names[0] == "'body' moves along z"
    assert names[1] == "'body' moves along (0.8, -0.6, 0)"
    assert names[2].startswith("'body' turns about an axis along (0.6, 0.8, 0) through (")


@pytest.mark.parametrize("name", ["HEXA8", "HEXA20"])
def test_a_ring_turns_in_its_seat(name):
    mesh = ring(name)
    names = check(*held(mesh, displacement=[Displacement(group="outer", un=0)]))
    assert names == ["'body' moves along z", "'body' turns about an axis along z through (0, 0, 0.5)"]
    names = check(*held(mesh, displacement=[Displacement(group="inner", un=0), Displacement(group="ends", un=0)]))
    assert names == ["'body' turns about an axis along z through (0, 0, 0.5)"]


def test_a_screw():
    """Three nodes of a circle may move along a helix only."""
    mesh = ring("HEXA8")
    thread = mesh.nodes_on(mesh.cell_groups["inner"])[::2]
    mesh = replace(mesh, node_groups={"thread": thread})
    angle = 2 * np.pi * np.arange(12) / 12
    np.testing.assert_allclose(
        mesh.points[thread], np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), atol=1e-15
    )
    helix = np.stack([-np.sin(angle), np.cos(angle), np.full(12, 0.25)], axis=1)
    space, constraints = held(mesh, displacement=[Displacement(group="thread", ux=0)])
    normal = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    part = constraints.local.parts[0]
    other = np.cross(helix, normal)
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    local = combine(space, [part._replace(directions=normal), part._replace(directions=other)])
    (motion,) = free_motions(space, replace(constraints, local=local))
    assert describe(motion) == "'body' screws about an axis along z through (0, 0, 0.5), 0.25 forward a radian"
    u = motion.field.reshape(-1, 3)[thread]
    np.testing.assert_allclose(np.cross(u, helix), 0, atol=1e-12)


# several bodies


@pytest.mark.parametrize("model", MODELS)
def test_one_of_two_floats(model):
    mesh = two(model)
    clamp = {k: v for k, v in ALL.items() if k[1] in "xyz"[: 3 if model == "3d" else 2]}
    names = check(*held(mesh, model, displacement=[Displacement(group="z0" if model == "3d" else "y0", **clamp)]))
    assert len(names) == {"3d": 6, "axisymmetric": 1}.get(model, 3)
    assert all(name.startswith("'b' ") for name in names)


def test_a_body_without_a_group_of_its_own_is_named_by_what_is_on_it_or_by_its_place():
    mesh = two()
    b = mesh.cell_groups["b"]
    numbers = np.arange(mesh.n_nodes)[::-1] + 500
    for groups, name in (
        ({"part": b[:3], "rest": b[3:]}, f"the body of {'rest'!r} and {'part'!r}"),
        ({"part": b[:3]}, "the body of 'part'"),
        ({"all": np.arange(mesh.n_cells), "top": mesh.cell_groups["z1"]}, "the body of 'all' with 'top'"),
        ({"top": mesh.cell_groups["z1"]}, "the body with 'top'"),
        ({"all": np.arange(mesh.n_cells)}, None),
        ({}, None),
    ):
        cells = {"z0": mesh.cell_groups["z0"], **groups}
        other = Mesh.create(mesh.points, mesh.blocks, cell_groups=cells, node_number=numbers)
        told = check(*held(other, displacement=[Displacement(group="z0", **ALL)]))[0]
        low, high = (f(mesh.points[27:], axis=0) for f in (np.min, np.max))
        place = "between ({:.5g}, {:.5g}, {:.5g}) and ({:.5g}, {:.5g}, {:.5g})".format(*low, *high)
        assert told == f"{name or ('the body of ' + repr('all') if groups else 'the body') + ' ' + place} moves along x"


def test_the_smallest_group_that_covers_a_body_names_it():
    mesh = two()
    b = mesh.cell_groups["b"]
    groups = {**mesh.cell_groups, "b and skin": np.union1d(b, mesh.cell_groups["z1"]), "most of b": b[1:]}
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_groups=groups)
    assert check(*held(mesh, displacement=[Displacement(group="z0", **ALL)]))[0] == "'b' moves along x"


def test_bodies_on_one_rigid_group_move_together():
    mesh = two()
    space, constraints = held(mesh, rigid=[Rigid(group="x0", fx=1.0, fz=2.0, moment=(0, 0, 0))])
    names = check(space, constraints)
    assert (
        names
        == [
            "'a' and 'b' move along x",
            "'a' and 'b' move along z",
            "'a' and 'b' turn about an axis along x through (0.5, 0.5, 0.5)",
            "'a' and 'b' turn about an axis along y through (0.5, 0.5, 0.5)",
            "'a' and 'b' turn about an axis along z through (0, 0.5, 0.5)",
        ]
        or len(names) == 5
    )


def test_a_rigid_group_that_is_held_holds():
    assert check(*held(two(), rigid=[Rigid(group="x0", ux=1.0, rotation=(0, 0, 1.0))])) == []


def test_a_rigid_group_and_what_is_prescribed_elsewhere():
    """The group may move along x and z and turn; the other side of both bodies holds x."""
    mesh = two()
    rigid = Rigid(group="x0", fx=1.0, fz=2.0, moment=(0, 0, 0))
    names = check(*held(mesh, displacement=[Displacement(group="x1", ux=0)], rigid=[rigid]))
    assert names == [
        "'a' and 'b' move along z",
        "'a' and 'b' turn about an axis along x through (0.5, 0.5, 1.25)",
    ]


def test_a_hinge_between_two_bodies():
    """A rigid group of one edge of each: each body turns about its own edge."""
    mesh = two(gap=0.0)
    low, high = (mesh.node_groups[name] for name in ("low", "high"))
    edge = [*low[mesh.points[low, 0] == 0], *high[mesh.points[high, 0] == 0]]
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups={"edge": edge})
    names = check(*held(mesh, rigid=[Rigid(group="edge")]))
    assert names == [
        "'a' turns about an axis along y through (0, 0.5, 1)",
        "'b' turns about an axis along y through (0, 0.5, 1)",
    ]
    names = check(*held(mesh, rigid=[Rigid(group="edge", fx=1.0)]))
    assert names == [
        "'a' turns about an axis along y through (0, 0.5, 1)",
        "'b' turns about an axis along y through (0, 0.5, 1)",
        "'a' and 'b' move along x",
    ]


def test_a_bare_rigid_skin_is_a_body():
    mesh = with_sides(cube("HEXA8", 1))
    die = mesh.n_nodes + np.arange(4)
    mesh = Mesh.create(
        np.vstack([mesh.points, [[0, 0, 2], [1, 0, 2], [1, 1, 2], [0, 1, 2]]]),
        [(t, np.vstack([nodes, [die]]) if t == "QUAD4" else nodes) for t, nodes in mesh.blocks],
        cell_groups={**{k: v for k, v in mesh.cell_groups.items() if k != "die"}, "die": [mesh.n_cells]},
    )
    clamp = Displacement(group="z0", **ALL)
    space, constraints = held(mesh, displacement=[clamp], rigid=[Rigid(group="die", ux=0.1, fz=-1.0, uy=0.2)])
    assert check(space, constraints) == ["rigid 'die' moves along z"]
    assert check(*held(mesh, displacement=[clamp], rigid=[Rigid(group="die", uz=-1.0)])) == []
    names = check(*held(mesh, displacement=[clamp], rigid=[Rigid(group="die", fx=1.0, moment=(0, 0, 1))]))
    assert names == [
        "rigid 'die' moves along x",
        *(f"rigid 'die' turns about an axis along {axis} through (0.5, 0.5, 2)" for axis in "xyz"),
    ]


@pytest.mark.parametrize("seed", range(8))
def test_random_conditions_leave_what_the_stiffness_says(seed):
    """A few nodes of two turned bodies, held along some components, and a rigid group on either or both of them."""
    rng = np.random.default_rng(seed)
    mesh = moved(two(), rotation(rng), rng.normal(size=3))
    dots = {f"d{k}": rng.choice(54, 2, replace=False) for k in range(4)}
    free = np.setdiff1d(np.arange(54), np.concatenate([*dots.values()]))
    dots["die"] = rng.choice(free, 4, replace=False)
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=dots)
    parts = [{c: 0 for c in rng.choice(["ux", "uy", "uz"], rng.integers(1, 3), replace=False)} for _ in range(4)]
    given = [Displacement(group=f"d{k}", **part) for k, part in enumerate(parts)][: int(rng.integers(1, 5))]
    motion = [{"fx": 1.0, "moment": (0, 0, 1)}, {"fy": 1.0, "fz": 1.0}, {"moment": (1, 0, 0)}, {}][seed % 4]
    check(*held(mesh, displacement=given, rigid=[Rigid(group="die", **motion)]))


# springs


def test_springs_hold():
    mesh = with_sides(cube("HEXA8", 2), node_groups={"dot": [0], "base": [0, 6, 18, 24], "line": [0, 18]})
    space, constraints = held(mesh, displacement=[Displacement(group="dot", uz=0)])
    base = mesh.node_groups["base"]
    some = loads.springs(space, base, (0.5, 0, 0)) + loads.springs(space, np.array([26]), (0, 2.0, 0))
    left = [
        "'body' turns about an axis along x through (0.5, 0, 1)",
        "'body' turns about an axis along y through (0, 0.5, 0)",
    ]
    assert check(space, constraints, some) == left
    uneven = loads.springs(space, base, (1e-9, 0, 0)) + loads.springs(space, np.array([26]), (0, 1e9, 0))
    assert [describe(m) for m in free_motions(space, constraints, uneven)] == left
    below = np.flatnonzero(mesh.points[:, 2] == 0)
    everywhere = loads.springs(space, below, (1.0, 1.0, 1.0))
    assert check(space, constraints, everywhere) == []
    normal = loads.springs(space, below, (0, 0, 3.0))
    assert check(space, held(mesh)[1], normal) == [
        "'body' moves along x",
        "'body' moves along y",
        "'body' turns about an axis along z through (0.5, 0.5, 0.5)",
    ]


def test_springs_in_axisymmetry():
    mesh = with_sides(square("QUAD4", 2))
    space, constraints = held(mesh, "axisymmetric")
    assert check(space, constraints, loads.springs(space, np.array([0]), (1.0, 0.0))) == ["'body' moves along y"]
    assert check(space, constraints, loads.springs(space, np.array([0]), (0.0, 1.0))) == []
