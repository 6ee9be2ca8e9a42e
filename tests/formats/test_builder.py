"""The builder: what a file lists by number, or by row, becomes one mesh; what cannot be is an error with its place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lacmesh.errors import LacmeshWarning, ReadError
from lacmesh.formats.builder import MeshBuilder

QUADS = np.array([[7, 5, 9, 3], [5, 11, 13, 9]])
POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]])
NUMBERS = np.array([7, 5, 9, 3, 11, 13])


def builder(rows_from=None, quads=QUADS, numbers=NUMBERS, points=POINTS):
    """Two quadrangles and a line, of which the file has the line first."""
    out = MeshBuilder(Path("a.msh"), rows_from=rows_from)
    out.nodes(numbers[:3], points[:3], part=np.array([1, 1, 1]))
    out.nodes(numbers[3:], points[3:])
    if rows_from is not None:
        quads = np.searchsorted(np.sort(NUMBERS), quads)
        quads = np.argsort(NUMBERS)[quads] + rows_from
    out.cells("QUAD4", np.array([20, 30]), quads, at=np.array([1, 2]), error=lambda m, row: ReadError("b", m, f"{row}"))
    out.cells("SEG2", np.array([10]), quads[:1, :2], groups=("edge",))
    return out


@pytest.mark.parametrize("rows_from", [None, 0, 1])
def test_mesh_by_number_and_by_row(rows_from):
    out = builder(rows_from)
    first = 0 if rows_from is None else rows_from
    cells = np.array([10, 30]) if rows_from is None else np.array([0, 2]) + first
    out.group("cell", "both", cells)
    out.group("cell", "none")
    out.group("node", "n", np.array([13]) if rows_from is None else np.array([5 + first]))
    out.values("cell", "T", cells, np.array([1.0, 3.0]))
    out.values("cell", "all", None, np.array([1, 2, 3], np.uint8))
    mesh = out.mesh(name="a", group_tags={"both": ((2, 1),), "gone": ((2, 2),)})
    assert [b.type for b in mesh.blocks] == ["SEG2", "QUAD4"] and mesh.file_order is None
    assert np.array_equal(mesh.node_number[mesh.block("QUAD4")], QUADS)
    assert mesh.cell_number.tolist() == [10, 20, 30]
    assert {n: g.tolist() for n, g in mesh.cell_groups.items()} == {"edge": [0], "both": [0, 2], "none": []}
    assert mesh.node_groups["n"].tolist() == [5]
    assert np.isnan(mesh.cell_data["T"]).tolist() == [False, True, False]
    assert mesh.cell_data["all"].tolist() == [1, 2, 3] and mesh.cell_data["all"].dtype == np.uint8
    assert mesh.node_data["part"].tolist() == [1, 1, 1, -1, -1, -1]
    assert mesh.group_tags == {"both": ((2, 1),)}


WRONG = [
    ({"quads": np.array([[7, 5, 9, 3], [5, 11, 99, 9]])}, "b, 1: the QUAD4 30 has node 99, which is not among"),
    ({"numbers": np.array([7, 5, 9, 3, 11, 7])}, "a.msh: two nodes have the number 7"),
    ({"numbers": np.array([7, 5, 9, 3, 0, 13])}, "a.msh: a node has the number 0; numbers start at 1"),
    ({"points": np.where(POINTS == 2, np.nan, POINTS)}, "the coordinates of nodes 11, 13 are not finite"),
]


@pytest.mark.parametrize(("given", "words"), WRONG)
def test_what_cannot_be_is_an_error(given, words):
    with pytest.raises(ReadError, match=words):
        builder(**given).mesh()


def test_strays_are_left_out_with_a_warning_or_an_error():
    out = builder()
    out.group("cell", "g", np.array([10, 99]))
    out.values("node", "T", np.array([98, 97]), np.ones(2))
    with pytest.warns(LacmeshWarning, match=r"a\.msh: 3 values or members belong to nodes or cells"):
        assert out.mesh().cell_groups["g"].tolist() == [0]
    out.group("cell", "g", np.array([97]), error=lambda message, _: ReadError("c", message))
    with pytest.raises(ReadError, match="c: the group 'g' has members that are not among the cells: 97"):
        out.mesh()
