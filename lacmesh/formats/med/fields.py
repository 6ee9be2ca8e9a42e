"""Fields of a MED file: values on nodes and cells, one array a step.

A field is a group under CHA, with a group for each step, in it one for each support (NOE, MAI.TE4 ...), in that one for
each profile (the numbers, from 1, of the nodes or cells that have a value), and the values, component by component.
MED 2.3 puts the support above the step, and the mesh's name in place of the profile's.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from functools import reduce
from itertools import chain, count
from operator import or_
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import WriteError
from lacmesh.formats.med.hdf5 import (
    Branch,
    Name,
    add_array,
    add_group,
    compact,
    encoded,
    set_attributes,
    set_mask,
    text,
)
from lacmesh.formats.med.types import MedType
from lacmesh.formats.slices import RowRange
from lacmesh.mesh import Ints, Mesh, Step

NO_PROFILE = "MED_NO_PROFILE_INTERNAL"
#: MED's numbers of the kinds of values, and the bits of cells and nodes in the mask LEN.
_KINDS = {"float64": 6, "int32": 24, "int64": 26}
_CELLS, _NODES = 1, 8
#: A support to write on: its name, the bit of its type, the indices in the mesh of its nodes or cells.
_Support = tuple[str, int, Ints]
#: Entries of a profile that are read at a time.
_PIECE = 1 << 18
#: Bytes of the name of a field, of a mesh; of a component.
_NAME_SIZE, _SHORT = 64, 16


class Support(NamedTuple):
    """Nodes, or cells of one type, that are read: their `rows` among all in the file, the `first` one's index here."""

    rows: RowRange
    first: int


#: values of one field at one step, which has no name, on one support: the step, the support, the profile, the values
_Leaf = tuple[Step, str, Name, Branch]


class Data(NamedTuple):
    """Fields of a file as `Mesh.cell_data`, `node_data` and `steps`."""

    cell_data: dict[str, NDArray]
    node_data: dict[str, NDArray]
    steps: dict[str, Step]


def read(root: Branch, mesh: Name, supports: Mapping[str, Support], sizes: Mapping[str, int], said: list[str]) -> Data:
    """Read the fields on nodes and cells of the mesh, or on those of a slice of it.

    `supports`: by the names of the file; `sizes`: numbers of nodes (NOE) and cells (MAI) that are read.
    What lies elsewhere (nodes of each cell, Gauss points) is named in `said`. Raises ReadError.
    """
    data = Data({}, {}, {})
    left = []
    for name, field in root.branch("CHA").branches() if root.has("CHA") else ():
        arrays, whole = _field(root, field, mesh, supports, sizes)
        if not whole:
            left.append(text(name))
        times = sorted({step for _, step in arrays}, key=lambda s: (s.number, s.order))
        for (where, step), values in arrays.items():
            key = text(name) if len(times) == 1 else f"{text(name)}@{times.index(step)}"
            (data.node_data if where == "NOE" else data.cell_data)[key] = values
            if len(times) > 1 or step != Step("", -1, -1, 0.0):
                data.steps[key] = Step(text(name), step.number, step.order, step.time)
    if left:
        said.append(
            "values at Gauss points, at the nodes of each cell or on cells that are not there are left out, "
            f"of {', '.join(left[:8])}" + (f" and {len(left) - 8} more" if len(left) > 8 else "")
        )
    return data


def _field(
    root: Branch, field: Branch, mesh: Name, supports: Mapping[str, Support], sizes: Mapping[str, int]
) -> tuple[dict[tuple[str, Step], NDArray], bool]:
    """Values of a field on all nodes or cells, by (NOE or MAI, step); and False if some of its values are left out."""
    width = field.integer("NCO")
    pieces: dict[tuple[str, Step], list[tuple[Ints, NDArray]]] = {}
    whole = at_cells = True
    for step, support, profile, branch in _leaves(field, mesh):
        if support not in supports or branch.integer("NGA", 1) != 1:
            whole = False
            at_cells = at_cells and support not in supports
            continue
        if width < 1:
            raise field.error(f"has {width} components")
        where = "NOE" if support == "NOE" else "MAI"
        there = pieces.setdefault((where, step), [])
        there += _values(root, profile, branch, supports[support], width)
    return {
        (where, step): _assembled(field, part, sizes[where], width)
        for (where, step), part in pieces.items()
        if where == "NOE" or at_cells
    }, whole


def _leaves(field: Branch, mesh: Name) -> Iterator[_Leaf]:
    for outer, child in field.branches():
        if child.has_attribute("NDT"):
            if field.string("MAI") != text(mesh):
                return
            when = _step(child)
            for support, inside in child.branches():
                for profile, branch in inside.branches():
                    yield when, text(support), profile, branch
        else:
            for _, step in child.branches():
                if step.has(mesh):
                    branch = step.branch(mesh)
                    yield _step(step), text(outer), branch.string("PFL"), branch


def _step(group: Branch) -> Step:
    """The step of a group of values, without a name."""
    return Step("", group.integer("NDT"), group.integer("NOR", -1), group.real("PDT", 0.0))


def _values(
    root: Branch, profile: Name, branch: Branch, support: Support, width: int
) -> Iterator[tuple[Ints, NDArray]]:
    """Yield the indices of nodes or cells that are read, and their values (k, width)."""
    rows, first = support
    if text(profile) in ("", NO_PROFILE):
        values = branch.numbers("CO", rows.size * width, rows)
        yield first + np.arange(rows.n), values.reshape(width, -1).T
        return
    home = _profile(root, profile)
    size = home.count("PFL", "iu")
    for start in range(0, max(size, 1), _PIECE):
        piece = RowRange(start, min(start + _PIECE, size), size)
        place = home.integers("PFL", None, piece).astype(np.int64) - 1
        if len(place) and (place.min() < 0 or place.max() >= rows.size):
            raise home.error(f"holds a number outside 1..{rows.size}", "PFL")
        values = branch.numbers("CO", size * width, piece).reshape(width, -1).T
        ours = (place >= rows.start) & (place < rows.stop)
        yield first + place[ours] - rows.start, values[ours]


def _profile(root: Branch, name: Name) -> Branch:
    """The group of a profile: the numbers, from 1, of the rows that have a value."""
    homes = root.branch("PROFILS")
    if not homes.has(name):  # MED 2.3 may fill up the link, or the name of it, with blanks
        name = next((n for n in homes.names() if text(n) == text(name)), name)
    return homes.branch(name)


def _assembled(field: Branch, parts: list[tuple[Ints, NDArray]], size: int, width: int) -> NDArray:
    """Join parts into an array (size,) or (size, width): NaN, or -1 in integers, where no part has a value."""
    kinds = [values.dtype for _, values in parts]
    whole = all(k.kind in "iu" for k in kinds)
    kind = np.dtype(float) if not whole else np.dtype(np.int32 if max(k.itemsize for k in kinds) <= 4 else np.int64)
    field.check_room(size * width * kind.itemsize)
    array = np.full((size, width), -1 if whole else np.nan, kind)
    for rows, values in parts:
        array[rows] = values
    return array[:, 0] if width == 1 else array


class _Part(NamedTuple):
    """One array to write: on nodes or cells, (n, width)."""

    nodes: bool
    step: Step
    values: NDArray


def write(root: h5py.Group, mesh: Mesh, name: str, cells: Sequence[tuple[MedType, Ints]], said: list[str]) -> None:
    """Write all data of a mesh that is called `name` in the file.

    `cells`: the types in the file, with the indices of their cells in the order of the file. Rows without a value (NaN,
    or -1 in integers) are left out through a profile. Raises WriteError for a name that MED cannot hold.
    """
    fields = _fields(root.file.filename, mesh, said)
    if not fields:
        return
    supports: dict[bool, list[tuple[str, int, Ints]]] = {
        True: [("NOE", 1, np.arange(mesh.n_nodes))],
        False: [(f"MAI.{kind.name}", 1 << kind.bit, rows) for kind, rows in cells],
    }
    home = add_group(root, "CHA")
    profiles: dict[bytes, str] = {}
    for title, parts in fields.items():
        _write_field(home, title, name, parts, supports, profiles)
    home = add_group(root, "PROFILS") if profiles else home
    for content, profile in profiles.items():
        numbers = np.frombuffer(content, np.int64)
        add_array(add_group(home, profile, NBR=len(numbers)), "PFL", compact(numbers))


def _fields(path: str, mesh: Mesh, said: list[str]) -> dict[str, list[_Part]]:
    """Arrays by the field's name in the file; arrays that share name, width and type of number make one field."""
    alike: dict[tuple[str, str, int], list[_Part]] = {}
    for nodes, data in ((False, mesh.cell_data), (True, mesh.node_data)):
        for key, given in data.items():
            values = _storable(given)
            if values is None:
                said.append(f"data {key!r} ({np.asarray(given).dtype}, {np.shape(given)}) are left out")
                continue
            if np.ndim(given) > 2:
                said.append(f"data {key!r} of shape {np.shape(given)} are written with {values.shape[1]} components")
            step = mesh.steps.get(key, Step(key))
            parts = alike.setdefault((step.field, values.dtype.kind, values.shape[1]), [])
            if any(p.nodes == nodes and (p.step.number, p.step.order) == (step.number, step.order) for p in parts):
                said.append(f"data {key!r} are left out, other data stand at the same step of field {step.field!r}")
            else:
                parts.append(_Part(nodes, step, values))
    fields: dict[str, list[_Part]] = {}
    for (field, _, _), parts in alike.items():
        fields[title(path, field, "field", said, fields)] = parts
    return fields


def _storable(given: NDArray) -> NDArray | None:
    """Data as (n, width) of float64, int32 or int64; None if no field can hold them."""
    values = np.asarray(given)
    if values.dtype.kind not in "fiub" or not values.size or (values.dtype == np.uint64 and values.max() >= 2**63):
        return None
    values = values.reshape(len(values), -1)
    return values.astype(float, copy=False) if values.dtype.kind == "f" else compact(values.astype(np.int64))


def title(path: Any, name: str, what: str, said: list[str], taken: Container[str] = ()) -> str:
    """Name that an HDF5 link and libmed can hold, and that is not `taken`. Raises WriteError if it is too long."""
    link = name.replace("/", "_").replace("\0", "_").rstrip(" ")
    link = link if link.strip(".") else f"{link}_"
    link = next(t for t in chain([link], (f"{link}_{k}" for k in count(2))) if t not in taken)
    if len(encoded(link)) > _NAME_SIZE:
        raise WriteError(path, f"MED names are of {_NAME_SIZE} bytes at most; shorten the name of {what} {name!r}")
    if link != name:
        said.append(f"{what} {name!r} is written as {link!r}")
    return link


def _write_field(
    home: h5py.Group,
    name: str,
    mesh: str,
    parts: list[_Part],
    supports: Mapping[bool, list[_Support]],
    profiles: dict[bytes, str],
) -> None:
    width = parts[0].values.shape[1]
    kind = np.result_type(*(part.values for part in parts))
    blank = " " * (_SHORT * width)
    field = add_group(home, name, MAI=mesh, NCO=width, TYP=_KINDS[kind.name], NOM=blank, UNI=blank, UNT="")
    used = []
    for number, order in sorted({(p.step.number, p.step.order) for p in parts}):
        if max(number, order) >= 2**31 or min(number, order) < -(2**31):
            raise WriteError(
                home.file.filename, f"the field {name!r} has step {number}, {order}: MED has 32 bits for them"
            )
        here = [p for p in parts if (p.step.number, p.step.order) == (number, order)]
        link = f"{number:020d}{order:020d}"
        step = add_group(field, link, NDT=number, NOR=order, PDT=float(here[0].step.time), RDT=-1, ROR=-1)
        used.append({p.nodes: _write_part(step, p, kind, supports[p.nodes], profiles) for p in here})
        _set_masks(step, used[-1])
    types = {nodes: reduce(or_, (u.get(nodes, 0) for u in used)) for u in used for nodes in u}
    _set_masks(field, types)
    set_attributes(field, LAA=sum(u.keys() == types.keys() for u in used))
    for nodes, mask in types.items():
        set_attributes(field, **{"LNA" if nodes else "LCA": sum(u.get(nodes) == mask for u in used)})


def _set_masks(holder: h5py.Group, used: Mapping[bool, int]) -> None:
    """Set the masks of a field or step that libmed 4.1 reads first: its entities (LEN) and their types (LGC, LGN).

    A field also has the number of its steps that have all of these (LAA, LCA, LNA; seen in files of medcoupling).
    """
    set_mask(holder, "LEN", sum(_NODES if nodes else _CELLS for nodes in used))
    for nodes, types in used.items():
        set_mask(holder, "LGN" if nodes else "LGC", types)


def _write_part(
    step: h5py.Group, part: _Part, kind: np.dtype, supports: list[_Support], profiles: dict[bytes, str]
) -> int:
    """Write the rows that have a value, or all if none has; return the mask of the types written."""
    values = part.values
    present = ~(np.isnan(values) if kind.kind == "f" else values == -1).all(axis=1)
    if not present.any():
        present[:] = True
    mask = 0
    for support, bit, rows in supports:
        places = np.flatnonzero(present[rows])
        if len(places):
            profile = NO_PROFILE
            if len(places) < len(rows):
                profile = profiles.setdefault((places + 1).tobytes(), f"PROFILE_{len(profiles) + 1}")
            leaf = add_group(add_group(step, support, GAU="", PFL=profile), profile, GAU="", NBR=len(places), NGA=1)
            add_array(leaf, "CO", values[rows[places]].T.astype(kind).reshape(-1))
            mask |= bit
    return mask
