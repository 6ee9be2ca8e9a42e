"""Case files: every key is read, and every mistake is told with its line, all of them at once; the schemas of the keys.

That a case is written as it was read, and that each key and option has an effect, are laws over the corpus (test_laws).
"""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
import tomllib
from dataclasses import MISSING, fields
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

import lacmesh
import lacsolver as ls
from lacmesh.errors import LacmeshError, ReadError
from lacmesh.surface.points import NORMALS
from lacsolver.case import Case, CaseError, Contact, Cyclic, parse_case, read_case
from lacsolver.case.keys import told_default
from lacsolver.case.lines import Lines
from lacsolver.case.schema import json_schema, page_tables, records, schema_text
from lacsolver.cli import main
from lacsolver.space.space import MODELS
from tests import REPOSITORY
from tests.lacsolver.bad_cases import MISTAKES, SHOWN
from tests.problems import PROBLEMS, case_of
from tests.viewing import DATA

HEADER = 'mesh = "a.msh"\nmodel = "{}"\nmaterial = [{{ young = 1, poisson = 0 }}]\n'
#: what a case that is written does not hold: integers for numbers and names, formulas and tables where the corpus has
#: numbers, nodes by number
BY_HAND = """
mesh = "two_blocks.med"
model = "3d"
[[material]]
groups = ["lower", 7, "3:8"]
young = 2000
poisson = 0.3
[[contact]]
slave = "Group_1"
master = "Group_2"
clearance = -0.01
stiffness = [[0.0, 10.0], [0.5, 20.0]]
friction = "0.3 + 0.1 * x"
cohesion = [[0, 0.0], [1, 2.0]]
shear_limit = 5
[[displacement]]
at = [0, 0.0, 1.5]
ux = 0.0
[[force]]
group = "a"
fx = 1.0
axes = { origin = [0, 0, 0], x = [1, 0, 0], xy = [0, 1, 0] }
[[coupling]]
group = "a"
weights = [[1, 2.0], [2, 1.0]]
ux = 1.0
[[equation]]
name = "sum"
terms = [{ factor = 1.0, component = "ux", node = 3 }, { factor = -2, component = "uz", at = [0, 0, 1] }]
[[pressure]]
group = "top"
value = 25.0
[steps]
end = 2.0
count = 4
"""
SOLVERS = [
    HEADER.format("3d") + f'solver.{name} = "{word}"\n'
    for name in ("engine", "backend")
    for word in ls.case.Solver.KEYS[name].kind.known
]


@cache
def text_of(name):
    """A problem of the corpus as a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder)
        PROBLEMS[name].case(mesh=path / "a.msh").write(path / "case.toml")
        return (path / "case.toml").read_text()


def every_text():
    """Case files that are right."""
    of_one_node = BY_HAND.replace("weights = [[1, 2.0], [2, 1.0]]", "weights = [[1, 2.0]]")
    return [BY_HAND, of_one_node, *SOLVERS, *map(text_of, PROBLEMS)]


# ---- what is right


def test_what_a_case_holds(tmp_path):
    (tmp_path / "press.toml").write_bytes(b"\xef\xbb\xbf" + BY_HAND.replace("\n", "\r\n").encode())  # as on Windows
    assert read_case(tmp_path / "press.toml").mesh == tmp_path / "two_blocks.med"
    case = parse_case(BY_HAND, "folder/press.toml")
    assert (case.mesh, case.path) == (Path("folder/two_blocks.med"), Path("folder/press.toml"))
    (steel,), (joint,) = case.material, case.contact
    assert steel.groups == ("lower", "7", "3:8") and steel.young == 2000.0 and isinstance(steel.young, float)
    assert joint.name == "Group_1" and joint.geometry == "reference"
    assert joint.clearance([[0, 0, 0]], 0.5) == [-0.01]  # not a load: not ramped
    assert joint.friction([[2, 0, 0]], 0.0) == [0.5] and joint.cohesion.at(0.5) == 1.0
    assert case.displacement[0].at == (0.0, 0.0, 1.5) and case.displacement[0].group is None
    assert case.pressure[0].value([[0, 0, 0]], 0.5) == [6.25]
    assert case.steps.planned == (0.5, 1.0, 1.5, 2.0) and case.steps.last == 2.0
    line = BY_HAND.splitlines().index("[[pressure]]") + 1
    assert case.pressure[0].place == f"folder/press.toml, line {line}"


def test_finite_kinematics_look_at_the_current_geometry():
    head = HEADER.format("axisymmetric").replace("{", '{ law = "neo_hookean",') + 'kinematics = "finite"\n'
    pair = '[[contact]]\nslave = "a"\nmaster = "b"\n'
    assert parse_case(head + pair).contact[0].geometry == "current"
    assert parse_case(head + pair + 'geometry = "reference"\n').contact[0].geometry == "reference"


def test_defaults_of_records_are_what_their_kinds_read():
    for record in records():
        for name, key in record.KEYS.items():
            default = record.DEFAULTS[name]
            if default is not MISSING and default is not None:
                assert key.kind.read(default) == default, name


def test_matrices_need_no_material():
    text = 'mesh = "a.msh"\nmodel = "3d"\n[[contact]]\nslave = "a"\nmaster = "b"\n'
    assert parse_case(text, matrices=True).material == ()
    with pytest.raises(CaseError, match=r"case.toml: the top of the file needs a \[\[material\]\]"):
        parse_case(text)


# ---- what is wrong


@pytest.mark.parametrize(("text", "said"), MISTAKES, ids=[said for _, said in MISTAKES])
def test_one_mistake(text, said):
    with pytest.raises(CaseError) as error:
        parse_case(text, "press.toml")
    marked = [k for k, line in enumerate(text.splitlines(), 1) if line.endswith("#!")]
    problems = [p for p in error.value.problems if said in p.message]
    assert problems, str(error.value)
    assert len(error.value.problems) == (2 if "has no groups" in said else 1), str(error.value)
    if marked:
        assert [p.line for p in problems] == marked
        assert str(error.value).startswith(f"press.toml, line {marked[0]}: ")
    assert error.value.status == 1 and error.value.path == "press.toml"


SEVERAL = """mesh = "a.msh"
modle = "3d"
[[material]]
young = -1.0
poison = 0.3
[[contact]]
slave = "a"
friktion = 0.2
clearance = "sine(x)"
[[contact]]
slave = "a"
master = "a"
place = "here"
[steps]
count = 0
"""
TOGETHER = """mesh = "a.msh"
model = "3d"
material = [{ young = 1.0, poisson = 0.3 }]
[[contact]]
slave = "a"
[[contact]]
slave = "a"
master = "a"
"""


def test_all_mistakes_of_keys_come_at_once_and_rules_between_them_when_keys_are_right():
    with pytest.raises(CaseError) as error:
        parse_case(SEVERAL, "press.toml")
    lines = [problem.line for problem in error.value.problems]
    assert lines == [None, 2, 4, 5, 8, 9, 13, 15], str(error.value)
    assert "contact.place is not a key of [[contact]]" in str(error.value)
    with pytest.raises(CaseError) as error:
        parse_case(TOGETHER, "press.toml")
    said = [(problem.line, problem.message.split(";")[0]) for problem in error.value.problems]
    assert said == [
        (4, "[[contact]] needs master or surfaces"),
        (7, "contact.slave is 'a', which is the slave of an earlier section too"),
        (7, "contact.slave is 'a', which is the name of an earlier section too"),
        (8, "contact.master is 'a', the same group as the slave"),
    ]


NO_TOML = [
    ("mesh = ", "line 1: Invalid value (the file ends)"),
    ('mesh = "a"\nmodel = "3d\n', "line 2: Illegal character '\\n' (column 12)"),
    ('mesh = "a"\n\nmesh = "b"\n', "line 3: Cannot overwrite a value"),
    ("[steps]\n[steps]\n", "line 2: Cannot declare ('steps',) twice"),
    ("[[contact]]\nslave = [1,\n2\n", "line 4: Unclosed array (the file ends)"),
    ('a = """\n\n', "line 3: Unterminated string (the file ends)"),
    ("x = " + "9" * 5000, "is not TOML ("),
    ("x = " + "[" * 100_000, "is nested too deeply to be read"),
    ("x = 2020-13-45", "line 1: "),
    ("[[contact]]\nslave = arc\n", 'line 2: slave = arc is text without quotes; write slave = "arc"'),
    ("[[pressure]]\nfollower = True # as in Python\n", "line 2: follower = True is not TOML; write follower = true"),
    ("[[material]]\nyoung = 1000.\n", "line 2: young: 1000. is not a number in TOML, which needs digits before and"),
    ("poisson = .3\n", "write 0.3"),
    ("x = 1e3.\n", "write 1e3"),
    ("x = 2.1D5\n", "write 2.1e5"),
    ("x = 007\n", "write 7"),
    ("axis = [0.0, 1., 0.0]\n", "axis: 1. is not a number in TOML, which needs digits"),
    ("x = 2000,0\n", "x = 2000,0 has a comma, which numbers in TOML do not have; write 2000.0"),
    ("thickness = None\n", "thickness = None is not TOML; remove the key"),
    ("mesh = ../my blocks.msh\n", 'write mesh = "../my blocks.msh"'),
    ('mesh = "C:\\work\\m.msh"\n', "mesh: a backslash in double quotes begins a code"),
]


@pytest.mark.parametrize(("text", "said"), NO_TOML, ids=range(len(NO_TOML)))
def test_no_toml(text, said):
    with pytest.raises(ReadError) as error:
        parse_case(text, "press.toml")
    assert said in str(error.value) and str(error.value).startswith("press.toml") and error.value.status == 3


@pytest.mark.parametrize("command", ["run", "validate", "modes", "matrices"])
def test_what_is_no_case_is_told_by_what_it_is(tmp_path, capsys, command):
    """Instead of a statement that is invalid."""
    mesh, results = tmp_path / "press.msh", tmp_path / "press"
    for name in ("press.msh", "press.med"):
        lacmesh.write(tmp_path / name, lacmesh.read(DATA / "two_blocks.msh"))
    results.mkdir()
    (results / "history.csv").write_text("time\n")
    (tmp_path / "empty.toml").write_text("\n")
    (tmp_path / "packed.toml").write_bytes(b"\x7fELF\x00\xff" * 20)
    for path, said in (
        (mesh, "is a mesh (msh), and not a case; lacsolver new press.msh"),
        (tmp_path / "press.med", "is a mesh (med), and not a case"),
        (DATA / "punch.inp", "lacsolver import punch.inp makes a case of it"),
        (results, "is a folder of results, not a case; give the case file, and --restart"),
        (tmp_path, "is a folder, not a case; it has empty.toml, packed.toml"),
        (tmp_path / "empty.toml", "is empty"),
        (tmp_path / "packed.toml", "is a binary file"),
    ):
        assert main([command, str(path), *([] if command == "validate" else ["-o", str(tmp_path / "out.npz")])]) == 3
        (line,) = capsys.readouterr().err.splitlines()
        assert str(path) in line and said in line


@pytest.mark.rows("50", "480")
@pytest.mark.parametrize("depth", [50, 200, 300, 320, 330, 340, 400, 480, 600])
def test_depth_is_no_crash(depth):
    """Deep nesting is refused with an error both where tomllib still reads it and where it gives up."""
    arrays, tables = "[" * depth + "]" * depth, "{a = " * depth + "1" + "}" * depth
    for text in (f"mesh = {arrays}", f"mesh = {tables}", f"[{'.'.join('a' * depth)}]"):
        with pytest.raises((CaseError, ReadError)):
            parse_case(text)


# ---- fuzzing: nothing but the documented errors
NAMES = sorted({n for r in records() for n in [*r.KEYS, r.SECTION.name] if n} | {"x", "a"})
TEXTS = st.sampled_from(["3d", "plane_strain", "small", "finite", "x * t", "1 /", "a", "", "neo_hookean", "node"])
SCALARS = st.one_of(
    TEXTS.map(lambda s: f'"{s}"'),
    st.integers(-3, 10**20).map(str),
    st.floats().map(repr),
    st.sampled_from(["true", "1979-05-27", "07:32:00"]),
)
VALUES = st.recursive(
    SCALARS,
    lambda v: st.one_of(
        st.lists(v, max_size=4).map(lambda p: f"[{', '.join(p)}]"),
        st.dictionaries(st.sampled_from(NAMES), v, max_size=3).map(
            lambda d: "{" + ", ".join(f"{k} = {w}" for k, w in d.items()) + "}"
        ),
    ),
    max_leaves=6,
)
LINES = st.one_of(
    st.tuples(st.sampled_from(NAMES), VALUES).map(" = ".join),
    st.sampled_from(NAMES).map("[{}]".format),
    st.sampled_from(NAMES).map("[[{}]]".format),
)


def told(text):
    """Parse a text and return the CaseError or ReadError, None without one; any other exception is a failure."""
    try:
        parse_case(text)
    except (CaseError, ReadError) as error:
        assert isinstance(error, LacmeshError) and str(error)
        return error
    return None


@given(st.lists(LINES, max_size=12).map("\n".join))
def test_garbage_of_our_own_words(text):
    error = told(text)
    if isinstance(error, CaseError):
        assert all(p.line is None or 1 <= p.line <= text.count("\n") + 1 for p in error.problems)


@given(st.data())
def test_a_case_with_one_value_replaced(data):
    """Every line of a valid file, given another value: right, or a mistake that names a line."""
    lines = data.draw(st.sampled_from(every_text())).splitlines()
    k = data.draw(st.sampled_from([k for k, line in enumerate(lines) if " = " in line]))
    lines[k] = f"{lines[k].split(' = ')[0]} = {data.draw(VALUES)}"
    error = told("\n".join(lines))
    if isinstance(error, CaseError):
        assert error.problems


# ---- a case that is written


@pytest.mark.parametrize(
    "record",
    [
        ls.Coupling(group="top", rotation=2.0),
        ls.Rigid(group="top", rotation=[[0.0, 0.0], [1.0, 0.5]]),
        ls.Rigid(group="low", moment="3 * t"),
        ls.Output(times=[0.5, 1.0]),
    ],
)
def test_rotations_of_plane_cases_and_times_go_to_a_file_and_back(record, tmp_path):
    case = case_of(tmp_path / "a.msh", ls.Material(young=1.0, poisson=0.0), record, model="plane_strain")
    case.write(tmp_path / "again.toml")
    assert read_case(tmp_path / "again.toml") == case


# ---- the line of every key
TEXT = '''# a comment [not.a.header]
top = "a # no comment" # one = 1

[[contact]]   # [[two]]
slave = 'it''s'
"quoted key" = 1
a.b . "c.d" = 2
[[contact]]
slave = """
  [header] = "no"
""\\" quotes """""
master = \'\'\'
[[contact]]\'\'\'\'
times = [
  [0, 1], # first
  [
    1,
    2.5,
  ],
  1979-05-27 07:32:00, "]" ]
inline = { one = 1, two = { three = "}", four = [1, 2] } }

[contact.deep]
key = true
[[contact.many]]
k = 1
[[contact.many]]
k = 2
[steps]
end = 1.0'''.replace("'it''s'", "'its'")
#: line -> paths whose key stands there
WHERE = {
    2: ["top"], 4: ["contact", "contact/0"], 5: ["contact/0/slave"], 6: ["contact/0/quoted key"],
    7: ["contact/0/a", "contact/0/a/b", "contact/0/a/b/c.d"], 8: ["contact/1"], 9: ["contact/1/slave"],
    12: ["contact/1/master"], 14: ["contact/1/times"], 15: ["contact/1/times/0", "contact/1/times/0/1"],
    16: ["contact/1/times/1"], 17: ["contact/1/times/1/0"], 18: ["contact/1/times/1/1"],
    20: ["contact/1/times/2", "contact/1/times/3"], 21: ["contact/1/inline", "contact/1/inline/two/four/1"],
    23: ["contact/1/deep"], 24: ["contact/1/deep/key"], 25: ["contact/1/many/0"], 28: ["contact/1/many/1/k"],
    29: ["steps"], 30: ["steps/end"],
}  # fmt: skip


def test_lines_of_a_text():
    tomllib.loads(TEXT)
    lines = Lines(TEXT)
    for number, there in WHERE.items():
        for path in there:
            assert lines[tuple(int(key) if key.isdigit() else key for key in path.split("/"))] == number, path
    # a path that is absent has the line of what is around it
    assert (lines["steps", "count"], lines["contact", 1, "times", 7], lines["gravity",], lines[()]) == (
        29,
        14,
        None,
        None,
    )


def paths(value, path=()):
    """Every path of a document."""
    if path:
        yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from paths(item, (*path, key))


KEYS = st.one_of(st.sampled_from(["a", "b-c", "1", "_"]), st.text(max_size=4))
QUOTED = KEYS.map(lambda k: '"' + "".join(f"\\U{ord(c):08x}" for c in k) + '"')
BARE = st.sampled_from(["a", "b", "c-1", "2", "_x"])
SPACE = st.sampled_from(["", " ", "\t "])
NEWLINES = st.sampled_from(["", " ", "\n", "\n  # c ] } [[x]] \" '\n", "\n\n"])
STRINGS = st.sampled_from(
    ['"a"', '"\\""', "'b#'", '"""x\n"y" \\\\"""', "'''\n[z]\n'''", '"""a"""""', "'''b'''''", '""', "''", '"]"']
)
PLAIN = st.sampled_from(["1", "-1.5e3", "true", "inf", "1979-05-27T07:32:00Z", "07:32:00", "0xff"])


def _inside(values):
    array = st.tuples(st.lists(st.tuples(NEWLINES, values, NEWLINES).map("".join), max_size=3), st.booleans()).map(
        lambda p: "[" + ",".join(p[0]) + ("," if p[0] and p[1] else "") + "]"
    )
    pair = st.tuples(SPACE, st.one_of(BARE, QUOTED), SPACE, SPACE, values).map(
        lambda p: f"{p[0]}{p[1]}{p[2]}={p[3]}{p[4]} "
    )
    return st.one_of(array, st.lists(pair, max_size=3).map(lambda ps: "{" + ",".join(ps) + "}"))


TOML = st.recursive(st.one_of(STRINGS, PLAIN), _inside, max_leaves=8)
DOTTED = st.lists(st.tuples(SPACE, st.one_of(BARE, QUOTED), SPACE).map("".join), min_size=1, max_size=3).map(".".join)
STATEMENTS = st.one_of(
    st.tuples(DOTTED, SPACE, TOML).map(lambda p: f"{p[0]}={p[1]}{p[2]}"),
    DOTTED.map(lambda k: f"[{k}]"),
    DOTTED.map(lambda k: f"[[{k}]]"),
    st.just("# comment"),
)


@given(st.lists(st.tuples(STATEMENTS, SPACE).map("".join), max_size=8).map("\n".join))
def test_every_path_of_tomllib_has_a_line_and_no_other_has(text):
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    lines = Lines(text)
    assert set(lines) == set(paths(document))
    assert all(1 <= lines[p] <= text.count("\n") + 1 for p in lines)


@given(st.lists(st.sampled_from(["x{} = 1", "x{} = [\n1,\n\n2]", 'x{} = """\n\n"""', "# c", ""]), max_size=12))
def test_keys_stand_where_they_were_written(parts):
    """A key's line is one more than the line breaks before it."""
    text, expected = "", {}
    for k, part in enumerate(parts):
        if part.startswith("x"):
            expected[f"x{k}",] = text.count("\n") + 1
        text += part.format(k) + "\n"
    lines = Lines(text)
    assert {p: lines[p] for p in lines if len(p) == 1} == expected


# ---- the table of keys as text and as JSON Schema


@cache
def validator():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft7Validator.check_schema(json_schema())
    return jsonschema.Draft7Validator(json_schema())


def test_json_schema_takes_what_the_parser_takes():
    for text in every_text():
        assert isinstance(parse_case(text), Case)
        assert [e.message for e in validator().iter_errors(tomllib.loads(text))] == [], text


@pytest.mark.parametrize(("text", "said"), SHOWN, ids=[said for _, said in SHOWN])
def test_json_schema_sees_the_mistakes_that_a_row_shows(text, said):
    document = json.loads(json.dumps(tomllib.loads(text), default=lambda date: {"date": str(date)}))
    assert not validator().is_valid(document)


def test_schemas_have_every_key_with_its_meaning_and_unit():
    text, whole = schema_text(), json_schema()
    assert max(map(len, text.splitlines())) <= 120
    for record in records():
        section, keys = record.SECTION, record.KEYS
        table = whole["properties"][section.name] if section.name else whole
        start = text.index(f"\n{section.header}  ") if section.name else 0
        part = text[start : text.find("\n\n", start) if section.name else text.index("\n\n[[")]
        for name, key in keys.items():
            assert table.get("items", table)["properties"][name]["description"].startswith(key.meaning)
            assert re.search(rf"^  {name} ", part, re.MULTILINE), name
            assert not key.unit or f"[{key.unit}]" in re.sub(r"\s+", " ", part), name
            assert all(f"  {word}: {meaning}" in part for word, meaning in key.kind.options.items()), name


def test_examples_of_the_page(fresh, capsys):
    """The TOML of the page is a case that can be run, and the same as the one made in Python beside it.

    A block without a mesh is added to the first case.
    """
    text = (REPOSITORY / "docs" / "case.md").read_text(encoding="utf-8")
    toml, *more = re.findall(r"^```toml\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    (python,) = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    names: dict = {}
    exec(python, names)
    assert parse_case(toml) == names["case"]
    (fresh / "case.toml").write_text(toml, encoding="utf-8")
    assert main(["validate", "case.toml"]) == 0
    assert "rigid-body mode without support" in capsys.readouterr().out
    assert main(["run", "case.toml", "-q"]) == 0
    assert len(more) >= 3
    for k, other in enumerate(more):
        whole = other if "mesh = " in other else f"{toml}\n{other}"
        (fresh / f"case_{k}.toml").write_text(whole, encoding="utf-8")
        assert main(["validate", f"case_{k}.toml"]) == main(["run", f"case_{k}.toml", "-q"]) == 0


def test_the_table_of_keys_is_whole(monkeypatch):
    """Every field is a key or a section, what these refer to is there, in later stages too.

    The built page has all tables; the page in the repository names every section, with keys that it has.
    """
    page = (REPOSITORY / "docs" / "case.md").read_text(encoding="utf-8")
    monkeypatch.syspath_prepend(str(REPOSITORY / "docs"))
    built = importlib.import_module("tables").with_tables("case.md", page, built=True)
    assert [name for name, table in page_tables().items() if table not in built] == []
    rows = dict(re.findall(r"^\| `?([^`|]+)`? \| [^|]+ \| (.+) \|$", page.split("## Values")[0], re.MULTILINE))
    for record in records():
        section = record.SECTION
        listed = set(re.findall(r"`(\w+)`", rows[section.header if section.name else "top of the file"]))
        words = {word for key in record.KEYS.values() for word in key.kind.options}
        assert listed and listed <= {*record.KEYS, *words}, section.header
    for record in records():
        keys, section = record.KEYS, record.SECTION
        other = {f.name for f in fields(record)} - set(keys) - set(record.SECTIONS)
        assert other <= {"place", "path", "why"} or record is Cyclic, record
        assert {n for names in (*section.one_of, *section.some_of, *section.not_both) for n in names} <= set(keys)
        for name, key in keys.items():
            assert key.meaning and key.kind.words, name
            assert "Value(" not in told_default(key, record.DEFAULTS[name])
            assert not key.needs or set(key.needs.values) <= set(keys[key.needs.key].kind.known)
    kinds = {**Case.KEYS, **Contact.KEYS}
    assert set(kinds["model"].kind.known) == set(MODELS)
    assert set(kinds["normals"].kind.known) == {*NORMALS, "slave"}


def test_reading_needs_no_numpy(tmp_path):
    """Nor scipy, nor numba: validate and schema answer at once."""
    (tmp_path / "a.toml").write_text(BY_HAND, encoding="utf-8")
    script = (
        "import sys; from lacsolver.case import read_case; from lacsolver.case.schema import schema_text, json_schema\n"
        "case = read_case(sys.argv[1]); schema_text(); json_schema()\n"
        "assert not {'numpy', 'scipy', 'numba', 'h5py'} & set(sys.modules), 'numpy'\n"
        "case.pressure[0].value([[0.0, 0.0, 0.0]], 0.5); assert 'numpy' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "a.toml")], check=True, cwd=REPOSITORY)
