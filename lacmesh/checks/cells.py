"""Checks of the cells: their numbers and nodes, whether their maps can be inverted, and how they fit together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.checks.findings import Place, rule
from lacmesh.checks.request import PLACE, Bools, Request
from lacmesh.cutting.records import is_cut
from lacmesh.errors import counted, some
from lacmesh.mesh import Ints, concatenated, mask_of, places_of
from lacmesh.quality.geometry import own_measures, validity, validity_among
from lacmesh.quality.measures import POOR
from lacmesh.reference.quadrature import signed_area
from lacmesh.topology.facets import CROWDED, FACETS
from lacmesh.topology.skin import lacking, mixed_bits

_WORST = 5
_NEITHER = -1


@rule("no-cells", "error", "give the mesh of a body")
def no_cells(request: Request) -> Iterator[Place]:
    """The mesh has no cells of dimension 2 or 3."""
    mesh = request.mesh
    if mesh.dim < 2 or (mesh.dim == request.dim < mesh.space_dim and not is_cut(mesh)):
        yield Place(f"{lacking(mesh, max(mesh.dim, 1) + 1)}: there is no body to check")


@rule("repeated-number", "error", "number them again")
def repeated_numbers(request: Request) -> Iterator[Place]:
    """Two cells or two nodes have the same number, or one is negative."""
    for what, numbers in (("cell", request.mesh.cell_number), ("node", request.mesh.node_number)):
        values, first, count = np.unique(numbers, return_index=True, return_counts=True)
        odd = first[(count > 1) | (values < 0)]
        if len(odd):
            message = f"{counted(len(odd), f'{what} number is', f'{what} numbers are')} repeated or negative "
            yield Place(f"{message}({some(numbers[odd])})", *((odd, None) if what == "cell" else (None, odd)))


@rule("not-finite", "error", "correct the coordinates")
def not_finite(request: Request) -> Iterator[Place]:
    """A coordinate of a node of a cell is not finite; checks that need it are left out."""
    nodes = np.flatnonzero(request.once(_used) & ~request.finite)
    yield from request.places(nodes, "has|have", "coordinates that are not finite, or huge", noun="node")


@rule("unreferenced-node", "info", "remove them if the solver gives them degrees of freedom")
def unreferenced_nodes(request: Request) -> Iterator[Place]:
    """A node belongs to no cell."""
    yield from request.places(np.flatnonzero(~request.once(_used)), "belongs|belong", "to no cell", noun="node")


def _used(request: Request) -> Bools:
    """(n_nodes,): True for nodes of cells."""
    return mask_of(request.mesh.n_nodes, *(block.nodes for block in request.mesh.blocks))


# ---- validity


@dataclass(frozen=True)
class _Validity:
    """Cells by their validity, and the corner Jacobian (n_cells,) of each; cells of no other list are good."""

    repeated: Ints
    invalid: Ints
    inverted: Ints
    clockwise: Ints
    poor: Ints
    quality: NDArray[np.floating]
    worst: float


def _validity(request: Request) -> _Validity:
    """Examine the Jacobian determinants of all cells where solvers evaluate them."""
    mesh = request.mesh
    value, quality = np.ones(mesh.n_cells), np.ones(mesh.n_cells)
    negative, repeated, known = (np.full(mesh.n_cells, k) for k in (False, False, True))
    for block, first, last in zip(mesh.blocks, mesh.offsets[:-1], mesh.offsets[1:], strict=True):
        cells = slice(first, last)
        columns = np.sort(block.nodes, axis=1).T
        repeated[cells] = (columns[1:] == columns[:-1]).any(axis=0)
        if not request.finite.all():
            known[cells] = request.finite[block.nodes].all(axis=1)
        if block.type not in CELLS or not CELLS[block.type].dim or not len(block.nodes):
            continue
        value[cells] = validity_among(block.type, mesh.points, block.nodes).least
        if CELLS[block.type].dim == mesh.dim:
            quality[cells] = own_measures(block.type, mesh.points, block.nodes, ["corner_jacobian"])["corner_jacobian"]
        if CELLS[block.type].dim == 2 == mesh.dim and mesh.space_dim == 2:
            negative[cells] = signed_area(block.type, mesh.points[block.nodes]) < 0
    worst = float(np.fmin.reduce(quality[known], initial=1.0))
    known &= ~repeated
    invalid = np.flatnonzero(~(value > 0) & known)
    inverted = invalid[_inversion(request, invalid) == 1]
    return _Validity(
        repeated=np.flatnonzero(repeated),
        invalid=np.setdiff1d(invalid, inverted),
        inverted=inverted,
        clockwise=np.flatnonzero(negative & (value > 0) & known),
        poor=np.flatnonzero((quality < POOR) & (value > 0) & known),
        quality=quality,
        worst=worst,
    )


@rule("repeated-node", "error", "use cells of a simpler type")
def repeated_nodes(request: Request) -> Iterator[Place]:
    """A cell lists a node twice."""
    yield from request.places(request.once(_validity).repeated, "lists|list", "a node twice")


@rule("invalid-cell", "error", "remesh there, or move the nodes")
def invalid_cells(request: Request) -> Iterator[Place | dict[str, Any]]:
    """The Jacobian determinant is zero or negative at a corner, a mid-node or an integration point of the cell."""
    validity = request.once(_validity)
    text = "a Jacobian determinant that is not positive where solvers evaluate it"
    yield from request.places(validity.invalid, "has|have", text)
    yield {"invalid_cells": len(validity.invalid) + len(validity.inverted), "worst_quality": validity.worst}


@rule("inverted-cell", "error", "reverse their node order")
def inverted_cells(request: Request) -> Iterator[Place]:
    """A solid cell is inverted: its nodes are listed in reverse; code_aster accepts it, most solvers do not."""
    yield from request.places(request.once(_validity).inverted, "is|are", "inverted")


@rule("clockwise-cell", "warning", "reverse their node order if the solver refuses them")
def clockwise_cells(request: Request) -> Iterator[Place]:
    """A plane cell is listed clockwise; some solvers refuse it, the cut accepts it."""
    yield from request.places(request.once(_validity).clockwise, "is|are", "listed clockwise", noun="plane cell")


@rule("poor-cell", "warning", "improve the mesh there, or try the other variant of the cut (--hexa)")
def poor_cells(request: Request) -> Iterator[Place]:
    """The corner Jacobian of the cell is below 0.1 (1: ideal), whatever its type: its stiffness is badly conditioned,
    its stresses are inaccurate.
    """
    mesh, quality, cells = request.mesh, request.once(_validity).quality, request.once(_validity).poor
    if not len(cells):
        return
    worst = cells[np.argsort(quality[cells].round(9), kind="stable")]  # the first of those that are equal
    listed = ", ".join(f"{mesh.cell_number[c]} ({quality[c]:.3f})" for c in worst[:_WORST])
    parent = mesh.cell_data.get("lac_parent")
    children = cells[:0] if parent is None else cells[parent[cells] >= 0]
    advice = "improve the mesh there (lacmesh quality says more)"
    if len(children):  # their quality depends on their parents and on the variant of the cut
        families = {CELLS[kind].family for kind, _, _ in mesh.select(children)}
        other = ", or cut with --hexa auto" if families & {"HEXA", "PYRAM"} else ""
        advice = f"{len(children):,} of them come from subdivision; improve the mesh there{other}"
    message = counted(len(cells), "cell has", "cells have")
    yield Place(f"{message} a corner Jacobian below {POOR}, worst first: {listed}", worst, advice=advice)


def _inversion(request: Request, cells: Ints) -> Ints:
    """(k,): 1 for cells inverted everywhere (clockwise in the plane), 0 for valid ones, _NEITHER for others."""
    mesh = request.mesh
    out = np.full(len(cells), _NEITHER)
    order = np.argsort(cells, kind="stable")
    done = 0
    for kind, chosen, nodes in mesh.select(cells[order]):
        rows = order[done : done + len(chosen)]
        done += len(chosen)
        if kind not in CELLS:
            continue
        x = mesh.points[nodes]
        valid = validity(kind, x) > 0
        if CELLS[kind].dim == 3:
            back = validity(kind, x * [-1, 1, 1]) > 0
            out[rows[valid]], out[rows[back]] = 0, 1
        elif CELLS[kind].dim == 2:
            out[rows[valid]] = signed_area(kind, x[valid]) < 0
    return out


# ---- how the cells fit together


@rule("repeated-cell", "error", "remove one of the two")
def repeated_cells(request: Request) -> Iterator[Place]:
    """Two cells have the same corners."""
    yield from request.places(request.facets.copies, "has|have", "the same corners as others")


@rule("crowded-facet", "error", "remove the surplus cells")
def crowded_facets(request: Request) -> Iterator[Place]:
    """More than two cells share a facet."""
    crowded = np.unique(np.flatnonzero(request.facets.opposite == CROWDED) // FACETS)
    yield from request.places(request.facets.solid.cells[crowded], "shares|share", "a facet with two others or more")


@rule("overlapping-cells", "error", "remesh there")
def overlapping_cells(request: Request) -> Iterator[Place]:
    """Two valid cells lie on the same side of the facet that they share."""
    if request.mesh.dim == 2 and request.mesh.space_dim == 3:  # a surface in space has no right way out
        return
    solid, opposite = request.facets.solid, request.facets.opposite
    odd = np.flatnonzero(request.facets.same)  # cells of one orientation that list their facet with the same winding
    odd = odd[odd < opposite[odd]]
    a, b = odd // FACETS, opposite[odd] // FACETS
    sides = [_inversion(request, solid.cells[rows]) for rows in (a, b)]
    overlap = np.flatnonzero((sides[0] == sides[1]) & (sides[0] != _NEITHER))
    cells = np.unique(solid.cells[np.concatenate([a[overlap], b[overlap]])])
    if len(cells):
        message = f"{counted(len(overlap), 'pair of cells lies', 'pairs of cells lie')} on the same side of the facet "
        yield Place(f"{message}that they share ({request.numbers(cells)})", cells)


@rule("mid-nodes-differ", "error", "elevate the order of both alike, and share the mid-nodes")
def different_mid_nodes(request: Request) -> Iterator[Place]:
    """Two cells, or a surface face and its parent cell, share the corners of a facet but not its mid-nodes."""
    mesh, solid, opposite = request.mesh, request.facets.solid, request.facets.opposite
    orders = {ALL_CELLS[b.type].order for b in mesh.blocks if ALL_CELLS[b.type].dim == mesh.dim and len(b.nodes)}
    if orders <= {1}:
        return
    sign = np.zeros(len(opposite), np.uint64)
    known = opposite >= 0
    place = places_of(solid.cells, mesh.n_cells)
    for k, block in enumerate(mesh.blocks):
        cell = ALL_CELLS[block.type]
        if cell.dim != mesh.dim:
            continue
        rows = place[mesh.offsets[k] : mesh.offsets[k + 1]]
        nodes = block.nodes[rows >= 0]
        rows = rows[rows >= 0]
        if block.type not in CELLS:
            known[(rows[:, None] * FACETS + np.arange(FACETS)).ravel()] = False
            continue
        mixed = mixed_bits(nodes)
        for j, facet in enumerate(cell.facets):
            sign[rows * FACETS + j] = mixed[:, facet.nodes].sum(axis=1, dtype=np.uint64)
    at = np.flatnonzero(known)
    at = at[(at < opposite[at]) & known[opposite[at]]]
    at = at[sign[at] != sign[opposite[at]]]
    cells = np.unique(solid.cells[np.concatenate([at, opposite[at]]) // FACETS])
    if len(cells):
        message = f"the cells on both sides of {counted(len(at), 'facet')} share corners but not mid-nodes "
        yield Place(f"{message}({request.numbers(cells)})", cells)


def edges_without_length(request: Request) -> Iterator[Place]:
    """Cells have an edge of zero length, compared with their longest one, between two different nodes."""
    mesh, ends = request.mesh, []
    for kind, nodes in mesh.blocks:
        if kind in CELLS and 1 < CELLS[kind].dim == mesh.dim and len(nodes):
            pairs = np.stack([np.sort(nodes[:, list(edge[:2])], axis=1) for edge in CELLS[kind].edges])
            length = np.linalg.norm(mesh.points[pairs[..., 0]] - mesh.points[pairs[..., 1]], axis=2)
            ends.append(pairs[(length <= PLACE * length.max(axis=0)) & (pairs[..., 0] < pairs[..., 1])])
    short = concatenated(pair.ravel() for pair in ends).reshape(-1, 2)
    if len(short):
        nodes = np.unique(short)
        message = f"{len(nodes):,} nodes have the coordinates of another node of their cell "
        message += f"({request.node_numbers(nodes)}): "
        message += f"{counted(len(np.unique(short, axis=0)), 'edge has', 'edges have')} no length"
        yield Place(message, nodes=nodes, advice="merge the nodes")


#: rules of cells that fit together, which a solver examines before it starts, each with its severity for a solution
FITTING = (
    ("repeated-cell", "error", repeated_cells),
    ("crowded-facet", "error", crowded_facets),
    ("overlapping-cells", "error", overlapping_cells),
    ("mid-nodes-differ", "warning", different_mid_nodes),
    ("coincident-nodes", "warning", edges_without_length),
)
