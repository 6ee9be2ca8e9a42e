"""The hypothesis of the method: every macro-element owns a dof with its support inside it (R5.03.55, 2.3).

A node counts for a macro-element T if every slave face that contains it is part of T, and if the integral of its shape
function over T, on the real geometry, is positive. A node on the boundary of the slave skin may satisfy this, but a
symmetry condition often constrains its dof: macro-elements that own only such nodes are reported separately. A face
that is a macro-element only because nothing was cut, and owns only such nodes, needs the cut.
"""

from __future__ import annotations

from collections.abc import Iterator
from shlex import quote
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.recorded import Fault, internal_faults
from lacmesh.checks.subject import Subject
from lacmesh.cutting.records import Cut
from lacmesh.mesh import Floats, Ints, mask_of
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.topology.skin import FACE_TYPES, N_CORNERS, N_NODES, edge_uses

#: what counts as positive, as a part of the macro-element's measure (round-off, and curved vertices of a TRIA6)
POSITIVE = 1e-6
_DEGREE = 6


class _Dofs(NamedTuple):
    """Numbers of internal dofs of each macro-element (m,).

    They count all of them; those off the boundary of the skin; those that no Dirichlet group holds; those that satisfy
    both.
    """

    anywhere: Ints
    inside: Ints
    free: Ints
    free_inside: Ints


def check_dofs(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check that every macro-element owns an internal dof, and still does with the Dirichlet groups constrained."""
    if not len(subject.slave):
        return [], {}
    macros = subject.macros
    size, value, owner = _integrals(subject)
    share = np.nan_to_num(value / np.where(size > 0, size, np.inf)[owner])
    internal = (owner >= 0) & (share > POSITIVE)
    dofs = _dofs(subject, owner, internal)
    best = np.zeros(macros.count)
    np.maximum.at(best, owner[internal], share[internal])
    figures = {
        "macro_elements": macros.count,
        "with_internal_dof": int((dofs.inside > 0).sum()),
        "with_free_internal_dof": int((dofs.free_inside > 0).sum()),
        "least_integral": float(best.min()) if len(best) else None,
    }
    faults = [*macros.faults]
    if (macros.number >= 0).any():
        faults += internal_faults(Cut(subject.mesh), macros.number, owner, internal, _boundary_nodes(subject))
    return [*_broken(subject, faults), *_records(subject), *_lacking(subject, dofs), *_owning(subject, dofs)], figures


def _dofs(subject: Subject, owner: Ints, internal: NDArray[np.bool_]) -> _Dofs:
    """Count the internal nodes of the macro-elements that own them."""
    n_nodes = subject.mesh.n_nodes
    boundary, fixed = mask_of(n_nodes, _boundary_nodes(subject)), mask_of(n_nodes, subject.fixed)
    kinds = internal, internal & ~boundary, internal & ~fixed, internal & ~boundary & ~fixed
    return _Dofs(*(np.bincount(owner[nodes], minlength=subject.macros.count) for nodes in kinds))


def _broken(subject: Subject, faults: list[Fault]) -> Iterator[Finding]:
    for fault in faults:
        message = f"the records of the cut cannot be used: {fault.message}"
        yield subject.found("broken-records", message, fault.cells, fault.nodes, subject.slave.group)


def _records(subject: Subject) -> Iterator[Finding]:
    """Report a cut recognised without records, and slave faces outside every macro-element of the cut."""
    side, macros = subject.slave, subject.macros
    if macros.recognised and macros.cut.all():
        message = "the skin is cut, without records: " + counted(
            macros.count, "macro-element was", "macro-elements were"
        )
        yield subject.found("recognised", f"{message} recognised from the faces", side.cells, group=side.group)
    left = side.cells[~macros.cut & ~macros.whole]
    if macros.cut[~macros.whole].any() and len(left):
        message = counted(len(left), "slave face is", "slave faces are")
        message += f" in no macro-element of the cut ({subject.numbers(left)}); cut the original mesh, with all "
        yield subject.found("half-cut", f"{message}slave groups at once", left, group=side.group)


def _lacking(subject: Subject, dofs: _Dofs) -> Iterator[Finding]:
    """Report macro-elements with no internal dof, with constrained ones only, or with free ones on the boundary."""
    side, macros = subject.slave, subject.macros
    uncut = mask_of(macros.count, macros.of_face[~macros.cut & ~macros.whole])
    none = (dofs.anywhere == 0) | (uncut & (dofs.inside == 0))
    taken = ~none & (dofs.free == 0)
    on_boundary = ~none & ~taken & (dofs.free_inside == 0)
    if none.any():
        cells = side.cells[macros.faces(none)]
        what = "macro-elements own" if macros.cut.any() else "slave faces own"
        message = f"{int(none.sum()):,} of {macros.count:,} {what} no internal dof ({subject.numbers(cells)}"
        if (dofs.anywhere[none] > 0).any():
            message += f"; {int((dofs.anywhere[none] > 0).sum())} of them one on the boundary of the skin, where a "
            message += "symmetry condition would constrain it"
        message += f"); cut the skin: lacmesh cut {' '.join(f'--slave {quote(name)}' for name in side.names)}"
        if macros.cut.any():
            yield subject.found("no-internal-dof", message, cells, group=side.group)
        else:
            yield subject.found("not-cut", f"the skin is not cut yet: {message}", cells, group=side.group)
    if taken.any():
        cells = side.cells[macros.faces(taken)]
        message = f"every internal dof of {counted(int(taken.sum()), 'macro-element')} is constrained by "
        message += (
            f"{', '.join(subject.dirichlet)} (slave faces {subject.numbers(cells)}); remove these faces from one "
        )
        yield subject.found("fixed-internal-dof", f"{message}of the groups", cells, group=side.group)
    if on_boundary.any():
        cells = side.cells[macros.faces(on_boundary)]
        message = counted(int(on_boundary.sum()), "macro-element owns", "macro-elements own")
        message += f" free dofs on the boundary of the slave skin only (slave faces {subject.numbers(cells)}), where a "
        message += (
            "symmetry condition would constrain them; cut the faces, or give the constrained groups with --dirichlet"
        )
        yield subject.found("rim-dof", message, cells, group=side.group)


def _owning(subject: Subject, dofs: _Dofs) -> Iterator[Finding]:
    """Report macro-elements with an internal dof; their faces are listed only if other macro-elements have none."""
    side, macros = subject.slave, subject.macros
    owning = dofs.inside > 0
    if not owning.any():
        return
    cells = side.cells[macros.faces(owning)]
    as_is = int((~macros.cut & macros.whole).sum())
    message = (
        f"{int(owning.sum()):,} of {counted(macros.count, 'macro-element owns', 'macro-elements own')} an internal dof"
    )
    message += f", {as_is:,} of them as faces that need no cut (SEG3, TRIA7, QUAD9)" if as_is else ""
    message += "" if owning.all() else f" (slave faces {subject.numbers(cells)})"
    yield subject.found("internal-dof", message, None if owning.all() else cells, group=side.group)


def _integrals(subject: Subject) -> tuple[Floats, Floats, Ints]:
    """Measure of each macro-element, integral of each node's function, the only macro-element at each node, or -1."""
    mesh, faces, macros = subject.mesh, subject.slave.faces, subject.macros
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
    """(k, n): the integral of each node's shape function over faces with nodes at x (k, n, 3)."""
    X, w = rule(CELLS[kind].family, _DEGREE)
    J = jacobian(kind, x, X)
    area = np.linalg.norm(np.cross(J[..., 0], J[..., 1]) if CELLS[kind].dim == 2 else J[..., 0], axis=-1)
    return (area * w) @ shape(kind, X)


def _boundary_nodes(subject: Subject) -> Ints:
    """Nodes on the boundary of the slave skin: on edges that belong to one slave face only."""
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
