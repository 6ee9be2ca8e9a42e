"""What a case's values are worth at places and times, records from Python, and whether two cases are the same one."""

from __future__ import annotations

import ast
import copy
import math
import pickle
import re
from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lacmesh import Mesh
from lacsolver.case import (
    Case,
    CaseError,
    Contact,
    Displacement,
    EvaluationError,
    Gravity,
    Material,
    Pressure,
    Rigid,
    Steps,
    Temperature,
    Traction,
    Value,
    changed,
    check_groups,
    digest,
    fingerprint,
    parse_case,
)
from lacsolver.case.errors import Mistake
from lacsolver.case.formula import CONSTANTS, FUNCTIONS, LONGEST, OPERATORS, VARIABLES, evaluate, parse_formula
from tests.problems import PROBLEMS, case_of

# ---- formulas

PLACE = {"x": 0.3, "y": -1.7, "z": 2.0, "t": 0.25}
X, Y, Z, T = PLACE.values()
WORTH = [
    ("2", 2.0), ("  1 +\n 2 ", 3.0), ("x + y - z * t / 2", X + Y - Z * T / 2), ("-x ** 2", -(X**2)), ("+x", X),
    ("2 ** 3 ** 2", 512.0), ("7 // 2", 3.0), ("-7 // 2", -4.0), ("-7 % 3", 2.0), ("mod(7, -3)", -2.0),
    ("pi", math.pi), ("1e-3", 0.001), ("0x10", 16.0), ("atan2(y, x)", math.atan2(Y, X)),
    *((f"{f}(x)", getattr(math, f)(X)) for f in ("sin", "cos", "tan", "asin", "acos", "atan")),
    *((f"{f}(x)", getattr(math, f)(X)) for f in ("sinh", "cosh", "tanh", "exp")),
    ("log(z)", math.log(Z)), ("log10(z)", math.log10(Z)), ("sqrt(z)", math.sqrt(Z)), ("abs(y)", abs(Y)),
    ("min(x, y, z)", Y), ("max(x, y, z, t)", Z), ("pow(z, 3)", 8.0), ("hypot(3, 4)", 5.0),
    ("floor(y)", -2.0), ("ceil(y)", -1.0), ("sign(y)", -1.0), ("heaviside(y)", 0.0), ("heaviside(0)", 1.0),
    ("where(x < 0.5, z, y)", Z), ("where(x > 0.5, z, y)", Y), ("z if x < 0.5 else y", Z),
    ("x < y", 0.0), ("-(x > y)", -1.0), ("x <= 0.3", 1.0), ("x >= 0.3", 1.0), ("x == 0.3", 1.0), ("x != 0.3", 0.0),
    ("0 < x < 1", 1.0), ("0 < x < 0.2", 0.0), ("1 < x < 2", 0.0), ("0 < x < 1 > z", 0.0),
    ("x > 0 and y > 0", 0.0), ("x > 0 and z > 0 and t > 0", 1.0), ("x < 0 or y < 0", 1.0),
    ("x < 0 or y > 0 or z < 0", 0.0), ("not x < 0", 1.0),
    ("where(x > 0, x, 1 / (x - 0.3) )", X), ("(1 / x if x > 0 else 0)", 1 / X),
]  # fmt: skip


def worth(text, **variables):
    return float(evaluate(parse_formula(text), {**PLACE, **variables}))


@pytest.mark.parametrize(("text", "value"), WORTH)
def test_a_formula_at_a_place(text, value):
    assert worth(text) == pytest.approx(value, rel=1e-15, abs=1e-300)


def test_every_function_and_operator_is_computed_and_used_above():
    used = {step.operation for text, _ in WORTH for step in parse_formula(text).program}
    assert {*OPERATORS.values(), *VARIABLES} <= used
    assert all(any(f"{name}(" in text for text, _ in WORTH) for name in FUNCTIONS)
    assert set(CONSTANTS) == {"pi"}


UNDEFINED = (
    """0 / 0; 1 / 0; sqrt(-1); log(0); log(-1); (-8) ** (1 / 3); asin(2); exp(1000); mod(1, 0); (8 + 1) ** 9 ** 9"""
)
#: numpy says pow(nan, 0) = 1, nan < 1 = false, hypot(inf, nan) = inf
HIDDEN = """sqrt(-1) < 1; 1 < sqrt(-1) < 2; sqrt(-1) ** 0; 1 ** sqrt(-1); not sqrt(-1); sqrt(-1) and 0; 1 or sqrt(-1);
where(sqrt(-1), 1, 2); heaviside(sqrt(-1)); max(sqrt(-1), 1); min(1, sqrt(-1)); sign(sqrt(-1)); hypot(1 / 0, sqrt(-1));
atan2(sqrt(-1), 1)"""


@pytest.mark.parametrize("text", [text.strip() for text in f"{UNDEFINED}; {HIDDEN}".split(";")])
def test_undefined_is_not_finite_and_does_not_hide(text):
    assert not np.isfinite(worth(text)) and (math.isnan(worth(text)) or text in UNDEFINED)


REFUSED = [
    ("x + w", "unknown name 'w'"), ("sine(x)", "did you mean sin"), ("Sin(x)", "did you mean sin or"),
    ("sqr(x)", "did you mean sqrt?"), ("x(2)", "write * to multiply by x"), ("pi(2)", "write * to multiply by pi"),
    *((text, "is not a formula") for text in ("2 x", "2x", "x +", "", "(x", "x = 1", "x; y", "\0")),
    ("x ^ 2", "write ** for a power"), ("sin", "write sin(...)"),
    ("sin()", "gives sin 0 arguments in its formula; it takes 1"), ("atan2(x)", "it takes 2"),
    ("where(x, y)", "it takes 3"), ("min(x)", "it takes 2 or more"),
    ("sin(x=1)", "names or unpacks an argument"), ("max(*x)", "names or unpacks an argument"),
    ("True", "True"), ("None", "None"), ("'x'", "'x'"), ("1j", "1j"), ("1e999", "too large"), ("9" * 400, "too large"),
    ("9**9**9**9", "a power of numbers"), ("x if t < 1 else pow(10, 400)", "a power of numbers"),
    ("1" * (LONGEST + 1), "characters"), ("(x, y)", "a comma outside a function"), ("[x]", "List"), ("{x}", "Set"),
    ("x[0]", "an index"), ("x in y", "an unknown comparison"), ("x is y", "an unknown comparison"), ("x & y", "BinOp"),
    ("x @ y", "BinOp"), ("~x", "UnaryOp"), ("(x := 1)", "NamedExpr"), ("x # the radius", "# in its formula"),
    ("-" * 50_000 + "x", "nested too deeply"), ("(" * 5_000 + "x" + ")" * 5_000, "too many nested parentheses"),
    ("x" * 1_000_000, "characters"), ("+".join("x" * 40_000), "nested too deeply"),
]  # fmt: skip


#: there is no way to Python
PYTHON = """__import__('os').system('true'); ().__class__.__bases__[0].__subclasses__(); x.__class__; sin.__globals__;
(lambda: 1)(); [c for c in (1, 2)]; open('/etc/passwd'); eval('1'); exec('1'); globals(); getattr(x, 'dtype'); f'{x}';
`x`; x.tofile('f'); np.sin(x); yield x; await x; sin(x)(y); print(x)"""


@pytest.mark.parametrize(("text", "said"), [*REFUSED, *((text.strip(), "") for text in PYTHON.split(";"))])
def test_a_formula_that_is_refused(text, said):
    with pytest.raises(Mistake) as error:
        parse_formula(text)
    assert said in error.value.message
    assert len(error.value.message) < 300


def test_long_and_deep_formulas():
    """A sum of a thousand terms is 999 operations deep, and a chain of comparisons takes each argument once."""
    assert worth("+".join(["x"] * 1000)) == pytest.approx(1000 * X)
    nested = "x"
    for _ in range(60):
        nested = f"(0 < {nested} < 2)"
    assert worth(nested) == 1.0


WORDS = [*VARIABLES, *FUNCTIONS, "pi", "e", "w", "__class__", "lambda", "1", "2.5", "1e9"]
WORDS += ["if", "else", "for", "in", "not", "and"]
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


# ---- values at places and times

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [0.5, -1.0, 2.0]])
STEEL = Material(young=1.0, poisson=0.3)


def case(**sections):
    return Case(mesh="a.msh", model="3d", material=[STEEL], **sections)


@pytest.mark.parametrize(
    ("given_", "t", "values", "place", "time"),
    [
        (2.5, 0.5, [2.5, 2.5, 2.5], False, False),
        (np.float64(2.5), 0.5, [2.5, 2.5, 2.5], False, False),
        (np.array(3), 0.5, [3.0, 3.0, 3.0], False, False),
        ("x + 2 * z", 0.5, [0.0, 7.0, 4.5], True, False),
        ("y", 0.5, [0.0, 2.0, -1.0], True, False),
        ("3 * t", 0.5, [1.5, 1.5, 1.5], False, True),
        ("where(y < 0, sqrt(-y), y ** 2)", 0.5, [0.0, 4.0, 1.0], True, False),
        ("x * t", 0.5, [0.0, 0.5, 0.25], True, True),
        ("2", 0.5, [2.0, 2.0, 2.0], False, False),
        ([[0, 0], [1, 4]], 0.25, [1.0, 1.0, 1.0], False, True),
        (np.array([[0, 1], [2, 1]]), 1.0, [1.0, 1.0, 1.0], False, False),
        (lambda x, t: x[:, 1] * t, 0.5, [0.0, 1.0, -0.5], True, True),
        (lambda x, t: 4 * t, 0.5, [2.0, 2.0, 2.0], True, True),
    ],
)
def test_value_at_points(given_, t, values, place, time):
    value = Value.of(given_)
    got = value(POINTS, t)
    assert got.shape == (3,) and got.dtype == float and got.flags.writeable
    np.testing.assert_allclose(got, values, rtol=1e-15)
    assert (value.depends_on_place, value.depends_on_time) == (place, time)
    assert value(np.empty((0, 3)), t).shape == (0,)


def test_in_a_plane_z_is_0_and_functions_see_two_coordinates():
    assert Value.of("x + z")(POINTS[:, :2], 0.0).tolist() == [0.0, 1.0, 0.5]
    assert Value.of(lambda x, t: np.full(len(x), x.shape[1]))(POINTS[:, :2], 0.0).tolist() == [2.0, 2.0, 2.0]


TABLES = st.lists(st.tuples(st.floats(-5, 5), st.floats(-9, 9)), min_size=1, max_size=6, unique_by=lambda row: row[0])


@given(TABLES, st.floats(-7, 7))
def test_a_table_is_linear_in_between_and_held_at_its_ends(rows, t):
    rows = sorted(rows)
    # numpy's slopes overflow less gracefully
    expected = pytest.approx(np.interp(t, [r[0] for r in rows], [r[1] for r in rows]), rel=1e-6, abs=1e-6)
    assert Value.of(rows).at(t) == expected
    value = Value.of([[0, 1], [0.1, 5], [0.3, -2]])
    assert [value.at(t) for t in (0, 0.1, 0.3)] == [1.0, 5.0, -2.0]


def test_numbers_under_a_load_are_ramped_and_nothing_else_is():
    made = case(
        steps=Steps(times=[1.0, 4.0]),
        pressure=[Pressure(group="a", value=8.0), Pressure(group="a", value="8"), Pressure(group="a", value=[[0, 8]])],
        displacement=[Displacement(group="b", ux=8.0)],
        contact=[Contact(slave="s", master="m", clearance=8.0)],
        rigid=[Rigid(group="r", rotation=[0.0, 0.0, 8.0])],
    )
    at = [p.value(POINTS[:1], 1.0)[0] for p in made.pressure]
    assert at == [2.0, 8.0, 8.0]
    assert made.displacement[0].ux(POINTS[:1], 4.0) == [8.0] and made.displacement[0].ux(POINTS[:1], 0.0) == [0.0]
    assert made.displacement[0].ux.depends_on_time and not Value(0.0, ramp_end=4.0).depends_on_time
    assert made.contact[0].clearance(POINTS[:1], 1.0) == [8.0]
    assert [v.at(2.0) for v in made.rigid[0].rotation] == [0.0, 0.0, 4.0]
    longer = replace(made, steps=Steps(end=8.0))
    assert longer.pressure[0].value(POINTS[:1], 1.0) == [1.0]
    assert made.pressure[0].value(POINTS[:1], 5.0) == [8.0]  # held after the end


def test_a_temperature_is_ramped_from_the_reference():
    warm = Material(young=1.0, poisson=0.3, expansion=1e-5, reference_temperature=20.0)
    (record,) = case_of("a.msh", warm, Temperature(value=120.0), model="3d").temperature
    value = record.value
    start = np.array([20.0, 20.0, 0.0])
    assert value(POINTS, 0.0, start=20.0).tolist() == [20.0, 20.0, 20.0]
    assert value(POINTS, 0.25, start=start).tolist() == [45.0, 45.0, 30.0]
    assert value(POINTS, 1.0, start=start).tolist() == [120.0, 120.0, 120.0]


def test_a_traction_s_function_sees_the_normals():
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    made = case(traction=[Traction(group="a", tx=lambda x, n, t: t * n[:, 0], ty="x", tz=2.0)])
    assert made.traction[0].tx(POINTS, 2.0, normals=normals).tolist() == [0.0, 2.0, 0.0]
    assert made.traction[0].ty(POINTS, 2.0, normals=normals).tolist() == [0.0, 1.0, 0.5]
    with pytest.raises(ValueError, match=r"traction.tx is a function of the normal"):
        made.traction[0].tx(POINTS, 2.0)


def test_a_function_of_a_rigid_body_has_no_place():
    made = case(rigid=[Rigid(group="a", ux=lambda x, t: 3 * t)])
    assert not made.rigid[0].ux.depends_on_place and made.rigid[0].ux.at(2.0) == 6.0
    with pytest.raises(ValueError, match="depends on the place"):
        Value.of("x").at(1.0)


LOADS = """mesh = "a.msh"
model = "3d"
material = [{young = 1, poisson = 0}]
[[pressure]]
group = "a"
value = "1 / (x - t)"
[[rigid]]
group = "b"
rotation = [
  0,
  "log(t - 1)",
  0]
"""


def test_a_formula_that_is_not_finite_names_formula_place_and_time():
    made = parse_case(LOADS, "dir/press.toml")
    with pytest.raises(EvaluationError) as error:
        made.pressure[0].value(POINTS, 0.5)
    said = "dir/press.toml, line 6: pressure.value = '1 / (x - t)' is inf at (0.5, -1, 2), t = 0.5"
    assert str(error.value).startswith(said) and error.value.status == 1
    with pytest.raises(EvaluationError, match=r"\(and 1 more places\), t = 0"):
        made.pressure[0].value(POINTS[[0, 0]], 0.0)
    with pytest.raises(EvaluationError, match=r"line 9: rigid.rotation = 'log\(t - 1\)' is nan"):
        made.rigid[0].rotation[1].at(0.5)


def test_a_function_that_gives_something_else():
    for function, said in (
        (lambda x, t: x[:2, 0], r"pressure.value gives \(2,\) for 3 points"),
        (lambda x, t: x, r"pressure.value gives \(3, 3\) for 3 points"),
        (lambda x, t: np.where(x[:, 0] > 0, np.nan, 0), r"pressure.value is nan at \(1, 2, 3\) \(and 1 more places\)"),
    ):
        with pytest.raises(EvaluationError, match=said):
            case(pressure=[Pressure(group="a", value=function)]).pressure[0].value(POINTS, 0.5)


def test_values_that_are_none():
    for wrong in (True, None, object(), {}, [], [1, 2], "x +", [[0, 0], [0, 1]], [[0, 10**400]], 10**400, float("nan")):
        with pytest.raises(ValueError, match="the value "):
            Value.of(wrong)


# ---- records from Python


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda: Pressure(group="a", value=1.0, follower=3), CaseError, r"^pressure.follower is 3"),
        (lambda: replace(case(), material=Material(young=1, poisson=0.5)), CaseError, r"^material.poisson is 0.5"),
        (lambda: replace(case(), model="plane_strain", gravity=Gravity(gz=1.0)), CaseError, r"^gravity.gz applies to"),
        (lambda: Pressure(group="a"), TypeError, "value"),
        (lambda: case(pressure=[3]), TypeError, "list of Pressure records"),
        (lambda: case(steps={"end": 2}), TypeError, "a Steps record"),
    ],
)
def test_records_are_checked_as_files_are(make, error, said):
    with pytest.raises(error, match=said):
        make()


def test_arrays_of_numpy_are_vectors():
    wood = Material(
        law="orthotropic", young=(1, 1, 1), poisson=(0, 0, 0), shear=(1, 1, 1), axes=np.array([[0.0, 1, 0], [1, 0, 0]])
    )
    assert wood.axes == ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    assert Displacement(at=np.zeros(3), ux=np.array([[0, 0], [1, 2]])).at == (0.0, 0.0, 0.0)
    assert Steps(times=np.linspace(0.5, 2, 4)).planned == (0.5, 1.0, 1.5, 2.0)


def test_records_are_frozen_equal_by_what_they_say_and_shown_as_they_could_be_given():
    one, other = (case(pressure=[Pressure(group="a", value="x")]) for _ in range(2))
    assert one == other
    assert one != case(pressure=[Pressure(group="a", value="y")])
    with pytest.raises(FrozenInstanceError):
        one.model = "axisymmetric"
    body = Rigid(group="a", ux="sin(t)", rotation=[0, "0.1 * t", [[0, 0], [1, 0.5]]])
    assert repr(body) == "Rigid(group='a', ux='sin(t)', rotation=(0.0, '0.1 * t', ((0.0, 0.0), (1.0, 0.5))))"
    assert eval(repr(body)) == body


def test_copies_of_records_are_checked_and_keep_their_place():
    (one,) = parse_case(HEAD + '[[pressure]]\ngroup = "a"\nvalue = 1\n', "press.toml").pressure
    assert one.place == "press.toml, line 4"
    assert {field.name for field in fields(one)} == {"group", "value", "follower", "place"}
    for copied in (replace(one, value="x"), one.model_copy(update={"value": "x"})):
        assert copied.value(POINTS, 0.0).tolist() == [0.0, 1.0, 0.5]
        assert copied.place == one.place and copied != one and len({copied, one}) == 2
    with pytest.raises(CaseError, match=r"^press.toml, line 4: pressure\.value is true"):
        one.model_copy(update={"value": True})
    with pytest.raises(TypeError, match=r"pressure.grup is not a key of \[\[pressure\]\]; did you mean group"):
        Pressure(grup="a", group="a", value=1.0)
    assert pickle.loads(pickle.dumps(one)) == one == copy.deepcopy(one)


# ---- the same case


def with_changes(name, kind, changes):
    """A problem of the corpus and its mesh; other keys of the first record of a kind ("": of the top)."""
    problem = PROBLEMS[name]
    if not kind:
        return problem.case(**changes), problem.mesh()
    records = list(problem.records)
    k = next(k for k, record in enumerate(records) if record.SECTION.name == kind)
    records[k] = replace(records[k], **changes)
    return problem.case(records), problem.mesh()


#: problem, section, other keys, and the parts of the case in which a restart differs for it
CHANGES = [
    ("loads", "material", {"young": 1000}, []),
    ("loads", "steps", {"count": 8}, []),
    ("loads", "output", {"every": 1}, []),
    ("halved", "steps", {"max_halvings": 1}, []),
    ("halved", "solver", {"max_iterations": 9}, []),
    ("springs", "probe", {"name": "another"}, []),
    ("searched", "contact", {"hexa": "pyramid"}, []),
    ("loads", "material", {"young": 1001.0}, ["material"]),
    ("loads", "pressure", {"value": 26.0}, ["pressure"]),
    ("strain", "pressure", {"value": "-2"}, ["pressure"]),
    ("searched", "contact", {"clearance": "0.01 + 0.03 * x"}, ["contact"]),
    ("loads", "traction", {"tz": [[0, 0], [1, 4]]}, ["traction"]),
    ("loads", "gravity", {"gx": None}, ["gravity"]),
    ("springs", "spring", {"kx": 2.0}, ["spring"]),
    ("rigid", "rigid", {"centre": [0.25, 0.0, 1.5]}, ["rigid"]),
    ("searched", "", {"thickness": 2.0}, ["thickness"]),
    # plain numbers of loads are reached at the end, and others say when
    ("loads", "steps", {"end": 3.0}, ["traction", "force", "body_force", "gravity"]),
    ("fields", "", {"steps": Steps(end=2.0)}, ["displacement", "temperature"]),
]


@pytest.mark.parametrize(("name", "kind", "changes", "parts"), CHANGES)
def test_what_makes_another_case(name, kind, changes, parts):
    one, other = PROBLEMS[name].case(), with_changes(name, kind, changes)
    assert one != other[0] or changes == {"young": 1000} or "hexa" in changes
    before = digest(one, other[1])
    assert len(before) == 32 and before == digest(PROBLEMS[name].case(), other[1])
    assert list(changed(fingerprint(one, other[1]), fingerprint(*other))) == parts
    assert (before == digest(*other)) == (not parts)


def mesh():
    return Mesh.create(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [("TETRA4", [[0, 1, 2, 3]]), ("TRIA3", [[0, 2, 1], [1, 2, 3]])],
        cell_groups={"body": [0], "lower": [1], "upper": [2], "both": [1]},
        node_groups={"tip": [3], "both": [1]},
        group_tags={"upper": ((2, 7),)},
    )


HEAD = 'mesh = "a.msh"\nmodel = "3d"\nmaterial = [{ young = 1.0, poisson = 0.3 }]\n'
NAMED = HEAD + '[[contact]]\nslave = "lower"\nmaster = "upper"\n'


def test_what_leaves_a_case_the_same():
    """Numbers of nodes, groups that it does not name or a probe alone, the file, the end of a run without ramps."""
    one, probed = (parse_case(text) for text in (NAMED, NAMED + '[[probe]]\nname = "new"\ngroup = "new"\n'))
    groups = {**mesh().cell_groups, "new": np.array([1])}
    renumbered = replace(mesh(), node_number=np.arange(10, 14), cell_groups=groups)
    assert digest(one, mesh()) == digest(one, renumbered) == digest(probed, renumbered)
    assert digest(one, mesh()) == digest(replace(one, mesh="elsewhere/a.msh"), mesh())
    load = {"pressure": Pressure(group="a", value="t"), "displacement": Displacement(group="b", ux=0.0)}
    ends = [digest(case(**load, steps=Steps(end=end)), mesh()) for end in (1.0, 2.0)]
    assert ends[0] == ends[1]


def test_functions_count_by_their_names():
    def rising(x, t):
        return t

    def other(x, t):
        return t

    one, again, another = (digest(case(pressure=Pressure(group="a", value=f)), mesh()) for f in (rising, rising, other))
    assert one == again != another


# ---- the groups of a case in a mesh


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (Displacement(group="both", kind="node", uy=0.0), ""),
        (Displacement(group="both", kind="cell", uy=0.0), ""),
        (Contact(slave=7, master="lower"), ""),
        (Pressure(group="2:7", value=1.0), ""),
        (Temperature(groups=["body", "bodi"], value=1.0), "groups: no cell group named 'bodi'; did you mean body"),
        (Contact(slave=8, master="lower"), "contact.slave: no cell group named '8'"),
        (Contact(slave=7, master="tip"), "contact.master: 'tip' is a group of nodes"),
        (Displacement(group="top", ux=0.0), "displacement.group: no group named 'top'; did you mean tip?"),
        (Displacement(group="lower", kind="node", ux=0.0), "displacement.group: no node group named 'lower'"),
        (Displacement(group="tip", kind="cell", ux=0.0), "displacement.group: 'tip' is a group of nodes"),
    ],
)
def test_groups_of_a_mesh(record, said):
    """Names, tags and kinds of groups; the commands tell the lines, see `bad_cases`."""
    made = case_of("a.msh", Material(young=1.0, poisson=0.3, expansion=1e-5), record, model="3d")
    if not said:
        check_groups(made, mesh())
        return
    with pytest.raises(CaseError, match=re.escape(said)) as error:
        check_groups(made, mesh())
    assert len(error.value.problems) == 1 and error.value.status == 1
