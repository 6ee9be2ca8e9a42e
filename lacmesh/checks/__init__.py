"""The check of a mesh against the requirements of the LAC method; faults of the mesh are findings, not exceptions.

    numbers, validity, facets  = the cells by themselves, and how they fit together   (solids, facets)
    groups, parents, shape     = the skins: their faces, parent cells and orientation  (skins)
    dofs                       = the hypothesis of the method, macro-element by macro-element (dofs)
    shapes                     = shapes of curved skins of linear faces, and whether the mesh resolves them (shapes)
    bodies, skins in space     = torn bodies, hanging and coincident nodes, faces that cross (bodies, boxes, crossing)
    facing                     = slave against master: gap, coverage, sides, sizes     (facing)

Every rule is defined in `rules.py`; `docs/check.md` lists them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any

import numpy as np

from lacmesh.checks.findings import Finding, Findings, Where, collect
from lacmesh.checks.pairs import check_one_pair
from lacmesh.checks.rules import RULES, Rule
from lacmesh.checks.subject import CheckStep, Subject, make_subject
from lacmesh.cutting.records import Cut
from lacmesh.errors import RequestError
from lacmesh.mesh import Mesh, MeshLike, Spec, as_mesh, spec_list, spec_text
from lacmesh.origin import from_origin, origin_of_mesh

__all__ = ["RULES", "Finding", "Findings", "Rule", "Where", "check"]

Specs = str | int | Sequence[str | int]
#: parts of the check that examine each pair by itself, and their rules about one skin, of whatever pair
_BY_PAIR = ("check_sharing", "check_skins_in_space", "check_facing")
_OF_ONE_SKIN = ("hanging-node", "self-intersection")


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
    options = {
        "search_distance": search_distance,
        "max_penetration": max_penetration,
        "axisymmetric": axisymmetric,
        "surface": surface,
        "crease_angle": crease_angle,
    }
    origin = origin_of_mesh(mesh) * [not axisymmetric, 1.0, 1.0]
    local = from_origin(mesh, origin)
    slaves, masters, fixed = (_listed(specs) for specs in (slave, master, dirichlet))
    if pairs is None:
        check_one_pair(slaves, masters)
    subject = make_subject(local, slaves, masters, fixed, options, origin, recognise)
    findings: list[Finding] = []
    figures: dict[str, Any] = {"slave": list(subject.slave.names), "slave_faces": len(subject.slave)}
    if subject.master is not None:
        figures |= {"master": list(subject.master.names), "master_faces": len(subject.master)}
    alone = [
        make_subject(local, (spec_text(one),), (spec_text(other),), fixed, options, origin, recognise)
        for one, other in pairs or ()
    ]
    if len(alone) > 1:
        figures["pairs"] = [{"slave": one.slave.group, "master": one.sides[1].group} for one in alone]
    for part in _parts(mesh):
        if len(alone) > 1 and part.__name__ in _BY_PAIR:
            findings += _done(part, replace(subject, master=None))[0] if part.__name__ == "check_sharing" else []
            for one, figures_of_pair in zip(alone, figures["pairs"], strict=True):
                more, what = _done(part, one)
                findings += [_of_pair(finding, one) for finding in more]
                figures_of_pair |= what
        else:
            more, what = _done(part, subject)
            findings += more
            figures |= what
    return collect(list(dict.fromkeys(findings)), figures)


def _of_pair(finding: Finding, pair: Subject) -> Finding:
    """Return a finding with the pair that it is about; one about a single skin stays as it is."""
    if finding.rule in _OF_ONE_SKIN:
        return finding
    slave, master = (side.group for side in pair.sides)
    where = finding.where._replace(pair=(slave, master))
    return replace(finding, where=where, message=f"{slave} on {master}: {finding.message}")


def _listed(specs: Specs | None) -> tuple[str, ...]:
    return () if specs is None else tuple(spec_list(specs))


def _parts(mesh: Mesh) -> list[CheckStep]:
    """Return the parts of the check in their order; modules with compiled kernels are imported only if needed."""
    from lacmesh.checks.dofs import check_dofs
    from lacmesh.checks.skins import check_groups, check_parents, check_shape, check_sharing
    from lacmesh.checks.solids import check_facets, check_numbers, check_validity

    if mesh.dim < 2:
        return [check_numbers]
    from lacmesh.checks.bodies import check_bodies, check_skins_in_space
    from lacmesh.checks.facing import check_facing
    from lacmesh.checks.shapes import check_shapes

    cells: list[CheckStep] = [check_numbers, check_validity, check_facets]
    skins: list[CheckStep] = [check_groups, check_parents, check_shape, check_sharing, check_dofs]
    return [*cells, *skins, check_shapes, check_bodies, check_skins_in_space, check_facing]


def _done(part: CheckStep, subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Run one part of the check; if it fails on an unusual mesh, a finding says so and the other parts go on."""
    try:
        with np.errstate(all="ignore"):
            return part(subject)
    except RequestError:
        raise
    except Exception as error:
        what = part.__name__.replace("check_", "").replace("_", " ")
        message = (
            f"the check of {what} could not be finished ({type(error).__name__}: {error}); report it, with the mesh"
        )
        return [subject.found("not-checked", message)], {}
