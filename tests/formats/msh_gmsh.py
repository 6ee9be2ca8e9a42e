"""Comparison of a file as gmsh reads it with a mesh; a model with all that makes groups difficult."""

from __future__ import annotations

import numpy as np

from lacmesh.cells import ALL_CELLS
from tests.formats.msh_meshes import plain


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


def by_place(gmsh):
    """Physical groups of gmsh's model, and all its elements: cells as types and coordinates."""
    number, xyz, _ = gmsh.model.mesh.getNodes()
    place = dict(zip(number.tolist(), map(tuple, np.round(xyz, 9).reshape(-1, 3).tolist()), strict=True))

    def cells(dim, entity):
        found = set()
        for kind, tags, nodes in zip(*gmsh.model.mesh.getElements(dim, entity), strict=True):
            for row in nodes.reshape(len(tags), -1).tolist():
                found.add((int(kind), *(place[n] for n in row)))
        return found

    groups = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        name = gmsh.model.getPhysicalName(dim, tag) or f"{dim}:{tag}"
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, tag):
            groups.setdefault(name, set()).update(cells(dim, int(entity)))
    return groups, cells(-1, -1)


def places(mesh):
    """Groups and elements of a mesh in the form of `by_place`, and the number of elements."""
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
