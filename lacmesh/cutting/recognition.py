"""The cut that slave faces have already: by the records of their mesh or, on request, by the patterns of its faces.

A macro-element is recognised where faces list their nodes as the children of a pattern do (`patterns.face_pattern`),
with the new nodes where the pattern puts them on the map of the outline, whatever program made the cut and numbered it.
The position of a node on a line is no evidence: segments must also have the cells of a cut behind them. Faces that a
cut leaves whole (SEG3, TRIA7, QUAD9) are macro-elements as they are. The nodes must not have been moved since the cut.
A mesher may make such faces too: a mesh without records is uncut unless the user requests recognition.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import CONE, RING, WHOLE, WHOLE_FACES, face_pattern, internal_points
from lacmesh.cutting.records import CELL_RECORDS, Cut, Origin, is_cut, with_records
from lacmesh.cutting.select import SlaveSkin, slave_skin
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, MeshLike, as_mesh, concatenated, mask_of, places_of, spec_list
from lacmesh.reference.shapes import shape
from lacmesh.topology.skin import (
    TYPE_CODE,
    Bools,
    FaceIncidence,
    Faces,
    cells_of_dim,
    distinct_edges,
    find_owners,
    find_repeats,
    neighbours,
)

#: how far a node may stand from its place, as a part of the outline's size: files keep as few as seven digits
PLACE = 1e-5
#: how far two consecutive segments of one macro-element may turn
_TURN = 20 * PLACE
_THIRD = 1 / 3
_PATTERNS = [(face, CONE) for face in ("TRIA3", "TRIA6", "QUAD4", "QUAD8")] + [("QUAD4", RING), ("QUAD8", RING)]


@dataclass(frozen=True)
class MacroGroup:
    """Macro-elements of one pattern: `parts` (m, k), the faces E1 ... Ek; `frame` (m, n), the nodes of its frame."""

    face: str
    kind: str
    parts: Ints
    frame: Ints
    ring: float = _THIRD

    def take(self, rows: Ints | Bools) -> MacroGroup:
        """Some of the macro-elements."""
        return replace(self, parts=self.parts[rows], frame=self.frame[rows])


@dataclass(frozen=True)
class RecognisedCut:
    """Recognised macro-elements of a slave skin: its faces, each once, as `cells` (f,), their `zone` (f,), `families`.

    `left`: rows of `cells` that belong to no macro-element.
    """

    names: tuple[str, ...]
    cells: Ints
    zone: Ints
    families: tuple[MacroGroup, ...]
    left: Ints

    @property
    def n_cut(self) -> int:
        """Number of faces that belong to macro-elements of several faces."""
        return sum(family.parts.size for family in self.families if family.kind != WHOLE)


def earlier_cut(mesh: Mesh, slave: SlaveSkin, recognise: bool | None) -> Cut | None:
    """Return the cut that some slave faces have already, or None if they are to be cut.

    `recognise`: as in `cut_skin`. Raises CutError if they are cut in part, or if a requested cut is not recognised.
    """
    if is_cut(mesh):
        if recognise is not False:
            return _recorded(mesh, slave)
        message = f"the mesh is cut already: its records (of {', '.join(mesh.zones)}) are replaced"
        warnings.warn(message, LacmeshWarning, stacklevel=3)
    if not recognise or not slave.names:
        return None
    recognised = find_macros(mesh, slave)
    if len(recognised.left) or not recognised.n_cut:
        left = recognised.cells[recognised.left]
        names = f"{', '.join(slave.names)} (cells {mesh.cell_names(left)} fit no pattern of a cut)"
        raise CutError(f"no earlier cut is recognised on {names}", mesh.cell_number[left])
    return as_cut(mesh, recognised)


def recognise(mesh: MeshLike, slave: str | int | Sequence[str | int]) -> Cut | None:
    """Recognise the cut of the slave groups of a mesh; return it with its records, or None if they are not cut.

    Existing records are used as they are; without them the macro-elements are recognised from the faces and numbered
    zone by zone, in the order of their first faces. The cells that the children replaced are unknown: `lac_parent` is
    left out. A skin that is only partly cut gives None and a LacmeshWarning with the remaining faces. Raises
    GroupNotFoundError and RequestError.

    >>> from dataclasses import replace
    >>> from lacmesh import cut_skin, read
    >>> mesh = read("data/two_blocks.msh")
    >>> bare = replace(cut_skin(mesh, "slave").mesh, cell_data={}, node_data={})
    >>> recognise(bare, "slave").n_macros, recognise(mesh, "slave")
    (36, None)
    """
    mesh, specs = as_mesh(mesh), spec_list(slave)
    if is_cut(mesh):
        return Cut(mesh)
    if not specs:
        raise RequestError("no slave group was given")
    recognised = find_macros(mesh, slave_skin(mesh, specs))
    if recognised.families and not len(recognised.left):
        return as_cut(mesh, recognised)
    if recognised.n_cut:
        left = mesh.cell_names(recognised.cells[recognised.left])
        message = f"the slave surface is cut in part: cells {left} belong to no macro-element of it"
        warnings.warn(message, LacmeshWarning, stacklevel=2)
    return None


def _recorded(mesh: Mesh, slave: SlaveSkin) -> Cut:
    """Return the cut that a mesh has records of. Raises CutError if a slave group has faces that are not cut."""
    cut = Cut(mesh)
    macro = cut.macro_of_face
    covered = np.flatnonzero(macro >= 0)
    skin = Faces.join((kind, nodes) for kind, _, nodes in mesh.select(covered))
    for name in slave.names:
        faces = mesh.cells_of(name)
        faces = faces[mesh.cell_dim[faces] == mesh.cell_dim[covered].max()]
        others = [(kind, nodes, cells) for kind, cells, nodes in mesh.select(faces[macro[faces] < 0])]
        left = np.setdiff1d(faces[macro[faces] < 0], find_repeats(skin, others, mesh.n_nodes).cell)
        if len(left) or not len(faces):
            message = f"this mesh is cut already (on {', '.join(mesh.zones)}), but not everywhere on {name!r} (cells "
            advice = "cut the original mesh, with every --slave at once"
            raise CutError(f"{message}{mesh.cell_names(left)}); {advice}", mesh.cell_number[left])
    return cut


def find_macros(mesh: Mesh, slave: SlaveSkin) -> RecognisedCut:
    """Recognise the macro-elements in some slave faces; none shares a face with another one."""
    cells, faces = slave.cells[slave.first], slave.faces
    families = list(_families(mesh, faces, mesh.places_in_file(cells)))
    count = np.bincount(np.concatenate([family.parts.ravel() for family in families]), minlength=len(faces))
    families = [family.take((count[family.parts] == 1).all(axis=1)) for family in families]
    covered = mask_of(len(faces), *(family.parts for family in families))
    present = tuple(family for family in families if len(family.parts))
    return RecognisedCut(slave.names, cells, slave.zone[slave.first], present, np.flatnonzero(~covered))


def as_cut(mesh: Mesh, recognised: RecognisedCut) -> Cut:
    """Return the recognised macro-elements as a cut, in which no cell is known to replace another."""
    first = np.concatenate([family.parts[:, 0] for family in recognised.families])
    order = np.lexsort((recognised.cells[first], recognised.zone[first]))
    number = places_of(order, len(order), np.int32)
    macro, zone, child = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    internal = np.full(mesh.n_nodes, -1, np.int32)
    for family in recognised.families:
        ids, number = np.split(number, [len(family.parts)])
        cells = recognised.cells[family.parts]
        macro[cells], zone[cells] = ids[:, None], recognised.zone[family.parts[:, :1]]
        child[cells] = np.arange(1, cells.shape[1] + 1)
        if family.kind == WHOLE:
            carriers = np.array([WHOLE_FACES[family.face]])
        else:
            carriers = CELLS[family.face].n_nodes + internal_points(family.face, family.kind, family.ring)
        internal[family.frame[:, carriers]] = ids[:, None]
    records = dict(zip(CELL_RECORDS, (macro, zone, child), strict=False))
    origin = Origin(np.arange(mesh.n_cells), np.arange(mesh.n_nodes), np.empty(0, np.int64))
    return Cut(with_records(mesh, records, internal, recognised.names), origin)


def _families(mesh: Mesh, faces: Faces, place: Ints) -> Iterator[MacroGroup]:
    """Yield the macro-elements among distinct faces, by pattern; `place` (f,): the place of each face in the file."""
    for face in WHOLE_FACES:
        rows = np.flatnonzero(faces.type == TYPE_CODE[face])
        yield MacroGroup(face, WHOLE, rows[:, None], faces.nodes[rows][:, : CELLS[face].n_nodes])
    yield from _segments(mesh, faces)
    across = neighbours(faces)
    for face, kind in _PATTERNS:
        family = _walked(faces, across, face, kind)
        around = family.parts[:, : CELLS[face].n_corners]
        family = family.take(place[around].argmin(axis=1) == 0)  # E1 is the first in the file
        yield _in_place(mesh, family)


def _walked(faces: Faces, across: Ints, face: str, kind: str) -> MacroGroup:
    """Return the faces that fit into the frame of a pattern, each macro-element once for every face it may start with.

    Each face is tried as the first child; the others follow across their common edges. `across`: `neighbours`.
    """
    children = face_pattern(face, kind).children[0]
    places = children.nodes[np.argsort(children.rank)]
    n, width = CELLS[children.type].n_corners, len(places[0])
    rows, start = np.nonzero((faces.type == TYPE_CODE[children.type])[:, None] & np.ones(n, bool))
    parts, starts = rows[:, None], start[:, None]
    frame = np.full((len(rows), int(places.max()) + 1), -1, np.int64)
    frame[:, places[0]] = _listed(faces.nodes[rows], start, n, width)
    edges: dict[tuple[int, int], tuple[int, int]] = {}  # (from, to): the child that lists it so, and its place there
    for c, corners in enumerate(places[:, :n].tolist()):
        if c:
            j, (p, i) = next((j, edges[e]) for j in range(n) if (e := (corners[(j + 1) % n], corners[j])) in edges)
            row = across[parts[:, p], (starts[:, p] + i) % n]
            start = ((faces.nodes[row, :n] == frame[:, corners[j]][:, None]).argmax(axis=1) - j) % n
            nodes = _listed(faces.nodes[row], start, n, width)
            known = frame[:, places[c]]
            fits = (row >= 0) & (faces.type[row] == TYPE_CODE[children.type])
            fits &= ((known == nodes) | (known < 0)).all(axis=1)
            frame[:, places[c]] = nodes
            parts, starts = np.column_stack([parts, row])[fits], np.column_stack([starts, start])[fits]
            frame = frame[fits]
        edges |= {(corners[i], corners[(i + 1) % n]): (c, i) for i in range(n)}
    return MacroGroup(face, kind, parts, frame)


def _listed(nodes: Ints, start: Ints, n: int, width: int) -> Ints:
    """List the nodes of faces (m, 9) with n corners from another corner, `start` (m,), and their mid-nodes likewise."""
    turned = (start[:, None] + np.arange(n)) % n
    return np.take_along_axis(nodes, np.hstack([turned, turned + n])[:, :width], axis=1)


def _in_place(mesh: Mesh, family: MacroGroup) -> MacroGroup:
    """Keep the macro-elements whose new nodes lie where the pattern puts them on the map of the outline."""
    cell = CELLS[family.face]
    x = mesh.points[family.frame]
    if family.kind == RING:  # one half-width for the whole cut: the median of inner over outer diagonal or length
        far, inner = cell.n_corners // 2, x[:, cell.n_nodes :]
        outer = x[:, far] - x[:, 0]
        size = (outer * outer).sum(axis=1)
        ratio = ((inner[:, far] - inner[:, 0]) * outer).sum(axis=1) / np.where(size > 0, size, np.inf)
        half = float(np.median(ratio)) if len(ratio) else _THIRD
        family = replace(family, ring=_THIRD if not 0 < half < 1 or abs(half - _THIRD) < 1e-3 else round(half, 9))
    at = face_pattern(family.face, family.kind, family.ring).on_face
    expected = np.einsum("pn,mnd->mpd", shape(family.face, at), x[:, : cell.n_nodes])
    outline = x[:, : cell.n_corners]
    size = np.linalg.norm(outline.max(axis=1) - outline.min(axis=1), axis=1)
    off = np.linalg.norm(x[:, cell.n_nodes :] - expected, axis=2).max(axis=1, initial=0)
    return family.take(off <= PLACE * size)


# ---- segments: two behind which a cut leaves triangles, or three behind which it leaves quadrangles


def _segments(mesh: Mesh, faces: Faces) -> list[MacroGroup]:
    """Recognise the macro-elements among SEG2: of each straight chain, the first two or three segments, and so on."""
    rows = np.flatnonzero(faces.type == TYPE_CODE["SEG2"])
    if not len(rows):
        return []
    segments = faces.take(rows)
    start, stop = segments.nodes[:, :2].T
    owners = find_owners(segments, cells_of_dim(mesh, 2), mesh.n_nodes)
    quad = mesh.of_type(owners.cell, ["QUAD4"])
    behind, quads = (np.bincount(of, minlength=len(rows)) for of in (owners.face, owners.face[quad]))
    size = np.where((behind > 0) & (quads == behind), 3, 2)
    way = mesh.points[stop] - mesh.points[start]
    way /= np.maximum(np.linalg.norm(way, axis=1), 1e-300)[:, None]
    passed = (np.bincount(start, minlength=mesh.n_nodes) == 1) & (np.bincount(stop, minlength=mesh.n_nodes) == 1)
    following = np.where(passed[stop], places_of(start, mesh.n_nodes)[stop], -1)
    alike = (size[following] == size) & (behind[following] == behind)
    following[~alike | (np.linalg.norm(way[following] - way, axis=1) > _TURN)] = -1
    chains = np.column_stack([np.arange(len(rows)), following, following[following]])
    chains[following < 0, 2] = -1
    first = np.zeros(len(rows), bool)
    after, sizes = following.tolist(), size.tolist()
    for segment in np.setdiff1d(np.arange(len(rows)), following).tolist():  # the heads of chains
        place = 0
        while segment >= 0:
            first[segment] = place % sizes[segment] == 0
            segment, place = after[segment], place + 1
    pairs, triples = chains[first & (size == 2), :2], chains[first & (size == 3)]
    pairs, triples = (parts[(parts >= 0).all(axis=1)] for parts in (pairs, triples))
    frame = np.column_stack([start[pairs[:, 0]], stop[pairs[:, 1]], stop[pairs[:, 0]]])
    cones = _in_place(mesh, MacroGroup("SEG2", CONE, pairs, frame))
    frame = np.column_stack([start[triples[:, 0]], stop[triples[:, 2]], stop[triples[:, :2]]])
    rings = _in_place(mesh, MacroGroup("SEG2", RING, triples, frame))
    cones, rings = _with_children(mesh, cones, behind[cones.parts[:, 0]], rings, owners)
    return [replace(family, parts=rows[family.parts]) for family in (cones, rings)]


def _with_children(
    mesh: Mesh, cones: MacroGroup, behind: Ints, rings: MacroGroup, owners: FaceIncidence
) -> tuple[MacroGroup, MacroGroup]:
    """Keep the macro-elements with the cells of a cut behind them; `behind`: the number of cells behind each cone.

    The new node of a cone has two triangles on each side, three in a quadrangle, which a cut divides so at an interface
    or beside another cut. The two new nodes in a quadrangle behind a ring have three cells. Each new node nearby, of a
    later cut of the same cell, adds one.
    """
    parts = [(kind, nodes, cells) for kind, nodes, cells in cells_of_dim(mesh, 2) if kind in TYPE_CODE]
    corners = Faces.join((kind, nodes) for kind, nodes, _ in parts).corners
    place = places_of(concatenated(cells for *_, cells in parts), mesh.n_cells)
    ring = places_of(rings.parts[:, 1], int(max(rings.parts.max(initial=0), owners.face.max(initial=0))) + 1)
    ring = ring[owners.face]
    plugs, ring = corners[place[owners.cell[ring >= 0]]], ring[ring >= 0]
    on_face = (plugs[:, :, None] == rings.frame[ring, None, 2:]).any(axis=2)
    node = np.concatenate([cones.frame[:, 2], plugs[~on_face]])
    macro = np.concatenate([np.arange(len(behind)), len(behind) + np.repeat(ring, 2)])
    least = np.concatenate([2 * behind, np.full(2 * len(ring), 3)])
    count = np.bincount(corners[corners >= 0], minlength=mesh.n_nodes)[node]
    label = np.full(mesh.n_nodes + 1, -1)  # one more, for the padding's -1
    label[node] = macro
    edges, _ = distinct_edges(corners[(label[corners] >= 0).sum(axis=1) > 1])
    one, other = label[edges.T]
    nearby = np.bincount(edges[(one >= 0) & (other >= 0) & (one != other)].ravel(), minlength=mesh.n_nodes)[node]
    most = least + np.where((macro < len(behind)) & ((least == 4) | (nearby > 0)), least // 2, 0)
    good = (count >= least) & (count - nearby <= most) & (np.bincount(node)[node] == 1)
    wrong = mask_of(len(behind) + len(rings.parts), macro[~good & (least > 0)])
    return cones.take(~wrong[: len(behind)]), rings.take(~wrong[len(behind) :])
