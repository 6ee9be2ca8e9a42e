"""One run at a time in a folder, and what a run that was killed leaves there."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

from lacmesh.errors import RequestError
from lacmesh.formats import output
from lacsolver.output import create_output, read_state
from lacsolver.output.lock import FILE, hold
from tests.lacsolver.test_output_writer import times_of
from tests.lacsolver.written import made_up

BUSY = "another run is writing into .*; wait for its end, or name another folder"

HOLDS = """
import sys, time
from pathlib import Path
from lacsolver.output.lock import hold
held = hold(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(600)
"""


def test_a_folder_that_a_run_writes_into_is_refused_to_another(tmp_path):
    run, asked_before = made_up(tmp_path), create_output(tmp_path / "out")
    writer = run.writer()
    run.step(writer, 1, 0.25)
    for force in (False, True):
        with pytest.raises(RequestError, match=BUSY):
            create_output(run.folder, force=force)
    with pytest.raises(RequestError, match=BUSY):
        asked_before.hold()
    run.finish(writer)
    assert all(times == [0.25] for times in times_of(run).values())
    assert not (run.folder / FILE).exists()


def test_results_that_came_since_the_folder_was_asked_for_are_not_lost(tmp_path):
    asked_before, run = create_output(tmp_path / "out"), made_up(tmp_path)
    run.steps(run.writer(), 2)
    with pytest.raises(RequestError, match="holds results already"):
        asked_before.hold()
    state = read_state(run.folder, run.case, 0.25)
    with pytest.raises(RequestError, match="holds later states"):
        create_output(run.folder, restart=state)
    assert not (run.folder / FILE).exists()


def test_a_writer_that_is_gone_holds_nothing(tmp_path):
    run = made_up(tmp_path)
    run.writer()
    assert not (tmp_path / "out" / FILE).exists()


def test_the_lock_of_a_run_that_was_killed_holds_nobody_up(tmp_path):
    with subprocess.Popen([sys.executable, "-c", HOLDS, str(tmp_path)], stdout=subprocess.PIPE, text=True) as child:
        try:
            assert child.stdout.readline() == "held\n"
            with pytest.raises(RequestError, match=BUSY):
                hold(tmp_path)
        finally:
            child.send_signal(signal.SIGKILL)
    assert (tmp_path / FILE).exists()
    hold(tmp_path)()
    assert not (tmp_path / FILE).exists()


def test_a_lock_that_its_holder_has_just_removed_is_taken_anew(tmp_path, monkeypatch):
    """Between opening the file and locking it."""
    opened = os.open

    def removed_meanwhile(path, *flags):
        handle = opened(path, *flags)
        monkeypatch.undo()
        path.unlink()
        return handle

    monkeypatch.setattr(os, "open", removed_meanwhile)
    let_go = hold(tmp_path)
    with pytest.raises(RequestError, match=BUSY):
        hold(tmp_path)
    let_go()


def test_where_the_file_system_has_no_locks_nothing_is_held(tmp_path, monkeypatch):
    def none(*given):
        raise OSError(37, "No locks available")

    monkeypatch.setattr("fcntl.flock", none)
    let_go = hold(tmp_path)
    hold(tmp_path)()
    let_go()


# ---- what a run that was killed was writing


def dead():
    """Number of a process that has ended."""
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    return child.pid


def token(pid, host=output._HOST):
    return f"{host}{pid:08x}0123abcd"


def test_hidden_files_of_a_run_that_was_killed_are_ignored_and_cleared(tmp_path):
    run = made_up(tmp_path)
    run.steps(run.writer(), 3)
    mine, theirs = dead(), os.getppid()
    names = (".contact_joint-{}.pvd", ".solid-{}.pvd", ".results-{}.json", "fields/.solid_0004-{}.vtu")
    left = [run.folder / name.format(token(mine)) for name in names]
    left += [run.folder / ".contact_joint-0123456789abcdef.pvd", run.folder / f".state_0004-{token(9, '0' * 8)}.npz"]
    kept = [run.folder / name for name in (".notes-0123456789abcdef.csv", ".solid.pvd", "mine.pvd", ".solid-12.pvd")]
    kept.append(run.folder / f".solid-{token(theirs)}.pvd")
    for path in (*left, *kept):
        path.write_text("half of it")
    state = read_state(run.folder, run.case)
    again = made_up(tmp_path)
    writer = again.writer(restart=state)
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
