"""Output of a run: when it is written, into which folder, and the fate of results that are already there."""

from __future__ import annotations

import csv
import itertools
import json
import os
import signal
from dataclasses import replace

import numpy as np
import pytest

from lacmesh.errors import ReadError, RequestError, WriteError
from lacmesh.formats.vtu.collection import read_pvd
from lacsolver.case import read_case
from lacsolver.output import create_output, read_state
from lacsolver.output import writer as writers
from lacsolver.output.lock import FILE
from lacsolver.results.results import Restart
from tests.lacsolver.test_output_med import room
from tests.lacsolver.written import fields, made_up, restart
from tests.samples import each_option

FORMATS = ("vtu", "med")


def times_of(run, folder=None):
    """The times in every file of a folder: history, contact tables, fields, states, results."""
    folder = folder or run.folder
    told = {}
    for path in (folder / "history.csv", *folder.glob("contact_*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            told[path.name] = list(dict.fromkeys(float(row["time"]) for row in csv.DictReader(file)))
    for path in folder.glob("*.pvd"):
        told[path.name] = list(read_pvd(path))
    if (folder / "results.med").exists():
        import h5py

        with h5py.File(folder / "results.med") as file:
            told["results.med"] = sorted(float(step.attrs["PDT"]) for step in file["CHA/DEPL"].values())
    states = sorted(folder.glob("state_0*.npz"))
    told["states"] = [json.loads(np.load(path)["about"].tobytes())["time"] for path in states]
    told["results.json"] = [step["time"] for step in json.loads((folder / "results.json").read_text())["steps"]]
    return told


def figures_of(told):
    return {name: times for name, times in told.items() if name in ("history.csv", "results.json")}


def fields_of(told):
    return {name: times for name, times in told.items() if name not in ("history.csv", "results.json", "states")}


def inside(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


# ---- when


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(
    ("output", "due", "in_the_end", "states"),
    [
        ("", [1, 1, 1, 1, 1], [0.25, 0.5, 0.75, 1.0, 1.25], None),
        ("every = 2", [0, 1, 0, 1, 0], [0.5, 1.0, 1.25], None),
        ("times = [0.25, 1]", [1, 0, 0, 1, 0], [0.25, 1.0], [0.25, 1.0, 1.25]),
    ],
)
def test_fields_are_written_as_the_case_says(tmp_path, kind, output, due, in_the_end, states):
    run = made_up(tmp_path, output=f'[output]\nformat = "{kind}"\n{output}')
    writer = run.writer()
    assert run.steps(writer, 5) == [bool(k) for k in due]
    assert run.calls == sum(due)
    run.finish(writer)
    told = times_of(run)
    every = [0.25, 0.5, 0.75, 1.0, 1.25]
    assert all(times == every for times in figures_of(told).values())
    assert fields_of(told) and all(times == in_the_end for times in fields_of(told).values()), told
    assert told["states"] == (states or in_the_end)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("status", ["failed", "interrupted"])
def test_a_run_that_is_not_done_leaves_its_last_converged_step(tmp_path, kind, status):
    run = made_up(tmp_path, output=f'[output]\nformat = "{kind}"\ntimes = [1.0]')
    writer = run.writer()
    run.steps(writer, 3)
    run.finish(writer, status, message="no convergence at t = 0.8")
    told = times_of(run)
    assert all(times == [0.75] for times in fields_of(told).values()) and told["states"] == [0.75]
    assert json.loads((run.folder / "results.json").read_text())["message"] == "no convergence at t = 0.8"


@pytest.mark.parametrize("kind", FORMATS)
def test_the_last_state_tried_goes_to_a_folder_of_its_own(tmp_path, kind):
    run = made_up(tmp_path, output=f'[output]\nformat = "{kind}"')
    writer = run.writer()
    run.steps(writer, 2)
    run.finish(writer, "failed", message="no", tried=lambda: fields(run.space, 0.625))
    assert times_of(run)["states"] == [0.25, 0.5]
    tried = run.folder / "unconverged"
    if kind == "vtu":
        assert list(read_pvd(tried / "solid.pvd")) == [0.625]
    else:
        assert (tried / "results.med").stat().st_size > 0
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
    writer = run.writer()
    add = writers.add_contact

    def interrupted(*given):
        os.kill(os.getpid(), signal.SIGINT)
        add(*given)

    monkeypatch.setattr(writers, "add_contact", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.step(writer, 1, 0.25)
    monkeypatch.undo()
    run.finish(writer, "interrupted", message="interrupted")
    assert all(times == [0.25] for times in times_of(run).values())


def test_an_interrupt_while_fields_are_made_leaves_them_to_the_end(tmp_path):
    run = made_up(tmp_path)
    writer = run.writer()
    run.step(writer, 1, 0.25)
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
    assert all(times == [0.25, 0.5] for times in times_of(run).values())


# ---- where


def test_nothing_is_there_before_the_writer_begins(tmp_path):
    create_output(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_results_are_not_written_over_without_force(tmp_path):
    run = made_up(tmp_path)
    run.steps(run.writer(), 1)
    before = inside(run.folder)
    with pytest.raises(RequestError, match=r"out holds results already; --force replaces them"):
        create_output(run.folder)
    create_output(run.folder, force=True)
    assert inside(run.folder) == before  # until the writer begins


def test_force_replaces_results_and_nothing_else(tmp_path):
    old = made_up(tmp_path)
    old.steps(old.writer(), 3)
    mine = ("notes.txt", "fields/mine.vtu", "state_of_art.npz", "contact.csv", "solid_0001.vtu")
    for name in mine:
        (old.folder / name).write_text("mine")
    run = made_up(tmp_path, output='[output]\nformat = "med"')
    writer = run.writer(force=True)
    assert set(inside(run.folder)) == {*mine, FILE}
    run.steps(writer, 1)
    assert all(times == [0.25] for times in times_of(run).values())


def test_a_folder_with_other_things_in_it_is_taken(tmp_path):
    run = made_up(tmp_path)
    run.folder.mkdir()
    (run.folder / "notes.txt").write_text("mine")
    run.steps(run.writer(), 1)
    assert (run.folder / "notes.txt").read_text() == "mine"


def test_a_name_that_no_folder_can_have_is_refused(tmp_path):
    with pytest.raises(WriteError, match="cannot be used"):
        create_output(tmp_path / ("x" * 300))


@pytest.mark.parametrize("kind", FORMATS)
def test_a_disk_that_is_full_is_told_in_a_sentence_and_what_was_whole_stays(tmp_path, kind):
    run = made_up(tmp_path, output=f'[output]\nformat = "{kind}"')
    writer = run.writer()
    run.step(writer, 1, 0.25)
    with room(2500), pytest.raises(WriteError, match=r"cannot be written \(File too large\)"):
        run.step(writer, 2, 0.5)
    told = times_of(run)
    assert all(times == [0.25] for times in fields_of(told).values()) and told["states"] == [0.25]
    assert [p.name for p in run.folder.rglob(".*") if p.is_file()] == [FILE]
    run.finish(writer, "failed", message="the disk is full")
    assert not [p for p in run.folder.rglob(".*") if p.is_file()]
    assert json.loads((run.folder / "results.json").read_text())["status"] == "failed"


# ---- restart


@pytest.mark.parametrize(("kind", "from_time"), each_option(itertools.product(FORMATS, (None, 0.5))))
def test_a_restart_goes_on_in_its_own_folder(tmp_path, kind, from_time):
    """Whole or in two parts, the same files hold the same times, and the same states."""
    force = from_time is not None
    whole = made_up(tmp_path, output=f'[output]\nformat = "{kind}"')
    whole.folder = tmp_path / "whole"
    writer = whole.writer()
    whole.steps(writer, 4)
    whole.finish(writer)

    first = made_up(tmp_path, output=f'[output]\nformat = "{kind}"')
    writer = first.writer()
    first.steps(writer, 3)
    first.finish(writer, "interrupted", message="interrupted", tried=lambda: fields(first.space, 0.9))
    second = made_up(tmp_path, output=f'[output]\nformat = "{kind}"')
    state = read_state(second.folder, second.case, from_time)
    writer = second.writer(restart=state, force=force)
    second.steps(writer, 4 - state.number, first=state.number + 1)
    second.finish(writer)

    assert times_of(second) == times_of(whole)
    texts = ("history.csv", "contact_joint.csv", "contact_glue_left__é.csv", "results.json")
    assert all((second.folder / name).read_bytes() == (whole.folder / name).read_bytes() for name in texts)
    assert {p for p in inside(second.folder)} == {p for p in inside(whole.folder)}


def test_a_restart_elsewhere_leaves_the_first_folder_and_numbers_on(tmp_path):
    run = made_up(tmp_path)
    run.steps(run.writer(), 2)
    before = inside(run.folder)
    again = made_up(tmp_path)
    state = read_state(run.folder, again.case, 0.25)
    again.folder = tmp_path / "other"
    again.steps(again.writer(restart=state), 1, first=2)
    assert inside(run.folder) == before
    assert all(times == [0.5] for times in times_of(again).values())
    assert (again.folder / "state_0002.npz").exists()


def test_a_restart_elsewhere_does_not_write_over_results(tmp_path):
    run = made_up(tmp_path)
    run.steps(run.writer(), 2)
    other = made_up(tmp_path)
    other.folder = tmp_path / "other"
    other.steps(other.writer(), 1)
    with pytest.raises(RequestError, match="other holds results already"):
        create_output(other.folder, restart=read_state(run.folder, run.case))


def test_later_states_are_not_lost_without_force(tmp_path):
    run = made_up(tmp_path)
    run.steps(run.writer(), 3)
    state = read_state(run.folder, run.case, 0.25)
    before = inside(run.folder)
    with pytest.raises(RequestError, match=r"later states \(after steps 2, 3\) than t = 0.25; --force"):
        create_output(run.folder, restart=state)
    assert inside(run.folder) == before


def test_a_restart_with_other_probes_has_their_columns(tmp_path):
    run = made_up(tmp_path)
    run.steps(run.writer(), 2)
    again = made_up(tmp_path)
    writer = again.writer(restart=read_state(run.folder, run.case))
    step = run.results.steps[-1]
    results = replace(run.results, steps=(replace(step, time=0.75, probes={"B": np.zeros(3)}),))
    writer.step(results, lambda: fields(run.space, 0.75), restart(run.space, 3, 0.75))
    with (run.folder / "history.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["probe.B.ux"] for row in rows] == ["", "", "0.0"]
    assert [row["probe.PA, top.ux"] for row in rows] == ["-0.25", "-0.5", ""]


@pytest.mark.parametrize("name", ["results.json", "history.csv"])
def test_a_damaged_file_stops_a_restart_before_anything_is_lost(tmp_path, name):
    run = made_up(tmp_path)
    run.steps(run.writer(), 2)
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
def test_a_state_comes_back_as_it_was(kept, from_time, number):
    assert 0.1 * 3 != 0.3
    state = read_state(kept.folder, kept.case, from_time)
    was = restart(kept.space, number, 0.1 * number)
    assert (state.time, state.step_size, state.number) == (was.time, was.step_size, was.number)
    assert np.array_equal(state.u, was.u) and state.u.dtype == np.float64
    for name in ("multipliers", "status", "rigid"):
        found, expected = getattr(state, name), getattr(was, name)
        assert list(found) == list(expected)
        assert all(np.array_equal(found[key], expected[key]) for key in expected)
    assert all(map(np.array_equal, state.step.iterate, was.step.iterate))
    assert (state.step.earlier is None) == (number == 1)
    one, other = state.step.histories, was.step.histories
    assert list(one.scheme) == ["velocity"]
    arrays = [(*h.materials, *h.contact, *h.scheme.values()) for h in (one, other)]
    assert len(arrays[0]) == 3 and all(map(np.array_equal, *arrays))
    if was.step.earlier is not None:
        assert state.step.earlier[0] == was.step.earlier[0] and all(
            map(np.array_equal, state.step.earlier[1], was.step.earlier[1])
        )
    joint, glue = state.multipliers.values()
    assert joint.ndim == 1 and glue.shape == (len(joint), 3)  # pressures, tractions of the tie


def test_a_time_without_a_state_is_an_error_that_lists_them(kept):
    with pytest.raises(RequestError, match=r"no state at t = 0.15; there are: 0.1, 0.2, 0.3$") as caught:
        read_state(kept.folder, kept.case, 0.15)
    assert caught.value.status == 2


def test_a_case_that_changed_is_refused_and_the_parts_named(kept, tmp_path):
    text = (kept.folder.parent / "case.toml").read_text()
    other = kept.folder.parent / "other.toml"
    other.write_text(text.replace("2000.0", "2100.0").replace("value = 25.0", "value = 26.0"))
    with pytest.raises(Exception, match="another case: material, pressure changed") as caught:
        read_state(kept.folder, read_case(other))
    assert caught.value.status == 1
    other.write_text(text.replace("count = 4", "count = 8") + "[solver]\nthreads = 1\n[output]\nevery = 2\n")
    assert read_state(kept.folder, read_case(other)).number == 3


def test_a_damaged_state_is_told_and_the_one_before_named(tmp_path):
    run = made_up(tmp_path)
    run.steps(run.writer(), 2)
    last = run.folder / "state_0002.npz"
    whole = last.read_bytes()
    rng = np.random.default_rng(0)
    for k in range(60):
        wrong = bytearray(whole)
        if k % 2:
            del wrong[int(rng.integers(len(whole))) :]
        else:
            at = int(rng.integers(len(whole)))
            wrong[at] ^= 1 << int(rng.integers(8))
        last.write_bytes(bytes(wrong))
        try:
            state = read_state(run.folder, run.case)
        except ReadError as error:
            assert str(error).startswith(f"{last}: is damaged or no state")
            assert str(error).endswith("--from 0.25")
        else:  # what was changed is not read: a date in the archive's list ...
            assert k % 2 == 0 and np.array_equal(state.u, restart(run.space, 2, 0.5).u) and state.time == 0.5
    last.write_bytes(b"")
    with pytest.raises(ReadError, match=r"go on from an earlier time, --from 0\.25"):
        read_state(run.folder, run.case)
    assert read_state(run.folder, run.case, 0.25).number == 1
    (run.folder / "state_0001.npz").unlink()
    with pytest.raises(ReadError, match="no other state is in"):
        read_state(run.folder, run.case)


def test_a_state_of_a_newer_version_is_told(kept, tmp_path):
    about = json.loads(np.load(kept.folder / "state_0001.npz")["about"].tobytes())
    content = np.frombuffer(json.dumps({**about, "version": 99}).encode(), np.uint8)
    np.savez(tmp_path / "state_0001.npz", about=content, u=np.zeros(3))
    with pytest.raises(ReadError, match="of a newer lacsolver"):
        read_state(tmp_path, kept.case)


def test_a_state_of_objects_is_not_unpickled(kept, tmp_path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("unpickled",))

    np.savez(tmp_path / "state_0001.npz", about=np.array([Trap()]), u=np.zeros(3))
    with pytest.raises(ReadError, match="damaged or no state"):
        read_state(tmp_path, kept.case)


def test_a_restart_is_a_states_own(kept):
    state = restart(kept.space, 1, 0.5)
    assert isinstance(state, Restart) and state.folder is None
    assert read_state(kept.folder, kept.case).folder == kept.folder
