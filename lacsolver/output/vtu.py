"""Fields for ParaView: solid.pvd, contact_NAME.pvd on the slave skins, a VTU file for each time of each.

Of several processes each writes a VTU file of its part of the solid, and a PVTU file names them all.

Displacements, forces and normals have three components, and stresses six (xx yy zz xy yz xz, VTK's order), in plane
models too, so that ParaView takes them for vectors and tensors. Points are undeformed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from lacmesh.formats import write
from lacmesh.formats.output import replace_file
from lacmesh.formats.vtu import read_pvd, write_pvd
from lacmesh.mesh import Floats, Mesh
from lacsolver.case import Cyclic
from lacsolver.distributed.share import Share
from lacsolver.output.folder import make_folder
from lacsolver.output.names import FIELDS, RING, SOLID, collections_in, contact_stems, vtu_file
from lacsolver.output.parts import Part, body, on_faces, skin
from lacsolver.output.ring import ring_of
from lacsolver.results.nodal import PRINCIPAL, principal, von_mises
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.space.space import Space

_SECTION = re.compile(r"<(PointData|CellData|Points)>(.*?)</\1>", re.DOTALL)
_ARRAY = re.compile(r"<DataArray (.*?) format=")
#: bytes in which the names of all arrays stand, before their values
_HEAD = 1 << 20


class VtuSeries:
    """The PVD and VTU files of a folder; existing ones are continued. Raises ReadError, WriteError.

    `sector`: the one whose whole ring is written too, None for none.
    """

    def __init__(self, folder: Path, space: Space, sector: Cyclic | None = None) -> None:
        self._folder, self._space, self._sector = folder, space, sector
        self._parts: dict[str, Part] = {}
        self._told: dict[str, dict[float, str]] = {}
        if space.share.rank == 0:
            self._told = {path.stem: read_pvd(path) for path in collections_in(folder)}
            for stem, files in self._told.items():
                write_pvd(folder / f"{stem}.pvd", files)

    def write(self, fields: Fields, number: int) -> None:
        """Add the fields after `number` steps. Raises WriteError."""
        solid = _with_data(self._part(SOLID, None), _solid(fields), {})
        self._add(SOLID, solid, fields.time, number)
        if self._sector is not None:
            self._add(RING, ring_of(solid, self._sector), fields.time, number)
        if self._space.share.rank > 0:  # the first process has all of the skins
            return
        for name, stem in contact_stems(fields.zones).items():
            zone = fields.zones[name]
            faces = _with_data(self._part(stem, zone), _nodal(zone, fields), _by_face(zone))
            self._add(stem, faces, fields.time, number)

    def _part(self, stem: str, zone: ZoneFields | None) -> Part:
        if stem not in self._parts:
            self._parts[stem] = body(self._space) if zone is None else skin(self._space.mesh, zone.surface)
        return self._parts[stem]

    def _add(self, stem: str, mesh: Mesh, time: float, number: int) -> None:
        """Write the VTU of a time, and then the PVD that names it."""
        share, file = self._space.share, vtu_file(stem, number)
        make_folder(self._folder / FIELDS)
        if share.size > 1 and stem == SOLID:
            file = _write_pieces(self._folder, stem, number, mesh, share)
        else:
            write(self._folder / file, mesh, compress=True)
        if share.rank > 0:
            return
        files = self._told.setdefault(stem, {})
        files[float(time)] = file
        write_pvd(self._folder / f"{stem}.pvd", files)


def _with_data(part: Part, nodal: Mapping[str, NDArray], by_cell: Mapping[str, NDArray]) -> Mesh:
    """Return the mesh of a part with values on all nodes and cells of the whole."""
    return replace(
        part.mesh,
        node_data={**part.mesh.node_data, **{name: values[part.nodes] for name, values in nodal.items()}},
        cell_data={**part.mesh.cell_data, **{name: values[part.cells] for name, values in by_cell.items()}},
    )


def _write_pieces(folder: Path, stem: str, number: int, mesh: Mesh, share: Share) -> str:
    """Write the piece of each process and, once all are there, the PVTU file; return its name, as a PVD has it.

    The pieces have the same arrays. Raises WriteError.
    """
    own = folder / vtu_file(stem, number, share.rank)
    failed: Exception | None = None
    try:
        write(own, mesh, compress=True)
    except Exception as error:
        failed = error
    share.agree(failed)
    file = str(Path(vtu_file(stem, number)).with_suffix(".pvtu"))
    names = [Path(vtu_file(stem, number, rank)).name for rank in range(share.size)]
    share.on_first(lambda: replace_file(folder / file, _collection_of(own, names).encode()))
    return file


def _collection_of(piece: Path, names: list[str]) -> str:
    """Return the text of a PVTU file for pieces with the arrays of one of them."""
    with piece.open("rb") as file:
        head = file.read(_HEAD).split(b"<AppendedData")[0].decode()
    version = re.search(r'version="([0-9.]+)"', head)
    lines = ['<?xml version="1.0" encoding="utf-8"?>']
    lines.append(f'<VTKFile type="PUnstructuredGrid" version="{version[1] if version else "1.0"}">')
    lines.append('<PUnstructuredGrid GhostLevel="0">')
    for section, arrays in _SECTION.findall(head):
        lines += [f"<P{section}>", *(f"<PDataArray {array}/>" for array in _ARRAY.findall(arrays)), f"</P{section}>"]
    lines += [f"<Piece Source={quoteattr(name)}/>" for name in names]
    return "\n".join([*lines, "</PUnstructuredGrid>", "</VTKFile>", ""])


def _solid(fields: Fields) -> dict[str, NDArray]:
    moving = {"velocity": fields.velocity, "acceleration": fields.acceleration}
    strain = {} if fields.plastic_strain is None else {"plastic_strain": np.asarray(fields.plastic_strain)}
    return {
        "displacement": wide(fields.displacement, 3),
        "stress": wide(fields.stress, 6),
        "von_mises": von_mises(fields.stress),
        **dict(zip(PRINCIPAL, principal(fields.stress).T, strict=True)),
        "reaction": wide(fields.reaction, 3),
        **{name: wide(values, 3) for name, values in moving.items() if values is not None},
        **strain,
    }


def _nodal(zone: ZoneFields, fields: Fields) -> dict[str, NDArray]:
    shear = {} if zone.shear_recovered is None else {"shear_recovered": wide(zone.shear_recovered, 3)}
    return {
        "displacement": wide(fields.displacement, 3),
        "contact_force": wide(zone.contact_force, 3),
        "pressure_recovered": zone.pressure_recovered,
        **shear,
    }


def _by_face(zone: ZoneFields) -> dict[str, NDArray]:
    reals = {"pressure": zone.pressure, "gap": zone.gap, "coverage": zone.coverage, "normal": wide(zone.normal, 3)}
    reals |= {name: values if values.ndim == 1 else wide(values, 3) for name, values in zone.of_friction.items()}
    fields = {name: on_faces(np.asarray(values, float), zone.macro, np.nan) for name, values in reals.items()}
    whole = {"status": zone.status, "macro": zone.number}
    return fields | {name: on_faces(np.asarray(values, np.int32), zone.macro, -1) for name, values in whole.items()}


def wide(values: Floats, width: int) -> Floats:
    """Return vectors (n, d) with `width` components, zeros appended.

    >>> wide(np.array([[1.0, 2.0]]), 3)
    array([[1., 2., 0.]])
    """
    return np.pad(np.asarray(values, float), ((0, 0), (0, width - values.shape[1])))
