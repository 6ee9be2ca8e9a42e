"""Skins that do not meet in the mesh: adjusted, closed as deep as a master is looked for, refused beyond; and meshes
with defects that would silently give a wrong answer.
"""

import itertools
import json
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import lacmesh
import lacsolver as ls
from lacmesh import Mesh, join
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning
from lacmesh.generate import grid as cells_between
from lacmesh.generate import rectangle, ring
from lacmesh.reference.shapes import shape
from lacmesh.surface import Surface
from lacmesh.surface.closest import closest_points
from lacsolver.case import CaseError, Contact, Material, Pressure, Steps
from lacsolver.equilibrium.state import UNPAIRED
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output
from lacsolver.problem.adjust import adjusted
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import prepared
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.patch_meshes import placed, stack, three_blocks
from tests.problem_meshes import nodes_of
from tests.problems import ELASTIC, case_of, contact, fix, move
from tests.samples import each_option
from verification.meshes import blocks, rings
from verification.meshes.stacks import block as grid

HYPERELASTIC = Material(young=1000.0, poisson=0.3, law="neo_hookean")
#: kinds of the slave and the master, and the variant of the cut
KINDS = [
    ("HEXA8", "TETRA4", "pyramid"),
    ("HEXA8", "HEXA8", "hexa"),
    ("TETRA10", "HEXA8", "pyramid"),
    ("HEXA20", "TETRA10", "pyramid"),
    ("HEXA27", "HEXA20", "pyramid"),
    ("PENTA15 triangle", "HEXA8", "pyramid"),
    ("PYRAM13 quadrangle", "HEXA8", "pyramid"),
    ("QUAD4", "QUAD8", "pyramid"),
    ("QUAD4", "TRIA3", "hexa"),
    ("QUAD8", "TRIA3", "pyramid"),
    ("TRIA6", "QUAD9", "pyramid"),
]


def wavy(mesh, group="slave", depth=0.02, up=-1.0):
    """The mesh with a group's nodes moved against its normal by a wave of up to `depth`, mid-nodes inside halfway."""
    x, axis = mesh.points.copy(), mesh.space_dim - 1
    nodes = nodes_of(mesh, group)
    x[nodes, axis] += 0.5 * up * depth * (1 + np.cos(7 * x[nodes, 0] + (3 * x[nodes, 1] if axis == 2 else 0.0)))
    shift = x - mesh.points
    for block in mesh.blocks:
        for k, corners in enumerate(CELLS[block.type].corners_of_node):
            rows = ~np.isin(block.nodes[:, k], nodes)
            inside = mesh.points[block.nodes[rows, k]] + shift[block.nodes[rows][:, list(corners)]].mean(axis=1)
            x[block.nodes[rows, k]] = inside
    return replace(mesh, points=x)


def pressed(mesh, *contacts, kinematics="small", value=10.0, count=1):
    """A stack on rollers under a pressure."""
    dim, material = mesh.space_dim, HYPERELASTIC if kinematics == "finite" else ELASTIC
    rollers = [fix(f"{a}0", a) for a in "xyz"[: dim - 1]] + [fix("bottom", "xyz"[dim - 1])]
    records = material, *contacts, *rollers, Pressure(group="top", value=value), Steps(count=count)
    return case_of(mesh, *records, model="3d" if dim == 3 else "plane_strain", kinematics=kinematics)


def moved(case):
    """The mesh of a case after its adjustment, and figures of that."""
    return adjusted(case, prepared(case, case.mesh))


# ---- nodes that are adjusted


@pytest.mark.rows("HEXA8-TETRA4-pyramid", "QUAD4-TRIA3-hexa")
@pytest.mark.parametrize(
    ("slave", "master", "hexa"), each_option(KINDS, of=lambda row: [CELLS[row[0].split()[0]].family, row[2]])
)
def test_a_wavy_gap_is_closed_exactly(slave, master, hexa):
    """Patch test: after the adjustment the bodies meet in a plane, and the pressure is that of the load everywhere."""
    dim = CELLS[slave.split()[0]].dim
    mesh = stack(slave, master, dim)
    problem, flat = (Problem.of(pressed(one, contact(adjust=0.021, hexa=hexa))) for one in (wavy(mesh), mesh))
    (state,) = march(problem)
    np.testing.assert_allclose(state.zones[0].pressure, 10.0, rtol=1e-10)
    np.testing.assert_allclose(state.zones[0].gap, 0.0, atol=1e-14)
    here, there = problem.space.mesh.points, flat.space.mesh.points
    np.testing.assert_allclose(here[:, dim - 1].max(), there.max(), atol=1e-12)
    if slave in ("HEXA8", "TETRA4", "HEXA27") and hexa == "pyramid":  # no nodes inside cells: as if it was never wavy
        np.testing.assert_allclose(here, there, atol=1e-12)


def test_figures_of_the_adjustment(tmp_path):
    """`validate` and results.json say how many nodes were moved, and how far."""
    mesh = wavy(stack("HEXA8", "HEXA8", 3))
    case, ways = pressed(mesh, contact(adjust=0.021)), 1 - mesh.points[nodes_of(mesh, "slave"), 2]
    (zone,) = validate(case).zones
    assert zone.adjusted is not None
    assert zone.adjusted.count == np.count_nonzero(ways > 1e-12)
    np.testing.assert_allclose(zone.adjusted[1:], [ways.max(), ways[ways > 1e-12].mean()], rtol=1e-9)
    np.testing.assert_allclose(zone.gap, 0.0, atol=1e-13)
    run(case, create_output(tmp_path / "out"))
    written = json.loads((tmp_path / "out" / "results.json").read_text())["contact"]["slave"]["adjusted"]
    assert written == zone.adjusted._asdict()


@pytest.mark.rows("HEXA20-hexa", "TETRA10-pyramid")
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize("slave", ["HEXA8", "HEXA20", "TETRA10"])
def test_a_mesh_that_was_cut_before(slave, hexa):
    """The nodes that the cut has made follow: the same mesh, whether the cut is in the file or made for the run."""
    mesh = wavy(stack(slave, "HEXA8", 3))
    both = mesh, lacmesh.cut_skin(mesh, "slave", hexa=hexa).mesh
    here, there = (Problem.of(pressed(one, contact(adjust=0.021, hexa=hexa))).space.mesh.points for one in both)
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-14)


def test_only_nodes_within_the_distance_are_moved():
    mesh = wavy(stack("HEXA8", "HEXA8", 3))
    after, figures = moved(pressed(mesh, contact(adjust=0.008)))
    slave = nodes_of(mesh, "slave")
    near = slave[1 - mesh.points[slave, 2] <= 0.008]
    far = np.setdiff1d(slave, near)
    assert len(near) and len(far)
    np.testing.assert_allclose(after.points[near, 2], 1.0, atol=1e-14)
    np.testing.assert_array_equal(after.points[far], mesh.points[far])
    assert figures["slave"].largest <= 0.008
    with pytest.raises(CaseError, match="adjust"):
        contact(adjust=-1.0)
    assert contact(adjust=0).adjust == 0  # nodes that overlap alone are moved, as with ADJUST=0.0 of decks


def test_several_zones_one_after_the_other():
    """A middle body is slave of one contact and master of the next."""
    mesh = wavy(wavy(three_blocks(), "slave1", up=1.0), "slave2", up=1.0)
    problem = Problem.of(
        pressed(mesh, *(Contact(slave=f"slave{k}", master=f"master{k}", adjust=0.021) for k in (1, 2)))
    )
    (state,) = march(problem)
    for zone in state.zones:
        np.testing.assert_allclose(zone.pressure, 10.0, rtol=1e-10)
    assert set(problem.adjusted) == {"slave1", "slave2"}


@pytest.mark.parametrize("before", [0.99, 1.01])
@pytest.mark.parametrize(("kind", "surface"), [("QUAD4", "smooth"), ("QUAD4", "faces"), ("QUAD8", "smooth")])
def test_a_shaft_in_a_hole(kind, surface, before):
    """A shaft that is too small, or too large, fills its hole: its nodes go onto the circle, or onto the faces."""
    mesh = rings.pair(rings.ring(kind, (2, 6), (0.5, before)), rings.ring(kind, (2, 7), (1.0, 2.0)))
    records = contact(adjust=0.02, surface=surface), fix("x0", "x"), fix("y0", "y"), Pressure(group="inner", value=1.0)
    problem = Problem.of(case_of(mesh, ELASTIC, *records, model="plane_strain"))
    x = problem.space.mesh.points
    radius = np.linalg.norm(x[nodes_of(mesh, "slave")], axis=1)
    (pair,) = problem.joints
    gap = pair.integrate(problem.space, np.zeros(problem.space.n_dof), 0.0).gap
    # two unlike polygons are apart by their sagittas, of up to 9e-3; smooth ones by a fraction of h^4
    np.testing.assert_allclose(gap, 0.0, atol=9e-3 if surface == "faces" else 3e-5)
    if surface == "faces":  # between the circle and the middles of seven chords
        assert np.cos(np.pi / 28) - 1e-12 < radius.min() < 1 - 1e-3
        assert radius.max() < 1 + 2e-4  # what overhangs the first face goes onto its plane
        return
    np.testing.assert_allclose(radius, 1.0, atol=2e-5)
    for group, axis in (("x0", 0), ("y0", 1)):  # planes of symmetry stay planes
        assert np.abs(x[nodes_of(mesh, group), axis]).max() < 1e-5
    (state,) = march(problem)
    assert state.zones[0].pressure.min() > 0


def test_nodes_that_overhang_are_moved_along_the_normal():
    """A slave that is wider than its master: what is beside the master keeps its place along it."""
    mesh = stack("HEXA8", "HEXA8", 3, counts=(4, 2))
    x, upper, slave = mesh.points.copy(), nodes_of(mesh, "upper"), nodes_of(mesh, "slave")
    x[upper, :2] = 0.25 + 0.5 * x[upper, :2]
    x[upper, 2] += 0.01
    after, _ = moved(pressed(replace(mesh, points=x), contact(adjust=0.3)))
    np.testing.assert_allclose(after.points[slave, :2], x[slave, :2], atol=1e-15)
    beside = np.linalg.norm(np.maximum(np.abs(x[slave, :2] - 0.5) - 0.25, 0.0), axis=1)
    near = np.hypot(beside, 0.01) <= 0.3
    assert 0 < near.sum() < len(near)
    np.testing.assert_allclose(after.points[slave, 2], np.where(near, 1.01, 1.0), atol=1e-14)


def test_cells_that_would_turn_over_are_named():
    """The first layer of the slave is a tenth thick, and its face is to go down by two tenths."""
    mesh = stack("HEXA8", "HEXA8", 3)
    x = mesh.points.copy()
    x[np.abs(x[:, 2] - np.unique(x[:, 2])[1]) < 1e-9, 2] = 0.9
    x[nodes_of(mesh, "upper"), 2] -= 0.2
    with pytest.raises(CaseError, match=r"would invert cells .*: .* moves by 0\.2"):
        Problem.of(pressed(replace(mesh, points=x), contact(adjust=0.3)))


@pytest.mark.parametrize("tilt", [0.0, 20.0])
def test_a_block_in_a_corner(tilt):
    """Two contacts share the nodes of an edge: with a wall upright on the floor both are met, with another not."""
    cube, a = grid("HEXA8", (2, 2, 2)), np.radians(tilt)
    turn = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
    wall = placed(cube, turn, (0.5, 3.0, 3.0), (-0.2 if tilt else -0.51, -1.0, -1.0))
    floor = placed(cube, None, (3.0, 3.0, 0.5), (-1.0, -1.0, -0.51))
    names = {"x0": "side", "z0": "foot", "z1": "top"}, {"x1": "wall", "x0": "held"}, {"z1": "floor", "z0": "bottom"}
    mesh = blocks.joined(list(zip((cube, wall, floor), names, strict=True)))
    contacts = Contact(slave="foot", master="floor", adjust=0.02), Contact(slave="side", master="wall", adjust=0.1)
    case = case_of(mesh, ELASTIC, *contacts, fix("bottom", "xyz"), model="3d")
    if tilt:
        with pytest.raises(CaseError, match="'foot' has moved onto its master"):
            moved(case)
        return
    after, _ = moved(case)
    np.testing.assert_allclose(after.points[nodes_of(mesh, "foot"), 2], -0.01, atol=1e-14)
    np.testing.assert_allclose(after.points[nodes_of(mesh, "side"), 0], -0.01, atol=1e-14)


@pytest.mark.rows("TRIA3-TETRA4", "QUAD4-HEXA8")
@pytest.mark.parametrize(
    "kind, solid",
    [("TRIA3", "TETRA4"), ("QUAD4", "HEXA8"), ("TRIA6", "TETRA10"), ("QUAD8", "HEXA20"), ("QUAD9", "HEXA27")],
)
def test_closest_points_against_a_search(kind, solid):
    """Closest points of a curved skin are those of a fine sampling of its faces, refined."""
    rng, mesh = np.random.default_rng(1), grid(solid, (2, 2, 2))

    def wave(x):
        return 0.2 * np.sin(2 * x[:, 0] + x[:, 1]) - 0.1 * x[:, 1] ** 2

    skin = Surface.of(mesh.moved(lambda x: [x[0], x[1], x[2] + wave(x.T)]), mesh.cells_of("z1"))
    points = np.column_stack([rng.uniform(0.1, 0.9, (60, 2)), np.zeros(60)])
    points[:, 2] = 1 + wave(points) + rng.uniform(-0.1, 0.1, 60)
    closest = closest_points(skin, points, np.tile([0.0, 0.0, -1.0], (60, 1)), 0.5)
    u, v = (c.ravel() for c in np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401)))
    square = np.column_stack([u, v])[u + v <= 1] if kind[0] == "T" else np.column_stack([2 * u - 1, 2 * v - 1])
    samples = [np.einsum("pn,fns->fps", shape(kind, square), skin.x[nodes]) for _, _, nodes in skin.by_type()]
    nearest = cKDTree(np.concatenate([one.reshape(-1, 3) for one in samples])).query(points)[0]
    assert (closest.distance <= nearest + 1e-12).all()
    assert (nearest**2 - closest.distance**2).max() < 2 / 800**2  # samples are 1 / 800 apart
    np.testing.assert_allclose(np.linalg.norm(closest.way, axis=1), closest.distance, rtol=1e-12)


# ---- bodies that overlap

SIZE = 0.08


def cylinder_on_block(lowered):
    """The lower half of a tube of radii 0.3 and 1 on a block: cells of 0.08; they touch at (0, 0) if not `lowered`."""
    tube = ring((9, 39), (0.3, 1.0), angle=180).moved(lambda x: [-x[0], 1 - lowered - x[1]])
    block = rectangle((round(3 / SIZE) - 1, round(1 / SIZE)), (3, 1), corner=(-1.5, -1))
    mesh = join(tube.renamed(outer="slave", inner="top"), block.renamed(top="master"))
    return mesh.only("body", "slave", "top", "master", "bottom").renamed(body="")


def of(mesh, kinematics="small", **keys):
    """Bodies whose outer sides, `top` and `bottom`, are held."""
    dim, material = mesh.space_dim, HYPERELASTIC if kinematics == "finite" else ELASTIC
    records = material, contact(**keys), fix("bottom", "xyz"[:dim]), fix("top", "xyz"[:dim])
    return case_of(mesh, *records, model="3d" if dim == 3 else "plane_strain", kinematics=kinematics)


def solved(case):
    (state,) = march(Problem.of(case))
    return state.zones[0]


@pytest.mark.parametrize("lowered", [0.1, 0.3, 0.5, 0.9])
def test_an_overlap_deeper_than_the_search_is_refused_with_place_and_depth(lowered):
    case = of(cylinder_on_block(lowered))
    with pytest.raises(CaseError, match=r"near.*max_penetration") as refused:
        ls.solve(case)
    depth = float(str(refused.value).split("by up to ")[1].split(",")[0])
    assert 0.8 * lowered < depth <= lowered
    (problem,) = validate(case).problems
    assert "lie inside the body of master 'master'" in str(problem)


def ran(case, folder):
    """The results of a run, what is in results.json, and its warnings."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warnings.filterwarnings("ignore", "nothing acts on the bodies")
        results = run(case, create_output(folder))
    written = json.loads((folder / "results.json").read_text())
    assert written.get("message", "") == results.message == "\n".join(str(one.message) for one in told)
    return results, written["contact"]["slave"], results.message


@pytest.mark.rows("keys1-0.03-False-small", "keys3-0.04-True-small")
@pytest.mark.parametrize("kinematics", ["small", pytest.param("finite", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("keys", "overlap", "doubted"),
    [
        ({}, 0.03, True),
        ({"max_penetration": 0.1}, 0.03, False),
        ({"clearance": 0.03}, 0.0, False),
        ({"clearance": -0.01}, 0.04, True),
        ({"clearance": 0.028}, 0.002, False),
    ],
)
def test_the_deepest_overlap_is_told_and_doubted_where_nothing_asks_for_it(
    tmp_path, keys, overlap, doubted, kinematics
):
    """0.03 of cells of 0.08; a clearance takes it away, and max_penetration says that it is meant."""
    case = of(cylinder_on_block(0.03), kinematics, **keys)
    said = r"overlaps master 'master' by 0\.0\d+ in the mesh, 0\.\d+ of a macro-element's size"
    (zone,) = validate(case).zones
    results, written, message = ran(case, tmp_path / "out")
    assert zone.overlap == results.overlap["slave"] == written["overlap_at_start"]
    assert zone.overlap == pytest.approx(overlap, abs=1e-3)
    for told in ("\n".join(zone.told), message):
        assert bool(re.search(said, told)) == doubted, told
    if not keys and kinematics == "small":
        assert (solved(case).pressure > 0).any() and validate(of(cylinder_on_block(-0.01))).zones[0].overlap == 0


def test_an_interference_by_a_clearance_is_not_doubted():
    """Blocks that touch, and a clearance of a third of a cell; the same in a mesh is doubted, for units of any size."""
    for scale in (1e-3, 1.0, 1e3):
        asked, meshed = (placed(stack("HEXA8", "HEXA8", 3, gap=gap, even=True), size=scale) for gap in (0.0, -0.1))
        for case, count in ((of(asked, clearance=-0.1 * scale), 0), (of(meshed), 1)):
            (zone,) = validate(case).zones
            assert zone.overlap == pytest.approx(0.1 * scale) and len(zone.told) == count


def test_a_slave_that_hardly_has_a_master_is_told(tmp_path):
    """Three tenths of a block's side on another one; not if it is pressed on that under current geometry."""
    side, low = rectangle(10).renamed(bottom="slave"), rectangle(9, corner=(0.7, -1.0)).renamed(top="master")
    mesh = join(side.only("body", "slave", "top"), low.only("body", "master", "bottom")).renamed(body="")
    said = "master 'master' is in front of 30 % of slave 'slave'"
    (zone,) = validate(of(mesh)).zones
    assert zone.covered == pytest.approx(0.3) and zone.told[0].startswith(said)
    assert ran(of(mesh), tmp_path / "small")[2].startswith(said)
    assert validate(of(mesh, "finite")).zones[0].told == ()
    below = (np.arange(mesh.n_nodes) >= side.n_nodes)[:, None]
    closed, apart = (replace(mesh, points=mesh.points + [0, up, 0] * below) for up in (0.005, -0.01))
    assert ran(of(closed, "finite"), tmp_path / "closed")[2] == ""
    assert ran(of(apart, "finite"), tmp_path / "open")[2].startswith(said)


@pytest.mark.parametrize(
    "lowered, kinematics, keys",
    [(0.1, "small", {"max_penetration": 0.6}), (0.3, "small", {"max_penetration": 0.6}), (0.1, "finite", {})],
)
def test_a_deeper_overlap_is_found_and_closed(lowered, kinematics, keys):
    """With a depth that is given; skins that are followed look deeper."""
    case = of(cylinder_on_block(lowered), kinematics, **keys)
    zone = solved(case)
    inside = (zone.centre[:, 1] < -1e-6) & (np.abs(zone.centre[:, 0]) < 1)
    assert inside.sum() > 5 and (zone.status[inside] != UNPAIRED).all()
    assert np.nanmin(zone.gap) > -1e-9  # all of it is closed
    pushed = zone.pressure > 0
    assert pushed.sum() > 5 and np.abs(zone.centre[pushed, 0]).max() > 0.5 * np.sqrt(2 * lowered)
    assert abs(validate(case).zones[0].overlap - lowered) < 0.1 * lowered


def block_in_a_channel(clockwise):
    """A block in a channel, 3 from either wall and 0.1 above the floor, of cells that are listed `clockwise` or not."""

    def part(x0, x1, y0, y1, h):
        lines = (a + h * np.arange(round((b - a) / h) + 1) for a, b in ((x0, x1), (y0, y1)))
        return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)

    channel = cells_between(part(0, 12, 0, 2, 1), part(0, 2, 2, 8, 1), part(10, 12, 2, 8, 1)).with_groups(
        bottom=lambda x: x[1] == 0,
        master=lambda x: ((x[0] == 2) & (x[1] >= 2)) | ((x[1] == 2) & (x[0] >= 2) & (x[0] <= 10)),
    )
    block = cells_between(part(5, 7, 2.1, 6.1, 0.5)).with_groups(
        top=lambda x: x[1] > 6.1 - 1e-9, slave=lambda x: (x[0] == 5) | (x[1] < 2.1 + 1e-9)
    )
    mesh = join(channel.renamed(body="channel"), block.renamed(body="block"))
    mesh = mesh.only("channel", "block", "bottom", "master", "top", "slave")
    quads = mesh.block("QUAD4").copy()
    turned = [k for k in range(len(quads)) if clockwise(k in set(mesh.cell_groups["channel"]), k)]
    quads[turned] = quads[turned, ::-1]
    cells = [(block.type, quads if block.type == "QUAD4" else block.nodes) for block in mesh.blocks]
    return Mesh.create(mesh.points, cells, cell_groups=mesh.cell_groups, space_dim=2)


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(
    "clockwise", [lambda low, k: low, lambda low, k: True, lambda low, k: k % 2], ids=["one", "all", "mixed"]
)
def test_cells_that_are_listed_clockwise_change_nothing(clockwise):
    """The outward side of a body is where its cells are not, whichever way these list their nodes."""
    forces = []
    for turned in (lambda low, k: False, clockwise):
        records = ELASTIC, contact(), fix("bottom", "xy"), move("top", ux=0.0, uy=-0.15)
        zone = solved(case_of(block_in_a_channel(turned), *records, model="plane_strain"))
        forces.append(float((zone.pressure * zone.area).sum()))
    assert forces[0] == pytest.approx(21.5183, rel=1e-5)
    assert forces[1] == pytest.approx(forces[0], rel=1e-4)


# ---- defects of a mesh


def rows_of_squares(n=4, glued=(), more=(), place=None):
    """Two rows of n squares, one on the other; nodes of the upper one's foot that are `glued` are the lower one's.

    `more`: cells beside; `place` of the node 12.
    """
    row = np.arange(n + 1)
    points = np.array([[x, y] for y in (0.0, 1.0, 1.0, 2.0) for x in row.tolist()])
    if place is not None:
        points[12] = place
    rows = row + (n + 1) * np.arange(4)[:, None]
    rows[2] = np.where(np.isin(row, glued), rows[1], rows[2])
    quads = [np.stack([a[:-1], a[1:], b[1:], b[:-1]], axis=1) for a, b in (rows[:2], rows[2:])]
    lines = [np.stack([a[:-1], a[1:]], axis=1) for a in (rows[2][::-1], rows[1], rows[0][::-1], rows[3])]
    used = np.concatenate([*quads, np.array(more, int).reshape(-1, 4)])
    names = {name: len(used) + k * n + np.arange(n) for k, name in enumerate(("slave", "master", "bottom", "top"))}
    return Mesh.create(points, [("QUAD4", used), ("SEG2", np.concatenate(lines))], cell_groups=names)


def told(mesh):
    """Rules of errors and of warnings of a run on a mesh; `validate` gives the same sentences."""
    records = ELASTIC, contact(), fix("bottom", "xy"), move("top", ux=0.0, uy=-0.02)
    case, said = case_of(mesh, *records, model="plane_strain"), []

    def by_run(case):
        try:
            Problem.of(case)
        except CaseError as error:
            return [p.message for p in error.problems]
        return []

    for look in (by_run, lambda case: [p.message for p in validate(case).problems]):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            said.append((look(case), [str(w.message) for w in caught if isinstance(w.message, LacmeshWarning)]))
    assert said[0] == said[1]
    findings = lacmesh.check(mesh, "slave", "master").findings
    rules = [[re.search(r"\(lacmesh check: (.*)\)", one)[1] for one in part] for part in said[0]]
    for rule, sentence in zip(itertools.chain(*rules), itertools.chain(*said[0]), strict=True):
        same = any(one.message in sentence for one in findings if one.rule == rule)
        assert same or "(12, 13): 1 edge has no length" in sentence
    return rules


@pytest.mark.parametrize(
    ("keys", "refused", "warned"),
    [
        ({}, [], []),
        ({"glued": range(5)}, ["shared-nodes"], []),
        ({"glued": (1, 2)}, ["shared-nodes"], []),
        ({"glued": (2,)}, [], ["shared-nodes"]),  # which may be meant
        ({"glued": (0,)}, [], []),  # the tip of a crack
        ({"more": [[10, 11, 16, 15]]}, ["repeated-cell"], []),
        ({"more": [[10, 11, 17, 16]]}, ["overlapping-cells"], []),
        ({"more": [[1, 6, 12, 13]]}, ["crowded-facet"], []),
        ({"place": [1.0 + 1e-13, 1.0]}, [], ["coincident-nodes"]),  # a face that carries nothing but rounding
    ],
)
def test_defects_are_refused_or_warned_of_in_the_words_of_the_check(keys, refused, warned):
    found, doubts = told(rows_of_squares(**keys))
    assert set(refused) <= set(found) and bool(found) == bool(refused) and doubts == warned


def test_cells_that_share_no_mid_node_are_warned_of():
    """The body is torn there between its corners."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]]
    mid = [[0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5], [1.5, 0], [2, 0.5], [1.5, 1], [1, 0.5]]
    cells = [[0, 1, 2, 3, 6, 7, 8, 9], [1, 4, 5, 2, 10, 11, 12, 13]]
    with pytest.warns(LacmeshWarning, match="corners but not mid-nodes"):
        Problem.of(case_of(Mesh.create(points + mid, [("QUAD8", cells)]), ELASTIC, model="plane_strain"))
