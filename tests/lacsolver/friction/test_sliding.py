"""Friction of skins that move: a block pulled over another, with exact tangents, and sticking without drift."""

from __future__ import annotations

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import Mesh
from lacsolver.case import Case, Contact, Displacement, Dynamics, Gravity, Initial, Material, Pressure, Steps
from verification.meshes.blocks import block, joined
from verification.meshes.stacks import stack

MU = 0.3


def rectangle(x, y, nx, ny):
    """Points, cells, and the sides below and above of a rectangle of QUAD4."""
    grid = np.meshgrid(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1))
    points = np.stack([*(values.ravel() for values in grid), np.zeros((nx + 1) * (ny + 1))], axis=1)
    node = np.arange(len(points)).reshape(ny + 1, nx + 1)
    cells = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    return points, cells, np.stack([node[0, :-1], node[0, 1:]], 1), np.stack([node[-1, 1:], node[-1, :-1]], 1)


def block_on_block(lower, upper):
    """Two rectangles, each given by x, y, and its numbers of cells; sides `bottom`, `below`, `above`, `top`."""
    parts = [rectangle(*lower), rectangle(*upper)]
    offset = [0, len(parts[0][0])]
    quads = np.concatenate([cells + k for (_, cells, _, _), k in zip(parts, offset, strict=True)])
    sides = [side + k for part, k in zip(parts, offset, strict=True) for side in part[2:]]
    ends = len(quads) + np.cumsum([0, *map(len, sides)])
    names = ("bottom", "below", "above", "top")
    groups = {name: np.arange(a, b) for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}
    groups["lower"] = np.arange(len(parts[0][1]))
    groups["upper"] = np.arange(len(parts[0][1]), len(quads))
    blocks = [("QUAD4", quads), ("SEG2", np.concatenate(sides))]
    return Mesh.create(np.concatenate([p[0] for p in parts]), blocks, cell_groups=groups, space_dim=2)


@pytest.mark.parametrize(("slave", "master"), [("above", "below"), ("below", "above")])
def test_a_block_is_pulled_over_another(slave, master):
    """1.2 of its length in 4 steps, either role: no step is halved, T = mu N to round-off, and the end is quadratic."""
    mesh = block_on_block(((0, 4), (0, 1), 19, 4), ((0.4, 1.4), (1, 2), 8, 8))
    case = Case(
        model="plane_strain", kinematics="finite", material=[Material(law="neo_hookean", young=1000.0, poisson=0.3)],
        contact=[Contact(name="joint", slave=slave, master=master, friction=MU)],
        displacement=[
            Displacement(group="bottom", ux=0, uy=0),
            Displacement(group="top", ux=[[1, 0], [2, 1.2]], uy=[[0, 0], [1, -0.02]]),
        ],
        steps=Steps(times=[1.0, 1.25, 1.5, 1.75, 2.0]),
    )  # fmt: skip
    for solution in ls.march(case, mesh):
        state, zone = solution._own("its residuals")[1], solution.contact["joint"]
        assert state.halvings == 0 and state.iterations <= 8
        if solution.time > 1:
            w = zone.area * zone.coverage
            assert (zone.status[zone.coverage > 0] != 1).all()
            assert abs(zone.shear[:, 0] @ w) == pytest.approx(MU * (zone.pressure @ w), rel=1e-10)
            first, second, last = np.log10(state.residuals[-3:])
            assert last < max(1.5 * second, -9.0) and second < first
    assert sum(zone.path > 1) > 3 or slave == "below"


@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_sticking_does_not_drift(geometry):
    """Three cycles of shear, all sticking: tractions come back to round-off."""
    mesh = block_on_block(((0, 2), (0, 1), 6, 3), ((0.4, 1.4), (1, 2), 5, 4))
    times = np.arange(13) / 4 + 1
    shear = [[0, 0], [1, 0], *([float(t), 1e-3 * float(np.sin(np.pi / 2 * k))] for k, t in enumerate(times) if k)]
    case = Case(
        model="plane_strain", kinematics="finite" if geometry == "current" else "small",
        material=[Material(law="neo_hookean" if geometry == "current" else "elastic", young=1000.0, poisson=0.3)],
        contact=[Contact(name="joint", slave="above", master="below", friction=1.5, geometry=geometry)],
        displacement=[
            Displacement(group="bottom", ux=0, uy=0),
            Displacement(group="top", ux=shear, uy=[[0, 0], [1, -0.02]]),
        ],
        steps=Steps(times=times.tolist()), solver=ls.Solver(tolerance=1e-12),
    )  # fmt: skip
    solutions = list(ls.march(case, mesh))
    first, last = (solutions[k].contact["joint"] for k in (0, -1))
    assert (last.status == 1).all() and np.abs(solutions[1].contact["joint"].shear - first.shear).max() > 0.1
    np.testing.assert_allclose(last.shear, first.shear, atol=1e-9)
    np.testing.assert_allclose(last.pressure, first.pressure, atol=1e-9)


def test_a_thrown_block_stops():
    """It slides v^2 / (2 mu g), then sticks, and friction takes its energy."""
    speed, g = 2.0, 10.0
    mesh = block_on_block(((0, 4), (0, 0.25), 16, 1), ((0.4, 1.4), (0.25, 0.75), 6, 3))
    case = Case(
        model="plane_strain", material=[Material(young=1e5, poisson=0.0, density=1.0)],
        contact=[Contact(name="joint", slave="above", master="below", friction=MU)],
        displacement=[Displacement(group="bottom", ux=0, uy=0)], gravity=Gravity(gy=-g),
        initial=[Initial(groups=["upper"], vx=speed)], dynamics=Dynamics(scheme="hht"), steps=Steps(end=1.0, count=100),
    )  # fmt: skip
    *_, last = ls.march(case, mesh)
    zone = last.contact["joint"]
    top = last.mesh.points[:, 1] > 0.74
    assert last.u[top, 0].mean() == pytest.approx(speed**2 / (2 * MU * g), rel=0.005)
    assert (zone.status == 1).all() and zone.friction.energy[1] == pytest.approx(0.5 * 0.5 * speed**2, rel=0.02)


@pytest.mark.parametrize(
    ("cell", "poisson", "geometry"),
    [("TETRA4", 0.3, "current"), ("TETRA4", 0.0, "current"), ("HEXA8", 0.3, "reference")],
)
def test_a_block_held_by_friction_alone_stays_where_it_is_without_a_load(cell, poisson, geometry, recwarn):
    """All sticks, so that nothing is lost: pressed again it is as before, without a warning of small displacements."""
    load = [[0, 0], [1, 6.8], [2, 0], [3, 6.8]]
    case = Case(
        model="3d", material=[Material(young=1000.0, poisson=poisson)],
        contact=[Contact(slave="slave", master="master", friction=0.5, geometry=geometry)],
        displacement=[Displacement(group="bottom", ux=0, uy=0, uz=0)],
        pressure=[Pressure(group="top", value=load)], steps=Steps(times=[1.0, 2.0, 3.0], max_halvings=0),
    )  # fmt: skip
    first, unloaded, last = (
        s._own("its displacements")[1] for s in ls.march(case, stack(cell, cell, 3, counts=(2, 1)))
    )
    size = np.abs(first.u).max()
    assert (last.zones[0].status == 1).all()
    np.testing.assert_allclose(unloaded.u, 0, atol=1e-9 * size)
    np.testing.assert_allclose(last.u, first.u, atol=1e-6 * size)
    assert not [one for one in recwarn if "nothing moves" in str(one.message)]


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_block_that_slips_as_it_is_pressed_stays_in_the_middle_without_a_load(kinematics):
    """It slides outwards and back by the same on all sides, as the model has two planes of symmetry."""
    plate, upper = ((0, 0, 0), (2, 2, 0.5)), ((0.5, 0.5, 0.5), (1.5, 1.5, 1.5))
    names = {"z0": "base", "z1": "under"}, {"z0": "foot", "z1": "top", "": "block"}
    mesh = joined([(block("HEXA8", (2, 2, 1), *box), own) for box, own in zip((plate, upper), names, strict=True)])
    load = [[0, 0], [1, 6.8], [2, 0], [3, 6.8]]
    case = Case(
        model="3d", kinematics=kinematics,
        material=[Material(law="elastic" if kinematics == "small" else "neo_hookean", young=1000.0, poisson=0.3)],
        contact=[Contact(slave="foot", master="under", friction=0.1)],
        displacement=[Displacement(group="base", ux=0, uy=0, uz=0)],
        pressure=[Pressure(group="top", value=load)], steps=Steps(times=[1.0, 2.0, 3.0]),
    )  # fmt: skip
    for solution in ls.march(case, mesh):
        problem, state = solution._own("its displacements")[:2]
        space = problem.space
        nodes = np.unique(np.concatenate([c.ravel() for *_, c in space.mesh.select(space.mesh.cell_groups["block"])]))
        moved = state.u.reshape(-1, 3)[nodes]
        np.testing.assert_allclose(moved.mean(axis=0)[:2], 0, atol=1e-5 * 6.8e-3)
