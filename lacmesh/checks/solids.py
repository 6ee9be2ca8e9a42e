"""Checks of the cells: their ids, nodes and facets, and whether their maps can be inverted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.subject import Subject
from lacmesh.cutting.records import is_cut
from lacmesh.errors import some
from lacmesh.mesh import Block, Ints, Mesh, mask_of, places_of
from lacmesh.reference.quadrature import signed_area
from lacmesh.topology.facets import CROWDED, FACETS, Solid
from lacmesh.topology.skin import lacking, mixed_bits

_WORST = 5
_NEITHER = -1
_PIECE = 1 << 14


def check_numbers(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check that the mesh has cells of a body, unique ids, finite coordinates and no node without a cell."""
    mesh, findings = subject.mesh, []
    if mesh.dim < 2 or (mesh.dim == subject.dim < mesh.space_dim and not is_cut(mesh)):
        findings.append(subject.found("no-cells", f"{lacking(mesh, max(mesh.dim, 1) + 1)}: there is no body to check"))
    for what, numbers in (("cell", mesh.cell_number), ("node", mesh.node_number)):
        values, first, count = np.unique(numbers, return_index=True, return_counts=True)
        odd = first[(count > 1) | (values < 0)]
        if len(odd):
            message = f"{counted(len(odd), f'{what} number is', f'{what} numbers are')} repeated or negative "
            message += f"({some(numbers[odd])}); number the {what}s again"
            rows = (odd, None) if what == "cell" else (None, odd)
            findings.append(subject.found("repeated-number", message, *rows))
    used = mask_of(mesh.n_nodes, *(block.nodes for block in mesh.blocks))
    infinite = np.flatnonzero(used & ~subject.finite)
    if len(infinite):
        message = counted(len(infinite), "node has", "nodes have")
        message += f" coordinates that are not finite, or huge ({subject.node_numbers(infinite)}); correct them"
        findings.append(subject.found("not-finite", message, nodes=infinite))
    free = np.flatnonzero(~used)
    if len(free):
        message = counted(len(free), "node belongs", "nodes belong")
        message += f" to no cell ({subject.node_numbers(free)}); nothing to do unless the solver gives them dofs"
        findings.append(subject.found("unreferenced-node", message, nodes=free))
    return findings, {"nodes": mesh.n_nodes, "cells": mesh.n_cells}


def check_validity(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check for repeated nodes in a cell, and for Jacobian determinants <= 0 where solvers evaluate them."""
    from lacmesh.quality.determinant import validity_among  # not for those who ask how cells fit together alone
    from lacmesh.quality.measures import POOR

    mesh = subject.mesh
    repeated = _with_repeated_nodes(mesh)
    value, poor = np.ones(mesh.n_cells), np.ones(mesh.n_cells)
    negative = np.zeros(mesh.n_cells, bool)
    for k, block in enumerate(mesh.blocks):
        if block.type not in CELLS or not CELLS[block.type].dim or not len(block.nodes):
            continue
        cells = slice(mesh.offsets[k], mesh.offsets[k + 1])
        with np.errstate(all="ignore"):  # places that are no numbers have a finding of their own
            value[cells] = validity_among(block.type, mesh.points, block.nodes).least
            if CELLS[block.type].dim == mesh.dim:
                poor[cells] = _quality(mesh, block)
            if CELLS[block.type].dim == 2 == mesh.dim and mesh.space_dim == 2:
                negative[cells] = signed_area(block.type, mesh.points[block.nodes]) < 0
    known = np.ones(mesh.n_cells, bool)
    for k, block in enumerate(mesh.blocks):
        if not subject.finite.all():
            known[mesh.offsets[k] : mesh.offsets[k + 1]] = subject.finite[block.nodes].all(axis=1)
    invalid = np.flatnonzero(~(value > 0) & ~repeated & known)
    inverted = invalid[_inversion(subject, invalid) == 1]
    invalid = np.setdiff1d(invalid, inverted)
    clockwise = np.flatnonzero(negative & (value > 0) & ~repeated & known)
    bad = np.flatnonzero((poor < POOR) & (value > 0) & ~repeated & known)
    findings = _invalid(subject, np.flatnonzero(repeated), invalid, inverted)
    return findings + _doubtful(subject, clockwise, bad, poor), {
        "invalid_cells": len(invalid) + len(inverted),
        "worst_quality": float(np.fmin.reduce(poor[known], initial=1.0)),
    }


def _quality(mesh: Mesh, block: Block) -> NDArray:
    """Scaled Jacobian of the cells of a block, as in `lacmesh quality`; that at the corners for quadratic cells."""
    from lacmesh.quality import corner_jacobian
    from lacmesh.quality.measures import measure_cells

    if CELLS[block.type].order == 1:
        return measure_cells(block.type, mesh.points, block.nodes, ["scaled_jacobian"])["scaled_jacobian"]
    starts = range(0, len(block.nodes), _PIECE)
    return np.concatenate([corner_jacobian(block.type, mesh.points[block.nodes[s : s + _PIECE]]) for s in starts])


def _invalid(subject: Subject, repeated: Ints, invalid: Ints, inverted: Ints) -> list[Finding]:
    findings = []
    if len(repeated):
        message = counted(len(repeated), "cell lists", "cells list")
        message += f" a node twice ({subject.numbers(repeated)}); use a simpler type for them"
        findings.append(subject.found("repeated-node", message, repeated))
    if len(invalid):
        message = (
            f"the Jacobian determinant of {counted(len(invalid), 'cell')} is not positive where solvers evaluate it "
        )
        message += f"({subject.numbers(invalid)}); remesh there, or move the nodes"
        findings.append(subject.found("invalid-cell", message, invalid))
    if len(inverted):
        message = counted(len(inverted), "cell is", "cells are")
        message += f" inverted ({subject.numbers(inverted)}); reverse their node order"
        findings.append(subject.found("inverted-cell", message, inverted))
    return findings


def _doubtful(subject: Subject, clockwise: Ints, bad: Ints, quality: NDArray) -> list[Finding]:
    from lacmesh.quality.measures import POOR

    findings = []
    if len(clockwise):
        message = counted(len(clockwise), "plane cell is", "plane cells are")
        message += (
            f" listed clockwise ({subject.numbers(clockwise)}); reverse their node order if the solver refuses them"
        )
        findings.append(subject.found("clockwise-cell", message, clockwise))
    if len(bad):
        worst = bad[np.argsort(quality[bad].round(9), kind="stable")]  # the first of those that are equal
        named = ", ".join(f"{subject.mesh.cell_number[c]} ({quality[c]:.3f})" for c in worst[:_WORST])
        message = counted(len(bad), "cell has", "cells have")
        message += f" a scaled Jacobian below {POOR}, worst first: {named}; {_advice(subject, bad)}"
        findings.append(subject.found("poor-cell", message, worst))
    return findings


def _advice(subject: Subject, poor: Ints) -> str:
    """Advice about poor cells; the quality of those that a cut made depends on their parents and on the variant."""
    parent = subject.mesh.cell_data.get("lac_parent")
    children = poor[:0] if parent is None else poor[parent[poor] >= 0]
    if not len(children):
        return "improve the mesh there (lacmesh quality says more)"
    families = {CELLS[kind].family for kind, _, _ in subject.mesh.select(children)}
    other = ", or cut with --hexa auto" if families & {"HEXA", "PYRAM"} else ""
    return f"{len(children):,} of them come from subdivision; improve the mesh there{other}"


def _with_repeated_nodes(mesh: Mesh) -> NDArray[np.bool_]:
    """(n_cells,): True for cells that list a node twice."""
    out = np.zeros(mesh.n_cells, bool)
    for k, block in enumerate(mesh.blocks):
        n = block.nodes.shape[1]
        twice = out[mesh.offsets[k] : mesh.offsets[k + 1]]
        columns = np.ascontiguousarray(block.nodes.T)
        for a in range(n):
            for b in range(a):
                twice |= columns[a] == columns[b]
    return out


def check_facets(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check that the cells fit together: each facet has one or two cells, on opposite sides, with the same nodes."""
    facets = subject.facets
    solid, opposite, findings = facets.solid, facets.opposite, []
    if len(facets.copies):
        message = (
            f"{counted(len(facets.copies), 'cell has', 'cells have')} the same corners as others "
            f"({subject.numbers(facets.copies)}); remove them"
        )
        findings.append(subject.found("repeated-cell", message, facets.copies))
    crowded = np.unique(np.flatnonzero(opposite == CROWDED) // FACETS)
    if len(crowded):
        cells = solid.cells[crowded]
        message = f"more than two cells share a facet (cells {subject.numbers(cells)}); remove the surplus cells"
        findings.append(subject.found("crowded-facet", message, cells))
    findings += _overlapping(subject, solid, opposite, facets.same)
    findings += _other_mid_nodes(subject, solid, opposite)
    return findings, {}


def _overlapping(subject: Subject, solid: Solid, opposite: Ints, same: NDArray[np.bool_]) -> list[Finding]:
    """Report cells that overlap: two cells of the same orientation that list their common facet with the same winding.

    They lie on the same side of it.
    """
    mesh = subject.mesh
    if mesh.dim == 2 and mesh.space_dim == 3:  # a surface in space has no right way out
        return []
    odd = np.flatnonzero(same)
    odd = odd[odd < opposite[odd]]
    a, b = odd // FACETS, opposite[odd] // FACETS
    sides = [_inversion(subject, solid.cells[rows]) for rows in (a, b)]
    overlap = np.flatnonzero((sides[0] == sides[1]) & (sides[0] != _NEITHER))
    cells = np.unique(solid.cells[np.concatenate([a[overlap], b[overlap]])])
    if not len(cells):
        return []
    message = (
        f"{counted(len(overlap), 'pair of cells lies', 'pairs of cells lie')} on the same side of the facet that they "
        f"share ({subject.numbers(cells)})"
    )
    return [subject.found("overlapping-cells", f"{message}; remesh there", cells)]


def _inversion(subject: Subject, cells: Ints) -> Ints:
    """(k,): 1 for cells inverted everywhere (clockwise in the plane), 0 for valid ones, _NEITHER for others."""
    from lacmesh.quality import validity

    mesh = subject.mesh
    out = np.full(len(cells), _NEITHER)
    order = np.argsort(cells, kind="stable")
    done = 0
    for kind, chosen, nodes in mesh.select(cells[order]):
        rows = order[done : done + len(chosen)]
        done += len(chosen)
        if kind not in CELLS:
            continue
        x = mesh.points[nodes]
        with np.errstate(all="ignore"):
            valid = validity(kind, x) > 0
            if CELLS[kind].dim == 3:
                back = validity(kind, x * [-1, 1, 1]) > 0
                out[rows[valid]], out[rows[back]] = 0, 1
            elif CELLS[kind].dim == 2:
                out[rows[valid]] = signed_area(kind, x[valid]) < 0
    return out


def _other_mid_nodes(subject: Subject, solid: Solid, opposite: Ints) -> list[Finding]:
    """Report facets at which two cells share the corners but not the mid-nodes."""
    mesh = subject.mesh
    orders = {ALL_CELLS[b.type].order for b in mesh.blocks if ALL_CELLS[b.type].dim == mesh.dim and len(b.nodes)}
    if orders <= {1}:
        return []
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
    if not len(cells):
        return []
    message = f"the cells on both sides of {counted(len(at), 'facet')} share corners but not mid-nodes "
    message += f"({subject.numbers(cells)})"
    return [subject.found("mid-nodes-differ", f"{message}; elevate the order of both alike", cells)]
