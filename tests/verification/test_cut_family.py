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


@pytest.mark.parametrize("name", ["TRIA", "QUAD", "TETRA", "mixed-2d", "counts"])
def test_nothing_is_broken(name):
    outcome = CASES[name].solve(levels=1)
    assert all(result.passed for result in outcome.results)


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


def test_a_mesh_backwards_is_the_same_mesh():
    mesh = sided("mixed 1", 3)
    other = backwards(mesh)
    assert same_up_to_numbers(mesh, other) and other.blocks[0].type == mesh.blocks[-1].type
    fewer = replace(other, cell_groups={**other.cell_groups, "slave": other.cell_groups["slave"][1:]})
    assert not same_up_to_numbers(mesh, fewer)


def test_sizes_and_facets_of_a_cell():
    mesh = single("PENTA15", (0, 2), 1, True)
    assert len(facets(mesh)) == 5
    shear = np.linalg.det(np.linalg.lstsq(np.array(CELLS["PENTA15"].reference), mesh.points, rcond=None)[0])
    assert sizes(mesh)[0] == pytest.approx(shear)


# ---- what is broken on purpose


def with_nodes(cut, pick, change):
    """The cut with the nodes of one cell changed, of those that `pick` takes."""
    mesh = cut.mesh
    cell = int(np.flatnonzero(pick)[0])
    k = int(np.searchsorted(mesh.offsets, cell, side="right") - 1)
    rows = mesh.blocks[k].nodes.copy()
    rows[cell - mesh.offsets[k]] = change(rows[cell - mesh.offsets[k]])
    blocks = tuple(b._replace(nodes=rows) if j == k else b for j, b in enumerate(mesh.blocks))
    return Cut(replace(mesh, blocks=blocks))


def children(cut, dim):
    return (cut.parent_of_cell >= 0) & (cut.mesh.cell_dim == dim)


def turned_about(cut):
    return with_nodes(cut, children(cut, cut.mesh.space_dim), lambda row: row[[1, 0, *range(2, len(row))]])


def skin_turned(cut):
    half = {2: [1, 0], 4: [0, 3, 2, 1]}
    return with_nodes(cut, children(cut, cut.mesh.space_dim - 1), lambda row: row[half[len(row)]])


def child_lost(cut):
    """One child stands for another one, too."""
    own = np.flatnonzero(children(cut, cut.mesh.space_dim))
    other = next(cut.mesh.select(own[1:2]))[2][0]
    return with_nodes(cut, np.arange(cut.mesh.n_cells) == own[0], lambda row: other)


def moved_node(cut):
    points = cut.mesh.points.copy()
    points[0, 0] += 1e-9
    return Cut(replace(cut.mesh, points=points))


def stray_node(cut):
    mesh = cut.mesh
    data = {name: np.concatenate([values, values[-1:]]) for name, values in mesh.node_data.items()}
    number = np.append(mesh.node_number, mesh.node_number.max() + 1)
    return Cut(replace(mesh, points=np.vstack([mesh.points, [[9.0, 9, 9]]]), node_number=number, node_data=data))


def without_record(cut):
    data = {**cut.mesh.node_data, "lac_internal": np.full(cut.mesh.n_nodes, -1)}
    return Cut(replace(cut.mesh, node_data=data))


def group_cut_short(cut):
    groups = {**cut.mesh.cell_groups, "slave": cut.mesh.cell_groups["slave"][1:]}
    return Cut(replace(cut.mesh, cell_groups=groups))


def data_changed(cut):
    return Cut(replace(cut.mesh, cell_data={**cut.mesh.cell_data, "colour": cut.mesh.cell_data["colour"] + 1}))


def number_twice(cut):
    number = cut.mesh.node_number.copy()
    number[-1] = number[-2]
    return Cut(replace(cut.mesh, node_number=number))


@pytest.mark.parametrize("harm, seen", [
    (turned_about, INVERTED), (skin_turned, TURNED), (child_lost, FILL), (child_lost, TORN), (moved_node, TOUCHED),
    (stray_node, TOUCHED), (without_record, DOF), (group_cut_short, LOST), (data_changed, LOST), (number_twice, LOST),
])  # fmt: skip
def test_harm_is_counted(made, harm, seen):
    before, cut = made
    assert not any(violations(before, cut).values())
    assert violations(before, harm(cut))[seen] > 0


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
