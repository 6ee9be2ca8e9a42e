"""Catalogue of the check's rules: severity, meaning, advice. `docs/check.md` is generated from this table."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Rule(NamedTuple):
    """A rule: `severity` (error, warning, info), what it `means`, and what to do (`advice`)."""

    severity: str
    means: str
    advice: str


SEVERITIES = ("error", "warning", "info")

RULES: Mapping[str, Rule] = MappingProxyType(
    {
        # the mesh as a whole
        "no-cells": Rule("error", "the mesh has no cells of dimension 2 or 3", "give the mesh of a body"),
        "not-finite": Rule(
            "error",
            "a coordinate of a node of a cell is not finite; checks that need it are left out",
            "correct the coordinates",
        ),
        "repeated-number": Rule(
            "error", "two cells or two nodes have the same number, or one is negative", "number them again"
        ),
        "repeated-node": Rule("error", "a cell lists a node twice", "replace the cell by one of a simpler type"),
        "repeated-cell": Rule("error", "two cells have the same corners", "remove one of them"),
        "invalid-cell": Rule(
            "error",
            "the Jacobian determinant is zero or negative at a corner, a mid-node or an integration point of the cell",
            "remesh there, or move the nodes",
        ),
        "inverted-cell": Rule(
            "error",
            "a solid cell is inverted: its nodes are listed in reverse; code_aster accepts it, most solvers do not",
            "reverse its node order",
        ),
        "clockwise-cell": Rule(
            "warning",
            "a plane cell is listed clockwise; some solvers refuse it, the cut accepts it",
            "reverse its node order if the solver refuses it",
        ),
        "poor-cell": Rule(
            "warning",
            "the scaled Jacobian of the cell is below 0.1 (1: ideal), whatever its type: its stiffness is badly "
            "conditioned, its stresses are inaccurate",
            "improve the mesh there, or try the other variant of the cut (--hexa)",
        ),
        "crowded-facet": Rule("error", "more than two cells share a facet", "remove the surplus cells"),
        "overlapping-cells": Rule(
            "error", "two valid cells lie on the same side of the facet that they share", "remesh there"
        ),
        "mid-nodes-differ": Rule(
            "error",
            "two cells, or a skin face and its parent cell, share the corners of a facet but not its mid-nodes",
            "elevate the order of both alike, and share the mid-nodes",
        ),
        "torn-body": Rule(
            "warning",
            "a node lies inside an edge of the boundary of the body that it belongs to: the cells do not conform",
            "mesh both sides conformingly, or tie them in the solver",
        ),
        "coincident-nodes": Rule(
            "warning",
            "two nodes have the same coordinates, and not because slave and master touch there: the body is torn, or "
            "there is a crack or another contact",
            "merge the nodes, unless the mesh is meant to be open there",
        ),
        "bodies": Rule("info", "number of separate bodies", "nothing, if this is the expected number"),
        "unreferenced-node": Rule(
            "info", "a node belongs to no cell", "remove it if the solver gives it degrees of freedom"
        ),
        # the skins
        "empty-skin": Rule("error", "a slave or master group has no skin faces", "name the group of the skin"),
        "wrong-dimension": Rule(
            "error",
            "a slave or master group has cells of the dimension of the body",
            "name the group of the skin, one dimension lower",
        ),
        "lower-dimension": Rule(
            "warning", "a slave or master group also has lines or points, which are ignored", "remove them"
        ),
        "unsupported-face": Rule(
            "error",
            "a slave or master face, or the cell behind a slave face, is of order 3 or higher",
            "mesh with linear or quadratic cells",
        ),
        "repeated-face": Rule(
            "error",
            "the slave or the master groups have a face twice, as two cells on the same nodes",
            "remove the copy",
        ),
        "face-in-two-zones": Rule(
            "info",
            "a face is in two slave groups; it belongs to the zone of the first",
            "nothing, or separate the groups",
        ),
        "duplicate": Rule(
            "info",
            "another skin cell, outside the group, lies on the same nodes as a slave face; the cut cuts both",
            "nothing",
        ),
        "no-parent": Rule(
            "error",
            "a slave face has no parent cell",
            "remove the face from the group, or mesh the body; --skin-only cuts a shell",
        ),
        "bare-master": Rule(
            "info", "master faces have no parent cells: a rigid master", "nothing, if the master is rigid"
        ),
        "interface": Rule(
            "warning",
            "a slave or master face lies between two cells, inside the body, where no gap can open",
            "separate the bodies (double the nodes: lacmesh split), or remove the face from the group",
        ),
        "orientation": Rule(
            "warning",
            "skin faces point inward, or, on a surface without parent cells, opposite to their neighbours",
            "lacmesh orient, or cut with --orient outward",
        ),
        "non-manifold": Rule(
            "error",
            "three or more faces of one skin meet at an edge",
            "remove the branching faces from the group",
        ),
        "mixed-order": Rule(
            "warning",
            "a skin has linear and quadratic faces",
            "elevate the order of the linear part (lacmesh convert --order), or make two zones",
        ),
        "faceted": Rule(
            "warning",
            "a curved skin of linear faces is too coarse for a smooth fit: neighbouring faces of a free-form surface "
            "meet at more than 22.5 degrees (fewer than 16 to a full turn), have too few neighbours, or change their "
            "curvature within few faces, as at a fillet, so that heights may be off by 0.005 of a face's size",
            "refine the mesh there, put nodes on the line where two shapes touch, or use quadratic cells",
        ),
        "few-faces": Rule(
            "warning",
            "a circle, cylinder, sphere or cone of few faces, five to eight to a full turn: they turn by more than 40 "
            "degrees, and are taken as that shape since all nodes lie on it",
            "nothing if it is round; --crease-angle 40 if the edges are sharp, as those of a nut",
        ),
        "hanging-node": Rule(
            "error",
            "a node of a skin lies inside an edge of another face of it: the skin does not conform",
            "mesh the skin conformingly",
        ),
        "self-intersection": Rule("error", "faces of one skin cross or overlap", "repair the geometry there"),
        "shared-nodes": Rule(
            "error",
            "slave and master share nodes, where no gap can open",
            "double the nodes (lacmesh split), or remove the faces that touch from one group",
        ),
        "crack-front": Rule(
            "info",
            "slave and master share nodes where they lie on each other, at the front of a crack, which stays closed",
            "nothing, if the skins are the sides of a crack (lacmesh split)",
        ),
        "zones-share-nodes": Rule(
            "warning",
            "two slave zones share nodes: the contact conditions of both act on them",
            "keep a row of faces between the zones, or make them one",
        ),
        # the internal dof
        "no-internal-dof": Rule(
            "error",
            "a macro-element has no internal dof: no node whose shape function vanishes outside it and has a positive "
            "integral",
            "lacmesh cut",
        ),
        "not-cut": Rule("info", "a slave face that is not cut yet has no internal dof", "lacmesh cut"),
        "rim-dof": Rule(
            "warning",
            "a macro-element has internal dofs only on the boundary of the slave skin, where a symmetry condition "
            "would constrain them",
            "cut the face, or give the constrained groups with --dirichlet for a definite answer",
        ),
        "fixed-internal-dof": Rule(
            "error",
            "every internal dof of a macro-element is in a Dirichlet group",
            "remove the slave faces from the Dirichlet group, or from the slave group",
        ),
        "internal-dof": Rule("info", "number of macro-elements with an internal dof", "nothing"),
        "recognised": Rule(
            "info", "the skin is cut, but has no records of the cut; the macro-elements were recognised", "nothing"
        ),
        "half-cut": Rule(
            "warning",
            "only a part of the slave skin is cut",
            "cut the original mesh, with all slave groups at once",
        ),
        "broken-records": Rule(
            "error",
            "the data lac_macro, lac_zone, ... of the mesh are not those of a cut: numbers with holes, faces of a "
            "macro-element that are not connected, or internal dofs where the integrals find none",
            "remove these data, or cut the original mesh again",
        ),
        # slave against master
        "no-coverage": Rule(
            "error",
            "no slave face of a zone finds a master face along its normal, within the search distance",
            "check the groups, their positions and their orientation, or increase --search-distance",
        ),
        "partial-coverage": Rule(
            "warning",
            "the master covers less than 95 % of a macro-element, or none of it",
            "nothing, if the slave is meant to extend beyond the master; pressures there are zero or act on a part",
        ),
        "wrong-side": Rule(
            "warning",
            "slave and master normals are not opposite where they face each other, or the master lies behind the slave",
            "orient the skins outward (lacmesh orient), and check which surfaces face each other",
        ),
        "gap": Rule("info", "the signed gap between slave and master: open > 0, penetration < 0", "nothing"),
        "size-ratio": Rule(
            "warning",
            "the faces of slave and master differ much in size",
            "refine the coarser side, which limits the resolution of the pressure",
        ),
        "better-slave": Rule(
            "info",
            "a hint from the meshes alone: by a rule of thumb the master is the coarser and stiffer side",
            "exchange slave and master, if the slave is not the softer body",
        ),
        "facing-left-out": Rule(
            "warning",
            "gap and coverage cannot be computed: segments that are not in one plane, or coordinates not finite",
            "correct the mesh; all other checks were done",
        ),
        "not-checked": Rule("error", "a part of the check failed", "report it, with the mesh"),
    }
)


def named(message: str, rule: str) -> str:
    """Return the message of another program about what a rule of the check finds, with the name of the rule.

    >>> named("master 'top' is in front of 30 % of slave 'low'", "partial-coverage")
    "master 'top' is in front of 30 % of slave 'low' (lacmesh check: partial-coverage)"
    """
    if rule not in RULES:
        raise KeyError(rule)
    return f"{message} (lacmesh check: {rule})"
