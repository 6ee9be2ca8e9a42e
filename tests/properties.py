"""Properties of every cut (the eight of the design), each checked without the code under test."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import measure, rule, signed_area
from lacmesh.reference.shapes import jacobian, shape
from tests.meshes import facets_of


def numbers(mesh, cells):
    return set(mesh.cell_number[np.asarray(cells, int)].tolist())


def volumes(mesh):
    """(n_cells,): signed measure of each cell; plane cells count against +z."""
    parts = []
    for block in mesh.blocks:
        x = mesh.points[block.nodes]
        plane = CELLS[block.type].dim == mesh.space_dim == 2
        parts.append((signed_area if plane else measure)(block.type, x))
    return np.concatenate(parts)


def children_tile_parents(before, cut):
    """1. Children are positive and fill their parent."""
    after = cut.mesh
    size_before, size_after = volumes(before), volumes(after)
    assert (size_after[after.cell_dim == after.dim] > 0).all(), "an inverted child"
    row = {int(n): k for k, n in enumerate(before.cell_number)}
    children = np.flatnonzero(cut.parent_of_cell >= 0)
    parents = [row[int(n)] for n in cut.parent_of_cell[children]]
    total = np.bincount(parents, size_after[children], before.n_cells)
    np.testing.assert_allclose(total[parents], size_before[parents], rtol=1e-12)


def is_conforming(before, cut):
    """2. Every facet has one or two cells, with the same nodes; the boundary is the old one; old nodes are kept."""
    after = cut.mesh
    np.testing.assert_array_equal(after.points[: before.n_nodes], before.points)
    np.testing.assert_array_equal(after.node_number[: before.n_nodes], before.node_number)
    table = facets_of(after)
    boundary = 0.0
    for owners in table.values():
        assert len(owners) <= 2
        assert len({frozenset(nodes.tolist()) for *_, nodes in owners}) == 1, "mid-nodes differ across a facet"
        if len(owners) == 1:
            boundary += measure(owners[0][2], after.points[owners[0][3]][None])[0]
    old = sum(measure(o[0][2], before.points[o[0][3]][None])[0] for o in facets_of(before).values() if len(o) == 1)
    np.testing.assert_allclose(boundary, old, rtol=1e-12)
    used = np.unique(np.concatenate([b.nodes.ravel() for b in after.blocks]))
    assert set(range(before.n_nodes, after.n_nodes)) <= set(used.tolist()), "a new node that no cell uses"
    assert len(np.unique(after.points[before.n_nodes :].round(12), axis=0)) == after.n_nodes - before.n_nodes
    untouched_is_unchanged(before, cut)


def untouched_is_unchanged(before, cut):
    after = cut.mesh

    def cells(mesh, keep):
        return {
            (b.type, int(mesh.cell_number[mesh.offsets[k] + i]), *nodes.tolist())
            for k, b in enumerate(mesh.blocks)
            for i, nodes in enumerate(b.nodes)
            if keep(int(mesh.offsets[k]) + i)
        }

    replaced = set(cut.parent_of_cell[cut.parent_of_cell >= 0].tolist())
    old = cells(before, lambda i: int(before.cell_number[i]) not in replaced)
    new = cells(after, lambda i: cut.parent_of_cell[i] < 0)
    assert old == new


def skin_is_in_order(before, cut):
    """3. Slave children keep their face's orientation, stand together, E1 E2 ...: ring first, centre last."""
    after = cut.mesh
    old = {int(n): i for i, n in enumerate(before.cell_number)}
    for macro, faces in enumerate(cut.faces_of_macro):
        np.testing.assert_array_equal(cut.child_kind[faces], np.arange(1, len(faces) + 1))
        np.testing.assert_array_equal(faces, faces[0] + np.arange(len(faces)))
        if len(faces) == 1:
            continue
        parent = old[int(cut.parent_of_cell[faces[0]])]
        ((kind, _, nodes),) = before.select(np.array([parent]))
        corners = nodes[0][: CELLS[kind].n_corners]
        mine = [next(after.select(np.array([f])))[2][0] for f in faces]
        assert macro == cut.macro_of_face[faces[0]]
        if CELLS[kind].dim == 1:
            assert mine[0][0] == corners[0] and mine[-1][1] == corners[1]
            assert all(a[1] == b[0] for a, b in pairwise(mine))
            continue
        for k, child in enumerate(mine[: len(corners)]):
            assert child[0] == corners[k] and child[1] == corners[(k + 1) % len(corners)]
        if len(mine) > len(corners):
            assert [c[3] for c in mine[:4]] == mine[4][:4].tolist()


def owns_internal_dofs(before, cut):
    """5. Each macro-element has a node whose function lives inside it and has a positive integral over it."""
    mesh = cut.mesh
    slave = np.flatnonzero(cut.macro_of_face >= 0)
    support = {}
    integral = np.zeros((cut.n_macros, mesh.n_nodes))
    for kind, cells, nodes in mesh.select(slave):
        X, w = rule(CELLS[kind].family, 8)
        J = jacobian(kind, mesh.points[nodes], X)
        area = np.linalg.norm(np.cross(J[..., 0], J[..., 1]) if CELLS[kind].dim == 2 else J[..., 0], axis=-1)
        per_node = np.einsum("kp,pn->kn", area * w, shape(kind, X))
        for cell, row, values in zip(cells, nodes, per_node, strict=True):
            macro = int(cut.macro_of_face[cell])
            np.add.at(integral[macro], row, values)
            for node in row:
                support.setdefault(int(node), set()).add(macro)
    for macro in range(cut.n_macros):
        inside = [n for n, macros in support.items() if macros == {macro} and _inside(mesh, cut, macro, n)]
        size = integral[macro].sum()
        carrying = {n for n in inside if integral[macro, n] > 1e-6 * size}
        assert carrying, f"macro-element {macro} owns no internal dof"
        assert set(cut.internal_nodes[macro].tolist()) == carrying


def _inside(mesh, cut, macro, node):
    """True for a node that lies on no boundary edge of its macro-element."""
    rim = Counter()
    members = {}
    for face in cut.faces_of_macro[macro]:
        kind, _, nodes = next(mesh.select(np.array([face])))
        for facet in CELLS[kind].facets:
            there = nodes[0][list(facet.nodes)]
            key = frozenset(there[: CELLS[facet.type].n_corners].tolist())
            rim[key] += 1
            members[key] = there
    return not any(node in members[key] for key, count in rim.items() if count == 1)


def groups_follow(before, cut):
    """6. and 7. A group holds the children of its cells; nothing is lost of groups, numbers and data."""
    after = cut.mesh
    assert list(after.cell_groups) == list(before.cell_groups)
    origin = np.where(cut.parent_of_cell >= 0, cut.parent_of_cell, after.cell_number)
    for name, members in before.cell_groups.items():
        wanted = numbers(before, members)
        inside = np.array([int(o) in wanted for o in origin], bool)
        np.testing.assert_array_equal(after.cell_groups[name], np.flatnonzero(inside))
    assert set(origin.tolist()) == set(before.cell_number.tolist())
    assert len(set(after.cell_number.tolist())) == after.n_cells
    assert len(set(after.node_number.tolist())) == after.n_nodes
    row = {int(n): i for i, n in enumerate(before.cell_number)}
    source = np.array([row[int(o)] for o in origin])
    for name, values in before.cell_data.items():
        np.testing.assert_array_equal(after.cell_data[name], values[source])
    for name, values in before.node_data.items():
        np.testing.assert_array_equal(after.node_data[name][: before.n_nodes], values)
    first = {}
    in_file = np.arange(after.n_cells) if after.file_order is None else after.file_order
    for cell in in_file:
        first.setdefault(int(origin[cell]), int(after.cell_number[cell]))
    assert all(a == b for a, b in first.items()), "the first child in the file keeps its parent's number"
    old_order = np.arange(before.n_cells) if before.file_order is None else before.file_order
    assert list(first) == before.cell_number[old_order].tolist(), "children stand where their cell stood"


def canonical(mesh):
    """A mesh up to numbering: its cells as sets of places, with the groups they are in."""
    places = [tuple(p) for p in mesh.points.round(9) + 0.0]
    out = Counter()
    of = [set() for _ in range(mesh.n_cells)]
    for name, members in mesh.cell_groups.items():
        for cell in members:
            of[cell].add(name)
    for k, block in enumerate(mesh.blocks):
        for row, nodes in enumerate(block.nodes):
            key = (block.type, tuple(sorted(places[n] for n in nodes)), tuple(sorted(of[mesh.offsets[k] + row])))
            out[key] += 1
    return out


def all_hold(before, cut):
    children_tile_parents(before, cut)
    is_conforming(before, cut)
    skin_is_in_order(before, cut)
    owns_internal_dofs(before, cut)
    groups_follow(before, cut)
