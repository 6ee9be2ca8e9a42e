"""Cells that fold between their integration points: which do, the step that is halved for it, and the warning."""

from __future__ import annotations

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.results.folding import _FACTORS, folded, folds
from lacsolver.running import run
from lacsolver.space.space import Space
from tests.lacsolver.mode_cases import block

QUADRATIC = [name for name, cell in CELLS.items() if cell.order == 2 and cell.family in _FACTORS]
BODY = 'mesh = "body.msh"\nmodel = "plane_strain"\nkinematics = "finite"\n'
BODY += '[[material]]\nlaw = "neo_hookean"\nyoung = 1.0\npoisson = 0.3\n'


def single(name, x=None):
    """A cell of a type, as its reference element or with its nodes at x."""
    reference = np.array(CELLS[name].reference) if x is None else x
    mesh = Mesh.create(reference, [(name, [[*range(len(reference))]])])
    return Space.of(mesh, "3d" if CELLS[name].dim == 3 else "plane_strain")


@pytest.mark.parametrize("name", QUADRATIC)
@pytest.mark.parametrize("place, folds_there", [(0.26, False), (0.24, True), (0.74, False), (0.76, True)])
def test_a_mid_side_node_may_be_at_a_quarter_of_its_edge_and_not_farther(name, place, folds_there):
    """Along the edge dx/ds is 4 place - 1 at one end and 3 - 4 place at the other."""
    space, cell = single(name), CELLS[name]
    start, end = np.array(cell.reference)[list(cell.edges[0][:2])]
    u = np.zeros((cell.n_nodes, cell.dim))
    u[cell.n_corners] = (place - 0.5) * (end - start)
    assert len(folds(space, u.ravel())) == folds_there


@pytest.mark.parametrize("to, folds_there", [(0.51, False), (0.49, True)])
def test_a_corner_may_go_to_the_middle_of_its_quadrangle(to, folds_there):
    x = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    u = np.zeros_like(x)
    u[2] = to - 1
    assert len(folds(single("QUAD4", x), u.ravel())) == folds_there


def test_a_cell_may_not_be_wound_around_a_point():
    """By x + i y -> its square, in which J is 4 (x^2 + y^2): not negative anywhere, and 1 at the mid-side nodes."""
    corners = np.exp(2j * np.pi * np.arange(3) / 3)
    z = np.concatenate([corners, (corners + np.roll(corners, -1)) / 2])
    u = z**2 - z
    (row,) = folds(single("TRIA6", np.stack([z.real, z.imag], axis=1)), np.stack([u.real, u.imag], axis=1).ravel())
    assert row[0] == 1


@pytest.mark.parametrize("name", QUADRATIC)
def test_a_cell_that_is_turned_and_squeezed_is_not_folded(name):
    space, turn = single(name), np.array([[0.0, -1.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.0, 1.0]])
    x = space.mesh.points
    assert not len(folds(space, (x @ turn.T - x)[:, : space.dim].ravel()))


def test_a_cell_that_is_collapsed_undeformed_is_left_out():
    """A quadrangle with two nodes at one place, as around the tip of a crack."""
    x = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [0.5, 0], [1, 0.5], [0.5, 0.5], [0, 0]])
    assert not len(folds(single("QUAD8", x), (0.1 * x**2).ravel()))


@pytest.mark.parametrize("theta", (2.5, 3.1))
def test_a_body_that_is_turned_at_once_is_not_folded(theta):
    """By 2.5 in two steps a corner changed places with its mid-side node, by 3.1 a cell was wound around a point."""
    steps = f'[[coupling]]\ngroup = "y1"\nat = [0.8, 1.9]\nrotation = {theta}\nux = 0.5\nuy = 0.5\n'
    problem = Problem.of(parse_case(BODY + steps), block("TRIA6", 2))
    *_, last = march(problem)
    arm = problem.space.mesh.points[:, :2] - (0.8, 1.9)
    c, s = np.cos(theta), np.sin(theta)
    wanted = arm @ np.array([[c, s], [-s, c]]) - arm + 0.5
    np.testing.assert_allclose(last.u.reshape(-1, 2), wanted, atol=1e-11)
    assert not last.folded


def test_a_cell_that_must_fold_is_warned_of(tmp_path):
    """A mid-side node is taken along its edge by 0.3, and is at a quarter of it at t = 0.83. Steps become an eighth."""
    mesh = block("QUAD8", 1)
    held = "".join(
        f"[[displacement]]\nat = {at}\nux = 0.0\nuy = 0.0\n" for at in ("[0, 0]", "[1, 0]", "[0, 1]", "[1, 1]")
    )
    case = parse_case(f"{BODY}{held}[[displacement]]\nat = [0.5, 0]\nux = -0.3\nuy = 0.0\n")
    lacmesh.write(tmp_path / "body.msh", mesh)
    with pytest.warns(LacmeshWarning, match="folded") as caught:
        done = run(case, create_output(tmp_path / "out"), mesh=mesh)
    assert [step.time for step in done.steps] == [0.5, 0.75, 0.875, 1.0]
    (said,) = [str(w.message) for w in caught]
    assert said == done.message
    assert said.startswith("cell 1 near (0.5, 0.5) folded at time 0.875: ")


def test_small_kinematics_do_not_fold():
    case = parse_case(
        BODY.replace("finite", "small").replace("neo_hookean", "elastic")
        + '[[displacement]]\ngroup = "y0"\nux = 0.0\nuy = 0.0\n'
    )
    problem = Problem.of(case, block("QUAD8", 1))
    assert folded(problem, np.full(problem.space.n_dof, 9.0), 1.0) == ""
