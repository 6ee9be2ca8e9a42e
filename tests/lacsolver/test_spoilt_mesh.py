"""Mesh defects that would silently give a wrong answer are refused, or warned of in the words of the check."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.errors import LacmeshWarning
from lacsolver.case import CaseError, parse_case
from lacsolver.problem.problem import Problem
from lacsolver.validation import validate

CASE = """
mesh = "nowhere.msh"
model = "plane_strain"
[[material]]
young = 2000.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
[[displacement]]
group = "top"
ux = 0.0
uy = -0.02
"""


def blocks(n=4, glued=(), more=(), moved=None):
    """Two rows of n squares, one on the other; nodes of the upper one's foot that are `glued` are the lower one's.

    `more`: cells beside; `moved` (node, place).
    """
    x = np.arange(n + 1.0)
    points = np.concatenate([np.stack([x, np.full(n + 1, y)], axis=1) for y in (0.0, 1.0, 1.0, 2.0)])
    if moved is not None:
        points[moved[0]] = moved[1]
    row = np.arange(n + 1)
    low, foot = n + 1 + row, 2 * (n + 1) + row
    foot = np.where(np.isin(row, glued), low, foot)
    rows = row, low, foot, 3 * (n + 1) + row
    quads = [np.stack([a[:-1], a[1:], b[1:], b[:-1]], axis=1) for a, b in (rows[:2], rows[2:])]
    lines = [np.stack([a[:-1], a[1:]], axis=1) for a in (rows[2][::-1], rows[1], rows[0][::-1], rows[3])]
    used = np.concatenate([*quads, *([more] if len(more) else [])])
    names = {name: len(used) + k * n + np.arange(n) for k, name in enumerate(("slave", "master", "bottom", "top"))}
    return Mesh.create(points, [("QUAD4", used), ("SEG2", np.concatenate(lines))], cell_groups=names)


def refused_by_run(case, mesh):
    try:
        Problem.of(case, mesh)
    except CaseError as error:
        return [p.message for p in error.problems]
    return []


def told(mesh):
    """Errors and warnings of a run on a mesh; `validate` gives the same."""
    case, said = parse_case(CASE), []
    for look in (refused_by_run, lambda *given: [p.message for p in validate(*given).problems]):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            said.append((look(case, mesh), [str(w.message) for w in caught if isinstance(w.message, LacmeshWarning)]))
    assert said[0] == said[1]
    return said[0]


def of_check(mesh, rule):
    (found,) = lacmesh.check(mesh, "slave", "master").of_rule(rule)
    return found.message


def test_a_good_mesh_is_taken():
    assert told(blocks()) == ([], [])


@pytest.mark.parametrize(("glued", "refused"), [(range(5), True), ((1, 2), True), ((2,), False)])
def test_a_slave_face_that_is_the_masters_is_refused_and_a_shared_node_warned_of(glued, refused):
    """Shared nodes may be meant."""
    mesh = blocks(glued=glued)
    lines = [f"case.toml, line 7: {of_check(mesh, 'shared-nodes')} (lacmesh check: shared-nodes)"]
    assert told(mesh) == ((lines, []) if refused else ([], lines))


def test_the_tip_of_a_crack_is_no_mistake():
    assert told(blocks(glued=(0,))) == ([], [])


@pytest.mark.parametrize(
    ("more", "rule"),
    [
        ([[10, 11, 16, 15]], "repeated-cell"),
        ([[10, 11, 17, 16]], "overlapping-cells"),
        ([[1, 6, 12, 13]], "crowded-facet"),
    ],
)
def test_cells_that_count_twice_are_refused(more, rule):
    mesh = blocks(more=np.array(more))
    refused, warned = told(mesh)
    assert f"{of_check(mesh, rule)} (lacmesh check: {rule})" in refused and warned == []


def test_an_edge_without_length_is_warned_of():
    """A slave face of 1e-13 carries nothing that can be told from rounding."""
    mesh = blocks(moved=(12, [1.0 + 1e-13, 1.0]))
    refused, warned = told(mesh)
    assert refused == []
    assert warned == [
        "2 nodes have the coordinates of another node of their cell (12, 13): 1 edge has no length; merge the nodes "
        "(lacmesh check: coincident-nodes)"
    ]


def test_cells_that_share_no_mid_node_are_warned_of():
    """The body is torn there between its corners."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]]
    mid = [[0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5], [1.5, 0], [2, 0.5], [1.5, 1], [1, 0.5]]
    cells = [[0, 1, 2, 3, 6, 7, 8, 9], [1, 4, 5, 2, 10, 11, 12, 13]]
    mesh = Mesh.create(points + mid, [("QUAD8", cells)])
    with pytest.warns(
        LacmeshWarning, match="both sides of 1 facet share corners but not mid-nodes .*; elevate the order"
    ):
        Problem.of(parse_case(CASE[: CASE.index("[[contact]]")]), mesh)
