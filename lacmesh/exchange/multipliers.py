"""Multipliers of a cut as code_aster sees them: the LAGS_C nodes that each slave face carries, and its share.

code_aster hangs a macro-element's one multiplier on nodes of its slave faces (R5.03.55, figures 3 to 16); where no node
is common to all of them it makes two or four, tied together, and each face's contribution is divided by the number it
carries (the halves and quarters of 3.3.4). Solvers that take one unknown a macro-element need none of this.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.records import Cut, split
from lacmesh.errors import CutError
from lacmesh.facts import Described
from lacmesh.mesh import Ints
from lacmesh.topology.skin import Faces, find_owners

#: (type of the faces, number of them in the macro-element): code of the patch; for each face, E1 first, the places of
#: the nodes that carry LAGS_C. SEG3 has a code for each parent: `_SEG3_CODE`.
_PATCHES: dict[tuple[str, int], tuple[int, tuple[tuple[int, ...], ...]]] = {
    ("SEG2", 2): (7, ((1,), (0,))),
    ("SEG2", 3): (12, ((1,), (0, 1), (0,))),
    ("SEG3", 1): (0, ((2,),)),
    ("TRIA3", 3): (18, ((2,),) * 3),
    ("TRIA6", 3): (19, ((2,),) * 3),
    ("TRIA3", 4): (125, ((2,),) * 4),
    ("TRIA6", 4): (126, ((2,),) * 4),
    ("QUAD4", 5): (25, (*((2, 3),) * 4, (0, 1, 2, 3))),
    ("QUAD8", 5): (26, (*((2, 3),) * 4, (0, 1, 2, 3))),
    ("QUAD9", 1): (27, ((8,),)),
    ("TRIA7", 1): (0, ((6,),)),
}
_SEG3_CODE = {"TRIA6": 9, "QUAD8": 14}


@dataclass(frozen=True, eq=False, repr=False)
class Multipliers(Described):
    """Nodes that carry LAGS_C: `faces` (f,), the slave faces, and for each face its `nodes` (f, 4), -1 beyond.

    `share` (f,): factor of a face's contribution, 1, 1/2 or 1/4. `patch_of_cell` (n_cells,) and
    `patch_of_node` (n_nodes,): patch numbers from 1, 0 where there is none. `patch_code` (patches,): code_aster's code
    of the pattern, 0 where code_aster has none (TRIA7, and QUAD9 in 2D); `patch_nodes`: for each patch its nodes.
    """

    faces: Ints
    nodes: Ints
    share: np.ndarray
    patch_of_cell: Ints
    patch_of_node: Ints
    patch_code: Ints
    patch_nodes: tuple[Ints, ...]


def aster_multipliers(cut: Cut) -> Multipliers:
    """code_aster's view of the multipliers of a cut. Raises CutError for macro-elements of whole faces.

    >>> from lacmesh import cut_skin, read
    >>> multipliers = aster_multipliers(cut_skin(read("data/two_blocks.msh"), "slave"))
    >>> len(multipliers.patch_nodes), multipliers.nodes[0].tolist(), float(multipliers.share[0])
    (36, [476, -1, -1, -1], 1.0)
    """
    mesh = cut.mesh
    faces = np.flatnonzero(cut.macro_of_face >= 0)
    macro = cut.macro_of_face[faces]
    size = np.bincount(macro, minlength=cut.n_macros)
    nodes = np.full((len(faces), 4), -1, np.int64)
    code = np.zeros(cut.n_macros, np.int64)
    for kind, cells, connectivity in mesh.select(faces):
        rows = np.searchsorted(faces, cells)
        base = int(size.max()) + 1
        key = size[macro[rows]] * base + cut.child_kind[cells]
        for value in np.unique(key).tolist():
            at, (n_faces, rank) = np.flatnonzero(key == value), divmod(value, base)
            patch, carriers = _PATCHES.get((kind, n_faces), (0, ()))
            places = carriers[rank - 1] if rank <= len(carriers) else ()
            corners = [k for k in range(CELLS[kind].n_corners) if k not in places]
            others = connectivity[at][:, corners]
            if not places or (cut.macro_of_node[others] == macro[rows[at], None]).any():
                message = "code_aster has no macro-elements of whole faces (macro = 'stars'); cut the mesh instead"
                raise CutError(message, mesh.cell_number[cells[at]])
            nodes[rows[at], : len(places)] = connectivity[at][:, places]
            code[macro[rows[at]]] = patch
        if kind == "SEG3":  # the code depends on the cell behind each
            blocks = [(b.type, b.nodes, np.full(len(b.nodes), k)) for k, b in enumerate(mesh.blocks)]
            plane = [block for block in blocks if block[0] in CELLS and CELLS[block[0]].dim == 2]
            owners = find_owners(Faces.join([(kind, connectivity)]), plane, mesh.n_nodes)
            codes = np.array([_SEG3_CODE.get(b.type, 0) for b in mesh.blocks])
            code[macro[rows[owners.face]]] = codes[owners.cell]
    patch_of_cell, patch_of_node = np.zeros(mesh.n_cells, np.int64), np.zeros(mesh.n_nodes, np.int64)
    patch_of_cell[faces] = macro + 1
    carried = nodes >= 0
    patch_of_node[nodes[carried]] = np.broadcast_to(macro[:, None] + 1, nodes.shape)[carried]
    share = 1.0 / carried.sum(axis=1)
    carrying = np.flatnonzero(patch_of_node)
    carriers_of = split(carrying, patch_of_node[carrying] - 1, cut.n_macros)
    return Multipliers(faces, nodes, share, patch_of_cell, patch_of_node, code, carriers_of)
