"""Fields of a finished run for Salome: results.med, with the mesh and the fields of every time that was written.

They are the data of the mesh, with a step for each time, as `lacmesh.formats.med` writes them. Names are those of
code_aster where it has one: DEPL, SIEF_NOEU, REAC_NODA, SIEQ_NOEU with VMIS and with PRIN_1 to PRIN_3, which ascend,
and of metals that yield VARI_NOEU with the component V1, the accumulated plastic strain; the names of a zone's fields
begin with its name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError
from lacmesh.formats import write
from lacmesh.formats.hdf5 import image, set_attributes
from lacmesh.formats.med_fields import title
from lacmesh.formats.output import replacing
from lacmesh.model import Step
from lacsolver.output.names import MED
from lacsolver.output.parts import Part, on_faces, whole
from lacsolver.output.states import StoredFields
from lacsolver.results.nodal import principal, von_mises
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.space.space import COMPONENTS

_AXES = "XYZ"
#: bytes of a component's name
_SHORT = 16
#: longest suffix to the name of a zone
_LONGEST = "pressure_recovered.nodes"


class _Field(NamedTuple):
    """A field at one time: name, components, and values (n, ...) on the nodes, or else the cells, of the mesh."""

    name: str
    components: tuple[str, ...]
    values: NDArray
    on_cells: bool = False


def write_med(folder: Path, path: Path | None = None) -> Path:
    """Write the mesh and the fields of a run's folder into a file, `results.med` in it by default; return its path.

    An existing file is replaced at the end. Raises ReadError, RequestError for a folder without fields, WriteError.
    """
    path = path or folder / MED
    stored = StoredFields(folder)
    if not stored.times:
        raise RequestError(f"{folder} holds no fields to export; run the case again")
    part = whole(stored.mesh)
    data = dict(part.mesh.node_data), dict(part.mesh.cell_data)
    steps: dict[str, Step] = {}
    components: dict[str, tuple[str, ...]] = {}
    for k, (time, number) in enumerate(zip(stored.times, stored.numbers, strict=True)):
        fields = list(_fields(stored.read(k), part))
        for link, field in zip(_names(path, [one.name for one in fields]), fields, strict=True):
            data[field.on_cells][f"{link}@{k}"] = field.values
            steps[f"{link}@{k}"] = Step(link, number, -1, float(time))
            components[link] = field.components
    name = title(path, part.mesh.name or "mesh", "mesh", [])
    with replacing(path) as (beside,):
        write(beside, replace(part.mesh, name=name, node_data=data[0], cell_data=data[1], steps=steps))
        with image(beside, beside) as root:
            for link, names in components.items():
                set_attributes(root["CHA"][link], NOM="".join(one[:_SHORT].ljust(_SHORT) for one in names))
    return path


def check_names(folder: Path, zones: Iterable[str]) -> None:
    """Raise WriteError for a zone whose name is too long for MED."""
    _names(folder / MED, [f"{zone}.{_LONGEST}" for zone in zones])


def _names(path: Path, names: Iterable[str]) -> list[str]:
    """Return the names of fields in the file, adapted to MED. Raises WriteError for a name that is too long."""
    titles: list[str] = []
    for name in names:
        titles.append(title(path, name, "field", [], titles))
    return titles


def _fields(fields: Fields, part: Part) -> Iterator[_Field]:
    axes = _AXES[: fields.displacement.shape[1]]
    stresses = tuple(f"SI{name.upper()}" for name in COMPONENTS[: fields.stress.shape[1]])
    of_size = np.column_stack([von_mises(fields.stress), principal(fields.stress)[:, ::-1]])  # ascending: code_aster's
    moves = tuple(f"D{a}" for a in axes)
    yield _Field("DEPL", moves, fields.displacement)
    yield _Field("SIEF_NOEU", stresses, fields.stress)
    yield _Field("SIEQ_NOEU", ("VMIS", "PRIN_1", "PRIN_2", "PRIN_3"), of_size)
    yield _Field("REAC_NODA", moves, fields.reaction)
    for name, values in (("VITE", fields.velocity), ("ACCE", fields.acceleration)):
        if values is not None:
            yield _Field(name, moves, values)
    if fields.plastic_strain is not None:
        yield _Field("VARI_NOEU", ("V1",), np.asarray(fields.plastic_strain))
    for name, zone in fields.zones.items():
        yield from _zone_fields(name, zone, part, moves)


def _zone_fields(name: str, zone: ZoneFields, part: Part, moves: tuple[str, ...]) -> Iterator[_Field]:
    on_macros = {"pressure": zone.pressure, "pressure_recovered": zone.recovered, "gap": zone.gap}
    on_macros |= {"coverage": zone.coverage, **zone.of_friction, "status": np.asarray(zone.status, np.int32)}
    for what, values in on_macros.items():
        missing = -1 if what == "status" else np.nan
        on_cells = np.full((part.mesh.n_cells, *values.shape[1:]), missing, values.dtype)
        on_cells[zone.surface.cell] = on_faces(values, zone.macro, missing)
        yield _Field(f"{name}.{what}", (what,) if values.ndim == 1 else moves, on_cells[part.cells], on_cells=True)
    yield _Field(f"{name}.contact_force", moves, zone.contact_force)
    yield _Field(f"{name}.{_LONGEST}", ("pressure",), zone.pressure_recovered)
    if zone.shear_recovered is not None:
        yield _Field(f"{name}.shear_recovered.nodes", moves, zone.shear_recovered)
