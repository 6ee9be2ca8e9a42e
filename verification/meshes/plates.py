"""Thin plates on one another and on a rigid table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from verification.meshes.blocks import block, joined, with_skin

Floats = NDArray[np.floating]

#: how far the table reaches beyond the plates, relative to their size
_BEYOND = 0.1


def plates(
    boxes: Sequence[tuple[Floats, Floats]], counts: Sequence[Sequence[int]], *, table: bool, kind: str = ""
) -> Mesh:
    """Plates from the lowest to the highest: their lower and upper corners (dim,), and `counts` (dim,) of their cells.

    Groups: `plate1`, ... of cells of a `kind`, by default QUAD4 or HEXA8; `under1`, `over1`, `start1`, `end1`, ... of
    facets: below, above, at the ends along x. `table`: True for a rigid face, `table`, at height 0 under all of them.

    >>> plates([(np.array([0.0, 0.0]), np.array([4.0, 1.0]))], [(4, 1)], table=True).cells_by_type
    {'SEG2': 11, 'QUAD4': 4}
    """
    dim, parts = len(boxes[0][0]), []
    kind, up = (kind or "QUAD4", "y") if dim == 2 else (kind or "HEXA8", "z")
    corners = [(low.tolist(), high.tolist()) for low, high in boxes]
    for k, ((low, high), count) in enumerate(zip(corners, counts, strict=True), 1):
        names = {"": f"plate{k}", f"{up}0": f"under{k}", f"{up}1": f"over{k}", "x0": f"start{k}", "x1": f"end{k}"}
        parts.append((block(kind, count, low, high), names))
    mesh = joined(parts)
    if not table:
        return mesh
    x = mesh.points[:, : dim - 1]
    beyond = _BEYOND * np.ptp(x, axis=0)
    first, last = x.min(axis=0) - beyond, x.max(axis=0) + beyond
    if dim == 2:
        return with_skin(mesh, "SEG2", np.array([[last[0], 0.0], [first[0], 0.0]]), np.array([[0, 1]]), "table")
    around = np.array([first, (last[0], first[1]), last, (first[0], last[1])])
    return with_skin(mesh, "QUAD4", np.pad(around, ((0, 0), (0, 1))), np.arange(4)[None], "table")
