"""The cases of data/friction and their tutorial: meshes made again, a clamp that slips, cylinders, the page's lines."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from tests.test_tutorials import TUTORIALS, pictures_of, shows_what_the_page_shows, size_of, tutorials

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data" / "friction"
__all__ = ["tutorials"]


@pytest.mark.parametrize("name", ["clamp", "cylinders"])
def test_the_scripts_make_the_meshes_again(name, tmp_path):
    target = tmp_path / f"{name}.msh"
    subprocess.run([sys.executable, str(DATA / f"make_{name}.py"), str(target)], check=True, cwd=ROOT)
    made, there = lacmesh.read(target), lacmesh.read(DATA / target.name)
    np.testing.assert_allclose(made.points, there.points, rtol=0, atol=1e-12)
    for one, other in zip(made.blocks, there.blocks, strict=True):
        np.testing.assert_array_equal(one.nodes, other.nodes)
    assert {name: cells.tolist() for name, cells in made.cell_groups.items()} == {
        name: cells.tolist() for name, cells in there.cell_groups.items()
    }


def test_the_clamp_holds_until_friction_carries_no_more():
    states = list(ls.march(DATA / "clamp.toml"))
    zones = [state.contact["joint"] for state in states]
    sliding = [int((zone.status == 2).sum()) for zone in zones]
    closed = [int((zone.pressure > 0).sum()) for zone in zones]
    assert 0 < sliding[1] < closed[1] and sliding[-1] == closed[-1]
    carried = [float(zone.shear_vector[:, 0] @ zone.area) for zone in zones]
    bound = [0.2 * float(zone.pressure @ zone.area) for zone in zones]
    assert carried[-1] == pytest.approx(bound[-1], rel=1e-10)
    assert all(now < most * (1 + 1e-12) for now, most in zip(carried, bound, strict=True))
    dissipation = [float(zone.dissipation @ zone.area) for zone in zones]
    assert (np.diff(dissipation) >= 0).all() and dissipation[-1] > 0


def test_the_clamp_slips_away_under_a_force_that_friction_does_not_carry(tmp_path):
    """Up to 314 N/mm on the 5 mm of the end it holds."""
    text = (DATA / "clamp.toml").read_text(encoding="utf-8").replace("ux = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.06]]\n", "")
    shutil.copy(DATA / "clamp.msh", tmp_path)
    for force, holds in ((300.0, True), (330.0, False)):
        pull = f"[[traction]]\ngroup = 'pulled'\ntx = [[0.0, 0.0], [1.0, 0.0], [2.0, {force / 5}]]\n"
        case = tmp_path / "pulled.toml"
        case.write_text(f"{text}max_halvings = 0\n\n{pull}", encoding="utf-8")
        if holds:
            zone = ls.solve(case).contact["joint"]
            assert float(zone.shear_vector[:, 0] @ zone.area) == pytest.approx(force, rel=1e-8)
        else:
            with pytest.raises(ls.NotConvergedError, match=r"slides along x: friction of .joint. carries 0.200"):
                ls.solve(case)


def test_cylinders_stick_where_cattaneo_and_mindlin_say():
    zone = ls.solve(DATA / "cylinders.toml").contact["line"]
    a = 0.6808
    assert zone.pressure.max() == pytest.approx(9.351, rel=0.01)
    stick = float(zone.area[zone.status == 1].sum()) / 2
    assert stick == pytest.approx(0.7293 * a, abs=0.04)  # one macro-element
    assert zone.shear_vector[:, 0] @ zone.area == pytest.approx(0.93616, rel=1e-8)


@pytest.mark.slow
def test_the_page_is_what_its_commands_do(tutorials, tmp_path):
    done = list(tutorials.run_page(TUTORIALS / "friction.md", tmp_path))
    assert shows_what_the_page_shows(done)
    for name in pictures_of(TUTORIALS / "friction.md"):
        assert size_of(tmp_path / name) == size_of(TUTORIALS / name)
