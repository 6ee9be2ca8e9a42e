"""The counts of the cut: nothing is broken, code_aster's totals are met, and what is broken on purpose is counted."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import Cut, Mesh
from lacmesh.cells import CELLS
from verification.families import cut as family
from verification.families.cut import FAMILY, Trial, backwards, broken, listed, sided, single
from verification.measures.cutting import PROPERTIES, facets, same_up_to_numbers, sizes, violations

CASES = {case.name: case for case in FAMILY.cases}
FILL, INVERTED, TORN, TOUCHED, TURNED, DOF, LOST = PROPERTIES


@pytest.fixture(scope="module", params=["QUAD4", "HEXA8"])
def made(request):
    """A mesh, and its cut."""
    dim = CELLS[request.param].dim
    before = sided(request.param, dim)
    return before, lacmesh.cut_skin(before, ("slave", "slave2"), hexa="hexa")


def test_every_type_facet_and_variant_is_cut():
    assert {name for case in CASES.values() for name in case.parameters.get("cells", ())} == {
        n for n, cell in CELLS.items() if cell.dim > 1
    }
    (trial,) = (t for t in family.trials(*CASES["HEXA"].solve.args, 1) if t.label == "HEXA20, hexa")
    assert trial.count == 6 * 4 * 2 and trial.added == (48 * 28, 48 * 9)
    pairs = next(t for t in family.trials(*CASES["TETRA"].solve.args, 2) if "several" in t.label)
    assert pairs.count == 2**4 - 5


@pytest.mark.shared
def test_totals_are_those_of_the_reference(shared):
    listed_ = json.loads((shared / "reference" / "cases.json").read_text())["cases"]
    wanted = {row["id"]: row for row in listed_ if row["kind"] == "cut_counts"}
    assert {f"zzzz383{row.name}" for row in family._ROWS} == set(wanted)
    for row in family._ROWS:
        asked = wanted[f"zzzz383{row.name}"]
        assert asked["expect"] == {"cells": row.n_cells, "nodes": row.n_nodes}
        assert (asked["hexa"] or "", len(asked["slave"])) == (row.hexa, len(row.slaves))


@pytest.mark.parametrize("kind", ["SEG3", "TRIA3", "TRIA6", "QUAD4", "QUAD8", "QUAD9"])
def test_a_face_is_the_same_however_it_is_listed(kind):
    """Its mid-nodes stay between their corners: the place of every edge's."""
    cell = CELLS[kind]
    found = set()
    for turn in range(max(cell.n_corners, 1)):
        for inward in (False, True):
            nodes = listed(np.arange(cell.n_nodes), kind, turn, inward)
            found.add(tuple(nodes.tolist()))
            assert sorted(nodes) == list(range(cell.n_nodes))
            x = np.array(cell.reference)[nodes]
            for k, (a, b) in enumerate(cell.edges if cell.order == 2 else ()):
                np.testing.assert_allclose(x[cell.n_corners + k], (x[a] + x[b]) / 2, atol=1e-15)
    assert len(found) == (2 if cell.n_corners == 2 else 2 * cell.n_corners)


# ---- what is broken on purpose


def with_nodes(cut, cell, change):
    """The cut with the nodes of one cell changed."""
    mesh = cut.mesh
    k = int(np.searchsorted(mesh.offsets, cell, side="right") - 1)
    rows = mesh.blocks[k].nodes.copy()
    rows[cell - mesh.offsets[k]] = change(rows[cell - mesh.offsets[k]])
    blocks = tuple(b._replace(nodes=rows) if j == k else b for j, b in enumerate(mesh.blocks))
    return Cut(replace(mesh, blocks=blocks))


def children(cut, lower):
    """Children of the dimension of the mesh, or of a lower one."""
    return np.flatnonzero((cut.parent_of_cell >= 0) & (cut.mesh.cell_dim == cut.mesh.space_dim - lower))


def child_lost(cut):
    """One child stands for another one, too."""
    own, other, *_ = children(cut, 0)
    nodes = next(cut.mesh.select(np.array([other])))[2][0]
    return with_nodes(cut, own, lambda row: nodes)


def stray_node(cut):
    mesh = cut.mesh
    data = {name: np.concatenate([values, values[-1:]]) for name, values in mesh.node_data.items()}
    number = np.append(mesh.node_number, mesh.node_number.max() + 1)
    return Cut(replace(mesh, points=np.vstack([mesh.points, [[9.0, 9, 9]]]), node_number=number, node_data=data))


def changed(cut, field, name, change):
    """The cut with one of its groups or data changed."""
    values = getattr(cut.mesh, field)
    return Cut(replace(cut.mesh, **{field: {**values, name: change(values[name])}}))


def put(cut, field, at, value):
    """The cut with a value written into a copy of one of its arrays."""
    values = getattr(cut.mesh, field).copy()
    values[at] = value(values)
    return Cut(replace(cut.mesh, **{field: values}))


HALF = {2: [1, 0], 4: [0, 3, 2, 1]}
HARM = {
    "a child is turned": (
        lambda c: with_nodes(c, children(c, 0)[0], lambda row: row[[1, 0, *range(2, len(row))]]), [INVERTED],
    ),
    "a face is turned": (lambda c: with_nodes(c, children(c, 1)[0], lambda row: row[HALF[len(row)]]), [TURNED]),
    "a child is lost": (child_lost, [FILL, TORN]),
    "a node is moved": (lambda c: put(c, "points", (0, 0), lambda x: x[0, 0] + 1e-9), [TOUCHED]),
    "a node is added": (stray_node, [TOUCHED]),
    "no record": (lambda c: changed(c, "node_data", "lac_internal", lambda v: np.full(len(v), -1)), [DOF]),
    "a group is short": (lambda c: changed(c, "cell_groups", "slave", lambda v: v[1:]), [LOST]),
    "data are changed": (lambda c: changed(c, "cell_data", "colour", lambda v: v + 1), [LOST]),
    "a number stands twice": (lambda c: put(c, "node_number", -1, lambda v: v[-2]), [LOST]),
}  # fmt: skip


@pytest.mark.rows("QUAD4-a child is turned", "QUAD4-a face is turned", "HEXA8-a child is turned")
@pytest.mark.parametrize("name", HARM)
def test_harm_is_counted(made, name):
    (before, cut), (harm, seen) = made, HARM[name]
    assert not any(violations(before, cut).values())
    found = violations(before, harm(cut))
    assert all(found[one] > 0 for one in seen)


def test_sizes_facets_and_order_of_a_mesh():
    mesh = single("PENTA15", (0, 2), 1, True)
    assert len(facets(mesh)) == 5
    shear = np.linalg.det(np.linalg.lstsq(np.array(CELLS["PENTA15"].reference), mesh.points, rcond=None)[0])
    assert sizes(mesh)[0] == pytest.approx(shear)
    mesh = sided("mixed 1", 3)
    other = backwards(mesh)
    assert same_up_to_numbers(mesh, other) and other.blocks[0].type == mesh.blocks[-1].type
    fewer = replace(other, cell_groups={**other.cell_groups, "slave": other.cell_groups["slave"][1:]})
    assert not same_up_to_numbers(mesh, fewer)


def test_an_uncut_skin_owns_no_internal_dof(made):
    """Its faces as macro-elements: their nodes are on the rim of each."""
    before, _ = made
    slave = np.concatenate([before.cell_groups["slave"], before.cell_groups["slave2"]])
    macro = np.full(before.n_cells, -1)
    macro[np.sort(slave)] = np.arange(len(slave))
    none = np.full(before.n_cells, -1)
    records = {"lac_macro": macro, "lac_zone": np.where(macro < 0, -1, 0), "lac_child": none, "lac_parent": none}
    mesh = replace(before, cell_data={**before.cell_data, **records}, zones=("slave",))
    assert violations(before, Cut(mesh))[DOF] == len(slave)


def test_another_count_and_another_order_are_seen(made, monkeypatch):
    before, cut = made
    trial = Trial("one", before, ("slave", "slave2"), "hexa", added=(1, 1))
    assert broken(trial, cut)[family._ADDED] == 1
    monkeypatch.setattr(family, "backwards", lambda mesh: Mesh.create(mesh.points * 2, mesh.blocks,
                        cell_groups=mesh.cell_groups, space_dim=mesh.space_dim))  # fmt: skip
    found = broken(trial, cut)
    assert found[family._ORDER] == 1 and found[family._AGAIN] == 0 and found[family._CHECKED] == 0
