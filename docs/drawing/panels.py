"""The drawing of a pattern: its new nodes, its children moved apart, its slave face; and the overview."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drawing.page import COLOURS, FAINT, INK, INSIDE, MARKS, SLAVE, Array, Page, roomiest
from drawing.patterns import Pattern, children_text, in_order, shown
from drawing.solids import (
    Body,
    apart,
    back_to_front,
    body,
    faces_of,
    ideal,
    nodes_of_face,
    plane,
    project,
    seen_faces,
    shade,
)
from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import WHOLE
from lacmesh.reference.shapes import shape


def nodes_panel(it: Body) -> Page:
    """The cell, the pattern on its slave face, and the new nodes with their numbers."""
    page = Page()
    flat = it.flat
    crowded = len(it.pattern.volume.inside) > 8
    at = project(it.points, flat) * (2.1 if crowded else 1.0)
    cell = CELLS[it.pattern.cell]
    slave = [n for n in cell.facets[it.pattern.facet].nodes if n < cell.n_corners]
    if flat:
        page.polygon(at[: cell.n_corners], "#f4f5f7", width=0)
    hidden = _hidden_edges(it)
    for edge in (e for e in cell.edges if e in hidden):
        page.line(at[list(edge)], FAINT, 0.8, ":")
    for a, b in sorted(_inner_edges(it)):
        page.line(at[[a, b]], INSIDE if max(a, b) >= it.n_own + it.n_face else FAINT, 0.6, "--")
    if not flat:
        page.polygon(at[slave], "#f3dcdc", edge="none", width=0, alpha=0.75)
    for a, b in sorted(_edges_on_face(it)):
        page.line(at[[a, b]], SLAVE, 1.1)
    for edge in (e for e in cell.edges if e not in hidden):
        page.line(at[list(edge)], INK, 1.0)
    page.line(at[[*slave, slave[0]] if not flat else slave], SLAVE, 1.9)
    _mark_nodes(page, it, at)
    return page


def _mark_nodes(page: Page, it: Body, at: Array) -> None:
    carriers = it.pattern.carriers
    edges = _halves([(it.pattern.cell, np.arange(it.n_own)), *it.children])
    own_panel = it.n_face > 1 and not it.flat  # the face's new nodes are numbered on its own panel
    for n in sorted(range(len(at)), key=lambda n: (n not in carriers, n)):
        kind = "own" if n < it.n_own else "face" if n < it.n_own + it.n_face else "inside"
        page.mark(at[n], kind, ring=n in carriers)
        named = n < CELLS[it.pattern.cell].n_corners or n in carriers or kind != "own"
        if named and not (own_panel and kind == "face"):
            _number(page, at, n, edges, kind, n in carriers)


def _number(page: Page, at: Array, n: int, edges: set[tuple[int, int]], kind: str, ring: bool, label: int = -1) -> None:
    """Write a node's number beside it, in the widest gap between the edges there; outward, if two are as wide."""
    ends = [b if a == n else a for a, b in edges if n in (a, b)]
    angles = sorted({round(float(np.arctan2(*(at[m] - at[n])[::-1])), 6) for m in ends})
    out = at[n] - at.mean(axis=0)
    ways = [(0.0, np.pi / 4)]
    if angles:
        turns = zip(angles, angles[1:] + angles[:1], strict=True)
        ways = [(w, a + w / 2) for a, w in ((a, (b - a) % (2 * np.pi) or 2 * np.pi) for a, b in turns)]
    widest = max(w for w, _ in ways)
    free = [np.array([np.cos(way), np.sin(way)]) for w, way in ways if w > widest - 0.02]
    way = max(free, key=lambda v: round(float(v @ out), 6))
    colour = FAINT if kind == "own" and not ring else MARKS[kind][0]
    number = str(n if label < 0 else label)
    page.text(at[n], number, 6.5, colour, offset=(10.5 if ring else 8.0) * way, bold=kind != "own" or ring)


def _hidden_edges(it: Body) -> set[tuple[int, ...]]:
    """Edges of the cell that none of the faces turned to the eye has."""
    cell = CELLS[it.pattern.cell]
    if it.flat:
        return set()
    seen: set[frozenset[int]] = set()
    for corners in seen_faces(cell.linear, it.points, it.flat):
        seen |= {frozenset(e) for e in zip(corners, corners[1:] + corners[:1], strict=True)}
    return {e for e in cell.edges if frozenset(e) not in seen}


def _edges_of(children: list[tuple[str, NDArray[np.intp]]]) -> set[tuple[int, int]]:
    found = set()
    for kind, nodes in children:
        for a, b in CELLS[kind].edges:
            low, high = sorted((int(nodes[a]), int(nodes[b])))
            found.add((low, high))
    return found


def _halves(cells: list[tuple[str, NDArray[np.intp]]]) -> set[tuple[int, int]]:
    """The edges of cells, each in two where it has a mid-node."""
    found = set()
    for kind, nodes in cells:
        cell = CELLS[kind]
        for k, (a, b) in enumerate(cell.edges):
            path = [a, cell.n_corners + k, b] if cell.order == 2 else [a, b]
            found |= {(int(nodes[i]), int(nodes[j])) for i, j in pairwise(path)}
    return found


def _edges_on_face(it: Body) -> set[tuple[int, int]]:
    """New edges on the slave face."""
    facet = CELLS[it.pattern.cell].facets[it.pattern.facet].nodes
    there = set(facet) | set(range(it.n_own, it.n_own + it.n_face))
    return {e for e in _new_edges(it) if set(e) <= there}


def _inner_edges(it: Body) -> set[tuple[int, int]]:
    return _new_edges(it) - _edges_on_face(it)


def _new_edges(it: Body) -> set[tuple[int, int]]:
    own = {tuple(sorted(e)) for e in CELLS[it.pattern.cell].edges}
    return {e for e in _edges_of(it.children) if e not in own}


def skin_children(it: Body) -> list[NDArray[np.intp]]:
    """The children of the slave face, E1 first, as nodes of the body."""
    facet = CELLS[it.pattern.cell].facets[it.pattern.facet].nodes
    frame = np.array([*facet, *range(it.n_own, it.n_own + it.n_face)])
    return [frame[nodes] for _, nodes in in_order(it.pattern.skin)]


def _owner(it: Body, face: NDArray[np.intp]) -> int:
    """The child that has a skin child as a face."""
    return next(k for k, (_, nodes) in enumerate(it.children) if set(face.tolist()) <= set(nodes.tolist()))


def children_panel(it: Body, labels: bool = True) -> Page:
    """The children, moved apart: each with its number, and the parts of the slave face on it."""
    page = Page()
    moved = apart(it)
    solids = [it.points[nodes[: CELLS[kind].n_corners]] + moved[k] for k, (kind, nodes) in enumerate(it.children)]
    planes = [[plane(x[list(f)]) for f in faces_of(kind)] for x, (kind, _) in zip(solids, it.children, strict=True)]
    order = range(len(solids)) if it.flat else back_to_front(solids, planes)
    slave = {tuple(sorted(face.tolist())): f"E{k + 1}" for k, face in enumerate(skin_children(it))}
    painted = [sight for k in order for sight in _paint_child(page, it, k, moved[k], slave)]
    if labels:
        _name_children(page, painted)
    if it.flat:
        for k in order:
            _slave_edges(page, it, k, moved[k], slave, labels)
    return page


class Sight(NamedTuple):
    """A face that was painted: of which child, where, and its name if it is part of the slave face."""

    child: int
    at: Array
    name: str


def _name_children(page: Page, painted: list[Sight]) -> None:
    """Write each child's number, and the names of the slave faces, where they are in sight and clear of edges."""
    spots: dict[int, list[tuple[float, Array]]] = {}
    for k, sight in enumerate(painted):
        room, spot = roomiest(sight.at, [later.at for later in painted[k + 1 :]])
        if sight.name and room > 0.07:
            page.text(spot, sight.name, 7.5, SLAVE, bold=True)
        elif not sight.name:
            spots.setdefault(sight.child, []).append((round(room, 6), spot))
    for child, found in spots.items():
        room, spot = max(found, key=lambda item: item[0])
        if room > 0.05:
            page.text(spot, str(child + 1), 9.5, INK, bold=True)


def _paint_child(page: Page, it: Body, k: int, move: Array, slave: dict[tuple[int, ...], str]) -> list[Sight]:
    kind, nodes = it.children[k]
    x = it.points[nodes] + move
    at = project(x, it.flat)
    seen = seen_faces(kind, x, it.flat)
    painted = [Sight(k, at[list(corners)], _slave_name(nodes, corners, kind, slave)) for corners in seen]
    for corners, sight in zip(seen, painted, strict=True):
        page.polygon(sight.at, shade(COLOURS[k % 6], x[list(corners)], it.flat), width=0.8)
    for sight in painted:
        if sight.name:
            page.line(sight.at[[*range(len(sight.at)), 0]], SLAVE, 1.5)
    for n in sorted({m for f in seen for m in nodes_of_face(kind, f)}, key=lambda m: int(nodes[m])):
        number = int(nodes[n])
        mark = "own" if number < it.n_own else "face" if number < it.n_own + it.n_face else "inside"
        page.mark(at[n], mark, 0.72)
    return painted


def _slave_name(nodes: NDArray[np.intp], corners: tuple[int, ...], kind: str, slave: dict[tuple[int, ...], str]) -> str:
    if CELLS[kind].dim == 2:
        return ""
    there = tuple(sorted(nodes[list(nodes_of_face(kind, corners))].tolist()))
    return slave.get(there, "")


def _slave_edges(page: Page, it: Body, k: int, move: Array, slave: dict[tuple[int, ...], str], labels: bool) -> None:
    """In the plane: the parts of the slave face on a child."""
    kind, nodes = it.children[k]
    at = project(it.points[nodes] + move, True)
    for facet in CELLS[kind].facets:
        name = slave.get(tuple(sorted(nodes[list(facet.nodes)].tolist())))
        if name:
            ends = at[list(facet.nodes[:2])]
            page.line(ends, SLAVE, 2.0)
            if labels:
                page.text(ends.mean(axis=0), name, 7.5, SLAVE, offset=np.array([0.0, 8.0]), bold=True)


def skin_panel(it: Body) -> Page:
    """The slave face by itself: E1, E2, ... in the colours of the children behind them, its nodes numbered."""
    page = Page()
    family = CELLS[it.pattern.face].family
    facet = CELLS[it.pattern.cell].facets[it.pattern.facet].nodes
    flat = ideal(family) * (1.15 if family == "QUAD" else 1.3)
    there = np.vstack([np.array(CELLS[it.pattern.face].reference), it.pattern.skin.on_face])
    at = shape(CELLS[it.pattern.face].linear, there) @ flat
    numbers = [*facet, *range(it.n_own, it.n_own + it.n_face)]
    carriers = it.pattern.carriers
    for k, (kind, nodes) in enumerate(in_order(it.pattern.skin)):
        owner = _owner(it, np.array(numbers)[nodes])
        corners = at[nodes[: CELLS[kind].n_corners]]
        page.polygon(corners, COLOURS[owner % 6], SLAVE, 1.1)
        spots = [n + np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]) for n in at]
        page.text(roomiest(corners, spots)[1], f"E{k + 1}", 9.0, INK, bold=True)
    page.line(at[[*range(len(flat)), 0]], SLAVE, 1.9)
    edges = _halves([(it.pattern.face, np.arange(len(facet))), *in_order(it.pattern.skin)])
    for n, number in enumerate(numbers):
        kind = "own" if n < len(facet) else "face"
        page.mark(at[n], kind, ring=number in carriers)
        _number(page, at, n, edges, kind, number in carriers, number)
    return page


_LEGEND = (
    ("own", "the cell's own node"),
    ("face", "new, on the slave face"),
    ("inside", "new, inside"),
)


def figure(pattern: Pattern) -> Page:
    """One pattern: nodes, children, slave face, and what they are."""
    it = body(pattern)
    page = Page()
    panels = [("nodes", nodes_panel(it))]
    if pattern.kind != WHOLE:
        panels.append(("children, moved apart", children_panel(it)))
    if not it.flat:
        panels.append(("slave face", skin_panel(it)))
    spans = []
    for title, panel in panels:
        page.beside(panel)
        spans.append((title, page.high[0] - (panel.high[0] - panel.low[0]) / 2))
    top, left = page.high[1] + 0.55, page.low[0]
    for title, x in spans:
        page.text(np.array([x, top]), title, 8.0, FAINT)
    page.text(np.array([left, top + 0.5]), pattern.title, 10.0, bold=True, left=True)
    page.see(np.array([left + 0.15 * len(pattern.title), top + 0.5]))
    _legend(page, it)
    return page


def _legend(page: Page, it: Body) -> None:
    """Draw the legend of the marks, on as many lines as the width of the page requires."""
    used = ["own", *(["face"] if it.n_face else []), *(["inside"] if len(it.pattern.volume.inside) else [])]
    items = [(kind, words, False) for kind, words in _LEGEND if kind in used]
    items.append(("face" if it.n_face else "own", "carries an internal dof", True))
    left, right = page.low[0] + 0.1, max(page.high[0], page.low[0] + 6.4)
    x, y = left, page.low[1] - 0.5
    for kind, words, ring in items:
        wide = 0.3 + 0.105 * len(words)
        if x + wide > right:
            x, y = left, y - 0.36
        page.mark(np.array([x, y]), kind, ring=ring)
        page.text(np.array([x + 0.2, y]), words, 7.5, left=True)
        page.see(np.array([x + wide, y - 0.1]))
        x += wide + 0.3


def overview() -> Page:
    """The main patterns side by side."""
    page = Page()
    cells = [(p, children_panel(body(p), labels=False)) for p in shown()]
    width = max(panel.high[0] - panel.low[0] for _, panel in cells) + 0.5
    height = max(panel.high[1] - panel.low[1] for _, panel in cells) + 1.2
    for k, (pattern, panel) in enumerate(cells):
        at = np.array([(k % 5 + 0.5) * width, -(k // 5) * height])
        page.place(panel, at - (panel.low + panel.high) / 2)
        variant = f", {pattern.variant}" if pattern.variant in ("pyramid", "hexa") else ""
        under = at - [0, height / 2 - 0.42]
        page.text(under, f"{pattern.cell} by a {pattern.face}{variant}", 8.5, bold=True)
        page.text(under - [0, 0.3], children_text(pattern.volume), 7.5, INK)
    return page
