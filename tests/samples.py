"""Share of the cases of a test in `make test`: a few random tries of many, and a few of a product's options.

`samples` is a number of random tries; `make verify FUZZ=1`, which sets LACMESH_FUZZ, makes them all. `each_option`
thins a list of cases; `make verify`, which runs what is marked slow, tries the others.
"""

import os
from collections import Counter

import pytest

FUZZ = os.environ.get("LACMESH_FUZZ") == "1"


def samples(few, many):
    """Choose between two numbers of tries; a test that calls this is marked `fuzz`: `make verify FUZZ=1` runs it."""
    return many if FUZZ else few


def each_option(cases, of=enumerate):
    """Make parameters of cases, tuples of options: a few that together have every option, and the others marked slow.

    `of`: a function of a case that gives its options, where they are not what stands at each place. The next case is
    always that with most options that none has yet; of several, that whose options are rarest so far.
    """
    every = list(cases)
    options = [tuple(str(option) for option in of(case)) for case in every]
    left = [options.index(own) for own in dict.fromkeys(options)]  # of cases with the same options the first
    uses, quick = Counter(), set()

    def worth(k):
        return sum(not uses[option] for option in options[k]), -sum(uses[option] for option in options[k])

    while left:
        quick.add(best := max(left, key=worth))
        uses.update(options[best])
        left = [k for k in left if worth(k)[0]]
    return [pytest.param(*case, marks=[pytest.mark.slow] * (k not in quick)) for k, case in enumerate(every)]
