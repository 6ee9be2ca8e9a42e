"""Resultants: a force in total is spread as a uniform traction, with every cut, model and group; stresses at nodes."""

import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate import box, rectangle
from lacsolver import CaseError
from lacsolver.bodies.points import points, weights
from lacsolver.case import BodyForce, Force, Gravity, Material, Pressure, Traction
from lacsolver.cli import main
from lacsolver.problem.loads import load_of
from lacsolver.problem.problem import Problem
from lacsolver.problem.resultants import resultants
from lacsolver.results.nodal import extrapolation, nodal_stress
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PAIRS, body, distorted, mixture
from tests.lacsolver.patch_meshes import stack
from tests.problems import case_of, contact, fix

SOFT = Material(young=1.0, poisson=0.0)


def total(group, **more):
    return Force(**{"group": group, "fx": 3.0, "fy": "-5*t", "total": True} | more)


def problem(mesh, *records, model="3d", **keys):
    return Problem.of(case_of(mesh, SOFT, *records, model=model, **keys))


def tractioned(made, group, tx, ty):
    """The nodal forces of a uniform traction."""
    return load_of(made.space, made.materials, Traction(group=group, tx=tx, ty=ty), finite=False).force(1.0, None)


def resultant(made):
    return made.load(1.0).reshape(-1, made.space.dim).sum(axis=0)


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize("kind", ["HEXA8", "HEXA20", "TETRA10", "PENTA6 quadrangle"])
def test_a_force_on_faces_is_a_uniform_traction_before_and_after_a_cut(kind, hexa):
    mesh = stack(kind, kind, 3, counts=(2, 2), even=True)
    for given in (mesh, lacmesh.cut_skin(mesh, "slave", hexa=hexa).mesh):
        made = problem(given, total("slave"))
        as_traction = tractioned(made, "slave", 3, -5)  # on an area of 1
        np.testing.assert_allclose(made.load(1.0), as_traction, atol=1e-13)
        assert resultant(made) == pytest.approx([3, -5, 0], abs=1e-13)
    assert resultant(problem(mesh, total("slave"), contact(hexa=hexa))) == pytest.approx([3, -5, 0], abs=1e-13)
    count = len(mesh.nodes_on(mesh.cells_of("slave")))
    assert resultant(problem(mesh, total("slave", total=False))) == pytest.approx([3 * count, -5 * count, 0])


@pytest.mark.parametrize(
    ("model", "keys", "area"),
    [("plane_strain", {}, 1.0), ("plane_stress", {"thickness": 0.25}, 0.25), ("axisymmetric", {}, np.pi)],
)
@pytest.mark.parametrize("kind", ["QUAD4", "TRIA6"])
def test_in_a_plane_it_is_that_of_the_whole_thickness_or_circle(kind, model, keys, area):
    """On the disc y = 0, 0 < r < 1: the traction along y is F / A."""
    mesh = rectangle(3, kind=kind)
    made = problem(mesh, total("bottom"), model=model, **keys)
    assert resultant(made) == pytest.approx([3, -5], rel=1e-12)
    expected = tractioned(made, "bottom", 3 / area, -5 / area)
    np.testing.assert_allclose(made.load(1.0), expected, atol=1e-13)


@pytest.mark.parametrize(
    ("group", "parts"),
    [
        ("edges", [1 / 3, 1 / 2, 1 / 6, 0, 0, 0, 0, 0]),
        ("points", [0, 0, 0, 0, 1 / 2, 1 / 2, 0, 0]),
        ("nodes", [1 / 3, 0, 0, 1 / 3, 0, 0, 1 / 3, 0]),
        ("body", [1 / 8] * 8),
        ("some", [1 / 8] * 8),
    ],
)
def test_edges_points_nodes_and_cells(group, parts):
    """Edges in space by length, cells by volume, nodes and points in equal parts."""
    corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1], [2, 0, 1], [2, 1, 1], [0, 1, 1]]
    blocks = [("HEXA8", [[0, 1, 2, 3, 4, 5, 6, 7]]), ("SEG2", [[0, 1], [1, 2]]), ("POI1", [[4], [5]])]
    groups = {"edges": [1, 2], "points": [3, 4], "body": [0], "some": [0, 1]}
    mesh = Mesh.create(corners, blocks, cell_groups=groups, node_groups={"nodes": [0, 3, 6]})
    f = problem(mesh, total(group)).load(1.0).reshape(-1, 3)
    np.testing.assert_allclose(f, np.outer(parts, [3, -5, 0]), atol=1e-14)


@pytest.mark.parametrize(
    ("force", "says"),
    [(total("bottom", fx="x"), "takes one force for the whole group"), (total("left"), "the group has none")],
)
def test_what_has_no_total_is_refused(force, says):
    with pytest.raises(CaseError, match=says):
        problem(rectangle(2), force, model="axisymmetric").load(1.0)


def test_resultants_are_printed_and_written(tmp_path, capsys, monkeypatch):
    """Both commands print those of forces of each node and in total, of pressures, tractions, body forces, gravity."""
    monkeypatch.chdir(tmp_path)
    lacmesh.write("blocks.msh", box(2))
    loads = Force(group="top", fz=-1.0), Force(group="top", fz=-7.0, total=True), Pressure(group="right", value=4.0)
    more = Traction(group="right", ty=3.0), BodyForce(fx=0.5), Gravity(gz=-10.0), fix("bottom", "xyz")
    case_of("blocks.msh", replace(SOFT, density=2.0), *loads, *more, model="3d").write("case.toml")
    told = [
        "pressure right: -4, 0, 0", "traction right: 0, 3, 0", "force top: 0, 0, -9", "force top: 0, 0, -7",
        "body_force everywhere: 0.5, 0, 0", "gravity everywhere: 0, 0, -20",
    ]  # fmt: skip
    for command in (["validate", "case.toml"], ["run", "case.toml"]):
        assert main(command) == 0
        out = capsys.readouterr().out
        assert "resultant, t = 1" in out and all(line in out for line in told), out
    written = json.loads((tmp_path / "case" / "results.json").read_text())
    assert [one["force"][2] for one in written["loads"] if one["section"] == "force"] == pytest.approx([-9, -7])
    support = written["steps"][-1]["reactions"]["bottom"]
    np.testing.assert_allclose(np.sum([one["force"] for one in written["loads"]], axis=0), -np.array(support))


def test_a_follower_pressure_has_its_resultant_on_the_deformed_face():
    records = Material(young=1.0, poisson=0.0, law="neo_hookean"), Pressure(group="top", value=1.0, follower=True)
    mesh = rectangle(2)
    made = Problem.of(case_of(mesh, *records, model="plane_strain", kinematics="finite"))
    u = np.zeros((mesh.n_nodes, 2))
    u[:, 0] = mesh.points[:, 0]  # twice as wide
    (found,) = resultants(made.loads, 1.0, u.ravel())
    assert found.force == pytest.approx((0, -2))


# ---- stresses at nodes: exact where constant or linear, means of cells that have one point, parts that do not mix

#: cells with one point in the plane or in space; PYRAM5's four lie in one plane
ONE_POINT = [("TRIA3", "plane_strain"), ("TRIA3", "plane_stress"), ("TETRA4", "3d")]


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_constant_stress_stays_on_distorted_cells_and_linear_stress_on_affine_ones(name, model):
    space = Space.of(distorted(body(name, 2), 0.03), model)
    n = space.model.n_stress
    given = np.arange(1.0, n + 1)
    field = tuple(np.broadcast_to(given, (*at.shape[:2], n)) for at in points(space))
    assert nodal_stress(space, field) == pytest.approx(np.tile(given, (space.mesh.n_nodes, 1)), rel=1e-12)
    if (name, model) not in ONE_POINT and name != "PYRAM5":
        slopes = np.random.default_rng(5).uniform(-1, 1, (3, n))
        space = Space.of(body(name, 2), model)
        made = nodal_stress(space, tuple(at @ slopes + given for at in points(space)))
        assert made == pytest.approx(space.mesh.points @ slopes + given, rel=1e-11)


def test_pyramid5_tells_slopes_across_its_axis_only():
    E, ref = extrapolation("PYRAM5"), np.array(CELLS["PYRAM5"].reference)
    x = E @ np.array([[a, b] for a in (-1, 1) for b in (-1, 1)])  # whatever the points' order: two slopes, mean 0
    assert x[:4].mean(axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert E.sum(axis=1) == pytest.approx(np.ones(len(ref)))
    assert E[4] == pytest.approx(np.full(4, 0.25))


@pytest.mark.parametrize(("name", "model"), ONE_POINT)
def test_one_point_cells_give_their_volume_weighted_mean(name, model):
    space = Space.of(distorted(body(name, 2), 0.05), model)
    (field,), (W,), (block,) = points(space), weights(space), space.blocks
    field = np.repeat(field[..., :1], space.model.n_stress, axis=2)
    node = int(block.nodes[0, 0])
    rows = np.flatnonzero((block.nodes == node).any(axis=1))
    assert len(rows) > 1
    expected = (field[rows, 0, 0] * W[rows, 0]).sum() / W[rows, 0].sum()
    assert nodal_stress(space, (field,))[node] == pytest.approx(np.full(space.model.n_stress, expected))


def test_stress_of_some_cells_does_not_mix_and_is_nan_elsewhere():
    """Cells of different types share one field."""
    mesh = body("QUAD4", 2)
    space, x = Space.of(mesh, "plane_strain"), mesh.points[:, 0]
    left = np.flatnonzero(mesh.points[mesh.blocks[0].nodes, 0].mean(axis=1) < 1.5)
    field = np.ones((4, 4, 4))
    field[left] = 5.0
    apart, mixed = nodal_stress(space, (field,), left), nodal_stress(space, (field,))
    assert apart[x <= 1.5] == pytest.approx(5.0) and np.isnan(apart[x > 1.5]).all()
    assert mixed[x == 1.5] == pytest.approx(3.0)
    space = Space.of(mixture(), "3d")
    assert nodal_stress(space, tuple(np.full((*at.shape[:2], 6), 7.0) for at in points(space))) == pytest.approx(7.0)
