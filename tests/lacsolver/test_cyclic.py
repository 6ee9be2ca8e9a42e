"""Sectors against whole rings, patches across sides that do not match, contact in a sector, rings for ParaView."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import lacmesh
import lacsolver as ls
from lacmesh import Mesh
from lacmesh.errors import RequestError
from lacsolver.case import (
    Case,
    CaseError,
    Contact,
    Cyclic,
    Displacement,
    Material,
    Output,
    Pressure,
    Solver,
    Steps,
)
from lacsolver.equilibrium.stepping import march
from lacsolver.linear.multigrid.factor import MultigridFactor
from lacsolver.output import create_output
from lacsolver.output.ring import described, fields_of_ring, sector_of
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from tests.lacsolver.distributed.cases import JOINED
from tests.lacsolver.patch_meshes import placed
from tests.lacsolver.sectors import ring, sector
from tests.samples import each_option
from verification.meshes import sectors
from verification.meshes.blocks import joined

CELLS = ["QUAD4", "TRIA6", "HEXA8", "HEXA20", "TETRA10", "PENTA6"]
SIDES = {"slave": "a", "master": "b", "sectors": 6}
LAWS = {"small": "elastic", "finite": "neo_hookean"}
#: finite strains have the same equations for all cells
MATCHING = [*((cell, "small") for cell in CELLS), *((cell, "finite") for cell in ("QUAD4", "HEXA8", "HEXA20"))]


def dim_of(cell):
    return 2 if cell[:4] in ("QUAD", "TRIA") else 3


def counts_of(cell):
    return (3, 4) if dim_of(cell) == 2 else (2, 3, 2)


def made(mesh, kinematics="small", **keys):
    model = "3d" if mesh.dim == 3 else "plane_strain"
    material = Material(young=100.0, poisson=0.3, law=LAWS[kinematics])
    return Case(mesh=mesh, model=model, kinematics=kinematics, material=material, **keys)


def solved(case):
    problem = Problem.of(case)
    *_, state = march(problem)
    return problem, state


def loaded(dim):
    """A load that every sector has, without any other symmetry."""
    axes = {"origin": [0.0] * dim, "axis": [0, 0, 1]}
    angle = "6 * atan2(y, x)"
    held = [Displacement(group="in", ux=f"0.01 * t * sin({angle})", uy=f"0.02 * t * cos({angle})", axes=axes)]
    held += [Displacement(group="bottom", uz=0)] if dim == 3 else []
    return {"displacement": held, "pressure": Pressure(group="out", value=f"t * (1 + cos({angle} + 1))")}


@pytest.mark.parametrize(("cell", "kinematics"), MATCHING)
def test_a_sector_with_matching_sides_is_a_part_of_the_ring(cell, kinematics):
    dim, counts = dim_of(cell), counts_of(cell)
    whole, small = ring(cell, counts, 6), sector(cell, counts, 6)
    _, full = solved(made(whole, kinematics, **loaded(dim)))
    problem, part = solved(made(small, kinematics, cyclic=Cyclic(**SIDES), **loaded(dim)))
    assert problem.case.cyclic[0].matching and not problem.joints
    away, at = cKDTree(whole.points).query(problem.space.mesh.points)
    assert away.max() < 1e-9
    wanted = full.u.reshape(-1, dim)[at]
    np.testing.assert_allclose(part.u.reshape(-1, dim), wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("cell, kinematics", each_option(itertools.product(CELLS, LAWS)))
def test_a_patch_across_sides_that_do_not_match(cell, kinematics):
    """A uniform growth, u = e X, is a uniform strain that every sector has."""
    dim = dim_of(cell)
    axes = {"origin": [0.0] * dim, "axis": [0, 0, 1]}
    grown = [Displacement(group="out", ux="0.05 * t * (x**2 + y**2)**0.5", uy=0, axes=axes)]
    grown += [replace(grown[0], group="in")]
    grown += [Displacement(group=g, uz=0) for g in ("bottom", "top")] if dim == 3 else []
    mesh = sector(cell, counts_of(cell), 6, skew=0.2)
    problem, state = solved(made(mesh, kinematics, cyclic=Cyclic(**SIDES), displacement=grown))
    assert [pair.name for pair in problem.joints] == ["a"]
    wanted = 0.05 * problem.space.mesh.points[:, :dim] * ([1, 1, 0][:dim])
    np.testing.assert_allclose(state.u.reshape(-1, dim), wanted, rtol=0, atol=1e-10)


@pytest.mark.parametrize("cell", ["QUAD4", "HEXA8"])
def test_the_pressures_of_sides_turn_with_their_sector(cell):
    """A ring that grows and turns by 80 degrees has the pressures of one that grows, along the turned normals."""
    dim, mesh, zones = dim_of(cell), sector(cell, counts_of(cell), 6, skew=0.2), []
    for angle in (0.0, np.radians(80)):
        c, s = (f"1.05 * {f}({angle} * t)" for f in ("cos", "sin"))
        turned = {"ux": f"x * ({c} - 1) - y * {s}", "uy": f"x * {s} + y * ({c} - 1)"}
        moved = [Displacement(group=g, **turned) for g in ("in", "out")]
        moved += [Displacement(group=g, uz=0) for g in ("bottom", "top")] if dim == 3 else []
        case = made(mesh, "finite", cyclic=Cyclic(**SIDES), displacement=moved, steps=Steps(count=4))
        zones.append(solved(case)[1].zones[0])
    grown, turned = zones
    R = np.eye(dim)
    R[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    np.testing.assert_allclose(turned.pressure, grown.pressure, rtol=1e-7)
    assert np.ptp(grown.pressure) < 1e-7 and grown.pressure[0] < -5
    np.testing.assert_allclose(turned.normal, grown.normal @ R.T, atol=1e-8)
    np.testing.assert_allclose(turned.centre, grown.centre @ R.T, atol=1e-8)


def test_sides_that_do_not_match_come_close_to_those_that_do():
    answers = []
    for n in (4, 8):
        fine = [solved(made(sector("QUAD8", (n, n), 6, skew=s), cyclic=Cyclic(**SIDES), **loaded(2))) for s in (0, 0.2)]
        energies = [problem.kinematics.energy(state.u, 1.0, ()) for problem, state in fine]
        answers.append(abs(energies[1] / energies[0] - 1))
    assert answers[1] < answers[0] / 4 and answers[1] < 2e-3


@pytest.mark.parametrize("skew", [0.0, 0.2])
def test_multigrid_solves_a_sector(skew):
    mesh = sector("HEXA8", (3, 4, 3), 6, skew=skew)
    answers = [
        solved(made(mesh, cyclic=Cyclic(**SIDES), solver=Solver(backend=name), **loaded(3)))[1].u
        for name in ("auto", "multigrid")
    ]
    np.testing.assert_allclose(answers[1], answers[0], rtol=0, atol=1e-8 * np.abs(answers[0]).max())


def test_two_sectors_and_an_axis_elsewhere():
    """Half a ring, moved, about an axis through its own middle."""
    mesh = sector("QUAD4", (3, 8), 2)
    moved = replace(mesh, points=mesh.points + np.array([3.0, -2.0, 0]))
    kept = {"slave": "a", "master": "b", "sectors": 2}
    load = {"displacement": Displacement(group="in", ux=0, uy=0), "pressure": Pressure(group="out", value=1.0)}
    _, one = solved(made(mesh, cyclic=Cyclic(**kept), **load))
    problem, other = solved(made(moved, cyclic=Cyclic(**kept, origin=[3.0, -2.0]), **load))
    assert problem.case.cyclic[0].matching
    np.testing.assert_allclose(other.u, one.u, atol=1e-13)


def test_the_ring_is_written_for_paraview(tmp_path):
    mesh = sector("HEXA8", (2, 2, 1), 6)
    case = made(mesh, cyclic=Cyclic(**SIDES, ring=True), output=Output(), **loaded(3))
    run(case, create_output(tmp_path / "out"))
    run(case, create_output(tmp_path / "out", force=True))
    (file,) = sorted((tmp_path / "out" / "fields").glob("ring_*.vtu"))
    whole = lacmesh.read(file)
    assert whole.n_nodes == 6 * mesh.n_nodes and (tmp_path / "out" / "ring.pvd").exists()
    x, u, stress = whole.points, whole.node_data["displacement"], whole.node_data["stress"]
    n = mesh.n_nodes
    for k in range(6):
        c, s = np.cos(k * np.pi / 3), -np.sin(k * np.pi / 3)
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        own = slice(k * n, (k + 1) * n)
        np.testing.assert_allclose(x[own], x[:n] @ R.T, atol=1e-14)
        np.testing.assert_allclose(u[own], u[:n] @ R.T, atol=1e-14)
        assert np.allclose(stress[own, :3].sum(axis=1), stress[:n, :3].sum(axis=1))
    apart = cKDTree(x).query_pairs(1e-9, output_type="ndarray")  # where sectors meet their displacements are the same
    assert len(apart) and np.abs(u[apart[:, 0]] - u[apart[:, 1]]).max() < 1e-12


def test_sides_that_are_none_are_named():
    mesh = sector("QUAD4", (3, 4), 6)
    wrong = {**SIDES, "sectors": 7}
    with pytest.raises(CaseError, match=r"turned by 51.4286 degrees, master 'b' is .* away from slave 'a'; check"):
        Problem.of(made(mesh, cyclic=Cyclic(**wrong)))


def test_a_restart_goes_on_in_a_sector(tmp_path):
    from lacsolver.output import read_state

    case = made(sector("QUAD4", (2, 3), 6, skew=0.2), cyclic=Cyclic(**SIDES), steps=Steps(count=2), **loaded(2))
    whole = run(case, create_output(tmp_path / "one"))
    again = run(case, create_output(tmp_path / "two"), start=read_state(tmp_path / "one", case, 0.5))
    assert again.steps[-1].energy == pytest.approx(whole.steps[-1].energy, rel=1e-10)


def stacked(make, cell):
    """Two rings, or sectors of them, one on the other; their meshes do not match where they meet."""
    low, high = make(cell, (3, 3, 2), 6), make(cell, (2, 2, 1), 6)
    up = Mesh.create(high.points + np.array([0, 0, 1.0]), high.blocks, cell_groups=high.cell_groups)
    names = {"a": "a", "b": "b"}
    return joined([
        (low, {**names, "body": "low", "bottom": "foot", "top": "slave"}),
        (up, {**names, "body": "high", "bottom": "master", "top": "head"}),
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("cell", "hexa"),
    [("HEXA8", "pyramid"), ("HEXA8", "hexa"), pytest.param("TETRA10", "pyramid", marks=pytest.mark.slow)],
)
def test_contact_that_touches_the_sides_is_that_of_the_ring(cell, hexa):
    """Nodes of both bodies are at one place on the sides; the slave is cut up to them."""
    angle = "6 * atan2(y, x)"
    keys = {
        "displacement": [Displacement(group="foot", ux=0, uy=0, uz=0), Displacement(group="head", ux=0, uy=0)],
        "pressure": Pressure(group="head", value=f"2 + sin({angle})"),
    }
    touching = Contact(slave="slave", master="master", hexa=hexa)
    _, whole = solved(made(stacked(ring, cell), contact=touching, **keys))
    problem, part = solved(made(stacked(sector, cell), contact=touching, cyclic=Cyclic(**SIDES, hexa=hexa), **keys))
    assert problem.case.cyclic[0].matching and len(problem.joints) == 1
    zone, all_zones = part.zones[0], whole.zones[0]
    away, at = cKDTree(all_zones.centre).query(zone.centre)
    if cell == "HEXA8":  # tetrahedra of the ring are not split as those of the sector are
        assert away.max() < 1e-9
        np.testing.assert_allclose(zone.pressure, all_zones.pressure[at], rtol=1e-8)
    sums = [(z.pressure * z.area).sum() for z in (zone, all_zones)]
    assert 6 * sums[0] == pytest.approx(sums[1], rel=1e-9 if cell == "HEXA8" else 1e-4)
    assert abs(part.u.reshape(-1, 3)[:, 2]).max() == pytest.approx(abs(whole.u.reshape(-1, 3)[:, 2]).max(), rel=1e-2)


def test_the_zones_of_a_whole_ring_are_those_of_the_sector_turned():
    solution = ls.solve(JOINED["a sector with friction"].case())
    record = sector_of(json.loads(json.dumps({"cyclic": described(solution._solved[0].case)})))
    whole, fields = fields_of_ring(solution.mesh, solution.fields, record)
    (name,) = fields.zones
    zone, part = (f.zones["zone"] for f in (fields, solution.fields))
    assert (
        name == "zone" and len(zone.pressure) == 6 * len(part.pressure) and zone.macro.max() == len(zone.pressure) - 1
    )
    same = cKDTree(whole.points).query_pairs(1e-9, output_type="ndarray")
    same = same[whole.points[same[:, 0], 2] > 1.1]  # above the contact, whose nodes are those of two bodies
    assert len(same) and np.abs(np.diff(fields.displacement[same], axis=1)).max() < 1e-12
    force, own = (one.contact_force[one.surface.faces.distinct_nodes].sum(axis=0) for one in (zone, part))
    np.testing.assert_allclose(force[2], 6 * own[2], rtol=1e-12)
    np.testing.assert_allclose(force[:2], 0, atol=1e-12 * abs(force[2]))
    np.testing.assert_allclose(zone.friction.resultant[:2], 0, atol=1e-12 * abs(force[2]))
    middle = whole.points[zone.surface.faces.corners[:, :3]].mean(axis=1)
    radius = np.hypot(*middle.T[:2]).reshape(6, -1)
    np.testing.assert_allclose(radius, np.broadcast_to(radius[0], radius.shape))
    with pytest.raises(RequestError, match=r"has no \[\[cyclic\]\]"):
        sector_of({"contact": {}})


@pytest.fixture
def cycles(monkeypatch):
    """Numbers of V-cycles, the last of which counts."""
    counts, cycle = [0], MultigridFactor.cycle

    def counted(factor, f):
        counts[-1] += 1
        return cycle(factor, f)

    monkeypatch.setattr(MultigridFactor, "cycle", counted)
    return counts


def test_a_sector_takes_no_more_cycles_than_one_with_free_sides(cycles):
    """Multigrid aggregates nodes of one side with those of their own cells: the other side's modes are turned."""
    mesh = sector("HEXA8", (8, 8, 8), 6)
    held = Displacement(group="bottom", ux=0, uy=0, uz=0)
    keys = {"displacement": held, "pressure": Pressure(group="out", value=1.0), "solver": Solver(backend="multigrid")}
    for sides in ({"cyclic": Cyclic(**SIDES)}, {}):
        solved(made(mesh, **keys, **sides))
        cycles.append(0)
    assert 10 < cycles[0] <= cycles[1]


def test_supports_along_local_axes_take_no_more_cycles(cycles):
    """A body that is turned, with its supports along axes that are turned too: multigrid has its nodes and modes."""
    answers, (c, s) = [], (np.cos(0.3), np.sin(0.3))
    mesh, R = sector("HEXA8", (8, 8, 8), 6), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    keys = {"pressure": Pressure(group="in", value=1.0), "solver": Solver(backend="multigrid")}
    local = {"x": [c, s, 0.0], "xy": [-s, c, 0.0]}
    for turned, axes in ((mesh, None), (replace(mesh, points=mesh.points @ R.T), local)):
        supports = {"out": {"uy": 0}, "b": {"ux": 0}, "bottom": {"uz": 0}}
        held = [Displacement(group=group, axes=axes, **way) for group, way in supports.items()]
        answers.append(solved(made(turned, displacement=held, **keys))[1].u.reshape(-1, 3))
        cycles.append(0)
    assert 10 < cycles[1] <= cycles[0] + 2
    np.testing.assert_allclose(answers[1] @ R, answers[0], rtol=0, atol=1e-8 * np.abs(answers[0]).max())


@pytest.mark.parametrize("given", [np.float64, np.float32])
@pytest.mark.parametrize("turned", [0.0, 0.1])
def test_round_off_of_axes_is_no_equation(turned, given):
    """A quarter of a ring, whose rim has u_theta = 0: the corners move as all others do, wherever the sides lie."""
    mesh = sector("QUAD4", (2, 3), 4)
    c, s = np.cos(turned), np.sin(turned)
    points = (mesh.points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])).astype(given).astype(float)
    rim = Displacement(group="out", uy=0, axes={"origin": [0, 0], "axis": [0, 0, 1]})
    sides = Cyclic(slave="a", master="b", sectors=4)
    case = made(replace(mesh, points=points), cyclic=sides, displacement=rim, pressure=Pressure(group="in", value=5.0))
    _, state = solved(case)
    radius = np.linalg.norm(points, axis=1).round(3)
    radial = (state.u.reshape(-1, 2) * points[:, :2]).sum(axis=1) / np.linalg.norm(points, axis=1)
    for r in np.unique(radius):
        np.testing.assert_allclose(radial[radius == r], radial[radius == r].max(), rtol=1e-5)
        assert radial[radius == r].max() > 0.01


# ---- slaves that leave their sector


def fitted(turned):
    """A press fit as one of 6 sectors, whose hub is cut elsewhere than its shaft by so many degrees."""
    shaft, hub = (sectors.sector("QUAD4", (2, 12), radii, 6) for radii in ((1.0, 2.0), (2.0, 3.0)))
    c, s = np.cos(np.radians(turned)), np.sin(np.radians(turned))
    hub = placed(hub, turn=np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    parts = {"a": "a", "b": "b"}
    return joined([(shaft, {"in": "inner", "out": "master", **parts}), (hub, {"in": "slave", "out": "outer", **parts})])


def pressed(turned, **keys):
    return made(
        fitted(turned),
        cyclic=Cyclic(**SIDES),
        contact=Contact(slave="slave", master="master", clearance=-0.01, **keys),
        displacement=(
            Displacement(group="inner", ux=0.0, uy=0.0),
            Displacement(group="outer", uy=0.0, axes={"origin": [0.0, 0.0], "axis": [0.0, 0.0, 1.0]}),
        ),
    )


@pytest.mark.parametrize("degrees", [3.0, 30.0, -20.0])
def test_a_slave_that_leaves_its_sector_is_refused(degrees):
    with pytest.raises(CaseError, match="of the area of slave 'slave' has master 'master' of a neighbouring sector"):
        ls.solve(pressed(degrees))


def test_a_slave_that_hardly_leaves_its_sector_is_warned_of():
    with pytest.warns(
        lacmesh.errors.LacmeshWarning, match="1.7 % of the area of slave 'slave' has master 'master' of a"
    ):
        ls.solve(pressed(1.0))


def test_a_slave_in_its_sector_is_pressed_evenly():
    *_, state = march(Problem.of(pressed(0.0)))
    (zone,) = state.zones
    pressure = zone.pressure
    assert np.ptp(pressure) <= 0.02 * pressure.mean()


def sliding(angle):
    """A hub that turns by so many radians in two steps."""
    case = pressed(0.0, geometry="current")
    turn = {
        "ux": f"x * (cos({angle} * t) - 1) - y * sin({angle} * t)",
        "uy": f"x * sin({angle} * t) + y * (cos({angle} * t) - 1)",
    }
    moved = (case.displacement[0], Displacement(group="outer", **turn))
    return made(case.mesh, "finite", cyclic=case.cyclic, contact=case.contact, displacement=moved, steps=Steps(count=2))


def test_a_hub_that_slides_out_of_its_sector_ends_the_run(tmp_path):
    """It turns by 1.1 degrees of 60 in the first step, of which it is warned, and by as much again in the second."""
    with (
        pytest.warns(lacmesh.errors.LacmeshWarning, match="contact 'slave' at time 0.5 1.9 % of the area of slave"),
        pytest.raises(CaseError, match=r"contact: at time 1 3.8 % of the area .* neighbouring sector .* whole ring"),
    ):
        ls.run(sliding(0.04), tmp_path / "out")
    results = ls.read_results(tmp_path / "out")
    assert results.status == "failed" and results.times.tolist() == [0.5]


# ---- natural modes of a sector


def heavy(mesh, **keys):
    foot = Displacement(group="in", ux=0.0, uy=0.0, uz=0.0)
    material = Material(young=100.0, poisson=0.3, density=1.0)
    return Case(mesh=mesh, model="3d", material=material, displacement=foot, **keys)


def test_modes_of_a_sector_are_those_of_the_ring_without_nodal_diameters():
    """Their effective mass along the axis is the same part of the mass; across it the sectors' motions cancel."""
    counts, n = (2, 2, 1), 6
    with pytest.warns(lacmesh.errors.LacmeshWarning, match="all 6 sectors move alike, .* 1 to 3 of them, .* left out"):
        one = ls.natural_modes(heavy(sector("HEXA8", counts, n), cyclic=Cyclic(**SIDES)), count=3)
    every = ls.natural_modes(heavy(ring("HEXA8", counts, n)), count=60)
    assert one.sectors == n and every.sectors == 0
    assert (one.effective_masses[:, :2] <= 1e-12 * one.mass).all()
    for frequency, masses in zip(one.frequencies, one.effective_masses, strict=True):
        same = np.isclose(every.frequencies, frequency, rtol=1e-9)
        assert same.any() and masses[2] / one.mass == pytest.approx(
            every.effective_masses[same, 2].sum() / every.mass, abs=1e-9
        )
