"""Share of the cases of a test in `make test`; `make fuzz`, which sets LACMESH_FUZZ, takes all."""

from __future__ import annotations

import os

FUZZ = os.environ.get("LACMESH_FUZZ") == "1"


def samples(few, all_of_them):
    """Choose between two numbers of cases; a test that calls this is marked `fuzz`, by which `make fuzz` finds it."""
    return all_of_them if FUZZ else few


def one_in(n, cases):
    """List every n-th case, or all cases; a test that calls this is marked `fuzz`."""
    every = list(cases)
    return every if FUZZ else every[::n]


def one_of_each(cases, key):
    """List the first case of every key, or all cases; a test that calls this is marked `fuzz`."""
    every, firsts = list(cases), {}
    for case in every:
        firsts.setdefault(key(case), case)
    return every if FUZZ else list(firsts.values())
