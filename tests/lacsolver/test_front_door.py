"""The first lines of a user of scikit-fem, meshio or pyvista: a case in Python, a solution, matrices, results."""

from __future__ import annotations

import logging
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import splu

import lacmesh
import lacsolver as ls
from lacmesh.errors import DataError, LacmeshError, LacmeshWarning, ReadError, RequestError
from lacsolver.contact.laws import Bilateral, Unilateral
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import state_fields
from lacsolver.results.figures import step_figures
from tests.lacsolver.patch_meshes import stack
from tests.properties import volumes


def case_of(value=25.0, **more):
    """The case of data/two_blocks.toml without a mesh, in one step."""
    return ls.Case(
        model="3d",
        material=[ls.Material(young=2000.0, poisson=0.3)],
        contact=[ls.Contact(slave="slave", master="master")],
        displacement=[
            ls.Displacement(group="bottom", ux=0, uy=0, uz=0),
            ls.Displacement(group="symmetry_x", ux=0),
            ls.Displacement(group="symmetry_y", uy=0),
        ],
        pressure=[ls.Pressure(group="top", value=value)],
        **more,
    )


@pytest.fixture(scope="module")
def mesh():
    return lacmesh.read("data/two_blocks.msh")


@pytest.fixture(scope="module")
def solution(mesh):
    return ls.solve(case_of(), mesh)


def disc():
    """A quarter of a disc pressed onto a block by a displacement, on which some macro-elements stay open."""
    case = ls.Case(
        mesh="data/disc_on_block.msh",
        model="plane_strain",
        material=[ls.Material(young=1.0, poisson=0.3)],
        contact=[ls.Contact(slave="slave", master="master")],
        displacement=[
            ls.Displacement(group="bottom", ux=0.0, uy=0.0),
            ls.Displacement(group="symmetry_x", ux=0.0),
            ls.Displacement(group="top", uy=-0.1),
        ],
    )
    return case, ls.solve(case)


def test_a_solution_has_the_figures_and_fields_of_its_state(mesh, solution):
    problem = Problem.of(case_of(), mesh)
    (state,) = march(problem)
    zone, fields = step_figures(problem, state).contact["slave"], state_fields(problem, state)
    contact = solution.contact["slave"]
    assert np.array_equal(solution.u.ravel(), state.u) and np.array_equal(contact.pressure, state.zones[0].pressure)
    assert np.allclose(contact.resultant, zone.resultant, rtol=1e-12)
    assert np.array_equal(solution.stress(), fields.stress, equal_nan=True)
    assert contact.force.shape == solution.u.shape and solution.mesh.n_nodes == len(solution.u)
    for name in ("gap", "status", "area", "recovered", "pressure"):
        assert getattr(contact, name).shape == (36,)
    for name in ("centre", "normal"):
        assert getattr(contact, name).shape == (36, 3)
    assert (contact.status == 1).all() and solution.time == 1.0 and solution.iterations >= 1


def test_reactions_probes_and_contacts_are_found_by_name(tmp_path):
    """In equilibrium with the load; a solution that is read from its folder has the same."""
    done = ls.run("data/two_blocks.toml", tmp_path / "results")
    read, solved = ls.read_results(tmp_path / "results").solution(), ls.solve("data/two_blocks.toml")
    for one in (read, solved):
        assert one.reactions["bottom"][2] == pytest.approx(10.435185, rel=1e-6)
        assert sum(one.reactions.values())[:2] == pytest.approx([0, 0], abs=1e-9)
        assert one.probes["corner"] == pytest.approx(done.steps[-1].probes["corner"], rel=1e-12, abs=1e-15)
        for of, there in ((one.reactions, "bottom"), (one.probes, "corner"), (one.contact, "joint")):
            with pytest.raises(KeyError, match=f"no 'xyz' here; there are: .*{there}"):
                of["xyz"]


def test_figures_of_a_plane_contact_are_described():
    """The moment of a plane model is one number."""
    zone = disc()[1].figures.contact["slave"]
    assert "moment" in repr(zone) and float(zone.moment) == zone.moment


def test_stress_in_cells_is_the_mean_of_each_and_von_mises_that_of_a_bar():
    bar = lacmesh.Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]],
        [("QUAD4", [[0, 1, 2, 3], [1, 4, 5, 2]]), ("SEG2", [[0, 3], [4, 5]])],
        cell_groups={"left": [2], "right": [3]},
    )
    case = ls.Case(
        model="plane_stress",
        material=[ls.Material(young=100.0, poisson=0.3)],
        displacement=[ls.Displacement(group="left", ux=0), ls.Displacement(at=[0, 0], uy=0)],
        traction=[ls.Traction(group="right", tx=7.0)],
    )
    solution = ls.solve(case, bar)
    cells = solution.stress("cells")
    assert np.allclose(cells[:2], [7, 0, 0, 0], atol=1e-12) and np.isnan(cells[2:]).all()
    assert np.allclose(solution.von_mises(), 7) and np.allclose(solution.von_mises("cells")[:2], 7)
    with pytest.raises(ValueError, match='at is "nodes" or "cells"'):
        solution.stress("points")


def test_march_yields_every_step_and_paths_are_taken(tmp_path):
    times = [solution.time for solution in ls.march("data/two_blocks.toml")]
    assert times == [0.5, 1.0]
    again = ls.solve(case_of(), "data/two_blocks.msh")
    assert again.contact["slave"].pressure.max() > 0
    done = ls.run("data/two_blocks.toml", tmp_path / "results")
    assert done.status == "done" and (tmp_path / "results" / "results.json").is_file()
    with pytest.raises(RequestError, match="holds results already"):
        ls.run("data/two_blocks.toml", str(tmp_path / "results"))
    assert ls.validate("data/two_blocks.toml").problems == []
    assert lacmesh.cut_skin("data/two_blocks.msh", "slave").n_macros == 36
    assert ls.contact_matrices("data/two_blocks.msh", "slave", "master").B.shape[0] == 36


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: ls.solve(3), "a case is a lacsolver.Case or the path of a case file, not int"),
        (lambda: ls.solve(case_of()), "names no mesh: give one"),
        (lambda: ls.solve(case_of(), [1, 2]), "a mesh is a lacmesh.Mesh or the path of a mesh file, not list"),
        (lambda: lacmesh.cut_skin(None, "slave"), "not NoneType; lacmesh.from_meshio"),
        (lambda: ls.solve("missing.toml"), "missing.toml: cannot be read"),
        (lambda: ls.read_results("data"), "holds no results of a run"),
        (lambda: ls.read_matrices("data/two_blocks.msh"), "holds no contact matrices"),
        (lambda: ls.solve(case_of(), lacmesh.cut_skin("data/two_blocks.msh", "slave")), "not Cut; give its .mesh"),
        (lambda: ls.parse_case(3), "parse_case takes a text in TOML, not int"),
        (
            lambda: ls.assemble(case_of(), "data/two_blocks.msh", t=-1),
            "the steps, which begin at 0, not -1",
        ),
        (lambda: ls.contact_matrices(lacmesh.read("data/two_blocks.msh")), "takes a case and its mesh, or a mesh and"),
        (
            lambda: ls.contact_matrices("data/two_blocks.msh", "slave", "master", clearance="0.02*("),
            "clearance: the value is no formula",
        ),
        (lambda: lacmesh.Mesh.from_pyvista(3), "takes the data sets of pyvista, not int"),
    ],
)
def test_what_cannot_be_taken_is_an_error_of_ours(wrong, words):
    with pytest.raises(LacmeshError, match=words.replace("(", r"\(")):
        wrong()


# ---- again, with one number changed


def test_another_load_takes_the_cut_the_pairing_and_the_factor_again(mesh, monkeypatch):
    ls.solve(case_of(), mesh)
    made = []
    real = ReducedProblem._factorised
    monkeypatch.setattr(ReducedProblem, "_factorised", lambda self, *a: made.append(1) or real(self, *a))
    monkeypatch.setattr("lacsolver.problem.problem.prepared", lambda *a: made.append("cut"))
    monkeypatch.setattr("lacsolver.problem.pair.ContactPair.of", lambda *a: made.append("pair"))
    monkeypatch.setattr("lacsolver.bodies.small.assemble_stiffness", lambda *a: made.append("K"))
    doubled = ls.solve(case_of(50.0), mesh)
    monkeypatch.undo()
    assert made == []
    fresh = list(march(Problem.of(case_of(50.0), mesh)))[-1]
    assert np.array_equal(doubled.u.ravel(), fresh.u)


CHANGES = {
    "material": lambda: replace(case_of(), material=[ls.Material(young=1000.0, poisson=0.2)]),
    "support": lambda: replace(
        case_of(),
        displacement=[
            ls.Displacement(group="bottom", ux=0, uy=0, uz=0),
            ls.Displacement(group="symmetry_x", ux=0, uy=0),
        ],
    ),
    "prescribed": lambda: replace(
        case_of(),
        displacement=[
            ls.Displacement(group="bottom", ux=0, uy=0, uz=0.001),
            ls.Displacement(group="symmetry_x", ux=0),
            ls.Displacement(group="symmetry_y", uy=0),
        ],
    ),
    "contact": lambda: replace(case_of(), contact=[ls.Contact(slave="slave", master="master", clearance=-1e-3)]),
    "soft": lambda: replace(case_of(), contact=[ls.Contact(slave="slave", master="master", stiffness=1e4)]),
    "spring": lambda: replace(case_of(), spring=[ls.Spring(group="top", kz=10.0)]),
    "steps": lambda: replace(case_of(), steps=ls.Steps(count=3)),
    "tie": lambda: replace(case_of(), contact=[], tie=[ls.Tie(slave="slave", master="master")]),
    "current": lambda: replace(case_of(), contact=[ls.Contact(slave="slave", master="master", geometry="current")]),
}


@pytest.fixture(scope="module")
def few_cells():
    """Two blocks of a few cells, with the groups of data/two_blocks.msh that the case names."""
    mesh = stack("HEXA8", "TETRA4", 3, counts=(2, 2))
    names = {"x0": "symmetry_x", "y0": "symmetry_y"}
    return replace(mesh, cell_groups={names.get(name, name): cells for name, cells in mesh.cell_groups.items()})


@pytest.mark.parametrize("name", CHANGES)
def test_whatever_is_changed_the_result_is_that_of_a_fresh_problem(name, few_cells):
    ls.solve(case_of(), few_cells)
    case = CHANGES[name]()
    found = ls.solve(case, few_cells)
    *_, fresh = march(Problem.of(case, few_cells))
    assert np.allclose(found.u.ravel(), fresh.u, rtol=1e-9, atol=1e-12 * np.abs(fresh.u).max())
    assert np.allclose(found.contact["slave"].pressure, fresh.zones[0].pressure, rtol=1e-9, atol=1e-9)


# ---- matrices and contact on them


def test_solve_contact_on_the_matrices_of_a_case_is_the_solution(mesh, solution):
    """The upper block is held by contact alone, so that K is singular."""
    system = ls.assemble(case_of(), mesh)
    pair = ls.contact_matrices(mesh, "slave", "master")
    found = ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0)
    assert np.allclose(found.u, solution.u.ravel(), rtol=0, atol=1e-12)
    assert np.allclose(found.pressure, solution.contact["slave"].pressure, rtol=1e-9) and found.status.all()
    assert system.dofs.shape == (system.mesh.n_nodes, 3) and system.T.shape[0] == len(system.f)
    with pytest.raises(RequestError, match="does not apply the inverse"):
        ls.solve_contact(
            system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0, solve=lambda f: np.asarray(f)
        )


def test_solve_contact_with_the_solver_of_another_program_and_in_any_numbering():
    case, solution = disc()
    system, pair = ls.assemble(case), ls.contact_matrices("data/disc_on_block.msh", "slave", "master")
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
    turned = ls.solve_contact(
        system.K[order][:, order], system.f[order], pair.B[:, order], pair.G, fixed=place[system.fixed],
        u0=system.u0[order],
    )  # fmt: skip
    assert np.allclose(turned.u[place], found.u, atol=1e-12)


@pytest.mark.parametrize("clearance", [0.0, "0.01 * (1 - x) * t"])
def test_matrices_of_a_case_are_those_of_its_solution(clearance):
    """A ball on a block: the areas are those of full circles, since the case says so."""
    case, _ = disc()
    contact = ls.Contact(slave="slave", master="master", clearance=clearance)
    case = replace(case, model="axisymmetric", contact=[contact])
    solution, system = ls.solve(case), ls.assemble(case)
    pair = system.contact["slave"]
    given = {"fixed": system.fixed, "u0": system.u0}
    made = ls.solve_contact(system.K, system.f, pair.B, pair.G, **given)
    assert np.allclose(made.u, solution.u.ravel(), atol=1e-12)
    assert np.allclose(made.pressure, solution.contact["slave"].pressure, atol=1e-11)
    of_case = ls.contact_matrices(case)["slave"]
    options = {"axisymmetric": True, "clearance": clearance}
    of_mesh = ls.contact_matrices("data/disc_on_block.msh", "slave", "master", **options)
    for other in (of_case, of_mesh):
        assert np.allclose(other.G, pair.G, atol=1e-15) and np.allclose((other.B - pair.B).data, 0, atol=1e-15)


def test_contact_matrices_take_a_case_file_without_materials(tmp_path):
    text = f'mesh = "{Path("data/two_blocks.msh").resolve()}"\nmodel = "3d"\n'
    text += '[[contact]]\nname = "joint"\nslave = "slave"\nmaster = "master"\nclearance = [[0.0, 0.0], [1.0, 0.5]]\n'
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    matrices = ls.contact_matrices(path)
    assert [*matrices] == ["joint"] and np.allclose(matrices["joint"].G / matrices["joint"].w, 0.5)
    options = {"clearance": [[0.0, 0.0], [1.0, 0.5]], "t": 0.5, "thickness": 2.0}
    half = ls.contact_matrices("data/two_blocks.msh", "slave", "master", **options)
    assert np.allclose(half.G / half.w, 0.25) and np.isclose(half.w.sum(), 2 * matrices["joint"].w.sum())


@pytest.mark.parametrize("change", [{}, {"solver": ls.Solver(backend="superlu")}], ids=["first", "again"])
def test_a_case_in_which_nothing_acts_is_a_warning(mesh, change):
    with pytest.warns(LacmeshWarning, match="nothing acts on the bodies"):
        unloaded = ls.solve(case_of(0.0, **change), mesh)
    assert not unloaded.u.any()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ls.solve(replace(case_of(0.0), contact=[ls.Contact(slave="slave", master="master", clearance=-1e-3)]), mesh)


def test_laws_of_given_rows_and_several_pairs():
    """Two springs, each on a rigid floor: u = (f - k overlap) and so on, by hand."""
    K, B, G = np.diag([2.0, 4.0]), np.eye(2), np.array([1.0, 1.0])
    f = np.array([6.0, 2.0])
    rigid = ls.solve_contact(K, f, B, G)
    assert np.allclose(rigid.u, [1.0, 0.5]) and np.allclose(rigid.pressure, [4.0, 0.0])
    soft = ls.solve_contact(K, f, B, G, w=np.ones(2), law=Unilateral(compliance=0.5))
    assert np.allclose(soft.u[0], (6 + 1 / 0.5) / (2 + 1 / 0.5)) and soft.pressure[1] == 0
    pairs = ls.solve_contact(K, f, [B[:1], B[1:]], [G[:1], G[1:]], law=[Unilateral(), Bilateral()])
    assert np.allclose(pairs.u, 1.0) and np.allclose(np.concatenate(pairs.pressure), [4.0, -2.0])
    with pytest.raises(RequestError, match="needs w"):
        ls.solve_contact(K, f, B, G, law=Unilateral(compliance=0.5))
    with pytest.raises(RequestError, match="not of the same unknowns"):
        ls.solve_contact(K, f, np.eye(3), np.ones(3))
    with pytest.raises(RequestError, match="one of each for every pair"):
        ls.solve_contact(K, f, [B], [G, G])
    for fixed in ([2], [True, False]):  # a mask would be taken for the unknowns 1 and 0
        with pytest.raises(RequestError, match="indices of unknowns, from 0 to 1"):
            ls.solve_contact(K, f, B, G, fixed=fixed)
    with pytest.raises(RequestError, match=r"f \(2, 1\)"):
        ls.solve_contact(K, f[:, None], B, G)
    with pytest.raises(RequestError, match="law is one of"):
        ls.solve_contact(K, f, B, G, law="unilateral")
    assert np.allclose(ls.solve_contact(K.astype(np.float32), f, B, G).u, rigid.u)


def test_a_motion_that_no_row_of_contact_meets_is_an_error():
    """A block between a floor and a plate, each of which lets it slide: what moves it sideways meets nothing."""
    mesh = lacmesh.Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1], [0, 1], [1, 1], [1, 2], [0, 2]],
        [("QUAD4", [[0, 1, 2, 3], [4, 5, 6, 7]]), ("SEG2", [[0, 1], [3, 2], [5, 4], [7, 6]])],
        cell_groups={"bottom": [2], "master": [3], "slave": [4], "top": [5]},
    )
    case = ls.Case(
        model="plane_strain",
        material=[ls.Material(young=1e3, poisson=0.3)],
        contact=[ls.Contact(slave="slave", master="master")],
        displacement=[ls.Displacement(group="bottom", ux=0, uy=0), ls.Displacement(group="top", uy=-0.01)],
    )
    system, pair = ls.assemble(case, mesh), ls.contact_matrices(mesh, "slave", "master")
    given = {"fixed": system.fixed, "u0": system.u0}
    for sideways in (0.0, 1.0):
        f = system.f.copy()
        f[8] += sideways
        with pytest.raises(DataError, match="nothing holds 1 of the motions that cost no energy"):
            ls.solve_contact(system.K, f, pair.B, pair.G, **given)
    sticking = ls.solve_contact(system.K, system.f, pair.B, pair.G, B_T=pair.B_T, friction=0.3, **given)
    assert np.abs(sticking.u).max() < 0.011


def test_a_body_that_nothing_holds_is_an_error():
    K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    with pytest.raises(DataError, match="no active set found"):
        ls.solve_contact(K, np.array([0.0, -1.0]), np.array([[1.0, 0.0]]), np.array([1.0]))
    held = ls.solve_contact(K, np.array([0.0, 1.0]), np.array([[1.0, 0.0]]), np.array([1.0]))
    assert np.allclose(held.u, [1.0, 2.0]) and np.allclose(held.pressure, 1.0)


def test_assemble_says_where_no_list_of_fixed_unknowns_exists(mesh):
    held = ls.Displacement(group="bottom", ux=0, uy=0, uz=0)
    rigid = ls.Rigid(group="upper", fz=-1.0)
    system = ls.assemble(replace(case_of(), pressure=[], displacement=[held], rigid=[rigid]), mesh)
    with pytest.raises(RequestError, match="take u = T q"):
        _ = system.fixed
    with pytest.raises(DataError, match="density"):
        _ = system.M
    heavy = ls.assemble(replace(case_of(), material=[ls.Material(young=1.0, poisson=0.0, density=2.0)]), mesh)
    along_x = np.tile([1.0, 0, 0], heavy.mesh.n_nodes)
    volume = volumes(heavy.mesh)[heavy.mesh.cell_dim == 3].sum()
    assert np.isclose(along_x @ heavy.M @ along_x, 2 * volume, rtol=1e-12)


# ---- results of a run


@pytest.mark.parametrize("format", ["vtu", "med"])
def test_results_of_a_run_are_read_from_its_folder(format, tmp_path, solution):
    case = replace(ls.read_case("data/two_blocks.toml"), output=ls.Output(format=format))
    ls.run(case, tmp_path / "results")
    results = ls.read_results(tmp_path / "results")
    assert results.status == "done" and results.times.tolist() == [0.5, 1.0] and results.message == ""
    assert results.history["time"].tolist() == [0.5, 1.0]
    read = results.solution()
    pairs = {read.contact["joint"].number[k]: k for k in range(36)}
    assert sorted(pairs) == list(range(36))
    assert np.allclose(read.contact["joint"].pressure, solution.contact["slave"].pressure, rtol=1e-9)
    assert np.allclose(read.contact["joint"].resultant, solution.contact["slave"].resultant, atol=1e-9)
    assert np.allclose(read.contact["joint"].centre, solution.contact["slave"].centre, rtol=1e-9)
    assert np.allclose(np.abs(read.u).max(axis=0), np.abs(solution.u).max(axis=0))
    assert np.allclose(np.nanmax(read.von_mises()), np.nanmax(solution.von_mises()))
    assert results.solution(0).time == 0.5 and len(repr(results).splitlines()) <= 10
    with pytest.raises(IndexError):
        results.solution(2)
    with pytest.raises(RequestError, match="read from a folder"):
        read.stress("cells")


def test_a_solution_is_saved_as_a_run_is(solution, tmp_path):
    solution.save(tmp_path / "one")
    read = ls.read_results(tmp_path / "one").solution()
    assert np.allclose(read.contact["slave"].pressure, solution.contact["slave"].pressure, rtol=1e-12)
    with pytest.raises(RequestError, match="holds results already"):
        solution.save(tmp_path / "one")


def test_a_damaged_folder_is_said_to_be_one(tmp_path):
    (tmp_path / "results.json").write_text("{")
    with pytest.raises(ReadError, match="cannot be read"):
        ls.read_results(tmp_path)
    (tmp_path / "results.json").write_text('{"status": "done", "steps": []}')
    (tmp_path / "history.csv").write_text("time\na,b\n")
    with pytest.raises(ReadError, match="is damaged"):
        ls.read_results(tmp_path)


# ---- cases as files, messages, descriptions


def test_a_case_is_written_and_read_again(tmp_path, mesh):
    case = replace(
        case_of("25 * t"), mesh="data/two_blocks.msh", dynamics=None, steps=ls.Steps(times=(0.25, 1)),
        rigid=[ls.Rigid(group="upper", fz=[[0, 0], [1, -2]])], solver=ls.Solver(tolerance=1e-9),
    )  # fmt: skip
    case.write(tmp_path / "again.toml")
    again = ls.read_case(tmp_path / "again.toml")
    assert again.mesh.resolve() == case.mesh.resolve()
    assert replace(again, mesh=case.mesh, path=None) == case
    with pytest.raises(RequestError, match="mesh of this case is none"):
        case_of().write(tmp_path / "none.toml")
    moving = replace(case, pressure=[ls.Pressure(group="top", value=lambda x, t: 0 * x[:, 0])])
    with pytest.raises(RequestError, match=r"function .* cannot be written"):
        moving.write(tmp_path / "function.toml")
    assert not (tmp_path / "function.toml").exists()
    assert replace(case_of(), mesh=mesh).mesh is mesh and "in memory" in repr(replace(case_of(), mesh=mesh))


def test_steps_are_logged(mesh, caplog):
    with caplog.at_level(logging.DEBUG, logger="lacsolver"):
        ls.solve(case_of(), mesh)
    said = [record.levelname for record in caplog.records if record.name == "lacsolver"]
    assert said.count("INFO") == 1 and "DEBUG" in said


def test_a_bar_is_shown_where_it_is_asked_for(mesh, capsys, monkeypatch):
    monkeypatch.setattr("lacsolver.solution._shows_bars", lambda: True)
    ls.solve(case_of(), mesh, progress=True)
    assert "t = 1" in capsys.readouterr().err


def test_in_a_log_each_step_is_a_line(mesh, capsys):
    ls.solve(case_of(), mesh, progress=True)
    heading, line = capsys.readouterr().err.splitlines()
    assert heading.split()[:3] == ["step", "time", "iterations"] and line.split()[:2] == ["1", "1"]


@pytest.fixture(scope="module")
def drawn(solution, tmp_path_factory):
    """The picture of the solution, and the file that it is written to."""
    path = tmp_path_factory.mktemp("drawn") / "contact.png"
    return solution.plot(path), path


@pytest.mark.vtk
def test_every_public_record_is_described_in_ten_lines(mesh, solution, drawn):
    cut = lacmesh.cut_skin(mesh, "slave")
    system = ls.assemble(case_of(), mesh)
    pair = ls.contact_matrices(mesh, "slave", "master")
    findings = lacmesh.check(cut, master="master")
    records = [
        *(
            mesh,
            cut,
            findings,
            next(iter(findings)),
            lacmesh.measure_quality(mesh),
            *lacmesh.fit_surface(mesh, "slave"),
        ),
        *(lacmesh.Surface.of(mesh, mesh.cells_of("slave")), case_of(), *case_of().displacement, ls.Steps(), solution),
        *(solution.contact["slave"], solution.fields, drawn[0], system, pair, ls.validate(case_of(), mesh)),
        *(ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0),),
        *(
            lacmesh.aster_multipliers(cut),
            ls.validate(replace(case_of(), pressure=[ls.Pressure(group="tap", value=1.0)] * 9), mesh),
        ),
        *(Problem.of(case_of(), mesh), *march(Problem.of(case_of(), mesh))),
    ]
    for record in records:
        lines = repr(record).splitlines()
        assert len(lines) <= 10 and max(map(len, lines)) <= 400, record
        assert "object at 0x" not in repr(record)
    assert repr(case_of().contact[0]) == "Contact(name='slave', slave='slave', master='master', geometry='reference')"
    assert repr(mesh).startswith("Mesh\n  nodes            476\n")
    assert "<table>" in solution._repr_html_() and "slave" in cut._repr_html_()


@pytest.mark.vtk
@pytest.mark.meshio
def test_meshes_of_other_libraries(mesh):
    assert lacmesh.from_meshio(mesh.to_meshio()).cells_by_type == mesh.cells_by_type
    again = lacmesh.Mesh.from_pyvista(mesh.to_pyvista())
    assert again.cells_by_type == mesh.cells_by_type and np.allclose(again.points, mesh.points)
    assert sorted(again.cell_groups) == sorted(mesh.cell_groups)


@pytest.mark.vtk
def test_a_mesh_shows_a_picture_in_a_notebook(mesh):
    assert 'src="data:image/png;base64,' in mesh._repr_html_()


@pytest.mark.vtk
def test_a_grid_has_the_fields(solution):
    grid = solution.to_pyvista()
    assert grid.n_cells == solution.mesh.n_cells
    assert np.allclose(grid.point_data["displacement"], solution.u)
    pressed = np.isfinite(grid.cell_data["pressure"])
    assert pressed.sum() == len(solution.contact["slave"].surface)
    assert np.isclose(np.nanmax(grid.cell_data["pressure"]), solution.contact["slave"].pressure.max())


@pytest.mark.vtk
def test_a_picture_is_written_and_shown(drawn):
    picture, path = drawn
    assert path.read_bytes() == picture._repr_png_()
    assert picture.png[:4] == b"\x89PNG"
