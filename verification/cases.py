"""The cases as tests of pytest: `pytest verification/cases.py -m quick -n 2`.

`python -m verification run` starts the same test, and keeps the results (`verification.running`).
"""

from __future__ import annotations

import faulthandler
import time
import traceback
from collections.abc import Callable

import pytest
from pydantic_core import to_json

from verification.families import family
from verification.records import Case, Outcome


def test_case(case: Case, levels: int, patience: float, record_property: Callable[[str, object], None]) -> None:
    """A case has an outcome, and meets every result. A case that takes longer than `patience` ends its process."""
    if missing := family(case.family).missing():
        pytest.skip(missing)
    faulthandler.dump_traceback_later(patience, exit=True, file=2)
    began = time.perf_counter()
    try:
        outcome = _solved(case, levels)
    finally:
        faulthandler.cancel_dump_traceback_later()
    record_property("seconds", time.perf_counter() - began)
    record_property("outcome", as_text(outcome))
    missed = [f"{r.quantity}: {r.value:.6g}, {r.bound} {r.expected}" for r in outcome.results if not r.passed]
    if outcome.failure or missed:
        pytest.fail("; ".join([outcome.failure, *missed]).strip("; "), pytrace=False)


def _solved(case: Case, levels: int) -> Outcome:
    """Solve a case and return its outcome, or the reason why it has none."""
    try:
        outcome = case.solve(levels=levels)
    except (Exception, SystemExit) as error:  # other cases go on, whatever the error
        traceback.print_exc()
        return Outcome(failure=f"{type(error).__name__}: {error}".removesuffix(": "))
    return outcome if outcome.results else Outcome(failure="the case yields no result")


def as_text(record: object) -> str:
    """A record as a line of JSON, with NaN and Infinity as Python reads them; numbers and arrays of numpy are plain."""
    return to_json(record, inf_nan_mode="constants", bytes_mode="base64", fallback=lambda v: v.tolist()).decode()
