"""Pairs of facets against a table, whatever the cells are, and where different facets have equal keys."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.topology import facets
from lacmesh.topology.facets import ALONE, CROWDED, Facets, Solid, boundary_faces, pair_facets
from lacmesh.topology.winding import face_normals
from tests.meshes import box, random_mesh
from tests.topology import plain


def some_meshes(seed):
    """A conforming mixture, the same three times over, and cells of random nodes."""
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim=2 + seed % 2, twins=True)
    yield mesh
    yield Mesh.create(mesh.points, [(b.type, np.concatenate([b.nodes] * 3)) for b in mesh.blocks], space_dim=mesh.dim)
    wild = [(kind, [rng.permutation(9)[:n] for _ in range(30)]) for kind, n in (("HEXA8", 8), ("TETRA4", 4))]
    yield Mesh.create(rng.random((9, 3)), wild)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("keys", ["spread", "few"])
def test_pairs_are_those_of_a_table(seed, keys, monkeypatch):
    if keys == "few":  # the first two draws give most facets the key of another one
        bits = facets.mixed_bits
        monkeypatch.setattr(
            facets, "mixed_bits", lambda n, draw: bits(n, draw) >> np.uint64(61) if draw < 3 else bits(n, draw)
        )
        monkeypatch.setattr(facets, "_keys", lambda *given, make=facets._keys: make(*given) << np.uint64(50))
    for mesh in some_meshes(seed):
        solid = Solid.of(mesh)
        for mine, theirs in zip(pair_facets(solid), plain.pairs_of_facets(solid), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_a_copy_of_a_cell_is_left_out_and_three_cells_crowd_a_facet():
    points, cells = box(2)
    twice = Facets.of(Mesh.create(points, [("HEXA8", np.vstack([cells, cells[:1]]))]))
    assert twice.copies.tolist() == [8] and len(twice.solid.cells) == 8
    assert (twice.opposite == ALONE).sum() == 24 and not twice.same.any()
    fan = Mesh.create([[0, 0], [1, 0], [0, 1], [1, 1], [1, -1]], [("TRIA3", [[0, 1, 2], [0, 1, 3], [0, 1, 4]])])
    assert (Facets.of(fan).opposite == CROWDED).sum() == 3


def test_no_cells_have_no_facets():
    none = Facets.of(Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])]))
    assert not len(none.opposite) and not len(none.boundary[0])


@pytest.mark.parametrize("name", [name for name, cell in CELLS.items() if cell.dim > 1 and cell.order == 1])
@pytest.mark.parametrize("inverted", [False, True])
def test_facets_on_the_boundary_are_outward_whichever_way_cells_list_their_nodes(name, inverted):
    cell = CELLS[name]
    x = np.array(cell.reference, dtype=float)
    x = np.pad(x * ([1.0] * (cell.dim - 1) + [-1.0 if inverted else 1.0]), ((0, 0), (0, 3 - cell.dim)))
    mesh = Mesh.create(x, [(name, [np.arange(cell.n_nodes)])], space_dim=cell.dim)
    faces, _ = boundary_faces(mesh)
    assert len(faces) == len(cell.facets)
    there = faces.nodes[:, :4] >= 0
    centre = np.where(there[..., None], x[faces.nodes[:, :4]], 0.0).sum(axis=1) / there.sum(axis=1)[:, None]
    assert ((centre - x.mean(axis=0)) * face_normals(mesh, faces)).sum(axis=1).min() > 0
