"""Processes that end together: one message, its status, and no process that waits for ever."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from textwrap import indent

import pytest

from tests.lacsolver.distributed.mpi import environment, in_ranks, own_lines, words

pytestmark = pytest.mark.petsc

#: a program whose ranks run BODY together; an error is printed as the command does, its status ends the program
PROGRAM = """
import os, signal, sys, time
from lacsolver.distributed.launch import import_mpi
from lacsolver.distributed.together import StoppedError, on_first, together
from lacmesh.errors import DataError
from lacsolver.linear import LinearError
MPI = import_mpi()
comm = MPI.COMM_WORLD
def stop(*_): raise KeyboardInterrupt
signal.signal(signal.SIGTERM, stop)
class Terminal:
    heard = []
    def describe(self, error): return [f"{type(error).__name__} {error}"], getattr(error, "status", 130)
    def say(self, lines): [print("lacsolver: error:", line, file=sys.stderr, flush=True) for line in lines]
    def warn(self, message): print("lacsolver: warning:", message, file=sys.stderr, flush=True)
terminal = Terminal()
try:
    with together(comm, terminal, patience=1.0):
BODY
except StoppedError as error:
    sys.exit(error.status)
"""


def program(body):
    """The program with a block."""
    return PROGRAM.replace("BODY", indent(body, " " * 8))


def run(n, body):
    """Run a block on n ranks: status of mpiexec, the lines that the program printed, the seconds it took."""
    begun = time.monotonic()
    done = in_ranks(n, program(body))
    return done.returncode, own_lines(done.stderr), time.monotonic() - begun


def test_ranks_that_end_well_and_their_warnings():
    """A warning of rank 0 is printed when it comes; one that only others have is printed at the end, once."""
    body = 'print(comm.allreduce(1))\nterminal.heard += ["all have it"] + ["flat cells"] * (comm.rank > 0)'
    assert run(3, body)[:2] == (0, ["lacsolver: warning: rank 1: flat cells"])


def test_an_error_of_all_ranks_is_reported_once():
    assert run(2, 'raise LinearError("no solution")')[:2] == (4, ["lacsolver: error: LinearError no solution"])


def test_an_error_of_one_rank_stops_those_that_end_well():
    status, said, _ = run(2, 'if comm.rank: raise DataError("a bad cell")')
    assert (status, said) == (1, ["lacsolver: error: rank 1: DataError a bad cell"])


def test_of_several_failed_ranks_the_lowest_ends_those_that_wait_for_them():
    """Rank 0 is in a reduction that the others never enter, as in PETSc."""
    status, said, seconds = run(3, 'if comm.rank: raise LinearError(f"pivot {comm.rank}")\ncomm.allreduce(1)')
    assert (status, said) == (4, ["lacsolver: error: rank 1: LinearError pivot 1"])
    assert seconds < 30


def test_what_rank_0_does_alone_is_known_to_all():
    body = """\
assert on_first(comm, lambda: comm.rank + 7) == 7
def fail(): raise LinearError("full")
on_first(comm, fail)
comm.allreduce(1)"""
    assert run(2, body)[:2] == (4, ["lacsolver: error: LinearError full"])


def test_a_signal_while_a_rank_waits_for_the_others_ends_the_run():
    body = """\
if comm.rank:
    comm.send(os.getpid(), 0)
else:
    waiting = comm.recv()
    time.sleep(0.5)
    os.kill(waiting, signal.SIGTERM)
    time.sleep(50)"""
    status, said, seconds = run(2, body)
    assert (status, said) == (130, ["lacsolver: error: rank 1: KeyboardInterrupt "])
    assert seconds < 30


def test_a_killed_rank_ends_the_run():
    """The kernel kills a rank for want of memory, and mpiexec ends the others."""
    body = "if comm.rank:\n    print(os.getpid(), flush=True)\n    time.sleep(50)\ncomm.allreduce(1)"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words(2, program(body)), env=environment(), text=True, **pipes) as started:
        os.kill(int(started.stdout.readline()), signal.SIGKILL)
        started.communicate(timeout=30)
    assert started.returncode != 0
