"""The check of a mesh against the requirements of the LAC method; faults of the mesh are findings, not exceptions.

    findings, request  = the rules and what they find; the mesh, its skins and the pairs
    cells              = the cells by themselves, and how they fit together
    skins              = the faces of the skins, their parent cells and orientation, the nodes that they share
    dofs               = the hypothesis of the method, macro-element by macro-element
    bodies             = torn bodies, hanging and coincident nodes, faces that cross
    facing             = shapes of curved skins; slave against master: gap, coverage, sides, sizes

Every rule is a function with the decorator `rule`; `docs/check.md` lists them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any

import numpy as np

from lacmesh.checks import cells, skins, dofs, bodies, facing  # isort: skip  # the order of the rules
from lacmesh.checks.findings import RULES, SEVERITIES, Finding, Findings, Place, Rule, Where
from lacmesh.checks.request import Request, check_one_pair
from lacmesh.cutting.records import Cut
from lacmesh.errors import RequestError
from lacmesh.mesh import Mesh, MeshLike, Spec, as_mesh, spec_list, spec_text
from lacmesh.origin import from_origin, origin_of_mesh

__all__ = ["RULES", "Finding", "Findings", "Rule", "Where", "bodies", "check", "dofs", "facing", "solution_defects"]

RULES["not-checked"] = Rule("error", "a part of the check failed", "report it, with the mesh", [])
#: rules that need no cells of dimension 2 or 3
_OF_ANY_MESH = ("no-cells", "repeated-number", "not-finite", "unreferenced-node")
Specs = str | int | Sequence[str | int]


def check(
    mesh: MeshLike | Cut,
    slave: Specs | None = None,
    master: Specs | None = None,
    dirichlet: Specs = (),
    *,
    search_distance: float | None = None,
    max_penetration: float | None = None,
    axisymmetric: bool = False,
    surface: str = "smooth",
    crease_angle: float | None = None,
    recognise: bool | None = None,
    pairs: Sequence[tuple[Spec, Spec]] | None = None,
) -> Findings:
    """Check a mesh, its slave and its master skin against the requirements of the LAC method; return the findings.

    `slave`: one group or several (a zone each), named as in `cut_skin`; a `Cut` knows its own. `master`: the groups
    that the slave faces; without them the checks that compare both skins are left out. `dirichlet`: cell or node groups
    whose displacement is prescribed. `search_distance`, `max_penetration`, `axisymmetric`: as in
    `surface.contact_points`; a search distance that is not given follows from the macro-elements, not from the faces.
    `surface`: the surfaces between which the gap of linear cells is measured: the `faces` themselves, or the `smooth`
    skins through their nodes, which keep edges where the normal turns by more than `crease_angle` degrees. Lengths are
    in the units of the mesh. `recognise`: as in `cut_skin`, for a skin that looks cut and has no records. `pairs`: in
    place of `slave` and `master`, (slave, master) of each contact, each of which is examined by itself; several slaves
    with several masters need them.

    Raises GroupNotFoundError and RequestError if the request is wrong; every fault of the mesh is a finding.

    >>> cells = [("TRIA3", [[0, 1, 2]]), ("SEG2", [[0, 1]])]
    >>> triangle = Mesh.create([[0, 0], [1, 0], [0, 1]], cells, cell_groups={"s": [1]})
    >>> check(triangle, "s").rules
    ('not-cut', 'bodies')
    """
    if pairs is not None:
        if slave is not None or master is not None:
            raise RequestError("give pairs, or slave and master, and not both")
        slave, master = (tuple(dict.fromkeys(spec_text(pair[k]) for pair in pairs)) for k in (0, 1))
    if isinstance(mesh, Cut):
        slave = mesh.zones if slave is None else slave
        mesh = mesh.mesh
    mesh = as_mesh(mesh)
    if slave is None or (not isinstance(slave, (str, int, Integral)) and not len(slave)):
        raise RequestError("no slave group was given")
    if axisymmetric and mesh.dim == 3:
        raise RequestError("an axisymmetric model is plane, and this mesh has cells of dimension 3")
    options: dict[str, Any] = {"search_distance": search_distance, "max_penetration": max_penetration}
    options |= {"axisymmetric": axisymmetric, "surface": surface, "crease_angle": crease_angle}
    origin = origin_of_mesh(mesh) * [not axisymmetric, 1.0, 1.0]
    local = from_origin(mesh, origin)
    slaves, masters, fixed = (() if specs is None else tuple(spec_list(specs)) for specs in (slave, master, dirichlet))
    if pairs is None:
        check_one_pair(slaves, masters)
    single = [((spec_text(one),), (spec_text(other),)) for one, other in pairs or ()]
    request, *by_pair = (
        Request.of(local, origin, *sides, fixed, recognise, **options) for sides in [(slaves, masters), *single]
    )
    return _examined(request, by_pair if len(by_pair) > 1 else [])


def _examined(request: Request, by_pair: Sequence[Request]) -> Findings:
    """Return the findings and figures of all rules; those of pairs are about each of several pairs by itself."""
    findings: list[Finding] = []
    failures: dict[str, list[str]] = {}
    figures: dict[str, Any] = {}
    for side in request.sides:
        figures |= {side.what: list(side.names), f"{side.what}_faces": len(side)}
    figures |= {"nodes": request.mesh.n_nodes, "cells": request.mesh.n_cells}
    if by_pair:
        figures["pairs"] = [{side.what: side.group for side in one.sides} for one in by_pair]
    every = RULES if request.mesh.dim > 1 else _OF_ANY_MESH
    for name, scope, function in ((one, *part) for one in every for part in RULES[one].functions):
        several = by_pair if "pair" in scope else ()
        for k, one in enumerate(several or [request]):
            try:
                with np.errstate(all="ignore"):
                    results = [
                        (result, group) for group, *skin in _arguments(scope, one) for result in function(one, *skin)
                    ]
                    more = [one.finding(name, result, group) for result, group in results if isinstance(result, Place)]
            except RequestError:
                raise
            except Exception as error:  # an unusual mesh: the other rules go on
                failures.setdefault(f"{type(error).__name__}: {error}", []).append(name)
                continue
            for result, _ in results:
                if isinstance(result, dict):
                    (figures["pairs"][k] if several else figures).update(result)
            if several and scope == "pair":
                pair = one.slave.group, one.sides[-1].group
                more = [
                    replace(f, where=replace(f.where, pair=pair), message=f"{pair[0]} on {pair[1]}: {f.message}")
                    for f in more
                ]
            findings += more
    for failure, of in failures.items():
        message = f"the check of {', '.join(dict.fromkeys(of))} could not be finished ({failure})"
        findings.append(request.finding("not-checked", Place(message)))
    ranked = sorted(dict.fromkeys(findings), key=lambda f: SEVERITIES.index(f.severity))
    counts = {severity: sum(f.severity == severity for f in ranked) for severity in SEVERITIES}
    return Findings(tuple(ranked), {"ok": counts["error"] == 0, **counts, **figures})


def _arguments(scope: str, request: Request) -> list[tuple[Any, ...]]:
    """Return the group of what a function finds, and what it gets besides the request: for skins each of them."""
    if scope == "mesh":
        return [(None,)]
    if scope in ("slave", "pair"):
        return [(request.slave.group,)] if scope == "pair" or len(request.slave) else []
    return [(side.group, side) for side in request.sides if len(side) or scope == "group"]


def solution_defects(mesh: Mesh, pairs: Iterable[tuple[str, str]]) -> tuple[Finding, ...]:
    """Return findings of `check` that make a solution wrong without showing in it (errors), or may do so (warnings).

    `pairs`: slave and master of each contact; a finding about one of them names it in `where`. Certainly wrong:
    duplicate or overlapping cells and non-manifold facets, where material counts twice; slave faces with all their
    nodes on the master, which can neither open nor transmit pressure. Possibly wrong: mid-nodes that two neighbouring
    cells do not share, where the body is torn; some nodes shared by slave and master, but for the front of a crack;
    cells with two coincident nodes. It is cheap compared with a solution: nothing is searched in space.
    """
    with np.errstate(all="ignore"):  # coordinates that are not finite are reported elsewhere
        return tuple(_defects(mesh, pairs))


def _defects(mesh: Mesh, pairs: Iterable[tuple[str, str]]) -> Iterator[Finding]:
    origin = origin_of_mesh(mesh)
    mesh = from_origin(mesh, origin)
    request = Request.of(mesh, origin)
    for rule, severity, function in cells.FITTING:
        yield from (request.finding(rule, place, severity=severity) for place in function(request))
    for pair in dict.fromkeys(pairs):
        if len(np.intersect1d(mesh.cells_of(pair[0]), mesh.cells_of(pair[1]))):
            continue  # one skin on both sides makes no contact at all, which its own message says
        request = Request.of(mesh, origin, pair[:1], pair[1:])
        severity = "error" if skins.is_glued(request) else "warning"
        for finding in (
            request.finding("shared-nodes", place, severity=severity) for place in skins.shared_nodes(request)
        ):
            yield replace(finding, where=replace(finding.where, pair=pair))
