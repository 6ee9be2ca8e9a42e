"""The harness's own meshes: whole, conforming, cut without complaint."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.errors import RequestError
from lacmesh.reference.quadrature import measure
from lacmesh.reference.shapes import shape
from verification.families.manufactured import ROWS, cells_a_side, mesh_of
from verification.meshes.blocks import BLOCK_TYPES, block

LOW, HIGH = (-0.5, 1.0, 0.0), (0.5, 3.0, 3.0)


def size_of(mesh, cells):
    return sum(measure(kind, mesh.points[nodes]).sum() for kind, _, nodes in mesh.select(cells))


@pytest.mark.parametrize("kind", BLOCK_TYPES)
def test_a_block_fills_its_box(kind):
    dim = CELLS[kind].dim
    mesh = block(kind, 3, LOW[:dim], HIGH[:dim])
    lengths = np.subtract(HIGH, LOW)[:dim]
    body = np.flatnonzero(mesh.cell_dim == dim)
    assert all(np.all(measure(t, mesh.points[nodes]) > 0) for t, _, nodes in mesh.select(body))
    assert size_of(mesh, body) == pytest.approx(np.prod(lengths), rel=1e-13)
    for name, cells in mesh.cell_groups.items():
        axis = "xyz".index(name[0])
        assert size_of(mesh, cells) == pytest.approx(np.prod(np.delete(lengths, axis)), rel=1e-13)
    assert set(mesh.cell_groups) == {f"{a}{e}" for a in "xyz"[:dim] for e in "01"}


@pytest.mark.parametrize("kind", BLOCK_TYPES)
def test_cells_of_a_block_share_their_facets(kind):
    """A facet is another cell's too, node by node, or in a side."""
    dim = CELLS[kind].dim
    mesh = block(kind, 2, LOW[:dim], HIGH[:dim])
    facets = [nodes[:, list(f.nodes)] for t, _, nodes in mesh.select(np.flatnonzero(mesh.cell_dim == dim))
              for f in CELLS[t].facets]  # fmt: skip
    times = Counter(tuple(sorted(row)) for rows in facets for row in rows.tolist())
    assert set(times.values()) == {1, 2}
    skin = {tuple(sorted(row)) for cells in mesh.cell_groups.values() for _, _, nodes in mesh.select(cells)
            for row in nodes.tolist()}  # fmt: skip
    assert {facet for facet, count in times.items() if count == 1} == skin


def test_a_block_of_something_else_is_refused():
    with pytest.raises(RequestError, match="a number or 1 numbers"):
        block("SEG3", 2, (0, 0), (1, 1))


@pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)
def test_a_row_has_a_mesh_that_can_be_cut_and_a_master_that_is_exact(row):
    given, mesh = row.solution, mesh_of(row, 0)
    cut = lacmesh.cut_skin(mesh, [given.slave], **({"hexa": row.hexa} if row.hexa else {}))
    assert not lacmesh.check(cut).errors
    (cell,) = mesh.select(mesh.cell_groups["master"])
    X = np.random.default_rng(2).uniform(-1, 1, (30, given.dim - 1))
    x = shape(cell[0], X) @ mesh.points[cell[2][0]]
    height = eval(given.master_height, {}, dict(zip("xyz", x.T, strict=False)))
    np.testing.assert_allclose(x[:, given.dim - 1], height, atol=1e-14)
    assert cells_a_side(row, 3) == 8 * cells_a_side(row, 0)
