"""Errors and rates that are known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from verification.exact.sources import compiled
from verification.measures.norms import displacement_error, nodal_pressure_error, pressure_errors
from verification.measures.rates import fitted, pairwise
from verification.meshes.blocks import BLOCK_TYPES, block

TEXTS = {2: ("x + 2 * y", "1 - x"), 3: ("x + 2 * y", "1 - x + z", "z - 3 * y")}


@pytest.mark.parametrize("kind", BLOCK_TYPES)
def test_a_field_that_the_cells_hold_has_no_error_and_no_field_has_all_of_it(kind):
    dim = CELLS[kind].dim
    mesh, exact = block(kind, 2, (0,) * dim, (1,) * dim), compiled(TEXTS[dim])
    u = exact(mesh.points[:, :dim])
    assert displacement_error(mesh, u, exact) < 1e-14
    assert displacement_error(mesh, 0 * u, exact) == pytest.approx(1, rel=1e-14)
    assert displacement_error(mesh, 1.25 * u, exact) == pytest.approx(0.25, rel=1e-13)


@pytest.mark.parametrize("kind", BLOCK_TYPES)
def test_interpolation_converges_as_approximation_theory_says(kind):
    """u = exp, at nodes: order + 1. Also says that a block halves its cells."""
    dim, order = CELLS[kind].dim, CELLS[kind].order
    exact = compiled(["exp(x - y)", *["0"] * (dim - 1)])
    counts = (3, 6) if dim == 3 else (8, 16)
    errors = []
    for n in counts:
        mesh = block(kind, n, (0,) * dim, (1,) * dim)
        errors.append(displacement_error(mesh, exact(mesh.points[:, :dim]), exact))
    assert pairwise([2, 1], errors)[0] == pytest.approx(order + 1, abs=0.06)


@pytest.mark.parametrize("kind", [k for k in BLOCK_TYPES if CELLS[k].dim == 2])
def test_the_mean_of_a_linear_pressure_is_off_by_its_slope(kind):
    """p = x on [0, 1], constant on n macro-elements: the variance of a piece is 1 / (12 n^2), the whole is 1 / 3."""
    n = 6
    cut = lacmesh.cut_skin(block(kind, n, (0, 0), (1, 1)), ["y0"]).mesh
    macro, p = cut.cell_data["lac_macro"], np.zeros(n)
    for _, chosen, nodes in cut.select(np.flatnonzero(macro >= 0)):
        p[macro[chosen]] = (np.floor(n * cut.points[nodes].mean(axis=1)[:, 0]) + 0.5) / n
    errors = pressure_errors(cut, p, compiled(["x"]))
    assert errors.mean < 1e-14
    assert errors.exact == pytest.approx(0.5 / n, rel=1e-13)
    assert pressure_errors(cut, p + 0.1, compiled(["x"])).mean == pytest.approx(0.1 * np.sqrt(3), rel=1e-13)


@pytest.mark.parametrize("kind", ["TRIA6", "QUAD4", "TETRA10", "HEXA8"])
def test_a_nodal_pressure_that_the_faces_hold_has_no_error(kind):
    """p = 1 + x at the nodes, and 1.5 times that on half of the faces alone."""
    dim = CELLS[kind].dim
    cut = lacmesh.cut_skin(block(kind, 4, (0,) * dim, (1,) * dim), [f"{'xyz'[dim - 1]}0"]).mesh
    p, exact = 1 + cut.points[:, 0], compiled(["1 + x"])
    assert nodal_pressure_error(cut, p, exact) < 1e-14
    faces = np.flatnonzero(cut.cell_data["lac_macro"] >= 0)
    left = np.concatenate([
        chosen[(cut.points[nodes, 0] < 0.5 + 1e-9).all(axis=1)] for _, chosen, nodes in cut.select(faces)
    ])  # fmt: skip
    p[cut.points[:, 0] > 0.5 + 1e-9] *= 1.5
    assert nodal_pressure_error(cut, p, exact, faces=np.sort(left)) < 1e-14
    assert nodal_pressure_error(cut, p, exact) > 0.2


def test_rates_of_a_power_are_its_exponent():
    h = np.array([1, 0.5, 0.25, 0.125])
    assert pairwise(h, 3 * h**1.7) == pytest.approx([1.7] * 3)
    assert fitted(h, 3 * h**1.7) == pytest.approx(1.7)
    coarse = np.array([100, 1, 1, 1]) * h**2
    assert fitted(h, coarse, 3) == pytest.approx(2)
    assert fitted(h, coarse) > 3


def test_one_level_has_no_rate():
    with pytest.raises(ValueError, match="two levels or more, not 1"):
        fitted([1.0], [0.5])
