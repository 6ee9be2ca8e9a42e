"""Run the program of a formula on arrays.

Everything is a real number: true is 1, false is 0. Every operation on NaN (0/0, the root of -1) gives NaN, comparisons
included, so that undefined values cannot go unnoticed; only `where` may drop them, with the branch that is not taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.case.formula import FUNCTIONS, OPERATORS, Formula


def evaluate(formula: Formula, variables: Mapping[str, Any]) -> Floats:
    """Return the value of a formula, not finite where it is undefined.

    `variables`: x, y, z, t as floats or arrays of one shape.
    """
    stack: list[Any] = []
    with np.errstate(all="ignore"):
        for step in formula.program:
            if step.operation == "number":
                stack.append(step.number)
            elif step.operation in variables:
                stack.append(np.asarray(variables[step.operation], dtype=float))
            else:
                first = len(stack) - step.takes
                stack[first:] = [_apply(step.operation, stack[first:])]
    (result,) = stack
    return np.asarray(result, dtype=float)


def _apply(operation: str, arguments: list[Any]) -> Any:
    if operation in _OPERATIONS:
        return _OPERATIONS[operation](*arguments)
    pairs = zip(operation.split(), arguments, arguments[1:], strict=False)
    return reduce(_OPERATIONS["and"], (_OPERATIONS[word](a, b) for word, a, b in pairs))


def _strict(operation: Callable[..., Any]) -> Callable[..., Any]:
    """Return the operation with NaN wherever an argument is NaN: numpy's own pow(nan, 0) is 1, and nan < 1 is false."""

    def apply(*arguments: Any) -> Any:
        result = operation(*arguments)
        undefined = [where for where in map(np.isnan, arguments) if where.any()]
        return np.where(reduce(np.logical_or, undefined), np.nan, result) if undefined else result.astype(float)

    return apply


def _where(test: Any, yes: Any, no: Any) -> Any:
    chosen = np.where(np.asarray(test, bool), yes, no)
    undefined = np.isnan(test)
    return np.where(undefined, np.nan, chosen) if undefined.any() else chosen


def _power(a: Any, b: Any) -> Any:
    """Return a to the power b; numpy is fast for plain-number exponents, of which only 0 needs the strict operation."""
    return np.asarray(a) ** b if type(b) is float and b else _strict(np.power)(a, b)


_OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "//": np.floor_divide,
    "neg": np.negative,
    "pos": np.positive,
    "<": _strict(np.less),
    "<=": _strict(np.less_equal),
    ">": _strict(np.greater),
    ">=": _strict(np.greater_equal),
    "==": _strict(np.equal),
    "!=": _strict(np.not_equal),
    "and": _strict(np.logical_and),
    "or": _strict(np.logical_or),
    "not": _strict(np.logical_not),
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "min": lambda *a: reduce(np.minimum, a),
    "max": lambda *a: reduce(np.maximum, a),
    "pow": _power,
    "mod": np.mod,
    "hypot": _strict(np.hypot),
    "floor": np.floor,
    "ceil": np.ceil,
    "sign": np.sign,
    "heaviside": _strict(lambda a: np.greater_equal(a, 0)),
    "where": _where,
}
assert set(_OPERATIONS) == {*FUNCTIONS, *OPERATORS}
