"""A run in several processes: its files, restarts with other numbers of them, divided meshes, and what is refused."""

from __future__ import annotations

import json
import shutil
from types import SimpleNamespace

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
from tests.lacsolver.distributed.mpi import ROOT, in_ranks, own_lines

pytestmark = pytest.mark.petsc
COMMAND = "import sys; from lacsolver.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with the case `two_blocks`, its mesh in three parts, and its results in 3 processes."""
    folder = tmp_path_factory.mktemp("runs")
    for name in ("two_blocks.msh", "two_blocks.toml"):
        shutil.copy(ROOT / "data" / name, folder)
    divided = (folder / "two_blocks.toml").read_text().replace('"two_blocks.msh"', '"two_blocks.parts"')
    (folder / "parts.toml").write_text(divided)
    assert not lacmesh_main(["partition", str(folder / "two_blocks.msh"), "-n", "3", "-q"])
    run(3, folder / "two_blocks.toml", "-o", folder / "three")
    return folder


def run(n, *words):
    """The command in n processes."""
    done = in_ranks(n, COMMAND, "run", "-q", *words)
    assert done.returncode == 0, done.stderr
    return done


def energy(folder):
    """The energy at the end of a run."""
    told = json.loads((folder / "results.json").read_text())
    assert told["status"] == "done"
    return told["energy"]


def test_pieces_hold_each_cell_once(runs):
    fields = runs / "three" / "fields"
    pieces = [read(fields / f"solid_0002.r{rank:05d}.vtu") for rank in range(3)]
    numbers = np.concatenate([piece.cell_number for piece in pieces])
    assert len(numbers) == len(set(numbers)) == 962
    whole = (fields / "solid_0002.pvtu").read_text()
    assert [f"solid_0002.r{rank:05d}.vtu" in whole for rank in range(3)] == [True] * 3
    assert 'Name="displacement" NumberOfComponents="3"' in whole
    assert "fields/solid_0002.pvtu" in (runs / "three" / "solid.pvd").read_text()


def test_pieces_have_the_displacement_of_the_state(runs):
    case = read_case(runs / "two_blocks.toml")
    place = {number: k for k, number in enumerate(prepared(case).node_number.tolist())}
    u = read_state(runs / "three", case).u.reshape(-1, 3)
    for rank in range(3):
        piece = read(runs / "three" / "fields" / f"solid_0002.r{rank:05d}.vtu")
        assert np.abs(piece.node_data["displacement"] - u[[place[k] for k in piece.node_number]]).max() <= 1e-15


def test_a_state_goes_on_with_any_number_of_processes(runs):
    for n in (1, 2):
        folder = runs / f"again_{n}"
        words = ["--restart", runs / "three", "--from", "0.5", "-o", folder]
        run(n, runs / "two_blocks.toml", *words)
        assert energy(folder) == pytest.approx(energy(runs / "three"), rel=1e-12)


def test_parts_are_solved_by_as_many_processes(runs):
    run(3, runs / "parts.toml", "-o", runs / "of_parts")
    assert energy(runs / "of_parts") == pytest.approx(energy(runs / "three"), rel=1e-12)
    done = in_ranks(2, COMMAND, "run", runs / "parts.toml", "-o", runs / "no")
    assert done.returncode == 2 and not (runs / "no").exists()
    (line,) = own_lines(done.stderr)
    assert "has 3 parts, and 2 processes were started; start 3 processes, name the mesh file itself, or" in line


def test_parts_that_were_divided_without_equations_are_refused(runs):
    text = (runs / "parts.toml").read_text() + '[[equation]]\ngroup = "top"\nsame = ["ux"]\n'
    (runs / "joined.toml").write_text(text)
    done = in_ranks(3, COMMAND, "run", runs / "joined.toml", "-o", runs / "joined")
    assert done.returncode == 1 and not (runs / "joined").exists()
    (line,) = own_lines(done.stderr)
    assert (
        "equation: it joins nodes, which one process then has, and the mesh was divided before; name the mesh" in line
    )


def test_med_is_the_file_of_one_process(runs):
    text = (runs / "two_blocks.toml").read_text() + '[output]\nformat = "med"\n'
    (runs / "med.toml").write_text(text)
    run(3, runs / "med.toml", "-o", runs / "med_of_three")
    assert not solver_main(["run", "-q", str(runs / "med.toml"), "-o", str(runs / "med_of_one")])
    one, three = ({}, {})
    for found, folder in ((one, "med_of_one"), (three, "med_of_three")):
        with h5py.File(runs / folder / "results.med") as file:
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
    text = (runs / "two_blocks.toml").read_text().replace("poisson", "density = 3.0\npoisson")
    for group in ("top", "slave", "upper"):
        text += f'[[force]]\ngroup = "{group}"\nfx = 0.25\nfz = -0.5\ntotal = true\n'
    (runs / "loads.toml").write_text(text + '[[force]]\ngroup = "top"\nfy = 0.01\n[gravity]\ngz = -0.1\n')
    told = []
    for n in (1, 3):
        run(n, runs / "loads.toml", "-o", runs / f"loads_{n}")
        found = json.loads((runs / f"loads_{n}" / "results.json").read_text())
        told.append([one["force"] for one in found["loads"]])
        assert [one["where"] for one in found["loads"]] == ["top", "top", "slave", "upper", "top", "everywhere"]
        np.testing.assert_allclose(told[-1][1:4], [[0.25, 0, -0.5]] * 3, atol=1e-14)
    np.testing.assert_allclose(*told, rtol=1e-12, atol=1e-14)
