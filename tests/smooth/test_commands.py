"""Output of `info --verbose` and `check` on curved skins."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, check, cut_skin, write
from lacmesh.cli import main
from lacmesh.smooth import fit_surface
from tests.checks.blocks import two_blocks
from tests.smooth.skins import block, rolled, shell
from verification.meshes.rings import octant, pair


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "shell.msh"
    write(path, cut_skin(block("HEXA8", shell), "skin").mesh)
    return str(path)


def test_info_says_shapes_when_asked(file, capsys):
    assert main(["info", file]) == 0
    assert "sphere" not in capsys.readouterr().out
    assert main(["info", file, "--verbose"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (line,) = [line for line in lines if line.startswith("skin:")]
    assert line.startswith("skin: sphere, radius 1.4, 25 nodes within ")
    assert main(["info", file, "-v", "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)["shapes"]["skin"]
    assert (one["shape"], one["faces"], one["nodes"]) == ("sphere", 64, 25)
    assert one["radius"] == pytest.approx(1.4, rel=1e-12) and one["text"].startswith("sphere, radius 1.4")


def test_check_says_shapes(file, capsys):
    assert main(["check", file, "--slave", "skin", "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)["summary"]["shapes"]["skin"]
    assert one["shape"] == "sphere" and one["tube"] is None
    assert main(["check", file, "--slave", "skin"]) == 0
    assert "shape of skin" in capsys.readouterr().out


def test_a_cut_without_records_is_found_again():
    """By the check, where it is asked to; from Python the cut must be recognised first."""
    cut = cut_skin(block("TETRA4", shell), "skin").mesh
    bare = replace(cut, cell_data={}, node_data={}, zones=())
    assert [one["shape"] for one in check(bare, "skin", recognise=True).summary["shapes"]["skin"]] == ["sphere"]
    assert [one.shape for one in fit_surface(bare, "skin")] == ["free form"]


def test_gaps_of_a_cut_without_records_are_those_of_the_cut():
    """The heights of its macro-elements, as the solver has them, not of each child for itself."""
    within, around = (octant("TETRA4", (1, n), r) for n, r in ((4, (1.0, 2.0)), (3, (2.1, 3.0))))
    cut = cut_skin(pair(within, around), "slave").mesh
    bare = replace(cut, cell_data={}, node_data={}, zones=())
    gap, again = (check(mesh, "slave", "master", recognise=True).summary["gap"] for mesh in (cut, bare))
    assert again == pytest.approx(gap, rel=1e-12)


def test_flat_skins_say_nothing():
    assert check(two_blocks(), "slave", "master").summary["shapes"] == {}


def test_centres_are_told_where_they_are_in_the_file():
    mesh = block("HEXA8", shell)
    far = replace(mesh, points=mesh.points + np.array([1e4, 0, -2e4]))
    (one,) = check(far, "skin").summary["shapes"]["skin"]
    np.testing.assert_allclose(one["centre"], [1e4, 0, -2e4], atol=1e-8)


def test_coarse_skins_are_faceted_and_fine_ones_are_not():
    bowl = lambda x: np.stack([x[:, 0], x[:, 1], 0.6 * x[:, 0] ** 2 + 0.4 * x[:, 1] ** 2], axis=1)  # noqa: E731
    (coarse,) = check(rolled(bowl, 2, "TRIA3", skew=0, size=1.5), "skin").of_rule("faceted")
    assert "at angles up to 29 degrees" in coarse.message and len(coarse.cells) == 7
    assert not check(rolled(bowl, 12, "TRIA3", skew=0, size=1.5), "skin").of_rule("faceted")


def test_a_curved_patch_of_few_nodes_has_no_fit():
    """Two warped quadrangles have six nodes, enough for a fit; two triangles have four."""
    x = np.array([[0, 0, 0], [1, 0, 0.2], [2, 0, 0], [0, 1, 0.1], [1, 1, 0.2], [2, 1, 0.05]])
    mesh = Mesh.create(x, [("QUAD4", [[0, 1, 4, 3], [1, 2, 5, 4]])], cell_groups={"skin": [0, 1]})
    (one,) = fit_surface(mesh, "skin")
    assert one.shape == "free form" and one.nodes == 6 and one.no_height == 0  # five neighbours each: there is a fit
    triangles = Mesh.create(x[[0, 1, 4, 3]], [("TRIA3", [[0, 1, 2], [0, 2, 3]])], cell_groups={"skin": [0, 1]})
    (one,) = fit_surface(triangles, "skin")
    assert one.shape == "free form" and one.no_height == 2
    assert "2 of them have too few neighbours" in check(triangles, "skin").of_rule("faceted")[0].message
