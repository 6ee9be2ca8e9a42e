"""Output of a run: when it is written, into which folder, and the fate of what is already there."""

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace

import h5py
import numpy as np
import pytest

from lacmesh.errors import ReadError, RequestError, WriteError
from lacmesh.formats import output
from lacmesh.formats.vtu import read_pvd
from lacsolver import plot, read_results
from lacsolver.case import Material, Output, Pressure, Solver, Steps
from lacsolver.output import create_output, read_state
from lacsolver.output import writer as writers
from lacsolver.output.states import StoredFields
from tests.bad_input.case import small_files
from tests.lacsolver.tables import table
from tests.lacsolver.written import fields, made_up, restart
from tests.samples import each_option

FORMATS = ("vtu", "med")


def going(folder, count, name="out", **output):
    """A run that has made some steps into a folder, and its writer."""
    run = made_up(folder, **output)
    run.folder = folder / name
    run.steps(writer := run.writer(), count)
    return run, writer


def after(*given):
    """A run that has made some steps, and whose writer is gone."""
    return going(*given)[0]


def times_of(run):
    """The times in every file of a run's folder: history, contact tables, fields, states, results."""
    folder, told = run.folder, {}
    for path in (folder / "history.csv", *folder.glob("contact_*.csv")):
        told[path.name] = list(dict.fromkeys(table(path)["time"]))
    for path in folder.glob("*.pvd"):
        told[path.name] = list(read_pvd(path))
    if (folder / "results.med").exists():
        with h5py.File(folder / "results.med") as file:
            told["results.med"] = sorted(float(step.attrs["PDT"]) for step in file["CHA/DEPL"].values())
    states = sorted(folder.glob("state_0*.npz"))
    told["states"] = [json.loads(np.load(path)["tree"].tobytes())["time"] for path in states]
    told["fields"] = StoredFields(folder).times
    told["results.json"] = [step["time"] for step in summary(run)["steps"]]
    return told


def summary(run):
    return json.loads((run.folder / "results.json").read_text())


def assert_times(run, times, of=lambda name: True):
    """Every file (of a kind) of a run has these times."""
    found = {name: own for name, own in times_of(run).items() if of(name)}
    assert found and all(own == times for own in found.values()), found


def has_fields(name):
    return name not in ("history.csv", "results.json", "states")


def inside(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


# ---- when


@pytest.mark.rows("output1-due1-in_the_end1-None-vtu", "output2-due2-in_the_end2-states2-vtu")
@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(
    ("output", "due", "in_the_end", "states"),
    [
        ({}, [1, 1, 1, 1, 1], [0.25, 0.5, 0.75, 1.0, 1.25], None),
        ({"every": 2}, [0, 1, 0, 1, 0], [0.5, 1.0, 1.25], None),
        ({"times": [0.25, 1]}, [1, 0, 0, 1, 0], [0.25, 1.0], [0.25, 1.0, 1.25]),
    ],
)
def test_fields_are_written_as_the_case_says(tmp_path, kind, output, due, in_the_end, states):
    run = made_up(tmp_path, format=kind, **output)
    writer = run.writer()
    assert run.steps(writer, 5) == [bool(k) for k in due]
    assert run.calls == sum(due)
    run.finish(writer)
    assert_times(run, [0.25, 0.5, 0.75, 1.0, 1.25], lambda name: name in ("history.csv", "results.json"))
    assert_times(run, in_the_end, has_fields)
    assert times_of(run)["states"] == (states or in_the_end)


@pytest.mark.parametrize(("kind", "status"), [("vtu", "failed"), ("med", "interrupted")])
def test_a_run_that_is_not_done_leaves_its_last_converged_step_and_apart_the_state_tried(tmp_path, kind, status):
    run, writer = going(tmp_path, 3, format=kind, times=[1.0])
    run.finish(writer, status, message="no convergence at t = 0.8", tried=lambda: fields(run.space, 0.8))
    assert_times(run, [0.75], has_fields)
    assert times_of(run)["states"] == [0.75] and summary(run)["message"] == "no convergence at t = 0.8"
    tried = run.folder / "unconverged"
    assert list(read_pvd(tried / "solid.pvd")) == [0.8]
    made_up(tmp_path).writer(force=True)
    assert not tried.exists()


@pytest.fixture
def heard():
    """SIGINT raises KeyboardInterrupt, whatever a gmsh of another test has set."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before or signal.SIG_DFL)


def test_a_signal_waits_until_a_step_is_whole(heard, tmp_path, monkeypatch):
    run = made_up(tmp_path)
    writer, add = run.writer(), writers.add_contact

    def interrupted(*given):
        os.kill(os.getpid(), signal.SIGINT)
        add(*given)

    monkeypatch.setattr(writers, "add_contact", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.step(writer, 1, 0.25)
    monkeypatch.undo()
    run.finish(writer, "interrupted", message="interrupted")
    assert_times(run, [0.25])


def test_an_interrupt_while_fields_are_made_leaves_them_to_the_end(tmp_path):
    run, writer = going(tmp_path, 1)
    asked = []

    def made():
        asked.append(1)
        if len(asked) == 1:
            raise KeyboardInterrupt
        return fields(run.space, 0.5)

    run.results = replace(run.results, steps=(*run.results.steps, replace(run.results.steps[-1], time=0.5)))
    with pytest.raises(KeyboardInterrupt):
        writer.step(run.results, made, restart(run.space, 2, 0.5))
    run.finish(writer, "interrupted", message="interrupted")
    assert_times(run, [0.25, 0.5])


# ---- where


def test_nothing_is_there_before_the_writer_begins_and_other_things_stay(tmp_path):
    create_output(tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(WriteError, match="cannot be used"):
        create_output(tmp_path / ("x" * 300))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "notes.txt").write_text("mine")
    run = after(tmp_path, 1)
    assert (run.folder / "notes.txt").read_text() == "mine"


def test_force_replaces_results_and_nothing_else(tmp_path):
    old = after(tmp_path, 3)
    mine = ("notes.txt", "fields/mine.vtu", "state_of_art.npz", "contact.csv", "solid_0001.vtu")
    for name in mine:
        (old.folder / name).write_text("mine")
    before = inside(old.folder)
    run = made_up(tmp_path, format="med")
    with pytest.raises(RequestError, match="holds results already; --force"):
        create_output(run.folder)
    create_output(run.folder, force=True)
    assert inside(run.folder) == before  # until the writer begins
    writer = run.writer(force=True)
    assert set(inside(run.folder)) == {*mine, "mesh.npz"}
    run.steps(writer, 1)
    assert_times(run, [0.25])
    run.finish(writer)
    assert_times(run, [0.25])
    assert (run.folder / "results.med").exists() and not list(run.folder.glob("*.pvd"))


@pytest.mark.parametrize("kind", FORMATS)
def test_a_disk_that_is_full_is_told_in_a_sentence_and_what_was_whole_stays(tmp_path, kind):
    run, writer = going(tmp_path, 1, format=kind)
    with small_files(2500), pytest.raises(WriteError, match=r"cannot be written \(File too large\)"):
        run.step(writer, 2, 0.5)
    assert_times(run, [0.25], has_fields if kind == "vtu" else lambda name: name == "fields")
    assert times_of(run)["states"] == [0.25]
    run.finish(writer, "failed", message="the disk is full")
    assert not [p for p in run.folder.rglob(".*") if p.is_file()] and summary(run)["status"] == "failed"


# ---- restart


@pytest.mark.parametrize(("kind", "from_time"), each_option(itertools.product(FORMATS, (None, 0.5))))
def test_a_restart_goes_on_in_its_own_folder(tmp_path, kind, from_time):
    """Whole or in two parts, the same files hold the same times, and the same states."""
    whole, writer = going(tmp_path, 4, "whole", format=kind)
    whole.finish(writer)
    first, writer = going(tmp_path, 3, format=kind)
    first.finish(writer, "interrupted", message="interrupted", tried=lambda: fields(first.space, 0.9))
    second = made_up(tmp_path, format=kind)
    state = read_state(second.folder, second.case, from_time)
    writer = second.writer(restart=state, force=from_time is not None)
    second.steps(writer, 4 - state.number, first=state.number + 1)
    second.finish(writer)
    assert times_of(second) == times_of(whole)
    texts = ("history.csv", "contact_joint.csv", "contact_glue_left__é.csv", "results.json")
    assert all((second.folder / name).read_bytes() == (whole.folder / name).read_bytes() for name in texts)
    assert set(inside(second.folder)) == set(inside(whole.folder))


def test_a_restart_elsewhere_leaves_the_first_folder_and_writes_over_nothing(tmp_path):
    run, other = after(tmp_path, 3), after(tmp_path, 1, "other")
    before = inside(run.folder)
    with pytest.raises(RequestError, match="other holds results already"):
        create_output(other.folder, restart=read_state(run.folder, run.case))
    early = read_state(run.folder, run.case, 0.25)
    with pytest.raises(RequestError, match=r"after steps 2, 3\) than t = 0\.25; --force"):
        create_output(run.folder, restart=early)
    other.folder = tmp_path / "third"
    other.steps(other.writer(restart=early), 1, first=2)
    assert times_of(other)["states"] == [0.5] and (other.folder / "state_0002.npz").exists()
    assert inside(run.folder) == before


def test_a_restart_with_other_probes_has_their_columns(tmp_path):
    run = after(tmp_path, 2)
    writer = made_up(tmp_path).writer(restart=read_state(run.folder, run.case))
    step = run.results.steps[-1]
    results = replace(run.results, steps=(replace(step, time=0.75, probes={"B": np.zeros(3)}),))
    writer.step(results, lambda: fields(run.space, 0.75), restart(run.space, 3, 0.75))
    rows = table(run.folder / "history.csv")
    np.testing.assert_array_equal(rows["probe.B.ux"], [np.nan, np.nan, 0.0])
    np.testing.assert_array_equal(rows["probe.PA, top.ux"], [-0.25, -0.5, np.nan])


@pytest.mark.parametrize("name", ["results.json", "history.csv"])
def test_a_damaged_file_stops_a_restart_before_anything_is_lost(tmp_path, name):
    run = after(tmp_path, 2)
    (run.folder / name).write_bytes((run.folder / name).read_bytes()[:-20])
    before = inside(run.folder)
    with pytest.raises(ReadError, match=name):
        run.writer(restart=read_state(run.folder, run.case, 0.25), force=True)
    assert inside(run.folder) == before


# ---- states


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    run = made_up(tmp_path_factory.mktemp("states"))
    run.steps(run.writer(), 3, size=0.1)
    return run


@pytest.mark.parametrize(("from_time", "number"), [(None, 3), (0.2, 2), (0.1 + 1e-12, 1), (0.3, 3)])
def test_the_state_of_a_time_comes_back_as_it_was(kept, from_time, number):
    """That a run goes on from it as if it had not stopped is a law (test_laws.py)."""
    assert 0.1 * 3 != 0.3
    state, was = read_state(kept.folder, kept.case, from_time), restart(kept.space, number, 0.1 * number)
    assert was.folder is None and state.folder == kept.folder
    assert (state.time, state.step_size, state.number) == (was.time, was.step_size, was.number)
    for name in ("multipliers", "status", "rigid"):
        found, expected = getattr(state, name), getattr(was, name)
        assert list(found) == list(expected)
        assert all(np.array_equal(found[key], expected[key]) for key in expected)
    one, other = state.step, was.step
    assert (one.earlier is None) == (number == 1) and list(one.histories.scheme) == ["velocity"]
    pairs = [
        (s.iterate, *(s.earlier or ()), s.histories.materials, s.histories.contact, s.histories.scheme.values())
        for s in (one, other)
    ]
    for mine, expected in zip(*pairs, strict=True):
        assert np.array_equal(mine, expected) if np.isscalar(mine) else all(map(np.array_equal, mine, expected))


def test_a_time_without_a_state_and_a_case_that_changed_are_refused(kept):
    with pytest.raises(RequestError, match=r"at t = 0\.15; there are: 0\.1, 0\.2, 0\.3$") as caught:
        read_state(kept.folder, kept.case, 0.15)
    assert caught.value.status == 2
    changed = {"material": [Material(young=2100.0, poisson=0.3)], "pressure": [Pressure(group="master", value=26.0)]}
    with pytest.raises(Exception, match="another case: material, pressure changed") as caught:
        read_state(kept.folder, replace(kept.case, **changed))
    assert caught.value.status == 1
    same = replace(kept.case, steps=Steps(count=8), solver=Solver(threads=1), output=Output(every=2))
    assert read_state(kept.folder, same).number == 3


def test_a_damaged_state_is_told_and_the_one_before_named(tmp_path):
    run, rng = after(tmp_path, 2), np.random.default_rng(0)
    last = run.folder / "state_0002.npz"
    whole = last.read_bytes()
    for k in range(60):
        at = int(rng.integers(len(whole)))
        last.write_bytes(whole[:at] + (b"" if k % 2 else bytes([whole[at] ^ 1 << k % 8]) + whole[at + 1 :]))
        try:
            state = read_state(run.folder, run.case)
        except ReadError as error:
            assert str(error).startswith(f"{last}: is damaged or no state")
            assert str(error).endswith("--from 0.25")
        else:  # the changed byte is one that nobody reads: a date in the archive's list ...
            assert k % 2 == 0 and np.array_equal(state.u, restart(run.space, 2, 0.5).u) and state.time == 0.5
    assert read_state(run.folder, run.case, 0.25).number == 1
    last.write_bytes(b"")
    (run.folder / "state_0001.npz").unlink()
    with pytest.raises(ReadError, match="no other state"):
        read_state(run.folder, run.case)


class Trap:
    def __reduce__(self):
        return (pytest.fail, ("unpickled",))


def test_a_state_of_another_version_or_of_objects_is_not_read(kept, tmp_path):
    tree = json.loads(np.load(kept.folder / "state_0001.npz")["tree"].tobytes())
    newer, older = (np.frombuffer(json.dumps({**tree, "version": n}).encode(), np.uint8) for n in (99, 3))
    for content, words in (
        ({"tree": newer}, "of a newer lacsolver"),
        ({"tree": older}, "of an older lacsolver, .* run the case again from its start"),
        ({"about": np.zeros(3, np.uint8)}, "of an older lacsolver"),  # as before version 4
        ({"tree": np.array([Trap()])}, "damaged or no state"),
    ):
        np.savez(tmp_path / "state_0001.npz", u=np.zeros(3), **content)
        with pytest.raises(ReadError, match=words):
            read_state(tmp_path, kept.case)


def test_a_folder_of_an_older_version_is_refused(kept, tmp_path):
    older = shutil.copytree(kept.folder, tmp_path / "older")
    (older / "mesh.npz").unlink()
    for asked in (read_results, lambda folder: plot(folder, tmp_path / "a.png")):
        with pytest.raises(ReadError, match=r"older: is of an older lacsolver, .*; run the case again"):
            asked(older)
    with pytest.raises(RequestError, match="holds results already"):
        create_output(older)


# ---- what a run that was killed was writing


def dead():
    """Number of a process that has ended."""
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    return child.pid


def token(pid, host=output._HOST):
    return f"{host}{pid:08x}0123abcd"


def test_hidden_files_of_a_run_that_was_killed_are_ignored_and_cleared(tmp_path):
    run = after(tmp_path, 3)
    mine, theirs = dead(), os.getppid()
    names = (".contact_joint-{}.pvd", ".solid-{}.pvd", ".results-{}.json", "fields/.solid_0004-{}.vtu")
    left = [run.folder / name.format(token(mine)) for name in names]
    kept = [run.folder / name for name in (".notes-0123456789abcdef.csv", ".solid.pvd", "mine.pvd", ".solid-12.pvd")]
    kept += [run.folder / f".solid-{token(theirs)}.pvd", run.folder / f".state_0004-{token(9, '0' * 8)}.npz"]
    for path in (*left, *kept):
        path.write_text("half of it")
    again = made_up(tmp_path)
    writer = again.writer(restart=read_state(run.folder, run.case))
    again.step(writer, 4, 1.0)
    again.finish(writer)
    assert [path for path in left if path.exists()] == []
    assert all(path.read_text() == "half of it" for path in kept)


KILLED = """
import os, signal, sys
from pathlib import Path
from lacmesh.formats.output import replacing
with replacing(Path(sys.argv[1])) as (beside,):
    beside.write_bytes(b"half of it")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_command_left_of_an_output_is_cleared_by_the_next(tmp_path):
    place = tmp_path / "out.msh"
    with suppress(subprocess.CalledProcessError):
        subprocess.run([sys.executable, "-c", KILLED, str(place)], check=True)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(".out-") and left.suffix == ".msh"
    alive, elsewhere = (tmp_path / f".out-{t}.msh" for t in (token(os.getppid()), token(dead(), "0" * 8)))
    other, old = tmp_path / f".outer-{token(dead())}.msh", tmp_path / ".out-0123456789abcdef.msh"
    for path in (alive, elsewhere, other, old):
        path.write_text("")
    output.check_place(place, force=False)
    assert sorted(tmp_path.iterdir()) == sorted((alive, elsewhere, other, old))
