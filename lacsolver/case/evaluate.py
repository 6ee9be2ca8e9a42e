"""Run the program of a formula on arrays, each operation by the function of numpy that has its name.

Everything is a real number: true is 1, false is 0. Every operation on NaN (0/0, the root of -1) gives NaN, comparisons
included, so that undefined values cannot go unnoticed; only `where` may drop them, with the branch that is not taken.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from typing import Any

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.case.formula import Formula


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
    """Return the result of an operation, NaN where an argument is: numpy's pow(nan, 0) is 1, and nan < 1 is false."""
    if operation == "where":
        test, yes, no = arguments
        result, arguments = np.where(np.asarray(test, bool), yes, no), [test]
    elif operation == "power" and type(arguments[1]) is float and arguments[1]:
        return np.asarray(arguments[0]) ** arguments[1]  # fast for plain numbers, of which only 0 hides NaN
    elif " " in operation:  # a < b < c
        pairs = zip(operation.split(), arguments, arguments[1:], strict=False)
        result = reduce(np.logical_and, (getattr(np, name)(a, b) for name, a, b in pairs))
    else:
        function = getattr(np, operation)
        result = function(*arguments) if len(arguments) <= function.nin else reduce(function, arguments)
    if result.dtype != bool and operation not in ("where", "power", "hypot"):
        return result
    undefined = [where for where in map(np.isnan, arguments) if where.any()]
    return np.where(reduce(np.logical_or, undefined), np.nan, result) if undefined else result.astype(float)
