"""Share of the cases of a test in `make test`; `make fuzz`, which sets LACMESH_FUZZ, or `make verify` takes all."""

from __future__ import annotations

import os
from collections import Counter

import pytest

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


def each_option(cases, of=enumerate):
    """Make parameters of cases, tuples of options: a few that together have every option, and the others marked slow.

    `of`: a function of a case that gives its options, where they are not what stands at each place. The next case is
    always that with most options that none has yet; of several, that whose options are rarest so far.
    """
    every = list(cases)
    options = [[str(option) for option in of(case)] for case in every]
    uses, quick = Counter(), set()

    def worth(k):
        return sum(not uses[option] for option in options[k]), -sum(uses[option] for option in options[k])

    while (best := max(range(len(every)), key=worth)) not in quick and worth(best)[0]:
        quick.add(best)
        uses.update(options[best])
    return [pytest.param(*case, marks=[pytest.mark.slow] * (k not in quick)) for k, case in enumerate(every)]
