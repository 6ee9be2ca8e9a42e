"""Cases as decks of CalculiX: what an import of the deck has again, what CalculiX computes of it, what is refused."""

import shutil

import numpy as np
import pytest

from lacmesh import read
from lacsolver import CaseError, read_case
from lacsolver.cli import main
from lacsolver.decks import export_deck, import_deck
from lacsolver.decks.exporting import HANDLERS, Export, write
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests import REPOSITORY
from tests.formats.decks import solved as run_calculix
from tests.formats.decks import tables

PROGRAM = shutil.which("ccx")
DATA = REPOSITORY / "data"
pytestmark = pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")


def case_of(folder, more="", **changes):
    """A case of two blocks with texts in front of some keys, and sections behind its own."""
    text = (DATA / "two_blocks.toml").read_text().replace("two_blocks.msh", str(DATA / "two_blocks.msh"))
    for key, before in changes.items():
        assert f"\n{key} = " in text
        text = text.replace(f"\n{key} = ", f"\n{before}{key} = ")
    path = folder / "case.toml"
    path.write_text(text + more)
    return read_case(path)


SOFT = "friction = 0.2\nstiffness = 5e5\n"
LOADS = '[[force]]\ngroup = "slave"\nfx = [[0, 0], [0.5, 2.0], [1, 2.0]]\n[gravity]\ngx = 2.0\n'
FINITE = {"young": 'density = 1e-9\nlaw = "saint_venant_kirchhoff"\n', "value": "follower = true\n"}


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_an_import_has_the_exported_case_again(tmp_path, kinematics):
    """Groups, constants, contact, supports and loads over time come back from the deck."""
    finite = kinematics == "finite"
    changes = FINITE | {"model": 'kinematics = "finite"\n'} if finite else {"young": "density = 1e-9\n"}
    case = case_of(tmp_path, LOADS, slave=SOFT, **changes)
    assert export_deck(case, tmp_path / "job.inp") == []
    again = import_deck(tmp_path / "job.inp", tmp_path / "again.toml")
    assert (again.case.kinematics, again.case.steps.planned) == (kinematics, case.steps.planned)
    (contact,), (material,), (pressure,) = again.case.contact, again.case.material, again.case.pressure
    assert (contact.slave, contact.master, contact.friction.at(0)) == ("slave", "master", 0.2)
    assert (material.young, material.poisson, material.density) == (2000, 0.3, 1e-9)
    assert contact.stiffness.at(0) == 5e5 and pressure.follower == finite
    for t in (0.5, 0.75, 1.0):
        assert pressure.value.at(t) == pytest.approx(25 * t)
        assert again.case.force[0].fx.at(t) == 2 and again.case.gravity.gx.at(t) == pytest.approx(2 * t)
    mesh, old = again.mesh, read(DATA / "two_blocks.msh")
    for axis, groups in (("ux", ["bottom", "symmetry_x"]), ("uy", ["bottom", "symmetry_y"]), ("uz", ["bottom"])):
        held = [mesh.node_groups[one.group] for one in again.case.displacement if getattr(one, axis)]
        wanted = [old.nodes_on(old.cell_groups[name]) for name in groups]
        assert set(mesh.node_number[np.concatenate(held)]) == set(old.node_number[np.concatenate(wanted)])


LACKS = """
[[traction]]
group = "top"
tx = 1.0

[[force]]
group = "top"
fx = "x + t"
"""


def test_what_calculix_has_not_is_named_with_its_line(tmp_path):
    case = case_of(tmp_path, LACKS)
    line = len(case.path.read_text().splitlines())
    with pytest.raises(CaseError) as caught:
        export_deck(case, tmp_path / "job.inp")
    told = str(caught.value).splitlines()
    assert [f"line {k}" in text for k, text in zip((line - 6, line), told, strict=True)] == [True, True], told
    assert "[[traction]]" in told[0] and "depends on the place" in told[1]
    assert not (tmp_path / "job.inp").exists()
    left = [text for text in export_deck(case, tmp_path / "job.inp", partial=True) if text.startswith("left out: ")]
    assert len(left) == 2
    assert len(import_deck(tmp_path / "job.inp", tmp_path / "again.toml").case.force) == 0


def test_a_rigid_body_and_springs(tmp_path):
    rigid = '[[rigid]]\ngroup = "top"\nuz = -0.1\nfx = 3.0\nmoment = [0, 0, 4.0]\n'
    case = case_of(tmp_path, f'[[spring]]\ngroup = "slave"\nkx = 2.0\n{rigid}')
    export_deck(case, tmp_path / "job.inp")
    again = import_deck(tmp_path / "job.inp", tmp_path / "again.toml").case
    (body,), (spring,) = again.rigid, again.spring
    assert spring.kx == 2 and body.uz.at(1) == -0.1 and body.fx.at(1) == 3 and body.uy.at(1) == 0
    assert body.rotation is None and [one.at(1) for one in body.moment] == [0, 0, 4]


def test_a_rigid_body_turns_about_the_axes_that_are_free_alone(tmp_path):
    turns, moment = 'rotation = ["free", 0, 0.1]\n', "moment = [3.0, 0, 0]\n"
    case = case_of(tmp_path, f'[[rigid]]\ngroup = "top"\n{turns}{moment}[[rigid]]\ngroup = "master"\n{turns}')
    export_deck(case, tmp_path / "job.inp", partial=True)
    rows = (tmp_path / "job.inp").read_text().split("*RIGID BODY")[1:]
    first, second = (int(row.partition("ROT NODE=")[2].split()[0]) for row in rows)
    text = (tmp_path / "job.inp").read_text()
    assert [f"\n{node}, {k}, {k}\n" in text for node in (first, second) for k in (1, 2, 3)] == [False, True, False] * 2
    assert f"\n{first}, 1, 1.0\n" in text and f"\n{first}, 3, 3, 1.0\n" in text and f"\n{second}, 3, 3, 1.0\n" in text


def test_rubber_and_a_wall_without_cells(tmp_path):
    """The constants of rubber come back; a wall of faces alone has no contact in CalculiX, with --partial neither."""
    changes = {"model": 'kinematics = "finite"\n', "young": 'law = "neo_hookean"\n', "value": "follower = true\n"}
    (note, _) = export_deck(case_of(tmp_path, **changes), tmp_path / "job.inp")
    assert "another volumetric energy" in note
    (material,) = import_deck(tmp_path / "job.inp", tmp_path / "again.toml").case.material
    assert (material.law, material.young, material.poisson) == ("neo_hookean", pytest.approx(2000), pytest.approx(0.3))
    wall = read_case(DATA / "impact" / "bar_on_wall.toml")
    with pytest.raises(CaseError, match=r"bar_on_wall.toml, line \d+: .*faces without a cell behind them"):
        export_deck(wall, tmp_path / "wall.inp", partial=True)
    assert not (tmp_path / "wall.inp").exists()


def test_a_deck_that_is_there_stays_until_the_new_one_is_whole(tmp_path):
    case, path = case_of(tmp_path), tmp_path / "job.inp"
    path.write_text("before")
    before = sorted(tmp_path.iterdir())
    broken = ["*MATERIAL, NAME=M1\n", None]  # writing the second card fails, after the mesh
    with pytest.raises(TypeError):
        write(Export(case, read(DATA / "two_blocks.msh"), model=broken), path)
    assert path.read_text() == "before" and sorted(tmp_path.iterdir()) == before


def test_each_section_is_written_or_lacking():
    assert set(HANDLERS) <= {(path[0]) for path, _ in read_case(DATA / "two_blocks.toml").records()} | {
        "tie", "force", "gravity", "rigid", "spring", "displacement",
    }  # fmt: skip


def displacements(case, mesh, folder):
    """Displacements of all nodes at the end: of lacsolver, and of the exported deck by CalculiX."""
    path = folder / "job.inp"
    notes = export_deck(case, path, mesh=mesh)
    first, last = (path.read_text().find("*STEP"), path.read_text().rfind("*END STEP"))
    text = path.read_text()
    every = "*NSET, NSET=EVERY, GENERATE\n1, 99999\n"
    path.write_text(f"{text[:first]}{every}{text[first:last]}*NODE PRINT, NSET=EVERY\nU\n{text[last:]}")
    rows = tables(run_calculix(path, PROGRAM))[-1][1]
    problem = Problem.of(case, mesh)
    *_, state = march(problem)
    place = {number: k for k, number in enumerate(problem.space.mesh.node_number.tolist())}
    u = state.u.reshape(-1, problem.space.dim)
    rows = np.array([row for row in rows if int(row[0]) in place])  # others belong to no cell
    return u[[place[int(number)] for number in rows[:, 0]]], rows[:, 1 : 1 + u.shape[1]], notes


@pytest.mark.calculix
@pytest.mark.parametrize(("more", "rel"), [("", 2e-2), ("clearance = -0.005\n", 3e-2), ("stiffness = 1e4\n", 2e-2)])
def test_calculix_runs_the_two_blocks(tmp_path, more, rel):
    """The penalty of rigid contact is all that differs; a clearance is an overlap that is pressed apart."""
    mine, theirs, notes = displacements(case_of(tmp_path, slave=more), None, tmp_path)
    assert np.abs(mine - theirs).max() < rel * np.abs(theirs).max()
    assert [("is rigid in lacsolver" in note) for note in notes] == [True] * ("stiffness" not in more)


@pytest.mark.calculix
def test_calculix_runs_a_deck_that_was_imported(tmp_path):
    made = import_deck(DATA / "punch.inp", tmp_path / "case.toml")
    mine, theirs, _ = displacements(made.case, made.mesh, tmp_path)
    assert np.abs(mine - theirs).max() < 5e-3 * np.abs(theirs).max()


def test_the_command(tmp_path, capsys):
    case = case_of(tmp_path, LACKS)
    assert main(["export", str(case.path)]) == 1
    assert "[[traction]]" in capsys.readouterr().err
    assert main(["export", str(case.path), "--partial", "-o", str(tmp_path / "job.inp")]) == 0
    out, err = capsys.readouterr()
    assert "job.inp: run it with ccx" in out and err.count("lacsolver: warning: left out: ") == 2
    assert err.count("lacsolver: note: contact joint is rigid in lacsolver") == 1
    assert main(["export", str(case.path), "--partial", "-o", str(tmp_path / "job.inp")]) == 2
    assert main(["export", str(case.path), "-o", str(tmp_path / "job.msh")]) == 2
