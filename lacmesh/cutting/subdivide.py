"""Subdivision: the pattern of each slave face, the new nodes and their positions, and the children of each cell.

    patterns = whole, cone or ring for every face: a parent uses one variant for all its slave faces
    points = the new nodes on every face, once for all cells that share it
    children of the skin cells on the faces, and of the parents, with the new nodes inside them

A cell with several slave faces is cut once per face, in the order of its own facets. Each pattern leaves the other
facets whole, so the next face has exactly one owner among the children of the earlier cuts; it is found in the same way
as the first owners (`skin.find_owners`). All cells are cut together: there are as many rounds as the largest number of
slave faces of a cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.assemble import ChildCells, NodeList, node_values
from lacmesh.cutting.patterns import CONE, RING, RING_PARENTS, WHOLE, Template, face_pattern, listings, parent_pattern
from lacmesh.cutting.select import Selection
from lacmesh.mesh import Ints, Mesh, codes, mask_of
from lacmesh.quality import corner_jacobian
from lacmesh.topology.bodies import label_components
from lacmesh.topology.orientation import relative_listing
from lacmesh.topology.skin import FACE_TYPES, Bools, FaceIncidence, Faces, find_owners

#: patterns, as codes of arrays
PATTERNS = (WHOLE, CONE, RING)
WHOLE_CODE, CONE_CODE, RING_CODE = range(3)
HEXA = ("pyramid", "hexa", "auto")
_RING_TYPES = np.array([name in ("SEG2", "QUAD4", "QUAD8") for name in FACE_TYPES])
#: a child that is cut again has fewer children than so many, which come between it and the next
_ROOM = 8


@dataclass(frozen=True)
class CutFaces:
    """Faces with their `patterns` (f,), codes of PATTERNS, and the new nodes on them, `points` (f, p), padded with -1.

    `ring`, `depth`: the shape of the ring, as parts of a cell.
    """

    faces: Faces
    patterns: Ints
    points: Ints
    ring: float
    depth: float

    def by_pattern(self, rows: Ints | None = None) -> Iterator[tuple[str, str, Ints]]:
        """Iterate over what all faces, or those of some `rows`, have: (face type, pattern, which of them)."""
        faces = slice(None) if rows is None else rows
        code = self.faces.type[faces] * len(PATTERNS) + self.patterns[faces]
        for value in codes(code):
            yield FACE_TYPES[value // len(PATTERNS)], PATTERNS[value % len(PATTERNS)], np.flatnonzero(code == value)

    def frame(self, nodes: Ints, listed: Ints, faces: Ints, face_type: str, pattern: str) -> Ints:
        """(k, ...): nodes of cells, then the points of their faces in the cells' listing (`listed`: facet nodes)."""
        rows = relative_listing(self.faces.take(faces), Faces.join([(face_type, listed)]))
        places = listings(face_type, pattern, self.ring)[rows]
        return np.hstack([nodes, np.take_along_axis(self.points[faces], places, axis=1)])


@dataclass(frozen=True)
class Subdivision:
    """Result of a cut: the faces with the points on them, all new nodes, and the cells that replace others."""

    cut: CutFaces
    new_nodes: NodeList
    children: list[ChildCells]


# ---- the pattern of each face


def subdivide(
    mesh: Mesh, selection: Selection, whole: Bools, hexa: str, skin_only: bool, ring: float, depth: float
) -> Subdivision:
    """Choose the pattern of every face, and cut those that are not left `whole` (f,).

    `hexa` "auto" cuts both ways, and keeps for each set of faces that must be cut alike the variant with the higher
    minimum Jacobian, the ring on a tie.
    """
    able, component = _allowed_rings(mesh, selection, whole, hexa, skin_only)
    by = partial(_subdivide, mesh, selection, whole, ring=ring, depth=depth)
    if hexa != "auto" or not (skin_only or mesh.dim == 3):
        return by(able)
    cuts = by(np.zeros_like(able)), by(able)
    worst = [_worst_of_sets(mesh, selection, component, one) for one in cuts]
    chosen = able & (worst[1] >= worst[0])[component]
    for rows, one in zip((np.zeros_like(able), able), cuts, strict=True):
        if np.array_equal(chosen, rows):
            return one
    return by(chosen)


def _allowed_rings(mesh: Mesh, selection: Selection, whole: Bools, hexa: str, skin_only: bool) -> tuple[Bools, Ints]:
    """(f,): True for faces that the ring can cut, by their parents and `hexa`; (f,): labels of faces cut alike."""
    faces, parents = selection.faces, selection.parents
    alone: Ints = np.arange(len(faces))
    ring = _RING_TYPES[faces.type] & ~whole
    if skin_only:
        return ring & (faces.type != FACE_TYPES.index("SEG2")) & (hexa != "pyramid"), alone
    # with "pyramid" the ring cuts no hexahedron
    able = mesh.of_type(parents.cell, [kind for kind in RING_PARENTS if hexa != "pyramid" or kind == "QUAD4"])
    ring[parents.face[~able]] = False
    if hexa != "auto" and not (able & ~ring[parents.face]).any():
        return ring, alone
    # parents that allow the ring connect faces, which must then be cut alike
    cell = np.unique(parents.cell[able], return_inverse=True)[1]
    size = len(faces) + int(cell.max(initial=-1)) + 1
    labels = label_components(parents.face[able], len(faces) + cell, size)[: len(faces)]
    component = np.unique(labels, return_inverse=True)[1]
    spoilt = mask_of(len(faces), component[~ring & ~whole])
    return ring & ~spoilt[component], component


def _worst_of_sets(mesh: Mesh, selection: Selection, component: Ints, subdivision: Subdivision) -> Ints:
    """(f,): the least corner Jacobian of the children of each set of faces, by the label of the set; inf for none."""
    points = node_values(mesh.points, subdivision.new_nodes.parts)
    face_of_cell = np.full(mesh.n_cells, -1)
    face_of_cell[selection.parents.cell] = selection.parents.face
    face_of_cell[selection.skin.cell] = selection.skin.face
    least = np.full(len(selection.faces), np.inf)
    for block in subdivision.children:
        quality = corner_jacobian(block.type, points[block.nodes], mesh.space_dim == 2)
        np.minimum.at(least, component[face_of_cell[block.parent]], quality)
    return least


# ---- new nodes and children


def _subdivide(
    mesh: Mesh, selection: Selection, whole: Bools, rings: Bools, *, ring: float, depth: float
) -> Subdivision:
    """Cut the faces that are not `whole` (f,), in `rings` (f,) or cones, the skin cells on them, and the parents."""
    patterns = np.where(whole, WHOLE_CODE, np.where(rings, RING_CODE, CONE_CODE))
    new_nodes = NodeList(mesh.n_nodes)
    faces = selection.faces
    cut = CutFaces(faces, patterns, np.empty((len(faces), 0), np.int64), ring, depth)
    groups = [(kind, face_pattern(kind, name, ring).on_face, rows) for kind, name, rows in cut.by_pattern()]
    points = np.full((len(faces), max((len(at) for _, at, _ in groups), default=0)), -1, np.int64)
    for kind, at, rows in groups:
        if len(at):
            nodes = faces.nodes[rows][:, : CELLS[kind].n_nodes]
            points[rows, : len(at)] = new_nodes.add(kind, nodes, at, nodes[:, : CELLS[kind].n_corners])
    cut = replace(cut, points=points)
    children: list[ChildCells] = []
    for kind, cells, nodes in mesh.select(selection.skin.cell):  # their children are in each cell's own order
        on = selection.skin.face[np.searchsorted(selection.skin.cell, cells)]
        for face_type, name, rows in cut.by_pattern(on):
            if name != WHOLE:
                frame = cut.frame(nodes[rows], nodes[rows], on[rows], face_type, name)
                children += _children(face_pattern(kind, name, ring), frame, cells[rows])
    return Subdivision(cut, new_nodes, [*children, *_cut_parents(mesh, cut, selection.parents, new_nodes)])


def _cut_parents(mesh: Mesh, cut: CutFaces, parents: FaceIncidence, new_nodes: NodeList) -> list[ChildCells]:
    """Cut the parents, a face of each a round; return their children."""
    order = np.lexsort((parents.facet, parents.cell))
    parents = parents.take(order[cut.patterns[parents.face[order]] != WHOLE_CODE])
    starts = np.flatnonzero(np.diff(parents.cell, prepend=-1))
    nth = np.arange(len(parents.cell)) - np.repeat(starts, np.diff(starts, append=len(parents.cell)))
    children = [ChildCells(kind, nodes, cells, 0 * cells) for kind, cells, nodes in mesh.select(parents.cell[starts])]
    owners = replace(parents.take(starts), cell=np.arange(len(starts)))
    children = _cut_once(mesh, cut, children, owners, new_nodes)
    for r in range(1, int(nth.max(initial=0)) + 1):
        owners = _owners(cut, children, parents.take(np.flatnonzero(nth == r)), new_nodes.following)
        children = _cut_once(mesh, cut, children, owners, new_nodes)
    return children


def _owners(cut: CutFaces, children: list[ChildCells], parents: FaceIncidence, n_nodes: int) -> FaceIncidence:
    """Find for each pair of a face and its parent the row of the child of that parent that owns the face."""
    wanted, which = np.unique(parents.face, return_inverse=True)
    of = np.concatenate([block.parent for block in children])
    ends = np.cumsum([len(block.parent) for block in children])[:-1]
    rows = np.split(np.arange(len(of)), ends)
    cells = [(block.type, block.nodes, own) for block, own in zip(children, rows, strict=True)]
    owners = find_owners(cut.faces.take(wanted), cells, n_nodes)
    size = int(of.max()) + 1
    mine = np.isin(owners.face * size + of[owners.cell], which * size + parents.cell)
    return replace(owners, face=wanted[owners.face]).take(np.flatnonzero(mine))


def _cut_once(
    mesh: Mesh, cut: CutFaces, cells: list[ChildCells], owners: FaceIncidence, new_nodes: NodeList
) -> list[ChildCells]:
    """Replace the cells that own a face by their children. `owners`: the faces, and the rows of their cells in all."""
    out: list[ChildCells] = []
    start = 0
    for block in cells:
        owned = owners.take(np.flatnonzero((owners.cell >= start) & (owners.cell < start + len(block.parent))))
        left = block.take(np.setdiff1d(np.arange(len(block.parent)), owned.cell - start, assume_unique=True))
        if len(left.parent):
            out.append(replace(left, child_index=left.child_index * _ROOM))
        for j in codes(owned.facet):
            of_facet = owned.take(np.flatnonzero(owned.facet == j))
            for face_type, name, rows in cut.by_pattern(of_facet.face):
                mine, faces = block.take(of_facet.cell[rows] - start), of_facet.face[rows]
                pattern = parent_pattern(block.type, int(j), name, cut.ring, cut.depth)
                listed = mine.nodes[:, CELLS[block.type].facets[j].nodes]
                frame = cut.frame(mine.nodes, listed, faces, face_type, name)
                if len(pattern.inside):
                    corners = _corners(mesh, mine.parent)
                    frame = np.hstack([frame, new_nodes.add(block.type, mine.nodes, pattern.inside, corners)])
                out += _children(pattern, frame, mine.parent, mine.child_index)
        start += len(block.parent)
    return out


def _children(pattern: Template, frame: Ints, parent: Ints, index: Ints | int = 0) -> list[ChildCells]:
    """Children of cells with nodes in a frame, in the places of those cells among the children of their parents."""
    return [
        ChildCells(
            block.type,
            frame[:, block.nodes].reshape(-1, block.nodes.shape[1]),
            np.repeat(parent, len(block.rank)),
            ((np.broadcast_to(index, parent.shape) * _ROOM)[:, None] + block.rank).ravel(),
        )
        for block in pattern.children
    ]


def _corners(mesh: Mesh, cells: Ints) -> Ints:
    """(k, 8): the corners of cells of the mesh, padded with the last one."""
    corners = np.empty((len(cells), 8), np.int64)
    order = np.argsort(cells, kind="stable")
    done = 0
    for kind, some, nodes in mesh.select(cells[order]):
        corners[order[done : done + len(some)]] = nodes[:, np.minimum(np.arange(8), CELLS[kind].n_corners - 1)]
        done += len(some)
    return corners
