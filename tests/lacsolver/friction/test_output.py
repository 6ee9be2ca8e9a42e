"""Files of a run with friction: what they hold, what is read from them again, and a restart to the last bit."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import read
from lacsolver.case import Case, Contact, Displacement, Material, Output, Steps
from lacsolver.output import create_output, read_state
from lacsolver.output.tables import CONTACT_COLUMNS, contact_columns
from tests.lacsolver.patch_meshes import stack
from tests.samples import each_option
from tests.test_pages import RUBBED as OF_FRICTION

# few steps leave over much of the energy that friction takes, as they should say
pytestmark = pytest.mark.filterwarnings("ignore:steps are too long for the energy")

WAYS = [("plane_strain", "small"), ("plane_strain", "current"), ("3d", "small"), ("3d", "current")]


@cache
def rubbed(model, geometry):
    """Blocks pressed and moved to and fro, so that some macro-elements stick and some slide."""
    dim, kinds = (3, ("HEXA8", "TETRA4")) if model == "3d" else (2, ("QUAD4", "TRIA3"))
    mesh = stack(*kinds, dim, counts=(3, 2))
    up, across = "xyz"[dim - 1], {} if dim == 2 else {"uz": "-0.03 * t"}
    moved = {"ux": "0.03 * sin(4 * t)", "uy": "-0.03 * t" if dim == 2 else "0.01 * t", **across}
    held = {f"u{axis}": 0 for axis in "xyz"[:dim]}
    assert up in "yz"
    case = Case(
        model=model, mesh=mesh, material=[Material(young=1000.0, poisson=0.3)],
        contact=[
            Contact(
                name="joint", slave="slave", master="master", friction=0.4,
                geometry="reference" if geometry == "small" else "current",
            )
        ],
        displacement=[Displacement(group="bottom", **held), Displacement(group="top", **moved)],
        steps=Steps(end=1.0, count=4),
    )  # fmt: skip
    return case, mesh


@cache
def joint(model, geometry):
    """The contact of these blocks in the end."""
    return ls.solve(*rubbed(model, geometry)).contact["joint"]


@pytest.fixture(
    scope="module", params=[pytest.param(way.values, marks=way.marks) for way in each_option(WAYS)], ids=str
)
def run_of(request, tmp_path_factory):
    """A way, and the folder of a run."""
    (case, mesh), folder = rubbed(*request.param), tmp_path_factory.mktemp("run")
    ls.run(case, folder / "a", mesh=mesh)
    return request.param, folder


def test_a_run_is_read_as_it_was(run_of):
    way, folder = run_of
    last = joint(*way)
    zone = ls.read_results(folder / "a").solution(-1).contact["joint"]
    for name in (
        "shear",
        "slip",
        "path",
        "use",
        "dissipation",
        "shear_vector",
        "slip_vector",
        "status",
        "shear_recovered",
    ):
        np.testing.assert_array_equal(getattr(zone, name), getattr(last, name))
    np.testing.assert_allclose(zone.friction.resultant, last.friction.resultant, rtol=1e-9, atol=1e-12)
    assert (last.path > 0).any()
    figures = json.loads((folder / "a" / "results.json").read_text())["contact"]["joint"]
    assert figures["sticking"] + figures["sliding"] == figures["active"] and figures["dissipation"][1] > 0
    assert figures["friction"] == last.friction.resultant.tolist()
    with (folder / "a" / "contact_joint.csv").open(newline="") as file:
        columns = next(csv.reader(file))
    assert tuple(columns) == contact_columns(last) and len(columns) > len(CONTACT_COLUMNS)
    skin = read(folder / "a" / "fields" / "contact_joint_0004.vtu")
    assert set(OF_FRICTION) <= set(skin.cell_data) and skin.cell_data["shear"].shape[1] == 3
    assert skin.node_data["shear_recovered"].shape[1] == 3
    grid = ls.read_results(folder / "a").solution(-1).to_pyvista()
    assert np.isfinite(grid.cell_data["shear"]).any()


@pytest.mark.parametrize("model", ["plane_strain", "3d"])
def test_a_run_is_read_from_med_as_it_was(tmp_path, model):
    case, mesh = rubbed(model, "small")
    last = joint(model, "small")
    ls.run(replace(case, output=Output(format="med")), tmp_path / "med", mesh=mesh)
    whole = read(tmp_path / "med" / "results.med")
    assert {f"joint.{name}" for name in OF_FRICTION} <= {name.split("@")[0] for name in whole.cell_data}
    again = ls.read_results(tmp_path / "med").solution(-1).contact["joint"].shear_recovered
    np.testing.assert_array_equal(again, last.shear_recovered)


def test_a_restart_is_the_same_to_the_last_bit(run_of):
    way, folder = run_of
    case, mesh = rubbed(*way)
    state = read_state(folder / "a", case, 0.5, mesh=mesh)
    ls.run(case, create_output(folder / "b"), mesh=mesh, start=state)
    rows = [(folder / run / "history.csv").read_text().splitlines() for run in "ab"]
    assert rows[0][0] == rows[1][0] and rows[0][-1] == rows[1][-1] and "contact.joint.dissipation" in rows[0][0]
