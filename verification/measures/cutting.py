"""Violations of the properties of a cut, counted from the two meshes alone, without lacmesh's own checks.

`before` is the mesh that was cut, whose cells are positive and whose faces are plane, so that children tile exactly.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lacmesh import Cut, Mesh
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape

Ints = NDArray[np.integer]
Floats = NDArray[np.floating]

#: of volumes and areas, relative; of an integral over a macro-element that counts as positive
_ROUNDING, _POSITIVE = 1e-12, 1e-6
_DEGREE = 6


def violations(before: Mesh, cut: Cut) -> dict[str, int]:
    """Count the violations: property -> number of cells, facets, nodes or groups that break it."""
    return {name: broken(before, cut) for name, broken in _PROPERTIES.items()}


def sizes(mesh: Mesh) -> NDArray[np.floating]:
    """Volume, area or length of each cell (n_cells,); signed for cells of the space's dimension."""
    out = np.zeros(mesh.n_cells)
    for kind, cells, nodes in _of(mesh, range(mesh.n_cells)):
        if CELLS[kind].dim:
            X, w = rule(CELLS[kind].family, _DEGREE)
            out[cells] = _density(mesh, kind, nodes, X) @ w
    return out


def facets(mesh: Mesh) -> dict[tuple[int, ...], list[tuple[str, Ints]]]:
    """Facets of the cells of the highest dimension: sorted corners -> (type, nodes) in each cell that has the facet."""
    cells_of: dict[tuple[int, ...], list[tuple[str, Ints]]] = defaultdict(list)
    for block in mesh.blocks:
        if CELLS[block.type].dim == mesh.space_dim:
            for facet in CELLS[block.type].facets:
                corners = CELLS[facet.type].n_corners
                for row in block.nodes[:, list(facet.nodes)]:
                    cells_of[tuple(sorted(row[:corners].tolist()))].append((facet.type, row))
    return dict(cells_of)


def same_up_to_numbers(one: Mesh, other: Mesh) -> bool:
    """True if two meshes have the same cells at the same places in the same groups."""
    return _places(one) == _places(other)


def _not_filled(before: Mesh, cut: Cut) -> int:
    old, new = sizes(before), sizes(cut.mesh)
    row = _rows(before)
    children = np.flatnonzero(cut.parent_of_cell >= 0)
    parent = np.array([row[int(n)] for n in cut.parent_of_cell[children]], int)
    total = np.bincount(parent, new[children], before.n_cells)[np.unique(parent)]
    whole = old[np.unique(parent)]
    return int((~(np.abs(total - whole) <= _ROUNDING * np.abs(whole))).sum())


def _inverted(before: Mesh, cut: Cut) -> int:
    """Count cells of the space's dimension whose Jacobian determinant is not positive at some quadrature point."""
    mesh, count = cut.mesh, 0
    for kind, _, nodes in _of(mesh, np.flatnonzero(mesh.cell_dim == mesh.space_dim)):
        X, _ = rule(CELLS[kind].family, _DEGREE)
        count += int((~(_density(mesh, kind, nodes, X) > 0)).any(axis=1).sum())
    return count


def _torn(before: Mesh, cut: Cut) -> int:
    """Facets of more than two cells, or with other mid-nodes on each side; a skin of another area than before."""
    table = facets(cut.mesh)
    broken = sum(len(own) > 2 or len({frozenset(n.tolist()) for _, n in own}) > 1 for own in table.values())
    skin, old = (_area(mesh, (own[0] for own in cells_of.values() if len(own) == 1))
                 for mesh, cells_of in ((cut.mesh, table), (before, facets(before))))  # fmt: skip
    faces = (n for _, _, rows in _of(cut.mesh, np.flatnonzero(cut.macro_of_face >= 0)) for n in rows)
    known = {frozenset(n.tolist()) for own in table.values() for _, n in own}
    return broken + sum(frozenset(n.tolist()) not in known for n in faces) + int(abs(skin - old) > _ROUNDING * old)


def _touched(before: Mesh, cut: Cut) -> int:
    """Old nodes that moved or have another number; cells that were to stay and did not; new nodes unused or twice."""
    after, n = cut.mesh, before.n_nodes
    moved = (after.points[:n] != before.points).any(axis=1) | (after.node_number[:n] != before.node_number)
    replaced = set(cut.parent_of_cell[cut.parent_of_cell >= 0].tolist())
    old = _numbered(before, [i for i in range(before.n_cells) if int(before.cell_number[i]) not in replaced])
    new = _numbered(after, np.flatnonzero(cut.parent_of_cell < 0))
    used = np.unique(np.concatenate([block.nodes.ravel() for block in after.blocks]))
    fresh = np.arange(n, after.n_nodes)
    twice = len(fresh) - len(np.unique(after.points[fresh].round(12), axis=0))
    return int(moved.sum()) + len(old ^ new) + len(np.setdiff1d(fresh, used)) + twice


def _turned(before: Mesh, cut: Cut) -> int:
    """Macro-elements whose faces do not stand together, in order, each turned as the face that was cut."""
    row = _rows(before)
    return sum(
        not _in_order(before, cut, faces, row[int(cut.parent_of_cell[faces[0]])])
        for faces in cut.faces_of_macro
        if len(faces) > 1
    )


def _in_order(before: Mesh, cut: Cut, faces: Ints, parent: int) -> bool:
    """E1, E2, ... beside one another: face k on edge k of the parent, the centre last; in a plane from end to end."""
    ((kind, _, (old,)),) = before.select(np.array([parent]))
    children = [next(cut.mesh.select(np.array([face]))) for face in faces]
    if not (np.diff(faces) == 1).all() or not (cut.child_kind[faces] == np.arange(1, len(faces) + 1)).all():
        return False
    facing = _facing(before, kind, old)
    if any(_facing(cut.mesh, child, nodes[0]) @ facing <= 0 for child, _, nodes in children):
        return False
    nodes = [n[0].tolist() for _, _, n in children]
    if CELLS[kind].dim == 1:
        ends = nodes[0][0] == old[0] and nodes[-1][1] == old[1]
        return bool(ends and all(a[1] == b[0] for a, b in pairwise(nodes)))
    corners = old[: CELLS[kind].n_corners].tolist()
    edges = zip(corners, corners[1:] + corners[:1], strict=True)
    return all(n[:2] == list(edge) for n, edge in zip(nodes, edges, strict=False))


def _without_dof(before: Mesh, cut: Cut) -> int:
    """Macro-elements without a node whose function lives inside and has a positive integral, or with a wrong record."""
    inside = _internal(cut)
    return sum(
        not internal or internal != set(recorded.tolist())
        for internal, recorded in zip(inside, cut.internal_nodes, strict=True)
    )  # fmt: skip


def _internal(cut: Cut) -> list[set[int]]:
    """For each macro-element, nodes off its rim that no other has, with a positive integral of their function."""
    mesh = cut.mesh
    integral: list[Counter[int]] = [Counter() for _ in range(cut.n_macros)]
    rim: list[Counter[frozenset[int]]] = [Counter() for _ in range(cut.n_macros)]
    for kind, cells, nodes in _of(mesh, np.flatnonzero(cut.macro_of_face >= 0)):
        X, w = rule(CELLS[kind].family, _DEGREE)
        values = (_density(mesh, kind, nodes, X) * w) @ shape(kind, X)
        for macro, row, value in zip(cut.macro_of_face[cells], nodes, values, strict=True):
            for node, part in zip(row.tolist(), value.tolist(), strict=True):
                integral[macro][node] += part
            rim[macro].update(frozenset(row[list(facet.nodes)].tolist()) for facet in CELLS[kind].facets)
    shared = Counter(node for integrals in integral for node in integrals)
    out = []
    for integrals, edges in zip(integral, rim, strict=True):
        outer = {node for edge, count in edges.items() if count == 1 for node in edge}
        least = _POSITIVE * sum(integrals.values())
        out.append({n for n, value in integrals.items() if value > least and shared[n] == 1 and n not in outer})
    return out


def _lost(before: Mesh, cut: Cut) -> int:
    """Groups that do not hold exactly the children of their cells, numbers that are not unique, data not passed on."""
    after, row = cut.mesh, _rows(before)
    origin = np.where(cut.parent_of_cell >= 0, cut.parent_of_cell, after.cell_number)
    source = np.array([row[int(n)] for n in origin])
    broken = len(set(before.cell_groups) ^ set(after.cell_groups))
    for name, members in before.cell_groups.items():
        broken += int(not np.array_equal(np.flatnonzero(np.isin(source, members)), after.cell_groups[name]))
    for name, values in before.cell_data.items():
        broken += int(not np.array_equal(after.cell_data[name], values[source]))
    for name, values in before.node_data.items():
        broken += int(not np.array_equal(after.node_data[name][: before.n_nodes], values))
    whole = [name for name, members in before.node_groups.items() if len(members) == before.n_nodes]
    broken += sum(len(after.node_groups[name]) != after.n_nodes for name in whole)
    numbers = ((after.cell_number, after.n_cells), (after.node_number, after.n_nodes))
    return broken + sum(len(np.unique(values)) != size for values, size in numbers)


_PROPERTIES: dict[str, Callable[[Mesh, Cut], int]] = {
    "parents that their children do not fill": _not_filled,
    "cells that are inverted somewhere": _inverted,
    "facets that do not conform": _torn,
    "nodes and cells that changed and should not": _touched,
    "macro-elements turned or out of order": _turned,
    "macro-elements without their internal dof": _without_dof,
    "groups, numbers and data lost": _lost,
}
#: the properties that `violations` counts
PROPERTIES = tuple(_PROPERTIES)


def _of(mesh: Mesh, cells: Iterable[int]) -> list[tuple[str, Ints, Ints]]:
    return list(mesh.select(np.fromiter(cells, int)))


def _rows(mesh: Mesh) -> dict[int, int]:
    return {int(n): k for k, n in enumerate(mesh.cell_number)}


def _density(mesh: Mesh, kind: str, nodes: Ints, X: Floats) -> NDArray[np.floating]:
    """(k, p): what dX is multiplied by; of cells that fill the space the determinant, with its sign."""
    J = jacobian(kind, mesh.points[nodes], X)
    dim = CELLS[kind].dim
    if dim == mesh.space_dim:
        return np.asarray(np.linalg.det(J[..., :dim, :]))
    return np.asarray(np.sqrt(np.linalg.det(np.swapaxes(J, -1, -2) @ J)))


def _facing(mesh: Mesh, kind: str, nodes: Ints) -> NDArray[np.floating]:
    """(3,): normal of a face times its area; of a segment the vector along it."""
    X, w = rule(CELLS[kind].family, _DEGREE)
    J = jacobian(kind, mesh.points[nodes[None]], X)[0]
    along = np.cross(J[..., 0], J[..., 1]) if CELLS[kind].dim == 2 else J[..., 0]
    return np.asarray(w @ along)


def _area(mesh: Mesh, faces: Iterable[tuple[str, Ints]]) -> float:
    total = 0.0
    for kind, nodes in faces:
        X, w = rule(CELLS[kind].family, _DEGREE)
        total += float((_density(mesh, kind, nodes[None], X) @ w)[0])
    return total


def _numbered(mesh: Mesh, cells: Iterable[int]) -> set[tuple[object, ...]]:
    return {
        (kind, int(mesh.cell_number[cell]), *nodes.tolist())
        for kind, which, rows in _of(mesh, cells)
        for cell, nodes in zip(which, rows, strict=True)
    }


def _places(mesh: Mesh) -> Counter[tuple[object, ...]]:
    """The cells by type, places of their nodes and groups."""
    places = [tuple(p) for p in (mesh.points.round(9) + 0.0).tolist()]
    member: list[list[str]] = [[] for _ in range(mesh.n_cells)]
    for name, cells in sorted(mesh.cell_groups.items()):
        for cell in cells:
            member[cell].append(name)
    return Counter(
        (kind, tuple(sorted(places[n] for n in nodes)), tuple(member[cell]))
        for kind, which, rows in _of(mesh, range(mesh.n_cells))
        for cell, nodes in zip(which, rows, strict=True)
    )
