"""Loads, springs and temperatures of a case: its records as vectors and matrices."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints, concatenated
from lacsolver.bodies.line_springs import LineSprings, between_nodes
from lacsolver.bodies.material import Materials
from lacsolver.bodies.small.fields import TemperatureField
from lacsolver.case import Case, Coupling, Force, Spring, Traction
from lacsolver.case import Temperature as Record
from lacsolver.case.entry import Entry
from lacsolver.case.value import Value
from lacsolver.constraints import coupling
from lacsolver.problem import loads
from lacsolver.space.axes import directions
from lacsolver.space.places import cells_of, nodes_of, wrong
from lacsolver.space.space import Space
from lacsolver.space.values import evaluate_vector

_AXES = "xyz"
#: distance, relative to the bodies' extent, up to which two nodes are at one place
_APART = 1e-9
PointFunction = Callable[[Floats, float], Floats]


def at_points(space: Space, value: Value) -> PointFunction:
    """Return a value of the case as a function of points (n, 3) and time; it gets the model's coordinates only."""
    return lambda x, t: value(x[:, : space.dim], t)


def at_local_points(space: Space, value: Value) -> PointFunction:
    """Return a value of the case as a function of points (n, 3), relative to the space's origin, and time."""
    return lambda x, t: value((x + space.origin)[:, : space.dim], t)


def load(
    space: Space, materials: Materials, case: Case, t: float, threads: int = 1, *, u: Floats | None = None,
    weight: Callable[[Floats], Floats] | None = None,
) -> NDArray[np.floating]:  # fmt: skip
    """Return the nodal forces f (n_dof,) of all loads at time t, except springs and loads on rigid bodies.

    `u` (n_dof,): displacement of the faces of follower loads; None: undeformed. `weight`: function for the weight
    (n_dof,) under accelerations (n_dof,) of gravity, that of the cells by default. Temperature is a load under small
    kinematics; under finite kinematics it is part of the internal forces (`kinematics.Finite`).
    """
    mesh, f = space.mesh, np.zeros(space.n_dof)
    for pressure in case.pressure:
        x = space.places(u) if pressure.follower and u is not None else None
        with _said_of(pressure):
            f += loads.pressure(space, mesh.cells_of(pressure.group), at_points(space, pressure.value), t, x=x)
    for traction in case.traction:
        with _said_of(traction):
            f += loads.traction(space, mesh.cells_of(traction.group), _traction(space, traction), t)
    for force in case.force:
        f += _force(space, force, t)
    finite = case.kinematics == "finite"
    for one in coupling.distributing(case):
        f += coupling.loads(space, one, finite, t, u)
    for body in case.body_force:
        with _said_of(body):
            f += loads.body_force(space, _vector(space, body, "f"), t, cells=space.cells(body.groups))
    if case.gravity is not None and weight is not None:
        f += weight(evaluate_vector(_vector(space, case.gravity, "g"), mesh.points, t, space.dim, "gravity").ravel())
    elif case.gravity is not None:
        f += loads.gravity(space, materials, _vector(space, case.gravity, "g"), t)
    warm = temperature(space, materials, case)
    if warm is not None and case.kinematics == "small":
        f += loads.thermal_force(space, materials, warm, t, threads=threads)
    return f


def load_tangent(space: Space, case: Case, u: Floats, t: float) -> csr_array | None:
    """Return df/du (n_dof, n_dof) of `load` at u (n_dof,) and time t, not symmetric; None for loads without one."""
    tangent = None
    for pressure in case.pressure:
        if pressure.follower:
            cells, value = space.mesh.cells_of(pressure.group), at_points(space, pressure.value)
            own = loads.pressure_tangent(space, cells, value, t, x=space.places(u))
            tangent = own if tangent is None else csr_array(tangent + own)
    for one in coupling.distributing(case) if coupling.follows(case) else ():
        turned = coupling.load_tangent(space, one, t, u)
        tangent = turned if tangent is None else tangent if turned is None else csr_array(tangent + turned)
    return tangent


def _force(space: Space, force: Force, t: float) -> NDArray[np.floating]:
    """Return the nodal forces (n_dof,) of a force on each node, or of one in total."""
    value = _vector(space, force, "f")
    if not force.total:
        nodes = _nodes_before_cut(space, force)
        return _along_axes(space, force, loads.nodal_force(space, nodes, value, t))
    spread = _spread_force(space, force, value, t)
    if force.moment is None:
        return spread
    record = Coupling(group=force.group or "", moment=force.moment, axes=None).altered(kind=force.kind)
    return spread + coupling.loads(space, record.altered(place=force.place), False, t, None)


def _spread_force(space: Space, force: Force, value: Sequence[float | PointFunction], t: float) -> NDArray[np.floating]:
    """Return the nodal forces (n_dof,) of a force in total."""
    given = [getattr(force, f"f{a}") for a in _AXES[: space.dim]]
    if any(part is not None and part.depends_on_place for part in given):
        message = "total = true takes one force for the whole group, and not a function of place"
        raise wrong(force, f"{message}; give numbers or formulas of t, or a traction")
    cells = None if force.group is None else cells_of(space, force)
    if cells is not None and space.share.largest(float(space.mesh.cell_dim[cells].max(initial=0))) > 0:
        with _said_of(force):
            return _along_axes(space, force, loads.spread_force(space, value, t, cells=cells))
    return _along_axes(space, force, loads.spread_force(space, value, t, nodes=_nodes_before_cut(space, force)))


def _along_axes(space: Space, force: Force, f: Floats) -> NDArray[np.floating]:
    """Return forces f (n_dof,), whose components are along the axes of their record, along those of the mesh."""
    if force.axes is None:
        return f
    f = f.reshape(-1, space.dim)
    nodes, out = np.flatnonzero(f.any(axis=1)), np.zeros_like(f)
    out[nodes] = np.einsum("nk,nks->ns", f[nodes], directions(space, force, nodes))
    return out.ravel()


@contextmanager
def _said_of(record: Entry) -> Iterator[None]:
    """Turn errors about a load's cells into CaseErrors that name the record of the case, and its line."""
    try:
        yield
    except (DataError, RequestError) as error:
        raise wrong(record, str(error)) from None


def _nodes_before_cut(space: Space, record: Force | Spring) -> Ints:
    """Return the nodes (k,) of a force or a spring without those that a cut made, so that its total is that of no cut.

    A node that is named by its place keeps its own. Raises CaseError for a group that has nodes of the cut alone.
    """
    nodes = nodes_of(space, record)
    if record.at is not None:
        return nodes
    kept = nodes[~space.made_by_cut[nodes]]
    if not space.share.total(np.array(len(kept))):
        message = f"the group {record.group!r} has only nodes that the cut made, on which forces and springs do not act"
        raise wrong(record, f"{message}; name one that has nodes of the mesh before the cut")
    return kept


def springs(space: Space, case: Case, *, along_lines: bool = True) -> csr_array | None:
    """Return the stiffness (n_dof, n_dof) of springs; None if there are none.

    `along_lines`: with those along the undeformed line between two nodes. Raises CaseError for ends that are not one
    node each, or are at one place, and DataError for nodes without a cell.
    """
    stiffness_matrix = None
    moved = _on_rigid_bodies(space, case)
    for spring in case.spring:
        if spring.k is not None and not along_lines:
            continue
        if spring.to is None:
            nodes, k = np.unique(_nodes_before_cut(space, spring)), _stiffness(space, spring)
            own = loads.springs(space, nodes, k, moved=moved, along=directions(space, spring, nodes))
        else:
            own = _between(space, spring, moved)
        stiffness_matrix = own if stiffness_matrix is None else csr_array(stiffness_matrix + own)
    return stiffness_matrix


def line_springs(space: Space, case: Case) -> LineSprings | None:
    """Return the springs along the line between two nodes, which turns with them; None if there are none."""
    records = [spring for spring in case.spring if spring.k is not None]
    if not records:
        return None
    moved = _on_rigid_bodies(space, case)
    ends = np.array([_ends(space, spring, moved) for spring in records])
    return LineSprings(space, ends, np.array([spring.k for spring in records], float))


def _on_rigid_bodies(space: Space, case: Case) -> Ints:
    """Return the nodes (k,) of rigid bodies, which springs and forces find without a cell."""
    return concatenated(nodes_of(space, body) for body in coupling.rigid_records(case))


def _stiffness(space: Space, spring: Spring) -> list[float]:
    return [getattr(spring, f"k{a}") or 0.0 for a in _AXES[: space.dim]]


def _between(space: Space, spring: Spring, moved: Ints) -> csr_array:
    """Return the stiffness (n_dof, n_dof) of a spring between two nodes, along its undeformed line or its axes."""
    ends = _ends(space, spring, moved)
    if spring.k is None:
        k, along = np.array(_stiffness(space, spring)), directions(space, spring, ends[:1])[0]
    else:
        line = np.subtract(*space.local.points[ends[::-1], : space.dim])
        k, along = np.array([spring.k]), line[None] / np.linalg.norm(line)
    return between_nodes(space, ends[None], np.einsum("k,ks,kt->st", k, along, along)[None])


def _ends(space: Space, spring: Spring, moved: Ints) -> Ints:
    """Return the two nodes (2,) of a spring. Raises CaseError unless they are two, at two places for one on a line."""
    records = spring, spring.altered(group=spring.to, at=None)
    nodes = [np.unique(_nodes_before_cut(space, record)) for record in records]
    for record, own in zip(records, nodes, strict=True):
        if len(own) > 1:
            message = f"the group {record.group!r} has {len(own)} nodes, and a spring between two nodes has one at"
            raise wrong(spring, f"{message} each end; name a group of one node")
    ends = np.concatenate(nodes)
    if ends[0] == ends[1]:
        raise wrong(spring, f"both its ends are node {space.mesh.node_number[ends[0]]}; name another one by to")
    if spring.k is not None and np.ptp(space.local.points[ends], axis=0).max() <= _APART * space.extent:
        numbers = " and ".join(str(number) for number in space.mesh.node_number[ends])
        raise wrong(spring, f"nodes {numbers} are at one place, with no line between them; give kx, ky, kz and no k")
    with _said_of(spring):
        loads.check_on_bodies(space, ends, "spring", moved)
    return ends


def temperature(space: Space, materials: Materials, case: Case) -> TemperatureField | None:
    """Return the temperature as (value, cells) pairs, as `bodies.small.stress` takes it; None if there is none."""
    if not case.temperature:
        return None
    return [pair for record in case.temperature for pair in _by_law(space, materials, record)]


def _by_law(space: Space, materials: Materials, record: Record) -> Iterator[tuple[PointFunction, Ints]]:
    """Yield a temperature for the cells of each law, since a number is ramped from the law's own reference."""
    place = np.full(space.mesh.n_cells, -1)
    for block, which in zip(space.blocks, materials.law, strict=True):
        place[block.cell] = which
    chosen = space.cells(record.groups)
    for k, law in enumerate(materials.laws):
        cells = chosen[place[chosen] == k]
        if len(cells):
            yield _ramped(space, record.value, law.reference_temperature), cells


def _ramped(space: Space, value: Value, start: float) -> PointFunction:
    return lambda x, t: value(x[:, : space.dim], t, start=start)


def _vector(space: Space, record: object, letter: str) -> Sequence[float | PointFunction]:
    values = [getattr(record, f"{letter}{a}") for a in _AXES[: space.dim]]
    return [0.0 if value is None else at_points(space, value) for value in values]


def _traction(space: Space, record: Traction) -> loads.TractionField:
    values = [getattr(record, f"t{a}") for a in _AXES[: space.dim]]

    def traction(x: Floats, n: Floats, t: float) -> NDArray[np.floating]:
        at, normals = x[:, : space.dim], n[:, : space.dim]
        components = [np.zeros(len(x)) if value is None else value(at, t, normals=normals) for value in values]
        return np.stack(components, axis=1)

    return traction
