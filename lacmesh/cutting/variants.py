"""Choice of the pattern of each slave face, before anything is cut: a parent uses one variant for all its slave faces.

variants = the cone where a face cannot be left whole, and the ring where its parents allow it (allowed_variants)
patterns = the one asked for, or of both the one with the higher minimum Jacobian                   (compare_variants)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.patterns import RING_PARENTS, WHOLE_FACES
from lacmesh.cutting.select import Selection
from lacmesh.cutting.subdivide import CONE_CODE, RING_CODE, WHOLE_CODE, Subdivision, node_values, subdivide
from lacmesh.mesh import Floats, Ints, Mesh, mask_of
from lacmesh.quality import corner_jacobian
from lacmesh.topology.bodies import label_components
from lacmesh.topology.skin import FACE_TYPES, Faces

HEXA = ("pyramid", "hexa", "auto")
_WHOLE_TYPES = np.array([name in WHOLE_FACES for name in FACE_TYPES])
_RING_TYPES = np.array([name in ("SEG2", "QUAD4", "QUAD8") for name in FACE_TYPES])

Bools = NDArray[np.bool_]


def allowed_variants(mesh: Mesh, selection: Selection, hexa: str, skin_only: bool) -> tuple[Bools, Ints]:
    """(f,): True for faces that the ring can cut, by their parents and `hexa`; (f,): labels of faces cut alike."""
    faces, parents = selection.faces, selection.parents
    alone: Ints = np.arange(len(faces))
    if skin_only:
        of_surface = _RING_TYPES[faces.type] & (faces.type != FACE_TYPES.index("SEG2"))
        return of_surface & (hexa != "pyramid"), alone
    able = _allow_ring(mesh, parents.cell, hexa)
    ring = _RING_TYPES[faces.type].copy()
    ring[parents.face[~able]] = False
    if hexa != "auto" and not (able & ~ring[parents.face]).any():
        return ring, alone
    component = _connected_by_parents(selection, able)
    spoilt = mask_of(len(faces), component[~ring & ~_WHOLE_TYPES[faces.type]])
    return ring & ~spoilt[component], component


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
    mesh: Mesh, selection: Selection, ring: Bools, component: Ints, shape: tuple[float, float]
) -> Subdivision:
    """Cut all sets of faces both ways, and keep for each the variant with the higher minimum Jacobian; ring on a tie.

    `ring`, `component` (f,): as `allowed_variants` gives them. `shape`: of the ring, its half-width and its depth.
    """

    def by(rows: Bools) -> Subdivision:
        patterns = with_ring(selection.faces, rows)
        return subdivide(mesh, selection.faces, patterns, selection.skin, selection.parents, *shape)

    cuts = by(np.zeros_like(ring)), by(ring)
    worst_of_cone, worst_of_ring = (_worst_of_sets(mesh, selection, component, one) for one in cuts)
    chosen = ring & (worst_of_ring >= worst_of_cone)[component]
    patterns = with_ring(selection.faces, chosen)
    same = (one for one in cuts if np.array_equal(one.cut.patterns, patterns))
    return next(same, None) or by(chosen)


def _worst_of_sets(mesh: Mesh, selection: Selection, component: Ints, subdivision: Subdivision) -> Floats:
    """(f,): the least corner Jacobian of the children of each set of faces, by the label of the set; inf for none."""
    points = node_values(mesh.points, subdivision.new_nodes)
    face_of_cell = np.full(mesh.n_cells, -1)
    face_of_cell[selection.parents.cell] = selection.parents.face
    face_of_cell[selection.skin.cell] = selection.skin.face
    least = np.full(len(selection.faces), np.inf)
    for block in subdivision.children:
        quality = corner_jacobian(block.type, points[block.nodes], mesh.space_dim == 2)
        np.minimum.at(least, component[face_of_cell[block.parent]], quality)
    return least
