"""`lacmesh cut --for` and `--master`: what is refused before and after the cut, and that nothing is written then."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.cli import main

DATA = Path(__file__).parent.parent / "data"
BLOCKS = str(DATA / "two_blocks.msh")


def refused(capsys, target, *args):
    """The sentence of a command that must fail on the data, and leave nothing."""
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(target), *args]) == 1
    assert not list(target.parent.iterdir())
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_what_the_program_lacks_is_said_before_the_cut(tmp_path, capsys):
    said = refused(capsys, tmp_path / "out.inp", "--for", "calculix")
    assert "180 PYRAM5" in said
    assert "CalculiX" in said
    assert "--hexa hexa" in said
    assert "mixture" in refused(capsys, tmp_path / "out.xdmf", "--for", "fenics", "--hexa", "hexa")


@pytest.mark.parametrize(("program", "card"), [("calculix", "TYPE=C3D8"), ("abaqus", "TYPE=C3D5")])
def test_inp_is_written_for_the_program(tmp_path, program, card, capsys):
    target = tmp_path / "out.inp"
    hexa = "hexa" if program == "calculix" else "pyramid"
    asked = ["cut", BLOCKS, "--slave", "slave", "-o", str(target), "--for", program, "--hexa", hexa]
    assert main(asked) == 0
    text = target.read_text().upper()
    assert card in text
    assert ("C3D5" in text) == (program == "abaqus")
    assert "macro-elements of slave 36" in " ".join(capsys.readouterr().out.split())


def test_for_code_aster_a_note_says_who_cuts(tmp_path, capsys):
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(tmp_path / "out.med"), "--for", "aster"]) == 0
    (note,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    assert "code_aster" in note and "DECOUPE_LAC" in note and BLOCKS in note


@pytest.mark.parametrize("program", ["gmsh", "aster"])
def test_other_files_may_be_for_a_program_too(tmp_path, program):
    target = tmp_path / "out.med"
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(target), "--for", program, "-q"]) == 0
    assert lacmesh.read(target).n_cells > 1268


def test_a_mesh_is_converted_for_a_program_that_takes_it(tmp_path, capsys):
    cut = tmp_path / "cut.msh"
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(cut), "-q"]) == 0
    capsys.readouterr()
    assert main(["convert", str(cut), str(tmp_path / "out.inp"), "--for", "calculix"]) == 1
    assert "PYRAM5" in capsys.readouterr().err
    assert main(["convert", str(cut), str(tmp_path / "out.inp"), "--for", "abaqus", "-q"]) == 0
    assert "C3D5" in (tmp_path / "out.inp").read_text()


def test_a_cut_is_checked_against_its_master(tmp_path, capsys):
    target = tmp_path / "out.msh"
    assert main(["cut", BLOCKS, "--slave", "slave", "--master", "master", "-o", str(target)]) == 0
    printed = capsys.readouterr()
    assert "check " in printed.out
    assert not printed.err


def test_a_cut_that_its_master_forbids_is_not_written(tmp_path, capsys):
    said = refused(capsys, tmp_path / "out.msh", "--master", "symmetry_x")
    assert "shared-nodes" in said
    assert "slave and master share 7 nodes" in said


def test_a_master_far_away_is_found_where_it_is_looked_for(tmp_path, capsys):
    mesh = lacmesh.read(BLOCKS)
    points = mesh.points.copy()
    for _, _, nodes in mesh.select(mesh.cell_groups["upper"]):
        points[np.unique(nodes), 2] = mesh.points[np.unique(nodes), 2] + 5
    lacmesh.write(tmp_path / "far.msh", replace(mesh, points=points))
    asked = ["cut", str(tmp_path / "far.msh"), "--slave", "slave", "--master", "master", "-q"]
    assert main([*asked, "-o", str(tmp_path / "out.msh")]) == 1
    assert "increase --search-distance" in capsys.readouterr().err
    assert main([*asked, "-o", str(tmp_path / "out.msh"), "--search-distance", "6"]) == 0
    with pytest.raises(SystemExit) as stopped:
        main([*asked, "-o", str(tmp_path / "other.msh"), "--search-distance", "inf"])
    assert stopped.value.code == 2


def test_a_quiet_check_says_warnings(tmp_path, capsys):
    mesh = str(DATA / "disc_on_block.msh")
    assert main(["cut", mesh, "--slave", "slave", "-o", str(tmp_path / "out.msh"), "-q"]) == 0
    assert main(["check", str(tmp_path / "out.msh"), "--slave", "slave", "--master", "master", "-q"]) == 0
    printed = capsys.readouterr()
    assert not printed.out
    assert "lacmesh: warning: partial-coverage: " in printed.err


def test_a_shell_that_was_cut_as_one_passes_the_check(tmp_path, capsys):
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    shell = lacmesh.Mesh.create(np.vstack([np.zeros(3), np.eye(3)]), [("TRIA3", faces)], cell_groups={"s": range(4)})
    assert lacmesh.check(shell, "s").rules[:2] == ("no-cells", "no-parent")
    assert not lacmesh.check(lacmesh.cut_skin(shell, "s", skin_only=True)).errors
