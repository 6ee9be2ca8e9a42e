"""`mpiexec -n 3 lacsolver run`: what a user sees, files and restarts are those of one process; refusals come once."""

import json
import shutil
import subprocess
import sys
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from lacmesh import read, write
from lacmesh.cli import main as lacmesh_main
from lacmesh.errors import DataError, RequestError
from lacmesh.partition import distribute_nodes, write_parts
from lacsolver.case import Output, Solver, parse_case, read_case
from lacsolver.cli import main as solver_main
from lacsolver.distributed import processes
from lacsolver.distributed.launch import import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.distributed.together import on_first
from lacsolver.output import create_output, read_state
from lacsolver.problem import problem
from lacsolver.problem.skin import prepared
from lacsolver.reading import read_results
from lacsolver.running import run
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.distributed.cases import CASES
from tests.lacsolver.distributed.mpi import ROOT, commands, environment, in_ranks, own_lines, printed
from tests.lacsolver.tables import table

pytestmark = [
    pytest.mark.petsc,
    pytest.mark.filterwarnings("ignore:massless nodes change", "ignore:.*is inside its master by"),  # few cells
]

#: the command, with a warning on every rank, and what each rank runs with in a file of its own
COMMAND = """
import sys, warnings
from pathlib import Path
import lacsolver.running as running
solve = running.run
def run(case, folder, **rest):
    from lacmesh.errors import LacmeshWarning
    shared = rest["distribution"]
    warnings.warn(LacmeshWarning("of all"))
    told = f"{type(shared).__name__} {case.solver.threads} {folder.path}"
    Path(f"rank_{shared.comm.rank if hasattr(shared, 'comm') else 0}.txt").write_text(told)
    return solve(case, folder, **rest)
running.run = run
from lacsolver.cli import main
sys.exit(main(sys.argv[1:]))
"""


def put_cases(folder):
    """Put the case `two_blocks`, its mesh, and cases that follow from it into a folder."""
    shutil.copy(ROOT / "data" / "two_blocks.msh", folder)
    write(folder / "two_blocks.med", read(folder / "two_blocks.msh"))
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
        "mistaken": whole.replace("young", "yung").replace("[[displacement]]", "[[displacment]]", 1),
        "serial": whole + '[solver]\nengine = "serial"\n',
        "absent": whole.replace(".msh", ".med").replace('slave = "slave"', 'slave = "slvae"'),
    }.items():
        (folder / f"{name}.toml").write_text(text)


def words(folder, name, out, *more):
    """The words that run a case of a folder into another folder."""
    return ["run", "-q", str(folder / f"{name}.toml"), "-o", str(folder / out), *more]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of the cases, with their results of one process, and the mesh in three parts."""
    folder = tmp_path_factory.mktemp("runs")
    put_cases(folder)
    assert not lacmesh_main(["partition", str(folder / "two_blocks.msh"), "-n", "3", "-q"])
    for name in ("two_blocks", "med", "loads"):
        assert not solver_main(words(folder, name, f"{name}_of_1"))
    return folder


@pytest.fixture(scope="module")
def of_3(folder):
    """What three processes said of each case, by its name."""
    names = ("two_blocks", "parts", "joined", "med", "loads")
    return dict(zip(names, commands(3, *(words(folder, name, f"{name}_of_3") for name in names)), strict=True))


@pytest.fixture(scope="module")
def of_2(folder, of_3):
    """What two processes said: of a restart, of refusals, and of meshes that the first one deals out."""
    rows = {"again": words(folder, "two_blocks", "again_2", "--restart", str(folder / "two_blocks_of_3"))}
    rows["again"] += ["--from", "0.5"]
    rows["taken"] = words(folder, "two_blocks", "two_blocks_of_3")
    rows |= {name: words(folder, name, f"no_{name}") for name in ("parts", "mistaken", "serial")}
    dealt = {"two_blocks": words(folder, "two_blocks", "dealt_to_2"), "absent": words(folder, "absent", "no_absent")}
    told = commands(2, *rows.values(), dealt=[*dealt.values()])
    return dict(zip((*rows, *dealt), told, strict=True))


def results(place):
    """The results in a folder, of a run that was done."""
    found = json.loads((place / "results.json").read_text())
    assert found["status"] == "done"
    return found


# ---- what a user sees


def alone(folder, *given):
    """The command in one process, in a folder."""
    command = [sys.executable, "-c", COMMAND, *given]
    return subprocess.run(command, env=environment(), cwd=folder, capture_output=True, text=True, timeout=60)


def shown(text):
    """The head, the step and the last line, without what depends on time, memory, round-off or the terminal's width."""
    head, step, *_, last = text.splitlines()
    return head, [word for k, word in enumerate(step.split()) if k != 4], last  # without the balance


def test_a_run_shows_what_one_process_shows(tmp_path, monkeypatch):
    """Whatever engine is behind it; one process alone takes the engine that the case names."""
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD)
    (tmp_path / "petsc.toml").write_text(GOOD + '[solver]\nengine = "petsc"\n')
    monkeypatch.chdir(tmp_path)
    done = in_ranks(3, COMMAND, "run", "case.toml", "-o", "several")
    assert done.returncode == 0, done.stderr
    assert own_lines(done.stderr) == ["lacsolver: warning: of all"]
    assert [(tmp_path / f"rank_{k}.txt").read_text() for k in range(3)] == ["Processes 1 several"] * 3
    assert results(tmp_path / "several")
    serial = alone(tmp_path, "run", "case.toml", "-o", "several", "--force")
    assert (tmp_path / "rank_0.txt").read_text() == "Distribution None several"
    assert serial.returncode == 0 and shown(done.stdout) == shown(serial.stdout)
    assert done.stdout.count("results: several") == 1 and "\x1b" not in done.stdout
    assert alone(tmp_path, "run", "petsc.toml").returncode == 0
    assert (tmp_path / "rank_0.txt").read_text() == "Processes None petsc"


#: name of a case -> words of each line that two processes print of it, which exit with status 2
REFUSED = {
    "taken": "holds results already; --force",
    "parts": "has 3 parts, and 2 processes",
    "serial": "each would solve the whole",
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_all_processes_refuse_is_said_once(folder, of_2, name):
    status, (line,) = of_2[name]
    assert status == 2 and line.startswith("lacsolver: error: ") and REFUSED[name] in line
    assert not (folder / f"no_{name}").exists()


@pytest.mark.parametrize("name", ["mistaken", "absent"])
def test_mistakes_are_told_as_by_one_process(folder, of_2, name, capsys):
    """Of a case, and of a group that is not in a mesh that is dealt out."""
    status, lines = of_2[name]
    assert status == solver_main(words(folder, name, f"no_{name}")) > 0
    assert lines == own_lines(capsys.readouterr().err) != []


def test_parts_that_were_divided_without_equations_are_refused(folder, of_3):
    status, (line,) = of_3["joined"]
    assert status == 1 and not (folder / "joined_of_3").exists()
    assert "mesh was divided without it" in line


# ---- files


@pytest.mark.parametrize("out", ["two_blocks_of_3", "parts_of_3", "again_2", "again_1", "dealt_to_2"])
def test_whole_divided_dealt_and_restarted_runs_end_alike(folder, of_3, of_2, out):
    assert of_3["two_blocks"] == of_3["parts"] == of_2["again"] == of_2["two_blocks"] == (0, [])
    if out == "again_1":
        restart = ("--restart", str(folder / "two_blocks_of_3"), "--from", "0.5")
        assert not solver_main(words(folder, "two_blocks", out, *restart))
    found, known = (results(folder / name) for name in (out, "two_blocks_of_1"))
    assert found["energy"] == pytest.approx(known["energy"], rel=1e-9) and found["sizes"] == known["sizes"]


def test_pieces_hold_each_cell_once_with_the_displacement_of_the_state(folder, of_3):
    place, case = folder / "two_blocks_of_3", read_case(folder / "two_blocks.toml")
    names = [f"solid_0002.r{rank:05d}.vtu" for rank in range(3)]
    pieces = [read(place / "fields" / name) for name in names]
    numbers = np.concatenate([piece.cell_number for piece in pieces])
    assert len(numbers) == len(set(numbers)) == 962
    whole = (place / "fields" / "solid_0002.pvtu").read_text()
    assert all(name in whole for name in names) and 'Name="displacement" NumberOfComponents="3"' in whole
    assert "fields/solid_0002.pvtu" in (place / "solid.pvd").read_text()
    at = {number: k for k, number in enumerate(prepared(case).node_number.tolist())}
    u = read_state(place, case).u.reshape(-1, 3)
    solution = read_results(place).solution()
    assert np.array_equal(solution.u, u[[at[k] for k in solution.mesh.node_number.tolist()]])
    whole_mesh = prepared(case)
    assert solution.mesh.cells_by_type == whole_mesh.cells_by_type and solution.contact["joint"].pressure.min() > 0
    for kind, number in (("cell_groups", "cell_number"), ("node_groups", "node_number")):
        one, other = (
            {name: sorted(getattr(mesh, number)[ids].tolist()) for name, ids in getattr(mesh, kind).items()}
            for mesh in (solution.mesh, whole_mesh)
        )
        assert one == other
    for piece in pieces:
        assert np.abs(piece.node_data["displacement"] - u[[at[k] for k in piece.node_number]]).max() <= 1e-15


def test_med_is_the_file_of_one_process(folder, of_3):
    one, three = ({}, {})
    for found, place in ((one, "med_of_1"), (three, "med_of_3")):
        with h5py.File(folder / place / "results.med") as file:
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
    with pytest.raises(RequestError, match="for at most 3 nodes"):
        problem._check_shared(case, SimpleNamespace(node=np.arange(4), largest=lambda x: x))
    problem._check_shared(case, SimpleNamespace(node=np.arange(3), largest=lambda x: x))


def test_resultants_are_those_of_one_process(folder, of_3):
    """They are those of forces in total on faces, on the slave and on cells, of one on each node, and of gravity."""
    found = [results(folder / f"loads_of_{n}")["loads"] for n in (1, 3)]
    for loads in found:
        assert [one["where"] for one in loads] == ["top", "top", "slave", "upper", "top", "everywhere"]
        np.testing.assert_allclose([one["force"] for one in loads[1:4]], [[0.25, 0, -0.5]] * 3, atol=1e-14)
    one, three = ([load["force"] for load in loads] for loads in found)
    np.testing.assert_allclose(one, three, rtol=1e-12, atol=1e-14)


# ---- restarts in other numbers of processes

#: cases, and the time of each to go on from: with a preload and damping, with a free rigid body of its own mass, with
#: the flow that each point has had
MIDDLE = {"preloaded, pushed by a foot, damped": 1.25, "a wall of its own mass, finite": 0.2, "metal": 2.0}
OTHERS = ("three", "two_after_three", "one_after_three")
PARTS = (
    *("three_after_two", "one_after_two", "serial_after_two"),
    *("two_after_one", "parts_after_two", "serial_after_parts"),
)


def solve(case, mesh, folder, start=None, comm=None, *, when=0.5, stop=False):
    """Solve a case into a folder, or go on from the state in another; `stop`: interrupted after half of it.

    `mesh`: None for the file that the case names; without a communicator it is solved alone.
    """

    def stepped(step):
        if stop and step.time == 0.5:
            raise KeyboardInterrupt

    given = {} if mesh is None else {"mesh": mesh}
    if comm is None:
        state = None if start is None else read_state(start, case, when, **given)
        return run(case, create_output(folder, restart=state), start=state, **given)
    state = None if start is None else on_first(comm, lambda: read_state(start, case, when, large=False, **given))
    place, shared = on_first(comm, lambda: create_output(folder, restart=state)), Processes(comm)
    with suppress(KeyboardInterrupt) if stop else nullcontext():
        return run(case, place, start=state, stepped=stepped, distribution=shared, **given)


def case_of(name, **solver):
    """A case that keeps the state in its middle, and its mesh."""
    source = CASES[name]
    case = source.case([*source.records, Output(times=[MIDDLE[name]]), Solver(threads=1, **solver)])
    return case, case.mesh


def pressed(mesh, folder, start=None, comm=None, **options):
    """Press the blocks of `two_blocks` on a mesh, in four steps, each with its state."""
    text = (ROOT / "data" / "two_blocks.toml").read_text().replace("two_blocks.msh", str(mesh))
    case = parse_case(text.replace("count = 2", "count = 4") + "[output]\nevery = 1\n[solver]\nthreads = 1\n")
    solve(case, None, folder, start, comm, **options)


def main(world, folder):
    """Solve the cases, and go on, in one, two and three processes, the blocks dealt out and on parts."""
    import_petsc()
    processes.LARGE = 0  # the first process deals every file out
    some, alone, place = world.Split(int(world.rank > 1)), world.Split(world.rank), Path(folder) / "blocks"
    mesh = place / "blocks.med"
    if world.rank < some.size:
        pressed(mesh, place / "two", comm=some, stop=True)
    world.Barrier()
    pressed(mesh, place / "three_after_two", place / "two", world)
    try:
        pressed(place / "moved.med", place / "refused", place / "two", world)
    except DataError as error:
        (place / f"refused_{world.rank}.txt").write_text(str(error))
    if world.rank < some.size:
        pressed(mesh, place / "two_after_one", place / "one", some)
        pressed(place / "blocks.parts", place / "parts_after_two", place / "two", some)
    if world.rank == 0:
        pressed(mesh, place / "one_after_two", place / "two", alone)
    for name, when in MIDDLE.items():
        (case, mesh), place = case_of(name, backend="mumps"), Path(folder) / name
        solve(case, mesh, place / "three", comm=world)
        if world.rank <= 1:
            solve(case, mesh, place / "two_after_three", place / "three", some, when=when)


@pytest.fixture(scope="module")
def restarts(tmp_path_factory):
    """For each case, folders of it and of its second half: by one process, and by others after others."""
    place = tmp_path_factory.mktemp("restarts")
    for name in (*MIDDLE, "blocks"):
        (place / name).mkdir()
    for name in MIDDLE:
        solve(*case_of(name), place / name / "one")
    parts, mesh = place / "blocks", read(ROOT / "data" / "two_blocks.msh")
    write(parts / "blocks.med", mesh)
    mesh = read(parts / "blocks.med")
    write_parts(parts / "blocks.parts", mesh, distribute_nodes(mesh, 2))
    moved = mesh.points.copy()
    moved[-1] += 1e-6
    write(parts / "moved.med", replace(mesh, points=moved))
    pressed(parts / "blocks.med", parts / "one")
    printed(3, "test_run", place, timeout=450)
    for name, when in MIDDLE.items():
        solve(*case_of(name), place / name / "one_after_three", place / name / "three", when=when)
    pressed(parts / "blocks.med", parts / "serial_after_two", parts / "two")
    pressed(parts / "blocks.med", parts / "serial_after_parts", parts / "parts_after_two", when=0.75)
    return place


@pytest.mark.parametrize(
    ("name", "other"), [*((n, o) for n in MIDDLE for o in OTHERS), *(("blocks", o) for o in PARTS)]
)
def test_a_run_goes_on_with_any_number_of_processes(restarts, name, other):
    """Its rows and its last state are those of one process in one go, on parts as on the whole mesh."""
    place, blocks = restarts / name, name == "blocks"
    found, expected = (rows(place / folder / "history.csv") for folder in (other, "one"))
    begin = {"three": 0.0, "serial_after_parts": 0.75}.get(other, MIDDLE.get(name, 0.5))
    kept = expected["time"] > begin + 1e-9
    assert list(found) == list(expected) and 0 < len(found["time"]) == kept.sum()
    for key, values in expected.items():
        alike = [v for k, v in expected.items() if blocks or k.split(".")[0] == key.split(".")[0]]
        assert np.abs(found[key] - values[kept]).max() <= 1e-9 * max(np.abs(v).max() for v in alike), key
    last = max(path.name for path in (place / "one").glob("state_*.npz"))
    kept_by = "restart.step.histories"
    with np.load(place / "one" / last) as one, np.load(place / other / last) as state:
        assert set(one) == set(state)
        histories = [values for key, values in one.items() if key.startswith(f"{kept_by}.materials.") and values.size]
        assert blocks or (any(v.max() > 1e-6 for v in histories) if name == "metal" else f"{kept_by}.scheme.10" in one)
        for key in [key for key in one if key.startswith("restart.") or key == "fields.displacement"]:
            size = np.abs(one[key]).max(initial=0.0)
            if key == f"{kept_by}.scheme.2":  # reactions, which are noise where nothing is held, beside forces
                size = max(size, np.abs(one.get(f"{kept_by}.scheme.5", 0.0)).max())
            np.testing.assert_allclose(state[key], one[key], rtol=0, atol=1e-9 * size, err_msg=key)
        told = (json.loads(file["tree"].tobytes())["restart"]["case"] for file in (one, state))
        assert not blocks or len({json.dumps(case, sort_keys=True) for case in told}) == 1


def test_a_mesh_with_a_node_that_was_moved_is_refused_by_all_processes(restarts):
    place = restarts / "blocks"
    (advice,) = {(place / f"refused_{rank}.txt").read_text() for rank in range(3)}
    assert "mesh changed" in advice and not (place / "refused").exists()


def rows(path):
    """The columns of a table; static steps have no values of a motion."""
    return {key: np.nan_to_num(values) for key, values in table(path).items() if key != "iterations"}
