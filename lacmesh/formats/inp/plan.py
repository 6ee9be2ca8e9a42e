"""The plan of an .inp file: the element of each cell, the label of each group, numbers; and groups written by it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import WriteError
from lacmesh.formats.ids import repeated
from lacmesh.formats.inp.lines import write_faces, write_set
from lacmesh.formats.inp.roles import Roles
from lacmesh.formats.inp.writer_types import card, hint
from lacmesh.formats.labels import changes, labels
from lacmesh.formats.writing import is_plane
from lacmesh.mesh import Ints, Mesh, mask_of

LARGEST = 999_999_999
#: Characters of a name in both programs.
NAME = 80
_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
#: Characters of a name, for `labels`.
_ALLOWED = {"calculix": "A-Za-z0-9_-", "abaqus": " !#-~"}


@dataclass(frozen=True)
class Plan:
    """Content of a file: the element for each cell type, skin or not; labels of the groups; numbers of nodes and cells.

    `of_cells`: nodes of the cell groups that give a set of nodes; `apart`: names of such sets that are not the group's.
    """

    mesh: Mesh
    target: str
    roles: Roles
    of_cells: dict[str, Ints]
    cards: dict[tuple[str, bool], str]
    labels: dict[str, str]
    apart: dict[str, str]
    node: Ints
    cell: Ints


def plan_of(
    path: Path, mesh: Mesh, roles: Roles, target: str, plane: str, said: list[str], named: NDArray[np.bool_]
) -> Plan:
    """Plan a file; `named` (n_cells,): cells that a deck has an element for. Raises WriteError, as `Plan.cards`."""
    of_cells = _nodes_of_groups(mesh, roles)
    return Plan(
        mesh,
        target,
        roles,
        of_cells,
        _cards(path, mesh, roles.element & ~named, roles, target, plane),
        _labels(mesh, target, said),
        _labels_apart(mesh, target, of_cells, said),
        _numbers(mesh.node_number, np.ones(mesh.n_nodes, bool), "nodes", said),
        _numbers(mesh.cell_number, roles.element, "cells", said),
    )


def _cards(
    path: Path, mesh: Mesh, which: NDArray[np.bool_], roles: Roles, target: str, plane: str
) -> dict[tuple[str, bool], str]:
    """Element for each type of cell of some cells, skin or not. Raises WriteError if the target has none."""
    flat = plane if is_plane(mesh) else None
    skins = {}
    for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True):
        for skin in (False, True):
            n = int((which[lo:hi] & (roles.skin[lo:hi] == skin)).sum())
            name = card(block.type, target, flat, skin)
            if n and name is None:
                raise no_element(path, block.type, target, n, bool(flat))
            if n and name is not None:
                skins[block.type, skin] = name
    return skins


def no_element(path: Path, cell_type: str, target: str, n: int, flat: bool) -> WriteError:
    """Make the error for a type of cell that the target has no element for; `n`: how many the mesh has."""
    shown = {"calculix": "CalculiX", "abaqus": "Abaqus"}[target] + " has no element"
    where = " in the plane" if flat else ""
    return WriteError(path, f"{shown}{where} for {cell_type}, and the mesh has {n}; {hint(cell_type, target)}")


def _nodes_of_groups(mesh: Mesh, roles: Roles) -> dict[str, Ints]:
    """Nodes of the cells in each group that are skin, or no elements."""
    nodes_of = {}
    for name, members in mesh.cell_groups.items():
        some = members[roles.skin[members] | ~roles.element[members]]
        if len(some):
            nodes_of[name] = mesh.nodes_on(some)
    return nodes_of


def _labels(mesh: Mesh, target: str, said: list[str]) -> dict[str, str]:
    """Name of each group in the file; a group of cells and one of nodes may share a name."""
    label_of = labels(_names(mesh), _ALLOWED[target], NAME)
    if changed := changes(label_of):
        said.append(f"names of groups that an .inp file cannot hold: {changed}")
    return _quoted(label_of, target)


def _labels_apart(mesh: Mesh, target: str, of_cells: dict[str, Ints], said: list[str]) -> dict[str, str]:
    """Name of the node set of each group of cells whose own name belongs to a group of other nodes."""
    own = mesh.node_groups
    clash = [n for n in of_cells if len(own.get(n, ())) and not np.array_equal(own[n], of_cells[n])]
    taken = labels(_names(mesh), _ALLOWED[target], NAME).values()
    label_of = labels((f"{name}_nodes" for name in clash), _ALLOWED[target], NAME, reserved=taken)
    apart = dict(zip(clash, label_of.values(), strict=True))
    if apart:
        shown = ", ".join(f"those of {name!r} are {label}" for name, label in apart.items())
        said.append(f"groups of cells and of other nodes have the same name; the sets of the cells' nodes: {shown}")
    return _quoted(apart, target)


def _names(mesh: Mesh) -> dict[str, None]:
    return dict.fromkeys([*mesh.cell_groups, *mesh.node_groups])


def _quoted(label_of: dict[str, str], target: str) -> dict[str, str]:
    """Put labels for Abaqus between quotes if they are more than a plain word."""
    if target != "abaqus":
        return label_of
    return {name: text if _PLAIN.fullmatch(text) else f'"{text}"' for name, text in label_of.items()}


def _numbers(numbers: Ints, which: NDArray[np.bool_], what: str, said: list[str]) -> Ints:
    """Numbers of the mesh; if those of `which` are not distinct, or out of range, these become 1, 2 ..."""
    numbers = np.asarray(numbers, np.int64)
    mine = numbers[which]
    if len(mine) and (mine.min() < 1 or mine.max() > LARGEST or repeated(mine) is not None):
        said.append(f"the numbers of {what} are not distinct from 1 to {LARGEST}: they are 1, 2 ... in the file")
        return np.cumsum(which)
    return numbers


def write_groups(file: BinaryIO, plan: Plan) -> None:
    """Write element sets, surfaces and node sets; cells of a group that are skin, or no elements, give node sets."""
    mesh, roles = plan.mesh, plan.roles
    for name, members in mesh.cell_groups.items():
        elements, skin = members[roles.element[members]], members[roles.skin[members]]
        if len(elements):
            write_set(file, f"*ELSET, ELSET={plan.labels[name]}", plan.cell[elements])
        if len(skin):
            file.write(f"*SURFACE, NAME={plan.labels[name]}, TYPE=ELEMENT".encode())
            write_faces(file, mesh, roles, plan.target, plan.cell, skin)
    of_nodes = {plan.labels[name]: nodes for name, nodes in mesh.node_groups.items() if len(nodes)}
    of_nodes |= {plan.apart.get(name, plan.labels[name]): nodes for name, nodes in plan.of_cells.items()}
    for label, nodes in of_nodes.items():
        write_set(file, f"*NSET, NSET={label}", plan.node[nodes])


def losses_of_groups(mesh: Mesh, roles: Roles) -> list[str]:
    """Messages on the cells and groups that the file does not hold as they are."""
    said = []
    lower = ~roles.element & ~roles.skin
    if as_nodes := [name for name, members in mesh.cell_groups.items() if lower[members].any()]:
        said.append(f"cells of lower dimension become sets of nodes: {', '.join(as_nodes)}")
    groups = [*mesh.cell_groups.items(), *mesh.node_groups.items()]
    if empty := dict.fromkeys(name for name, members in groups if not len(members)):
        said.append(f"empty groups are left out: {', '.join(empty)}")
    grouped = mask_of(mesh.n_cells, *mesh.cell_groups.values())
    if n := int((~grouped & ~roles.element).sum()):
        said.append(f"{n} cells of lower dimension are in no group, and left out")
    skin = np.flatnonzero(roles.skin & ~roles.element & grouped)
    face = roles.parent[skin] * 8 + roles.facet[skin]
    if twice := len(face) - len(np.unique(face)):
        said.append(f"{twice} skin cells lie on others, and become one face with them")
    return said
