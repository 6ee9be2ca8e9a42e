"""The hypothesis of the method: every macro-element owns a dof whose function lives inside it (R5.03.55, 2.3).

A node is counted for a macro-element T when every slave face that holds it is part of T, and the integral of its
function over T, on the real geometry, is positive. A node on the rim of the slave skin meets this, but its dof is often
taken by a symmetry condition: macro-elements that own only such ones are told apart, and a face that is a macro-element
only because nothing was cut needs the cut.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.checks.findings import Finding
from lacmesh.checks.subject import Subject
from lacmesh.errors import CutError
from lacmesh.mesh import Floats, Ints
from lacmesh.orientation import edge_uses
from lacmesh.patterns import WHOLE_FACES
from lacmesh.quadrature import rule
from lacmesh.recognition import find_macros, with_records
from lacmesh.records import Cut, is_cut
from lacmesh.shapes import jacobian, shape
from lacmesh.skin import FACE_TYPES, N_CORNERS, N_NODES

#: what counts as positive, as a part of the macro-element's measure (round-off, and curved vertices of a TRIA6)
POSITIVE = 1e-6
_DEGREE = 6
_WHOLE = np.array([name in WHOLE_FACES for name in FACE_TYPES])


@dataclass(frozen=True)
class Macros:
    """The macro-elements of the slave faces: `of_face` (f,) numbered from 0, `count`, `cut` (f,): made by a cut."""

    of_face: Ints
    count: int
    cut: np.ndarray
    recognised: bool = False
    broken: str = ""


def macros_of(subject: Subject) -> Macros:
    """From the records, or found again, or each face its own."""
    mesh, side = subject.mesh, subject.slave
    own, recognised, broken = np.full(len(side), -1, np.int64), False, ""
    if is_cut(mesh):
        try:
            own = Cut(mesh).macro_of_face[side.cells].astype(np.int64)
        except (CutError, IndexError, ValueError) as error:
            broken = str(error)
    if len(side) and (broken or not is_cut(mesh)):
        found = find_macros(mesh, list(side.names))
        if found.n_cut:
            recognised = True
            own = with_records(mesh, found).cell_data["lac_macro"][side.cells].astype(np.int64)
    made = own >= 0
    start = int(own.max(initial=-1)) + 1
    own[~made] = start + np.arange(np.count_nonzero(~made))
    _, of_face = np.unique(own, return_inverse=True)
    return Macros(of_face, int(of_face.max(initial=-1)) + 1, made, recognised, broken)


def check_dofs(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """The internal dofs of every macro-element, and those left once the Dirichlet groups are held."""
    side = subject.slave
    if not len(side):
        return [], {}
    macros = macros_of(subject)
    found = list(_records(subject, macros))
    size, value, owner = _integrals(subject, macros)
    share = value / np.where(size > 0, size, np.inf)[owner]
    counted = (owner >= 0) & (share > POSITIVE)
    rim = np.zeros(subject.mesh.n_nodes, bool)
    rim[_rim(subject)] = True
    held = np.zeros(subject.mesh.n_nodes, bool)
    held[subject.fixed] = True
    inside = _per_macro(owner, counted & ~rim, macros.count)
    anywhere = _per_macro(owner, counted, macros.count)
    free_inside = _per_macro(owner, counted & ~rim & ~held, macros.count)
    free = _per_macro(owner, counted & ~held, macros.count)
    found += _lacking(subject, macros, inside, anywhere, free_inside, free)
    best = np.zeros(macros.count)
    np.maximum.at(best, owner[counted], share[counted])
    figures = {
        "macro_elements": macros.count,
        "with_internal_dof": int((inside > 0).sum()),
        "with_free_internal_dof": int((free_inside > 0).sum()),
        "least_integral": float(best.min()) if len(best) else None,
    }
    return found, figures


def _records(subject: Subject, macros: Macros) -> list[Finding]:
    """What is said of the cut itself."""
    side, found = subject.slave, []
    if macros.broken:
        found.append(subject.found("broken-records", f"the records of the cut cannot be used: {macros.broken}"))
    if macros.recognised and macros.cut.all():
        message = f"the skin is cut, without records: {macros.count} macro-elements were found again from the faces"
        found.append(subject.found("recognised", message, side.cells, group=side.group))
    whole = _WHOLE[side.faces.type]
    left = side.cells[~macros.cut & ~whole]
    if macros.cut[~whole].any() and len(left):
        message = f"{len(left)} slave faces ({subject.numbers(left)}) are in no macro-element of the cut; "
        message += "cut the mesh it came from, with every slave group at once"
        found.append(subject.found("half-cut", message, left, group=side.group))
    return found


def _lacking(
    subject: Subject, macros: Macros, inside: Ints, anywhere: Ints, free_inside: Ints, free: Ints
) -> list[Finding]:
    """Macro-elements without an internal dof, with one on the rim only, with none that is free."""
    side = subject.slave
    uncut = np.zeros(macros.count, bool)
    uncut[macros.of_face[~macros.cut & ~_WHOLE[side.faces.type]]] = True
    none = (anywhere == 0) | (uncut & (inside == 0))
    rim_only = ~none & (inside == 0)
    taken = ~none & (free == 0)
    rim_left = ~none & ~taken & ~rim_only & (free_inside == 0)
    found = []
    if none.any():
        cells = side.cells[none[macros.of_face]]
        on_rim = int((none & (anywhere > 0)).sum())
        message = f"{int(none.sum())} of {macros.count} macro-elements own no internal dof (slave faces "
        message += f"{subject.numbers(cells)}); lacmesh cut gives every slave face one"
        if on_rim:
            message += f" ({on_rim} of them own one on the rim of the skin, which a symmetry condition would take)"
        found.append(subject.found("no-internal-dof", message, cells, group=side.group))
    if rim_only.any() or rim_left.any():
        cells = side.cells[(rim_only | rim_left)[macros.of_face]]
        message = (
            f"the macro-elements of slave faces {subject.numbers(cells)} own free dofs on the rim of the slave skin "
        )
        message += "only, which a symmetry condition would take; cut them, or name the conditions with --dirichlet"
        found.append(subject.found("rim-dof", message, cells, group=side.group))
    if taken.any():
        cells = side.cells[taken[macros.of_face]]
        message = (
            f"every internal dof of {int(taken.sum())} macro-elements (slave faces {subject.numbers(cells)}) is held "
        )
        message += f"by {', '.join(subject.dirichlet)}; take these faces out of one of the groups"
        found.append(subject.found("fixed-internal-dof", message, cells, group=side.group))
    owning = int((inside > 0).sum())
    if owning:
        as_is = int((~macros.cut & _WHOLE[side.faces.type]).sum())
        message = f"{owning} of {macros.count} macro-elements own an internal dof"
        message += f", {as_is} of them faces that need no cut (SEG3, TRIA7, QUAD9)" if as_is else ""
        found.append(subject.found("internal-dof", message, group=side.group))
    return found


def _per_macro(owner: Ints, counted: np.ndarray, count: int) -> Ints:
    return np.bincount(owner[counted], minlength=count)


def _integrals(subject: Subject, macros: Macros) -> tuple[Floats, Floats, Ints]:
    """(measure of each macro-element, integral of each node's function, macro-element that alone holds the node)."""
    mesh, faces = subject.mesh, subject.slave.faces
    size, value = np.zeros(macros.count), np.zeros(mesh.n_nodes)
    low, high = np.full(mesh.n_nodes, macros.count), np.full(mesh.n_nodes, -1)
    for code in np.unique(faces.type):
        rows = np.flatnonzero(faces.type == code)
        nodes = faces.nodes[rows, : N_NODES[code]]
        own = np.broadcast_to(macros.of_face[rows, None], nodes.shape)
        np.minimum.at(low, nodes, own)
        np.maximum.at(high, nodes, own)
        good = subject.finite[nodes].all(axis=1)
        per_node = _face_integrals(FACE_TYPES[code], mesh.points[nodes[good]])
        np.add.at(value, nodes[good], per_node)
        size += np.bincount(macros.of_face[rows[good]], per_node.sum(axis=1), macros.count)
    return size, value, np.where(low == high, low, -1)


def _face_integrals(kind: str, x: Floats) -> Floats:
    """(k, n): the integral of each node's function over faces with nodes at x (k, n, 3)."""
    X, w = rule(CELLS[kind].family, _DEGREE)
    J = jacobian(kind, x, X)
    area = np.linalg.norm(np.cross(J[..., 0], J[..., 1]) if CELLS[kind].dim == 2 else J[..., 0], axis=-1)
    return (area * w) @ shape(kind, X)


def _rim(subject: Subject) -> Ints:
    """The nodes on edges that one slave face alone has."""
    faces = subject.slave.faces
    uses = edge_uses(faces)
    alone = np.flatnonzero(np.bincount(uses.edge)[uses.edge] == 1)
    face, place = uses.face[alone], uses.place[alone]
    n = N_CORNERS[faces.type[face]]
    first = faces.nodes[face, place]
    segment = n == 2
    second = np.where(segment, first, faces.nodes[face, (place + 1) % n])
    middle = np.where(segment | (N_NODES[faces.type[face]] == n), first, faces.nodes[face, n + place])
    return np.unique(np.concatenate([first, second, middle]))
