"""Formulas: what they are worth, what is refused, and that nothing but our own error ever comes of a text."""

from __future__ import annotations

import ast
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lacsolver.case.errors import Mistake
from lacsolver.case.evaluate import evaluate
from lacsolver.case.formula import CONSTANTS, FUNCTIONS, LONGEST, OPERATORS, VARIABLES, parse_formula

PLACE = {"x": 0.3, "y": -1.7, "z": 2.0, "t": 0.25}


def worth(text, **variables):
    return float(evaluate(parse_formula(text), {**PLACE, **variables}))


X, Y, Z, T = PLACE["x"], PLACE["y"], PLACE["z"], PLACE["t"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2", 2.0),
        ("  1 +\n 2 ", 3.0),
        ("x + y - z * t / 2", X + Y - Z * T / 2),
        ("-x ** 2", -(X**2)),
        ("+x", X),
        ("2 ** 3 ** 2", 512.0),
        ("7 // 2", 3.0),
        ("-7 // 2", -4.0),
        ("-7 % 3", 2.0),
        ("mod(7, -3)", -2.0),
        ("pi", math.pi),
        ("1e-3", 0.001),
        ("0x10", 16.0),
        ("sin(x)", math.sin(X)),
        ("cos(x)", math.cos(X)),
        ("tan(x)", math.tan(X)),
        ("asin(x)", math.asin(X)),
        ("acos(x)", math.acos(X)),
        ("atan(x)", math.atan(X)),
        ("atan2(y, x)", math.atan2(Y, X)),
        ("sinh(x)", math.sinh(X)),
        ("cosh(x)", math.cosh(X)),
        ("tanh(x)", math.tanh(X)),
        ("exp(x)", math.exp(X)),
        ("log(z)", math.log(Z)),
        ("log10(z)", math.log10(Z)),
        ("sqrt(z)", math.sqrt(Z)),
        ("abs(y)", abs(Y)),
        ("min(x, y, z)", Y),
        ("max(x, y, z, t)", Z),
        ("pow(z, 3)", 8.0),
        ("hypot(3, 4)", 5.0),
        ("floor(y)", -2.0),
        ("ceil(y)", -1.0),
        ("sign(y)", -1.0),
        ("heaviside(y)", 0.0),
        ("heaviside(0)", 1.0),
        ("where(x < 0.5, z, y)", Z),
        ("where(x > 0.5, z, y)", Y),
        ("z if x < 0.5 else y", Z),
        ("x < y", 0.0),
        ("-(x > y)", -1.0),
        ("x <= 0.3", 1.0),
        ("x >= 0.3", 1.0),
        ("x == 0.3", 1.0),
        ("x != 0.3", 0.0),
        ("0 < x < 1", 1.0),
        ("0 < x < 0.2", 0.0),
        ("1 < x < 2", 0.0),
        ("0 < x < 1 > z", 0.0),
        ("x > 0 and y > 0", 0.0),
        ("x > 0 and z > 0 and t > 0", 1.0),
        ("x < 0 or y < 0", 1.0),
        ("x < 0 or y > 0 or z < 0", 0.0),
        ("not x < 0", 1.0),
        ("where(x > 0, x, 1 / (x - 0.3) )", X),
        ("(1 / x if x > 0 else 0)", 1 / X),
    ],
)
def test_value(text, value):
    assert worth(text) == pytest.approx(value, rel=1e-15, abs=1e-300)


def test_every_function_and_operator_is_computed_and_used_above():
    mark = next(m for m in test_value.pytestmark if m.name == "parametrize")
    texts = [text for text, _ in mark.args[1]]
    used = {step.operation for text in texts for step in parse_formula(text).program}
    assert {*OPERATORS.values(), *VARIABLES} <= used
    assert all(any(f"{name}(" in text for text in texts) for name in FUNCTIONS)
    assert set(CONSTANTS) == {"pi"}


def test_on_arrays():
    x = np.linspace(-1, 1, 7)
    got = evaluate(parse_formula("where(x < 0, sqrt(-x), x ** 2) + y"), {"x": x, "y": 1.0, "z": 0.0, "t": 0.0})
    np.testing.assert_allclose(got, np.where(x < 0, np.sqrt(np.abs(x)), x**2) + 1, rtol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "0 / 0",
        "1 / 0",
        "sqrt(-1)",
        "log(0)",
        "log(-1)",
        "(-8) ** (1 / 3)",
        "asin(2)",
        "exp(1000)",
        "(8 + 1) ** 9 ** 9",
        "mod(1, 0)",
    ],
)
def test_undefined_is_not_finite(text):
    assert not np.isfinite(worth(text))


@pytest.mark.parametrize(
    "text",
    [
        "sqrt(-1) < 1",
        "1 < sqrt(-1) < 2",
        "sqrt(-1) ** 0",
        "1 ** sqrt(-1)",
        "not sqrt(-1)",
        "sqrt(-1) and 0",
        "1 or sqrt(-1)",
        "where(sqrt(-1), 1, 2)",
        "heaviside(sqrt(-1))",
        "max(sqrt(-1), 1)",
        "min(1, sqrt(-1))",
        "sign(sqrt(-1))",
        "hypot(1 / 0, sqrt(-1))",
        "atan2(sqrt(-1), 1)",
    ],
)
def test_undefined_does_not_hide(text):
    """numpy says pow(nan, 0) = 1, nan < 1 = false, hypot(inf, nan) = inf."""
    assert math.isnan(worth(text))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x + w", "unknown name 'w'"),
        ("sine(x)", "did you mean sin"),
        ("Sin(x)", "did you mean sin or"),
        ("sqr(x)", "did you mean sqrt?"),
        ("x(2)", "write * to multiply by x"),
        ("pi(2)", "write * to multiply by pi"),
        ("2 x", "is no formula"),
        ("2x", "is no formula"),
        ("x +", "is no formula"),
        ("", "is no formula"),
        ("(x", "is no formula"),
        ("x = 1", "is no formula"),
        ("x; y", "is no formula"),
        ("\0", "is no formula"),
        ("x ^ 2", "write ** for a power"),
        ("sin", "write sin(...)"),
        ("sin()", "gives sin 0 arguments in its formula; it takes 1"),
        ("atan2(x)", "it takes 2"),
        ("where(x, y)", "it takes 3"),
        ("min(x)", "it takes 2 or more"),
        ("sin(x=1)", "names or unpacks an argument"),
        ("max(*x)", "names or unpacks an argument"),
        ("True", "True"),
        ("None", "None"),
        ("'x'", "'x'"),
        ("1j", "1j"),
        ("1e999", "too large"),
        ("9" * 400, "too large"),
        ("9**9**9**9", "a power of numbers in its formula that is too large"),
        ("x if t < 1 else pow(10, 400)", "a power of numbers"),
        ("1" * (LONGEST + 1), "characters"),
        ("(x, y)", "a comma outside a function"),
        ("[x]", "List"),
        ("{x}", "Set"),
        ("x[0]", "an index"),
        ("x in y", "a comparison"),
        ("x is y", "a comparison"),
        ("x & y", "BinOp"),
        ("x @ y", "BinOp"),
        ("~x", "UnaryOp"),
        ("(x := 1)", "NamedExpr"),
        ("x # the radius", "# in its formula"),
        ("-" * 50_000 + "x", "too deeply nested"),
        ("(" * 5_000 + "x" + ")" * 5_000, "too many nested parentheses"),
        ("x" * 1_000_000, "characters"),
        ("+".join("x" * 40_000), "too deeply nested"),
    ],
)
def test_refused(text, said):
    with pytest.raises(Mistake) as error:
        parse_formula(text)
    assert said in error.value.message
    assert len(error.value.message) < 300


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "().__class__.__bases__[0].__subclasses__()",
        "x.__class__",
        "sin.__globals__",
        "(lambda: 1)()",
        "[c for c in (1, 2)]",
        "open('/etc/passwd')",
        "eval('1')",
        "exec('1')",
        "globals()",
        "getattr(x, 'dtype')",
        "f'{x}'",
        "`x`",
        "x.tofile('f')",
        "np.sin(x)",
        "yield x",
        "await x",
        "sin(x)(y)",
        "print(x)",
    ],
)
def test_there_is_no_way_to_python(text):
    with pytest.raises(Mistake):
        parse_formula(text)


def test_long_and_deep_formulas():
    """A sum of a thousand terms is 999 operations deep, and a chain of comparisons takes each argument once."""
    assert worth("+".join(["x"] * 1000)) == pytest.approx(1000 * X)
    nested = "x"
    for _ in range(60):
        nested = f"(0 < {nested} < 2)"
    assert worth(nested) == 1.0


# ---- fuzzing

WORDS = [
    *VARIABLES,
    *FUNCTIONS,
    "pi",
    "e",
    "w",
    "__class__",
    "lambda",
    "if",
    "else",
    "for",
    "in",
    "not",
    "and",
    "1",
    "2.5",
    "1e9",
]
MARKS = [*"()+-*/%^<[].:='{}#@~ \n", "**", "//", "<=", "==", "!=", ":=", ","]
SOUP = st.lists(st.sampled_from(WORDS + MARKS), max_size=15).map(" ".join)


@given(st.one_of(st.text(max_size=60), SOUP))
def test_any_text_is_a_formula_or_our_error(text):
    try:
        formula = parse_formula(text)
    except Mistake:
        return
    assert formula.variables <= set(VARIABLES)
    assert evaluate(formula, PLACE).shape == ()


LEAVES = st.sampled_from(["x", "y", "z", "t", "0.5", "2.0", "3.25"])


def _grow(inner):
    binary = st.tuples(st.sampled_from(["+", "-", "*", "<", ">=", "=="]), inner, inner).map(
        lambda p: f"({p[1]} {p[0]} {p[2]})"
    )
    call = st.tuples(st.sampled_from(["sin", "cos", "atan", "tanh", "abs"]), inner).map(lambda p: f"{p[0]}({p[1]})")
    choice = st.tuples(inner, inner, inner).map(lambda p: f"({p[0]} if {p[1]} else {p[2]})")
    return st.one_of(binary, call, choice)


@given(st.recursive(LEAVES, _grow, max_leaves=20))
def test_agrees_with_python(text):
    """Python itself, on the same text, is the referee."""
    names = {**PLACE, "sin": math.sin, "cos": math.cos, "atan": math.atan, "tanh": math.tanh, "abs": abs}
    expected = float(eval(compile(ast.parse(text, mode="eval"), "formula", "eval"), {"__builtins__": {}}, names))
    assert worth(text) == pytest.approx(expected, rel=1e-9, abs=1e-12)
