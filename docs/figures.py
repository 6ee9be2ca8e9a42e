"""Drawings of every pattern of the cut: the new nodes in their parent, and the children moved apart; an overview.

Cells are shown with the slave face on top, their edges all as long. Children are painted from back to front.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from tables import Pattern, children_text, in_order, patterns, points_of

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import CONE, RING, WHOLE

FIGURES = Path(__file__).parent / "figures"
#: sizes of ideal cells, and by family and corners of the slave face a turn about the vertical, for a better view
SIZES = {"TRIA": 1.15, "TETRA": 1.4, "PYRAM": 1.15, "PENTA": 1.1}
TURNS = {("TETRA", 3): 15.0, ("PENTA", 3): 35.0, ("PENTA", 4): -30.0, ("PYRAM", 3): -5.0}
OVERVIEW = "patterns.svg"
COLOURS = ("#9db8d2", "#e3bd93", "#aecba3", "#d8a9ab", "#bcb0d4", "#d3c795")
INK, FAINT, SLAVE, INSIDE = "#30343a", "#9aa0a8", "#b3262e", "#1f5f99"
_AZIMUTH, _ELEVATION = np.radians([-62.0, 30.0])
EYE = np.array([np.cos(_ELEVATION) * np.cos(_AZIMUTH), np.cos(_ELEVATION) * np.sin(_AZIMUTH), np.sin(_ELEVATION)])
_RIGHT = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
_PLANE = np.stack([_RIGHT, np.cross(EYE, _RIGHT)])
_LIGHT = np.array([0.15, -0.55, 0.82]) / np.linalg.norm([0.15, -0.55, 0.82])
#: the patterns of the overview
SHOWN = (
    *(("TRIA3", "SEG2", CONE), ("QUAD4", "SEG2", RING), ("TETRA4", "TRIA3", CONE), ("TETRA10", "TRIA6", CONE)),
    *(("HEXA8", "QUAD4", CONE), ("HEXA8", "QUAD4", RING), ("PENTA6", "TRIA3", CONE), ("PENTA6", "QUAD4", CONE)),
    *(("PYRAM5", "QUAD4", CONE), ("PYRAM5", "TRIA3", CONE)),
)


def figures() -> dict[str, list[Pattern]]:
    """File name -> the patterns that it shows."""
    every = {(p.cell, p.face, p.kind): p for p in patterns()}
    return {OVERVIEW: [every[key] for key in SHOWN], **{p.figure: [p] for p in every.values()}}


def digest(of: list[Pattern]) -> str:
    """A short hash of all that a figure depends on: its patterns, and the code that draws them."""
    described = [[p, points_of(p).round(6).tolist(), sorted(p.carriers)] for p in of]
    children = [[kind, nodes.tolist()] for p in of for kind, nodes in in_order(p.volume)]
    code = Path(__file__).read_text(encoding="utf-8")
    return hashlib.sha256(f"{json.dumps([described, children])}{code}".encode()).hexdigest()[:16]


def stale() -> list[str]:
    """Figures that are absent, out of date, or of no pattern."""
    there = {path.name: path.read_text(encoding="utf-8") for path in FIGURES.glob("*.svg")}
    wanted = figures()
    return [name for name, of in wanted.items() if digest(of) not in there.get(name, "")] + sorted({*there} - {*wanted})


def upright(p: Pattern) -> np.ndarray:
    """The points of a pattern, turned so that the slave facet looks up (in the plane: along y)."""
    cell, points = CELLS[p.cell], points_of(p)
    facet = points[[n for n in cell.facets[p.facet].nodes if n < cell.n_corners]]
    middle = points[: cell.n_corners].mean(axis=0)
    along = (facet[1] - facet[0]) / np.linalg.norm(facet[1] - facet[0])
    up = np.cross(along, [0.0, 0.0, 1.0]) if cell.dim == 2 else np.cross(facet[1] - facet[0], facet[2] - facet[1])
    up = up / np.linalg.norm(up) * (1 if (facet.mean(axis=0) - middle) @ up > 0 else -1)
    frame = [along, up, [0, 0, 1]] if cell.dim == 2 else [along, np.cross(up, along), up]
    angle = np.radians(TURNS.get((cell.family, len(facet)), 0.0))
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return SIZES.get(cell.family, 1.0) * (points - middle) @ np.array(frame).T @ turn.T


def faces_of(kind: str, x: np.ndarray) -> list[tuple[list[int], np.ndarray]]:
    """The faces of a cell that are turned to the eye, by their corners, with their normals."""
    cell = CELLS[kind]
    if cell.dim == 2:
        return [(list(range(cell.n_corners)), _LIGHT)]
    found = []
    for facet in cell.facets:
        corners = [n for n in facet.nodes if n < cell.n_corners]
        normal = np.cross(x[corners[1]] - x[corners[0]], x[corners[2]] - x[corners[1]])
        if normal @ EYE > 1e-9:
            found.append((corners, normal / np.linalg.norm(normal)))
    return found


def on_page(x: np.ndarray, flat: bool) -> np.ndarray:
    """(n, 2): points on the page."""
    return x[:, :2] if flat else x @ _PLANE.T


def draw_children(axes: Any, p: Pattern, shift: np.ndarray) -> None:
    """The children of a pattern, moved apart: red the slave face and its new nodes, blue new nodes inside."""
    cell, x = CELLS[p.cell], upright(p)
    flat, top = cell.dim == 2, x[: cell.n_corners].max(axis=0)[1 if cell.dim == 2 else 2]
    apart = np.array([0.45, 0.45, 0.0] if flat else [0.85, 0.85, 1.7])
    children = [(kind, n, x[n[: CELLS[kind].n_corners]].mean(axis=0)) for kind, n in in_order(p.volume)]
    order = sorted(range(len(children)), key=lambda k: round(float(children[k][2] * (1 + apart) @ EYE), 6))
    for z, k in enumerate(order):
        kind, nodes, middle = children[k]
        moved = x[nodes] + middle * apart
        at, colour = on_page(moved, flat) + shift, COLOURS[k % len(COLOURS)]
        faces = sorted(faces_of(kind, moved), key=lambda face: face[1] @ (0, 0, 1))  # the slave face last
        for corners, normal in faces:
            rgb = np.array([int(colour[c : c + 2], 16) for c in (1, 3, 5)]) / 255
            bright = 1.0 if flat else 0.80 + 0.30 * max(float(normal @ _LIGHT), 0.0)
            axes.fill(*at[corners].T, facecolor=np.clip(rgb * bright, 0, 1), edgecolor=INK, lw=0.8, zorder=z)
            height = x[nodes[corners], 1 if flat else 2] > top - 1e-9
            ring = [*corners, corners[0]]
            for a, b in pairwise(ring):
                if height[corners.index(a)] and height[corners.index(b)] and (flat or height.all()):
                    axes.plot(*at[[a, b]].T, color=SLAVE, lw=1.6, zorder=z)
        facets = CELLS[kind].facets if not flat else ()
        seen = {n for f in facets for corners, _ in faces if set(corners) <= set(f.nodes) for n in f.nodes}
        here = sorted(seen) if not flat else list(range(len(nodes)))
        draw_nodes(axes, p, at[here], nodes[here], z)


def draw_nodes(axes: Any, p: Pattern, at: np.ndarray, nodes: np.ndarray, z: int, numbers: bool = False) -> None:
    """Nodes as marks: red new ones on the face, blue ones inside; a ring where they carry an internal dof."""
    own, face = CELLS[p.cell].n_nodes, len(p.volume.on_face)
    for n, place in zip(nodes, at, strict=True):
        colour, form = (INK, "o") if n < own else (SLAVE, "o") if n < own + face else (INSIDE, "s")
        if n >= own or numbers:
            axes.plot(*place, form, color=colour, ms=3.2, mec="white", mew=0.4, zorder=z + 0.5)
        if numbers and n in p.carriers:
            axes.plot(*place, "o", mfc="none", mec=colour, ms=8.0, mew=0.9, zorder=z + 0.5)
        if numbers:
            style = {"textcoords": "offset points", "fontsize": 7.5, "color": colour, "annotation_clip": False}
            axes.annotate(str(n), place, xytext=(4.5, 4.5), zorder=z + 1, **style)


def draw_parent(axes: Any, p: Pattern, shift: np.ndarray) -> None:
    """The cell and its nodes with their numbers: the pattern on the slave face in red, inner edges broken."""
    cell, x = CELLS[p.cell], upright(p)
    flat = cell.dim == 2
    at, seen = on_page(x, flat) + shift, set()
    for corners, _ in faces_of(p.cell, x):
        seen |= {frozenset(pair) for pair in pairwise([*corners, corners[0]])}
    inner = {frozenset((int(n[a]), int(n[b]))) for kind, n in in_order(p.volume) for a, b in _edges(kind)}
    own = {frozenset(edge) for edge in _edges(p.cell)}
    on_face = {n for n in range(len(x)) if x[n, 1 if flat else 2] > x[:, 1 if flat else 2].max() - 1e-9}
    for edge in sorted(inner - own if p.kind != WHOLE else [], key=sorted):
        red = edge <= on_face
        axes.plot(*at[list(edge)].T, color=SLAVE if red else INSIDE, lw=1.0 if red else 0.6, ls="-" if red else "--")
    for edge in sorted(own, key=sorted):
        hidden = not flat and edge not in seen
        axes.plot(*at[list(edge)].T, color=SLAVE if edge <= on_face else FAINT if hidden else INK,
                  lw=1.6 if edge <= on_face else 0.9, ls=":" if hidden else "-")  # fmt: skip
    draw_nodes(axes, p, at, np.arange(len(x)), 5, numbers=True)


def _edges(kind: str) -> list[tuple[int, int]]:
    return [(edge[0], edge[1]) for edge in CELLS[kind].edges]


def write_figure(name: str, path: Path) -> None:
    """Draw one figure into a file; the same name gives the same file every time."""
    import matplotlib
    from matplotlib.figure import Figure

    of, parts = figures()[name], []
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none", "font.family": "sans-serif"}):
        made = Figure(figsize=(7.4, 3.6) if name != OVERVIEW else (11.0, 5.2), facecolor="white")
        axes = made.add_axes((0, 0, 1, 1), aspect="equal")
        axes.set_axis_off()
        if name == OVERVIEW:
            parts = [(draw_children, p, np.array([7.2 * (k % 5), -8.0 * (k // 5)])) for k, p in enumerate(of)]
            for _, p, place in parts:
                words = f"{p.cell} by a {p.face}\n{children_text(p.volume)}"
                axes.text(place[0], place[1] - 3.4, words, ha="center", va="top", fontsize=8.5, color=INK)
        else:
            parts = [(draw_parent, of[0], np.zeros(2))]
            parts += [(draw_children, of[0], np.array([5.2, 0.0]))] if of[0].kind != WHOLE else []
        for draw, p, place in parts:
            draw(axes, p, place)
        text, title = io.StringIO(), "Patterns of the cut" if name == OVERVIEW else of[0].title
        about = {"Title": title, "Description": f"{digest(of)}, matplotlib {matplotlib.__version__}"}
        made.savefig(text, format="svg", bbox_inches="tight", metadata={"Date": None, "Creator": None, **about})
    path.write_text(_slim(text.getvalue()), encoding="utf-8")


def _slim(svg: str) -> str:
    """Shorten the text of a drawing: two decimals, a path on one line, no groups of one item."""
    svg = re.sub(r"-?\d+\.\d{3,}", lambda m: f"{float(m[0]):.2f}".rstrip("0").rstrip("."), svg)
    svg = re.sub(r' id="(?:line2d|patch|text)_\d+"', "", svg)
    svg = re.sub(r" ?\n(?=[LCz]|\" style)", " ", svg)
    svg = re.sub(r"<g>\s*(<(?:path|use|text)[^>]*/>)\s*</g>", r"\1", svg)
    return re.sub(r"\n\s+", "\n", svg)
