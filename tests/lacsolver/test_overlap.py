"""Bodies that overlap in the mesh: closed as deep as a master is looked for, refused with place and depth beyond."""

from __future__ import annotations

import itertools
import json
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, join
from lacmesh.generate import rectangle, ring
from lacsolver.case import CaseError, parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.results.state import UNPAIRED
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.patch_meshes import stack
from verification.meshes.blocks import block, joined

CASE = """mesh = "cylinder.msh"
model = "plane_strain"
kinematics = "{kinematics}"
[[material]]
young = 1000.0
poisson = 0.3
law = "{law}"
[[contact]]
slave = "slave"
master = "master"
{more}
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
[[displacement]]
group = "hub"
ux = 0.0
uy = 0.0
"""
SIZE = 0.08


def cylinder_on_block(lowered, height=1.0):
    """The lower half of a tube of radii 0.3 and 1 on a block: cells of 0.08; they touch at (0, 0) if not `lowered`."""
    tube = ring((9, 39), (0.3, 1.0), angle=180).moved(lambda x: [-x[0], 1 - lowered - x[1]])
    block = rectangle((round(3 / SIZE) - 1, round(height / SIZE)), (3, height), corner=(-1.5, -height))
    mesh = join(tube.renamed(outer="slave", inner="hub"), block.renamed(top="master"))
    return mesh.only("body", "slave", "hub", "master", "bottom").renamed(body="")


def of(more="", kinematics="small"):
    law = "elastic" if kinematics == "small" else "neo_hookean"
    return parse_case(CASE.format(more=more, kinematics=kinematics, law=law))


def solved(mesh, case):
    (state,) = march(Problem.of(case, mesh))
    return state.zones[0]


@pytest.mark.parametrize("lowered", [0.1, 0.3, 0.5, 0.9])
def test_an_overlap_deeper_than_the_search_is_refused_with_place_and_depth(lowered):
    mesh = cylinder_on_block(lowered)
    with pytest.raises(CaseError, match=r"lie inside the body of master 'master'.*near.*max_penetration") as refused:
        solved(mesh, of())
    depth = float(str(refused.value).split("by up to ")[1].split(",")[0])
    assert 0.8 * lowered < depth <= lowered
    (problem,) = validate(of(), mesh).problems
    assert "lie inside the body of master 'master'" in str(problem)


def test_an_overlap_within_the_search_is_closed_and_told():
    mesh = cylinder_on_block(0.03)
    found = validate(of(), mesh)
    assert not found.problems and 0.025 < found.zones[0].overlap <= 0.03
    assert validate(of(), cylinder_on_block(-0.01)).zones[0].overlap == 0
    zone = solved(mesh, of())
    assert (zone.pressure > 0).any()


def ran(case, mesh, folder):
    """The results of a run, what is in results.json, and its warnings."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warnings.filterwarnings("ignore", "nothing acts on the bodies")
        results = run(case, create_output(folder), mesh=mesh)
    written = json.loads((folder / "results.json").read_text())
    assert written.get("message", "") == results.message == "\n".join(str(one.message) for one in told)
    return results, written["contact"]["slave"], results.message


@pytest.mark.parametrize("kinematics", ["small", pytest.param("finite", marks=pytest.mark.slow)])
def test_a_run_tells_the_deepest_overlap_and_doubts_what_nothing_asks_for(tmp_path, kinematics):
    """0.03 of cells of 0.08; a clearance takes it away, and max_penetration says that it is meant."""
    mesh = cylinder_on_block(0.03)
    said = r"slave 'slave' overlaps master 'master' by 0\.0\d+ in the mesh, 0\.\d+ of a macro-element's size, near"
    for k, (more, overlap, doubted) in enumerate(
        [
            ("", 0.03, True),
            ("max_penetration = 0.1", 0.03, False),
            ("clearance = 0.03", 0.0, False),
            ("clearance = -0.01", 0.04, True),
            ("clearance = 0.028", 0.002, False),
        ]
    ):
        case = of(more, kinematics)
        (zone,) = validate(case, mesh).zones
        results, written, message = ran(case, mesh, tmp_path / str(k))
        assert zone.overlap == results.overlap["slave"] == written["overlap_at_start"]
        assert zone.overlap == pytest.approx(overlap, abs=1e-3)
        for told in ("\n".join(zone.told), message):
            assert bool(re.search(said, told)) == doubted, told


def test_an_interference_by_a_clearance_is_not_doubted():
    """Blocks that touch, and a clearance of a third of a cell; the same in a mesh is doubted, for units of any size."""
    for scale in (1e-3, 1.0, 1e3):
        asked, meshed = (moved(stack("HEXA8", "HEXA8", 3, gap=gap, even=True), scale) for gap in (0.0, -0.1))
        held = CASE.replace("hub", "top").replace("plane_strain", "3d").replace("uy = 0.0", "uy = 0.0\nuz = 0.0")
        for mesh, more, count in (asked, f"clearance = {-0.1 * scale}", 0), (meshed, "", 1):
            (zone,) = validate(parse_case(held.format(kinematics="small", law="elastic", more=more)), mesh).zones
            assert zone.overlap == pytest.approx(0.1 * scale) and len(zone.told) == count


def moved(mesh, scale):
    """A mesh in other units."""
    return replace(mesh, points=mesh.points * scale)


def test_a_slave_that_hardly_has_a_master_is_told(tmp_path):
    """Three tenths of a block's side on another one; not if it is pressed on that under current geometry."""
    side = block("QUAD4", 10, [0.0, 0.0], [1.0, 1.0])
    low = block("QUAD4", 9, [0.7, -1.0], [1.7, 0.0])
    names = {"y1": "hub", "y0": "slave"}, {"y1": "master", "y0": "bottom"}
    mesh = joined([(side, names[0]), (low, names[1])])
    said = "master 'master' is in front of 30 % of slave 'slave', less than half of it; name as slave"
    case = of()
    (zone,) = validate(case, mesh).zones
    assert zone.covered == pytest.approx(0.3) and zone.told[0].startswith(said)
    assert ran(case, mesh, tmp_path / "small")[2].startswith(said)
    follow = of(kinematics="finite")
    assert validate(follow, mesh).zones[0].told == ()
    below = (np.arange(mesh.n_nodes) >= side.n_nodes)[:, None]
    pressed, apart = (replace(mesh, points=mesh.points + [0, up, 0] * below) for up in (0.005, -0.01))
    assert ran(follow, pressed, tmp_path / "closed")[2] == ""
    assert ran(follow, apart, tmp_path / "open")[2].startswith(said)


def test_skins_that_are_followed_look_deeper_and_close_it():
    zone = solved(cylinder_on_block(0.1), of(kinematics="finite"))
    assert np.nanmin(zone.gap) > -1e-9 and (zone.pressure > 0).sum() > 5


@pytest.mark.parametrize(
    ("slave", "master"), [("HEXA8", "TETRA4"), ("TETRA10", "HEXA20"), ("PENTA6 quadrangle", "HEXA8")]
)
def test_blocks_that_lie_in_one_another_are_refused_and_parted_on_demand(slave, master):
    mesh = stack(slave, master, 3, gap=-0.7, even=True)
    held = CASE.replace("hub", "top").replace("plane_strain", "3d").replace("uy = 0.0", "uy = 0.0\nuz = 0.0")
    with pytest.raises(CaseError, match=r"deeper than a master is looked for: by up to 0\.7, near"):
        solved(mesh, parse_case(held.format(kinematics="small", law="elastic", more="")))
    zone = solved(mesh, parse_case(held.format(kinematics="small", law="elastic", more="max_penetration = 0.8")))
    assert (zone.status != UNPAIRED).all() and (zone.pressure > 0).all()


@pytest.mark.parametrize("lowered", [0.1, 0.3])
def test_max_penetration_finds_a_deeper_overlap_and_closes_it(lowered):
    mesh = cylinder_on_block(lowered)
    case = of("max_penetration = 0.6")
    zone = solved(mesh, case)
    y = zone.centre[:, 1]
    inside = (y < -1e-6) & (np.abs(zone.centre[:, 0]) < 1)
    assert inside.sum() > 5 and (zone.status[inside] != UNPAIRED).all()
    assert np.nanmin(zone.gap) > -1e-9  # all of it is closed
    pressed = zone.centre[zone.pressure > 0, 0]
    assert np.abs(pressed).max() > 0.5 * np.sqrt(2 * lowered)
    assert abs(validate(case, mesh).zones[0].overlap - lowered) < 0.1 * lowered


CHANNEL = """mesh = "channel.msh"
model = "plane_strain"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
[[displacement]]
group = "base"
ux = 0.0
uy = 0.0
[[displacement]]
group = "lid"
ux = 0.0
uy = -0.15
"""


def block_in_a_channel(clockwise):
    """A block in a channel, 3 from either wall and 0.1 above the floor, of cells that are listed `clockwise` or not."""
    number, cells, first = {}, [], {}

    def node(x, y, body):
        return number.setdefault((round(x, 9), round(y, 9), body), len(number))

    for body, (x0, x1, y0, y1, h) in enumerate(
        [(0, 12, 0, 2, 1), (0, 2, 2, 8, 1), (10, 12, 2, 8, 1), (5, 7, 2.1, 6.1, 0.5)]
    ):
        for y in np.arange(y0, y1 - 1e-9, h):
            for x in np.arange(x0, x1 - 1e-9, h):
                ring = [node(a, b, body == 3) for a, b in ((x, y), (x + h, y), (x + h, y + h), (x, y + h))]
                cells.append(ring[::-1] if clockwise(body, len(cells)) else ring)
    paths = {
        "slave": [(5, 6.1), (5, 2.1), (7, 2.1)], "master": [(2, 8), (2, 2), (10, 2)], "base": [(0, 0), (12, 0)],
        "lid": [(7, 6.1), (5, 6.1)],
    }  # fmt: skip
    sides, groups = [], {}
    for name, path in paths.items():
        body, h, first = name in ("slave", "lid"), 0.5 if name in ("slave", "lid") else 1, len(cells) + len(sides)
        for a, b in itertools.pairwise(np.array(path, float)):
            places = a + (b - a) * np.linspace(0, 1, 1 + round(np.abs(b - a).max() / h))[:, None]
            sides += itertools.pairwise([node(*place, body) for place in places])
        groups[name] = np.arange(first, len(cells) + len(sides))
    points = np.array([place[:2] for place in number])
    return Mesh.create(points, [("QUAD4", cells), ("SEG2", sides)], cell_groups=groups)


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(
    "clockwise", [lambda body, k: body < 3, lambda body, k: True, lambda body, k: k % 2], ids=["one", "all", "mixed"]
)
def test_cells_that_are_listed_clockwise_change_nothing(clockwise):
    """The outward side of a body is where its cells are not, whichever way these list their nodes."""
    forces = []
    for turned in (lambda body, k: False, clockwise):
        state = list(march(Problem.of(parse_case(CHANNEL), block_in_a_channel(turned))))[-1]
        zone = state.zones[0]
        forces.append(float((zone.pressure * zone.area).sum()))
    assert forces[0] == pytest.approx(21.5183, rel=1e-5)
    assert forces[1] == pytest.approx(forces[0], rel=1e-4)
