"""Numbers as they are read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from verification.records import Result


def number(value: float | None) -> str:
    """Format a number of any size to four digits.

    >>> number(12), number(0.25), number(1.2345e-11), number(1234567.0), number(float("nan"))
    ('12', '0.25', '1.23e-11', '1,234,567', 'none')
    """
    if value is None or math.isnan(value):
        return "none"
    if value == round(value) and abs(value) < 1e9:
        return f"{value:,.0f}"
    return f"{value:.4g}" if 1e-2 <= abs(value) < 1e5 else f"{value:.2e}"


def bound(value: float | None) -> str:
    """Format a bound as it was set.

    >>> bound(1e-10), bound(0.0004), bound(None)
    ('1e-10', '0.0004', '')
    """
    return "" if value is None else f"{value:,.0f}" if value == round(value) and abs(value) < 1e9 else f"{value:.6g}"


def error(value: float) -> str:
    """Format an error to three digits.

    >>> error(0.0012345)
    '1.23e-03'
    """
    return "none" if math.isnan(value) else f"{value:.2e}"


def rate(value: float | None) -> str:
    """Format a rate; empty if there is none.

    >>> rate(1.98765), rate(None)
    ('1.988', '')
    """
    return "" if value is None else "none" if math.isnan(value) else f"{value:.3f}"


def span(values: Sequence[float], form: Callable[[float], str]) -> str:
    """Format a range, from the smallest to the largest value.

    >>> span([2.0, 1.0, math.nan], number), span([], number)
    ('1 to 2', 'none')
    """
    texts = [form(v) for v in sorted(v for v in values if not math.isnan(v))]
    return "none" if not texts else texts[0] if texts[0] == texts[-1] else f"{texts[0]} to {texts[-1]}"


def seconds(value: float) -> str:
    """Format a time.

    >>> [seconds(s) for s in (0.123, 12.34, 90, 754, 4000)]
    ['0.12 s', '12.3 s', '90 s', '13 min', '1 h 07 min']
    """
    if value < 10:
        return f"{value:.2f} s"
    if value < 100:
        return f"{value:.3g} s"
    minutes = round(value / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02} min"


def memory(count: int) -> str:
    """Format a number of bytes.

    >>> memory(213_000_000)
    '213 MB'
    """
    return f"{count / 1e6:,.0f} MB"


def count(many: int, word: str) -> str:
    """Format a count with its noun.

    >>> count(1, "case"), count(1200, "case"), count(2, "family")
    ('1 case', '1,200 cases', '2 families')
    """
    plural = f"{word[:-1]}ies" if word.endswith("y") else f"{word}s"
    return f"{many:,} {word if many == 1 else plural}"


def is_rate(result: Result) -> bool:
    """True if a result is the slope of the errors listed with it."""
    fits = len(result.levels) > 1 and result.bound in ("at least", "informative")
    return fits and result.value != result.levels[-1].error


def value_of(result: Result) -> str:
    """Format the value of a result with as many digits as its tolerance needs."""
    if is_rate(result):
        return rate(result.value)
    return _to_tolerance_digits(result, result.value)


def reason_of(result: Result) -> str:
    """Reason for a result; first, if it missed, the rate between two levels that made it fall short."""
    if result.passed or not is_rate(result) or result.expected is None or not result.value >= result.expected:
        return result.reason
    least = min(level.rate for level in result.levels if level.rate is not None)
    return f"from one level to the next the rate is {rate(least)}, below half of what is wanted; {result.reason}"


def expected_of(result: Result) -> str:
    """Format the expected value of a result."""
    if is_rate(result) and result.expected is not None:
        return rate(result.expected)
    return bound(result.expected) if result.bound != "equal" else _to_tolerance_digits(result, result.expected)


def must_be(result: Result) -> str:
    """Format the requirement on a result: expected value with tolerance or sign of inequality."""
    expected = expected_of(result)
    if result.bound == "equal":
        return f"{expected} ± {bound(result.tolerance)}" if result.tolerance else expected
    if result.bound == "informative":
        return "for information" if result.passed else "a number"
    return f"{'≤' if result.bound == 'at most' else '≥'} {expected}"


def _to_tolerance_digits(result: Result, value: float | None) -> str:
    """Format a value with enough digits to distinguish it from a value out of tolerance."""
    if (
        value is None
        or result.bound != "equal"
        or not result.tolerance
        or not math.isfinite(value)
        or abs(value) >= 1e5
    ):
        return number(value)
    digits = math.ceil(-math.log10(result.tolerance)) + 1
    return f"{value:.{digits}f}" if 0 < digits <= 8 else number(value)
