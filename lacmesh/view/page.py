"""A page that shows a mesh in a browser, offline: one file, with the faces in sight and a small viewer.

The template and the viewer are in `web/`. The arrays go into the page as one block, deflated and in
base64; the viewer bends curved faces itself, with the shape functions that the page brings along.
"""

from __future__ import annotations

import base64
import html
import json
import os
import re
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import RequestError
from lacmesh.formats.output import replace_file
from lacmesh.mesh import Floats, Ints, Mesh, MeshLike, as_mesh, mask_of
from lacmesh.reference.shapes import shape
from lacmesh.scene import colours, legend_of, title_of
from lacmesh.scene.edges import body_edges, group_edges, group_ends, segments
from lacmesh.scene.layers import curved_parts, grid
from lacmesh.scene.marks import MarkedFinding, Marks, Values, find_marks
from lacmesh.scene.placing import ExplodedView, arrange, find_exploded_view, find_eye
from lacmesh.scene.request import Placing
from lacmesh.scene.visible import (
    BODY,
    SLAVE,
    Groups,
    Vector,
    VisibleSurface,
    as_faces,
    diagonal,
    find_visible,
    names_of_bodies,
)
from lacmesh.topology.skin import FACE_TYPES, N_NODES, Faces, label_faces

#: the role of a face that a finding names, after BODY, SLAVE, MASTER
MARK = 3
#: kinds of lines, in the order that the viewer knows
PLAIN, CREASE, INNER, OUTLINE, BORDER, SEGMENT = range(6)
#: cells with the worst values that the page lists; cells that a finding shows at most
WORST, MOST = 12, 20_000
SCRIPTS = ("data.js", "graphics.js", "panel.js")

PageArrays = dict[str, NDArray]


class Moment(NamedTuple):
    """A time that a page shows: it in `words`, the mesh's `points` (n_nodes, 3), and the values of its cells."""

    words: str
    points: Floats
    values: Floats


def page(
    mesh: MeshLike,
    path: str | os.PathLike[str],
    *,
    slave: Groups = None,
    master: Groups = None,
    findings: Iterable[MarkedFinding] | None = None,
    values: Values | None = None,
    camera: Vector | None = None,
    explode: float | None = None,
    near: float | None = None,
    cutaway: Vector | None = None,
    bodies: str | None = None,
    title: str | None = None,
) -> None:
    """Write a page that shows a mesh and opens without a network; the options are those of `picture`.

    Raises RequestError, GroupNotFoundError, DataError, WriteError.
    """
    path = Path(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise RequestError(f"{path}: a page is written as .html")
    text = page_text(
        as_mesh(mesh), slave=slave, master=master, findings=findings, values=values,
        camera=camera, explode=explode, near=near, cutaway=cutaway, bodies=bodies, title=title,
    )  # fmt: skip
    replace_file(path, text.encode("utf-8", "replace"))


def page_text(
    mesh: Mesh,
    *,
    slave: Groups = None,
    master: Groups = None,
    findings: Iterable[MarkedFinding] | None = None,
    values: Values | None = None,
    moments: Sequence[Moment] = (),
    title: str | None = None,
    **options: Any,
) -> str:
    """Return the text of a page; the `options` are those of `page`.

    `moments`: several times, with a slider between them, the last of which is shown first; `values` then has the scale
    of all, and the values of the last. Raises RequestError, GroupNotFoundError, DataError.
    """
    placing = Placing(**options)
    visible = find_visible(mesh, slave, master, near=placing.near, cutaway=placing.cutaway)
    marks = find_marks(mesh, [*(findings or ()), *_worst(mesh, values)], visible.kept)
    head, arrays = _content(mesh, visible, marks, values, moments)
    eye = find_eye(mesh, visible, placing.camera)
    view, shown = arrange(mesh, visible, eye, replace(placing, tilt=0.0) if placing.explode == 0 else placing)
    head |= _placing(visible, head, eye, view or find_exploded_view(mesh, visible, eye)) | {"opened": view is not None}
    head |= {"title": title or title_of(mesh), "checked": findings is not None, "bodiesAs": shown}
    return _filled(head, arrays)


class _Worst:
    """A cell of the worst values, listed as findings are."""

    nodes = ()

    def __init__(self, cell: int, message: str) -> None:
        self.severity, self.cells, self.message = "worst", (cell,), message


def _worst(mesh: Mesh, values: Values | None) -> list[Any]:
    if values is None:
        return []
    cells = values.worst(WORST)
    return [_Worst(int(mesh.cell_number[c]), f"cell {mesh.cell_number[c]}\t{values.values[c]:.4g}") for c in cells]


def _content(
    mesh: Mesh, visible: VisibleSurface, marks: Marks, values: Values | None, moments: Sequence[Moment]
) -> tuple[dict[str, Any], PageArrays]:
    """Data of the page: a head of names and small tables, and the arrays."""
    shown = _limited(marks)
    faces = Faces.stack([visible.faces, marks.faces.take(shown)])
    cell = np.append(visible.cell, marks.cell[shown])
    slaves = visible.rows(SLAVE)
    ends = group_ends(visible.faces.take(slaves), visible.macro[slaves])
    used, place = _numbering(mesh, (faces.nodes, visible.internal, ends, marks.nodes))
    box = np.concatenate([mesh.points[used], *(moment.points[used] for moment in moments)])
    centre, half = (box.min(axis=0) + box.max(axis=0)) / 2, diagonal(box) / 2 or 1.0
    names, bodies = np.unique(visible.body_of_node[used], return_inverse=True)
    named = names_of_bodies(mesh, visible)
    combination, combinations = _group_sets(mesh, visible, cell)
    edges, kind, face = _edges(mesh, visible, marks, shown)
    arrays: PageArrays = {
        "points": ((mesh.points[used] - centre) / half).astype(np.float32),
        "nodeNumber": _numbers(mesh.node_number[used]),
        "nodeBody": bodies.astype(np.int32),
        **_face_arrays(mesh, visible, faces, place, cell, marks.of[shown]),
        "groups": combination.astype(np.int32),
        "edges": np.where(edges < 0, -1, place[edges]).astype(np.int32),
        "edgeKind": kind.astype(np.uint8),
        "edgeFace": face.astype(np.int32),
        "internal": place[visible.internal].astype(np.int32),
        "ends": place[ends].astype(np.int32),
        "markNodes": place[marks.nodes].astype(np.int32),
        "markOf": marks.node_of.astype(np.int32),
    }
    head = _head(mesh, visible, marks, faces) | {
        **{"centre": centre.tolist(), "half": half},
        **{"nBodies": len(names), "bodies": names.tolist(), "combinations": combinations},
        "bodyNames": [named.get(body, "") for body in names.tolist()],
    }
    if values is not None:
        own = np.append(values.of(visible), values.values[marks.cell[shown]])
        arrays["value"] = own.astype(np.float32)
        arrays["invalid"] = values.invalid[cell].astype(np.uint8)
        head["values"] = {"what": values.what, "bad": values.bad, "good": values.good, "onSkin": values.on_skin}
        head["colours"]["ramp"] = values.ramp
        none = np.full(len(shown), np.nan)
        each = [np.append(replace(values, values=moment.values).of(visible), none) for moment in moments]
        arrays["momentValues"] = np.concatenate([none[:0], *each]).astype(np.float32)
    head["moments"] = [moment.words for moment in moments]
    x = np.stack([moment.points[used] for moment in moments]) if moments else np.empty((0, 0, 3))
    arrays["momentPoints"] = ((x - centre) / half).astype(np.float32).ravel()
    return head, arrays


def _numbering(mesh: Mesh, lists: Iterable[Ints]) -> tuple[NDArray[np.bool_], Ints]:
    """True for nodes (n_nodes,) that stand in lists, whose -1 are none; the index of each among these."""
    used = mask_of(mesh.n_nodes + 1, *lists)
    used[-1] = False
    return used[:-1], np.cumsum(used) - 1


def _face_arrays(
    mesh: Mesh, visible: VisibleSurface, faces: Faces, place: Ints, cell: Ints, finding: Ints
) -> PageArrays:
    """Arrays with a row for each face: those in sight, then those that the findings (m,) name."""
    none = np.full(len(finding), -1)
    slaves = visible.rows(SLAVE)
    paint = np.zeros(len(faces), np.uint8)
    paint[slaves] = colours.paint(visible.macro[slaves], visible.faces.corners[slaves])
    skin = np.where(visible.skin < 0, -1, mesh.cell_number[visible.skin])
    own = np.arange(faces.nodes.shape[1]) < N_NODES[faces.type][:, None]
    return {
        "type": faces.type.astype(np.uint8),
        "nodes": place[faces.nodes[own]].astype(np.int32),
        "role": np.append(visible.role, np.full(len(finding), MARK)).astype(np.uint8),
        "of": np.append(np.full(len(visible.faces), -1), finding).astype(np.int32),
        "macro": np.append(visible.macro, none).astype(np.int32),
        "paint": paint,
        "cutOpen": np.append(visible.cut_open, np.zeros(len(finding), bool)).astype(np.uint8),
        "cell": _numbers(mesh.cell_number[cell]),
        "cellType": (np.searchsorted(mesh.offsets, cell, side="right") - 1).astype(np.uint8),
        "skin": _numbers(np.append(skin, none)),
    }


def _head(mesh: Mesh, visible: VisibleSurface, marks: Marks, faces: Faces) -> dict[str, Any]:
    """Names and small tables: types, groups, findings, colours."""
    return {
        "counts": title_of(mesh),
        "plane": mesh.space_dim == 2,
        "faceTypes": _face_types(faces),
        "cellTypes": [b.type for b in mesh.blocks],
        "cut": len(visible.internal) > 0,
        "groups": [{"name": g, "dim": mesh.group_dim(g), "cells": len(ids)} for g, ids in mesh.cell_groups.items()],
        "findings": [{"severity": s, "message": m} for s, m in zip(marks.severity, marks.message, strict=True)],
        "legend": [entry.words for entry in legend_of(visible)],
        "colours": {
            "palette": colours.PALETTE, "bodies": colours.BODIES, "inside": colours.INSIDE, "master": colours.MASTER,
            "dot": colours.DOT, "ramp": colours.RAMP, "invalid": colours.INVALID, **colours.SEVERITIES,
        },
    }  # fmt: skip


def _limited(marks: Marks) -> Ints:
    """Rows of the marks' faces that are shown: at most MOST for each finding."""
    start = np.searchsorted(marks.of, np.arange(len(marks) + 1))
    return np.flatnonzero(np.arange(len(marks.of)) - start[marks.of] < MOST)


def _edges(mesh: Mesh, visible: VisibleSurface, marks: Marks, shown: Ints) -> tuple[Ints, Ints, Ints]:
    """Lines: ends and mid-node (e, 3), kind, and for a face that is a segment its row (-1 elsewhere)."""
    plain, sharp = body_edges(mesh.points, visible.faces.take(visible.rows(BODY)))
    skin = np.flatnonzero(visible.role != BODY)
    group = np.where(visible.role[skin] == SLAVE, visible.macro[skin] + 1, 0)
    inner, outline = group_edges(visible.faces.take(skin), group)
    lines, rows = segments(visible.faces)
    marked, marked_rows = segments(marks.faces.take(shown))
    border = group_edges(visible.faces.take(skin), visible.role[skin])[1]
    parts = (plain, sharp, inner, outline, border, np.vstack([lines, marked]))
    kind = np.repeat([PLAIN, CREASE, INNER, OUTLINE, BORDER, SEGMENT], [len(p) for p in parts])
    face = np.full(len(kind), -1)
    face[kind == SEGMENT] = np.concatenate([rows, marked_rows + len(visible.faces)])
    return np.vstack(parts), kind, face


def _face_types(faces: Faces) -> dict[int, dict[str, Any]]:
    """Types of faces and curved edges: the nodes of each, and its drawing (weights of these at points, triangles)."""
    parts, types = curved_parts(faces), {}
    for code in dict.fromkeys([*np.unique(faces.type).tolist(), FACE_TYPES.index("SEG3")]):
        name = FACE_TYPES[code]
        if CELLS[name].dim == 1:
            X = np.linspace(-1, 1, (parts if CELLS[name].order == 2 else 1) + 1)[:, None]
            triangles = np.empty((0, 3), int)
        else:
            X, triangles = grid(name, parts)
        weights = np.round(shape(name, X), 9).tolist()
        types[code] = {"name": name, "nodes": int(N_NODES[code]), "weights": weights, "triangles": triangles.tolist()}
    return types


def _group_sets(mesh: Mesh, visible: VisibleSurface, cell: Ints) -> tuple[Ints, list[list[int]]]:
    """Index of each face's set of groups, and the list of these sets.

    A face is in the groups of the cell behind it, and of every cell of its own dimension that lies on it.
    """
    names = list(mesh.cell_groups)
    rows, cells = _on_faces(mesh, visible)
    rows, cells = np.append(np.arange(len(cell)), rows), np.append(cell, cells)
    weight = np.random.default_rng(3).integers(1, 1 << 63, len(names), np.uint64)
    signature = np.zeros(len(cell), np.uint64)
    for k, name in enumerate(names):
        inside = mask_of(mesh.n_cells, mesh.cell_groups[name])
        signature[np.unique(rows[inside[cells]])] += weight[k]
    _, first, combination = np.unique(signature, return_index=True, return_inverse=True)
    order = np.argsort(rows, kind="stable")
    start, end = np.searchsorted(rows[order], first), np.searchsorted(rows[order], first, side="right")
    sets: list[list[int]] = [[] for _ in first]
    for k, name in enumerate(names):
        inside = mask_of(mesh.n_cells, mesh.cell_groups[name])
        for which, (a, b) in enumerate(zip(start, end, strict=True)):
            if inside[cells[order[a:b]]].any():
                sets[which].append(k)
    return combination, sets


def _on_faces(mesh: Mesh, visible: VisibleSurface) -> tuple[Ints, Ints]:
    """Rows of faces in sight, and the cells of lower dimension that lie on them."""
    faces, cells = as_faces(mesh, np.flatnonzero((mesh.cell_dim < mesh.dim) & (mesh.cell_dim > 0)))
    label = label_faces(Faces.stack([visible.faces, faces]))[0]
    mine, theirs = np.split(label, [len(visible.faces)])
    order = np.argsort(mine)
    low, high = (np.searchsorted(mine[order], theirs, side=side) for side in ("left", "right"))
    count = high - low
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return order[np.repeat(low, count) + within], np.repeat(cells, count)


def _placing(visible: VisibleSurface, head: dict[str, Any], eye: Floats, view: ExplodedView | None) -> dict[str, Any]:
    """Direction of the eye, and motion of the bodies with the slave skin that shows it, in the page's own lengths."""
    placed: dict[str, Any] = {"eye": eye.tolist()}
    if view is not None:
        mine = np.searchsorted(head["bodies"], visible.slave_bodies)
        placed["opening"] = {
            "bodies": mine.tolist(),
            "centre": ((view.centre - head["centre"]) / head["half"]).tolist(),
            "axis": view.axis.tolist(),
            "angle": view.angle,
            "shift": (view.shift / head["half"]).tolist(),
        }
    return placed


def _numbers(numbers: Ints) -> NDArray:
    """The file's numbers in four bytes, or as reals where they are too large."""
    return numbers.astype(np.int32 if not len(numbers) or np.abs(numbers).max() < 1 << 31 else np.float64)


def _filled(head: dict[str, Any], arrays: PageArrays) -> str:
    """Text of the page: the template with each of its marks replaced once (what is filled in may look like one)."""
    block, places = _packed(arrays)
    said = json.dumps(head | {"arrays": places}, separators=(",", ":"), allow_nan=False)
    web = files("lacmesh.view") / "web"
    template, style, *script = (
        (web / name).read_text(encoding="utf-8") for name in ("page.html", "page.css", *SCRIPTS)
    )
    parts = {
        "TITLE": html.escape(head["title"]),
        "STYLE": style,
        "HEAD": said.replace("<", "\\u003c"),  # a name with </script> would end the element that holds it
        "BLOCK": base64.b64encode(zlib.compress(block, 6)).decode(),
        "SCRIPT": "".join(script),
    }
    return re.sub("%([A-Z]+)%", lambda mark: parts[mark[1]], template)


def _packed(arrays: PageArrays) -> tuple[bytes, dict[str, tuple[str, int, int]]]:
    """All arrays in one block, little-endian, each at a multiple of 8 bytes: the block, and (type, start, length)."""
    parts, places, start = [], {}, 0
    for name, array in arrays.items():
        content = np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()
        places[name] = (array.dtype.name, start, array.size)
        content += bytes(-len(content) % 8)
        parts.append(content)
        start += len(content)
    return b"".join(parts), places
