"""Cyclic symmetry: the sides of a sector, of which one is the other, turned about an axis by the angle of the sector.

Displacements at the slave are those at the master, turned: u_s = R u_m, R the rotation that takes the master onto the
slave. Where the nodes of both sides match, these are equations, one for each node and component, and the sector is
exactly a part of the whole ring. Where they do not, the sides are a tie whose master is turned (`contact.interface`).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.surface.normals import unit
from lacsolver.case.case import Case
from lacsolver.case.joints import Cyclic
from lacsolver.constraints.equations import Equations
from lacsolver.constraints.rotation import turn
from lacsolver.contact.interface import Turn
from lacsolver.space.places import in_words, wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse

#: distance of matching nodes, relative to the size of the sides
_MATCH = 1e-6
#: mean distance of the sides about the axis, relative to that between their nodes, up to which they are those of a
#: sector: on sides that are curved, nearest nodes are a little apart
_APART = 0.3


def with_sectors(case: Case, mesh: Mesh) -> Case:
    """Return the case with the angle of each sector, and whether the nodes of its sides match.

    Raises CaseError where the sides are not those of a sector.
    """
    if not case.cyclic:
        return case
    records = tuple(_with_angle(record, mesh, mesh.dim) for record in case.cyclic)
    return case.altered(cyclic=records)


def turn_of(record: Cyclic, dim: int) -> Turn:
    """Return the rotation that takes the master of a sector onto its slave, in the coordinates of the mesh."""
    centre = np.zeros(3)
    centre[:dim] = record.origin or np.zeros(dim)
    axis = np.array(record.axis) / np.linalg.norm(record.axis)
    return Turn(np.eye(3) + turn(record.angle * axis), centre)


def equations_of(space: Space, case: Case) -> Iterator[Equations]:
    """Yield the equations of the sectors whose sides match, node by node."""
    for record in case.cyclic:
        if record.matching:
            pairs = _matching(space.mesh, record, turn_of(record, space.dim))
            if pairs is None:
                message = "its sides matched before the slaves were cut, and no longer match"
                raise wrong(record, f"{message}; let slaves end before the sides, or cut them alike on both")
            yield _equations(space, record, *pairs)


def _equations(space: Space, record: Cyclic, slave: Ints, master: Ints) -> Equations:
    """Return u_s - R u_m = 0 for each pair of nodes; nodes on the axis, which are both, are their own partners."""
    R = turn_of(record, space.dim).R[: space.dim, : space.dim]
    k, dim = len(slave), space.dim
    row = np.arange(k * dim).reshape(k, dim)
    of_slave, of_master = (row, space.dofs(slave), 1.0), (row[:, :, None], space.dofs(master)[:, None, :], -R)
    C = sparse((k * dim, space.n_dof), of_slave, of_master)
    return Equations(
        f"cyclic {record.name}", C, lambda t: np.zeros(k * dim), partial(in_words, record), may_follow=True
    )


def _with_angle(record: Cyclic, mesh: Mesh, dim: int) -> Cyclic:
    """Return a record with its angle, of the sign for which the turned master is nearer to the slave."""
    slave, master = _nodes(mesh, record)
    x_s, x_m = mesh.points[slave], mesh.points[master]
    angles = [sign * 2 * np.pi / record.sectors for sign in (1, -1)]
    turned = [turn_of(record.altered(angle=angle), dim).places(x_m) for angle in angles]
    away = [_nearest(x, x_s)[0] for x in turned]
    best = int(np.argmin([d.mean() for d in away]))
    apart = _about_axis(record, dim, x_s, turned[best])
    if not apart <= _APART * max(_spacing(x_s), _spacing(x_m)):
        message = f"rotated by {360 / record.sectors:g} degrees, master {record.master!r} is {apart:.4g} away"
        advice = "check sectors, axis and origin, and which groups are the sides of the sector"
        raise wrong(record, f"{message} from slave {record.slave!r}; {advice}")
    turned_record = record.altered(angle=angles[best])
    matching = _matching(mesh, record, turn_of(turned_record, dim)) is not None
    return record.altered(angle=angles[best], matching=matching)


def _matching(mesh: Mesh, record: Cyclic, turn: Turn) -> tuple[Ints, Ints] | None:
    """Return the nodes (k,) of the slave and their partners of the master; None where faces do not match.

    Faces are matched, and then their nodes, since nodes of several bodies may be at one place.
    """
    slaves, masters = (_faces(mesh, group) for group in (record.slave, record.master))
    if {kind: len(rows) for kind, rows in slaves.items()} != {kind: len(rows) for kind, rows in masters.items()}:
        return None
    x, turned, pairs = mesh.points, turn.places(mesh.points), []
    size = max(float(np.ptp(x[rows.ravel()], axis=0).max()) for rows in slaves.values())
    for kind, rows in slaves.items():
        away, which = _nearest(turned[masters[kind]].mean(axis=1), x[rows].mean(axis=1))
        partner = masters[kind][which]
        apart = np.linalg.norm(x[rows][:, :, None] - turned[partner][:, None], axis=3)
        at = apart.argmin(axis=2)
        if (
            max(away.max(), apart.min(axis=2).max()) > _MATCH * size
            or (np.sort(at, axis=1) != np.arange(rows.shape[1])).any()
        ):
            return None
        pairs.append(np.stack([rows, np.take_along_axis(partner, at, axis=1)], axis=-1).reshape(-1, 2))
    slave, master = np.unique(np.concatenate(pairs), axis=0).T
    return None if len(np.unique(slave)) < len(slave) or len(np.unique(master)) < len(master) else (slave, master)


def _faces(mesh: Mesh, group: str) -> dict[str, Ints]:
    """Return the distinct faces of a group, nodes (k, n) by type."""
    cells = mesh.cells_of(group)
    rows = {name: nodes for name, _, nodes in mesh.select(cells[mesh.cell_dim[cells] == mesh.dim - 1])}
    return {
        name: nodes[np.unique(np.sort(nodes, axis=1), axis=0, return_index=True)[1]] for name, nodes in rows.items()
    }


def _about_axis(record: Cyclic, dim: int, slave: Floats, master: Floats) -> float:
    """Return the mean distance, about the axis, of slave nodes (n, 3) from the nearest ones of the turned master."""
    arm = slave - turn_of(record, dim).centre
    theta = unit(np.cross(record.axis, arm))
    away = master[_nearest(master, slave)[1]] - slave
    return float(np.abs((away * theta).sum(axis=1)).mean())


def _spacing(x: Floats) -> float:
    """Return the median distance of points (n, 3) from their neighbours."""
    return float(np.median(_nearest(x, x, 2)[0][:, 1])) if len(x) > 1 else np.inf


def _nodes(mesh: Mesh, record: Cyclic) -> tuple[Ints, Ints]:
    """Return the nodes of both sides."""
    return mesh.nodes_on(mesh.cells_of(record.slave)), mesh.nodes_on(mesh.cells_of(record.master))


def _nearest(points: Floats, places: Floats, count: int = 1) -> tuple[Floats, Ints]:
    """Return the distances and rows of the nearest points of some places: (k,) of one, (k, count) of more."""
    # imported where used, for it takes a tenth of the start of a run
    from scipy.spatial import cKDTree

    return cKDTree(points).query(places, count)
