"""Bolts that are tightened: columns in closed form on all cells, moments of a bent bolt, sections that are refused."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh import join
from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.generate import box, rectangle
from lacsolver.case import CaseError, Displacement, Dynamics, Material, Pressure, Pretension, Rigid, Steps, Traction
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.results.figures import step_figures
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.tables import table
from tests.problem_meshes import joint
from tests.problems import case_of, contact, fix
from tests.samples import each_option

E = 1000.0
KINDS = [name for name, cell in CELLS.items() if cell.dim > 1]
SHORTENED = ["TRIA6", "QUAD4", "TETRA4", "HEXA20", "PENTA15"]
STEPS = Steps(times=[1.0, 2.0, 3.0, 4.0])
TIGHTENED = {"force": [[0, 0], [1, 10]], "lock": 1.0}


def tightened(mesh, touching=None, **keys):
    """The case: the feet are held, the heads move together under a force 0, 10, 20, 30 at the times 1 to 4."""
    d = mesh.space_dim
    free = {"ux": 0.0, "uy": 0.0} if d == 3 else {"ux": 0.0}
    heads = Rigid(group="head", **free, **{"fz" if d == 3 else "fy": [[0, 0], [1, 0], [4, 30]]})
    bolt = Pretension(**{"group": "shank"} | keys)
    records = touching or contact(), fix("foot", "xyz"[:d]), heads, bolt, STEPS
    return case_of(mesh, Material(young=E, poisson=0.0), *records, model="3d" if d == 3 else "plane_stress")


def marched(case):
    """Of each step the bolt, and the contact force along it."""
    out, problem = [], Problem.of(case)
    for state in march(problem):
        step = step_figures(problem, state)
        out.append((step.pretension[case.pretension[0].name], -step.contact["slave"].resultant[-1]))
    return out


#: F0 + F kb / (kb + kc) until F = 20, where the lid leaves the foot, and F after it; kb = kc
LOCKED = [10.0, 15.0, 20.0, 30.0]


@pytest.mark.rows("TRIA6", "QUAD4")
@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind not in SHORTENED)) for kind in KINDS]
)
def test_a_locked_bolt_between_clamped_columns(kind):
    steps = marched(tightened(joint(kind, m=3), **TIGHTENED))
    np.testing.assert_allclose([bolt.force for bolt, _ in steps], LOCKED, rtol=1e-10)
    np.testing.assert_allclose([f for _, f in steps], [10, 5, 0, 0], atol=1e-9)
    np.testing.assert_allclose([bolt.shortening for bolt, _ in steps], 10 * (2 / E + 2 / E), rtol=1e-10)


@pytest.mark.rows("TRIA6-False", "QUAD4-True")
@pytest.mark.parametrize("kind, halves", each_option(itertools.product(SHORTENED, (False, True))))
def test_a_bolt_shortened_by_a_length(kind, halves):
    """Forces are as with a lock, also with a section between meshes that do not match."""
    mesh = joint(kind, halves=halves)
    for keys in ({"shortening": [[0, 0], [1, 0.04]]}, {"shortening": [[0, 0], [1, 0.04], [2, 0.5]], "lock": 1.0}):
        np.testing.assert_allclose([bolt.force for bolt, _ in marched(tightened(mesh, **keys))], LOCKED, rtol=1e-10)


@pytest.mark.parametrize("halves", [False, True])
def test_a_force_without_a_lock_stays(halves):
    steps = marched(tightened(joint("HEXA8", halves=halves), force=[[0, 0], [1, 40]]))
    np.testing.assert_allclose([bolt.force for bolt, _ in steps], 40, rtol=1e-10)
    np.testing.assert_allclose([f for _, f in steps], [40, 30, 20, 10], rtol=1e-9)
    np.testing.assert_allclose([bolt.shortening for bolt, _ in steps], [0.16, 0.14, 0.12, 0.1], rtol=1e-10)


@pytest.mark.rows("QUAD4-current")
@pytest.mark.parametrize("kind, geometry", [("QUAD4", "reference"), ("QUAD4", "current"), ("HEXA8", "current")])
def test_a_locked_bolt_is_tightened_over_a_gap(kind, geometry):
    """The lid comes down by the gap of 0.01 before it is clamped; what is clamped is shorter by that."""
    mesh, gap = joint(kind), 0.01
    points = mesh.points.copy()
    points[mesh.nodes_on(mesh.cell_groups["master"]), mesh.space_dim - 1] += gap
    steps = marched(tightened(replace(mesh, points=points), contact(geometry=geometry), **TIGHTENED))
    np.testing.assert_allclose(steps[0][0].shortening, 10 * (2 / E + (2 - gap) / E) + gap, rtol=1e-3)
    k_bolt, k_clamped = E / 2, E / (2 - gap)
    pulled = np.array([0, 10]) * k_bolt / (k_bolt + k_clamped)
    np.testing.assert_allclose([bolt.force for bolt, _ in steps[:2]], 10 + pulled, rtol=1e-9)
    np.testing.assert_allclose([f for _, f in steps[:2]], pulled + 10 - [0, 10], atol=1e-8)


def test_the_bolt_is_in_the_files(tmp_path):
    run(tightened(joint("HEXA8"), **TIGHTENED), create_output(tmp_path / "out"))
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert set(results["pretension"]["shank"]) == {"force", "shortening", "moment", "resultant"}
    forces = [step["pretension"]["shank"]["force"] for step in results["steps"]]
    np.testing.assert_allclose(forces, LOCKED, rtol=1e-10)
    columns = table(tmp_path / "out" / "history.csv")
    np.testing.assert_allclose(columns["pretension.shank.force"], forces, rtol=1e-12)
    assert "pretension.shank.moment.x" in columns


def test_the_normal_is_an_axis_whatever_its_length_and_sign():
    normals = {}, {"normal": (0, 0, 1)}, {"normal": (0, 0, -3)}, {"normal": (0, 0.1, 1)}
    forces = [marched(tightened(joint("HEXA8"), **TIGHTENED, **keys))[1][0].force for keys in normals]
    np.testing.assert_allclose(forces[:3], 15.0, rtol=1e-10)
    assert abs(forces[3] - 15) > 1e-3


@pytest.mark.parametrize("spec", ["7", "2:7", "entity:2:3"])
def test_a_section_may_be_named_by_its_tag(spec):
    mesh = joint("HEXA8")
    entity = np.full((mesh.n_cells, 2), -1)
    entity[mesh.cell_groups["shank"]] = 2, 3
    mesh = replace(mesh, group_tags={"shank": ((2, 7),)}, cell_data={"entity": entity})
    steps = marched(tightened(mesh, group=spec, name="bolt", **TIGHTENED))
    np.testing.assert_allclose([bolt.force for bolt, _ in steps], LOCKED, rtol=1e-10)


def test_a_mesh_that_is_split_and_cut_before_is_the_same():
    mesh = joint("HEXA8")
    before = lacmesh.cut_skin(lacmesh.split(mesh, "shank"), "slave").mesh
    one, other = ([bolt.force for bolt, _ in marched(tightened(m, **TIGHTENED))] for m in (mesh, before))
    np.testing.assert_allclose(other, one, rtol=1e-12)


# ---- forces across the bolt, and moments


def beam(kind, halves=False):
    """A bolt alone, 1 wide and 3 high, with a section at the height 1."""
    up = CELLS[kind].dim - 1
    make = rectangle if up == 1 else box

    def column(n, tall, low, high):
        corner = (*(0,) * up, low)
        return make((*(n,) * up, tall), (*(1,) * up, high - low), kind, corner=corner).only("body", "bottom", "top")

    if halves:
        low = column(2, 2, 0, 1).renamed(bottom="foot", top="shank_a", body="body0")
        return join(low, column(3, 4, 1, 3).renamed(bottom="shank_b", top="end", body="body1"))
    bolt = column(2, 6, 0, 3).with_groups("inner", shank=lambda x: np.abs(x[up] - 1) < 1e-9)
    return bolt.renamed(bottom="foot", top="end")


def bent(mesh, *records, kinematics="small", **keys):
    """A bolt under a traction, unless records have other loads."""
    d = mesh.space_dim
    pull = dict(zip(("tx", "ty", "tz"), (0.3, 0.2, 5.0) if d == 3 else (0.3, 5.0), strict=False))
    material = Material(young=E, poisson=0.3, law="elastic" if kinematics == "small" else "neo_hookean")
    section = [Pretension(**{"group": "shank", "shortening": 0.01} | keys)] if keys.get("group", True) else []
    records = records or (fix("foot", "xyz"[:d]), Traction(group="end", **pull))
    model = "3d" if d == 3 else "plane_strain"
    return case_of(mesh, material, *records, *section, model=model, kinematics=kinematics)


def last(case):
    problem = Problem.of(case)
    *_, state = march(problem)
    return problem, state, step_figures(problem, state).pretension["shank"]


@pytest.mark.rows("QUAD9-True", "PENTA18-True")
@pytest.mark.parametrize("kind, halves", each_option(itertools.product(KINDS, (False, True))))
def test_moments_of_a_bent_bolt(kind, halves):
    """The section carries what acts beyond it: 5 along the bolt, 0.3 and 0.2 across it with an arm of 2."""
    mesh = beam(kind, halves=halves)
    problem, _, bolt = last(bent(mesh))
    assert bolt.force == pytest.approx(5.0, rel=1e-10) and bolt.shortening == pytest.approx(0.01, rel=1e-10)
    sign = np.sign(problem.sections[0].normal[-1])  # side a is below or above
    flat = mesh.space_dim == 2
    np.testing.assert_allclose(sign * bolt.resultant, [0.3, 5.0] if flat else [0.3, 0.2, 5.0], rtol=1e-9)
    np.testing.assert_allclose(sign * bolt.moment, -0.6 if flat else [-0.4, 0.6, 0.0], atol=1e-9)


@pytest.mark.parametrize("halves", [False, True])
def test_a_bolt_with_large_displacements(halves):
    """The force is in balance; the moment has the arm of the deformed bolt."""
    problem, state, bolt = last(bent(beam("HEXA8", halves=halves), kinematics="finite"))
    section = problem.sections[0]
    sign = np.sign(section.normal[2])
    np.testing.assert_allclose(sign * bolt.resultant, [0.3, 0.2, 5.0], rtol=1e-8)
    assert np.isclose(bolt.shortening, 0.01, rtol=1e-10)
    x = problem.space.mesh.points + state.u.reshape(-1, 3)
    f = problem.load(1.0, state.u).reshape(-1, 3)
    centre = x[section.nodes].mean(axis=0)
    np.testing.assert_allclose(sign * bolt.moment, np.cross(x - centre, f).sum(axis=0), atol=2e-2)


def test_a_bolt_in_axisymmetry():
    """The force of the full circle, p A, and no moment."""
    records = fix("foot", "xy"), Pressure(group="end", value=-2.0), Pretension(group="shank", shortening=0.01)
    _, _, bolt = last(case_of(beam("QUAD8"), Material(young=E, poisson=0.3), *records, model="axisymmetric"))
    assert bolt.force == pytest.approx(2 * np.pi, rel=1e-10) and bolt.moment is None


@pytest.mark.rows("None")
@pytest.mark.parametrize("lock", [None, 0.5])
def test_a_bolt_in_motion_swings_about_its_force(lock):
    """A static start tightens it; then an end is let go on its own, and the section holds its force or its length."""
    end = Displacement(group="end", ux=0, uy=0, uz="where(t > 0.5, 1e-3, 0)")
    bolt = Pretension(group="shank", force=[[0, 0], [0.4, 5]], lock=lock)
    material = Material(young=E, poisson=0.0, density=1e-3)
    records = material, fix("foot", "xyz"), end, bolt, Dynamics(start=0.5), Steps(count=40, end=1.0)
    forces = [solution.pretension["shank"] for solution in ls.march(case_of(beam("HEXA8"), *records, model="3d"))]
    assert forces[19].force == pytest.approx(5.0, rel=1e-9)
    late = np.array([bolt.force for bolt in forces[20:]])
    if lock is None:
        np.testing.assert_allclose(late, 5.0, rtol=1e-8)
    else:
        np.testing.assert_allclose(late, 5 + E * 1e-3 / 3, atol=0.05)
        np.testing.assert_allclose([bolt.shortening for bolt in forces[20:]], forces[19].shortening, rtol=1e-9)


def test_the_whole_body_is_back_without_a_shortening():
    """A section with a shortening of 0 is none: displacements as without it."""
    mesh = beam("PENTA15")
    case = bent(mesh, shortening=0.0)
    with_section, without = ls.solve(case), ls.solve(replace(case, pretension=()))
    np.testing.assert_allclose(with_section.u[: mesh.n_nodes], without.u, atol=1e-13)


# ---- sections that are refused


def grouped(mesh, **groups):
    return replace(mesh, cell_groups={**mesh.cell_groups, **groups})


def a_part(mesh):
    """Half of the section."""
    cells = mesh.cell_groups["shank"]
    x = np.array([mesh.points[nodes].mean(axis=1)[:, 0] for _, _, nodes in mesh.select(cells)])[0]
    return grouped(mesh, part=cells[x < 0.5])


def far_sides(mesh):
    return grouped(mesh, far_a=mesh.cell_groups["end"], far_b=mesh.cell_groups["shank"])


@pytest.mark.parametrize(
    ("make", "keys", "words"),
    [
        (lambda mesh: mesh, {"group": "shnk"}, "did you mean shank"),
        (lambda mesh: mesh, {"group": "end"}, "is not divided"),
        (lambda mesh: mesh, {"normal": (1, 0, 0)}, "lies in the section"),
        (a_part, {"group": "part"}, "sides share nodes"),
        (far_sides, {"group": "far"}, "surface of a body"),
        (lambda mesh: lacmesh.cut_skin(mesh, "end").mesh, {}, "split first"),
    ],
)
def test_sections_that_are_refused(make, keys, words):
    case = bent(make(beam("HEXA8")), **{"shortening": None, "force": 1.0} | keys)
    with pytest.raises(CaseError, match=words) as caught:
        Problem.of(case)
    told = [str(issue) for issue in validate(case).problems]
    assert any(str(caught.value) in one or one in str(caught.value) for one in told)


def test_two_sections_in_one_shank_are_refused():
    """Before their lock nothing holds the part between them: two forces cannot both be that of the shank."""
    mesh = box((1, 1, 3), (1, 1, 3)).with_groups("inner", s1=lambda x: x[2] == 1, s2=lambda x: x[2] == 2)
    bolts = [Pretension(group=f"s{k}", force=[[0, 0], [1, 5.0 + 3 * k]], lock=1.0) for k in (1, 2)]
    records = fix("bottom", "xyz"), fix("top", "xyz"), *bolts, Steps(end=2.0, count=2)
    with pytest.raises(DataError, match="nothing supports a part"):
        ls.solve(case_of(mesh, Material(young=E, poisson=0.0), *records, model="3d"))
