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
from lacmesh.formats import hdf5
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.orders import FormatCell
from lacmesh.mesh import Ints, Mesh, Step

NO_PROFILE = "MED_NO_PROFILE_INTERNAL"
#: MED's numbers of the kinds of values, and the bits of cells and nodes in the mask LEN
_KINDS = {"float64": 6, "int32": 24, "int64": 26}
_CELLS, _NODES = 1, 8
#: bytes of the name of a field, of a mesh; of a component
_NAME_SIZE, _SHORT = 64, 16


class _Values(NamedTuple):
    """Values (k, width) of a field at a step, on the "node"s or "cell"s of some rows, counted from 1."""

    on: str
    step: Step
    rows: Ints
    values: NDArray


def read(root: h5py.File, mesh: hdf5.Name, supports: Mapping[str, range], out: MeshBuilder) -> dict[str, Step]:
    """Add the fields on nodes and cells of a mesh; return the steps of arrays, by their names.

    `supports`: the rows of the nodes (NOE), and of the cells of each type (as MAI.HE8), counted from 1. What lies
    elsewhere (nodes of each cell, Gauss points) is named in a warning. Raises ReadError.
    """
    steps, left = dict[str, Step](), list[str]()
    for link, field in hdf5.groups_in(hdf5.member(root, "CHA")) if "CHA" in root else ():
        name = hdf5.text(link)
        parts, whole = _read_field(root, field, mesh, supports, out)
        if not whole:
            left.append(name)
        times = sorted({part.step for part in parts}, key=lambda step: (step.number, step.order))
        for on, step, rows, array in parts:
            key = name if len(times) == 1 else f"{name}@{times.index(step)}"
            out.values(on, key, rows, array[:, 0] if array.shape[1] == 1 else array)
            if len(times) > 1 or step != Step("", -1, -1, 0.0):
                steps[key] = Step(name, step.number, step.order, step.time)
    if left:
        out.warnings.append(
            "values at Gauss points, at the nodes of each cell or on cells that are not there are left out, "
            f"of {', '.join(left[:8])}" + (f" and {len(left) - 8} more" if len(left) > 8 else "")
        )
    return steps


def _read_field(
    root: h5py.File, field: h5py.Group, mesh: hdf5.Name, supports: Mapping[str, range], out: MeshBuilder
) -> tuple[list[_Values], bool]:
    """Return the values of a field, and False if some are left out: those at Gauss points take all on cells along."""
    width = hdf5.attribute(field, "NCO", int)
    parts, whole, at_cells = list[_Values](), True, True
    for step, support, profile, group in _leaves(field, mesh):
        if support not in supports or hdf5.attribute(group, "NGA", int, 1) != 1:
            whole, at_cells = False, at_cells and support not in supports
            continue
        if width < 1:
            raise hdf5.error_at(field, f"has {width} components")
        on, known = ("node" if support == "NOE" else "cell"), supports[support]
        hdf5.check_room(field, out.size(on) * width * 4)  # where all get a value
        rows: Ints = np.arange(known.start, known.stop)
        if hdf5.text(profile) not in ("", NO_PROFILE):
            rows = known.start - 1 + _profile(root, profile, len(known))
        array = hdf5.values(group, "CO", "iuf", len(rows) * width).reshape(width, len(rows)).T
        kind: Any = float if array.dtype.kind == "f" else np.int32 if array.dtype.itemsize <= 4 else np.int64
        parts.append(_Values(on, step, rows, array.astype(kind, copy=False)))
    return [part for part in parts if part.on == "node" or at_cells], whole


def _leaves(field: h5py.Group, mesh: hdf5.Name) -> Iterator[tuple[Step, str, hdf5.Name, h5py.Group]]:
    """Yield the step, the support and the profile of the values of a field on a mesh, and the group of each."""
    for outer, child in hdf5.groups_in(field):
        if "NDT" in child.attrs:
            if hdf5.attribute(field, "MAI", str, "") != hdf5.text(mesh):
                return
            for support, inside in hdf5.groups_in(child):
                for profile, group in hdf5.groups_in(inside):
                    yield _step(child), hdf5.text(support), profile, group
        else:
            for _, step in hdf5.groups_in(child):
                if mesh in step:
                    group = hdf5.member(step, mesh)
                    yield _step(step), hdf5.text(outer), hdf5.attribute(group, "PFL", str, ""), group


def _step(group: h5py.Group) -> Step:
    number, order = hdf5.attribute(group, "NDT", int), hdf5.attribute(group, "NOR", int, -1)
    return Step("", number, order, hdf5.attribute(group, "PDT", float, 0.0))


def _profile(root: h5py.File, name: hdf5.Name, n: int) -> Ints:
    """Return the numbers, from 1 to n, of the nodes or cells that have a value."""
    homes = hdf5.member(root, "PROFILS")
    if name not in homes:  # MED 2.3 may fill up the link, or the name of it, with blanks
        name = next((link for link, _ in hdf5.groups_in(homes) if hdf5.text(link) == hdf5.text(name)), name)
    home = hdf5.member(homes, name)
    numbers = hdf5.values(home, "PFL", "iu").astype(np.int64)
    if len(numbers) and (numbers.min() < 1 or numbers.max() > n):
        raise hdf5.error_at(home, f"holds a number outside 1..{n}", "PFL")
    return numbers


# ---- writing

#: a support to write on: its name, the bit of its type, the indices in the mesh of its nodes or cells
_Support = tuple[str, int, Ints]


class _Array(NamedTuple):
    """One array to write: on nodes or cells, (n, width)."""

    nodes: bool
    step: Step
    values: NDArray


def write(
    root: h5py.Group, mesh: Mesh, name: str, cells: Sequence[tuple[FormatCell, Ints]], left_out: list[str]
) -> None:
    """Write all data of a mesh that is called `name` in the file.

    `cells`: the types in the file, with the indices of their cells in the order of the file. Rows without a value (NaN,
    or -1 in integers) are left out through a profile. Raises WriteError for a name that MED cannot hold.
    """
    fields = _fields(root.file.filename, mesh, left_out)
    supports: dict[bool, list[_Support]] = {
        True: [("NOE", 1, np.arange(mesh.n_nodes))],
        False: [(f"MAI.{kind.name}", 1 << kind.bit, rows) for kind, rows in cells],
    }
    home = hdf5.add_group(root, "CHA") if fields else root
    profiles: dict[bytes, str] = {}
    for link, arrays in fields.items():
        _write_field(home, link, name, arrays, supports, profiles)
    home = hdf5.add_group(root, "PROFILS") if profiles else home
    for content, profile in profiles.items():
        numbers = np.frombuffer(content, np.int64)
        hdf5.add_array(hdf5.add_group(home, profile, NBR=len(numbers)), "PFL", hdf5.compact(numbers))


def _fields(path: str, mesh: Mesh, left_out: list[str]) -> dict[str, list[_Array]]:
    """Arrays by the field's name in the file; arrays that share name, width and type of number make one field."""
    alike: dict[tuple[str, str, int], list[_Array]] = {}
    for nodes, data in ((False, mesh.cell_data), (True, mesh.node_data)):
        for key, original in data.items():
            array = _storable(original)
            if array is None:
                left_out.append(f"data {key!r} ({np.asarray(original).dtype}, {np.shape(original)}) are left out")
                continue
            if np.ndim(original) > 2:
                left_out.append(
                    f"data {key!r} of shape {np.shape(original)} are written with {array.shape[1]} components"
                )
            step = mesh.steps.get(key, Step(key))
            same = alike.setdefault((step.field, array.dtype.kind, array.shape[1]), [])
            if any(p.nodes == nodes and (p.step.number, p.step.order) == (step.number, step.order) for p in same):
                left_out.append(f"data {key!r} are left out, other data stand at the same step of field {step.field!r}")
            else:
                same.append(_Array(nodes, step, array))
    fields: dict[str, list[_Array]] = {}
    for (field, _, _), arrays in alike.items():
        fields[title(path, field, "field", left_out, fields)] = arrays
    return fields


def _storable(original: NDArray) -> NDArray | None:
    """Data as (n, width) of float64, int32 or int64; None if no field can hold them."""
    array = np.asarray(original)
    if array.dtype.kind not in "fiub" or not array.size or (array.dtype == np.uint64 and array.max() >= 2**63):
        return None
    array = array.reshape(len(array), -1)
    return array.astype(float, copy=False) if array.dtype.kind == "f" else hdf5.compact(array.astype(np.int64))


def title(path: Any, name: str, what: str, left_out: list[str], known: Container[str] = ()) -> str:
    """Name that an HDF5 link and libmed can hold, and that is not `known`. Raises WriteError if it is too long."""
    link = name.replace("/", "_").replace("\0", "_").rstrip(" ")
    link = link if link.strip(".") else f"{link}_"
    link = next(t for t in chain([link], (f"{link}_{k}" for k in count(2))) if t not in known)
    if len(hdf5.encoded(link)) > _NAME_SIZE:
        raise WriteError(path, f"MED names are of {_NAME_SIZE} bytes at most; shorten the name of {what} {name!r}")
    if link != name:
        left_out.append(f"{what} {name!r} is written as {link!r}")
    return link


def _write_field(
    home: h5py.Group,
    name: str,
    mesh: str,
    arrays: list[_Array],
    supports: Mapping[bool, list[_Support]],
    profiles: dict[bytes, str],
) -> None:
    width, kind = arrays[0].values.shape[1], np.result_type(*(one.values for one in arrays))
    blank = " " * (_SHORT * width)
    field = hdf5.add_group(home, name, MAI=mesh, NCO=width, TYP=_KINDS[kind.name], NOM=blank, UNI=blank, UNT="")
    hdf5.make_room(field)
    used = []
    for number, order in sorted({(one.step.number, one.step.order) for one in arrays}):
        if max(number, order) >= 2**31 or min(number, order) < -(2**31):
            message = f"the field {name!r} has step {number}, {order}: MED has 32 bits for them"
            raise WriteError(home.file.filename, message)
        here = [one for one in arrays if (one.step.number, one.step.order) == (number, order)]
        time = float(here[0].step.time)
        step = hdf5.add_group(field, f"{number:020d}{order:020d}", NDT=number, NOR=order, PDT=time, RDT=-1, ROR=-1)
        used.append({one.nodes: _write_array(step, one, kind, supports[one.nodes], profiles) for one in here})
        _set_masks(step, used[-1])
    types = {nodes: reduce(or_, (u.get(nodes, 0) for u in used)) for u in used for nodes in u}
    _set_masks(field, types)
    hdf5.set_attributes(field, LAA=sum(u.keys() == types.keys() for u in used))
    for nodes, mask in types.items():
        hdf5.set_attributes(field, **{"LNA" if nodes else "LCA": sum(u.get(nodes) == mask for u in used)})


def _set_masks(holder: h5py.Group, used: Mapping[bool, int]) -> None:
    """Set the masks of a field or step that libmed 4.1 reads first: its entities (LEN) and their types (LGC, LGN).

    A field also has the number of its steps that have all of these (LAA, LCA, LNA; seen in files of medcoupling).
    """
    hdf5.set_mask(holder, "LEN", sum(_NODES if nodes else _CELLS for nodes in used))
    for nodes, types in used.items():
        hdf5.set_mask(holder, "LGN" if nodes else "LGC", types)


def _write_array(
    step: h5py.Group, one: _Array, kind: np.dtype, supports: list[_Support], profiles: dict[bytes, str]
) -> int:
    """Write the rows that have a value, or all if none has; return the mask of the types written."""
    array, mask = one.values, 0
    present = ~(np.isnan(array) if kind.kind == "f" else array == -1).all(axis=1)
    if not present.any():
        present[:] = True
    for support, bit, rows in supports:
        places = np.flatnonzero(present[rows])
        if len(places):
            profile = NO_PROFILE
            if len(places) < len(rows):
                profile = profiles.setdefault((places + 1).tobytes(), f"PROFILE_{len(profiles) + 1}")
            leaf = hdf5.add_group(
                hdf5.add_group(step, support, GAU="", PFL=profile), profile, GAU="", NBR=len(places), NGA=1
            )
            hdf5.add_array(leaf, "CO", array[rows[places]].T.astype(kind).reshape(-1))
            mask |= bit
    return mask
