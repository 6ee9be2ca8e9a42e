"""Every measure of every cell type by its name: Verdict's on the linear types, and ours on all of dimension 2 and 3.

Ours: `validity` (`determinant`), `corner_jacobian` (`corner`), `edge_ratio`, and the least and largest angle at the
corners (`angles`): `min_dihedral`, `max_dihedral` of solids, `min_corner_angle`, `max_corner_angle` of surfaces. A
quadratic cell has these only: Verdict defines nothing on it. Lines have `validity` alone, points nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import RequestError, did_you_mean
from lacmesh.mesh import Floats, Ints
from lacmesh.quality.angles import angles, edge_ratio
from lacmesh.quality.corner import corner_jacobian
from lacmesh.quality.determinant import COMPILED_FROM, PIECE, validity_among
from lacmesh.quality.vectors import nodes_first
from lacmesh.quality.verdict import ACCEPTED, CLASSES


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
#: measures of relative size, which need the mean size of a type in the whole mesh
RELATIVE = ("relative_size_squared", "shape_and_size", "shear_and_size")
_DEFAULT: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "TRIA3": ("scaled_jacobian", "aspect_ratio", "condition", "shape", "min_angle", "max_angle", "area"),
        "QUAD4": (
            *("scaled_jacobian", "aspect_ratio", "condition", "skew", "shape", "warpage"),
            *("min_angle", "max_angle", "area"),
        ),
        "TETRA4": ("scaled_jacobian", "aspect_ratio", "condition", "shape", "volume"),
        "HEXA8": ("scaled_jacobian", "condition", "skew", "shape", "volume"),
        "PENTA6": ("scaled_jacobian", "condition", "shape", "volume"),
        "PYRAM5": ("scaled_jacobian", "shape", "volume"),
    }
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
    own = ("validity", "corner_jacobian", *(_SOLID if cell.dim == 3 else _SURFACE))
    return (*own, *ACCEPTED.get(name, ()))


def default_measures(name: str) -> tuple[str, ...]:
    """Return the default measures of a type; the one that ranks its cells comes first."""
    if name not in CELLS or CELLS[name].dim < 2:
        return measures_of(name)
    verdict = _DEFAULT.get(name, ("corner_jacobian",))
    angle = _SOLID if CELLS[name].dim == 3 else (_SURFACE if name not in _DEFAULT else _SURFACE[:1])
    return ("validity", verdict[0], *angle, *verdict[1:])


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
    found: dict[str, Floats] = {}
    if "validity" in measures:
        found["validity"] = validity_among(name, points, nodes).least
    rest = [m for m in measures if m != "validity"]
    if mean_size is None and set(rest) & set(RELATIVE):
        mean_size = mean_size_of(name, points, nodes)
    found |= _measured(name, points, nodes, rest, mean_size)
    return {m: found[m] for m in measures}


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
    total = sum(float(CLASSES[name](x).size.sum()) for x in _pieces(points, nodes))
    return total / len(nodes) if len(nodes) else float("nan")


def _pieces(points: Floats, nodes: Ints) -> Iterable[NDArray]:
    return (nodes_first(points[nodes[start : start + PIECE]]) for start in range(0, len(nodes), PIECE))


def _measured(
    name: str, points: Floats, nodes: Ints, measures: list[str], mean_size: float | None
) -> dict[str, NDArray]:
    found: dict[str, NDArray] = {}
    if len(nodes) >= COMPILED_FROM:
        found = _compiled(name, points, nodes, measures)
    rest = [m for m in measures if m not in found]
    parts = [_piece(name, points[nodes[start : start + PIECE]], rest, mean_size) for start in _starts(len(nodes), rest)]
    return found | {m: np.concatenate([part[m] for part in parts]) if parts else np.empty(0) for m in rest}


def _starts(count: int, rest: list[str]) -> range:
    return range(0, count if rest else 0, PIECE)


def _piece(name: str, x: Floats, measures: list[str], mean_size: float | None) -> dict[str, NDArray]:
    found: dict[str, NDArray] = {}
    if set(measures) & {*_SOLID[1:], *_SURFACE[1:]}:
        low, high = angles(name, x)
        found = dict(zip((_SOLID if CELLS[name].dim == 3 else _SURFACE)[1:], (low, high), strict=True))
    if "edge_ratio" in measures:
        found["edge_ratio"] = edge_ratio(name, x)
    if "corner_jacobian" in measures:
        found["corner_jacobian"] = corner_jacobian(name, x)
    verdict = [m for m in measures if m in ACCEPTED.get(name, ())]
    if verdict:
        cells = CLASSES[name](nodes_first(x), mean_size)
        found |= {m: getattr(cells, m)() for m in verdict}
    return found


#: type -> the measures that its kernel fills, in its order
_KERNELS = {
    "HEXA8": ("hexahedra", ("scaled_jacobian", "condition", "skew", "shape", "volume")),
    "TETRA4": ("tetrahedra", ("scaled_jacobian", "aspect_ratio", "condition", "shape", "volume")),
    "PENTA6": ("prisms", ("scaled_jacobian", "condition", "shape", "volume")),
}


def _compiled(name: str, points: Floats, nodes: Ints, measures: list[str]) -> dict[str, NDArray]:
    """Compute the measures for which there is a compiled kernel; the others are left out."""
    from lacmesh.kernels.threads import in_threads
    from lacmesh.quality import kernels

    found: dict[str, NDArray] = {}
    own = ("corner_jacobian", *(_SOLID if CELLS[name].dim == 3 else _SURFACE))
    if set(measures) & set(own):
        found |= dict(zip(own, kernels.corners(name, points, nodes).T, strict=True))
    kernel, filled = _KERNELS.get(name, ("", ()))
    if set(measures) & set(filled):
        out = np.empty((len(nodes), len(filled)))
        fill = getattr(kernels, kernel)
        in_threads(lambda part: fill(points, nodes[part], out[part]), len(nodes))
        found |= dict(zip(filled, out.T, strict=True))
    return {m: values for m, values in found.items() if m in measures}
