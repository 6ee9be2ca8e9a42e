"""What pytest does with the cases: it makes a test of each, with the suites as its marks."""

from __future__ import annotations

import os
from typing import Any

import pytest

from verification.families import cases, family, levels_in
from verification.records import SUITES


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks; a process of `python -m verification run` leads its children, and keeps to its cores."""
    for suite in SUITES:
        config.addinivalue_line("markers", f"{suite}: cases of the verification's suite {suite}")
    if own := _plan_of(config):
        os.chdir(config.rootpath)
        os.setsid()
        if own["cores"] and hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, own["cores"])


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test of each case: of the plan of a run, or of all suites."""
    if "levels" not in metafunc.fixturenames:
        return
    own = _plan_of(metafunc.config)
    if own:
        known = {name: {case.name: case for case in family(name).cases} for name in {f for f, *_ in own["cases"]}}
        rows = [pytest.param(known[f][name], levels, id=f"{f}/{name}") for f, name, levels in own["cases"]]
    else:
        rows = [
            pytest.param(case, levels_in(case, suite), id=f"{suite}-{case.id}", marks=getattr(pytest.mark, suite))
            for suite in SUITES
            for case in cases(suite)
        ]
    metafunc.parametrize(("case", "levels"), rows)


@pytest.fixture
def patience(request: pytest.FixtureRequest) -> float:
    """Seconds after which a case is given up: an hour where a run does not say."""
    return float((_plan_of(request.config) or {}).get("patience", 3600))


def _plan_of(config: pytest.Config) -> dict[str, Any] | None:
    """What `verification.running` has sent to this process: cases, cores and patience."""
    return getattr(config, "workerinput", {}).get("verification")
