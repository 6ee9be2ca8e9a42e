"""Every measure of every cell type by its name: Verdict's on the linear types, and ours on all of dimension 2 and 3.

Ours: `validity` (`determinant`), `corner_jacobian` (`corner`), `edge_ratio`, and the least and largest angle at the
corners (`angles`): `min_dihedral`, `max_dihedral` of solids, `min_corner_angle`, `max_corner_angle` of surfaces. A
quadratic cell has these only: Verdict defines nothing on it. Lines have `validity` alone, points nothing.
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
from lacmesh.quality.corner import corner_measures
from lacmesh.quality.determinant import validity_among
from lacmesh.quality.linear import HEXA_CORNERS, LINEAR, linear_measures
from lacmesh.quality.vectors import LARGEST
from lacmesh.quality.verdict import ACCEPTED


class Scale(NamedTuple):
    """Scale of a measure: `kind` is "unit" (0 to 1), "ratio" (1 and more), "angle" (degrees), "size" or "other".

    `better`: 1 if larger values are better, -1 if smaller ones are, 0 if neither.
    """

    kind: str
    better: int


_MORE, _LESS, _NEITHER = 1, -1, 0
_UNIT = (
    "validity corner_jacobian scaled_jacobian shape shear relative_size_squared shape_and_size shear_and_size "
    "distortion stretch diagonal warpage collapse_ratio"
)
_RATIO = (
    "edge_ratio aspect_ratio aspect_frobenius aspect_gamma condition radius_ratio max_aspect_frobenius "
    "med_aspect_frobenius max_edge_ratio"
)
#: every measure there is
SCALES: Mapping[str, Scale] = MappingProxyType(
    {name: Scale("unit", _MORE) for name in _UNIT.split()}
    | {name: Scale("unit", _LESS) for name in ("skew", "taper")}
    | {name: Scale("ratio", _LESS) for name in _RATIO.split()}
    | {name: Scale("angle", _MORE) for name in ("min_angle", "min_dihedral", "min_corner_angle")}
    | {name: Scale("angle", _LESS) for name in ("max_angle", "max_dihedral", "max_corner_angle")}
    | {name: Scale("size", _NEITHER) for name in ("area", "volume", "jacobian", "dimension")}
    | {"oddy": Scale("other", _LESS)}
)
_SOLID = ("edge_ratio", "min_dihedral", "max_dihedral")
_SURFACE = ("edge_ratio", "min_corner_angle", "max_corner_angle")
#: measures of relative size, which need the mean size of a type in the whole mesh -> the measure they are times
RELATIVE: Mapping[str, str] = MappingProxyType(
    {"relative_size_squared": "", "shape_and_size": "shape", "shear_and_size": "shear"}
)


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
    return ("validity", *_at_corners(name), *ACCEPTED.get(name, ()))


def default_measures(name: str) -> tuple[str, ...]:
    """Return the default measures of a type; the one that ranks its cells comes first."""
    if name not in CELLS or CELLS[name].dim < 2:
        return measures_of(name)
    rank, *verdict = LINEAR[name][1] if name in LINEAR else ("corner_jacobian",)
    own = [m for m in _at_corners(name)[1:] if not (name in LINEAR and m.endswith("corner_angle"))]
    return ("validity", rank, *own, *verdict)


def _at_corners(name: str) -> tuple[str, ...]:
    """The measures in the order of `corner_measures`."""
    return ("corner_jacobian", *(_SOLID if CELLS[name].dim == 3 else _SURFACE))


def primary_metric(name: str) -> str | None:
    """Return the measure that ranks the cells of a type; None for points."""
    for measure in ("scaled_jacobian", "corner_jacobian", "validity"):
        if measure in measures_of(name):
            return measure
    return None


#: a face or a solid is poor whose scaled Jacobian (of a quadratic one: that of the corners; 1: ideal) is below it
POOR = 0.1


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


def measure_cells(
    name: str, points: Floats, nodes: Ints, measures: Iterable[str], mean_size: float | None = None
) -> dict[str, Floats]:
    """Compute measures, (k,) each, of cells of type `name` with `nodes` (k, n_nodes) among `points` (n, 3).

    `mean_size`: that of the cells of this type in the mesh, for the measures of relative size (default: of these
    cells). NaN if a node has no finite position. Raises RequestError for a measure that the type does not have.

    >>> from lacmesh.mesh import Mesh
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    >>> {k: float(v[0]) for k, v in measure_cells("QUAD4", square, np.array([[0, 1, 2, 3]]), ["skew", "area"]).items()}
    {'skew': 0.0, 'area': 1.0}
    """
    measures = tuple(measures)
    nodes = np.ascontiguousarray(nodes, np.int64)
    for measure in measures:
        if measure not in measures_of(name):
            raise RequestError(f"{measure!r} is not defined on {name}{did_you_mean(measure, measures_of(name))}")
    few = nodes.size < len(points)
    if not np.isfinite(points[nodes] if few else points).all():
        placed = np.isfinite(points[nodes]).all(axis=(1, 2))
        return _some_without_place(name, points, nodes, measures, mean_size, np.asarray(placed))
    values: dict[str, NDArray] = {}
    if "validity" in measures:
        values["validity"] = validity_among(name, points, nodes).least
    if set(measures) & set(_at_corners(name)):
        values |= dict(zip(_at_corners(name), corner_measures(name, points, nodes), strict=True))
    if name in LINEAR:
        values |= _verdict(name, points, nodes, [m for m in measures if m not in values], mean_size)
    return {m: values[m] for m in measures}


def _verdict(name: str, points: Floats, nodes: Ints, measures: list[str], mean: float | None) -> dict[str, NDArray]:
    """Return Verdict's measures of cells of a linear type; `mean`: the mean size for the relative ones."""
    size, factors = "area" if CELLS[name].dim == 2 else "volume", {RELATIVE[m] for m in measures if m in RELATIVE}
    needed = {*measures, *factors, *({size} if factors else ())} - {*RELATIVE, ""}
    ours = LINEAR[name][1]
    values = linear_measures(name, points, nodes) if needed & set(ours) else {}
    if rest := sorted(needed - set(ours)):
        values |= vtk_measures(name, points, nodes, rest)
    if factors:
        relative = _relative_size(name, points, nodes, values[size], mean)
        values |= {m: relative * values.get(RELATIVE[m], 1.0) for m in measures if m in RELATIVE}
    return values


def _relative_size(name: str, points: Floats, nodes: Ints, size: NDArray, mean: float | None) -> NDArray:
    """Size over the mean size of the type, or its inverse where that is less, squared; 0 if inverted.

    In a mesh whose mean size is negative NaN, for a hexahedron -LARGEST if it is not inverted, as in Verdict. Verdict
    compares the mean of a hexahedron's determinants at the corners, not its volume, with the mean volume.
    """
    mean = (float(size.mean()) if len(size) else np.nan) if mean is None else mean
    if name == "HEXA8":
        corners = points[nodes[:, HEXA_CORNERS]]
        size = np.linalg.det(corners[:, :, 1:] - corners[:, :, :1]).mean(axis=1)
    if mean < 0:
        return np.where(size > 0, -LARGEST, 0.0) if name == "HEXA8" else np.full(len(size), np.nan)
    relative = np.maximum(size / mean, 0) if mean else np.zeros(len(size))
    inverse = np.divide(1, relative, out=np.zeros(len(size)), where=relative > 0)
    return np.asarray(np.minimum(relative, inverse) ** 2)


def _some_without_place(
    name: str, points: Floats, nodes: Ints, measures: tuple[str, ...], mean_size: float | None, good: NDArray
) -> dict[str, Floats]:
    """Compute `measure_cells` if some nodes have NaN or infinite coordinates: their cells get NaN."""
    out: dict[str, Floats] = {m: np.full(len(nodes), np.nan) for m in measures}
    safe = np.where(np.isfinite(points), points, 0)
    for m, values in measure_cells(name, safe, nodes[good], measures, mean_size).items():
        out[m][good] = values
    return out


def mean_size_of(name: str, points: Floats, nodes: Ints) -> float:
    """Mean area or volume of cells of a linear type, by Verdict's definition."""
    size = linear_measures(name, points, nodes)["area" if CELLS[name].dim == 2 else "volume"]
    return float(size.mean()) if len(nodes) else float("nan")


# ---- Verdict's measures that only a list of measures asks for, computed by VTK through pyvista (the extra `view`)

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
