"""The table of entities: split only where groups differ, tags kept where they can be."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import DataError, LacmeshWarning
from lacmesh.formats.entities import Entity, assign
from lacmesh.mesh import Mesh, Model, Periodic
from tests.formats.msh_meshes import meshes
from tests.samples import samples


def chain(n, **rest):
    """n segments in a row."""
    nodes = np.arange(n)[:, None] + [0, 1]
    return Mesh.create(np.eye(n + 1, 3), [("SEG2", nodes)], **rest)


def tags(mesh):
    table = assign(mesh)
    return [(table.entities[r].dim, table.entities[r].tag) for r in table.cell]


def node_tags(mesh):
    table = assign(mesh)
    return [(table.entities[r].dim, table.entities[r].tag) for r in table.node]


@pytest.mark.fuzz
@settings(max_examples=samples(50, 150), deadline=None, suppress_health_check=list(HealthCheck))
@given(mesh=meshes())
def test_the_table_says_what_the_groups_say(mesh):
    table = assign(mesh)
    assert [(e.dim, e.tag) for e in table.entities] == sorted({(e.dim, e.tag) for e in table.entities})
    before = mesh.cell_data.get("entity", np.full((mesh.n_cells, 2), -1))
    said = {tag: name for name, found in table.group_tags.items() for tag in found}
    assert len(said) == sum(map(len, table.group_tags.values()))
    member = {name: set(cells.tolist()) for name, cells in mesh.cell_groups.items()}
    classes, kept = {}, {}
    for c in range(mesh.n_cells):
        e = table.entities[table.cell[c]]
        assert e.dim == mesh.cell_dim[c]
        groups = {name for name in member if c in member[name]}
        assert {said[e.dim, g] for g in e.groups} == groups
        valid = before[c, 0] == e.dim and before[c, 1] > 0
        # new entities hold one order: gmsh's getElements shows one order of a shape in an entity
        source = tuple(before[c].tolist()) if valid else ("new", order_of(mesh, c) > 1)
        assert classes.setdefault((e.dim, e.tag), (source, groups)) == (source, groups)
        if valid:
            kept.setdefault(source, Counter())[e.tag] += 1
    # one entity for each source and combination, and the most numerous keeps its tag
    assert len({(d, s, frozenset(g)) for (d, _), (s, g) in classes.items()}) == len(classes)
    for (_, tag), count in kept.items():
        assert count[tag] == max(count.values())
    for n, r in enumerate(table.node):
        if "entity" in mesh.node_data and mesh.node_data["entity"][n, 1] > 0:
            assert (table.entities[r].dim, table.entities[r].tag) == tuple(mesh.node_data["entity"][n])


def order_of(mesh, cell):
    return next(ALL_CELLS[kind].order for kind, _, _ in mesh.select(np.array([cell])))


def test_the_largest_part_keeps_the_tag():
    entity = np.array([[1, 7]] * 4 + [[1, 3]])
    groups = {"a": [1], "b": [2, 3], "c": [0, 1, 2, 3, 4]}
    mesh = chain(5, cell_data={"entity": entity}, cell_groups=groups, group_tags={"b": ((1, 5),)})
    assert tags(mesh) == [(1, 8), (1, 9), (1, 7), (1, 7), (1, 3)]
    assert assign(mesh).group_tags == {"a": ((1, 6),), "b": ((1, 5),), "c": ((1, 7),)}
    assert assign(mesh).entities[1] == Entity(1, 7, (5, 7))


def test_without_entities_there_is_one_for_each_combination():
    mesh = Mesh.create(
        np.eye(4, 3),
        [("TRIA3", [[0, 1, 2], [0, 1, 3]]), ("SEG2", [[0, 1], [1, 2], [2, 3]])],
        cell_groups={"a": [0, 2], "b": [2, 3]},
    )
    assert tags(mesh) == [(2, 2), (2, 1), (1, 2), (1, 3), (1, 1)]
    assert assign(mesh).group_tags == {"a": ((1, 1), (2, 1)), "b": ((1, 2),)}


def test_an_entity_of_another_dimension_is_unknown():
    mesh = chain(3, cell_data={"entity": np.array([[2, 4], [1, 4], [-1, -1]])})
    assert tags(mesh) == [(1, 5), (1, 4), (1, 5)]


def test_nodes_lie_on_the_lowest_cell_and_orphans_somewhere():
    mesh = Mesh.create(
        np.eye(6, 3),
        [("POI1", [[4]]), ("TRIA3", [[0, 1, 2], [1, 2, 3]]), ("SEG2", [[0, 1]])],
        node_data={"entity": np.array([[-1, -1], [2, 9], [-1, -1], [3, 1], [-1, -1], [-1, -1]])},
    )
    assert node_tags(mesh) == [(1, 1), (2, 9), (2, 10), (3, 1), (0, 1), (3, 1)]
    assert node_tags(Mesh.create(np.eye(2), [])) == [(2, 1), (2, 1)]
    assert assign(Mesh.create(np.empty((0, 2)), [])).entities == ()


def test_two_groups_cannot_have_one_tag():
    mesh = chain(2, cell_groups={"a": [0], "b": [1]}, group_tags={"a": ((1, 4),), "b": ((1, 4), (2, 4))})
    with pytest.warns(LacmeshWarning, match="'a' and 'b' both have the tag 1:4"):
        assert assign(mesh).group_tags == {"a": ((1, 4),), "b": ((2, 4), (1, 5))}


def test_boundaries_hold_only_what_is_there():
    surfaces = np.array([[2, 1], [2, 1], [2, 1], [2, 2]])
    model = Model(
        {(3, 1): (1, -2, 8), (2, 1): (), (2, 2): ()},
        (Periodic((0, 5), (0, 6), (), np.empty((0, 2), int)),),
    )
    rows = [("TRIA3", [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])]
    mesh = Mesh.create(np.eye(4, 3), rows, cell_data={"entity": surfaces}, cell_groups={"g": [0]}, model=model)
    table = assign(mesh)
    assert table.boundary == {(3, 1): (1, 3, -2), (2, 1): (), (2, 2): ()}  # 3 is a part of 1; 8 is unknown
    assert {(0, 5), (0, 6), (3, 1)} <= {(e.dim, e.tag) for e in table.entities}


def test_an_embedded_entity_follows_the_largest_tag():
    model = Model({(2, 1): (1, 2 + 2), (1, 1): (), (1, 2): ()})  # curve 2 lies in surface 1
    entity = np.array([[1, 1], [1, 1], [1, 2]])
    mesh = chain(3, cell_data={"entity": entity}, cell_groups={"g": [0]}, model=model)
    assert tags(mesh) == [(1, 3), (1, 1), (1, 2)]
    assert assign(mesh).boundary[2, 1] == (1, 3, 3 + 2)


@pytest.mark.parametrize("entity", [np.zeros(2, int), np.zeros((2, 2)), np.full((2, 2), 2**40)])
def test_wrong_entity_data(entity):
    with pytest.raises(DataError, match="'entity'"):
        assign(chain(2, cell_data={"entity": entity}))
