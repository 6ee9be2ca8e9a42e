"""Loads of a case as nodal forces (n_dof,) at a time t and a displacement u.

A load on faces or cells is a density at the points of a `Quadrature`, which is built once. Forces are those of the
whole thickness or circle. Values are evaluated at undeformed points, in the coordinates of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.surface.normals import unit
from lacsolver.bodies.material import Materials
from lacsolver.bodies.small import internal_force
from lacsolver.bodies.temperature import TemperatureField
from lacsolver.case import BodyForce, Case, Coupling, Force, Gravity, Pressure, Temperature, Traction
from lacsolver.case.entry import Entry
from lacsolver.case.value import Value
from lacsolver.constraints.coupling import PointLoad, is_loaded
from lacsolver.space.axes import directions
from lacsolver.space.places import cells_of, nodes_before_cut, on_bodies, wrong
from lacsolver.space.quadrature import Points, Quadrature, nodal_measures
from lacsolver.space.space import Cells, Space
from lacsolver.space.sparse import sparse_blocks

_AXES = "xyz"
#: weight (n_dof,) of the nodes under accelerations (n_dof,) of gravity
Weight = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Load:
    """The load of one record of a case: `force(t, u)` returns its nodal forces (n_dof,).

    `u` (n_dof,): the displacement, 0 if None. `tangent(t, u)`: the derivative (n_dof, n_dof) of the forces by u, not
    symmetric, which may be None; None if the forces do not depend on u.
    """

    record: Entry
    force: Callable[[float, Floats | None], NDArray[np.floating]]
    tangent: Callable[[float, Floats], csr_array | None] | None = None


@dataclass(frozen=True, eq=False)
class Loads:
    """All loads of a case, except springs and loads on rigid bodies.

    `thermal`: that of all temperatures under small kinematics; under finite ones they are a part of the internal forces
    (`kinematics.Kinematics`). `finite`: True if forces act at displaced nodes.
    """

    space: Space
    mechanical: tuple[Load, ...]
    thermal: Load | None
    finite: bool

    @classmethod
    def of(
        cls, space: Space, materials: Materials, case: Case, *, weight: Weight | None = None, threads: int = 1
    ) -> Loads:
        """Build the loads of a case. `weight`: that of the nodes, that of the cells by default. Raises CaseError."""
        finite = case.kinematics == "finite"
        mechanical = [load_of(space, materials, record, finite=finite, weight=weight) for record in load_records(case)]
        thermal = None
        if case.temperature and not finite:
            thermal = thermal_load(space, materials, case.temperature, threads)
        return cls(space, tuple(mechanical), thermal, finite)

    @property
    def follow(self) -> bool:
        """True if some of the forces depend on the displacement."""
        return any(load.tangent for load in self.mechanical)

    def force(self, t: float, u: Floats | None = None) -> NDArray[np.floating]:
        """Return the nodal forces (n_dof,) at time t; `u` (n_dof,): displacement of the faces of follower loads."""
        loads = [*self.mechanical, *([] if self.thermal is None else [self.thermal])]
        return sum((load.force(t, u) for load in loads), np.zeros(self.space.n_dof))

    def tangent(self, t: float, u: Floats) -> csr_array | None:
        """Return the derivative (n_dof, n_dof) of the forces by u, not symmetric; None for loads without one."""
        following = (load.tangent(t, u) for load in self.mechanical if load.tangent)
        parts = [part for part in following if part is not None]
        return csr_array(sum(parts[1:], parts[0])) if parts else None


def load_records(case: Case) -> Iterator[Entry]:
    """Yield the records of a case that are loads, without its temperatures."""
    loaded = (one for one in case.coupling if is_loaded(one))
    yield from (*case.pressure, *case.traction, *case.force, *loaded, *case.body_force)
    if case.gravity is not None:
        yield case.gravity


def load_of(
    space: Space, materials: Materials, record: Entry, *, finite: bool, weight: Weight | None = None
) -> Load:  # fmt: skip
    """Return the load of a record. Raises CaseError."""
    with _naming(record):
        match record:
            case Pressure():
                return pressure(record, on_skin(space, space.mesh.cells_of(record.group), outer=True))
            case Traction():
                return _traction(space, record)
            case Force():
                return _force(space, record)
            case Coupling():
                point = PointLoad.of(space, record, finite)
                return Load(record, point.force, point.tangent if point.follows else None)
            case BodyForce():
                return _body_force(space, record)
            case Gravity():
                return _gravity(space, materials, record, weight)
            case Temperature():
                return thermal_load(space, materials, [record])
    raise TypeError(f"{record!r} is no load")


@contextmanager
def _naming(record: Entry) -> Iterator[None]:
    """Turn errors about a load's nodes and cells into CaseErrors that name its record, and its line."""
    try:
        yield
    except (DataError, RequestError) as error:
        raise wrong(record, str(error)) from None


# ---- loads on faces and cells


def _distributed(record: Entry, on: Quadrature, density: Callable[[Points, float], Floats]) -> Load:
    """Return the load of a density (c, q, dim) per measure of the reference element, at points and a time."""
    return Load(record, lambda t, _u: on.forces(lambda at: density(at, t)))


def _traction(space: Space, record: Traction) -> Load:
    """Return a force per area of the undeformed faces, whose values may depend on their unit normals."""
    values = _values(space, record, "t")
    on = on_skin(space, space.mesh.cells_of(record.group))
    return _distributed(
        record, on, lambda at, t: _values_at(space, values, at.x, t, unit(at.normal)) * at.size[..., None]
    )


def _body_force(space: Space, record: BodyForce) -> Load:
    """Return a force per volume of the undeformed cells."""
    values = _values(space, record, "f")
    on = Quadrature.on_cells(space, space.cells(record.groups))
    return _distributed(record, on, lambda at, t: _values_at(space, values, at.x, t) * at.size[..., None])


def _gravity(space: Space, materials: Materials, record: Gravity, weight: Weight | None) -> Load:
    """Return the weight of the cells, the density of each times an acceleration, or the `weight` of the nodes.

    Raises DataError if all densities are 0.
    """
    values = _values(space, record, "g")
    if weight is not None:
        return Load(record, lambda t, _u: weight(_values_at(space, values, space.mesh.points, t).ravel()))
    if not any(law.density for law in materials.laws):
        raise DataError("it needs a density, and every material has 0; give at least one its density")
    density = np.zeros(space.mesh.n_cells)
    for number, block in enumerate(space.blocks):
        density[block.cell] = materials.densities(number)

    def weight_at(at: Points, t: float) -> NDArray[np.floating]:
        return _values_at(space, values, at.x, t) * (density[at.cells.cell][:, None] * at.size)[..., None]

    return _distributed(record, Quadrature(space, space.blocks), weight_at)


def pressure(record: Pressure, on: Quadrature) -> Load:
    """Return a pressure on faces, > 0 into the body: f_as = -int p N_a n_s, with n = a_1 x a_2 of the tangents a_k.

    A follower load has n, and the radius in axisymmetry, of the displaced faces. n changes with the tangents,

        df_as/du_bt = -int p N_a (N_b,1 e_t x a_2 - N_b,2 e_t x a_1)_s,

    in 2D n = (a_y, -a_x); in axisymmetry the radius in 2 pi r grows by N_b with u_bx. The matrix is symmetric if the
    pressure is uniform and the surface is closed or its boundary is fixed; in general it is not.
    """
    space = on.space

    def value(at: Points, t: float) -> NDArray[np.floating]:
        return _values_at(space, [record.value], at.x, t)

    def force(t: float, u: Floats | None) -> NDArray[np.floating]:
        return on.forces(lambda at: -value(at, t) * at.normal[..., : space.dim], u if record.follower else None)

    def tangent(t: float, u: Floats) -> csr_array:
        parts = []
        for at in on.points(u):
            p = -value(at, t)[..., 0] * at.w
            K = np.einsum("fq,qa,fqbst->fasbt", p, at.N, _normal_derivative(space, at), optimize=True)
            dofs = space.dofs(at.nodes.ravel()).reshape(len(at.nodes), -1)
            parts.append((dofs, K.reshape(*dofs.shape, -1)))
        return sparse_blocks(space.n_dof, parts)

    return Load(record, force, tangent if record.follower else None)


def _normal_derivative(space: Space, at: Points) -> NDArray[np.floating]:
    """Return the derivative (f, q, n, s, t) of the normals, times Jacobian, by the nodes' displacements.

    In axisymmetry it includes the derivative of the radius, relative to the radius.
    """
    J, dN, radius = at.J, at.gradient, at.now[..., 0]
    if space.dim == 3:
        cross = np.cross(np.eye(3)[:, None], J.swapaxes(2, 3)[:, :, None])  # (f, q, t, k, s): e_t x a_k
        by_first = np.einsum("qb,fqts->fqbst", dN[..., 0], cross[..., 1, :])
        return by_first - np.einsum("qb,fqts->fqbst", dN[..., 1], cross[..., 0, :])
    quarter = np.array([[0.0, 1.0], [-1.0, 0.0]])
    turned = np.broadcast_to(np.einsum("qb,st->qbst", dN[..., 0], quarter), (*at.w.shape, *dN.shape[1:2], 2, 2))
    if not space.model.axisymmetric:
        return turned
    inverse = np.divide(1.0, radius, out=np.zeros_like(radius), where=radius > 0)
    grown = np.einsum("fqs,qb,fq->fqbs", at.normal[..., :2], at.N, inverse)
    return turned + grown[..., None] * np.eye(2)[0]


def on_skin(space: Space, faces: Ints, *, outer: bool = False) -> Quadrature:
    """Return the quadrature over skin cells, each face once, outward; of several processes those near its own nodes.

    Raises DataError for cells that are no skin, or of no thickness, and of an `outer` skin, on which a pressure has one
    side, for those that do not have exactly one cell behind them.
    """
    mesh = space.mesh
    odd = faces[mesh.cell_dim[faces] != space.dim - 1]
    if len(odd) or not space.share.total(np.array(len(faces))):
        named = f"cells {mesh.cell_names(odd)} have another" if len(odd) else "the group is empty"
        message = f"a load on a surface needs cells of dimension {space.dim - 1}, and {named}"
        raise DataError(f"{message}; name a group of faces", mesh.cell_number[odd])
    faces = space.near(faces)
    if not len(faces):
        return Quadrature(space, ())
    surface = Surface.of(mesh, faces)
    nodes = surface.faces.nodes
    loose = surface.cell[((nodes >= 0) & ~space.attached[nodes]).any(axis=1)]
    if len(loose):
        message = f"cells {mesh.cell_names(loose)} have nodes that belong to no cell of a body"
        raise DataError(f"{message}; a load acts on the surface of a body", mesh.cell_number[loose])
    unknown = surface.cell[np.isnan(surface.depth)]
    if outer and len(unknown):
        message = f"cells {mesh.cell_names(unknown)} do not have exactly one cell of a body behind them"
        raise DataError(f"{message}; a pressure needs outer faces of a body", mesh.cell_number[unknown])
    space.thick(surface.cell)
    return Quadrature(space, tuple(Cells(name, own, surface.cell[rows]) for name, rows, own in surface.by_type()))


# ---- loads at nodes


def _force(space: Space, record: Force) -> Load:
    """Return a force on each node of a group, or one in total, which is spread evenly; of the full circle."""
    parts = _parts(space, record)
    nodes: Ints = np.flatnonzero(parts)
    parts = parts[nodes]
    values, axes, moment = _values(space, record, "f"), directions(space, record, nodes), None
    if record.total and record.moment is not None:
        about = Coupling(group=record.group or "", moment=record.moment, axes=None).altered(kind=record.kind)
        moment = PointLoad.of(space, about.altered(place=record.place), False)

    def force(t: float, _u: Floats | None) -> NDArray[np.floating]:
        out = np.zeros((space.mesh.n_nodes, space.dim))
        f = _values_at(space, values, space.mesh.points[nodes], t) * parts[:, None]
        out[nodes] = np.einsum("nk,nks->ns", f, axes)
        return out.ravel() if moment is None else out.ravel() + moment.force(t)

    return Load(record, force)


def _parts(space: Space, record: Force) -> NDArray[np.floating]:
    """Return the part (n_nodes,) that each node has of a force: 1, or a share of one in total.

    Over a group of cells it goes by the measure of those of the highest dimension: faces by area, edges by length,
    cells of the body by volume, with thickness or 2 pi r; over points and nodes in equal parts. Raises CaseError,
    DataError.
    """
    if record.total and any(value is not None and value.depends_on_place for value in _values(space, record, "f")):
        message = "total = true takes one force for the whole group, and not a function of place"
        raise wrong(record, f"{message}; give numbers or formulas of t, or a traction")
    cells = cells_of(space, record) if record.total and record.group is not None else None
    dims = np.zeros(0) if cells is None else space.mesh.cell_dim[cells]
    dim = int(space.share.largest(float(dims.max(initial=0))))
    if cells is None or not dim:
        parts: Floats = np.zeros(space.mesh.n_nodes)
        parts[on_bodies(space, nodes_before_cut(space, record), "force")] = 1.0
    else:
        cells = cells[dims == dim]
        if dim == space.dim - 1:
            on_skin(space, cells)
        elif dim < space.dim:
            on_bodies(space, space.mesh.nodes_on(space.near(cells)), "force")
        parts = nodal_measures(space, cells)
    whole = float(space.share.total(space.own(parts).sum())) if record.total else 1.0
    if not whole > 0:
        raise DataError("a total force is spread by area, and the group has none; name a group of faces, or of nodes")
    return parts / whole


# ---- temperatures


def thermal_load(space: Space, materials: Materials, records: Sequence[Temperature], threads: int = 1) -> Load:
    """Return the load of some temperatures under small kinematics."""
    warm = temperature_of(space, materials, records)
    return Load(records[0], lambda t, _u: thermal_force(space, materials, warm, t, threads=threads))


def thermal_force(
    space: Space, materials: Materials, temperature: TemperatureField | None, t: float = 1.0, *, threads: int = 1
) -> NDArray[np.floating]:
    """Return the thermal load int B^T C (T - T0) alpha dV (n_dof,): K u equals it if nothing else acts."""
    undeformed = np.zeros(space.n_dof)
    return -internal_force(space, materials, undeformed, temperature=temperature, t=t, threads=threads)


def temperature_of(space: Space, materials: Materials, records: Sequence[Temperature]) -> TemperatureField | None:
    """Return temperatures as (value, cells) pairs, as `temperature.warming` takes them; None if there are none.

    Each has the cells of one law, since a number is ramped from the law's own reference.
    """
    law_of_cell = np.full(space.mesh.n_cells, -1)
    for block, which in zip(space.blocks, materials.law, strict=True):
        law_of_cell[block.cell] = which
    pairs = []
    for record in records:
        chosen = space.cells(record.groups)
        for k, law in enumerate(materials.laws):
            cells = chosen[law_of_cell[chosen] == k]
            if len(cells):
                pairs.append((_ramped(space, record.value, law.reference_temperature), cells))
    return pairs or None


def _ramped(space: Space, value: Value, start: float) -> Callable[[Floats, float], Floats]:
    """Return a temperature as a function of points (n, 3) and time, ramped from its `start`."""
    return lambda x, t: value(x[:, : space.dim], t, start=start)


# ---- values at points


def _values(space: Space, record: Entry, letter: str) -> list[Value | None]:
    """Return the values of a vector's components, by the letter of its keys."""
    return [getattr(record, f"{letter}{axis}") for axis in _AXES[: space.dim]]


def _values_at(
    space: Space, values: Sequence[Value | None], x: Floats, t: float, normals: Floats | None = None
) -> NDArray[np.floating]:
    """Return values (..., k) at points x (..., 3) and time t, 0 for None; `normals` (..., 3): unit normals there."""
    flat = x.reshape(-1, 3)[:, : space.dim]
    n = None if normals is None else normals.reshape(-1, 3)[:, : space.dim]
    of_each = [np.zeros(len(flat)) if value is None else value(flat, t, normals=n) for value in values]
    return np.stack(of_each, axis=-1).reshape(*x.shape[:-1], len(values))
