"""The commands `lacmesh partition` and `lacmesh info` on a folder: their output, their errors and exit statuses."""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from lacmesh import read
from lacmesh.cli import main
from lacmesh.errors import DataError, RequestError
from lacmesh.partition import distribute_nodes, part_of, read_part
from lacmesh.partition.metis import distribute_by_metis
from tests import REPOSITORY
from tests.partition.compare import differences

BLOCKS = str(REPOSITORY / "data" / "two_blocks.msh")


def test_parts_are_written_beside_the_mesh_and_told(fresh, capsys):
    main(["convert", BLOCKS, "two.msh", "-q"])
    assert main(["partition", "two.msh", "-n", "3"]) == 0
    out = capsys.readouterr().out
    mesh = read("two.msh")
    owner = distribute_nodes(mesh, 3)
    parts = [part_of(mesh, owner, rank) for rank in range(3)]
    nodes = [part.mesh.n_nodes for part in parts]
    assert f"two.msh: 3 parts of {min(nodes)} to {max(nodes)} nodes, {sum(nodes) / mesh.n_nodes:.2f} copies" in out
    assert "written to two.parts" in out
    assert [differences(part, read_part("two.parts", part.rank)) for part in parts] == [[], [], []]


def test_info_lists_the_parts(fresh, capsys):
    assert main(["partition", BLOCKS, "-n", "4", "-o", "p", "-q"]) == 0
    assert capsys.readouterr().out == ""
    assert main(["info", "p", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert main(["info", "p"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"p: 4 parts of a mesh of {told['nodes']:,} nodes, {told['cells']:,} cells; " + (
        f"{told['copies']:.2f} copies of a node"
    )
    largest = next(line.split() for line in lines if line.startswith(" largest"))
    assert largest[1:] == [f"{max(counts):,}" for counts in told["parts"].values()]


def fails(capsys, *args):
    """The status of a command, and what it says of its errors."""
    capsys.readouterr()
    return main(list(args)), capsys.readouterr().err


@pytest.mark.parametrize(
    "args, status, told",
    [
        ((BLOCKS, "-n", "0"), 2, "has from 1 to 476 parts, not 0"),
        ((BLOCKS, "-n", "4000"), 2, "has from 1 to 476 parts, not 4,000"),
        ((BLOCKS, "-n", "2", "--method", "metis"), 2, "the method metis needs pymetis: pip install 'lacmesh[metis]'"),
        ((BLOCKS, "-n", "2", "-o", "no/p"), 3, "no/p: the folder no does not exist"),
        ((BLOCKS, "-n", "2", "-o", "file"), 3, "file: is a file; name a folder"),
        ((BLOCKS, "-n", "2", "-o", "old"), 2, "old/parts.h5 exists already; --force replaces it"),
        ((".", "-n", "2"), 3, ".: cannot be read (Is a directory)"),
        (("nothing.msh", "-n", "2"), 3, "nothing.msh: cannot be read (No such file or directory)"),
    ],
)
def test_what_cannot_be_done_has_its_status_and_changes_nothing(args, status, told, fresh, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pymetis", None)
    main(["partition", BLOCKS, "-n", "2", "-o", "old", "-q"])
    before = (fresh / "old" / "parts.h5").read_bytes()
    (fresh / "file").write_text("kept")
    there = sorted(fresh.iterdir())
    found, said = fails(capsys, "partition", *args)
    assert found == status and told in said and said.count("\n") == 1
    assert sorted(fresh.iterdir()) == there
    assert (fresh / "old" / "parts.h5").read_bytes() == before


def test_a_folder_without_parts_is_no_mesh(fresh, capsys):
    assert fails(capsys, "info", "data") == (
        3,
        "lacmesh: error: data: is no folder of parts; lacmesh partition makes one\n",
    )


# ---- METIS, in whose place a function looks at the graph


def shared_nodes(mesh):
    """The pairs of different nodes that share a cell of the highest dimension."""
    solids = [block.nodes for k, block in enumerate(mesh.blocks) if mesh.cell_dim[mesh.offsets[k]] == mesh.dim]
    return {(a, b) for nodes in solids for row in nodes.tolist() for a in row for b in row if a != b}


def test_metis_is_given_the_graph_of_nodes_that_share_a_cell(monkeypatch):
    mesh = read(BLOCKS)
    seen = set()

    def part_graph(n, xadj, adjncy):
        seen.update((a, b) for a, (i, j) in enumerate(pairwise(xadj.tolist())) for b in adjncy[i:j].tolist())
        return 0, [node % n for node in range(mesh.n_nodes)]

    monkeypatch.setitem(sys.modules, "pymetis", SimpleNamespace(part_graph=part_graph))
    assert np.array_equal(distribute_by_metis(mesh, 3), np.arange(mesh.n_nodes) % 3)
    assert seen == shared_nodes(mesh)
    with pytest.raises(RequestError, match="has from 1 to 476 parts"):
        distribute_by_metis(mesh, 477)


def test_a_part_that_metis_leaves_empty_is_refused(monkeypatch):
    mesh = read(BLOCKS)
    empty = SimpleNamespace(part_graph=lambda n, **_: (0, [0] * mesh.n_nodes))
    monkeypatch.setitem(sys.modules, "pymetis", empty)
    with pytest.raises(DataError, match="METIS leaves 1 of 2 parts without nodes; ask for fewer parts"):
        distribute_by_metis(mesh, 2)
