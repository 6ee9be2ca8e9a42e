"""Every measure of every cell type by its name: those that lacmesh computes (`geometry`), and Verdict's.

Ours: `validity`, `corner_jacobian`, `edge_ratio`, and the least and largest angle at the corners:
`min_dihedral`, `max_dihedral` of solids, `min_corner_angle`, `max_corner_angle` of surfaces. A quadratic cell has these
only: Verdict defines nothing on it. Lines have `validity` alone, points nothing. Verdict's measures of the linear types
are computed by VTK, through pyvista (the extra `view`). Names and accepted ranges: Stimpson et al., *The Verdict
Library Reference Manual*, Sandia report SAND2007-1751, 2007. `docs/quality.md` says which of them matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import RequestError, did_you_mean, listed
from lacmesh.mesh import Floats, Ints
from lacmesh.quality.geometry import OWN, own_measures, validity_among

Range = tuple[float, float]


class Scale(NamedTuple):
    """Scale of a measure: `kind` is "unit" (0 to 1), "ratio" (1 and more), "angle" (degrees), "size" or "other".

    `better`: 1 if larger values are better, -1 if smaller ones are, 0 if neither.
    """

    kind: str
    better: int


#: a measure a line: its scale, which ends with + where more is better and with - where less is; and for each type the
#: range that Verdict accepts, `any` where it names none, `-` where it does not define the measure
_TABLE = """
measure               scale  TRIA3                   QUAD4   TETRA4                HEXA8    PENTA6 PYRAM5
validity              unit+  -                       -       -                     -        -      -
corner_jacobian       unit+  -                       -       -                     -        -      -
edge_ratio            ratio- -                       -       -                     -        -      -
min_dihedral          angle+ -                       -       -                     -        -      -
max_dihedral          angle- -                       -       -                     -        -      -
min_corner_angle      angle+ -                       -       -                     -        -      -
max_corner_angle      angle- -                       -       -                     -        -      -
area                  size   0:inf                   0:inf   -                     -        -      -
aspect_frobenius      ratio- 1:1.3                   -       1:1.3                 -        -      -
aspect_gamma          ratio- -                       -       1:3                   -        -      -
aspect_ratio          ratio- 1:1.3                   1:1.3   1:3                   -        -      -
collapse_ratio        unit+  -                       -       0.1:inf               -        -      -
condition             ratio- 1:1.3                   1:4     1:3                   any      any    -
diagonal              unit+  -                       -       -                     0.65:1   -      -
dimension             size   -                       -       -                     0:inf    -      -
distortion            unit+  0.5:1                   0.5:1   0.5:1                 0.5:1    any    -
jacobian              size   -                       0:inf   0:inf                 0:inf    any    any
max_angle             angle- 60:90                   90:135  -                     -        -      -
max_aspect_frobenius  ratio- -                       1:1.3   -                     1:3      any    -
max_edge_ratio        ratio- -                       1:1.3   -                     1:1.3    -      -
med_aspect_frobenius  ratio- -                       1:1.3   -                     1:3      -      -
min_angle             angle+ 30:60                   45:90   40:70.528779365509308 -        -      -
oddy                  other- -                       0:0.5   -                     0:0.5    -      -
radius_ratio          ratio- 1:3                     1:1.3   1:3                   -        -      -
relative_size_squared unit+  any                     0.3:1   0.3:1                 0.5:1    -      -
scaled_jacobian       unit+  0.5:1.1547005383792517  0.3:1   0.5:1                 0.5:1    any    any
shape                 unit+  0.25:1                  0.3:1   0.3:1                 0.3:1    any    any
shape_and_size        unit+  0.25:1                  0.2:1   0.2:1                 0.2:1    -      -
shear                 unit+  -                       0.3:1   -                     0.3:1    -      -
shear_and_size        unit+  -                       0.2:1   -                     0.2:1    -      -
skew                  unit-  -                       0:0.5   -                     0:0.5    -      -
stretch               unit+  -                       0.25:1  -                     0.25:1   -      -
taper                 unit-  -                       0:0.7   -                     0:0.5    -      -
volume                size   -                       -       0:inf                 0:inf    0:inf  0:inf
warpage               unit+  -                       0.3:1   -                     -        -      -
"""
_HEAD, *_ROWS = [line.split() for line in _TABLE.strip().split("\n")]


_RANGES: Mapping[str, Any] = {
    text: tuple(map(float, text.split(":"))) if ":" in text else None for row in _ROWS for text in row[2:]
}
#: type -> measure of Verdict -> the range that it accepts, None where it names none
ACCEPTED: Mapping[str, Mapping[str, Range | None]] = MappingProxyType(
    {kind: {row[0]: _RANGES[row[k]] for row in _ROWS if row[k] != "-"} for k, kind in enumerate(_HEAD) if k > 1}
)
#: every measure there is
SCALES: Mapping[str, Scale] = MappingProxyType(
    {row[0]: Scale(row[1].rstrip("+-"), {"+": 1, "-": -1}.get(row[1][-1], 0)) for row in _ROWS}
)
#: a face or a solid is poor whose corner Jacobian (1: ideal) is below it
POOR = 0.1
#: measures that compare a cell with all cells of its type in the mesh
RELATIVE = frozenset(("relative_size_squared", "shape_and_size", "shear_and_size"))


def measures_of(name: str) -> tuple[str, ...]:
    """Return all measures that are defined for cells of type `name`.

    >>> measures_of("PYRAM13")
    ('validity', 'corner_jacobian', 'edge_ratio', 'min_dihedral', 'max_dihedral')
    """
    cell = ALL_CELLS[name]
    if name not in CELLS or cell.dim == 0:
        return ()
    if cell.dim == 1:
        return ("validity",)
    angles = ("min_dihedral", "max_dihedral") if cell.dim == 3 else ("min_corner_angle", "max_corner_angle")
    return ("validity", "corner_jacobian", "edge_ratio", *angles, *ACCEPTED.get(name, ()))


def default_measures(name: str) -> tuple[str, ...]:
    """Return the default measures of a type, all computed by lacmesh.

    >>> default_measures("TRIA3")
    ('validity', 'corner_jacobian', 'edge_ratio', 'min_corner_angle', 'max_corner_angle')
    """
    return measures_of(name)[:5]


def primary_metric(name: str) -> str | None:
    """Return the measure that ranks the cells of a type; None for points."""
    return next((m for m in ("corner_jacobian", "validity") if m in measures_of(name)), None)


def chosen_measures(names: str | Iterable[str] | None) -> Callable[[str], tuple[str, ...]]:
    """Return the function that lists the measures of a type selected by None (the default), "all", or names.

    Raises RequestError, with near matches, for a name that no type has.
    """
    if names is None:
        return default_measures
    if names == "all":
        return measures_of
    wanted = [names] if isinstance(names, str) else list(names)
    for name in wanted:
        if name not in SCALES:
            raise RequestError(f"no measure named {name!r}{did_you_mean(name, SCALES)}")
    return lambda kind: tuple(m for m in wanted if m in measures_of(kind))


def measure_cells(name: str, points: Floats, nodes: Ints, measures: Iterable[str]) -> dict[str, Floats]:
    """Compute measures, (k,) each, of cells of type `name` with `nodes` (k, n_nodes) among `points` (n, 3).

    Sizes relative to a mean are relative to that of these cells. NaN if a node has no finite position. Raises
    RequestError for a measure that the type does not have, or that needs pyvista where that is not installed.

    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    >>> measures = ["corner_jacobian", "edge_ratio"]
    >>> {k: float(v[0]) for k, v in measure_cells("QUAD4", square, np.array([[0, 1, 2, 3]]), measures).items()}
    {'corner_jacobian': 1.0, 'edge_ratio': 1.0}
    """
    measures = tuple(measures)
    for measure in measures:
        if measure not in measures_of(name):
            raise RequestError(f"{measure!r} is not defined on {name}{did_you_mean(measure, measures_of(name))}")
    nodes = np.asarray(nodes)
    few = nodes.size < len(points)
    good: Any = slice(None)
    if not np.isfinite(points[nodes] if few else points).all():
        good = np.isfinite(points[nodes]).all(axis=(1, 2))
    values: dict[str, NDArray] = {}
    if "validity" in measures:
        values["validity"] = validity_among(name, points, nodes[good]).least
    values |= own_measures(name, points, nodes[good], [m for m in measures if m in OWN])
    rest = [m for m in measures if m not in values]
    for names in ([m for m in rest if m not in RELATIVE], [m for m in rest if m in RELATIVE]):
        if names:
            values |= _vtk_measures(name, points, nodes[good], names)
    out: dict[str, Floats] = {m: np.full(len(nodes), np.nan) for m in measures}
    for m in measures:
        out[m][good] = values[m]
    return out


#: linear type -> its name in `pyvista.CellType`
TYPES = {
    **{"TRIA3": "TRIANGLE", "QUAD4": "QUAD", "TETRA4": "TETRA"},
    **{"HEXA8": "HEXAHEDRON", "PENTA6": "WEDGE", "PYRAM5": "PYRAMID"},
}
#: cells at a time
_PIECE = 1 << 15


def _vtk_measures(name: str, points: Floats, nodes: Ints, measures: Sequence[str]) -> dict[str, NDArray]:
    """Return measures, (c,) each, of cells of a linear type with `nodes` (c, n) among points (p, 3), by VTK.

    Each cell is scaled to about 1, since Verdict takes lengths below an absolute 1e-30 or so as zero; all cells alike,
    and at once, if their sizes are compared. Raises RequestError where pyvista is missing or has no such measures.
    """
    try:
        import pyvista

        compute: Any = pyvista.UnstructuredGrid.cell_quality
    except (ImportError, AttributeError):
        what = f"the measure {measures[0]!r} needs" if len(measures) == 1 else f"{listed(measures, 'and')} need"
        raise RequestError(f"{what} pyvista, 0.45 or later; pip install 'lacmesh[view]' brings it") from None
    values = {measure: np.empty(len(nodes)) for measure in measures}
    together = not RELATIVE.isdisjoint(measures)
    step = max(1, len(nodes)) if together else _PIECE
    for start in range(0, len(nodes), step):
        x = points[nodes[start : start + step]]
        x = x - x[:, :1]
        extent = np.ptp(x, axis=1).max(axis=1)
        _, exponent = np.frexp(np.full(len(x), extent.max()) if together else extent)
        unit = np.ldexp(1.0, exponent)  # a power of two, by which nothing is rounded
        rows = np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])
        x = (x / unit[:, None, None]).reshape(-1, 3)
        grid = compute(pyvista.UnstructuredGrid({pyvista.CellType[TYPES[name]]: rows}, x), list(measures))
        for measure, out in values.items():
            power = {"area": 2, "volume": 3, "jacobian": CELLS[name].dim, "dimension": 1}.get(measure, 0)
            out[start : start + step] = grid.cell_data[measure] * unit**power
    return values
