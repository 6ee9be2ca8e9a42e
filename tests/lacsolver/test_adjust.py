"""`[[contact]] adjust`: slave nodes go onto the master before the solution, without strain."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.reference.shapes import shape
from lacmesh.surface import Surface
from lacmesh.surface.closest import closest_points
from lacsolver.case import CaseError, parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output
from lacsolver.problem.adjust import adjusted
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import prepared
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.contact_cases import HEAD, JOINT, held
from tests.lacsolver.patch_meshes import placed, stack, three_blocks
from tests.samples import each_option
from verification.meshes import blocks, rings
from verification.meshes.stacks import block as grid

#: kinds of the slave and the master, and the variant of the cut
KINDS = [
    ("HEXA8", "TETRA4", "pyramid"),
    ("HEXA8", "HEXA8", "hexa"),
    ("TETRA4", "PENTA6 quadrangle", "pyramid"),
    ("TETRA10", "HEXA8", "pyramid"),
    ("HEXA20", "TETRA10", "pyramid"),
    ("HEXA20", "HEXA8", "hexa"),
    ("HEXA27", "HEXA20", "pyramid"),
    ("PENTA15 triangle", "HEXA8", "pyramid"),
    ("PYRAM13 quadrangle", "HEXA8", "pyramid"),
    ("QUAD4", "QUAD8", "pyramid"),
    ("QUAD4", "TRIA3", "hexa"),
    ("QUAD8", "TRIA3", "pyramid"),
    ("TRIA6", "QUAD9", "pyramid"),
]
ELASTIC = "[[material]]\nyoung = 1e3\npoisson = 0.3\n"


def nodes_in(mesh, group):
    """The nodes of a group of cells."""
    return np.unique(np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cells_of(group))]))


def wavy(mesh, group="slave", depth=0.02, up=-1.0):
    """The mesh with a group's nodes moved against its normal by a wave of up to `depth`, mid-nodes inside halfway."""
    x, axis = mesh.points.copy(), mesh.space_dim - 1
    nodes = nodes_in(mesh, group)
    x[nodes, axis] += 0.5 * up * depth * (1 + np.cos(7 * x[nodes, 0] + (3 * x[nodes, 1] if axis == 2 else 0.0)))
    shift = x - mesh.points
    for block in mesh.blocks:
        for k, corners in enumerate(CELLS[block.type].corners_of_node):
            own = np.setdiff1d(block.nodes[:, k], nodes)
            rows = np.isin(block.nodes[:, k], own)
            x[block.nodes[rows, k]] = mesh.points[block.nodes[rows, k]]
            x[block.nodes[rows, k]] += shift[block.nodes[rows][:, list(corners)]].mean(axis=1)
    return replace(mesh, points=x)


def pressed(dim, contact, kinematics="small", value=10.0):
    """A stack on rollers under a pressure."""
    up = "xyz"[dim - 1]
    text = HEAD.format(model="3d" if dim == 3 else "plane_strain")
    law = '[[material]]\nlaw = "neo_hookean"\nyoung = 1e3\npoisson = 0.3\n' if kinematics == "finite" else ELASTIC
    text = text.replace("[solver]", f'kinematics = "{kinematics}"\n[solver]') + law + contact
    sides = "".join(held(f"{a}0", **{f"u{a}": 0.0}) for a in "xyz"[: dim - 1])
    return text + sides + held("bottom", **{f"u{up}": 0.0}) + f'[[pressure]]\ngroup = "top"\nvalue = {value}\n'


@pytest.mark.parametrize(
    ("slave", "master", "hexa"), each_option(KINDS, of=lambda row: [CELLS[row[0].split()[0]].family, row[2]])
)
def test_a_wavy_gap_is_closed_exactly(slave, master, hexa):
    """Patch test: after the adjustment the bodies meet in a plane, and the pressure is that of the load everywhere."""
    dim = 3 if slave[:4] in ("HEXA", "TETR", "PENT", "PYRA") else 2
    case = parse_case(pressed(dim, f'{JOINT}adjust = 0.021\nhexa = "{hexa}"\n'))
    mesh = stack(slave, master, dim)
    problem = Problem.of(case, wavy(mesh))
    (state,) = march(problem)
    np.testing.assert_allclose(state.zones[0].pressure, 10.0, rtol=1e-10)
    np.testing.assert_allclose(state.zones[0].gap, 0.0, atol=1e-14)
    flat = Problem.of(case, mesh).space.mesh.points
    np.testing.assert_allclose(problem.space.mesh.points[:, -1 if dim == 3 else 1].max(), flat.max(), atol=1e-12)
    if slave in ("HEXA8", "TETRA4", "HEXA27") and hexa == "pyramid":  # no nodes inside cells: as if it was never wavy
        np.testing.assert_allclose(problem.space.mesh.points, flat, atol=1e-12)


@pytest.mark.parametrize(("slave", "ways"), [("HEXA8", (-1.0, 1.0)), ("TETRA10", (1.0,))])
def test_finite_kinematics_start_unstrained(slave, ways):
    """Columns under large strain, that overlapped or were apart, are those of a mesh that is flat from the start."""
    mesh = stack(slave, "HEXA8", 3, counts=(2, 1))
    case = parse_case(pressed(3, f"{JOINT}adjust = 0.021\n", "finite", 300.0) + "[steps]\ncount = 3\n")
    *_, flat = march(Problem.of(case, mesh))
    for up in ways:
        *_, state = march(Problem.of(case, wavy(mesh, up=up)))
        np.testing.assert_allclose(state.zones[0].pressure, flat.zones[0].pressure, rtol=1e-9)
        assert np.abs(state.u).max() > 0.2


def test_figures_are_told(tmp_path, capsys):
    """`validate` and results.json say how many nodes were moved, and how far."""
    from lacsolver.cli.summary import print_summary

    mesh, case = wavy(stack("HEXA8", "HEXA8", 3)), parse_case(pressed(3, f"{JOINT}adjust = 0.021\n"))
    nodes = nodes_in(mesh, "slave")
    ways = 1 - mesh.points[nodes, 2]
    (zone,) = validate(case, mesh).zones
    assert zone.adjusted is not None
    assert zone.adjusted.count == np.count_nonzero(ways > 1e-12)
    np.testing.assert_allclose(zone.adjusted[1:], [ways.max(), ways[ways > 1e-12].mean()], rtol=1e-9)
    np.testing.assert_allclose(zone.gap, 0.0, atol=1e-13)
    results = run(case, create_output(tmp_path / "out"), mesh=mesh)
    written = json.loads((tmp_path / "out" / "results.json").read_text())["contact"]["slave"]["adjusted"]
    assert written == zone.adjusted._asdict()
    print_summary(results, tmp_path, "vtu")
    assert "slave nodes adjusted" in capsys.readouterr().out


@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize("slave", ["HEXA8", "HEXA20", "TETRA10"])
def test_a_mesh_that_was_cut_before(slave, hexa):
    """The nodes that the cut has made follow: the same mesh, whether the cut is in the file or made for the run."""
    case = parse_case(pressed(3, f'{JOINT}adjust = 0.021\nhexa = "{hexa}"\n'))
    mesh = wavy(stack(slave, "HEXA8", 3))
    cut = lacmesh.cut_skin(mesh, "slave", hexa=hexa).mesh
    here, there = (Problem.of(case, one).space.mesh.points for one in (mesh, cut))
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-14)


def test_only_nodes_within_the_distance_are_moved():
    mesh = wavy(stack("HEXA8", "HEXA8", 3))
    case = parse_case(pressed(3, f"{JOINT}adjust = 0.008\n"))
    cut = prepared(case, mesh)
    after, figures = adjusted(case, cut)
    old = mesh.points[:, 2]
    slave = nodes_in(mesh, "slave")
    near = slave[1 - old[slave] <= 0.008]
    far = np.setdiff1d(slave, near)
    assert len(near) and len(far)
    np.testing.assert_allclose(after.points[near, 2], 1.0, atol=1e-14)
    np.testing.assert_array_equal(after.points[far], mesh.points[far])
    assert figures["slave"].largest <= 0.008


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_units_and_place_do_not_count(size):
    """A mesh in other units, turned and far away, is adjusted alike."""
    a = 0.7
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    mesh = wavy(stack("HEXA20", "TETRA4", 3))
    one = parse_case(pressed(3, f"{JOINT}adjust = 0.012\n"))
    other = parse_case(pressed(3, f"{JOINT}adjust = {0.012 * size!r}\n"))
    shift = 100 * size * np.array([1.0, 1.0, -1.0])
    moved, _ = adjusted(one, prepared(one, mesh))
    again, _ = adjusted(other, prepared(other, placed(mesh, turn, size, shift)))
    expected = size * moved.points @ turn.T + shift
    np.testing.assert_allclose(again.points / size, expected / size, atol=1e-11)


def test_several_zones_one_after_the_other():
    """A middle body is slave of one contact and master of the next."""
    mesh = wavy(wavy(three_blocks(), "slave1", up=1.0), "slave2", up=1.0)
    contacts = "".join(f'[[contact]]\nslave = "slave{k}"\nmaster = "master{k}"\nadjust = 0.021\n' for k in (1, 2))
    problem = Problem.of(parse_case(pressed(3, contacts)), mesh)
    (state,) = march(problem)
    for zone in state.zones:
        np.testing.assert_allclose(zone.pressure, 10.0, rtol=1e-10)
    assert set(problem.adjusted) == {"slave1", "slave2"}


@pytest.mark.parametrize("before", [0.99, 1.01])
@pytest.mark.parametrize(("kind", "surface"), [("QUAD4", "smooth"), ("QUAD4", "faces"), ("QUAD8", "smooth")])
def test_a_shaft_in_a_hole(kind, surface, before):
    """A shaft that is too small, or too large, fills its hole: its nodes go onto the circle, or onto the faces."""
    mesh = rings.pair(rings.ring(kind, (2, 6), (0.5, before)), rings.ring(kind, (2, 7), (1.0, 2.0)))
    text = HEAD.format(model="plane_strain") + ELASTIC + f'{JOINT}adjust = 0.02\nsurface = "{surface}"\n'
    text += held("x0", ux=0.0) + held("y0", uy=0.0) + '[[pressure]]\ngroup = "inner"\nvalue = 1.0\n'
    problem = Problem.of(parse_case(text), mesh)
    radius = np.linalg.norm(problem.space.mesh.points[nodes_in(mesh, "slave")], axis=1)
    if surface == "faces":  # between the circle and the middles of seven chords
        assert radius.min() > np.cos(np.pi / 28) - 1e-12
        assert radius.min() < 1 - 1e-3
        assert radius.max() < 1 + 2e-4  # what overhangs the first face goes onto its plane
    else:
        np.testing.assert_allclose(radius, 1.0, atol=2e-5)
    pair = problem.joints[0]
    gap = pair.integrate(problem.space, np.zeros(problem.space.n_dof), 0.0).gap
    # two unlike polygons are apart by their sagittas, of up to 9e-3; smooth ones by a fraction of h^4
    np.testing.assert_allclose(gap, 0.0, atol=9e-3 if surface == "faces" else 3e-5)
    if surface == "smooth":
        x = problem.space.mesh.points
        for group, axis in (("x0", 0), ("y0", 1)):  # planes of symmetry stay planes
            assert np.abs(x[nodes_in(mesh, group), axis]).max() < 1e-5
        (state,) = march(problem)
        assert state.zones[0].pressure.min() > 0


def test_what_overhangs_is_moved_along_the_normal():
    """A slave that is wider than its master: what is beside the master keeps its place along it."""
    mesh = stack("HEXA8", "HEXA8", 3, counts=(4, 2))
    x = mesh.points.copy()
    upper = nodes_in(mesh, "upper")
    x[upper, :2] = 0.25 + 0.5 * x[upper, :2]
    x[upper, 2] += 0.01
    case, mesh = parse_case(pressed(3, f"{JOINT}adjust = 0.3\n")), replace(mesh, points=x)
    after, _ = adjusted(case, prepared(case, mesh))
    slave = nodes_in(mesh, "slave")
    np.testing.assert_allclose(after.points[slave, :2], x[slave, :2], atol=1e-15)
    beside = np.linalg.norm(np.maximum(np.abs(x[slave, :2] - 0.5) - 0.25, 0.0), axis=1)
    near = np.hypot(beside, 0.01) <= 0.3
    assert 0 < near.sum() < len(near)
    np.testing.assert_allclose(after.points[slave, 2], np.where(near, 1.01, 1.0), atol=1e-14)


def test_cells_that_would_turn_over_are_named():
    """The first layer of the slave is a tenth thick, and its face is to go down by two tenths."""
    mesh = stack("HEXA8", "HEXA8", 3)
    x = mesh.points.copy()
    layer = np.abs(x[:, 2] - np.unique(x[:, 2])[1]) < 1e-9
    x[layer, 2] = 0.9
    upper = nodes_in(mesh, "upper")
    x[upper, 2] -= 0.2
    case = parse_case(pressed(3, f"{JOINT}adjust = 0.3\n"))
    with pytest.raises(CaseError, match=r"adjust is 0.3, by which cells .* would be turned over: .* moves by 0\.2"):
        Problem.of(case, replace(mesh, points=x))


@pytest.mark.parametrize("tilt", [0.0, 20.0])
def test_a_block_in_a_corner(tilt):
    """Two contacts share the nodes of an edge: with a wall upright on the floor both are met, with another not."""
    cube = grid("HEXA8", (2, 2, 2))
    a = np.radians(tilt)
    turn = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
    wall = placed(cube, turn, (0.5, 3.0, 3.0), (-0.2 if tilt else -0.51, -1.0, -1.0))
    floor = placed(cube, None, (3.0, 3.0, 0.5), (-1.0, -1.0, -0.51))
    mesh = blocks.joined([
        (cube, {"x0": "side", "z0": "foot", "z1": "top"}),
        (wall, {"x1": "wall", "x0": "held"}),
        (floor, {"z1": "floor", "z0": "bottom"}),
    ])  # fmt: skip
    contacts = '[[contact]]\nslave = "foot"\nmaster = "floor"\nadjust = 0.02\n'
    contacts += f'[[contact]]\nslave = "side"\nmaster = "wall"\nadjust = {0.1 if tilt else 0.02}\n'
    case = parse_case(HEAD.format(model="3d") + ELASTIC + contacts + held("bottom", ux=0.0, uy=0.0, uz=0.0))
    if tilt:
        with pytest.raises(CaseError, match="adjust moves nodes off the master of 'foot' again, as near"):
            adjusted(case, prepared(case, mesh))
        return
    after, _ = adjusted(case, prepared(case, mesh))
    np.testing.assert_allclose(after.points[nodes_in(mesh, "foot"), 2], -0.01, atol=1e-14)
    np.testing.assert_allclose(after.points[nodes_in(mesh, "side"), 0], -0.01, atol=1e-14)


@pytest.mark.parametrize("kind", ["TRIA3", "QUAD4", "TRIA6", "QUAD8", "QUAD9"])
def test_closest_points_against_a_search(kind):
    """Closest points of a curved skin are those of a fine sampling of its faces, refined."""
    rng = np.random.default_rng(1)
    solid = {"TRIA3": "TETRA4", "QUAD4": "HEXA8", "TRIA6": "TETRA10", "QUAD8": "HEXA20", "QUAD9": "HEXA27"}[kind]
    mesh = grid(solid, (2, 2, 2))
    x = mesh.points.copy()
    x[:, 2] += 0.2 * np.sin(2 * x[:, 0] + x[:, 1]) - 0.1 * x[:, 1] ** 2
    mesh = replace(mesh, points=x)
    skin = Surface.of(mesh, mesh.cells_of("z1"))
    points = np.column_stack([rng.uniform(0.1, 0.9, (60, 2)), np.zeros(60)])
    points[:, 2] = (
        1 + 0.2 * np.sin(2 * points[:, 0] + points[:, 1]) - 0.1 * points[:, 1] ** 2 + rng.uniform(-0.1, 0.1, 60)
    )
    closest = closest_points(skin, points, np.tile([0.0, 0.0, -1.0], (60, 1)), 0.5)
    u, v = (c.ravel() for c in np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401)))
    square = np.column_stack([u, v]) if kind[0] == "T" else np.column_stack([2 * u - 1, 2 * v - 1])
    square = square[u + v <= 1] if kind[0] == "T" else square
    samples = np.concatenate(
        [np.einsum("pn,fns->fps", shape(kind, square), skin.x[nodes]).reshape(-1, 3) for _, _, nodes in skin.by_type()]
    )
    nearest = cKDTree(samples).query(points)[0]
    assert (closest.distance <= nearest + 1e-12).all()
    assert (nearest**2 - closest.distance**2).max() < 2 / 800**2  # samples are 1 / 800 apart
    np.testing.assert_allclose(np.linalg.norm(closest.way, axis=1), closest.distance, rtol=1e-12)


def test_adjust_is_a_length():
    """Nodes that overlap alone are moved with 0, as with ADJUST=0.0 of decks."""
    with pytest.raises(CaseError, match="adjust"):
        parse_case(pressed(3, f"{JOINT}adjust = -1.0\n"))
    assert parse_case(pressed(3, f"{JOINT}adjust = 0\n")).contact[0].adjust == 0
