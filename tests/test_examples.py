"""Examples that come with the packages: all of data/ is there, can be copied, and does what its command says."""

from __future__ import annotations

from pathlib import Path

import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cli import main as lacmesh_main
from lacmesh.errors import RequestError
from lacmesh.examples import CASES, MESHES, data_folder
from lacsolver.cli import main as lacsolver_main

DATA = Path(__file__).resolve().parents[1] / "data"


def test_every_case_and_mesh_of_the_folder_is_an_example():
    of_cases = {file for one in CASES.values() for file in one.files}
    assert {str(path.relative_to(DATA)) for path in DATA.rglob("*.toml")} <= of_cases
    named = of_cases | {file for one in MESHES.values() for file in one.files}
    kept = {str(p.relative_to(DATA)) for end in ("msh", "toml", "step", "inp") for p in DATA.rglob(f"*.{end}")}
    assert named == kept and data_folder() == DATA


@pytest.mark.parametrize("name", [name for name, one in CASES.items() if one.files[0].endswith(".toml")])
def test_a_copied_case_has_its_mesh_beside_it(name, tmp_path, capsys):
    assert lacsolver_main(["example", name, "-o", str(tmp_path / "new")]) == 0
    told = capsys.readouterr().out
    case = ls.read_case(tmp_path / "new" / f"{name}.toml")
    assert case.mesh.is_file() and f"next: lacsolver run {tmp_path / 'new' / name}.toml" in told
    assert lacmesh.example(f"{name}.toml").read_bytes() == (tmp_path / "new" / f"{name}.toml").read_bytes()
    assert lacsolver_main(["example", name, "-o", str(tmp_path / "new")]) == 2
    assert "--force" in capsys.readouterr().err
    assert lacsolver_main(["example", name, "-o", str(tmp_path / "new"), "--force", "-q"]) == 0
    assert capsys.readouterr().out == ""


def test_lists_have_a_line_each(capsys):
    for main, examples in ((lacmesh_main, MESHES), (lacsolver_main, CASES)):
        assert main(["example"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line.split()[0] for line in lines] == list(examples)


@pytest.mark.parametrize("name", MESHES)
def test_the_command_of_a_mesh_runs(name, tmp_path, monkeypatch, capsys):
    if name == "pin_in_lug":
        pytest.importorskip("gmsh")
    monkeypatch.chdir(tmp_path)
    assert lacmesh_main(["example", name]) == 0
    program, *words = capsys.readouterr().out.split("next: ")[1].split()
    assert program == "lacmesh" and lacmesh_main([*words, "-q"]) == 0
    assert lacmesh.example(MESHES[name].files[0]).read_bytes() == (tmp_path / MESHES[name].files[0]).read_bytes()


def test_an_unknown_example_is_said(capsys):
    assert lacsolver_main(["example", "clmp"]) == 2
    assert "there is no example 'clmp'; did you mean clamp?" in capsys.readouterr().err
    with pytest.raises(RequestError, match="there is no example file 'clamp'; did you mean clamp"):
        lacmesh.example("clamp")
