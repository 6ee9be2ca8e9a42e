"""The command `lacsolver`: what it prints, its statuses, what it leaves on the disk, and what it says of bad input."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import warnings
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy.io import mmread
from scipy.sparse import load_npz

import lacmesh
from lacsolver.cli import main, ranks
from lacsolver.cli.ranks import check_alone
from lacsolver.matrices import contact_matrices, read_matrices
from tests.bad_input.case import alarm, listing, nobody, small_files
from tests.lacsolver.bad_cases import CASES, GOOD, HEAVY, blocks, put
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.tables import table

FRICTION = GOOD.replace('master = "master"\n', 'master = "master"\nfriction = 0.3\n')


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The good case and its mesh, in the folder that the command works in."""
    put(blocks(), tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))  # for commands in their own processes
    case()
    return tmp_path


def case(text=GOOD):
    Path("case.toml").write_text(text)


def results(folder="case"):
    return json.loads((Path(folder) / "results.json").read_text())


@pytest.fixture
def printed(folder, capsys):
    """Runs a command that succeeds: what it prints, with single spaces."""

    def run(words):
        assert main(words.split()) == 0
        out, err = capsys.readouterr()
        assert err == ""
        return " ".join(out.split())

    return run


# ---- run


def test_run_writes_the_results_beside_the_case_and_says_so(printed):
    text = printed("run case.toml")
    told = results()
    zone, step = told["contact"]["joint"], told["steps"][0]
    assert told["status"] == "done" and zone["active"] == len(blocks().cell_groups["slave"])
    for name in ("pressure_min", "pressure_max", "pressure_mean"):
        assert zone[name] == pytest.approx(1.0, rel=1e-9)
    for part in (
        *("contact joint", "3 in contact, 0 open, 0 without a master", "coverage 1 to 1", "results: case ("),
        *("pressure 1 to 1, mean 1 ", f"iterations {step['iterations']} ", "largest displacement 0.00"),
        "rigid-body mode without support 'upper' moves along y",
    ):
        assert part in text, part
    assert re.search(r"peak memory \d+ MB", text) and re.search(r"time .*\d s", text)


def test_the_summary_tells_friction_and_what_joints_carry(printed):
    point = '[[coupling]]\nname = "load"\ngroup = "top"\nat = [0.0, 2.0]\nfx = 0.1\nfy = -0.2\n'
    case(FRICTION + point + '[[equation]]\nname = "level"\ngroup = "top"\nsame = ["uy"]\n')
    text, zone = printed("run case.toml"), results()["contact"]["joint"]
    stick, slide = zone["sticking"], zone["sliding"]
    assert f"friction {stick} macro-elements stick, {slide} slide; largest slip of the step" in text
    assert re.search(r"coupling load moved by \S+, \S+; force 0\.1, -0\.2 rotated by \S+; moment ", text)
    assert "equation level force" in text and stick + slide == zone["active"] > 0


def test_the_summary_of_a_ring_has_an_axial_force_and_no_moment(printed):
    case(GOOD.replace("plane_strain", "axisymmetric"))
    text = printed("run case.toml")
    axial, radial = (f"{results()['contact']['joint']['resultant'][k]:.6g}" for k in (1, 0))
    assert f"force on the slave axial {axial}; radial integral " in text and "moment on the slave" not in text
    assert "resultant, t = 1 pressure top: axial -" in text and radial != axial


@pytest.mark.slow
def test_a_log_has_a_line_for_each_step_and_nothing_that_moves(folder):
    """Output of a batch job: no terminal, standard output and error in one file."""
    case(FRICTION + "[steps]\ncount = 3\n")
    words = [sys.executable, "-m", "lacsolver", "run", "case.toml"]
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
    log = done.stdout
    assert done.returncode == 0 and "\x1b" not in log and "\r" not in log and "iteration " not in log
    heading, *lines = log.splitlines()[:4]
    columns = re.split(r"  +", heading.strip())
    assert columns == [
        *("step", "time", "iterations", "cutbacks", "balance"),
        *("in contact", "sticking", "sliding", "max pressure"),
    ]
    history = table(folder / "case" / "history.csv")
    for k, (line, step) in enumerate(zip(lines, results()["steps"], strict=True)):
        cells = dict(zip(columns, re.split(r"  +", line.strip()), strict=True))
        friction = [int(history[f"contact.joint.{name}"][k]) for name in ("sticking", "sliding")]
        assert cells["step"] == str(k + 1) and float(cells["time"]) == pytest.approx(step["time"], rel=1e-5)
        assert [cells["iterations"], cells["cutbacks"]] == [str(step["iterations"]), str(step["halvings"])]
        assert cells["in contact"] == f"{sum(friction)} of 3" and float(cells["max pressure"]) > 0
        assert [int(cells["sticking"]), int(cells["sliding"])] == friction


def test_output_force_another_folder_and_more_threads_than_cores(folder):
    assert main(["run", "case.toml", "-q"]) == 0
    Path("case/notes.txt").write_text("mine")
    assert main(["run", "case.toml", "-q", "--force"]) == 0
    case(GOOD + "[solver]\nthreads = 1000000\n")
    assert main(["run", "case.toml", "-q", "-o", "other"]) == 0
    assert Path("case/notes.txt").read_text() == "mine" and results("other")["status"] == "done"
    assert results("other")["contact"] == results("case")["contact"]


def test_stopped_before_the_first_step(folder, capsys, monkeypatch):
    def stopped(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(import_module("lacsolver.running"), "run", stopped)
    assert main(["run", "case.toml"]) == 130
    assert capsys.readouterr().err == "lacsolver: error: interrupted; no step has converged\n"
    assert not Path("case").exists()


# ---- one of several processes

SRUN = {"SLURM_PROCID": "0", "SLURM_NTASKS": "4", "SLURM_STEP_NUM_TASKS": "4"}
BATCH = {"SLURM_NTASKS": "4", "ENVIRONMENT": "BATCH"}


@pytest.mark.parametrize(
    "told, name",
    [
        ({"OMPI_COMM_WORLD_SIZE": "4"}, "OMPI_COMM_WORLD_SIZE"),
        ({"PMI_SIZE": "4", "PMI_RANK": "3"}, "PMI_SIZE"),
        (SRUN, "SLURM_STEP_NUM_TASKS"),
        (SRUN | BATCH, "SLURM_STEP_NUM_TASKS"),  # srun in a script of sbatch
        ({"SLURM_PROCID": "0", "SLURM_NTASKS": "4"}, "SLURM_NTASKS"),
        (BATCH | {"SLURM_PROCID": "1"}, "SLURM_NTASKS"),
    ],
)
@pytest.mark.parametrize(
    "words", ["run case.toml", "matrices case.toml -o m.npz", "modes case.toml", "film case.toml -o f.png"]
)
def test_one_of_several_processes_is_refused(folder, monkeypatch, capsys, told, name, words):
    """The command `run` only where the engine of several processes is not installed."""
    monkeypatch.setattr(ranks, "absence", lambda: "PETSc is not installed; type this")
    monkeypatch.setattr(ranks, "_PAUSE", 0)
    threads = {"OMP_NUM_THREADS": "", "OPENBLAS_NUM_THREADS": "", "MKL_NUM_THREADS": "5"}
    for key, value in (told | threads).items():
        monkeypatch.setenv(key, value)
    for key in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.delenv(key)
    before = sorted(folder.iterdir())
    assert main(words.split()) == 2
    said = capsys.readouterr().err
    why = "PETSc is not installed; type this; else start one " if words.startswith("run") else "each would solve "
    assert said.startswith(f"lacsolver: error: 4 processes were started ({name}), and {why}")
    assert len(said.splitlines()) == 1 and sorted(folder.iterdir()) == before
    if words.startswith("run"):  # one thread a process, but as many as the user asks for
        assert [os.environ[key] for key in threads] == ["1", "1", "5"]


@pytest.mark.parametrize(
    "told",
    [
        *({"OMPI_COMM_WORLD_SIZE": "1"}, {"PMI_SIZE": ""}),
        {"SLURM_NTASKS": "4"},  # salloc
        BATCH | {"SLURM_PROCID": "0"},  # a script of sbatch
        SRUN | {"SLURM_STEP_NUM_TASKS": "1"},  # srun -n 1
    ],
)
def test_one_process_of_a_job_of_many_is_alone(told):
    check_alone(told)


# ---- validate


def test_validate_tells_what_would_be_solved_and_counts_as_the_run_does(printed, folder):
    text = printed("validate case.toml")
    for part in (
        *("model plane_strain, small kinematics", "cut of this run"),
        *("rigid-body mode without support 'upper' moves along y", "contact joint: slave slave, master master"),
        "3 of 3 face the master; 100 % of the slave is covered",
        *("displacement bottom: uy = 0.0", "pressure top: value = 1.0, ramped"),
    ):
        assert part in text, part
    assert sorted(p.name for p in folder.iterdir()) == ["blocks.msh", "case.toml"]
    unknowns = int(re.search(r"unknowns ([\d,]+) of", text)[1].replace(",", ""))
    printed("run case.toml -q")
    assert results()["sizes"]["unknowns"] == unknowns


@pytest.mark.parametrize(("young", "words"), [(1000.0, "36.69"), (4000.0, "36.69 to 73.3799")])
def test_validate_tells_the_wave_speeds_of_all_materials(printed, young, words):
    """From sqrt(E (1 - nu) / (1 + nu) / (1 - 2 nu) / rho) of the softest to that of the stiffest."""
    one = HEAVY[HEAVY.index("[[material]]") : HEAVY.index("[[contact]]")]
    laws = (one.replace("young", f'groups = ["{name}"]\nyoung') for name in ("lower", "upper"))
    case(HEAVY.replace(one, "".join(laws).replace("1000.0", str(young), 1)) + "[dynamics]\n[steps]\ncount = 4\n")
    assert f"wave speeds {words} cells crossed" in printed("validate case.toml")


#: a mesh, and what is said of its cut; an edge of three nodes owns its middle node: the mesh stays as it is
PRESENT = "present in the mesh"
CUTS = {
    "cut": (lambda: lacmesh.cut_skin(blocks(), "slave").mesh, PRESENT),
    "bare": (lambda: bare(), "of this run"),
    "recognised": (lambda: lacmesh.recognise(bare(), "slave").mesh, PRESENT),
    **{
        kind: (lambda kind=kind: stack(kind, "QUAD4", 2, counts=(3, 2)), "not needed: every slave face is a macro")
        for kind in ("TRIA6", "QUAD8")
    },
}


def bare():
    return replace(lacmesh.cut_skin(blocks(), "slave").mesh, cell_data={}, node_data={})


@pytest.mark.parametrize("name", CUTS)
def test_validate_says_whether_and_where_the_mesh_is_cut(folder, capsys, name):
    mesh, words = CUTS[name]
    put(mesh(), folder)
    assert main(["validate", "case.toml"]) == 0
    said = " ".join("".join(capsys.readouterr()).split())
    assert words in said and (words == PRESENT) == (PRESENT in said)


def test_validate_tells_every_section_its_values_and_mistakes_of_different_kinds_at_once(folder, capsys):
    more = '[[spring]]\ngroup = "top"\nkx = 2.5\n[[force]]\nat = [1, 2]\nfy = "-sin(t)"\n'
    more += '[[body_force]]\nfy = [[0, 0], [1, -2]]\ngroups = ["upper", "lower"]\n'
    case(GOOD + more + '[[tie]]\nname = "glue"\nslave = "x1"\nmaster = "x0"\n')
    assert main(["validate", "case.toml"]) == 1
    out = capsys.readouterr()
    text = " ".join(out.out.split())
    for part in (
        "spring top: kx = 2.5",
        'force at [1, 2]: fy = "-sin(t)"',
        "upper, lower: fy = [[0.0, 0.0], [1.0, -2.0]]",
    ):
        assert part in text, part
    assert "tie: no face of slave 'x1' has master 'x0' in front of it" in out.err
    text = GOOD.replace('"slave"\n', '"lower"\n').replace("value = 1.0", 'value = "1 / x"')
    case(text.replace('group = "x0"', "at = [9, 9]").replace("young", 'groups = ["lower"]\nyoung'))
    assert main(["validate", "case.toml"]) == 1
    said = capsys.readouterr().err.splitlines()
    wanted = ("line 7: .*lower", "cells have no material", r"line 14: displacement: no node at \[9, 9\]")
    assert len(said) == len(wanted)
    for pattern in wanted:
        assert any(re.search(pattern, line) for line in said), (pattern, said)


# ---- matrices


def loaded(path):
    B, arrays = read_matrices(path)
    assert np.array_equal(load_npz(path).toarray(), B.toarray())  # scipy reads it too
    return B, arrays


def test_matrices_are_those_of_python(printed):
    assert "joint: B 3 x " in printed("matrices case.toml -o m.npz --mtx")
    made = contact_matrices(lacmesh.read("blocks.msh"), "slave", "master")
    B, file = loaded("m.npz")
    assert abs(B - made.B).max() == 0 and abs(mmread("m.mtx", spmatrix=False) - made.B).max() < 1e-15
    for name in ("G", "w", "area", "coverage", "normal", "centre", "macro", "node"):
        assert np.array_equal(file[name], getattr(made, name)), name


def test_matrices_need_no_material_and_no_load_and_have_the_clearance_of_the_end(printed):
    joint = '[[contact]]\nslave = "slave"\nmaster = "master"\nclearance = "0.5 * t"\n'
    case(GOOD.split("[[material]]")[0] + joint + "[steps]\nend = 3.0\n")
    printed("matrices case.toml -o m.npz -q")
    B, file = loaded("m.npz")
    assert B.shape[0] == 3 and np.allclose(file["G"], 1.5 * file["w"], atol=1e-12)


def test_matrices_of_several_zones_have_a_file_each(printed, folder):
    put(lacmesh.cut_skin(blocks(), ["slave", "x1"]).mesh, folder)
    more = '[[tie]]\nname = "a/b"\nslave = "x1"\nmaster = "x0"\n'
    case(GOOD.replace('master = "master"', 'master = "master"\nclearance = 0.25') + more)
    printed("matrices case.toml -o m.npz")
    assert sorted(p.name for p in folder.glob("m*")) == ["m-a_b.npz", "m-joint.npz"]
    B, file = loaded("m-joint.npz")
    assert np.allclose(file["G"], 0.25 * file["w"], atol=1e-12)
    tie, of_tie = loaded("m-a_b.npz")
    assert tie.shape == (2 * len(of_tie["w"]), B.shape[1])


# ---- bad input: what the command says, its status, and that the folder is as it was


def said(words, folder, bad):
    """The command's status and what it said of errors, line by line."""
    out = io.StringIO()
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stderr(out),
        contextlib.redirect_stdout(io.StringIO()),
        nobody() if bad.nobody else contextlib.nullcontext(),
        small_files(bad.file_size),
        alarm(300),  # of the processor's time: kernels may have to be compiled first
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("default")
        status = main(words)
    lines = out.getvalue().splitlines()
    assert all(line.startswith(("lacsolver: error: ", "lacsolver: warning: ")) for line in lines), lines
    return status, [line.removeprefix("lacsolver: error: ") for line in lines if "error: " in line]


@pytest.fixture
def open_folder():
    """A folder that a user who owns nothing may work in, too."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o777)
        put(blocks(), Path(name))
        yield Path(name)


@pytest.mark.parametrize("bad", CASES, ids=lambda bad: bad.what)
def test_bad_input(bad, open_folder):
    (open_folder / "case.toml").write_bytes(bad.text if isinstance(bad.text, bytes) else bad.text.encode())
    if bad.make:
        bad.make(open_folder)
    for command in bad.commands:
        before = listing(open_folder)
        words = [*command.replace("CASE", "case.toml").split(), *["case.toml"] * (command in ("validate", "run"))]
        status, lines = said(words, open_folder, bad)
        told = "\n".join(lines)
        assert status == bad.status, told
        assert len(lines) == len(bad.patterns), told
        for pattern, line in zip(bad.patterns, lines, strict=True):
            assert re.search(pattern, line), f"{command}: {line}"
        assert "internal error" not in told and "Traceback" not in told
        if bad.then:
            bad.then(open_folder)
        else:
            assert listing(open_folder) == before, "something was left, or changed"
