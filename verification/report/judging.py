"""Verdicts on results: met, missed or informative; distance to the bound; comparison with published values."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from verification.pages.blocks import Verdict
from verification.records import Published, Result
from verification.running.folder import CaseResult

#: what stands for a verdict in words
SAID: dict[Verdict, str] = {
    "met": "met",
    "missed": "missed",
    "informative": "for information",
    "none": "no outcome",
    "": "",
}


@dataclass(frozen=True)
class Count:
    """Numbers of results met, missed and informative, of `cases`, and of cases without an outcome (`failed`)."""

    met: int = 0
    missed: int = 0
    informative: int = 0
    cases: int = 0
    failed: int = 0

    @property
    def judged(self) -> int:
        """Results that are held against something."""
        return self.met + self.missed

    @property
    def verdict(self) -> Verdict:
        """Common verdict on all cases and results."""
        return "none" if self.failed else "missed" if self.missed else "met" if self.met else "informative"


def verdict(result: Result) -> Verdict:
    """Verdict on one result."""
    return "missed" if not result.passed else "informative" if result.bound == "informative" else "met"


def counted(done: Iterable[CaseResult]) -> Count:
    """The results of some cases."""
    cases = tuple(done)
    verdicts = [verdict(result) for case in cases for result in case.results]
    failed = sum(bool(case.failure) for case in cases)
    return Count(verdicts.count("met"), verdicts.count("missed"), verdicts.count("informative"), len(cases), failed)


def used(result: Result) -> float:
    """The share of what is allowed that a result uses up: 1 at its bound, above where it is missed; NaN is infinite.

    >>> from verification.records import at_least, at_most, equal
    >>> used(at_most("a", 1.0, 4.0, source="")), used(equal("b", 3.5, 3.0, 1.0, source="", reason=""))
    (0.25, 0.5)
    >>> used(at_least("rate", 3.0, 1.5, source=""))
    0.5
    """
    if result.expected is None:
        return math.nan
    off = abs(result.value - result.expected)
    parts = {
        "equal": (off, result.tolerance or 0.0),
        "at most": (result.value, result.expected),
        "at least": (result.expected, result.value),
    }
    share = _share(*parts[result.bound]) if result.bound in parts else math.nan
    return math.inf if math.isnan(share) and result.bound in parts else share


def _share(part: float, whole: float) -> float:
    if math.isnan(part) or math.isnan(whole):
        return math.inf
    if whole == 0:
        return 0.0 if part == 0 else math.inf
    return part / whole


def as_good(result: Result, published: Published) -> bool | None:
    """True if a result is at least as good as the published one; None if it is informative.

    For a rate or a lower bound the larger value is better; for an upper bound the smaller; for an equality the
    one that is nearer to the expected value.
    """
    if result.bound == "informative" or result.expected is None or not math.isfinite(result.value):
        return None
    if result.bound == "equal":
        return abs(result.value - result.expected) <= abs(published.value - result.expected)
    return result.value >= published.value if result.bound == "at least" else result.value <= published.value
