"""The case of data/plastic: its mesh made again, and the imprint that a ball leaves in a plate."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import read, write

DATA = Path(__file__).resolve().parents[2] / "data" / "plastic"


@pytest.fixture
def script():
    """The script that makes the mesh, as a module."""
    spec = importlib.util.spec_from_file_location("make_imprint", DATA / "make_imprint.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


def test_the_mesh_is_what_its_script_makes(script, tmp_path):
    script.main(tmp_path / "imprint.msh")
    made, kept = read(tmp_path / "imprint.msh"), read(DATA / "imprint.msh")
    np.testing.assert_allclose(made.points, kept.points, rtol=0, atol=1e-12)
    write(tmp_path / "again.msh", replace(made, points=kept.points))
    assert (tmp_path / "again.msh").read_bytes() == (DATA / "imprint.msh").read_bytes()


def test_a_ball_leaves_an_imprint(script, tmp_path, monkeypatch):
    """Pressed in, nearly the pressure of full plasticity; taken off, what stays is deeper than what comes back.

    On a mesh twice as coarse.
    """
    monkeypatch.setattr(script, "H", 2 * script.H)
    script.main(tmp_path / "imprint.msh")
    states = list(ls.march(DATA / "imprint.toml", tmp_path / "imprint.msh"))
    pressed, last = states[5], states[-1]
    zone = pressed.contact["top"]
    on = zone.status == 1
    mean = (zone.pressure @ zone.area) / zone.area[on].sum()
    assert pressed.time == 1.0 and 2.4 * 400 < mean < 3.1 * 475
    assert not last.contact["top"].pressure.any()
    (pole,) = last.mesh.node_groups["pole"]
    depth = [-state.u[pole, 1] for state in (pressed, last)]
    assert 0.0495 < depth[0] < 0.0505 and 0.8 * depth[0] < depth[1] < 0.95 * depth[0]
    taken = [state.figures.plastic.dissipation[1] for state in states]
    assert (np.diff(taken) >= 0).all() and 30 < taken[-1] < 40
    assert np.nanmax(last.plastic_strain) > 0.05  # the ball has none
