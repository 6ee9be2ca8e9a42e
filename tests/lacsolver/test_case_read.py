"""Case files: every key and option is read, every mistake is told with its line, and all of them at once."""

from __future__ import annotations

import string
import tomllib
from dataclasses import MISSING, replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import lacmesh
import lacsolver as ls
from lacmesh.errors import LacmeshError, ReadError
from lacsolver.case import Case, CaseError, parse_case, read_case
from lacsolver.case.entry import same
from lacsolver.case.keys import defaults_of, keys_of
from lacsolver.case.kinds import Choice
from lacsolver.case.schema import records
from lacsolver.cli import main
from tests.lacsolver.case_mistakes import MISTAKES
from tests.lacsolver.case_texts import FINITE, PLANE, SMALL, STRAIN, VALID
from tests.viewing import DATA


def tables(text):
    """(record class, the table of the file) of every section of a text."""
    document = tomllib.loads(text)
    for record in records():
        section = record.SECTION
        if not section.name:
            yield record, {k: v for k, v in document.items() if k in keys_of(record)}
        else:
            given = document.get(section.name, [] if section.several else {})
            yield from ((record, table) for table in (given if isinstance(given, list) else [given]))


# ---- what is right


@pytest.mark.parametrize("text", VALID, ids=range(len(VALID)))
def test_valid(text):
    assert isinstance(parse_case(text), Case)


@pytest.mark.parametrize("record", records(), ids=lambda r: r.__name__)
def test_every_key_and_every_option_is_read(record):
    """Each key is given another value than its default by some valid file; each option by some file."""
    given = [table for text in VALID for of, table in tables(text) if of is record]
    for name, key in keys_of(record).items():
        if name in ("constants", "harmonic"):  # of laws that a program adds: test_added_*.py; 0 alone
            continue
        kind, default = key.kind, defaults_of(record)[name]
        values = [kind.read(table[name]) for table in given if name in table]
        assert values, name
        assert any(default is MISSING or not same(v, default) for v in values), name
        if isinstance(kind, Choice):
            assert set(values) | {default} >= set(kind.known), name


def test_what_a_case_holds():
    case = parse_case(SMALL, "folder/press.toml")
    assert case.mesh == Path("folder/two_blocks.med") and case.path == Path("folder/press.toml")
    assert (case.model, case.kinematics, case.thickness) == ("3d", "small", None)
    steel, wood, metal = case.material
    assert steel.groups == ("lower", "7", "3:8") and steel.young == 2000.0 and isinstance(steel.young, float)
    assert wood.young == (11000.0, 400.0, 300.0) and wood.axes == ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    assert metal.hardening == ((250.0, 0.0), (300.0, 0.05)) and metal.kinematic == 1000.0
    joint, other, *_ = case.contact
    assert (joint.name, other.name) == ("joint", "Group_3")
    assert (joint.geometry, other.geometry, case.contact[2].geometry) == ("current", "reference", "reference")
    assert joint.clearance([[0, 0, 0]], 0.5) == [-0.01]  # not a load: not ramped
    assert other.clearance([[2, 0, 0]], 0.5) == [0.502]
    assert case.tie[0].name == "glue"
    assert [v.at(1.0) for v in case.rigid[0].rotation] == [0.0, 0.1, 0.5]
    assert case.rigid[0].uz.at(0.5) == -0.25 and case.rigid[0].ux.at(0.5) == pytest.approx(0.479425538604203)
    assert case.displacement[2].at == (0.0, 0.0, 1.5) and case.displacement[2].group is None
    assert case.spring[0].kz == 3.0
    assert case.pressure[0].value([[0, 0, 0]], 0.5) == [6.25]
    assert case.gravity.gz([[0, 0, 0]], 2.0) == [-9810.0]
    assert case.temperature[0].value([[1, 0, 0]], 0.0) == [101.0]
    assert [probe.name for probe in case.probe] == ["tip", "origin"]
    assert case.steps.planned == (0.5, 1.0, 1.5, 2.0) and case.steps.last == 2.0
    assert case.output.every == 2
    assert (
        case.pressure[0].place == f"folder/press.toml, line {SMALL[: SMALL.index('[[pressure]]')].count(chr(10)) + 1}"
    )


def test_what_a_case_holds_without_being_told():
    case = parse_case('mesh = "/a/b.msh"\nmodel = "3d"\n[[material]]\nyoung = 1\npoisson = 0\n')
    assert case.mesh == Path("/a/b.msh") and case.kinematics == "small"
    assert case.material[0].groups is None and case.material[0].law == "elastic"
    assert case.contact == () and case.gravity is None
    assert (case.steps.planned, case.steps.max_halvings) == ((1.0,), 6)
    assert (case.solver.backend, case.output.format) == ("auto", "vtu")


def test_finite_kinematics_look_at_the_current_geometry():
    case = parse_case(FINITE)
    assert case.contact[0].geometry == "current" and case.pressure[0].follower
    assert case.steps.planned == (0.25, 0.5, 2.0) and case.steps.last == 2.0
    assert case.pressure[0].value([[0, 0]], 1.0) == [0.5]
    assert parse_case(PLANE).contact[0].geometry == "reference"
    assert [v.at(0.75) for v in parse_case(STRAIN).rigid[0].rotation] == [0.5]


def test_defaults_of_records_are_what_their_kinds_read():
    for record in records():
        for name, key in keys_of(record).items():
            default = defaults_of(record)[name]
            if default is not MISSING and default is not None:
                assert key.kind.read(default) == default, name


def test_a_file(tmp_path):
    path = tmp_path / "press.toml"
    path.write_bytes(b"\xef\xbb\xbf" + SMALL.replace("\n", "\r\n").encode())  # as an editor on Windows saves it
    assert read_case(path).mesh == tmp_path / "two_blocks.med"


def test_matrices_need_no_material():
    text = 'mesh = "a.msh"\nmodel = "3d"\n[[contact]]\nslave = "a"\nmaster = "b"\n'
    assert parse_case(text, matrices=True).material == ()
    with pytest.raises(CaseError, match=r"case.toml: the top of the file needs a \[\[material\]\]"):
        parse_case(text)
    with pytest.raises(CaseError, match=r"needs a \[\[contact\]\] or a \[\[tie\]\]"):
        parse_case('mesh = "a.msh"\nmodel = "3d"\n', matrices=True)


# ---- what is wrong


@pytest.mark.parametrize(("text", "said"), MISTAKES, ids=[said for _, said in MISTAKES])
def test_one_mistake(text, said):
    with pytest.raises(CaseError) as error:
        parse_case(text, "press.toml")
    marked = [k for k, line in enumerate(text.splitlines(), 1) if line.endswith("#!")]
    problems = [p for p in error.value.problems if said in p.message]
    assert problems, str(error.value)
    assert len(error.value.problems) == (2 if "whole mesh" in said else 1), str(error.value)
    if marked:
        assert [p.line for p in problems] == marked
        assert str(error.value).startswith(f"press.toml, line {marked[0]}: ")
    assert error.value.status == 1 and error.value.path == "press.toml"


def test_all_at_once_in_the_order_of_lines():
    """The marked lines, and these only, each with one mistake."""
    text = """mesh = 3 #!
model = "3e" #!
[[material]]
young = -1 #!
poisson = 0.7 #!
colour = "red" #!
[[contact]]
slave = "a"
master = "a" #!
clearance = "x +" #!
[[contact]] #!
slave = "b"
normals = "smooth" #!
[[displacement]]
group = "g"
ux = [[1, 0],
 [0, 1]] #!
[stepz] #!
"""
    with pytest.raises(CaseError) as error:
        parse_case(text)
    assert [p.line for p in error.value.problems] == [k for k, s in enumerate(text.splitlines(), 1) if "#!" in s]
    assert len(str(error.value).splitlines()) == len(error.value.problems)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("mesh = ", "line 1: Invalid value (the file ends)"),
        ('mesh = "a"\nmodel = "3d\n', "line 2: Illegal character '\\n' (column 12)"),
        ('mesh = "a"\n\nmesh = "b"\n', "line 3: Cannot overwrite a value"),
        ("[steps]\n[steps]\n", "line 2: Cannot declare ('steps',) twice"),
        ("[[contact]]\nslave = [1,\n2\n", "line 4: Unclosed array (the file ends)"),
        ('a = """\n\n', "line 3: Unterminated string (the file ends)"),
        ("x = " + "9" * 5000, "is no TOML text"),
        ("x = " + "[" * 100_000, "is nested too deeply to be read"),
        ("x = 2020-13-45", "line 1: "),
        ("x = 00", "line 1: "),
        ("[[contact]]\nslave = arc\n", 'line 2: slave = arc is text without quotes; write slave = "arc"'),
        ("[[pressure]]\nfollower = True # as in Python\n", "line 2: follower = True is no TOML; write follower = true"),
        ("[[material]]\nyoung = 1000.\n", "line 2: young: 1000. is no number of TOML, which wants digits before and"),
        ("young = 1000.", "line 1: young: 1000. is no number of TOML"),
        ("[[material]]\nyoung = 1000. # MPa\n", "after a point; write 1000.0"),
        ("poisson = .3\n", "write 0.3"),
        ("x = +.5\n", "write +0.5"),
        ("x = 1e3.\n", "write 1e3"),
        ("x = 2.1D5\n", "write 2.1e5"),
        ("x = 007\n", "write 7"),
        (
            "axis = [0.0, 1., 0.0]\n",
            "axis: 1. is no number of TOML, which wants digits",
        ),
        ("x = 2000,0\n", "x = 2000,0 has a comma, which no number of TOML has; write 2000.0"),
        ("x = 1,000\n", "x = 1,000 has a comma, which no number of TOML has; write 1000 or 1.000"),
        ("thickness = None\n", "thickness = None is no TOML; leave the key out"),
        ("mesh = ../my blocks.msh\n", 'write mesh = "../my blocks.msh"'),
        ('mesh = "C:\\work\\m.msh"\n', "mesh: a backslash in double quotes begins a code"),
    ],
    ids=range(26),
)
def test_no_toml(text, said):
    with pytest.raises(ReadError) as error:
        parse_case(text, "press.toml")
    assert said in str(error.value) and str(error.value).startswith("press.toml") and error.value.status == 3


@pytest.mark.parametrize("command", ["run", "validate", "modes", "matrices"])
def test_what_is_no_case_is_told_by_what_it_is(tmp_path, capsys, command):
    """Instead of a statement that is invalid."""
    mesh, results = tmp_path / "press.msh", tmp_path / "press"
    lacmesh.write(mesh, lacmesh.read(DATA / "two_blocks.msh"))
    lacmesh.write(tmp_path / "press.med", lacmesh.read(DATA / "two_blocks.msh"))
    results.mkdir()
    (results / "history.csv").write_text("time\n")
    (tmp_path / "empty.toml").write_text("\n")
    (tmp_path / "packed.toml").write_bytes(b"\x7fELF\x00\xff" * 20)
    for path, said in (
        (
            mesh,
            "is a mesh (msh), and not a case; lacsolver new press.msh writes a first case for it",
        ),
        (tmp_path / "press.med", "is a mesh (med), and not a case"),
        (DATA / "punch.inp", "and not a case; lacsolver import punch.inp makes a case of it"),
        (results, "is a folder of results, and not a case; --restart"),
        (tmp_path, "is a folder, and not a case; it holds empty.toml, packed.toml"),
        (tmp_path / "empty.toml", "is empty; a case is a text file"),
        (tmp_path / "packed.toml", "is a binary file, and not a case"),
    ):
        assert main([command, str(path), *([] if command == "validate" else ["-o", str(tmp_path / "out.npz")])]) == 3
        (line,) = capsys.readouterr().err.splitlines()
        assert str(path) in line and said in line


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ReadError, match=r"absent.toml: cannot be read \(No such file"):
        read_case(tmp_path / "absent.toml")
    with pytest.raises(ReadError, match=r"is a folder, and not a case$"):
        read_case(tmp_path)
    (tmp_path / "latin.toml").write_bytes("mesh = 'a'\n# d\xe9j\xe0\n".encode("latin-1"))
    with pytest.raises(ReadError, match=r"latin\.toml, line 2: is not UTF-8 text"):
        read_case(tmp_path / "latin.toml")


@pytest.mark.parametrize("depth", [50, 200, 300, 320, 330, 340, 400, 480, 600])
@pytest.mark.parametrize("what", ["array", "inline", "header"])
def test_depth_is_no_crash(what, depth):
    """Deep nesting is refused with an error both where tomllib still reads it and where it gives up."""
    text = {
        "array": "mesh = " + "[" * depth + "]" * depth,
        "inline": "mesh = " + "{a = " * depth + "1" + "}" * depth,
        "header": f"[{'.'.join('a' * depth)}]",
    }[what]
    with pytest.raises((CaseError, ReadError)):
        parse_case(text)


# ---- fuzzing: nothing but the documented errors

NAMES = sorted({n for r in records() for n in [*keys_of(r), r.SECTION.name] if n} | {"x", "a"})
TEXTS = st.sampled_from(
    ["3d", "plane_strain", "small", "finite", "x * t", "1 /", "a", "", "neo_hookean", "smoothed", "node"]
)
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


@given(st.text(alphabet=string.printable, max_size=80))
def test_garbage(text):
    told(text)


@given(st.lists(LINES, max_size=12).map("\n".join))
def test_garbage_of_our_own_words(text):
    error = told(text)
    if isinstance(error, CaseError):
        assert all(p.line is None or 1 <= p.line <= text.count("\n") + 1 for p in error.problems)


@given(st.sampled_from(VALID), st.data())
def test_a_case_with_one_value_replaced(text, data):
    """Every line of a valid file, given another value: right, or a mistake that names a line."""
    lines = text.splitlines()
    k = data.draw(st.sampled_from([k for k, line in enumerate(lines) if " = " in line]))
    lines[k] = f"{lines[k].split(' = ')[0]} = {data.draw(VALUES)}"
    error = told("\n".join(lines))
    if isinstance(error, CaseError):
        assert error.problems


# ---- a case that is written


def rewritten(case, folder):
    """The case of the file that a case is written into, and its text."""
    case.write(folder / "again.toml")
    return read_case(folder / "again.toml"), (folder / "again.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", sorted(DATA.rglob("*.toml")), ids=lambda path: path.stem)
def test_a_case_file_goes_to_a_case_and_back(path, tmp_path):
    case = read_case(path)
    again, text = rewritten(case, tmp_path)
    assert replace(again, mesh=case.mesh) == case and rewritten(again, tmp_path)[1] == text


IN_PLANE = {
    "coupling": [ls.Coupling(group="top", rotation=2.0)],
    "rigid": [ls.Rigid(group="top", rotation=[[0.0, 0.0], [1.0, 0.5]]), ls.Rigid(group="low", moment="3 * t")],
    "output": ls.Output(times=[0.5, 1.0]),
}


@pytest.mark.parametrize("name", IN_PLANE)
def test_rotations_of_plane_cases_and_times_go_to_a_file_and_back(name, tmp_path):
    material = [ls.Material(young=1.0, poisson=0.0)]
    case = ls.Case(mesh=tmp_path / "a.msh", model="plane_strain", material=material, **{name: IN_PLANE[name]})
    assert rewritten(case, tmp_path)[0] == case
