"""Models whose sets of rows return under pivoting: seats, a lid on two blocks, a belt on a drum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lacsolver as ls
from lacsolver.case import (
    BodyForce,
    Case,
    Contact,
    Displacement,
    Force,
    Material,
    Rigid,
    Solver,
    Steps,
    Tie,
    Traction,
)  # fmt: skip
from lacsolver.contact.friction import Bounds, next_states
from lacsolver.equilibrium.stepping import NotConvergedError
from tests.lacsolver.friction.test_rules import STICKS, solved

MESHES = Path(__file__).parent.parent / "meshes"
INF = np.inf


def seat(model, friction, geometry="reference", slave="round", **options):
    """A cylinder in a groove or a ball in a cone of 90 degrees, under a weight of 1 per volume: half of it."""
    master = {"round": "flank", "flank": "round"}[slave]
    return Case(
        mesh=MESHES / "seat.msh", model=model, material=[Material(young=210e3, poisson=0.3)],
        contact=[Contact(slave=slave, master=master, friction=friction, geometry=geometry)],
        displacement=[Displacement(group="base", ux=0, uy=0), Displacement(group="axis_seat", ux=0),
                      Displacement(group="axis_ball", ux=0)],
        body_force=[BodyForce(groups=["ball"], fy=-1.0)], **options,
    )  # fmt: skip


@pytest.mark.parametrize("model", ["plane_strain", "axisymmetric"])
@pytest.mark.parametrize(
    ("friction", "geometry", "slave"),
    [(0.1, "reference", "round"), (0.5, "reference", "flank"), (0.5, "current", "flank"), (0.3, "current", "flank")],
)
def test_a_body_in_a_seat(model, friction, geometry, slave):
    """It slides on the flank as it settles, so that forces along it are its bound, and both carry the weight."""
    solution = ls.solve(seat(model, friction, geometry, slave, steps=Steps(count=4, max_halvings=0)))
    (zone,) = solution.contact.values()
    pressed = zone.status == 2
    ratio = np.abs(zone.shear[pressed, 0]) / zone.pressure[pressed]
    assert ratio == pytest.approx(np.full(pressed.sum(), friction), rel=1e-8)
    assert pressed.any() and not (zone.status == 1).any()


def test_a_message_blames_no_friction_where_pressures_carry_the_load():
    case = seat("plane_strain", 0.2, steps=Steps(count=1, max_halvings=0), solver=Solver(max_iterations=1))
    with pytest.raises(NotConvergedError) as caught:
        ls.solve(case)
    assert "raise friction" not in str(caught.value) and "forces are off by" in str(caught.value)


def lid(friction, geometry="reference"):
    """A lid on two blocks, tied to a column between them, pressed and pushed."""
    return Case(
        mesh=MESHES / "lid.msh", model="plane_strain", material=[Material(young=1000.0, poisson=0.3)],
        contact=[Contact(name="joint", slave="pt", master="hb", friction=friction, geometry=geometry)],
        tie=[Tie(name="tie", slave="bt", master="hb")],
        displacement=[Displacement(group="bolt0", ux=0, uy=0), Displacement(group="p0", ux=0, uy=0)],
        force=[Force(group="ht", fx=1.0, fy=-4.0, total=True)], steps=Steps(count=1, max_halvings=0),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("friction", "normal", "shear"), [(0.2, 2.7830869501, 0.5231004109), (0.3, 2.7427535141, 0.5553778340)]
)
def test_a_lid_on_two_blocks(friction, normal, shear):
    """Forces are those of projected Gauss-Seidel on the same matrices, whose largest violation is 4e-16."""
    zone = ls.solve(lid(friction)).contact["joint"]
    assert zone.pressure @ zone.area == pytest.approx(normal, rel=1e-9)
    assert zone.shear[:, 0] @ zone.area == pytest.approx(shear, rel=1e-9)
    assert (zone.status > 0).sum() == 5 and (zone.status == 2).sum() == 4


def test_a_rough_macro_element_without_pressure_that_presses_goes_on_sticking():
    """Soft contact may press at a gap, where p is not yet above 0; an infinite bound has no size to slide at."""
    rough = Bounds(np.array([INF]), np.zeros(1), np.array([INF]))
    then = next_states(STICKS, solved(-0.1, (0.5,), presses=True), rough)
    assert then.sticks[0] and not then.direction.any()


@pytest.mark.slow
@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_a_belt_on_a_quarter_of_a_drum(geometry):
    """All its steps are solved at once: a slender body, whose tractions depend on all others; at the end it slides."""
    pull = [[0.0, 0.0], [1.0, -0.002], [2.0, -0.05]]
    case = Case(
        mesh=MESHES / "belt.msh", model="plane_strain",
        material=[Material(groups=["belt"], young=1e4, poisson=0.0),
                  Material(groups=["drum"], young=1e6, poisson=0.0)],
        contact=[Contact(name="joint", slave="in", master="dr", friction=0.3, geometry=geometry)],
        rigid=[Rigid(group="drum")], displacement=[Displacement(group="e1", ux=pull)],
        traction=[Traction(group="e0", ty=[[0.0, 0.0], [1.0, -10.0], [2.0, -10.0]])],
        steps=Steps(end=2.0, count=20, max_halvings=0),
    )  # fmt: skip
    zone = ls.solve(case).contact["joint"]
    assert (zone.status == 2).sum() >= 20
