"""Parts in a file are those of the whole mesh; what is damaged, missing or in the way is refused."""

from __future__ import annotations

import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest

from lacmesh import LacmeshWarning, Mesh, cut_skin, read
from lacmesh.errors import GroupNotFoundError, ReadError, RequestError, WriteError
from lacmesh.partition import describe_parts, distribute_nodes, part_of, read_part, write_parts
from lacmesh.partition.store import FILE
from tests.meshes import random_mesh
from tests.partition.compare import differences

BLOCKS = "data/two_blocks.msh"


@pytest.fixture(scope="module")
def cut():
    return cut_skin(read(BLOCKS), "slave").mesh


@pytest.fixture(scope="module")
def written(cut, tmp_path_factory):
    """A folder with four parts of the cut, which no test changes."""
    folder = tmp_path_factory.mktemp("written") / "parts"
    write_parts(folder, cut, distribute_nodes(cut, 4))
    return folder


@pytest.fixture
def parts(written, tmp_path):
    """A copy of the folder with four parts."""
    return shutil.copytree(written, tmp_path / "parts")


def check(mesh, n, folder, everywhere):
    owner = distribute_nodes(mesh, n)
    write_parts(folder, mesh, owner, force=True)
    for rank in range(n):
        for groups in ((), *((name,) for name in everywhere), everywhere):
            there, here = part_of(mesh, owner, rank, everywhere=groups), read_part(folder, rank, everywhere=groups)
            assert differences(there, here) == []


@pytest.mark.parametrize("n", [1, 2, 5])
def test_parts_read_are_those_of_the_whole_mesh(cut, n, tmp_path):
    check(cut, n, tmp_path, ("slave", "master"))


@pytest.mark.parametrize("seed", range(6))
def test_parts_of_random_meshes_are_those_of_the_whole_mesh(seed, tmp_path):
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)
    check(mesh, 3 + seed, tmp_path, ("slave", "none"))


def test_skins_are_named_by_tags_too(parts, cut):
    owner = distribute_nodes(cut, 4)
    (dim, tag) = cut.group_tags["slave"][0]
    there = part_of(cut, owner, 1, everywhere=["slave"])
    assert differences(there, read_part(parts, 1, everywhere=[f"{dim}:{tag}"])) == []


def test_a_mesh_without_groups_has_entities_as_skins(cut, tmp_path):
    entity = np.column_stack([cut.cell_dim, np.ones(cut.n_cells, int)])
    mesh = replace(cut, cell_groups={}, group_tags={}, cell_data={**cut.cell_data, "entity": entity})
    check(mesh, 3, tmp_path, ("entity:2:1",))


def test_the_folder_is_described(parts, cut):
    told = describe_parts(parts)
    all_parts = [read_part(parts, rank) for rank in range(4)]
    assert (told["nodes"], told["cells"], told["bodies"]) == (cut.n_nodes, cut.n_cells, 2)
    assert told["parts"] == {
        "own_nodes": [int(part.own.sum()) for part in all_parts],
        "nodes": [part.mesh.n_nodes for part in all_parts],
        "cells": [part.mesh.n_cells for part in all_parts],
    }
    assert told["copies"] == sum(told["parts"]["nodes"]) / cut.n_nodes
    assert set(told["skins"]) == {name for name in cut.cell_groups if cut.group_dim(name) < 3}


def test_what_cannot_be_read_is_refused(parts):
    with pytest.raises(RequestError, match="has 4 parts, and no rank 4"):
        read_part(parts, 4)
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        read_part(parts, 0, everywhere=["slav"])
    with pytest.raises(GroupNotFoundError, match="no group of skin faces named 'lower'; there are: "):
        read_part(parts, 0, everywhere=["lower"])
    for other in (parts / "other", parts / FILE, "data"):
        with pytest.raises(ReadError, match="is no folder of parts; lacmesh partition makes one"):
            read_part(other, 0)


def test_parts_are_replaced_only_if_asked_for(parts, cut, tmp_path):
    owner = distribute_nodes(cut, 2)
    with pytest.raises(RequestError, match="exists already; --force replaces it"):
        write_parts(parts, cut, owner)
    assert len(describe_parts(parts)["parts"]["nodes"]) == 4
    write_parts(parts, cut, owner, force=True)
    assert len(describe_parts(parts)["parts"]["nodes"]) == 2
    with pytest.raises(WriteError, match="is a file; name a folder"):
        write_parts(parts / FILE, cut, owner, force=True)
    with pytest.raises(WriteError, match="does not exist"):
        write_parts(tmp_path / "no" / "folder", cut, owner)


def test_nothing_is_left_of_parts_that_could_not_be_written(cut, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("lacmesh.partition.store._write", full)
    with pytest.raises(WriteError, match=f"{FILE}: cannot be written"):
        write_parts(tmp_path / "parts", cut, distribute_nodes(cut, 2))
    assert list(tmp_path.iterdir()) == []


def test_data_that_are_no_numbers_are_left_out_and_named(tmp_path):
    mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], node_data={"name": np.array(["a", "b"])})
    with pytest.warns(LacmeshWarning, match="data that are no numbers are left out: name"):
        write_parts(tmp_path, mesh, distribute_nodes(mesh, 2))
    assert read_part(tmp_path, 0).mesh.node_data == {}


@pytest.mark.parametrize(
    "place, value, told",
    [
        ("header", np.frombuffer(b"{}", np.uint8), r"is damaged \('version'\); partition the mesh again"),
        ("header", np.frombuffer(b'{"version": 1}', np.uint8), "has version 1, expected 2"),
        ("header", np.frombuffer(b'{"version": 2}', np.uint8), r"is damaged \('whole'\)"),
        ("header", np.frombuffer(b"[", np.uint8), "is damaged .*partition the mesh again"),
        ("node/number", np.array([[1], [2]] * 999), "is damaged .*node_number must be integers"),
        ("notes", np.frombuffer(b"[]", np.uint8), "/notes: are damaged"),
        ("node/start", np.zeros((2, 9), int), "/node/start: has 2 rows, expected 4 or more"),
        ("node/index", np.arange(10, dtype=np.int32), "/node/index: has 10 rows, expected"),
        ("cell/type1", np.full((9999, 4), 10**6), "has nodes that are not in the part"),
        ("node/points", None, "/node/points: is missing"),
    ],
)
def test_damage_is_told_with_its_place(parts, place, value, told):
    with h5py.File(parts / FILE, "a") as file:
        del file[place]
        if value is not None:
            file[place] = value
    with pytest.raises(ReadError, match=told):
        read_part(parts, 2)


@pytest.mark.parametrize("seed", range(20))
def test_a_damaged_file_is_refused_or_read(seed, parts):
    """Bytes changed at the beginning, where HDF5 keeps its structure, or the end cut off: no other exception."""
    rng = np.random.default_rng(seed)
    content = bytearray((parts / FILE).read_bytes())
    for place in rng.integers(3000, size=seed):
        content[place] = rng.integers(256)
    (parts / FILE).write_bytes(content if seed % 4 else content[: rng.integers(len(content))])
    try:
        part = read_part(parts, seed % 4, everywhere=["slave"])
        assert len(part.node) == part.mesh.n_nodes and describe_parts(parts)["nodes"] == part.n_nodes
    except ReadError as error:
        assert FILE in str(error)
