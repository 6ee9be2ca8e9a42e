"""Formulas of x, y, z, t in Python's grammar, restricted to the names and operations listed here.

A formula becomes a program for a stack machine: names and numbers push an array, an operation takes its arguments from
the top of the stack and pushes its result. An operation is a function of numpy, by its name (`evaluate`, which alone
needs numpy). A formula cannot reach Python: it has no attributes, indices, strings or assignments, and no names beyond
the tables below. It is not compiled by Python, whose compiler takes a sum of 900 terms and not of 1,000.
"""

from __future__ import annotations

import ast
import operator
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Any, NamedTuple

from lacmesh.errors import did_you_mean
from lacsolver.case.errors import Mistake

if TYPE_CHECKING:
    from lacmesh.mesh import Floats

VARIABLES = {"x": "place (the radius r where axisymmetric)", "y": "place", "z": "place (3d only)", "t": "time"}
CONSTANTS = {"pi": 3.141592653589793}
#: of each function the least and most arguments (None: no limit), and the meaning of its result
FUNCTIONS: dict[str, tuple[int, int | None, str]] = {
    "sin": (1, 1, "sine; angles are in radians"),
    "cos": (1, 1, "cosine"),
    "tan": (1, 1, "tangent"),
    "asin": (1, 1, "inverse sine"),
    "acos": (1, 1, "inverse cosine"),
    "atan": (1, 1, "inverse tangent"),
    "atan2": (2, 2, "angle of the point (b, a): `atan2(y, x)`"),
    "sinh": (1, 1, "hyperbolic sine"),
    "cosh": (1, 1, "hyperbolic cosine"),
    "tanh": (1, 1, "hyperbolic tangent"),
    "exp": (1, 1, "e to the power a"),
    "log": (1, 1, "natural logarithm"),
    "log10": (1, 1, "logarithm to base 10"),
    "sqrt": (1, 1, "square root"),
    "abs": (1, 1, "size without sign"),
    "min": (2, None, "the least of its arguments"),
    "max": (2, None, "the greatest of its arguments"),
    "pow": (2, 2, "a to the power b; also `a ** b`"),
    "mod": (2, 2, "remainder of a / b, of b's sign; also `a % b`"),
    "hypot": (2, 2, "square root of a² + b²"),
    "floor": (1, 1, "the next whole number below"),
    "ceil": (1, 1, "the next whole number above"),
    "sign": (1, 1, "−1, 0 or 1"),
    "heaviside": (1, 1, "0 below 0, 1 from 0 on"),
    "where": (3, 3, "b where a is true, c elsewhere: `where(x < 0.5, 1, 0)`; also `b if a else c`"),
}
#: names of functions that numpy has by another name
_NUMPY = {
    **{"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"},
    **{"min": "minimum", "max": "maximum", "pow": "power"},
}
#: functions of numpy for operators
OPERATORS: dict[type[ast.AST], str] = {
    **{ast.Add: "add", ast.Sub: "subtract", ast.Mult: "multiply", ast.Div: "divide"},
    **{ast.Pow: "power", ast.Mod: "mod", ast.FloorDiv: "floor_divide"},
    **{ast.USub: "negative", ast.UAdd: "positive", ast.Not: "logical_not"},
    **{ast.And: "logical_and", ast.Or: "logical_or"},
    **{ast.Lt: "less", ast.LtE: "less_equal", ast.Gt: "greater", ast.GtE: "greater_equal"},
    **{ast.Eq: "equal", ast.NotEq: "not_equal"},
}
LONGEST = 100_000


class Step(NamedTuple):
    """One step of a program: push a number or a variable, or apply an operation to the top `takes` items."""

    operation: str
    takes: int = 0
    number: float = 0.0


@dataclass(frozen=True)
class Formula:
    """A parsed formula: its text, and the program that computes it."""

    text: str
    program: tuple[Step, ...]

    @property
    def variables(self) -> frozenset[str]:
        """The variables among x, y, z, t that the formula uses."""
        return frozenset(step.operation for step in self.program) & frozenset(VARIABLES)


def parse_formula(text: str) -> Formula:
    """Read a formula. Raises Mistake.

    >>> sorted(parse_formula("25 * sin(pi * x) if t < 1 else 0").variables)
    ['t', 'x']
    """
    steps: list[Step] = []
    waiting: list[ast.expr | Step] = [_tree(text)]  # without recursion, since a sum of a thousand terms is deep
    while waiting:
        node = waiting.pop()
        if isinstance(node, Step):
            steps.append(node)
        else:
            waiting.extend(reversed(_expand(node)))
    _check_powers(steps)
    return Formula(text, tuple(steps))


def _tree(text: str) -> ast.expr:
    if len(text) > LONGEST:
        raise Mistake(f"is a formula of {len(text)} characters; at most {LONGEST} are allowed")
    if "#" in text:
        raise Mistake("has # in its formula; write comments outside the text")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(" ".join(text.split()), mode="eval").body
    except (RecursionError, MemoryError):
        raise Mistake("is a formula that is nested too deeply; split it with where() or a shorter form") from None
    except (SyntaxError, ValueError) as error:
        said = getattr(error, "msg", None) or str(error)
        raise Mistake(f"is not a formula of x, y, z, t: {_short(text)} ({said})") from None


def _expand(node: ast.expr) -> list[ast.expr | Step]:
    """Return the replacement of one node in postfix order: its arguments, then its own step."""
    match node:
        case ast.Constant(value=value):
            return [_number(value)]
        case ast.Name(id=name):
            return [_name(name)]
        case ast.BinOp(left=a, op=op, right=b) if type(op) in OPERATORS:
            return [a, b, Step(OPERATORS[type(op)], 2)]
        case ast.UnaryOp(op=op, operand=a) if type(op) in OPERATORS:
            return [a, Step(OPERATORS[type(op)], 1)]
        case ast.BoolOp(op=op, values=values):
            return [*values, Step(OPERATORS[type(op)], len(values))]
        case ast.Compare():
            return _comparison(node)
        case ast.IfExp(test=a, body=b, orelse=c):
            return [a, b, c, Step("where", 3)]
        case ast.Call():
            return _call(node)
    raise Mistake(_refusal(node))


def _number(value: object) -> Step:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        shown = _short(repr(value))
        raise Mistake(f"has {shown} in its formula, where only numbers, x, y, z, t and functions are allowed")
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    if number == float("inf"):
        raise Mistake("has a number in its formula that is too large")
    return Step("number", 0, number)


def _check_powers(program: Sequence[Step]) -> None:
    """Raise Mistake for a power of numbers that is too large, as 9**9**9**9."""
    stack: list[float | None] = []  # None: what is no number before the formula is evaluated
    for step in program:
        first = len(stack) - step.takes
        arguments, result = stack[first:], step.number if step.operation == "number" else None
        if step.operation == "power" and None not in arguments:
            try:
                power: Any = operator.pow(*arguments)
            except ZeroDivisionError:
                power = None
            except OverflowError:
                raise Mistake("has a power of numbers in its formula that is too large") from None
            result = power if isinstance(power, float) else None
        stack[first:] = [result]


def _name(name: str) -> Step:
    if name in CONSTANTS:
        return Step("number", 0, CONSTANTS[name])
    if name in VARIABLES:
        return Step(name)
    if name in FUNCTIONS:
        raise Mistake(f"has {name} without its argument: write {name}(...)")
    raise Mistake(f"has the unknown name {_short(name)!r} in its formula{_suggest(name)}")


def _suggest(name: str) -> str:
    near = did_you_mean(name, [*VARIABLES, *CONSTANTS, *FUNCTIONS])
    return near if "did you mean" in near else "; it may use x, y, z, t, pi and functions as sin, sqrt, where"


def _comparison(node: ast.Compare) -> list[ast.expr | Step]:
    """Return the arguments of a comparison and its step: that of `a < b < c` is `less less` on three."""
    if any(type(op) not in OPERATORS for op in node.ops):
        raise Mistake("has an unknown comparison in its formula; use < <= > >= == !=")
    words = " ".join(OPERATORS[type(op)] for op in node.ops)
    return [node.left, *node.comparators, Step(words, len(node.ops) + 1)]


def _call(node: ast.Call) -> list[ast.expr | Step]:
    if not isinstance(node.func, ast.Name):
        raise Mistake(_refusal(node.func))
    name = node.func.id
    if name not in FUNCTIONS:
        known = f"; write * to multiply by {name}" if name in {*VARIABLES, *CONSTANTS} else _suggest(name)
        raise Mistake(f"has the unknown function {_short(name)!r} in its formula{known}")
    least, most, _ = FUNCTIONS[name]
    count = len(node.args)
    if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
        raise Mistake(f"names or unpacks an argument of {name}; write {name}(a, b)")
    if count < least or (most is not None and count > most):
        wanted = str(least) if most == least else f"{least} or more"
        raise Mistake(f"gives {name} {count} arguments in its formula; it takes {wanted}")
    if name == "heaviside":
        return [*node.args, Step("number"), Step("greater_equal", 2)]
    return [*node.args, Step(_NUMPY.get(name, name), count)]


def _refusal(node: ast.AST) -> str:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
        return "has ^ in its formula; write ** for a power"
    if isinstance(node, ast.Call):
        return "calls something without a name in its formula"
    what = {ast.Attribute: "a dot after a name", ast.Subscript: "an index", ast.Tuple: "a comma outside a function"}
    kind = what.get(type(node), f"an operator or word ({type(node).__name__})")
    return f"has {kind} in its formula, where only numbers, x, y, z, t, + - * / ** and functions are allowed"


def _short(text: str, most: int = 60) -> str:
    return text if len(text) <= most else f"{text[: most - 3]}..."


def evaluate(formula: Formula, variables: Mapping[str, Any]) -> Floats:
    """Return the value of a formula, not finite where it is undefined.

    `variables`: x, y, z, t as floats or arrays of one shape. Everything is a real number: true is 1, false is 0. Every
    operation on NaN (0/0, the root of -1) gives NaN, comparisons included, so that undefined values cannot go
    unnoticed; only `where` may drop them, with the branch that is not taken.
    """
    import numpy as np  # reading a case needs none

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
    import numpy as np

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
