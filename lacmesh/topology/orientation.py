"""Orientation of faces: how they list their nodes relative to each other, inverted cells, and flipping skins outward.

A face with one parent cell is outward if its normal, by the right-hand rule, points out of this cell. A face between
two cells has no outward side and keeps its orientation. A surface without parent cells (a rigid master, a shell) has no
outward side either: its faces get consistent windings across their edges, and a closed surface is oriented so that the
enclosed volume is positive. Consistent windings are found on the double cover: it contains every face twice, with its
own and with the opposite winding, joined to the copies of its neighbours that are consistent with it; each connected
component is one orientation of a connected part of the skin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.mesh import Floats, Ints, Mesh, MeshLike, Spec, as_mesh, codes, mask_of, places_of, spec_text
from lacmesh.reference.quadrature import measure, signed_area
from lacmesh.topology.bodies import label_components
from lacmesh.topology.skin import (
    FACE_TYPES,
    N_CORNERS,
    Bools,
    FaceIncidence,
    Faces,
    cells_of_dim,
    distinct_faces,
    edge_uses,
    faces_of,
    facets_of,
    find_owners,
    find_repeats,
)


def _relisted(kind: str, *corners: int) -> tuple[int, ...]:
    """Places of all nodes of a face whose corners are listed in another order."""
    on = [frozenset(nodes) for nodes in CELLS[kind].corners_of_node]
    return tuple(on.index(frozenset(corners[c] for c in nodes)) for nodes in CELLS[kind].corners_of_node)


#: the same face, flipped: it starts from the same corner and has the opposite winding (a segment starts at its other)
REVERSED = {
    kind: _relisted(kind, *((1, 0) if n == 2 else (0, *range(n - 1, 0, -1))))
    for kind, n in zip(FACE_TYPES, N_CORNERS.tolist(), strict=True)
}
#: a slave face of a macro-element, flipped, so that it still lists its outer corners first (`patterns.py`)
_REVERSED_CHILD = {
    kind: _relisted(kind, 1, 0, *range(n - 1, 1, -1))
    for kind, n in zip(FACE_TYPES, N_CORNERS.tolist(), strict=True)
    if n > 1
}


def relative_listing(faces: Faces, listed: Faces) -> Ints:
    """(f,): relative orientation 2 s + r of each row of `listed`: it starts at corner s; r = 1 for opposite winding."""
    corners, other = faces.corners, listed.corners
    start = (corners == other[:, :1]).argmax(axis=1)
    n = N_CORNERS[faces.type]
    back = corners[np.arange(len(faces)), (start + 1) % n] != other[:, 1]
    return 2 * start + np.where(n == 2, start, back)  # a segment has two corners only: its start gives both


def turned_over(faces: Faces, rows: Ints) -> Faces:
    """Flip some rows of the faces."""
    nodes = faces.nodes.copy()
    for code in codes(faces.type[rows]):
        some = rows[faces.type[rows] == code]
        order = REVERSED[FACE_TYPES[code]]
        nodes[some[:, None], np.arange(len(order))] = faces.nodes[some[:, None], order]
    return Faces(faces.type, nodes)


def is_inverted(mesh: Mesh, cells: Ints, plane: bool) -> Bools:
    """(k,): True for inverted cells, whose node order makes their facets point inward (real meshes contain some).

    Solids are tested by the signed volume of their linear cell, surface cells in a `plane` z = constant by their signed
    area. Surface cells in space are never inverted: they have no preferred orientation.
    """
    wrong = np.zeros(mesh.n_cells, bool)
    for kind, chosen, nodes in mesh.select(cells):
        flat = CELLS[CELLS[kind].linear]
        if flat.dim == 3:
            wrong[chosen] = measure(flat.name, mesh.points[nodes[:, : flat.n_corners]]) < 0
        elif plane:
            wrong[chosen] = signed_area(kind, mesh.points[nodes]) < 0
    return wrong[cells]


def corner_normals(x: Floats, n: Ints) -> Floats:
    """(f, 3): normals of faces with n corners at x (f, 4, 3), twice as long as the area; of segments, as long as these.

    Those of segments lie in the plane z = 0, to their right.
    """
    t = x[:, 1] - x[:, 0]
    plane = np.stack([t[:, 1], -t[:, 0], 0 * t[:, 0]], axis=1)
    if (n == 2).all():
        return plane
    last = np.where((n == 4)[:, None], x[:, 3], x[:, 0])
    return np.where((n == 2)[:, None], plane, np.cross(x[:, 2] - x[:, 0], last - x[:, 1]))


def face_normals(mesh: Mesh, faces: Faces) -> Floats:
    """(f, 3): normals of faces by their corners, as long as the faces' areas; of lines in space, their tangents."""
    n, x = N_CORNERS[faces.type], mesh.points[faces.corners]
    normals = corner_normals(x, n) / np.where(n == 2, 1, 2)[:, None]
    return normals if mesh.space_dim == 2 else np.where((n == 2)[:, None], x[:, 1] - x[:, 0], normals)


# ---- skins


@dataclass(frozen=True)
class SkinOrientation:
    """Result of the orientation analysis of some skin faces; every field holds indices of cells of the mesh.

    `to_flip`: faces to flip so that all are outward. `interface`: faces between two cells, which stay. `parentless`:
    faces without a cell behind them; among these `open`, on a skin that encloses no volume, which only get consistent
    windings, and `one_sided`, for which no consistent windings exist (a Moebius strip), which stay.
    """

    to_flip: Ints
    interface: Ints
    parentless: Ints
    open: Ints
    one_sided: Ints


def orient(mesh: MeshLike, group: Spec) -> Mesh:
    """Flip the skin faces of a cell group so that all are outward; numbers, groups and data are kept.

    `group`: named as `Mesh.group` takes it.

    Raises GroupNotFoundError, and DataError if the group holds no skin face that can be flipped.

    >>> cells = [("TRIA3", [[0, 1, 2]]), ("SEG2", [[1, 0]])]
    >>> triangle = Mesh.create([[0, 0], [1, 0], [0, 1]], cells, cell_groups={"s": [1]})
    >>> orient(triangle, "s").block("SEG2").tolist()
    [[0, 1]]
    """
    mesh = as_mesh(mesh)
    return reverse(mesh, analyse_orientation(mesh, skin_cells(mesh, group)).to_flip)


def skin_cells(mesh: Mesh, group: Spec) -> Ints:
    """Return the skin faces of a cell group: its cells of dimension d - 1 or, without any, of its highest dimension."""
    cells = mesh.cells_of(group)
    dims = mesh.cell_dim[cells]
    want = mesh.dim - 1 if (dims == mesh.dim - 1).any() else int(dims.max(initial=0))
    faces = cells[dims == want]
    odd = [chosen for kind, chosen, _ in mesh.select(faces) if kind not in REVERSED]
    if want not in (1, 2) or odd:
        what = f"cells of dimension {want}" if not odd else f"cells that cannot be flipped ({mesh.cell_names(odd[0])})"
        raise DataError(
            f"the group {spec_text(group)!r} has no lines and no linear or quadratic surface cells, but {what}",
            mesh.cell_number[odd[0] if odd else faces],
        )
    return faces


def analyse_orientation(mesh: Mesh, cells: Ints) -> SkinOrientation:
    """Analyse the orientation of skin faces (indices, of one dimension, of types that can be flipped)."""
    empty = np.empty(0, np.int64)
    if not len(cells):
        return SkinOrientation(*(empty,) * 5)
    faces, _ = distinct_faces(mesh, cells)
    parents = find_owners(faces, cells_of_dim(mesh, int(mesh.cell_dim[cells[0]]) + 1), mesh.n_nodes)
    on = _cells_on(mesh, cells, faces)
    count = np.bincount(parents.face, minlength=len(faces))
    parentless = np.flatnonzero(count == 0)
    flip, kind = np.zeros(len(faces), bool), np.full(len(faces), -1)
    flip[parentless], kind[parentless], _ = consistent_windings(mesh, faces.take(parentless))
    back = relative_listing(faces.take(on.face), faces_of(mesh, on.cell)) % 2 == 1
    wrong = (back ^ flip[on.face]) & np.isin(kind[on.face], (CLOSED, OPEN))
    groups = count[on.face] > 1, count[on.face] == 0, kind[on.face] == OPEN, kind[on.face] == ONE_SIDED
    inward = _inward(mesh, faces, on, parents)
    return SkinOrientation(np.union1d(inward, on.cell[wrong]), *(np.sort(on.cell[group]) for group in groups))


def flip_outward(mesh: Mesh, cells: Ints, faces: Faces, first: Ints, parents: FaceIncidence) -> tuple[Mesh, Faces]:
    """Flip the skin cells that are not outward; return the mesh and its faces (like `faces`, from `cells[first]`).

    `faces`: the faces under `cells`, each once; `parents`: the cells behind (`skin.find_owners`).
    """
    if len(parents.face):
        back = _inward(mesh, faces, _cells_on(mesh, cells, faces), parents)
    else:
        back = analyse_orientation(mesh, cells).to_flip
    if not len(back):
        return mesh, faces
    flipped = reverse(mesh, back)
    return flipped, faces_of(flipped, cells[first])


def _cells_on(mesh: Mesh, cells: Ints, faces: Faces) -> FaceIncidence:
    return find_repeats(faces, [(k, n, c) for k, c, n in mesh.select(np.sort(cells))], mesh.n_nodes)


def _inward(mesh: Mesh, faces: Faces, on: FaceIncidence, parents: FaceIncidence) -> Ints:
    """Return the cells `on` the faces (sorted) with a normal that points into the only one of the `parents` behind."""
    single = np.bincount(parents.face, minlength=len(faces)) == 1
    on = on.take(np.flatnonzero(single[on.face]))
    owner = places_of(parents.face, len(faces))[on.face]
    back = relative_listing(facets_of(mesh, parents).take(owner), faces_of(mesh, on.cell)) % 2 == 1
    back ^= is_inverted(mesh, parents.cell, mesh.space_dim == 2)[owner]
    return np.sort(on.cell[back])


def reverse(mesh: Mesh, cells: Ints) -> Mesh:
    """Flip some skin cells (sorted indices) of a mesh.

    The faces of a macro-element still list their outer corners first, and the order of E1, E2, ... is reversed.
    """
    if not len(cells):
        return mesh
    macro = mesh.cell_data.get("lac_macro", np.full(mesh.n_cells, -1))
    rank = mesh.cell_data.get("lac_child", np.full(mesh.n_cells, -1))
    size = np.bincount(macro[macro >= 0], minlength=1)[np.maximum(macro, 0)]
    # the face at the centre of a ring, its fifth, is not one of those around it
    outer = (macro >= 0) & (rank >= 0) & (size > 1) & ((size != 5) | (rank != 5))
    blocks = []
    for k, block in enumerate(mesh.blocks):
        rows = cells[(cells >= mesh.offsets[k]) & (cells < mesh.offsets[k + 1])] - mesh.offsets[k]
        nodes = block.nodes
        if len(rows):
            of_macro = outer[rows + mesh.offsets[k]]
            nodes = nodes.copy()
            nodes[rows] = nodes[rows][:, REVERSED[block.type]]
            if of_macro.any():
                nodes[rows[of_macro]] = block.nodes[rows[of_macro]][:, _REVERSED_CHILD[block.type]]
        blocks.append(block._replace(nodes=nodes))
    flipped = replace(mesh, blocks=tuple(blocks))
    around = cells[outer[cells]]
    if not len(around):
        return flipped
    new_rank = rank.copy()
    new_rank[around] = size[around] - (size[around] == 5) + 1 - rank[around]
    return replace(flipped, cell_data={**mesh.cell_data, "lac_child": new_rank})


# ---- surfaces without parent cells

CLOSED, OPEN, ONE_SIDED = range(3)


def consistent_windings(mesh: Mesh, faces: Faces) -> tuple[Bools, Ints, Ints]:
    """Consistent orientation: faces to flip (f,), codes CLOSED, OPEN or ONE_SIDED of their components, and these (f,).

    Closed components become outward, of open ones the fewer faces are flipped. Components end at edges of more than
    two faces.
    """
    size = len(faces)
    if not size:
        return np.zeros(0, bool), np.zeros(0, int), np.zeros(0, int)
    uses = edge_uses(faces)
    a, b = uses.pairs
    f, g = uses.face[a], uses.face[b]
    same = uses.forward[a] == uses.forward[b]  # they disagree: as it is goes with flipped
    rows = np.concatenate([f, f + size])
    columns = np.concatenate([g + size * same, g + size * ~same])
    sheet = label_components(rows, columns, 2 * size).reshape(2, size)
    piece = np.unique(sheet.min(axis=0), return_inverse=True)[1]
    n_pieces = int(piece.max()) + 1
    over = sheet[0] != sheet.min(axis=0)
    one_sided = mask_of(n_pieces, piece[sheet[0] == sheet[1]])
    closed = ~one_sided
    closed[piece[uses.face[np.bincount(uses.edge)[uses.edge] != 2]]] = False
    enclosed = np.bincount(piece, _signed_volume(mesh, faces) * np.where(over, -1, 1), n_pieces)
    if mesh.space_dim == 3 and N_CORNERS[faces.type[0]] == 2:  # a loop in space encloses nothing
        closed[:] = False
    few = np.bincount(piece, over, n_pieces) * 2 > np.bincount(piece, minlength=n_pieces)
    over ^= np.where(closed, enclosed < 0, few)[piece]
    over[one_sided[piece]] = False
    return over, np.where(one_sided, ONE_SIDED, np.where(closed, CLOSED, OPEN))[piece], piece


def _signed_volume(mesh: Mesh, faces: Faces) -> NDArray:
    """(f,): contribution of each face to the volume that a closed skin encloses (to the area, for segments)."""
    n, corners = N_CORNERS[faces.type], faces.corners
    x = mesh.points[corners] - mesh.points[corners[0, 0]]
    return np.asarray((x[:, 0] * corner_normals(x, n)).sum(axis=1) / np.where(n == 2, 2, 6))
