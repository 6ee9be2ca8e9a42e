"""Recognition of the macro-elements of a cut without records, from the faces alone, whatever program made the cut.

A macro-element is recognised by its pattern: faces around a node (cone) or around a face (ring) of the skin that list
their nodes as the pattern's children do, with the new nodes where the pattern puts them on the map of the outline.
This is sufficient for the cone on a triangle and the ring on a quadrangle. The cone on a quadrangle also looks like a
quadrangle that a mesher divided by its diagonals: it counts only if a pyramid lies behind it, or if nodes and faces are
numbered as a cut numbers them. Segments are recognised from their parent cells (`regroup.py`). Faces that a cut leaves
whole (SEG3, TRIA7, QUAD9) are macro-elements as they are.

A mesh is recognised as cut if every slave face is part of a macro-element; its nodes must not have been moved since. A
mesher may make similar faces (an O-grid, triangles split at their centroids), so that two marks of a cut are required
as well: rings have the half-width 1/3, and the nodes that the cut made are the last of the mesh. If they are missing,
`doubt` says so, and the faces are recognised only on request.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import (
    CONE,
    RING,
    RING_PARENTS,
    WHOLE,
    WHOLE_FACES,
    face_pattern,
    internal_points,
    parent_pattern,
)
from lacmesh.cutting.records import CELL_RECORDS, Cut, Origin, with_records
from lacmesh.cutting.regroup import regroup_segments
from lacmesh.cutting.select import SlaveSkin
from lacmesh.mesh import Ints, Mesh, mask_of, places_of
from lacmesh.reference.shapes import shape
from lacmesh.topology.skin import FACE_TYPES, N_CORNERS, TYPE_CODE, Faces, cells_of_dim, distinct_faces, find_owners

#: how far a node may stand from its place, as a part of the outline's size: files keep as few as seven digits
PLACE = 1e-5
_THIRD = 1 / 3
#: what is in doubt where the places are those of a cut and the numbers are not
NOT_LAST = "the last nodes of the mesh are not those that a cut would have made"


@dataclass(frozen=True)
class MacroGroup:
    """Macro-elements of one pattern: `parts` (m, k), the faces E1 ... Ek; `frame` (m, n), the nodes of its frame."""

    face: str
    kind: str
    parts: Ints
    frame: Ints
    ring: float = _THIRD

    @property
    def outline(self) -> Ints:
        """(m, n): the nodes of the faces that were cut."""
        return self.frame[:, : CELLS[self.face].n_nodes]

    @property
    def new(self) -> Ints:
        """(m, p): the nodes that the cut put on them."""
        return self.frame[:, CELLS[self.face].n_nodes :]


@dataclass(frozen=True)
class RecognisedCut:
    """Recognised macro-elements of a slave skin: its faces, each once, as `cells` (f,), their `zone` (f,), `families`.

    `left`: rows of `cells` that belong to no macro-element. `doubt`: a sentence on what contradicts a cut; empty if
    nothing does.
    """

    names: tuple[str, ...]
    cells: Ints
    zone: Ints
    families: tuple[MacroGroup, ...]
    left: Ints
    doubt: str = ""

    @property
    def n_cut(self) -> int:
        """Number of faces that belong to macro-elements of several faces."""
        return sum(family.parts.size for family in self.families if family.kind != WHOLE)

    @property
    def complete(self) -> bool:
        """True if the skin is cut and every face belongs to a macro-element."""
        return self.n_cut > 0 and not len(self.left)

    @property
    def mostly_cut(self) -> bool:
        """True if at least half of the faces look cut; fewer may do so by chance."""
        return self.n_cut > 0 and 2 * self.n_cut >= len(self.cells)

    @property
    def n_macros(self) -> int:
        """Number of macro-elements."""
        return sum(len(family.parts) for family in self.families)


def find_macros(mesh: Mesh, slave: SlaveSkin) -> RecognisedCut:
    """Recognise the macro-elements in some slave faces."""
    cells, faces = slave.cells[slave.first], slave.faces
    families = _families(mesh, faces, mesh.places_in_file(cells)) if len(cells) else ()
    covered = mask_of(len(faces), *(family.parts for family in families))
    doubt = _doubt(mesh, families, faces, cells)
    return RecognisedCut(slave.names, cells, slave.zone[slave.first], families, np.flatnonzero(~covered), doubt)


def _families(mesh: Mesh, faces: Faces, place: Ints) -> tuple[MacroGroup, ...]:
    """Recognise the macro-elements among distinct faces; `place` (f,): the position of each face in the file."""
    families = _whole(faces)
    if (N_CORNERS[faces.type] == 2).any():
        families += [
            MacroGroup("SEG2", kind, parts, nodes, ring)
            for kind, parts, nodes, ring in regroup_segments(mesh, faces, place, PLACE)
        ]
    else:
        families += _cones(mesh, faces, place) + _rings(mesh, faces, place)
    return tuple(_without_conflicts([f for f in families if len(f.parts)], len(faces)))


def as_cut(mesh: Mesh, recognised: RecognisedCut) -> Cut:
    """Return the recognised macro-elements as a cut, in which no cell is known to replace another."""
    zone_of = [recognised.zone[family.parts[:, 0]] for family in recognised.families]
    first = [recognised.cells[family.parts[:, 0]] for family in recognised.families]
    order = np.lexsort((np.concatenate(first), np.concatenate(zone_of)))
    number = places_of(order, len(order), np.int32)
    macro, zone, child = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    internal = np.full(mesh.n_nodes, -1, np.int32)
    done = 0
    for family, mine in zip(recognised.families, zone_of, strict=True):
        ids = number[done : done + len(family.parts)]
        done += len(ids)
        cells = recognised.cells[family.parts]
        macro[cells], zone[cells] = ids[:, None], mine[:, None]
        child[cells] = np.arange(1, cells.shape[1] + 1)
        internal[family.frame[:, _carriers(family)]] = ids[:, None]
    records = dict(zip(CELL_RECORDS, (macro, zone, child), strict=False))
    origin = Origin(np.arange(mesh.n_cells), np.arange(mesh.n_nodes), np.empty(0, np.int64))
    return Cut(with_records(mesh, records, internal, recognised.names), origin)


def _carriers(family: MacroGroup) -> list[int]:
    """Positions in the frame of the nodes that carry an internal dof."""
    if family.kind == WHOLE:
        return [WHOLE_FACES[family.face]]
    n = CELLS[family.face].n_nodes
    return [n + int(p) for p in internal_points(family.face, family.kind, family.ring)]


def _whole(faces: Faces) -> list[MacroGroup]:
    rows = {name: np.flatnonzero(faces.type == TYPE_CODE[name]) for name in WHOLE_FACES}
    return [MacroGroup(n, WHOLE, r[:, None], faces.nodes[r][:, : CELLS[n].n_nodes]) for n, r in rows.items()]


def _without_conflicts(families: list[MacroGroup], n_faces: int) -> list[MacroGroup]:
    """Remove the macro-elements that share a face with another one."""
    count = np.zeros(n_faces, np.int64)
    for family in families:
        np.add.at(count, family.parts.ravel(), 1)
    kept = [(f, (count[f.parts] == 1).all(axis=1)) for f in families]
    return [replace(f, parts=f.parts[ok], frame=f.frame[ok]) for f, ok in kept if ok.any()]


# ---- what only a cut has


def _doubt(mesh: Mesh, families: tuple[MacroGroup, ...], faces: Faces, cells: Ints) -> str:
    """Reason to doubt that the faces were cut, as a sentence; "" if none. `families`: parts of `faces`, of `cells`."""
    cut_groups = [family for family in families if family.kind != WHOLE]
    if not cut_groups:
        return ""
    odd = [family.ring for family in cut_groups if family.kind == RING and family.ring != _THIRD]
    if odd:
        return f"their inner faces have a half-width of {odd[0]:.4g}, and those of a cut have 1/3"
    if _new_nodes_last(mesh, cut_groups, faces, cells) or _new_nodes_last(mesh, *_all_made(mesh, faces)):
        return ""
    return NOT_LAST


def _all_made(mesh: Mesh, faces: Faces) -> tuple[list[MacroGroup], Faces, Ints]:
    """Recognise the macro-elements of the whole skin, whatever the group; return (families, faces, their cells).

    The nodes made by the cuts of other groups may lie, in the numbering, among those of the groups asked for.
    """
    dim = CELLS[FACE_TYPES[faces.type[0]]].dim
    cells = np.sort(np.concatenate([cells for kind, _, cells in cells_of_dim(mesh, dim) if kind in TYPE_CODE]))
    skin, first = distinct_faces(mesh, cells)
    families = _families(mesh, skin, mesh.places_in_file(cells[first]))
    return [family for family in families if family.kind != WHOLE], skin, cells[first]


def _new_nodes_last(mesh: Mesh, cut_groups: list[MacroGroup], faces: Faces, cells: Ints) -> bool:
    """True if the new nodes are the last of the mesh, or of each entity of the skin (gmsh renumbers by entity)."""
    return bool(cut_groups) and (_last_of_mesh(mesh, cut_groups, faces) or _last_of_entities(mesh, cut_groups, cells))


def _last_of_mesh(mesh: Mesh, cut_groups: list[MacroGroup], faces: Faces) -> bool:
    """True if the last of the nodes that cells use are those that the cut made on its faces and behind them.

    Their number, and the number of cells with such nodes, must agree with the new nodes and children of the cut.
    """
    dim = CELLS[cut_groups[0].face].dim
    used = mask_of(mesh.n_nodes, *(nodes for _, nodes, _ in (*cells_of_dim(mesh, dim), *cells_of_dim(mesh, dim + 1))))
    least, most = _n_made(mesh, cut_groups, faces)
    number = mesh.node_number
    first_new = min(number[f.new].min() for f in cut_groups)
    last_old = max(number[f.outline].max() for f in cut_groups)
    first_made = min(first_new, np.sort(number[used])[-least[0] :][0])
    young = used & (number >= first_made)
    n_cells = sum(np.count_nonzero(young[nodes].any(axis=1)) for _, nodes, _ in cells_of_dim(mesh, dim + 1))
    return bool(first_made > last_old and np.count_nonzero(young) <= most[0] and least[1] <= n_cells <= most[1])


def _last_of_entities(mesh: Mesh, cut_groups: list[MacroGroup], cells: Ints) -> bool:
    """True if each macro-element lies in one entity of msh, and the new nodes of an entity follow all its others."""
    entity = mesh.entity_of_cell
    if not len(entity) or any((np.ptp(entity[cells[f.parts], 1], axis=1) > 0).any() for f in cut_groups):
        return False
    new = mask_of(mesh.n_nodes, *(family.new for family in cut_groups))
    skin = [(entity[cells, 1], nodes) for _, nodes, cells in cells_of_dim(mesh, CELLS[cut_groups[0].face].dim)]
    tag = np.concatenate([np.repeat(tags, nodes.shape[1]) for tags, nodes in skin])
    node = np.concatenate([nodes.ravel() for _, nodes in skin])
    order = np.lexsort((mesh.node_number[node], tag))
    tag, late = tag[order], new[node[order]]
    return not (late[:-1] & ~late[1:] & (tag[:-1] == tag[1:])).any()


def _n_made(mesh: Mesh, cut_groups: list[MacroGroup], faces: Faces) -> tuple[Ints, Ints]:
    """Bounds (2,), (2,): least and largest numbers of new nodes, and of new cells behind the faces, that a cut made.

    Each face replaces one cell by children: the first slave face of a parent replaces the parent, each further one
    replaces one of the children.
    """
    least, most = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for f in cut_groups:
        first = faces.take(f.parts[:, 0])
        behind = len(find_owners(first, cells_of_dim(mesh, CELLS[f.face].dim + 1), mesh.n_nodes).face)
        counts = _n_behind(f.face, f.kind)
        least += [f.new.size, min(behind, 1 - int(least[1] > 0))]
        most += [f.new.size, 0]
        least += behind * (counts.min(axis=0) - [0, 1])
        most += behind * counts.max(axis=0)
    return least, most


@cache
def _n_behind(face: str, kind: str) -> Ints:
    """(p, 2): numbers of new nodes inside and of children, for each possible parent of a face with this cut."""
    parents = [name for name in CELLS if kind != RING or name in RING_PARENTS]
    facets = [(name, j) for name in parents for j, f in enumerate(CELLS[name].facets) if f.type == face]
    patterns = [parent_pattern(name, j, kind) for name, j in facets]
    return np.array([(len(p.inside), p.n_children) for p in patterns])


# ---- cones: triangles around a node


def _cones(mesh: Mesh, faces: Faces, place: Ints) -> list[MacroGroup]:
    """Recognise cones on triangles and quadrangles: nodes with exactly three or four triangles around them."""
    valence = np.bincount(faces.corners[faces.corners >= 0], minlength=mesh.n_nodes)
    out = []
    for name in ("TRIA3", "TRIA6"):
        rows = np.flatnonzero(faces.type == TYPE_CODE[name])
        if not len(rows):
            continue
        corners = faces.nodes[rows, :3]
        few = (valence[corners] == 3) | (valence[corners] == 4)
        if not few.any():
            continue
        at, corner = np.nonzero(few)
        node = corners[at, corner]
        order = np.lexsort((place[rows[at]], node))
        node, face, corner = node[order], rows[at[order]], corner[order]
        same_type = np.bincount(node, minlength=mesh.n_nodes)[node] == valence[node]
        for n, outline in ((3, "TRIA"), (4, "QUAD")):
            mine = same_type & (valence[node] == n)
            parts, last = face[mine].reshape(-1, n), corner[mine].reshape(-1, n)
            family = _fan(faces, parts, last, f"{outline}{n if name == 'TRIA3' else 2 * n}")
            family = _in_place(mesh, family)
            out.append(family if n == 3 else _take(family, _surely_cut(mesh, family, place)))
    return out


def _fan(faces: Faces, parts: Ints, last: Ints, face: str) -> MacroGroup:
    """Keep the closed fans of triangles, sorted E1, E2, ... (E1 is the first in the file).

    `parts` (m, n): the triangles around each centre; `last` (m, n): the corner of each that is the centre.
    """
    m, n = parts.shape
    pattern = face_pattern(face, CONE)
    children = pattern.children[0]
    listed = _rolled(faces.nodes[parts], (last + 1) % 3, 3, children.nodes.shape[1])
    order = np.zeros((m, n), np.int64)
    good = np.ones(m, bool)
    rows = np.arange(m)
    for k in range(1, n):
        follows = listed[:, :, 0] == listed[rows, order[:, k - 1], 1][:, None]
        good &= follows.sum(axis=1) == 1
        order[:, k] = follows.argmax(axis=1)
    parts = np.take_along_axis(parts, order, axis=1)
    listed = np.take_along_axis(listed, order[:, :, None], axis=1)
    return _framed(face, CONE, parts[good], listed[good], _THIRD)


def _rolled(nodes: Ints, start: Ints, n_corners: int, n_nodes: int) -> Ints:
    """List the nodes of faces (m, k, 9) from another corner, `start` (m, k), and their mid-nodes accordingly."""
    turn = (np.arange(n_corners) + start[..., None]) % n_corners
    both = turn if n_nodes == n_corners else np.concatenate([turn, turn + n_corners], axis=-1)
    return np.take_along_axis(nodes, both, axis=-1)


def _framed(face: str, kind: str, parts: Ints, listed: Ints, ring: float) -> MacroGroup:
    """Keep the macro-elements whose faces, with nodes `listed` (m, k, n) as in the pattern, fit into one frame."""
    pattern = face_pattern(face, kind, ring)
    children = pattern.children[0]
    places = children.nodes[np.argsort(children.rank)]
    frame = np.full((len(parts), CELLS[face].n_nodes + len(pattern.on_face)), -1, np.int64)
    frame[:, places.ravel()] = listed.reshape(len(parts), places.size)
    fits = (frame[:, places] == listed).all(axis=(1, 2)) if len(parts) else np.zeros(0, bool)
    return MacroGroup(face, kind, parts[fits], frame[fits], ring)


def _in_place(mesh: Mesh, family: MacroGroup) -> MacroGroup:
    """Keep the macro-elements whose new nodes lie where the pattern puts them on the map of the outline."""
    n = CELLS[family.face].n_nodes
    at = face_pattern(family.face, family.kind, family.ring).on_face
    x = mesh.points[family.frame]
    expected = np.einsum("pn,mnd->mpd", shape(family.face, at), x[:, :n])
    outline = x[:, : CELLS[family.face].n_corners]
    size = np.linalg.norm(outline.max(axis=1) - outline.min(axis=1), axis=1)
    off = np.linalg.norm(x[:, n:] - expected, axis=2).max(axis=1, initial=0)
    return _take(family, off <= PLACE * size)


def _take(family: MacroGroup, rows: NDArray[np.bool_]) -> MacroGroup:
    return replace(family, parts=family.parts[rows], frame=family.frame[rows])


def _surely_cut(mesh: Mesh, family: MacroGroup, place: Ints) -> NDArray[np.bool_]:
    """True for fans of four triangles made by a cut, not by a mesher.

    Either the apex of a pyramid is at the centre, or the numbering is that of a cut, which numbers new nodes after all
    old ones and puts the children of a face in its place in the file.
    """
    n = CELLS[family.face].n_corners
    centre = family.frame[:, CELLS[family.face].n_nodes]
    apex = np.zeros(mesh.n_nodes, bool)
    for block in mesh.blocks:
        if CELLS[block.type].family == "PYRAM" if block.type in CELLS else False:
            apex[block.nodes[:, 4]] = True
    late = (centre[:, None] > family.frame[:, :n]).all(axis=1)
    together = (np.diff(np.sort(place[family.parts], axis=1), axis=1) == 1).all(axis=1)
    return apex[centre] | (late & together)


# ---- rings: quadrangles around a quadrangle


def _rings(mesh: Mesh, faces: Faces, place: Ints) -> list[MacroGroup]:
    """Recognise rings around quadrangles: at each corner of the inner one, exactly three faces of the skin meet."""
    valence = np.bincount(faces.corners[faces.corners >= 0], minlength=mesh.n_nodes)
    out = []
    for name in ("QUAD4", "QUAD8"):
        rows = np.flatnonzero(faces.type == TYPE_CODE[name])
        corners = faces.nodes[rows, :4]
        centre = np.flatnonzero((valence[corners] == 3).all(axis=1))
        if len(centre):
            inner_and_sides = _sides(mesh, faces, rows, centre)
            if inner_and_sides is not None:
                out.append(_ring_family(mesh, faces, place, name, *inner_and_sides))
    return out


def _sides(mesh: Mesh, faces: Faces, rows: Ints, centre: Ints) -> tuple[Ints, Ints] | None:
    """(centres (m,), sides (m, 4)), rows of `faces`: inner quadrangles, and the neighbours across their four edges."""
    corners = faces.nodes[rows, :4]
    near = mask_of(mesh.n_nodes, corners[centre])
    at, corner = np.nonzero(near[corners])
    node = corners[at, corner]
    order = np.argsort(node, kind="stable")
    node, at = node[order], at[order]
    known, start, count = np.unique(node, return_index=True, return_counts=True)
    three = np.flatnonzero(count == 3)  # else a face of another type is there
    around = np.full((mesh.n_nodes, 3), -1, np.int64) if len(three) else np.empty((0, 3), np.int64)
    if not len(three):
        return None
    around[known[three]] = at[start[three][:, None] + np.arange(3)]
    there = around[corners[centre]]  # (m, 4, 3)
    following = np.roll(there, -1, axis=1)
    shared = (there[..., None] == following[:, :, None, :]).any(axis=3)
    shared &= (there != centre[:, None, None]) & (there >= 0)
    good = (shared.sum(axis=2) == 1).all(axis=1)
    side = np.take_along_axis(there, shared.argmax(axis=2)[..., None], axis=2)[..., 0]
    return rows[centre[good]], rows[side[good]]


def _ring_family(mesh: Mesh, faces: Faces, place: Ints, face: str, centre: Ints, sides: Ints) -> MacroGroup:
    n_nodes = CELLS[face].n_nodes
    first = place[sides].argmin(axis=1)
    turn = (first[:, None] + np.arange(4)) % 4
    sides = np.take_along_axis(sides, turn, axis=1)
    inner = np.take_along_axis(faces.nodes[centre, :4], turn, axis=1)
    # a side lists two corners of the outline, then the inner ones backwards
    at = (faces.nodes[sides][:, :, :4] == np.roll(inner, -1, axis=1)[:, :, None]).argmax(axis=2)
    listed = _rolled(faces.nodes[sides], (at + 2) % 4, 4, n_nodes)
    middle = _rolled(faces.nodes[centre][:, None], first[:, None], 4, n_nodes)
    parts = np.column_stack([sides, centre])
    nodes = np.concatenate([listed, middle], axis=1)
    half = _half_width(mesh, listed[:, 0, 0], listed[:, 2, 0], inner[:, 0], inner[:, 2])
    return _in_place(mesh, _framed(face, RING, parts, nodes, half))


def _half_width(mesh: Mesh, v1: Ints, v3: Ints, n1: Ints, n3: Ints) -> float:
    """Half-width of the rings, one value for the whole cut: inner over outer diagonal, the median."""
    outer, inner = mesh.points[v3] - mesh.points[v1], mesh.points[n3] - mesh.points[n1]
    size = (outer * outer).sum(axis=1)
    ratio = float(np.median((inner * outer).sum(axis=1) / np.where(size > 0, size, np.inf))) if len(size) else _THIRD
    if not 0 < ratio < 1 or abs(ratio - _THIRD) < 1e-3:
        return _THIRD
    return round(ratio, 9)
