"""Warnings of a run and of `validate`: bodies that lock, skins that never meet."""

from __future__ import annotations

import warnings

import pytest

import lacmesh
from lacmesh.errors import LacmeshWarning
from lacsolver.case import parse_case
from lacsolver.output import create_output
from lacsolver.running import run
from lacsolver.validation import validate
from tests.problem_meshes import plane

CASE = """
mesh = "blocks.msh"
model = "plane_strain"
kinematics = "finite"
[[material]]
law = "{law}"
young = 1000.0
poisson = {poisson}
[[contact]]
slave = "slave"
master = "master"
search_distance = 0.5
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
[[displacement]]
group = "top"
ux = 0.0
uy = {down}
"""


def case(law="neo_hookean", poisson=0.3, down=-0.02):
    return parse_case(CASE.format(law=law, poisson=poisson, down=down))


@pytest.mark.parametrize("law, poisson, told", [("neo_hookean", 0.49, True), ("neo_hookean", 0.4, False)])
def test_cells_that_lock_are_warned_of(law, poisson, told, tmp_path, monkeypatch):
    """By `validate` and by a run; TRIA3 are above, QUAD8 below."""
    monkeypatch.chdir(tmp_path)
    made, mesh = case(law, poisson), plane()
    lacmesh.write("blocks.msh", mesh)
    for look in (lambda: validate(made, mesh), lambda: run(made, create_output("out"), mesh=mesh)):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            look()
        said = [str(w.message) for w in caught if isinstance(w.message, LacmeshWarning)]
        assert bool(said) == told
        assert all("TRIA3" in line and "lock" in line and "QUAD8" not in line for line in said)


def test_skins_that_never_meet_are_warned_of(tmp_path, monkeypatch):
    """The upper block is lifted beyond where the slave looks; the run is done, and says so."""
    monkeypatch.chdir(tmp_path)
    lacmesh.write("blocks.msh", plane("QUAD4", "QUAD4"))
    with pytest.warns(LacmeshWarning, match="slave 'slave' never had master 'master' in front of it; check which"):
        done = run(case(down=0.8), create_output("out"), mesh=plane("QUAD4", "QUAD4"))
    assert done.status == "done" and done.steps[-1].contact["slave"].unpaired > 0
