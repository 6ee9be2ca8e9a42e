"""The notes of lacmesh in files: each has a value that comes back from JSON, and others that are refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from lacmesh.formats import notes
from lacmesh.formats.note_types import DAMAGE, from_plain, to_plain
from lacmesh.formats.notes import ARRAY_NOTES, CUT_NOTES, MED_NOTES, MSH_NOTES, CellsNote, FieldNote
from lacmesh.mesh import Model, Periodic, Step

_LINK = Periodic((2, 1), (2, 7), (1.0, 0.5), np.array([[0, 4], [1, 5]]))
_CELLS = CellsNote("TRIA7", np.array([9]), np.arange(1, 8)[None], np.array([[2, 5]]), np.array([3]))
_FIELDS = {("node", "T", 0): FieldNote("T@0", "température", 1, -1, (2, 2), False)}
_FIELDS |= {("cell", "s", 2): FieldNote("s", "s", 2, -1, None, True)}
#: note -> a value of it, and JSON data that are none
MESH = {
    "name": ("Körper", [7, None, ["a"]]),
    "space_dim": (2, [0, 4, 2.0, "2", True]),
    "zones": (("a", "b"), ["a", [7], {"a": 1}]),
    "group_tags": ({"g": ((2, 5), (3, 1))}, [{"g": [[2]]}, {"g": [[2, 5, 1]]}, [["g"]], {"g": [[2, 5.0]]}]),
    "steps": ({"T@0": Step("T", 0, -1, 0.5)}, [{"T@0": ["T", 0, -1]}, {"T@0": ["T", "0", -1, 0.5]}, {"T": 1}]),
    "model": (
        Model({(3, 1): (1, -2), (2, 1): ()}, (_LINK,)),
        [{}, {"boundary": [], "periodic": [{}]}, {"boundary": [[3]], "periodic": []}, {"boundary": 1, "periodic": []}],
    ),
}
VALUES = {
    "ARRAY_NOTES": MESH
    | {
        "names": ({"cell": {"a_b": "a b"}}, [{"cell": ["a"]}, {"cell": {"a": 1}}, "a"]),
        "shapes": ({"node": {"s": (3, 3)}}, [{"node": {"s": 3}}, {"node": {"s": [1.5]}}]),
        "own": (("tags",), [[1], "tags"]),
        "groups": (("group:a",), [[None], {}]),
        "file_order": (np.array([2, 0, 1]), [[1.5], [[1]], ["1"], [2**70]]),
    },
    "MED_NOTES": {"mesh": ("m", [1]), **{name: MESH[name] for name in ("zones", "group_tags", "model")}},
    "MSH_NOTES": {
        "nodes": (12, ["12", 1.5, 2**63, None]),
        "cells": (6, [[6]]),
        **{name: MESH[name] for name in ("name", "space_dim", "zones")},
        "groups": ({"g": ((2, 5),)}, [{"g": []}, [{"name": "g"}], [{"name": 1, "tags": []}], [7]]),
        "node_groups": ({"g": np.array([4, 9])}, [[{"name": "g", "nodes": ["4"]}], [{"nodes": [4]}]]),
        "cell_groups": ({"g": np.array([1])}, [[{"name": "g", "nodes": [1]}], 7]),
        "extra_cells": (
            (_CELLS,),
            [
                [{"type": "TRIA7"}],
                [{"type": "?", "number": [], "nodes": [], "entity": [], "at": []}],
                [{"type": "TRIA7", "number": [9], "nodes": [1, 2], "entity": [2, 5], "at": [3]}],
            ],
        ),
        "node_entity": (np.array([[2, 1, 4], [3, 1, 8]]), [[1, 2], [[1, 2, 3]], "1"]),
        "boundary": ({(3, 1): (1, -2)}, [[[3, 1]], [[3, 1, 5]], [3]]),
        "fields": (_FIELDS, [[{"on": "node"}], {"on": "node"}]),
    },
    "CUT_NOTES": {
        "nodes": (12, ["12"]),
        "cells": ({"HEXA8": 2}, [2, {"HEXA8": "2"}]),
        "digest": ("ab", [7]),
        "zones": (("slave",), ["slave"]),
        "children": (
            {name: np.array([k, -1]) for k, name in enumerate(("cell", "macro", "zone", "child", "parent"))},
            [{"cell": [1]}, [1]],
        ),
        "internal": (
            {"node": np.array([7]), "macro": np.array([0])},
            [{"node": [7], "macro": []}, {"node": [7], "macro": [-2]}, {"node": [7], "macro": [0.5]}],
        ),
    },
}
TABLES = {"ARRAY_NOTES": ARRAY_NOTES, "MED_NOTES": MED_NOTES, "MSH_NOTES": MSH_NOTES, "CUT_NOTES": CUT_NOTES}


def same(a, b):
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.shape == b.shape and np.array_equal(a, b)
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (Model, Periodic)):
        return type(a) is type(b) and same(vars(a), vars(b))
    if isinstance(a, tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


def test_every_note_of_every_table_is_tried():
    assert {name: list(values) for name, values in VALUES.items()} == {name: list(t) for name, t in TABLES.items()}
    assert {name for name in vars(notes) if name.endswith("_NOTES") and name[0] != "_"} == set(TABLES)


@pytest.mark.parametrize("name", TABLES)
def test_values_come_back_from_json(name):
    values = {key: value for key, (value, _) in VALUES[name].items()}
    text = json.dumps(to_plain(values, TABLES[name]))
    back = from_plain(json.loads(text), TABLES[name])
    assert same(values, back)
    assert json.dumps(to_plain(back, TABLES[name])) == text


@pytest.mark.parametrize(("name", "key"), [(name, key) for name, values in VALUES.items() for key in values])
def test_other_data_are_refused(name, key):
    for wrong in VALUES[name][key][1]:
        with pytest.raises(DAMAGE):
            from_plain({key: wrong}, TABLES[name])


def test_nothing_is_noted_of_what_is_empty():
    empty = {"zones": (), "group_tags": {}, "steps": {}, "model": None, "names": {}, "name": "", "space_dim": 3}
    assert to_plain(empty, ARRAY_NOTES) == {"name": "", "space_dim": 3}


def test_a_link_of_nodes_that_are_not_there_is_refused():
    assert notes.mesh_fields({"model": Model({}, (_LINK,)), "mesh": "m"}, 6).keys() == {"model"}
    with pytest.raises(ValueError, match="periodic node outside"):
        notes.mesh_fields({"model": Model({}, (_LINK,))}, 5)
