"""The tutorials, run as their pages stand: what commands print, their pictures, and the figures that pages quote."""

import importlib.util
import json
import re
import signal
import struct
import subprocess
import sys

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.drawing import RAMP
from lacmesh.gmsh.cad import list_cad
from lacmesh.grids import PALETTE
from tests import REPOSITORY
from tests.viewing import tones

TUTORIALS = REPOSITORY / "docs" / "tutorials"
PAGES = sorted(TUTORIALS.glob("*.md"))
drawn = [pytest.mark.gmsh, pytest.mark.vtk]
slow = [pytest.mark.slow, *drawn]


def loaded(name):
    """A script of the tutorials, as a module."""
    spec = importlib.util.spec_from_file_location(name, TUTORIALS / f"{name}.py")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[name]
    return module


@pytest.fixture(scope="module")
def tutorials():
    """docs/tutorials/run.py, as a module."""
    return loaded("run")


@pytest.fixture(scope="module")
def ran(tutorials, tmp_path_factory):
    """A function that runs the commands of a page once: the folder, and what each printed, by its words."""
    done = {}

    def run(name):
        if name not in done:
            folder = tmp_path_factory.mktemp(name)
            done[name] = folder, list(tutorials.run_page(TUTORIALS / f"{name}.md", folder))
        return done[name]

    return run


def pictures_of(page):
    return re.findall(r"!\[[^\]]+\]\((\S+\.png)\)", page.read_text(encoding="utf-8"))


def size_of(path):
    """Width and height of a PNG, from its head."""
    head = path.read_bytes()[:24]
    assert head.startswith(b"\x89PNG\r\n\x1a\n")
    return struct.unpack(">2I", head[16:])


def plain(line):
    """A line without the spaces and rules of tables, and without the digits of round-off."""
    return re.sub(r"\b\d[.\d]*e-1\d\b", "0", " ".join(line.split()))


def shows_what_the_page_shows(done):
    """Assert that each command printed the lines of its page; `...` stands for lines left out."""
    for command, printed in done:
        lines = {plain(line) for line in printed.splitlines()}
        assert {plain(line) for line in command.shown} - {"..."} <= lines, command.words
    return True


# ---- the pages


def test_every_page_is_run_and_no_picture_is_left_over(tutorials):
    assert sorted(tutorials.PAGES) == [page.name for page in PAGES]
    pictures = {name for page in PAGES for name in pictures_of(page)}
    assert {p.name for p in TUTORIALS.glob("*.png")} == pictures
    assert all(size_of(TUTORIALS / name)[0] >= 1000 for name in pictures)


#: page -> its scripts, and how many of its blocks come after them
SCRIPTS = {
    "gmsh_script": (["gmsh_script"], 2),
    "bolt_script": (["bolt_script"], 0),
    "own_mesh": (["own_mesh", "half_width"], 0),
    "p0_mortar": (["p0_mortar"], 0),
    "own_solver": (["own_solver"], 0),
}


@pytest.mark.parametrize("page", SCRIPTS)
def test_the_page_is_the_script(tutorials, page):
    """All of it, in its order, word for word."""
    scripts, rest = SCRIPTS[page]
    whole = "".join((TUTORIALS / f"{name}.py").read_text("utf-8").partition('"""\n\n')[2] for name in scripts)
    pieces = tutorials.blocks(TUTORIALS / f"{page}.md", "python")
    told = [line for line in "".join(pieces[: len(pieces) - rest]).splitlines() if line]
    assert told == [line for line in whole.splitlines() if line]


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("gmsh_script", marks=slow),
        pytest.param("own_mesh", marks=drawn),
        pytest.param("from_calculix", marks=pytest.mark.calculix),
        pytest.param("own_solver", marks=pytest.mark.slow),
        pytest.param("p0_mortar", marks=pytest.mark.slow),
        pytest.param("bolt_script", marks=slow),
        pytest.param("pin_in_lug", marks=slow),
        pytest.param("step_to_med", marks=slow),
    ],
)
def test_commands_print_what_the_page_shows_and_pictures_are_made_again(ran, name):
    folder, done = ran(name)
    assert shows_what_the_page_shows(done)
    assert sorted(pictures_of(TUTORIALS / f"{name}.md")) == sorted(path.name for path in folder.glob("*.png"))
    for path in folder.glob("*.png"):
        assert size_of(path) == size_of(TUTORIALS / path.name) and path.stat().st_size < 500_000
        ours, theirs = (np.array(tones(p, *PALETTE, *RAMP)) for p in (path, TUTORIALS / path.name))
        shown = np.maximum(ours, theirs) > 2000
        assert (np.abs(ours - theirs)[shown] < 0.35 * theirs[shown]).all(), path.name


# ---- what they quote


@pytest.mark.gmsh
@pytest.mark.vtk
@pytest.mark.filterwarnings("ignore:.*InterpolationScheme")  # gmsh_script.md says so
def test_the_script_cuts_and_saves(tutorials, ran, monkeypatch, capsys, request):
    folder, _ = ran("gmsh_script")
    cut = lacmesh.Cut(lacmesh.read(folder / "roller.med"))
    assert cut.n_macros == 10 * 8 and cut.mesh.cells_by_type["HEXA8"] == 10 * 8 * (3 + 5 + 1)
    groups = {n: len(c) for n, c in cut.mesh.cell_groups.items()}
    assert set(groups) == {"contact", "bottom", "symmetry", "top", "roller_face", "block", "roller"}
    assert {n: len(c) for n, c in lacmesh.read(folder / "roller.msh").cell_groups.items()} == groups
    handler = signal.getsignal(signal.SIGINT)  # gmsh.initialize sets another
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, handler))
    monkeypatch.chdir(folder)
    space = {}
    for piece in tutorials.blocks(TUTORIALS / "gmsh_script.md", "python")[-2:]:
        exec(compile(piece, "gmsh_script.md", "exec"), space)
    in_file, in_model, types = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"[1-9]\d* macro-elements in cube\.msh", in_file)
    assert in_model == in_file.replace("in cube.msh", "in the model cube") and types.endswith("[11 17]")


@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_half_width_of_own_mesh_is_hertz(ran):
    (printed,) = (text for command, text in ran("own_mesh")[1] if "half_width" in command.words[-1])
    (a, p0), (a_hertz, p0_hertz) = np.array(re.findall(r"a = (\S+), p0 = (\S+)", printed), float)
    assert a == pytest.approx(a_hertz, rel=5e-3) and p0 == pytest.approx(p0_hertz, rel=5e-3)


@pytest.mark.calculix
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_a_deck_has_the_same_forces_in_both_programs(ran):
    forces, *pressures = ran("from_calculix")[1][-1][1].splitlines()
    before, after, lac = (float(word) for word in re.findall(r"[0-9.]+", forces))
    assert after == pytest.approx(before, rel=1e-3) and lac == pytest.approx(before, rel=5e-3)
    before, after, lac = (float(line.split()[-1]) for line in pressures)
    assert after == pytest.approx(before, rel=5e-2) and 0.9 * before < lac < before


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_a_step_file_becomes_a_cut_mesh_and_pressures_in_balance(ran):
    folder, done = ran("step_to_med")
    cut = lacmesh.Cut(lacmesh.read(folder / "lug.lac.med"))
    assert cut.zones == ("bore",) and cut.n_macros == len(cut.mesh.cell_groups["bore"]) // 3 > 100
    checked = " ".join("".join(printed for command, printed in done if "check" in command.words).split())
    assert f"{cut.n_macros} of {cut.n_macros} macro-elements own an internal dof" in checked
    zone = json.loads((folder / "lug" / "results.json").read_text(encoding="utf-8"))["contact"]["eye"]
    assert zone["resultant"][2] == pytest.approx(-2 * 183.22 * 100, rel=1e-3) and zone["unpaired"] == 0  # of both ends
    assert 1 / 8 < zone["active"] / (zone["active"] + zone["open"]) < 1 / 5


@pytest.mark.gmsh
def test_the_step_file_is_its_scripts(tmp_path):
    """The file holds the same shapes, whatever version of gmsh writes it, and names neither date nor machine."""
    kept = REPOSITORY / "data" / "pin_in_lug.step"
    maker = kept.parent / "make_pin_in_lug.py"
    subprocess.run([sys.executable, str(maker), str(tmp_path / kept.name)], check=True, capture_output=True)
    ours, made = (list_cad(path) for path in (kept, tmp_path / kept.name))
    assert [(s.dim, s.type) for s in made] == [(s.dim, s.type) for s in ours]
    for a, b in zip(ours, made, strict=True):
        assert a.measure == pytest.approx(b.measure, rel=1e-9) and a.radius == (b.radius and pytest.approx(b.radius))
    assert not re.search(r"\d{4}-\d\d-\d\dT", kept.read_text(encoding="utf-8"))


# ---- the P0 mortar


@pytest.fixture(scope="module")
def p0_mortar():
    return loaded("p0_mortar")


def uncut_and_cut(p0_mortar, n):
    """A mesh of n faces and its cut, each with the contact of the tutorial on it."""
    mesh = p0_mortar.pad(n)
    return (mesh, p0_mortar.p0_mortar), (lacmesh.cut_skin(mesh, "slave").mesh, p0_mortar.lac)


def turns(p):
    return int((np.diff(np.sign(np.diff(p))) != 0).sum())


@pytest.mark.parametrize("n", [25, 49])
def test_faces_oscillate_and_macro_elements_do_not(p0_mortar, n):
    """Faces open at both ends; the gaps' sum with alternating signs is not zero, so not every face can be closed."""
    (mesh, mortar), cut = uncut_and_cut(p0_mortar, n)
    p, smooth = p0_mortar.pressures(mesh, mortar), p0_mortar.pressures(*cut)
    assert turns(smooth) == 1 and turns(p) >= n - 3
    assert np.median(np.abs(p - smooth)[1:-1] / smooth.max()) > 0.15
    assert p.sum() == pytest.approx(smooth.sum(), rel=0.04)
    _, G, _ = mortar(mesh)
    opened = np.flatnonzero(p == 0)
    assert len(opened) == 2 and opened[0] < 3 and opened[1] > n - 4
    assert abs(G @ (-1.0) ** np.arange(n)) > 1e-5 * np.abs(G).sum()


def test_the_inf_sup_constant_is_zero_uncut_and_that_of_no_mesh_cut(p0_mortar):
    """The hypothesis, seen: theory.md and p0_mortar.md say so."""
    pairs = [uncut_and_cut(p0_mortar, n) for n in (9, 25, 49)]
    uncut, cut = (np.array([p0_mortar.inf_sup(*pair[k]) for pair in pairs]) for k in (0, 1))
    assert uncut[:, 0].max() < 1e-6 and (uncut[1:, 1] < 0.6 * uncut[:-1, 1]).all()
    assert cut.min() > 0.57 and np.ptp(cut[:, 0]) < 0.01
    felt = []
    for mesh, stage in uncut_and_cut(p0_mortar, 25):  # the alternating pressure moves nothing on the uncut mesh
        B, _, w = stage(mesh)
        T = p0_mortar.held(mesh).problem.constraints.T
        felt.append(np.abs(T.T @ (B.T @ (-1.0) ** np.arange(25))).max() / w.max())
    assert felt[0] < 1e-14 and felt[1] > 0.1


# ---- the own solver


def test_the_own_solver_agrees_with_lacsolver():
    own = loaded("own_solver")
    path = REPOSITORY / "data" / "disc_on_block.msh"
    pair, found = own.solve(path)
    case = ls.Case(
        model="plane_strain",
        material=[ls.Material(young=own.YOUNG, poisson=own.POISSON)],
        contact=[ls.Contact(slave="slave", master="master")],
        displacement=[
            ls.Displacement(group="bottom", ux=0.0, uy=0.0),
            ls.Displacement(group="symmetry_x", ux=0.0),
            ls.Displacement(group="top", uy=-own.PRESSED),
        ],
    )
    reference = ls.solve(case, path)
    pressure = reference.contact["slave"].pressure
    assert np.abs(found.u - reference.u.ravel()).max() < 1e-9 * np.abs(reference.u).max()
    assert np.abs(found.pressure - pressure).max() < 1e-9 * pressure.max()
    assert 3 < found.status.sum() < (pair.coverage > 0.5).sum() < len(found.status)
