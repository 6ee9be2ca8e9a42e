"""Random small meshes that use all a msh file can hold; meshes as plain values, by number, and as gmsh reads them."""

import numpy as np
from hypothesis import strategies as st

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.entities import assign
from lacmesh.mesh import Mesh, Model, Periodic, Step

NAMES = ["slave", "A", "b c", "Körper", 'say "hi"', "x" * 300, "é" * 90, "$End", "", "tab\t<&>", "2:7", "a'b", " pad "]
FIELDS = ["T", "U", "champ é", 'f"q"', "T@0", "lac_macro", "x" * 200, "x" * 201]


def meshes(kinds=tuple(ALL_CELLS), tidy=False):
    """Meshes of random numbers with some of all that a mesh may have; `tidy`: as gmsh likes them.

    Then nodes are distinct in a cell, there is one type of a family (gmsh's API sees no other in an entity), entities
    have the cells' dimension, numbers are small (gmsh's fields are as long as the largest) and nothing is periodic
    (gmsh moves nodes to where the map takes them).
    """
    return st.integers(0, 2**32 - 1).map(lambda seed: _mesh(np.random.default_rng(seed), kinds, tidy))


def _mesh(rng, kinds, tidy):
    def yes():
        return rng.random() < 0.5

    def some(candidates, most=None):
        found = rng.permutation(candidates)[: rng.integers(0, min(len(candidates), most or len(candidates)) + 1)]
        return found.tolist()

    def numbers(size):
        largest = 10 ** int(rng.integers(3, 5 if tidy else 10))
        return rng.choice(largest, size, replace=False) + 1 if counted else np.arange(1, size + 1)

    def groups(size, most):
        return {name: np.sort(some(np.arange(size))).astype(int) for name in some(NAMES, most)}

    counted, tagged = yes(), yes()
    n = int(rng.integers(130, 150) if tidy else rng.integers(1, 30))
    points = np.round(rng.normal(size=(n, 3)) * 10.0 ** rng.integers(-3, 4), 12) * [1, 1, yes()]
    chosen = some(kinds, 5)
    if tidy:
        chosen = list({ALL_CELLS[kind].family: kind for kind in chosen}.values())
    blocks = []
    for kind in chosen:
        rows = [rng.choice(n, ALL_CELLS[kind].n_nodes, replace=not tidy) for _ in range(rng.integers(1, 7))]
        blocks.append((kind, np.array(rows)))
    cell_dim = np.array([ALL_CELLS[kind].dim for kind, rows in blocks for _ in rows], int)
    k = len(cell_dim)
    cell_groups, tags, used = groups(k, 6), {}, set()
    for name in cell_groups if tagged else ():
        found = {(int(d), int(t)) for d, t in rng.integers([0, 1], [4, 9], (2, 2))} - used
        if found:
            tags[name] = tuple(sorted(found))
            used |= found
    if tagged and "2:12" not in cell_groups:
        cell_groups["2:12"], tags["2:12"] = np.sort(some(np.flatnonzero(cell_dim == 2))).astype(int), ((2, 12),)
    cell_data, node_data, steps = _fields(rng, some(FIELDS, 3), k), _fields(rng, some(FIELDS, 2), n), {}
    for key in [key for key in cell_data if key != "lac_macro" and yes()]:
        steps |= _steps(rng, cell_data, node_data, key)
    if yes():
        entity = np.column_stack([cell_dim, rng.integers(1, 4, k)])
        if not tidy:
            entity[rng.random(k) < 0.1] = -1
            entity[rng.random(k) < 0.1, 0] = 2
        cell_data["entity"] = entity.astype(np.int32)
    if yes():
        node_data["entity"] = rng.integers([0, 1], [4, 4], (n, 2)).astype(np.int32)
        node_data["entity"][rng.random(n) < 0.2] = -1
    return Mesh.create(
        points, blocks, space_dim=[None, 2, 3][rng.integers(3)], node_number=numbers(n), cell_number=numbers(k),
        file_order=rng.permutation(k) if yes() else None, cell_groups=cell_groups, node_groups=groups(n, 3),
        cell_data=cell_data, node_data=node_data, group_tags=tags, steps=steps, zones=tuple(some(["zone 1", "z$é"])),
        model=_model(rng, n, tidy) if yes() else None, name=["mesh", "my mesh é", "$"][rng.integers(3)],
    )  # fmt: skip


def _fields(rng, names, n):
    fields = {}
    for name in names:
        shape = [(), (1,), (2,), (3,), (6,), (9,), (12,), (3, 3)][rng.integers(8)]
        values = rng.normal(size=(n, *shape))
        if name.startswith("lac_"):
            values = rng.integers(-1, 5, n).astype(np.int32)
        elif rng.random() < 0.3:
            values = rng.integers(-1, 2**50, (n, *shape))
        elif rng.random() < 0.6:
            values[rng.random(n) < 0.5] = np.nan
        fields[name] = values
    return fields


def _steps(rng, cell_data, node_data, key):
    """Make a field one of several steps, or of one step with a time."""
    if rng.random() < 0.5:
        return {key: Step(key, int(rng.integers(-1, 3)), int(rng.integers(-1, 2)), float(rng.normal()))}
    values, steps = cell_data.pop(key), {}
    node_data.pop(key, None)
    numbers = np.array([[0, 1, 2], [5, 2, 9], [-1, -1, 3], [10**8, 0, 1], [4, 4, 0]])[rng.integers(5)]
    for j, number in enumerate(numbers.tolist()):
        cell_data[f"{key}@{j}"] = values * (j + 1)
        steps[f"{key}@{j}"] = Step(key, number, -1, 0.5 * j)
    return steps


def _model(rng, n, tidy):
    tags = [(d, t) for d in range(4) for t in (1, 2)]
    boundary = {(d, t): tuple((rng.permutation([1, -2])[: rng.integers(0, 3)]).tolist()) if d else () for d, t in tags}
    links = tuple(
        Periodic((d, 1), (d, 2), tuple(rng.normal(size=16)) if d else (), rng.integers(0, n, (d, 2))) for d in range(3)
    )
    return Model(boundary, () if tidy else links[: rng.integers(0, 4)])


def plain(mesh):
    """Contents of a mesh by the numbers of nodes and cells, without what a writer is free to choose."""
    node, cell = mesh.node_number, mesh.cell_number
    cells = {}
    for block, first in zip(mesh.blocks, mesh.offsets, strict=False):
        for j, row in enumerate(block.nodes):
            cells[int(cell[first + j])] = (block.type, *node[row].tolist())
    return {
        "points": dict(zip(node.tolist(), map(tuple, mesh.points.tolist()), strict=True)),
        "cells": cells,
        "space_dim": mesh.space_dim,
        "cell_groups": {name: set(cell[g].tolist()) for name, g in mesh.cell_groups.items()},
        "node_groups": {name: set(node[g].tolist()) for name, g in mesh.node_groups.items()},
        "cell_data": {key: _by_number(cell, v) for key, v in mesh.cell_data.items() if key != "entity"},
        "node_data": {key: _by_number(node, v) for key, v in mesh.node_data.items() if key != "entity"},
        "steps": {key: tuple(vars(step).values()) for key, step in mesh.steps.items()},
        "zones": mesh.zones,
        "name": mesh.name,
        "periodic": [] if mesh.model is None else [_link(link, node) for link in mesh.model.periodic],
    }


def _by_number(number, values):
    values = np.asarray(values)
    integer = values.dtype.kind in "iu"
    absent = (values == -1) if integer else np.isnan(values)
    absent = absent.all(axis=tuple(range(1, values.ndim)))
    rows = {int(n): repr(v.tolist()) for n, v, a in zip(number, values, absent, strict=True) if not a}
    return integer, values.shape[1:], rows


def _link(link, node):
    return link.slave, link.master, tuple(link.affine), node[np.reshape(link.nodes, (-1, 2))].tolist()


def entities(mesh):
    """The entities of cells and nodes by number (where they are known), and the boundaries that are not empty."""
    said = {"boundary": {} if mesh.model is None else {t: b for t, b in mesh.model.boundary.items() if b}}
    for on, number, data in (("cell", mesh.cell_number, mesh.cell_data), ("node", mesh.node_number, mesh.node_data)):
        if "entity" in data:
            said[on] = dict(zip(number.tolist(), map(tuple, data["entity"].tolist()), strict=True))
    return said


def decided(mesh):
    """Entities and boundaries in the form of `entities`, as `assign` chooses them."""
    table = assign(mesh)
    tags = np.array([(e.dim, e.tag) for e in table.entities]).reshape(-1, 2)
    return {
        "cell": dict(zip(mesh.cell_number.tolist(), map(tuple, tags[table.cell].tolist()), strict=True)),
        "node": dict(zip(mesh.node_number.tolist(), map(tuple, tags[table.node].tolist()), strict=True)),
        "boundary": {tag: signed for tag, signed in table.boundary.items() if signed},
    }


def order(mesh):
    """Numbers of the cells in the order of the file."""
    return mesh.cell_number[slice(None) if mesh.file_order is None else mesh.file_order].tolist()


def same(a, b):
    """Differences between two meshes: keys of `plain`, and the order of the file."""
    first, second = plain(a), plain(b)
    return [key for key in first if first[key] != second[key]] + ([] if order(a) == order(b) else ["order"])


def seen_by(gmsh, path):
    """A file as gmsh reads it: nodes, elements and physical groups, by number."""
    gmsh.clear()
    gmsh.logger.start()
    try:
        gmsh.open(str(path))
        complaints = [line for line in gmsh.logger.get() if line.startswith(("Warning", "Error"))]
    finally:
        gmsh.logger.stop()
    number, xyz, _ = gmsh.model.mesh.getNodes()
    elements = {}
    for kind, tags, nodes in zip(*gmsh.model.mesh.getElements(), strict=True):
        for tag, row in zip(tags.tolist(), nodes.reshape(len(tags), -1).tolist(), strict=True):
            elements[tag] = (int(kind), *row)
    groups = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        found = [gmsh.model.mesh.getElements(dim, e)[1] for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)]
        name = gmsh.model.getPhysicalName(dim, tag)
        groups[dim, tag] = (name, {int(n) for tags in found for some in tags for n in some})
    return {
        "points": dict(zip(number.tolist(), map(tuple, xyz.reshape(-1, 3).tolist()), strict=True)),
        "elements": elements,
        "groups": groups,
        "complaints": complaints,
    }


def as_seen(mesh):
    """Nodes, elements and physical groups of a mesh, in the form of `seen_by`."""
    said = plain(mesh)
    dim = dict(zip(mesh.cell_number.tolist(), mesh.cell_dim.tolist(), strict=True))
    groups = {}
    for name, cells in said["cell_groups"].items():
        for d, tag in mesh.group_tags.get(name, ()):
            first = next(t for t in mesh.group_tags[name] if t[0] == d)
            members = {n for n in cells if dim[n] == d} if first == (d, tag) else set()
            groups[d, tag] = ("" if name == f"{d}:{tag}" else name, members)
    return {
        "points": said["points"],
        "elements": {n: (ALL_CELLS[c[0]].msh, *c[1:]) for n, c in said["cells"].items()},
        "groups": groups,
    }


def places(mesh):
    """Groups and elements of a mesh: cells as types and coordinates; and the number of elements."""
    xyz = [tuple(p) for p in np.round(mesh.points, 9).tolist()]
    rows = [(ALL_CELLS[b.type].msh, *(xyz[n] for n in row)) for b in mesh.blocks for row in b.nodes.tolist()]
    return {name: {rows[c] for c in cells} for name, cells in mesh.cell_groups.items()}, set(rows), len(rows)


def two_boxes(gmsh, order=1, parts=0):
    """Two boxes: overlapping groups, a name in two dimensions, a tag in two, nameless ones, a part in no group."""
    gmsh.clear()
    gmsh.model.add("two boxes")
    occ = gmsh.model.occ
    occ.fragment([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addBox(1, 0, 0, 1, 1, 1))])
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.7)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
    along_x = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1]
    by_box = {tuple(np.round(gmsh.model.getBoundingBox(2, t), 3)): t for _, t in gmsh.model.getEntities(2)}
    low, high = (next(t for b, t in by_box.items() if b[2] == b[5] == z and b[0] == 0) for z in (0, 1))
    gmsh.model.mesh.setPeriodic(2, [high], [low], along_x)
    add = gmsh.model.addPhysicalGroup
    add(3, [1], 7, "left part")
    add(3, [1], 8, "also left")
    add(2, [low, high], 7, 'Körper "1"')
    add(2, [low], 9, "left part")
    add(2, [low], 11)
    add(1, [1, 2, 3], 1, "lines")
    add(0, [1], 4, "corner")
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    if parts:
        gmsh.model.mesh.partition(parts)
