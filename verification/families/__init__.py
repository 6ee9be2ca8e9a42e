"""The families of cases, in the order of the report; one module each, loaded when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

from verification.records import SUITES, Case, Family

#: name of a family -> the module that has its `FAMILY`
MODULES = {
    "cut": "cut",
    "patch": "patch",
    "balance": "balance",
    "hertz": "hertz",
    "hertz-engineering": "hertz_engineering",
    "press-fit": "press_fit",
    "curved": "curved",
    "moved-fits": "moved_fits",
    "manufactured": "manufactured",
    "inf-sup": "inf_sup",
    "friction": "friction",
    "joints": "joints",
    "sliding": "sliding",
    "punches": "punches",
    "peeling": "peeling",
    "impact": "impact",
    "scaling": "scaling",
    "distributed": "distributed",
}


def family(name: str) -> Family:
    """A family by its name. Raises KeyError."""
    module_family: Family = import_module(f"verification.families.{MODULES[name]}").FAMILY
    return module_family


def cases(suite: str = SUITES[-1], names: tuple[str, ...] = tuple(MODULES)) -> Iterator[Case]:
    """The cases of some families that are in a suite."""
    for name in names:
        yield from (case for case in family(name).cases if levels_in(case, suite))


def levels_in(case: Case, suite: str) -> int:
    """Number of levels of a case in a suite; 0 if the suite does not contain it.

    >>> from functools import partial
    >>> levels_in(Case("patch", "a", "", partial(print), {"quick": 1, "all": 4}), "full")
    1
    """
    before = SUITES[: SUITES.index(suite) + 1]
    return next((case.levels[name] for name in reversed(before) if name in case.levels), 0)
