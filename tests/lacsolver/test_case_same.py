"""Comparison of cases, and look-up of the groups that a case names in a mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh
from lacsolver.case import CaseError, changed, digest, fingerprint, parse_case
from lacsolver.case.groups import check_groups
from tests.lacsolver.case_texts import SMALL


@pytest.fixture
def folder(tmp_path):
    return tmp_path


def read(folder, old="", new=""):
    assert old in SMALL
    return parse_case(SMALL.replace(old, new, 1), folder / "press.toml")


def test_a_digest_is_a_fixed_text_for_a_fixed_case(folder):
    assert digest(read(folder), mesh()) == digest(read(folder), mesh()) and len(digest(read(folder), mesh())) == 32
    assert set(fingerprint(read(folder), mesh())) >= {"mesh", "model", "material", "contact", "pressure", "gravity"}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("young = 2000", "young = 2000.0"),
        ('\n[[contact]]\nname = "joint"', '\n# a comment\n[[contact]]\n\nname = "joint"'),
        ('hexa = "pyramid"\n', ""),
        ("count = 4", "count = 8"),
        ("max_halvings = 3", "max_halvings = 1"),
        ('backend = "rslab"', 'backend = "auto"'),
        ("every = 2", "every = 1"),
        ('name = "tip"', 'name = "top"'),
        ('mesh = "two_blocks.med"', 'mesh = "elsewhere/two_blocks.med"'),
    ],
)
def test_the_same_case(folder, old, new):
    assert digest(read(folder), mesh()) == digest(read(folder, old, new), mesh())
    assert changed(fingerprint(read(folder), mesh()), fingerprint(read(folder, old, new), mesh())) == ()


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("young = 2000", "young = 2001", ("material",)),
        ("value = 25.0", "value = 26.0", ("pressure",)),
        ("value = 25.0", 'value = "25"', ("pressure",)),
        ('clearance = "1e-3 * x + t"', 'clearance = "1e-3 * x"', ("contact",)),
        ("uz = [[0, 0], [0.5, 1], [1, 0]]", "uz = [[0, 0], [0.5, 2], [1, 0]]", ("displacement",)),
        ("at = [0.0, 0.0, 1.5]", "at = [0.0, 0.0, 1.0]", ("displacement",)),
        ("[gravity]\ngx = 0.5\n", "[gravity]\n", ("gravity",)),
        ("moment = [1.0, 0.0, 0.0]", "moment = [1.0, 0.0, 0.5]", ("rigid",)),
        ("end = 2.0", "end = 3.0", ("rigid", "displacement", "pressure", "traction", "force", "body_force", "gravity")),
    ],
)
def test_another_case(folder, old, new, part):
    assert changed(fingerprint(read(folder), mesh()), fingerprint(read(folder, old, new), mesh())) == part
    assert digest(read(folder), mesh()) != digest(read(folder, old, new), mesh())


def test_the_same_mesh(folder):
    """Numbers, a group that the case does not name, and one that a probe alone names do not matter."""
    case, probed = (parse_case(text, folder / "case.toml") for text in (NAMED, NAMED + PROBE))
    groups = {**mesh().cell_groups, "new": np.array([1])}
    renumbered = replace(mesh(), node_number=np.arange(10, 14), cell_groups=groups)
    assert digest(case, mesh()) == digest(case, renumbered) == digest(probed, renumbered)


def test_a_longer_run_is_the_same_case_where_nothing_is_ramped(folder):
    head = 'mesh = "two_blocks.med"\nmodel = "3d"\nmaterial = [{young = 1, poisson = 0}]\n'
    load = 'pressure = [{group = "a", value = "t"}]\ndisplacement = [{group = "b", ux = 0.0}]\n'
    one, other = (parse_case(head + load + f"steps = {{end = {end}}}\n", folder / "a.toml") for end in (1, 2))
    assert digest(one, mesh()) == digest(other, mesh())


def test_functions_count_by_their_names(folder):
    from lacsolver.case import Case, Pressure

    def rising(x, t):
        return t

    def other(x, t):
        return t

    def made(function):
        return Case(mesh=folder / "two_blocks.med", model="3d", pressure=[Pressure(group="a", value=function)])

    one, again, another = (digest(made(f), mesh()) for f in (rising, rising, other))
    assert one == again != another


# ---- groups


def mesh():
    return Mesh.create(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [("TETRA4", [[0, 1, 2, 3]]), ("TRIA3", [[0, 2, 1], [1, 2, 3]])],
        cell_groups={"body": [0], "lower": [1], "upper": [2], "both": [1]},
        node_groups={"tip": [3], "both": [1]},
        group_tags={"upper": ((2, 7),)},
    )


CASE = """mesh = "a.msh"
model = "3d"
[[material]]
groups = ["body"]
young = 1.0
poisson = 0.3
[[contact]]
slave = 7
master = "lower"
[[displacement]]
group = "tip"
ux = 0.0
[[displacement]]
group = "both"
kind = "node"
uy = 0.0
[[rigid]]
group = "both"
kind = "cell"
[[pressure]]
group = "2:7"
value = 1.0
"""


NAMED = """mesh = "a.msh"
model = "3d"
[[material]]
young = 1.0
poisson = 0.3
[[contact]]
slave = "lower"
master = "upper"
"""
PROBE = """[[probe]]
name = "new"
group = "new"
"""


def test_groups_that_are_there():
    text = CASE.replace('[[rigid]]\ngroup = "both"\nkind = "cell"\n', "")
    check_groups(parse_case(text), mesh())
    check_groups(parse_case(text.replace('group = "both"\nkind = "node"', 'group = "both"\nkind = "cell"')), mesh())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'groups = ["body"]',
            'groups = ["body", "bodi"]',
            "line 3: material.groups: no cell group named 'bodi'; did you mean body?",
        ),
        ("slave = 7", "slave = 8", "case.toml, line 7: contact.slave: no cell group named '8'"),
        ('master = "lower"', 'master = "tip"', "case.toml, line 7: contact.master: 'tip' is a group of nodes, and a"),
        ('group = "tip"', 'group = "top"', "line 10: displacement.group: no group named 'top'; did you mean tip?"),
        ('group = "tip"', 'group = "lower"\nkind = "node"', "displacement.group: no node group named 'lower'"),
        ('group = "tip"', 'group = "tip"\nkind = "cell"', "displacement.group: 'tip' is a group of nodes, and a"),
        ('group = "2:7"', 'group = "tip"', "pressure.group: 'tip' is a group of nodes, and a"),
    ],
)
def test_groups_that_are_missing(old, new, said):
    text = CASE.replace('[[rigid]]\ngroup = "both"\nkind = "cell"\n', "")
    assert old in text
    with pytest.raises(CaseError) as error:
        check_groups(parse_case(text.replace(old, new)), mesh())
    assert said in str(error.value) and len(error.value.problems) == 1 and error.value.status == 1


def test_all_missing_groups_at_once():
    with pytest.raises(CaseError) as error:
        check_groups(parse_case(SMALL), mesh())
    assert len(error.value.problems) > 20
