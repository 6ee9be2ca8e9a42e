"""The tutorials: what their commands print, their pictures, and the figures that pages quote."""

import importlib
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
    """docs/make.py, as a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(TUTORIALS.parent))
        yield importlib.import_module("make")


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
    pictures = {name for page in PAGES for name in tutorials.pictures(page)}
    assert {p.name for p in TUTORIALS.glob("*.png")} == pictures
    assert all(size_of(TUTORIALS / name)[0] == 1000 for name in pictures)
    kept = [path for path in TUTORIALS.parent.rglob("*") if path.suffix in (".png", ".gif", ".svg")]
    assert sum(path.stat().st_size for path in kept) < 2_100_000  # of 4 MB of all documents


def test_the_page_of_a_mesh_of_your_own_is_its_scripts(tutorials):
    """All of them, in their order, word for word."""
    scripts = [(TUTORIALS / f"{name}.py").read_text("utf-8") for name in ("own_mesh", "half_width")]
    whole = "".join(text.partition('"""\n\n')[2] for text in scripts)
    shown = "".join(tutorials.blocks(TUTORIALS / "own_mesh.md", "python"))
    assert [line for line in shown.splitlines() if line] == [line for line in whole.splitlines() if line]


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("first_run", marks=drawn),
        pytest.param("own_mesh", marks=drawn),
        pytest.param("friction", marks=slow),
        pytest.param("flange", marks=slow),
        pytest.param("pin_in_lug", marks=slow),
        pytest.param("step_to_med", marks=slow),
    ],
)
def test_commands_print_what_the_page_shows_and_pictures_are_made_again(tutorials, ran, name):
    folder, done = ran(name)
    assert shows_what_the_page_shows(done)
    printed = {plain(line) for _, text in done for line in text.splitlines()}
    shown = [line for block in tutorials.blocks(TUTORIALS / f"{name}.md", "text") for line in block.splitlines()]
    assert {plain(line) for line in shown} <= printed
    for picture in tutorials.pictures(TUTORIALS / f"{name}.md"):
        path = folder / "docs" / picture
        tutorials.keep(folder / picture, path)
        assert size_of(path) == size_of(TUTORIALS / path.name) and path.stat().st_size < 150_000
        ours, theirs = (np.array(tones(p, *PALETTE, *RAMP)) for p in (path, TUTORIALS / path.name))
        shown = np.maximum(ours, theirs) > 2000
        assert (np.abs(ours - theirs)[shown] < 0.35 * theirs[shown]).all(), path.name


# ---- what they quote


@pytest.mark.vtk
def test_the_results_of_the_first_run_are_read_in_python(tutorials, ran, monkeypatch, capsys):
    folder, _ = ran("first_run")
    monkeypatch.chdir(folder)
    (block,) = tutorials.blocks(TUTORIALS / "first_run.md", "python")
    exec(compile(block, "first_run.md", "exec"), {})
    times, forces, largest = capsys.readouterr().out.splitlines()
    assert times == "[1.  1.5 2. ]" and float(forces.strip("[]").split()[-1]) == 0
    assert float(largest) == pytest.approx(14.0367, rel=1e-5) and "at the first time: 14.0367" in block


#: a model of gmsh that is cut, saved with the views of the cut, and read back; then one made from a mesh
IN_GMSH = """
import gmsh

import lacmesh
from lacmesh.gmsh import cut_model, from_mesh, to_mesh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.add("cube")
gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
gmsh.model.mesh.generate(3)
cut_model("entity:2:6")

gmsh.option.setNumber("Mesh.SaveAll", 1)
gmsh.write("cube.msh")
gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
for view in gmsh.view.getTags():
    gmsh.view.write(view, "cube.msh", append=True)
print(lacmesh.Cut(lacmesh.read("cube.msh")).n_macros, "macro-elements in cube.msh")
mesh = to_mesh()
print(lacmesh.Cut(mesh).n_macros, "macro-elements in the model", mesh.name)

from_mesh(lacmesh.read("roller.msh"), name="roller")
from_mesh(lacmesh.raise_order(to_mesh()), name="quadratic")
print(gmsh.model.getCurrent(), "has cells of the types", gmsh.model.mesh.getElementTypes(3))
gmsh.finalize()
"""


@pytest.mark.gmsh
@pytest.mark.vtk
@pytest.mark.filterwarnings("ignore:.*InterpolationScheme")  # a section of gmsh's views, without any part of the cut
def test_the_script_cuts_and_saves_in_gmsh(ran, monkeypatch, capsys, request):
    folder, _ = ran("own_mesh")
    cut = lacmesh.Cut(lacmesh.read(folder / "roller.med"))
    assert cut.n_macros == 10 * 8 and cut.mesh.cells_by_type["HEXA8"] == 10 * 8 * (3 + 5 + 1)
    groups = {n: len(c) for n, c in cut.mesh.cell_groups.items()}
    assert set(groups) == {"contact", "bottom", "symmetry", "top", "roller_face", "block", "roller"}
    assert {n: len(c) for n, c in lacmesh.read(folder / "roller.msh").cell_groups.items()} == groups
    handler = signal.getsignal(signal.SIGINT)  # gmsh.initialize sets another
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, handler))
    monkeypatch.chdir(folder)
    exec(compile(IN_GMSH, "in_gmsh", "exec"), {})
    in_file, in_model, types = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"[1-9]\d* macro-elements in cube\.msh", in_file)
    assert in_model == in_file.replace("in cube.msh", "in the model cube") and types.endswith("[11 17]")


@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_half_width_of_own_mesh_is_hertz(ran):
    (printed,) = (text for command, text in ran("own_mesh")[1] if "half_width" in command.words[-1])
    (a, p0), (a_hertz, p0_hertz) = np.array(re.findall(r"a = (\S+), p0 = (\S+)", printed), float)
    assert a == pytest.approx(a_hertz, rel=5e-3) and p0 == pytest.approx(p0_hertz, rel=5e-3)


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


# ---- the own solver


@pytest.mark.filterwarnings("ignore:master .* is in front of")
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
