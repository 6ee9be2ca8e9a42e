"""Slices of a MED file: together they are the whole, and each reads no more than its rows."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from lacmesh import cut_skin, read, write
from lacmesh.formats.med import fields
from lacmesh.formats.med.reader import read_slice
from lacmesh.formats.slices import Slice
from tests.meshes import random_mesh


def check(path, n):
    """Compare n slices, one after the other, with the whole."""
    whole, slices = read_slice(path, Slice()), [read_slice(path, Slice(k, n)) for k in range(n)]
    assert len({len(one.points) for one in slices}) <= 2
    for name in ("points", "node_number", "node_family"):
        assert np.array_equal(np.concatenate([getattr(one, name) for one in slices]), getattr(whole, name))
    for k, cells in enumerate(whole.cells):
        for name in ("nodes", "number", "family"):
            joined = np.concatenate([getattr(one.cells[k], name) for one in slices])
            assert np.array_equal(joined, getattr(cells, name)) and joined.dtype == getattr(cells, name).dtype
    for name, values in whole.data.node_data.items():
        joined = np.concatenate([one.data.node_data[name] for one in slices])
        assert np.array_equal(joined, values, equal_nan=values.dtype.kind == "f") and joined.dtype == values.dtype
    for name, values in whole.data.cell_data.items():
        parts = [by_type(one, one.data.cell_data[name]) for one in slices]
        joined = np.concatenate([part[k] for k in range(len(whole.cells)) for part in parts])
        assert np.array_equal(joined, values, equal_nan=values.dtype.kind == "f") and joined.dtype == values.dtype
    for one in slices:
        assert (one.cell_families, one.node_families) == (whole.cell_families, whole.node_families)
        assert (one.name, one.space_dim, one.said) == (whole.name, whole.space_dim, whole.said)


def by_type(content, values):
    """Data of the cells of a slice, by their types."""
    return np.split(values, np.cumsum([len(cells.nodes) for cells in content.cells])[:-1])


@pytest.mark.parametrize("seed", range(4))
def test_slices_together_are_the_whole(seed, tmp_path):
    mesh = random_mesh(np.random.default_rng(seed), dim=2 + seed % 2, order=1 + seed // 2, twins=True)
    write(tmp_path / "mesh.med", mesh)
    for n in (2, 3, 50) if seed == 0 else (2, 3):
        check(tmp_path / "mesh.med", n)


def test_values_with_profiles_are_read_piece_by_piece(tmp_path, monkeypatch):
    monkeypatch.setattr(fields, "_PIECE", 7)
    write(tmp_path / "cut.med", cut_skin(read("data/two_blocks.msh"), "slave").mesh)
    assert read(tmp_path / "cut.med").cell_data["lac_macro"].max() > 7
    check(tmp_path / "cut.med", 3)


def test_a_slice_reads_its_rows_alone(tmp_path, monkeypatch):
    write(tmp_path / "mesh.med", read("data/two_blocks.msh"))
    seen = []
    plain = h5py.Dataset.__getitem__

    def get(dataset, what, *more):
        got = plain(dataset, what, *more)
        if dataset.name.rsplit("/")[-1] in ("COO", "NOD", "NUM", "FAM"):
            seen.append(np.size(got) / dataset.size)
        return got

    monkeypatch.setattr(h5py.Dataset, "__getitem__", get)
    read_slice(tmp_path / "mesh.med", Slice(1, 5))
    assert len(seen) > 10 and max(seen) < 0.21
