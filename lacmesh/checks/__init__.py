"""The check: whether a mesh will work with the method, and where it will not. Findings, never an exception.

    numbers, validity, facets  = the cells by themselves, and how they fit together   (solids, facets)
    groups, parents, shape     = the skins: their faces, the cells behind, their turn  (skins)
    dofs                       = the hypothesis of the method, macro-element by macro-element (dofs)
    shapes                     = what curved skins of linear faces are, and whether they are fine enough (shapes)
    bodies, skins in space     = what is torn, hangs, coincides or crosses             (bodies, boxes, crossing)
    facing                     = slave against master: gap, coverage, sides, sizes     (facing)

Every rule stands in `rules.py`; `docs/check.md` lists them.
"""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from lacmesh.checks.findings import Finding, Findings, Where, collect
from lacmesh.checks.rules import RULES, Rule
from lacmesh.checks.subject import Part, Subject, make_subject
from lacmesh.cutting.records import Cut
from lacmesh.errors import RequestError
from lacmesh.mesh import Mesh, spec_list
from lacmesh.origin import from_origin, origin_of_mesh

__all__ = ["RULES", "Finding", "Findings", "Rule", "Where", "check"]

Specs = str | int | Sequence[str | int]


def check(
    mesh: Mesh | Cut,
    slave: Specs | None = None,
    master: Specs | None = None,
    dirichlet: Specs = (),
    *,
    search_distance: float | None = None,
    max_penetration: float | None = None,
    axisymmetric: bool = False,
    surface: str = "smooth",
    crease_angle: float = 40.0,
    recognise: bool | None = None,
) -> Findings:
    """Everything that the mesh, its slave and its master skin say about the method, as findings.

    `slave`: one group or several (a zone each), named as in `cut_skin`; a `Cut` knows its own. `master`: the groups
    that it faces; what compares both is left out without. `dirichlet`: cell or node groups whose displacement is held.
    `search_distance`, `max_penetration`, `axisymmetric`: as in `surface.contact_points`, with macro-elements for faces
    where the distance is not given. `surface`: what the gap is measured between, where cells are linear: `faces`, or
    the `smooth` skins that their nodes lie on, which stay sharp at edges that turn by more than `crease_angle` degrees.
    Lengths are the mesh's. `recognise`: as in `cut_skin`, for a skin that looks cut
    and has no records.

    Raises GroupNotFoundError and RequestError for what was asked; whatever is wrong with the mesh is a finding.

    >>> cells = [("TRIA3", [[0, 1, 2]]), ("SEG2", [[0, 1]])]
    >>> triangle = Mesh.create([[0, 0], [1, 0], [0, 1]], cells, cell_groups={"s": [1]})
    >>> check(triangle, "s").errors[0].rule
    'no-internal-dof'
    """
    if isinstance(mesh, Cut):
        slave = mesh.zones if slave is None else slave
        mesh = mesh.mesh
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
    subject = make_subject(local, _listed(slave), _listed(master), _listed(dirichlet), options, origin, recognise)
    found: list[Finding] = []
    figures: dict[str, Any] = {"slave": list(subject.slave.names), "slave_faces": len(subject.slave)}
    if subject.master is not None:
        figures |= {"master": list(subject.master.names), "master_faces": len(subject.master)}
    for part in _parts(mesh):
        more, what = _done(part, subject)
        found += more
        figures |= what
    return collect(found, figures)


def _listed(specs: Specs | None) -> tuple[str, ...]:
    return () if specs is None else tuple(spec_list(specs))


def _parts(mesh: Mesh) -> list[Part]:
    """The parts of the check, in their order; what is compiled is loaded where it is used."""
    from lacmesh.checks.dofs import check_dofs
    from lacmesh.checks.skins import check_groups, check_parents, check_shape, check_sharing
    from lacmesh.checks.solids import check_facets, check_numbers, check_validity

    if mesh.dim < 2:
        return [check_numbers]
    from lacmesh.checks.bodies import check_bodies, check_skins_in_space
    from lacmesh.checks.facing import check_facing
    from lacmesh.checks.shapes import check_shapes

    cells: list[Part] = [check_numbers, check_validity, check_facets]
    skins: list[Part] = [check_groups, check_parents, check_shape, check_sharing, check_dofs]
    return [*cells, *skins, check_shapes, check_bodies, check_skins_in_space, check_facing]


def _done(part: Part, subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """What a part says; a part that fails on a strange mesh says so, and the others go on."""
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
