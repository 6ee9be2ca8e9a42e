"""Layers of a drawing: faces as triangles, edges as short lines, nodes as dots, each with its colour."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.shapes import gradient, shape
from lacmesh.scene.colours import (
    BODIES,
    CHILD_EDGE,
    CREASE,
    DOT,
    EDGE,
    INK,
    INSIDE,
    MASTER,
    PALETTE,
    SEVERITIES,
    paint,
    pale,
    rgb,
)
from lacmesh.scene.edges import TINY, body_edges, group_edges, group_ends, segments
from lacmesh.scene.marks import Marks, Values
from lacmesh.scene.request import BODIES_AS
from lacmesh.scene.visible import BODY, SLAVE, VisibleSurface, diagonal, is_segment
from lacmesh.scene.visible import MASTER as IS_MASTER
from lacmesh.topology.skin import FACE_TYPES, Faces

#: parts that an edge of a curved face is drawn in: most, and how many pieces may be drawn in all
CURVED, PIECES = 6, 400_000
#: edges that are to be narrower than this part of a line are left out: they would only darken the faces
FAINT = 0.25
#: how much of a marked cell shows through what stands before it
THROUGH = 0.3
#: by how much the lines of skins are narrower where bodies around them are not solid and colours are values
_PALER_LINES = 0.5


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
    opacity: float = 1.0


def make_layers(
    points: Floats,
    visible: VisibleSurface,
    eye: Floats,
    marks: Marks | None = None,
    values: Values | None = None,
    bodies: str = "solid",
) -> tuple[Layer, ...]:
    """Layers in the order of drawing: faces first, then lines, then dots, then the marks of findings.

    `bodies`: one of BODIES_AS; ghosts and hidden ones show the skins behind them.
    """
    marked = marks is not None and marks.wrong
    body, slave, master = (visible.faces.take(visible.rows(role)) for role in (BODY, SLAVE, IS_MASTER))
    colour = _face_colours(visible, marked, values)
    parts = curved_parts(visible.faces)
    layers = [
        _surface(points, faces, colour[visible.rows(role)], parts)
        for role, faces in ((BODY, body), (IS_MASTER, master), (SLAVE, slave))
    ]
    layers[0] = replace(layers[0], opacity=BODIES_AS[bodies])
    layers += _edge_layers(points, visible, parts, bodies, valued=values is not None)
    for faces, role, width in ((body, BODY, 4.0), (master, IS_MASTER, 12.0), (slave, SLAVE, 18.0)):
        ends, rows = segments(faces)
        layers.append(_lines(points, ends, colour[visible.rows(role)][rows], width, parts))
    radius = _dot_radius(points, visible)
    ends = group_ends(slave, visible.macro[visible.rows(SLAVE)])
    layers += [
        _dots(points[ends], INK, 0.8 * radius),
        _dots(points[visible.internal], INK if marked else DOT, radius),
    ]
    if marks is not None:
        layers += _mark_layers(points, visible, eye, marks)
    return tuple(layer for layer in layers if len(layer.cells) and layer.opacity > 0)


def _face_colours(visible: VisibleSurface, marked: bool, values: Values | None) -> NDArray[np.uint8]:
    """Colour of each face in sight, (f, 3)."""
    if values is not None:
        colours = values.colours(visible)
        lines = is_segment(visible.faces) & ~(values.on_skin & (visible.role == SLAVE))
        colours[lines] = rgb((INK,))
        return colours
    colours = rgb(BODIES)[visible.body % len(BODIES)]
    colours[visible.cut_open] = rgb((INSIDE,))
    slaves = visible.rows(SLAVE)
    colours[slaves] = rgb(PALETTE)[paint(visible.macro[slaves], visible.faces.corners[slaves])]
    colours[visible.rows(IS_MASTER)] = rgb((MASTER,))
    colours[(visible.role == BODY) & is_segment(visible.faces)] = rgb((CREASE,))
    return np.where((visible.role != BODY)[:, None], pale(colours), colours) if marked else colours


def _edge_layers(
    points: Floats, visible: VisibleSurface, parts: int, bodies: str, *, valued: bool = False
) -> list[Layer]:
    """Layers of edges; coloured by values, the master's border has the colour of the master."""
    plain, sharp = body_edges(points, visible.faces.take(visible.rows(BODY)))
    skin = np.flatnonzero(visible.role != BODY)
    faces = visible.faces.take(skin)
    # each macro-element is a group of its own, and the master another
    inner, outline = group_edges(faces, np.where(visible.role[skin] == SLAVE, visible.macro[skin] + 1, 0))
    of_role = (visible.faces.take(visible.rows(role)) for role in (IS_MASTER, SLAVE))
    of_master, of_slave = (group_edges(part, np.zeros(len(part), np.int64))[1] for part in of_role)
    wide, narrow = _thin(points, visible.faces.take(visible.rows(BODY))), _thin(points, faces)
    narrow *= 1.0 if bodies == "solid" or not valued else _PALER_LINES
    layers = [
        (plain, EDGE, 1.5 * wide, wide if bodies == "solid" else 0.0),
        (sharp, CREASE, 3.2 * max(wide, 0.5), 0.0 if bodies == "hidden" else 1.0),
        (inner, CHILD_EDGE, 1.8 * narrow, narrow),
        (outline, INK, 6.0 * narrow, narrow),
        (of_master, MASTER if valued else INK, (9.0 if valued else 6.0) * max(narrow, 0.4), 1.0),
        (of_slave, INK, 6.0 * max(narrow, 0.4), 1.0),
    ]
    return [_lines(points, ends, rgb((colour,)), width, parts) for ends, colour, width, thin in layers if thin > FAINT]


def _mark_layers(points: Floats, visible: VisibleSurface, eye: Floats, marks: Marks) -> list[Layer]:
    """Layers of the marks of findings: in front of the faces they lie on, and again, faintly, before everything."""
    size = diagonal(points[visible.faces.nodes[:, 0]])
    step = 2e-3 * size * eye
    colours = rgb([SEVERITIES[s] for s in marks.severity])
    shown = np.flatnonzero(np.array([s != "info" for s in marks.severity])[marks.of])[::-1]  # the worst is drawn last
    faces, colour = marks.faces.take(shown), colours[marks.of[shown]]
    parts = curved_parts(faces)
    solid = _surface(points + step, faces, colour, parts)
    inner, outline = group_edges(faces, marks.cell[shown])
    ends, rows = segments(faces)
    lines = [
        _lines(points + 2 * step, np.vstack([inner, outline]), rgb((INK,)), 2.5 * _thin(points, faces), parts),
        _lines(points + 2 * step, ends, colour[rows], 22.0, parts),
    ]
    ghosts = [replace(layer, points=layer.points + 2 * size * eye, opacity=THROUGH) for layer in (solid, *lines)]
    radius = 1.3 * _dot_radius(points, visible)
    dots = [
        _dots(points[marks.nodes[here]] + 2.1 * size * eye, SEVERITIES[name], radius)
        for name in ("warning", "error")
        if len(here := np.flatnonzero(np.array([s == name for s in marks.severity])[marks.node_of]))
    ]
    return [solid, *lines, *ghosts, *dots]


def _thin(points: Floats, faces: Faces) -> float:
    """A factor for the width of lines, less than 1 where faces are so small that lines would hide them."""
    if not len(faces):
        return 1.0
    ends = points[faces.nodes[:, :2]]
    length = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    return min(1.0, length / (0.03 * diagonal(points[faces.nodes[:, 0]]) + TINY))


def _dot_radius(points: Floats, visible: VisibleSurface) -> float:
    """A radius that suits the picture, and keeps dots apart."""
    from scipy.spatial import cKDTree

    largest = 0.006 * diagonal(points[visible.faces.nodes[:, 0]])
    x = points[visible.internal]
    if len(x) < 2:
        return largest
    return min(largest, 0.2 * float(np.quantile(cKDTree(x).query(x, k=2)[0][:, 1], 0.25)))


def curved_parts(faces: Faces) -> int:
    """Number of straight parts that an edge of a curved face is drawn in: fewer if there are many faces."""
    curved = np.array([CELLS[name].order == 2 for name in FACE_TYPES])[faces.type]
    count = max(1, int(np.count_nonzero(curved)))
    return int(np.clip(np.sqrt(PIECES / 2 / count), 2, CURVED))


@cache
def grid(kind: str, parts: int) -> tuple[NDArray, NDArray]:
    """Reference points (p, 2) and triangles (t, 3) that a face of type `kind` is drawn by."""
    m = parts if CELLS[kind].order == 2 else 1
    at = {ij: n for n, ij in enumerate((i, j) for i in range(m + 1) for j in range(m + 1))}
    if CELLS[kind].family == "TRIA":
        at = {ij: n for n, ij in enumerate(ij for ij in at if sum(ij) <= m)}
    squares = [[(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] for i in range(m) for j in range(m)]
    halves = [[s[k] for k in half] for s in squares for half in ((0, 1, 3), (1, 2, 3))]
    triangles = [[at[ij] for ij in half] for half in halves if all(ij in at for ij in half)]
    X = np.array(list(at), float) / m
    return (X if CELLS[kind].family == "TRIA" else 2 * X - 1), np.array(triangles)


def _surface(points: Floats, faces: Faces, colour: NDArray[np.uint8], parts: int) -> Layer:
    """Faces as triangles, curved where their cells are; `colour` (f, 3). Segments are left out."""
    x, normals, cells, colours = [np.empty((0, 3))], [np.empty((0, 3))], [np.empty((0, 3), int)], [colour[:0]]
    start = 0
    for code in np.unique(faces.type[~is_segment(faces)]):
        kind, here = FACE_TYPES[code], np.flatnonzero(faces.type == code)
        X, triangles = grid(kind, parts)
        corner = points[faces.nodes[here][:, : CELLS[kind].n_nodes]]
        J = np.einsum("fns,pnd->fpds", corner, gradient(kind, X))
        x.append(np.einsum("fns,pn->fps", corner, shape(kind, X)).reshape(-1, 3))
        normals.append(np.cross(J[:, :, 0], J[:, :, 1]).reshape(-1, 3))
        cells.append((start + len(X) * np.arange(len(here))[:, None, None] + triangles).reshape(-1, 3))
        colours.append(np.repeat(colour[here], len(X), axis=0))
        start += len(X) * len(here)
    n = np.vstack(normals)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), TINY)
    return Layer("faces", np.vstack(x), np.vstack(cells), np.vstack(colours), n, 0.0)


def _lines(points: Floats, ends: Ints, colour: NDArray[np.uint8], width: float, parts: int) -> Layer:
    """Edges, (e, 3): ends and mid-node or -1, as short straight pieces; `colour` (e, 3), or (1, 3) for all."""
    colour = np.broadcast_to(colour, (len(ends), 3))
    x, colours = [np.empty((0, 2, 3))], [colour[:0]]
    for kind, here in (("SEG2", ends[:, 2] < 0), ("SEG3", ends[:, 2] >= 0)):
        m = parts if kind == "SEG3" else 1
        N = shape(kind, np.linspace(-1, 1, m + 1)[:, None])
        at = np.einsum("ens,pn->eps", points[ends[here][:, : N.shape[1]]], N)
        x.append(np.stack([at[:, :-1], at[:, 1:]], axis=2).reshape(-1, 2, 3))
        colours.append(np.repeat(colour[here], m, axis=0))
    pieces = np.concatenate(x)
    pairs = np.arange(2 * len(pieces)).reshape(-1, 2)
    return Layer("lines", pieces.reshape(-1, 3), pairs, np.repeat(np.vstack(colours), 2, axis=0), points[:0], width)


def _dots(x: Floats, colour: str, radius: float) -> Layer:
    return Layer("dots", x, np.arange(len(x))[:, None], np.repeat(rgb((colour,)), len(x), axis=0), x[:0], radius)
