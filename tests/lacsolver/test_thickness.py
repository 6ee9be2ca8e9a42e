"""Plane bodies of several thicknesses: columns in closed form, loads, contact, mass, and groups that are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacsolver.case import (
    BodyForce,
    Case,
    CaseError,
    Contact,
    Displacement,
    Force,
    Material,
    Pressure,
    Tie,
    parse_case,
    read_case,
)
from lacsolver.cli import main
from lacsolver.validation import validate
from tests.checks.blocks import block, join, skin

E, LOW, UP = 1000.0, 2.0, 5.0


def columns(kind="QUAD4", low=2, up=3):
    """A column 1 wide and 1 high, and one of height 2 on it."""
    lower, upper = block((low, low), (0, 0), (1, 1), kind), block((up, 2 * up), (0, 1), (1, 3), kind)

    def side(part, at):
        return skin(*part, lambda x: abs(x[..., 1] - at) < 1e-9)

    return join([
        (*lower, {"bottom": side(lower, 0), "under": side(lower, 1)}),
        (*upper, {"over": side(upper, 1), "top": side(upper, 3)}),
    ])  # fmt: skip


def pressed(slave="under", model="plane_stress", pair=Contact, **keys):
    """Columns of the thicknesses LOW and UP under a pressure of 6 on top, a force of 6 UP."""
    master = {"under": "over", "over": "under"}[slave]
    key = {Contact: "contact", Tie: "tie"}[pair]
    given = {
        "model": model, "thickness": {"body0": LOW, "body1": UP}, "material": Material(young=E, poisson=0.0),
        key: pair(slave=slave, master=master), "pressure": Pressure(group="top", value=6.0),
        "displacement": [Displacement(group="bottom", ux=0.0, uy=0.0), Displacement(group="top", ux=0.0)],
    }  # fmt: skip
    return Case(**(given | keys))


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA3"])
@pytest.mark.parametrize("model", ["plane_stress", "plane_strain"])
@pytest.mark.parametrize("slave, pair", [("under", Contact), ("over", Contact), ("under", Tie), ("over", Tie)])
def test_columns_under_a_force(slave, pair, model, kind):
    """The force 6 UP goes through both; the contact's area is that of the slave, and so is its pressure."""
    mesh = columns(kind)
    solution = ls.solve(pressed(slave, model, pair), mesh)
    force, thick = 6.0 * UP, {"under": LOW, "over": UP}[slave]
    y = solution.mesh.points[:, 1]
    above = np.isin(np.arange(len(y)), solution.mesh.nodes_on(solution.mesh.cells_of("body1")))
    u = np.where(above, -force / (E * LOW) - 6.0 * (y - 1) / E, -force / (E * LOW) * y)
    np.testing.assert_allclose(solution.u, np.stack([0 * u, u], axis=1), atol=1e-12)
    (zone,) = solution.contact.values()
    np.testing.assert_allclose(zone.pressure, force / thick, rtol=1e-9)
    assert zone.area.sum() == pytest.approx(thick, rel=1e-12)
    figures = solution.figures
    assert figures.reactions["bottom"][1] == pytest.approx(force, rel=1e-12)
    assert abs(figures.contact[slave].resultant[1]) == pytest.approx(force, rel=1e-12)
    assert max(figures.balance) < 1e-12
    assert figures.energy == pytest.approx(0.5 * force**2 / (E * LOW) + 0.5 * 6.0**2 / E * 2 * UP, rel=1e-9)


@pytest.mark.parametrize("slave", ["under", "over"])
def test_large_strains_and_moving_contact(slave):
    """With Saint Venant-Kirchhoff and the contact paired again; the lower column has S = E (l^2 - 1) / 2, F = l S A."""
    law = Material(young=E, poisson=0.0, law="saint_venant_kirchhoff")
    case = pressed(slave, kinematics="finite", material=law)
    solution = ls.solve(case, columns())
    force = 6.0 * UP
    figures = solution.figures
    assert figures.reactions["bottom"][1] == pytest.approx(force, rel=1e-9)
    assert abs(figures.contact[slave].resultant[1]) == pytest.approx(force, rel=1e-9)
    bottom = solution.mesh.nodes_on(solution.mesh.cells_of(slave))
    stretch = max(np.roots([E * LOW / 2, 0, -E * LOW / 2, force]).real)
    if slave == "under":
        np.testing.assert_allclose(solution.u[bottom, 1], stretch - 1, rtol=1e-8)


def test_a_slave_of_two_thicknesses():
    """Each macro-element has the thickness of its own cell; one body has both, left and right."""
    mesh = columns(low=2, up=3)
    x = np.array([mesh.points[nodes].mean(axis=0) for nodes in mesh.block("QUAD4")])
    body = mesh.cells_of("body0")
    groups = {**mesh.cell_groups, "left": body[x[: len(body), 0] < 0.5], "right": body[x[: len(body), 0] > 0.5]}
    made = lacmesh.Mesh.create(mesh.points, mesh.blocks, cell_groups=groups, space_dim=2)
    thickness = {"left": 1.0, "right": 3.0, "body1": UP}
    moved = [Displacement(group="bottom", ux=0.0, uy=0.0), Displacement(group="top", ux=0.0, uy=-0.01)]
    case = pressed(thickness=thickness, displacement=moved, pressure=(), contact=Contact(slave="under", master="over"))
    solution = ls.solve(case, made)
    (zone,) = solution.contact.values()
    np.testing.assert_allclose(sorted(zone.area), [0.5, 1.5], rtol=1e-12)
    assert max(solution.figures.balance) < 1e-12
    total = -(zone.pressure * zone.area).sum()
    assert solution.figures.reactions["top"][1] == pytest.approx(total, rel=1e-9)


def test_loads_and_mass_have_the_thickness_of_their_cells():
    """Weight is rho V; a total force is spread by area, and an edge between two thicknesses has none."""
    case = pressed(pressure=(), body_force=BodyForce(fy=-2.0), force=Force(group="top", fy=-3.0, total=True))
    solution = ls.solve(case, columns())
    weight = 2.0 * (1 * LOW + 2 * UP)
    assert solution.figures.reactions["bottom"][1] == pytest.approx(weight + 3.0, rel=1e-12)
    assert abs(solution.figures.contact["under"].resultant[1]) == pytest.approx(2.0 * 2 * UP + 3.0, rel=1e-12)
    dense = replace(case, material=Material(young=E, poisson=0.0, density=1.5))
    modes = ls.natural_modes(replace(dense, body_force=(), force=()), columns(), count=1)
    assert modes.mass == pytest.approx(1.5 * (LOW + 2 * UP), rel=1e-12)


def test_the_line_of_a_thickness_that_cells_lack(tmp_path, capsys):
    lacmesh.write(tmp_path / "columns.msh", columns())
    text = (
        'mesh = "columns.msh"\nmodel = "plane_stress"\nthickness = {thick}\n[[material]]\nyoung = 1.0\npoisson = 0.0\n'
    )
    text += '[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\n[[tie]]\nslave = "under"\nmaster = "over"\n'
    for thick, words in (
        ("{ body0 = 1.0 }", "are in none of the groups that have a thickness"),
        ("{ body0 = 1.0, body1 = 2.0, top = 1.0 }", ""),
        ("{ body0 = 1.0, body2 = 2.0 }", "no cell group named 'body2'"),
    ):
        (tmp_path / "case.toml").write_text(text.replace("{thick}", thick))
        assert main(["validate", str(tmp_path / "case.toml")]) == (1 if words else 0)
        err = capsys.readouterr().err
        assert words in err and (not words or "case.toml, line 3: thickness: " in err)


def test_a_table_of_thicknesses_is_read_and_written(tmp_path):
    given = {"body 1": 2.0, "5": 3.0}
    case = pressed(thickness=given, mesh="a.msh")
    case.write(tmp_path / "case.toml")
    assert read_case(tmp_path / "case.toml").thickness == given
    text = (tmp_path / "case.toml").read_text()
    assert 'thickness = { "body 1" = 2.0, 5 = 3.0 }' in text and parse_case(text).thickness == given


def test_a_thickness_from_python_is_checked():
    assert not validate(pressed(), columns()).problems
    with pytest.raises(CaseError, match=r"thickness: cells .* are in none of the groups"):
        ls.solve(pressed(thickness={"body0": 1.0}), columns())
