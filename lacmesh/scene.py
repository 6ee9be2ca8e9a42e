"""What is drawn of a mesh: the faces in sight, as triangles, lines and dots with their colours, and the camera.

    shown = the faces of bodies and of the slave skin that are in sight     (`_find_shown`)
    points = the bodies moved apart, to show the skin between them          (`_moved`)
    layers = triangles, lines and dots with their colours                   (`_layers`)

Numbers only: `view.py` draws them. Curved faces follow their cells' own shape functions; cells of order 3 and more are
drawn by their corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cut import is_cut
from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.shapes import gradient, shape
from lacmesh.skin import FACE_TYPES, Faces, label_rows

Vector = tuple[float, float, float]

#: colours of macro-elements: close to Paul Tol's light scheme, made for areas side by side
PALETTE = ("77aadd", "ee8866", "eedd88", "ffaabb", "99ddff", "44bb99", "bbcc33", "c3a5d9")
#: colours of bodies, and of what a cutaway lays bare
BODIES, INSIDE = ("eceae4", "dbe1e6", "e6e0ec", "dfe8dc"), "c3c9cf"
INK, CREASE, EDGE, CHILD_EDGE, DOT = "1b1f24", "5c646c", "8a929a", "4a525a", "b3122f"
#: cosine of the angle from which an edge between two faces is a crease
CREASE_COSINE = 0.77
TINY = 1e-300
#: where the eye is by default, and how far from straight on it may see the slave skin, in degrees
OBLIQUE, SEEN_AT = (1.0, -1.6, 0.9), 40.0
#: the part of the picture's height that the mesh may take; words have the rest
LOW, HIGH = 0.11, 0.93
#: parts that an edge of a curved face is drawn in
CURVED = 6


@dataclass(frozen=True)
class Shown:
    """What is seen of a mesh: the faces of its bodies, and its slave faces (segments in a plane mesh).

    `body` (f,) and `slave_body` (s,): the body of each face; `bare` (f,): whether a cutaway laid it bare. `macro` (s,)
    the macro-element of each slave face. `internal` (n,) nodes that carry an internal dof.
    """

    faces: Faces
    body: Ints
    bare: NDArray[np.bool_]
    slaves: Faces
    slave_body: Ints
    macro: Ints
    internal: Ints


@dataclass(frozen=True)
class Layer:
    """Things of one kind to draw: `faces` (triangles), `lines` (pairs) or `dots` (single points).

    `points` (n, 3), `cells` (m, 3, 2 or 1) rows of `points`, `rgb` (n, 3) 0 to 255, `normals` (n, 3) of faces, else
    (0, 3); `width` of a line in thousandths of the picture's height, radius of a dot.
    """

    kind: str
    points: Floats
    cells: Ints
    rgb: NDArray[np.uint8]
    normals: Floats
    width: float


@dataclass(frozen=True)
class Scene:
    """All that is drawn, and `eye` (3,): the direction from it towards the eye. `legend`: (`macro` or `dot`, words)."""

    layers: tuple[Layer, ...]
    eye: Floats
    title: str
    legend: tuple[tuple[str, str], ...]


def make_scene(
    mesh: Mesh,
    slave: str | Sequence[str] | None = None,
    *,
    camera: Vector | None = None,
    explode: float | None = None,
    tilt: float | None = None,
    near: float | None = None,
    cutaway: Vector | None = None,
) -> Scene:
    """What `view.picture` draws; the options are explained there. Raises RequestError, GroupNotFoundError."""
    shown = _find_shown(mesh, _slave_faces(mesh, slave), near, cutaway)
    eye = _eye(mesh, shown, camera)
    points = _moved(mesh, shown, eye, explode, tilt)
    return Scene(tuple(_layers(points, shown)), eye, _title(mesh), _legend(mesh, shown))


def _slave_faces(mesh: Mesh, slave: str | Sequence[str] | None) -> Ints:
    """Indices of the faces to colour: those of the groups, or all of a cut."""
    if slave is None:
        return np.flatnonzero(mesh.cell_data["lac_macro"] >= 0) if is_cut(mesh) else np.empty(0, np.int64)
    specs = [slave] if isinstance(slave, str) else list(slave)
    cells = np.unique(np.concatenate([np.empty(0, np.int64), *(mesh.cells_of(spec) for spec in specs)]))
    dims = mesh.cell_dim[cells]
    return cells[(dims == dims.max(initial=0)) & (dims < 3) & (dims > 0)]


def _find_shown(mesh: Mesh, slave: Ints, near: float | None, cutaway: Vector | None) -> Shown:
    """What is seen of a mesh: facets of one solid only, cells of a surface, and the slave faces."""
    kept = _kept(mesh, slave, near, cutaway)
    solid, facet_of = _facets(mesh)
    cells = np.flatnonzero(mesh.cell_dim == 2)
    surface, surface_cell = _as_faces(mesh, cells[~np.isin(cells, slave)])
    slaves, slave_cell = _as_faces(mesh, slave)
    corners = np.sort(np.vstack([f.corners for f in (solid, surface, slaves)]), axis=1)
    label, count = label_rows(corners)
    on_solid, on_surface, on_slave = np.split(label, np.cumsum([len(solid), len(surface)]))
    owners = np.bincount(on_solid, minlength=count)
    left = np.bincount(on_solid[kept[facet_of]], minlength=count)
    coloured = np.zeros(count, bool)
    coloured[on_slave] = True
    outer = np.flatnonzero(kept[facet_of] & (left[on_solid] == 1) & ~coloured[on_solid])
    loose = np.flatnonzero(kept[surface_cell] & (owners[on_surface] == 0) & ~coloured[on_surface])
    seen = np.flatnonzero(np.where(owners[on_slave] > 0, left[on_slave] > 0, kept[slave_cell]))
    faces = _join(solid.take(outer), surface.take(loose))
    slaves, slave_cell = slaves.take(seen), slave_cell[seen]
    if not len(faces) and not len(slaves):
        raise RequestError("there is nothing to draw: no cells of dimension 2 or 3, or none left in sight")
    body = _bodies(mesh)
    return Shown(
        faces=faces,
        body=body[faces.nodes[:, 0]],
        bare=np.concatenate([owners[on_solid[outer]] > 1, np.zeros(len(loose), bool)]),
        slaves=slaves,
        slave_body=body[slaves.nodes[:, 0]],
        macro=_macros(mesh, slave_cell),
        internal=_internal_nodes(mesh, slaves),
    )


def _kept(mesh: Mesh, slave: Ints, near: float | None, cutaway: Vector | None) -> NDArray[np.bool_]:
    """(n_cells,): whether a cell's centre is near enough and not cut away."""
    kept = np.ones(mesh.n_cells, bool)
    centres = np.concatenate([np.empty((0, 3)), *(mesh.points[b.nodes].mean(axis=1) for b in mesh.blocks)])
    if near is not None:
        from scipy.spatial import cKDTree

        on_skin = np.unique(np.concatenate([np.empty(0, int), *(n.ravel() for _, _, n in mesh.select(slave))]))
        if not len(on_skin):
            raise RequestError("near means near slave faces, and there are none; name them")
        kept &= cKDTree(mesh.points[on_skin]).query(centres)[0] <= near * _diagonal(mesh.points)
    if cutaway is not None and kept.any():
        along = centres @ _unit(cutaway)
        kept &= along <= (along[kept].min() + along[kept].max()) / 2
    return kept


def _facets(mesh: Mesh) -> tuple[Faces, Ints]:
    """Every facet of every solid cell, and the cell that it is of."""
    parts: list[tuple[str, Ints]] = []
    cells: list[Ints] = [np.empty(0, np.int64)]
    for kind, ids, nodes in mesh.select(np.flatnonzero(mesh.cell_dim == 3)):
        for facet in CELLS[_drawn_as(kind)].facets:
            parts.append((facet.type, nodes[:, facet.nodes]))
            cells.append(ids)
    return Faces.join(parts), np.concatenate(cells)


def _as_faces(mesh: Mesh, cells: Ints) -> tuple[Faces, Ints]:
    """Cells of dimension 1 and 2 as faces, and their indices, type by type."""
    chosen = list(mesh.select(cells))
    kinds = [_drawn_as(kind) for kind, _, _ in chosen]
    parts = [(kind, nodes[:, : CELLS[kind].n_nodes]) for kind, (_, _, nodes) in zip(kinds, chosen, strict=True)]
    return Faces.join(parts), np.concatenate([np.empty(0, np.int64), *(ids for _, ids, _ in chosen)])


def _drawn_as(kind: str) -> str:
    """The type that a cell is drawn as: itself, or its corners alone where its order is above 2."""
    return kind if kind in CELLS else ALL_CELLS[kind].linear


def _join(a: Faces, b: Faces) -> Faces:
    return Faces(np.concatenate([a.type, b.type]), np.vstack([a.nodes, b.nodes]))


def _bodies(mesh: Mesh) -> Ints:
    """(n_nodes,): the body of each node; cells of dimension 2 or 3 that share a node are of one body."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    blocks = [b.nodes for b in mesh.blocks if ALL_CELLS[b.type].dim > 1]
    first = np.concatenate([np.empty(0, int), *(np.repeat(n[:, 0], n.shape[1] - 1) for n in blocks)])
    other = np.concatenate([np.empty(0, int), *(n[:, 1:].ravel() for n in blocks)])
    joined = coo_matrix((np.ones(len(first), bool), (first, other)), shape=(mesh.n_nodes, mesh.n_nodes))
    return connected_components(joined, directed=False)[1]


def _macros(mesh: Mesh, slave_cell: Ints) -> Ints:
    """(s,): the macro-element of each slave face; a face that is part of none counts by itself."""
    macro = mesh.cell_data["lac_macro"][slave_cell] if is_cut(mesh) else np.full(len(slave_cell), -1)
    alone = macro < 0
    return np.where(alone, macro.max(initial=-1) + np.cumsum(alone), macro)


def _internal_nodes(mesh: Mesh, slaves: Faces) -> Ints:
    """Nodes of the slave faces that carry an internal dof."""
    owner = mesh.node_data.get("lac_internal")
    nodes = np.unique(slaves.nodes[slaves.nodes >= 0])
    return nodes[owner[nodes] >= 0] if owner is not None else nodes[:0]


def _eye(mesh: Mesh, shown: Shown, camera: Vector | None) -> Floats:
    """(3,): the direction from the mesh towards the eye."""
    if camera is not None:
        return _unit(camera)
    if mesh.space_dim == 2:
        return np.array([0.0, 0.0, 1.0])
    outward = _outward(mesh.points, shown)
    return _unit((0 if _hidden(shown) else outward) + 0.6 * _unit(OBLIQUE))


def _hidden(shown: Shown) -> bool:
    """Whether another body is in sight, which may hide the slave skin."""
    return bool(len(shown.slaves)) and not np.isin(shown.body, shown.slave_body).all()


def _outward(points: Floats, shown: Shown) -> Floats:
    """(3,): the unit normal of the slave skin, on average and out of its bodies; 0 where it looks every way."""
    if not len(shown.slaves):
        return np.zeros(3)
    corners = shown.slaves.corners
    x = points[np.where(corners < 0, corners[:, :1], corners)]
    third = np.where(_is_segment(shown.slaves)[:, None], x[:, 0] + [0.0, 0.0, 1.0], x[:, 2])
    normals = np.cross(x[:, 1] - x[:, 0], third - x[:, 0])
    own = np.isin(shown.body, shown.slave_body)
    inside = points[shown.faces.nodes[own, 0]].mean(axis=0) if own.any() else x[:, 0].mean(axis=0)
    mean = normals.sum(axis=0)
    if np.linalg.norm(mean) < 0.3 * np.linalg.norm(normals, axis=1).sum():
        return np.zeros(3)
    return _unit(mean if mean @ (x[:, 0].mean(axis=0) - inside) >= 0 else -mean)


def _moved(mesh: Mesh, shown: Shown, eye: Floats, explode: float | None, tilt: float | None) -> Floats:
    """The points, those of the bodies that carry slave faces turned by `tilt` and moved off, to show these."""
    points, outward, plane = mesh.points, _outward(mesh.points, shown), mesh.space_dim == 2
    if not outward.any() or not _hidden(shown):
        return points
    if tilt is None:
        tilt = 0.0 if plane else max(0.0, float(np.degrees(np.arccos(np.clip(outward @ eye, -1, 1)))) - SEEN_AT)
    gap = ((0.0 if plane else 0.05) if explode is None else explode) * _diagonal(points)
    if tilt == gap == 0:
        return points
    body = _bodies(mesh)
    mine = np.isin(body, shown.slave_body)
    other = np.isin(body, shown.body) & ~mine
    points = points.copy()
    centre = (points[mine].min(axis=0) + points[mine].max(axis=0)) / 2
    points[mine] = centre + _rotated(
        points[mine] - centre, _unit(eye if plane else np.cross(outward, eye)), np.radians(tilt)
    )
    overlap = (points[mine] @ outward).max() - (points[other] @ outward).min()
    points[mine] -= (overlap + gap) * outward
    return points


def _rotated(x: Floats, axis: Floats, angle: float) -> Floats:
    """Vectors (n, 3) turned about an axis by Rodrigues' formula."""
    along = np.outer(x @ axis, axis)
    return along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(axis, x)


def _unit(v: Any) -> Floats:
    v = np.asarray(v, float)
    length = float(np.linalg.norm(v))
    return v / length if length > 0 else np.zeros(3)


def _diagonal(points: Floats) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0


def _layers(points: Floats, shown: Shown) -> list[Layer]:
    """What is drawn: faces first, then lines, then dots."""
    greys = _rgb(BODIES)[shown.body % len(BODIES)]
    greys[shown.bare] = _rgb((INSIDE,))
    shades = _rgb(PALETTE)[_paint(shown)]
    plain, sharp = _body_edges(points, shown.faces)
    inner, outline = _slave_edges(shown)
    ends, shade = _segments(shown.slaves).nodes[:, :3], shades[_is_segment(shown.slaves)]
    body, skin = _thin(points, shown.faces), _thin(points, shown.slaves)
    layers = [
        _surface(points, shown.faces, greys),
        _surface(points, shown.slaves, shades),
        _lines(points, plain, _rgb((EDGE,)), 1.5 * body),
        _lines(points, sharp, _rgb((CREASE,)), 3.2 * body),
        _lines(points, inner, _rgb((CHILD_EDGE,)), 1.8 * skin),
        _lines(points, outline, _rgb((INK,)), 6.0 * skin),
        _lines(points, ends, shade, 18.0),
    ]
    radius = _dot_radius(points, shown)
    layers += [_dots(points[_macro_ends(shown)], INK, 0.8 * radius), _dots(points[shown.internal], DOT, radius)]
    return [layer for layer in layers if len(layer.cells)]


def _thin(points: Floats, faces: Faces) -> float:
    """A factor for the width of lines, less than 1 where faces are so small that lines would hide them."""
    if not len(faces):
        return 1.0
    ends = points[faces.nodes[:, :2]]
    length = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    return min(1.0, length / (0.03 * _diagonal(points[faces.nodes[:, 0]]) + TINY))


def _is_segment(faces: Faces) -> NDArray[np.bool_]:
    return np.isin(faces.type, [FACE_TYPES.index("SEG2"), FACE_TYPES.index("SEG3")])


def _segments(faces: Faces) -> Faces:
    return faces.take(np.flatnonzero(_is_segment(faces)))


def _rgb(colours: Sequence[str]) -> NDArray[np.uint8]:
    """(n, 3): colours from 0 to 255."""
    return np.array([[int(c[k : k + 2], 16) for k in (0, 2, 4)] for c in colours], np.uint8)


def _paint(shown: Shown) -> Ints:
    """(s,): the place in PALETTE of each slave face: one colour a macro-element, neighbours as different as can be."""
    from scipy.sparse import coo_matrix

    if not len(shown.slaves):
        return np.empty(0, np.int64)
    names, macro = np.unique(shown.macro, return_inverse=True)
    corners = shown.slaves.corners
    face, place = np.nonzero(corners >= 0)
    touch = coo_matrix((np.ones(len(face)), (macro[face], corners[face, place]))).tocsr()
    touch.data[:] = 1
    shared = (touch @ touch.T).tocsr()  # nodes that two macro-elements share
    colour = np.full(len(names), -1)
    used = np.zeros(len(PALETTE))
    for k in range(len(names)):
        near = slice(shared.indptr[k], shared.indptr[k + 1])
        painted = colour[shared.indices[near]]
        clash = np.bincount(painted[painted >= 0], shared.data[near][painted >= 0], minlength=len(PALETTE))
        colour[k] = np.lexsort((used, clash))[0]
        used[colour[k]] += 1
    return colour[macro]


def _edges(faces: Faces) -> tuple[Ints, Ints]:
    """Every edge of every face, (e, 3): its ends and its mid-node or -1; and the row of the face."""
    ends, rows = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for code in np.unique(faces.type):
        cell = CELLS[FACE_TYPES[code]]
        here = np.flatnonzero(faces.type == code)
        for k, (a, b) in enumerate(cell.edges if cell.n_corners > 2 else ()):
            middle = cell.n_corners + k if cell.order == 2 else -1  # a row of `nodes` ends with -1, or QUAD9's centre
            nodes = faces.nodes[here]
            ends.append(np.stack([nodes[:, a], nodes[:, b], nodes[:, middle] if middle > 0 else 0 * here - 1], axis=1))
            rows.append(here)
    return np.vstack(ends), np.concatenate(rows)


def _body_edges(points: Floats, faces: Faces) -> tuple[Ints, Ints]:
    """The edges of bodies, each once: those on smooth ground, and those where the body ends or has a crease."""
    ends, face = _edges(faces)
    label, count = label_rows(np.sort(ends[:, :2], axis=1))
    x = points[faces.nodes[:, :3]]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), TINY)
    order = np.argsort(label, kind="stable")
    first = np.searchsorted(label[order], np.arange(count))
    times = np.bincount(label, minlength=count)
    other = order[np.minimum(first + 1, len(order) - 1)]
    turn = np.abs((normal[face[order[first]]] * normal[face[other]]).sum(axis=1))
    sharp = (times != 2) | (turn < CREASE_COSINE)
    return ends[order[first[~sharp]]], ends[order[first[sharp]]]


def _slave_edges(shown: Shown) -> tuple[Ints, Ints]:
    """The edges of slave faces, each once: those inside a macro-element, and those on its outline."""
    ends, face = _edges(shown.slaves)
    label, count = label_rows(np.sort(ends[:, :2], axis=1))
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(low, label, shown.macro[face])
    np.maximum.at(high, label, shown.macro[face])
    inside = (np.bincount(label, minlength=count) == 2) & (low == high)
    once = np.unique(label, return_index=True)[1]
    return ends[once[inside]], ends[once[~inside]]


def _macro_ends(shown: Shown) -> Ints:
    """Nodes where a macro-element of segments ends."""
    line = np.flatnonzero(_is_segment(shown.slaves))
    nodes = shown.slaves.nodes[line][:, :2]
    pairs = np.stack([nodes.ravel(), np.repeat(shown.macro[line], 2)], axis=1)
    pairs, times = np.unique(pairs, axis=0, return_counts=True)
    return np.unique(pairs[times == 1, 0])


def _dot_radius(points: Floats, shown: Shown) -> float:
    """A radius that suits the picture, and keeps dots apart."""
    from scipy.spatial import cKDTree

    largest = 0.006 * _diagonal(points[np.concatenate([shown.faces.nodes[:, 0], shown.slaves.nodes[:, 0]])])
    x = points[shown.internal]
    if len(x) < 2:
        return largest
    return min(largest, 0.2 * float(np.quantile(cKDTree(x).query(x, k=2)[0][:, 1], 0.25)))


@cache
def _grid(kind: str) -> tuple[NDArray, NDArray]:
    """Reference points and triangles that a face of type `kind` is drawn by."""
    m = CURVED if CELLS[kind].order == 2 else 1
    at = {ij: n for n, ij in enumerate((i, j) for i in range(m + 1) for j in range(m + 1))}
    if CELLS[kind].family == "TRIA":
        at = {ij: n for n, ij in enumerate(ij for ij in at if sum(ij) <= m)}
    squares = [[(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] for i in range(m) for j in range(m)]
    halves = [[s[k] for k in half] for s in squares for half in ((0, 1, 3), (1, 2, 3))]
    triangles = [[at[ij] for ij in half] for half in halves if all(ij in at for ij in half)]
    X = np.array(list(at), float) / m
    return (X if CELLS[kind].family == "TRIA" else 2 * X - 1), np.array(triangles)


def _surface(points: Floats, faces: Faces, rgb: NDArray[np.uint8]) -> Layer:
    """Faces as triangles, curved where their cells are; `rgb` (f, 3)."""
    x, normals, cells, colours = [np.empty((0, 3))], [np.empty((0, 3))], [np.empty((0, 3), int)], [rgb[:0]]
    start = 0
    for code in np.unique(faces.type[~_is_segment(faces)]):
        kind, here = FACE_TYPES[code], np.flatnonzero(faces.type == code)
        X, triangles = _grid(kind)
        corner = points[faces.nodes[here][:, : CELLS[kind].n_nodes]]
        J = np.einsum("fns,pnd->fpds", corner, gradient(kind, X))
        x.append(np.einsum("fns,pn->fps", corner, shape(kind, X)).reshape(-1, 3))
        normals.append(np.cross(J[:, :, 0], J[:, :, 1]).reshape(-1, 3))
        cells.append((start + len(X) * np.arange(len(here))[:, None, None] + triangles).reshape(-1, 3))
        colours.append(np.repeat(rgb[here], len(X), axis=0))
        start += len(X) * len(here)
    n = np.vstack(normals)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), TINY)
    return Layer("faces", np.vstack(x), np.vstack(cells), np.vstack(colours), n, 0.0)


def _lines(points: Floats, ends: Ints, rgb: NDArray[np.uint8], width: float) -> Layer:
    """Edges, (e, 3): ends and mid-node or -1, as short straight pieces; `rgb` (e, 3), or (1, 3) for all."""
    rgb = np.broadcast_to(rgb, (len(ends), 3))
    x, colours = [np.empty((0, 2, 3))], [rgb[:0]]
    for kind, here in (("SEG2", ends[:, 2] < 0), ("SEG3", ends[:, 2] >= 0)):
        m = CURVED if kind == "SEG3" else 1
        N = shape(kind, np.linspace(-1, 1, m + 1)[:, None])
        at = np.einsum("ens,pn->eps", points[ends[here][:, : N.shape[1]]], N)
        x.append(np.stack([at[:, :-1], at[:, 1:]], axis=2).reshape(-1, 2, 3))
        colours.append(np.repeat(rgb[here], m, axis=0))
    pieces = np.concatenate(x)
    pairs = np.arange(2 * len(pieces)).reshape(-1, 2)
    return Layer("lines", pieces.reshape(-1, 3), pairs, np.repeat(np.vstack(colours), 2, axis=0), points[:0], width)


def _dots(x: Floats, colour: str, radius: float) -> Layer:
    return Layer("dots", x, np.arange(len(x))[:, None], np.repeat(_rgb((colour,)), len(x), axis=0), x[:0], radius)


def camera_of(scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    """A camera of parallel rays that looks along -eye, upright, with all in sight and room for the words."""
    upright = np.array([0.0, 1.0, 0.0] if abs(scene.eye[2]) > 0.999 else [0.0, 0.0, 1.0])
    right = _unit(np.cross(upright, scene.eye))
    up = np.cross(scene.eye, right)
    axes = np.stack([right, up, scene.eye], axis=1)
    seen = np.vstack([layer.points for layer in scene.layers]) @ axes
    extent, middle = np.ptp(seen, axis=0), axes @ (seen.min(axis=0) + seen.max(axis=0)) / 2
    half = max(extent[1] / (HIGH - LOW), extent[0] / 0.94 * size[1] / size[0]) / 2
    middle -= (HIGH + LOW - 1) * half * up
    distance = float(np.linalg.norm(extent)) or 1.0
    position = middle + distance * scene.eye
    return {"focal": middle.tolist(), "position": position.tolist(), "up": up.tolist(), "scale": float(half) or 1.0}


def _title(mesh: Mesh) -> str:
    """A line that says what the mesh holds."""
    cells = (f"{count:,} {kind}" for kind, count in mesh.cells_by_type.items() if ALL_CELLS[kind].dim == mesh.dim)
    return f"{mesh.n_nodes:,} nodes, {', '.join(cells)}"


def _legend(mesh: Mesh, shown: Shown) -> tuple[tuple[str, str], ...]:
    """What the colours stand for: (`macro` or `dot`, words)."""
    macros, faces = len(np.unique(shown.macro)), len(shown.slaves)
    if not len(shown.internal):
        return (("macro", f"{faces:,} slave faces"),) if faces else ()
    legend = ("macro", f"{macros:,} macro-elements, made of {faces:,} slave faces")
    return legend, ("dot", f"{len(shown.internal):,} internal nodes: each has a displacement dof of its own")
