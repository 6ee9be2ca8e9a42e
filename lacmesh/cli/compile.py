"""`lacmesh compile`: compile all kernels, once after installing."""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
import time
from typing import Any

from lacmesh.cli.options import add_command
from lacmesh.cli.program import SELDOM

#: processes at most; each takes some 300 MB
_MOST = 4


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "compile", run, "compile all kernels once, for all later commands")
    parser.epilog = (
        "Nothing has to be compiled: small work runs without, and larger work compiles what it needs, once.\n"
        "This does it beforehand, for lacmesh and lacsolver. Where it is kept: beside the package, or where that\n"
        "cannot be written, in the user's cache folder; NUMBA_CACHE_DIR names another."
    )


def run(args: argparse.Namespace) -> None:
    """Compile all kernels, and print the progress."""
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    from lacmesh.compiled_kernels import compile_listed, listed
    from lacmesh.errors import WriteError
    from lacmesh.kernels import cache_folder, writable

    start, names, folder = time.perf_counter(), list(listed()), cache_folder()
    if not writable(folder):
        raise WriteError(folder, "cannot be written; name another folder by NUMBA_CACHE_DIR")
    workers = min(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1, _MOST)
    with ProcessPoolExecutor(workers, get_context("spawn"), _start) as pool:
        under_way = [pool.submit(compile_listed, name) for name in names]
        try:
            for count, done in enumerate(as_completed(under_way), 1):
                done.result()
                _tell(args, count, len(names))
        except BaseException:  # interrupted: what is compiled is kept
            pool.shutdown(cancel_futures=True)
            raise
    if not args.quiet:
        print(f"compiled {len(names)} kernels in {time.perf_counter() - start:.0f} s; kept in {folder}")


def _start() -> None:
    """Ignore interrupts in a worker: the terminal sends them to all processes, and the first one ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(SELDOM)  # a tenth of the time


def _tell(args: argparse.Namespace, count: int, total: int) -> None:
    """Print the progress: on one line of a terminal, in a file at every tenth."""
    if args.quiet:
        return
    if sys.stdout.isatty():
        print(f"\rcompiling: {count} of {total}", end="\n" if count == total else "", flush=True)
    elif count * 10 // total > (count - 1) * 10 // total:
        print(f"compiling: {count} of {total}", flush=True)
