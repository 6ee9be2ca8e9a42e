"""The Hertz family: its meshes, its exact fields, and that rates come out on coarse levels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.samples import each_option
from verification.families.hertz import (
    FAMILY,
    Given,
    bodies,
    case_of,
    displacement_errors,
    exact_approach,
    half_width,
    outcome,
    pressure,
)
from verification.meshes.half_spaces import REACH, edge_lines, half_spaces

MODELS = (("plane_strain", "QUAD8"), ("axisymmetric", "TRIA3"), ("3d", "HEXA8"))


def given(model, cell, *, rigid=False):
    return Given(model, cell, "pyramid", rigid, (2, 4))


@pytest.mark.parametrize("k", [2, 4, 16])
def test_the_edge_lies_at_the_fraction(k):
    lines = edge_lines(k, 0.3)
    edge = np.searchsorted(lines, 1.0) - 1
    assert (1 - lines[edge]) / (lines[edge + 1] - lines[edge]) == pytest.approx(0.3)
    assert lines[-1] == REACH and (np.diff(lines) > 0).all()


@pytest.mark.parametrize(("model", "cell"), MODELS)
@pytest.mark.parametrize("rigid", [False, True])
def test_lines_of_slave_and_master_do_not_match(model, cell, rigid):
    mesh = half_spaces(cell, 4, 0.5, rigid=rigid)
    groups = {"upper", "slave", "master", "far_upper", "axis_x"} | (set() if rigid else {"lower", "far_lower"})
    assert groups <= set(mesh.cell_groups)
    nodes = [np.unique(mesh.points[np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups[g])]), 0])
             for g in ("slave", "master")]  # fmt: skip
    inner = [x[(x > 0.1) & (x < REACH - 0.1)] for x in nodes]
    common = np.isclose(inner[0][:, None], inner[1][None]).any(axis=1)
    assert common.mean() < 0.5


@pytest.mark.parametrize(("model", "cell"), MODELS)
def test_surfaces_meet_inside_the_contact_and_part_beyond(model, cell):
    made = given(model, cell)
    upper, lower = bodies(made).values()
    r = np.linspace(0, 2, 21)
    x = np.column_stack([r, *[np.zeros_like(r)] * (made.dim - 1)])
    gap = r**2 / (2 * made.radius) + (upper.displacement(upper.at(x)) - lower.displacement(lower.at(x)))[:, -1]
    np.testing.assert_allclose(gap[r <= 1], 0, atol=1e-12)
    assert (gap[r > 1.05] > 0).all()
    assert pressure(made, x)[0, 0] == made.p0


@pytest.mark.parametrize(
    ("model", "cell", "rigid"),
    each_option([(*m, r) for m in MODELS for r in (False, True) if m[0] != "3d" or r]),
)
def test_errors_fall_and_forces_balance(model, cell, rigid):
    own = {"model": model, "cell": cell, "rigid": rigid, "hexa": "pyramid"}
    (case,) = (c for c in FAMILY.cases if c.parameters.items() >= own.items())
    coarse = replace(case.solve.args[0], levels=(2, 4) if model == "3d" else case.parameters["levels"])
    made = {r.quantity: r for r in outcome(coarse, case.description, levels=2).results}
    assert made["u, energy norm"].value > 0.8
    assert made["p_m, L2"].value > 0.6
    assert made["error of the recovered pressure over that of p_m"].passed
    assert made["balance of forces"].passed
    assert made["approach of the points at depth a, relative error"].value < 0.03


def test_the_exact_solution_has_no_error():
    """The exact displacement at the nodes is as near as interpolation is, so that the measure is of the solver."""
    from types import SimpleNamespace

    made = given("axisymmetric", "QUAD8")
    found = []
    for k in (4, 8):
        mesh = half_spaces("QUAD8", k, 0.5)
        u = np.zeros((mesh.n_nodes, 2))
        for group, body in bodies(made).items():
            for _, _, nodes in mesh.select(np.sort(mesh.cell_groups[group])):
                own = np.unique(nodes)
                u[own] = body.displacement(body.at(mesh.points[own, :2]))
        found.append(displacement_errors(made, SimpleNamespace(mesh=mesh, u=u)))
    (energy, u), (finer_energy, finer_u) = found
    assert finer_energy < 0.45 * energy < 0.02
    assert finer_u < 0.25 * u < 1e-3


def test_the_half_width_is_that_of_exact_means():
    x = np.linspace(0.01, 0.99, 50)
    assert half_width(np.column_stack([x, 0 * x]), np.sqrt(1 - x**2), 1.0) == pytest.approx(1.0)


def test_the_approach_is_what_is_pressed_in():
    assert 0 < exact_approach(given("3d", "HEXA8")) < 1 / given("3d", "HEXA8").radius


def test_the_case_holds_the_outer_sides():
    groups = [held.group for held in case_of(given("3d", "TETRA4")).displacement]
    assert groups == ["axis_x", "axis_y", "far_upper", "far_lower"]
