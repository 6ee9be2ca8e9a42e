"""Choice of the pattern of each slave face, before anything is cut: a parent uses one variant for all its slave faces.

variants = the cone where a face cannot be left whole, and the ring where its parents allow it (allowed_variants)
patterns = the one asked for, or of both the one with the higher minimum Jacobian                   (compare_variants)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.patterns import RING_PARENTS, WHOLE_FACES
from lacmesh.cutting.select import Selection
from lacmesh.cutting.subdivide import CONE_CODE, RING_CODE, WHOLE_CODE, Subdivision, subdivide
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.quality import corner_jacobian
from lacmesh.topology.components import label_components
from lacmesh.topology.skin import FACE_TYPES, Faces

HEXA = ("pyramid", "hexa", "auto")
_WHOLE_TYPES = np.array([name in WHOLE_FACES for name in FACE_TYPES])
_RING_TYPES = np.array([name in ("SEG2", "QUAD4", "QUAD8") for name in FACE_TYPES])

Bools = NDArray[np.bool_]


class AllowedVariants(NamedTuple):
    """The faces that the ring can cut, `ring` (f,), and labels of faces that must be cut alike, `component` (f,)."""

    ring: Bools
    component: Ints


def allowed_variants(mesh: Mesh, selection: Selection, hexa: str, skin_only: bool) -> AllowedVariants:
    """Find the faces that the ring can cut, as their parents and `hexa` allow it, and the sets that are cut alike."""
    faces, parents = selection.faces, selection.parents
    alone: Ints = np.arange(len(faces))
    if skin_only:
        of_surface = _RING_TYPES[faces.type] & (faces.type != FACE_TYPES.index("SEG2"))
        return AllowedVariants(of_surface & (hexa != "pyramid"), alone)
    able = _allow_ring(mesh, parents.cell, hexa)
    ring = _RING_TYPES[faces.type].copy()
    ring[parents.face[~able]] = False
    if hexa != "auto" and not (able & ~ring[parents.face]).any():
        return AllowedVariants(ring, alone)
    component = _connected_by_parents(selection, able)
    spoilt = np.zeros(len(faces), bool)
    spoilt[component[~ring & ~_WHOLE_TYPES[faces.type]]] = True
    return AllowedVariants(ring & ~spoilt[component], component)


def _allow_ring(mesh: Mesh, cells: Ints, hexa: str) -> Bools:
    """(k,): True for parents that the ring can cut; with `hexa` "pyramid" it cuts no hexahedron."""
    types = [b.type in RING_PARENTS and (hexa != "pyramid" or b.type == "QUAD4") for b in mesh.blocks]
    return np.array(types, bool)[np.searchsorted(mesh.offsets, cells, side="right") - 1]


def _connected_by_parents(selection: Selection, able: Bools) -> Ints:
    """(f,): labels of faces that must be cut alike because parents that allow the ring connect them."""
    n_faces = len(selection.faces)
    _, cell = np.unique(selection.parents.cell[able], return_inverse=True)
    face = selection.parents.face[able]
    labels = label_components(face, n_faces + cell, n_faces + int(cell.max(initial=-1)) + 1)[:n_faces]
    return np.unique(labels, return_inverse=True)[1]


def with_ring(faces: Faces, ring: Bools) -> Ints:
    """(f,): the patterns of faces, codes of PATTERNS: whole if the type allows it, else the ring on `ring`, or cone."""
    return np.where(_WHOLE_TYPES[faces.type], WHOLE_CODE, np.where(ring, RING_CODE, CONE_CODE))


def compare_variants(
    mesh: Mesh, selection: Selection, variants: AllowedVariants, shape: tuple[float, float]
) -> tuple[Ints, Subdivision]:
    """Cut all sets of faces both ways, and keep for each the variant with the higher minimum Jacobian; ring on a tie.

    Returns the patterns (f,) and the subdivision by them. `shape`: of the ring, its half-width and its depth.
    """
    ring, component = variants
    cut_by = [
        (patterns, subdivide(mesh, selection.faces, patterns, selection.skin, selection.parents, *shape))
        for patterns in (with_ring(selection.faces, rows) for rows in (np.zeros_like(ring), ring))
    ]
    worst_of_cone, worst_of_ring = (_worst_of_sets(mesh, selection, component, cut) for _, cut in cut_by)
    chosen = with_ring(selection.faces, ring & (worst_of_ring >= worst_of_cone)[component])
    for patterns, cut in cut_by:
        if np.array_equal(patterns, chosen):
            return patterns, cut
    return chosen, subdivide(mesh, selection.faces, chosen, selection.skin, selection.parents, *shape)


def _worst_of_sets(mesh: Mesh, selection: Selection, component: Ints, cut: Subdivision) -> Floats:
    """(f,): the least corner Jacobian of the children of each set of faces, by the label of the set; inf for none."""
    points = np.vstack([mesh.points, np.zeros((cut.n_nodes - mesh.n_nodes, 3))])
    for nodes in cut.new_nodes:
        points[nodes.ids] = nodes.values(points)
    face_of_cell = np.full(mesh.n_cells, -1)
    face_of_cell[selection.parents.cell] = selection.parents.face
    face_of_cell[selection.skin.cell] = selection.skin.face
    least = np.full(len(selection.faces), np.inf)
    for block in cut.children:
        quality = corner_jacobian(block.type, points[block.nodes], mesh.space_dim == 2)
        np.minimum.at(least, component[face_of_cell[block.parent]], quality)
    return least
