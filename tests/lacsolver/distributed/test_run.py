"""A run in several processes: its files, restarts with other numbers of them, divided meshes, and what is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import h5py
import numpy as np
import pytest

from lacmesh.cli import main as lacmesh_main
from lacmesh.errors import RequestError
from lacmesh.formats import read
from lacsolver.case import read_case
from lacsolver.cli import main as solver_main
from lacsolver.output import read_state
from lacsolver.problem import problem
from lacsolver.problem.skin import prepared
from tests.lacsolver.distributed.mpi import ROOT, commands

pytestmark = pytest.mark.petsc


class Runs(NamedTuple):
    """A folder with cases on the mesh `two_blocks` and their results, and by name what three processes said of each."""

    folder: Path
    said: dict[str, tuple[int, list[str]]]


def put_cases(folder):
    """Put the case `two_blocks`, its mesh, and cases that follow from it into a folder."""
    shutil.copy(ROOT / "data" / "two_blocks.msh", folder)
    whole = (ROOT / "data" / "two_blocks.toml").read_text()
    divided = whole.replace('"two_blocks.msh"', '"two_blocks.parts"')
    loads = whole.replace("poisson", "density = 3.0\npoisson")
    for group in ("top", "slave", "upper"):
        loads += f'[[force]]\ngroup = "{group}"\nfx = 0.25\nfz = -0.5\ntotal = true\n'
    for name, text in {
        "two_blocks": whole,
        "parts": divided,
        "joined": divided + '[[equation]]\ngroup = "top"\nsame = ["ux"]\n',
        "med": whole + '[output]\nformat = "med"\n',
        "loads": loads + '[[force]]\ngroup = "top"\nfy = 0.01\n[gravity]\ngz = -0.1\n',
    }.items():
        (folder / f"{name}.toml").write_text(text)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """All cases in three processes, the mesh in three parts."""
    folder = tmp_path_factory.mktemp("runs")
    put_cases(folder)
    assert not lacmesh_main(["partition", str(folder / "two_blocks.msh"), "-n", "3", "-q"])
    names = ("two_blocks", "parts", "joined", "med", "loads")
    rows = [["run", "-q", folder / f"{name}.toml", "-o", folder / f"{name}_of_3"] for name in names]
    return Runs(folder, dict(zip(names, commands(3, *rows), strict=True)))


@pytest.fixture(scope="module")
def again(runs):
    """The answers of two processes to a restart, and to a mesh in three parts."""
    again = [*restarted(runs.folder), "-o", runs.folder / "again_2"]
    return commands(2, again, ["run", "-q", runs.folder / "parts.toml", "-o", runs.folder / "no"])


def restarted(folder):
    """The words of a restart from the run of three processes."""
    return ["run", "-q", folder / "two_blocks.toml", "--restart", folder / "two_blocks_of_3", "--from", "0.5"]


def run_alone(folder, name):
    """Run a case in this process."""
    assert not solver_main(["run", "-q", str(folder / f"{name}.toml"), "-o", str(folder / f"{name}_of_1")])


def energy(folder):
    """The energy at the end of a run."""
    told = json.loads((folder / "results.json").read_text())
    assert told["status"] == "done"
    return told["energy"]


def test_pieces_hold_each_cell_once(runs):
    place = runs.folder / "two_blocks_of_3"
    pieces = [read(place / "fields" / f"solid_0002.r{rank:05d}.vtu") for rank in range(3)]
    numbers = np.concatenate([piece.cell_number for piece in pieces])
    assert len(numbers) == len(set(numbers)) == 962
    whole = (place / "fields" / "solid_0002.pvtu").read_text()
    assert [f"solid_0002.r{rank:05d}.vtu" in whole for rank in range(3)] == [True] * 3
    assert 'Name="displacement" NumberOfComponents="3"' in whole
    assert "fields/solid_0002.pvtu" in (place / "solid.pvd").read_text()


def test_pieces_have_the_displacement_of_the_state(runs):
    results = runs.folder / "two_blocks_of_3"
    case = read_case(runs.folder / "two_blocks.toml")
    place = {number: k for k, number in enumerate(prepared(case).node_number.tolist())}
    u = read_state(results, case).u.reshape(-1, 3)
    for rank in range(3):
        piece = read(results / "fields" / f"solid_0002.r{rank:05d}.vtu")
        assert np.abs(piece.node_data["displacement"] - u[[place[k] for k in piece.node_number]]).max() <= 1e-15


def test_a_state_goes_on_with_any_number_of_processes(runs, again):
    assert again[0] == (0, [])
    assert not solver_main([str(word) for word in (*restarted(runs.folder), "-o", runs.folder / "again_1")])
    for n in (1, 2):
        known = energy(runs.folder / "two_blocks_of_3")
        assert energy(runs.folder / f"again_{n}") == pytest.approx(known, rel=1e-12)


def test_parts_are_solved_by_as_many_processes(runs, again):
    assert runs.said["parts"] == (0, [])
    known = energy(runs.folder / "two_blocks_of_3")
    assert energy(runs.folder / "parts_of_3") == pytest.approx(known, rel=1e-12)
    status, (line,) = again[1]
    assert status == 2 and not (runs.folder / "no").exists()
    assert "has 3 parts, and 2 processes were started; start 3 processes, name the mesh file itself, or" in line


def test_parts_that_were_divided_without_equations_are_refused(runs):
    status, (line,) = runs.said["joined"]
    assert status == 1 and not (runs.folder / "joined_of_3").exists()
    assert (
        "equation: it joins nodes, which one process then has, and the mesh was divided before; name the mesh" in line
    )


def test_med_is_the_file_of_one_process(runs):
    run_alone(runs.folder, "med")
    one, three = ({}, {})
    for found, folder in ((one, "med_of_1"), (three, "med_of_3")):
        with h5py.File(runs.folder / folder / "results.med") as file:
            file.visititems(lambda name, item, found=found: found.update({name: item[()]} if is_array(item) else {}))
    assert one.keys() == three.keys() and len(one) > 20
    for name, values in one.items():
        size = np.nanmax(np.abs(values)) if values.dtype.kind == "f" else 0.0
        np.testing.assert_allclose(three[name], values, rtol=0, atol=1e-9 * size + 1e-14, err_msg=name)  # closed gaps


def is_array(item):
    """True for an array of numbers of HDF5."""
    return isinstance(item, h5py.Dataset) and item.dtype.kind in "if"


def test_med_of_a_large_model_is_refused(monkeypatch):
    monkeypatch.setattr(problem, "MED_NODES", 3)
    case = SimpleNamespace(output=SimpleNamespace(format="med"), cyclic=(), spring=())
    share = SimpleNamespace(node=np.arange(4), largest=lambda x: x)
    with pytest.raises(RequestError, match=r"gathered on one, for at most 3 nodes, and the mesh has 4; take format"):
        problem._check_shared(case, share)
    problem._check_shared(case, SimpleNamespace(node=np.arange(3), largest=lambda x: x))


def test_resultants_are_those_of_one_process(runs):
    """They are those of forces in total on faces, on the slave and on cells, of one on each node, and of gravity."""
    run_alone(runs.folder, "loads")
    told = []
    for n in (1, 3):
        found = json.loads((runs.folder / f"loads_of_{n}" / "results.json").read_text())
        told.append([one["force"] for one in found["loads"]])
        assert [one["where"] for one in found["loads"]] == ["top", "top", "slave", "upper", "top", "everywhere"]
        np.testing.assert_allclose(told[-1][1:4], [[0.25, 0, -0.5]] * 3, atol=1e-14)
    np.testing.assert_allclose(*told, rtol=1e-12, atol=1e-14)
