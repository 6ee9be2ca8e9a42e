"""Fields of a finished run for Salome: results.med, with the mesh and the fields of every time that was written.

MED stores fields by name, and each field by time. A zone's fields on faces are defined on its slave faces only, by a
profile. The layout is that of MED 4.1 (`lacmesh.formats.med`); names are those of
code_aster where it has one: DEPL, SIEF_NOEU, REAC_NODA, SIEQ_NOEU with VMIS and with PRIN_1 to PRIN_3, which ascend,
and of metals that yield VARI_NOEU with the component V1, the accumulated plastic strain; the names of a zone's fields
begin with its name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import reduce
from operator import or_
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError
from lacmesh.formats import write
from lacmesh.formats.hdf5 import add_array, add_group, image, set_attributes, set_mask
from lacmesh.formats.med_fields import NO_PROFILE, title
from lacmesh.formats.orders import MED_CELLS
from lacmesh.formats.output import replacing
from lacmesh.mesh import Ints, places_of
from lacsolver.output.names import MED
from lacsolver.output.parts import Part, on_faces, whole
from lacsolver.output.states import StoredFields
from lacsolver.results.nodal import principal, von_mises
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.space.space import COMPONENTS

_AXES = "XYZ"
#: MED's codes of types of values; bits of cells and nodes in the mask LEN; bytes of a component's name
_KINDS = {"float64": 6, "int32": 24}
_CELLS, _NODES, _SHORT = 1, 8, 16
#: longest suffix to the name of a zone
_LONGEST = "pressure_recovered.nodes"


class _Support(NamedTuple):
    """Entities that carry values: MED's name and bit, the rows of the values, and the entities' indices (None: all)."""

    name: str
    bit: int
    rows: Ints
    places: Ints | None


class _Field(NamedTuple):
    """A field at one time: name, components, `nodes` (else cells), values (n, m), and the entities that carry them."""

    name: str
    components: tuple[str, ...]
    nodes: bool
    values: NDArray
    supports: tuple[_Support, ...]


def write_med(folder: Path, path: Path | None = None) -> Path:
    """Write the mesh and the fields of a run's folder into a file, `results.med` in it by default; return its path.

    An existing file is replaced at the end. Raises ReadError, RequestError for a folder without fields, WriteError.
    """
    path = path or folder / MED
    stored = StoredFields(folder)
    if not stored.times:
        raise RequestError(f"{folder} holds no fields to export; run the case again")
    part = whole(stored.mesh)
    name = title(path, part.mesh.name or "mesh", "mesh", [])
    part = part._replace(mesh=replace(part.mesh, name=name))
    with replacing(path) as (beside,):
        write(beside, part.mesh)
        with image(beside, beside) as root:
            for k, (time, number) in enumerate(zip(stored.times, stored.numbers, strict=True)):
                series = list(_fields(stored.read(k), part))
                for link, field in zip(_names(path, [one.name for one in series]), series, strict=True):
                    _add_time(root, _home(root, link, name, field), field, time, number)
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
    everywhere = (_Support("NOE", 1, np.arange(len(part.nodes)), None),)
    axes = _AXES[: fields.displacement.shape[1]]
    stresses = tuple(f"SI{name.upper()}" for name in COMPONENTS[: fields.stress.shape[1]])
    yield _Field("DEPL", tuple(f"D{a}" for a in axes), True, fields.displacement, everywhere)
    yield _Field("SIEF_NOEU", stresses, True, fields.stress, everywhere)
    of_size = np.column_stack([von_mises(fields.stress), principal(fields.stress)[:, ::-1]])  # ascending: code_aster's
    yield _Field("SIEQ_NOEU", ("VMIS", "PRIN_1", "PRIN_2", "PRIN_3"), True, of_size, everywhere)
    yield _Field("REAC_NODA", tuple(f"D{a}" for a in axes), True, fields.reaction, everywhere)
    for name, values in (("VITE", fields.velocity), ("ACCE", fields.acceleration)):
        if values is not None:
            yield _Field(name, tuple(f"D{a}" for a in axes), True, values, everywhere)
    if fields.plastic_strain is not None:
        yield _Field("VARI_NOEU", ("V1",), True, np.asarray(fields.plastic_strain), everywhere)
    for name, zone in fields.zones.items():
        yield from _zone_fields(name, zone, part, everywhere, axes)


def _zone_fields(
    name: str, zone: ZoneFields, part: Part, everywhere: tuple[_Support, ...], axes: str
) -> Iterator[_Field]:
    faces = tuple(_face_supports(zone, part))
    for what, values in (
        ("pressure", zone.pressure),
        ("pressure_recovered", zone.recovered),
        ("gap", zone.gap),
        ("coverage", zone.coverage),
    ):
        yield _Field(f"{name}.{what}", (what,), False, on_faces(np.asarray(values, float), zone.macro, np.nan), faces)
    for what, values in zone.of_friction.items():
        components = (what,) if values.ndim == 1 else tuple(f"D{a}" for a in axes)
        yield _Field(f"{name}.{what}", components, False, on_faces(values, zone.macro, np.nan), faces)
    status = on_faces(np.asarray(zone.status, np.int32), zone.macro, -1)
    yield _Field(f"{name}.status", ("status",), False, status, faces)
    yield _Field(f"{name}.contact_force", tuple(f"D{a}" for a in axes), True, zone.contact_force, everywhere)
    slave = zone.surface.faces.distinct_nodes
    on_slave = (_Support("NOE", 1, slave, slave),)
    yield _Field(f"{name}.{_LONGEST}", ("pressure",), True, zone.pressure_recovered, on_slave)
    if zone.shear_recovered is not None:
        components = tuple(f"D{a}" for a in axes)
        yield _Field(f"{name}.shear_recovered.nodes", components, True, zone.shear_recovered, on_slave)


def _face_supports(zone: ZoneFields, part: Part) -> Iterator[_Support]:
    """Yield the zone's faces, type by type, in the order of the file."""
    place = places_of(part.cells, part.mesh.n_cells)
    where = place[zone.surface.cell]
    rows = np.argsort(where, kind="stable")
    for block, lo in zip(part.mesh.blocks, part.mesh.offsets[:-1], strict=True):
        here = rows[(where[rows] >= lo) & (where[rows] < lo + len(block.nodes))]
        if len(here):
            places = where[here] - lo
            kind = MED_CELLS[block.type]
            yield _Support(f"MAI.{kind.name}", 1 << kind.bit, here, None if len(here) == len(block.nodes) else places)


def _home(root: h5py.Group, name: str, mesh: str, field: _Field) -> h5py.Group:
    """Return the field's group, which is made if it does not exist."""
    fields = root["CHA"] if "CHA" in root else add_group(root, "CHA")
    if name in fields:
        return fields[name]
    blank = " " * (_SHORT * len(field.components))
    names = "".join(component[:_SHORT].ljust(_SHORT) for component in field.components)
    kind = _KINDS[field.values.dtype.name]
    size = len(field.components)
    home = add_group(fields, name, MAI=mesh, NCO=size, TYP=kind, NOM=names, UNI=blank, UNT="")
    _set_masks(home, field)
    return home


def _set_masks(holder: h5py.Group, field: _Field) -> None:
    """Set the masks that libmed 4.1 reads first in a field or time: its entities (LEN) and their types (LGN, LGC)."""
    set_mask(holder, "LEN", _NODES if field.nodes else _CELLS)
    set_mask(holder, "LGN" if field.nodes else "LGC", reduce(or_, (s.bit for s in field.supports), 0))


def _add_time(root: h5py.Group, home: h5py.Group, field: _Field, time: float, number: int) -> None:
    step = add_group(home, f"{number:020d}{-1:020d}", NDT=number, NOR=-1, PDT=float(time), RDT=-1, ROR=-1)
    _set_masks(step, field)
    for support in field.supports:
        profile = NO_PROFILE if support.places is None else _profile(root, support.places)
        inside = add_group(step, support.name, GAU="", PFL=profile)
        leaf = add_group(inside, profile, GAU="", NBR=len(support.rows), NGA=1)
        values = field.values[support.rows].reshape(len(support.rows), -1)
        add_array(leaf, "CO", values.T.reshape(-1))
    _count_times(home, field.nodes)


def _count_times(home: h5py.Group, nodes: bool) -> None:
    """Set the number of times that have all entities of the field, which are all times here."""
    set_attributes(home, **{"LAA": len(home), "LNA" if nodes else "LCA": len(home)})


def _profile(root: h5py.Group, places: Ints) -> str:
    """Return the name of the profile of these entities, which is made if it does not exist."""
    numbers = (places + 1).astype(np.int32 if places.max() < 2**31 - 1 else np.int64)
    name = "places_" + hashlib.sha256(numbers.tobytes()).hexdigest()[:24]
    profiles = root["PROFILS"] if "PROFILS" in root else add_group(root, "PROFILS")
    if name not in profiles:
        add_array(add_group(profiles, name, NBR=len(numbers)), "PFL", numbers)
    return name
