"""Consistency of the records of a cut with each other, with the faces, and with the integrals over the faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.records import Cut
from lacmesh.errors import some
from lacmesh.mesh import Ints, mask_of
from lacmesh.topology.bodies import label_components
from lacmesh.topology.skin import Faces, edge_uses

_NONE = np.empty(0, np.int64)


class Fault(NamedTuple):
    """A fault of the records, as a message, and the cells or nodes that show it."""

    message: str
    cells: Ints = _NONE
    nodes: Ints = _NONE


def record_faults(cut: Cut) -> list[Fault]:
    """Return the faults of `lac_macro`, `lac_zone` and `lac_child`, over all faces of the cut."""
    cells = np.flatnonzero(cut.macro_of_face >= 0)
    numbers, macro = np.unique(cut.macro_of_face[cells], return_inverse=True)
    beyond = f"lac_macro does not number the {len(numbers):,} macro-elements from 0 to {len(numbers) - 1}"
    ruled = (
        (numbers[macro] >= len(numbers), beyond),
        (_apart(cut, cells, macro), "faces of one macro-element (lac_macro) are not connected"),
        (_mixed(cut.zone_of_face[cells], macro), "faces of one macro-element are in several zones (lac_zone)"),
        (_unranked(cut.child_kind[cells], macro), "lac_child does not count the faces of a macro-element from 1"),
    )
    name = cut.mesh.cell_number
    return [
        Fault(f"{message} (slave faces {some(name[cells[odd]], 8)})", cells[odd]) for odd, message in ruled if odd.any()
    ]


def _mixed(zone: Ints, macro: Ints) -> NDArray[np.bool_]:
    """(f,): True for faces of macro-elements that lie in several zones."""
    first = np.empty(int(macro.max()) + 1, np.int64)
    first[macro] = zone
    odd = mask_of(len(first), macro[zone != first[macro]])
    return odd[macro]


def _unranked(child: Ints, macro: Ints) -> NDArray[np.bool_]:
    """(f,): True for faces of macro-elements whose faces are not numbered 1, 2, ... k, each once."""
    order = np.lexsort((child, macro))
    start = np.searchsorted(macro[order], macro[order])
    odd = mask_of(int(macro.max()) + 1, macro[order][child[order] != np.arange(len(order)) - start + 1])
    return odd[macro]


def _apart(cut: Cut, cells: Ints, macro: Ints) -> NDArray[np.bool_]:
    """(f,): True for faces of disconnected macro-elements; faces connect at edges, segments at their ends."""
    faces = Faces.join((kind, nodes) for kind, _, nodes in cut.mesh.select(cells))
    uses = edge_uses(faces)
    edge = np.unique(uses.edge.astype(np.int64) * (int(macro.max()) + 1) + macro[uses.face], return_inverse=True)[1]
    size = len(cells) + int(edge.max()) + 1
    return _mixed(label_components(uses.face, len(cells) + edge, size)[: len(cells)], macro)


def internal_faults(cut: Cut, number: Ints, owner: Ints, internal: NDArray[np.bool_], boundary: Ints) -> list[Fault]:
    """Return the faults of `lac_internal`, compared with the integrals of the shape functions.

    `number` (m,): the number in the records of each macro-element that is checked, -1 without one. `owner` (n_nodes,):
    the only macro-element that contains a node, or -1. `internal` (n_nodes,): nodes whose function has a positive
    integral. `boundary`: nodes on the boundary of the skin. If the integrals find no internal node off it for a
    macro-element, its records need not name one, and a node they name need only lie in that macro-element alone: there
    the cut is at fault, not the record.
    """
    mesh, recorded = cut.mesh, cut.macro_of_node
    off_boundary = internal.copy()
    off_boundary[boundary] = False
    owning = mask_of(len(number), owner[off_boundary])
    fitting = (owner >= 0) & (off_boundary | ~owning[owner])
    expected = np.where(fitting, number[owner], -1)
    known = np.isin(recorded, number[number >= 0]) | ~np.isin(recorded, cut.macro_of_face)
    odd = np.flatnonzero((recorded >= 0) & known & (recorded != expected))
    faults = []
    if len(odd):
        message = "lac_internal names nodes that carry no internal dof of the macro-element named"
        faults.append(Fault(f"{message} (nodes {some(mesh.node_number[odd], 8)})", nodes=odd))
    lacking = number[owning & (number >= 0) & ~np.isin(number, recorded)]
    if len(lacking):
        cells = np.flatnonzero(np.isin(cut.macro_of_face, lacking))
        message = f"lac_internal names no node of {len(lacking):,} of the macro-elements"
        faults.append(Fault(f"{message} (slave faces {some(mesh.cell_number[cells], 8)})", cells))
    return faults
