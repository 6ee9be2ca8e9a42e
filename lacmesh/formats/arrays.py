"""A mesh as named arrays on its cells and nodes, for formats that know nothing else (VTU, XDMF, pyvista, meshio).

    group:NAME      0 or 1: membership of a group; groups may overlap, and ParaView can threshold them
    cell_number     the file's numbers of the cells;  node_number: of the nodes
    anything else   the data of the mesh, under its own name: fields, the records of a cut (lac_*), entity, partition

What an array itself cannot hold (a name illegal in the format, rows of several dimensions) goes into the notes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping
from itertools import chain, count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD
from lacmesh.errors import listed
from lacmesh.facts import listed as first_of
from lacmesh.formats.notes import fitting, zone_names
from lacmesh.mesh import Floats, Ints, Mesh, Tag, distinct

GROUP = "group:"
CELL_NUMBER, NODE_NUMBER = "cell_number", "node_number"
#: most tags that an array of integers may have to be tags, and arrays of integers that are no tags
_MOST_TAGS = 1000
_NO_TAGS = frozenset({"vtkGhostType", "vtkOriginalCellIds", "entity", "partition", *CELL_RECORDS})
_NUMBER = {"cell": CELL_NUMBER, "node": NODE_NUMBER}


class Arrays(NamedTuple):
    """Arrays on cells and on nodes, each (n,) or (n, m); `notes`: names and shapes that the arrays cannot hold."""

    cell: dict[str, NDArray]
    node: dict[str, NDArray]
    notes: dict[str, Any]


def to_arrays(mesh: Mesh, said: list[str], tidy: Callable[[str], str] = str) -> Arrays:
    """Numbers, groups and data of a mesh as arrays on cells and nodes; `tidy` makes a name legal in the format.

    Data that cannot be an array of numbers are left out, with a message in `said`.
    """
    parts: dict[str, dict[str, NDArray]] = {}
    notes: dict[str, Any] = {"names": {}, "shapes": {}}
    for on, groups, data, number in (
        ("cell", mesh.cell_groups, mesh.cell_data, mesh.cell_number),
        ("node", mesh.node_groups, mesh.node_data, mesh.node_number),
    ):
        arrays: dict[str, NDArray] = {_NUMBER[on]: np.asarray(number, np.int64)}
        names: dict[str, str] = {}
        for name, members in groups.items():
            inside = np.zeros(len(number), np.uint8)
            inside[members] = 1
            arrays[_unique(GROUP, name, tidy, arrays, names)] = inside
        for name, given in data.items():
            values = _storable(given)
            if values is None:
                said.append(f"data {name!r} ({np.asarray(given).dtype}, shape {np.shape(given)}) are left out")
                continue
            key = _unique("" if not name.startswith(GROUP) else "data:", name, tidy, arrays, names)
            arrays[key] = values
            if np.shape(given)[1:] != values.shape[1:] or np.shape(given)[1:] == (1,):
                notes["shapes"].setdefault(on, {})[key] = list(np.shape(given)[1:])
        if names:
            notes["names"][on] = names
        parts[on] = arrays
    return Arrays(parts["cell"], parts["node"], {key: value for key, value in notes.items() if value})


def _unique(prefix: str, name: str, tidy: Callable[[str], str], taken: Container[str], names: dict[str, str]) -> str:
    """Unused name for an array; if it differs from the prefix and the name, `names` maps it to the original name."""
    key = prefix + tidy(name)
    key = next(k for k in chain([key], (f"{key}_{n}" for n in count(2))) if k and k not in taken)
    if key != prefix + name or prefix == "data:":
        names[key] = name
    return key


def _storable(given: NDArray) -> NDArray | None:
    """Data as native integers or reals, (n,) or (n, m); None if no array of a file can hold them."""
    values = np.asarray(given)
    if values.dtype.kind not in "fiub" or 0 in values.shape[1:]:
        return None
    if values.dtype.kind == "b":
        values = values.astype(np.uint8)
    elif values.dtype.kind == "f" and values.dtype.itemsize not in (4, 8):
        values = values.astype(np.float32 if values.dtype.itemsize < 4 else np.float64)
    if values.dtype.byteorder not in "=|":
        values = values.astype(values.dtype.newbyteorder("="))
    if values.ndim > 2:
        return values.reshape(len(values), int(np.prod(values.shape[1:])))
    return values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values


def from_arrays(
    cell: Mapping[str, NDArray],
    node: Mapping[str, NDArray],
    sizes: tuple[int, int],
    notes: Mapping[str, Any],
    said: list[str],
) -> dict[str, Any]:
    """Fields of a Mesh (numbers, groups, data) from the arrays on its cells and nodes; `sizes`: how many of each.

    Arrays `group:NAME` of integers 0 or 1 become groups; numbers that are not positive and distinct are replaced by
    1, 2 ..., with a message in `said`.
    """
    fields: dict[str, Any] = {}
    for on, arrays, size in (("cell", cell, sizes[0]), ("node", node, sizes[1])):
        names: Mapping[str, str] = notes.get("names", {}).get(on, {})
        shapes: Mapping[str, tuple[int, ...]] = notes.get("shapes", {}).get(on, {})
        groups: dict[str, Ints] = {}
        data: dict[str, NDArray] = {}
        for key, values in arrays.items():
            if key == _NUMBER[on] and values.shape == (size,):
                fields[key] = _numbers(values, on, said)
            elif key.startswith(GROUP) and _is_mark(values):
                groups[names.get(key, key.removeprefix(GROUP))] = np.flatnonzero(values)
            else:
                data[names.get(key, key)] = _shaped(values, shapes.get(key))
        fields[f"{on}_groups"] = groups
        fields[f"{on}_data"] = _sound(data, said)
    return fields


def assembled(
    points: Floats,
    blocks: Mapping[str, Ints],
    place: Ints,
    arrays: tuple[Mapping[str, NDArray], Mapping[str, NDArray]],
    fields: Mapping[str, Any],
    noted: Mapping[str, Any],
    said: list[str],
    groups: Mapping[str, Mapping[str, Ints]] | None = None,
) -> Mesh:
    """Assemble a mesh from points (n, 3), nodes by cell type, and `arrays` on cells and on nodes.

    `place`: for each cell, block after block, its position in the file, which is its row in the arrays on cells.
    `fields`: those read from its notes; `groups`: further ones (on "cell", "node").
    """
    in_order = bool((np.diff(place) > 0).all())
    of_cells, of_nodes = arrays
    rows = {name: values if in_order else values[place] for name, values in of_cells.items()}
    more = {**fields, **from_arrays(rows, of_nodes, (len(place), len(points)), noted, said)}
    if not in_order:
        more["file_order"] = np.argsort(place)
    for on, given in (groups or {}).items():
        more[f"{on}_groups"] = {**given, **more[f"{on}_groups"]}
    if not noted and not more["cell_groups"] and CELL_NUMBER not in of_cells:  # lacmesh writes names of groups
        dims = np.repeat([ALL_CELLS[kind].dim for kind in blocks], [len(nodes) for nodes in blocks.values()])
        more["cell_groups"], more["group_tags"] = groups_of_tags(dims, more["cell_data"], said)
    known = {*more["cell_data"], *more["node_data"]}
    more["steps"] = {key: step for key, step in more.get("steps", {}).items() if key in known}
    if not more.get("zones"):
        more["zones"] = zone_names(more["cell_data"], more["cell_groups"])
    return fitting(Mesh.create(points, blocks.items(), **more))


def groups_of_tags(
    dims: Ints, data: Mapping[str, NDArray], said: list[str]
) -> tuple[dict[str, Ints], dict[str, tuple[Tag, ...]]]:
    """Return groups of cells that have the same tag, an integer >= 0, and the dimension and tag of each group.

    `dims` (n,): dimensions of the cells; `data`: arrays on them, of which those of few integers are tags. A group has
    its number as its name; `2:5`, its dimension and number, where others have that number too.

    >>> said = []
    >>> groups_of_tags(np.array([3, 3, 2]), {"tags": np.array([1, 1, 7]), "size": np.array([0.5, 1, 2])}, said)[1]
    {'7': ((2, 7),), '1': ((3, 1),)}
    >>> said
    ["no group has a name in this file: the tags 'tags' are groups, named by their numbers (7, 1)"]
    """
    found: list[tuple[str, Tag, Ints]] = []
    for array, values in data.items():
        if values.shape != dims.shape or values.dtype.kind not in "iu" or array in _NO_TAGS:
            continue
        least = 1 if ":" in array else 0  # 0 is no tag in the formats of meshio: medit:ref, nastran:ref, su2:tag
        tags = np.unique(np.stack([dims, values], axis=1)[values >= least], axis=0)
        if len(tags) <= min(_MOST_TAGS, max(1, len(dims) // 2)):
            found += [(array, (d, t), np.flatnonzero((dims == d) & (values == t))) for d, t in tags.tolist()]
    of_number = Counter(tag for _, (_, tag), _ in found)
    of_tag = Counter(tag for _, tag, _ in found)
    groups, group_tags = dict[str, Ints](), dict[str, tuple[Tag, ...]]()
    for array, tag, cells in found:
        name = (
            str(tag[1]) if of_number[tag[1]] == 1 else f"{tag[0]}:{tag[1]}" if of_tag[tag] == 1 else f"{array} {tag[1]}"
        )
        groups[name] = cells
        if of_tag[tag] == 1 and tag[1] > 0:
            group_tags[name] = (tag,)
    if found:
        arrays = listed([repr(array) for array in dict.fromkeys(array for array, _, _ in found)], "and")
        message = f"no group has a name in this file: the tags {arrays} are groups, named by their numbers"
        said.append(f"{message} ({first_of(groups, 10)})")
    return groups, group_tags


def _is_mark(values: NDArray) -> bool:
    if values.ndim != 1 or values.dtype.kind not in "iu":
        return False
    return not len(values) or (values.min() >= 0 and values.max() <= 1)


def _numbers(values: NDArray, on: str, said: list[str]) -> Ints:
    numbers = _integers(values)
    if numbers is not None and (not len(numbers) or (numbers.min() > 0 and distinct(numbers))):
        return numbers.astype(np.int64)
    said.append(f"{on}s are counted from 1: {_NUMBER[on]} is not positive and distinct")
    return np.arange(1, len(values) + 1)


def _integers(values: NDArray) -> Ints | None:
    """Values as integers, also if a tool stored them as reals; None if some are not integers."""
    if values.dtype.kind in "iu":
        return None if values.dtype == np.uint64 and len(values) and values.max() >= 2**63 else values
    if values.dtype.kind != "f" or not np.isfinite(values).all():
        return None
    whole = np.rint(values)
    return values.astype(np.int64) if (whole == values).all() and (np.abs(whole) < 2.0**53).all() else None


def _shaped(values: NDArray, shape: tuple[int, ...] | None) -> NDArray:
    """Reshape the rows of an array as the notes say, if its size allows."""
    if shape is None or any(n <= 0 for n in shape):
        return values
    fits = int(np.prod([len(values), *shape], dtype=object)) == values.size
    return values.reshape(len(values), *shape) if fits else values


def _sound(data: dict[str, NDArray], said: list[str]) -> dict[str, NDArray]:
    """Convert data with names that lacmesh reserves to integers, or rename them if they do not fit that meaning."""
    sound: dict[str, NDArray] = {}
    for name, values in data.items():
        reserved = name in ("entity", NODE_RECORD, *CELL_RECORDS)
        whole = _integers(values) if reserved else None
        if not reserved:
            sound[name] = values
        elif whole is None or (values.shape[1:] != ((2,) if name == "entity" else ())):
            said.append(f"data {name!r} are not what lacmesh means by that name: they are {name + '_'!r} now")
            sound[name + "_"] = values
        else:
            sound[name] = values if values.dtype.kind == "i" else whole.astype(np.int64)
    return sound


def merged(parts: Iterable[tuple[Mapping[str, NDArray], int]], said: list[str], what: str) -> dict[str, NDArray]:
    """Concatenate the arrays of several pieces (arrays, size); a piece that lacks one gets NaN, -1, or 0 in a group.

    An array whose pieces have different widths is left out, with a message in `said`.
    """
    parts = list(parts)
    names = dict.fromkeys(name for arrays, _ in parts for name in arrays)
    result: dict[str, NDArray] = {}
    for name in names:
        given = [arrays[name] for arrays, _ in parts if name in arrays]
        if len({a.shape[1:] for a in given}) > 1:
            said.append(f"{what} data {name!r} have other widths in other pieces: they are left out")
            continue
        dtype = np.result_type(*given)
        if len(given) < len(parts) and dtype.kind == "u" and not name.startswith(GROUP):
            dtype = np.result_type(dtype, np.int8) if dtype.itemsize < 8 else np.dtype(np.int64)
        blank = 0 if name.startswith(GROUP) else np.nan if dtype.kind == "f" else -1
        shape = given[0].shape[1:]
        result[name] = np.concatenate(
            [
                np.asarray(arrays[name], dtype) if name in arrays else np.full((size, *shape), blank, dtype)
                for arrays, size in parts
            ]
        )
    return result
