"""Rigid masters: a bare skin that is moved, or loaded, against a block."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lacmesh import Mesh, raise_order
from lacmesh.generate.parts import raised
from lacsolver.results.state import CONTACT, OPEN
from tests.lacsolver.bodies import square
from tests.lacsolver.contact_cases import JOINT, POISSON, SLIDING, YOUNG, held, only, resultant, stresses
from tests.lacsolver.patch_meshes import block, joined, stack
from tests.samples import each_option

GROUND = held("bottom", uz=0.0)
FACES = ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9")


def plate(face, n=2, wide=1.2):
    """A bare skin in the plane z = 1 or the line y = 1, a little larger than the block, that faces down."""
    if face in ("SEG2", "SEG3"):
        x = np.linspace(-0.1, 1.1, n + 1)
        line = Mesh.create(
            np.column_stack([x, 1 + 0 * x]), [("SEG2", np.column_stack([np.arange(n), np.arange(1, n + 1)]))]
        )
        made = line if face == "SEG2" else raise_order(line, "2")
        return Mesh.create(made.points, made.blocks, cell_groups={"plate": np.arange(n)}, space_dim=2)
    flat = raised(square("QUAD4" if face[0] == "Q" else "TRIA3", n), face)
    x = (flat.points - [1, 0, 0]) * wide - (wide - 1) / 2
    points = np.column_stack([x[:, 1], x[:, 0], np.ones(len(x))])  # mirrored, so that it faces down
    return Mesh.create(points, flat.blocks, cell_groups={"plate": np.arange(flat.n_cells)}, space_dim=3)


def under_a_plate(kind, face):
    """A block of height 1, its top the slave, under a plate."""
    dim = 2 if face.startswith("SEG") else 3
    up = "xyz"[dim - 1]
    names = {a: a for a in ("x0", "y0")[: dim - 1]} | {f"{up}0": "bottom", f"{up}1": "slave"}
    return joined(
        [(block(kind, dim, 3, f"{up}1"), np.zeros(3), names), (plate(face), np.zeros(3), {"plate": "master"})]
    )


def rigid(**values):
    """[[rigid]] of the plate, its centre over the middle of the block."""
    lines = "".join(f"{k} = {v!r}\n" for k, v in {"centre": [0.5, 0.5, 1.0], **values}.items())
    return f'[[rigid]]\ngroup = "master"\n{lines}'


@pytest.mark.parametrize(("kind", "face"), each_option(itertools.product(("HEXA8", "TETRA10", "HEXA27"), FACES)))
def test_a_plate_that_is_moved_presses_evenly(kind, face):
    problem, state = only(under_a_plate(kind, face), JOINT + SLIDING + GROUND + rigid(uz=-0.01))
    (zone,) = state.zones
    np.testing.assert_allclose(zone.pressure, 0.01 * YOUNG, rtol=1e-10)
    np.testing.assert_allclose(stresses(problem, state)[:, 2], -0.01 * YOUNG, rtol=1e-10)
    assert resultant(zone, problem)[2] == pytest.approx(-0.01 * YOUNG, rel=1e-10)
    np.testing.assert_allclose(state.rigid["master"], [0, 0, -0.01, 0, 0, 0], atol=1e-16)


@pytest.mark.parametrize("face", FACES)
def test_a_plate_that_is_loaded_presses_evenly(face):
    """Its height is found: only contact holds it."""
    problem, state = only(under_a_plate("HEXA8", face), JOINT + SLIDING + GROUND + rigid(fz=-7.0))
    (zone,) = state.zones
    np.testing.assert_allclose(zone.pressure, 7.0, rtol=1e-9)
    assert resultant(zone, problem)[2] == pytest.approx(-7.0, rel=1e-10)
    np.testing.assert_allclose(state.rigid["master"], [0, 0, -7.0 / YOUNG, 0, 0, 0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("moment", [0.0, 0.1, 0.3])
def test_a_rigid_block_with_a_moment_stands_under_its_load(moment):
    """The resultant of the pressures is off the middle by moment / force; with the largest one an edge lifts.

    Weak springs keep the block from turning about the height.
    """
    springs = '[[spring]]\ngroup = "top"\nkx = 1e-7\nky = 1e-7\n'
    body = f'[[rigid]]\ngroup = "upper"\ncentre = [0.5, 0.5, 1.0]\nfz = -1.0\nmoment = [0.0, {moment}, 0.0]\n'
    ground = held("bottom", ux=0.0, uy=0.0, uz=0.0)
    problem, state = only(stack("HEXA8", "TETRA4", 3, counts=(5, 2)), JOINT + ground + springs + body)
    (zone,) = state.zones
    force = zone.pressure * zone.area
    assert force.sum() == pytest.approx(1.0, rel=1e-9)
    np.testing.assert_allclose(force @ zone.centre[:, :2], [0.5 + moment, 0.5], atol=1e-6)
    assert (zone.status == OPEN).any() == (moment > 0.2)
    turn = state.rigid["upper"][4]
    assert turn > 1e-6 if moment else abs(turn) < 1e-4
    assert resultant(zone, problem)[2] == pytest.approx(-1.0, rel=1e-9)


def test_a_plate_that_is_turned_lifts_on_one_side():
    """Turned about y and pressed: one half is in contact, with the reaction that the pressures add up to."""
    problem, state = only(
        under_a_plate("HEXA20", "TRIA6"), JOINT + SLIDING + GROUND + rigid(uz=-0.001, rotation=[0.0, 0.02, 0.0])
    )
    (zone,) = state.zones
    closed = zone.status == CONTACT
    assert closed.any() and (~closed).any()
    assert zone.centre[closed, 0].min() > zone.centre[~closed, 0].max()
    (body,) = problem.constraints.rigid
    on_plate = state.reaction[problem.space.dofs(body.nodes).ravel()]
    load = body.resultant(on_plate)
    assert load[2] == pytest.approx(-(zone.pressure @ zone.area), rel=1e-10)


@pytest.mark.parametrize("face", ["SEG2", "SEG3"])
@pytest.mark.parametrize("model", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("how", ["moved", "loaded"])
def test_a_line_presses_evenly(face, model, how):
    kind = "QUAD8" if face == "SEG2" else "TRIA3"
    if model == "axisymmetric":
        line, blocks = plate(face), block(kind, 2, 3, "y1")
        points = line.points.copy()
        points[:, 0] = (points[:, 0] + 0.1) / 1.2 * 1.1
        line = Mesh.create(points, line.blocks, cell_groups=line.cell_groups, space_dim=2)
        names = {"x0": "x0", "y0": "bottom", "y1": "slave"}
        mesh = joined([(blocks, np.zeros(3), names), (line, np.zeros(3), {"plate": "master"})])
    else:
        mesh = under_a_plate(kind, face)
    E = YOUNG / (1 - POISSON**2) if model == "plane_strain" else YOUNG
    area = np.pi if model == "axisymmetric" else 1.0
    lines = "uy = -0.01\n" if how == "moved" else f"fy = {-0.01 * E * area!r}\n"
    sections = JOINT + held("x0", ux=0.0) + held("bottom", uy=0.0) + f'[[rigid]]\ngroup = "master"\n{lines}'
    problem, state = only(mesh, sections, model)
    (zone,) = state.zones
    np.testing.assert_allclose(zone.pressure, 0.01 * E, rtol=1e-10)
    np.testing.assert_allclose(stresses(problem, state)[:, 1], -0.01 * E, rtol=1e-10)
    assert state.rigid["master"][1] == pytest.approx(-0.01, rel=1e-9)


@pytest.mark.parametrize("face", ["TRIA3", "QUAD4"])
def test_springs_hold_the_spin_of_a_bare_plate(face):
    """Free to tilt, which contact stops, and to spin about its normal, which springs on its nodes do."""
    springs = '[[spring]]\ngroup = "master"\nkx = 1.0\nky = 1.0\n'
    sections = JOINT + SLIDING + GROUND + rigid(fz=-0.01 * YOUNG, moment=[0.0, 0.0, 0.0]) + springs
    problem, state = only(under_a_plate("HEXA8", face), sections)
    (zone,) = state.zones
    np.testing.assert_allclose(zone.pressure, 0.01 * YOUNG, rtol=1e-9)
    np.testing.assert_allclose(state.rigid["master"], [0, 0, -0.01, 0, 0, 0], atol=1e-11)
    assert resultant(zone, problem)[2] == pytest.approx(-0.01 * YOUNG, rel=1e-9)
