"""The hypothesis of the method: every macro-element owns a dof with its support inside it (R5.03.55, 2.3).

A node counts for a macro-element T if every slave face that contains it is part of T, and if the integral of its shape
function over T, on the real geometry, is positive. A node on the boundary of the slave skin may satisfy this, but a
symmetry condition often constrains its dof: macro-elements that own only such nodes are reported separately. A face
that is a macro-element only because nothing was cut, and owns only such nodes, needs the cut. The records of a cut must
agree with each other, with the faces, and with these integrals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from shlex import quote
from typing import Any

import numpy as np

from lacmesh.checks.findings import Place, rule
from lacmesh.checks.request import SHOWN, Bools, Request
from lacmesh.cutting.recognition import as_cut, find_macros
from lacmesh.cutting.records import Cut, is_cut, without_records
from lacmesh.cutting.select import slave_skin
from lacmesh.cutting.stars import WHOLE, node_integrals
from lacmesh.errors import CutError, counted, some
from lacmesh.mesh import Floats, Ints, Mesh, mask_of
from lacmesh.topology.bodies import label_components
from lacmesh.topology.skin import Faces, boundary_edges, edge_uses

#: what counts as positive, as a part of the macro-element's measure (round-off, and curved vertices of a TRIA6)
POSITIVE = 1e-6
_UNUSABLE = "the records of the cut cannot be used:"


# ---- the records of a cut, and the macro-elements


@dataclass(frozen=True)
class Records:
    """The mesh with usable records, its own or `recognised` ones, or without any; `cut`: the cut that they describe.

    `faults`: places that show why the mesh's own records cannot be used.
    """

    mesh: Mesh
    cut: Cut | None = None
    recognised: bool = False
    faults: tuple[Place, ...] = ()


def records_of(request: Request) -> Records:
    """Return the records of the cut of the slave skin: those of the mesh or, on request, recognised ones."""
    mesh = request.mesh
    if is_cut(mesh) and request.recognise is not False:
        faults = tuple(_faults_of(mesh))
        return Records(without_records(mesh), faults=faults) if faults else Records(mesh, Cut(mesh))
    if request.recognise and len(request.slave):
        macros = find_macros(mesh, slave_skin(mesh, request.slave.names))
        if macros.n_cut:
            cut = as_cut(mesh, macros)
            return Records(cut.mesh, cut, recognised=True)
    return Records(mesh)


@dataclass(frozen=True)
class Macros:
    """The macro-elements of the slave faces: `of_face` (f,) numbered from 0, and their `count`.

    `cut` (f,): faces that a cut made or left as a macro-element; every other face is a macro-element by itself.
    `whole` (f,): faces of types that need no cut (SEG3, TRIA7, QUAD9). `number` (count,): number of each macro-element
    in the records, -1 without one.
    """

    of_face: Ints
    count: int
    cut: Bools
    whole: Bools
    number: Ints


def macros_of(request: Request) -> Macros:
    """Return the macro-elements of the slave skin."""
    side, cut = request.slave, request.once(records_of).cut
    macro = np.full(len(side), -1) if cut is None else cut.macro_of_face[side.cells].astype(np.int64)
    alone, last = macro < 0, int(macro.max(initial=-1))
    macro[alone] = last + 1 + np.arange(np.count_nonzero(alone))
    values, of_face = np.unique(macro, return_inverse=True)
    return Macros(of_face, len(values), ~alone, WHOLE[side.faces.type], np.where(values <= last, values, -1))


def _faults_of(mesh: Mesh) -> Iterator[Place]:
    """Yield the faults of `lac_macro`, `lac_zone` and `lac_child`, over all faces of the cut."""
    try:
        cut = Cut(mesh)
        cells = np.flatnonzero(cut.macro_of_face >= 0)
        numbers, macro = np.unique(cut.macro_of_face[cells], return_inverse=True)
        child = cut.child_kind[cells]
        order = np.lexsort((child, macro))
        place = 1 + np.arange(len(order)) - np.searchsorted(macro[order], macro[order])
        unranked = mask_of(len(numbers), macro[order][child[order] != place])
        beyond = f"lac_macro does not number the {len(numbers):,} macro-elements from 0 to {len(numbers) - 1}"
        faults = (
            (beyond, numbers[macro] >= len(numbers)),
            ("faces of one macro-element (lac_macro) are not connected", _mixed(_connected(cut, cells, macro), macro)),
            ("faces of one macro-element are in several zones (lac_zone)", _mixed(cut.zone_of_face[cells], macro)),
            ("lac_child does not count the faces of a macro-element from 1", unranked[macro]),
        )
    except (CutError, IndexError, ValueError) as error:
        yield Place(f"{_UNUSABLE} {error}")
        return
    for message, odd in faults:
        if odd.any():
            names = some(mesh.cell_number[cells[odd]], SHOWN)
            yield Place(f"{_UNUSABLE} {message} (slave faces {names})", cells[odd])


def _mixed(label: Ints, macro: Ints) -> Bools:
    """(f,): True for faces of macro-elements whose faces have several labels."""
    first = np.empty(int(macro.max()) + 1, np.int64)
    first[macro] = label
    return mask_of(len(first), macro[label != first[macro]])[macro]


def _connected(cut: Cut, cells: Ints, macro: Ints) -> Ints:
    """(f,): labels of faces of one macro-element that are connected, at edges; segments at their ends."""
    faces = Faces.join((kind, nodes) for kind, _, nodes in cut.mesh.select(cells))
    uses = edge_uses(faces)
    edge = np.unique(uses.edge.astype(np.int64) * (int(macro.max()) + 1) + macro[uses.face], return_inverse=True)[1]
    return label_components(uses.face, len(cells) + edge, len(cells) + int(edge.max()) + 1)[: len(cells)]


def _internal_faults(cut: Cut, number: Ints, owner: Ints, internal: Bools, boundary: Bools) -> Iterator[Place]:
    """Yield the faults of `lac_internal`, compared with the integrals of the shape functions.

    `number` (m,): the number in the records of each macro-element that is checked, -1 without one. `owner` (n_nodes,):
    the only macro-element that contains a node, or -1. `internal` (n_nodes,): nodes whose function has a positive
    integral; `boundary` (n_nodes,): nodes on the boundary of the skin. If the integrals find no internal node off it
    for a macro-element, its records need not name one, and a node they name need only lie in that macro-element alone:
    there the cut is at fault, not the record.
    """
    mesh, recorded = cut.mesh, cut.macro_of_node
    off_boundary = internal & ~boundary
    owning = mask_of(len(number), owner[off_boundary])
    fitting = (owner >= 0) & (off_boundary | ~owning[owner])
    expected = np.where(fitting, number[owner], -1)
    known = np.isin(recorded, number[number >= 0]) | ~np.isin(recorded, cut.macro_of_face)
    odd = np.flatnonzero((recorded >= 0) & known & (recorded != expected))
    if len(odd):
        message = f"{_UNUSABLE} lac_internal names nodes that carry no internal dof of the macro-element named (nodes"
        yield Place(f"{message} {some(mesh.node_number[odd], SHOWN)})", nodes=odd)
    lacking = number[owning & (number >= 0) & ~np.isin(number, recorded)]
    if len(lacking):
        cells = np.flatnonzero(np.isin(cut.macro_of_face, lacking))
        message = f"{_UNUSABLE} lac_internal names no node of {len(lacking):,} of the macro-elements (slave faces"
        yield Place(f"{message} {some(mesh.cell_number[cells], SHOWN)})", cells)


# ---- the internal dofs


@dataclass(frozen=True)
class _Dofs:
    """Numbers of internal dofs of each macro-element (m,), faults of the records, and the least integral.

    The numbers count all dofs; those off the boundary of the skin; those that no Dirichlet group holds; those that
    satisfy both. The least integral is that of the best dof of a macro-element, as a part of its measure.
    """

    anywhere: Ints
    inside: Ints
    free: Ints
    free_inside: Ints
    faults: tuple[Place, ...]
    least: float | None


def _dofs(request: Request) -> _Dofs:
    """Examine the nodes of the slave skin by the integrals of their shape functions."""
    macros, records = request.once(macros_of), request.once(records_of)
    size, value, owner = _integrals(request, macros)
    share = np.nan_to_num(value / np.where(size > 0, size, np.inf)[owner])
    internal = (owner >= 0) & (share > POSITIVE)
    edge = boundary_edges(request.slave.faces)
    boundary, fixed = (mask_of(request.mesh.n_nodes, nodes) for nodes in (edge[edge >= 0], request.fixed))
    kinds = internal, internal & ~boundary, internal & ~fixed, internal & ~boundary & ~fixed
    best = np.zeros(macros.count)
    np.maximum.at(best, owner[internal], share[internal])
    faults = records.faults
    if records.cut is not None and not records.recognised and (macros.number >= 0).any():
        faults = tuple(_internal_faults(records.cut, macros.number, owner, internal, boundary))
    anywhere, inside, free, free_inside = (np.bincount(owner[nodes], minlength=macros.count) for nodes in kinds)
    return _Dofs(anywhere, inside, free, free_inside, faults, float(best.min()) if len(best) else None)


def _integrals(request: Request, macros: Macros) -> tuple[Floats, Floats, Ints]:
    """Measure of each macro-element, integral of each node's function, the only macro-element at each node, or -1."""
    faces, n_nodes = request.slave.faces, request.mesh.n_nodes
    inside = faces.nodes >= 0
    node, macro = faces.nodes[inside], np.broadcast_to(macros.of_face[:, None], inside.shape)[inside]
    low, high = np.full(n_nodes, macros.count), np.full(n_nodes, -1)
    np.minimum.at(low, node, macro)
    np.maximum.at(high, node, macro)
    on_face = np.zeros(inside.shape)
    good = np.flatnonzero((request.finite[faces.nodes] | ~inside).all(axis=1))
    on_face[good] = node_integrals(request.mesh.points, faces.take(good))
    size, value = np.zeros(macros.count), np.zeros(n_nodes)
    np.add.at(size, macro, on_face[inside])
    np.add.at(value, node, on_face[inside])
    return size, value, np.where(low == high, low, -1)


def _faces(request: Request, macros: Bools) -> Ints:
    """Return the cells on the slave faces of some macro-elements, a mask (m,)."""
    return request.slave.cells[macros[request.once(macros_of).of_face]]


def _lacking(request: Request) -> Bools:
    """(m,): True for macro-elements without an internal dof; an uncut face with one on the boundary alone has none."""
    macros, dofs = request.once(macros_of), request.once(_dofs)
    uncut = mask_of(macros.count, macros.of_face[~macros.cut & ~macros.whole])
    return (dofs.anywhere == 0) | (uncut & (dofs.inside == 0))


@rule("broken-records", "error", "remove these data, or cut the original mesh again", "slave")
def broken_records(request: Request) -> Iterator[Place]:
    """The data lac_macro, lac_zone, ... of the mesh are not those of a cut: numbers with holes, faces of a
    macro-element that are not connected, or internal dofs where the integrals find none.
    """
    yield from request.once(_dofs).faults


@rule("recognised", "info", "nothing", "slave")
def recognised(request: Request) -> Iterator[Place]:
    """The surface is cut, but has no records of the cut; the macro-elements were recognised."""
    macros, side = request.once(macros_of), request.slave
    if request.once(records_of).recognised and macros.cut.all():
        macro_elements = counted(macros.count, "macro-element was", "macro-elements were")
        yield Place(f"the surface is cut, without records: {macro_elements} recognised from the faces", side.cells)


@rule("half-cut", "warning", "cut the original mesh, with all slave groups at once", "slave")
def half_cut(request: Request) -> Iterator[Place]:
    """Only a part of the slave surface is cut."""
    macros, side = request.once(macros_of), request.slave
    if macros.cut[~macros.whole].any():
        cells = side.cells[~macros.cut & ~macros.whole]
        yield from request.places(cells, "is|are", "in no macro-element of the cut", side)


@rule("no-internal-dof", "error", "lacmesh cut", "slave")
def no_internal_dof(request: Request) -> Iterator[Place]:
    """A macro-element has no internal dof: no node whose shape function vanishes outside it and has a positive
    integral.
    """
    if request.once(macros_of).cut.any():
        message, cells, advice = _without_dof(request, "macro-elements own")
        if len(cells):
            yield Place(message, cells, advice=advice)


@rule("not-cut", "info", "lacmesh cut", "slave")
def not_cut(request: Request) -> Iterator[Place]:
    """A slave face that is not cut yet has no internal dof."""
    if not request.once(macros_of).cut.any():
        message, cells, advice = _without_dof(request, "slave faces own")
        if len(cells):
            yield Place(f"the surface is not cut yet: {message}; {advice}", cells)


def _without_dof(request: Request, what: str) -> tuple[str, Ints, str]:
    """Return a message about macro-elements without an internal dof, their cells, and what to do."""
    dofs, none = request.once(_dofs), _lacking(request)
    cells = _faces(request, none)
    message = f"{int(none.sum()):,} of {len(none):,} {what} no internal dof ({request.numbers(cells)}"
    if (dofs.anywhere[none] > 0).any():
        message += f"; {int((dofs.anywhere[none] > 0).sum())} of them have one on the boundary of the surface, where a "
        message += "symmetry condition would constrain it"
    groups = " ".join(f"--slave {quote(name)}" for name in request.slave.names)
    return f"{message})", cells, f"cut the surface: lacmesh cut {groups}"


@rule("fixed-internal-dof", "error", "remove these faces from the Dirichlet group, or from the slave group", "slave")
def fixed_internal_dof(request: Request) -> Iterator[Place]:
    """Every internal dof of a macro-element is in a Dirichlet group."""
    fixed = ~_lacking(request) & (request.once(_dofs).free == 0)
    if fixed.any():
        cells = _faces(request, fixed)
        message = f"every internal dof of {counted(int(fixed.sum()), 'macro-element')} is constrained by "
        message += f"{', '.join(request.dirichlet)} (slave faces {request.numbers(cells)})"
        yield Place(message, cells)


@rule("rim-dof", "warning", "cut the faces, or give the constrained groups with --dirichlet", "slave")
def rim_dofs(request: Request) -> Iterator[Place]:
    """A macro-element has internal dofs only on the boundary of the slave surface, which a symmetry condition would
    constrain.
    """
    dofs = request.once(_dofs)
    on_boundary = ~_lacking(request) & (dofs.free > 0) & (dofs.free_inside == 0)
    if on_boundary.any():
        cells = _faces(request, on_boundary)
        message = counted(int(on_boundary.sum()), "macro-element owns", "macro-elements own")
        message += f" internal dofs only on the boundary of the slave surface (slave faces {request.numbers(cells)}), "
        yield Place(f"{message}where a symmetry condition would constrain them", cells)


@rule("internal-dof", "info", "nothing", "slave")
def internal_dofs(request: Request) -> Iterator[Place | dict[str, Any]]:
    """Number of macro-elements with an internal dof."""
    macros, dofs = request.once(macros_of), request.once(_dofs)
    owning = dofs.inside > 0
    yield {
        "macro_elements": macros.count,
        "with_internal_dof": int(owning.sum()),
        "with_free_internal_dof": int((dofs.free_inside > 0).sum()),
        "least_integral": dofs.least,
    }
    if owning.any():
        cells = None if owning.all() else _faces(request, owning)  # listed only if others have none
        as_is = int((~macros.cut & macros.whole).sum())
        whole = f", {as_is:,} of them as faces that need no cut (SEG3, TRIA7, QUAD9)" if as_is else ""
        message = f"{int(owning.sum()):,} of {counted(macros.count, 'macro-element owns', 'macro-elements own')} an "
        message += f"internal dof{whole}" + ("" if cells is None else f" (slave faces {request.numbers(cells)})")
        yield Place(message, cells)
