"""The share of a process: its largest values, and the rows of its matrix for PETSc."""

from __future__ import annotations

import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import measure
from tests.lacsolver.distributed.mpi import ROOT, printed

pytestmark = pytest.mark.petsc


@pytest.fixture(scope="module")
def told():
    """The figures of both processes."""
    return printed(2, "share")


def test_the_largest_value_of_all_processes_keeps_nan(told):
    for one in told:
        assert one["largest"] == 1.0 and one["least"] == -1.0
        assert one["nan"] and one["infinite"]


def test_rows_placed_by_index_are_those_of_the_triple_product(told):
    assert sum(one["own"] for one in told) == one_process_has(told)
    assert [one["difference"] for one in told] == [0.0, 0.0]


def test_the_rows_of_all_processes_have_the_whole_mass(told):
    """Density 2, along each of three axes: six times the volume of the cells."""
    mesh = lacmesh.read(ROOT / "data" / "two_blocks.msh")
    volume = sum(measure(b.type, mesh.points[b.nodes]).sum() for b in mesh.blocks if CELLS[b.type].dim == 3)
    assert [one["mass"] for one in told] == pytest.approx([6 * volume] * 2, rel=1e-12)


def test_the_cycle_with_rows_of_contact_reduces_errors_as_that_without(told):
    assert told[0]["cycles"] == told[1]["cycles"]
    for left, unsymmetric in told[0]["cycles"].values():
        assert left < 0.2 and unsymmetric < 1e-5


def test_a_backend_is_taken_after_another_in_the_same_process(told):
    assert [one["kinds"] for one in told] == [["gamg", "hypre", "lu", "gamg"]] * 2


def one_process_has(told):
    """Number of unknowns of the whole model."""
    (n,) = {one["n_dof"] for one in told}
    return n
