"""A run that is restarted gives the results of one that is not; a state of another case, mesh or version is refused.

A mesh is recognised by its digest, which parts of it, in several processes, have together.
"""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lacmesh
import lacsolver as ls
from lacmesh import Mesh, cut_skin, example
from lacmesh.errors import DataError
from lacmesh.partition import cut_part, distribute_nodes, part_of
from lacsolver import Contact, Rigid, Steps, run
from lacsolver.case import fingerprint
from lacsolver.cli import main
from lacsolver.distributed.mesh_digest import ROWS, row_sums
from lacsolver.output.states import read_state
from tests.lacsolver.patch_meshes import three_blocks
from tests.lacsolver.tables import table
from tests.meshes import random_mesh
from tests.problems import ELASTIC, case_of, contact, move

#: its slave is finer than its master, which is said
pytestmark = pytest.mark.filterwarnings("ignore:pressures of contact 'foot' alternate")

#: a contact that opens and closes, a tie, a rigid body that is loaded and one that is moved
SEVERAL = (
    ELASTIC,
    Contact(name="foot", slave="slave1", master="master1", clearance="0.002 * x - 0.001"),
    ls.Tie(name="glue", slave="slave2", master="master2"),
    Rigid(group="bottom", uz="1e-4 * t * t"),
    ls.Spring(group="master2", kx=50.0, ky=50.0, kz=2.0),
    Rigid(group="top", fz="-3 * sin(t)", fx="0.1 * t", moment=[0.0, "0.2 * t", 0.0]),
)


@cache
def blocks():
    return three_blocks(("HEXA8", "TETRA4", "PENTA6 quadrangle"))


def several(end=3.0, count=6):
    """The case of several joints, in six steps unless other numbers are given."""
    return case_of(blocks(), *SEVERAL, Steps(end=end, count=count), model="3d")


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The folder with the results of the whole run."""
    run(several(), output := tmp_path_factory.mktemp("several") / "whole")
    return output


def results(folder):
    return json.loads((folder / "results.json").read_text())


# ---- goes on; that it does to the last bit is a law of the corpus (test_laws.py), its files are in test_output_writer


@pytest.mark.rows("15-143-terminated")
@pytest.mark.parametrize(
    ("number", "status", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_the_command_goes_on_after_it_was_stopped(ran, tmp_path, monkeypatch, number, status, word):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
    lacmesh.write("blocks.msh", blocks())
    case = replace(several(), mesh="blocks.msh")
    case.write("case.toml")
    words = [sys.executable, "-m", "lacsolver", "run", "case.toml", "-o", "out"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        next(line for line in process.stdout if line.split()[:1] == ["2"])
        process.send_signal(number)
        error = process.communicate(timeout=600)[1]
    told = results(tmp_path / "out")
    last = told["steps"][-1]["time"]
    assert process.returncode == status and told["status"] == "interrupted" and 1.0 <= last < 3.0
    assert f"lacsolver: error: {word}; what converged up to t = {last:g} is in out; --restart out" in error
    assert read_state(tmp_path / "out", case).time == last
    assert not [path for path in (tmp_path / "out").rglob(".*") if path.is_file()]
    assert main(["run", "case.toml", "--restart", "out", "-o", "out", "-q"]) == 0
    assert (read_state("out", case).time, read_state("out", case).number) == (3.0, 6)
    assert main(["run", "case.toml", "--restart", "out", "--from", "2.5", "-o", "last", "-q"]) == 0
    assert [step["time"] for step in results(tmp_path / "last")["steps"]] == [3.0]
    run(case, tmp_path / "whole")
    for name in ("history.csv", "contact_foot.csv", "contact_glue.csv"):  # of processes with kernels of other bits
        one, other = table(tmp_path / "out" / name), table(tmp_path / "whole" / name)
        assert list(one) == list(other)
        for column in one.keys() - {"iterations"}:
            np.testing.assert_allclose(one[column], other[column], rtol=1e-9, atol=1e-9, err_msg=column)


# ---- refused

CHANGES = {
    "material": (0, {"young": 1001.0}),
    "contact": (1, {"clearance": 0.0}),
    "tie": (2, {"coverage_threshold": 0.1}),
    "spring": (4, {"kz": 2.5}),
    "rigid": (5, {"fx": "0.2 * t"}),
}


@pytest.mark.parametrize("part", CHANGES)
def test_a_state_of_another_case_is_refused(ran, part):
    k, change = CHANGES[part]
    records = [replace(record, **change) if j == k else record for j, record in enumerate(SEVERAL)]
    other = case_of(blocks(), *records, Steps(end=4.0), model="3d")
    with pytest.raises(DataError, match=f"another case: {part} changed"):
        read_state(ran, other, mesh=other.mesh)


def wider(mesh):
    return replace(mesh, points=mesh.points * [1.001, 1.0, 1.0])


def test_a_state_on_another_mesh_is_refused(ran, tmp_path):
    whole = several(4.0, 8)
    start = read_state(ran, whole, mesh=whole.mesh)
    with pytest.raises(DataError, match="another case: mesh changed"):
        read_state(ran, whole, mesh=wider(whole.mesh))
    with pytest.raises(DataError, match="another case: mesh changed"):
        run(whole, tmp_path / "then", mesh=wider(whole.mesh), start=start)
    assert not (tmp_path / "then").exists()


# ---- the digest of a mesh: any parts of it have the same one together


def naming(some="some"):
    """A case that names groups of cells and of nodes, and an entity."""
    moved = move(some, ux=0.0), move("nodes", uy=0.0)
    return case_of("a.msh", ELASTIC, contact(), *moved, model="3d")


def digest_of(case, whole):
    return fingerprint(case, whole)["mesh"]


def digests_of(case, parts):
    """The digests that processes with the parts of a mesh make together."""
    sums = []

    def made(part, total):
        share = SimpleNamespace(own=part.own, node=part.node, cell=part.cell, total=total)
        return fingerprint(case, part.mesh, share)["mesh"]

    for part in parts:
        made(part, lambda own: sums.append(own.copy()) or own)
    return {made(part, lambda own: np.sum(sums, axis=0, dtype=np.uint64)) for part in parts}


def divided(whole, n, skins=()):
    owner = distribute_nodes(whole, n)
    return [part_of(whole, owner, rank, everywhere=skins) for rank in range(n)]


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("seed", range(4))
def test_any_parts_of_a_mesh_have_its_digest(seed, n):
    rng = np.random.default_rng(seed)
    some = random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)
    groups = {**some.cell_groups, "some": rng.permutation(some.n_cells)[: some.n_cells // 3]}
    nodes = {"nodes": np.arange(0, some.n_nodes, 3)}
    whole = Mesh.create(some.points, some.blocks, cell_groups=groups, node_groups=nodes)
    assert digests_of(naming(), divided(whole, n)) == {digest_of(naming(), whole)}


BLOCKS = lacmesh.read(example("two_blocks.msh"))
CUT = cut_skin(BLOCKS, "slave").mesh


def test_an_entity_that_a_part_has_no_cell_of_counts_in_the_others():
    dim, tag = next(entity for entity in BLOCKS.entities if entity[0] == 2)
    case, parts = naming(f"entity:{dim}:{tag}"), divided(BLOCKS, 8)
    assert any((part.mesh.entity_of_cell != [dim, tag]).any(axis=1).all() for part in parts)
    assert digests_of(case, parts) == {digest_of(case, BLOCKS)} != {digest_of(naming(), BLOCKS)}


@pytest.mark.parametrize("n", [2, 3])
def test_parts_that_are_cut_have_the_digest_of_the_cut_mesh(n):
    parts = [cut_part(part, "slave") for part in divided(BLOCKS, n, ["slave", "master"])]
    assert digests_of(naming(), parts) == {digest_of(naming(), CUT)}


def altered(values, rng, change):
    """A copy of an array with one row changed, or two that change places ("swap")."""
    values = values.copy()
    one, other = rng.choice(len(values), 2, replace=False)
    if change == "swap":
        values[[one, other]] = values[[other, one]]
    else:
        values[one] = change(values[one])
    return values


def in_block(rng, change):
    """Blocks one of which has other cells."""
    k = int(rng.integers(len(CUT.blocks)))
    return tuple((kind, altered(n, rng, change) if j == k else n) for j, (kind, n) in enumerate(CUT.blocks))


ALTERED = {
    "last bit": lambda rng: {"points": altered(CUT.points, rng, lambda x: np.nextafter(x, [9, x[1], x[2]]))},
    "nodes swapped": lambda rng: {"points": altered(CUT.points, rng, "swap")},
    "cells swapped": lambda rng: {"blocks": in_block(rng, "swap")},
    "cell turned": lambda rng: {"blocks": in_block(rng, lambda nodes: np.roll(nodes, 1))},
    "regrouped": lambda rng: {
        "cell_groups": {**CUT.cell_groups, "slave": np.delete(CUT.cell_groups["slave"], rng.integers(36))}
    },
    "recorded": lambda rng: {
        "cell_data": {**CUT.cell_data, "lac_macro": altered(CUT.cell_data["lac_macro"], rng, lambda k: k + 1)}
    },
    "zone renamed": lambda rng: {"zones": ("other",)},
}


@pytest.mark.rows("nodes swapped", "zone renamed")
@pytest.mark.parametrize("change", ALTERED)
@settings(max_examples=20)
@given(seed=st.integers(0, 2**32))
def test_any_change_is_seen(change, seed):
    other = replace(CUT, **ALTERED[change](np.random.default_rng(seed)))
    assert digest_of(naming(), other) != digest_of(naming(), CUT)


def test_the_sign_of_zero_and_the_width_of_integers_do_not_count():
    points = np.where(CUT.points == 0.0, -0.0, CUT.points)
    assert np.signbit(points[CUT.points == 0.0]).all() and (CUT.points == 0.0).any()
    blocks = tuple((kind, nodes.astype(np.int32)) for kind, nodes in CUT.blocks)
    assert digest_of(naming(), replace(CUT, points=points, blocks=blocks)) == digest_of(naming(), CUT)


def test_sums_of_rows_are_those_of_splitmix64():
    """Numbers as Python's integers give them: the finaliser of SplitMix64, from two seeds of the SHA-256 of a name."""
    x = np.array([[0.1, -2.5, np.inf], [1e-300, -0.0, 3.0]])
    assert row_sums("points", np.array([5, 6]), x).tolist() == [16465191677129263898, 4827909912438296895]


@given(st.integers(0, 2**40), st.integers(0, 2**32), st.sampled_from([5, 3 * ROWS + 5]))
@settings(max_examples=20)
def test_sums_are_those_of_rows_in_any_order_and_of_pieces(start, seed, n):
    rng = np.random.default_rng(seed)
    index, x = start + np.arange(n), rng.normal(size=(n, 3))
    pieces = np.split(rng.permutation(n), np.sort(rng.integers(0, n, 3)))
    total = np.sum([row_sums("x", index[rows], x[rows]) for rows in pieces], axis=0, dtype=np.uint64)
    assert row_sums("x", index, x).tolist() == total.tolist() != row_sums("y", index, x).tolist()
