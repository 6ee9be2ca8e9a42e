"""Writing .inp: nodes, elements, sets, and skin groups as surfaces.

A skin cell is not written as an element: it gives the face of its parent in a *SURFACE. A skin group thus becomes a
surface of its name, with a set of its nodes. Element sets, surfaces and node sets have separate names: one name may
mean all three.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from lacmesh.deck import Deck
from lacmesh.errors import LacmeshWarning, RequestError
from lacmesh.formats.inp.carry import Complaints
from lacmesh.formats.inp.contradictions import contradictions
from lacmesh.formats.inp.deck_writer import DeckWriter
from lacmesh.formats.inp.flat import flattened
from lacmesh.formats.inp.follow import Followed
from lacmesh.formats.inp.lines import write_nodes, write_rows
from lacmesh.formats.inp.plain import below_dimension, losses
from lacmesh.formats.inp.plan import NAME, Plan, losses_of_groups, plan_of, write_groups
from lacmesh.formats.inp.roles import Roles, roles_of
from lacmesh.formats.inp.writer_types import PLANES, TARGETS
from lacmesh.formats.table import DEFAULT, WriteOptions
from lacmesh.formats.writing import blocks_in_order, is_plane, left_out
from lacmesh.mesh import Mesh


def write(path: Path, mesh: Mesh, options: WriteOptions = DEFAULT) -> None:
    """Write a mesh as an .inp file for the `target` "calculix" (also if None) or "abaqus", replacing any content.

    The option `plane`: the elements of plane meshes: CPS (plane stress), CPE (plane strain) or CAX (axisymmetric); by
    default `mesh.plane`, else CPS, with a warning. Skin cells are written as faces of *SURFACEs, other cells below the
    mesh's dimension as sets of nodes; with `all_cells` all of them are elements as well. Raises WriteError for a cell
    that the target has no element for, RequestError for an option; one LacmeshWarning names what is changed or left
    out.

    A mesh with a deck (`Mesh.deck`) is written as that deck: every card in its place, its mesh as it has become; one of
    parts is written without them if anything in its mesh has changed, or if "calculix", which has none, is named.
    Raises DataError for a line that cannot be carried; with `lenient` it is left out, and a LacmeshWarning names it.
    """
    with_parts, target = options.target != "calculix", options.target or "calculix"
    chosen, all_cells = options.plane or mesh.plane or "CPS", options.all_cells
    if target not in TARGETS or chosen not in PLANES:
        raise RequestError(
            f"an .inp file is for {' or '.join(TARGETS)}, in {', '.join(PLANES)}: not {target}, {chosen}"
        )
    said = left_out(mesh)
    complaints = Complaints(options.lenient)
    followed = None if mesh.deck is None else _followed(mesh.deck, mesh, with_parts, complaints, said)
    if followed is not None and (why := followed.misfit() or ("" if all_cells else below_dimension(followed))):
        said += [
            f"written anew and not as the deck {followed.deck.path}: {why}",
            *filter(None, [losses(followed.deck)]),
        ]
        followed = None
    roles = roles_of(mesh, all_cells)
    if followed is not None:
        _write_deck(path, followed, roles, said, target, options.plane, complaints)
    else:
        _write_mesh(path, mesh, roles, said, target, options.plane)
    if said:
        warnings.warn(LacmeshWarning(".inp: " + "; ".join(said)), stacklevel=2)


def _followed(deck: Deck, mesh: Mesh, with_parts: bool, complaints: Complaints, said: list[str]) -> Followed:
    """Follow a deck into a mesh made of it; `with_parts`: with its parts as long as all in the mesh is as read."""
    followed = Followed(deck, mesh)
    if not deck.instances or (with_parts and followed.untouched):
        return followed
    flat, refused = flattened(deck)
    without_parts = Followed(flat, mesh)
    if not without_parts.misfit():
        for refusal in refused:
            complaints.add(refusal.card, refusal.file, refusal.line, refusal.why, "it is left out")
        names = ", whose names stand before those of their sets" if any(one.prefix for one in deck.instances) else ""
        said.append(f"the deck is written without parts and instances{names}")
    return without_parts


def _write_deck(
    path: Path, followed: Followed, roles: Roles, said: list[str], target: str, plane: str | None,
    complaints: Complaints,
) -> None:  # fmt: skip
    """Write the deck that a mesh was read from, as `write` says."""
    deck, mesh = followed.deck, followed.mesh
    of_deck = followed.home >= 0
    roles = replace(roles, element=roles.element | of_deck)
    known = {*deck.element_sets.values(), *(group for (kind, _), group in deck.surfaces.items() if kind == "ELEMENT")}
    known_nodes = {*deck.node_sets.values(), *(group for (kind, _), group in deck.surfaces.items() if kind == "NODE")}
    rest = replace(
        mesh,
        cell_groups={name: cells for name, cells in mesh.cell_groups.items() if name not in known},
        node_groups={name: nodes for name, nodes in mesh.node_groups.items() if name not in known_nodes},
    )
    chosen = plane or mesh.plane or "CPS"
    plan = plan_of(path, mesh, roles, target, chosen, [], of_deck)
    for one in contradictions(deck):
        complaints.add(one.card, one.file, one.line, one.why, "carried as it stands")
    with path.open("wb") as file:
        rest_plan = plan_of(path, rest, roles, target, chosen, said, of_deck)
        DeckWriter(path, plan, rest_plan, followed, plane, complaints).write(file)
    in_group = roles.element.copy()
    for name in known & set(mesh.cell_groups):
        in_group[mesh.cell_groups[name]] = True
    said += losses_of_groups(rest, replace(roles, element=in_group))
    said += complaints.said


def _write_mesh(path: Path, mesh: Mesh, roles: Roles, said: list[str], target: str, plane: str | None) -> None:
    """Write a mesh alone, as `write` says."""
    chosen = plane or mesh.plane or "CPS"
    plan = plan_of(path, mesh, roles, target, chosen, said, np.zeros(mesh.n_cells, bool))
    with path.open("wb") as file:
        _write_heading(file, mesh.name)
        file.write(b"*NODE\n")
        write_nodes(file, mesh, plan.node)
        _write_elements(file, plan)
        write_groups(file, plan)
    said += losses_of_groups(mesh, roles)
    if not (plane or mesh.plane) and is_plane(mesh) and mesh.dim == 2:
        said.append("written as CPS (plane stress); --plane CPE or CAX (plane=) for plane strain or axisymmetry")


def _write_heading(file: BinaryIO, name: str) -> None:
    line = " ".join(name.split())
    if line and name != "mesh" and not line.startswith("*") and len(line) <= NAME:
        file.write(f"*HEADING\n{line}\n".encode())


def _write_elements(file: BinaryIO, plan: Plan) -> None:
    """Write a card of elements for each type, cells in the file's order."""
    mesh, roles = plan.mesh, plan.roles
    for block, lo, here in blocks_in_order(mesh):
        for skin in (False, True):
            some = here[roles.element[here] & (roles.skin[here] == skin)]
            if len(some):
                file.write(f"*ELEMENT, TYPE={plan.cards[block.type, skin]}".encode())
                write_rows(file, block.type, block.nodes, some - lo, plan.node, plan.cell[some])
                file.write(b"\n")
