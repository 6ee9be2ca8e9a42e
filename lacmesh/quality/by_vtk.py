"""Verdict's measures that only a list of measures asks for, computed by VTK through pyvista (the extra `view`).

Each cell is moved to the origin and scaled to an extent of 0.5 to 1: Verdict takes lengths below 1e-30 or so as
nothing whatever their power, which makes some measures useless in meshes of nanometres in metres. What the reports and
the check need is not taken from VTK, whose quality filter knows no quadratic cell and is an extra; nor are the sizes
relative to the mean, which VTK compares with the cells it is given, and not with those of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import RequestError, listed
from lacmesh.mesh import Floats, Ints

#: linear type -> its name in `pyvista.CellType`
TYPES = {
    **{"TRIA3": "TRIANGLE", "QUAD4": "QUAD", "TETRA4": "TETRA"},
    **{"HEXA8": "HEXAHEDRON", "PENTA6": "WEDGE", "PYRAM5": "PYRAMID"},
}
#: cells at a time
_PIECE = 1 << 15


def vtk_measures(name: str, points: Floats, nodes: Ints, measures: Sequence[str]) -> dict[str, NDArray]:
    """Return measures, (c,) each, of cells of a linear type with `nodes` (c, n) among points (p, 3).

    Raises RequestError where pyvista is not installed, or is older than 0.45, the first that has the measures.
    """
    try:
        import pyvista

        compute: Any = pyvista.UnstructuredGrid.cell_quality
    except (ImportError, AttributeError):
        what = f"the measure {measures[0]!r} needs" if len(measures) == 1 else f"{listed(measures, 'and')} need"
        raise RequestError(f"{what} pyvista, 0.45 or later; pip install 'lacmesh[view]' brings it") from None
    values = {measure: np.empty(len(nodes)) for measure in measures}
    for start in range(0, len(nodes), _PIECE):
        x = points[nodes[start : start + _PIECE]]
        x = x - x[:, :1]
        _, exponent = np.frexp(np.ptp(x, axis=1).max(axis=1))
        unit = np.ldexp(1.0, exponent)  # a power of two, by which nothing is rounded
        rows = np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])
        x = (x / unit[:, None, None]).reshape(-1, 3)
        grid = compute(pyvista.UnstructuredGrid({pyvista.CellType[TYPES[name]]: rows}, x), list(measures))
        for measure, out in values.items():
            power = {"jacobian": CELLS[name].dim, "dimension": 1}.get(measure, 0)
            out[start : start + _PIECE] = grid.cell_data[measure] * unit**power
    return values
