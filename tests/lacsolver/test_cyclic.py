"""Sectors against whole rings, patches across sides that do not match, contact in a sector, rings for ParaView."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial import cKDTree

import lacmesh
import lacsolver as ls
from lacmesh import join
from lacmesh.errors import LacmeshWarning, RequestError
from lacsolver.case import CaseError, Contact, Coupling, Cyclic, Displacement, Material, Output, Pressure, Solver, Steps
from lacsolver.equilibrium.stepping import march
from lacsolver.linear.multigrid.factor import MultigridFactor
from lacsolver.output import create_output
from lacsolver.output.ring import described, fields_of_ring, sector_of
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from tests.lacsolver.patch_meshes import placed
from tests.lacsolver.sectors import ring, sector
from tests.problems import case_of, fix, move
from tests.samples import each_option
from verification.meshes import sectors

CELLS = ["QUAD4", "TRIA6", "HEXA8", "HEXA20", "TETRA10", "PENTA6"]
LAWS = {"small": "elastic", "finite": "neo_hookean"}
SIX = Cyclic(slave="a", master="b", sectors=6)
MULTIGRID = Solver(backend="multigrid")
AROUND = {"origin": [0.0, 0.0], "axis": [0, 0, 1]}
ANGLE = "6 * atan2(y, x)"
#: finite strains have the same equations for all cells
MATCHING = [*((cell, "small", 6) for cell in CELLS), *((cell, "finite", 6) for cell in ("QUAD4", "HEXA8", "HEXA20"))]
MATCHING += [("QUAD4", "small", 2)]


def made(mesh, *records, kinematics="small"):
    model = "3d" if mesh.dim == 3 else "plane_strain"
    material = Material(young=100.0, poisson=0.3, density=1.0, law=LAWS[kinematics])
    return case_of(mesh, material, *records, model=model, kinematics=kinematics)


def solved(*given, **keys):
    problem = Problem.of(made(*given, **keys))
    *_, state = march(problem)
    return problem, state


def is_flat(cell):
    return cell[:4] in ("QUAD", "TRIA")


def counts_of(cell):
    return (3, 4) if is_flat(cell) else (2, 3, 2)


def around(dim, group, **components):
    """Displacements of a group along the radius and around the axis."""
    return Displacement(group=group, axes=AROUND | {"origin": [0.0] * dim}, **components)


def loaded(dim):
    """A load that every sector has, without any other symmetry."""
    inner = around(dim, "in", ux=f"0.01 * t * sin({ANGLE})", uy=f"0.02 * t * cos({ANGLE})")
    pressure = Pressure(group="out", value=f"t * (1 + cos({ANGLE} + 1))")
    return inner, pressure, *([fix("bottom", "z")] if dim == 3 else [])


def rotation(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.rows("QUAD4-small-6", "HEXA8-finite-6")
@pytest.mark.parametrize(("cell", "kinematics", "count"), MATCHING)
def test_a_sector_with_matching_sides_is_a_part_of_the_ring(cell, kinematics, count):
    dim, counts = 2 if is_flat(cell) else 3, counts_of(cell)
    whole, small = ring(cell, counts, count), sector(cell, counts, count)
    _, full = solved(whole, *loaded(dim), kinematics=kinematics)
    problem, part = solved(small, replace(SIX, sectors=count), *loaded(dim), kinematics=kinematics)
    assert problem.case.cyclic[0].matching and not problem.joints
    away, at = cKDTree(whole.points).query(problem.space.mesh.points)
    assert away.max() < 1e-9
    wanted = full.u.reshape(-1, dim)[at]
    np.testing.assert_allclose(part.u.reshape(-1, dim), wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("cell, kinematics", each_option(itertools.product(CELLS, LAWS)))
def test_a_patch_across_sides_that_do_not_match(cell, kinematics):
    """A uniform growth, u = e X, is a uniform strain that every sector has."""
    dim = 2 if is_flat(cell) else 3
    grown = [around(dim, group, ux="0.05 * t * (x**2 + y**2)**0.5", uy=0) for group in ("in", "out")]
    grown += [fix(group, "z") for group in ("bottom", "top")] if dim == 3 else []
    problem, state = solved(sector(cell, counts_of(cell), 6, skew=0.2), SIX, *grown, kinematics=kinematics)
    assert [pair.name for pair in problem.joints] == ["a"]
    wanted = 0.05 * problem.space.mesh.points[:, :dim] * ([1, 1, 0][:dim])
    np.testing.assert_allclose(state.u.reshape(-1, dim), wanted, rtol=0, atol=1e-10)


def turning(angle, size=1.0):
    """Components of a body that grows and turns by so many radians."""
    c, s = (f"{size!r} * {f}({angle!r} * t)" for f in ("cos", "sin"))
    return {"ux": f"x * ({c} - 1) - y * {s}", "uy": f"x * {s} + y * ({c} - 1)"}


@pytest.mark.parametrize("cell", ["QUAD4", "HEXA8"])
def test_the_pressures_of_sides_turn_with_their_sector(cell):
    """A ring that grows and turns by 80 degrees has the pressures of one that grows, along the turned normals."""
    dim, mesh, zones, angle = 2 if is_flat(cell) else 3, sector(cell, counts_of(cell), 6, skew=0.2), [], np.radians(80)
    for turn in (0.0, angle):
        moved = [move(group, **turning(float(turn), 1.05)) for group in ("in", "out")]
        moved += [fix(group, "z") for group in ("bottom", "top")] if dim == 3 else []
        zones.append(solved(mesh, SIX, *moved, Steps(count=4), kinematics="finite")[1].zones[0])
    (grown, turned), R = zones, rotation(angle)[:dim, :dim]
    np.testing.assert_allclose(turned.pressure, grown.pressure, rtol=1e-7)
    assert np.ptp(grown.pressure) < 1e-7 and grown.pressure[0] < -5
    np.testing.assert_allclose(turned.normal, grown.normal @ R.T, atol=1e-8)
    np.testing.assert_allclose(turned.centre, grown.centre @ R.T, atol=1e-8)


def test_the_ring_is_written_for_paraview(tmp_path):
    mesh, out = sector("HEXA8", (2, 2, 1), 6), tmp_path / "out"
    case = made(mesh, replace(SIX, ring=True), Output(), *loaded(3))
    run(case, create_output(out))
    run(case, create_output(out, force=True))
    (file,) = sorted((out / "fields").glob("ring_*.vtu"))
    whole, n = lacmesh.read(file), mesh.n_nodes
    assert whole.n_nodes == 6 * n and (out / "ring.pvd").exists()
    x, u, stress = whole.points, whole.node_data["displacement"], whole.node_data["stress"]
    for k in range(6):
        R, own = rotation(-k * np.pi / 3), slice(k * n, (k + 1) * n)
        np.testing.assert_allclose(x[own], x[:n] @ R.T, atol=1e-14)
        np.testing.assert_allclose(u[own], u[:n] @ R.T, atol=1e-14)
        assert np.allclose(stress[own, :3].sum(axis=1), stress[:n, :3].sum(axis=1))
    apart = cKDTree(x).query_pairs(1e-9, output_type="ndarray")  # where sectors meet their displacements are the same
    assert len(apart) and np.abs(u[apart[:, 0]] - u[apart[:, 1]]).max() < 1e-12


@pytest.mark.parametrize(("counts", "sectors", "angle"), [((3, 4), 7, "51.4286"), ((1, 1), 4, "90")])
def test_sides_that_are_none_are_named(counts, sectors, angle):
    """Also where a side is one edge, of two nodes."""
    with pytest.raises(CaseError, match=f"rotated by {angle} degrees"):
        Problem.of(made(sector("QUAD4", counts, 6), replace(SIX, sectors=sectors)))


# ---- contact in a sector

FEET = fix("foot", "xyz"), fix("head", "xy")


def stacked(make, cell):
    """Two rings, or sectors of them, one on the other; their meshes do not match where they meet."""
    low, high = make(cell, (3, 3, 2), 6), make(cell, (2, 2, 1), 6).moved((0, 0, 1.0))
    low = low.renamed(body="low", bottom="foot", top="slave")
    mesh = join(low, high.renamed(body="high", bottom="master", top="head"))
    return mesh.only(*({"low", "foot", "slave", "high", "master", "head", "a", "b"} & set(mesh.cell_groups)))


@pytest.mark.parametrize(
    ("cell", "hexa"),
    [("HEXA8", "pyramid"), ("HEXA8", "hexa"), pytest.param("TETRA10", "pyramid", marks=pytest.mark.slow)],
)
def test_contact_that_touches_the_sides_is_that_of_the_ring(cell, hexa):
    """Nodes of both bodies are at one place on the sides; the slave is cut up to them."""
    records = (
        *FEET,
        Pressure(group="head", value=f"2 + sin({ANGLE})"),
        Contact(slave="slave", master="master", hexa=hexa),
    )
    _, whole = solved(stacked(ring, cell), *records)
    problem, part = solved(stacked(sector, cell), *records, replace(SIX, hexa=hexa))
    assert problem.case.cyclic[0].matching and len(problem.joints) == 1
    zone, all_zones = part.zones[0], whole.zones[0]
    away, at = cKDTree(all_zones.centre).query(zone.centre)
    if cell == "HEXA8":  # tetrahedra of the ring are not split as those of the sector are
        assert away.max() < 1e-9
        np.testing.assert_allclose(zone.pressure, all_zones.pressure[at], rtol=1e-8)
    sums = [(z.pressure * z.area).sum() for z in (zone, all_zones)]
    assert 6 * sums[0] == pytest.approx(sums[1], rel=1e-9 if cell == "HEXA8" else 1e-4)
    down = [np.abs(state.u.reshape(-1, 3)[:, 2]).max() for state in (part, whole)]
    assert down[0] == pytest.approx(down[1], rel=1e-2)


def test_the_zones_of_a_whole_ring_are_those_of_the_sector_turned():
    rubbed = Contact(name="zone", slave="slave", master="master", friction=0.3)
    lid = Coupling(name="lid", group="head", fz=-20.0, moment=[0.0, 0.0, 2.0])
    solution = ls.solve(made(stacked(sector, "HEXA8"), SIX, rubbed, fix("foot", "xyz"), lid))
    record = sector_of(json.loads(json.dumps({"cyclic": described(solution._solved[0].case)})))
    whole, fields = fields_of_ring(solution.mesh, solution.fields, record)
    assert list(fields.zones) == ["zone"]
    zone, part = (f.zones["zone"] for f in (fields, solution.fields))
    assert len(zone.pressure) == 6 * len(part.pressure) and zone.macro.max() == len(zone.pressure) - 1
    same = cKDTree(whole.points).query_pairs(1e-9, output_type="ndarray")
    same = same[whole.points[same[:, 0], 2] > 1.1]  # above the contact, whose nodes are those of two bodies
    assert len(same) and np.abs(np.diff(fields.displacement[same], axis=1)).max() < 1e-12
    force, own = (one.contact_force[one.surface.faces.distinct_nodes].sum(axis=0) for one in (zone, part))
    np.testing.assert_allclose(force[2], 6 * own[2], rtol=1e-12)
    np.testing.assert_allclose(force[:2], 0, atol=1e-12 * abs(force[2]))
    np.testing.assert_allclose(zone.friction.resultant[:2], 0, atol=1e-12 * abs(force[2]))
    middle = whole.points[zone.surface.faces.corners[:, :3]].mean(axis=1)
    ((_, _, nodes),) = whole.select(zone.surface.cell)
    np.testing.assert_array_equal(np.sort(nodes), np.sort(zone.surface.faces.nodes[:, : nodes.shape[1]]))
    radius = np.hypot(*middle.T[:2]).reshape(6, -1)
    np.testing.assert_allclose(radius, np.broadcast_to(radius[0], radius.shape))
    with pytest.raises(RequestError, match=r"no \[\[cyclic\]\]"):
        sector_of({"contact": {}})


def fitted(turned, outer, *records, **keys):
    """A press fit as one of 6 sectors, whose hub is cut elsewhere than its shaft by so many degrees."""
    shaft, hub = (sectors.sector("QUAD4", (2, 12), radii, 6) for radii in ((1.0, 2.0), (2.0, 3.0)))
    hub = placed(hub, turn=rotation(np.radians(turned))).renamed(**{"in": "slave", "out": "outer"})
    touching = Contact(slave="slave", master="master", clearance=-0.01, **keys.pop("contact", {}))
    mesh = join(shaft.renamed(**{"in": "inner", "out": "master"}), hub)
    return made(mesh, SIX, touching, fix("inner", "xy"), outer, *records, **keys)


pressed = partial(fitted, outer=around(2, "outer", uy=0.0))


def test_a_slave_in_its_sector_is_pressed_evenly_and_one_that_leaves_it_is_refused():
    ((zone,),) = (state.zones for state in march(Problem.of(pressed(0.0))))
    assert np.ptp(zone.pressure) <= 0.02 * zone.pressure.mean()
    for degrees in (3.0, 30.0, -20.0):
        with pytest.raises(CaseError, match="of a neighbouring sector"):
            ls.solve(pressed(degrees))
    with pytest.warns(LacmeshWarning, match=r"1\.7 % of"):
        ls.solve(pressed(1.0))


def test_a_hub_that_slides_out_of_its_sector_ends_the_run(tmp_path):
    """It turns by 1.1 degrees of 60 in the first step, of which it is warned, and by as much again in the second."""
    steps, current = Steps(count=2), {"geometry": "current"}
    case = fitted(0.0, move("outer", **turning(0.04)), steps, contact=current, kinematics="finite")
    with (
        pytest.warns(LacmeshWarning, match=r"at time 0\.5 1\.9 %"),
        pytest.raises(CaseError, match=r"at time 1 3\.8 % .* whole ring"),
    ):
        ls.run(case, tmp_path / "out")
    results = ls.read_results(tmp_path / "out")
    assert results.status == "failed" and results.times.tolist() == [0.5]


# ---- multigrid, round-off, modes


@pytest.fixture
def cycles(monkeypatch):
    """Numbers of V-cycles, the last of which counts."""
    counts, cycle = [0], MultigridFactor.cycle

    def counted(factor, f):
        counts[-1] += 1
        return cycle(factor, f)

    monkeypatch.setattr(MultigridFactor, "cycle", counted)
    return counts


@pytest.mark.rows("0.2")
@pytest.mark.parametrize("skew", [0.0, 0.2])
def test_multigrid_solves_a_sector(skew):
    records = sector("HEXA8", (3, 4, 3), 6, skew=skew), SIX, *loaded(3)
    one, other = (solved(*records, Solver(backend=name))[1].u for name in ("auto", "multigrid"))
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-8 * np.abs(one).max())


def test_a_sector_takes_no_more_cycles_than_one_with_free_sides(cycles):
    """Multigrid aggregates nodes of one side with those of their own cells: the other side's modes are turned."""
    records = sector("HEXA8", (8, 8, 8), 6), fix("bottom", "xyz"), Pressure(group="out", value=1.0), MULTIGRID
    solved(*records, SIX)
    cycles.append(0)
    solved(*records)
    assert 10 < cycles[0] <= cycles[1]


def test_supports_along_local_axes_take_no_more_cycles(cycles):
    """A body that is turned, with its supports along axes that are turned too: multigrid has its nodes and modes."""
    answers, mesh, R = [], sector("HEXA8", (8, 8, 8), 6), rotation(0.3)
    local = {"x": R[:, 0].tolist(), "xy": R[:, 1].tolist()}
    for turned, axes in ((mesh, None), (replace(mesh, points=mesh.points @ R.T), local)):
        ways = ("out", "uy"), ("b", "ux"), ("bottom", "uz")
        held = [Displacement(group=group, axes=axes, **{way: 0.0}) for group, way in ways]
        answers.append(solved(turned, *held, Pressure(group="in", value=1.0), MULTIGRID)[1].u.reshape(-1, 3))
        cycles.append(0)
    assert 10 < cycles[1] <= cycles[0] + 2
    np.testing.assert_allclose(answers[1] @ R, answers[0], rtol=0, atol=1e-8 * np.abs(answers[0]).max())


@pytest.mark.parametrize("given", [np.float64, np.float32])
@pytest.mark.parametrize("turned", [0.0, 0.1])
def test_round_off_of_axes_is_no_equation(turned, given):
    """A quarter of a ring, whose rim has u_theta = 0: the corners move as all others do, wherever the sides lie."""
    mesh = sector("QUAD4", (2, 3), 4)
    points = (mesh.points @ rotation(turned).T).astype(given).astype(float)
    records = replace(SIX, sectors=4), around(2, "out", uy=0), Pressure(group="in", value=5.0)
    _, state = solved(replace(mesh, points=points), *records)
    away = np.linalg.norm(points, axis=1)
    radial, radius = (state.u.reshape(-1, 2) * points[:, :2]).sum(axis=1) / away, away.round(3)
    for r in np.unique(radius):
        np.testing.assert_allclose(radial[radius == r], radial[radius == r].max(), rtol=1e-5)
        assert radial[radius == r].max() > 0.01


def test_modes_of_a_sector_are_those_of_the_ring_without_nodal_diameters():
    """Their effective mass along the axis is the same part of the mass; across it the sectors' motions cancel."""
    counts, n = (2, 2, 1), 6
    with pytest.warns(LacmeshWarning, match="all 6 sectors move alike"):
        one = ls.natural_modes(made(sector("HEXA8", counts, n), SIX, fix("in", "xyz")), count=3)
    every = ls.natural_modes(made(ring("HEXA8", counts, n), fix("in", "xyz")), count=60)
    assert one.sectors == n and every.sectors == 0
    assert (one.effective_masses[:, :2] <= 1e-12 * one.mass).all()
    for frequency, masses in zip(one.frequencies, one.effective_masses, strict=True):
        same = np.isclose(every.frequencies, frequency, rtol=1e-9)
        assert same.any() and masses[2] / one.mass == pytest.approx(
            every.effective_masses[same, 2].sum() / every.mass, abs=1e-9
        )
