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
from lacsolver.constraints.supports import nodal_map
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.problem.rigid_modes import describe, free_motions, rigid_modes, unheld
from lacsolver.problem.springs import to_ground
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANE_MODELS, cube, mixed, square
from tests.lacsolver.held import held, joined, moved, ring, turn, two, with_sides
from tests.quality_cells import rotation

MODELS = ["3d", *PLANE_MODELS]


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


# ---- bodies


def test_bodies_are_counted_by_their_first_nodes():
    a, b = cube("TETRA4", 1), cube("HEXA20", 1)
    mesh = joined(a, b, b)
    order = np.random.default_rng(0).permutation(mesh.n_nodes)
    place = np.argsort(order)
    blocks = [*((t, place[nodes]) for t, nodes in mesh.blocks), ("POI1", [[mesh.n_nodes]])]
    label = Space.of(Mesh.create(np.vstack([mesh.points[order], [[9, 9, 9]]]), blocks), "3d").bodies
    assert label[-1] == -1
    owner = np.repeat([0, 1, 2], [8, 20, 20])[order]
    _, first = np.unique(owner, return_index=True)
    assert label[:-1].tolist() == np.argsort(np.argsort(first))[owner].tolist()


@pytest.mark.parametrize("model", MODELS)
def test_rigid_modes_cost_no_energy(model):
    space = Space.of(mixed("2", model), model)
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


# ---- what nothing holds

ALL = {"ux": 0, "uy": 0, "uz": 0}
X_TURN = "'body' turns about an axis along x through (0.5, 0.5, 0.5)"
BOTH = "'a' and 'b'"


def hinged():
    """Two boxes on one another, with the nodes of both on an edge between them."""
    mesh = two(gap=0.0)
    edge = [n for name in ("low", "high") for n in mesh.node_groups[name] if mesh.points[n, 0] == 0]
    return replace(mesh, node_groups={"edge": np.array(edge)})


def under_a_die():
    """A box held at z0, and a square above it that belongs to no body."""
    mesh = with_sides(cube("HEXA8", 1))
    die = mesh.n_nodes + np.arange(4)
    return Mesh.create(
        np.vstack([mesh.points, [[0, 0, 2], [1, 0, 2], [1, 1, 2], [0, 1, 2]]]),
        [(t, np.vstack([nodes, [die]]) if t == "QUAD4" else nodes) for t, nodes in mesh.blocks],
        cell_groups={**mesh.cell_groups, "die": [mesh.n_cells]},
    )


def die(**motion):
    return [Rigid(group="die", **motion)]


#: name -> mesh
MESHES = {
    "cube": lambda: with_sides(cube("HEXA8", 2), node_groups={"edge": [0, 1, 2]}),
    "turned": lambda: moved(with_sides(cube("HEXA8", 2)), turn(np.arctan2(4, 3))),
    "ring": ring, "quadratic ring": lambda: ring("HEXA20"), "two": two, "hinged": hinged, "under a die": under_a_die,
}  # fmt: skip
#: name of a mesh, displacements, rigid bodies, and the names of the motions that are left
HELD = [
    ("cube", [{"group": "x0", **ALL}], [], []),
    ("cube", [{"group": "x0", "un": 0}], [], ["'body' moves along y", "'body' moves along z", X_TURN]),
    ("cube", [{"group": "x0", "ux": 0, "uy": 0}], [], ["'body' moves along z"]),
    ("cube", [{"at": (0, 0, 0), **ALL}], [], [
        f"'body' turns about an axis along {axis} through {place}"
        for axis, place in (("x", "(0.5, 0, 0)"), ("y", "(0, 0.5, 0)"), ("z", "(0, 0, 0.5)"))
    ]),
    ("cube", [{"group": "edge", **ALL}], [], ["'body' turns about an axis along z through (0, 0, 0.5)"]),
    ("turned", [{"group": "x0", "un": 0}, {"group": "z0", "un": 0}], [], ["'body' moves along (0.8, -0.6, 0)"]),
    *((name, given, [], [*slid, "'body' turns about an axis along z through (0, 0, 0.5)"])
      for name in ("ring", "quadratic ring")
      for given, slid in (([{"group": "outer", "un": 0}], ["'body' moves along z"]),
                          ([{"group": "inner", "un": 0}, {"group": "ends", "un": 0}], []))),
    ("two", [], [Rigid(group="x0", ux=1.0, rotation=(0, 0, 1.0))], []),
    ("two", [{"group": "x1", "ux": 0}], [Rigid(group="x0", fx=1.0, fz=2.0, moment=(0, 0, 0))],
     [f"{BOTH} move along z", f"{BOTH} turn about an axis along x through (0.5, 0.5, 1.25)"]),
    *(("hinged", [], [Rigid(group="edge", **load)],
       [*(f"{name} turns about an axis along y through (0, 0.5, 1)" for name in ("'a'", "'b'")), *slid])
      for load, slid in (({}, []), ({"fx": 1.0}, [f"{BOTH} move along x"]))),
    ("under a die", [{"group": "z0", **ALL}], die(ux=0.1, fz=-1.0, uy=0.2), ["rigid 'die' moves along z"]),
    ("under a die", [{"group": "z0", **ALL}], die(uz=-1.0), []),
    ("under a die", [{"group": "z0", **ALL}], die(fx=1.0, moment=(0, 0, 1)), [
        "rigid 'die' moves along x",
        *(f"rigid 'die' turns about an axis along {axis} through (0.5, 0.5, 2)" for axis in "xyz"),
    ]),
]  # fmt: skip


@pytest.mark.parametrize("name, given, rigid, left", HELD)
def test_what_is_left(name, given, rigid, left):
    assert check(*held(MESHES[name](), displacement=[Displacement(**row) for row in given], rigid=rigid)) == left


def test_the_sentence_on_one_motion_has_its_place_and_that_on_several_has_none():
    supports = {"group": "edge", **ALL}, {"at": (0, 0, 0), **ALL}
    one, three = (free_motions(*held(MESHES["cube"](), displacement=[Displacement(**row)])) for row in supports)
    assert "model: 'body' turns about an axis along z through (0, 0, 0.5); add" in unheld(one)
    turns = ", ".join(f"turns about an axis along {axis}" for axis in "xyz")
    assert f"model: 'body' {turns}; add" in unheld(three)


@pytest.mark.parametrize("model", MODELS)
def test_nothing_is_held_or_one_of_two(model):
    names = check(*held(with_sides(cube("HEXA8", 2) if model == "3d" else square("TRIA6", 2)), model))
    assert names == {
        "3d": [
            *(f"'body' moves along {axis}" for axis in "xyz"),
            *(f"'body' turns about an axis along {axis} through (0.5, 0.5, 0.5)" for axis in "xyz"),
        ],
        "axisymmetric": ["'body' moves along y"],
    }.get(model, ["'body' moves along x", "'body' moves along y", "'body' turns about the point (1.5, 0.5)"])
    clamp = ALL if model == "3d" else {"ux": 0, "uy": 0}
    below = Displacement(group="z0" if model == "3d" else "y0", **clamp)
    others = check(*held(two(model), model, displacement=[below]))
    assert len(others) == len(names) and all(name.startswith("'b' ") for name in others)


def test_a_motion_along_no_axis_is_named_by_its_vector():
    *moves, turns = check(*held(MESHES["turned"](), displacement=[Displacement(group="x0", un=0)]))
    assert moves == ["'body' moves along z", "'body' moves along (0.8, -0.6, 0)"]
    assert turns.startswith("'body' turns about an axis along (0.6, 0.8, 0) through (")


def test_a_screw():
    """Three nodes of a circle may move along a helix only."""
    mesh = ring("HEXA8")
    thread = mesh.nodes_on(mesh.cell_groups["inner"])[::2]
    mesh = replace(mesh, node_groups={"thread": thread})
    normal, across = mesh.points[thread] * [1, 1, 0], mesh.points[thread][:, [1, 0]] * [-1, 1]
    helix = np.column_stack([across, np.full(len(thread), 0.25)])
    space, constraints = held(mesh, displacement=[Displacement(group="thread", ux=0)])
    part = constraints.local.parts[0]
    other = np.cross(helix, normal)
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    local = combine(space, [part._replace(directions=normal), part._replace(directions=other)])
    supports = replace(constraints.supports, local=local, T=nodal_map(space, local, ()))
    (motion,) = free_motions(space, replace(constraints, supports=supports))
    assert describe(motion) == "'body' screws about an axis along z through (0, 0, 0.5), 0.25 forward a radian"
    np.testing.assert_allclose(np.cross(motion.field.reshape(-1, 3)[thread], helix), 0, atol=1e-12)


# ---- several bodies


def test_a_body_is_named_by_its_group_by_what_is_on_it_or_by_its_place():
    """The smallest group that covers it; without one its parts, its skin, its place."""
    mesh = two()
    b, top, every = mesh.cell_groups["b"], mesh.cell_groups["z1"], np.arange(mesh.n_cells)
    low, high = (f(mesh.points[27:], axis=0) for f in (np.min, np.max))
    place = "between ({:.5g}, {:.5g}, {:.5g}) and ({:.5g}, {:.5g}, {:.5g})".format(*low, *high)
    for groups, name in (
        ({"b": b, "b and skin": np.union1d(b, top), "most of b": b[1:]}, "'b'"),
        ({"part": b[:3], "rest": b[3:]}, "the body of 'rest' and 'part'"),
        ({"part": b[:3]}, "the body of 'part'"),
        ({"all": every, "top": top}, "the body of 'all' with 'top'"),
        ({"top": top}, "the body with 'top'"),
        ({"all": every}, f"the body of 'all' {place}"),
        ({}, f"the body {place}"),
    ):
        other = replace(mesh, cell_groups={"z0": mesh.cell_groups["z0"], **groups}, node_groups={})
        assert check(*held(other, displacement=[Displacement(group="z0", **ALL)]))[0] == f"{name} moves along x"


@pytest.mark.parametrize("seed", range(8))
def test_random_conditions_leave_what_the_stiffness_says(seed):
    """A few nodes of two turned bodies, held along some components, and a rigid group on either or both of them."""
    rng = np.random.default_rng(seed)
    mesh = moved(two(), rotation(rng), rng.normal(size=3))
    dots = {f"d{k}": rng.choice(54, 2, replace=False) for k in range(4)}
    free = np.setdiff1d(np.arange(54), np.concatenate([*dots.values()]))
    dots["die"] = rng.choice(free, 4, replace=False)
    mesh = replace(mesh, node_groups=dots)
    parts = [{c: 0 for c in rng.choice(["ux", "uy", "uz"], rng.integers(1, 3), replace=False)} for _ in range(4)]
    given = [Displacement(group=f"d{k}", **part) for k, part in enumerate(parts)][: int(rng.integers(1, 5))]
    motion = [{"fx": 1.0, "moment": (0, 0, 1)}, {"fy": 1.0, "fz": 1.0}, {"moment": (1, 0, 0)}, {}][seed % 4]
    check(*held(mesh, displacement=given, rigid=[Rigid(group="die", **motion)]))


# ---- springs


def grounded(space, nodes, k):
    """The stiffness of springs from nodes to the ground, along the axes of the mesh."""
    return to_ground(space, nodes, np.array(k), np.tile(np.eye(space.dim), (len(nodes), 1, 1)))


def test_springs_hold():
    mesh = with_sides(cube("HEXA8", 2), node_groups={"dot": [0], "base": [0, 6, 18, 24], "line": [0, 18]})
    space, constraints = held(mesh, displacement=[Displacement(group="dot", uz=0)])
    base = mesh.node_groups["base"]
    some = grounded(space, base, (0.5, 0, 0)) + grounded(space, np.array([26]), (0, 2.0, 0))
    left = [
        "'body' turns about an axis along x through (0.5, 0, 1)",
        "'body' turns about an axis along y through (0, 0.5, 0)",
    ]
    assert check(space, constraints, some) == left
    uneven = grounded(space, base, (1e-9, 0, 0)) + grounded(space, np.array([26]), (0, 1e9, 0))
    assert [describe(m) for m in free_motions(space, constraints, uneven)] == left
    below = np.flatnonzero(mesh.points[:, 2] == 0)
    everywhere = grounded(space, below, (1.0, 1.0, 1.0))
    assert check(space, constraints, everywhere) == []
    normal = grounded(space, below, (0, 0, 3.0))
    assert check(space, held(mesh)[1], normal) == [
        "'body' moves along x",
        "'body' moves along y",
        "'body' turns about an axis along z through (0.5, 0.5, 0.5)",
    ]
