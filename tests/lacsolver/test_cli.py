"""The command `lacsolver` as a user meets it: what it prints, its statuses, what it leaves on the disk."""

from __future__ import annotations

import csv
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from scipy.io import mmread
from scipy.sparse import load_npz

import lacmesh
from lacsolver.case import read_case
from lacsolver.cli import main, ranks
from lacsolver.cli.ranks import check_alone
from lacsolver.matrices import contact_matrices, read_matrices
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.patch_meshes import stack

#: a run that takes many steps, so that it can be stopped on its way
LONG = GOOD + "[steps]\ncount = 100000\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The good case and its mesh, in the folder that the command works in."""
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))  # for commands in their own processes
    return tmp_path


def command(*words, **options):
    """The command as a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "lacsolver", *words],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options},
    )


def results(folder):
    return json.loads((folder / "results.json").read_text())


# ---- start


def test_help_and_version_import_no_numpy():
    code = (
        "import sys\nfrom lacsolver.cli import main\n"
        "for words in (['--help'], ['--version'], ['run', '--help'], ['validate', '--help']):\n"
        "    try: main(words)\n    except SystemExit as e: assert e.code == 0\n"
        "heavy = {'numpy', 'scipy', 'h5py', 'rich', 'numba', 'pyvista'} & set(sys.modules)\nassert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("usage: lacsolver") == 3


def test_importing_the_package_imports_nothing():
    code = "import sys, lacsolver; assert 'numpy' not in sys.modules; assert 'lacsolver.case' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize(
    "first",
    [
        "lacsolver",
        "lacsolver.pictures.drawing",
        *(pytest.param(f"lacsolver.{name}", marks=pytest.mark.slow) for name in ("running", "equilibrium.stepping")),
    ],
)
def test_public_names_are_what_they_say_whatever_was_imported_before(first):
    code = (
        f"import importlib, sys\nimportlib.import_module({first!r})\nimport lacsolver\n"
        "assert callable(lacsolver.run) and callable(lacsolver.march) and callable(lacsolver.plot)\n"
        "assert lacsolver.run is sys.modules['lacsolver.running'].run\n"
        "from lacsolver import *\nassert run is lacsolver.run and read_case is lacsolver.read_case\n"
        "assert all(getattr(lacsolver, name) is not None for name in lacsolver.__all__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_name_that_is_not_there():
    import lacsolver

    with pytest.raises(AttributeError, match="no attribute 'runn'"):
        _ = lacsolver.runn


# ---- run


def test_run_writes_the_results_beside_the_case_and_says_so(folder, capsys):
    assert main(["run", "case.toml"]) == 0
    out = capsys.readouterr()
    assert out.err == ""
    told = results(folder / "case")
    zone = told["contact"]["joint"]
    assert told["status"] == "done" and zone["active"] == len(blocks().cell_groups["slave"])
    assert zone["pressure_min"] == pytest.approx(1.0, rel=1e-9) and zone["pressure_max"] == pytest.approx(1.0, rel=1e-9)
    lines = out.out.splitlines()
    assert lines[0].split() == [
        *("step", "time", "iterations", "cutbacks", "balance"),
        *("in", "contact", "max", "pressure"),
    ]
    step = told["steps"][0]
    assert lines[1].split()[:4] == ["1", "1", str(step["iterations"]), str(step["halvings"])]
    assert lines[1].split()[-4:] == ["3", "of", "3", "1"]
    text = " ".join(out.out.split())
    for part in ("zone joint", "3 in contact, 0 open, 0 without a master", "coverage 1 to 1", "results: case ("):
        assert part in text, part
    assert re.search(r"peak memory \d+ MB", text) and re.search(r"time .*\d s", text)
    assert f"iterations {step['iterations']} " in text
    assert re.search(r"largest displacement 0\.00\d+ rigid-body mode without support 'upper' moves along y", text)


def test_the_summary_tells_friction_and_what_joints_carry(folder, capsys):
    text = GOOD.replace('master = "master"\n', 'master = "master"\nfriction = 0.3\n')
    point = '[[coupling]]\nname = "load"\ngroup = "top"\nat = [0.0, 2.0]\nfx = 0.1\nfy = -0.2\n'
    equation = '[[equation]]\nname = "level"\ngroup = "top"\nsame = ["uy"]\n'
    (folder / "case.toml").write_text(text + point + equation)
    assert main(["run", "case.toml"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    zone = results(folder / "case")["contact"]["joint"]
    stick, slide = zone["sticking"], zone["sliding"]
    assert f"friction {stick} macro-elements stick, {slide} slide; largest slip of the step" in printed
    assert re.search(r"coupling load moved by \S+, \S+; force 0\.1, -0\.2 turned by \S+; moment ", printed)
    assert "equation level force" in printed and stick + slide == zone["active"] > 0


def test_the_summary_of_a_ring_has_an_axial_force_and_no_moment(folder, capsys):
    (folder / "case.toml").write_text(GOOD.replace("plane_strain", "axisymmetric"))
    assert main(["run", "case.toml"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    axial, radial = (f"{results(folder / 'case')['contact']['joint']['resultant'][k]:.6g}" for k in (1, 0))
    assert f"force on the slave axial {axial}; radial integral " in printed and "its moment" not in printed
    assert "resultant, t = 1 pressure top: axial -" in printed and radial != axial


def test_the_summary_has_the_mean_pressure(folder, capsys):
    assert main(["run", "case.toml"]) == 0
    assert "pressure 1 to 1, mean 1 " in " ".join(capsys.readouterr().out.split())
    assert results(folder / "case")["contact"]["joint"]["pressure_mean"] == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("program", ["lacmesh", "lacsolver"])
def test_a_bare_command_prints_its_help(program, capsys):
    from lacmesh.cli import main as lacmesh

    assert {"lacmesh": lacmesh, "lacsolver": main}[program]([]) == 0
    out = capsys.readouterr()
    assert out.out.startswith(f"usage: {program} ") and "COMMAND" in out.out and out.err == ""


def test_every_step_has_a_line(folder, capsys):
    (folder / "case.toml").write_text(GOOD + "[steps]\ncount = 4\n")
    assert main(["run", "case.toml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines[1:5]] == [["1", "0.25"], ["2", "0.5"], ["3", "0.75"], ["4", "1"]]


FRICTION = GOOD.replace('master = "master"\n', 'master = "master"\nfriction = 0.3\n')


def test_a_log_has_a_line_for_each_step_and_nothing_that_moves(folder):
    """Output of a batch job: no terminal, standard output and error in one file."""
    (folder / "case.toml").write_text(FRICTION + "[steps]\ncount = 3\n")
    with command("run", "case.toml", stderr=subprocess.STDOUT) as child:
        log, _ = child.communicate(timeout=300)
    assert child.returncode == 0, log
    assert "\x1b" not in log and "\r" not in log and "iteration " not in log
    heading, *lines = log.splitlines()[:4]
    columns = re.split(r"  +", heading.strip())
    assert columns[:5] == ["step", "time", "iterations", "cutbacks", "balance"]
    assert columns[5:] == ["in contact", "sticking", "sliding", "max pressure"]
    with (folder / "case" / "history.csv").open() as file:
        history = list(csv.DictReader(file))
    for line, step, row in zip(lines, results(folder / "case")["steps"], history, strict=True):
        cells = dict(zip(columns, re.split(r"  +", line.strip()), strict=True))
        friction = [int(row[f"contact.joint.{name}"]) for name in ("sticking", "sliding")]
        assert float(cells["time"]) == pytest.approx(step["time"], rel=1e-5)
        assert [cells["iterations"], cells["cutbacks"]] == [str(step["iterations"]), str(step["halvings"])]
        assert cells["in contact"] == f"{sum(friction)} of 3"
        assert [int(cells["sticking"]), int(cells["sliding"])] == friction


def test_quiet_prints_nothing(folder, capsys):
    for words in (["run", "case.toml"], ["validate", "case.toml"], ["matrices", "case.toml", "-o", "m.npz"]):
        assert main([*words, "--quiet"]) == 0
        assert capsys.readouterr() == ("", "")
    assert results(folder / "case")["status"] == "done"


def test_a_warning_is_said_however_quiet(folder, capsys, monkeypatch):
    import warnings

    import lacsolver.validation
    from lacmesh.errors import LacmeshWarning

    real = lacsolver.validation.validate

    def warned(case, mesh):
        warnings.warn("something was left out", LacmeshWarning, stacklevel=1)
        return real(case, mesh)

    monkeypatch.setattr(sys.modules["lacsolver.validation"], "validate", warned)
    assert main(["validate", "case.toml", "-q"]) == 0
    assert capsys.readouterr() == ("", "lacsolver: warning: something was left out\n")


def test_output_force_and_another_folder(folder, capsys):
    assert main(["run", "case.toml", "-q"]) == 0
    assert main(["run", "case.toml", "-q"]) == 2
    assert "--force" in capsys.readouterr().err
    (folder / "case" / "notes.txt").write_text("mine")
    assert main(["run", "case.toml", "-q", "--force"]) == 0
    assert main(["run", "case.toml", "-q", "-o", "other"]) == 0
    assert (folder / "case" / "notes.txt").read_text() == "mine"
    assert results(folder / "other")["status"] == "done"


def test_restart_goes_on_from_the_last_state_or_from_a_time(folder, capsys):
    (folder / "case.toml").write_text(GOOD + "[steps]\ncount = 4\n")
    assert main(["run", "case.toml", "-q"]) == 0
    whole = results(folder / "case")
    (folder / "case" / "state_0004.npz").unlink()
    assert main(["run", "case.toml", "--restart", "case", "--from", "0.5", "-o", "again"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in out[1:3]] == [["1", "0.75"], ["2", "1"]]
    again = results(folder / "again")
    assert [step["time"] for step in again["steps"]] == [0.75, 1.0]
    assert again["contact"]["joint"]["resultant"] == pytest.approx(whole["contact"]["joint"]["resultant"], abs=1e-10)
    assert main(["run", "case.toml", "--restart", "case", "-q"]) == 0  # into its own folder, after state 3
    assert [step["time"] for step in results(folder / "case")["steps"]] == [0.25, 0.5, 0.75, 1.0]
    assert main(["run", "case.toml", "--restart", "case", "--from", "0.6", "-o", "third"]) == 2
    assert "there are: 0.25, 0.5, 0.75, 1" in capsys.readouterr().err


def test_a_closed_error_stream_is_no_internal_error(folder):
    done = subprocess.run(f"{sys.executable} -m lacsolver run case.toml 2>&-", shell=True, capture_output=True)
    assert done.returncode == 0 and results(folder / "case")["status"] == "done"


def test_more_threads_than_cores_are_as_many_as_there_are(folder, capsys):
    assert main(["run", "case.toml", "-q"]) == 0
    (folder / "many.toml").write_text(GOOD + "[solver]\nthreads = 1000000\n")
    assert main(["run", "many.toml", "-q"]) == 0, capsys.readouterr().err
    assert results(folder / "many")["contact"] == results(folder / "case")["contact"]


def test_a_folder_whose_name_is_no_utf8_is_written_and_gone_on_with(folder, capsys):
    name = os.fsdecode(b"out\xff")
    (folder / "case.toml").write_text(GOOD + '[output]\nformat = "med"\n[steps]\ncount = 2\n')
    assert main(["run", "case.toml", "-q", "-o", name]) == 0, capsys.readouterr().err
    (folder / name / "state_0002.npz").unlink()
    assert main(["run", "case.toml", "-q", "-o", name, "--restart", name]) == 0, capsys.readouterr().err
    assert results(folder / name)["status"] == "done"


# ---- one of several processes

SRUN = {"SLURM_PROCID": "0", "SLURM_NTASKS": "4", "SLURM_STEP_NUM_TASKS": "4"}


@pytest.mark.parametrize(
    "told, name",
    [
        ({"OMPI_COMM_WORLD_SIZE": "4"}, "OMPI_COMM_WORLD_SIZE"),
        ({"PMI_SIZE": "4", "PMI_RANK": "3"}, "PMI_SIZE"),
        (SRUN, "SLURM_STEP_NUM_TASKS"),
        ({**SRUN, "ENVIRONMENT": "BATCH"}, "SLURM_STEP_NUM_TASKS"),  # srun in a script of sbatch
        ({"SLURM_PROCID": "0", "SLURM_NTASKS": "4"}, "SLURM_NTASKS"),
        ({"SLURM_PROCID": "1", "SLURM_NTASKS": "4", "ENVIRONMENT": "BATCH"}, "SLURM_NTASKS"),
    ],
)
@pytest.mark.parametrize(
    "words", ["run case.toml", "matrices case.toml -o m.npz", "modes case.toml", "film case.toml -o f.png"]
)
def test_one_of_several_processes_is_refused(folder, monkeypatch, capsys, told, name, words):
    """The command `run` only where the engine of several processes is not installed."""
    monkeypatch.setattr(ranks, "absence", lambda: "PETSc is not installed; type this")
    monkeypatch.setattr(ranks, "_PAUSE", 0)
    for key, value in told.items():
        monkeypatch.setenv(key, value)
    for key in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(key, "1")
    before = sorted(folder.iterdir())
    assert main(words.split()) == 2
    said = capsys.readouterr().err
    why = "PETSc is not installed; type this; else start one " if words.startswith("run") else "each would solve "
    assert said.startswith(f"lacsolver: error: 4 processes were started ({name}), and {why}")
    assert len(said.splitlines()) == 1 and sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    "told",
    [
        {"OMPI_COMM_WORLD_SIZE": "1"},
        {"SLURM_NTASKS": "4"},  # salloc
        {"SLURM_NTASKS": "4", "SLURM_PROCID": "0", "ENVIRONMENT": "BATCH"},  # a script of sbatch
        {"SLURM_NTASKS": "4", "SLURM_PROCID": "0", "SLURM_STEP_NUM_TASKS": "1"},  # srun -n 1
        {"PMI_SIZE": ""},
    ],
)
def test_one_process_of_a_job_of_many_is_alone(monkeypatch, told):
    check_alone(told)


# ---- stopped


def started(folder, words=("run", "case.toml"), steps=3, **options):
    """A run in a process of its own, once it has made some steps."""
    (folder / "case.toml").write_text(LONG)
    process = command(*words, cwd=folder, **options)
    give_up = time.monotonic() + 600
    history = folder / "case" / "history.csv"
    while time.monotonic() < give_up and process.poll() is None:
        if history.exists() and len(history.read_bytes().splitlines()) > steps:
            return process
        time.sleep(0.02)
    raise AssertionError(process.communicate())


@pytest.mark.parametrize(
    "number, status, word",
    [pytest.param(signal.SIGINT, 130, "interrupted", marks=pytest.mark.slow), (signal.SIGTERM, 143, "terminated")],
)
def test_a_run_that_is_stopped_leaves_what_converged(folder, number, status, word):
    process = started(folder)
    process.send_signal(number)
    _, err = process.communicate(timeout=300)
    assert process.returncode == status
    told = results(folder / "case")
    last = told["steps"][-1]["time"]
    assert told["status"] == "interrupted"
    assert re.fullmatch(
        rf"lacsolver: error: {word}; what converged up to t = (\S+) is in case; --restart case goes on from there\n",
        err,
    )
    assert float(re.search(r"t = (\S+) is", err)[1]) == pytest.approx(last, rel=1e-8)
    state = sorted((folder / "case").glob("state_*.npz"))[-1]
    assert json.loads(np.load(state)["about"].tobytes())["time"] == pytest.approx(last)
    assert not [path for path in (folder / "case").rglob("*") if path.name.startswith(".")]


def test_a_run_into_the_folder_of_another_is_refused(folder, capsys):
    process = started(folder)
    try:
        for more in ([], ["--force"], ["--restart", "case"]):
            assert main(["run", "case.toml", "-q", *more]) == 2
            assert "another run is writing into case; wait for its end" in capsys.readouterr().err
    finally:
        process.kill()
        process.communicate()
    (folder / "case.toml").write_text(GOOD)  # of the same name: it takes over what the killed run left
    assert main(["run", "case.toml", "-q", "--force"]) == 0, capsys.readouterr().err
    assert results(folder / "case")["status"] == "done"
    assert not [path for path in (folder / "case").rglob("*") if path.name.startswith(".")]


def test_stopped_before_the_first_step(folder, capsys, monkeypatch):
    def stopped(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["lacsolver.running"], "run", stopped)
    assert main(["run", "case.toml"]) == 130
    assert capsys.readouterr().err == "lacsolver: error: interrupted; no step has converged\n"
    assert not (folder / "case").exists()


def test_a_reader_that_goes_away_ends_the_command_quietly(folder):
    process = command("schema", cwd=folder)
    process.stdout.close()
    assert process.wait(300) in (0, 120)
    assert "Traceback" not in process.stderr.read()
    process.stderr.close()


def test_an_internal_error_is_one_line(folder, capsys, monkeypatch):
    def broken(*args):
        raise ZeroDivisionError("of ours")

    monkeypatch.setattr(import_module("lacsolver.validation"), "validate", broken)
    assert main(["validate", "case.toml"]) == 1
    assert capsys.readouterr().err.startswith(
        "lacsolver: error: internal error (ZeroDivisionError: of ours); --verbose"
    )
    with pytest.raises(ZeroDivisionError):
        main(["validate", "case.toml", "--verbose"])


def test_too_little_memory_is_one_line(folder, capsys, monkeypatch):
    def broken(*args):
        raise MemoryError

    monkeypatch.setattr(import_module("lacsolver.validation"), "validate", broken)
    assert main(["validate", "case.toml"]) == 1
    assert "there is not enough memory for this model" in capsys.readouterr().err


# ---- a terminal


def on_terminal(words, folder, columns=80):
    """Run a command on a terminal of `columns` columns: its exit status and its output."""
    pid, fd = pty.fork()
    if pid == 0:
        os.chdir(folder)
        os.environ |= {"TERM": "xterm-256color", "COLUMNS": str(columns)}
        os.execv(sys.executable, [sys.executable, "-m", "lacsolver", *words])
    shown = b""
    while True:
        try:
            part = os.read(fd, 4096)
        except OSError:  # the other end was closed
            break
        if not part:
            break
        shown += part
    os.close(fd)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), shown.decode()


def visible(shown):
    """The lines that stay: what is erased or written over is left out."""
    kept = []
    for line in re.sub(r"\x1b\[[0-9;?]*[lhm]", "", shown).replace("\r\n", "\n").split("\n"):
        for _ in range(line.count("\x1b[1A")):
            kept.pop()
        kept.append(re.split(r"\x1b\[2K|\r", line)[-1].replace("\x1b[1A", ""))
    return kept


def test_a_terminal_shows_iterations_which_leave_a_line_a_step(folder):
    (folder / "case.toml").write_text(FRICTION + "[steps]\ncount = 3\n")
    status, shown = on_terminal(["run", "case.toml"], folder)
    assert status == 0 and "\x1b[2K" in shown  # the display that is erased again
    assert re.search(r"towards t = [\d.]+ of 1", shown) and re.search(r"iteration +\d+  closed +3", shown)
    lines = visible(shown)
    assert not [line for line in lines if "towards" in line or "preparing" in line]
    steps = [line for line in lines if re.match(r" +[123] +[\d.]+ +\d+ +0 ", line)]
    assert len(steps) == 3
    assert max(map(len, lines)) <= 80


def test_a_quiet_terminal_shows_nothing(folder):
    assert on_terminal(["run", "case.toml", "--quiet"], folder) == (0, "")


# ---- validate


def test_validate_tells_what_would_be_solved(folder, capsys):
    assert main(["validate", "case.toml"]) == 0
    out = capsys.readouterr()
    text = " ".join(out.out.split())
    for part in (
        "model plane_strain, small strains",
        "cut made for this run",
        "rigid-body mode without support 'upper' moves along y",
        "contact joint: slave slave, master master",
        "3 of 3 face the master; 100 % of the slave is covered",
        "displacement bottom: uy = 0",
        "pressure top: value = 1, ramped",
    ):
        assert part in text, part
    assert out.err == "" and sorted(p.name for p in folder.iterdir()) == ["blocks.msh", "case.toml"]


def test_validate_says_of_a_cut_that_the_mesh_has_it(folder, capsys):
    put(lacmesh.cut_skin(blocks(), "slave").mesh, folder)
    assert main(["validate", "case.toml"]) == 0
    assert "present in the mesh" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["TRIA6", "QUAD8"])
def test_validate_says_where_nothing_is_cut(folder, capsys, kind):
    """An edge of three nodes owns its middle node: the mesh stays as it is."""
    put(stack(kind, "QUAD4", 2, counts=(3, 2)), folder)
    assert main(["validate", "case.toml"]) == 0
    assert "not needed: every slave face is a macro-element as it is" in capsys.readouterr().out


def test_validate_warns_of_a_cut_without_records_and_takes_it_once_it_is_recognised(folder, capsys):
    mesh = lacmesh.cut_skin(blocks(), "slave").mesh
    bare = replace(mesh, cell_data={}, node_data={})
    put(bare, folder)
    assert main(["validate", "case.toml"]) == 0
    printed = capsys.readouterr()
    assert "of an earlier cut without records, and are cut as they are" in " ".join((printed.out + printed.err).split())
    assert "present in the mesh" not in printed.out
    put(lacmesh.recognise(bare, "slave").mesh, folder)
    assert main(["validate", "case.toml"]) == 0
    assert "present in the mesh" in capsys.readouterr().out


def test_validate_counts_as_the_run_does(folder, capsys):
    assert main(["validate", "case.toml"]) == 0
    unknowns = int(re.search(r"unknowns +([\d,]+) of", capsys.readouterr().out)[1].replace(",", ""))
    assert main(["run", "case.toml", "-q"]) == 0
    assert results(folder / "case")["sizes"]["unknowns"] == unknowns


def test_validate_tells_every_section_and_its_values(folder, capsys):
    more = """
[[spring]]
group = "top"
kx = 2.5
[[force]]
at = [1, 2]
fy = "-sin(t)"
[[body_force]]
fy = [[0, 0], [1, -2]]
groups = ["upper", "lower"]
[[tie]]
name = "glue"
slave = "x1"
master = "x0"
"""
    (folder / "case.toml").write_text(GOOD + more)
    assert main(["validate", "case.toml"]) == 1
    out = capsys.readouterr()
    text = " ".join(out.out.split())
    for part in (
        "spring top: kx = 2.5",
        "force at [1, 2]: fy = '-sin(t)'",
        "body_force upper, lower: fy = [[0, 0], [1, -2]]",
    ):
        assert part in text, part
    assert "tie: no face of slave 'x1' has master 'x0' in front of it" in out.err


def test_validate_tells_mistakes_of_different_kinds_at_once(folder, capsys):
    text = GOOD.replace('"slave"\n', '"lower"\n').replace("value = 1.0", 'value = "1 / x"')
    text = text.replace('group = "x0"', "at = [9, 9]").replace("young", 'groups = ["lower"]\nyoung')
    (folder / "case.toml").write_text(text)
    assert main(["validate", "case.toml"]) == 1
    said = capsys.readouterr().err.splitlines()
    wanted = ("line 7: .*lower", "cells have no material", r"line 14: displacement: no node at \[9, 9\]")
    assert len(said) == len(wanted)
    for pattern in wanted:
        assert any(re.search(pattern, line) for line in said), (pattern, said)


# ---- schema


def test_schema_lists_every_key(capsys):
    assert main(["schema"]) == 0
    text = capsys.readouterr().out
    assert "[[contact]]" in text and "crease_angle" in text and "max_halvings" in text
    assert main(["schema", "--json"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema["properties"]["contact"]["items"]["properties"]["clearance"]


# ---- matrices


def loaded(path):
    B, arrays = read_matrices(path)
    assert np.array_equal(load_npz(path).toarray(), B.toarray())  # scipy reads it too
    return B, arrays


def test_matrices_are_those_of_python(folder, capsys):
    assert main(["matrices", "case.toml", "-o", "m.npz", "--mtx"]) == 0
    assert "joint: B 3 x " in capsys.readouterr().out
    made = contact_matrices(lacmesh.read("blocks.msh"), "slave", "master")
    B, file = loaded("m.npz")
    assert abs(B - made.B).max() == 0 and abs(mmread("m.mtx", spmatrix=False) - made.B).max() < 1e-15
    for name in ("G", "w", "area", "coverage", "normal", "centre", "macro", "node"):
        assert np.array_equal(file[name], getattr(made, name)), name


def test_matrices_need_no_material_and_no_load(folder):
    head, contact = GOOD.split("[[material]]")[0], '[[contact]]\nslave = "slave"\nmaster = "master"\n'
    (folder / "case.toml").write_text(head + contact)
    assert main(["matrices", "case.toml", "-o", "m.npz", "-q"]) == 0
    assert loaded("m.npz")[0].shape[0] == 3


def test_matrices_of_several_zones_have_a_file_each(folder, capsys):
    put(lacmesh.cut_skin(blocks(), ["slave", "x1"]).mesh, folder)
    more = '[[tie]]\nname = "a/b"\nslave = "x1"\nmaster = "x0"\n'
    (folder / "case.toml").write_text(GOOD.replace('master = "master"', 'master = "master"\nclearance = 0.25') + more)
    assert main(["matrices", "case.toml", "-o", "m.npz"]) == 0
    assert sorted(p.name for p in folder.glob("m*")) == ["m-a_b.npz", "m-joint.npz"]
    B, file = loaded("m-joint.npz")
    assert np.allclose(file["G"], 0.25 * file["w"], atol=1e-12)
    tie, of_tie = loaded("m-a_b.npz")
    assert tie.shape == (2 * len(of_tie["w"]), B.shape[1])


def test_a_clearance_is_that_of_the_end(folder):
    text = GOOD.replace('master = "master"', 'master = "master"\nclearance = "0.5 * t"') + "[steps]\nend = 3.0\n"
    (folder / "case.toml").write_text(text)
    assert read_case("case.toml").steps.last == 3.0
    assert main(["matrices", "case.toml", "-o", "m.npz", "-q"]) == 0
    file = loaded("m.npz")[1]
    assert np.allclose(file["G"], 1.5 * file["w"], atol=1e-12)


def test_names_of_the_mesh_are_no_commands_to_the_terminal(folder, capsys):
    """A group that clears the screen, among those that are like the one asked for."""
    mesh = blocks()
    groups = {"\x1b[2J" + name if name == "slave" else name: cells for name, cells in mesh.cell_groups.items()}
    put(replace(mesh, cell_groups=groups), folder)
    for command in ("validate", "run"):
        assert main([command, str(folder / "case.toml")]) != 0
        said = capsys.readouterr()
        assert r"\x1b[2Jslave" in said.err and "\x1b" not in said.err + said.out
