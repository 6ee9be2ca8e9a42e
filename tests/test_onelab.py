"""gmsh's window with the buttons of LAC: its parameters and actions without a window, and the window itself."""

from __future__ import annotations

import json
import shutil
import sys

import numpy as np
import pytest

import lacmesh
from lacmesh.cli import main
from lacmesh.errors import ReadError
from lacmesh.gmsh import to_mesh
from lacmesh.gmsh.onelab import MASTER, RESULT, SLAVE, act, open_model, set_parameters
from tests.viewing import DATA

pytestmark = pytest.mark.gmsh


@pytest.fixture
def gmsh():
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    if gmsh.isInitialized():  # not after a window that could not be opened
        gmsh.logger.stop()  # else the next session begins with its lines
        gmsh.finalize()


@pytest.fixture
def blocks(gmsh, tmp_path):
    """The path of the two blocks, open in gmsh with the parameters set; messages are logged."""
    path = tmp_path / "two_blocks.msh"
    shutil.copy(DATA / "two_blocks.msh", path)
    open_model(path)
    set_parameters()
    gmsh.logger.start()
    return path


def logged(gmsh, kind):
    return [line.removeprefix(f"{kind}: ") for line in gmsh.logger.get() if line.startswith(f"{kind}: ")]


def views(gmsh):
    return {gmsh.view.option.getString(t, "Name"): int(t) for t in gmsh.view.getTags()}


def test_the_parameters_are_groups_of_faces_and_buttons(gmsh, blocks):
    groups = ["slave", "master", "bottom", "top", "symmetry_x", "symmetry_y"]
    assert sorted(json.loads(gmsh.onelab.get(SLAVE))["choices"]) == sorted(groups)
    assert gmsh.onelab.getString(SLAVE) == ["slave"] and gmsh.onelab.getString(MASTER) == ["master"]
    gmsh.onelab.setString(MASTER, ["top"])
    gmsh.model.addPhysicalGroup(2, [gmsh.model.getEntities(2)[0][1]], name="further")
    set_parameters()
    assert "further" in json.loads(gmsh.onelab.get(SLAVE))["choices"] and gmsh.onelab.getString(MASTER) == ["top"]
    own = [json.loads(gmsh.onelab.get(name)) for name in gmsh.onelab.getNames() if name.startswith("LAC/")]
    buttons = [one for one in own if one.get("attributes", {}).get("Aspect") == "Button"]
    assert {b["values"][0] for b in buttons} == {"lac cut", "lac check", "lac solve"}
    assert all(b["attributes"]["Macro"] == "Action" for b in buttons)


@pytest.mark.parametrize(("slave", "macros"), [("slave", 36), ("slave, bottom", 78)])
def test_cut_is_the_cut_of_the_command_and_check_prints_its_findings(gmsh, blocks, slave, macros):
    gmsh.onelab.setString(SLAVE, [slave])
    act(blocks, "lac check")
    assert any(line.startswith("not-cut: ") for line in logged(gmsh, "Info"))
    cut = lacmesh.cut_skin(lacmesh.read(blocks), slave.split(", "))
    assert act(blocks, "lac cut") == f"{slave} cut: {macros} macro-elements" and cut.n_macros == macros
    assert to_mesh().cells_by_type == cut.mesh.cells_by_type and to_mesh().zones == cut.zones
    set_parameters()
    assert gmsh.onelab.getString(SLAVE) == [slave]
    gmsh.logger.stop()
    gmsh.logger.start()
    said = act(blocks, "lac check")
    assert said == "no errors, 0 warnings" or slave != "slave"
    assert not any(line.startswith("not-cut: ") for line in logged(gmsh, "Info"))
    assert any(line.startswith("gap: ") for line in logged(gmsh, "Info"))
    gmsh.onelab.setString(SLAVE, ["top"])
    assert "cut already" in act(blocks, "lac cut")


@pytest.mark.parametrize("name", ["blocks.med", "pin_in_lug.step"])
def test_other_formats_and_geometries_that_are_meshed_in_the_window_are_cut(gmsh, tmp_path, name):
    path = tmp_path / name
    if name == "blocks.med":
        lacmesh.write(path, lacmesh.read(DATA / "two_blocks.msh"))
    else:
        shutil.copy(DATA / name, path)
    open_model(path)
    set_parameters()
    if name == "pin_in_lug.step":
        surfaces = [f"entity:2:{tag}" for _, tag in gmsh.model.getEntities(2)]
        assert json.loads(gmsh.onelab.get(SLAVE))["choices"] == surfaces
        gmsh.onelab.setString(SLAVE, surfaces[:1])
        assert "no mesh yet" in act(path, "lac cut")
        gmsh.option.setNumber("Mesh.MeshSizeMin", gmsh.option.getNumber("Mesh.MeshSizeMax"))
        gmsh.model.mesh.generate(3)
    assert "macro-elements" in act(path, "lac cut") and to_mesh().zones


def test_solve_writes_a_case_then_runs_it_and_shows_results(gmsh, blocks):
    """The views hold what the run's own table holds, at the last time; 25 on the top is in balance."""
    act(blocks, "lac cut")
    case = blocks.with_name("two_blocks.lac.toml")
    assert "fill in" in act(blocks, "lac solve") and case.exists() and "displacement" not in views(gmsh)
    text = case.read_text()
    assert 'mesh = "two_blocks.lac.msh"' in text
    supports = (DATA / "two_blocks.toml").read_text().partition("[[displacement]]")
    case.write_text(text.partition("# prescribed displacement")[0] + "".join(supports[1:]))
    for _ in range(2):  # results are replaced, their views too
        assert "views: displacement, pressure slave" in act(blocks, "lac solve"), gmsh.logger.get()
    names = [gmsh.view.option.getString(t, "Name") for t in gmsh.view.getTags()]
    assert names.count("displacement") == names.count("pressure slave") == 1 and not logged(gmsh, "Error")
    mesh = to_mesh()
    assert not {"displacement", "pressure slave"} & {*mesh.node_data, *mesh.cell_data}
    kind, cells, pressure, moment, _ = gmsh.view.getHomogeneousModelData(views(gmsh)["pressure slave"], 1)
    table = blocks.with_name("two_blocks.lac.results") / "contact_slave.csv"
    table = np.genfromtxt(table, delimiter=",", names=True)
    last = table[table["time"] == table["time"].max()]
    assert (kind, moment, set(cells)) == ("ElementData", 1.0, set(mesh.cell_number[mesh.cell_groups["slave"]]))
    np.testing.assert_allclose(np.unique(pressure), np.unique(last["pressure"]), rtol=1e-12)
    top = mesh.cell_number[mesh.cell_groups["top"]]
    areas, above = (gmsh.model.mesh.getElementQualities(of, "volume") for of in (cells, top))
    assert areas @ pressure == pytest.approx(25.0 * sum(above), rel=1e-9)
    _, nodes, displacement, _, _ = gmsh.view.getHomogeneousModelData(views(gmsh)["displacement"], 1)
    bottom = np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["bottom"])])
    assert not displacement.reshape(-1, 3)[np.isin(nodes, mesh.node_number[bottom])].any()
    assert gmsh.view.option.getNumber(views(gmsh)["displacement"], "VectorType") == 5


def mistaken(case):
    case.write_text("mesh = 'two_blocks.lac.msh'\nmodle = '3d'\n")


def of_the_uncut_mesh(case):
    shutil.copy(DATA / "two_blocks.toml", case)


def of_another_slave(case):
    case.write_text((DATA / "two_blocks.toml").read_text().replace("two_blocks.msh", "two_blocks.lac.msh"))


@pytest.mark.parametrize(
    ("slave", "prepare", "action", "words"),
    [
        ("slave", None, "lac solve", "press Cut"),
        ("", None, "lac cut", "choose LAC/Slave"),
        ("nothing", None, "lac cut", "nothing"),
        ("slave", mistaken, "lac solve", "modle"),
        ("bottom", of_the_uncut_mesh, "lac solve", "another mesh"),
        ("bottom", of_another_slave, "lac solve", "none of slave"),
    ],
)
def test_what_cannot_be_done_is_a_message(gmsh, blocks, slave, prepare, action, words):
    gmsh.onelab.setString(SLAVE, [slave])
    if prepare:
        act(blocks, "lac cut")
        prepare(blocks.with_name("two_blocks.lac.toml"))
    before = sorted(blocks.parent.iterdir())
    assert words in act(blocks, action) and any(words in line for line in logged(gmsh, "Error"))
    assert words in gmsh.onelab.getString(RESULT)[0] and "displacement" not in views(gmsh)
    assert prepare or sorted(blocks.parent.iterdir()) == before


def test_a_damaged_or_absent_file_and_an_absent_display_are_refused(gmsh, tmp_path, monkeypatch, capsys):
    (tmp_path / "no.msh").write_text("nothing\n")
    for name in ("no.msh", "absent.msh"):
        with pytest.raises(ReadError, match=name):
            open_model(tmp_path / name)
    if sys.platform == "linux":  # windows of other systems need no display
        monkeypatch.setenv("DISPLAY", ":65500")
        assert main(["onelab", str(DATA / "two_blocks.msh")]) == 2
        assert "cannot open its window" in capsys.readouterr().err
