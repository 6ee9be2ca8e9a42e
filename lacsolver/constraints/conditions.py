"""Prescribed displacements as conditions d . u = value at nodes; d is a unit vector, an axis or the outward normal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.mesh import Ints, concatenated
from lacmesh.surface import Surface
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.records import Displacement
from lacsolver.case.value import Value
from lacsolver.constraints.normals import Normals, nodal_normals
from lacsolver.space.axes import directions
from lacsolver.space.places import cells_of, nodes_of, wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse

_AXES = ("ux", "uy", "uz")
#: largest x of a node on the axis of symmetry, relative to the bodies' extent
_ON_AXIS = 1e-9
#: stands for a record in the conditions of nodes on the axis of symmetry
AXIS = Displacement(group="the axis of symmetry", ux=Value(0.0))


class Prescribed(NamedTuple):
    """One prescribed component of a record: direction . u = `value` at each of its nodes.

    `nodes` (k,), `directions` (k, dim) unit vectors; a node is repeated where a skin has an edge.
    """

    record: Displacement
    component: str
    value: Value
    nodes: Ints
    directions: NDArray[np.floating]

    def at(self, space: Space, t: float) -> NDArray[np.floating]:
        """Return the value (k,) at each node at time t. Raises EvaluationError where it is not finite."""
        return self.value(space.mesh.points[self.nodes][:, : space.dim], t)

    def take(self, chosen: NDArray[np.bool_]) -> Prescribed:
        """Return the component at some of its nodes, a mask (k,)."""
        return self._replace(nodes=self.nodes[chosen], directions=self.directions[chosen])


def values_of(space: Space, parts: Iterable[Prescribed], t: float) -> NDArray[np.floating]:
    """Return the values (k,) of some prescribed components at time t, one after the other."""
    return np.concatenate([np.empty(0), *(part.at(space, t) for part in parts)])


def rows_of(space: Space, parts: Sequence[Prescribed]) -> csr_array:
    """Return C (k, n_dof), such that C u are some components of displacement that are prescribed, in their order."""
    nodes = concatenated(part.nodes for part in parts)
    d = np.concatenate([np.empty((0, space.dim)), *(part.directions for part in parts)])
    C = sparse((len(nodes), space.n_dof), (np.arange(len(nodes))[:, None], space.dofs(nodes), d))
    C.eliminate_zeros()
    return C


def prescribed(space: Space, records: Sequence[Displacement]) -> tuple[Prescribed, ...]:
    """Return the prescribed components of the records, in their order.

    Raises CaseError, with every mistake at once, for groups and places that are missing, and for `un` of a group that
    is not a skin.
    """
    problems: list[Issue] = []
    parts_of: list[list[Prescribed]] = []
    skins: dict[int, Surface | None] = {}
    for number, record in enumerate(records):
        try:
            parts_of.append(along_axes(space, record, nodes_of(space, record)))
            if record.un is not None:
                skins[number] = _skin(space, record)
        except CaseError as error:
            problems += error.problems
    if problems:
        raise CaseError(problems)
    there = {number: skin for number, skin in skins.items() if skin is not None}
    normals = dict(zip(there, nodal_normals(space, list(there.values())), strict=True)) if there else {}
    for number in skins:
        value = records[number].un
        normal = normals.get(number, Normals(np.empty(0, np.int64), np.empty((0, space.dim))))
        assert value is not None
        own = np.isin(normal.nodes, space.own_nodes(normal.nodes))
        parts_of[number].append(Prescribed(records[number], "un", value, normal.nodes[own], normal.normals[own]))
    return tuple(part for parts in parts_of for part in parts)


def on_axis(space: Space, moved: Ints) -> tuple[Prescribed, ...]:
    """Return the condition ux = 0 on the axis of an axisymmetric model, where strain would not be finite else.

    Nodes `moved` by rigid bodies are left out.
    """
    if not space.model.axisymmetric:
        return ()
    x = space.mesh.points
    there = space.attached & (np.abs(x[:, 0]) <= _ON_AXIS * space.extent)
    there[moved] = False
    nodes = space.own_nodes(np.flatnonzero(there))
    return (Prescribed(AXIS, "ux", Value(0.0), nodes, np.tile([1.0, 0.0], (len(nodes), 1))),) if len(nodes) else ()


def along_axes(space: Space, record: Displacement, nodes: Ints) -> list[Prescribed]:
    """Return the components that a record prescribes along its axes, at some nodes."""
    values = [(k, name, getattr(record, name)) for k, name in enumerate(_AXES[: space.dim])]
    along = directions(space, record, nodes)
    return [Prescribed(record, name, value, nodes, along[:, k]) for k, name, value in values if value is not None]


def _skin(space: Space, record: Displacement) -> Surface | None:
    """Return the faces of a record's group, each with one cell of the body behind it; None if this process has none.

    Raises CaseError for others.
    """
    mesh = space.mesh
    cells = cells_of(space, record)
    if cells is None:
        raise wrong(
            record, f"un needs a group of surface cells, and {record.group!r} is one of nodes; make it one of cells"
        )
    cells = space.near(cells)
    if not len(cells):
        return None
    odd = cells[(mesh.cell_dim[cells] != space.dim - 1) | ~_known(space, cells)]
    if len(odd):
        what = f"linear or quadratic surface cells of dimension {space.dim - 1}"
        raise wrong(record, f"un needs {what}, and cells {mesh.cell_names(odd)} are none; name a surface")
    try:
        surface = Surface.of(space.local, cells)
    except DataError as error:
        raise wrong(record, str(error)) from None
    loose = surface.cell[np.isnan(surface.depth)]
    if len(loose):
        message = f"cells {mesh.cell_names(loose)} do not have exactly one cell of a body behind them"
        raise wrong(record, f"{message}, so that their outward normal is unknown; prescribe ux, uy, uz")
    return surface


def _known(space: Space, cells: Ints) -> NDArray[np.bool_]:
    """Return a mask (k,), True for cells of a type that has shape functions."""
    known = np.zeros(space.mesh.n_cells, bool)
    for kind, chosen, _ in space.mesh.select(cells):
        known[chosen] = kind in CELLS
    return known[cells]
