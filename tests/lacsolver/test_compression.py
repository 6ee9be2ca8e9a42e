"""Bodies of the law of Saint Venant-Kirchhoff that are crushed: stretch, place and time, and the warning of a run."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.errors import LacmeshWarning
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.results.compression import LARGEST, most_compressed, softened, worse
from lacsolver.running import run
from tests.lacsolver.deck_texts import held as deck_held
from tests.lacsolver.deck_texts import imported, section, step
from tests.lacsolver.distributed.mpi import in_ranks, own_lines
from tests.lacsolver.mode_cases import block, hold
from tests.lacsolver.test_import import COLUMN
from tests.samples import each_option

BODY = 'mesh = "body.msh"\nmodel = "{model}"\nkinematics = "finite"\n'
BODY += '[[material]]\nlaw = "{law}"\nyoung = 100.0\npoisson = 0.3\n'
SIDES = {"3d": "xyz", "plane_strain": "xy", "plane_stress": "xy", "axisymmetric": "y"}


def pressed(model, down, law="saint_venant_kirchhoff", more=""):
    """A block or ring of height 1 on rollers, whose top moves by `down` along its last axis; the sides are free."""
    up = "z" if model == "3d" else "y"
    rollers = hold(**{f"{a}0": f"u{a}" for a in SIDES[model]})
    top = f'[[displacement]]\ngroup = "{up}1"\nu{up} = {down}\n'
    return BODY.format(model=model, law=law) + more + rollers + top


def body_of(model, n=2):
    return (
        block("HEXA8", n, "3d") if model == "3d" else block("QUAD4", n, shift=1.0 if model == "axisymmetric" else 0.0)
    )


def told(tmp_path, case, mesh):
    """The warnings of a run."""
    lacmesh.write(tmp_path / "body.msh", mesh)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        done = run(parse_case(case), create_output(tmp_path / "out", force=True), mesh=mesh)
    said = [str(w.message) for w in caught if issubclass(w.category, LacmeshWarning)]
    assert done.message == "\n".join(said)
    return said


@pytest.mark.parametrize(("model", "stretch"), each_option(itertools.product(SIDES, (0.75, 0.69, 0.5))))
def test_a_body_that_is_pressed(model, stretch, tmp_path):
    said = told(tmp_path, pressed(model, f'"{stretch - 1} * t"', more="[steps]\ncount = 4\n"), body_of(model))
    if stretch > 0.7:
        assert said == []
        return
    (line,) = said
    assert f"is compressed to a principal stretch of {stretch:g}, most near (" in line
    assert "at time 1; this law is meant for small strains, and below 0.577 its force falls" in line
    assert line.endswith('take law = "neo_hookean"')


def test_the_force_is_largest_where_the_warning_says():
    """Uniaxial strain: dP/dx = 0, from the reactions of two states on either side."""
    sides = hold(x0="ux", x1="ux", y0="uy")
    case = BODY.format(model="plane_strain", law="saint_venant_kirchhoff") + "[steps]\ncount = 25\nend = 25.0\n"
    case += sides + '[[displacement]]\ngroup = "y1"\nuy = "-0.02 * t"\n'
    problem = Problem.of(parse_case(case), body_of("plane_strain", 1))
    top = problem.space.mesh.points[:, 1] == 1
    forces = [-state.reaction.reshape(-1, 2)[top, 1].sum() for state in march(problem)]
    assert 1 - 0.02 * (1 + int(np.argmax(forces))) == pytest.approx(LARGEST, abs=0.01)


def test_the_law_neo_hookean_is_not_warned_of(tmp_path):
    case = pressed("plane_strain", '"-0.5 * t"', "neo_hookean", "[steps]\ncount = 4\n")
    assert told(tmp_path, case, body_of("plane_strain")) == []


def test_the_worst_step_counts_and_the_material_is_named(tmp_path):
    """Pressed, and let go again; one of two materials is the softer one. A rotation is no compression."""
    mesh = body_of("plane_strain", 2)
    upper = np.flatnonzero(mesh.points[mesh.blocks[0].nodes][..., 1].mean(axis=1) > 0.5)
    groups = {"upper": upper, "lower": np.setdiff1d(np.arange(mesh.n_cells), upper)}
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_groups=groups, node_groups=mesh.node_groups, space_dim=2)
    case = pressed("plane_strain", '"-0.25 * (1 - abs(t - 1))"', more="[steps]\ncount = 8\nend = 2.0\n")
    soft = 'groups = ["upper"]\n[[material]]\nlaw = "saint_venant_kirchhoff"\ngroups = ["lower"]\n'
    soft += "young = 1e6\npoisson = 0.3\n"
    (line,) = told(tmp_path, case.replace("poisson = 0.3\n", f"poisson = 0.3\n{soft}", 1), mesh)
    assert line.startswith("material 'upper' of law saint_venant_kirchhoff is compressed to a principal stretch of 0.")
    assert " at time 1; " in line


def test_a_turned_body_is_not_compressed():
    turn = np.array([[0.0, -1], [1, 0]])
    problem = Problem.of(parse_case(pressed("plane_strain", 0.0)), body_of("plane_strain"))
    (state,) = march(problem)
    x = problem.space.mesh.points[:, :2]
    for stretch in (1.0, 0.6):
        object.__setattr__(state, "u", (x @ (turn * [1.0, stretch]).T - x).ravel())
        found = most_compressed(problem, state)
        assert found[0, 0] == (pytest.approx(stretch) if stretch < 0.7 else np.inf)


def test_what_heat_alone_would_stretch_is_compressed(tmp_path):
    """A body that is held and warm: its elastic stretch is 1 / 1.6 = 0.625."""
    hot = 'expansion = 6e-3\n[[temperature]]\nvalue = "100 * t"\n[steps]\ncount = 4\n'
    case = BODY.format(model="plane_strain", law="saint_venant_kirchhoff") + hot
    sides = hold(x0="ux", x1="ux", y0="uy", y1="uy")
    (line,) = told(tmp_path, case + sides, body_of("plane_strain"))
    assert "a principal stretch of 0.625, " in line


def test_a_run_that_does_not_converge_tells_what_was_crushed(tmp_path):
    """A pressure that grows to more than the largest that the law can bear, 25.9."""
    case = BODY.format(model="plane_strain", law="saint_venant_kirchhoff")
    case += "[steps]\ncount = 6\nmax_halvings = 0\n[solver]\nmax_iterations = 15\n" + hold(x0="ux", x1="ux", y0="uy")
    mesh = body_of("plane_strain", 1)
    top = np.flatnonzero(mesh.points[:, 1] == 1)[None]
    mesh = Mesh.create(
        mesh.points, [*mesh.blocks, ("SEG2", top)], cell_groups={"top": [mesh.n_cells]}, node_groups=mesh.node_groups
    )
    case += '[[pressure]]\ngroup = "top"\nvalue = "30 * t"\n'
    with warnings.catch_warnings(record=True) as caught, pytest.raises(NotConvergedError):
        warnings.simplefilter("always")
        run(parse_case(case), create_output(tmp_path / "out"), mesh=mesh)
    assert ["compressed to a principal stretch of 0.66" in str(w.message) for w in caught] == [True]


def test_the_lesser_stretch_is_kept():
    one, other = np.array([[0.6, 1.0], [np.inf, np.inf]]), np.array([[0.65, 2.0], [0.5, 2.0]])
    assert worse(one, other).tolist() == worse(other, one).tolist() == [[0.6, 1.0], [0.5, 2.0]]
    assert list(softened(Problem.of(parse_case(pressed("plane_strain", 0.0)), body_of("plane_strain")), one[1:])) == []


@pytest.mark.petsc
def test_several_processes_say_it_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lacmesh.write("body.msh", body_of("plane_strain", 4))
    (tmp_path / "case.toml").write_text(pressed("plane_strain", '"-0.4 * t"', more="[steps]\ncount = 4\n"))
    done = in_ranks(3, "import sys\nfrom lacsolver.cli import main\nsys.exit(main(sys.argv[1:]))", "run", "case.toml")
    assert done.returncode == 0, done.stderr
    (line,) = own_lines(done.stderr)
    assert "compressed to a principal stretch of 0.6, most near (" in line


def test_import_says_it_of_nlgeom(tmp_path):
    deck = COLUMN.text() + section() + deck_held() + step("*CLOAD\n1, 3, 0.\n", ", NLGEOM")
    (note,) = [one for one in imported(tmp_path, deck).findings if one.card == "MATERIAL"]
    assert note.level == "note" and "has the law saint_venant_kirchhoff" in note.text and "neo_hookean" in note.text
    small = imported(tmp_path, deck.replace(", NLGEOM", ""))
    assert [one for one in small.findings if one.card == "MATERIAL"] == []
