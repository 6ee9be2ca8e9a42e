"""Parts in a file are those of the whole mesh; damage is refused; the commands `partition` and `info`; METIS."""

import json
import shutil
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lacmesh import LacmeshWarning, Mesh, cut_skin, read
from lacmesh.errors import DataError, GroupNotFoundError, ReadError, RequestError, WriteError
from lacmesh.partition import describe_parts, distribute_nodes, part_of, read_part, write_parts
from lacmesh.partition.parts import distribute_by_metis
from lacmesh.partition.store import FILE
from tests import REPOSITORY
from tests.bad_input.case import listing
from tests.meshes import random_mesh
from tests.partition.test_parts import differences

BLOCKS = str(REPOSITORY / "data" / "two_blocks.msh")


@pytest.fixture(scope="module")
def cut():
    return cut_skin(read(BLOCKS), "slave").mesh


@pytest.fixture
def parts(cut, tmp_path):
    """A folder with four parts of the cut."""
    write_parts(tmp_path / "parts", cut, distribute_nodes(cut, 4))
    return tmp_path / "parts"


def check(mesh, n, folder, *everywhere):
    owner = distribute_nodes(mesh, n)
    write_parts(folder, mesh, owner, force=True)
    for rank in range(n):
        for groups in ((), *((name,) for name in everywhere), everywhere):
            there, here = part_of(mesh, owner, rank, everywhere=groups), read_part(folder, rank, everywhere=groups)
            assert differences(there, here) == []


@pytest.mark.rows("0", "1")
@pytest.mark.parametrize("seed", range(6))
def test_parts_read_are_those_of_the_whole_mesh(seed, cut, tmp_path):
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)
    check(mesh, 3 + seed, tmp_path, "slave", "none")
    check(cut, 1 + seed, tmp_path, "slave", "master")


def test_skins_are_named_by_tags_and_entities_too(parts, cut, tmp_path):
    (dim, tag) = cut.group_tags["slave"][0]
    there = part_of(cut, distribute_nodes(cut, 4), 1, everywhere=["slave"])
    assert differences(there, read_part(parts, 1, everywhere=[f"{dim}:{tag}"])) == []
    entity = np.column_stack([cut.cell_dim, np.ones(cut.n_cells, int)])
    mesh = replace(cut, cell_groups={}, group_tags={}, cell_data={**cut.cell_data, "entity": entity})
    check(mesh, 3, tmp_path / "entities", "entity:2:1")


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


@pytest.mark.parametrize(
    "place, rank, groups, error, says",
    [
        ("", 4, (), RequestError, "no rank 4"),
        ("", 0, ["slav"], GroupNotFoundError, "did you mean slave"),
        ("", 0, ["lower"], GroupNotFoundError, "faces named 'lower'"),
        ("other", 0, (), ReadError, "no folder of parts"),
        (FILE, 0, (), ReadError, "no folder of parts"),
        (REPOSITORY / "data", 0, (), ReadError, "no folder of parts"),
    ],
)
def test_what_cannot_be_read_is_refused(parts, place, rank, groups, error, says):
    with pytest.raises(error, match=says):
        read_part(parts / place, rank, everywhere=groups)


def test_parts_are_replaced_only_if_asked_for(parts, cut, tmp_path):
    owner = distribute_nodes(cut, 2)
    with pytest.raises(RequestError, match="exists already"):
        write_parts(parts, cut, owner)
    assert len(describe_parts(parts)["parts"]["nodes"]) == 4
    write_parts(parts, cut, owner, force=True)
    assert len(describe_parts(parts)["parts"]["nodes"]) == 2
    for place, says in ((parts / FILE, "is a file"), (tmp_path / "no" / "folder", "does not exist")):
        with pytest.raises(WriteError, match=says):
            write_parts(place, cut, owner, force=True)


def test_nothing_is_left_of_parts_that_could_not_be_written(cut, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("lacmesh.partition.store._pieces", full)
    with pytest.raises(WriteError, match="cannot be written"):
        write_parts(tmp_path / "parts", cut, distribute_nodes(cut, 2))
    assert list(tmp_path.iterdir()) == []


def test_data_that_are_no_numbers_are_left_out_and_named(tmp_path):
    mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], node_data={"name": np.array(["a", "b"])})
    with pytest.warns(LacmeshWarning, match="left out: name"):
        write_parts(tmp_path, mesh, distribute_nodes(mesh, 2))
    assert read_part(tmp_path, 0).mesh.node_data == {}


def header(**changes):
    """The change of a header of which some entries are others."""
    return lambda array: json.dumps({**json.loads(array.tobytes()), **changes}).encode()


@pytest.mark.parametrize(
    "place, value, message",
    [
        ("header", b"{}", r"damaged \('version'\)"),
        ("header", header(version=2), "version 2, expected"),
        ("header", b'{"version": 3}', r"damaged \('figures'\)"),
        ("header", b"[", "is damaged"),
        ("header", header(note="["), "is damaged"),
        ("2/node_number", np.array([[1], [2]] * 999), "rows, expected"),
        ("2/node", np.arange(10, dtype=np.int32), "is damaged"),
        ("2/type1", np.full((9999, 4), 10**6), "is damaged"),
        ("2/node_points", None, "2/node_points"),
    ],
)
def test_damage_is_reported_with_the_file(parts, place, value, message):
    with np.load(parts / FILE) as file:
        arrays = dict(file)
    array = arrays.pop(place)
    value = value(array) if callable(value) else value
    if value is not None:
        arrays[place] = np.frombuffer(value, np.uint8) if isinstance(value, bytes) else value
    np.savez(parts / FILE, **arrays)
    with pytest.raises(ReadError, match=f"{FILE}.*{message}.*partition the mesh again"):
        read_part(parts, 2)


@pytest.mark.rows("0", "13")
@pytest.mark.parametrize("seed", range(20))
def test_a_damaged_file_is_refused_or_read(seed, parts):
    """Bytes changed at the end, where the file has its structure, or the end cut off: no other exception."""
    rng = np.random.default_rng(seed)
    content = bytearray((parts / FILE).read_bytes())
    for place in rng.integers(3000, size=seed):
        content[-place] = rng.integers(256)
    (parts / FILE).write_bytes(content if seed % 4 else content[: rng.integers(len(content))])
    try:
        part = read_part(parts, seed % 4, everywhere=["slave"])
        assert len(part.node) == part.mesh.n_nodes and describe_parts(parts)["nodes"] == part.n_nodes
    except ReadError as error:
        assert FILE in str(error)


# ---- the commands


def test_parts_are_written_beside_the_mesh_and_told(run):
    shutil.copy(BLOCKS, "two.msh")
    out, mesh = run("partition two.msh -n 3"), read("two.msh")
    parts = [part_of(mesh, distribute_nodes(mesh, 3), rank) for rank in range(3)]
    nodes = [part.mesh.n_nodes for part in parts]
    assert f"3 parts of {min(nodes)} to {max(nodes)} nodes, {sum(nodes) / mesh.n_nodes:.2f} copies" in out
    assert "written to two.parts" in out
    assert [differences(part, read_part("two.parts", part.rank)) for part in parts] == [[], [], []]
    told, lines = json.loads(run("info two.parts --json")), run("info two.parts").splitlines()
    assert all(f"{told[what]:,} {what}" in lines[0] for what in ("nodes", "cells"))
    assert f"{told['copies']:.2f} copies of a node" in lines[0]
    largest = next(line.split() for line in lines if line.startswith(" largest"))
    assert largest[1:] == [f"{max(counts):,}" for counts in told["parts"].values()]


@pytest.mark.parametrize(
    "words, status, told",
    [
        (f"partition {BLOCKS} -n 0", 2, "1 to 476 parts, not 0"),
        (f"partition {BLOCKS} -n 4000", 2, "not 4,000"),
        (f"partition {BLOCKS} -n 2 --method metis", 2, "pip install 'lacmesh[metis]'"),
        (f"partition {BLOCKS} -n 2 -o no/p", 3, "folder no does not"),
        (f"partition {BLOCKS} -n 2 -o file", 3, "file: is a file"),
        (f"partition {BLOCKS} -n 2 -o old", 2, "old/parts.npz exists already"),
        ("partition . -n 2", 3, ".: cannot be read"),
        ("partition nothing.msh -n 2", 3, "nothing.msh: cannot be read"),
        ("info old -q", 0, ""),
        ("info empty", 3, "empty: is no folder of parts"),
    ],
)
def test_what_cannot_be_done_has_its_status_and_changes_nothing(words, status, told, run, monkeypatch):
    monkeypatch.setitem(sys.modules, "pymetis", None)
    assert run(f"partition {BLOCKS} -n 2 -o old -q") == ""
    Path("empty").mkdir()
    Path("file").write_text("kept")
    before = listing(Path())
    said = run(words, status)
    assert told in said and said.count("\n") == (status > 0) and listing(Path()) == before


# ---- METIS, in whose place a function looks at the graph


def test_metis_is_given_the_graph_of_nodes_that_share_a_cell_and_may_leave_no_part_empty(monkeypatch):
    mesh, seen = read(BLOCKS), set()
    answer = [node % 3 for node in range(mesh.n_nodes)]

    def part_graph(n, xadj, adjncy):
        seen.update((a, b) for a, (i, j) in enumerate(pairwise(xadj.tolist())) for b in adjncy[i:j].tolist())
        return 0, answer

    monkeypatch.setitem(sys.modules, "pymetis", SimpleNamespace(part_graph=part_graph))
    assert np.array_equal(distribute_by_metis(mesh, 3), np.arange(mesh.n_nodes) % 3)
    solids = [block.nodes for k, block in enumerate(mesh.blocks) if mesh.cell_dim[mesh.offsets[k]] == mesh.dim]
    assert seen == {(a, b) for nodes in solids for row in nodes.tolist() for a in row for b in row if a != b}
    with pytest.raises(RequestError, match="1 to 476 parts"):
        distribute_by_metis(mesh, 477)
    with pytest.raises(DataError, match="1 of 4 parts"):
        distribute_by_metis(mesh, 4)
