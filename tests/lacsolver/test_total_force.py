"""A force in total: its resultant is what is given, spread as a uniform traction, with every cut, model and group."""

import json

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacsolver import CaseError
from lacsolver.case import Force, parse_case
from lacsolver.cli import main
from lacsolver.problem import loads
from lacsolver.problem.problem import Problem
from lacsolver.problem.resultants import resultants
from tests.lacsolver.test_records_on_mesh import blocks
from verification.meshes.blocks import block, joined

HEAD = """
mesh = "blocks.msh"
model = "{model}"
{more}
[[material]]
young = 1.0
poisson = 0.0
"""
CONTACT = '[[contact]]\nslave = "slave"\nmaster = "master"\n'


def total(group, more=""):
    return f'[[force]]\ngroup = "{group}"\nfx = 3.0\nfy = "-5*t"\ntotal = true\n{more}'


def problem(mesh, text, model="3d", more=""):
    return Problem.of(parse_case(HEAD.format(model=model, more=more) + text), mesh)


def resultant(made):
    return made.load(1.0).reshape(-1, made.space.dim).sum(axis=0)


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize("kind", ["HEXA8", "HEXA20", "TETRA10", "PENTA6"])
def test_a_force_on_faces_is_a_uniform_traction_before_and_after_a_cut(kind, hexa):
    mesh, count = blocks(kind)
    cut = lacmesh.cut_skin(mesh, "slave", hexa=hexa).mesh
    for given, contact in ((mesh, ""), (cut, "")):
        made = problem(given, total("slave") + contact)
        area = 1.0
        as_traction = loads.traction(made.space, given.cells_of("slave"), (3 / area, -5 / area, 0.0))
        np.testing.assert_allclose(made.load(1.0), as_traction, atol=1e-13)
        assert resultant(made) == pytest.approx([3, -5, 0], abs=1e-13)
    assert resultant(problem(mesh, total("slave") + CONTACT + f'hexa = "{hexa}"\n')) == pytest.approx(
        [3, -5, 0], abs=1e-13
    )
    assert resultant(problem(mesh, total("slave").replace("total = true", ""))) == pytest.approx(
        [3 * count, -5 * count, 0]
    )


@pytest.mark.parametrize(
    ("model", "more"), [("plane_strain", ""), ("plane_stress", "thickness = 0.25"), ("axisymmetric", "")]
)
@pytest.mark.parametrize("kind", ["QUAD4", "TRIA6"])
def test_in_a_plane_it_is_that_of_the_whole_thickness_or_circle(kind, model, more):
    """On the disc y = 0, 0 < r < 1: the traction along y is F / A."""
    low = joined([(block(kind, 3, [0.0, 0.0], [1.0, 1.0]), {"y0": "disc"})])
    made = problem(low, total("disc"), model, more)
    assert resultant(made) == pytest.approx([3, -5], rel=1e-12)
    area = {"plane_strain": 1.0, "plane_stress": 0.25, "axisymmetric": np.pi}[model]
    expected = loads.traction(made.space, low.cells_of("disc"), (3 / area, -5 / area))
    np.testing.assert_allclose(made.load(1.0), expected, atol=1e-13)


def test_edges_points_nodes_and_cells():
    """Edges in space by length, cells by volume, nodes and points in equal parts."""
    corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1], [2, 0, 1], [2, 1, 1], [0, 1, 1]]
    blocks = [("HEXA8", [[0, 1, 2, 3, 4, 5, 6, 7]]), ("SEG2", [[0, 1], [1, 2]]), ("POI1", [[4], [5]])]
    groups = {"edges": [1, 2], "points": [3, 4], "body": [0], "some": [0, 1]}
    mesh = Mesh.create(corners, blocks, cell_groups=groups, node_groups={"nodes": [0, 3, 6]})
    parts = {
        "edges": [1 / 3, 1 / 2, 1 / 6, 0, 0, 0, 0, 0],
        "points": [0, 0, 0, 0, 1 / 2, 1 / 2, 0, 0],
        "nodes": [1 / 3, 0, 0, 1 / 3, 0, 0, 1 / 3, 0],
        "body": [1 / 8] * 8,
        "some": [1 / 8] * 8,
    }
    for group, part in parts.items():
        f = problem(mesh, total(group)).load(1.0).reshape(-1, 3)
        np.testing.assert_allclose(f, np.outer(part, [3, -5, 0]), atol=1e-14)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (total("slave", 'fz = "x"\n'), r"force: total = true takes one force for the whole group"),
        (total("axis"), r"a total force is spread by area, and the group has none"),
    ],
)
def test_what_has_no_total_is_refused(text, says):
    mesh = joined([(block("QUAD4", 2, [0.0, 0.0], [1.0, 1.0]), {"x0": "axis", "y0": "slave"})])
    with pytest.raises(CaseError, match=says):
        problem(mesh, text.replace("fz", "fx").replace("fx = 3.0\n", "", 1), "axisymmetric").load(1.0)


def test_resultants_are_printed_and_written(tmp_path, capsys, monkeypatch):
    """Both commands print those of forces of each node and in total, of pressures, tractions, body forces, gravity."""
    monkeypatch.chdir(tmp_path)
    cube = block("HEXA8", 2, [0.0, 0.0, 0.0], [1.0, 1.0, 1.0])
    lacmesh.write("blocks.msh", joined([(cube, {"z0": "foot", "z1": "lid", "x1": "side"})]))
    text = HEAD.format(model="3d", more="").replace("poisson = 0.0", "poisson = 0.0\ndensity = 2.0")
    text += '[[displacement]]\ngroup = "foot"\nux = 0.0\nuy = 0.0\nuz = 0.0\n'
    text += '[[force]]\ngroup = "lid"\nfz = -1.0\n[[force]]\ngroup = "lid"\nfz = -7.0\ntotal = true\n'
    text += '[[pressure]]\ngroup = "side"\nvalue = 4.0\n[[traction]]\ngroup = "side"\nty = 3.0\n'
    text += "[[body_force]]\nfx = 0.5\n[gravity]\ngz = -10.0\n"
    (tmp_path / "case.toml").write_text(text)
    told = [
        "pressure side: -4, 0, 0", "traction side: 0, 3, 0", "force lid: 0, 0, -9", "force lid: 0, 0, -7",
        "body_force everywhere: 0.5, 0, 0", "gravity everywhere: 0, 0, -20",
    ]  # fmt: skip
    for command in (["validate", "case.toml"], ["run", "case.toml"]):
        assert main(command) == 0
        out = capsys.readouterr().out
        assert all("resultant, t = 1" in out and line in out for line in told), out
    written = json.loads((tmp_path / "case" / "results.json").read_text())
    assert [one["force"][2] for one in written["loads"] if one["section"] == "force"] == pytest.approx([-9, -7])
    support = written["steps"][-1]["reactions"]["foot"]
    np.testing.assert_allclose(np.sum([one["force"] for one in written["loads"]], axis=0), -np.array(support))


def test_a_follower_pressure_has_its_resultant_on_the_deformed_face():
    mesh = joined([(block("QUAD4", 2, [0.0, 0.0], [1.0, 1.0]), {"y1": "top", "y0": "foot"})])
    text = '[[pressure]]\ngroup = "top"\nvalue = 1.0\nfollower = true\n'
    text = HEAD.format(model="plane_strain", more='kinematics = "finite"') + 'law = "neo_hookean"\n' + text
    made = Problem.of(parse_case(text), mesh)
    u = np.zeros((mesh.n_nodes, 2))
    u[:, 0] = mesh.points[:, 0]  # twice as wide
    (found,) = resultants(made.space, made.materials, made.case, 1.0, u=u.ravel())
    assert found.force == pytest.approx((0, -2))


def test_the_record_from_python():
    assert Force(group="lid", fz=-1000.0, total=True).total and not Force(group="lid", fz=1.0).total
