"""The nodes that records name."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacsolver.case import CaseError, Force, Probe, Rigid
from lacsolver.space.places import nodes_of
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANE_MODELS, cube, square
from tests.lacsolver.held import (
    joined,
    moved,
    nodes_in,
    with_sides,
)

POISSON = 0.3
BOXES = [("HEXA8", "3d"), ("TETRA10", "3d"), ("HEXA27", "3d"), ("PENTA15", "3d"), ("PYRAM5", "3d")]
BOXES += [(name, model) for name in ("TRIA3", "QUAD8") for model in PLANE_MODELS]


def test_the_node_at_a_place():
    mesh = with_sides(cube("HEXA8", 2))
    space = Space.of(mesh, "3d")
    assert nodes_of(space, Probe(at=(0.5, 0.5, 1.0), name="p")).tolist() == [14]
    assert nodes_of(space, Force(at=(0.5, 0.5 + 9e-7, 1.0), fx=1.0)).tolist() == [14]
    message = r"^force: no node at \[0\.5, 0\.503, 1\]; the nearest is node 15 at \[0\.5, 0\.5, 1\], 0\.003 away$"
    with pytest.raises(CaseError, match=message):
        nodes_of(space, Force(at=(0.5, 0.503, 1.0), fx=1.0))
    plane = Space.of(moved(with_sides(square("QUAD4", 1)), shift=(0, 0, 4.0)), "plane_strain")
    assert nodes_of(plane, Probe(at=(2.0, 1.0), name="p")).tolist() == [3]


def test_a_place_where_bodies_touch_is_two_nodes():
    mesh = joined(cube("HEXA8", 1), moved(cube("HEXA8", 1), shift=(0, 0, 1)))
    mesh = Mesh.create(np.vstack([mesh.points, [[0, 0, 0], [3, 3, 3]]]), mesh.blocks)
    space = Space.of(mesh, "3d")
    with pytest.raises(CaseError, match=r"nodes 2, 9 are all at \[0, 0, 1\]; name a group of nodes"):
        nodes_of(space, Probe(at=(0.0, 0.0, 1.0), name="p"))
    assert nodes_of(space, Probe(at=(0.0, 0.0, 0.0), name="p")).tolist() == [0]  # not the node of no cell
    assert nodes_of(space, Probe(at=(3.0, 3.0, 3.0), name="p")).tolist() == [17]


def test_groups_of_cells_and_of_nodes():
    mesh = with_sides(square("QUAD8", 1), node_groups={"x0": [3], "dots": [5, 1], "none": []})
    mesh = Mesh.create(
        mesh.points,
        mesh.blocks,
        cell_groups={**mesh.cell_groups, "empty": []},
        node_groups=mesh.node_groups,
        group_tags={"x1": ((1, 7),), "y0": ((1, 8),), "body": ((2, 8),)},
    )
    space = Space.of(mesh, "plane_strain")
    assert nodes_of(space, Probe(group="x0")).tolist() == nodes_in(mesh, "x0").tolist()
    assert nodes_of(space, Probe(group="x0", kind="node")).tolist() == [3]
    assert nodes_of(space, Probe(group="dots")).tolist() == [1, 5]
    assert nodes_of(space, Rigid(group=7)).tolist() == nodes_in(mesh, "x1").tolist()
    wrong = {
        ("empty", None): "the group 'empty' is empty",
        ("none", None): "the group 'none' is empty",
        ("dots", "cell"): "no cell group named 'dots'",
        ("y0", "node"): "no node group named 'y0'; there are: dots, none, x0",
        ("dot", None): "no group named 'dot'; did you mean dots",
        ("8", None): "tag 8 means several groups",
    }
    for (group, kind), message in wrong.items():
        with pytest.raises(CaseError, match=f"probe: {message}"):
            nodes_of(space, Probe(group=group, kind=kind))
