"""`lacsolver import` as a user runs it: files, messages, exit statuses; then validate and run on what it wrote."""

import json

import pytest

from lacmesh import Mesh, write
from lacsolver.cli import main
from tests.lacsolver.deck_texts import Block, held, section, step

COLUMN = Block(high=(1, 1, 2), cells=(1, 1, 2))
TEXT = (
    COLUMN.text()
    + section(nu=0.0)
    + held()
    + step("*DLOAD\nB_EZ1, P2, 20.\n*NODE PRINT, NSET=B_Z1\nU\n*EL PRINT, ELSET=B\nS\n")
)


@pytest.fixture
def deck(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "column.inp").write_text(TEXT)
    return tmp_path


def test_import_validate_run(deck, capsys):
    """Two commands to an answer: the probes of *NODE PRINT have the exact displacements."""
    assert main(["import", "column.inp"]) == 0
    out, err = capsys.readouterr()
    assert (deck / "column.toml").is_file()
    assert (deck / "column.med").is_file()
    assert "next: lacsolver validate column.toml" in out
    assert err.count("lacsolver: note: column.inp, line ") == 2
    assert main(["validate", "column.toml"]) == 0
    assert main(["run", "column.toml", "-o", "out"]) == 0
    figures = json.loads((deck / "out" / "results.json").read_text())["steps"][-1]
    assert set(figures["probes"]) == {f"node {n}" for n in COLUMN.at(2, 2)}
    for u in figures["probes"].values():
        assert u == pytest.approx([0, 0, -20 / 1000 * 2])
    assert figures["reactions"]["B_Z0"] == pytest.approx([0, 0, 20])


def test_the_case_says_where_its_records_come_from(deck):
    assert main(["import", "column.inp", "-o", "case.toml", "--quiet"]) == 0
    text = (deck / "case.toml").read_text()
    line = TEXT.splitlines().index("*DLOAD") + 1
    assert f"# *DLOAD (column.inp, line {line})\n[[pressure]]" in text
    assert 'mesh = "case.med"' in text


def test_a_deck_that_is_refused_leaves_nothing(deck, capsys):
    (deck / "column.inp").write_text(TEXT.replace("*STATIC", "*VISCO"))
    assert main(["import", "column.inp"]) == 1
    line = TEXT.splitlines().index("*STATIC") + 1
    what = "lacsolver computes static steps (*STATIC) and implicit ones with inertia (*DYNAMIC)"
    message = f"lacsolver: error: column.inp, line {line}: *VISCO: {what}"
    assert capsys.readouterr().err.splitlines() == [message]
    assert [path.name for path in deck.iterdir()] == ["column.inp"]


def test_existing_outputs_are_kept(deck, capsys):
    (deck / "column.med").write_text("mine")
    assert main(["import", "column.inp"]) == 2
    assert "column.med" in capsys.readouterr().err
    assert main(["import", "column.inp", "--force"]) == 0
    assert (deck / "column.med").read_bytes() != b"mine"


def test_lenient(deck, capsys):
    (deck / "column.inp").write_text(TEXT.replace("*STEP", "*SUBMODEL, TYPE=NODE\n*STEP"))
    assert main(["import", "column.inp"]) == 1
    assert main(["import", "column.inp", "--lenient"]) == 0
    assert "lacsolver: warning: column.inp, line " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["nowhere.inp"], 3, "cannot be read"),
        (["mesh.msh"], 3, "is no deck of CalculiX or Abaqus"),
        (["column.inp", "-o", "case.inp"], 2, "a case file is called .toml"),
    ],
)
def test_wrong_requests(deck, capsys, arguments, status, words):
    write(deck / "mesh.msh", Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]])]))
    assert main(["import", *arguments]) == status
    assert words in capsys.readouterr().err
