"""The macro-elements of a cut whose records are gone, found again from the faces, whoever made it.

A macro-element is known by its pattern: faces that stand around a node (cone) or around a face (ring) of the skin, list
their nodes as the pattern's children do, and have the new nodes where the pattern puts them on the outline's own map.
That is certain for the cone on a triangle and the ring on a quadrangle. The cone on a quadrangle also looks like a
quadrangle that a mesher crossed with its diagonals: there a pyramid behind it, or nodes and faces numbered as a cut
numbers them, must say so. Segments need the cells behind them (`regroup.py`). Faces that a cut leaves whole (SEG3,
TRIA7, QUAD9) are macro-elements as they stand.

A mesh is taken for cut when every slave face is part of a macro-element; nodes must not have been moved since. Faces
that a mesher made may look alike (an O-grid, triangles split at their centroids), so that more is asked for, which only
a cut has: rings of half-width 1/3, and as the last nodes of the mesh those that the cut made. Where that fails, `doubt`
says so, and only who knows better takes the faces for cut.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
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
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, Cut, is_cut
from lacmesh.cutting.regroup import regroup_segments
from lacmesh.errors import LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, spec_list
from lacmesh.reference.shapes import shape
from lacmesh.topology.faces import cells_of_dim, distinct_faces
from lacmesh.topology.skin import FACE_TYPES, N_CORNERS, TYPE_CODE, Faces, find_owners

#: how far a node may stand from its place, as a part of the outline's size: files keep as few as seven digits
PLACE = 1e-5
_THIRD = 1 / 3
#: what is in doubt where the places are those of a cut and the numbers are not
NOT_LAST = "the last nodes of the mesh are not those that a cut would have made"


@dataclass(frozen=True)
class Family:
    """Macro-elements of one pattern: `parts` (m, k) the faces E1 ... Ek, `frame` (m, n) nodes in its frame."""

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
class Found:
    """What was found in a slave skin: `cells` (f,) of its faces, each once, the `zone` (f,) of each, the `families`.

    `left`: the rows of `cells` that are part of no macro-element. `doubt`: what no cut would have, in words;
    empty where everything is as a cut leaves it.
    """

    names: tuple[str, ...]
    cells: Ints
    zone: Ints
    families: tuple[Family, ...]
    left: Ints
    doubt: str = ""

    @property
    def n_cut(self) -> int:
        """Number of faces that are parts of macro-elements of several faces."""
        return sum(family.parts.size for family in self.families if family.kind != WHOLE)

    @property
    def complete(self) -> bool:
        """Whether the skin is cut, and everywhere."""
        return self.n_cut > 0 and not len(self.left)

    @property
    def mostly_cut(self) -> bool:
        """Whether half of the faces or more were cut: a few may look so by chance."""
        return self.n_cut > 0 and 2 * self.n_cut >= len(self.cells)

    @property
    def n_macros(self) -> int:
        """Number of macro-elements."""
        return sum(len(family.parts) for family in self.families)


def recognise(mesh: Mesh, slave: str | int | Sequence[str | int], *, certain: bool = True) -> Cut | None:
    """The cut that a mesh carries on its slave groups, with its records, or None where these are not cut.

    Records that are there are taken as they are; else the macro-elements are found from the faces, and numbered zone by
    zone, in the order of their first faces. What the children replaced is not known any more: `lac_parent` is left out.
    `certain`: only what has all that a cut has, half-widths of 1/3 and the new nodes last, is taken for one; else the
    pattern of the faces is enough, for a cut with another `ring` or numbered again since.
    A skin that is cut in part only gives None, and a LacmeshWarning with the faces left over. Raises GroupNotFoundError
    and RequestError.
    """
    if is_cut(mesh):
        return Cut(mesh)
    found = find_macros(mesh, group_names(mesh, slave))
    if found.families and not len(found.left) and not (certain and found.doubt):
        return Cut(with_records(mesh, found))
    if found.n_cut and len(found.left) and not (certain and found.doubt):
        left = mesh.cell_names(found.cells[found.left])
        message = f"the slave skin is cut in part: cells {left} belong to no macro-element of it"
        warnings.warn(message, LacmeshWarning, stacklevel=2)
    return None


def group_names(mesh: Mesh, slave: str | int | Sequence[str | int]) -> list[str]:
    """The slave groups asked for, as a list of specifications; each must be in the mesh."""
    specs = spec_list(slave)
    if not specs:
        raise RequestError("no slave group was given")
    for spec in specs:
        mesh.cells_of(spec)
    return specs


def find_macros(mesh: Mesh, specs: list[str]) -> Found:
    """The macro-elements in some groups; cells that are no skin faces of ours are passed over."""
    cells, zone = _slave_cells(mesh, specs)
    if not len(cells):
        return Found(tuple(specs), cells, zone, (), np.empty(0, np.int64))
    faces, first = distinct_faces(mesh, cells)
    cells, zone = cells[first], zone[first]
    place = _places_in_file(mesh, cells)
    families = _families(mesh, faces, place)
    covered = np.zeros(len(faces), bool)
    for family in families:
        covered[family.parts] = True
    doubt = _doubt(mesh, families, faces, cells)
    return Found(tuple(specs), cells, zone, families, np.flatnonzero(~covered), doubt)


def _families(mesh: Mesh, faces: Faces, place: Ints) -> tuple[Family, ...]:
    """The macro-elements among some faces, each once; `place` (f,): where each stands in the file."""
    families = _whole(faces)
    if (N_CORNERS[faces.type] == 2).any():
        families += [
            Family("SEG2", kind, parts, nodes, ring)
            for kind, parts, nodes, ring in regroup_segments(mesh, faces, place, PLACE)
        ]
    else:
        families += _cones(mesh, faces, place) + _rings(mesh, faces, place)
    return tuple(_without_conflicts([f for f in families if len(f.parts)], len(faces)))


def with_records(mesh: Mesh, found: Found) -> Mesh:
    """The mesh with the records of what was found (`docs/conventions.md`)."""
    zone_of = [found.zone[family.parts[:, 0]] for family in found.families]
    first = [found.cells[family.parts[:, 0]] for family in found.families]
    order = np.lexsort((np.concatenate(first), np.concatenate(zone_of)))
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order))
    macro, zone, child = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    internal = np.full(mesh.n_nodes, -1, np.int32)
    done = 0
    for family, mine in zip(found.families, zone_of, strict=True):
        ids = number[done : done + len(family.parts)]
        done += len(ids)
        cells = found.cells[family.parts]
        macro[cells], zone[cells] = ids[:, None], mine[:, None]
        child[cells] = np.arange(1, cells.shape[1] + 1)
        internal[family.frame[:, _carriers(family)]] = ids[:, None]
    records = dict(zip(CELL_RECORDS, (macro, zone, child), strict=False))
    return replace(
        mesh,
        cell_data={**mesh.cell_data, **records},
        node_data={**mesh.node_data, NODE_RECORD: internal},
        zones=found.names,
    )


def _carriers(family: Family) -> list[int]:
    """The places of a frame whose nodes carry an internal dof."""
    if family.kind == WHOLE:
        return [WHOLE_FACES[family.face]]
    n = CELLS[family.face].n_nodes
    return [n + int(p) for p in internal_points(family.face, family.kind, family.ring)]


def _slave_cells(mesh: Mesh, specs: list[str]) -> tuple[Ints, Ints]:
    """The skin faces of some groups, a cell once, and the place among the groups of the first that holds it."""
    known = np.array([b.type in TYPE_CODE and b.type != "POI1" for b in mesh.blocks], bool)
    parts = []
    for spec in specs:
        cells = np.asarray(mesh.cells_of(spec))
        dims = mesh.cell_dim[cells]
        want = mesh.dim - 1 if (dims == mesh.dim - 1).any() else dims.max(initial=0)
        cells = cells[dims == want]
        parts.append(cells[known[np.searchsorted(mesh.offsets, cells, side="right") - 1]])
    cells = np.concatenate(parts)
    zone = np.repeat(np.arange(len(parts)), [len(p) for p in parts])
    if len(parts) > 1:
        first = np.sort(np.unique(cells, return_index=True)[1])
        cells, zone = cells[first], zone[first]
        same = mesh.cell_dim[cells] == mesh.cell_dim[cells].max(initial=0)
        cells, zone = cells[same], zone[same]
    return cells, zone


def _places_in_file(mesh: Mesh, cells: Ints) -> Ints:
    if mesh.file_order is None:
        return cells
    rank = np.empty(mesh.n_cells, np.int64)
    rank[mesh.file_order] = np.arange(mesh.n_cells)
    return rank[cells]


def _whole(faces: Faces) -> list[Family]:
    rows = {name: np.flatnonzero(faces.type == TYPE_CODE[name]) for name in WHOLE_FACES}
    return [Family(n, WHOLE, r[:, None], faces.nodes[r][:, : CELLS[n].n_nodes]) for n, r in rows.items()]


def _without_conflicts(families: list[Family], n_faces: int) -> list[Family]:
    """Macro-elements that share a face are none."""
    count = np.zeros(n_faces, np.int64)
    for family in families:
        np.add.at(count, family.parts.ravel(), 1)
    kept = [(f, (count[f.parts] == 1).all(axis=1)) for f in families]
    return [replace(f, parts=f.parts[ok], frame=f.frame[ok]) for f, ok in kept if ok.any()]


# ---- what only a cut has


def _doubt(mesh: Mesh, families: tuple[Family, ...], faces: Faces, cells: Ints) -> str:
    """What no cut would have, in words, or nothing; `faces`: those that the families are of, from `cells`."""
    made = [family for family in families if family.kind != WHOLE]
    if not made:
        return ""
    odd = [family.ring for family in made if family.kind == RING and family.ring != _THIRD]
    if odd:
        return f"their inner faces have a half-width of {odd[0]:.4g}, and those of a cut have 1/3"
    if _new_nodes_last(mesh, made, faces, cells) or _new_nodes_last(mesh, *_all_made(mesh, faces)):
        return ""
    return NOT_LAST


def _all_made(mesh: Mesh, faces: Faces) -> tuple[list[Family], Faces, Ints]:
    """What was cut of the whole skin: the nodes of other groups' cuts may stand among those of the cut of `faces`."""
    dim = CELLS[FACE_TYPES[faces.type[0]]].dim
    cells = np.sort(np.concatenate([cells for kind, _, cells in cells_of_dim(mesh, dim) if kind in TYPE_CODE]))
    skin, first = distinct_faces(mesh, cells)
    found = _families(mesh, skin, _places_in_file(mesh, cells[first]))
    return [family for family in found if family.kind != WHOLE], skin, cells[first]


def _new_nodes_last(mesh: Mesh, made: list[Family], faces: Faces, cells: Ints) -> bool:
    """Whether the new nodes are the last, of the mesh or, as gmsh numbers nodes again, of each entity of the skin."""
    return bool(made) and (_last_of_mesh(mesh, made, faces) or _last_of_entities(mesh, made, cells))


def _last_of_mesh(mesh: Mesh, made: list[Family], faces: Faces) -> bool:
    """Whether the last nodes, of those that cells use, are the ones that the cut made on its faces and behind them.

    They are as many as the cut makes, and the cells on them are as many as the children that it makes.
    """
    dim = CELLS[made[0].face].dim
    used = np.zeros(mesh.n_nodes, bool)
    for _, nodes, _ in (*cells_of_dim(mesh, dim), *cells_of_dim(mesh, dim + 1)):
        used[nodes] = True
    least, most = _n_made(mesh, made, faces)
    number = mesh.node_number
    first_new = min(number[f.new].min() for f in made)
    last_old = max(number[f.outline].max() for f in made)
    first_made = min(first_new, np.sort(number[used])[-least[0] :][0])
    young = used & (number >= first_made)
    n_cells = sum(np.count_nonzero(young[nodes].any(axis=1)) for _, nodes, _ in cells_of_dim(mesh, dim + 1))
    return bool(first_made > last_old and np.count_nonzero(young) <= most[0] and least[1] <= n_cells <= most[1])


def _last_of_entities(mesh: Mesh, made: list[Family], cells: Ints) -> bool:
    """Whether each macro-element lies in one of msh's entities, in which the new nodes come after all others."""
    entity = mesh.entity_of_cell
    if not len(entity) or any((np.ptp(entity[cells[f.parts], 1], axis=1) > 0).any() for f in made):
        return False
    new = np.zeros(mesh.n_nodes, bool)
    for family in made:
        new[family.new] = True
    skin = [(entity[cells, 1], nodes) for _, nodes, cells in cells_of_dim(mesh, CELLS[made[0].face].dim)]
    tag = np.concatenate([np.repeat(tags, nodes.shape[1]) for tags, nodes in skin])
    node = np.concatenate([nodes.ravel() for _, nodes in skin])
    order = np.lexsort((mesh.node_number[node], tag))
    tag, late = tag[order], new[node[order]]
    return not (late[:-1] & ~late[1:] & (tag[:-1] == tag[1:])).any()


def _n_made(mesh: Mesh, made: list[Family], faces: Faces) -> tuple[Ints, Ints]:
    """How many nodes, and how many cells behind the faces, a cut made, (2,) at least and (2,) at most.

    Each face has one of the cells behind it replaced by its children: the first of a parent's faces the parent itself,
    the next ones one of these children.
    """
    least, most = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for f in made:
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
    """(p, 2): the new nodes inside and the children of each type of cell behind a face, by its cut."""
    parents = [name for name in CELLS if kind != RING or name in RING_PARENTS]
    facets = [(name, j) for name in parents for j, f in enumerate(CELLS[name].facets) if f.type == face]
    patterns = [parent_pattern(name, j, kind) for name, j in facets]
    return np.array([(len(p.inside), p.n_children) for p in patterns])


# ---- cones: triangles around a node


def _cones(mesh: Mesh, faces: Faces, place: Ints) -> list[Family]:
    """Cones on triangles and quadrangles, by the nodes with three or four triangles around them, only."""
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


def _fan(faces: Faces, parts: Ints, last: Ints, face: str) -> Family:
    """The fans that close, in the order E1, E2, ... (E1 is the first in the file): parts (m, n), centres `last`."""
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
    """Faces (m, k, 9) listed from another corner, `start` (m, k); mid-nodes follow."""
    turn = (np.arange(n_corners) + start[..., None]) % n_corners
    both = turn if n_nodes == n_corners else np.concatenate([turn, turn + n_corners], axis=-1)
    return np.take_along_axis(nodes, both, axis=-1)


def _framed(face: str, kind: str, parts: Ints, listed: Ints, ring: float) -> Family:
    """Macro-elements whose faces' nodes, listed (m, k, n) as the pattern's children, fit one frame; the others go."""
    pattern = face_pattern(face, kind, ring)
    children = pattern.children[0]
    places = children.nodes[np.argsort(children.rank)]
    frame = np.full((len(parts), CELLS[face].n_nodes + len(pattern.on_face)), -1, np.int64)
    frame[:, places.ravel()] = listed.reshape(len(parts), places.size)
    fits = (frame[:, places] == listed).all(axis=(1, 2)) if len(parts) else np.zeros(0, bool)
    return Family(face, kind, parts[fits], frame[fits], ring)


def _in_place(mesh: Mesh, family: Family) -> Family:
    """Those whose new nodes stand where the pattern puts them on the outline's own map."""
    n = CELLS[family.face].n_nodes
    at = face_pattern(family.face, family.kind, family.ring).on_face
    x = mesh.points[family.frame]
    expected = np.einsum("pn,mnd->mpd", shape(family.face, at), x[:, :n])
    outline = x[:, : CELLS[family.face].n_corners]
    size = np.linalg.norm(outline.max(axis=1) - outline.min(axis=1), axis=1)
    off = np.linalg.norm(x[:, n:] - expected, axis=2).max(axis=1, initial=0)
    return _take(family, off <= PLACE * size)


def _take(family: Family, rows: NDArray[np.bool_]) -> Family:
    return replace(family, parts=family.parts[rows], frame=family.frame[rows])


def _surely_cut(mesh: Mesh, family: Family, place: Ints) -> NDArray[np.bool_]:
    """Cones on quadrangles that a cut made, and not a mesher: a pyramid's apex is their centre, or the numbers say so.

    A cut numbers new nodes after all old ones and puts a face's children where the face stood.
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


def _rings(mesh: Mesh, faces: Faces, place: Ints) -> list[Family]:
    """Rings, by the quadrangles all of whose corners have three faces of the skin around them."""
    valence = np.bincount(faces.corners[faces.corners >= 0], minlength=mesh.n_nodes)
    out = []
    for name in ("QUAD4", "QUAD8"):
        rows = np.flatnonzero(faces.type == TYPE_CODE[name])
        corners = faces.nodes[rows, :4]
        centre = np.flatnonzero((valence[corners] == 3).all(axis=1))
        if len(centre):
            found = _sides(mesh, faces, rows, centre)
            if found is not None:
                out.append(_ring_family(mesh, faces, place, name, *found))
    return out


def _sides(mesh: Mesh, faces: Faces, rows: Ints, centre: Ints) -> tuple[Ints, Ints] | None:
    """(centres (m,), sides (m, 4)) as rows of `faces`: the quadrangle across each edge of a centre, in its order."""
    corners = faces.nodes[rows, :4]
    near = np.zeros(mesh.n_nodes, bool)
    near[corners[centre]] = True
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


def _ring_family(mesh: Mesh, faces: Faces, place: Ints, face: str, centre: Ints, sides: Ints) -> Family:
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
    """The ring's half-width, the same in one cut: inner over outer diagonal."""
    outer, inner = mesh.points[v3] - mesh.points[v1], mesh.points[n3] - mesh.points[n1]
    size = (outer * outer).sum(axis=1)
    ratio = float(np.median((inner * outer).sum(axis=1) / np.where(size > 0, size, np.inf))) if len(size) else _THIRD
    if not 0 < ratio < 1 or abs(ratio - _THIRD) < 1e-3:
        return _THIRD
    return round(ratio, 9)
