"""Thickness of the cells of a plane model, where groups of them have several."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Mesh, concatenated
from lacmesh.topology.skin import TYPE_CODE, cells_of_dim, faces_of, find_owners, first_of_each, label_faces

#: models that have a thickness
MODELS = ("plane_strain", "plane_stress")


def thickness_of(mesh: Mesh, model: str, given: float | Mapping[str, float] | None) -> float | NDArray[np.floating]:
    """Return one thickness for all cells of a mesh, or that of each (n_cells,), `given` by groups of cells.

    Edges have that of the cell that they are an edge of, NaN between cells of several. Raises RequestError for what is
    no thickness of a model, DataError for cells that have none, or several.

    >>> from lacmesh import Mesh
    >>> two = [("QUAD4", [[0, 1, 2, 3], [1, 4, 5, 2]])]
    >>> x = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]]
    >>> mesh = Mesh.create(x, two, cell_groups={"pin": [0], "bar": [1]})
    >>> thickness_of(mesh, "plane_stress", {"pin": 2.0, "bar": 5.0})
    array([2., 5.])
    """
    if given is None:
        return 1.0
    if model not in MODELS:
        raise RequestError(f"thickness belongs to the models {' and '.join(MODELS)}, not {model}; leave it out")
    values = list(given.values()) if isinstance(given, Mapping) else [given]
    for value in values:
        if not (np.isfinite(value) and value > 0):
            raise RequestError(f"thickness is a length above 0, not {value}")
    if not isinstance(given, Mapping):
        return float(given)
    solid = mesh.cell_dim == 2
    out = np.full(mesh.n_cells, np.nan)
    for name, value in given.items():
        own = mesh.cells_of(name)
        own = own[solid[own]]
        twice = own[~np.isnan(out[own]) & (out[own] != value)]
        if len(twice):
            message = f"cells {mesh.cell_names(twice)} of {name!r} have another thickness by another group"
            raise DataError(f"{message}; give each cell one", mesh.cell_number[twice])
        out[own] = value
    without = np.flatnonzero(solid & np.isnan(out))
    if len(without):
        message = f"cells {mesh.cell_names(without)} are in none of the groups that have a thickness"
        raise DataError(f"{message}; name a group for each cell", mesh.cell_number[without])
    return _with_edges(mesh, out)


def _with_edges(mesh: Mesh, thickness: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the thickness (n_cells,) of cells with that of the edges, NaN where they have none or several."""
    known = [own for kind, own, _ in mesh.select(np.flatnonzero(mesh.cell_dim == 1)) if kind in TYPE_CODE]
    edges = concatenated(known)
    faces = faces_of(mesh, edges)
    first, which = first_of_each(*label_faces(faces))
    owners = find_owners(faces.take(first), cells_of_dim(mesh, 2), mesh.n_nodes)
    low, high = np.full(len(first), np.inf), np.full(len(first), -np.inf)
    np.minimum.at(low, owners.face, thickness[owners.cell])
    np.maximum.at(high, owners.face, thickness[owners.cell])
    thickness[edges] = np.where(low == high, low, np.nan)[which]
    return thickness
