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
            "a node that cells use has a coordinate that is not a number, or infinite; what needs it is left out",
            "correct the coordinates",
        ),
        "repeated-number": Rule(
            "error", "two cells or two nodes have the same number, or one is negative", "number them again"
        ),
        "repeated-node": Rule("error", "a cell lists a node twice", "replace the cell by one of a simpler type"),
        "repeated-cell": Rule("error", "two cells stand on the same corners", "remove one of them"),
        "invalid-cell": Rule(
            "error",
            "the Jacobian determinant is zero or negative at a corner, a mid-node or an integration point of the cell",
            "mesh again there, or move the nodes",
        ),
        "inverted-cell": Rule(
            "error",
            "a solid cell is inverted: its nodes are listed the other way round; code_aster takes it, most refuse",
            "list its nodes the other way",
        ),
        "clockwise-cell": Rule(
            "warning",
            "a plane cell is listed clockwise; some solvers refuse it, the cut does not mind",
            "list its nodes the other way if the solver refuses it",
        ),
        "poor-cell": Rule(
            "warning",
            "the scaled Jacobian of the cell is below 0.1 (1: ideal), whatever its type: its stiffness is badly "
            "conditioned, its stresses are inaccurate",
            "mesh better there, or try the other variant of the cut (--hexa)",
        ),
        "crowded-facet": Rule("error", "more than two cells share a facet", "remove the cell that is too many"),
        "overlapping-cells": Rule(
            "error", "two valid cells lie on the same side of the facet that they share", "mesh again there"
        ),
        "mid-nodes-differ": Rule(
            "error",
            "two cells, or a skin face and the cell behind it, share the corners of a facet and not its mid-nodes",
            "raise the order of both alike, and share the mid-nodes",
        ),
        "torn-body": Rule(
            "warning",
            "a node lies inside an edge of the boundary of the body that it belongs to: the cells do not conform",
            "mesh both sides alike, or tie them in the solver",
        ),
        "coincident-nodes": Rule(
            "warning",
            "two nodes stand at the same place, and slave and master do not explain it: the body is torn, or it is a "
            "crack or another contact",
            "merge the nodes, unless the mesh is meant to be open there",
        ),
        "bodies": Rule("info", "how many separate bodies the cells make", "nothing, if that is the number expected"),
        "unreferenced-node": Rule(
            "info", "a node belongs to no cell", "remove it if the solver gives it degrees of freedom"
        ),
        # the skins
        "empty-skin": Rule("error", "a slave or master group holds no skin faces", "name the group of the skin"),
        "wrong-dimension": Rule(
            "error",
            "a slave or master group holds cells of the body's own dimension",
            "name the group of the skin, one dimension lower",
        ),
        "lower-dimension": Rule(
            "warning", "a slave or master group also holds lines or points, which are passed over", "take them out"
        ),
        "unsupported-face": Rule(
            "error",
            "a slave or master face, or the cell behind a slave face, is of order 3 or higher",
            "mesh with linear or quadratic cells",
        ),
        "repeated-face": Rule(
            "error",
            "a face stands twice in the slave or in the master groups, as two cells on the same nodes",
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
            "a slave face has no cell behind it",
            "take the face out of the group, or mesh the body; a shell is cut with --skin-only",
        ),
        "bare-master": Rule(
            "info", "master faces have no cells behind them: a rigid master", "nothing, if the master is rigid"
        ),
        "interface": Rule(
            "warning",
            "a slave or master face lies between two cells: it is inside the body, where nothing can open",
            "separate the bodies (double the nodes), or take the face out of the group",
        ),
        "orientation": Rule(
            "warning",
            "skin faces point inward or, without cells behind them, against their neighbours",
            "lacmesh orient, or cut with --orient outward",
        ),
        "non-manifold": Rule(
            "error",
            "three or more faces of one skin meet at an edge",
            "take the faces that branch off out of the group",
        ),
        "mixed-order": Rule(
            "warning",
            "a skin has linear and quadratic faces",
            "raise the order of the linear part (lacmesh convert --order), or make two zones",
        ),
        "faceted": Rule(
            "warning",
            "a curved skin of linear faces is too coarse to be taken for smooth: faces of no exact shape turn by more "
            "than 22.5 degrees to the next (fewer than 16 to a turn), or have too few neighbours for a fit",
            "mesh finer there, or with quadratic cells",
        ),
        "hanging-node": Rule(
            "error",
            "a node of a skin lies inside an edge of another face of it: the skin does not conform",
            "mesh the skin conformingly",
        ),
        "self-intersection": Rule("error", "faces of one skin cross or overlap", "repair the geometry there"),
        "shared-nodes": Rule(
            "error",
            "slave and master share nodes: they cannot open there",
            "double the nodes, or take the faces that touch out of one group",
        ),
        "zones-share-nodes": Rule(
            "warning",
            "two slave zones share nodes: the contact conditions of both act on them",
            "keep a row of faces between the zones, or make them one",
        ),
        # the internal dof
        "no-internal-dof": Rule(
            "error",
            "a macro-element owns no internal dof: no node whose function lives inside it with a positive integral",
            "lacmesh cut",
        ),
        "rim-dof": Rule(
            "warning",
            "a macro-element owns dofs only on the boundary of the slave skin, which a symmetry condition would take",
            "cut the face, or name the conditions with --dirichlet to know",
        ),
        "fixed-internal-dof": Rule(
            "error",
            "every internal dof of a macro-element is in a Dirichlet group",
            "take the slave faces out of the Dirichlet group, or out of the slave group",
        ),
        "internal-dof": Rule("info", "how many macro-elements own an internal dof", "nothing"),
        "recognised": Rule("info", "the skin is cut; its records were gone and are found again", "nothing"),
        "half-cut": Rule(
            "warning",
            "a part of the slave skin is cut, and another is not",
            "cut the mesh it came from, with every slave group at once",
        ),
        "broken-records": Rule(
            "error",
            "the data lac_macro, lac_zone, ... of the mesh are not those of a cut: numbers with holes, faces of a "
            "macro-element that are not connected, or internal dofs where the integrals find none",
            "take them out, or cut the original again",
        ),
        # slave against master
        "no-coverage": Rule(
            "error",
            "no slave face of a zone finds a master face along its normal, as far as it looks",
            "check the groups, their places and their sides, or look farther (--search-distance)",
        ),
        "partial-coverage": Rule(
            "warning",
            "the master covers less than 95 % of a macro-element, or nothing of it",
            "nothing, if the slave is meant to reach beyond the master; such pressures are zero or act on a part",
        ),
        "wrong-side": Rule(
            "warning",
            "slave and master normals do not oppose each other where they face, or the master lies behind the slave",
            "flip the skins outward (lacmesh orient), and check which surfaces face each other",
        ),
        "gap": Rule("info", "the signed gap between slave and master: open > 0, penetration < 0", "nothing"),
        "size-ratio": Rule(
            "warning",
            "the faces of slave and master differ much in size where they meet",
            "refine the coarser side: the pressure is no finer than the coarser of both",
        ),
        "better-slave": Rule(
            "info",
            "a hint, from the meshes alone: the rule of thumb takes the coarser and stiffer side as master",
            "exchange slave and master, if the stiffness of the bodies does not speak against it",
        ),
        "facing-left-out": Rule(
            "warning",
            "slave and master cannot be measured against each other: segments that do not lie in a plane, or places "
            "that are no numbers",
            "correct the mesh; everything else was checked",
        ),
        "not-checked": Rule("error", "a part of the check could not be done", "report it, with the mesh"),
    }
)
