"""The whole ring of a sector with cyclic symmetry, for ParaView and pictures: cells and fields, turned one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.topology.skin import Faces
from lacsolver.case import Case, Cyclic
from lacsolver.constraints.cyclic import turn_of
from lacsolver.contact.interface import Turn
from lacsolver.equilibrium.state import ZoneFriction
from lacsolver.results.results import Fields, ZoneFields

#: places of the components xx, yy, zz, xy, yz, xz of a stress in a matrix
_ROWS, _COLUMNS = [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]


def asked(case: Case) -> Cyclic | None:
    """Return the sector of a case whose whole ring is to be written; None if there is none."""
    return next((record for record in case.cyclic if record.ring), None)


def described(case: Case) -> dict[str, dict[str, Any]]:
    """Return the sectors of a case by name, as results.json has them."""
    names = ("slave", "master", "sectors", "axis", "origin", "angle")
    return {one.name: {name: getattr(one, name) for name in names} for one in case.cyclic}


def sector_of(summary: Mapping[str, Any]) -> Cyclic:
    """Return the sector of a run, from what results.json has of it. Raises RequestError for one without."""
    for one in summary.get("cyclic", {}).values():
        keys: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in one.items()}
        angle = keys.pop("angle")
        return Cyclic(**keys).altered(angle=angle)
    raise RequestError("a whole ring is drawn of a sector, and the case of this run has no [[cyclic]]")


def ring_of(mesh: Mesh, record: Cyclic) -> Mesh:
    """Return the sector's mesh with its fields, repeated about the axis; nodes of neighbouring sectors are not joined.

    Nodal fields of three components are turned as vectors, those of six as stresses, others are repeated. Cells have
    the data `sector`, counted from 0.
    """
    turns = _turns(record, mesh.dim)
    fields = [{name: _turned(np.asarray(values), turn.R) for name, values in mesh.node_data.items()} for turn in turns]
    n = mesh.n_nodes
    blocks = [
        (block.type, np.concatenate([block.nodes + k * n for k in range(record.sectors)])) for block in mesh.blocks
    ]
    sector = [np.repeat(np.arange(record.sectors), len(block.nodes)) for block in mesh.blocks]
    data = {name: np.concatenate([one[name] for one in fields]) for name in mesh.node_data}
    whole = Mesh.create(np.concatenate([turn.places(mesh.points) for turn in turns]), blocks, space_dim=mesh.dim)
    return replace(whole, node_data=data, cell_data={"sector": np.concatenate(sector).astype(np.int32)})


def fields_of_ring(mesh: Mesh, fields: Fields, record: Cyclic) -> tuple[Mesh, Fields]:
    """Return the mesh of the whole ring, as `ring_of`, and the displacements and zones of the sector on it."""
    turns = _turns(record, mesh.dim)
    whole = ring_of(replace(mesh, node_data={}), record)
    zones = {name: _zone_of_ring(zone, mesh, whole, turns) for name, zone in fields.zones.items()}
    none = np.full((whole.n_nodes, fields.stress.shape[1]), np.nan)
    u, reaction = (_vectors(values, turns) for values in (fields.displacement, fields.reaction))
    return whole, Fields(fields.time, u, none, reaction, zones)


def _turns(record: Cyclic, dim: int) -> list[Turn]:
    """Return the rotation of each sector of a ring, the first one that stays."""
    step = turn_of(record, dim)
    return [step._replace(R=np.linalg.matrix_power(step.R, k)) for k in range(record.sectors)]


def _zone_of_ring(zone: ZoneFields, mesh: Mesh, whole: Mesh, turns: Sequence[Turn]) -> ZoneFields:
    """Return a zone's fields on the whole ring, whose macro-elements and faces follow one another by sectors."""
    k, surface = len(turns), zone.surface
    faces = Faces(np.tile(surface.faces.type, k), _numbered(surface.faces.nodes, k, mesh.n_nodes))
    block = np.searchsorted(mesh.offsets, surface.cell, side="right") - 1
    size = np.diff(mesh.offsets)[block]
    cell = np.concatenate([surface.cell + (k - 1) * mesh.offsets[block] + i * size for i in range(k)])
    skin = replace(surface, x=whole.points, faces=faces, cell=cell, depth=np.tile(surface.depth, k), height=None)
    names = ("number", "pressure", "recovered", "gap", "status", "coverage", "area", "dip", "pressure_recovered")
    repeated: dict[str, Any] = {name: np.tile(getattr(zone, name), k) for name in names}
    turned: dict[str, Any] = {name: _vectors(getattr(zone, name), turns) for name in ("normal", "traction", "force")}
    centre = np.pad(zone.centre, ((0, 0), (0, 3 - zone.centre.shape[1])))
    repeated["dip"] = None if zone.dip is None else repeated["dip"]
    return replace(
        zone, surface=skin, macro=_numbered(zone.macro, k, len(zone.status)),
        centre=np.concatenate([turn.places(centre) for turn in turns])[:, : zone.centre.shape[1]],
        shear_recovered=None if zone.shear_recovered is None else _vectors(zone.shear_recovered, turns),
        friction=None if zone.friction is None else _friction_of_ring(zone.friction, turns),
        **repeated, **turned,
    )  # fmt: skip


def _friction_of_ring(friction: ZoneFriction, turns: Sequence[Turn]) -> ZoneFriction:
    k, shape = len(turns), friction.tangents.shape
    tangents = _vectors(friction.tangents.reshape(-1, shape[-1]), turns).reshape(-1, *shape[1:])
    of_step, so_far = friction.energy
    return ZoneFriction(
        tangents, np.tile(friction.shear, (k, 1)), np.tile(friction.slip, (k, 1)), np.tile(friction.path, k),
        np.tile(friction.use, k), np.tile(friction.dissipation, k), (k * of_step, k * so_far),
        _vectors(friction.resultant[None], turns).sum(axis=0),
    )  # fmt: skip


def _numbered(index: Ints, sectors: int, n: int) -> Ints:
    """Return indices below n of a sector, -1 for none, as those of all sectors, one after the other."""
    return np.concatenate([np.where(index >= 0, index + k * n, -1) for k in range(sectors)])


def _vectors(values: Floats, turns: Sequence[Turn]) -> NDArray[np.floating]:
    """Return vectors (n, d) of a sector as those of all sectors."""
    d = values.shape[1]
    return np.concatenate([values @ turn.R[:d, :d].T for turn in turns])


def _turned(values: NDArray, R: NDArray) -> NDArray:
    """Return nodal values, turned by R (3, 3)."""
    if values.ndim == 2 and values.shape[1] == 3:
        return np.asarray(values @ R.T)
    if values.ndim == 2 and values.shape[1] == 6:
        full = np.zeros((len(values), 3, 3))
        full[:, _ROWS, _COLUMNS] = full[:, _COLUMNS, _ROWS] = values
        return (R @ full @ R.T)[:, _ROWS, _COLUMNS]
    return values
