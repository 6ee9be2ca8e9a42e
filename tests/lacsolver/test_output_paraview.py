"""The state of ParaView beside the results: what it names is there, and ParaView draws bodies and pressures with it."""

from __future__ import annotations

import ast
import subprocess
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.scene.colours import RESULT
from lacsolver.output import paraview_state
from lacsolver.output.names import PARAVIEW, results_in
from tests.lacsolver.written import ZONES, made_up
from tests.viewing import display

SCRIPT = Path(paraview_state.__file__)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = made_up(tmp_path_factory.mktemp("paraview"))
    made.steps(made.writer(), 2)
    return made.folder


def test_it_lies_beside_the_results_and_is_one_of_them(folder):
    assert (folder / PARAVIEW).read_bytes() == SCRIPT.read_bytes()
    assert folder / PARAVIEW in results_in(folder)


def test_the_python_of_paraview_reads_it():
    """ParaView 5.10 has Python 3.9, and nothing of ours."""
    tree = ast.parse(SCRIPT.read_text(), feature_version=(3, 9))
    modules = {getattr(node, "module", None) or node.names[0].name for node in ast.walk(tree)
               if isinstance(node, (ast.Import, ast.ImportFrom))}  # fmt: skip
    assert modules == {"__future__", "json", "sys", "pathlib", "typing", "paraview"}


def test_its_colours_are_those_of_other_pictures():
    assert paraview_state.COLOURS == RESULT


def test_its_files_and_fields_are_there(folder):
    skins = sorted(folder.glob("contact_*.pvd"))
    assert (folder / "solid.pvd").exists() and len(skins) == len(ZONES)
    for name in paraview_state.TITLES:
        assert f'"{name}"' in SCRIPT.read_text()
    solid = lacmesh.read(next((folder / "fields").glob("solid_*.vtu")))
    assert {"displacement", "von_mises"} <= set(solid.node_data)
    for path in (folder / "fields").glob("contact_*.vtu"):
        skin = lacmesh.read(path)
        assert "displacement" in skin.node_data and "pressure" in skin.cell_data


def test_units_are_those_of_the_run(tmp_path):
    assert paraview_state.units(tmp_path) == ""
    (tmp_path / "results.json").write_text('{"units": "N, mm, MPa"}')
    assert paraview_state.units(tmp_path) == " (N, mm, MPa)"


@pytest.mark.paraview
@pytest.mark.parametrize("model", ["3d", "plane_strain"])
def test_paraview_draws_bodies_and_pressures(tmp_path, model):
    from PIL import Image

    made = made_up(tmp_path, model)
    made.steps(made.writer(), 2)
    picture = tmp_path / "picture.png"
    with display() as environment:
        environment = {name: value for name, value in environment.items() if name != "PYTHONPATH"}
        words = ["pvbatch", str(made.folder / PARAVIEW), str(picture)]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    assert pixels.shape == (700, 1600, 3)
    coloured = np.ptp(pixels, axis=2) > 40
    coloured[400:, 640:800] = coloured[400:, 1440:] = False  # the scales
    coloured[500:, :150] = coloured[500:, 800:950] = False  # the axes
    left, right = coloured[:, :800].sum(), coloured[:, 800:].sum()
    assert left > 2000 and right > (1000 if model == "3d" else 100), (left, right)
