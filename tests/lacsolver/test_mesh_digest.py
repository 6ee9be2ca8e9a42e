"""The digest of a mesh: any parts of it give the same one, any change another, and that of older states is known."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lacmesh import Mesh, cut_skin, read
from lacmesh.partition import cut_part, distribute_nodes, part_of
from lacsolver.case import changed, fingerprint, fingerprint_as, parse_case
from lacsolver.case.row_sums import ROWS, row_sums
from tests.lacsolver.distributed.mpi import ROOT
from tests.lacsolver.test_case_values import NAMED, mesh
from tests.meshes import random_mesh

#: names groups of cells and of nodes, and an entity
GROUPS = """mesh = "a.msh"
model = "3d"
material = [{ young = 1.0, poisson = 0.3 }]
contact = [{ slave = "slave", master = "master" }]
displacement = [{ group = "some", ux = 0.0 }, { group = "nodes", uy = 0.0 }]
"""
WORD = (1 << 64) - 1


def digest_of(text, whole):
    """The digest of a whole mesh."""
    return fingerprint(parse_case(text), whole)["mesh"]


def digests_of(text, parts):
    """The digests that processes with the parts of a mesh make together."""
    case, sums = parse_case(text), []

    def made(part, total):
        held = SimpleNamespace(own=part.own, node=part.node, cell=part.cell, total=total)
        return fingerprint(case, part.mesh, held)["mesh"]

    for part in parts:
        made(part, lambda own: sums.append(own.copy()) or own)
    return {made(part, lambda own: np.sum(sums, axis=0, dtype=np.uint64)) for part in parts}


def divided(whole, n, skins=()):
    owner = distribute_nodes(whole, n)
    return [part_of(whole, owner, rank, everywhere=skins) for rank in range(n)]


# ---- parts


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("seed", range(4))
def test_any_parts_of_a_mesh_have_its_digest(seed, n):
    rng = np.random.default_rng(seed)
    some = random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)
    groups = {**some.cell_groups, "some": rng.permutation(some.n_cells)[: some.n_cells // 3]}
    named = replace(some, cell_groups=groups, node_groups={"nodes": np.arange(0, some.n_nodes, 3)})
    whole = Mesh.create(named.points, named.blocks, cell_groups=groups, node_groups=named.node_groups)
    assert digests_of(GROUPS, divided(whole, n)) == {digest_of(GROUPS, whole)}


def test_an_entity_that_a_part_has_no_cell_of_counts_in_the_others():
    whole = read(ROOT / "data" / "two_blocks.msh")
    dim, tag = next(entity for entity in whole.entities if entity[0] == 2)
    text = GROUPS.replace('"some"', f'"entity:{dim}:{tag}"')
    parts = divided(whole, 8)
    assert any((part.mesh.entity_of_cell != [dim, tag]).any(axis=1).all() for part in parts)
    assert digests_of(text, parts) == {digest_of(text, whole)} != {digest_of(GROUPS, whole)}


@pytest.mark.parametrize("n", [2, 3])
def test_parts_that_are_cut_have_the_digest_of_the_cut_mesh(n):
    whole = read(ROOT / "data" / "two_blocks.msh")
    parts = [cut_part(part, "slave") for part in divided(whole, n, ["slave", "master"])]
    assert digests_of(GROUPS, parts) == {digest_of(GROUPS, cut_skin(whole, "slave").mesh)}


# ---- changes


def moved(some, rng):
    """Move a node by the last bit of a coordinate."""
    points = some.points.copy()
    at = int(rng.integers(some.n_nodes)), int(rng.integers(3))
    points[at] = np.nextafter(points[at], np.inf)
    return replace(some, points=points)


def nodes_swapped(some, rng):
    """Let two nodes change places, and their cells keep the numbers of the nodes."""
    points = some.points.copy()
    one, other = rng.choice(some.n_nodes, 2, replace=False)
    points[[one, other]] = points[[other, one]]
    return replace(some, points=points)


def cells_swapped(some, rng):
    """Let two cells of a type change places."""
    k = int(rng.integers(len(some.blocks)))
    kind, nodes = some.blocks[k]
    order = np.arange(len(nodes))
    one, other = rng.choice(len(nodes), 2, replace=False)
    order[[one, other]] = other, one
    return replace(some, blocks=tuple((kind, nodes[order]) if j == k else b for j, b in enumerate(some.blocks)))


def cell_turned(some, rng):
    """List the nodes of a cell from another one on."""
    k = int(rng.integers(len(some.blocks)))
    kind, nodes = some.blocks[k]
    nodes = nodes.copy()
    row = int(rng.integers(len(nodes)))
    nodes[row] = np.roll(nodes[row], 1)
    return replace(some, blocks=tuple((kind, nodes) if j == k else b for j, b in enumerate(some.blocks)))


def regrouped(some, rng):
    """Take a face out of the slave."""
    members = some.cell_groups["slave"]
    left = np.delete(members, rng.integers(len(members)))
    return replace(some, cell_groups={**some.cell_groups, "slave": left})


def recorded(some, rng):
    """Change the macro-element of a cell."""
    macro = some.cell_data["lac_macro"].copy()
    macro[rng.integers(len(macro))] += 1
    return replace(some, cell_data={**some.cell_data, "lac_macro": macro})


def renamed(some, rng):
    """Give the zone another name."""
    return replace(some, zones=("other",))


CUT = cut_skin(read(ROOT / "data" / "two_blocks.msh"), "slave").mesh


@pytest.mark.parametrize("change", [moved, nodes_swapped, cells_swapped, cell_turned, regrouped, recorded, renamed])
@settings(max_examples=20)
@given(seed=st.integers(0, 2**32))
def test_any_change_is_seen(change, seed):
    other = change(CUT, np.random.default_rng(seed))
    assert digest_of(GROUPS, other) != digest_of(GROUPS, CUT)


def test_the_sign_of_zero_and_the_width_of_integers_do_not_count():
    points = np.where(CUT.points == 0.0, -0.0, CUT.points)
    assert np.signbit(points[CUT.points == 0.0]).all() and (CUT.points == 0.0).any()
    blocks = tuple((kind, nodes.astype(np.int32)) for kind, nodes in CUT.blocks)
    assert digest_of(GROUPS, replace(CUT, points=points, blocks=blocks)) == digest_of(GROUPS, CUT)


# ---- sums


def mixed(z):
    """The finaliser of SplitMix64, in Python's integers."""
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & WORD
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & WORD
    return z ^ (z >> 31)


def hashed(seed, index, bits):
    """The hash of a row."""
    h = mixed((seed + index * 0x9E3779B97F4A7C15) & WORD)
    for value in bits:
        h = mixed(h ^ value)
    return h


def test_the_mixing_is_that_of_splitmix64():
    """The first numbers from the seed 1234567, as in Rosetta Code, Pseudo-random numbers/Splitmix64."""
    found = [hashed(1234567, k, ()) for k in range(1, 6)]
    published = 6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431, 16408922859458223821
    assert found == list(published)


@given(
    st.lists(st.lists(st.floats(), min_size=3, max_size=3), min_size=1, max_size=20),
    st.integers(0, 2**40),
    st.randoms(use_true_random=False),
)
def test_sums_are_those_of_single_rows_in_any_order(values, start, random):
    index, x = start + np.arange(len(values)), np.array(values)
    bits = (x + 0.0).view(np.uint64).tolist()
    seeds = np.frombuffer(hashlib.sha256(b"points").digest(), "<u8", 2).tolist()
    expected = [sum(hashed(seed, start + k, row) for k, row in enumerate(bits)) & WORD for seed in seeds]
    assert row_sums("points", index, x).tolist() == expected
    order = np.array(random.sample(range(len(values)), len(values)))
    half = len(order) // 2
    both = [row_sums("points", index[rows], x[rows]) for rows in (order[:half], order[half:])]
    assert (both[0] + both[1]).tolist() == expected


def test_many_rows_are_those_of_pieces():
    x = np.arange(3 * ROWS + 5)[:, None]
    ends = [0, 7, ROWS, 2 * ROWS + 1, len(x)]
    pieces = [row_sums("x", np.arange(a, b), x[a:b]) for a, b in pairwise(ends)]
    assert row_sums("x", np.arange(len(x)), x).tolist() == np.sum(pieces, axis=0, dtype=np.uint64).tolist()
    assert row_sums("y", np.arange(len(x)), x).tolist() != row_sums("x", np.arange(len(x)), x).tolist()


# ---- states of older versions


def test_a_fingerprint_of_an_older_version_is_compared_as_it_was_made():
    """The digests are those that commit 5e38391 made of these meshes."""
    case = parse_case(NAMED)
    cut = cut_skin(mesh(), "lower").mesh
    cut = replace(cut, points=np.round(3 * cut.points) / 3)  # to the bit: the digests are those of bits
    for some, digest in ((mesh(), "ed2c0bdf9bbe1600eda12f11e344dcbf"), (cut, "6ed56fad9dce9ce9b856e2433bdf9947")):
        now = fingerprint(case, some)
        older = {**now, "mesh": digest}
        assert changed(older, now) == ("mesh",)
        assert changed(older, fingerprint_as(older, now, case, some)) == ()
        wider = replace(some, points=some.points * 1.001)
        assert changed(older, fingerprint_as(older, fingerprint(case, wider), case, wider)) == ("mesh",)
        assert fingerprint_as(now, now, case, some) is now
