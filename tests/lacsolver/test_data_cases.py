"""The cases of data/ and their pages: meshes made again, what bodies do in them; and patches of another solver's suite.

The suite is code_aster's; its meshes are read from the shared folder where it is there.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.errors import LacmeshWarning
from lacmesh.reference.quadrature import measure
from lacsolver.case import Dynamics, Material, Rigid, Steps
from lacsolver.cli import main
from lacsolver.constraints.cyclic import with_sectors
from lacsolver.equilibrium.motion import ENERGIES
from lacsolver.validation import validate
from tests import REPOSITORY
from tests.lacsolver.contact_cases import load, only, stresses
from tests.lacsolver.moving import SPEED
from tests.lacsolver.tables import table
from tests.problems import case_of, contact, fix
from tests.test_tutorials import TUTORIALS, shows_what_the_page_shows, size_of, tutorials
from verification.meshes.bars import bar_on_wall

__all__ = ["tutorials"]
DATA = REPOSITORY / "data"
SLIDING, IMPACT, FRICTION, FLANGE = (DATA / name for name in ("sliding", "impact", "friction", "flange"))
#: script -> the meshes that it makes
SCRIPTS = {
    "sliding/make_ring": ["ring"],
    "sliding/make_ironing": ["ironing_2d", "ironing_3d"],
    "sliding/make_ball": ["ball"],
    "sliding/make_snap_fit": ["snap_fit"],
    "impact/make_bar": ["bar_on_wall"],
    "impact/make_dropping_ball": ["dropping_ball"],
    "friction/make_clamp": ["clamp"],
    "friction/make_cylinders": ["cylinders"],
}


def make(script, *arguments):
    command = [sys.executable, str(DATA / f"{script}.py"), *map(str, arguments)]
    subprocess.run(command, check=True, cwd=REPOSITORY, capture_output=True)


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_scripts_make_the_meshes_again(script, tmp_path):
    names, folder = SCRIPTS[script], (DATA / script).parent
    make(script, tmp_path if len(names) > 1 else tmp_path / f"{names[0]}.msh")
    for name in names:
        made, there = lacmesh.read(tmp_path / f"{name}.msh"), lacmesh.read(folder / f"{name}.msh")
        np.testing.assert_allclose(made.points, there.points, rtol=0, atol=1e-9)
        for one, other in zip(made.blocks, there.blocks, strict=True):
            assert one.type == other.type and (one.nodes == other.nodes).all()
        for groups in ("cell_groups", "node_groups"):
            one, other = getattr(made, groups), getattr(there, groups)
            assert list(one) == list(other) and all((one[key] == other[key]).all() for key in one)


CASES = [*SLIDING.glob("*.toml"), *FRICTION.glob("*.toml"), IMPACT / "dropping_ball.toml"]


@pytest.mark.rows("clamp", "cylinders", "dropping_ball")
@pytest.mark.parametrize("case", sorted(CASES), ids=lambda path: path.stem)
def test_cases_are_valid(case, capsys):
    assert case.with_suffix(".msh").is_file()
    assert main(["validate", str(case)]) == 0
    assert not capsys.readouterr().err


def copied(folder, path, *changes):
    """A case beside its mesh in a folder, with changes (old text, new); a mesh that is there stays."""
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    mesh = folder / path.with_suffix(".msh").name
    if not mesh.exists():
        shutil.copy(path.with_suffix(".msh"), mesh)
    (folder / path.name).write_text(text, encoding="utf-8")
    return folder / path.name


# ---- sliding


@pytest.mark.slow
def test_the_ring_lies_down_on_the_block(tmp_path):
    """The first twelve steps: one contact, alike on both sides, in balance."""
    shorter = ("uy = -90.0", 'uy = "-90 * t"'), ("count = 20", "end = 0.6\ncount = 12")
    case = copied(tmp_path, SLIDING / "ring.toml", *shorter)
    assert main(["run", str(case), "-q"]) == 0
    columns, told = table(tmp_path / "ring" / "history.csv"), (tmp_path / "ring" / "results.json").read_text()
    assert max(json.loads(told)["balance"].values()) <= 1e-12
    down, foot = columns["reaction.ends.y"], columns["reaction.bottom.y"]
    assert np.allclose(down, -foot, rtol=0, atol=1e-7 * np.abs(down).max())
    assert np.abs(columns["reaction.ends.x"]).max() < 1e-7 * np.abs(down).max()
    touched = columns["time"] > 20 / 90
    assert np.abs(down[~touched]).max() < 1e-9 * np.abs(down).max() and (np.diff(-down[touched]) > 0).all()
    # the block is pressed down in its middle first, later more where one of the two contacts will be
    middle, side = ([np.interp(t, columns["time"], columns[f"probe.{p}.uy"]) for t in (0.4, 0.6)] for p in ("PA", "PB"))
    assert middle[0] < -4 < side[0] < 0 and side[1] < middle[1] - 1


# ---- impact


def run_of_bar(folder, *changes):
    """The folder of a run of the bar, and its history; the case stands beside it."""
    case = copied(folder, IMPACT / "bar_on_wall.toml", *changes)
    with pytest.warns(LacmeshWarning, match="massless nodes change the inertia of .* by -1.57%"):
        ls.run(case, out := case.with_suffix(""))
    return out, table(out / "history.csv")


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """The bar in a quarter of its steps."""
    return run_of_bar(tmp_path_factory.mktemp("bar"), ("count = 128", "count = 32"))


@pytest.mark.slow
def test_the_bar_does_what_its_page_says(tmp_path):
    _, columns = run_of_bar(tmp_path)
    t, p = columns["time"], columns["contact.impact.pressure_max"]
    assert not p[t < 0.95].any() and not p[t > 3.2].any()
    assert p[(t > 1.5) & (t < 2.8)].mean() == pytest.approx(0.01, rel=0.01)
    assert columns["contact.impact.impulse.y"][-1] == pytest.approx(2 * 0.01 * 0.25, rel=5e-3)
    assert columns["momentum.y"][-1] == pytest.approx(-0.0025 + columns["contact.impact.impulse.y"][-1], rel=1e-9)
    energies = np.array([(-1 if name == "external" else 1) * columns[f"energy.{name}"] for name in ENERGIES])
    assert np.abs(energies.sum(axis=0)).max() < 1e-10 * energies.max()
    assert columns["probe.top.vy"][0] == pytest.approx(-0.01)


def test_results_and_fields_have_the_motion(bar):
    folder, columns = bar
    step = json.loads((folder / "results.json").read_text())["steps"][-1]
    assert list(step["energies"]) == list(ENERGIES)
    for name, value in (
        ("energy.kinetic", step["energies"]["kinetic"]),
        ("momentum.y", step["momentum"]["linear"][1]),
        ("momentum.angular", step["momentum"]["angular"]),
        ("contact.impact.impulse.y", step["impulse"]["impact"][1]),
        ("probe.top.vy", step["velocities"]["top"][1]),
        ("probe.top.ay", step["accelerations"]["top"][1]),
    ):
        assert value == columns[name][-1], name
    fields = sorted((folder / "fields").glob("solid_*.vtu"))
    last = lacmesh.read(fields[-1]).node_data
    assert len(fields) == 32 and all(last[name].shape[1] == 3 for name in ("velocity", "acceleration"))


def test_validate_tells_of_the_motion():
    found = validate(ls.read_case(IMPACT / "bar_on_wall.toml"))
    motion = found.motion
    assert not found.problems and motion.speeds == pytest.approx((1.0, 1.0)) and motion.cell == pytest.approx(1 / 16)
    assert motion.crossed == pytest.approx(0.5) and motion.suggested == pytest.approx(1 / 16)
    assert motion.mass == pytest.approx(0.25) and motion.momentum == pytest.approx((0.0, -0.0025))
    records = Material(young=1.0, poisson=0.3, density=1.0), contact(master="wall"), Rigid(group="wall"), Dynamics()
    case = case_of(bar_on_wall("QUAD8", 4), *records, Steps(count=4), model="plane_strain")
    quadratic = validate(case).motion
    assert quadratic.cell == pytest.approx(1 / 4)  # a wave goes from node to node, of which there are twice as many
    assert quadratic.suggested == pytest.approx(1 / 8 / SPEED)


# ---- friction


@pytest.mark.slow
def test_the_clamp_holds_until_friction_carries_no_more():
    zones = [state.contact["joint"] for state in ls.march(FRICTION / "clamp.toml")]
    sliding = [int((zone.status == 2).sum()) for zone in zones]
    closed = [int((zone.pressure > 0).sum()) for zone in zones]
    assert 0 < sliding[1] < closed[1] and sliding[-1] == closed[-1]
    carried = [float(zone.shear_vector[:, 0] @ zone.area) for zone in zones]
    bound = [0.2 * float(zone.pressure @ zone.area) for zone in zones]
    assert carried[-1] == pytest.approx(bound[-1], rel=1e-10)
    assert all(now < most * (1 + 1e-12) for now, most in zip(carried, bound, strict=True))
    dissipation = [float(zone.dissipation @ zone.area) for zone in zones]
    assert (np.diff(dissipation) >= 0).all() and dissipation[-1] > 0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:steps are too long for the energy that friction takes")
def test_cylinders_stick_where_cattaneo_and_mindlin_say():
    zone = ls.solve(FRICTION / "cylinders.toml").contact["line"]
    assert zone.pressure.max() == pytest.approx(9.351, rel=0.01)
    stick = float(zone.area[zone.status == 1].sum()) / 2
    assert stick == pytest.approx(0.7293 * 0.6808, abs=0.04)  # of the half width; one macro-element
    assert zone.shear_vector[:, 0] @ zone.area == pytest.approx(0.93616, rel=1e-8)


@pytest.mark.slow
def test_the_page_of_friction_is_what_its_commands_do(tutorials, tmp_path):
    assert shows_what_the_page_shows(list(tutorials.run_page(TUTORIALS / "friction.md", tmp_path)))
    for name in tutorials.pictures(TUTORIALS / "friction.md"):
        tutorials.keep(tmp_path / name, tmp_path / f"small_{name}")
        assert size_of(tmp_path / f"small_{name}") == size_of(TUTORIALS / name)


# ---- the flange joint

GROUPS = {
    *("upper", "lower", "bolt", "face_upper", "face_lower", "top", "bottom", "head", "nut", "end", "foot"),
    *("side_a", "side_b", "shank"),
}


def bolt_of(mesh):
    """The volume of the bolt of a sector."""
    return sum(float(measure(kind, mesh.points[nodes]).sum()) for kind, _, nodes in mesh.select(mesh.cells_of("bolt")))


@pytest.mark.slow
def test_the_flange_is_valid_and_has_its_bolt_and_its_sides():
    case, mesh = ls.read_case(FLANGE / "flange.toml"), lacmesh.read(FLANGE / "flange.msh")
    assert validate(case).problems == []
    assert set(mesh.cell_groups) == GROUPS and mesh.cells_by_type["TETRA10"] == 2242
    assert with_sectors(case, mesh).cyclic[0].matching
    parts = lacmesh.split(mesh, "shank")
    assert all(len(parts.cell_groups[f"shank_{end}"]) == len(mesh.cell_groups["shank"]) for end in "ab")


@pytest.mark.gmsh
def test_the_script_makes_the_flange(tmp_path):
    """Another version of gmsh may give other tetrahedra: the groups, and the volumes of the bodies."""
    make("flange/make_flange", tmp_path / "made.msh", 24)
    made = lacmesh.read(tmp_path / "made.msh")
    assert set(made.cell_groups) == GROUPS
    sizes = [bolt_of(mesh) for mesh in (made, lacmesh.read(FLANGE / "flange.msh"))]
    np.testing.assert_allclose(sizes, 2 * np.pi * (6**2 * 16 + 11**2 * 8), rtol=0.03)
    assert with_sectors(ls.read_case(FLANGE / "flange.toml"), made).cyclic[0].matching


@pytest.mark.slow
def test_the_page_of_the_flange_tells_what_comes(tutorials, tmp_path):
    """Forces in the table of the page are those of the run."""
    page = TUTORIALS / "flange.md"
    printed = "".join(text for _, text in tutorials.run_page(page, tmp_path))
    assert (tmp_path / "flange.png").is_file() and (tmp_path / "flange_bolts.png").is_file()
    words = r"t = ([\d.]+): pull ([\d.]+) kN, torque ([\d.]+) N m, bolt ([\d.]+) kN, gasket ([\d.]+)"
    rows = re.findall(r"^\|" + 5 * r" ([\d.]+) \|", page.read_text(encoding="utf-8"), re.MULTILINE)
    of_run = {float(t): tuple(map(float, values)) for t, *values in re.findall(words, printed)}
    assert len(rows) == 3
    for t, *values in rows:
        np.testing.assert_allclose(of_run[float(t)], tuple(map(float, values)), atol=0.06)


# ---- patches of code_aster's suite

PLANE, SOLID = {"Sym": "x", "Group_3": "y"}, {"Symx": "x", "Symy": "y", "Group_3": "z"}
#: id -> mesh, model, slave, master, hexa, what is held
SUITE = {
    "ssnp170a": ("ssnp170a", "plane_strain", "Group_1", "Group_2", "pyramid", PLANE),
    "ssnp170e-1": ("ssnp170e", "plane_strain", "Group_1", "Group_2", "pyramid", PLANE),
    "ssnp170e-2": ("ssnp170e", "plane_strain", "Group_2", "Group_1", "pyramid", PLANE),
    "ssnp170k": ("ssnp170k", "3d", "Group_1", "Group_2", "pyramid", SOLID),
    "ssnp170m": ("ssnp170m", "3d", "Group_1", "Group_2", "hexa", SOLID),
}


@pytest.mark.shared
@pytest.mark.parametrize("row", SUITE)
def test_patch_of_the_suite(shared, row):
    """Stress, pressure, gap against the mesh size and coverage, all within 1e-10."""
    name, model, slave, master, hexa, fixed = SUITE[row]
    mesh = lacmesh.read(shared / "reference" / "meshes" / f"{name}.med")
    joint, held = contact(slave=slave, master=master, hexa=hexa), [fix(group, axis) for group, axis in fixed.items()]
    steel, pressed = ls.Material(young=2000.0, poisson=0.3), load("Group_4", 25.0)
    problem, state = only(mesh, joint, *held, pressed, material=steel, model=model)
    (zone,), sigma, up = state.zones, stresses(problem, state), problem.space.dim - 1
    size = 50 / len(mesh.cells_of(slave)) ** (1 / up)
    assert zone.pressure / 25 == pytest.approx(1, abs=1e-10) and np.abs(zone.gap).max() < 1e-10 * size
    assert zone.coverage == pytest.approx(1, abs=1e-10) and (zone.status == 1).all()
    assert sigma[:, up] / 25 == pytest.approx(-1, abs=1e-10)
    assert np.abs(np.delete(sigma, [up, 2], axis=1)).max() < 1e-10 * 25
    assert state.iterations <= 2  # code_aster's
