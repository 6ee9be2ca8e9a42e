"""The skin cells of a mesh as `Faces`: each face once, in the order asked for, and the facets of the cells behind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.mesh import Ints, Mesh, codes, places_of
from lacmesh.topology.skin import FaceIncidence, Faces, first_of_each, label_faces


def cells_of_dim(mesh: Mesh, dim: int) -> Iterator[tuple[str, Ints, Ints]]:
    """Iterate over the cells of dimension `dim`, block by block: (type, their nodes, their indices)."""
    for k, block in enumerate(mesh.blocks):
        if ALL_CELLS[block.type].dim == dim:
            yield block.type, block.nodes, np.arange(mesh.offsets[k], mesh.offsets[k + 1])


def lacking(mesh: Mesh, dim: int, called: str = "the mesh") -> str:
    """Say that a mesh, `called` so, has no cells of dimension `dim`, what it has, and what gmsh leaves out of a file.

    >>> lacking(Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])]), 2)[:44]
    'the mesh has no surfaces, only cells of type'
    """
    name = ("points", "lines", "surfaces", "volumes")[dim]
    if not mesh.n_cells:
        return f"{called} has no {name}, nor any other cells"
    message = f"{called} has no {name}, only cells of type {', '.join(mesh.cells_by_type)}; where there are physical "
    message += f"groups, gmsh saves their cells alone: add one of the {name}, or save as msh 4.1 with "
    return f"{message}Mesh.SaveAll = 1 (msh 2.2 loses all groups then)"


def faces_of(mesh: Mesh, cells: Ints) -> Faces:
    """Return some skin cells (of types in FACE_TYPES) as faces, in the order of `cells`."""
    order: list[Ints] = [np.empty(0, np.int64)]
    parts = []
    for kind, chosen, nodes in mesh.select(cells):
        order.append(chosen)
        parts.append((kind, nodes))
    by_type = Faces.join(parts)
    return by_type.take(places_of(np.concatenate(order), mesh.n_cells, np.int32)[cells])


def distinct_faces(mesh: Mesh, cells: Ints) -> tuple[Faces, Ints]:
    """Return the faces under some cells, each once, and the index in `cells` of the cell that gives its node order."""
    faces = faces_of(mesh, cells)
    first, _ = first_of_each(*label_faces(faces))
    return faces.take(first), first


def facets_of(mesh: Mesh, owners: FaceIncidence) -> Faces:
    """Return the facets of a match's cells, with the cells' (outward) listing of their nodes, in the match's order."""
    parts, rows = [], [np.empty(0, np.int64)]
    order = np.argsort(owners.cell, kind="stable")
    done = 0
    for kind, cells, nodes in mesh.select(owners.cell[order]):
        facet = owners.facet[order[done : done + len(cells)]]
        for j in codes(facet):
            at = np.flatnonzero(facet == j)
            parts.append((CELLS[kind].facets[j].type, nodes[at][:, CELLS[kind].facets[j].nodes]))
            rows.append(order[done + at])
        done += len(cells)
    place = places_of(np.concatenate(rows), len(order))
    return Faces.join(parts).take(place)
