"""Fields that a run has written into its folder, read again: the mesh, and the fields at each time.

solid, contact_NAME (VTU) or results.med, contact_NAME.csv -> `Fields`       at the times of [output]
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError
from lacmesh.formats import read
from lacmesh.formats.vtu import read_pvd
from lacmesh.indices import Index
from lacmesh.mesh import Floats, Ints, Mesh, concatenated
from lacmesh.surface import Surface
from lacsolver.output.names import MED, SOLID, contact_stems
from lacsolver.output.tables import CONTACT_COLUMNS, FRICTION_COLUMNS, read_table, same_time
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.results.state import ZoneFriction

#: a file of one process among those that a PVTU names
_PIECE = re.compile(r'<Piece Source="([^"]+)"')


def stored_fields(folder: Path) -> StoredFields:
    """Return the fields in a folder: those of its VTU files, or else of results.med. Raises ReadError."""
    return StoredVtu(folder) if (folder / f"{SOLID}.pvd").exists() else StoredMed(folder)


class StoredVtu:
    """Fields in VTU files. What all times have in one file, series and tables, is read once."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._entries = folder, list(read_pvd(folder / f"{SOLID}.pvd").items())
        self._series, self._table = cache(read_pvd), cache(_contact_table)

    @property
    def times(self) -> Sequence[float]:
        """Times of the PVD."""
        return [time for time, _ in self._entries]

    def read(self, i: int, zones: tuple[str, ...]) -> tuple[Mesh, Fields]:
        """Return the bodies and the fields at the i-th time. Raises ReadError."""
        time, file = self._entries[i]
        solid = _joined(self._folder / file) if file.endswith(".pvtu") else read(self._folder / file)
        nodal = _vectors(solid, solid.node_data)
        contact = {}
        for zone, stem in contact_stems(zones).items():
            series = self._series(self._folder / f"{stem}.pvd")
            skin = next((file for then, file in series.items() if same_time(then, time)), None)
            if skin is not None:
                rows = _rows_at(self._table(self._folder / f"{stem}.csv"), time)
                contact[zone] = _of_skin(solid, read(self._folder / skin), rows)
        stress = solid.node_data["stress"]
        stress = stress[:, :4] if solid.dim == 2 else stress
        moving = (nodal.get("velocity"), nodal.get("acceleration"))
        strain = solid.node_data.get("plastic_strain")
        return solid, Fields(time, nodal["displacement"], stress, nodal["reaction"], contact, *moving, strain)


class StoredMed:
    """Fields in results.med; tables of contacts are read once."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._mesh, self._table = folder, read(folder / MED), cache(_contact_table)
        steps = self._mesh.steps.values()
        self._times = sorted({step.time for step in steps if step.field == "DEPL"})

    @property
    def times(self) -> Sequence[float]:
        """Times of the displacement."""
        return self._times

    def read(self, i: int, zones: tuple[str, ...]) -> tuple[Mesh, Fields]:
        """Return the bodies and the fields at the i-th time. Raises ReadError."""
        time, mesh = self._times[i], self._mesh
        now = {step.field: name for name, step in mesh.steps.items() if same_time(step.time, time)}
        names = {field: mesh.node_data[name] for field, name in now.items() if name in mesh.node_data}
        nodal, contact = _vectors(mesh, names), {}
        for zone, stem in contact_stems(zones).items():
            pressure = mesh.cell_data[now[f"{zone}.pressure"]].reshape(-1)
            surface = Surface.of(mesh, np.flatnonzero(np.isfinite(pressure)))
            rows = _rows_at(self._table(self._folder / f"{stem}.csv"), time)
            macro = Index(rows["macro"].astype(int)).places(mesh.cell_data["lac_macro"][surface.cell])
            recovered = names[f"{zone}.pressure_recovered.nodes"].reshape(-1)
            contact[zone] = _zone(surface, macro, rows, nodal[f"{zone}.contact_force"], recovered)
            contact[zone] = replace(contact[zone], shear_recovered=nodal.get(f"{zone}.shear_recovered.nodes"))
        moving = (nodal.get("VITE"), nodal.get("ACCE"))
        strain = names["VARI_NOEU"].reshape(-1) if "VARI_NOEU" in names else None
        return mesh, Fields(time, nodal["DEPL"], names["SIEF_NOEU"], nodal["REAC_NODA"], contact, *moving, strain)


#: fields as a folder has them, in one format or the other
StoredFields: TypeAlias = StoredVtu | StoredMed


def _joined(path: Path) -> Mesh:
    """Return the mesh of the pieces that a PVTU file names, one for each process. Raises ReadError."""
    try:
        names = _PIECE.findall(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ReadError(path, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if not names:
        raise ReadError(path, "names no piece; run the case again")
    pieces = [read(path.parent / name) for name in names]
    number = np.concatenate([piece.node_number for piece in pieces])
    known, first, place = np.unique(number, return_index=True, return_inverse=True)
    starts = np.cumsum([0, *(piece.n_nodes for piece in pieces)])
    blocks, cells = _blocks(pieces, place, starts)
    return Mesh.create(
        np.concatenate([piece.points for piece in pieces])[first],
        blocks,
        space_dim=pieces[0].space_dim,
        node_number=known,
        cell_number=np.concatenate([piece.cell_number for piece in pieces])[cells],
        node_data={k: np.concatenate([piece.node_data[k] for piece in pieces])[first] for k in pieces[0].node_data},
        cell_data={k: np.concatenate([piece.cell_data[k] for piece in pieces])[cells] for k in pieces[0].cell_data},
        zones=pieces[0].zones,
    )


def _blocks(pieces: Sequence[Mesh], place: Ints, starts: Ints) -> tuple[list[tuple[str, Ints]], Ints]:
    """Return the cells of all pieces by type, and their old indices; node n of piece k is `place[starts[k] + n]`."""
    offset = np.cumsum([0, *(piece.n_cells for piece in pieces)])
    parts: dict[str, list[tuple[Ints, Ints]]] = {}
    for piece, start, before in zip(pieces, starts, offset, strict=False):
        for block, low in zip(piece.blocks, piece.offsets, strict=False):
            own = place[start + block.nodes], before + low + np.arange(len(block.nodes))
            parts.setdefault(block.type, []).append(own)
    blocks = [(kind, np.concatenate([nodes for nodes, _ in own])) for kind, own in parts.items()]
    return blocks, concatenated(rows for own in parts.values() for _, rows in own)


def _vectors(mesh: Mesh, values: Mapping[str, NDArray]) -> dict[str, NDArray[np.floating]]:
    """Return the values (n, components) that have at least as many components as the space, as vectors (n, d)."""
    d = mesh.dim
    return {k: np.asarray(v, float)[:, :d] for k, v in values.items() if v.ndim == 2 and v.shape[1] >= d}


def _contact_table(path: Path) -> dict[str, NDArray[np.floating]]:
    """Return the columns of a contact's table. Raises ReadError."""
    table = read_table(path)
    if not set(CONTACT_COLUMNS) <= set(table):
        raise ReadError(path, "is no table of a contact")
    return table


def _rows_at(table: Mapping[str, NDArray], time: float) -> dict[str, NDArray[np.floating]]:
    """Return the rows (m,) of a contact's table at a time, by column."""
    at = np.array([same_time(t, time) for t in table["time"]], bool)
    return {name: values[at] for name, values in table.items()}


def _of_skin(solid: Mesh, skin: Mesh, rows: Mapping[str, NDArray]) -> ZoneFields:
    """Return the fields of a zone from its skin's file, on the nodes of the bodies."""
    surface = Surface.of(skin, np.arange(skin.n_cells))
    node = Index(solid.node_number).places(skin.node_number)
    on_solid = np.where(surface.faces.nodes >= 0, node[surface.faces.nodes], -1)
    cells = Index(solid.cell_number).places(skin.cell_number[surface.cell])
    force, nodal = np.zeros((solid.n_nodes, solid.dim)), np.full(solid.n_nodes, np.nan)
    force[node] = skin.node_data["contact_force"][:, : solid.dim]
    nodal[node] = skin.node_data["pressure_recovered"].reshape(-1)
    macro = Index(rows["macro"].astype(int)).places(skin.cell_data["macro"][surface.cell])
    faces = replace(surface.faces, nodes=on_solid)
    zone = _zone(replace(surface, x=solid.points, faces=faces, cell=cells), macro, rows, force, nodal)
    if "shear_recovered" not in skin.node_data:
        return zone
    shear = np.full((solid.n_nodes, solid.dim), np.nan)
    shear[node] = skin.node_data["shear_recovered"][:, : solid.dim]
    return replace(zone, shear_recovered=shear)


def _zone(surface: Surface, macro: Ints, rows: Mapping[str, NDArray], force: Floats, nodal: Floats) -> ZoneFields:
    axes = "xyz"[: surface.dim + 1]
    centre, normal = (np.stack([rows[f"{start}{axis}"] for axis in axes], axis=1) for start in ("", "n"))
    columns = ("pressure", "pressure_recovered", "gap", "status", "coverage", "area")
    pressure, recovered, gap, status, coverage, area = (rows[name] for name in columns)
    return ZoneFields(
        surface, macro, rows["macro"].astype(int), pressure, recovered, gap, status.astype(np.int8), coverage, area,
        centre, normal, force, nodal, _friction(rows, axes, area * coverage),
    )  # fmt: skip


def _friction(rows: Mapping[str, NDArray], axes: str, w: Floats) -> ZoneFriction | None:
    """Return the friction of a zone from the rows of its table, with the covered areas w (m,); None without it.

    Energies of the step are not known.
    """
    if "shear_1" not in rows:
        return None
    count = range(1, len(axes))
    tangents = np.stack([np.stack([rows[f"tangent_{k}_{a}"] for a in axes], axis=1) for k in count], axis=1)
    shear, slip = (np.stack([rows[f"{name}_{k}"] for k in count], axis=1) for name in ("shear", "slip"))
    taken = float((rows["dissipation"] * w).sum())
    resultant = -np.einsum("n,nk,nkd->d", w, shear, tangents)
    path, use, dissipation = (rows[name] for name in FRICTION_COLUMNS)
    return ZoneFriction(tangents, shear, slip, path, use, dissipation, (np.nan, taken), resultant)
