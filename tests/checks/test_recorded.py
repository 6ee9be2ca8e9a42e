"""Findings on records that no cut produces, fault by fault, with the numbers of the file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import cut_skin
from lacmesh.checks import check
from tests.checks import corpus_contact  # noqa: F401 (it enters its meshes)
from tests.checks.blocks import SOLIDS, two_blocks
from tests.checks.corpus import CORPUS

NODES, NONE = "lac_internal names nodes", "lac_internal names no node"
NUMBERS, ZONES = "lac_macro does not number", "in several zones"
APART, CHILDREN = "are not connected", "lac_child does not count"
FAULTS = {
    "an_internal_dof_recorded_at_a_vertex": {NODES},
    "an_internal_dof_recorded_at_a_vertex_of_the_rim": {NODES},
    "internal_dofs_that_are_not_recorded": {NONE},
    "faces_of_macro_elements_that_are_all_the_first": {CHILDREN},
    "macro_elements_of_two_bodies_with_one_number": {APART, ZONES, CHILDREN},
    "a_macro_element_in_two_zones": {ZONES},
    "a_huge_number_of_a_macro_element": {NUMBERS},
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_told_apart_in_the_numbers_of_the_file(name):
    case = CORPUS[name]
    mesh = case.make()
    mesh = replace(mesh, cell_number=mesh.cell_number + 1000, node_number=mesh.node_number + 5000)
    found = check(mesh, **case.asked).of_rule("broken-records")
    said = {fault for fault in (NODES, NONE, NUMBERS, ZONES, APART, CHILDREN) for f in found if fault in f.message}
    assert said == FAULTS[name]
    for f in found:
        numbers = f.nodes if NODES in f.message else f.cells
        assert numbers and min(numbers) > (5000 if f.nodes else 1000)
        assert str(numbers[0]) in f.message


@pytest.mark.parametrize("name", SOLIDS)
def test_a_part_of_the_zones_may_be_asked_for(name):
    mesh = cut_skin(two_blocks(name, reach=0.2), ["master", "slave"]).mesh
    for asked in ("slave", "master", ["slave", "master"]):
        assert not check(mesh, asked).of_rule("broken-records")


def test_neighbouring_zones_are_no_fault():
    mesh = two_blocks("HEXA20", n=4)
    left = mesh.cell_groups["slave"][:8]
    halves = {"left": left, "right": np.setdiff1d(mesh.cell_groups["slave"], left)}
    cut = cut_skin(replace(mesh, cell_groups={**mesh.cell_groups, **halves}), ["left", "right"]).mesh
    for asked in ("left", "right", ["left", "right"]):
        assert not check(cut, asked).of_rule("broken-records")
