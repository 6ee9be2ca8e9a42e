"""gmsh's window with the buttons of LAC: its parameters and actions without a window, and the window itself."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.cli import main
from lacmesh.errors import ReadError
from lacmesh.gmsh import to_mesh
from lacmesh.gmsh.onelab import MASTER, RESULT, SLAVE, act, open_model, set_parameters
from tests import REPOSITORY
from tests.xserver import display

pytestmark = pytest.mark.gmsh
DATA = REPOSITORY / "data"


@pytest.fixture
def gmsh():
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.logger.stop()  # else the next session begins with its lines
    gmsh.finalize()


@pytest.fixture
def blocks(gmsh, tmp_path):
    """The path of the two blocks, open in gmsh with the parameters set; messages are logged."""
    path = Path(shutil.copy(DATA / "two_blocks.msh", tmp_path))
    open_model(path)
    set_parameters()
    gmsh.logger.start()
    return path


def parameter(gmsh, name):
    return json.loads(gmsh.onelab.get(name))


def errors(gmsh):
    return [line.removeprefix("Error: ") for line in gmsh.logger.get() if line.startswith("Error: ")]


def views(gmsh):
    return {gmsh.view.option.getString(t, "Name"): int(t) for t in gmsh.view.getTags()}


def test_the_skins_are_chosen_among_the_groups_of_faces(gmsh, blocks):
    groups = ["slave", "master", "bottom", "top", "symmetry_x", "symmetry_y"]
    assert sorted(parameter(gmsh, SLAVE)["choices"]) == sorted(groups)
    assert gmsh.onelab.getString(SLAVE) == ["slave"] and gmsh.onelab.getString(MASTER) == ["master"]
    gmsh.onelab.setString(MASTER, ["top"])
    gmsh.model.addPhysicalGroup(2, [gmsh.model.getEntities(2)[0][1]], name="further")
    set_parameters()
    assert "further" in parameter(gmsh, SLAVE)["choices"] and gmsh.onelab.getString(MASTER) == ["top"]


def test_the_buttons_have_an_action_each(gmsh, blocks):
    names = [n for n in gmsh.onelab.getNames() if n.startswith("LAC/")]
    buttons = [p for p in map(lambda n: parameter(gmsh, n), names) if p.get("attributes", {}).get("Aspect") == "Button"]
    assert {b["label"]: b["values"][0] for b in buttons} == {
        "Cut for LAC": "lac cut",
        "Check": "lac check",
        "Solve": "lac solve",
    }
    assert all(b["attributes"]["Macro"] == "Action" for b in buttons)


def test_cut_is_the_cut_of_the_command(gmsh, blocks):
    assert act(blocks, "lac cut") == "slave cut: 36 macro-elements"
    assert gmsh.onelab.getString(RESULT) == ["slave cut: 36 macro-elements"] and not errors(gmsh)
    cut = lacmesh.cut_skin(lacmesh.read(blocks), "slave").mesh
    assert to_mesh().cells_by_type == cut.cells_by_type and to_mesh().zones == ("slave",)


def test_check_says_its_findings_in_the_console(gmsh, blocks):
    assert act(blocks, "lac check") == "no errors, 0 warnings"
    assert any(line.startswith("Info: not-cut: ") for line in gmsh.logger.get()) and not errors(gmsh)
    act(blocks, "lac cut")
    assert act(blocks, "lac check") == "no errors, 0 warnings"
    assert any(line.startswith("Info: gap: ") for line in gmsh.logger.get()) and not errors(gmsh)


def test_solve_writes_a_case_then_runs_it_and_shows_results(gmsh, blocks):
    act(blocks, "lac cut")
    case = blocks.with_name("two_blocks.lac.toml")
    assert "fill in" in act(blocks, "lac solve") and case.exists() and not views(gmsh).keys() & {"displacement"}
    text = case.read_text()
    assert 'mesh = "two_blocks.lac.msh"' in text
    supports = (DATA / "two_blocks.toml").read_text().partition("[[displacement]]")
    case.write_text(text.partition("# prescribed displacement")[0] + "".join(supports[1:]))
    for _ in range(2):  # results are replaced, their views too
        assert "views: displacement, pressure slave" in act(blocks, "lac solve"), gmsh.logger.get()
    names = [gmsh.view.option.getString(t, "Name") for t in gmsh.view.getTags()]
    assert names.count("displacement") == names.count("pressure slave") == 1 and not errors(gmsh)
    assert not {"displacement", "pressure slave"} & {*to_mesh().node_data, *to_mesh().cell_data}
    check_views(gmsh, blocks.with_name("two_blocks.lac.results"))


def check_views(gmsh, folder):
    """The views hold what the run's own tables and VTU files hold, at the last time."""
    tags = views(gmsh)
    kind, cells, pressure, time, _ = gmsh.view.getHomogeneousModelData(tags["pressure slave"], 1)
    table = np.genfromtxt(folder / "contact_slave.csv", delimiter=",", names=True)
    last = table[table["time"] == table["time"].max()]
    assert (kind, len(cells), time) == ("ElementData", 144, 1.0)
    np.testing.assert_allclose(np.unique(pressure), np.unique(last["pressure"]), rtol=1e-12)
    mesh = to_mesh()
    assert set(cells) == set(mesh.cell_number[mesh.cell_groups["slave"]])
    # the foot is symmetric about x = y to the accuracy of its mesh, and 25 on its top balances the mean pressure below
    area = sum(gmsh.model.mesh.getElementQualities(cells, "volume"))
    weights = np.array(gmsh.model.mesh.getElementQualities(cells, "volume"))
    top = mesh.cell_number[mesh.cell_groups["top"]]
    load = 25.0 * sum(gmsh.model.mesh.getElementQualities(top, "volume"))
    assert area > 0 and weights @ pressure == pytest.approx(load, rel=1e-9)
    _, nodes, displacement, _, _ = gmsh.view.getHomogeneousModelData(tags["displacement"], 1)
    moved = dict(zip(nodes, displacement.reshape(-1, 3), strict=True))
    bottom = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["bottom"])]))
    assert all((moved[n] == 0).all() for n in mesh.node_number[bottom])
    assert gmsh.view.option.getNumber(tags["displacement"], "VectorType") == 5


def test_a_run_that_fails_is_a_message(gmsh, blocks):
    act(blocks, "lac cut")
    blocks.with_name("two_blocks.lac.toml").write_text("mesh = 'two_blocks.lac.msh'\nmodle = '3d'\n")
    assert "modle" in act(blocks, "lac solve") and any("modle" in line for line in errors(gmsh))
    assert "modle" in gmsh.onelab.getString(RESULT)[0]


def test_results_of_a_case_that_cuts_other_faces_are_refused(gmsh, blocks):
    gmsh.onelab.setString(SLAVE, ["bottom"])
    act(blocks, "lac cut")
    case = blocks.with_name("two_blocks.lac.toml")
    shutil.copy(DATA / "two_blocks.toml", case)
    assert "is of another mesh than gmsh's" in act(blocks, "lac solve")
    assert "displacement" not in views(gmsh)
    case.write_text(case.read_text().replace("two_blocks.msh", "two_blocks.lac.msh"))
    assert "carries a cut of bottom, and none of slave 'slave'" in act(blocks, "lac solve")


def test_several_slaves_are_cut_at_once(gmsh, blocks):
    gmsh.onelab.setString(SLAVE, ["slave, bottom"])
    assert act(blocks, "lac cut") == "slave, bottom cut: 78 macro-elements"
    set_parameters()
    assert gmsh.onelab.getString(SLAVE) == ["slave, bottom"]
    act(blocks, "lac check")
    assert not any("not-cut" in line for line in gmsh.logger.get())
    gmsh.onelab.setString(SLAVE, ["top"])
    assert "this mesh is cut already" in act(blocks, "lac cut")


@pytest.mark.parametrize(
    "slave, action, message",
    [
        ("slave", "lac solve", "the mesh is not cut yet: press Cut for LAC first"),
        ("", "lac cut", "choose LAC/Slave first: a group of faces"),
        ("nothing", "lac cut", "nothing"),
    ],
)
def test_what_cannot_be_done_is_a_message(gmsh, blocks, slave, action, message):
    gmsh.onelab.setString(SLAVE, [slave])
    before = sorted(blocks.parent.iterdir())
    assert message in act(blocks, action) and message in errors(gmsh)[0]
    assert message in gmsh.onelab.getString(RESULT)[0] and sorted(blocks.parent.iterdir()) == before


def test_a_geometry_is_meshed_in_the_window_then_cut(gmsh, tmp_path):
    path = Path(shutil.copy(DATA / "pin_in_lug.step", tmp_path))
    open_model(path)
    set_parameters()
    surfaces = [f"entity:2:{tag}" for _, tag in gmsh.model.getEntities(2)]
    assert parameter(gmsh, SLAVE)["choices"] == surfaces
    gmsh.onelab.setString(SLAVE, surfaces[:1])
    assert "no mesh yet" in act(path, "lac cut")
    gmsh.option.setNumber("Mesh.MeshSizeMin", gmsh.option.getNumber("Mesh.MeshSizeMax"))
    gmsh.model.mesh.generate(3)
    assert "macro-elements" in act(path, "lac cut") and to_mesh().zones


def test_other_formats_are_opened_too(gmsh, tmp_path):
    lacmesh.write(tmp_path / "blocks.med", lacmesh.read(DATA / "two_blocks.msh"))
    open_model(tmp_path / "blocks.med")
    set_parameters()
    assert gmsh.onelab.getString(SLAVE) == ["slave"]
    assert act(tmp_path / "blocks.med", "lac cut") == "slave cut: 36 macro-elements"


def test_a_file_that_is_none_is_refused(gmsh, tmp_path):
    (tmp_path / "no.msh").write_text("nothing\n")
    for name in ("no.msh", "absent.msh"):
        with pytest.raises(ReadError, match=name):
            open_model(tmp_path / name)


@pytest.mark.skipif(sys.platform != "linux", reason="windows of other systems need no display")
def test_without_a_display_the_command_says_so(monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":65500")
    assert main(["onelab", str(DATA / "two_blocks.msh")]) == 2
    assert "gmsh cannot open its window: " in capsys.readouterr().err


@pytest.mark.window
def test_the_buttons_of_the_window_cut_and_write(tmp_path):
    path = Path(shutil.copy(DATA / "two_blocks.msh", tmp_path))
    with display() as environment:
        words = [sys.executable, "-m", "lacmesh", "onelab", str(path)]
        with subprocess.Popen(words, env=environment, cwd=REPOSITORY, stderr=subprocess.PIPE, text=True) as child:
            try:
                wait_for_window(environment["DISPLAY"], child)
                press_buttons(environment, path.with_name("two_blocks.lac.toml"))
                status = child.poll()
            finally:
                child.send_signal(signal.SIGTERM)
                errors = child.communicate(timeout=30)[1]
    assert status is None and child.returncode == 143 and "Traceback" not in errors
    assert lacmesh.read(path.with_name("two_blocks.lac.msh")).zones == ("slave",)


def wait_for_window(name, child):
    """Wait until something else than the empty screen is seen."""
    from PIL import ImageGrab

    end = time.monotonic() + 60
    while child.poll() is None and time.monotonic() < end:
        if ImageGrab.grab(xdisplay=name).getcolors(50) is None:  # more than 50 colours
            time.sleep(1)
            return
        time.sleep(0.2)
    raise AssertionError(f"no window within a minute (status {child.poll()})")


def press_buttons(environment, written):
    """Click all along gmsh's tree, upwards, until Solve has written a file: the first time Solve precedes Cut."""
    for _ in range(4):
        for y in range(480, 200, -8):
            subprocess.run(["xdotool", "mousemove", "120", str(y), "click", "1"], env=environment, check=True)
            time.sleep(0.1)
        for _ in range(20):
            if written.exists():
                return
            time.sleep(0.2)
    raise AssertionError(f"{written.name} was not written")
