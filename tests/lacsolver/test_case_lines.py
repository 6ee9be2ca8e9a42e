"""The line of every key, on texts whose answer is known, and against tomllib on texts made at random."""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lacsolver.case.lines import Lines

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

WHERE = {
    ("top",): 2,
    ("contact",): 4,
    ("contact", 0): 4,
    ("contact", 0, "slave"): 5,
    ("contact", 0, "quoted key"): 6,
    ("contact", 0, "a"): 7,
    ("contact", 0, "a", "b"): 7,
    ("contact", 0, "a", "b", "c.d"): 7,
    ("contact", 1): 8,
    ("contact", 1, "slave"): 9,
    ("contact", 1, "master"): 12,
    ("contact", 1, "times"): 14,
    ("contact", 1, "times", 0): 15,
    ("contact", 1, "times", 0, 1): 15,
    ("contact", 1, "times", 1): 16,
    ("contact", 1, "times", 1, 0): 17,
    ("contact", 1, "times", 1, 1): 18,
    ("contact", 1, "times", 2): 20,
    ("contact", 1, "times", 3): 20,
    ("contact", 1, "inline"): 21,
    ("contact", 1, "inline", "two", "four", 1): 21,
    ("contact", 1, "deep"): 23,
    ("contact", 1, "deep", "key"): 24,
    ("contact", 1, "many", 0): 25,
    ("contact", 1, "many", 1, "k"): 28,
    ("steps",): 29,
    ("steps", "end"): 30,
}


@pytest.mark.parametrize("path", WHERE, ids=lambda p: ".".join(map(str, p)))
def test_lines_of_a_text(path):
    tomllib.loads(TEXT)
    assert Lines(TEXT)[path] == WHERE[path]


def test_absent_paths_have_the_line_of_what_is_around_them():
    lines = Lines(TEXT)
    assert lines["steps", "count"] == 29
    assert lines["contact", 1, "times", 7] == 14
    assert lines["gravity",] is None and lines[()] is None


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


VALUES = st.recursive(st.one_of(STRINGS, PLAIN), _inside, max_leaves=8)
DOTTED = st.lists(st.tuples(SPACE, st.one_of(BARE, QUOTED), SPACE).map("".join), min_size=1, max_size=3).map(".".join)
STATEMENTS = st.one_of(
    st.tuples(DOTTED, SPACE, VALUES).map(lambda p: f"{p[0]}={p[1]}{p[2]}"),
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
