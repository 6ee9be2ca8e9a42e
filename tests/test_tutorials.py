"""The tutorials, run as their pages stand: commands, scripts, what they print, their pictures and their web page."""

from __future__ import annotations

import importlib
import json
import re
import shutil
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.scene import colours
from tests.browser import Browser
from tests.viewing import tones

TUTORIALS = Path(__file__).resolve().parents[1] / "docs" / "tutorials"
PAGES = sorted(TUTORIALS.glob("*.md"))
WARNING = ".*InterpolationScheme"  # gmsh_script.md says so


@pytest.fixture(scope="module")
def tutorials():
    """docs/tutorials/run.py, as a module."""
    sys.path.insert(0, str(TUTORIALS))
    try:
        yield importlib.import_module("run")
    finally:
        sys.path.remove(str(TUTORIALS))
        sys.modules.pop("run", None)


@pytest.fixture(scope="module")
def script(tutorials, tmp_path_factory):
    """The folder in which the commands of gmsh_script.md have run, and what each printed."""
    folder = tmp_path_factory.mktemp("script")
    return folder, list(tutorials.run_page(TUTORIALS / "gmsh_script.md", folder))


@pytest.fixture(scope="module")
def own(tutorials, tmp_path_factory):
    """The folder in which the commands of own_mesh.md have run, and what each printed."""
    folder = tmp_path_factory.mktemp("own")
    return folder, list(tutorials.run_page(TUTORIALS / "own_mesh.md", folder))


@pytest.fixture(scope="module")
def step(tutorials, tmp_path_factory):
    """The folder in which the commands of step_to_med.md have run, and what each printed."""
    folder = tmp_path_factory.mktemp("step")
    return folder, list(tutorials.run_page(TUTORIALS / "step_to_med.md", folder))


@pytest.fixture(scope="module")
def pin(tutorials, tmp_path_factory):
    """The folder in which the commands of pin_in_lug.md have run, and what each printed."""
    folder = tmp_path_factory.mktemp("pin")
    return folder, list(tutorials.run_page(TUTORIALS / "pin_in_lug.md", folder))


def pictures_of(page):
    return re.findall(r"!\[[^\]]+\]\((\S+\.png)\)", page.read_text(encoding="utf-8"))


def size_of(path):
    """Width and height of a PNG, from its head."""
    head = path.read_bytes()[:24]
    assert head.startswith(b"\x89PNG\r\n\x1a\n")
    return struct.unpack(">2I", head[16:])


def is_like(made, kept):
    """True if a picture has the size of the one in the docs, shows macro-elements, and marks no finding as error."""
    shown = tones(made, *colours.PALETTE)
    return size_of(made) == size_of(kept) and sum(count > 200 for count in shown) >= 5 and made.stat().st_size < 500_000


def shows_what_the_page_shows(done):
    """Assert that each command printed the lines of its page, apart from the spaces and rules of tables."""
    for command, printed in done:
        lines = {" ".join(line.split()) for line in printed.splitlines()}
        assert {" ".join(line.split()) for line in command.shown} <= lines, command.words
    return True


# ---- the pages


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_pictures_and_links_are_there(page):
    assert pictures_of(page) and all(size_of(TUTORIALS / name)[0] >= 1000 for name in pictures_of(page))
    for target in re.findall(r"\[[^\]]+\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert (TUTORIALS / target).is_file()


def test_no_picture_is_left_over():
    assert {p.name for p in TUTORIALS.glob("*.png")} == {name for page in PAGES for name in pictures_of(page)}


def test_the_page_is_the_script(tutorials):
    """gmsh_script.md and bolt_script.md tell their scripts in pieces: all of it, in its order, word for word."""
    for name, rest in (("gmsh_script", 2), ("bolt_script", 0)):
        whole = (TUTORIALS / f"{name}.py").read_text(encoding="utf-8").partition('"""\n\n')[2]
        pieces = tutorials.blocks(TUTORIALS / f"{name}.md", "python")
        told = [line for line in "".join(pieces[: len(pieces) - rest]).splitlines() if line]
        assert told == [line for line in whole.splitlines() if line]


def test_every_page_is_run(tutorials):
    assert sorted(tutorials.PAGES) == [page.name for page in PAGES]


# ---- a script of gmsh


@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_script_cuts_and_saves(script):
    folder, done = script
    assert shows_what_the_page_shows(done) and all(command.shown for command, _ in done[:1])
    cut = lacmesh.Cut(lacmesh.read(folder / "roller.med"))
    assert cut.n_macros == 10 * 8 and cut.mesh.cells_by_type["HEXA8"] == 10 * 8 * (3 + 5 + 1)
    groups = {n: len(c) for n, c in cut.mesh.cell_groups.items()}
    assert set(groups) == {"contact", "bottom", "symmetry", "top", "roller_face", "block", "roller"}
    assert {n: len(c) for n, c in lacmesh.read(folder / "roller.msh").cell_groups.items()} == groups
    assert is_like(folder / "roller.png", TUTORIALS / "roller.png")


@pytest.mark.gmsh
@pytest.mark.vtk
@pytest.mark.filterwarnings(f"ignore:{WARNING}")
def test_the_rest_of_the_scripts_page_runs(tutorials, script, monkeypatch, capsys, request):
    handler = signal.getsignal(signal.SIGINT)  # gmsh.initialize sets another
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, handler))
    monkeypatch.chdir(script[0])
    space = {}
    for piece in tutorials.blocks(TUTORIALS / "gmsh_script.md", "python")[-2:]:
        exec(compile(piece, "gmsh_script.md", "exec"), space)
    in_file, in_model, types = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"[1-9]\d* macro-elements in cube\.msh", in_file)
    assert in_model == in_file.replace("in cube.msh", "in the model cube")
    assert types == "roller has cells of the types [11 17]"


# ---- a mesh of one's own


@pytest.mark.gmsh
@pytest.mark.vtk
def test_own_mesh_is_solved_as_the_page_says(tutorials, own):
    folder, done = own
    assert shows_what_the_page_shows(done)
    printed = {command.words[1]: " ".join(text.split()) for command, text in done if command.words[0] == "lacsolver"}
    assert "rigid-body mode without support 'cylinder' moves along y" in printed["validate"]
    assert "11 in contact" in printed["run"] and "contact area 0.32267" in printed["run"]
    assert size_of(folder / "pressure.png") == size_of(TUTORIALS / "pressure.png")
    whole = "".join(
        (TUTORIALS / f"{name}.py").read_text().partition('"""\n\n')[2] for name in ("own_mesh", "half_width")
    )
    pieces = tutorials.blocks(TUTORIALS / "own_mesh.md", "python")
    assert [x for x in "".join(pieces).splitlines() if x] == [x for x in whole.splitlines() if x]


@pytest.mark.gmsh
@pytest.mark.vtk
def test_its_half_width_is_hertz(own):
    (printed,) = (text for command, text in own[1] if "half_width" in command.words[-1])
    (a, p0), (a_hertz, p0_hertz) = np.array(re.findall(r"a = (\S+), p0 = (\S+)", printed), float)
    assert a == pytest.approx(a_hertz, rel=5e-3) and p0 == pytest.approx(p0_hertz, rel=5e-3)


# ---- a deck


@pytest.mark.calculix
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_a_deck_has_the_same_forces_in_both_programs(tutorials, tmp_path):
    done = list(tutorials.run_page(TUTORIALS / "from_calculix.md", tmp_path))
    forces, *pressures = done[-1][1].splitlines()
    before, after, lac = (float(word) for word in re.findall(r"[0-9.]+", forces))
    assert after == pytest.approx(before, rel=1e-3) and lac == pytest.approx(before, rel=5e-3)
    before, after, lac = (float(line.split()[-1]) for line in pressures)
    assert after == pytest.approx(before, rel=5e-2) and 0.9 * before < lac < before
    assert shows_what_the_page_shows(done)
    assert size_of(tmp_path / "punch.png") == size_of(TUTORIALS / "punch.png")


# ---- a bolted plate


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_a_bolt_that_is_locked_feels_little_and_the_joint_the_rest(tutorials, tmp_path):
    """From the script to the pressures: forces are in balance, and those of the page."""
    list(tutorials.run_page(TUTORIALS / "bolt_script.md", tmp_path))
    columns = np.genfromtxt(tmp_path / "bolt" / "history.csv", delimiter=",", names=True, deletechars="")
    force = columns["pretension.screw.force"]
    contact = json.loads((tmp_path / "bolt" / "results.json").read_text())["contact"]
    head, joint = (contact[name]["resultant"][2] for name in ("under the head", "joint"))
    assert force[0] == pytest.approx(2500, rel=1e-9) and force[1] == pytest.approx(2503, abs=2)
    assert head == pytest.approx(force[1], rel=1e-9) and head - joint == pytest.approx(800, rel=1e-9)
    assert 0.05 < contact["joint"]["active"] / 114 < 0.25
    assert size_of(tmp_path / "bolt.png") == size_of(TUTORIALS / "bolt.png")
    assert (tmp_path / "bolt.png").stat().st_size < 500_000


# ---- a pin in a lug


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_cylinders_are_found_and_their_gap_is_that_of_the_model(pin):
    smooth, faces = (printed for command, printed in pin[1] if command.words[1] == "check")
    assert re.search(r"bore +cylinder, radius 12, \d+ nodes within \de-15", smooth)
    assert re.search(r"pin +cylinder, radius 11\.8, \d+ nodes within \de-15", smooth)
    least, most = (np.array(re.findall(r"gap from (\S+) to (\S+),", said)[0], float) for said in (smooth, faces))
    assert np.abs(least - [0, 0.4]).max() < 2e-3
    assert most[0] < -0.01 and most[1] > 0.41


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_faces_and_smooth_are_as_the_page_says(pin):
    """Twice as many macro-elements press, a quarter of all as with TETRA10, at half the pressure, force alike."""
    folder, _ = pin
    page = " ".join((TUTORIALS / "pin_in_lug.md").read_text(encoding="utf-8").split())
    told = [json.loads((folder / name / "results.json").read_text()) for name in ("faces", "smooth")]
    faces, smooth = (one["contact"]["eye"] for one in told)
    assert 80 <= faces["active"] <= 100 and 185 <= smooth["active"] <= 215
    assert faces["resultant"][2] == pytest.approx(smooth["resultant"][2], rel=1e-9)
    most = [np.genfromtxt(folder / name / "contact_eye.csv", delimiter=",", names=True)["pressure"].max()
            for name in ("faces", "smooth")]  # fmt: skip
    assert most[0] == pytest.approx(7200, rel=0.05) and most[1] == pytest.approx(3000, rel=0.05)
    assert "E h / 8R" in told[0]["message"] and "E h / 8R" not in told[1]["message"]
    assert "alternate" in told[1]["message"] and "warns that pressures inside the area of contact alternate" in page
    assert sorted(pictures_of(TUTORIALS / "pin_in_lug.md")) == sorted(p.name for p in folder.glob("*.png"))


# ---- a STEP file


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_commands_print_what_the_page_shows(step):
    folder, done = step
    said = [command.words[1] for command, _ in done]
    made = ["mesh", "mesh", "view", "cut", "view", "check", "view", "convert", "info", "view", "view"]
    assert said == [*made, "validate", "run"]
    assert shows_what_the_page_shows(done)
    assert len(done[0][0].shown) == 10  # the list, whose surfaces the next command names
    cut = lacmesh.Cut(lacmesh.read(folder / "lug.lac.med"))
    assert cut.zones == ("bore",) and cut.n_macros == len(cut.mesh.cell_groups["bore"]) // 3 > 100
    assert set(cut.mesh.cell_groups) == {"bore", "pin", "bolt", "ends", "symmetry", "lug", "shaft"}


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_check_says_what_the_page_claims(step):
    folder, done = step
    (checked,) = [printed for command, printed in done if command.words[1] == "check"]
    rules = re.findall(r"^ *(error|warning|info) +([\w-]+)", checked, re.MULTILINE)
    assert {("warning", "poor-cell"), ("info", "internal-dof"), ("info", "bodies"), ("info", "gap")} == set(rules)
    n = lacmesh.Cut(lacmesh.read(folder / "lug.lac.msh")).n_macros
    assert f"{n} of {n} macro-elements own an internal dof" in checked
    least, most = map(float, re.findall(r"gap from (\S+) to (\S+),", checked)[0])
    assert abs(least) < 1e-3 and most == pytest.approx(0.4, abs=1e-3)
    assert "; 99.99 % of the slave faces the master" in checked
    poor = int(re.findall(r"(\d+) cells have a scaled Jacobian below 0.1", checked)[0])
    assert 250 < 4996 / poor < 350  # one in three hundred


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_pressures_are_as_the_page_says(step):
    folder, done = step
    (told,) = [" ".join(printed.split()) for command, printed in done if command.words[1] == "validate"]
    assert "'shaft' moves along z" in told and "along y" not in told  # nothing but contact, and not along its axis
    results = json.loads((folder / "lug" / "results.json").read_text(encoding="utf-8"))
    zone, force = results["contact"]["eye"], 2 * 183.22 * 100  # of both ends: the list of surfaces has their area
    assert zone["resultant"][2] == pytest.approx(-force, rel=1e-3) and 36.6e3 < force < 36.7e3
    assert 1 / 8 < zone["active"] / (zone["active"] + zone["open"]) < 1 / 5 and zone["unpaired"] == 0
    table = np.genfromtxt(folder / "lug" / "contact_eye.csv", delimiter=",", names=True)
    last = table[table["time"] == 1]
    assert abs(abs(last["y"][last["pressure"].argmax()]) - 10) < 3.5 / 2  # of a bore from -10 to 10
    assert np.abs(last["x"][last["status"] == 1]).max() < 6


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_pictures_are_made_again(step):
    folder, _ = step
    names = pictures_of(TUTORIALS / "step_to_med.md")
    assert sorted(names) == sorted(p.name for p in folder.glob("*.png"))
    for name in set(names) - {"lug_med.png", "lug_check.png", "lug_pressure.png"}:
        assert is_like(folder / name, TUTORIALS / name), name
    for name, wanted in (("lug_med.png", colours.RAMP[2:4]), ("lug_check.png", [colours.SEVERITIES["warning"]])):
        assert size_of(folder / name) == size_of(TUTORIALS / name)
        assert min(tones(folder / name, *wanted)) > 500, name


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
@pytest.mark.browser
def test_the_page_opens_without_an_error(step, tmp_path):
    folder, _ = step
    page = tmp_path / "lug.html"  # alone: what it shows is in it
    shutil.copy(folder / "lug.html", page)
    browser = Browser(tmp_path / "browser")
    try:
        browser.open(page)
        assert (browser.data("state"), browser.data("glError")) == ("ready", "0")
        assert int(browser.data("faces")) > 1000
        assert "macro-elements" in browser.value("document.getElementById('panel').innerText")
        browser.photograph(tmp_path / "page.png")
        assert browser.said == []
    finally:
        browser.close()
    assert min(tones(tmp_path / "page.png", *colours.RAMP[2:4])) > 500


@pytest.mark.gmsh
def test_the_step_file_is_its_scripts(tmp_path):
    """The file holds the same shapes, whatever version of gmsh writes it, and names neither date nor machine."""
    from lacmesh.gmsh.cad import list_cad

    kept = TUTORIALS.parents[1] / "data" / "pin_in_lug.step"
    maker = kept.parent / "make_pin_in_lug.py"
    subprocess.run([sys.executable, str(maker), str(tmp_path / kept.name)], check=True, capture_output=True)
    ours, made = (list_cad(path) for path in (kept, tmp_path / kept.name))
    assert [(s.dim, s.type) for s in made] == [(s.dim, s.type) for s in ours]
    for a, b in zip(ours, made, strict=True):
        assert a.measure == pytest.approx(b.measure, rel=1e-9) and a.radius == (b.radius and pytest.approx(b.radius))
    assert kept.stat().st_size < 100_000
    assert not re.search(r"\d{4}-\d\d-\d\dT", kept.read_text(encoding="utf-8"))
