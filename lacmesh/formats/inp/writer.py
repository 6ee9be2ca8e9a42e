"""Writing .inp: nodes, elements, sets, and skin groups as surfaces.

A skin cell is not written as an element: it gives the face of its parent in a *SURFACE. A skin group thus becomes a
surface of its name, with a set of its nodes. Element sets, surfaces and node sets have separate names: one name may
mean all three.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning, RequestError, WriteError
from lacmesh.formats.ids import repeated
from lacmesh.formats.inp.types import FACETS, NODES
from lacmesh.formats.inp.writer_types import PLANES, TARGETS, card, hint
from lacmesh.formats.labels import changes, labels
from lacmesh.formats.text import int_rows, joined, reals
from lacmesh.formats.without_fields import left_out
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.skin import TYPE_CODE, Faces, find_owners, first_of_each, label_faces
from lacmesh.topology.winding import relative_listing

_LARGEST = 999_999_999
_ROWS = 1 << 14
_PER_LINE = 16
#: Characters of a name, and of a real number, in both programs.
_NAME, _REAL = 80, 20
_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
#: Characters of a name, for `labels`.
_ALLOWED = {"calculix": "A-Za-z0-9_-", "abaqus": " !#-~"}


def write(
    path: Path, mesh: Mesh, *, target: str = "calculix", plane: str | None = None, all_cells: bool = False
) -> None:
    """Write a mesh as an .inp file for `target`, "calculix" or "abaqus", replacing any content.

    `plane`: the elements of plane meshes: CPS (plane stress), CPE (plane strain) or CAX (axisymmetric); by default
    `mesh.plane`, else CPS, with a warning. Skin cells are written as faces of *SURFACEs, other cells below the mesh's
    dimension as sets of nodes; with `all_cells` all of them are elements as well. Raises WriteError for a cell that the
    target has no element for, RequestError for an option; one LacmeshWarning names what is changed or left out.
    """
    chosen = plane or mesh.plane or "CPS"
    if target not in TARGETS or chosen not in PLANES:
        raise RequestError(
            f"an .inp file is for {' or '.join(TARGETS)}, in {', '.join(PLANES)}: not {target}, {chosen}"
        )
    said = left_out(mesh)
    roles = _roles(mesh, all_cells)
    of_cells = _nodes_of_groups(mesh, roles)
    plan = _Plan(
        mesh,
        target,
        roles,
        of_cells,
        _cards(path, mesh, roles, target, chosen),
        _labels(mesh, target, said),
        _labels_apart(mesh, target, of_cells, said),
        _numbers(mesh.node_number, np.ones(mesh.n_nodes, bool), "nodes", said),
        _numbers(mesh.cell_number, roles.element, "cells", said),
    )
    with path.open("wb") as file:
        _write_heading(file, mesh.name)
        _write_nodes(file, mesh, plan.node)
        _write_elements(file, plan)
        _write_groups(file, plan)
    said += _losses(mesh, roles)
    if not (plane or mesh.plane) and _is_plane(mesh) and mesh.dim == 2:
        said.append("written as CPS (plane stress); --plane CPE or CAX (plane=) for plane strain or axisymmetry")
    if said:
        warnings.warn(LacmeshWarning(".inp: " + "; ".join(said)), stacklevel=2)


@dataclass(frozen=True)
class _Roles:
    """Role of each cell in the file: an element; for skin, the face `facet` of the cell `parent` (-1 for none)."""

    element: NDArray[np.bool_]
    parent: Ints
    facet: Ints

    @property
    def skin(self) -> NDArray[np.bool_]:
        """(n_cells,): True for skin cells, which lie on a face of another cell."""
        return self.parent >= 0


@dataclass(frozen=True)
class _Plan:
    """Content of a file: the element for each cell type, skin or not; labels of the groups; numbers of nodes and cells.

    `of_cells`: nodes of the cell groups that give a set of nodes; `apart`: names of such sets that are not the group's.
    """

    mesh: Mesh
    target: str
    roles: _Roles
    of_cells: dict[str, Ints]
    cards: dict[tuple[str, bool], str]
    labels: dict[str, str]
    apart: dict[str, str]
    node: Ints
    cell: Ints


def _roles(mesh: Mesh, all_cells: bool) -> _Roles:
    """Find the skin cells and the cell behind each; of two, the one whose facet has the same orientation."""
    parent, facet = np.full(mesh.n_cells, -1), np.full(mesh.n_cells, -1)
    below = np.flatnonzero(mesh.cell_dim == mesh.dim - 1) if mesh.dim > 1 else np.empty(0, np.int64)
    solid = [
        (b.type, b.nodes, np.arange(lo, hi))
        for b, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True)
        if b.type in CELLS and CELLS[b.type].dim == mesh.dim and CELLS[b.type].family in FACETS
    ]
    for cell_type, chosen, nodes in mesh.select(below):
        if cell_type in TYPE_CODE:
            faces = Faces.join([(cell_type, nodes)])
            face, cell, side = _behind(faces, solid, mesh.n_nodes)
            turned = relative_listing(faces.take(face), _facets(mesh, cell, side)) % 2
            best = np.lexsort((turned, face))
            best = best[np.append(True, np.diff(face[best]) != 0)[: len(best)]]
            parent[chosen[face[best]]] = cell[best]
            facet[chosen[face[best]]] = side[best]
    element = (mesh.cell_dim == mesh.dim) | ((mesh.cell_dim == mesh.dim - 1) & (parent < 0))
    return _Roles(element | all_cells, parent, facet)


def _behind(faces: Faces, solid: list[tuple[str, Ints, Ints]], n_nodes: int) -> tuple[Ints, Ints, Ints]:
    """Pairs of a face and a cell behind it: face, cell, facet of the cell; faces may lie on each other."""
    first, which = first_of_each(*label_faces(faces))
    owners = find_owners(faces.take(first), solid, n_nodes)
    count = np.bincount(owners.face, minlength=len(first))
    begin = (np.cumsum(count) - count)[which]
    of = count[which]
    rows = np.repeat(begin - (np.cumsum(of) - of), of) + np.arange(of.sum())
    return np.repeat(np.arange(len(faces)), of), owners.cell[rows], owners.facet[rows]


def _facets(mesh: Mesh, cells: Ints, facets: Ints) -> Faces:
    """Facets of cells, as faces, in the order of `cells`."""
    parts, order = [], [np.empty(0, np.int64)]
    block = np.searchsorted(mesh.offsets, cells, side="right") - 1
    for b in np.unique(block).tolist():
        for j, facet in enumerate(CELLS[mesh.blocks[b].type].facets):
            rows = np.flatnonzero((block == b) & (facets == j))
            parts.append((facet.type, mesh.blocks[b].nodes[cells[rows] - mesh.offsets[b]][:, facet.nodes]))
            order.append(rows)
    return Faces.join(parts).take(np.argsort(np.concatenate(order)))


def _cards(path: Path, mesh: Mesh, roles: _Roles, target: str, plane: str) -> dict[tuple[str, bool], str]:
    """Element for each type of cell, skin or not. Raises WriteError if the target has none."""
    flat = plane if _is_plane(mesh) else None
    found = {}
    for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True):
        for skin in (False, True):
            n = int((roles.element[lo:hi] & (roles.skin[lo:hi] == skin)).sum())
            name = card(block.type, target, flat, skin)
            if n and name is None:
                shown = {"calculix": "CalculiX", "abaqus": "Abaqus"}[target] + " has no element"
                where = " in the plane" if flat else ""
                try_this = hint(block.type, target)
                raise WriteError(path, f"{shown}{where} for {block.type}, and the mesh has {n}; {try_this}")
            if n and name is not None:
                found[block.type, skin] = name
    return found


def _is_plane(mesh: Mesh) -> bool:
    return mesh.space_dim == 2 and mesh.dim < 3 and not np.any(mesh.points[:, 2])


def _nodes_of_groups(mesh: Mesh, roles: _Roles) -> dict[str, Ints]:
    """Nodes of the cells in each group that are skin, or no elements."""
    found = {}
    for name, members in mesh.cell_groups.items():
        some = members[roles.skin[members] | ~roles.element[members]]
        if len(some):
            found[name] = _nodes_of(mesh, some)
    return found


def _labels(mesh: Mesh, target: str, said: list[str]) -> dict[str, str]:
    """Name of each group in the file; a group of cells and one of nodes may share a name."""
    made = labels(_names(mesh), _ALLOWED[target], _NAME)
    if changed := changes(made):
        said.append(f"names of groups that an .inp file cannot hold: {changed}")
    return _quoted(made, target)


def _labels_apart(mesh: Mesh, target: str, of_cells: dict[str, Ints], said: list[str]) -> dict[str, str]:
    """Name of the node set of each group of cells whose own name belongs to a group of other nodes."""
    own = mesh.node_groups
    clash = [n for n in of_cells if len(own.get(n, ())) and not np.array_equal(own[n], of_cells[n])]
    taken = labels(_names(mesh), _ALLOWED[target], _NAME).values()
    made = labels((f"{name}_nodes" for name in clash), _ALLOWED[target], _NAME, reserved=taken)
    apart = dict(zip(clash, made.values(), strict=True))
    if apart:
        shown = ", ".join(f"those of {name!r} are {label}" for name, label in apart.items())
        said.append(f"groups of cells and of other nodes have the same name; the sets of the cells' nodes: {shown}")
    return _quoted(apart, target)


def _names(mesh: Mesh) -> dict[str, None]:
    return dict.fromkeys([*mesh.cell_groups, *mesh.node_groups])


def _quoted(made: dict[str, str], target: str) -> dict[str, str]:
    """Put labels for Abaqus between quotes if they are more than a plain word."""
    if target != "abaqus":
        return made
    return {name: text if _PLAIN.fullmatch(text) else f'"{text}"' for name, text in made.items()}


def _numbers(numbers: Ints, which: NDArray[np.bool_], what: str, said: list[str]) -> Ints:
    """Numbers of the mesh; if those of `which` are not distinct, or out of range, these become 1, 2 ..."""
    numbers = np.asarray(numbers, np.int64)
    mine = numbers[which]
    if len(mine) and (mine.min() < 1 or mine.max() > _LARGEST or repeated(mine) is not None):
        said.append(f"the numbers of {what} are not distinct from 1 to {_LARGEST}: they are 1, 2 ... in the file")
        return np.cumsum(which)
    return numbers


def _write_heading(file: BinaryIO, name: str) -> None:
    line = " ".join(name.split())
    if line and name != "mesh" and not line.startswith("*") and len(line) <= _NAME:
        file.write(f"*HEADING\n{line}\n".encode())


def _write_nodes(file: BinaryIO, mesh: Mesh, number: Ints) -> None:
    """Write the nodes; coordinates have 20 characters at most, which is all that either program reads."""
    dim = 2 if _is_plane(mesh) else 3
    file.write(b"*NODE\n")
    for a in range(0, mesh.n_nodes, _ROWS):
        part = slice(a, a + _ROWS)
        columns = [list(map(str, number[part].tolist()))]
        columns += [reals(mesh.points[part, axis], _REAL) for axis in range(dim)]
        file.write(joined(columns, ", ").encode())


def _write_elements(file: BinaryIO, plan: _Plan) -> None:
    """Write a card of elements for each type, cells in the file's order."""
    mesh, roles = plan.mesh, plan.roles
    order = np.arange(mesh.n_cells) if mesh.file_order is None else np.asarray(mesh.file_order)
    for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True):
        here = order[(order >= lo) & (order < hi)]
        for skin in (False, True):
            some = here[roles.element[here] & (roles.skin[here] == skin)]
            if len(some):
                file.write(f"*ELEMENT, TYPE={plan.cards[block.type, skin]}".encode())
                _write_rows(file, block.type, block.nodes, some - lo, plan.node, plan.cell[some])
                file.write(b"\n")


def _write_rows(file: BinaryIO, kind: str, nodes: Ints, rows: Ints, node: Ints, number: Ints) -> None:
    """Write the number and the nodes of each element, at most 16 numbers on a line."""
    places = list(NODES.get(kind, range(nodes.shape[1])))
    leads = [b"\n"] + [b",\n" if k % _PER_LINE == 0 else b", " for k in range(1, len(places) + 1)]
    for a in range(0, len(rows), _ROWS):
        part = rows[a : a + _ROWS]
        table = np.empty((len(part), 1 + len(places)), np.int64)
        table[:, 0] = number[a : a + _ROWS]
        table[:, 1:] = node[nodes[part][:, places]]
        file.write(int_rows(table, leads))


def _write_groups(file: BinaryIO, plan: _Plan) -> None:
    """Write element sets, surfaces and node sets; cells of a group that are skin, or no elements, give node sets."""
    mesh, roles = plan.mesh, plan.roles
    for name, members in mesh.cell_groups.items():
        elements, skin = members[roles.element[members]], members[roles.skin[members]]
        if len(elements):
            _write_set(file, f"*ELSET, ELSET={plan.labels[name]}", plan.cell[elements])
        if len(skin):
            _write_surface(file, plan, plan.labels[name], skin)
    of_nodes = {plan.labels[name]: nodes for name, nodes in mesh.node_groups.items() if len(nodes)}
    of_nodes |= {plan.apart.get(name, plan.labels[name]): nodes for name, nodes in plan.of_cells.items()}
    for label, nodes in of_nodes.items():
        _write_set(file, f"*NSET, NSET={label}", plan.node[nodes])


def _losses(mesh: Mesh, roles: _Roles) -> list[str]:
    """Messages on the cells and groups that the file does not hold as they are."""
    said = []
    lower = ~roles.element & ~roles.skin
    if as_nodes := [name for name, members in mesh.cell_groups.items() if lower[members].any()]:
        said.append(f"cells of lower dimension become sets of nodes: {', '.join(as_nodes)}")
    groups = [*mesh.cell_groups.items(), *mesh.node_groups.items()]
    if empty := dict.fromkeys(name for name, members in groups if not len(members)):
        said.append(f"empty groups are left out: {', '.join(empty)}")
    grouped = np.zeros(mesh.n_cells, bool)
    for members in mesh.cell_groups.values():
        grouped[members] = True
    if n := int((~grouped & ~roles.element).sum()):
        said.append(f"{n} cells of lower dimension are in no group, and left out")
    skin = np.flatnonzero(roles.skin & ~roles.element & grouped)
    face = roles.parent[skin] * 8 + roles.facet[skin]
    if twice := len(face) - len(np.unique(face)):
        said.append(f"{twice} skin cells lie on others, and become one face with them")
    return said


def _nodes_of(mesh: Mesh, cells: Ints) -> Ints:
    """Sorted indices of the nodes of some cells."""
    used = np.zeros(mesh.n_nodes, bool)
    for _, _, nodes in mesh.select(cells):
        used[nodes] = True
    return np.flatnonzero(used)


def _write_set(file: BinaryIO, head: str, numbers: Ints) -> None:
    """Write the keyword line of a set, and its members in lines of 16."""
    file.write(head.encode())
    whole = len(numbers) // _PER_LINE * _PER_LINE
    for rows in (numbers[:whole].reshape(-1, _PER_LINE), numbers[whole:].reshape(1, -1)):
        if rows.size:
            file.write(int_rows(rows, [b"\n", *[b", "] * (rows.shape[1] - 1)]))
    file.write(b"\n")


def _write_surface(file: BinaryIO, plan: _Plan, name: str, skin: Ints) -> None:
    """Write the faces of a surface, each once, as the number of an element and the label of its face."""
    mesh, roles = plan.mesh, plan.roles
    at = np.unique(roles.parent[skin] * 8 + roles.facet[skin])
    parent, facet = at // 8, at % 8
    block = np.searchsorted(mesh.offsets, parent, side="right") - 1
    shells = mesh.dim == 2 and not _is_plane(mesh)  # Abaqus counts their edges from E1, CalculiX from S3
    letter = "E" if shells and plan.target == "abaqus" else "S"
    number = np.full(len(at), 3 if shells and plan.target == "calculix" else 1)
    for b in np.unique(block).tolist():
        place = np.argsort(FACETS[CELLS[mesh.blocks[b].type].family])  # our facet -> its place among S1, S2 ...
        number[block == b] += place[facet[block == b]]
    file.write(f"*SURFACE, NAME={name}, TYPE=ELEMENT".encode())
    file.write(int_rows(np.stack([plan.cell[parent], number], axis=1), [b"\n", f", {letter}".encode()]))
    file.write(b"\n")
