"""The first lines of a user of scikit-fem, meshio or pyvista: a case in Python, a solution, matrices, results."""

from __future__ import annotations

import logging
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import splu

import lacmesh
import lacsolver as ls
from lacmesh.errors import DataError, LacmeshError, LacmeshWarning, ReadError, RequestError
from lacsolver.case.errors import Issue
from lacsolver.contact.laws import Bilateral, Unilateral
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import state_fields
from lacsolver.results.figures import step_figures
from lacsolver.validation import Validation
from tests.lacsolver.patch_meshes import stack
from tests.problems import contact, fix, move
from verification.measures.cutting import sizes

CASE, MESH, DISC = "data/two_blocks.toml", "data/two_blocks.msh", "data/disc_on_block.msh"


def case_of(value=25.0, **more):
    """The case of data/two_blocks.toml without a mesh, in one step."""
    own = {
        "model": "3d",
        "material": [ls.Material(young=2000.0, poisson=0.3)],
        "contact": [contact()],
        "displacement": [fix("bottom", "xyz"), fix("symmetry_x", "x"), fix("symmetry_y", "y")],
        "pressure": [ls.Pressure(group="top", value=value)],
    }
    return ls.Case(**own | more)


@pytest.fixture(scope="module")
def mesh():
    return lacmesh.read(MESH)


@pytest.fixture(scope="module")
def solution(mesh):
    return ls.solve(case_of(), mesh)


@pytest.fixture(scope="module")
def disc():
    """A quarter of a disc pressed onto a block by a displacement, on which some macro-elements stay open."""
    case = ls.Case(
        mesh=DISC,
        model="plane_strain",
        material=[ls.Material(young=1.0, poisson=0.3)],
        contact=[contact()],
        displacement=[fix("bottom", "xy"), fix("symmetry_x", "x"), move("top", uy=-0.1)],
    )
    with pytest.warns(LacmeshWarning, match=r"in front of 47\.9 % of slave"):
        return case, ls.solve(case)


# ---- a solution


def test_a_solution_has_the_figures_and_fields_of_its_state(mesh, solution, disc):
    problem = Problem.of(case_of(), mesh)
    (state,) = march(problem)
    zone, fields = step_figures(problem, state).contact["slave"], state_fields(problem, state)
    own = solution.contact["slave"]
    assert np.array_equal(solution.u.ravel(), state.u) and np.array_equal(own.pressure, state.zones[0].pressure)
    assert np.allclose(own.resultant, zone.resultant, rtol=1e-12)
    assert np.array_equal(solution.stress(), fields.stress, equal_nan=True)
    assert own.force.shape == solution.u.shape and solution.mesh.n_nodes == len(solution.u)
    assert {getattr(own, name).shape for name in ("gap", "status", "area", "recovered", "pressure")} == {(36,)}
    assert own.centre.shape == own.normal.shape == (36, 3)
    assert (own.status == 1).all() and solution.time == 1.0 and solution.iterations >= 1
    zone = disc[1].figures.contact["slave"]  # the moment of a plane model is one number
    assert "moment" in repr(zone) and float(zone.moment) == zone.moment


def test_stress_in_cells_is_the_mean_of_each_and_von_mises_that_of_a_bar():
    bar = lacmesh.generate.rectangle((2, 1), (2, 1)).only("body", "left", "right")
    case = ls.Case(
        model="plane_stress",
        material=[ls.Material(young=100.0, poisson=0.3)],
        displacement=[fix("left", "x"), ls.Displacement(at=[0, 0], uy=0)],
        traction=[ls.Traction(group="right", tx=7.0)],
    )
    solution = ls.solve(case, bar)
    cells, solid = solution.stress("cells"), bar.cell_dim == 2
    assert np.allclose(cells[solid], [7, 0, 0, 0], atol=1e-12) and np.isnan(cells[~solid]).all()
    assert np.allclose(solution.von_mises(), 7) and np.allclose(solution.von_mises("cells")[solid], 7)
    with pytest.raises(ValueError, match='"nodes" or "cells"'):
        solution.stress("points")


def test_paths_are_taken_everywhere_and_reactions_probes_and_contacts_are_found_by_name(tmp_path):
    """In equilibrium with the load; a solution that is read from its folder has the same."""
    assert [solution.time for solution in ls.march(CASE)] == [0.5, 1.0]
    done = ls.run(CASE, tmp_path / "results")
    assert done.status == "done" and (tmp_path / "results" / "results.json").is_file()
    with pytest.raises(RequestError, match="holds results already"):
        ls.run(CASE, str(tmp_path / "results"))
    for one in (ls.read_results(tmp_path / "results").solution(), ls.solve(CASE)):
        assert one.reactions["bottom"][2] == pytest.approx(10.435185, rel=1e-6)
        assert sum(one.reactions.values())[:2] == pytest.approx([0, 0], abs=1e-9)
        assert one.probes["corner"] == pytest.approx(done.steps[-1].probes["corner"], rel=1e-12, abs=1e-15)
        for of, there in ((one.reactions, "bottom"), (one.probes, "corner"), (one.contact, "joint")):
            with pytest.raises(KeyError, match=f"no 'xyz' here; there are: .*{there}"):
                of["xyz"]
    assert ls.solve(case_of(), MESH).contact["slave"].pressure.max() > 0
    assert ls.validate(CASE).problems == [] and lacmesh.cut_skin(MESH, "slave").n_macros == 36
    assert ls.contact_matrices(MESH, "slave", "master").B.shape[0] == 36


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: ls.solve(3), "path of a case file, not int"),
        (lambda: ls.solve(case_of()), "names no mesh: give"),
        (lambda: ls.solve(case_of(), [1, 2]), "mesh file, not list"),
        (lambda: lacmesh.cut_skin(None, "slave"), "not NoneType; lacmesh.from_meshio"),
        (lambda: ls.solve("missing.toml"), "missing.toml: cannot be"),
        (lambda: ls.read_results("data"), "holds no results"),
        (lambda: ls.read_matrices(MESH), "holds no contact"),
        (lambda: ls.solve(case_of(), lacmesh.cut_skin(MESH, "slave")), "not Cut; give"),
        (lambda: ls.parse_case(3), "in TOML, not int"),
        (lambda: ls.assemble(case_of(), MESH, t=-1), "at 0, not -1"),
        (lambda: ls.contact_matrices(lacmesh.read(MESH)), "a mesh and"),
        (lambda: ls.contact_matrices(MESH, "slave", "master", clearance="0.02*("), "is not a formula"),
        (lambda: lacmesh.Mesh.from_pyvista(3), "pyvista, not int"),
        (lambda: case_of().write("none.toml"), "this case is none"),
        (lambda: case_of(lambda x, t: 0 * x[:, 0], mesh=MESH).write("none.toml"), "function .* cannot be written"),
    ],
)
def test_what_cannot_be_taken_is_an_error_of_ours(wrong, words):
    with pytest.raises(LacmeshError, match=words):
        wrong()


@pytest.mark.parametrize("change", [{}, {"solver": ls.Solver(backend="superlu")}], ids=["first", "again"])
def test_a_case_in_which_nothing_acts_is_a_warning(mesh, change):
    with pytest.warns(LacmeshWarning, match="nothing acts on"):
        unloaded = ls.solve(case_of(0.0, **change), mesh)
    assert not unloaded.u.any()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ls.solve(case_of(0.0, contact=[contact(clearance=-1e-3)]), mesh)


# ---- again, with one number changed


CHANGES = {
    "load": {"pressure": [ls.Pressure(group="top", value=50.0)]},
    "material": {"material": [ls.Material(young=1000.0, poisson=0.2)]},
    "support": {"displacement": [fix("bottom", "xyz"), fix("symmetry_x", "xy")]},
    "prescribed": {"displacement": [move("bottom", ux=0, uy=0, uz=0.001), *case_of().displacement[1:]]},
    "contact": {"contact": [contact(clearance=-1e-3)]},
    "soft": {"contact": [contact(stiffness=1e4)]},
    "spring": {"spring": [ls.Spring(group="top", kz=10.0)]},
    "steps": {"steps": ls.Steps(count=3)},
    "tie": {"contact": [], "tie": [ls.Tie(slave="slave", master="master")]},
    "current": {"contact": [contact(geometry="current")]},
}


@pytest.mark.rows("load", "support", "tie")
@pytest.mark.parametrize("name", CHANGES)
def test_whatever_is_changed_the_result_is_that_of_a_fresh_problem(name):
    few = stack("HEXA8", "TETRA4", 3, counts=(2, 2)).renamed(x0="symmetry_x", y0="symmetry_y")
    ls.solve(case_of(), few)
    case = case_of(**CHANGES[name])
    found = ls.solve(case, few)
    *_, fresh = march(Problem.of(case, few))
    assert np.allclose(found.u.ravel(), fresh.u, rtol=1e-9, atol=1e-12 * np.abs(fresh.u).max())
    assert np.allclose(found.contact["slave"].pressure, fresh.zones[0].pressure, rtol=1e-9, atol=1e-9)


# ---- matrices and contact on them


def test_solve_contact_on_the_matrices_of_a_case_is_the_solution(mesh, solution):
    """The upper block is held by contact alone, so that K is singular."""
    system, pair = ls.assemble(case_of(), mesh), ls.contact_matrices(mesh, "slave", "master")
    given = {"fixed": system.fixed, "u0": system.u0}
    found = ls.solve_contact(system.K, system.f, pair.B, pair.G, **given)
    assert np.allclose(found.u, solution.u.ravel(), rtol=0, atol=1e-12)
    assert np.allclose(found.pressure, solution.contact["slave"].pressure, rtol=1e-9) and found.status.all()
    assert system.dofs.shape == (system.mesh.n_nodes, 3) and system.T.shape[0] == len(system.f)
    with pytest.raises(RequestError, match="does not apply the"):
        ls.solve_contact(system.K, system.f, pair.B, pair.G, solve=lambda f: np.asarray(f), **given)


def test_solve_contact_with_the_solver_of_another_program_and_in_any_numbering(disc):
    case, solution = disc
    system, pair = ls.assemble(case), ls.contact_matrices(DISC, "slave", "master")
    free = np.setdiff1d(np.arange(len(system.f)), system.fixed)
    inverse = splu(system.K[free][:, free].tocsc())
    given = {"fixed": system.fixed, "u0": system.u0}
    found = ls.solve_contact(system.K, system.f, pair.B, pair.G, solve=inverse.solve, **given)
    assert 0 < found.status.sum() < len(found.status)
    assert np.allclose(found.u, solution.u.ravel(), atol=1e-12)
    assert np.allclose(found.pressure, solution.contact["slave"].pressure, atol=1e-11)
    assert np.allclose(found.gap[found.status == 1], 0, atol=1e-14) and (found.gap > -1e-14).all()
    order = np.random.default_rng(3).permutation(len(system.f))
    place = np.argsort(order)
    given = {"fixed": place[system.fixed], "u0": system.u0[order]}
    turned = ls.solve_contact(system.K[order][:, order], system.f[order], pair.B[:, order], pair.G, **given)
    assert np.allclose(turned.u[place], found.u, atol=1e-12)


@pytest.mark.filterwarnings("ignore:master .* is in front of")
@pytest.mark.parametrize("clearance", [0.0, "0.01 * (1 - x) * t"])
def test_matrices_of_a_case_are_those_of_its_solution(disc, clearance):
    """A ball on a block: the areas are those of full circles, since the case says so."""
    case = replace(disc[0], model="axisymmetric", contact=[contact(clearance=clearance)])
    solution, system = ls.solve(case), ls.assemble(case)
    pair = system.contact["slave"]
    made = ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0)
    assert np.allclose(made.u, solution.u.ravel(), atol=1e-12)
    assert np.allclose(made.pressure, solution.contact["slave"].pressure, atol=1e-11)
    of_mesh = ls.contact_matrices(DISC, "slave", "master", axisymmetric=True, clearance=clearance)
    for other in (ls.contact_matrices(case)["slave"], of_mesh):
        assert np.allclose(other.G, pair.G, atol=1e-15) and np.allclose((other.B - pair.B).data, 0, atol=1e-15)


def test_contact_matrices_take_a_case_without_materials_a_time_and_a_thickness(tmp_path):
    rising = [[0.0, 0.0], [1.0, 0.5]]
    text = f'mesh = "{lacmesh.example("two_blocks.msh")}"\nmodel = "3d"\n[[contact]]\nname = "joint"\n'
    (tmp_path / "case.toml").write_text(f'{text}slave = "slave"\nmaster = "master"\nclearance = {rising}\n')
    matrices = ls.contact_matrices(tmp_path / "case.toml")
    assert [*matrices] == ["joint"] and np.allclose(matrices["joint"].G / matrices["joint"].w, 0.5)
    half = ls.contact_matrices(MESH, "slave", "master", clearance=rising, t=0.5, thickness=2.0)
    assert np.allclose(half.G / half.w, 0.25) and np.isclose(half.w.sum(), 2 * matrices["joint"].w.sum())


K2, B2, G2, F2 = np.diag([2.0, 4.0]), np.eye(2), np.array([1.0, 1.0]), np.array([6.0, 2.0])


def test_laws_of_given_rows_and_several_pairs():
    """Two springs, each on a rigid floor: u = (f - k overlap) and so on, by hand."""
    rigid = ls.solve_contact(K2, F2, B2, G2)
    assert np.allclose(rigid.u, [1.0, 0.5]) and np.allclose(rigid.pressure, [4.0, 0.0])
    soft = ls.solve_contact(K2, F2, B2, G2, w=np.ones(2), law=Unilateral(compliance=0.5))
    assert np.allclose(soft.u[0], (6 + 1 / 0.5) / (2 + 1 / 0.5)) and soft.pressure[1] == 0
    pairs = ls.solve_contact(K2, F2, [B2[:1], B2[1:]], [G2[:1], G2[1:]], law=[Unilateral(), Bilateral()])
    assert np.allclose(pairs.u, 1.0) and np.allclose(np.concatenate(pairs.pressure), [4.0, -2.0])
    assert np.allclose(ls.solve_contact(K2.astype(np.float32), F2, B2, G2).u, rigid.u)


@pytest.mark.parametrize(
    ("given", "options", "words"),
    [
        ((K2, F2, B2, G2), {"law": Unilateral(compliance=0.5)}, "needs w"),
        ((K2, F2, np.eye(3), np.ones(3)), {}, "not of the same"),
        ((K2, F2, [B2], [G2, G2]), {}, "for every pair"),
        ((K2, F2, B2, G2), {"fixed": [2]}, "indices of unknowns"),
        ((K2, F2, B2, G2), {"fixed": [True, False]}, "indices of unknowns"),  # not the unknowns 1 and 0
        ((K2, F2[:, None], B2, G2), {}, r"f \(2, 1\)"),
        ((K2, F2, B2, G2), {"law": "unilateral"}, "law is one"),
    ],
)
def test_rows_that_do_not_fit_are_refused(given, options, words):
    with pytest.raises(RequestError, match=words):
        ls.solve_contact(*given, **options)


def test_a_motion_that_no_row_of_contact_meets_is_an_error():
    """A block between a floor and a plate, each of which lets it slide: what moves it sideways meets nothing."""
    square = lacmesh.generate.rectangle(1)
    mesh = lacmesh.generate.stack(square, square)
    case = case_of(model="plane_strain", pressure=[], displacement=[fix("bottom", "xy"), move("top", uy=-0.01)])
    system, pair = ls.assemble(case, mesh), ls.contact_matrices(mesh, "slave", "master")
    given = {"fixed": system.fixed, "u0": system.u0}
    for sideways in (0.0, 1.0):
        f = system.f.copy()
        f[8] += sideways
        with pytest.raises(DataError, match="holds 1 of the motions"):
            ls.solve_contact(system.K, f, pair.B, pair.G, **given)
    sticking = ls.solve_contact(system.K, system.f, pair.B, pair.G, B_T=pair.B_T, friction=0.3, **given)
    assert np.abs(sticking.u).max() < 0.011
    K, B, G = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[1.0, 0.0]]), np.array([1.0])
    with pytest.raises(DataError, match="no active set"):  # of a body that nothing holds
        ls.solve_contact(K, np.array([0.0, -1.0]), B, G)
    held = ls.solve_contact(K, np.array([0.0, 1.0]), B, G)
    assert np.allclose(held.u, [1.0, 2.0]) and np.allclose(held.pressure, 1.0)


def test_assemble_says_where_no_list_of_fixed_unknowns_exists(mesh):
    rigid = ls.Rigid(group="upper", fz=-1.0)
    system = ls.assemble(case_of(pressure=[], displacement=[fix("bottom", "xyz")], rigid=[rigid]), mesh)
    with pytest.raises(RequestError, match="take u = T q"):
        _ = system.fixed
    with pytest.raises(DataError, match="density"):
        _ = system.M
    heavy = ls.assemble(case_of(material=[ls.Material(young=1.0, poisson=0.0, density=2.0)]), mesh)
    along_x = np.tile([1.0, 0, 0], heavy.mesh.n_nodes)
    volume = sizes(heavy.mesh)[heavy.mesh.cell_dim == 3].sum()
    assert np.isclose(along_x @ heavy.M @ along_x, 2 * volume, rtol=1e-12)


# ---- results of a run


def test_results_are_read_from_their_folder(tmp_path, mesh):
    """What is read is the solution, by a law (test_laws.py); a solution is saved as a run is."""
    times, last = [0.5, 1.0], case_of(steps=ls.Steps(count=2))
    *_, solution = ls.march(last, mesh)
    ls.run(last, tmp_path / "run", mesh=mesh)
    solution.save(tmp_path / "saved")
    with pytest.raises(RequestError, match="holds results already"):
        solution.save(tmp_path / "saved")
    for name in ("run", "saved"):
        results = ls.read_results(tmp_path / name)
        own = times if name == "run" else times[1:]
        assert results.status == "done" and results.times.tolist() == own and results.message == ""
        assert results.history["time"].tolist() == own and results.solution(0).time == own[0]
        read = results.solution()
        assert sorted(read.contact["slave"].number) == list(range(36)) and len(repr(results).splitlines()) <= 10
        assert np.array_equal(np.nanmax(read.von_mises()), np.nanmax(solution.von_mises()))
        with pytest.raises(IndexError):
            results.solution(2)
        with pytest.raises(RequestError, match="read from a folder"):
            read.stress("cells")


def test_a_damaged_folder_is_said_to_be_one(tmp_path):
    (tmp_path / "results.json").write_text("{")
    with pytest.raises(ReadError, match="cannot be read"):
        ls.read_results(tmp_path)
    (tmp_path / "results.json").write_text('{"status": "done", "steps": []}')
    (tmp_path / "history.csv").write_text("time\na,b\n")
    with pytest.raises(ReadError, match="is damaged"):
        ls.read_results(tmp_path)


# ---- messages, descriptions, other libraries


def test_steps_are_logged_and_in_a_log_each_step_is_a_line_beside_iterations(mesh, caplog, capsys, monkeypatch):
    with caplog.at_level(logging.DEBUG, logger="lacsolver"):
        ls.solve(case_of(), mesh, progress=True)
    levels = [record.levelname for record in caplog.records if record.name == "lacsolver"]
    assert levels.count("INFO") == 1 and "DEBUG" in levels
    heading, line = capsys.readouterr().err.splitlines()
    assert heading.split()[:3] == ["step", "time", "iterations"] and line.split()[:2] == ["1", "1"]
    monkeypatch.setattr("lacsolver.watch.shows_more", lambda: True)
    monkeypatch.setenv("FORCE_COLOR", "1")  # a terminal, for rich
    ls.solve(case_of(), mesh, progress=True)
    shown = capsys.readouterr().err
    assert heading in shown and line in shown and ("preparing" in shown or "t = 1" in shown)


@pytest.mark.parametrize(("count", "last"), [(0, "none"), (4, "mistake 4"), (6, "2 more")])
def test_a_validation_shows_four_mistakes_and_the_number_of_others(mesh, count, last):
    shown = repr(Validation(mesh, problems=[Issue(f"mistake {k}") for k in range(1, count + 1)])).splitlines()
    *_, final = [line for line in shown if line.startswith("  problem")]
    assert final.endswith(f" {last}") and sum("mistake" in line for line in shown) == min(count, 4)


@pytest.mark.vtk
def test_every_public_record_is_described_in_ten_lines_and_a_solution_is_drawn(mesh, solution, tmp_path):
    cut, system, problem = lacmesh.cut_skin(mesh, "slave"), ls.assemble(case_of(), mesh), Problem.of(case_of(), mesh)
    pair, findings = ls.contact_matrices(mesh, "slave", "master"), lacmesh.check(cut, master="master")
    picture = solution.plot(tmp_path / "p.png")
    assert (tmp_path / "p.png").read_bytes() == picture._repr_png_() and picture.png[:4] == b"\x89PNG"
    records = [
        *(mesh, cut, findings, next(iter(findings)), lacmesh.measure_quality(mesh)),
        *(*lacmesh.fit_surface(mesh, "slave"), lacmesh.Surface.of(mesh, mesh.cells_of("slave")), ls.Steps(), solution),
        *(case_of(), *case_of().displacement, solution.contact["slave"], solution.fields, picture, system, pair),
        ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0),
        *(lacmesh.aster_multipliers(cut), ls.validate(case_of(), mesh), problem, *march(problem)),
        ls.validate(case_of(pressure=[ls.Pressure(group="tap", value=1.0)] * 9), mesh),
    ]
    for record in records:
        lines = repr(record).splitlines()
        assert len(lines) <= 10 and max(map(len, lines)) <= 400 and "object at 0x" not in repr(record), record
    assert repr(case_of().contact[0]) == "Contact(name='slave', slave='slave', master='master', geometry='reference')"
    assert repr(mesh).startswith("Mesh\n  nodes            476\n") and "in memory" in repr(case_of(mesh=mesh))
    assert "<table>" in solution._repr_html_() and "slave" in cut._repr_html_()
    assert 'src="data:image/png;base64,' in mesh._repr_html_()
    grid, own = solution.to_pyvista(), solution.contact["slave"]
    assert grid.n_cells == solution.mesh.n_cells and np.allclose(grid.point_data["displacement"], solution.u)
    pressure = grid.cell_data["pressure"]
    assert np.isfinite(pressure).sum() == len(own.surface) and np.isclose(np.nanmax(pressure), own.pressure.max())
