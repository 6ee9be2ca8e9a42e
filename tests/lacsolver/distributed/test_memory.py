"""Memory of a process: no array as long as the whole model, from the parts of the mesh to the files and back."""

from __future__ import annotations

import pytest

from tests.lacsolver.distributed.mpi import printed

#: what is traced takes a minute, so that it is for `make verify`
pytestmark = [pytest.mark.petsc, pytest.mark.slow]
#: processes that are watched; the first one writes the states and prints
FIXED = (0, 1)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Allocations that these processes found to grow, the other one having more and more."""
    lines = printed(2, "allocations", tmp_path_factory.mktemp("models"), *map(str, FIXED))
    return {line["fixed"]: line for line in lines}


@pytest.mark.parametrize("fixed", FIXED)
def test_no_allocation_grows_with_the_part_of_another_process(told, fixed):
    """The first process writes the states, and gathers nothing else either.

    Levels of multigrid that are whole on each process have at most four nodes here, in place of 500.
    """
    (nodes, cells, own), (more, more_cells, same) = told[fixed]["sizes"]
    assert own == same and more > 3 * nodes and more_cells > 3 * cells
    longer = min(more - nodes, more_cells - cells)  # bytes by which an array of one byte a node or cell would grow
    assert {place: size for place, size in told[fixed]["grown"].items() if size >= longer} == {}
    assert told[fixed]["largest"] > 10 * longer  # what is allocated is seen
