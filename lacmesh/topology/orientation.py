"""Orientation of skin faces, and flipping them outward.

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

from lacmesh.errors import DataError
from lacmesh.mesh import Ints, Mesh, MeshLike, Spec, as_mesh, mask_of, places_of, spec_text
from lacmesh.topology.components import label_components
from lacmesh.topology.edges import edge_uses
from lacmesh.topology.faces import cells_of_dim, distinct_faces, faces_of, facets_of
from lacmesh.topology.skin import N_CORNERS, FaceIncidence, Faces, find_owners, find_repeats
from lacmesh.topology.winding import REVERSED, is_inverted, relative_listing

Bools = NDArray[np.bool_]

#: a slave face of a macro-element, flipped, so that it still lists its outer corners first (`patterns.py`)
_REVERSED_CHILD = {
    "SEG2": (1, 0),
    "SEG3": (1, 0, 2),
    "TRIA3": (1, 0, 2),
    "TRIA6": (1, 0, 2, 3, 5, 4),
    "QUAD4": (1, 0, 3, 2),
    "QUAD8": (1, 0, 3, 2, 4, 7, 6, 5),
}


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
            f"the group {spec_text(group)!r} holds no skin of lines or of linear or quadratic surface cells, but "
            f"{what}",
            mesh.cell_number[odd[0] if odd else faces],
        )
    return faces


def analyse_orientation(mesh: Mesh, cells: Ints) -> SkinOrientation:
    """Analyse the orientation of skin faces (indices, of one dimension, of types that can be flipped)."""
    empty = np.empty(0, np.int64)
    if not len(cells):
        return SkinOrientation(*(empty,) * 5)
    faces, _ = distinct_faces(mesh, cells)
    dim = int(mesh.cell_dim[cells[0]])
    parents = find_owners(faces, cells_of_dim(mesh, dim + 1), mesh.n_nodes)
    own = _cells_on(mesh, cells, faces)
    count = np.bincount(parents.face, minlength=len(faces))
    parentless = np.flatnonzero(count == 0)
    flip, component = np.zeros(len(faces), bool), np.full(len(faces), -1)
    flip[parentless], component[parentless], _ = consistent_windings(mesh, faces.take(parentless))
    of_own = component[own.face]
    inconsistent = (_listed_back(mesh, faces, own) ^ flip[own.face]) & (of_own >= 0) & (of_own != ONE_SIDED)
    return SkinOrientation(
        np.union1d(inward(mesh, cells, faces, parents), own.cell[inconsistent]),
        np.sort(own.cell[count[own.face] > 1]),
        np.sort(own.cell[count[own.face] == 0]),
        np.sort(own.cell[of_own == OPEN]),
        np.sort(own.cell[of_own == ONE_SIDED]),
    )


def inward(mesh: Mesh, cells: Ints, faces: Faces, parents: FaceIncidence) -> Ints:
    """Return the skin cells (sorted) with a normal that points into the only cell behind them.

    `faces`: the faces under `cells`, each once; `parents`: the cells behind (`skin.find_owners`).
    """
    own = _cells_on(mesh, cells, faces)
    single = np.bincount(parents.face, minlength=len(faces)) == 1
    mine = single[own.face]
    own = FaceIncidence(own.face[mine], own.cell[mine], own.facet[mine], own.same[mine])
    owner = places_of(parents.face, len(faces))
    outward = facets_of(mesh, parents).take(owner[own.face])
    back = relative_listing(outward, faces_of(mesh, own.cell)) % 2 == 1
    back ^= is_inverted(mesh, parents.cell, mesh.space_dim == 2)[owner[own.face]]
    return np.sort(own.cell[back])


def flip_outward(mesh: Mesh, cells: Ints, faces: Faces, first: Ints, parents: FaceIncidence) -> tuple[Mesh, Faces]:
    """Flip the skin cells that are not outward; return the mesh and its faces (like `faces`, from `cells[first]`)."""
    back = inward(mesh, cells, faces, parents) if len(parents.face) else analyse_orientation(mesh, cells).to_flip
    if not len(back):
        return mesh, faces
    flipped = reverse(mesh, back)
    return flipped, faces_of(flipped, cells[first])


def reverse(mesh: Mesh, cells: Ints) -> Mesh:
    """Flip some skin cells (sorted indices) of a mesh.

    The faces of a macro-element still list their outer corners first, and the order of E1, E2, ... is reversed.
    """
    if not len(cells):
        return mesh
    macro, rank = mesh.cell_data.get("lac_macro"), mesh.cell_data.get("lac_child")
    child, centre = np.zeros(mesh.n_cells, bool), np.zeros(mesh.n_cells, bool)
    if macro is not None and rank is not None:
        child, centre = _children(macro, rank)
    blocks = []
    for k, block in enumerate(mesh.blocks):
        rows = cells[(cells >= mesh.offsets[k]) & (cells < mesh.offsets[k + 1])] - mesh.offsets[k]
        nodes = block.nodes
        if len(rows):
            nodes = nodes.copy()
            nodes[rows] = nodes[rows][:, REVERSED[block.type]]
            of_macro = rows[(child & ~centre)[rows + mesh.offsets[k]]]
            if len(of_macro):
                nodes[of_macro] = block.nodes[of_macro][:, _REVERSED_CHILD[block.type]]
        blocks.append(block._replace(nodes=nodes))
    flipped = replace(mesh, blocks=tuple(blocks))
    if not child[cells].any() or rank is None or macro is None:
        return flipped
    around = cells[child[cells] & ~centre[cells]]
    size = np.zeros(int(macro.max()) + 1, np.int64)
    np.maximum.at(size, macro[child & ~centre], rank[child & ~centre])
    new_rank = rank.copy()
    new_rank[around] = size[macro[around]] + 1 - rank[around]
    return replace(flipped, cell_data={**mesh.cell_data, "lac_child": new_rank})


def _children(macro: Ints, rank: Ints) -> tuple[Bools, Bools]:
    """(n_cells,) each: True for faces of macro-elements that were cut, and for those at the centre of a ring."""
    faces = np.flatnonzero(macro >= 0)
    size = np.bincount(macro[faces])
    child = np.zeros(len(macro), bool)
    child[faces] = size[macro[faces]] > 1
    centre = np.zeros(len(macro), bool)
    centre[faces] = (size[macro[faces]] == 5) & (rank[faces] == 5)
    return child, centre


def _cells_on(mesh: Mesh, cells: Ints, faces: Faces) -> FaceIncidence:
    return find_repeats(faces, [(k, n, c) for k, c, n in mesh.select(np.sort(cells))], mesh.n_nodes)


def _listed_back(mesh: Mesh, faces: Faces, own: FaceIncidence) -> Bools:
    """True for cells on faces that have the opposite winding."""
    return relative_listing(faces.take(own.face), faces_of(mesh, own.cell)) % 2 == 1


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
    face, edge, forward = uses.face, uses.edge, uses.forward
    order = np.argsort(edge, kind="stable")
    count = np.bincount(edge)
    pairs = order[(count == 2)[edge[order]]].reshape(-1, 2)
    f, g = face[pairs].T
    same = forward[pairs[:, 0]] == forward[pairs[:, 1]]  # they disagree: as it is goes with flipped
    rows = np.concatenate([f, f + size])
    columns = np.concatenate([g + size * same, g + size * ~same])
    sheet = label_components(rows, columns, 2 * size).reshape(2, size)
    piece = np.unique(sheet.min(axis=0), return_inverse=True)[1]
    n_pieces = int(piece.max()) + 1
    over = sheet[0] != sheet.min(axis=0)
    one_sided = mask_of(n_pieces, piece[sheet[0] == sheet[1]])
    closed = ~one_sided
    closed[piece[face[count[edge] != 2]]] = False
    enclosed = np.bincount(piece, _signed_volume(mesh, faces) * np.where(over, -1, 1), n_pieces)
    if mesh.space_dim == 3 and N_CORNERS[faces.type[0]] == 2:  # a loop in space encloses nothing
        closed[:] = False
    few = np.bincount(piece, over, n_pieces) * 2 > np.bincount(piece, minlength=n_pieces)
    over ^= np.where(closed, enclosed < 0, few)[piece]
    over[one_sided[piece]] = False
    return over, np.where(one_sided, ONE_SIDED, np.where(closed, CLOSED, OPEN))[piece], piece


def _signed_volume(mesh: Mesh, faces: Faces) -> NDArray:
    """(f,): contribution of each face to the volume that a closed skin encloses (to the area, for segments)."""
    n = N_CORNERS[faces.type]
    corners = faces.corners
    x = mesh.points[corners] - mesh.points[corners[0, 0]]
    if n[0] == 2:
        return (x[:, 0, 0] * x[:, 1, 1] - x[:, 0, 1] * x[:, 1, 0]) / 2
    total = np.zeros(len(faces))
    for k in (1, 2):
        part = np.einsum("fi,fi->f", x[:, 0], np.cross(x[:, k], x[:, min(k + 1, 3)])) / 6
        total += np.where(k + 1 < n, part, 0)
    return total
